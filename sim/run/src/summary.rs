//! `summary.json`: the numbers of a run. Equal inputs give equal bytes on every machine, except for `host`.

use std::collections::BTreeMap;

use activity::{Counts, S_PER_PS, Unit};
use output::MeanSd;
use output::report::Headline;
use power_model::Energy;
use serde::Serialize;
use traces::energy::{FrameEnergy, FrameSummary, Spread};
use warnings::Warning;
use workloads::Scene;
use workloads::scene::CameraUsed;

use crate::frame::image_name;
use crate::measure::{Checks, mean_parts_w};
use crate::passes::{self, PassSummary, StallShares, stall_shares};
use crate::provenance::SCHEMA;
use crate::{
    Choice, HardwareSummary, Host, Input, Measurement, Modelled, Plan, Provenance, Resolution, RunOptions,
    SampledSummary, Simulated, StatedError, Verified, warn,
};

/// Contents of `summary.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Schema version.
    pub schema: u32,
    /// Version of the program.
    pub version: &'static str,
    /// Name of the scene.
    pub scene: String,
    /// Name of the GPU.
    pub gpu: String,
    /// Name of the platform.
    pub platform: String,
    /// Name and column of the energy table.
    pub energy_table: [String; 2],
    /// Options of the run. Results depend on these and on the contents of `inputs`.
    pub request: RunOptions,
    /// Input files, sorted by name.
    pub inputs: Vec<Input>,
    /// Settings in use.
    pub settings: SettingsSummary,
    /// Camera of the first frame; `None` for workloads without a scene.
    pub camera: Option<CameraUsed>,
    /// Area and power of the hardware, scaled from the GPU that the platform was made for.
    pub hardware: HardwareSummary,
    /// Dimensions and units that were modelled.
    pub modelled: Modelled,
    /// Warnings.
    pub warnings: Vec<Warning>,
    /// Frames as measured in the trace; `None` if of several frames only the marked one was found.
    pub measured: Option<Figures>,
    /// Frames as simulated: the ground truth.
    pub truth: Option<Figures>,
    /// Sampling rate relative to the frames.
    pub recorder: Resolution,
    /// Found frame starts compared with true ones.
    pub detection: Detection,
    /// Consistency checks.
    pub checks: Checks,
    /// Energy by part in joules, from the first frame's start to the last frame's end.
    pub energy_by_part_j: Energy,
    /// Mean power by part in watts.
    pub power_by_part_w: BTreeMap<&'static str, f64>,
    /// Busy time of each unit in use, as a share of the frames' busy time.
    pub unit_busy: BTreeMap<&'static str, f64>,
    /// Busy, idle and stalled shares of each unit's time, if the timing level records stalls.
    pub stalls: BTreeMap<&'static str, StallShares>,
    /// Sample test efficiency: samples hit over samples tested.
    pub sample_test_efficiency: Option<f64>,
    /// Results of a workload by name, means over frames.
    pub facts: BTreeMap<&'static str, f64>,
    /// Event counts of the simulated frames.
    pub counts: Counts,
    /// Work and energy of the passes of the simulated frames, by name.
    pub passes: Vec<PassSummary>,
    /// Hash of the event counts of all simulated frames. Equal runs have equal hashes.
    pub counts_hash: String,
    /// Choice for the requested accuracy or time budget.
    pub choice: Option<Choice>,
    /// Stated error of cycles and busy energy, over those at `stepped`.
    pub stated_error: StatedError,
    /// Actual errors, with `--verify`.
    pub verified: Option<Verified>,
    /// Simulated frames and confidence intervals of a sampled run.
    pub sampled: Option<SampledSummary>,
    /// All frames of the run.
    pub frames: Vec<FrameRow>,
    /// Program, command line and host. All other keys are equal on every machine.
    pub host: Host,
}

/// Settings in use.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs, reason = "the names say it, documented at their sources")]
pub struct SettingsSummary {
    pub width: u32,
    pub height: u32,
    pub samples: u32,
    pub table: String,
    pub clip: Option<String>,
    pub frame_rate_hz: f64,
    pub shutter: f64,
    pub first_frame: u32,
    pub frames: u32,
    pub lens_radius: f32,
    pub focus: Option<f32>,
    /// `None` in a run of images alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pacing: Option<&'static str>,
    /// `None` in a run of images alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trace_rate_hz: Option<f64>,
    pub seed: u64,
    pub triangles: usize,
}

impl SettingsSummary {
    /// Settings of image and scene. The first frame has so many triangles in all passes.
    pub(super) fn new(plan: &Plan, triangles: usize) -> Self {
        let scene = plan.job.settings();
        Self {
            width: scene.width,
            height: scene.height,
            samples: scene.samples,
            table: scene.table.clone(),
            clip: plan.job.scene().and_then(Scene::clip).map(str::to_owned),
            frame_rate_hz: scene.frame_rate_hz,
            shutter: scene.shutter,
            first_frame: scene.frames.start,
            frames: scene.frames.end - scene.frames.start,
            lens_radius: scene.lens_radius,
            focus: scene.focus,
            pacing: None,
            trace_rate_hz: None,
            seed: plan.options.seed,
            triangles,
        }
    }
}

/// Statistics over frames.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Figures {
    /// Number of frames.
    pub frames: usize,
    /// Seconds from start to start of the next.
    pub duration_s: Spread,
    /// Joules.
    pub energy_j: Spread,
    /// Joules per pixel.
    pub energy_per_pixel_j: Spread,
    /// Watts.
    pub power_w: Spread,
    /// Energy of all frames in joules.
    pub total_j: f64,
}

impl Figures {
    fn of(frames: &[FrameEnergy], pixels: u64) -> Option<Self> {
        let summary = FrameSummary::of(frames)?;
        Some(Self {
            frames: summary.frames,
            duration_s: summary.duration_s,
            energy_j: summary.energy_j,
            energy_per_pixel_j: scaled(summary.energy_j, 1.0 / pixels as f64),
            power_w: summary.power_w,
            total_j: summary.total_j,
        })
    }
}

fn scaled(spread: Spread, by: f64) -> Spread {
    Spread { mean: spread.mean * by, deviation: spread.deviation * by, median: spread.median * by }
}

/// Precision and errors of the found frame starts.
#[derive(Clone, Debug, Serialize)]
#[allow(missing_docs, reason = "the terms of information retrieval")]
pub struct Detection {
    pub true_frames: usize,
    pub found_frames: usize,
    pub matched_frames: usize,
    pub precision: f64,
    pub recall: f64,
    pub median_timing_error_s: Option<f64>,
    pub worst_timing_error_s: Option<f64>,
    pub median_energy_error: Option<f64>,
    pub worst_energy_error: Option<f64>,
}

impl Summary {
    /// Time, energy and power per frame, measured and true: mean and standard deviation in SI units. A single
    /// frame has no deviation.
    pub fn headline(&self) -> Vec<Headline> {
        let sd = |deviation: f64| (self.settings.frames > 1).then_some(deviation);
        let row = |label: &str, unit: &str, pick: fn(&Figures) -> Spread| {
            let number = |figures: &Option<Figures>| {
                figures.as_ref().map(pick).map(|s| MeanSd { mean: s.mean, sd: sd(s.deviation) })
            };
            let (measured, truth) = (number(&self.measured), number(&self.truth));
            Headline { label: label.to_owned(), unit: unit.to_owned(), measured, truth }
        };
        vec![
            row("time per frame", "s", |f| f.duration_s),
            row("energy per frame", "J", |f| f.energy_j),
            row("energy per pixel", "J", |f| f.energy_per_pixel_j),
            row("power", "W", |f| f.power_w),
        ]
    }

    /// Choice, confidence intervals, stated and actual errors as text rows.
    pub fn accuracy_rows(&self) -> Vec<(&'static str, String)> {
        let mut rows: Vec<(&'static str, String)> = Vec::new();
        rows.extend(self.choice.as_ref().map(|choice| ("chosen", choice.line())));
        rows.extend(self.sampled.as_ref().map(|sampled| ("predicted", sampled.line())));
        let stated = self.stated_error.line();
        rows.push(match self.choice {
            None => ("stated error", stated),
            // It is of random GPUs and frames, and may be far above what was measured on these.
            Some(_) => {
                ("stated error", format!("{stated} for any run at this level; the choice measured this one"))
            }
        });
        rows.extend(self.verified.as_ref().map(|verified| ("actual error", verified.line())));
        rows
    }

    /// Adds the warnings about a missed accuracy or budget, and about an actual error beyond the stated one.
    pub(super) fn with_error_warnings(mut self) -> Self {
        let verified = self.verified.as_ref();
        let missed = self.choice.iter().flat_map(|choice| warn::missed_requests(choice, verified));
        let beyond = verified.and_then(|verified| warn::beyond_stated(&self.stated_error, verified));
        self.warnings.extend(missed.chain(beyond).collect::<Vec<_>>());
        self.warnings = Warning::fold(self.warnings);
        self
    }

    pub(super) fn new(
        plan: &Plan,
        provenance: Provenance,
        simulated: &Simulated,
        measurement: &Measurement,
    ) -> Self {
        let Provenance { request, inputs, camera, host } = provenance;
        let counts = simulated.total();
        let truth = true_frames(measurement);
        let by_part = mean_parts_w(&measurement.run);
        let pixels = plan.pixels();
        Self {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION"),
            scene: plan.name.clone(),
            gpu: plan.gpu.name.clone(),
            platform: plan.platform.name.clone(),
            energy_table: [plan.table.name().to_owned(), format!("{:?}", plan.options.bound).to_lowercase()],
            request,
            inputs,
            settings: SettingsSummary {
                pacing: Some(plan.options.pacing.name()),
                trace_rate_hz: Some(measurement.resolution.rate_hz),
                ..SettingsSummary::new(plan, simulated.distinct.first().map_or(0, |frame| frame.triangles))
            },
            camera,
            hardware: HardwareSummary::new(plan),
            modelled: Modelled::new(plan, simulated),
            warnings: warn::gather(plan, simulated, measurement),
            measured: Figures::of(&measurement.frames, pixels).filter(|_| !measurement.is_mark_alone()),
            truth: Figures::of(&truth, pixels),
            recorder: measurement.resolution,
            detection: detection(measurement),
            checks: measurement.checks.clone(),
            energy_by_part_j: measurement.run.energy(),
            power_by_part_w: measurement
                .run
                .energy()
                .reported()
                .map(|(part, _)| (part.name(), by_part[part.index()]))
                .collect(),
            unit_busy: unit_busy(simulated),
            stalls: stall_shares(simulated),
            facts: facts(simulated),
            sample_test_efficiency: counts.sample_test_efficiency(),
            counts,
            passes: passes::passes_of(plan, simulated.in_order()),
            counts_hash: format!(
                "{:016x}",
                simulated.known().fold(0, |seed, frame| hash(seed, &frame.counts))
            ),
            choice: None,
            stated_error: stated_error(plan, simulated),
            verified: None,
            sampled: simulated.sampled.clone(),
            frames: rows(plan, simulated, measurement),
            host,
        }
    }
}

/// Stated error of the timing level, and of the prediction of frames.
fn stated_error(plan: &Plan, simulated: &Simulated) -> StatedError {
    let of_level = StatedError::of_frames(plan.options.level(), simulated.in_order());
    match &simulated.sampled {
        Some(SampledSummary { cycles_per_frame, busy_energy_per_frame_j, .. }) => {
            of_level.beside(cycles_per_frame.relative_half_width, busy_energy_per_frame_j.relative_half_width)
        }
        None => of_level,
    }
}

/// Mean over frames of each result of a workload.
fn facts(simulated: &Simulated) -> BTreeMap<&'static str, f64> {
    let mut sums: BTreeMap<&'static str, [f64; 2]> = BTreeMap::new();
    for fact in simulated.known().flat_map(|frame| &frame.facts) {
        let [sum, count] = sums.entry(fact.name).or_default();
        *sum += fact.value;
        *count += 1.0;
    }
    sums.into_iter().map(|(name, [sum, count])| (name, sum / count)).collect()
}

/// True frames in the form of measured frames, for the same statistics.
fn true_frames(measurement: &Measurement) -> Vec<FrameEnergy> {
    let frame = |f: &power_model::PacedFrame| FrameEnergy {
        start_s: f.start_s,
        end_s: f.end_s,
        energy_j: f.energy.total_j(),
        confidence: 1.0,
        flags: traces::frames::Flags::default(),
    };
    measurement.run.frames.iter().map(frame).collect()
}

fn detection(measurement: &Measurement) -> Detection {
    let score = &measurement.score;
    Detection {
        true_frames: score.truth,
        found_frames: score.found,
        matched_frames: score.matched,
        precision: score.precision(),
        recall: score.recall(),
        median_timing_error_s: score.median_timing_error_s(),
        worst_timing_error_s: score.worst_timing_error_s(),
        median_energy_error: score.median_energy_error(),
        worst_energy_error: score.worst_energy_error(),
    }
}

/// Busy time of each unit over the busy time of the frames.
fn unit_busy(simulated: &Simulated) -> BTreeMap<&'static str, f64> {
    let total = simulated.total();
    let time: f64 = simulated.in_order().map(|frame| frame.power.duration_s()).sum();
    let busy = |unit: Unit| {
        let ps: u64 = simulated.in_order().map(|frame| frame.busy_ps[unit as usize]).sum();
        ps as f64 * S_PER_PS / time
    };
    Unit::ALL.into_iter().filter(|&unit| total.uses(unit)).map(|unit| (unit.name(), busy(unit))).collect()
}

/// Frame of a run, in `summary.json`.
#[derive(Clone, Debug, Serialize)]
pub struct FrameRow {
    /// Frame number in the scene.
    pub frame: u32,
    /// Image file; `None` for a predicted frame.
    pub image: Option<String>,
    /// Whether the frame was predicted.
    pub predicted: bool,
    /// Hash of its event counts, equal at every timing level; `None` for a predicted frame.
    pub counts_hash: Option<String>,
    /// True start in seconds from the start of the recording.
    pub start_s: f64,
    /// Busy time in cycles of the core clock.
    pub cycles: u64,
    /// Busy time in seconds.
    pub busy_s: f64,
    /// Time to the start of the next frame, in seconds.
    pub duration_s: f64,
    /// True energy in joules.
    pub energy_j: f64,
    /// True energy per pixel in joules.
    pub energy_per_pixel_j: f64,
    /// True mean power in watts.
    pub power_w: f64,
    /// True energy by part in joules. Summed in this order they give the frame's energy exactly.
    pub energy_by_part_j: Energy,
    /// Ends of the interval of the cycles, for a predicted frame.
    pub cycles_interval: Option<[f64; 2]>,
    /// Ends of the interval of the energy in joules, for a predicted frame.
    pub energy_interval_j: Option<[f64; 2]>,
    /// Energy measured in the trace in joules; `None` if the frame was not found.
    pub measured_energy_j: Option<f64>,
    /// Error of the found start in seconds; `None` if the frame was not found.
    pub start_error_s: Option<f64>,
}

/// Hash of counts, continued from `seed`.
fn hash(seed: u64, counts: &Counts) -> u64 {
    counts.reported().zip(0..).fold(seed, |hash: u64, ((_, count), at)| {
        pipeline::random::mix(hash.rotate_left(1) ^ count.wrapping_add(at))
    })
}

/// Interval of half-width `half` around a value, not below 0.
fn around(value: f64, half: Option<f64>) -> Option<[f64; 2]> {
    half.map(|half| [(value - half).max(0.0), value + half])
}

/// All frames of the run.
fn rows(plan: &Plan, simulated: &Simulated, measurement: &Measurement) -> Vec<FrameRow> {
    let first = plan.job.settings().frames.start;
    measurement
        .run
        .frames
        .iter()
        .zip(measurement.by_true_frame())
        .zip(simulated.in_order())
        .zip(first..)
        .map(|(((paced, measured), known), frame)| {
            let (energy_j, duration_s) = (paced.energy.total_j(), paced.end_s - paced.start_s);
            FrameRow {
                frame,
                image: known.observed().map(|_| format!("{}.png", image_name(frame))),
                predicted: known.half_widths().is_some(),
                counts_hash: known.observed().map(|observed| format!("{:016x}", hash(0, &observed.counts))),
                start_s: paced.start_s,
                cycles: known.cycles,
                busy_s: paced.busy_end_s - paced.start_s,
                duration_s,
                energy_j,
                energy_per_pixel_j: energy_j / plan.pixels() as f64,
                cycles_interval: around(known.cycles as f64, known.half_widths().map(|half| half.cycles)),
                energy_interval_j: around(energy_j, known.half_widths().map(|half| half.energy_j)),
                energy_by_part_j: paced.energy,
                power_w: energy_j / duration_s,
                measured_energy_j: measured.map(|m| m.energy_j),
                start_error_s: measured.map(|m| m.start_s - paced.start_s),
            }
        })
        .collect()
}
