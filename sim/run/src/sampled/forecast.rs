//! What the representatives say of all frames.

use timing::sampled::{Design, Estimate};

use super::Signatures;
use crate::{FrameCost, Quantity};

/// How sure an interval is to hold the truth.
pub const CONFIDENCE: f64 = 0.95;

/// Cycles and energy of every frame, as the representatives and the previews have it.
pub struct Forecast {
    design: Design,
    cycles: Estimate,
    energy: Estimate,
}

impl Forecast {
    /// From the signatures of all frames and what those that `design` chose took.
    pub fn new(design: Design, signatures: &Signatures, cost: impl Fn(usize) -> FrameCost) -> Self {
        let cycles = Estimate::new(&design, &signatures.cycles, |frame| cost(frame).cycles);
        let energy = Estimate::new(&design, &signatures.energy_j, |frame| cost(frame).energy_j);
        Self { design, cycles, energy }
    }

    /// Which frames were simulated.
    pub fn design(&self) -> &Design {
        &self.design
    }

    /// Mean cycles of a frame.
    pub fn cycles_per_frame(&self) -> Quantity {
        self.cycles.total(CONFIDENCE).scaled(1.0 / self.frames()).into()
    }

    /// Mean joules of a frame while busy.
    pub fn energy_per_frame_j(&self) -> Quantity {
        self.energy.total(CONFIDENCE).scaled(1.0 / self.frames()).into()
    }

    /// Mean watts while busy.
    pub fn busy_power_w(&self, core_hz: f64) -> Quantity {
        self.energy.ratio(&self.cycles, CONFIDENCE).scaled(core_hz).into()
    }

    /// The half-width of the widest interval, relative to its value.
    pub fn relative_half_width(&self) -> f64 {
        let all = [self.cycles_per_frame(), self.energy_per_frame_j(), self.busy_power_w(1.0)];
        all.iter().map(|quantity| quantity.relative_half_width).fold(0.0, f64::max)
    }

    /// What frame `place` takes, most likely, and half the width of the intervals in which its own values lie.
    pub fn frame(&self, place: usize) -> [FrameCost; 2] {
        let stratum = self.design.stratum_of(place);
        let half = |estimate: &Estimate| estimate.half_width_of_one(stratum, CONFIDENCE);
        [
            FrameCost { cycles: self.cycles.predicted(place), energy_j: self.energy.predicted(place) },
            FrameCost { cycles: half(&self.cycles), energy_j: half(&self.energy) },
        ]
    }

    fn frames(&self) -> f64 {
        self.design.units() as f64
    }
}
