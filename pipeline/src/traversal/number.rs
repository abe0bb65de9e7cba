//! Numbers of the tile tests: `f64` at run time, and in tests a number that counts its operations.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Number type of the kernels of the tile tests. A generic kernel can be run with counting numbers to measure
/// its cost.
pub trait Number:
    Copy
    + PartialOrd
    + From<f32>
    + Into<f64>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Magnitude.
    fn abs(self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;

    /// Maximum; the other one if one is NaN.
    fn max(self, other: Self) -> Self {
        if other > self || self.partial_cmp(&self).is_none() { other } else { self }
    }

    /// Minimum; the other one if one is NaN.
    fn min(self, other: Self) -> Self {
        if other < self || self.partial_cmp(&self).is_none() { other } else { self }
    }

    /// A constant.
    fn constant(value: f64) -> Self;

    /// Zero.
    fn zero() -> Self {
        Self::from(0.0)
    }
}

impl Number for f64 {
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
