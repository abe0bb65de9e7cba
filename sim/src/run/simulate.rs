//! The frames of a run through pipeline, clock and watts.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use activity::{Counts, Timeline, Unit, Warning};
use glam::Vec3;
use pipeline::frame::HeatMap;
use power_model::FramePower;
use rayon::prelude::*;
use timing::{Recorder, Stalls};
use workloads::job::Fact;

use super::heat::{self, HeatPicture};
use super::regime::Regime;
use super::sampled::{self, SampledSummary, Taken};
use super::{Distinct, Plan, RunError, work};
use crate::output::OutDir;
use crate::output::image::LinearImage;
use crate::output::progress::Progress;
use crate::timing::{Doubt, FrameClock, Sampling};

/// Bins of a frame's timeline are a microsecond long, twenty to a sample of a 50 kHz recorder.
pub(crate) const BIN_PS: u64 = 1_000_000;
/// Most bins of all frames that are kept, about 200 bytes each; where there would be more they are made longer.
const MOST_BINS: usize = 8_000_000;
/// Fewest bins of a frame, however many frames there are.
pub(super) const FEWEST_BINS: usize = 1024;

/// One frame as the simulator knows it.
pub struct SimulatedFrame {
    /// Its number in the scene.
    pub index: u32,
    /// Triangles drawn.
    pub triangles: usize,
    /// Whether anything moves while its shutter is open.
    pub moving: bool,
    /// Whether the camera has a lens.
    pub lens: bool,
    /// How often each event happened.
    pub counts: Counts,
    /// What a job found out in it.
    pub facts: Vec<Fact>,
    /// What a job warned of in it.
    pub warnings: Vec<Warning>,
    /// Triangles that tile tests are known to be bad at.
    pub regime: Regime,
    /// Watts over time and joules by part.
    pub power: FramePower,
    /// For how long each unit was busy, in picoseconds.
    pub busy_ps: [u64; Unit::COUNT],
    /// The busy share of each unit in each bin of [`FramePower::bin_s`].
    pub busy: Vec<[f32; Unit::COUNT]>,
    /// Cycles of the core clock.
    pub cycles: u64,
    /// Why units did not work, where the level of timing knows.
    pub stalls: Option<Stalls>,
    /// Why its time is not to be trusted.
    pub doubts: Vec<Doubt>,
    /// For a frame that was predicted from others: half the widths of the intervals in which its cycles and its energy lie. Its
    /// power, its busy times and its cycles are then predicted, and nothing is known of its counts.
    pub predicted: Option<Taken>,
}

/// All frames of a run.
pub struct Simulated {
    /// Frames that differ.
    pub distinct: Vec<SimulatedFrame>,
    /// For each frame of the run, its place in `distinct`: frames with the same input share one.
    pub frames: Vec<usize>,
    /// Pictures for the report: frame number and the linear image.
    pub pictures: Vec<(u32, Vec<Vec3>)>,
    /// The heat maps of the frame in the middle.
    pub heat: Vec<HeatPicture>,
    /// Which frames were predicted, and how sure that is.
    pub sampled: Option<SampledSummary>,
}

impl Simulated {
    /// The frames of the run in order.
    pub fn in_order(&self) -> impl Iterator<Item = &SimulatedFrame> {
        self.frames.iter().map(|&place| &self.distinct[place])
    }

    /// Those that were simulated rather than predicted.
    pub fn known(&self) -> impl Iterator<Item = &SimulatedFrame> {
        self.in_order().filter(|frame| frame.predicted.is_none())
    }

    /// The counts of the frames of the run that were simulated.
    pub fn total(&self) -> Counts {
        self.known().fold(Counts::default(), |mut sum, frame| {
            sum += &frame.counts;
            sum
        })
    }
}

/// Simulates the frames that the plan asks for, writing the image of each as soon as it is done.
pub(super) fn simulate(
    plan: &Plan,
    distinct: &Distinct,
    dir: &OutDir,
    progress: &Progress,
) -> Result<Simulated, RunError> {
    let most_bins = (MOST_BINS / distinct.numbers().len()).max(FEWEST_BINS);
    let stage = Stage { plan, distinct, dir: Some(dir), most_bins };
    if plan.options.sampling == Sampling::Every || is_few(distinct, plan.options.sampling) {
        return every(&stage, progress);
    }
    sampled::simulate(&stage, progress)
}

/// Whether frames repeat so often that simulating all that differ takes no more than predicting some of them.
fn is_few(distinct: &Distinct, sampling: Sampling) -> bool {
    let (differ, all) = (distinct.numbers().len(), distinct.groups().len());
    differ == 1 || differ < all && differ <= sampling.first(all)
}

/// Simulates the frames that the plan asks for, each of them, and writes nothing.
pub(super) fn unwritten(plan: &Plan, progress: &Progress) -> Result<Simulated, RunError> {
    let distinct = &Distinct::new(&plan.work)?;
    let most_bins = (MOST_BINS / distinct.numbers().len()).max(FEWEST_BINS);
    every(&Stage { plan, distinct, dir: None, most_bins }, progress)
}

/// Simulates every frame that differs. Pictures are kept of the first, the middle and the last.
fn every(stage: &Stage<'_>, progress: &Progress) -> Result<Simulated, RunError> {
    let numbers = stage.distinct.numbers();
    let middle = numbers[numbers.len() / 2];
    let shown = [middle, numbers[0], numbers[numbers.len() - 1]];
    let bar = progress.bar("frames", numbers.len() as u64);
    let simulate = |group: usize| {
        let done = stage.whole(group, shown.contains(&numbers[group]))?;
        bar.inc();
        Ok(done)
    };
    let done: Vec<Whole> =
        (0..numbers.len()).into_par_iter().map(simulate).collect::<Result<_, RunError>>()?;
    let (mut distinct, mut pictures, mut heat) = (Vec::new(), Vec::new(), Vec::new());
    for done in done {
        if done.frame.index == middle {
            heat = done.heat;
        }
        pictures.extend(done.picture.map(|picture| (done.frame.index, picture)));
        distinct.push(done.frame);
    }
    let frames = stage.distinct.groups().to_vec();
    Ok(Simulated { distinct, frames, pictures, heat, sampled: None })
}

/// Simulates the frames called `numbers` and writes nothing.
///
/// # Errors
/// When a frame cannot be made or timed.
pub fn frames_of(plan: &Plan, numbers: &[u32], progress: &Progress) -> Result<Vec<SimulatedFrame>, RunError> {
    let most_bins = (MOST_BINS / numbers.len().max(1)).max(FEWEST_BINS);
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
    pub frame: SimulatedFrame,
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
) -> Result<(SimulatedFrame, Vec<Vec3>, Vec<HeatMap>), RunError> {
    let mut clock = FrameClock::new(plan.options.timing, &plan.gpu, Recorder::new(BIN_PS, most_bins))?;
    let work::Drawing { drawn, regime, heat } =
        work::draw(plan, number, &plan.options.heat, |packet, lines| clock.push(packet, lines))?;
    let timed = clock.finish()?;
    let doubts = Doubt::all(plan.options.timing, &timed);
    let timeline = timed.timeline;
    let power = plan.model.frame(&timeline).map_err(|source| RunError::Timeline { frame: number, source })?;
    let simulated = SimulatedFrame {
        index: number,
        triangles: drawn.triangles,
        moving: drawn.moving,
        lens: drawn.lens,
        counts: drawn.counts,
        regime,
        facts: drawn.facts,
        warnings: drawn.warnings,
        power,
        busy_ps: timeline.busy_ps(),
        busy: busy_shares(&timeline),
        cycles: timed.cycles,
        doubts,
        stalls: timed.stalls,
        predicted: None,
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
