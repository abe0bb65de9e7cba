//! The recorder of a run: its range follows the peak, and its rate the length of the frames, as one would choose both in a
//! laboratory.

use power_model::{FramePower, Run};
use serde::Serialize;
use traces::device::{DeviceSpec, RATES_HZ};

use super::Plan;
use super::options::DEFAULT_RATE_HZ;
use output::table::si;

/// Rates that are chosen from where none is given, lowest first. A run with short frames is recorded at a higher one.
const CHOSEN_RATES_HZ: [f64; 5] = [DEFAULT_RATE_HZ, 100e3, 200e3, 500e3, 1e6];
/// Work that takes less than this many samples may fall between two of them: its frame may then not be found.
pub(super) const MIN_BUSY_SAMPLES: f64 = 2.0;
/// A start is uncertain by a good part of a sample, so a frame of this many samples is measured to about two percent.
const MIN_FRAME_SAMPLES: f64 = 50.0;
/// A higher rate is not chosen where the trace would have more samples than this.
const MAX_CHOSEN_SAMPLES: f64 = 5e6;

/// How finely frames are recorded.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Resolution {
    /// Samples a second.
    pub rate_hz: f64,
    /// Whether the rate was raised above the default, because frames are short.
    pub raised: bool,
    /// For how long the shortest frame is busy, in seconds.
    pub shortest_busy_s: f64,
}

impl Resolution {
    /// Of the frames of `run`, at the rate asked for or at the lowest that resolves them.
    pub(super) fn new(asked_hz: Option<f64>, run: &Run) -> Self {
        let shortest =
            |of: fn(&power_model::PacedFrame) -> f64| run.frames.iter().map(of).fold(f64::INFINITY, f64::min);
        let shortest_busy_s = shortest(|frame| frame.busy_end_s - frame.start_s);
        let shortest_frame_s = shortest(|frame| frame.end_s - frame.start_s);
        let rate_hz =
            asked_hz.unwrap_or_else(|| chosen_hz(shortest_busy_s, shortest_frame_s, run.curve.end_s()));
        Self { rate_hz, raised: asked_hz.is_none() && rate_hz > DEFAULT_RATE_HZ, shortest_busy_s }
    }

    /// Samples while the shortest frame is busy.
    pub fn samples_in_shortest(&self) -> f64 {
        self.shortest_busy_s * self.rate_hz
    }

    /// A sentence about a rate that was raised; nothing where it was not.
    pub fn raised_line(&self) -> Option<String> {
        self.raised.then(|| {
            format!(
                "recorder: {}, raised from {} because the shortest frame is busy for {} only; --trace-rate sets it",
                si(self.rate_hz, "Hz"),
                si(DEFAULT_RATE_HZ, "Hz"),
                si(self.shortest_busy_s, "s")
            )
        })
    }

    /// The lowest usual rate at which the shortest frame would be resolved; `None` where no recorder is as fast.
    pub(super) fn needed_hz(&self) -> Option<f64> {
        let needed_hz = MIN_BUSY_SAMPLES / self.shortest_busy_s;
        let series =
            (0..8).flat_map(|decade| [1.0, 2.0, 5.0].map(|step| step * libm::pow(10.0, f64::from(decade))));
        series.into_iter().find(|rate_hz| *rate_hz >= needed_hz).filter(|rate_hz| RATES_HZ.contains(rate_hz))
    }
}

/// The lowest rate that resolves the shortest frame, or the highest that keeps the trace small.
fn chosen_hz(shortest_busy_s: f64, shortest_frame_s: f64, trace_s: f64) -> f64 {
    let resolves = |rate_hz: f64| {
        rate_hz * shortest_busy_s >= MIN_BUSY_SAMPLES && rate_hz * shortest_frame_s >= MIN_FRAME_SAMPLES
    };
    let mut chosen_hz = DEFAULT_RATE_HZ;
    for rate_hz in CHOSEN_RATES_HZ {
        if resolves(chosen_hz) || rate_hz * trace_s > MAX_CHOSEN_SAMPLES {
            break;
        }
        chosen_hz = rate_hz;
    }
    chosen_hz
}

/// A recorder on the platform's rail whose range fits the peak.
pub(super) fn device_spec(plan: &Plan, rate_hz: f64, powers: &[&FramePower]) -> DeviceSpec {
    let peak_w = powers.iter().map(|power| power.peak_w()).fold(plan.platform.idle_w.value(), f64::max);
    let spec = DeviceSpec {
        rate_hz,
        packet_samples: plan.options.packet_samples,
        packet_loss: plan.options.packet_loss,
        seed: plan.options.seed,
        ..DeviceSpec::fitting(plan.platform.rail.voltage_v.value(), peak_w)
    };
    spec.named_by_rate_and_bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_frames_are_recorded_faster() {
        let vsync = |busy_s| chosen_hz(busy_s, 1.0 / 60.0, 1.0);
        assert_eq!([1e-3, 40e-6, 39e-6, 14e-6, 2e-6, 1e-9].map(vsync), [50e3, 50e3, 100e3, 200e3, 1e6, 1e6]);
    }

    #[test]
    fn frames_without_idle_time_need_fifty_samples() {
        assert_eq!(
            [2e-3, 1e-3, 0.9e-3, 0.3e-3].map(|frame_s| chosen_hz(frame_s, frame_s, 1.0)),
            [50e3, 50e3, 100e3, 200e3]
        );
    }

    #[test]
    fn a_long_trace_keeps_its_rate() {
        assert_eq!(
            [1.0, 24.0, 26.0, 60.0].map(|trace_s| chosen_hz(14e-6, 1.0 / 60.0, trace_s)),
            [200e3, 200e3, 100e3, 50e3]
        );
    }

    #[test]
    fn the_rate_that_is_needed_is_one_that_recorders_have() {
        let needed =
            |shortest_busy_s| Resolution { rate_hz: 50e3, raised: false, shortest_busy_s }.needed_hz();
        assert_eq!([14e-6, 1.9e-6, 0.2e-6, 0.1e-6].map(needed), [Some(200e3), Some(2e6), Some(10e6), None]);
    }
}
