//! A thin-lens or orthographic camera that may move while the shutter is open.

use glam::{Affine3A, Vec2};
use serde::Serialize;

use super::Clip;

/// A camera looking down `+z` of its own space, `x` to the right and `y` up.
///
/// The pose is given at both ends of the shutter; in between every vertex moves on a straight line, so a
/// camera that turns is a chord of its true path.
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

/// A thin lens. In an orthographic view, where there is none, what it does to the image far away: a point at depth `w` is moved by
/// `radius (w / focus - 1)` scene units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Lens {
    radius: f32,
    focus: f32,
}

/// Why a camera or a lens cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// A value that has to be finite and above zero is not.
    #[error("{what} is {value}; it has to be a finite number above zero")]
    NotPositive {
        /// Which value.
        what: &'static str,
        /// What was given.
        value: f32,
    },
    /// A pose or a shift holds a value that is not finite.
    #[error("{what} holds a value that is not finite")]
    NotFinite {
        /// Which value.
        what: &'static str,
    },
}

fn positive(what: &'static str, value: f32) -> Result<f32, CameraError> {
    if value.is_finite() && value > 0.0 { Ok(value) } else { Err(CameraError::NotPositive { what, value }) }
}

impl Lens {
    /// A lens of `radius` focused at depth `focus`, both in scene units.
    ///
    /// # Errors
    /// When either is not a finite number above zero. A pinhole is a camera without a lens.
    pub fn new(radius: f32, focus: f32) -> Result<Self, CameraError> {
        Ok(Self { radius: positive("lens radius", radius)?, focus: positive("focus depth", focus)? })
    }

    /// Radius in scene units.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Depth in scene units at which everything is sharp.
    pub fn focus(&self) -> f32 {
        self.focus
    }
}

impl Camera {
    /// A still pinhole camera with the world-to-camera transform `pose`. `tan_half_height` is the tangent of
    /// half the vertical field of view; samples nearer than `near` (scene units) are not seen.
    ///
    /// # Errors
    /// When the pose is not finite, or the others are not finite and above zero.
    pub fn new(pose: Affine3A, tan_half_height: f32, near: f32) -> Result<Self, CameraError> {
        let half_height = positive("tangent of half the field of view", tan_half_height)?;
        Self::still(pose, half_height, false, near)
    }

    /// A still camera that sees everything from the same side, at the same size at any depth: `half_height` is half the height of its
    /// view in scene units.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn orthographic(pose: Affine3A, half_height: f32, near: f32) -> Result<Self, CameraError> {
        Self::still(pose, positive("half the height of the view", half_height)?, true, near)
    }

    fn still(pose: Affine3A, half_height: f32, orthographic: bool, near: f32) -> Result<Self, CameraError> {
        let (shift, near) = (Vec2::ZERO, positive("near depth", near)?);
        Self { open: pose, close: pose, half_height, orthographic, shift, lens: None, near, clip: Clip::NONE }
            .moving(pose, pose)
    }

    /// The same camera moving from the world-to-camera transform `open` to `close` over the shutter.
    ///
    /// # Errors
    /// When a pose is not finite.
    pub fn moving(self, open: Affine3A, close: Affine3A) -> Result<Self, CameraError> {
        if open.is_finite() && close.is_finite() {
            Ok(Self { open, close, ..self })
        } else {
            Err(CameraError::NotFinite { what: "camera pose" })
        }
    }

    /// The same camera with a lens, or as a pinhole.
    #[must_use]
    pub fn with_lens(self, lens: Option<Lens>) -> Self {
        Self { lens, ..self }
    }

    /// The same camera with clip planes across lens and shutter: what is drawn is seen there only.
    #[must_use]
    pub fn with_clip(self, clip: Clip) -> Self {
        Self { clip, ..self }
    }

    /// The same camera with an off-centre frustum: `shift` moves the image by that many image heights.
    ///
    /// # Errors
    /// When the shift is not finite.
    pub fn with_shift(self, shift: Vec2) -> Result<Self, CameraError> {
        if shift.is_finite() {
            Ok(Self { shift, ..self })
        } else {
            Err(CameraError::NotFinite { what: "shift" })
        }
    }

    /// World to camera when the shutter opens.
    pub fn open(&self) -> Affine3A {
        self.open
    }

    /// World to camera when the shutter closes.
    pub fn close(&self) -> Affine3A {
        self.close
    }

    /// Half the height of the view: at depth 1 in perspective, which is the tangent of half the vertical field of view, and in scene
    /// units at any depth in an orthographic view.
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

    /// The part of lens and shutter in which anything is drawn.
    pub fn clip(&self) -> Clip {
        self.clip
    }

    /// Depth in scene units below which samples are not seen.
    pub fn near(&self) -> f32 {
        self.near
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
}
