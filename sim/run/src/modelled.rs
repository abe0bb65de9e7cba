//! What a run modelled, and what it left out because the scene does not need it.

use activity::Unit;
use serde::Serialize;

use super::{Plan, Simulated};

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
