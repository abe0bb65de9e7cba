//! Numbers that count the operations they take part in. A kernel that is generic over its number reports what it did
//! on this input, without a cost written beside it.
//!
//! The count depends on the branches alone. So a kernel runs on plain numbers and records its [`Path`]; only a path
//! that [`Costs`] does not know yet runs again on numbers that count.

use std::cell::Cell;
use std::cmp::Ordering;
use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::random::GOLDEN;

/// Count of multiply-adds, by the convention of the sample test: a product and the sum it goes into are one;
/// a separate addition, multiplication, division or root is one. Signs, magnitudes and comparisons are free.
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

/// Recorder of the branches of a kernel. Every choice that decides which operations follow goes through it; a choice
/// between two values does not.
pub trait Branches: Copy {
    /// Records a condition, and returns it.
    fn branch(self, condition: bool) -> bool;
}

/// Records nothing.
impl Branches for () {
    #[inline(always)]
    fn branch(self, condition: bool) -> bool {
        condition
    }
}

/// Numbers that count need no record.
impl Branches for &Tally {
    #[inline(always)]
    fn branch(self, condition: bool) -> bool {
        condition
    }
}

/// Branches of one run of a kernel, in order, as bits behind a number that is the kernel's.
#[derive(Debug)]
pub struct Path(Cell<u64>);

impl Path {
    /// Bit that is set if there were too many branches.
    const FULL: u64 = 1 << 63;

    /// The start of the path through a kernel.
    pub(crate) fn new(kernel: Kernel) -> Self {
        Self(Cell::new(kernel as u64))
    }

    /// The branches so far, if there is room for all of them.
    fn bits(&self) -> Option<u64> {
        let bits = self.0.get();
        (bits & Self::FULL == 0).then_some(bits)
    }
}

impl Branches for &Path {
    #[inline(always)]
    fn branch(self, condition: bool) -> bool {
        let bits = self.0.get();
        if bits & Path::FULL == 0 {
            self.0.set(bits << 1 | u64::from(condition));
        }
        condition
    }
}

/// Kernels whose multiply-adds are counted by path. Their numbers have five bits each, so that no path
/// through one is that through another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Kernel {
    /// The face that a triangle shows.
    Facing = 16,
    /// A point in a still triangle.
    Inside,
    /// The times of a point in a moving triangle.
    Times,
    /// The size of a triangle, and its planes at the ends of the shutter.
    Planes,
    /// The depths of a triangle over a tile.
    Depths,
    /// The same in conservative mode.
    ExactDepths,
}

/// Multiply-adds of the paths that were taken so far, each with its branches. By default none is remembered,
/// and every run is counted.
#[derive(Debug, Default)]
pub struct Costs(Box<[Cell<(u64, u32)>]>);

impl Costs {
    /// Room for 4096 paths; of two in one place the later stays.
    pub fn remembered() -> Self {
        Self(vec![Cell::default(); 4096].into())
    }

    /// Makes room if there is none.
    pub(crate) fn remember(&mut self) {
        if self.0.is_empty() {
            *self = Self::remembered();
        }
    }

    /// Runs a kernel: `follow` on plain numbers, and `count` if the path is new. Returns the result with its
    /// multiply-adds.
    #[inline(always)]
    pub(crate) fn run<T>(
        &self,
        kernel: Kernel,
        follow: impl FnOnce(&Path) -> T,
        count: impl FnOnce(&Tally),
    ) -> (T, u32) {
        let path = Path::new(kernel);
        let result = follow(&path);
        let slot = path.bits().and_then(|bits| Some((bits, self.slot(bits)?)));
        if let Some((bits, slot)) = slot
            && let (known, madds) = slot.get()
            && known == bits
            && cfg!(not(debug_assertions))
        {
            return (result, madds);
        }
        (result, self.counted(slot, count))
    }

    #[cold]
    fn counted(&self, slot: Option<(u64, &Cell<(u64, u32)>)>, count: impl FnOnce(&Tally)) -> u32 {
        let tally = Tally::default();
        count(&tally);
        let madds = tally.madds();
        if let Some((bits, slot)) = slot {
            let (known, before) = slot.replace((bits, madds));
            debug_assert!(known != bits || before == madds, "{bits:b}: {before} and {madds}");
        }
        madds
    }

    fn slot(&self, bits: u64) -> Option<&Cell<(u64, u32)>> {
        // Multiplicative hashing (Knuth 1973).
        let hash = bits.wrapping_mul(GOLDEN) >> 32;
        self.0.get(hash as usize & self.0.len().saturating_sub(1))
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

    /// One of two values, whichever it is: a choice does not decide what counts.
    #[inline(always)]
    pub(crate) fn choice(self, other: Self, takes_other: bool) -> Self {
        let (tally, fresh) = (self.tally.or(other.tally), self.fresh && other.fresh);
        Self { value: if takes_other { other.value } else { self.value }, tally, fresh }
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
