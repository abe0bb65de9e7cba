//! Deferred rendering: a pass writes what light meets at the visible surface of every sample (the G-buffer; Saito and Takahashi,
//! Comprehensible rendering of 3-D shapes, SIGGRAPH 1990), a second one lights it, and a third one makes the image. Forward
//! rendering of the same surfaces under the same lights stands beside it.
//!
//! Positions are not stored: they follow from depth and the ray of a sample. The camera is a still pinhole; objects may move, as every
//! sample has a surface of its own.

mod buffer;
mod job;
mod lights;
mod shaders;

pub use buffer::NormalFormat;
pub use job::{Deferred, DeferredOptions, LightPass, Method, Rate};
pub(crate) use job::{FLAGS, job};
pub use lights::point_lights;
