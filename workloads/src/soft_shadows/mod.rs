//! Motion-blurred soft shadows from a 5D shadow map (thesis, Paper VI, section 7).
//!
//! The lens of the light's camera is the area of the light, focused at infinity. All texels share a small
//! fixed set of light and time samples. So the map is an array of ordinary shadow maps, one per `(u, v, t)`.
//! It is made in one pass ([`Method::OnePass`]) or in one pass per sample ([`Method::Accumulation`]). The
//! shading pass uses the same set, and each of its samples reads the map of its own `(u, v, t)`
//! ([`World::image`]).
//!
//! - [`AreaLight`]: the light as a camera.
//! - [`ShadowMap`]: both ways of making a map, and look-ups.
//! - [`VisibleTriangles`]: the triangle that each sample of the image sees, in surfaces.
//! - [`World`]: shading, with a map or with rays as the ground truth.
//! - [`job()`]: the workload; [`default_scene()`]: its default scene.

mod job;
mod light;
mod map;
mod seen;
mod shade;

pub(crate) use job::FLAGS;
pub use job::{SoftShadowOptions, SoftShadows, default_scene, job};
pub use light::{AreaLight, LightSpec};
pub use map::{DepthPass, Method, SceneView, ShadowMap, depth_pass};
pub use seen::VisibleTriangles;
pub use shade::{Shadows, World, look_ups};
