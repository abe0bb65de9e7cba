//! Geometry: cameras, triangles, and their moving vertices on the image plane.

mod camera;
mod triangles;
mod vertex;

pub use camera::{Camera, CameraError, Clip, Lens};
pub use triangles::{Cull, DrawError, Geometry};
pub use vertex::{MovingVertex, Projection, Shear, Viewport};
