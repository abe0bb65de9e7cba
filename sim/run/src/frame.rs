//! One frame through pipeline, clock and watts.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use activity::{Timeline, Unit};
use glam::Vec3;
use pipeline::frame::HeatMap;
use rayon::prelude::*;
use timing::Recorder;

use super::heat::{self, HeatPicture};
use super::{Distinct, Observed, Origin, Plan, RunError, RunFrame, draw};
use output::OutDir;
use output::image::LinearImage;
use output::progress::Progress;
use timing::{AccuracyWarning, FrameClock};

/// Bins of a frame's timeline are a microsecond long, twenty to a sample of a 50 kHz recorder.
pub const BIN_PS: u64 = 1_000_000;
/// Most bins of all frames that are kept, about 200 bytes each; where there would be more they are made longer.
const MOST_BINS: usize = 8_000_000;
/// Fewest bins of a frame, however many frames there are.
pub(super) const FEWEST_BINS: usize = 1024;

/// The most bins of a frame where `frames` are kept.
pub(super) fn bins_of_each(frames: usize) -> usize {
    (MOST_BINS / frames.max(1)).max(FEWEST_BINS)
}

/// Simulates the frames called `numbers` and writes nothing.
///
/// # Errors
/// When a frame cannot be made or timed.
pub fn frames_of(plan: &Plan, numbers: &[u32], progress: &Progress) -> Result<Vec<RunFrame>, RunError> {
    let most_bins = bins_of_each(numbers.len());
    let bar = progress.bar("frames", numbers.len() as u64);
    let simulate = |&number: &u32| {
        let (frame, ..) = simulate_frame(plan, number, most_bins)?;
        bar.inc();
        Ok(frame)
    };
    numbers.par_iter().map(simulate).collect()
}

/// What a panic carries through the threads, so that it is known which frame it happened in.
pub struct CrashedFrame {
    /// The frame.
    pub frame: u32,
    /// What the panic itself carried.
    pub panic: Box<dyn Any + Send>,
}

/// Lets tests of builds with assertions see a crash; elsewhere it is nothing.
fn panic_where_asked(number: u32) {
    if cfg!(debug_assertions)
        && std::env::var("QUINTILE_PANIC_IN_FRAME").is_ok_and(|asked| asked == number.to_string())
    {
        panic!("a test asked for it");
    }
}

/// Where frames are simulated.
pub(super) struct Stage<'a> {
    pub plan: &'a Plan,
    pub distinct: &'a Distinct,
    /// Where images and heat maps go; nowhere without it.
    pub dir: Option<&'a OutDir>,
    /// Bins of a frame at most.
    pub most_bins: usize,
}

/// A frame simulated whole.
pub(super) struct Whole {
    pub frame: RunFrame,
    /// Its linear image, where it is wanted.
    pub picture: Option<Vec<Vec3>>,
    pub heat: Vec<HeatPicture>,
}

impl Stage<'_> {
    /// Simulates the frames of group `group` once and writes the image of each.
    pub fn whole(&self, group: usize, picture: bool) -> Result<Whole, RunError> {
        let (plan, dir, number) = (self.plan, self.dir, self.distinct.numbers()[group]);
        let simulate = || {
            panic_where_asked(number);
            simulate_frame(plan, number, self.most_bins)
        };
        let simulated = catch_unwind(AssertUnwindSafe(simulate))
            .unwrap_or_else(|panic| resume_unwind(Box::new(CrashedFrame { frame: number, panic })));
        let (frame, image, maps) = simulated?;
        let mut heat = Vec::new();
        if let Some(dir) = dir {
            let write = |map| heat::write(plan, dir, number, (map, &image));
            heat = maps.iter().map(write).collect::<Result<_, _>>()?;
            self.distinct.members(group).try_for_each(|number| write_image(plan, dir, number, &image))?;
        }
        Ok(Whole { frame, picture: picture.then_some(image), heat })
    }
}

fn simulate_frame(
    plan: &Plan,
    number: u32,
    most_bins: usize,
) -> Result<(RunFrame, Vec<Vec3>, Vec<HeatMap>), RunError> {
    let mut clock =
        FrameClock::new(plan.options.timing, plan.gpu.machine()?, Recorder::new(BIN_PS, most_bins));
    let draw::Drawing { drawn, regime, heat } =
        draw::draw(plan, number, &plan.options.heat, |packet, lines| clock.push(packet, lines))?;
    let timed = clock.finish()?;
    let accuracy = AccuracyWarning::all(plan.options.timing, &timed);
    let timeline = timed.timeline;
    let power = plan.model.frame(&timeline).map_err(|source| RunError::Timeline { frame: number, source })?;
    let simulated = RunFrame {
        index: number,
        triangles: drawn.triangles,
        moving: drawn.moving,
        lens: drawn.lens,
        power,
        busy_ps: timeline.busy_ps(),
        busy: busy_shares(&timeline),
        cycles: timed.cycles,
        origin: Origin::Simulated(Observed {
            counts: drawn.counts,
            facts: drawn.facts,
            warnings: drawn.warnings,
            regime,
            stalls: timed.stalls,
            accuracy,
        }),
    };
    Ok((simulated, drawn.image, heat))
}

fn busy_shares(timeline: &Timeline) -> Vec<[f32; Unit::COUNT]> {
    let share = |busy: u64| (busy as f64 / timeline.bin_ps as f64) as f32;
    timeline.bins.iter().map(|bin| bin.busy_ps.map(share)).collect()
}

/// The name of a frame's image without its ending.
pub(super) fn image_name(number: u32) -> String {
    format!("images/frame_{number:04}")
}

fn write_image(plan: &Plan, dir: &OutDir, number: u32, image: &[Vec3]) -> Result<(), RunError> {
    let pixels: Vec<[f32; 3]> = image.iter().map(Vec3::to_array).collect();
    let linear = LinearImage::new(plan.viewport.width(), plan.viewport.height(), &pixels)?;
    linear.write_png(dir, &format!("{}.png", image_name(number)))?;
    if plan.options.exr {
        linear.write_exr(dir, &format!("{}.exr", image_name(number)))?;
    }
    Ok(())
}
