//! A few frames at a reduced size, at every level.

use std::time::Instant;

use activity::{Counts, Event};
use cpu_time::ThreadTime;
use output::progress::Progress;
use pipeline::frame::render_with_heat;
use pipeline::{PipelineSpec, Settings, Viewport};
use timing::{FrameClock, Level, Recorder};

use super::decide::Findings;
use super::{ProbeSummary, with_blur_thresholds};
use crate::{Distinct, FrameCost, Plan, RunError, frame};

/// Frames that are looked at: the middles of as many equal parts of the run.
const MAX_FRAMES: usize = 3;
/// The image is as many times smaller along each axis as leaves it so wide, and at most [`MAX_REDUCTION`] times.
const TARGET_WIDTH_PX: u32 = 320;
const MAX_REDUCTION: u32 = 4;

/// What was looked at, and what was found.
pub(super) struct Probe {
    numbers: Vec<u32>,
    viewport: Viewport,
    pub findings: Findings,
}

/// A frame at one level.
struct ProbedFrame {
    cost: FrameCost,
    counts: Counts,
    /// Seconds of the host: of the thread in the clock alone, and by the clock on the wall in the pipeline around it.
    timing_s: f64,
    pipeline_s: f64,
}

impl Probe {
    /// Simulates some of the frames that differ.
    pub fn new(plan: &Plan, distinct: &Distinct, progress: &Progress) -> Result<Self, RunError> {
        let differ = distinct.numbers();
        let some = MAX_FRAMES.min(differ.len());
        let numbers: Vec<u32> =
            (0..some).map(|part| differ[(2 * part + 1) * differ.len() / (2 * some)]).collect();
        let by = (plan.viewport.width() / TARGET_WIDTH_PX).clamp(1, MAX_REDUCTION);
        let [width, height] = [plan.viewport.width(), plan.viewport.height()].map(|side| side.div_ceil(by));
        let viewport = Viewport::new(width, height)
            .ok_or_else(|| RunError::Setting(format!("size of the probe: {width}x{height}")))?;
        let bar = progress.bar("probe", numbers.len() as u64);
        let mut findings = Findings::default();
        for &number in &numbers {
            probe_frame(plan, number, viewport, by, &mut findings)?;
            bar.inc();
        }
        // Host times are for all frames of the probe; a frame of the run has more pixels.
        let scale = plan.pixels() as f64 / viewport.pixels() as f64 / some as f64;
        findings.scale_times(scale);
        Ok(Self { numbers, viewport, findings })
    }

    pub fn summary(&self) -> ProbeSummary {
        let error = |level: Level| (level, self.findings.error(level));
        ProbeSummary {
            frames: self.numbers.clone(),
            size: [self.viewport.width(), self.viewport.height()],
            error: Level::ALL.map(error).into_iter().collect(),
            dimensions_error: self.findings.dimensions_error,
            dimensions_saved: self.findings.dimensions_error.map(|_| self.findings.saved()),
        }
    }
}

/// One frame at every level, and once more without dimensions that hardly show.
fn probe_frame(
    plan: &Plan,
    number: u32,
    viewport: Viewport,
    by: u32,
    findings: &mut Findings,
) -> Result<(), RunError> {
    let spec = &plan.gpu.pipeline;
    let truth = simulate_frame(plan, number, viewport, spec, Level::Stepped)?;
    for level in Level::ALL {
        let seen = if level == Level::Stepped {
            None
        } else {
            Some(simulate_frame(plan, number, viewport, spec, level)?)
        };
        let seen = seen.as_ref().unwrap_or(&truth);
        findings.add(level, relative_error(&seen.cost, &truth.cost), seen.timing_s, seen.pipeline_s);
    }
    let thresholds = PipelineSpec { features: with_blur_thresholds(spec.features, by as f32), ..*spec };
    let (exact, reduced) = (
        simulate_frame(plan, number, viewport, spec, Level::Packet)?,
        simulate_frame(plan, number, viewport, &thresholds, Level::Packet)?,
    );
    if exact.counts != reduced.counts {
        findings.add_dimensions(
            relative_error(&reduced.cost, &exact.cost),
            [&exact, &reduced].map(|seen| madds(&seen.counts)),
        );
    }
    Ok(())
}

fn simulate_frame(
    plan: &Plan,
    number: u32,
    viewport: Viewport,
    spec: &PipelineSpec,
    level: Level,
) -> Result<ProbedFrame, RunError> {
    let started = Instant::now();
    let scene = plan.work.scene("--accuracy or --budget")?;
    let frame = scene.frame(number)?;
    let draws = frame.draws(scene)?;
    let settings = Settings { spec, viewport, samples: &*plan.samples, background: scene.background() };
    let mut clock =
        FrameClock::new(level, plan.gpu.machine()?, Recorder::new(frame::BIN_PS, frame::MIN_FRAME_BINS));
    let mut packets = Vec::new();
    let mut lines = Vec::new();
    let emit = |packet: &activity::Packet, new_lines: &[activity::LineAccess]| {
        lines.extend_from_slice(new_lines);
        packets.push((*packet, lines.len()));
    };
    let rendered = render_with_heat(&frame.camera, &draws, &settings, &[], emit);
    let (rendered, _) = rendered.map_err(RunError::setting)?;
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
    Ok(ProbedFrame { cost, counts: rendered.counts, timing_s, pipeline_s })
}

/// The larger of the relative errors of cycles and energy.
pub(super) fn relative_error(found: &FrameCost, truth: &FrameCost) -> f64 {
    let relative = |found: f64, truth: f64| if found == truth { 0.0 } else { (found / truth - 1.0).abs() };
    relative(found.cycles, truth.cycles).max(relative(found.energy_j, truth.energy_j))
}

fn madds(counts: &Counts) -> u64 {
    counts[Event::TileMadds] + counts[Event::ScreenMadds] + counts[Event::SampleMadds]
}
