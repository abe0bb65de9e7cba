//! Numbers of the tile tests: `f64`, or a number that counts its operations. Quadratics of time in Bernstein form,
//! and the intervals where they are not negative.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::tally::{Branches, Counting};

/// Type of the coordinates, lens positions and times that the tile tests take and return. They compute with a
/// [`Number`] in between.
pub trait Coordinate:
    Copy + PartialOrd + Into<f64> + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
    /// Zero.
    const ZERO: Self;

    /// The value nearest to `value`.
    fn nearest(value: f64) -> Self;
    /// Magnitude.
    fn abs(self) -> Self;
    /// Maximum; the other one if one is NaN.
    fn max(self, other: Self) -> Self;
    /// Minimum; the other one if one is NaN.
    fn min(self, other: Self) -> Self;
    /// The next greater value.
    fn next_up(self) -> Self;
    /// The next smaller value.
    fn next_down(self) -> Self;

    /// Largest one at or below `value`.
    fn at_most(value: f64) -> Self {
        let near = Self::nearest(value);
        if near.into() > value { near.next_down() } else { near }
    }

    /// Smallest one at or above `value`.
    fn at_least(value: f64) -> Self {
        let near = Self::nearest(value);
        if near.into() < value { near.next_up() } else { near }
    }
}

macro_rules! coordinate {
    ($type:ident) => {
        impl Coordinate for $type {
            const ZERO: Self = 0.0;

            #[inline(always)]
            fn nearest(value: f64) -> Self {
                value as Self
            }

            #[inline(always)]
            fn abs(self) -> Self {
                self.abs()
            }

            #[inline(always)]
            fn max(self, other: Self) -> Self {
                self.max(other)
            }

            #[inline(always)]
            fn min(self, other: Self) -> Self {
                self.min(other)
            }

            #[inline(always)]
            fn next_up(self) -> Self {
                self.next_up()
            }

            #[inline(always)]
            fn next_down(self) -> Self {
                self.next_down()
            }
        }
    };
}

coordinate!(f32);
coordinate!(f64);

/// Numbers with the four operations: those of kernels that are run with counting numbers to measure their cost.
pub trait Scalar:
    Copy
    + PartialOrd
    + From<f32>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
}

impl<N> Scalar for N where
    N: Copy
        + PartialOrd
        + From<f32>
        + Add<Output = N>
        + Sub<Output = N>
        + Mul<Output = N>
        + Div<Output = N>
        + Neg<Output = N>
{
}

/// Number type of the kernels of the tile tests. A generic kernel can be run with counting numbers to measure
/// its cost.
pub trait Number: Scalar + Into<f64> {
    /// Magnitude.
    fn abs(self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;

    /// The other one if `takes_other`; a choice is free.
    fn or(self, other: Self, takes_other: bool) -> Self {
        if takes_other { other } else { self }
    }

    /// Maximum; the other one if one is NaN.
    fn max(self, other: Self) -> Self {
        self.or(other, other > self || self.partial_cmp(&self).is_none())
    }

    /// Minimum; the other one if one is NaN.
    fn min(self, other: Self) -> Self {
        self.or(other, other < self || self.partial_cmp(&self).is_none())
    }

    /// A constant.
    fn constant(value: f64) -> Self;

    /// Zero.
    fn zero() -> Self {
        Self::from(0.0)
    }

    /// Work that the modelled unit does although its result is not used. The host need not do it.
    fn unused(work: impl FnOnce()) {
        work();
    }

    /// A coordinate.
    fn of(coordinate: impl Coordinate) -> Self {
        Self::constant(coordinate.into())
    }
}

impl Number for f64 {
    #[inline(always)]
    fn unused(_: impl FnOnce()) {}

    fn constant(value: f64) -> Self {
        value
    }

    fn abs(self) -> Self {
        Self::abs(self)
    }

    fn sqrt(self) -> Self {
        Self::sqrt(self)
    }
}

impl From<f32> for Counting<'_> {
    fn from(value: f32) -> Self {
        Self::constant(f64::from(value))
    }
}

impl From<Counting<'_>> for f64 {
    fn from(counting: Counting<'_>) -> Self {
        counting.value()
    }
}

impl Number for Counting<'_> {
    fn constant(value: f64) -> Self {
        Self::constant(value)
    }

    fn abs(self) -> Self {
        self.with(self.value().abs())
    }

    fn sqrt(self) -> Self {
        self.root()
    }

    fn or(self, other: Self, takes_other: bool) -> Self {
        self.choice(other, takes_other)
    }
}

/// `b0 (1-s)^2 + 2 b1 s (1-s) + b2 s^2` for `s` in [0, 1]. Its values are between the smallest and the
/// largest coefficient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quadratic<N = f64>(pub [N; 3]);

/// Up to two intervals of [0, 1], in order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pieces<N> {
    /// No interval.
    None,
    /// One interval.
    One([N; 2]),
    /// Two intervals with a gap in between.
    Two([N; 2], [N; 2]),
}

impl<N: Number> Quadratic<N> {
    /// A constant.
    pub fn constant(value: N) -> Self {
        Self([value; 3])
    }

    /// A linear function from `start` to `end`.
    pub fn linear(start: N, end: N) -> Self {
        Self([start, (start + end) * N::from(0.5), end])
    }

    /// Combine two quadratics coefficient by coefficient.
    pub fn zip(&self, other: &Self, f: impl Fn(N, N) -> N) -> Self {
        Self([0, 1, 2].map(|k| f(self.0[k], other.0[k])))
    }

    /// The same function over `part` of [0, 1]: its blossom at the ends (Ramshaw 1987).
    pub fn over(&self, [start, end]: [N; 2]) -> Self {
        let [b0, b1, b2] = self.0;
        let (slope, bend) = (b1 - b0, b0 - b1 - b1 + b2);
        Self([[start, start], [start, end], [end, end]].map(|[r, s]| b0 + (r + s) * slope + r * s * bend))
    }

    /// `m0 + m1 c + m2 c^2` with `c` from -1 to 1 over the interval.
    pub fn centred(&self) -> [N; 3] {
        let [b0, b1, b2] = self.0;
        let (ends, quarter) = (b0 + b2, N::from(0.25));
        let twice = b1 + b1;
        [(ends + twice) * quarter, (b2 - b0) * N::from(0.5), (ends - twice) * quarter]
    }

    /// Hull of the times at which it is not negative. If the coefficients alone decide for all or none of the
    /// interval, no root is computed; the flag says whether one was.
    pub fn hull_above(&self) -> (Option<[N; 2]>, bool) {
        let [b0, b1, b2] = self.0;
        let (zero, one) = (N::zero(), N::from(1.0));
        let (starts_below, ends_below) = (b0 < zero, b2 < zero);
        if !starts_below && !ends_below {
            (Some([zero, one]), false)
        } else if starts_below && ends_below && b1 <= zero {
            (None, false)
        } else {
            match self.above() {
                Pieces::None => (None, true),
                Pieces::One(piece) => (Some(piece), true),
                Pieces::Two(first, last) => (Some([first[0], last[1]]), true),
            }
        }
    }

    /// Intervals where it is not negative. With `r = s / (1 - s)` it is `b2 r^2 + 2 b1 r + b0`, whose roots
    /// are `q / b2` and `b0 / q` with `q = -(b1 +- sqrt(b1^2 - b0 b2))`. The sign is that of `b1`, so there
    /// is no cancellation (Kahan). Mapped back to [0, 1] they are `q / (q + b2)` and `b0 / (b0 + q)`, both
    /// sums of equal signs for roots inside.
    pub fn above(&self) -> Pieces<N> {
        self.pieces(())
    }

    /// The same with its branches.
    pub(super) fn pieces(&self, path: impl Branches) -> Pieces<N> {
        let [b0, b1, b2] = self.0;
        let (zero, one) = (N::zero(), N::from(1.0));
        let discriminant = b1 * b1 - b0 * b2;
        let (starts_below, ends_below) = (path.branch(b0 < zero), path.branch(b2 < zero));
        let bends_over = if starts_below { b1 > zero } else { b1 < zero };
        if path.branch(starts_below == ends_below && (discriminant < zero || !bends_over)) {
            // No root inside.
            return if starts_below { Pieces::None } else { Pieces::One([zero, one]) };
        }
        let root = discriminant.max(zero).sqrt();
        let q = if b1 < zero { root - b1 } else { -(b1 + root) };
        let clamp = |s: N| s.max(zero).min(one);
        let (by_end, by_start) = (clamp(q / (q + b2)), clamp(b0 / (b0 + q)));
        match (starts_below, ends_below) {
            (true, true) => Pieces::One([by_start, by_end]),
            (false, false) => Pieces::Two([zero, by_start], [by_end, one]),
            (true, false) => Pieces::One([if b1 < zero { by_end } else { by_start }, one]),
            (false, true) => Pieces::One([zero, if b1 < zero { by_start } else { by_end }]),
        }
    }
}

impl<N: Number> Neg for Quadratic<N> {
    type Output = Self;
    fn neg(self) -> Self {
        Self(self.0.map(|b| -b))
    }
}

/// A number that counts multiply-adds by the convention of the sample test. A product and the sum it goes
/// into are one. A separate addition, multiplication, division or root is one. Signs, magnitudes and
/// comparisons are free.
#[cfg(test)]
pub mod counted {
    use std::cell::Cell;
    use std::cmp::Ordering;

    use super::*;

    thread_local! {
        static COUNT: Cell<u32> = const { Cell::new(0) };
    }

    /// Multiply-adds and result of `kernel`.
    pub fn count<R>(kernel: impl FnOnce() -> R) -> (u32, R) {
        COUNT.set(0);
        let result = kernel();
        (COUNT.get(), result)
    }

    /// A value, and whether it is a product not yet used in a sum.
    #[derive(Clone, Copy, Debug, Default)]
    pub struct Counted {
        pub value: f64,
        fresh: bool,
    }

    impl Counted {
        fn sum(self, other: Self, value: f64) -> Self {
            COUNT.set(COUNT.get() + u32::from(!self.fresh && !other.fresh));
            Self { value, fresh: false }
        }

        fn product(value: f64, fresh: bool) -> Self {
            COUNT.set(COUNT.get() + 1);
            Self { value, fresh }
        }
    }

    impl From<f32> for Counted {
        fn from(value: f32) -> Self {
            Self { value: f64::from(value), fresh: false }
        }
    }

    impl From<Counted> for f64 {
        fn from(counted: Counted) -> Self {
            counted.value
        }
    }

    impl PartialEq for Counted {
        fn eq(&self, other: &Self) -> bool {
            self.value == other.value
        }
    }

    impl PartialOrd for Counted {
        fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
            self.value.partial_cmp(&other.value)
        }
    }

    impl Add for Counted {
        type Output = Self;
        fn add(self, other: Self) -> Self {
            self.sum(other, self.value + other.value)
        }
    }

    impl Sub for Counted {
        type Output = Self;
        fn sub(self, other: Self) -> Self {
            self.sum(other, self.value - other.value)
        }
    }

    impl Mul for Counted {
        type Output = Self;
        fn mul(self, other: Self) -> Self {
            Self::product(self.value * other.value, true)
        }
    }

    impl Div for Counted {
        type Output = Self;
        fn div(self, other: Self) -> Self {
            Self::product(self.value / other.value, false)
        }
    }

    impl Neg for Counted {
        type Output = Self;
        fn neg(self) -> Self {
            Self { value: -self.value, ..self }
        }
    }

    impl Number for Counted {
        fn constant(value: f64) -> Self {
            Self { value, fresh: false }
        }

        fn abs(self) -> Self {
            Self { value: self.value.abs(), ..self }
        }

        fn sqrt(self) -> Self {
            Self::product(self.value.sqrt(), false)
        }
    }

    #[test]
    fn an_edge_takes_two_and_a_move_takes_one() {
        let [a, b, c, d] = [1.0, 2.0, 3.0, 4.0].map(Counted::from);
        assert_eq!(count(|| (a * b - c * d).value), (2, -10.0));
        assert_eq!(count(|| (a + b * c).value), (1, 7.0));
        assert_eq!(count(|| (a + b + c).value), (2, 6.0));
        assert_eq!(count(|| (-(a / b)).abs().value), (1, 0.5));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(b: [f64; 3], s: f64) -> f64 {
        b[0] * (1.0 - s) * (1.0 - s) + 2.0 * b[1] * s * (1.0 - s) + b[2] * s * s
    }

    fn holds(pieces: Pieces<f64>, s: f64) -> bool {
        let within = |[lo, hi]: [f64; 2]| (lo..=hi).contains(&s);
        match pieces {
            Pieces::None => false,
            Pieces::One(piece) => within(piece),
            Pieces::Two(first, last) => within(first) || within(last),
        }
    }

    #[test]
    fn rounding_is_outward_and_no_further() {
        for value in [1.0 / 3.0, -1.0 / 3.0, 0.1, 7.0, -7.0, 0.0, 1e-50, -1e-50, 1e30] {
            let (below, above) = (f32::at_most(value), f32::at_least(value));
            assert!(f64::from(below) <= value && value <= f64::from(above), "{value}");
            assert!(above == below || above == below.next_up(), "{value}: {below} to {above}");
            assert_eq!([f64::at_most(value), f64::at_least(value)], [value; 2]);
        }
    }

    #[test]
    fn roots_known_by_hand() {
        // (4 s - 1)(4 s - 3) = 16 s^2 - 16 s + 3
        let dip = Quadratic([3.0, -5.0, 3.0]);
        assert_eq!(dip.above(), Pieces::Two([0.0, 0.25], [0.75, 1.0]));
        assert_eq!(dip.hull_above(), (Some([0.0, 1.0]), false));
        let hill = Quadratic(dip.0.map(|b| -b));
        assert_eq!(hill.above(), Pieces::One([0.25, 0.75]));
        assert_eq!(Quadratic([-1.0, 0.5, -1.0]).above(), Pieces::None);
        assert_eq!(Quadratic([-1.0, 0.0, 1.0]).above(), Pieces::One([0.5, 1.0]));
        assert_eq!(Quadratic([1.0, 0.0, -1.0]).above(), Pieces::One([0.0, 0.5]));
        assert_eq!(Quadratic([0.0_f64; 3]).above(), Pieces::One([0.0, 1.0]));
    }

    proptest! {
        #[test]
        fn every_sign_is_that_of_the_function(b in [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0], flat: bool) {
            let b = if flat { [b[0], b[0] * (1.0 + 1e-9 * b[1]), b[0] * (1.0 + 1e-9 * b[2])] } else { b };
            let pieces = Quadratic(b).above();
            let (hull, _) = Quadratic(b).hull_above();
            for step in 0..=1000 {
                let s = f64::from(step) / 1000.0;
                let value = at(b, s);
                if value.abs() > 1e-14 {
                    prop_assert_eq!(holds(pieces, s), value > 0.0, "{} at {}: {:?}", value, s, pieces);
                }
                if value > 1e-14 {
                    prop_assert!(hull.is_some_and(|[lo, hi]| lo <= s && s <= hi));
                }
            }
        }

        #[test]
        fn a_part_is_the_same_function(b in [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0], lo in 0.0..0.5_f64, hi in 0.5..1.0_f64) {
            let part = Quadratic(b).over([lo, hi]);
            let [m0, m1, m2] = part.centred();
            for step in 0..=10 {
                let s = f64::from(step) / 10.0;
                let (whole, c) = (at(b, lo + s * (hi - lo)), 2.0 * s - 1.0);
                prop_assert!((at(part.0, s) - whole).abs() < 1e-14);
                prop_assert!((m0 + m1 * c + m2 * c * c - whole).abs() < 1e-14);
            }
        }
    }
}
