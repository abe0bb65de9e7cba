//! The data-acquisition device: from noise-free power to the voltage and current a recorder would write.

mod bound;
mod fit;
mod gaps;
mod packets;
mod quantizer;
mod rail;
mod resample;
mod sample;
mod spec;

pub use fit::Peaks;
pub use resample::Resampled;
pub use sample::{SampleError, Sampled};
pub use spec::{DeviceError, DeviceSpec, MAX_PACKET_SAMPLES, RATES_HZ};

use quantizer::Quantizer;
use rail::Rail;

/// A validated [`DeviceSpec`], ready to sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Device {
    spec: DeviceSpec,
    rail: Rail,
    voltage: Quantizer,
    current: Quantizer,
}

impl Device {
    /// A device from its description.
    ///
    /// # Errors
    /// [`DeviceError`] names the field that is out of range.
    pub fn new(spec: DeviceSpec) -> Result<Self, DeviceError> {
        spec.check()?;
        Ok(Self {
            rail: Rail::new(spec.rail_v, spec.rail_ohm),
            voltage: Quantizer::new(spec.voltage_range_v, spec.bits),
            current: Quantizer::new(spec.current_range_a, spec.bits),
            spec,
        })
    }

    /// What the device was built from.
    pub fn spec(&self) -> &DeviceSpec {
        &self.spec
    }

    /// The same device without noise, low-pass filter and losses: its only error is quantization.
    #[must_use]
    pub fn noise_free(&self) -> Self {
        let mut quiet = self.clone();
        quiet.spec.current_noise_a = 0.0;
        quiet.spec.voltage_noise_v = 0.0;
        quiet.spec.low_pass_s = None;
        quiet.spec.packet_loss = 0.0;
        quiet
    }

    /// Whether gain, offset and the source of the voltage leave nothing but quantization.
    fn is_true(&self) -> bool {
        let spec = &self.spec;
        let straight = spec.current_gain == 1.0 && spec.voltage_gain == 1.0;
        straight
            && spec.current_offset_a == 0.0
            && spec.voltage_offset_v == 0.0
            && spec.specified_voltage_v.is_none()
            && spec.packet_loss == 0.0
    }

    fn is_noise_free(&self) -> bool {
        self.spec.current_noise_a == 0.0 && self.spec.voltage_noise_v == 0.0 && self.spec.low_pass_s.is_none()
    }
}
