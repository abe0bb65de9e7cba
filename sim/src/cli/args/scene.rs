//! Flags that change settings and camera of a scene.

use std::ops::Range;

use clap::Args;
use workloads::Overrides;

use crate::cli::parse::{depth, frames, lens, per_pixel, shutter, size};
use crate::cli::quantity::rate;

/// Changes to a scene's settings and its camera.
#[derive(Debug, Args)]
pub struct SceneArgs {
    /// Frames to render, the end not included
    #[arg(long, value_name = "A..B", value_parser = frames)]
    pub frames: Option<Range<u32>>,
    /// Samples per pixel, 1 to 256
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = per_pixel)]
    pub samples: Option<u32>,
    /// Sample table: a built-in one (see `quintile list`), a description in a .ron file, or samples in a .smp
    /// file
    #[arg(long, value_name = "TABLE")]
    pub table: Option<String>,
    /// Size of the image in pixels
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<(u32, u32)>,
    /// Frame rate of scene and display, in Hz
    #[arg(long, value_name = "HZ", allow_hyphen_values = true, value_parser = rate)]
    pub rate: Option<f64>,
    /// Radius of the lens in scene units, 0 for a pinhole
    #[arg(long, value_name = "R", allow_hyphen_values = true, value_parser = lens)]
    pub lens: Option<f32>,
    /// Depth in scene units that is in focus
    #[arg(long, value_name = "F", allow_hyphen_values = true, value_parser = depth)]
    pub focus: Option<f32>,
    /// Open time of the shutter as a share of the frame period, 0 to 1
    #[arg(long, value_name = "S", allow_hyphen_values = true, value_parser = shutter)]
    pub shutter: Option<f64>,
    /// Animation of a glTF scene, by name or number
    #[arg(long, value_name = "CLIP")]
    pub clip: Option<String>,
    /// The camera: one of the scene's own by name or number, `inside` or `outside` for automatic placement, a
    /// .ron file, or a description in the RON of scene files such as 'position: (1, 2, 3), target: (0, 0, 0),
    /// fov_deg: 40'. `quintile info` prints the one in use
    #[arg(long, value_name = "CAMERA", allow_hyphen_values = true)]
    pub camera: Option<String>,
}

impl SceneArgs {
    /// The changes as overrides of the scene's settings.
    pub fn overrides(&self) -> Overrides {
        Overrides {
            size: self.size,
            samples: self.samples,
            frame_rate_hz: self.rate,
            shutter: self.shutter,
            frames: self.frames.clone(),
            lens_radius: self.lens,
            focus: self.focus,
            clip: self.clip.clone(),
            camera: self.camera.clone(),
            table: self.table.clone(),
        }
    }
}
