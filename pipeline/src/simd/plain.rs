//! Lanes as an array, for any machine.

use std::ops::{Add, Div, Mul, Sub};

use super::{LANES, Lanes, Mask};

/// An array; the compiler vectorizes its loops for the baseline of the target.
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
