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
mod tiles;

use rayon::prelude::*;

use crate::depth::vertex_range;
use crate::geometry::{Camera, Clip, Cull, Geometry, MovingVertex, Projection, Viewport};
use crate::sampling::SampleSource;
use crate::setup::{PixelRect, SetupResult, Triangle, bounds, distribute, set_up};
use crate::simd::{Width, dispatch};
use bin::BinSamples;
use cells::Facing;
pub use raster::Tally;
use raster::{BinSurface, Queue, VisibleBinWorker};
pub use sorter::SampleLayout;
use tiles::SortedTiles;

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
    let vertices = layout.projection.images(geometry);
    let corners =
        |id: u32| (geometry.triangles()[id as usize].map(|vertex| &vertices[vertex as usize]), cull);
    let ready = FrontEnd::new(layout, geometry.triangles().len() as u32, corners);
    let bins = layout.bins.par_iter().zip(&mut into.bins).zip(&ready.lists);
    bins.map(|((samples, surface), list)| ready.bin(width, layout, (samples, list), surface)).sum()
}

/// Corners of a triangle on the image plane, and its culled faces.
pub(crate) type Placed<'a> = ([&'a MovingVertex; 3], Cull);

/// What the samples of a bin see.
#[derive(Clone, Debug, Default)]
pub(crate) struct SeenBin {
    /// First pixel.
    pub origin: [u32; 2],
    /// Side in pixels, a power of two and at least 16.
    pub side_px: u32,
    /// Triangle, or [`Visibility::NO_TRIANGLE`], of every sample: pixel by pixel in rows, also of pixels beyond the image.
    pub triangles: Vec<u32>,
    /// Depth of each; infinite without a triangle.
    pub depths: Vec<f32>,
}

/// Calls `take` with what the samples of each bin see of `count` triangles with these `corners`, and returns the results in the
/// order of bins. Samples are sorted and dropped bin by bin, so those of a bin stay in the caches of the host. The value that
/// `init` makes is for the bins that a worker takes one after another. `None` for an orthographic camera.
pub(crate) fn bin_by_bin<'a, S, T: Send>(
    (camera, viewport, source): (&Camera, Viewport, &dyn SampleSource),
    (count, moving): (u32, bool),
    corners: impl Fn(u32) -> Placed<'a> + Sync,
    init: impl Fn() -> S + Sync + Send,
    take: impl Fn(&mut S, &SeenBin) -> T + Sync + Send,
) -> Option<Vec<T>> {
    let layout = SampleLayout::unsorted(camera, viewport, source.per_pixel(), moving)?;
    let sorter = layout.sorter(source, camera.clip());
    let ready = FrontEnd::new(&layout, count, corners);
    let bins = (0..layout.bin_count()).into_par_iter().zip(&ready.lists);
    let tiles = SortedTiles::new(&sorter);
    let each = |scratch: &mut Scratch<S>, (bin, list): (u32, &Vec<u32>)| {
        let Scratch { samples, surface, seen, own } = scratch;
        let origin = layout.origin(bin);
        if !tiles.as_ref().is_some_and(|tiles| tiles.fill(&sorter, samples, origin)) {
            sorter.fill(samples, origin);
        }
        let surface = surface.get_or_insert_with(|| BinSurface::new(samples));
        ready.bin(Width::widest(), &layout, (samples, list), surface);
        seen.fill(&layout, samples, surface);
        take(own, seen)
    };
    Some(bins.map_init(|| Scratch::new(init()), each).collect())
}

/// Memory of a worker, which takes bins one after another.
struct Scratch<S> {
    samples: BinSamples,
    surface: Option<BinSurface>,
    seen: SeenBin,
    own: S,
}

impl<S> Scratch<S> {
    fn new(own: S) -> Self {
        Self { samples: BinSamples::default(), surface: None, seen: SeenBin::default(), own }
    }
}

impl SeenBin {
    fn fill(&mut self, layout: &SampleLayout, samples: &BinSamples, surface: &BinSurface) {
        let count = (layout.plan.bin_px.pow(2) * layout.per_pixel) as usize;
        (self.origin, self.side_px) = (samples.origin, layout.plan.bin_px);
        self.triangles.clear();
        self.triangles.resize(count, Visibility::NO_TRIANGLE);
        self.depths.clear();
        self.depths.resize(count, f32::INFINITY);
        for (packet, places) in samples.sample_indices.iter().enumerate() {
            for (lane, &at) in places.iter().enumerate() {
                let depth = surface.depth[packet].0[lane];
                if at != BinSamples::NO_SAMPLE && depth.is_finite() {
                    self.triangles[at as usize] = surface.triangle[packet][lane];
                    self.depths[at as usize] = depth;
                }
            }
        }
    }
}

/// Triangles that were set up, and those of each bin, front to back.
struct FrontEnd {
    placed: Vec<Option<BinTriangle>>,
    lists: Vec<Vec<u32>>,
}

impl FrontEnd {
    /// Sets up `count` triangles with these `corners`.
    fn new<'a>(layout: &SampleLayout, count: u32, corners: impl Fn(u32) -> Placed<'a> + Sync) -> Self {
        let (mut spans, mut placed) = (Vec::new(), Vec::new());
        (0..count)
            .into_par_iter()
            .with_min_len(256)
            .map(|id| set_up_triangle(layout, id, corners(id)).unzip())
            .unzip_into_vecs(&mut spans, &mut placed);
        // Keys are sorted, as triangles are large; at equal depths the lower number comes first.
        let keys = (0_u32..).zip(&spans).filter_map(|(id, span): (u32, &Option<Span>)| {
            span.as_ref().map(|span| u64::from(span.nearest.to_bits()) << 32 | u64::from(id))
        });
        let mut order: Vec<u64> = keys.collect();
        order.sort_unstable();
        let pixels = |id: u32| spans[id as usize].as_ref().map(|span| (id, span.pixels));
        let met = order.iter().filter_map(|&key| pixels(key as u32));
        Self { placed, lists: distribute(met, layout.viewport, layout.plan.bin_px) }
    }

    /// Finds what the samples of a bin see of the triangles that are listed for it.
    fn bin(
        &self,
        width: Width,
        layout: &SampleLayout,
        (samples, list): (&BinSamples, &[u32]),
        surface: &mut BinSurface,
    ) -> Tally {
        let mut tally = Tally::default();
        let queue = Queue::new(samples.sample_indices.len());
        let placed = &self.placed;
        dispatch(
            width,
            VisibleBinWorker { layout, samples, surface, placed, list, tally: &mut tally, queue },
        );
        tally
    }
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
    (corners, cull): Placed<'_>,
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
