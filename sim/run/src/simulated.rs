//! Results of the simulator: the frames of a run, and which dimensions and units were modelled.

use activity::{Counts, Unit};
use glam::Vec3;
use power_model::FramePower;
use serde::Serialize;
use timing::sampled::Interval;
use timing::{AccuracyWarning, Stalls};
use warnings::Warning;
use workloads::job::Fact;

use crate::Plan;
use crate::heat::HeatPicture;
use crate::regime::Regime;

/// A frame of a run with its power over time, simulated or predicted.
pub struct RunFrame {
    /// Its number in the scene.
    pub index: u32,
    /// Triangles drawn.
    pub triangles: usize,
    /// Whether anything moves while its shutter is open.
    pub moving: bool,
    /// Whether the camera has a lens.
    pub lens: bool,
    /// Watts over time and joules by part.
    pub power: FramePower,
    /// For how long each unit was busy, in picoseconds.
    pub busy_ps: [u64; Unit::COUNT],
    /// The busy share of each unit in each bin of [`FramePower::bin_s`].
    pub busy: Vec<[f32; Unit::COUNT]>,
    /// Cycles of the core clock.
    pub cycles: u64,
    /// How it came about, with what is known of such frames alone.
    pub origin: Origin,
}

/// How a frame of a run came about.
pub enum Origin {
    /// It was simulated whole.
    Simulated(Observed),
    /// It was predicted from others: half the widths of the intervals of its cycles and its energy.
    Predicted(FrameCost),
}

/// What is known of a frame that was simulated, and of no other.
pub struct Observed {
    /// How often each event happened.
    pub counts: Counts,
    /// Results of a workload.
    pub facts: Vec<Fact>,
    /// Warnings of a workload.
    pub warnings: Vec<Warning>,
    /// Triangles that tile tests are weak for.
    pub regime: Regime,
    /// Why units did not work, where the timing level records it.
    pub stalls: Option<Stalls>,
    /// Why the timing level may be inaccurate.
    pub accuracy: Vec<AccuracyWarning>,
}

impl RunFrame {
    /// What is known of it, if it was simulated.
    pub fn observed(&self) -> Option<&Observed> {
        match &self.origin {
            Origin::Simulated(observed) => Some(observed),
            Origin::Predicted(_) => None,
        }
    }

    /// Its cycles and its energy.
    pub fn cost(&self) -> FrameCost {
        FrameCost { cycles: self.cycles as f64, energy_j: self.power.energy().total_j() }
    }

    /// Half the widths of its intervals, if it was predicted.
    pub fn half_widths(&self) -> Option<FrameCost> {
        match self.origin {
            Origin::Simulated(_) => None,
            Origin::Predicted(half) => Some(half),
        }
    }
}

/// All frames of a run.
pub struct Simulated {
    /// Frames that differ.
    pub distinct: Vec<RunFrame>,
    /// For each frame of the run, its place in `distinct`: frames with the same input share one.
    pub frames: Vec<usize>,
    /// Pictures for the report: frame number and the linear image.
    pub pictures: Vec<(u32, Vec<Vec3>)>,
    /// The heat maps of the frame in the middle.
    pub heat: Vec<HeatPicture>,
    /// Which frames were predicted, and with which confidence.
    pub sampled: Option<SampledSummary>,
}

impl Simulated {
    /// The frames of the run in order.
    pub fn in_order(&self) -> impl Iterator<Item = &RunFrame> {
        self.frames.iter().map(|&place| &self.distinct[place])
    }

    /// The simulated frames among those that differ.
    pub fn observed(&self) -> impl Iterator<Item = (&RunFrame, &Observed)> {
        self.distinct.iter().filter_map(|frame| Some((frame, frame.observed()?)))
    }

    /// What is known of the simulated frames of the run, in order.
    pub fn known(&self) -> impl Iterator<Item = &Observed> {
        self.in_order().filter_map(RunFrame::observed)
    }

    /// The counts of the frames of the run that were simulated.
    pub fn total(&self) -> Counts {
        self.known().fold(Counts::default(), |mut sum, frame| {
            sum += &frame.counts;
            sum
        })
    }
}

/// What a simulated frame took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameCost {
    /// Cycles of the core clock.
    pub cycles: f64,
    /// Joules while busy.
    pub energy_j: f64,
}

/// A quantity of the whole run with its interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantity {
    /// The most likely value.
    pub value: f64,
    /// The lower end of the 95 % interval.
    pub low: f64,
    /// The upper end.
    pub high: f64,
    /// Half the width over the value.
    pub relative_half_width: f64,
}

impl From<Interval> for Quantity {
    fn from(interval: Interval) -> Self {
        let Interval { value, low, high } = interval;
        Self { value, low, high, relative_half_width: interval.relative() }
    }
}

impl Quantity {
    /// Whether `truth` is inside.
    pub fn holds(&self, truth: f64) -> bool {
        (self.low..=self.high).contains(&truth)
    }
}

/// Which frames were simulated, and how sure the rest is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SampledSummary {
    /// Frames that were simulated whole; all others are predicted.
    pub simulated_frames: Vec<u32>,
    /// Frames of the run for one that was simulated.
    pub frames_per_simulated: f64,
    /// Groups of frames of like previews, that of the frame all are scaled by among them.
    pub strata: usize,
    /// Width and height of the preview in pixels, and samples in each of them.
    pub preview: [u32; 3],
    /// The probability with which an interval holds the truth.
    pub confidence: f64,
    /// Mean cycles of a frame.
    pub cycles_per_frame: Quantity,
    /// Mean joules of a frame while the GPU works on it, idle after it not counted.
    pub busy_energy_per_frame_j: Quantity,
    /// Mean watts while the GPU works.
    pub busy_power_w: Quantity,
}

impl SampledSummary {
    /// The quantities with their names and units.
    pub fn quantities(&self) -> [(&'static str, &'static str, Quantity); 3] {
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
            "from {} frames, one in {:.0}, with 95 % intervals: {}",
            self.simulated_frames.len(),
            self.frames_per_simulated,
            quantities.join(", ")
        )
    }

    /// Half of the widest interval, over its value.
    pub fn worst(&self) -> f64 {
        self.quantities().iter().map(|(_, _, quantity)| quantity.relative_half_width).fold(0.0, f64::max)
    }
}

/// The dimensions and units in use.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Modelled {
    /// 2 for the screen, one more where anything moves while the shutter is open, two more for a lens.
    pub dimensions: u32,
    /// Whether time is a dimension.
    pub motion: bool,
    /// Whether the lens is a dimension.
    pub lens: bool,
    /// Frames that were simulated; equal ones are simulated once.
    pub distinct_frames: usize,
    /// Frames that were predicted from those.
    pub predicted_frames: usize,
    /// Units that did something.
    pub units: Vec<&'static str>,
    /// Units that nothing in the scene asks for.
    pub units_not_modelled: Vec<&'static str>,
    /// The level of the timing model.
    pub timing: &'static str,
    /// What no run of this version models.
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
            "one opaque pass; no blending",
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
            units_not_modelled: unused.into_iter().map(Unit::name).collect(),
            timing: plan.options.timing.name(),
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
