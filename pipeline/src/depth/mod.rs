//! Depth: the depth interval of a triangle over a box, and the stored depths of a tile for culling.
//!
//! - [`plane`]: moving planes that bound a triangle from one side, the mathematics of the depth interval,
//! - [`DepthBound`] and [`Bounder`]: the interval of all depths that the sample test computes in a tile,
//! - [`DepthBoxes`]: farthest and nearest stored depth of a tile, by boxes of lens and time,
//! - [`DepthTile`]: the stored samples,
//! - [`Pyramid`]: farthest stored depths of larger and larger tiles, for occlusion queries,
//! - [`Real`]: numbers of the depth bounds and of tests of points: `f64`, or a number that counts its operations.

mod bound;
mod boxes;
mod grid;
pub mod plane;

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::tally::{Branches, Counting, Path, Tally};

pub use bound::{Bounder, DepthBound, interval_madds, set_up_madds, vertex_range};
pub(crate) use bound::{ExactBounder, exact_interval_madds};
pub use boxes::{DepthBoxes, DepthTile, Visible};
pub use grid::{BoxGrid, DepthSpec, Pyramid};

/// A real number.
pub trait Real:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The number `value`.
    fn new(value: f64) -> Self;

    /// Its value.
    fn value(self) -> f64;

    /// `self b + c`, rounded after each operation; one multiply-add.
    fn madd(self, b: Self, c: Self) -> Self;

    /// The other one if `takes_other`; a choice is free.
    fn or(self, other: Self, takes_other: bool) -> Self {
        if takes_other { other } else { self }
    }

    /// Minimum; comparisons are free.
    fn smaller(self, other: Self) -> Self {
        self.or(other, other < self)
    }

    /// Maximum.
    fn larger(self, other: Self) -> Self {
        self.or(other, other > self)
    }

    /// Magnitude.
    fn magnitude(self) -> Self {
        if self < Self::new(0.0) { -self } else { self }
    }
}

impl Real for f64 {
    fn new(value: f64) -> Self {
        value
    }

    fn value(self) -> f64 {
        self
    }

    fn madd(self, b: Self, c: Self) -> Self {
        self * b + c
    }
}

impl Real for Counting<'_> {
    fn new(value: f64) -> Self {
        Self::constant(value)
    }

    fn value(self) -> f64 {
        Self::value(self)
    }

    fn madd(self, b: Self, c: Self) -> Self {
        self.multiply_add(b, c)
    }

    fn or(self, other: Self, takes_other: bool) -> Self {
        self.choice(other, takes_other)
    }
}

/// Source of the numbers that a kernel computes with, and recorder of its branches.
pub(crate) trait Numbers: Branches {
    /// Type of the numbers.
    type Number: Real;

    /// An input of the kernel.
    fn number(self, value: f64) -> Self::Number;
}

/// Plain numbers.
impl Numbers for &Path {
    type Number = f64;

    #[inline(always)]
    fn number(self, value: f64) -> f64 {
        value
    }
}

impl<'t> Numbers for &'t Tally {
    type Number = Counting<'t>;

    #[inline(always)]
    fn number(self, value: f64) -> Counting<'t> {
        Counting::new(value, self)
    }
}

/// `a . b`.
fn dot<R: Real>(a: [R; 3], b: [R; 3]) -> R {
    a[0].madd(b[0], a[1].madd(b[1], a[2] * b[2]))
}

/// `a x b`.
fn cross<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    let part = |i: usize, j: usize| a[i].madd(b[j], -(a[j] * b[i]));
    [part(1, 2), part(2, 0), part(0, 1)]
}

/// Smallest and largest value.
fn range<R: Real, const N: usize>(values: [R; N]) -> [R; 2] {
    values.iter().fold([values[0]; 2], |[lo, hi], &value| [lo.smaller(value), hi.larger(value)])
}

/// Intersection of two ranges.
fn both<R: PartialOrd + Copy>(a: [R; 2], b: [R; 2]) -> [R; 2] {
    [if b[0] > a[0] { b[0] } else { a[0] }, if b[1] < a[1] { b[1] } else { a[1] }]
}

/// Hull of two ranges.
fn hull<R: Real>(a: [R; 2], b: [R; 2]) -> [R; 2] {
    [a[0].smaller(b[0]), a[1].larger(b[1])]
}

#[cfg(test)]
mod counting {
    use super::Real;
    use std::cell::Cell;
    use std::ops::{Add, Div, Mul, Neg, Sub};

    thread_local!(static MADDS: Cell<u32> = const { Cell::new(0) });

    /// A number that counts multiply-adds; a separate addition, multiplication or division counts as one.
    #[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
    pub struct Counted(pub f64);

    fn count(value: f64) -> Counted {
        MADDS.set(MADDS.get() + 1);
        Counted(value)
    }

    /// Multiply-adds of `work`.
    pub fn madds(work: impl FnOnce()) -> u32 {
        MADDS.set(0);
        work();
        MADDS.get()
    }

    macro_rules! operator {
        ($($name:ident $method:ident $op:tt),*) => {$(
            impl $name for Counted {
                type Output = Self;
                fn $method(self, other: Self) -> Self {
                    count(self.0 $op other.0)
                }
            }
        )*};
    }

    operator!(Add add +, Sub sub -, Mul mul *, Div div /);

    impl Neg for Counted {
        type Output = Self;
        fn neg(self) -> Self {
            Self(-self.0)
        }
    }

    impl Real for Counted {
        fn new(value: f64) -> Self {
            Self(value)
        }

        fn value(self) -> f64 {
            self.0
        }

        fn madd(self, b: Self, c: Self) -> Self {
            count(self.0 * b.0 + c.0)
        }
    }
}
