//! One frame through the pipeline: vertices, set-up, bins, tiles, the replay of what they touched, and the image.

mod bin;
mod counters;
mod draw;
mod heat;
mod judge;
mod look;
mod pass;
mod replay;
mod resolve;
mod settings;
mod surface;
mod tile_tests;
mod vertices;
mod worker;

use std::ops::Range;

use activity::{Counts, Event, LineAccess, Packet, PacketKind};
use glam::Vec3;
use judge::Judge;
use rayon::prelude::*;
use vertices::Ready;

use crate::geometry::Camera;
use crate::memory::CacheError;
use crate::setup::distribute;
use bin::Bin;
use counters::BinLog;
pub use draw::Draw;
pub use heat::{HeatMap, TileHeat};
use pass::Pass;
use replay::Replay;
pub use settings::{Features, PipelineSpec, Settings, Shading, SpecError};
use worker::Worker;

/// A rendered frame.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// Linear RGB radiance of each pixel, row by row from the top left.
    pub image: Vec<Vec3>,
    /// How often each event happened.
    pub counts: Counts,
}

/// Renders `draws` as seen by `camera`, handing each work packet to `emit` in the order of the modelled hardware.
///
/// The image and every packet are the same for any number of threads.
///
/// # Errors
/// When a cache of the settings cannot be built.
pub fn render(
    camera: &Camera,
    draws: &[Draw<'_>],
    settings: &Settings<'_>,
    mut emit: impl FnMut(&Packet),
) -> Result<Rendered, CacheError> {
    render_with_heat(camera, draws, settings, &[], |packet, _| emit(packet)).map(|(rendered, _)| rendered)
}

/// The same, each packet with the lines it asks the L2 for, and where in the image each of `events` happened.
///
/// # Errors
/// When a cache of the settings cannot be built.
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

/// Renders several images in one pass: image `k` is the mean of those samples of each pixel whose indices are in `views[k]`.
/// Runs may overlap; indices beyond the samples of a pixel add nothing, and an image of no samples is black.
///
/// # Errors
/// When a cache of the settings cannot be built.
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

/// A pass that leaves depths and no image, such as a shadow map: nothing is shaded, and the depths are written to memory. What
/// each sample sees is told as by [`visibility`].
///
/// # Errors
/// When a cache of the settings cannot be built.
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
    let bins = rasterize(&pass, &mut replay, &mut |done: Done<'_>| {
        if let Done::Packet(packet, lines) = done {
            emit(packet, lines);
        }
    });
    replay.finish(&mut emit);
    Ok((resolve::visible(&pass, &bins), counts))
}

/// Images, counts and heat.
type Drawn = (Vec<Vec<Vec3>>, Counts, Vec<HeatMap>);

/// A pass from its draws to its images.
fn draw(
    pass: &Pass<'_>,
    events: &[Event],
    emit: &mut impl FnMut(&Packet, &[LineAccess]),
) -> Result<Drawn, CacheError> {
    let mut heat: Vec<_> = events.iter().map(|&event| HeatMap::new(event, pass)).collect();
    let mut counts = Counts::default();
    let mut replay = Replay::new(pass)?;
    let mut emit = |work: Done<'_>| match work {
        Done::Packet(packet, lines) => {
            counts += &packet.counts;
            heat.iter_mut().for_each(|map| map.packet(packet));
            emit(packet, lines);
        }
        Done::Tests(number, bin, log) => heat.iter_mut().for_each(|map| map.tests(pass, number, bin, log)),
    };
    let bins = rasterize(pass, &mut replay, &mut emit);
    replay.finish(&mut |packet: &Packet, lines: &[LineAccess]| emit(Done::Packet(packet, lines)));
    Ok((resolve::resolve(pass, &bins), counts, heat))
}

/// Something that was done, told in order.
enum Done<'a> {
    /// A packet and its lines.
    Packet(&'a Packet, &'a [LineAccess]),
    /// The work of a batch in a bin, with the bin's number.
    Tests(usize, &'a Bin, &'a BinLog),
}

/// The triangle each sample sees (`u32::MAX` for none) and the bits of its depth (infinite for none), in the order
/// `(y width + x) per_pixel + index`.
///
/// # Errors
/// When a cache of the settings cannot be built.
pub fn visibility(
    camera: &Camera,
    draws: &[Draw<'_>],
    settings: &Settings<'_>,
) -> Result<Vec<(u32, u32)>, CacheError> {
    let pass = Pass::with_views(camera, draws, settings, Vec::new());
    let bins = rasterize(&pass, &mut Replay::new(&pass)?, &mut |_: Done<'_>| ());
    Ok(resolve::visible(&pass, &bins))
}

/// Every batch through the front end and the bins; what the tiles touched is replayed batch by batch. Bins are double
/// buffered: the front end works on the next batch while tiles are traversed, so its packets come one batch ahead. After
/// the last batch each bin is resolved at once, while its samples are still in the caches.
fn rasterize<F: FnMut(Done<'_>)>(pass: &Pass<'_>, replay: &mut Replay<'_>, done: &mut F) -> Vec<Bin> {
    let mut bins = Bin::all(pass);
    let mut batches = pass.batches();
    // Without a single triangle there is still an image to resolve.
    let first = batches.next().unwrap_or(0..0);
    let front_end = |batch, replay: &mut Replay<'_>, done: &mut F| {
        let emit = &mut |packet: &Packet, lines: &[LineAccess]| done(Done::Packet(packet, lines));
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
            done(Done::Tests(number, bin, log));
            let emit = &mut |packet: &Packet, lines: &[LineAccess]| done(Done::Packet(packet, lines));
            replay.bin(log, emit);
            if next.is_none() {
                replay.resolve(bin, emit);
            }
        }
    }
    bins
}

/// The logs of a batch, by bin. Where `auto` has learnt nothing yet some bins go first, and the others know what they have learnt.
fn rasterize_bins(pass: &Pass<'_>, bins: &mut [Bin], ready: &[Ready], lists: &[Vec<u32>]) -> Vec<BinLog> {
    const FIRST_OF: usize = 4;
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
    if !pass.settings.spec.features.auto || bins.iter().any(|bin| bin.judge.has_learnt()) {
        run(bins, &|_| true);
        return logs;
    }
    let mut busiest: Vec<_> = (0..bins.len()).collect();
    busiest.sort_by_key(|&bin| std::cmp::Reverse(lists[bin].len()));
    let mut first = vec![false; bins.len()];
    busiest.iter().take(bins.len().div_ceil(FIRST_OF)).for_each(|&bin| first[bin] = true);
    run(bins, &|bin| first[bin]);
    let mut known = Judge::new();
    bins.iter().for_each(|bin| known.join(&bin.judge));
    bins.iter_mut().zip(&first).filter(|(_, first)| !**first).for_each(|(bin, _)| bin.judge = known);
    run(bins, &|bin| !first[bin]);
    logs
}

/// A packet of the only pass there is so far.
fn packet(kind: PacketKind, tile: u32, triangle: u32) -> Packet {
    Packet::new(kind, 0, tile, triangle)
}
