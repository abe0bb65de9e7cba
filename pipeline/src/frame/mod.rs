//! Frame: draws through the whole pipeline, from vertices, set-up, bins and tiles to the replay and the
//! image.

mod bin;
mod heat;
mod pass;
mod replay;
mod resolve;
mod settings;
mod surface;
mod test_selection;
mod tile_tests;
mod vertices;
mod worker;

use std::ops::Range;

use activity::{Counts, Event, LineAccess, Packet};
use glam::Vec3;
use rayon::prelude::*;
use test_selection::TestSelector;
use vertices::Ready;

use crate::geometry::Camera;
use crate::memory::CacheError;
use crate::setup::distribute;
use bin::{Bin, BinLog};
pub use heat::{HeatMap, TileHeat};
pub use pass::Draw;
use pass::Pass;
use replay::Replay;
pub use settings::{Features, PipelineSpec, Settings, Shading, SpecError};
use worker::Worker;

/// A rendered frame.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// Linear RGB radiance of every pixel, row by row from the top left.
    pub image: Vec<Vec3>,
    /// Count of every event.
    pub counts: Counts,
}

/// Render `draws` as seen by `camera`. `emit` gets every work packet in the order of the modelled hardware.
///
/// The image and all packets are the same for any number of threads.
///
/// # Errors
/// [`CacheError`] if a cache of the settings is invalid.
pub fn render(
    camera: &Camera,
    draws: &[Draw<'_>],
    settings: &Settings<'_>,
    mut emit: impl FnMut(&Packet),
) -> Result<Rendered, CacheError> {
    render_with_heat(camera, draws, settings, &[], |packet, _| emit(packet)).map(|(rendered, _)| rendered)
}

/// Render as [`render`] does. `emit` also gets the lines each packet requests from the L2, and the result has
/// a heat map for each of `events`.
///
/// # Errors
/// [`CacheError`] if a cache of the settings is invalid.
pub fn render_with_heat(
    camera: &Camera,
    draws: &[Draw<'_>],
    settings: &Settings<'_>,
    events: &[Event],
    mut emit: impl FnMut(&Packet, &[LineAccess]),
) -> Result<(Rendered, Vec<HeatMap>), CacheError> {
    let mut pass = Pass::new(camera, draws, settings);
    pass.heat = !events.is_empty();
    let (images, counts, heat) = draw(&pass, events, &mut emit)?;
    Ok((Rendered { image: images.into_iter().flatten().collect(), counts }, heat))
}

/// Render several images in one pass. Image `k` is the mean of the samples of each pixel whose indices are in
/// `views[k]`. Ranges may overlap. Indices beyond the samples of a pixel are ignored, and an image without
/// samples is black.
///
/// # Errors
/// [`CacheError`] if a cache of the settings is invalid.
pub fn render_views(
    camera: &Camera,
    draws: &[Draw<'_>],
    settings: &Settings<'_>,
    views: &[Range<u32>],
    mut emit: impl FnMut(&Packet, &[LineAccess]),
) -> Result<(Vec<Vec<Vec3>>, Counts), CacheError> {
    let within = views.iter().map(|run| run.start..run.end.min(settings.samples.per_pixel()).max(run.start));
    let pass = Pass::with_views(camera, draws, settings, within.collect());
    if pass.is_depth_only() {
        return Ok((Vec::new(), Counts::default()));
    }
    draw(&pass, &[], &mut emit).map(|(images, counts, _)| (images, counts))
}

/// Render depths only, such as a shadow map. Nothing is shaded, and the depths are written to memory. The
/// result is that of [`visibility`], with the counts.
///
/// # Errors
/// [`CacheError`] if a cache of the settings is invalid.
pub fn render_depth(
    camera: &Camera,
    draws: &[Draw<'_>],
    settings: &Settings<'_>,
    mut emit: impl FnMut(&Packet, &[LineAccess]),
) -> Result<(Vec<(u32, u32)>, Counts), CacheError> {
    let pass = Pass::with_views(camera, draws, settings, Vec::new());
    let (mut counts, mut replay) = (Counts::default(), Replay::new(&pass)?);
    let mut emit = |packet: &Packet, lines: &[LineAccess]| {
        counts += &packet.counts;
        emit(packet, lines);
    };
    let bins = rasterize(&pass, &mut replay, &mut |done: Finished<'_>| {
        if let Finished::Packet(packet, lines) = done {
            emit(packet, lines);
        }
    });
    replay.finish(&mut emit);
    Ok((resolve::visible(&pass, &bins), counts))
}

/// Images, counts and heat maps.
type PassOutput = (Vec<Vec<Vec3>>, Counts, Vec<HeatMap>);

/// Render a pass.
fn draw(
    pass: &Pass<'_>,
    events: &[Event],
    emit: &mut impl FnMut(&Packet, &[LineAccess]),
) -> Result<PassOutput, CacheError> {
    let mut heat: Vec<_> = events.iter().map(|&event| HeatMap::new(event, pass)).collect();
    let mut counts = Counts::default();
    let mut replay = Replay::new(pass)?;
    let mut emit = |work: Finished<'_>| match work {
        Finished::Packet(packet, lines) => {
            counts += &packet.counts;
            heat.iter_mut().for_each(|map| map.packet(packet));
            emit(packet, lines);
        }
        Finished::Tests(number, bin, log) => {
            heat.iter_mut().for_each(|map| map.tests(pass, number, bin, log))
        }
    };
    let bins = rasterize(pass, &mut replay, &mut emit);
    replay.finish(&mut |packet: &Packet, lines: &[LineAccess]| emit(Finished::Packet(packet, lines)));
    Ok((resolve::resolve(pass, &bins), counts, heat))
}

/// A unit of finished work, in the order of the modelled hardware.
enum Finished<'a> {
    /// A packet and its lines.
    Packet(&'a Packet, &'a [LineAccess]),
    /// Work of a batch in a bin, with the bin's number.
    Tests(usize, &'a Bin, &'a BinLog),
}

/// Visible triangle (`u32::MAX` for none) and bits of its depth (infinite for none) of every sample, in the
/// order `(y width + x) per_pixel + index`.
///
/// # Errors
/// [`CacheError`] if a cache of the settings is invalid.
pub fn visibility(
    camera: &Camera,
    draws: &[Draw<'_>],
    settings: &Settings<'_>,
) -> Result<Vec<(u32, u32)>, CacheError> {
    let pass = Pass::with_views(camera, draws, settings, Vec::new());
    let bins = rasterize(&pass, &mut Replay::new(&pass)?, &mut |_: Finished<'_>| ());
    Ok(resolve::visible(&pass, &bins))
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
        for ((bin, log), number) in bins.iter().zip(&logs).zip(0..) {
            done(Finished::Tests(number, bin, log));
            let emit = &mut |packet: &Packet, lines: &[LineAccess]| done(Finished::Packet(packet, lines));
            replay.bin(batch, log, emit);
            if next.is_none() {
                replay.resolve(batch, bin, emit);
            }
        }
        batch += 1;
    }
    bins
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
                *log = Worker::new(pass, bin, scratch).rasterize(ready, list);
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
