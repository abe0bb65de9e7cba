//! Side tests of a tile over lens and time (Munkberg et al. 2011 in t, extended to u and v), in `f64`.
//!
//! A point of the triangle in the tile at depth `w > 0` is not beyond the left side. The point is a mean of
//! the vertices, so some vertex is not beyond it either: `d = x(t) + u (a w(t) - s) - X0 w(t) >= 0`, bilinear
//! in `u` and `t`. The possible times are the hull over the vertices of the times at which `d` is not
//! negative at one end of `u`; likewise for `u`.

use super::triangle::{ROUNDING, Seen};
use super::{Prepared, Region, View};
use crate::depth::{Numbers, Real};
use crate::tally::Branches;

/// Test all sides together: each bound is linear in t alone. The times left.
pub(super) fn through_pinhole<N: Numbers>(
    numbers: N,
    seen: &Seen<N::Number>,
    t: [f64; 2],
) -> Option<[f64; 2]> {
    numbers.branch(seen.view.is_perspective());
    let t = t.map(|t| numbers.number(t));
    let mut part = t;
    for axis in [0, 1] {
        for (side, border) in seen.tile[axis].into_iter().enumerate() {
            let inward = |d: N::Number| if side == 0 { d } else { -d };
            let d = [0, 1, 2].map(|k| [0, 1].map(|end| inward(seen.through_pinhole(axis, k, end, border))));
            let zero = N::Number::new(0.0);
            let is_inside = d.iter().any(|&[opening, closing]| opening >= zero && closing >= zero);
            if numbers.branch(is_inside) {
                continue;
            }
            let times = d.map(|[opening, closing]| above(numbers, t, [opening, closing], seen.noise[axis]));
            let met = times.into_iter().fold(None, union).and_then(|times| meet(part, times));
            numbers.branch(met.is_some());
            part = met?;
        }
    }
    Some(part.map(Real::value))
}

/// Test one side: the part of lens and time left.
pub(super) fn through_lens<N: Numbers>(
    numbers: N,
    seen: &Seen<N::Number>,
    (axis, side): (usize, usize),
    region: &Region,
) -> Option<Region> {
    numbers.branch(seen.view.is_perspective());
    let lens = if axis == 0 { region.u } else { region.v };
    let [lens, t] = [lens, region.t].map(|range| range.map(|end| numbers.number(end)));
    let (inward, border) = (|d: N::Number| if side == 0 { d } else { -d }, seen.tile[axis][side]);
    let (mut times, mut positions) = (None, None);
    for k in 0..3 {
        let d = lens
            .map(|position| [0, 1].map(|end| inward(seen.from(numbers, axis, [k, end], [position, border]))));
        for [opening, closing] in d {
            times = union(times, above(numbers, t, [opening, closing], seen.noise[axis]));
        }
        for [at_low, at_high] in [0, 1].map(|end| [d[0][end], d[1][end]]) {
            positions = union(positions, above(numbers, lens, [at_low, at_high], seen.noise[axis]));
        }
    }
    let mut next = Region { t: times?.map(Real::value), ..*region };
    *if axis == 0 { &mut next.u } else { &mut next.v } = positions?.map(Real::value);
    Some(next)
}

/// The part of `region` in which some vertex is beyond the near depth.
pub(super) fn beyond_near<N: Numbers>(
    numbers: N,
    view: &View,
    prepared: &Prepared,
    region: &Region,
) -> Option<Region> {
    let near = numbers.number(view.near());
    let (size, unsure) = (numbers.number(prepared.size[2]), numbers.number(prepared.uncertainty()[2]));
    let noise = N::Number::new(ROUNDING) * (size + near.magnitude()) + unsure;
    let t = region.t.map(|t| numbers.number(t));
    let depths = region.t.map(|t| prepared.at(numbers, [2], t).map(|[depth]| depth - near));
    let times = (0..3).map(|k| above(numbers, t, depths.map(|end| end[k]), noise));
    Some(Region { t: times.fold(None, union)?.map(Real::value), ..*region })
}

/// The part of `range` in which a linear function may be non-negative. It has the values `lo` and `hi` at the
/// ends, each with an error of at most `noise`.
fn above<R: Real>(path: impl Branches, range: [R; 2], [lo, hi]: [R; 2], noise: R) -> Option<[R; 2]> {
    let zero = R::new(0.0);
    // Twice the noise also covers the rounding of the quotient; the nudge covers the mapping to the range.
    let allowance = R::new(2.0) * noise;
    let (lo, hi) = (lo + allowance, hi + allowance);
    let nudge = || R::new(4.0 * f64::EPSILON) * range[0].magnitude().larger(range[1].magnitude());
    let root = || range[0] + (range[1] - range[0]) * (lo / (lo - hi));
    match (path.branch(lo >= zero), path.branch(hi >= zero)) {
        (true, true) => Some(range),
        (false, false) => None,
        (true, false) => Some([range[0], (root() + nudge()).smaller(range[1])]),
        (false, true) => Some([(root() - nudge()).larger(range[0]), range[1]]),
    }
}

/// Intersection of two closed ranges.
fn meet<R: Real>(a: [R; 2], b: [R; 2]) -> Option<[R; 2]> {
    let shared = [a[0].larger(b[0]), a[1].smaller(b[1])];
    (shared[0] <= shared[1]).then_some(shared)
}

fn union<R: Real>(a: Option<[R; 2]>, b: Option<[R; 2]>) -> Option<[R; 2]> {
    match (a, b) {
        (Some(a), Some(b)) => Some([a[0].smaller(b[0]), a[1].larger(b[1])]),
        (a, b) => a.or(b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The exact value in units of 2^-80.
    fn exact(value: f64) -> i128 {
        let bits = value.to_bits();
        let (mantissa, exponent) = (bits & ((1 << 52) - 1) | 1 << 52, (bits >> 52) as i32);
        if value == 0.0 { 0 } else { i128::from(mantissa) << (exponent - 1023 - 52 + 80) }
    }

    /// The root is in the result in exact arithmetic, for ranges of any width.
    #[test]
    fn the_root_is_kept_whatever_is_rounded() {
        for seed in 1..200_000_u64 {
            let bits = crate::random::mix(seed);
            let start = 0.25 + (bits % 1000) as f64 / 3000.0;
            let range = [start, start + 1.0 / (3_u64 << (bits >> 20 & 31)) as f64];
            let (p, q) = ((bits >> 40) % 4096 + 1, (bits >> 52) + 1);
            let (low, high) = (exact(range[0]), exact(range[1]));
            // Times (p + q), where the function is zero.
            let root = low * i128::from(p + q) + (high - low) * i128::from(p);
            let [from, _] = above((), range, [-(p as f64), q as f64], 0.0).unwrap();
            assert!(exact(from) * i128::from(p + q) <= root, "{range:?} {p} {q}");
            let [_, to] = above((), range, [p as f64, -(q as f64)], 0.0).unwrap();
            assert!(exact(to) * i128::from(p + q) >= root, "{range:?} {p} {q}");
        }
    }

    #[test]
    fn the_part_that_may_not_be_negative() {
        assert_eq!(above((), [0.0, 1.0], [0.0, -1.0], 0.0).unwrap()[0], 0.0);
        assert_eq!(above((), [0.0, 1.0], [-1.0, -2.0], 0.25), None);
        assert_eq!(above((), [0.0, 1.0], [-0.5, -0.5], 0.25), Some([0.0, 1.0]));
    }
}
