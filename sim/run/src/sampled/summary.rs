//! What a sampled run says of itself.

use std::collections::BTreeSet;

use super::super::simulated::SampledSummary;
use super::super::{Distinct, Plan};
use super::forecast::CONFIDENCE;
use super::{Forecast, Scout};

/// What a sampled run says of itself.
pub(super) fn summary(plan: &Plan, frames: &Distinct, scout: &Scout, forecast: &Forecast) -> SampledSummary {
    let (numbers, groups) = (frames.numbers(), frames.groups());
    let chosen: BTreeSet<u32> =
        forecast.design().chosen().into_iter().map(|place| numbers[groups[place]]).collect();
    let viewport = scout.preview.viewport;
    SampledSummary {
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
