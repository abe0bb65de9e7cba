//! Probe: a few frames at a reduced size, simulated at every timing level.

use std::time::Instant;

use activity::{Counts, Event, PacketBuffer};
use cpu_time::ThreadTime;
use output::terminal::Progress;
use pipeline::PipelineSpec;
use timing::{CheckedClock, Level, Recorder};
use workloads::Job;
use workloads::job::Reduction;

use super::{Findings, ProbeSummary, with_blur_thresholds};
use crate::frame::{self, draw_on};
use crate::{Distinct, FrameCost, GpuSpec, Plan, RunError};

/// Largest number of probed frames: the middles of as many equal parts of the run.
const MAX_FRAMES: usize = 3;
/// Width in pixels that images are reduced to, at most by a factor of [`MAX_REDUCTION`].
const TARGET_WIDTH_PX: u32 = 320;
/// Largest factor of the reduction along each axis.
const MAX_REDUCTION: u32 = 4;

/// A finished probe: frames, image size and results.
pub(super) struct Probe {
    numbers: Vec<u32>,
    size: [u32; 2],
    pub findings: Findings,
}

/// A frame as drawn.
struct ProbedFrame {
    number: u32,
    packets: PacketBuffer,
    counts: Counts,
    /// Wall-clock seconds of the pipeline.
    pipeline_s: f64,
}

impl Probe {
    /// Simulates some of the distinct frames.
    pub fn new(plan: &Plan, distinct: &Distinct, progress: &Progress) -> Result<Self, RunError> {
        let differ = distinct.numbers();
        let some = MAX_FRAMES.min(differ.len());
        let numbers: Vec<u32> =
            (0..some).map(|part| differ[(2 * part + 1) * differ.len() / (2 * some)]).collect();
        let job = plan.reduced(&Reduction::to_width(plan.job.settings(), TARGET_WIDTH_PX, MAX_REDUCTION))?;
        let size = [job.settings().width, job.settings().height];
        let bar = progress.bar("probe", numbers.len() as u64);
        let mut findings = Findings::default();
        for &number in &numbers {
            probe_frame(plan, &*job, number, &mut findings)?;
            bar.inc();
        }
        // Host times are sums over the probe's frames, at a reduced size. Passes that do not depend on it are
        // overestimated.
        let scale = plan.pixels() as f64 / (f64::from(size[0]) * f64::from(size[1])) / some as f64;
        findings.scale_times(scale);
        Ok(Self { numbers, size, findings })
    }

    pub fn summary(&self) -> ProbeSummary {
        let error = |level: Level| (level, self.findings.error(level));
        ProbeSummary {
            frames: self.numbers.clone(),
            size: self.size,
            error: Level::ALL.map(error).into_iter().collect(),
            dimensions_error: self.findings.dimensions_error,
            dimensions_saved: self.findings.dimensions_error.map(|_| self.findings.saved()),
        }
    }
}

/// Draws a frame once and times it at every level, and draws it once more without small motion and blur.
fn probe_frame(plan: &Plan, job: &dyn Job, number: u32, findings: &mut Findings) -> Result<(), RunError> {
    let gpu = &plan.gpu;
    let drawn = ProbedFrame::draw(job, number, gpu)?;
    let [stepped, packet, bound] = Level::ALL.map(|level| drawn.timed(plan, level));
    let timed = [stepped?, packet?, bound?];
    let cost = |level: Level| timed[level as usize].0;
    for (level, (_, timing_s)) in Level::ALL.into_iter().zip(timed) {
        let error = relative_error(&cost(level), &cost(Level::Stepped));
        findings.add(level, error, timing_s, drawn.pipeline_s);
    }
    let by = plan.viewport.width() as f32 / job.settings().width as f32;
    let features = with_blur_thresholds(gpu.pipeline.features, by);
    let thresholds = GpuSpec { pipeline: PipelineSpec { features, ..gpu.pipeline }, ..gpu.clone() };
    let reduced = ProbedFrame::draw(job, number, &thresholds)?;
    if drawn.counts != reduced.counts {
        let error = relative_error(&reduced.timed(plan, Level::Packet)?.0, &cost(Level::Packet));
        findings.add_dimensions(error, [&drawn, &reduced].map(|probed| madds(&probed.counts)));
    }
    Ok(())
}

impl ProbedFrame {
    fn draw(job: &dyn Job, number: u32, gpu: &GpuSpec) -> Result<Self, RunError> {
        let started = Instant::now();
        let mut packets = PacketBuffer::default();
        let emit = |packet: &_, lines: &_| packets.push(packet, lines);
        let (_, report) = draw_on(gpu, None, &*job.prepare(number)?, None, emit)?;
        Ok(Self { number, packets, counts: report.counts(), pipeline_s: started.elapsed().as_secs_f64() })
    }

    /// Cost of the frame at `level`, and the CPU seconds of the timing model.
    fn timed(&self, plan: &Plan, level: Level) -> Result<(FrameCost, f64), RunError> {
        let started = ThreadTime::now();
        let recorder = Recorder::new(crate::BIN_PS, frame::MIN_FRAME_BINS);
        let mut clock = CheckedClock::new(level, plan.gpu.machine()?, recorder);
        self.packets.iter().for_each(|(packet, lines)| clock.push(packet, lines));
        let timed = clock.finish()?;
        let timing_s = started.elapsed().as_secs_f64();
        let power = plan.model.frame(&timed.timeline);
        let power = power.map_err(|source| RunError::Timeline { frame: self.number, source })?;
        Ok((FrameCost { cycles: timed.cycles as f64, energy_j: power.energy().total_j() }, timing_s))
    }
}

/// Larger of the relative errors of cycles and energy.
fn relative_error(found: &FrameCost, truth: &FrameCost) -> f64 {
    let relative = |found: f64, truth: f64| if found == truth { 0.0 } else { (found / truth - 1.0).abs() };
    relative(found.cycles, truth.cycles).max(relative(found.energy_j, truth.energy_j))
}

fn madds(counts: &Counts) -> u64 {
    counts[Event::TileMadds] + counts[Event::ScreenMadds] + counts[Event::SampleMadds]
}
