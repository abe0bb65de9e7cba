//! Separate `u` tests for views over disjoint regions of the lens (Nilsson et al. 2012, section 8): "the separate lens
//! regions could share the tile test for the v-axis, but perform separate tests for the u-axis".
//!
//! Between the regions the lens has no samples. One interval of `u` and `t` over the whole lens has to contain the
//! gaps, and its times are those of all views together. With one interval per region a tile between the views'
//! images of a triangle is culled, and each view keeps its own times.

use super::side_planes::{narrow_sides, union};
use super::{Box5, TileRect};
use crate::geometry::Shear;
use crate::sampling::LensRegion;
use crate::setup::Triangle;
use crate::traversal::number::Number;

/// Part of a region of the lens and its times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensSpan {
    /// Lens positions.
    pub u: [f32; 2],
    /// Times.
    pub t: [f32; 2],
}

impl LensSpan {
    /// Intersection with a box of lens and time, or `None` if it is empty.
    pub fn within(&self, within: &Box5) -> Option<Self> {
        let both = |a: [f32; 2], b: [f32; 2]| [a[0].max(b[0]), a[1].min(b[1])];
        let (u, t) = (both(self.u, within.u), both(self.t, within.t));
        (u[0] <= u[1] && t[0] <= t[1]).then_some(Self { u, t })
    }
}

/// Disjoint spans of `u` that contain all lens positions with samples, from low to high.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensSpans {
    spans: [LensSpan; Self::MAX],
    len: usize,
    /// Total length in `u` before any test.
    length: f32,
}

impl LensSpans {
    /// Largest number of spans. Beyond it, neighbouring regions share one.
    pub const MAX: usize = 8;

    /// Spans of the regions' ranges of `u`. Regions one above the other share a span, as do ranges that overlap.
    /// `None` if fewer than two spans remain: the test over the whole lens is then as good.
    pub fn new(regions: &[LensRegion]) -> Option<Self> {
        let mut ranges: Vec<[f32; 2]> = regions.iter().map(|region| [region.u.0, region.u.1]).collect();
        ranges.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut apart: Vec<[f32; 2]> = Vec::new();
        for [low, high] in ranges {
            match apart.last_mut() {
                Some(last) if low < last[1] => last[1] = last[1].max(high),
                // A position on a common border belongs to the lower span, so no sample is tested twice.
                Some(last) if low == last[1] => apart.push([low.next_up(), high]),
                _ => apart.push([low, high]),
            }
        }
        if apart.len() < 2 {
            return None;
        }
        let length = apart.iter().map(|[low, high]| high - low).sum();
        let whole = LensSpan { u: [0.0; 2], t: [0.0, 1.0] };
        let mut spans = Self { spans: [whole; Self::MAX], len: 0, length };
        for group in apart.chunks(apart.len().div_ceil(Self::MAX)) {
            spans.push(LensSpan { u: [group[0][0], group[group.len() - 1][1]], ..whole });
        }
        Some(spans)
    }

    fn push(&mut self, span: LensSpan) {
        self.spans[self.len] = span;
        self.len += 1;
    }

    /// The spans.
    pub fn as_slice(&self) -> &[LensSpan] {
        &self.spans[..self.len]
    }

    /// The parts inside a box, and the box around them; `None` if nothing remains.
    pub fn within(&self, within: &Box5) -> Option<(Self, Box5)> {
        self.kept(within, |span| span.within(within))
    }

    fn kept(
        &self,
        within: &Box5,
        mut keep: impl FnMut(&LensSpan) -> Option<LensSpan>,
    ) -> Option<(Self, Box5)> {
        let mut kept = Self { len: 0, ..*self };
        let mut hull = None;
        for span in self.as_slice().iter().filter_map(&mut keep) {
            kept.push(span);
            hull = union(hull, Some(span.t));
        }
        let [first, last] = [kept.as_slice().first()?.u, kept.as_slice().last()?.u];
        Some((kept, Box5 { u: [first[0], last[1]], t: hull?, ..*within }))
    }

    /// The parts from which `triangle` may touch `tile`, with the box around them, or `None` if it cannot; and the
    /// multiply-adds. The sides along `v` are tested once, for all spans.
    pub fn narrow_counted<N: Number>(
        &self,
        triangle: &Triangle,
        shear: &Shear,
        tile: &TileRect,
        within: &Box5,
    ) -> (Option<(Self, Box5)>, u32) {
        let mut common = *within;
        let (is_left, mut madds) = narrow_sides::<N, _>(triangle, shear, tile, &mut common, 1);
        if !is_left {
            return (None, madds);
        }
        let kept = self.kept(&common, |span| {
            let LensSpan { u, t } = span.within(&common)?;
            let mut left = Box5 { u, t, ..common };
            let (is_left, more) = narrow_sides::<N, _>(triangle, shear, tile, &mut left, 0);
            madds += more;
            is_left.then_some(LensSpan { u: left.u, t: left.t })
        });
        (kept, madds)
    }

    /// Fraction of the samples that remain in these spans, each with the fraction `of` the shutter.
    pub fn share(&self, of: impl Fn(&LensSpan) -> f64) -> f64 {
        let parts = self.as_slice().iter().map(|span| f64::from(span.u[1] - span.u[0]) * of(span));
        parts.sum::<f64>() / f64::from(self.length)
    }
}

#[cfg(test)]
mod tests {
    use super::super::narrow;
    use super::super::testing::{Uniform, cases};
    use super::*;

    fn region(low: f32, high: f32) -> LensRegion {
        LensRegion { u: (low, high), v: (-1.0, 1.0) }
    }

    fn ranges(regions: &[LensRegion]) -> Vec<[f32; 2]> {
        LensSpans::new(regions).map_or(Vec::new(), |s| s.as_slice().iter().map(|span| span.u).collect())
    }

    #[test]
    fn regions_apart_have_a_span_each_and_others_share_one() {
        let eyes = [region(0.6, 1.0), region(-1.0, -0.6)];
        assert_eq!(ranges(&eyes), [[-1.0, -0.6], [0.6, 1.0]]);
        assert!(ranges(&[LensRegion::WHOLE]).is_empty());
        assert!(ranges(&[region(-1.0, 0.1), region(0.0, 1.0)]).is_empty(), "they overlap in u");
        let adjoining = ranges(&[region(-1.0, 0.0), region(0.0, 1.0)]);
        assert_eq!(adjoining, [[-1.0, 0.0], [0.0_f32.next_up(), 1.0]]);
    }

    #[test]
    fn more_regions_than_spans_share_them_and_none_is_lost() {
        for count in 1..=40_u32 {
            let edge = |k: u32| -1.0 + 2.0 * k as f32 / count as f32;
            let regions: Vec<_> = (0..count).map(|k| region(edge(k), edge(k + 1).min(1.0))).collect();
            let spans = ranges(&regions);
            assert!(spans.len() <= LensSpans::MAX, "{count}");
            assert!(spans.windows(2).all(|pair| pair[0][1] < pair[1][0]), "{count}");
            for place in (0..=1000).map(|k| k as f32 / 500.0 - 1.0) {
                let found = spans.iter().filter(|[low, high]| (low..=high).contains(&&place)).count();
                assert_eq!(found, usize::from(!spans.is_empty()), "{count}: {place}");
            }
        }
    }

    /// Every point of the regions that sees the triangle is kept; and never more than by the test over the whole
    /// lens.
    #[test]
    fn no_view_loses_a_sample_and_none_keeps_more() {
        let eyes = [region(-1.0, -0.5), region(0.5, 1.0)];
        let (mut r, mut culled, mut tighter) = (Uniform::new(14), 0, 0);
        for (seed, case) in cases(600).filter(|(_, case)| case.within.lens) {
            let Some((spans, within)) = LensSpans::new(&eyes).unwrap().within(&case.within) else { continue };
            let (left, _) = spans.narrow_counted::<f64>(&case.triangle, &case.shear, &case.tile, &within);
            let whole = narrow(&case.triangle, &case.shear, &case.tile, &within);
            culled += u32::from(left.is_none() && whole.is_some());
            let volume = |t: [f32; 2], u: [f32; 2]| (t[1] - t[0]) * (u[1] - u[0]);
            if let (Some((spans, _)), Some(whole)) = (&left, &whole) {
                let separate: f32 = spans.as_slice().iter().map(|s| volume(s.t, s.u)).sum();
                let common: f32 = spans
                    .as_slice()
                    .iter()
                    .filter_map(|s| s.within(whole))
                    .map(|s| volume(whole.t, s.u))
                    .sum();
                tighter += u32::from(separate < 0.99 * common);
            }
            for _ in 0..60 {
                let place = case.position(&mut r);
                let (u, t) = (place[2] as f32, place[4] as f32);
                let Some(span) = spans.as_slice().iter().find(|s| (s.u[0]..=s.u[1]).contains(&u)) else {
                    continue;
                };
                let e = case.edges(place);
                let inside = e.iter().all(|&e| e >= 0.0) || e.iter().all(|&e| e <= 0.0);
                let kept = left.is_some_and(|(left, hull)| {
                    let of = |s: &LensSpan| {
                        (s.u[0]..=s.u[1]).contains(&u)
                            && (!case.triangle.moving || (s.t[0]..=s.t[1]).contains(&t))
                    };
                    left.as_slice().iter().any(of) && (hull.u[0]..=hull.u[1]).contains(&u)
                });
                assert!(kept || !inside, "{seed}: {place:?} {span:?} {left:?}");
            }
        }
        assert!(culled > 20 && tighter > 5, "{culled} {tighter}");
    }
}
