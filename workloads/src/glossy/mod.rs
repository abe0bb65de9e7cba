//! Glossy reflection and refraction on planar receivers (thesis, Paper VI, section 6).
//!
//! The receiver is the focus plane, the near plane and the viewport of a camera with a lens. The camera is at
//! the mirrored position of the viewer, or at the position along the plane's normal that the refracted
//! central ray comes from. Objects that touch the receiver are sharp, and far ones are blurred. One 4D pass
//! makes the map, filtered by the resolve. The lens radius is the roughness.
//!
//! - [`Receiver`], [`Effect`]: the rectangle, and the camera position for it; [`ReceiverShader`]: its
//!   shading.
//! - [`Map`]: the map in [one pass](Map::one_pass), by [accumulation](Map::accumulated), and by
//!   [rays](Map::by_rays), the brute-force reference.
//! - [`job()`]: the workload; [`default_scene()`]: its scene.

mod job;
mod map;
mod receiver;

pub(crate) use job::FLAGS;
pub use job::{Glossy, GlossyOptions, default_scene, job, receiver};
pub use map::{Lobe, Map};
pub use receiver::{Effect, Receiver, ReceiverShader};
