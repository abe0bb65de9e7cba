//! What a recorder makes of a scene.

use super::scene::Scene;
use crate::device::{Device, DeviceError, DeviceSpec, SampleError};
use crate::trace::Trace;
use thiserror::Error;

/// Rate at which the power of the signal is taken, Hz.
const FINE_HZ: f64 = 50e3;
/// Voltage of the rail, V.
const RAIL_V: f64 = 4.0;

/// How a scene is recorded: a 4 V rail without resistance, currents of +-4 A, voltages of +-6 V.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recording {
    /// Samples per second.
    pub rate_hz: f64,
    /// Resolution of current and voltage.
    pub bits: u32,
    /// Variance of the power while frames are drawn, at 50 kHz, over the variance of the noise of one sample at any rate, dB.
    pub snr_db: f64,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for Recording {
    /// 50 kHz, 14 bits, 30 dB.
    fn default() -> Self {
        Self { rate_hz: 50e3, bits: 14, snr_db: 30.0, seed: 1 }
    }
}

/// A scene that cannot be recorded so.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the variants are the sources, documented there")]
pub enum SynthError {
    #[error(transparent)]
    Device(#[from] DeviceError),
    #[error(transparent)]
    Sample(#[from] SampleError),
}

impl Scene {
    /// The trace of all of it, idle before and after included.
    ///
    /// # Errors
    /// [`SynthError`] where rate, bits or noise are out of range.
    pub fn record(&self, recording: &Recording) -> Result<Trace, SynthError> {
        let noise_w = libm::sqrt(self.variance_w2()) * libm::pow(10.0, -recording.snr_db / 20.0);
        let device = Device::new(DeviceSpec {
            name: "synthetic".to_owned(),
            rate_hz: recording.rate_hz,
            rail_v: RAIL_V,
            rail_ohm: 0.0,
            current_range_a: [-4.0, 4.0],
            voltage_range_v: [-6.0, 6.0],
            bits: recording.bits,
            current_noise_a: noise_w / RAIL_V,
            voltage_noise_v: 0.0,
            seed: recording.seed,
            ..DeviceSpec::default()
        })?;
        Ok(device.sample(&self.curve, self.curve.start_s(), self.curve.end_s())?.trace)
    }

    /// Variance of the power while frames are drawn, W^2.
    fn variance_w2(&self) -> f64 {
        let from_s = self.truth.first().map_or(self.end_s, |frame| frame.start_s);
        let count = ((self.end_s - from_s) * FINE_HZ) as usize;
        let watts = self.curve.sample_means_w(from_s, FINE_HZ, count);
        let mean = watts.iter().sum::<f64>() / count.max(1) as f64;
        watts.iter().map(|w| (w - mean) * (w - mean)).sum::<f64>() / count.max(1) as f64
    }
}
