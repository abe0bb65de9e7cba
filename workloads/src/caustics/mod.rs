//! Caustics: light refracted or reflected by a surface, in light volumes (thesis, Paper VI, section 4).
//!
//! A *generator* triangle and the light behind each of its corners span a beam, whose sides are bilinear
//! patches. For a 5D rasterizer the beam is a moving triangle: the generator at shutter open, the far end at
//! shutter close. A pixel is in the beam if it is inside all three moving edges at some time. The exact times
//! give the light that it gathers, so no bounding volume is needed. The bounding volumes of earlier methods
//! are included for comparison.
//!

//! - [`Beam`]: the light volume of a generator triangle; [`Beam::inside`]: when a point lies in it.
//! - [`generator`]: beams of an ocean, of a water surface with one wave, of a mirror ring, of a ball lens.
//! - [`Method`]: the moving triangle, and bounding volumes: the prism of Ernst et al. (2005), the refined
//!   bound of Liktor and Dachsbacher (2011), the convex hull.
//! - [`Squares`]: the same light by photons, as a reference for images.
//! - [`Eye`], [`draw()`]: light and shader executions of every pixel, in the volume ([`Light::Volume`]) or on
//!   the floor ([`Light::Floor`]).
//!
//! All views are orthographic. In perspective a beam may reach behind the camera, and no method here clips.

mod beam;
mod bound;
mod check;
mod draw;
pub mod generator;
mod job;
mod light;
mod photons;
mod shader;

pub use beam::{Beam, Hit};
pub use bound::Method;
pub use check::{Coverage, MAX_CROSSED_SHARE, MIN_SQUARES_PER_WAVE, accuracy_warnings, crossing, receivers};
pub use draw::{Picture, draw};

pub(crate) use job::FLAGS;
pub use job::{CausticsOptions, LightView, job};
pub use light::{Eye, Floor, Light};
pub use photons::{Squares, error};
pub use shader::draw_on;
