//! Probe: a few frames at a reduced size, simulated at every timing level.

use std::time::Instant;

use activity::{Counts, Event};
use cpu_time::ThreadTime;
use output::progress::Progress;
use pipeline::{Gpu, PipelineSpec};
use timing::{FrameClock, Level, Recorder};
use workloads::Job;
use workloads::job::Reduction;

use super::Findings;
use super::{ProbeSummary, with_blur_thresholds};
use crate::{Distinct, FrameCost, Plan, RunError, frame};

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

/// Result of one frame at one level.
struct ProbedFrame {
    cost: FrameCost,
    counts: Counts,
    /// CPU seconds of the timing model.
    timing_s: f64,
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
        // Host times are sums over the probe's frames, at a reduced size. Passes that do not depend on it are overestimated.
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

/// Simulates a frame at every level, and once more without small motion and blur.
fn probe_frame(plan: &Plan, job: &dyn Job, number: u32, findings: &mut Findings) -> Result<(), RunError> {
    let spec = &plan.gpu.pipeline;
    let truth = simulate_frame(plan, job, number, spec, Level::Stepped)?;
    for level in Level::ALL {
        let probed = if level == Level::Stepped {
            None
        } else {
            Some(simulate_frame(plan, job, number, spec, level)?)
        };
        let probed = probed.as_ref().unwrap_or(&truth);
        findings.add(level, relative_error(&probed.cost, &truth.cost), probed.timing_s, probed.pipeline_s);
    }
    let by = plan.viewport.width() as f32 / job.settings().width as f32;
    let thresholds = PipelineSpec { features: with_blur_thresholds(spec.features, by), ..*spec };
    let (exact, reduced) = (
        simulate_frame(plan, job, number, spec, Level::Packet)?,
        simulate_frame(plan, job, number, &thresholds, Level::Packet)?,
    );
    if exact.counts != reduced.counts {
        findings.add_dimensions(
            relative_error(&reduced.cost, &exact.cost),
            [&exact, &reduced].map(|probed| madds(&probed.counts)),
        );
    }
    Ok(())
}

fn simulate_frame(
    plan: &Plan,
    job: &dyn Job,
    number: u32,
    spec: &PipelineSpec,
    level: Level,
) -> Result<ProbedFrame, RunError> {
    let started = Instant::now();
    let mut clock =
        FrameClock::new(level, plan.gpu.machine()?, Recorder::new(crate::BIN_PS, frame::MIN_FRAME_BINS));
    let mut packets = Vec::new();
    let mut lines = Vec::new();
    let emit = |packet: &activity::Packet, new_lines: &[activity::LineAccess]| {
        lines.extend_from_slice(new_lines);
        packets.push((*packet, lines.len()));
    };
    let mut gpu = Gpu::new(spec, emit).map_err(RunError::setting)?;
    job.frame(number, &mut gpu).map_err(RunError::on(&plan.gpu))?;
    let counts = gpu.finish().counts();
    let pipeline_s = started.elapsed().as_secs_f64();
    let started = ThreadTime::now();
    let mut first = 0;
    for (packet, end) in &packets {
        clock.push(packet, &lines[first..*end]);
        first = *end;
    }
    let timed = clock.finish()?;
    let timing_s = started.elapsed().as_secs_f64();
    let power = plan.model.frame(&timed.timeline);
    let power = power.map_err(|source| RunError::Timeline { frame: number, source })?;
    let cost = FrameCost { cycles: timed.cycles as f64, energy_j: power.energy().total_j() };
    Ok(ProbedFrame { cost, counts, timing_s, pipeline_s })
}

/// Larger of the relative errors of cycles and energy.
pub(super) fn relative_error(found: &FrameCost, truth: &FrameCost) -> f64 {
    let relative = |found: f64, truth: f64| if found == truth { 0.0 } else { (found / truth - 1.0).abs() };
    relative(found.cycles, truth.cycles).max(relative(found.energy_j, truth.energy_j))
}

fn madds(counts: &Counts) -> u64 {
    counts[Event::TileMadds] + counts[Event::ScreenMadds] + counts[Event::SampleMadds]
}
