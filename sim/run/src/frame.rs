//! A frame of a run or of a job: drawn, timed and with its power, and the energy of its passes; and which
//! frames of a run differ.

use std::any::Any;
use std::cell::Cell;
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use activity::{Counts, Event, LineAccess, Packet, S_PER_PS, Timeline, Unit};
use glam::Vec3;
use output::OutDir;
use output::image::LinearImage;
use output::terminal::Progress;
use pipeline::frame::HeatMap;
use pipeline::{FrameReport, Gpu, Viewport};
use power_model::{FramePower, PowerModel};
use rayon::prelude::*;
use timing::{CheckedClock, FrameClock, Level, Recorder, Timed, TimingError};
use warnings::Warning;
use workloads::job::{Drawn, Fact, ReadyFrame};
use workloads::{Fingerprint, Job, Regime};

use crate::heat::{self, HeatPicture};
use crate::passes::{self, WRITE_BACK, timed_j};
use crate::{GpuSpec, HeatRequest, Observed, Origin, Plan, RunError, RunFrame};

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

/// Panics in the frame that `QUINTILE_PANIC_IN_FRAME` names: a hook for tests of crash reports. It is in
/// release builds, too, as those are tested.
fn panic_if_requested(number: u32) {
    if std::env::var("QUINTILE_PANIC_IN_FRAME").is_ok_and(|frame| frame == number.to_string()) {
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
    /// Group that has to have the passes whose heat maps are requested; those of other groups may be empty.
    pub checked: usize,
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
        if let Some(observed) = frame.observed().filter(|_| group == self.checked) {
            heat::check_passes(&plan.options.heat, number, &observed.report)?;
        }
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

/// Draws frame `number` and emits its packets, until `stop` is set.
pub(crate) fn draw<'a>(
    plan: &'a Plan,
    number: u32,
    stop: Option<&'a Cell<bool>>,
    emit: impl FnMut(&Packet, &[LineAccess]) + 'a,
) -> Result<(DrawnFrame, Pictures), RunError> {
    let (ready, requests) = (plan.job.prepare(number)?, &plan.options.heat);
    let (drawn, mut report) = draw_on(&plan.gpu, Some((requests, plan.viewport)), &*ready, stop, emit)?;
    let Drawn { image, moving, lens, facts, warnings } = drawn;
    let heat = std::mem::take(&mut report.heat);
    passes::limit_draws(&mut report);
    let regime = ready.regime()?;
    Ok((DrawnFrame { number, report, moving, lens, facts, warnings, regime }, Pictures { image, heat }))
}

impl DrawnFrame {
    /// The frame with its time, and with the power that `model` gives it.
    pub fn powered(self, timed: &Timed, model: &PowerModel) -> Result<RunFrame, RunError> {
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
                checked: timed.checked,
            })),
        })
    }
}

fn simulate_frame(plan: &Plan, number: u32, max_bins: usize) -> Result<(RunFrame, Pictures), RunError> {
    let level = plan.options.timing.ok_or_else(not_timed)?;
    let mut clock = CheckedClock::new(level, plan.gpu.machine()?, Recorder::new(BIN_PS, max_bins));
    let stop = Cell::new(false);
    let emit = |packet: &_, lines: &_| {
        clock.push(packet, lines);
        stop.set(clock.is_too_long());
    };
    let drawn = draw(plan, number, Some(&stop), emit);
    if stop.get() {
        return Err(TimingError::TooLong.into());
    }
    let (frame, pictures) = drawn?;
    Ok((frame.powered(&clock.finish()?, &plan.model)?, pictures))
}

/// Error of simulating a run without a timing level.
fn not_timed() -> RunError {
    RunError::invalid("timing", "none; cycles and joules need a timing level, such as packet")
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

/// Length of a timeline bin in picoseconds: one microsecond, a twentieth of a sample at 50 kHz.
pub const BIN_PS: u64 = 1_000_000;

/// A drawn and timed frame with the energy of its passes.
pub struct JobFrame {
    /// Image and facts.
    pub drawn: Drawn,
    /// Work by pass.
    pub report: FrameReport,
    /// Power over time.
    pub power: FramePower,
    /// Passes of the frame, in order, and its write-back.
    pub passes: Vec<PassEnergy>,
}

/// Energy of a pass.
#[derive(Clone, Debug, PartialEq)]
pub struct PassEnergy {
    /// Name of the pass.
    pub name: String,
    /// When its last packet leaves, s from the start of the frame.
    pub end_s: f64,
    /// From the end of the pass before, s.
    pub time_s: f64,
    /// Energy of its events, as the pipeline counted them, J.
    pub events_j: f64,
    /// Energy of clocks, leakage and what is constant in that time, J.
    pub timed_j: f64,
}

impl PassEnergy {
    /// All of it, J.
    pub fn total_j(&self) -> f64 {
        self.events_j + self.timed_j
    }
}

/// Largest number of bins of a frame.
const MAX_BINS: usize = 4096;

/// Draws a frame on the pipeline of `gpu`, with the heat maps that are requested over images of a size, and emits its
/// packets, until `stop` is set.
pub(crate) fn draw_on<'a>(
    gpu: &'a GpuSpec,
    heat: Option<(&[HeatRequest], Viewport)>,
    ready: &dyn ReadyFrame,
    stop: Option<&'a Cell<bool>>,
    emit: impl FnMut(&Packet, &[LineAccess]) + 'a,
) -> Result<(Drawn, FrameReport), RunError> {
    let mut on = Gpu::new(&gpu.pipeline, emit)?;
    if let Some((requests, viewport)) = heat {
        on = heat::with_maps(on, requests, viewport);
    }
    if let Some(stop) = stop {
        on = on.stopping(stop);
    }
    let drawn = ready.draw(&mut on).map_err(RunError::on(gpu))?;
    Ok((drawn, on.finish()))
}

impl JobFrame {
    /// Draws frame `number` of a job.
    ///
    /// # Errors
    /// [`RunError`] if the frame cannot be drawn or timed.
    pub fn new(job: &dyn Job, number: u32, gpu: &GpuSpec, model: &PowerModel) -> Result<Self, RunError> {
        let mut clock = FrameClock::new(Level::default(), gpu.machine()?, Recorder::new(BIN_PS, MAX_BINS));
        let emit = |packet: &_, lines: &_| clock.push(packet, lines);
        let (drawn, report) = draw_on(gpu, None, &*job.prepare(number)?, None, emit)?;
        let timed = clock.finish()?;
        let power = model.frame(&timed.timeline);
        let power = power.map_err(|source| RunError::Timeline { frame: number, source })?;
        let mut before_s = 0.0;
        let pass = |((name, counts), time): ((&str, Counts), &timing::PassTime)| {
            let end_s = time.end_ps as f64 * S_PER_PS;
            let from_s = std::mem::replace(&mut before_s, end_s);
            PassEnergy {
                name: name.to_owned(),
                end_s,
                time_s: end_s - from_s,
                events_j: events_j(model, &counts),
                timed_j: timed_j(&power, from_s, end_s),
            }
        };
        let works = report.passes.iter().map(|pass| (pass.name.as_str(), pass.counts()));
        let works = works.chain([(WRITE_BACK, report.write_back)]);
        let passes = works.zip(&timed.passes).map(pass).collect();
        Ok(Self { drawn, report, power, passes })
    }

    /// Energy of all passes, J: to compare with that of the power over time.
    pub fn sum_j(&self) -> f64 {
        self.passes.iter().map(PassEnergy::total_j).sum()
    }

    /// Bytes to and from memory.
    pub fn dram_bytes(&self) -> u64 {
        let counts = self.report.counts();
        counts[Event::DramReadBytes] + counts[Event::DramWriteBytes]
    }
}

fn events_j(model: &PowerModel, counts: &Counts) -> f64 {
    model.counts_energy(counts).total_j()
}

/// Groups of frames with equal input. Each group is simulated once.
///
/// Inputs are compared by the [`Fingerprint`] of everything that the renderer receives and that changes from
/// frame to frame: the camera at both ends of the shutter, every mesh, and all that a workload prepares.
/// Settings, materials, lights, background, sample table and hardware are constant in a run and are not
/// compared.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Distinct {
    /// First frame of each group, in order.
    numbers: Vec<u32>,
    /// Index of the group of each frame of the run.
    groups: Vec<usize>,
    /// Number of the first frame of the run.
    start: u32,
}

impl Distinct {
    /// Prepares and compares all frames of `job`.
    ///
    /// # Errors
    /// When a frame cannot be made.
    pub fn new(job: &dyn Job) -> Result<Self, RunError> {
        let range = job.settings().frames.clone();
        if range.len() == 1 {
            return Ok(Self::of(range.start, &[()]));
        }
        let start = range.start;
        let prints = range.into_par_iter().map(|number| job.fingerprint(number));
        Ok(Self::of(start, &prints.collect::<Result<Vec<Fingerprint>, _>>()?))
    }

    fn of<K: Eq + std::hash::Hash>(start: u32, inputs: &[K]) -> Self {
        let (mut numbers, mut known) = (Vec::new(), HashMap::new());
        let groups = (start..)
            .zip(inputs)
            .map(|(number, input)| {
                *known.entry(input).or_insert_with(|| {
                    numbers.push(number);
                    numbers.len() - 1
                })
            })
            .collect();
        Self { numbers, groups, start }
    }

    /// Number of the first frame of each group, in order: the frames to simulate.
    pub fn numbers(&self) -> &[u32] {
        &self.numbers
    }

    /// Index of the group of each frame of the run, in [`Self::numbers`].
    pub fn groups(&self) -> &[usize] {
        &self.groups
    }

    /// Numbers of the frames in `group`.
    pub fn members(&self, group: usize) -> impl Iterator<Item = u32> {
        (self.start..).zip(&self.groups).filter(move |(_, of)| **of == group).map(|(number, _)| number)
    }
}

#[cfg(test)]
mod tests {
    use power_model::{EnergyTable, Platform};
    use workloads::Overrides;
    use workloads::deferred::{Deferred, DeferredOptions, LightPass};

    use super::*;

    #[test]
    fn energies_of_passes_add_up_to_that_of_the_power_over_time() {
        let gpu = GpuSpec::load("hd_4000").unwrap();
        let platform = Platform::builtin("hd_4000").unwrap();
        let model = PowerModel::new(&EnergyTable::builtin("28nm").unwrap(), &platform).unwrap();
        let overrides = Overrides { size: Some((160, 90)), ..Overrides::default() };
        for lighting in [LightPass::Screen, LightPass::Volumes] {
            let options = DeferredOptions { lights: 8, lighting, ..DeferredOptions::default() };
            let job = Deferred::new(options, &overrides, 1).unwrap();
            let frame = JobFrame::new(&job, 0, &gpu, &model).unwrap();
            let names: Vec<&str> = frame.passes.iter().map(|pass| pass.name.as_str()).collect();
            assert_eq!(names, ["g-buffer", "lighting", "resolve", WRITE_BACK]);
            let whole_j: f64 =
                frame.power.bins().map(|(length_s, watts)| length_s * watts.iter().sum::<f64>()).sum();
            let error = (frame.sum_j() / whole_j - 1.0).abs();
            assert!(error < 1e-9, "{error:e}");
            // Each part is far above what would be missed.
            let mut parts = frame.passes.iter().flat_map(|pass| [pass.events_j, pass.timed_j]);
            assert!(parts.all(|part_j| part_j > 1e-6 * whole_j));
        }
    }

    #[test]
    fn equal_frames_share_a_group_wherever_they_are() {
        let found = Distinct::of(7, &["a", "b", "a", "a", "c", "b"]);
        assert_eq!((found.numbers(), found.groups()), (&[7, 8, 11][..], &[0, 1, 0, 0, 2, 1][..]));
        assert_eq!(found.members(0).collect::<Vec<_>>(), [7, 9, 10]);
        assert_eq!(found.members(2).collect::<Vec<_>>(), [11]);
    }
}
