//! Sixteen samples side by side.
//!
//! Plain loops over arrays and no closures, which would not be inlined into functions compiled for wider vectors.

use std::ops::Range;

use crate::sampling::TileSamples;
use crate::setup::Corner;

/// Samples tested together.
pub(super) const LANES: usize = TileSamples::LANES;

/// The union of one bit for each lane.
#[inline(always)]
pub(super) fn any(bits: &[u16; LANES]) -> u32 {
    u32::from(bits.iter().fold(0, |union, bit| union | bit))
}

/// What sixteen samples need to see a vertex.
pub(super) struct View<'a, const MOTION: bool, const LENS: bool> {
    t: &'a [f32; LANES],
    lens_x: &'a [f32; LANES],
    lens_y: &'a [f32; LANES],
    slope_x: &'a [f32; LANES],
    slope_y: &'a [f32; LANES],
}

/// A vertex as a sample sees it.
pub(super) struct Seen {
    pub x: f32,
    pub y: f32,
    pub w: f32,
}

impl<'a, const MOTION: bool, const LENS: bool> View<'a, MOTION, LENS> {
    #[inline(always)]
    pub fn at(samples: &'a TileSamples, base: usize) -> Self {
        Self {
            t: block_of(&samples.t, base),
            lens_x: block_of(&samples.lens[0], base),
            lens_y: block_of(&samples.lens[1], base),
            slope_x: block_of(&samples.slope[0], base),
            slope_y: block_of(&samples.slope[1], base),
        }
    }

    #[inline(always)]
    pub fn see(&self, corner: &Corner, lane: usize) -> Seen {
        let ([mut x, mut y, mut w], [dx, dy, dw]) = (corner.open, corner.delta);
        if MOTION {
            let t = self.t[lane];
            (x, y, w) = (x + t * dx, y + t * dy, w + t * dw);
        }
        if LENS {
            (x, y) = (x - self.lens_x[lane], y - self.lens_y[lane]);
        }
        Seen { x: x - self.slope_x[lane] * w, y: y - self.slope_y[lane] * w, w }
    }
}

#[inline(always)]
pub(super) fn block_of(array: &[f32], base: usize) -> &[f32; LANES] {
    // Arrays are padded to whole blocks, so the fallback is never taken.
    array[base..base + LANES].first_chunk().unwrap_or(&[0.0; LANES])
}

/// The lanes of the block at `base` that belong to `run`.
pub(super) fn lanes(run: &Range<usize>, base: usize) -> u32 {
    let first = run.start.saturating_sub(base);
    let last = (run.end - base).min(LANES);
    ((1_u32 << last) - 1) & !((1_u32 << first) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_of_a_run() {
        assert_eq!(lanes(&(0..16), 0), 0xFFFF);
        assert_eq!(lanes(&(3..40), 0), 0xFFF8);
        assert_eq!(lanes(&(3..40), 16), 0xFFFF);
        assert_eq!(lanes(&(3..40), 32), 0x00FF);
    }
}
