//! A tile-based rasterizer in five dimensions (screen, lens, time) as a functional model.
//!
//! It says *what* happens when triangles are drawn, never when or at what cost in joules: it renders an image and emits
//! the work packets of the modelled hardware, each with the events it causes (see the crate `activity`).
//!
//! The folders are the block diagram, in the order of the work:
//!
//! - [`geometry`]: cameras (perspective or orthographic), draws and vertices on the homogeneous image plane,
//! - [`setup`]: triangles ready for traversal,
//! - [`traversal`]: tile tests, which bound where in lens and time a triangle may touch a tile,
//! - [`sample_test`]: the exact test of a sample against a triangle,
//! - [`random`]: counter-based random numbers,
//! - [`sampling`]: where and when each pixel looks,
//! - [`depth`]: depth intervals and culling,
//! - [`shading`] and [`texture`]: the shading grid, shaders and textures,
//! - [`memory`]: caches and addresses,
//! - [`conservative`]: the tiles a triangle may touch, without samples,
//! - [`frame`]: all of it in order.
//!
//! What it guarantees:
//!
//! - *Culling changes nothing*: the image is the same bit for bit whichever tests are switched on, because a tile test
//!   bounds the sample test's own arithmetic.
//! - *Dropping a dimension changes nothing*: a still triangle takes the path without time and a pinhole the one without
//!   lens, with equal bytes.
//! - *Watertight*: the sample test is exact for the rounded points it sees, so a shared edge has one owner.
//! - *Deterministic*: the same bytes for any number of threads and any vector width.

pub mod conservative;
pub mod depth;
pub mod frame;
pub mod geometry;
pub mod memory;
pub mod random;
pub mod sample_test;
pub mod sampling;
pub mod setup;
pub mod shading;
pub mod simd;
pub mod texture;
pub mod traversal;
pub mod visibility;

pub use frame::{Draw, Features, PipelineSpec, Rendered, Settings, Shading, render};
pub use geometry::{
    Camera, CameraError, Clip, Cull, DrawError, Geometry, Lens, MovingVertex, Shear, Viewport,
};
pub use memory::{CacheSpec, MemorySpec, Replacement};
pub use sampling::{LensShape, SampleSpec, SampleTable};
pub use shading::{Shader, ShaderCost, ShadingPoint};
pub use texture::{Texture, TextureError, Wrap, linear_to_srgb8};
