//! Lanes in the vector registers of x86-64: one of 512 bits, or two of 256.
//!
//! SAFETY, for all of this file: the types are used inside [`avx2`] and [`avx512`] only, whose callers have
//! checked for the instructions. Memory is accessed through references to whole arrays.

use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

use super::{Kernel, LANES, Lanes, Mask};

/// Run a kernel with 256-bit vectors.
#[target_feature(enable = "avx2,fma,popcnt,bmi1,bmi2,lzcnt")]
pub(super) fn avx2(kernel: impl Kernel) {
    kernel.run::<Avx2>();
}

/// Run a kernel with 512-bit vectors.
#[target_feature(enable = "avx512f,avx512dq,avx2,fma,popcnt,bmi1,bmi2,lzcnt")]
pub(super) fn avx512(kernel: impl Kernel) {
    kernel.run::<Avx512>();
}

/// Prefetch every cache line of `at`.
#[inline(always)]
pub(super) fn prefetch<T>(at: &T) {
    let first = std::ptr::from_ref(at).cast::<i8>();
    for offset in (0..size_of::<T>()).step_by(64) {
        // A prefetch never faults, and this is within the value.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(first.add(offset)) };
    }
}

#[derive(Clone, Copy)]
pub(super) struct Avx512(__m512);

#[derive(Clone, Copy)]
pub(super) struct Avx2(__m256, __m256);

/// One operator in both widths.
macro_rules! operator {
    ($trait:ident, $name:ident, $wide:ident, $half:ident) => {
        impl $trait for Avx512 {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self(unsafe { $wide(self.0, other.0) })
            }
        }
        impl $trait for Avx2 {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                unsafe { Self($half(self.0, other.0), $half(self.1, other.1)) }
            }
        }
    };
}
operator!(Add, add, _mm512_add_ps, _mm256_add_ps);
operator!(Sub, sub, _mm512_sub_ps, _mm256_sub_ps);
operator!(Mul, mul, _mm512_mul_ps, _mm256_mul_ps);
operator!(Div, div, _mm512_div_ps, _mm256_div_ps);

impl Lanes for Avx512 {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(unsafe { _mm512_set1_ps(value) })
    }

    #[inline(always)]
    fn load(from: &[f32; LANES]) -> Self {
        Self(unsafe { _mm512_loadu_ps(from.as_ptr()) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; LANES]) {
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(unsafe { _mm512_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm512_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(unsafe { _mm512_abs_ps(self.0) })
    }

    #[inline(always)]
    fn times_plus(self, by: Self, plus: Self) -> Self {
        Self(unsafe { _mm512_fmadd_ps(self.0, by.0, plus.0) })
    }

    #[inline(always)]
    fn times_from(self, by: Self, from: Self) -> Self {
        Self(unsafe { _mm512_fnmadd_ps(self.0, by.0, from.0) })
    }

    #[inline(always)]
    fn gt(self, other: Self) -> Mask {
        unsafe { _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn ge(self, other: Self) -> Mask {
        unsafe { _mm512_cmp_ps_mask::<_CMP_GE_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn equal(self, other: Self) -> Mask {
        unsafe { _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn put(mask: Mask, value: u32, to: &mut [u32; LANES]) {
        unsafe {
            _mm512_mask_storeu_epi32(to.as_mut_ptr().cast(), mask, _mm512_set1_epi32(value.cast_signed()));
        }
    }

    #[inline(always)]
    fn number(mask: Mask, first: u32, to: &mut [u32; LANES]) {
        unsafe {
            let lane = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
            let number = _mm512_add_epi32(_mm512_set1_epi32(first.cast_signed()), lane);
            _mm512_storeu_epi32(to.as_mut_ptr().cast(), _mm512_maskz_compress_epi32(mask, number));
        }
    }

    #[inline(always)]
    fn or_else(self, mask: Mask, other: Self) -> Self {
        Self(unsafe { _mm512_mask_blend_ps(mask, other.0, self.0) })
    }

    #[inline(always)]
    fn largest(self) -> f32 {
        unsafe { _mm512_reduce_max_ps(self.0) }
    }
}

/// A comparison of both halves as one mask.
macro_rules! compare {
    ($a:expr, $b:expr, $how:ident) => {
        unsafe {
            let low = _mm256_movemask_ps(_mm256_cmp_ps::<$how>($a.0, $b.0));
            let high = _mm256_movemask_ps(_mm256_cmp_ps::<$how>($a.1, $b.1));
            (low | high << 8) as Mask
        }
    };
}

/// All ones in the lanes of the mask, as two vectors.
#[inline(always)]
fn spread(mask: Mask) -> (__m256i, __m256i) {
    (spread_half(i32::from(mask & 0xFF)), spread_half(i32::from(mask >> 8)))
}

#[inline(always)]
fn spread_half(bits: i32) -> __m256i {
    unsafe {
        let bit = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
        _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(bits), bit), bit)
    }
}

impl Lanes for Avx2 {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        unsafe { Self(_mm256_set1_ps(value), _mm256_set1_ps(value)) }
    }

    #[inline(always)]
    fn load(from: &[f32; LANES]) -> Self {
        unsafe { Self(_mm256_loadu_ps(from.as_ptr()), _mm256_loadu_ps(from.as_ptr().add(8))) }
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; LANES]) {
        unsafe {
            _mm256_storeu_ps(to.as_mut_ptr(), self.0);
            _mm256_storeu_ps(to.as_mut_ptr().add(8), self.1);
        }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        unsafe { Self(_mm256_min_ps(self.0, other.0), _mm256_min_ps(self.1, other.1)) }
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        unsafe { Self(_mm256_max_ps(self.0, other.0), _mm256_max_ps(self.1, other.1)) }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        unsafe {
            let sign = _mm256_set1_ps(-0.0);
            Self(_mm256_andnot_ps(sign, self.0), _mm256_andnot_ps(sign, self.1))
        }
    }

    #[inline(always)]
    fn times_plus(self, by: Self, plus: Self) -> Self {
        unsafe { Self(_mm256_fmadd_ps(self.0, by.0, plus.0), _mm256_fmadd_ps(self.1, by.1, plus.1)) }
    }

    #[inline(always)]
    fn times_from(self, by: Self, from: Self) -> Self {
        unsafe { Self(_mm256_fnmadd_ps(self.0, by.0, from.0), _mm256_fnmadd_ps(self.1, by.1, from.1)) }
    }

    #[inline(always)]
    fn gt(self, other: Self) -> Mask {
        compare!(self, other, _CMP_GT_OQ)
    }

    #[inline(always)]
    fn ge(self, other: Self) -> Mask {
        compare!(self, other, _CMP_GE_OQ)
    }

    #[inline(always)]
    fn equal(self, other: Self) -> Mask {
        compare!(self, other, _CMP_EQ_OQ)
    }

    #[inline(always)]
    fn put(mask: Mask, value: u32, to: &mut [u32; LANES]) {
        unsafe {
            let ((low, high), value) = (spread(mask), _mm256_set1_epi32(value.cast_signed()));
            _mm256_maskstore_epi32(to.as_mut_ptr().cast(), low, value);
            _mm256_maskstore_epi32(to.as_mut_ptr().add(8).cast(), high, value);
        }
    }

    #[inline(always)]
    fn number(mask: Mask, first: u32, to: &mut [u32; LANES]) {
        super::Plain::number(mask, first, to);
    }

    #[inline(always)]
    fn or_else(self, mask: Mask, other: Self) -> Self {
        unsafe {
            let (low, high) = spread(mask);
            Self(
                _mm256_blendv_ps(other.0, self.0, _mm256_castsi256_ps(low)),
                _mm256_blendv_ps(other.1, self.1, _mm256_castsi256_ps(high)),
            )
        }
    }

    #[inline(always)]
    fn largest(self) -> f32 {
        unsafe {
            let four = _mm256_max_ps(self.0, self.1);
            let two = _mm_max_ps(_mm256_castps256_ps128(four), _mm256_extractf128_ps::<1>(four));
            let one = _mm_max_ps(two, _mm_movehl_ps(two, two));
            _mm_cvtss_f32(_mm_max_ss(one, _mm_shuffle_ps::<1>(one, one)))
        }
    }
}
