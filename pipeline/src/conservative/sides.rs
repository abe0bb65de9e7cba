//! Side tests of a tile over lens and time (Munkberg et al. 2011 in t, extended to u and v), in `f64`.
//!
//! A point of the triangle in the tile at depth `w > 0` is not beyond the left side. The point is a mean of
//! the vertices, so some vertex is not beyond it either: `d = x(t) + u (a w(t) - s) - X0 w(t) >= 0`, bilinear
//! in `u` and `t`. The possible times are the hull over the vertices of the times at which `d` is not
//! negative at one end of `u`; likewise for `u`.

use super::triangle::{ROUNDING, Seen};
use super::{Prepared, Region};
use crate::depth::{Numbers, Real};

/// The part of `region` in which the triangle may be inside the sides of the tile and beyond the near depth,
/// or `None`. `seen` is first given for `region`, then for that part.
pub(super) fn narrow<N: Numbers>(seen: &mut Seen<N>, prepared: &Prepared, region: &Region) -> Option<Region> {
    let part = if seen.view.has_lens() {
        through_lens(seen, prepared, region)?
    } else {
        Region { t: through_pinhole(seen, region.t)?, ..*region }
    };
    let part = beyond_near(seen, prepared, &part)?;
    if part != *region {
        *seen = seen.within(prepared, &part);
    }
    Some(part)
}

/// Test all sides together: each bound is linear in t alone.
fn through_pinhole<N: Numbers>(seen: &Seen<N>, t: [f64; 2]) -> Option<[f64; 2]> {
    let t = t.map(|t| seen.numbers.number(t));
    let mut part = t;
    for axis in [0, 1] {
        for (side, border) in seen.tile[axis].into_iter().enumerate() {
            let inward = |d: N::Number| if side == 0 { d } else { -d };
            let d = [0, 1, 2].map(|k| [0, 1].map(|end| inward(seen.through_pinhole(axis, k, end, border))));
            let zero = N::Number::new(0.0);
            if d.iter().any(|&[opening, closing]| opening >= zero && closing >= zero) {
                continue;
            }
            let times = d.map(|[opening, closing]| above(t, opening, closing, seen.noise[axis]));
            part = meet(part, times.into_iter().fold(None, union)?)?;
        }
    }
    Some(part.map(Real::value))
}

/// Test one side after another: each test uses the part of lens and time left by the previous ones.
fn through_lens<N: Numbers>(seen: &mut Seen<N>, prepared: &Prepared, region: &Region) -> Option<Region> {
    let mut region = *region;
    for (axis, side) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        region = narrow_side(seen, axis, side, &region)?;
        *seen = seen.within(prepared, &region);
    }
    Some(region)
}

fn narrow_side<N: Numbers>(seen: &Seen<N>, axis: usize, side: usize, region: &Region) -> Option<Region> {
    let lens = if axis == 0 { region.u } else { region.v };
    let [lens, t] = [lens, region.t].map(|range| range.map(|end| seen.numbers.number(end)));
    let (inward, border) = (|d: N::Number| if side == 0 { d } else { -d }, seen.tile[axis][side]);
    let (mut times, mut positions) = (None, None);
    for k in 0..3 {
        let d = lens.map(|position| [0, 1].map(|end| inward(seen.from(axis, [k, end], position, border))));
        for [opening, closing] in d {
            times = union(times, above(t, opening, closing, seen.noise[axis]));
        }
        for [at_low, at_high] in [0, 1].map(|end| [d[0][end], d[1][end]]) {
            positions = union(positions, above(lens, at_low, at_high, seen.noise[axis]));
        }
    }
    let mut next = Region { t: times?.map(Real::value), ..*region };
    *if axis == 0 { &mut next.u } else { &mut next.v } = positions?.map(Real::value);
    Some(next)
}

/// The part of `region` in which some vertex is beyond the near depth.
fn beyond_near<N: Numbers>(seen: &Seen<N>, prepared: &Prepared, region: &Region) -> Option<Region> {
    let (near, numbers) = (seen.view.near(), seen.numbers);
    if near == f64::NEG_INFINITY {
        return Some(*region);
    }
    let near = numbers.number(near);
    let (size, unsure) = (numbers.number(prepared.size[2]), numbers.number(prepared.uncertainty()[2]));
    let noise = N::Number::new(ROUNDING) * (size + near.magnitude()) + unsure;
    let t = region.t.map(|t| numbers.number(t));
    let times = (0..3).map(|k| {
        let [open, close] = region.t.map(|t| prepared.coordinate(numbers, [k, 2], t) - near);
        above(t, open, close, noise)
    });
    Some(Region { t: times.fold(None, union)?.map(Real::value), ..*region })
}

/// The part of `range` in which a linear function may be non-negative. It has the values `lo` and `hi` at the
/// ends, each with an error of at most `noise`.
fn above<R: Real>(range: [R; 2], lo: R, hi: R, noise: R) -> Option<[R; 2]> {
    let zero = R::new(0.0);
    // Twice the noise also covers the rounding of the quotient; the nudge covers the mapping to the range.
    let allowance = R::new(2.0) * noise;
    let (lo, hi) = (lo + allowance, hi + allowance);
    let nudge = || R::new(4.0 * f64::EPSILON) * range[0].magnitude().larger(range[1].magnitude());
    let root = || range[0] + (range[1] - range[0]) * (lo / (lo - hi));
    match (lo >= zero, hi >= zero) {
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
            let [from, _] = above(range, -(p as f64), q as f64, 0.0).unwrap();
            assert!(exact(from) * i128::from(p + q) <= root, "{range:?} {p} {q}");
            let [_, to] = above(range, p as f64, -(q as f64), 0.0).unwrap();
            assert!(exact(to) * i128::from(p + q) >= root, "{range:?} {p} {q}");
        }
    }

    #[test]
    fn the_part_that_may_not_be_negative() {
        assert_eq!(above([0.0, 1.0], 0.0, -1.0, 0.0).unwrap()[0], 0.0);
        assert_eq!(above([0.0, 1.0], -1.0, -2.0, 0.25), None);
        assert_eq!(above([0.0, 1.0], -0.5, -0.5, 0.25), Some([0.0, 1.0]));
    }
}
