//! Results of the simulator: the frames of a run, which dimensions and units were modelled, and how far its
//! cycles and its energy may be from those at timing level `stepped`.
//!
//! Stated errors are factors: an error of 0.05 says that the number at `stepped` is at most 1.05 times as
//! large and at least 1/1.05 times. The stated error is what the check of a frame finds, and a margin: by so
//! much or less the errors of 95 % of runs on GPUs drawn at random were larger than what their checks found
//! (split conformal prediction; Papadopoulos et al. 2002, Vovk, Gammerman and Shafer 2005).
//! `quintile chart stated-errors` measures the margins, and how often stated errors hold.

use std::sync::OnceLock;

use activity::{Counts, Unit};
use glam::Vec3;
use pipeline::FrameReport;
use power_model::FramePower;
use serde::{Deserialize, Serialize};
use timing::sampled::Interval;
use timing::{Checked, DrawSpan, Level, PassTime, Stalls, error_size};
use warnings::Warning;
use workloads::Regime;
use workloads::job::Fact;

use crate::Plan;
use crate::heat::HeatPicture;

/// Frame of a run with its power over time, simulated or predicted.
pub struct RunFrame {
    /// Frame number in the scene.
    pub index: u32,
    /// Number of triangles.
    pub triangles: usize,
    /// Whether anything moves while its shutter is open.
    pub moving: bool,
    /// Whether the camera has a lens.
    pub lens: bool,
    /// Power over time in watts, and energy by part in joules.
    pub power: FramePower,
    /// Busy time of each unit in picoseconds.
    pub busy_ps: [u64; Unit::COUNT],
    /// Busy share of each unit in each bin of [`FramePower::bin_s`].
    pub busy: Vec<[f32; Unit::COUNT]>,
    /// Cycles of the core clock.
    pub cycles: u64,
    /// Simulated or predicted, with the data of that variant.
    pub origin: Origin,
}

/// Origin of the numbers of a frame.
pub enum Origin {
    /// The frame was simulated.
    Simulated(Box<Observed>),
    /// The frame was predicted from others: half-widths of the intervals of cycles and energy.
    Predicted(FrameCost),
}

/// Data that only a simulated frame has.
pub struct Observed {
    /// Event counts.
    pub counts: Counts,
    /// Work by pass and by draw.
    pub report: FrameReport,
    /// Time of each pass.
    pub times: Vec<PassTime>,
    /// When the frame spent its time on which draw; empty if draws take turns and no stalls are recorded.
    pub spans: Vec<DrawSpan>,
    /// Results of a workload, by name.
    pub facts: Vec<Fact>,
    /// Warnings of a workload.
    pub warnings: Vec<Warning>,
    /// Numbers of triangles for which tile tests are ineffective.
    pub regime: Regime,
    /// Stall reasons, if the timing level records them.
    pub stalls: Option<Stalls>,
    /// How far the timing level is off on parts of the frame; `None` at `stepped`.
    pub checked: Option<Checked>,
}

impl RunFrame {
    /// Data of a simulated frame; `None` for a predicted frame.
    pub fn observed(&self) -> Option<&Observed> {
        match &self.origin {
            Origin::Simulated(observed) => Some(observed),
            Origin::Predicted(_) => None,
        }
    }

    /// Cycles and energy of the frame.
    pub fn cost(&self) -> FrameCost {
        FrameCost { cycles: self.cycles as f64, energy_j: self.power.energy().total_j() }
    }

    /// Half-widths of the intervals of a predicted frame; `None` for a simulated frame.
    pub fn half_widths(&self) -> Option<FrameCost> {
        match self.origin {
            Origin::Simulated(_) => None,
            Origin::Predicted(half) => Some(half),
        }
    }
}

/// Frames of a run.
pub struct Simulated {
    /// Distinct frames.
    pub distinct: Vec<RunFrame>,
    /// Index into `distinct` of each frame of the run; frames with equal input share one entry.
    pub frames: Vec<usize>,
    /// Images for the report: frame number and linear pixels.
    pub pictures: Vec<(u32, Vec<Vec3>)>,
    /// Heat maps of one frame, for the report.
    pub heat: Vec<HeatPicture>,
    /// Simulated frames and confidence intervals of a sampled run.
    pub sampled: Option<SampledSummary>,
}

impl Simulated {
    /// Frames of the run in order.
    pub fn in_order(&self) -> impl Iterator<Item = &RunFrame> {
        self.frames.iter().map(|&place| &self.distinct[place])
    }

    /// Simulated frames among the distinct frames.
    pub fn observed(&self) -> impl Iterator<Item = (&RunFrame, &Observed)> {
        self.distinct.iter().filter_map(|frame| Some((frame, frame.observed()?)))
    }

    /// Data of the simulated frames of the run, in order.
    pub fn known(&self) -> impl Iterator<Item = &Observed> {
        self.in_order().filter_map(RunFrame::observed)
    }

    /// Event counts, summed over the simulated frames of the run.
    pub fn total(&self) -> Counts {
        self.known().fold(Counts::default(), |mut sum, frame| {
            sum += &frame.counts;
            sum
        })
    }
}

/// Cycles and energy of a frame, or their errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameCost {
    /// Cycles of the core clock.
    pub cycles: f64,
    /// Joules while busy.
    pub energy_j: f64,
}

/// Quantity of the run with its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RunQuantity {
    /// Estimate.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of the 95 % interval.
    pub high: f64,
    /// Half-width over the estimate.
    pub relative_half_width: f64,
}

impl From<Interval> for RunQuantity {
    fn from(interval: Interval) -> Self {
        let Interval { value, low, high } = interval;
        Self { value, low, high, relative_half_width: interval.relative() }
    }
}

impl RunQuantity {
    /// Whether the interval contains `truth`.
    pub fn holds(&self, truth: f64) -> bool {
        (self.low..=self.high).contains(&truth)
    }
}

/// Simulated frames and confidence intervals of a sampled run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SampledSummary {
    /// Simulated frames; all others are predicted.
    pub simulated_frames: Vec<u32>,
    /// Frames of the run per simulated frame.
    pub frames_per_simulated: f64,
    /// Number of strata: groups of frames with similar previews, including that of the pilot frame.
    pub strata: usize,
    /// Width and height of the preview in pixels, and samples per pixel.
    pub preview: [u32; 3],
    /// Cycles of the preview of a frame over those of the frame.
    pub preview_share: f64,
    /// Confidence level of the intervals.
    pub confidence: f64,
    /// Mean cycles per frame.
    pub cycles_per_frame: RunQuantity,
    /// Mean energy per frame in joules while the GPU is busy, without idle time.
    pub busy_energy_per_frame_j: RunQuantity,
    /// Mean power in watts while the GPU is busy.
    pub busy_power_w: RunQuantity,
}

impl SampledSummary {
    /// The three quantities with names and units.
    pub fn quantities(&self) -> [(&'static str, &'static str, RunQuantity); 3] {
        [
            ("cycles per frame", "", self.cycles_per_frame),
            ("energy per frame while busy", "J", self.busy_energy_per_frame_j),
            ("power while busy", "W", self.busy_power_w),
        ]
    }

    /// A line for the terminal and the report.
    pub fn line(&self) -> String {
        let quantities = self.quantities().map(|(name, unit, quantity)| {
            format!(
                "{name} {} ± {:.2} %",
                output::table::si(quantity.value, unit),
                quantity.relative_half_width * 100.0
            )
        });
        format!(
            "from {} simulated frames, one of every {:.0}, with 95 % intervals: {}",
            self.simulated_frames.len(),
            self.frames_per_simulated,
            quantities.join(", ")
        )
    }

    /// Relative half-width of the widest interval.
    pub fn worst(&self) -> f64 {
        self.quantities().iter().map(|(_, _, quantity)| quantity.relative_half_width).fold(0.0, f64::max)
    }
}

/// Dimensions and units that a run modelled.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Modelled {
    /// Number of dimensions: 2 for the screen, 1 for motion while the shutter is open, 2 for a lens.
    pub dimensions: u32,
    /// Whether time is a dimension.
    pub motion: bool,
    /// Whether the lens is a dimension.
    pub lens: bool,
    /// Number of simulated frames; equal frames are simulated once.
    pub distinct_frames: usize,
    /// Number of predicted distinct frames.
    pub predicted_frames: usize,
    /// Units with at least one event.
    pub units: Vec<&'static str>,
    /// Units without events.
    pub units_not_modelled: Vec<&'static str>,
    /// Timing level.
    pub timing: &'static str,
    /// Limitations of the model and of this run.
    pub limits: Vec<&'static str>,
}

impl Modelled {
    pub(super) fn new(plan: &Plan, simulated: &Simulated) -> Self {
        let total = simulated.total();
        let motion = simulated.distinct.iter().any(|frame| frame.moving);
        let lens = simulated.distinct.iter().any(|frame| frame.lens);
        let (used, unused): (Vec<Unit>, Vec<Unit>) =
            Unit::ALL.into_iter().partition(|&unit| total.uses(unit));
        let predicted = simulated.distinct.iter().filter(|frame| frame.half_widths().is_some()).count();
        let mut limits = vec![
            "one voltage and clock state; no governor, no temperature change",
            "caches are walked in the order of the stream, whenever it is timed",
        ];
        if simulated.distinct.len() < simulated.frames.len() {
            limits.push(match simulated.distinct.len() {
                1 => "nothing changes from frame to frame: one frame was simulated and repeated",
                _ => "some frames equal an earlier one: these were not simulated again",
            });
        }
        if predicted > 0 {
            limits.push(
                "counters, heat and images are of the frames that were simulated; the others are predicted",
            );
        }
        Self {
            dimensions: 2 + u32::from(motion) + 2 * u32::from(lens),
            motion,
            lens,
            distinct_frames: simulated.distinct.len() - predicted,
            predicted_frames: predicted,
            units: used.into_iter().map(Unit::name).collect(),
            units_not_modelled: unused
                .into_iter()
                .filter(|unit| !unit.is_optional())
                .map(Unit::name)
                .collect(),
            timing: plan.options.level().name(),
            limits,
        }
    }

    /// A line for the terminal.
    pub fn line(&self) -> String {
        let dimensions = match (self.motion, self.lens) {
            (true, true) => "5D (screen, lens, time)",
            (true, false) => "3D (screen, time; pinhole: no lens)",
            (false, true) => "4D (screen, lens; nothing moves: no time)",
            (false, false) => "2D (screen; pinhole and nothing moves)",
        };
        let unused = if self.units_not_modelled.is_empty() {
            String::new()
        } else {
            format!("; not needed and not modelled: {}", self.units_not_modelled.join(", "))
        };
        let predicted = match self.predicted_frames {
            0 => String::new(),
            count => format!(", {} frames simulated and {count} predicted", self.distinct_frames),
        };
        format!("{dimensions}, timing level {}{predicted}{unused}", self.timing)
    }
}

/// The measured errors, as `quintile chart stated-errors` writes them.
const TABLE: &str = include_str!("../stated_errors.csv");

/// Share of runs whose error is within the stated one.
pub const CONFIDENCE: f64 = 0.95;

/// Stated error of a run, as a factor less one. Infinite without a bound, as `null` in JSON.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct StatedError {
    /// Of cycles.
    pub cycles: f64,
    /// Of the energy while busy.
    pub energy: f64,
}

/// A row of the table: what is added to the error that the check of a frame found.
#[derive(Clone, Copy, Debug, Deserialize)]
struct Row {
    level: Level,
    cycles: f64,
    energy: f64,
}

fn table() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| csv::Reader::from_reader(TABLE.as_bytes()).deserialize().flatten().collect())
}

impl StatedError {
    /// Without a bound.
    const UNKNOWN: Self = Self { cycles: f64::INFINITY, energy: f64::INFINITY };

    /// Stated error of a frame at a level whose check found the relative error `checked`; unknown without one.
    pub fn of(level: Level, checked: Option<f64>) -> Self {
        if level == Level::Stepped {
            return Self::default();
        }
        let row = table().iter().find(|row| row.level == level);
        row.zip(checked).map_or(Self::UNKNOWN, |(row, checked)| {
            let found = error_size(libm::log1p(checked));
            Self { cycles: found + row.cycles, energy: found + row.energy }
        })
    }

    /// Stated error of the sum over `frames`: the mean of those of simulated frames, by time, as errors of
    /// frames of one scene do not cancel.
    pub fn of_frames<'a>(level: Level, frames: impl IntoIterator<Item = &'a RunFrame>) -> Self {
        let (mut sum, mut time_s) = (Self::default(), 0.0);
        for frame in frames {
            let Some(Observed { checked, .. }) = frame.observed() else { continue };
            let found = checked.map(|checked| checked.error);
            let (of, frame_s) = (Self::of(level, found), frame.power.duration_s());
            sum = Self { cycles: sum.cycles + of.cycles * frame_s, energy: sum.energy + of.energy * frame_s };
            time_s += frame_s;
        }
        if time_s > 0.0 { Self { cycles: sum.cycles / time_s, energy: sum.energy / time_s } } else { sum }
    }

    /// With a further error of a prediction, as relative half-widths. Errors are added, as one may be as
    /// large as it can while the other is.
    #[must_use]
    pub fn beside(self, cycles: f64, energy: f64) -> Self {
        Self { cycles: self.cycles + cycles, energy: self.energy + energy }
    }

    /// A line for the terminal and the report.
    pub fn line(&self) -> String {
        let percent = |error: f64| match error.is_finite() {
            true => format!("{:.1} %", 100.0 * error),
            false => "unknown".to_owned(),
        };
        format!("cycles {}, energy {}", percent(self.cycles), percent(self.energy))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_frame_is_that_of_its_check_and_a_margin() {
        assert_eq!(StatedError::of(Level::Stepped, None), StatedError::default());
        assert_eq!(table().len(), 2);
        for row in table() {
            let at = |checked| StatedError::of(row.level, Some(checked));
            assert_eq!([at(0.0).cycles, at(0.0).energy], [row.cycles, row.energy]);
            assert!([row.cycles, row.energy].iter().all(|margin| *margin > 0.0 && margin.is_finite()));
            // A fifth too short: the truth is a quarter longer.
            assert!((at(-0.2).cycles - row.cycles - 0.25).abs() < 1e-12);
            assert!((at(0.25).energy - row.energy - 0.25).abs() < 1e-12);
        }
        assert!(
            StatedError::of(Level::Packet, Some(0.0)).cycles
                < StatedError::of(Level::Bound, Some(0.0)).cycles
        );
    }

    #[test]
    fn errors_of_predictions_are_added() {
        let sum = StatedError { cycles: 0.01, energy: 0.02 }.beside(0.03, 0.05);
        assert!((sum.cycles - 0.04).abs() < 1e-15 && (sum.energy - 0.07).abs() < 1e-15);
        assert_eq!(sum.line(), "cycles 4.0 %, energy 7.0 %");
        assert_eq!(StatedError::UNKNOWN.line(), "cycles unknown, energy unknown");
    }
}
