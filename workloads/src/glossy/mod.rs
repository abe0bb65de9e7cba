//! Glossy reflection and refraction on planar receivers (thesis, Paper VI, section 6).
//!
//! The receiver is the focus plane, the near plane and the viewport of a camera with a lens: at the mirrored place of the viewer, or at the
//! place along the plane's normal from which the refracted middle ray comes. Seen through the receiver, what touches it is sharp and
//! what is far from it is blurred. One four-dimensional pass makes the map, pre-filtered by the resolve; the lens radius is the roughness.
//!
//! - [`Receiver`], [`Effect`]: the rectangle, and the eye that looks through it.
//! - [`Map`]: the camera of a map, in [one pass](Map::one_pass), by [accumulation](Map::accumulated), and by
//!   [rays](Map::by_rays), the brute force reference.
//! - [`job`]: the map on its receiver as a job, [`stage`] the scene it draws.

mod job;
mod map;
mod receiver;
mod stage;
mod surface;

pub(crate) use job::FLAGS;
pub use job::{Glossy, Options, job};
pub use map::{Lobe, Map};
pub use receiver::{Effect, Receiver};
pub use stage::{receiver, stage};
pub use surface::ReceiverShader;
