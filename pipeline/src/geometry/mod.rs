//! What is drawn and from where: cameras, draws and the moving vertices they become.

mod camera;
mod clip;
mod draw;
mod vertex;

pub use camera::{Camera, CameraError, Lens};
pub use clip::Clip;
pub use draw::{Cull, Draw, DrawError, Geometry};
pub use vertex::{MovingVertex, Projection, Shear, Viewport};
