//! Edge functions of a triangle at sixteen samples.

use crate::sampling::TileSamples;
use crate::setup::Corner;
use crate::simd::{LANES, Lanes, Mask};

/// Data of sixteen samples for the sample test, in memory.
#[derive(Clone, Copy)]
pub(crate) struct SampleRows<'a> {
    /// Factor of a vertex's depth ([`crate::geometry::Shear::ray`]).
    pub slope: [&'a [f32; LANES]; 2],
    /// Offset of a vertex independent of its depth; read with a lens or in an orthographic view.
    pub lens: [&'a [f32; LANES]; 2],
    /// Time; read for moving triangles.
    pub t: &'a [f32; LANES],
}

impl<'a> SampleRows<'a> {
    /// The sixteen samples of a tile from `base` on, a multiple of sixteen.
    #[inline(always)]
    pub fn of(samples: &'a TileSamples, base: usize) -> Self {
        Self {
            slope: [block_of(&samples.slope[0], base), block_of(&samples.slope[1], base)],
            lens: [block_of(&samples.lens[0], base), block_of(&samples.lens[1], base)],
            t: block_of(&samples.t, base),
        }
    }
}

#[inline(always)]
pub(crate) fn block_of(array: &[f32], base: usize) -> &[f32; LANES] {
    // Arrays are padded to whole blocks, so the fallback is never used.
    array[base..base + LANES].first_chunk().unwrap_or(&[0.0; LANES])
}

/// Data of sixteen samples in registers, in perspective or in an orthographic view.
#[derive(Clone, Copy)]
pub(crate) struct View<V, const MOTION: bool, const LENS: bool, const PARALLEL: bool = false> {
    pub slope: [V; 2],
    pub lens: [V; 2],
    pub t: V,
}

/// A vertex relative to the samples.
#[derive(Clone, Copy)]
pub(crate) struct Seen<V> {
    pub x: V,
    pub y: V,
    pub w: V,
}

impl<V: Lanes, const MOTION: bool, const LENS: bool, const PARALLEL: bool> View<V, MOTION, LENS, PARALLEL> {
    const HAS_BASE: bool = LENS || PARALLEL;
    const HAS_SLOPE: bool = LENS || !PARALLEL;

    #[inline(always)]
    pub fn load(rows: &SampleRows<'_>) -> Self {
        let zero = V::splat(0.0);
        Self {
            slope: [V::load(rows.slope[0]), V::load(rows.slope[1])],
            lens: if Self::HAS_BASE { [V::load(rows.lens[0]), V::load(rows.lens[1])] } else { [zero; 2] },
            t: if MOTION { V::load(rows.t) } else { zero },
        }
    }

    #[inline(always)]
    pub fn see(&self, corner: &Corner) -> Seen<V> {
        let [mut x, mut y, mut w] =
            [V::splat(corner.open[0]), V::splat(corner.open[1]), V::splat(corner.open[2])];
        if MOTION {
            x = self.t.times_plus(V::splat(corner.delta[0]), x);
            y = self.t.times_plus(V::splat(corner.delta[1]), y);
            w = self.t.times_plus(V::splat(corner.delta[2]), w);
        }
        if Self::HAS_BASE {
            x = x - self.lens[0];
            y = y - self.lens[1];
        }
        if Self::HAS_SLOPE {
            x = self.slope[0].times_from(w, x);
            y = self.slope[1].times_from(w, y);
        }
        Seen { x, y, w }
    }
}

/// Edge functions of a triangle at sixteen samples, and their signs.
pub(crate) struct Crossing<V> {
    edges: [V; 3],
    depths: [V; 3],
    /// Smallest and largest edge function.
    ends: [V; 2],
}

impl<V: Lanes> Crossing<V> {
    #[inline(always)]
    pub fn new<const MOTION: bool, const LENS: bool, const PARALLEL: bool>(
        corners: &[Corner; 3],
        view: &View<V, MOTION, LENS, PARALLEL>,
    ) -> Self {
        let (a, b, c) = (view.see(&corners[0]), view.see(&corners[1]), view.see(&corners[2]));
        let e0 = b.x * c.y - c.x * b.y;
        let e1 = c.x * a.y - a.x * c.y;
        let e2 = a.x * b.y - b.x * a.y;
        let (min, max) = (e0.min(e1).min(e2), e0.max(e1).max(e2));
        Self { edges: [e0, e1, e2], depths: [a.w, b.w, c.w], ends: [min, max] }
    }

    /// Whether any lane is inside or on an edge.
    #[inline(always)]
    pub fn any(&self) -> bool {
        let zero = V::splat(0.0);
        (self.ends[0].ge(zero) | zero.ge(self.ends[1])) != 0
    }

    /// Lanes on an edge or a vertex and outside of no other edge; [`super::exact`] decides them.
    #[inline(always)]
    pub fn tie(&self) -> Mask {
        let zero = V::splat(0.0);
        self.ends[0].equal(zero) | self.ends[1].equal(zero)
    }

    /// Lanes inside that show a drawn face.
    #[inline(always)]
    pub fn shown(&self, faces: [bool; 2]) -> Mask {
        let zero = V::splat(0.0);
        // Uniform branches rather than masks, which the compiler would vectorize.
        let mut shown = 0;
        if faces[0] {
            shown |= self.ends[0].gt(zero);
        }
        if faces[1] {
            shown |= zero.gt(self.ends[1]);
        }
        shown
    }

    /// Barycentric weights of the lanes, extrapolated outside.
    #[inline(always)]
    pub fn weights(&self) -> [V; 3] {
        let [e0, e1, e2] = self.edges;
        let sum = (e0 + e1) + e2;
        [e0 / sum, e1 / sum, e2 / sum]
    }

    /// Depth of the lanes inside.
    #[inline(always)]
    pub fn depth(&self) -> V {
        let ([e0, e1, e2], [a, b, c]) = (self.edges, self.depths);
        let quotient = ((e0 * a + e1 * b) + e2 * c) / ((e0 + e1) + e2);
        // The quotient may leave the range of the vertices by rounding; depth culling relies on the range.
        quotient.max(a.min(b).min(c)).min(a.max(b).max(c))
    }
}
