//! Fast visibility: the visible triangle of every sample, without a model of the hardware.
//!
//! [`crate::frame`] models tile tests one by one, counts them and logs their accesses. Here nothing is
//! logged. Samples are sorted beforehand into packets of sixteen that are close on the screen, on the lens
//! and in time. The hierarchy is bin, cell, block, packet (see `layout`):
//!
//! 1. triangles are set up, sorted front to back and passed to the bins they may touch;
//! 2. in a bin each triangle is bounded over sixteen boxes of lens and time at once (`cells`);
//! 3. in each cell where it may be visible, blocks and then their packets are tested sixteen at once: against
//!    its box, their stored depths and finally its edges;
//! 4. the remaining packets wait in a queue while their samples are prefetched. They are tested sample by
//!    sample, with the kernel of [`crate::sample_test`].
//!
//! The result is that of the sample test on all samples, bit for bit.

mod bin;
mod cells;
mod edges;
mod raster;
mod sorter;

use rayon::prelude::*;

use crate::depth::vertex_range;
use crate::geometry::{Clip, Cull, Geometry, MovingVertex, Projection};
use crate::setup::{PixelRect, SetupResult, Triangle, bounds, distribute, set_up};
use crate::simd::{Width, dispatch};
use cells::Facing;
pub use raster::Tally;
use raster::{BinSurface, Queue, VisibleBinWorker};
pub use sorter::SampleLayout;

/// Visible triangle of every sample of a layout.
#[derive(Clone, Debug)]
pub struct Visibility {
    bins: Vec<BinSurface>,
}

/// Visible triangle of a sample, [`Visibility::NO_TRIANGLE`] for none, and its depth, infinite for none.
pub type VisibleTriangle = (u32, f32);

impl Visibility {
    /// Triangle of a sample without a hit.
    pub const NO_TRIANGLE: u32 = u32::MAX;

    /// Memory for the result of `layout`; reusable.
    pub fn new(layout: &SampleLayout) -> Self {
        Self { bins: layout.bins.par_iter().map(BinSurface::new).collect() }
    }

    /// Result in the order `(y width + x) per_pixel + index`.
    pub fn in_image_order(&self, layout: &SampleLayout) -> Vec<VisibleTriangle> {
        let mut image = vec![(Self::NO_TRIANGLE, f32::INFINITY); layout.samples()];
        for (samples, surface) in layout.bins.iter().zip(&self.bins) {
            let lanes = samples.sample_indices.as_flattened().iter().zip(surface.triangle.as_flattened());
            for ((&sample_index, &triangle), depth) in lanes.zip(surface.depth.iter().flat_map(|row| row.0)) {
                if let Some(index) = layout.in_image(samples, sample_index) {
                    image[index] = (if depth.is_finite() { triangle } else { Self::NO_TRIANGLE }, depth);
                }
            }
        }
        image
    }
}

/// Find the visible triangle of `geometry` at every sample of `layout`.
///
/// # Panics
/// If the geometry has clip planes. The layout already excludes samples outside the camera's clip planes, so
/// clip planes belong to the camera.
pub fn resolve(layout: &SampleLayout, geometry: &Geometry<'_>, cull: Cull, into: &mut Visibility) -> Tally {
    resolve_at(Width::widest(), layout, geometry, cull, into)
}

/// [`resolve`] with vectors of a given width, to check that all widths give the same bytes.
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
                VisibleBinWorker {
                    layout,
                    samples,
                    surface,
                    placed: &placed,
                    list,
                    tally: &mut tally,
                    queue: Queue::new(samples.sample_indices.len()),
                },
            );
            tally
        })
        .sum()
}

/// Set up triangles, and list those of each bin, front to back.
fn front_end(
    layout: &SampleLayout,
    geometry: &Geometry<'_>,
    cull: Cull,
) -> (Vec<Option<BinTriangle>>, Vec<Vec<u32>>) {
    let vertices = layout.projection.images(geometry);
    let (mut spans, mut placed) = (Vec::new(), Vec::new());
    (0..geometry.triangles().len() as u32)
        .into_par_iter()
        .with_min_len(256)
        .map(|id| {
            let corners = geometry.triangles()[id as usize].map(|vertex| &vertices[vertex as usize]);
            set_up_triangle(layout, id, corners, cull).unzip()
        })
        .unzip_into_vecs(&mut spans, &mut placed);
    // Keys are sorted, as triangles are large; at equal depths the lower number comes first.
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

/// Screen bounds of a triangle.
struct Span {
    /// Smallest depth, not negative.
    nearest: f32,
    pixels: PixelRect,
}

/// A triangle set up for all bins.
#[derive(Clone, Debug)]
struct BinTriangle {
    triangle: Triangle,
    facing: Facing,
}

/// Set up a triangle, unless it is invisible.
fn set_up_triangle(
    layout: &SampleLayout,
    id: u32,
    corners: [&MovingVertex; 3],
    cull: Cull,
) -> Option<(Span, BinTriangle)> {
    let Projection { shear, near, .. } = &layout.projection;
    let SetupResult::Ready(triangle) = set_up(id, corners, cull, shear, *near, layout.viewport.half_px())
    else {
        return None;
    };
    let pixels = bounds(&triangle, shear, layout.viewport);
    let nearest = vertex_range(&triangle, [0.0, 1.0])[0].max(0.0);
    let facing = Facing::new(&triangle.corners, shear);
    (!pixels.is_empty()).then_some((Span { nearest, pixels }, BinTriangle { triangle, facing }))
}
