//! Motion-blurred soft shadows from a five-dimensional shadow map (thesis, Paper VI, section 7).
//!
//! The lens of the light's camera is the area of the light, focused at infinity, and all texels share a small fixed set of places on
//! it and in time. So the map is an array of ordinary shadow maps, one for each `(u, v, t)`, made in one pass ([`Method::OnePass`])
//! rather than in as many ([`Method::Accumulation`]). The pass that is shaded has the same set, and each of its
//! samples looks into the map of its own `(u, v, t)` ([`World::image`]).
//!
//! - [`AreaLight`]: the light and where it sees a point.
//! - [`ShadowMap`]: both ways of making one, and looking into it.
//! - [`World`]: what is shaded: by a map, or by rays as the truth.
//! - [`job`]: all of it as a job, [`stage`] the scene it draws unless told otherwise.

mod job;
mod light;
mod look_up;
mod map;
mod sees;
mod shade;
mod stage;

pub(crate) use job::FLAGS;
pub use job::{Options, SoftShadows, job};
pub use light::{AreaLight, LightSpec};
pub use look_up::look_up_packets;
pub use map::ShadowMap;
pub use sees::{Method, Seen, see};
pub use shade::{Shadows, World};
pub use stage::stage;
