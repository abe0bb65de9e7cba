//! Programs of groups on surfaces that raster passes of the same frame wrote.
//!
//! - [`Kernels`]: the mean luminance of an image by a reduction ([`Chain`]: by a mip chain), its histogram by atomics, and the lights of each tile by the
//!   depths of a pre-pass.
//! - [`ComputeOptions`]: sizes of groups, layouts of shared memory and kinds of atomics; [`Blocks`], [`Order`]: which pixels a lane
//!   works on, and the steps of a tree.
//! - [`job()`]: the workload.

mod block;
mod job;
mod kernels;
mod light_culling;
mod luminance;
mod options;

use pipeline::texture::LUMINANCE;
use pipeline::{GroupLane, SurfaceView};

pub use block::{Blocks, Order};
pub(crate) use job::FLAGS;
pub use job::{ATOMICS_PER_WORD, CHAIN, CYCLES_PER_ACCESS, Chain, Compute, job};
pub use kernels::{Kernels, TileLights};
pub use light_culling::LightSphere;
pub use luminance::{Atomics, bin};
pub use options::{ComputeOptions, Kernel};

/// Luminance of a sample of an image in linear RGB: loads and a dot product.
fn luminance(lane: &GroupLane<'_, '_>, image: &SurfaceView, pixel: [u32; 2], sample: u32) -> f32 {
    lane.dot(lane.texel(image, pixel, sample).truncate(), LUMINANCE)
}
