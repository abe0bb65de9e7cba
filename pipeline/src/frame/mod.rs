//! Frame: settings of the modelled hardware, and passes through the whole pipeline, each from vertices,
//! set-up, bins and tiles to the replay and the image.

mod attachments;
mod bin;
mod cells;
mod conservative_pass;
mod dispatch;
mod fragments;
mod gpu;
mod heat;
mod lanes;
mod pass;
mod query;
mod replay;
mod resolve;
mod resolve_pass;
mod seen;
mod shaded;
mod test_selection;
mod tile_tests;
mod worker;

use std::ops::Range;

use activity::{Event, LineAccess, Packet, PacketKind};
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::compute::ComputeSpec;
use crate::depth::{BoxGrid, DepthSpec};
use crate::geometry::Viewport;
use crate::memory::{Cache, CacheError, CacheSpec, MemorySpec};
use crate::sampling::SampleSource;
use crate::setup::{PixelRect, SetupResult, Triangle, bounds, distribute, is_flat, set_up_counted};
use crate::traversal::{self, BLUR_MADDS, Box5, LensLines, TimePieces, motion_madds};
pub use attachments::{
    Attachment, Attachments, Binding, Load, PassError, PassPart, Store, SurfaceId, SurfaceProblem,
};
use bin::{Bin, BinLog};
pub use conservative_pass::{ConservativeDraw, ConservativePass, Primitive, TileIntervals, TileShader};
pub use gpu::{FrameReport, Gpu, PassReport, Rendered};
pub use heat::{HeatMap, Placement, TileHeat};
pub use lanes::Lanes;
pub use pass::{Draw, Query, RasterPass, Resident, Target};
use pass::{Pass, Staged};
pub use query::{IntervalAnswer, IntervalQueries, MovingBox, SampledAnswer, SampledAnswers, SampledQueries};
use replay::Replay;
pub use resolve_pass::ResolvePass;
use test_selection::TestSelector;
use worker::BinWorker;

/// A unit of finished work, in the order of the modelled hardware.
enum Finished<'a> {
    /// A packet and its lines.
    Packet(&'a Packet, &'a [LineAccess]),
    /// Work of a batch in a bin, with the bin's number.
    Tests(usize, &'a Bin, &'a BinLog),
}

/// Process every batch: front end, bins, and replay of the work of the tiles. Bins are double buffered: the
/// front end works on the next batch while tiles are traversed, so its packets come one batch ahead. After
/// the last batch each bin is resolved at once, while its samples are still in the caches.
fn rasterize<F: FnMut(Finished<'_>)>(pass: &Pass<'_>, replay: &mut Replay<'_>, done: &mut F) -> Vec<Bin> {
    let mut bins = Bin::all(pass);
    let mut batches = pass.batches();
    let mut batch = 0;
    // Without triangles there is still an image to resolve.
    let first = batches.next().unwrap_or(0..0);
    let front_end = |batch, replay: &mut Replay<'_>, done: &mut F| {
        let emit = &mut |packet: &Packet, lines: &[LineAccess]| done(Finished::Packet(packet, lines));
        front_end(pass, batch, replay, emit)
    };
    let mut next = Some(front_end(first, replay, done));
    while let Some(ready) = next {
        next = batches.next().map(|batch| front_end(batch, replay, done));
        let lists = distribute(
            (0..).zip(ready.iter().map(|ready| ready.pixels)),
            pass.settings.viewport,
            pass.settings.spec.coarse_tile_px,
        );
        let logs = rasterize_bins(pass, &mut bins, &ready, &lists);
        let last =
            if next.is_none() && pass.shades_last() { shade_bins(pass, &mut bins) } else { Vec::new() };
        for ((bin, log), number) in bins.iter().zip(&logs).zip(0..) {
            for log in [Some(log), last.get(number)].into_iter().flatten() {
                done(Finished::Tests(number, bin, log));
                let emit = &mut |packet: &Packet, lines: &[LineAccess]| done(Finished::Packet(packet, lines));
                replay.bin(batch, (number, &lists[number]), log, emit);
            }
            if next.is_none() {
                let emit = &mut |packet: &Packet, lines: &[LineAccess]| done(Finished::Packet(packet, lines));
                replay.resolve(batch, bin, emit);
            }
        }
        replay.end_batch();
        batch += 1;
    }
    bins
}

/// Logs of shading the visible samples of every bin.
fn shade_bins(pass: &Pass<'_>, bins: &mut [Bin]) -> Vec<BinLog> {
    let shade = |scratch: &mut worker::Scratch, bin| BinWorker::new(pass, bin, scratch).shade_visible();
    bins.par_iter_mut().map_init(worker::Scratch::default, shade).collect()
}

/// Logs of a batch, by bin. While the feature `auto` has no statistics, some bins run first, and the others
/// start with their statistics.
fn rasterize_bins(pass: &Pass<'_>, bins: &mut [Bin], ready: &[Ready], lists: &[Vec<u32>]) -> Vec<BinLog> {
    const BINS_PER_FIRST: usize = 4;
    let mut logs = vec![BinLog::default(); bins.len()];
    let mut run = |bins: &mut [Bin], chosen: &(dyn Fn(usize) -> bool + Sync)| {
        let all = bins.par_iter_mut().zip(lists).zip(&mut logs).enumerate();
        all.filter(|(number, _)| chosen(*number)).for_each_init(
            worker::Scratch::default,
            |scratch, (_, ((bin, list), log))| {
                *log = BinWorker::new(pass, bin, scratch).rasterize(ready, list);
            },
        );
    };
    if !pass.settings.spec.features.auto || bins.iter().any(|bin| bin.selector.has_records()) {
        run(bins, &|_| true);
        return logs;
    }
    let mut busiest: Vec<_> = (0..bins.len()).collect();
    busiest.sort_by_key(|&bin| std::cmp::Reverse(lists[bin].len()));
    let mut first = vec![false; bins.len()];
    busiest.iter().take(bins.len().div_ceil(BINS_PER_FIRST)).for_each(|&bin| first[bin] = true);
    run(bins, &|bin| first[bin]);
    let mut known = TestSelector::new();
    bins.iter().for_each(|bin| known.merge(&bin.selector));
    bins.iter_mut().zip(&first).filter(|(_, first)| !**first).for_each(|(bin, _)| bin.selector = known);
    run(bins, &|bin| !first[bin]);
    logs
}

/// A triangle for traversal, with the pixels it may touch.
struct Ready {
    pub triangle: Triangle,
    pub pixels: PixelRect,
    /// Part of lens and shutter between the clip planes; says whether the lens shears the triangle.
    pub within: Box5,
    /// Range of image coordinates between the clip planes, if there are any.
    pub image: Option<[[f32; 2]; 2]>,
    /// Bounds over lens and image, if enabled.
    pub lines: Option<LensLines>,
}

impl Ready {
    fn line_madds(&self) -> u32 {
        if self.lines.is_some() { traversal::lens_line_setup_madds(self.triangle.moving) } else { 0 }
    }
}

/// Triangles per packet of vertices.
const PACKET_TRIANGLES: u32 = 32;

/// Set up the triangles of a batch and emit the packets of their vertices.
fn front_end(
    pass: &Pass<'_>,
    batch: Range<u32>,
    replay: &mut Replay<'_>,
    emit: &mut impl FnMut(&Packet, &[LineAccess]),
) -> Vec<Ready> {
    let outcomes: Vec<_> =
        batch.clone().into_par_iter().with_min_len(256).map(|id| outcome(pass, id)).collect();
    replay.begin_batch();
    let new = |kind| Packet {
        batch: batch.start / pass.settings.spec.batch_triangles,
        ..Packet::new(kind, pass.number)
    };
    let mut first = batch.start;
    while first < batch.end {
        let (draw, index) = pass.locate(first);
        if index == 0 {
            let mut start = Packet { draw: draw as u32, triangle: first, ..new(PacketKind::Draw) };
            start.counts[Event::Draws] = 1;
            emit(&start, &[]);
        }
        let end = batch.end.min(first + PACKET_TRIANGLES).min(pass.triangles_of(draw).end);
        let at = |id: u32| (id - batch.start) as usize;
        let vertices = Packet { draw: draw as u32, triangle: first, ..new(PacketKind::Vertices) };
        emit_packet(pass, vertices, &outcomes[at(first)..at(end)], replay, emit);
        first = end;
    }
    outcomes.into_iter().filter_map(|outcome| outcome.ready).collect()
}

/// Result of set-up.
struct Outcome {
    event: Event,
    /// Multiply-adds of set-up.
    madds: u32,
    /// The triangle if it is kept.
    ready: Option<Ready>,
}

fn outcome(pass: &Pass<'_>, id: u32) -> Outcome {
    let viewport = pass.settings.viewport;
    let Draw { geometry, state, .. } = &pass.draws[pass.locate(id).0];
    let (Staged { vertices, lens }, near) = (pass.staged(id), pass.projection.near);
    let shear = pass.projection.shear;
    let shear = if lens { shear } else { shear.sharp() };
    let within = Box5::whole(lens).clipped(&pass.clip).clipped(&geometry.clip());
    if within.is_empty() {
        return Outcome { event: Event::TrianglesOutside, madds: 0, ready: None };
    }
    let (result, madds) =
        set_up_counted(id, vertices.each_ref(), state.cull, &shear, near, viewport.half_px());
    let dropped = |event| Outcome { event, madds, ready: None };
    let triangle = match result {
        SetupResult::Degenerate => return dropped(Event::TrianglesDegenerate),
        SetupResult::Outside => return dropped(Event::TrianglesOutside),
        SetupResult::FaceCulled => return dropped(Event::TrianglesFaceCulled),
        SetupResult::Ready(triangle) => triangle,
    };
    let mut pixels = bounds(&triangle, &shear, viewport);
    let both =
        |a: [[f32; 2]; 2], b: [[f32; 2]; 2]| [0, 1].map(|k| [a[k][0].max(b[k][0]), a[k][1].min(b[k][1])]);
    let image = [pass.clip, geometry.clip()].iter().filter_map(|clip| clip.in_image(viewport)).reduce(both);
    if let Some(image) = image {
        pixels = pixels.intersection(&PixelRect::around(image, viewport));
    }
    if pixels.is_empty() {
        return dropped(Event::TrianglesOutside);
    }
    let wanted = lens && pass.settings.spec.features.lens_lines;
    let lines = wanted.then(|| LensLines::new(&triangle, &shear, near));
    let ready = Some(Ready { triangle, pixels, within, image, lines });
    Outcome { event: Event::TrianglesSetUp, madds, ready }
}

fn emit_packet(
    pass: &Pass<'_>,
    mut packet: Packet,
    outcomes: &[Outcome],
    replay: &mut Replay<'_>,
    emit: &mut impl FnMut(&Packet, &[LineAccess]),
) {
    let draw = packet.draw as usize;
    let Features { still_px, in_focus_px, .. } = pass.settings.spec.features;
    let thresholds = if still_px > 0.0 { motion_madds(pass.lens) } else { 0 }
        + if in_focus_px > 0.0 && pass.lens { BLUR_MADDS } else { 0 };
    for (Outcome { event, madds, ready }, id) in outcomes.iter().zip(packet.triangle..) {
        let corners = pass.images(id);
        packet.counts[*event] += 1;
        packet.counts[Event::TrianglesFlat] +=
            u32::from(*event != Event::TrianglesDegenerate && is_flat(corners));
        packet.counts[Event::TrianglesIn] += 1;
        packet.counts[Event::Indices] += 3;
        packet.counts[Event::SetupMadds] += madds + thresholds + ready.as_ref().map_or(0, Ready::line_madds);
        replay.vertices(draw, id, &mut packet.counts);
        if let Some(Ready { triangle, pixels, .. }) = ready {
            replay.set_up(triangle, pixels, &mut packet.counts);
        }
    }
    replay.emit(&packet, emit);
}

/// Functional parameters of the hardware: sizes that decide *what* happens. Throughput belongs to the timing
/// models.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PipelineSpec {
    /// Side of a fine tile in pixels: 1, 2, 4 or 8.
    pub tile_px: u32,
    /// Side of a coarse tile in pixels, a multiple of `tile_px` up to 256.
    pub coarse_tile_px: u32,
    /// Triangles per batch, which limits the memory of bins.
    pub batch_triangles: u32,
    /// Capacity of the FIFO of shaded vertices.
    pub vertex_reuse: u32,
    /// Where visible samples are shaded.
    #[serde(default)]
    pub shading: Shading,
    /// Shading cache, with quads as entries; unused if every sample is shaded.
    pub shading_cache: CacheSpec,
    /// Caches of memory.
    pub memory: MemorySpec,
    /// Enabled tests.
    pub features: Features,
    /// Depth bounds and Hi-Z.
    #[serde(default)]
    pub depth: DepthSpec,
    /// Groups of lanes; a GPU without it runs none.
    #[serde(default)]
    pub compute: Option<ComputeSpec>,
    /// Lanes of a warp, which run in step. A GPU file has them in `units.shader`, from where they come.
    #[serde(skip_deserializing, default = "usual_warp_lanes")]
    pub warp_lanes: u32,
}

fn usual_warp_lanes() -> u32 {
    32
}

/// Where visible samples are shaded. The choice changes the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Shading {
    /// At cells of the shading grid, through the shading cache.
    #[default]
    Cached,
    /// At every sample's own position, lens position and time, without a cache.
    PerSample,
}

/// Tests that can be disabled. They change the cost, never the image. The two thresholds change the image if
/// they are above zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Features {
    /// Narrow the lens interval by dual-space lines found in set-up.
    pub lens_lines: bool,
    /// Narrow the box of lens and time by the side planes of a tile.
    pub side_planes: bool,
    /// Narrow it by the sides along `u` for each region of the lens, where samples have disjoint ones
    /// ([`crate::sampling::LensRegions`]).
    pub lens_regions: bool,
    /// Find which face of a triangle is visible over a tile and its box of lens and time.
    pub facing: bool,
    /// Largest number of time bisections while the visible face is undecided; 0 to 3.
    pub facing_splits: u32,
    /// Bound the edges over a tile and its box of lens and time.
    pub edges: bool,
    /// Test facing and edges on coarse tiles, too.
    pub coarse: bool,
    /// Screen single samples by the linearized edges before the sample test.
    pub screen: bool,
    /// Cull tiles behind the farthest stored depth.
    pub z_max: bool,
    /// Run only those of the enabled tests that pay off.
    pub auto: bool,
    /// Shade the visible samples of a bin after its last triangle, and no others (hidden-surface removal of
    /// tile-based deferred renderers). Passes whose result depends on the order of triangles shade in that
    /// order.
    pub hidden_surface_removal: bool,
    /// A triangle whose points are all within this distance in pixels of their mid-shutter position is drawn
    /// still at that position. 0 disables it.
    pub still_px: f32,
    /// A triangle whose circle of confusion has at most this radius in pixels is drawn in focus. 0 disables
    /// it.
    pub in_focus_px: f32,
}

impl Default for Features {
    fn default() -> Self {
        Self::ALL
    }
}

impl Features {
    /// All tests.
    pub const ALL: Self = Self {
        lens_lines: true,
        side_planes: true,
        lens_regions: false,
        facing: true,
        facing_splits: 2,
        edges: true,
        coarse: true,
        screen: true,
        z_max: true,
        auto: false,
        hidden_surface_removal: false,
        still_px: 0.0,
        in_focus_px: 0.0,
    };
    /// Bounding boxes only.
    pub const NONE: Self = Self {
        lens_lines: false,
        side_planes: false,
        facing: false,
        facing_splits: 0,
        edges: false,
        coarse: false,
        screen: false,
        z_max: false,
        ..Self::ALL
    };
}

/// Why a pipeline specification is invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SpecError {
    /// A size has an invalid value.
    #[error("`{field}` is {value}; {allowed}")]
    Size {
        /// Field.
        field: &'static str,
        /// Value.
        value: u32,
        /// Allowed values.
        allowed: &'static str,
    },
    /// A threshold has an invalid value.
    #[error("`{field}` is {value}; it has to be 0 to 16384")]
    Threshold {
        /// Field.
        field: &'static str,
        /// Value.
        value: String,
    },
    /// A cache is invalid.
    #[error("`{field}`: {source}")]
    Cache {
        /// Field.
        field: &'static str,
        /// Reason.
        source: CacheError,
    },
}

/// Largest threshold in pixels: the side of the largest image.
const MAX_THRESHOLD_PX: f32 = 16_384.0;

impl SpecError {
    /// The invalid field, such as `memory.l2`.
    pub fn field(&self) -> &'static str {
        match self {
            Self::Size { field, .. } | Self::Threshold { field, .. } | Self::Cache { field, .. } => field,
        }
    }
}

impl PipelineSpec {
    /// Check every size.
    ///
    /// # Errors
    /// The first invalid field, with the allowed values.
    pub fn validate(&self) -> Result<(), SpecError> {
        let size = |field, value, fits: bool, allowed| {
            if fits { Ok(()) } else { Err(SpecError::Size { field, value, allowed }) }
        };
        size("tile_px", self.tile_px, [1, 2, 4, 8].contains(&self.tile_px), "it has to be 1, 2, 4 or 8")?;
        let coarse = self.coarse_tile_px;
        let fits = (1..=256).contains(&coarse) && coarse.is_multiple_of(self.tile_px);
        size("coarse_tile_px", coarse, fits, "it has to be a multiple of `tile_px`, at most 256")?;
        let batch = self.batch_triangles;
        size("batch_triangles", batch, (1..=1 << 24).contains(&batch), "it has to be 1 to 16777216")?;
        let reuse = self.vertex_reuse;
        size("vertex_reuse", reuse, (1..=4096).contains(&reuse), "it has to be 1 to 4096")?;
        let Features { facing_splits, still_px, in_focus_px, .. } = self.features;
        let max = TimePieces::MAX_SPLITS;
        size("features.facing_splits", facing_splits, facing_splits <= max, "it has to be 0 to 3")?;
        for (field, value) in [("features.still_px", still_px), ("features.in_focus_px", in_focus_px)] {
            if !(0.0..=MAX_THRESHOLD_PX).contains(&value) {
                return Err(SpecError::Threshold { field, value: value.to_string() });
            }
        }
        let boxes = self.depth.boxes;
        let invalid = boxes.iter().copied().find(|count| !(1..=BoxGrid::MAX).contains(count));
        size("depth.boxes", invalid.unwrap_or(1), invalid.is_none(), "it has to be 1 to 16 along each axis")?;
        if let Some((field, value, allowed)) = self.compute.as_ref().and_then(ComputeSpec::invalid) {
            return Err(SpecError::Size { field, value, allowed });
        }
        let caches = [
            ("shading_cache", self.shading_cache),
            ("memory.depth", self.memory.depth),
            ("memory.colour", self.memory.colour),
            ("memory.texture", self.memory.texture),
            ("memory.l2", self.memory.l2),
        ];
        let [llc, edram] = self.memory.levels();
        let optional = [("memory.bins", self.memory.bins), ("memory.llc", llc), ("memory.edram", edram)];
        let optional = optional.into_iter().filter_map(|(field, cache)| Some((field, cache?)));
        for (field, cache) in caches.into_iter().chain(optional) {
            Cache::new(cache).map_err(|source| SpecError::Cache { field, source })?;
        }
        Ok(())
    }
}

/// Settings of one frame.
#[derive(Clone, Copy, Debug)]
pub struct Settings<'a> {
    /// Hardware; validated.
    pub spec: &'a PipelineSpec,
    /// Image size.
    pub viewport: Viewport,
    /// Sample positions of every pixel.
    pub samples: &'a dyn SampleSource,
    /// Linear RGB radiance of samples without a hit.
    pub background: Vec3,
}
