//! Caustics: light that a surface refracts or reflects, followed in beams (thesis, Paper VI, section 4).
//!
//! A *generator* triangle and the light behind each of its corners span a beam, whose sides are bilinear patches. To a
//! rasterizer of five dimensions that is a triangle that moves: the generator when the shutter opens, the far end when it closes. A pixel is in
//! the beam where it is inside all three moving edges at some time, and the exact times say how much light it gathers, so nothing has to be
//! put around the beam. The bodies that others put around it are here, too.
//!
//! - [`optics`]: refraction, reflection and Fresnel's transmission.
//! - [`Beam`]: the warped volume of a generator triangle; [`Beam::inside`]: when a point lies in it.
//! - [`generator`]: beams of an ocean, of a water surface with one wave, of a mirror ring, of a ball lens.
//! - [`Method`]: the moving triangle, and bodies around it: the prism of Ernst et al. (2005), the refined bound of Liktor and Dachsbacher
//!   (2011), the convex hull.
//! - [`Squares`]: the same light by photons, to hold images against.
//! - [`Eye`], [`draw`]: light and shader executions of every pixel, in the volume ([`Light::Volume`]) or on the floor ([`Light::Floor`]).
//!
//! All is drawn orthographically. In perspective a beam may reach behind the camera, and no method here clips.

mod beam;
mod bound;
mod check;
mod cover;
mod cubic;
mod doubt;
mod draw;
mod eye;
pub mod generator;
mod job;
mod light;
pub mod optics;
mod photons;

pub use beam::{Beam, Hit};
pub use bound::Method;
pub use check::{Found, receivers};
pub use doubt::{CROSSED, SQUARES, crossing, doubts};
pub use draw::{Picture, draw};
pub use eye::Eye;
pub(crate) use job::FLAGS;
pub use job::{Look, Options, job};
pub use light::{Floor, Light};
pub use photons::{Squares, error};
