//! What a sampled run says of itself.

use std::collections::BTreeSet;

use serde::Serialize;

use super::super::{Distinct, Plan};
use super::forecast::CONFIDENCE;
use super::{Forecast, Quantity, Scout};

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
    pub(super) fn new(plan: &Plan, frames: &Distinct, scout: &Scout, forecast: &Forecast) -> Self {
        let (numbers, groups) = (frames.numbers(), frames.groups());
        let chosen: BTreeSet<u32> =
            forecast.design().chosen().into_iter().map(|place| numbers[groups[place]]).collect();
        let viewport = scout.preview.viewport;
        Self {
            frames_per_simulated: groups.len() as f64 / chosen.len() as f64,
            simulated_frames: chosen.into_iter().collect(),
            strata: forecast.design().strata().len(),
            preview: [viewport.width(), viewport.height(), scout.preview.per_pixel()],
            confidence: CONFIDENCE,
            cycles_per_frame: forecast.cycles_per_frame(),
            busy_energy_per_frame_j: forecast.energy_per_frame_j(),
            busy_power_w: forecast.busy_power_w(plan.gpu.core_hz),
        }
    }

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
                crate::output::table::si(quantity.value, unit),
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
