//! Scenes and workloads of the pipeline.
//!
//! - [`load`] loads a scene by name or path: built in, RON, glTF 2.0, OBJ, PLY, OFF or STL.
//! - [`Scene`] gives, for every frame, the camera and all meshes at both ends of the shutter ([`Frame`]);
//!   [`Frame::draws`] passes them to the pipeline.
//! - [`scene`] has the parts of a scene, for programs that build their own; [`shapes`] makes solids.
//! - [`points`] makes random points: Poisson disk points, points in volumes, white noise.
//! - [`job`] is work beyond one rendering of a scene; [`catalog`] finds a job by name.
//! - [`caustics`] draws refracted and reflected light, with light volumes as moving triangles.
//! - [`compute`] runs groups of lanes on what raster passes drew.
//! - [`glossy`] draws glossy reflections and refractions on planar receivers.
//! - [`multiview`] draws stereo and multi-view images in one pass.
//! - [`soft_shadows`] draws motion-blurred shadows of area lights; [`accumulation`] is the method for
//!   comparison.
//! - [`collision`] finds the pairs of moving objects that may collide.
//! - [`occlusion`] finds objects that are hidden at all times and from all of the lens.
//! - [`deferred`] draws a G-buffer and lights it, beside forward rendering with the same lights.
//! - [`Material`] is the look of a surface, [`material::SurfaceShader`] its cost; [`material::Lighting`] is
//!   its light.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scene = workloads::load("tiny")?;
//! for index in scene.settings().frames.clone() {
//!     let frame = scene.frame(index)?;
//!     let draws = frame.draws(&scene)?;
//!     assert!(draws.len() > 1 && frame.camera.lens().is_some());
//! }
//! # Ok(())
//! # }
//! ```
//!
//! World space is that of glTF: right-handed, y up. Camera space is x right, y up, z forward. Scenes are
//! deterministic: the same file gives the same bits on every machine.

pub mod accumulation;
mod bounded;
mod builtin;
mod bvh;
pub mod catalog;
pub mod caustics;
pub mod collision;
pub mod compute;
pub mod deferred;
mod error;
pub mod glossy;
mod import;
pub mod job;
pub mod material;
pub mod multiview;
pub mod occlusion;
pub mod points;
mod regime;
mod rendering;
mod samples;
pub mod scene;
pub mod shapes;
pub mod soft_shadows;
pub mod stress;
pub mod visibility;

pub use builtin::builtin_names;
pub use error::LoadError;
pub use import::{load, load_text};
pub use job::Job;
pub use job::{Fingerprint, FingerprintError};
pub use material::{Alpha, Light, Material};
pub use regime::Regime;
pub use rendering::{Rendering, write_hits};
pub use samples::{FixedSamples, SampleChoice, write_samples};
pub use scene::{Frame, FrameError, FrameMesh, Overrides, Scene, SceneSettings};
