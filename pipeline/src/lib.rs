//! Functional model of a tile-based rasterizer in five dimensions (screen, lens and time).
//!
//! It models *what* happens when triangles are drawn; timing and energy are in other crates. It renders an
//! image and emits the work packets of the modelled hardware with the events they cause (see the crate
//! `activity`).
//!
//! The modules follow the block diagram, in the order of the work:
//!
//! - [`geometry`]: cameras (perspective or orthographic), draws and vertices on the homogeneous image plane,
//! - [`setup`]: triangles ready for traversal,
//! - [`traversal`]: tile tests, which bound the lens positions and times at which a triangle may touch a
//!   tile,
//! - [`sample_test`]: the exact test of a sample against a triangle,
//! - [`random`]: counter-based random numbers,
//! - [`sampling`]: sample positions of every pixel,
//! - [`depth`]: depth intervals and culling,
//! - [`state`]: depth test, stencil test and blending of a draw,
//! - [`shader`], [`shading`] and [`texture`]: shaders and the lanes that run them, the shading grid, and textures,
//! - [`surface`]: images that passes write and read, and their formats,
//! - [`memory`]: caches and addresses,
//! - [`buffer`]: typed data that groups read and write and shaders read,
//! - [`compute`]: groups of lanes with shared memory, buffers, atomics and barriers,
//! - [`conservative`]: the tiles that a triangle may touch, without samples,
//! - [`frame`]: all stages in order.
//!
//! Beside it: [`tally`], numbers that count their operations; [`visibility`], the visible triangle of every
//! sample as fast as the host can, without the model; [`simd`], its vectors.
//!
//! ```
//! use glam::Vec3;
//! use pipeline::Geometry;
//!
//! // A triangle that moves to the right while the shutter is open.
//! let open = [Vec3::new(0.0, 0.0, 3.0), Vec3::new(1.0, 0.0, 3.0), Vec3::new(0.0, 1.0, 3.0)];
//! let close = open.map(|corner| corner + Vec3::X);
//! let geometry = Geometry::new(&open, &close, &[[0, 1, 2]])?;
//! assert_eq!(geometry.triangles().len(), 1);
//! # Ok::<(), pipeline::DrawError>(())
//! ```
//!
//! `examples/triangle.rs` renders it.
//!
//! Guarantees:
//!
//! - *Culling changes nothing*: the image is the same bit for bit with any tests enabled, because a tile test
//!   bounds the sample test's own arithmetic.
//! - *Dropping a dimension changes nothing*: a still triangle is tested without time and a pinhole view
//!   without lens, with equal bytes.
//! - *Watertight*: the sample test is exact for the rounded points it sees, so a shared edge has one owner.
//! - *Deterministic*: the same bytes for any number of threads and any vector width.

pub mod buffer;
pub mod compute;
pub mod conservative;
pub mod depth;
pub mod frame;
pub mod geometry;
pub mod memory;
pub mod random;
pub mod sample_test;
pub mod sampling;
pub mod setup;
pub mod shader;
pub mod shading;
pub mod simd;
pub mod state;
pub mod surface;
pub mod tally;
pub mod texture;
pub mod traversal;
pub mod visibility;

pub use buffer::{Atomic, Buffer, BufferBinding, Word};
pub use compute::{
    ComputeError, ComputePass, ComputeSpec, Fault, Group, GroupLane, GroupShader, SurfaceView,
};
pub use frame::{
    Attachment, Attachments, Binding, ConservativeDraw, ConservativePass, Draw, Features, FrameReport, Gpu,
    IntervalAnswer, IntervalQueries, Lanes, Load, MovingBox, PassError, PassPart, PassReport, PipelineSpec,
    Placement, Primitive, Query, RasterPass, Rendered, ResolvePass, SampledAnswer, SampledAnswers,
    SampledQueries, Settings, Shading, Store, SurfaceId, SurfaceProblem, Target, TileIntervals, TileShader,
    Uses,
};
pub use geometry::{
    Camera, CameraError, Clip, Cull, DrawError, Geometry, Lens, MovingVertex, Shear, Viewport,
};
pub use memory::{CacheSpec, MemorySpec, Replacement};
pub use sampling::{LensShape, SampleSpec, SampleTable};
pub use shader::{Lane, Outputs, Shader, ShadingPoint};
pub use state::{Blend, Clear, ColourState, Compare, DepthState, DrawState, Stencil, StencilFace, StencilOp};
pub use surface::{Format, Layout, SurfaceSpec};
pub use texture::{Texture, TextureError, Wrap, linear_to_srgb8};
