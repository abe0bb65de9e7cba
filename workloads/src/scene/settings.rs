//! Render settings of a scene, and the changes by a command line.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::error::LoadError;

/// Size of the image, sampling, time and lens.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneSettings {
    /// Width of the image in pixels, 1 to 16384.
    pub width: u32,
    /// Height of the image in pixels, 1 to 16384.
    pub height: u32,
    /// Samples in a pixel, 1 to 256.
    pub samples: u32,
    /// Frames in a second of the scene's time.
    pub frame_rate_hz: f64,
    /// Open time of the shutter, as a fraction of the frame period, 0 to 1.
    pub shutter: f64,
    /// Frames to render; frame `i` opens its shutter at `i / frame_rate_hz`.
    pub frames: Range<u32>,
    /// Radius of the lens in scene units; zero is a pinhole.
    pub lens_radius: f32,
    /// Depth in scene units at which the lens is sharp; without it the camera's target is, or, for cameras
    /// that have none, the centre of the scene.
    pub focus: Option<f32>,
    /// Name or file of a sample table.
    pub table: String,
}

impl Default for SceneSettings {
    fn default() -> Self {
        Self {
            width: 1280,
            height: 720,
            samples: 8,
            frame_rate_hz: 60.0,
            shutter: 0.5,
            frames: 0..1,
            lens_radius: 0.0,
            focus: None,
            table: "owen".to_owned(),
        }
    }
}

/// Changes to [`SceneSettings`], clip and camera; `None` keeps the scene's value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Overrides {
    /// Width and height of the image in pixels.
    pub size: Option<(u32, u32)>,
    /// Samples per pixel.
    pub samples: Option<u32>,
    /// Frames in a second.
    pub frame_rate_hz: Option<f64>,
    /// Fraction of the frame period for which the shutter is open.
    pub shutter: Option<f64>,
    /// Frames to render.
    pub frames: Option<Range<u32>>,
    /// Radius of the lens in scene units; zero for a pinhole.
    pub lens_radius: Option<f32>,
    /// Focus depth in scene units.
    pub focus: Option<f32>,
    /// Name or file of a sample table.
    pub table: Option<String>,
    /// Name or index of an animation clip of a glTF scene.
    pub clip: Option<String>,
    /// Name or number of one of the scene's own cameras, or a description: see
    /// [`CameraSpec::flag`](super::CameraSpec::flag).
    pub camera: Option<String>,
}

/// The largest frame number: times stay exact to well below a microsecond.
pub(super) const LAST_FRAME: u32 = 10_000_000;

impl SceneSettings {
    /// These settings with the changes in `overrides`.
    ///
    /// # Errors
    /// [`LoadError::Setting`] if a value is invalid.
    pub fn with(&self, overrides: &Overrides) -> Result<Self, LoadError> {
        let (width, height) = overrides.size.unwrap_or((self.width, self.height));
        let changed = Self {
            width,
            height,
            samples: overrides.samples.unwrap_or(self.samples),
            frame_rate_hz: overrides.frame_rate_hz.unwrap_or(self.frame_rate_hz),
            shutter: overrides.shutter.unwrap_or(self.shutter),
            frames: overrides.frames.clone().unwrap_or_else(|| self.frames.clone()),
            lens_radius: overrides.lens_radius.unwrap_or(self.lens_radius),
            // An explicit pinhole removes the focus depth of the scene's lens.
            table: overrides.table.clone().unwrap_or_else(|| self.table.clone()),
            focus: overrides.focus.or(self.focus.filter(|_| overrides.lens_radius != Some(0.0))),
        };
        changed.check().map(|()| changed)
    }

    /// Checks every value.
    ///
    /// # Errors
    /// [`LoadError::Setting`] with the first invalid value.
    pub fn check(&self) -> Result<(), LoadError> {
        let side = 1..=16_384;
        ensure(side.contains(&self.width) && side.contains(&self.height), "size", || {
            format!("{}x{}: each side has to be 1 to 16384 pixels", self.width, self.height)
        })?;
        ensure((1..=256).contains(&self.samples), "samples", || {
            format!("{}: a pixel takes 1 to 256 samples", self.samples)
        })?;
        let rate = self.frame_rate_hz;
        ensure((1e-3..=1e6).contains(&rate), "frame_rate_hz", || {
            format!("{rate:e}: the frame rate has to be 0.001 to 1000000 frames per second")
        })?;
        ensure((0.0..=1.0).contains(&self.shutter), "shutter", || {
            format!("{}: the shutter is open for a fraction of the frame, 0 to 1", self.shutter)
        })?;
        self.check_frames()?;
        self.check_lens()
    }

    fn check_frames(&self) -> Result<(), LoadError> {
        let Range { start, end } = self.frames;
        ensure(start < end, "frames", || {
            format!("{start}..{end} is empty: the end, which is not rendered, has to lie above the start")
        })?;
        ensure(end <= LAST_FRAME, "frames", || format!("{start}..{end}: frames go up to {LAST_FRAME}"))
    }

    fn check_lens(&self) -> Result<(), LoadError> {
        let radius = self.lens_radius;
        ensure(radius.is_finite() && radius >= 0.0, "lens", || {
            format!("{radius}: the radius of the lens has to be a finite number, zero for a pinhole")
        })?;
        let Some(focus) = self.focus else { return Ok(()) };
        ensure(focus.is_finite() && focus > 0.0, "focus", || {
            format!("{focus}: the focus depth has to be a finite number above zero")
        })?;
        ensure(radius > 0.0, "focus", || {
            format!(
                "{focus}, but there is no lens to focus: give a lens radius above zero, too, or leave it out"
            )
        })
    }
}

fn ensure(holds: bool, setting: &'static str, message: impl FnOnce() -> String) -> Result<(), LoadError> {
    if holds { Ok(()) } else { Err(LoadError::Setting { setting, message: message() }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bad_override_is_a_usage_error_that_names_itself() {
        let none = Overrides::default;
        let bad = [
            ("size", Overrides { size: Some((0, 480)), ..none() }),
            ("samples", Overrides { samples: Some(0), ..none() }),
            ("frame_rate_hz", Overrides { frame_rate_hz: Some(-60.0), ..none() }),
            ("frame_rate_hz", Overrides { frame_rate_hz: Some(f64::NAN), ..none() }),
            ("shutter", Overrides { shutter: Some(1.5), ..none() }),
            ("frames", Overrides { frames: Some(4..4), ..none() }),
            ("lens", Overrides { lens_radius: Some(-0.1), ..none() }),
            ("focus", Overrides { focus: Some(2.0), ..none() }),
            ("focus", Overrides { focus: Some(0.0), lens_radius: Some(0.1), ..none() }),
        ];
        for (name, overrides) in bad {
            let error = SceneSettings::default().with(&overrides).unwrap_err();
            assert!(error.is_usage());
            assert!(error.to_string().contains(name), "{error}");
        }
    }

    #[test]
    fn a_pinhole_on_request_drops_the_focus() {
        let lens = SceneSettings { lens_radius: 0.1, focus: Some(3.0), ..SceneSettings::default() };
        let pinhole = lens.with(&Overrides { lens_radius: Some(0.0), ..Overrides::default() }).unwrap();
        assert_eq!((pinhole.lens_radius, pinhole.focus), (0.0, None));
    }
}
