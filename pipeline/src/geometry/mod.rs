//! What is drawn and from where: cameras, triangles and the moving vertices they become.

mod camera;
mod clip;
mod triangles;
mod vertex;

pub use camera::{Camera, CameraError, Lens};
pub use clip::Clip;
pub use triangles::{Cull, DrawError, Geometry};
pub use vertex::{MovingVertex, Projection, Shear, Viewport};
