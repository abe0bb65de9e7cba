//! Which triangle each sample sees, as fast as it can be found: the rasterizer without the hardware around it.
//!
//! [`crate::frame`] models tile tests one by one, counts them and logs what they touch; here nothing is logged, and samples
//! are sorted beforehand into packets of sixteen that are close on the screen, on the lens and in time. The hierarchy
//! is bin, cell, block, packet (see `plan`):
//!
//! 1. triangles are set up, sorted front to back and handed to the bins they may touch;
//! 2. in a bin each is bounded over sixteen boxes of lens and time at once (`cells`);
//! 3. in each cell where it may be seen, blocks and then their packets are tested sixteen at once: against its box, the depths
//!    they hold and, where that leaves something, its edges;
//! 4. what is left waits in a queue while its samples are fetched, and is tested sample by sample, by the very kernel of
//!    [`crate::sample_test`].
//!
//! The result is that of the sample test on all samples, bit for bit.

mod bin;
mod block;
mod cells;
mod edges;
mod faces;
mod facing;
mod layout;
mod plan;
mod queue;
mod raster;
mod scene;
mod sorter;

use rayon::prelude::*;

use crate::depth::vertex_range;
use crate::geometry::{Clip, Cull, Geometry, MovingVertex, Projection};
use crate::setup::{Outcome, PixelRect, Triangle, bounds, distribute, set_up};
use crate::simd::{Width, dispatch};
use facing::Facing;
pub use layout::SampleLayout;
use queue::Queue;
pub use raster::Tally;
use raster::{BinSurface, Worker};

/// What every sample of a layout sees.
#[derive(Clone, Debug)]
pub struct Visibility {
    bins: Vec<BinSurface>,
}

/// The triangle a sample sees, [`Visibility::NOTHING`] for none, and its depth, infinite for none.
pub type Sighting = (u32, f32);

impl Visibility {
    /// The triangle of a sample that sees none.
    pub const NOTHING: u32 = u32::MAX;

    /// Room for what the samples of `layout` see; may be used again and again.
    pub fn new(layout: &SampleLayout) -> Self {
        Self { bins: layout.bins.par_iter().map(BinSurface::new).collect() }
    }

    /// In the order `(y width + x) per_pixel + index`.
    pub fn in_image_order(&self, layout: &SampleLayout) -> Vec<Sighting> {
        let mut image = vec![(Self::NOTHING, f32::INFINITY); layout.samples()];
        for (samples, surface) in layout.bins.iter().zip(&self.bins) {
            let lanes = samples.places.as_flattened().iter().zip(surface.triangle.as_flattened());
            for ((&place, &triangle), depth) in lanes.zip(surface.depth.iter().flat_map(|row| row.0)) {
                if let Some(index) = layout.in_image(samples, place) {
                    image[index] = (if depth.is_finite() { triangle } else { Self::NOTHING }, depth);
                }
            }
        }
        image
    }
}

/// Finds what every sample of `layout` sees of `geometry`.
///
/// # Panics
/// When the geometry has clip planes of its own: the samples are sorted without those outside, so they belong to the camera.
pub fn resolve(layout: &SampleLayout, geometry: &Geometry<'_>, cull: Cull, into: &mut Visibility) -> Tally {
    resolve_at(Width::widest(), layout, geometry, cull, into)
}

/// The same with vectors of a given width, to show that all give the same bytes.
pub fn resolve_at(
    width: Width,
    layout: &SampleLayout,
    geometry: &Geometry<'_>,
    cull: Cull,
    into: &mut Visibility,
) -> Tally {
    assert_eq!(geometry.clip(), Clip::NONE, "clip planes have to be those of the camera");
    let (placed, lists) = front_end(layout, geometry, cull);
    layout
        .bins
        .par_iter()
        .zip(&mut into.bins)
        .zip(&lists)
        .map(|((samples, surface), list)| {
            let mut tally = Tally::default();
            dispatch(
                width,
                Worker {
                    layout,
                    samples,
                    surface,
                    placed: &placed,
                    list,
                    tally: &mut tally,
                    queue: Queue::new(samples.places.len()),
                },
            );
            tally
        })
        .sum()
}

/// Triangles set up, and those that each bin has to visit, front to back.
fn front_end(
    layout: &SampleLayout,
    geometry: &Geometry<'_>,
    cull: Cull,
) -> (Vec<Option<Placed>>, Vec<Vec<u32>>) {
    let vertices = layout.projection.images(geometry);
    let (mut spans, mut placed) = (Vec::new(), Vec::new());
    (0..geometry.triangles().len() as u32)
        .into_par_iter()
        .with_min_len(256)
        .map(|id| {
            let corners = geometry.triangles()[id as usize].map(|vertex| &vertices[vertex as usize]);
            place(layout, id, corners, cull).unzip()
        })
        .unzip_into_vecs(&mut spans, &mut placed);
    // Keys are sorted, not triangles, which are large; of equal depths the lower number comes first.
    let keys = (0_u32..).zip(&spans).filter_map(|(id, span): (u32, &Option<Span>)| {
        span.as_ref().map(|span| u64::from(span.nearest.to_bits()) << 32 | u64::from(id))
    });
    let mut order: Vec<u64> = keys.collect();
    order.sort_unstable();
    let pixels = |id: u32| spans[id as usize].as_ref().map(|span| (id, span.pixels));
    let lists =
        distribute(order.iter().filter_map(|&key| pixels(key as u32)), layout.viewport, layout.plan.bin_px);
    (placed, lists)
}

/// Where a triangle may be seen.
struct Span {
    /// The smallest depth, not negative.
    nearest: f32,
    pixels: PixelRect,
}

/// A triangle set up for all bins.
#[derive(Clone, Debug)]
struct Placed {
    triangle: Triangle,
    facing: Facing,
}

/// Sets up a triangle, unless it cannot be seen.
fn place(layout: &SampleLayout, id: u32, corners: [&MovingVertex; 3], cull: Cull) -> Option<(Span, Placed)> {
    let Projection { shear, near, .. } = &layout.projection;
    let Outcome::Ready(triangle) = set_up(id, corners, cull, shear, *near, layout.viewport.half_px()) else {
        return None;
    };
    let pixels = bounds(&triangle, shear, layout.viewport);
    let nearest = vertex_range(&triangle, [0.0, 1.0])[0].max(0.0);
    let facing = Facing::new(&triangle.corners, shear);
    (!pixels.is_empty()).then_some((Span { nearest, pixels }, Placed { triangle, facing }))
}
