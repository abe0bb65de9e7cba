//! Which faces a triangle may show in each of sixteen cells.

use super::scene::{Extent, ROUNDING, Scene};
use crate::simd::{Lanes, Mask};

impl Scene<'_> {
    /// The cells in which a clockwise face, and those in which a counter-clockwise one, may be seen.
    #[inline(always)]
    pub fn faces<V: Lanes, const MOTION: bool, const LENS: bool>(
        &self,
        margin: V,
        extent: &Extent<V>,
    ) -> [Mask; 2] {
        let (cells, constant) = (&self.bin.cells, &self.facing.constant);
        let t = V::load(&cells.t.middle.0);
        let mut det = Polynomial::new::<MOTION>(constant, t, extent.t);
        if LENS {
            for (axis, range) in [&cells.u, &cells.v].into_iter().enumerate() {
                let slope = Polynomial::new::<MOTION>(&self.facing.lens[axis], t, extent.t);
                let place = V::load(&range.middle.0);
                det.value = det.value + place * slope.value;
                det.extent = det.extent
                    + place.abs() * slope.extent
                    + extent.lens[axis] * (slope.value.abs() + slope.extent);
                det.magnitude = det.magnitude + slope.magnitude;
            }
        }
        let extent = det.extent + margin + V::splat(ROUNDING) * det.magnitude;
        let zero = V::splat(0.0);
        let mut faces = [!zero.gt(det.value + extent), !(det.value - extent).gt(zero)];
        for (face, drawn) in faces.iter_mut().zip(self.triangle.faces) {
            *face = if drawn { *face } else { 0 };
        }
        faces
    }
}

/// A polynomial in time over a cell.
struct Polynomial<V> {
    /// In the middle.
    value: V,
    /// How far from that it may be anywhere.
    extent: V,
    /// The sum of the magnitudes it is made of.
    magnitude: V,
}

impl<V: Lanes> Polynomial<V> {
    /// By its coefficients, about `t` in either direction by `half`: Taylor's series, which ends.
    #[inline(always)]
    fn new<const MOTION: bool>(coefficients: &[f32], t: V, half: V) -> Self {
        let magnitude = V::splat(coefficients.iter().map(|c| c.abs()).sum());
        if !MOTION {
            return Self { value: V::splat(coefficients[0]), extent: V::splat(0.0), magnitude };
        }
        let cubic = coefficients.get(3).copied().unwrap_or(0.0);
        let [c0, c1] = [V::splat(coefficients[0]), V::splat(coefficients[1])];
        let [c2, c3] = [V::splat(coefficients[2]), V::splat(cubic)];
        let value = ((c3 * t + c2) * t + c1) * t + c0;
        let first = (V::splat(3.0) * c3 * t + V::splat(2.0) * c2) * t + c1;
        let second = V::splat(3.0) * c3 * t + c2;
        let extent = ((c3.abs() * half + second.abs()) * half + first.abs()) * half;
        Self { value, extent, magnitude }
    }
}
