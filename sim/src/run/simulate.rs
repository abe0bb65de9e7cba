//! The frames of a run through pipeline, clock and watts.

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
use super::{Plan, RunError, work};
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
    /// For each frame of the run, its place in `distinct`: a still scene is simulated once.
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
pub(super) fn simulate(plan: &Plan, dir: &OutDir, progress: &Progress) -> Result<Simulated, RunError> {
    remove_stale(dir)?;
    let range = plan.work.settings().frames.clone();
    let animated = plan.work.is_animated();
    let numbers: Vec<u32> = if animated { range.collect() } else { vec![range.start] };
    let stage = Stage { plan, dir: Some(dir), most_bins: (MOST_BINS / numbers.len()).max(FEWEST_BINS) };
    if animated && plan.options.sampling != Sampling::Every {
        return sampled::simulate(&stage, &numbers, progress);
    }
    every(&stage, &numbers, progress)
}

/// Simulates every frame that differs. Pictures are kept of the first, the middle and the last.
pub(super) fn every(stage: &Stage<'_>, numbers: &[u32], progress: &Progress) -> Result<Simulated, RunError> {
    let middle = numbers[numbers.len() / 2];
    let shown = [middle, numbers[0], numbers[numbers.len() - 1]];
    let bar = progress.bar("frames", numbers.len() as u64);
    let simulate = |&number: &u32| {
        let done = stage.whole(number, shown.contains(&number))?;
        bar.inc();
        Ok(done)
    };
    let done: Vec<Whole> = numbers.par_iter().map(simulate).collect::<Result<_, RunError>>()?;
    let (mut distinct, mut pictures, mut heat) = (Vec::new(), Vec::new(), Vec::new());
    for done in done {
        if done.frame.index == middle {
            heat = done.heat;
        }
        pictures.extend(done.picture.map(|picture| (done.frame.index, picture)));
        distinct.push(done.frame);
    }
    let frames = stage.plan.work.settings().frames.clone();
    let frames =
        frames.map(|number| if numbers.len() == 1 { 0 } else { (number - numbers[0]) as usize }).collect();
    Ok(Simulated { distinct, frames, pictures, heat, sampled: None })
}

/// Simulates the frames called `numbers` and writes nothing.
///
/// # Errors
/// When a frame cannot be made or timed.
pub fn frames_of(plan: &Plan, numbers: &[u32], progress: &Progress) -> Result<Vec<SimulatedFrame>, RunError> {
    let most_bins = (MOST_BINS / numbers.len().max(1)).max(FEWEST_BINS);
    let stage = Stage { plan, dir: None, most_bins };
    let bar = progress.bar("frames", numbers.len() as u64);
    let simulate = |&number: &u32| {
        let done = stage.whole(number, false)?;
        bar.inc();
        Ok(done.frame)
    };
    numbers.par_iter().map(simulate).collect()
}

/// Where frames are simulated.
pub(super) struct Stage<'a> {
    pub plan: &'a Plan,
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
    /// Simulates frame `number` and writes its image.
    pub fn whole(&self, number: u32, picture: bool) -> Result<Whole, RunError> {
        let plan = self.plan;
        let (frame, image, maps) = simulate_frame(plan, number, self.most_bins)?;
        let mut heat = Vec::new();
        if let Some(dir) = self.dir {
            heat = maps.iter().map(|map| heat::write(plan, dir, number, map)).collect::<Result<_, _>>()?;
            // A still scene is simulated once; every frame of the run has its image all the same.
            let range = plan.work.settings().frames.clone();
            let mut shown_as = if plan.work.is_animated() { number..number + 1 } else { range };
            shown_as.try_for_each(|frame| write_image(plan, dir, frame, &image))?;
        }
        Ok(Whole { frame, picture: picture.then_some(image), heat })
    }
}

/// What an earlier run left: should this one die on the way, nothing old may stand in for it.
fn remove_stale(dir: &OutDir) -> Result<(), RunError> {
    dir.remove_stale("images", "frame_", &["png", "exr"])?;
    dir.remove_stale("heat", "", &["png", "exr", "csv"])?;
    dir.remove_stale("", "report.", &["html"])?;
    dir.remove_stale("", "frames.", &["csv"])?;
    dir.remove_stale("", "trace.", &["csv", "json", "parquet"])?;
    dir.remove_stale("plots", "stalls", &["svg", "png"])?;
    dir.remove_stale("", "timeline.", &["perfetto-trace"])?;
    for (figure, _) in super::FIGURES {
        dir.remove_stale("plots", figure, &["svg", "png"])?;
    }
    Ok(())
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
