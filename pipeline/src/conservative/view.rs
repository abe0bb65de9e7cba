//! How points of view space appear on the image.

use crate::geometry::Shear;

/// A projection. Points are `[x, y, depth]` in units of tiles' borders (pixels, for instance).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum View {
    /// A point is seen at `(x + u (a_x w - s_x)) / w`, `y` alike, where `w` is its depth: a thin lens with the shear `s`, `a`, or a
    /// pinhole where these are zero. What is nearer than `near` (not below zero) is not seen.
    Perspective {
        /// Projection scale times lens radius.
        s: [f64; 2],
        /// The same over the focus depth.
        a: [f64; 2],
        /// The nearest depth at which anything is seen.
        near: f64,
    },
    /// A point is seen at `x + u (a_x z - s_x)`, `y` alike, where `z` is its depth. What is nearer than `near` is not seen.
    Orthographic {
        /// Projection scale times lens radius.
        s: [f64; 2],
        /// The same over the focus depth.
        a: [f64; 2],
        /// The nearest depth at which anything is seen, perhaps negative infinity.
        near: f64,
    },
}

impl View {
    /// Through a pinhole.
    pub fn pinhole(near: f64) -> Self {
        Self::Perspective { s: [0.0; 2], a: [0.0; 2], near }
    }

    /// At any depth and without a lens.
    pub fn orthographic() -> Self {
        Self::Orthographic { s: [0.0; 2], a: [0.0; 2], near: f64::NEG_INFINITY }
    }

    /// As a camera of the standard mode sees it.
    pub fn of(shear: &Shear, near: f32) -> Self {
        let [s, a] = [shear.s, shear.a].map(|part| part.map(f64::from));
        let near = f64::from(near);
        if shear.parallel { Self::Orthographic { s, a, near } } else { Self::Perspective { s, a, near } }
    }

    /// Whether places on the lens see different things.
    pub fn has_lens(&self) -> bool {
        self.shear() != ([0.0; 2], [0.0; 2])
    }

    pub(super) fn shear(&self) -> ([f64; 2], [f64; 2]) {
        let (Self::Perspective { s, a, .. } | Self::Orthographic { s, a, .. }) = self;
        (*s, *a)
    }

    /// The weight of a point on the homogeneous image plane.
    pub(super) fn weight(&self, depth: f64) -> f64 {
        match self {
            Self::Perspective { .. } => depth,
            Self::Orthographic { .. } => 1.0,
        }
    }

    pub(super) fn near(&self) -> f64 {
        let (Self::Perspective { near, .. } | Self::Orthographic { near, .. }) = self;
        *near
    }
}
