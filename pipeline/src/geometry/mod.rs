//! Geometry: cameras, triangles, and their moving vertices on the image plane.
//!
//! Cameras are thin-lens or orthographic, moving while the shutter is open, with clip planes across lens,
//! shutter and image.

mod vertex;

use glam::{Affine3A, Vec2};
use serde::Serialize;

pub use crate::surface::Viewport;
pub use vertex::{Cull, DrawError, Geometry, MovingVertex, Projection, Shear};

/// A camera looking along `+z` of its own space, with `x` to the right and `y` up.
///
/// The pose is given at both ends of the shutter. In between, every vertex moves linearly, so a rotating
/// camera follows a chord of its true path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Camera {
    open: Affine3A,
    close: Affine3A,
    half_height: f32,
    orthographic: bool,
    shift: Vec2,
    lens: Option<Lens>,
    near: f32,
    clip: Clip,
}

/// A thin lens. In an orthographic view it is a shear that moves a point at depth `w` by `radius (w / focus -
/// 1)` scene units, like a distant lens.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Lens {
    radius: f32,
    focus: f32,
}

/// Why a camera or a lens is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// A value is not finite and positive.
    #[error("{what} is {value}; it has to be a finite number above zero")]
    NotPositive {
        /// Name of the value.
        what: &'static str,
        /// Value given.
        value: f32,
    },
    /// A pose or a shift is not finite.
    #[error("{what} holds a value that is not finite")]
    NotFinite {
        /// Name of the value.
        what: &'static str,
    },
}

fn positive(what: &'static str, value: f32) -> Result<f32, CameraError> {
    if value.is_finite() && value > 0.0 { Ok(value) } else { Err(CameraError::NotPositive { what, value }) }
}

impl Lens {
    /// A lens of `radius` focused at depth `focus`, both in scene units. A pinhole is a camera without a
    /// lens.
    ///
    /// # Errors
    /// [`CameraError`] if either is not finite and positive.
    pub fn new(radius: f32, focus: f32) -> Result<Self, CameraError> {
        Ok(Self { radius: positive("lens radius", radius)?, focus: positive("focus depth", focus)? })
    }

    /// Radius in scene units.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Depth in focus, in scene units.
    pub fn focus(&self) -> f32 {
        self.focus
    }
}

impl Camera {
    /// A still pinhole camera with the world-to-camera transform `pose`. `tan_half_height` is the tangent of
    /// half the vertical field of view. Samples nearer than `near` (scene units) are invisible.
    ///
    /// # Errors
    /// [`CameraError`] if the pose is not finite, or another value is not finite and positive.
    pub fn new(pose: Affine3A, tan_half_height: f32, near: f32) -> Result<Self, CameraError> {
        let half_height = positive("tangent of half the field of view", tan_half_height)?;
        Self::still(pose, half_height, false, near)
    }

    /// A still orthographic camera; `half_height` is half the height of its view in scene units.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn orthographic(pose: Affine3A, half_height: f32, near: f32) -> Result<Self, CameraError> {
        Self::still(pose, positive("half the height of the view", half_height)?, true, near)
    }

    /// An orthographic view along `z` of a screen two units high, for passes over a whole surface.
    pub(crate) fn of_screen() -> Self {
        let (open, close) = (Affine3A::IDENTITY, Affine3A::IDENTITY);
        let (orthographic, shift, clip) = (true, Vec2::ZERO, Clip::NONE);
        Self { open, close, half_height: 1.0, orthographic, shift, lens: None, near: 0.5, clip }
    }

    fn still(pose: Affine3A, half_height: f32, orthographic: bool, near: f32) -> Result<Self, CameraError> {
        let (shift, near) = (Vec2::ZERO, positive("near depth", near)?);
        Self { open: pose, close: pose, half_height, orthographic, shift, lens: None, near, clip: Clip::NONE }
            .moving(pose, pose)
    }

    /// The camera moving from the world-to-camera transform `open` to `close` during the shutter.
    ///
    /// # Errors
    /// [`CameraError`] if a pose is not finite.
    pub fn moving(self, open: Affine3A, close: Affine3A) -> Result<Self, CameraError> {
        if open.is_finite() && close.is_finite() {
            Ok(Self { open, close, ..self })
        } else {
            Err(CameraError::NotFinite { what: "camera pose" })
        }
    }

    /// The camera with a lens, or as a pinhole.
    #[must_use]
    pub fn with_lens(self, lens: Option<Lens>) -> Self {
        Self { lens, ..self }
    }

    /// The camera with clip planes across lens and shutter, which limit where draws are visible.
    #[must_use]
    pub fn with_clip(self, clip: Clip) -> Self {
        Self { clip, ..self }
    }

    /// The camera with an off-centre frustum; `shift` moves the image by that many image heights.
    ///
    /// # Errors
    /// [`CameraError`] if the shift is not finite.
    pub fn with_shift(self, shift: Vec2) -> Result<Self, CameraError> {
        if shift.is_finite() {
            Ok(Self { shift, ..self })
        } else {
            Err(CameraError::NotFinite { what: "shift" })
        }
    }

    /// World-to-camera transform when the shutter opens.
    pub fn open(&self) -> Affine3A {
        self.open
    }

    /// World-to-camera transform when the shutter closes.
    pub fn close(&self) -> Affine3A {
        self.close
    }

    /// Half the height of the view. In perspective it is taken at depth 1, the tangent of half the vertical
    /// field of view. In an orthographic view it is in scene units.
    pub fn half_height(&self) -> f32 {
        self.half_height
    }

    /// Whether the view is orthographic.
    pub fn is_orthographic(&self) -> bool {
        self.orthographic
    }

    /// Shift of the image in image heights.
    pub fn shift(&self) -> Vec2 {
        self.shift
    }

    /// The lens, or `None` for a pinhole.
    pub fn lens(&self) -> Option<Lens> {
        self.lens
    }

    /// Part of lens and shutter in which anything is drawn.
    pub fn clip(&self) -> Clip {
        self.clip
    }

    /// Smallest visible depth in scene units.
    pub fn near(&self) -> f32 {
        self.near
    }
}

/// Part of lens, shutter and image in which something is drawn, as a half-open range on each axis. Samples on the
/// lower bound are included, samples on the upper bound are not, so adjacent parts share no sample.
/// (Conservative mode includes both.) An infinite value is no bound; 1 would exclude samples on the rim of
/// the lens.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Clip {
    u: [f32; 2],
    v: [f32; 2],
    t: [f32; 2],
    /// Across and down the image, as shares of its sides.
    image: [[f32; 2]; 2],
}

impl Default for Clip {
    fn default() -> Self {
        Self::NONE
    }
}

impl Clip {
    /// No clip planes.
    pub const NONE: Self = {
        let all = [f32::NEG_INFINITY, f32::INFINITY];
        Self { u: all, v: all, t: all, image: [all; 2] }
    };

    /// Clip planes across `u`, `v` (lens, -1 to 1) and `t` (shutter, 0 to 1), or `None` if a bound is NaN.
    pub fn new(u: [f32; 2], v: [f32; 2], t: [f32; 2]) -> Option<Self> {
        let numbers = [u, v, t].iter().flatten().all(|bound| !bound.is_nan());
        numbers.then_some(Self { u, v, t, ..Self::NONE })
    }

    /// The planes with others across `x` and `y`, shares of the image from its left (0 to 1) and from its
    /// top, or `None` if a bound is NaN. Conservative mode has its scissors instead.
    pub fn across_image(self, x: [f32; 2], y: [f32; 2]) -> Option<Self> {
        let numbers = [x, y].iter().flatten().all(|bound| !bound.is_nan());
        numbers.then_some(Self { image: [x, y], ..self })
    }

    /// First and last included image coordinate on each axis, in pixels from the centre of the image; `None`
    /// without planes there.
    pub fn in_image(&self, viewport: Viewport) -> Option<[[f32; 2]; 2]> {
        let sides = [viewport.width(), viewport.height()].map(f64::from);
        let px = |share: f32, side: f64| ((f64::from(share) - 0.5) * side) as f32;
        let of_axis = |axis: usize| {
            let [lo, hi] = self.image[axis].map(|share| px(share, sides[axis]));
            if hi == f32::INFINITY { [lo, hi] } else { [lo, hi.next_down()] }
        };
        (self.image != Self::NONE.image).then(|| [0, 1].map(of_axis))
    }

    /// First and last included value on each axis, for standard mode.
    pub fn half_open(&self) -> [[f32; 2]; 3] {
        [self.u, self.v, self.t]
            .map(|[lo, hi]| if hi == f32::INFINITY { [lo, hi] } else { [lo, hi.next_down()] })
    }

    /// Whether a lens position and a time are within. Those of a sample count without a lens, too.
    pub fn holds(&self, [u, v]: [f32; 2], t: f32) -> bool {
        [u, v, t].into_iter().zip(self.half_open()).all(|(at, [lo, hi])| lo <= at && at <= hi)
    }

    /// The planes for a rendering at one time and lens position: those across the image, and an empty part of
    /// the shutter if the others exclude it.
    #[must_use]
    pub fn frozen(&self, lens: [f32; 2], t: f32) -> Self {
        let t = if self.holds(lens, t) { Self::NONE.t } else { [0.0; 2] };
        Self { t, image: self.image, ..Self::NONE }
    }

    /// Both bounds, for conservative mode.
    pub fn closed(&self) -> [[f32; 2]; 3] {
        [self.u, self.v, self.t]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_cameras_cannot_be_built() {
        assert!(Camera::new(Affine3A::IDENTITY, 0.5, 0.1).is_ok());
        assert!(Camera::new(Affine3A::IDENTITY, 0.0, 0.1).is_err());
        assert!(Camera::new(Affine3A::IDENTITY, 0.5, f32::NAN).is_err());
        assert!(Camera::new(Affine3A::from_translation(glam::Vec3::splat(f32::INFINITY)), 0.5, 0.1).is_err());
        for bad in [0.0, -1.0, f32::INFINITY, f32::NAN] {
            let error = Camera::orthographic(Affine3A::IDENTITY, bad, 0.1).unwrap_err();
            assert!(error.to_string().contains("half the height of the view is"), "{error}");
            assert!(Camera::orthographic(Affine3A::IDENTITY, 1.0, bad).is_err());
        }
        assert!(Lens::new(0.0, 1.0).is_err());
        assert!(Lens::new(0.1, -1.0).is_err());
    }

    #[test]
    fn parts_side_by_side_share_nothing_and_miss_nothing() {
        let parts = [[f32::NEG_INFINITY, 0.0], [0.0, 0.5], [0.5, f32::INFINITY]];
        let all = [-1.0, 1.0];
        for value in [-1.0, -0.0, 0.0, -f32::MIN_POSITIVE / 4.0, f32::EPSILON, 0.5, 0.5_f32.next_down(), 1.0]
        {
            let owners = parts.iter().filter(|part| {
                let [[lo, hi], ..] = Clip::new(**part, all, all).unwrap().half_open();
                (lo..=hi).contains(&value)
            });
            assert_eq!(owners.count(), 1, "{value}");
        }
        assert_eq!(Clip::new([0.0, f32::NAN], all, all), None);
        assert_eq!(Clip::new(all, all, [0.25, 0.5]).unwrap().closed()[2], [0.25, 0.5]);
    }

    #[test]
    fn a_frozen_clip_draws_everything_or_nothing() {
        let all = [f32::NEG_INFINITY, f32::INFINITY];
        let clip = Clip::new([-0.5, 0.5], all, [0.25, 0.75]).unwrap().across_image([0.0, 0.5], all).unwrap();
        let inside = Clip::NONE.across_image([0.0, 0.5], all).unwrap();
        assert_eq!(clip.frozen([0.0, 0.9], 0.25), inside);
        // Upper bounds are excluded.
        for (lens, t) in [([0.5, 0.0], 0.5), ([0.0; 2], 0.75), ([0.0; 2], 0.0)] {
            let [.., [lo, hi]] = clip.frozen(lens, t).half_open();
            assert!(lo > hi, "{lens:?} {t}");
        }
    }

    #[test]
    fn planes_across_the_image_are_in_pixels_from_its_centre() {
        let viewport = Viewport::new(40, 30).unwrap();
        let open = [f32::NEG_INFINITY, f32::INFINITY];
        let of = |x, y| Clip::NONE.across_image(x, y).unwrap().in_image(viewport);
        assert_eq!(of(open, open), None);
        assert_eq!(of([0.25, 0.5], open), Some([[-10.0, 0.0_f32.next_down()], open]));
        assert_eq!(of(open, [0.5, f32::INFINITY]), Some([open, [0.0, f32::INFINITY]]));
        assert_eq!(Clip::NONE.across_image([0.0, f32::NAN], open), None);
    }
}
