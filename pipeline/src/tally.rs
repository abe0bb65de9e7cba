//! Numbers that count the operations they take part in. A kernel that is generic over its number reports what it did
//! on this input, without a cost written beside it.

use std::cell::Cell;
use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Count of multiply-adds, by the convention of the sample test: a product and the sum it goes into are one; a separate
/// addition, multiplication, division or root is one. Signs, magnitudes and comparisons are free.
#[derive(Debug, Default)]
pub struct Tally(Cell<u32>);

impl Tally {
    /// Multiply-adds so far.
    pub fn madds(&self) -> u32 {
        self.0.get()
    }

    #[inline(always)]
    fn add(&self, madds: u32) {
        self.0.set(self.0.get() + madds);
    }
}

/// A value that counts on a tally. A constant has no tally: operations among constants are free.
#[derive(Clone, Copy, Debug)]
pub struct Counting<'t> {
    value: f64,
    tally: Option<&'t Tally>,
    /// Whether it is a product that no sum has used yet.
    fresh: bool,
}

impl<'t> Counting<'t> {
    /// A value in registers.
    #[inline(always)]
    pub fn new(value: f64, tally: &'t Tally) -> Self {
        Self { value, tally: Some(tally), fresh: false }
    }

    /// A constant.
    #[inline(always)]
    pub fn constant(value: f64) -> Self {
        Self { value, tally: None, fresh: false }
    }

    /// The value.
    #[inline(always)]
    pub fn value(self) -> f64 {
        self.value
    }

    /// The same number with another value, without an operation.
    #[inline(always)]
    pub(crate) fn with(self, value: f64) -> Self {
        Self { value, ..self }
    }

    /// Square root.
    #[inline(always)]
    pub(crate) fn root(self) -> Self {
        self.result(self, self.value.sqrt(), [true, false])
    }

    /// `self b + c`, rounded after each operation.
    #[inline(always)]
    pub(crate) fn multiply_add(self, b: Self, c: Self) -> Self {
        self * b + c
    }

    #[inline(always)]
    fn result(self, other: Self, value: f64, [counts, fresh]: [bool; 2]) -> Self {
        let tally = self.tally.or(other.tally);
        if counts && let Some(tally) = tally {
            tally.add(1);
        }
        Self { value, tally, fresh: fresh && tally.is_some() }
    }

    #[inline(always)]
    fn sum(self, other: Self, value: f64) -> Self {
        self.result(other, value, [!self.fresh && !other.fresh, false])
    }
}

impl PartialEq for Counting<'_> {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl PartialOrd for Counting<'_> {
    #[inline(always)]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl Add for Counting<'_> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.sum(other, self.value + other.value)
    }
}

impl Sub for Counting<'_> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.sum(other, self.value - other.value)
    }
}

impl Mul for Counting<'_> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.result(other, self.value * other.value, [true, true])
    }
}

impl Div for Counting<'_> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.result(other, self.value / other.value, [true, false])
    }
}

impl Neg for Counting<'_> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.with(-self.value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_and_its_sum_are_one_and_constants_are_free() {
        let tally = Tally::default();
        let [a, b, c, d] = [1.0, 2.0, 3.0, 4.0].map(|value| Counting::new(value, &tally));
        let counted = |of: &dyn Fn() -> f64| {
            let before = tally.madds();
            (of(), tally.madds() - before)
        };
        assert_eq!(counted(&|| (a * b - c * d).value()), (-10.0, 2));
        assert_eq!(counted(&|| (a + b * c).value()), (7.0, 1));
        assert_eq!(counted(&|| (a + b + c).value()), (6.0, 2));
        assert_eq!(counted(&|| (-(d / b)).value()), (-2.0, 1));
        assert_eq!(counted(&|| d.root().value()), (2.0, 1));
        let two = Counting::constant(2.0);
        assert_eq!(counted(&|| (two * two + a).value()), (5.0, 1));
        assert_eq!(counted(&|| (two * two).value()), (4.0, 0));
    }
}
