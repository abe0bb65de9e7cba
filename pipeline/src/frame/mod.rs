//! Frame: passes through the whole pipeline, each from vertices, set-up, bins and tiles to the replay and the image.

mod attachments;
mod bin;
mod bin_memory;
mod cells;
mod conservative_pass;
mod dispatch;
mod error;
mod fragments;
mod gpu;
mod heat;
mod lanes;
mod levels;
mod pass;
mod query;
mod replay;
mod resolve;
mod resolve_pass;
mod screen_pass;
mod seen;
mod settings;
mod shaded;
mod target_checks;
mod test_selection;
mod tile_tests;
mod vertices;
mod warps;
mod worker;

use activity::{LineAccess, Packet};
use rayon::prelude::*;
use test_selection::TestSelector;
use vertices::Ready;

use crate::setup::distribute;
pub use attachments::{Attachment, Attachments, Binding, Load, Store, SurfaceId};
use bin::{Bin, BinLog};
pub use conservative_pass::{ConservativeDraw, ConservativePass, Primitive, TileIntervals, TileShader};
pub use error::{PassError, PassPart, SurfaceProblem};
pub use gpu::{FrameReport, Gpu, PassReport, Rendered};
pub use heat::{HeatMap, Placement, TileHeat};
pub use lanes::Lanes;
use pass::Pass;
pub use pass::{Draw, Query, RasterPass, Resident, Target};
pub use query::{IntervalAnswer, IntervalQueries, MovingBox, SampledAnswer, SampledAnswers, SampledQueries};
use replay::Replay;
pub use resolve_pass::ResolvePass;
pub use settings::{Features, PipelineSpec, Settings, Shading, SpecError};
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
        vertices::front_end(pass, batch, replay, emit)
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
