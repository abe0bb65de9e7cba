//! Simulation of one frame: pipeline, timing model and power model.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use activity::{LineAccess, Packet, Timeline, Unit};
use glam::Vec3;
use output::OutDir;
use output::image::LinearImage;
use output::progress::Progress;
use pipeline::FrameReport;
use pipeline::frame::HeatMap;
use power_model::PowerModel;
use rayon::prelude::*;
use timing::{AccuracyWarning, FrameClock, Level, Recorder, Timed};
use warnings::Warning;
use workloads::Regime;
use workloads::job::{Drawn, Fact};

use crate::heat::{self, HeatPicture};
use crate::job_frame::{self, BIN_PS};
use crate::passes;
use crate::{Distinct, Observed, Origin, Plan, RunError, RunFrame};

/// Largest number of bins of all frames, at about 200 bytes each. Longer runs use longer bins.
const MAX_TOTAL_BINS: usize = 8_000_000;
/// Lower limit of the bins of a frame, for any number of frames.
pub(super) const MIN_FRAME_BINS: usize = 1024;

/// Largest number of bins of one frame, in a run of `frames`.
pub(super) fn max_bins_per_frame(frames: usize) -> usize {
    (MAX_TOTAL_BINS / frames.max(1)).max(MIN_FRAME_BINS)
}

/// Simulates the frames `numbers` without writing files.
///
/// # Errors
/// If a frame cannot be rendered or timed.
pub fn frames_of(plan: &Plan, numbers: &[u32], progress: &Progress) -> Result<Vec<RunFrame>, RunError> {
    let max_bins = max_bins_per_frame(numbers.len());
    let bar = progress.bar("frames", numbers.len() as u64);
    let simulate = |&number: &u32| {
        let (frame, ..) = simulate_frame(plan, number, max_bins)?;
        bar.inc();
        Ok(frame)
    };
    numbers.par_iter().map(simulate).collect()
}

/// Payload of a panic in a worker thread, with the frame that was simulated.
pub struct CrashedFrame {
    /// Number of the frame.
    pub frame: u32,
    /// Payload of the original panic.
    pub panic: Box<dyn Any + Send>,
}

/// Text of the panic with this payload.
pub fn panic_message(payload: &(dyn Any + Send)) -> String {
    if let Some(crashed) = payload.downcast_ref::<CrashedFrame>() {
        return panic_message(&*crashed.panic);
    }
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no message").to_owned()
}

/// Panics in the frame that `QUINTILE_PANIC_IN_FRAME` names: a test hook of debug builds.
fn panic_if_requested(number: u32) {
    if cfg!(debug_assertions)
        && std::env::var("QUINTILE_PANIC_IN_FRAME").is_ok_and(|frame| frame == number.to_string())
    {
        panic!("requested by a test");
    }
}

/// Result of `work` on frame `number`; a panic names the frame.
pub(super) fn caught<T>(number: u32, work: impl FnOnce() -> T) -> T {
    let work = || {
        panic_if_requested(number);
        work()
    };
    catch_unwind(AssertUnwindSafe(work))
        .unwrap_or_else(|panic| resume_unwind(Box::new(CrashedFrame { frame: number, panic })))
}

/// Simulates frames of a plan and writes their images.
pub(super) struct FrameSimulator<'a> {
    pub plan: &'a Plan,
    pub distinct: &'a Distinct,
    /// Folder of images and heat maps; `None` writes no files.
    pub dir: Option<&'a OutDir>,
    /// Largest number of timeline bins of a frame.
    pub max_bins: usize,
}

/// Result of simulating one frame.
pub(super) struct SimulatedFrame {
    pub frame: RunFrame,
    /// Linear image, if it is kept for the report.
    pub picture: Option<Vec<Vec3>>,
    pub heat: Vec<HeatPicture>,
}

impl FrameSimulator<'_> {
    /// Simulates group `group` once and writes the image of each of its frames.
    pub fn simulate(&self, group: usize, keep_picture: bool) -> Result<SimulatedFrame, RunError> {
        let (plan, dir, number) = (self.plan, self.dir, self.distinct.numbers()[group]);
        let simulated = caught(number, || simulate_frame(plan, number, self.max_bins));
        let (frame, Pictures { image, heat: maps }) = simulated?;
        let mut heat = Vec::new();
        if let Some(dir) = dir {
            heat = heat::write_all(plan, dir, number, &maps, &image)?;
            self.distinct.members(group).try_for_each(|number| write_image(plan, dir, number, &image))?;
        }
        Ok(SimulatedFrame { frame, picture: keep_picture.then_some(image), heat })
    }
}

/// A frame as drawn: all but its packets.
#[derive(Clone, Debug)]
pub(crate) struct DrawnFrame {
    pub number: u32,
    /// Work by pass, without heat maps.
    pub report: FrameReport,
    pub moving: bool,
    pub lens: bool,
    pub facts: Vec<Fact>,
    pub warnings: Vec<Warning>,
    pub regime: Regime,
}

/// Pictures of a frame.
pub(crate) struct Pictures {
    /// Linear radiance of each pixel.
    pub image: Vec<Vec3>,
    pub heat: Vec<HeatMap>,
}

/// Draws frame `number` and emits its packets.
pub(crate) fn draw<'a>(
    plan: &'a Plan,
    number: u32,
    emit: impl FnMut(&Packet, &[LineAccess]) + 'a,
) -> Result<(DrawnFrame, Pictures), RunError> {
    let (ready, events) = (plan.job.prepare(number)?, heat::events(&plan.options.heat));
    let (drawn, mut report) = job_frame::draw(&plan.gpu, Some((&events, plan.viewport)), &*ready, emit)?;
    let Drawn { image, moving, lens, facts, warnings } = drawn;
    let heat = std::mem::take(&mut report.heat);
    passes::limit_draws(&mut report);
    let regime = ready.regime()?;
    Ok((DrawnFrame { number, report, moving, lens, facts, warnings, regime }, Pictures { image, heat }))
}

impl DrawnFrame {
    /// The frame with its time at `level`, and with the power that `model` gives it.
    pub fn powered(self, level: Level, timed: &Timed, model: &PowerModel) -> Result<RunFrame, RunError> {
        let Self { number, report, moving, lens, facts, warnings, regime } = self;
        let timeline = &timed.timeline;
        let power = model.frame(timeline).map_err(|source| RunError::Timeline { frame: number, source })?;
        let (times, spans) = passes::limited_times(timed);
        Ok(RunFrame {
            index: number,
            triangles: report.triangles(),
            moving,
            lens,
            power,
            busy_ps: timeline.busy_ps(),
            busy: busy_shares(timeline),
            cycles: timed.cycles,
            origin: Origin::Simulated(Box::new(Observed {
                counts: report.counts(),
                report,
                times,
                spans,
                facts,
                warnings,
                regime,
                stalls: timed.stalls.clone(),
                accuracy: AccuracyWarning::all(level, timed),
            })),
        })
    }
}

fn simulate_frame(plan: &Plan, number: u32, max_bins: usize) -> Result<(RunFrame, Pictures), RunError> {
    let level = plan.options.timing.ok_or_else(not_timed)?;
    let mut clock = FrameClock::new(level, plan.gpu.machine()?, Recorder::new(BIN_PS, max_bins));
    let (frame, pictures) = draw(plan, number, |packet, lines| clock.push(packet, lines))?;
    Ok((frame.powered(level, &clock.finish()?, &plan.model)?, pictures))
}

/// Error of simulating a run without a timing level.
fn not_timed() -> RunError {
    RunError::setting("timing: none; cycles and joules need a timing level, such as packet")
}

fn busy_shares(timeline: &Timeline) -> Vec<[f32; Unit::COUNT]> {
    let share = |busy: u64| (busy as f64 / timeline.bin_ps as f64) as f32;
    timeline.bins.iter().map(|bin| bin.busy_ps.map(share)).collect()
}

/// Path of the image of frame `number`, without extension.
pub(super) fn image_name(number: u32) -> String {
    format!("images/frame_{number:04}")
}

pub(super) fn write_image(plan: &Plan, dir: &OutDir, number: u32, image: &[Vec3]) -> Result<(), RunError> {
    let pixels: Vec<[f32; 3]> = image.iter().map(Vec3::to_array).collect();
    let linear = LinearImage::new(plan.viewport.width(), plan.viewport.height(), &pixels)?;
    linear.write_png(dir, &format!("{}.png", image_name(number)))?;
    if plan.options.exr {
        linear.write_exr(dir, &format!("{}.exr", image_name(number)))?;
    }
    Ok(())
}
