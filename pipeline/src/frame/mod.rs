//! Frame: passes through the whole pipeline, each from vertices, set-up, bins and tiles to the replay and the
//! image. Here is the order of the work and the front end: the set-up of triangles and the packets of their
//! vertices.

mod accesses;
mod attachments;
mod bin;
mod cells;
mod conservative_pass;
mod dispatch;
mod fragments;
mod gpu;
mod heat;
mod lanes;
mod order;
mod pass;
mod query;
mod replay;
mod resolve;
mod resolve_pass;
mod seen;
mod settings;
mod shaded;
mod target_checks;
mod test_selection;
mod tile_tests;
mod uses;
mod warps;
mod worker;

use std::ops::Range;

use activity::{Event, LineAccess, Packet, PacketKind};
use rayon::prelude::*;

use crate::setup::{PixelRect, SetupResult, Triangle, bounds, distribute, is_flat, set_up_counted};
use crate::traversal::{self, BLUR_MADDS, Box5, LensLines, motion_madds};
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
pub use settings::{Features, PipelineSpec, PipelineSpecError, Settings, Shading};
use test_selection::TestSelector;
pub use uses::Uses;
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
            if next.is_none() && pass.shading_waits() { shade_bins(pass, &mut bins) } else { Vec::new() };
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

/// Logs of shading what still waits in every bin.
fn shade_bins(pass: &Pass<'_>, bins: &mut [Bin]) -> Vec<BinLog> {
    let shade = |scratch: &mut worker::Scratch, bin| BinWorker::new(pass, bin, scratch).shade_rest();
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
