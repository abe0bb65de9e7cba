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
//!
//! Samples of a table repeat from tile to tile: each of its blocks is sorted once, and bins are put together.

mod cells;
mod raster;
mod sorter;

use std::collections::HashMap;

use rayon::prelude::*;

use crate::depth::vertex_range;
use crate::geometry::{Camera, Clip, Cull, Geometry, MovingVertex, Projection, Shear, Viewport};
use crate::sampling::{Sample, SampleSource, SampleTable};
use crate::setup::{PixelRect, SetupResult, Triangle, bounds, distribute, set_up};
use crate::simd::{Kernel, LANES, Lanes, Row, VectorWidth, dispatch};
use cells::Facing;
pub use raster::StepTally;
use raster::{BinSurface, Queue, VisibleBinWorker};
pub use sorter::SampleLayout;
use sorter::{BinSamples, CellBoxes, Hierarchy, Sorter};

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
pub fn resolve(
    layout: &SampleLayout,
    geometry: &Geometry<'_>,
    cull: Cull,
    into: &mut Visibility,
) -> StepTally {
    resolve_at(VectorWidth::widest(), layout, geometry, cull, into)
}

/// [`resolve`] with vectors of a given width, to check that all widths give the same bytes.
pub fn resolve_at(
    width: VectorWidth,
    layout: &SampleLayout,
    geometry: &Geometry<'_>,
    cull: Cull,
    into: &mut Visibility,
) -> StepTally {
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
    /// Triangle, or [`Visibility::NO_TRIANGLE`], of every sample: pixel by pixel in rows, also of pixels
    /// beyond the image.
    pub triangles: Vec<u32>,
    /// Depth of each; infinite without a triangle.
    pub depths: Vec<f32>,
}

/// Calls `take` with what the samples of each bin see of `count` triangles with these `corners`, and returns
/// the results in the order of bins. Samples are sorted and dropped bin by bin, so those of a bin stay in the
/// caches of the host. The value that `init` makes is for the bins that a worker takes one after another.
/// `None` for an orthographic camera.
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
        ready.bin(VectorWidth::widest(), &layout, (samples, list), surface);
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
        let count = (layout.hierarchy.bin_px.pow(2) * layout.per_pixel) as usize;
        (self.origin, self.side_px) = (samples.origin, layout.hierarchy.bin_px);
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
        Self { placed, lists: distribute(met, layout.viewport, layout.hierarchy.bin_px) }
    }

    /// Finds what the samples of a bin see of the triangles that are listed for it.
    fn bin(
        &self,
        width: VectorWidth,
        layout: &SampleLayout,
        (samples, list): (&BinSamples, &[u32]),
        surface: &mut BinSurface,
    ) -> StepTally {
        let mut tally = StepTally::default();
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

/// Side of a tile in pixels.
const SIDE_PX: u32 = SampleTable::SHIFT_PX;

/// The sorted blocks of a table, by their samples.
struct SortedTiles {
    /// By the address of their samples.
    number: HashMap<usize, usize>,
    tiles: Vec<SortedTile>,
    /// Boxes of lens and time around the samples of all tiles.
    cells: CellBoxes,
}

/// Packets of a tile, in the order of their parts.
struct SortedTile {
    packets: Vec<TilePacket>,
}

/// Sixteen samples of a tile. Lanes without a sample repeat the first one.
struct TilePacket {
    /// Column and row of the block of pixels.
    block: [u32; 2],
    cell: usize,
    /// Position in the pixel, by axis.
    within: [Row; 2],
    /// Column and row of the pixel.
    pixel: [Row; 2],
    /// Lens position, by axis.
    lens: [Row; 2],
    t: Row,
    /// Index in a bin that starts with the tile.
    sample_indices: [u32; LANES],
    /// Lanes with samples.
    len: usize,
}

impl SortedTiles {
    /// Sorts the tiles of the image of `sorter`. `None` if its samples do not repeat, or if packets of a tile
    /// would not be full or not fit into a block.
    pub fn new(sorter: &Sorter<'_>) -> Option<Self> {
        let Sorter { viewport, source, hierarchy, .. } = *sorter;
        let [across, down] = [viewport.width(), viewport.height()].map(|side| side / SIDE_PX);
        let in_tile = Hierarchy {
            block_px: hierarchy.block_px.map(|side| side.min(SIDE_PX)),
            bin_px: SIDE_PX,
            ..*hierarchy
        };
        let (mut number, mut origins) = (HashMap::new(), Vec::new());
        for (column, row) in (0..down).flat_map(|row| (0..across).map(move |column| (column, row))) {
            let origin = [column * SIDE_PX, row * SIDE_PX];
            number.entry(address(source.block_by_time(origin[0], origin[1])?)).or_insert_with(|| {
                origins.push(origin);
                origins.len() - 1
            });
        }
        let in_tiles = Sorter { hierarchy: &in_tile, ..*sorter };
        let tile = |origin| SortedTile::new(&in_tiles, hierarchy.bin_px, origin);
        let tiles: Vec<_> = origins.into_par_iter().map(tile).collect();
        let samples = (in_tile.block_px[0] * in_tile.block_px[1] * source.per_pixel()) as usize;
        let tiles_in_block =
            hierarchy.block_px.map(|side| (side / SIDE_PX).max(1)).iter().product::<u32>() as usize;
        let is_together = |a: &TilePacket, b: &TilePacket| (a.block, a.cell) == (b.block, b.cell);
        let parts = tiles.iter().flat_map(|tile| tile.packets.chunk_by(is_together));
        let most = parts.map(<[_]>::len).max()?;
        let is_good = samples >= LANES * hierarchy.cells() && most * tiles_in_block <= LANES;
        (is_good && sorter.clip == Clip::NONE).then(|| Self { number, cells: cell_boxes(&tiles), tiles })
    }

    /// Fills the bin at `origin`. Returns whether all of its tiles are whole; else it has to be sorted by itself.
    pub fn fill(&self, sorter: &Sorter<'_>, bin: &mut BinSamples, origin: [u32; 2]) -> bool {
        let Sorter { viewport, source, hierarchy, .. } = *sorter;
        let ([across, down], cells) = (hierarchy.blocks(), hierarchy.cells());
        bin.reset(origin, viewport, [(across * down) as usize, cells]);
        bin.cells.clone_from(&self.cells);
        let mut filled = vec![0; bin.boxes.len()];
        let side = hierarchy.bin_px / SIDE_PX;
        for [x, y] in (0..side * side).map(|tile| [tile % side * SIDE_PX, tile / side * SIDE_PX]) {
            let [px, py] = [origin[0] + x, origin[1] + y];
            if px >= viewport.width() || py >= viewport.height() {
                continue;
            }
            let whole = px + SIDE_PX <= viewport.width() && py + SIDE_PX <= viewport.height();
            let block = source.block_by_time(px, py).filter(|_| whole);
            let Some(&number) = block.and_then(|block| self.number.get(&address(block))) else {
                return false;
            };
            let (packets, filled) = (&self.tiles[number].packets[..], &mut filled[..]);
            dispatch(VectorWidth::widest(), Placement { sorter, bin, packets, filled, tile: [x, y] });
        }
        bin.finish_partial();
        true
    }
}

/// Address of a block of samples, which distinguishes it from others.
fn address<T>(block: &T) -> usize {
    std::ptr::from_ref(block).addr()
}

/// Boxes of lens and time around the samples of tiles.
fn cell_boxes(tiles: &[SortedTile]) -> CellBoxes {
    let mut boxes = CellBoxes::default();
    for packet in tiles.iter().flat_map(|tile| &tile.packets) {
        for lane in 0..LANES {
            boxes.u.include(packet.cell, packet.lens[0].0[lane]);
            boxes.v.include(packet.cell, packet.lens[1].0[lane]);
            boxes.t.include(packet.cell, packet.t.0[lane]);
        }
    }
    boxes.finish();
    boxes
}

impl SortedTile {
    /// The tile at `origin`, for bins of `bin_px` pixels squared.
    fn new(sorter: &Sorter<'_>, bin_px: u32, origin: [u32; 2]) -> Self {
        let (bin, source, hierarchy) = (sorter.bin(origin), sorter.source, sorter.hierarchy);
        let per_pixel = source.per_pixel();
        let mut samples = vec![Sample::default(); (SIDE_PX * SIDE_PX * per_pixel) as usize];
        for (pixel, samples) in (0..).zip(samples.chunks_exact_mut(per_pixel as usize)) {
            source.pixel_into(origin[0] + pixel % SIDE_PX, origin[1] + pixel / SIDE_PX, samples);
        }
        let packet = |(number, places): (usize, &[u32; LANES])| {
            let part = number / LANES;
            let (block, cell) = ((part / hierarchy.cells()) as u32, part % hierarchy.cells());
            let block = [block % hierarchy.blocks()[0], block / hierarchy.blocks()[0]];
            TilePacket::new((block, cell, places), &samples, [per_pixel, bin_px])
        };
        Self { packets: bin.sample_indices.iter().enumerate().filter_map(packet).collect() }
    }
}

impl TilePacket {
    /// The samples at these places of a tile; `None` without any.
    fn new(
        (block, cell, places): ([u32; 2], usize, &[u32; LANES]),
        samples: &[Sample],
        [per_pixel, bin_px]: [u32; 2],
    ) -> Option<Self> {
        let len = places.iter().position(|&place| place == BinSamples::NO_SAMPLE).unwrap_or(LANES);
        let all = |of: &dyn Fn(u32) -> f32| {
            Row(std::array::from_fn(|lane| of(places[if lane < len { lane } else { 0 }])))
        };
        let row = |of: fn(&Sample) -> f32| all(&|place| samples.get(place as usize).map_or(0.0, of));
        let in_bin = |place: u32| {
            let (pixel, index) = (place / per_pixel, place % per_pixel);
            (pixel / SIDE_PX * bin_px + pixel % SIDE_PX) * per_pixel + index
        };
        (len > 0).then(|| Self {
            block,
            cell,
            within: [row(|s| s.x), row(|s| s.y)],
            pixel: [
                all(&|place| (place / per_pixel % SIDE_PX) as f32),
                all(&|place| (place / per_pixel / SIDE_PX) as f32),
            ],
            lens: [row(|s| s.u), row(|s| s.v)],
            t: row(|s| s.t),
            sample_indices: places
                .map(|place| if place == BinSamples::NO_SAMPLE { place } else { in_bin(place) }),
            len,
        })
    }

    /// Lowest and highest image position along an axis, with the corner of the tile. The slopes and bases of
    /// the samples are written.
    #[inline(always)]
    fn along<V: Lanes>(
        &self,
        axis: usize,
        corner: f32,
        shear: &Shear,
        [slope, base]: [&mut Row; 2],
    ) -> [f32; 2] {
        // The corner of a pixel is exact.
        let at = (V::splat(corner) + V::load(&self.pixel[axis].0)) + V::load(&self.within[axis].0);
        let lens = V::load(&self.lens[axis].0);
        // As `Shear::ray`, in perspective.
        (at - lens * V::splat(shear.a[axis])).store(&mut slope.0);
        (lens * V::splat(shear.s[axis])).store(&mut base.0);
        [-(V::splat(0.0) - at).largest(), at.largest()]
    }
}

/// Places the packets of the tile at pixel `tile` of a bin. Counts the packets of each cell in a block.
struct Placement<'a, 's> {
    sorter: &'a Sorter<'s>,
    bin: &'a mut BinSamples,
    packets: &'a [TilePacket],
    filled: &'a mut [usize],
    tile: [u32; 2],
}

impl Kernel for Placement<'_, '_> {
    #[inline(always)]
    fn run<V: Lanes>(self) {
        let Self { sorter: Sorter { viewport, source, shear, hierarchy, .. }, bin, packets, filled, tile } =
            self;
        let (cells, across) = (hierarchy.cells(), hierarchy.blocks()[0]);
        let first = (tile[1] * hierarchy.bin_px + tile[0]) * source.per_pixel();
        let corner = [
            Viewport::edge(bin.origin[0] + tile[0], viewport.width()),
            Viewport::edge(bin.origin[1] + tile[1], viewport.height()),
        ];
        let [column, row] = [tile[0] / hierarchy.block_px[0], tile[1] / hierarchy.block_px[1]];
        for packet in packets {
            let block = ((row + packet.block[1]) * across + column + packet.block[0]) as usize;
            let turn = filled[block * cells + packet.cell];
            filled[block * cells + packet.cell] += 1;
            let number = (block * cells + packet.cell) * LANES + turn;
            let into = &mut bin.packets[number];
            let ([slope_x, slope_y], [base_x, base_y]) = (&mut into.slope, &mut into.lens);
            let x = packet.along::<V>(0, corner[0], shear, [slope_x, base_x]);
            let y = packet.along::<V>(1, corner[1], shear, [slope_y, base_y]);
            into.t = packet.t;
            (packet.len..LANES).for_each(|lane| into.clear(lane));
            // No sample stays no sample.
            bin.sample_indices[number] = packet.sample_indices.map(|index| index.saturating_add(first));
            bin.include((block, packet.cell), turn, cells, [x, y]);
        }
    }
}
