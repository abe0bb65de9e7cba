//! Which triangle each sample sees, as fast as it can be found: the rasterizer without the hardware around it.
//!
//! [`crate::frame`] models tile tests one by one, counts them and logs what they touch; here nothing is logged, and samples
//! are sorted beforehand into packets of sixteen that are close on the screen, on the lens and in time. The hierarchy
//! is bin, cell, block, packet (see `plan`):
//!
//! 1. triangles are set up, sorted front to back and handed to the bins they may touch;
//! 2. in a bin each is bounded over sixteen boxes of lens and time at once (`cells`);
//! 3. in each cell where it may be seen, sixteen packets at once are tested against its edges and the depths they hold;
//! 4. what is left is tested sample by sample, by the very kernel of [`crate::sample_test`].
//!
//! The result is that of the sample test on all samples, bit for bit.

mod cells;
mod edges;
mod faces;
mod facing;
mod layout;
mod plan;
mod raster;
mod sorter;

use rayon::prelude::*;

use crate::depth::vertex_range;
use crate::geometry::{Cull, Geometry};
use crate::setup::{Outcome, bounds, distribute, set_up};
use crate::simd::{Width, dispatch};
use facing::Facing;
pub use layout::SampleLayout;
pub use raster::Tally;
use raster::{BinSurface, Ready, Worker};

/// What every sample of a layout sees.
#[derive(Clone, Debug)]
pub struct Visibility {
    bins: Vec<BinSurface>,
}

/// The triangle a sample sees, [`Visibility::NOTHING`] for none, and its depth, infinite for none.
pub type Sighting = (u32, f32);

impl Visibility {
    /// The triangle of a sample that sees none.
    pub const NOTHING: u32 = BinSurface::NOTHING;

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
                    image[index] = (triangle, depth);
                }
            }
        }
        image
    }
}

/// Finds what every sample of `layout` sees of `geometry`.
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
    let (ready, lists) = front_end(layout, geometry, cull);
    layout
        .bins
        .par_iter()
        .zip(&mut into.bins)
        .zip(&lists)
        .map(|((samples, surface), list)| {
            let mut tally = Tally::default();
            dispatch(width, Worker { layout, samples, surface, ready: &ready, list, tally: &mut tally });
            tally
        })
        .sum()
}

/// Triangles that have to be visited, front to back, and those of them each bin has to visit.
fn front_end(layout: &SampleLayout, geometry: &Geometry<'_>, cull: Cull) -> (Vec<Ready>, Vec<Vec<u32>>) {
    let vertices = layout.projection.images(geometry);
    let mut placed: Vec<_> = (0..geometry.triangles().len() as u32)
        .into_par_iter()
        .with_min_len(256)
        .filter_map(|id| {
            let corners = geometry.triangles()[id as usize].map(|vertex| &vertices[vertex as usize]);
            let projection = &layout.projection;
            let Outcome::Ready(triangle) =
                set_up(id, corners, cull, &projection.shear, projection.near, layout.viewport.half_px())
            else {
                return None;
            };
            let pixels = bounds(&triangle, &projection.shear, layout.viewport);
            let nearest = vertex_range(&triangle, [0.0, 1.0])[0].max(0.0);
            let facing = Facing::new(&triangle.corners, &projection.shear);
            (!pixels.is_empty()).then_some((nearest.to_bits(), pixels, Ready { triangle, facing }))
        })
        .collect();
    placed.sort_unstable_by_key(|(nearest, _, ready)| (*nearest, ready.triangle.id));
    let rects = placed.iter().map(|(_, pixels, _)| *pixels);
    let lists = distribute(rects, layout.viewport, layout.plan.bin_px);
    (placed.into_iter().map(|(_, _, ready)| ready).collect(), lists)
}
