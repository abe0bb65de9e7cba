//! Prediction of all frames from the simulated ones.

use timing::sampled::{Design, Estimate};

use super::Signatures;
use crate::{FrameCost, Quantity};

/// Confidence level of the intervals.
pub const CONFIDENCE: f64 = 0.95;

/// Estimates of cycles and energy of every frame, from simulated frames and previews.
pub struct Forecast {
    design: Design,
    cycles: Estimate,
    energy: Estimate,
}

impl Forecast {
    /// Estimates from the signatures of all frames and the `cost` of those that `design` chose.
    pub fn new(design: Design, signatures: &Signatures, cost: impl Fn(usize) -> FrameCost) -> Self {
        let cycles = Estimate::new(&design, &signatures.cycles, |frame| cost(frame).cycles);
        let energy = Estimate::new(&design, &signatures.energy_j, |frame| cost(frame).energy_j);
        Self { design, cycles, energy }
    }

    /// Design of the sample: strata and simulated frames.
    pub fn design(&self) -> &Design {
        &self.design
    }

    /// Mean cycles per frame.
    pub fn cycles_per_frame(&self) -> Quantity {
        self.cycles.total(CONFIDENCE).scaled(1.0 / self.frames()).into()
    }

    /// Mean energy per frame in joules while busy.
    pub fn energy_per_frame_j(&self) -> Quantity {
        self.energy.total(CONFIDENCE).scaled(1.0 / self.frames()).into()
    }

    /// Mean power in watts while busy.
    pub fn busy_power_w(&self, core_hz: f64) -> Quantity {
        self.energy.ratio(&self.cycles, CONFIDENCE).scaled(core_hz).into()
    }

    /// Relative half-width of the widest interval.
    pub fn relative_half_width(&self) -> f64 {
        let all = [self.cycles_per_frame(), self.energy_per_frame_j(), self.busy_power_w(1.0)];
        all.iter().map(|quantity| quantity.relative_half_width).fold(0.0, f64::max)
    }

    /// Predicted cost of frame `place`, and the half-widths of its prediction intervals.
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
