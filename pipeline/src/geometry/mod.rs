//! Geometry: cameras, triangles, and their moving vertices on the image plane.

mod camera;
mod vertex;

pub use camera::{Camera, CameraError, Clip, Lens};
pub use vertex::{Cull, DrawError, Geometry, MovingVertex, Projection, Shear};

pub use crate::viewport::Viewport;
