//! Sums that have to agree, computed in every run and written into its results.

use power_model::Run;
use serde::Serialize;
use traces::device::Device;
use traces::energy::{FrameEnergy, PowerIntegral};
use traces::frames::Found;

use super::RunError;

/// How well the books of a run balance.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Checks {
    /// |sum of frame energies / integral from the first found start to the end mark - 1|.
    pub frames_against_integral_relative: f64,
    /// |sum of true frame energies / integral of the noise-free curve over the frames - 1|.
    pub parts_against_curve_relative: f64,
    /// Integral of a trace without noise minus that of the curve, over the recording, in joules.
    pub noise_free_trace_minus_curve_j: f64,
    /// How far these may differ by the recorder's quantization, in joules.
    pub quantization_bound_j: f64,
}

impl Checks {
    pub(super) fn new(
        run: &Run,
        device: &Device,
        integral: &PowerIntegral<'_>,
        found: &Found,
        frames: &[FrameEnergy],
    ) -> Result<Self, RunError> {
        let sum: f64 = frames.iter().map(|frame| frame.energy_j).sum();
        let first = found.starts.first().map_or(found.end_s, |start| start.time_s);
        let quiet = device.noise_free();
        let sampled = quiet.sample(&run.curve, 0.0, run.curve.end_s())?;
        let trace_j = PowerIntegral::new(&sampled.trace).total_j();
        let curve_j = run.curve.energy_j(sampled.trace.start_s(), sampled.trace.end_s());
        Ok(Self {
            frames_against_integral_relative: relative(sum, integral.energy_j(first, found.end_s)),
            parts_against_curve_relative: relative(
                run.energy().total_j(),
                run.curve.energy_j(run.start_s, run.end_s),
            ),
            noise_free_trace_minus_curve_j: trace_j - curve_j,
            quantization_bound_j: quiet.quantization_energy_bound_j(&sampled).unwrap_or(f64::INFINITY),
        })
    }
}

fn relative(a: f64, b: f64) -> f64 {
    if a == b { 0.0 } else { (a / b - 1.0).abs() }
}
