//! Vectors of sixteen numbers, in the widest registers of the machine.
//!
//! Kernels are written once over `Lanes` and entered through `dispatch`, which selects the widest vectors at
//! run time. Every operation rounds as IEEE 754 requires. Multiply-adds are fused only where they are
//! written, so all widths give the same bytes.

#[cfg(target_arch = "x86_64")]
mod x86;

use std::ops::{Add, Div, Mul, Sub};
use std::sync::LazyLock;

/// Numbers per vector.
pub const LANES: usize = 16;

/// Sixteen numbers in memory, aligned to the widest vector.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Row(pub [f32; LANES]);

impl Row {
    /// Sixteen copies of a number.
    pub const fn splat(value: f32) -> Self {
        Self([value; LANES])
    }
}

/// One bit per lane.
pub(crate) type Mask = u16;

/// Sixteen `f32` in registers. Comparisons with NaN are false.
pub(crate) trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    fn splat(value: f32) -> Self;
    fn load(from: &[f32; LANES]) -> Self;
    fn store(self, to: &mut [f32; LANES]);
    /// Minimum by lane; `other` if either is NaN.
    fn min(self, other: Self) -> Self;
    /// Maximum by lane; `other` if either is NaN.
    fn max(self, other: Self) -> Self;
    fn abs(self) -> Self;
    /// `self * by + plus`, rounded once.
    fn times_plus(self, by: Self, plus: Self) -> Self;
    /// `from - self * by`, rounded once.
    fn times_from(self, by: Self, from: Self) -> Self;
    fn gt(self, other: Self) -> Mask;
    fn ge(self, other: Self) -> Mask;
    fn equal(self, other: Self) -> Mask;
    /// Write `value` to the lanes of the mask only.
    fn put(mask: Mask, value: u32, to: &mut [u32; LANES]);
    /// Write `first` plus the number of each lane of the mask, consecutively; the entries after them are
    /// undefined.
    fn number(mask: Mask, first: u32, to: &mut [u32; LANES]);
    /// Lanes of the mask from `self`, the others from `other`.
    fn or_else(self, mask: Mask, other: Self) -> Self;
    /// Largest of the sixteen, none of them NaN.
    fn largest(self) -> f32;
}

/// A vector width that this machine supports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VectorWidth(Vectors);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Vectors {
    Plain,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

static WIDEST: LazyLock<VectorWidth> =
    LazyLock::new(|| VectorWidth::available().last().unwrap_or(VectorWidth(Vectors::Plain)));

impl VectorWidth {
    /// All widths of this machine, the widest last.
    pub fn available() -> impl Iterator<Item = Self> {
        let mut widths = vec![Self(Vectors::Plain)];
        #[cfg(target_arch = "x86_64")]
        {
            let bits = is_x86_feature_detected!("popcnt")
                && is_x86_feature_detected!("lzcnt")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("bmi2");
            let half = bits && is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
            if half {
                widths.push(Self(Vectors::Avx2));
            }
            if half && is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
                widths.push(Self(Vectors::Avx512));
            }
        }
        widths.into_iter()
    }

    /// The widest one of this machine.
    pub fn widest() -> Self {
        *WIDEST
    }
}

/// A computation that runs with any vector width. Its `run` and all functions it calls on lanes need
/// `#[inline(always)]`, to be compiled for the vectors it is entered with.
pub(crate) trait Kernel {
    fn run<V: Lanes>(self);
}

/// Prefetch the memory of `at`.
#[inline(always)]
pub(crate) fn prefetch<T>(at: &T) {
    #[cfg(target_arch = "x86_64")]
    x86::prefetch(at);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = at;
}

/// Run a kernel with vectors of the given width.
pub(crate) fn dispatch(width: VectorWidth, kernel: impl Kernel) {
    match width.0 {
        Vectors::Plain => kernel.run::<Plain>(),
        // SAFETY: a `Width` other than the plain one exists only on machines that support it.
        #[cfg(target_arch = "x86_64")]
        Vectors::Avx2 => unsafe { x86::avx2(kernel) },
        #[cfg(target_arch = "x86_64")]
        Vectors::Avx512 => unsafe { x86::avx512(kernel) },
    }
}

/// Lanes as an array, for any machine. The compiler vectorizes its loops for the baseline of the target.
#[derive(Clone, Copy)]
pub(crate) struct Plain([f32; LANES]);

#[inline(always)]
fn zip(a: Plain, b: Plain, of: impl Fn(f32, f32) -> f32) -> Plain {
    let mut out = a.0;
    for (out, b) in out.iter_mut().zip(b.0) {
        *out = of(*out, b);
    }
    Plain(out)
}

#[inline(always)]
fn mask(a: Plain, b: Plain, of: impl Fn(f32, f32) -> bool) -> Mask {
    let mut bits = 0;
    for lane in 0..LANES {
        bits |= Mask::from(of(a.0[lane], b.0[lane])) << lane;
    }
    bits
}

/// One operator, lane by lane.
macro_rules! operator {
    ($trait:ident, $name:ident, $op:tt) => {
        impl $trait for Plain {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                zip(self, other, |a, b| a $op b)
            }
        }
    };
}
operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl Lanes for Plain {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn load(from: &[f32; LANES]) -> Self {
        Self(*from)
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; LANES]) {
        *to = self.0;
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        zip(self, other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        zip(self, other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        zip(self, self, |a, _| a.abs())
    }

    #[inline(always)]
    fn times_plus(self, by: Self, plus: Self) -> Self {
        let mut out = plus.0;
        for (out, (a, b)) in out.iter_mut().zip(self.0.into_iter().zip(by.0)) {
            *out = a.mul_add(b, *out);
        }
        Self(out)
    }

    #[inline(always)]
    fn times_from(self, by: Self, from: Self) -> Self {
        let mut out = from.0;
        for (out, (a, b)) in out.iter_mut().zip(self.0.into_iter().zip(by.0)) {
            *out = (-a).mul_add(b, *out);
        }
        Self(out)
    }

    #[inline(always)]
    fn gt(self, other: Self) -> Mask {
        mask(self, other, |a, b| a > b)
    }

    #[inline(always)]
    fn ge(self, other: Self) -> Mask {
        mask(self, other, |a, b| a >= b)
    }

    #[inline(always)]
    fn equal(self, other: Self) -> Mask {
        mask(self, other, |a, b| a == b)
    }

    #[inline(always)]
    fn put(mask: Mask, value: u32, to: &mut [u32; LANES]) {
        for (lane, slot) in to.iter_mut().enumerate() {
            if mask >> lane & 1 != 0 {
                *slot = value;
            }
        }
    }

    #[inline(always)]
    fn number(mask: Mask, first: u32, to: &mut [u32; LANES]) {
        let mut remaining = mask;
        for slot in to.iter_mut().take(mask.count_ones() as usize) {
            *slot = first + remaining.trailing_zeros();
            remaining &= remaining - 1;
        }
    }

    #[inline(always)]
    fn or_else(self, mask: Mask, other: Self) -> Self {
        let mut out = other.0;
        for (lane, (slot, value)) in out.iter_mut().zip(self.0).enumerate() {
            if mask >> lane & 1 != 0 {
                *slot = value;
            }
        }
        Self(out)
    }

    #[inline(always)]
    fn largest(self) -> f32 {
        self.0.into_iter().fold(f32::NEG_INFINITY, f32::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every operation on a few hundred special numbers, as bits.
    struct Everything<'a>(&'a mut Vec<u32>);

    fn awkward(seed: u32) -> [f32; LANES] {
        let special = [0.0, -0.0, 1.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e-40, 3.4e38];
        std::array::from_fn(|lane| {
            let bits = (seed + lane as u32).wrapping_mul(0x9E37_79B9);
            if bits.is_multiple_of(3) { special[bits as usize % special.len()] } else { f32::from_bits(bits) }
        })
    }

    impl Kernel for Everything<'_> {
        #[inline(always)]
        fn run<V: Lanes>(self) {
            for seed in 0..200 {
                let (from_a, from_b) = (awkward(seed), awkward(7 * seed + 3));
                let (a, b) = (V::load(&from_a), V::load(&from_b));
                let masks = [a.gt(b), a.ge(b), a.equal(b)];
                let mut put = [7; LANES];
                V::put(masks[1], seed, &mut put);
                let mut numbers = [0; LANES];
                V::number(masks[1], seed, &mut numbers);
                let results = [
                    a + b,
                    a - b,
                    a * b,
                    a / b,
                    a.min(b),
                    a.max(b),
                    a.abs(),
                    a.times_plus(b, a),
                    a.times_from(b, a),
                    a.or_else(masks[0], b),
                    V::splat(2.0),
                ];
                for result in results {
                    let mut out = [0.0; LANES];
                    result.store(&mut out);
                    // The sign and payload of a NaN are unspecified.
                    self.0.extend(out.map(|x| if x.is_nan() { u32::MAX } else { x.to_bits() }));
                }
                self.0.extend(masks.map(u32::from));
                self.0.push(a.abs().min(V::splat(f32::MAX)).largest().to_bits());
                self.0.extend(put);
                self.0.extend(&numbers[..masks[1].count_ones() as usize]);
            }
        }
    }

    #[test]
    fn all_widths_give_the_same_bytes() {
        let at = |width| {
            let mut bits = Vec::new();
            dispatch(width, Everything(&mut bits));
            bits
        };
        let plain = at(VectorWidth(Vectors::Plain));
        assert!(plain.len() > 200 * 160);
        assert!(VectorWidth::available().all(|width| at(width) == plain));
    }
}
