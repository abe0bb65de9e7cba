//! The data-acquisition device: from noise-free power to the voltage and current a recorder would write.

mod resample;
mod sample;
mod spec;

pub use resample::Resampled;
pub use sample::{SampleError, SampledTrace};
pub use spec::{DeviceError, DeviceSpec, MAX_PACKET_SAMPLES, Peaks, RATES_HZ};

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

    /// Specification of the device.
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

/// A source of `volts` behind `ohm`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rail {
    volts: f64,
    ohm: f64,
}

impl Rail {
    pub(super) fn new(volts: f64, ohm: f64) -> Self {
        Self { volts, ohm }
    }

    /// The most power that can be drawn, W: `V0^2 / 4R`, at half the voltage.
    pub(super) fn limit_w(&self) -> f64 {
        if self.ohm == 0.0 { f64::INFINITY } else { self.volts * self.volts / (4.0 * self.ohm) }
    }

    /// Voltage (V) and current (A) where the load draws `power_w`; `None` beyond [`Rail::limit_w`].
    ///
    /// Kirchhoff: `V = V0 - R I`, `P = V I`, so `R I^2 - V0 I + P = 0`. Of its roots the smaller current is
    /// the stable one; the form below has no cancellation and holds for `R = 0`.
    pub(super) fn solve(&self, power_w: f64) -> Option<(f64, f64)> {
        let discriminant = self.volts * self.volts - 4.0 * self.ohm * power_w;
        if discriminant < 0.0 {
            return None;
        }
        let current = 2.0 * power_w / (self.volts + libm::sqrt(discriminant));
        Some((self.volts - self.ohm * current, current))
    }
}

/// Rounds to the nearest of `2^bits` codes from one end of the range to the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Quantizer {
    lowest: f64,
    step: f64,
    last_code: f64,
}

impl Quantizer {
    pub(super) fn new(range: [f64; 2], bits: u32) -> Self {
        let last_code = f64::from((1_u32 << bits) - 1);
        Self { lowest: range[0], step: (range[1] - range[0]) / last_code, last_code }
    }

    /// The stored value, and whether the input was beyond the range.
    pub(super) fn quantize(&self, value: f64) -> (f32, bool) {
        let code = libm::round((value - self.lowest) / self.step);
        let kept = code.clamp(0.0, self.last_code);
        ((self.lowest + kept * self.step) as f32, kept != code)
    }

    /// The most a stored, unclipped value can differ from its input: half a step, the rounding to f32
    /// (half a unit in the last place, at most 2^-24 of the value), and the f64 arithmetic on the way.
    pub(super) fn error(&self, stored: f32) -> f64 {
        let span = self.lowest.abs() + self.last_code * self.step;
        0.5 * self.step + f64::from(stored).abs() * f64::from(f32::EPSILON) * 0.5 + 8.0 * f64::EPSILON * span
    }
}

impl Device {
    /// A bound on |trace integral - curve integral| over the whole trace, J, for a device without noise and
    /// filter; `None` for a device with either, and where samples were clipped (no bound holds then).
    ///
    /// With `V = V' + a`, `I = I' + b`, `|a| <= e_V`, `|b| <= e_I`, the power is off by at most
    /// `|V'| e_I + |I'| e_V + e_V e_I`; `e` is half a code plus the f32 rounding of the stored value. The last term
    /// covers the f64 arithmetic of means, rail and integral.
    pub fn quantization_energy_bound_j(&self, sampled: &SampledTrace) -> Option<f64> {
        if !self.is_noise_free()
            || !self.is_true()
            || sampled.clipped_currents > 0
            || sampled.clipped_voltages > 0
        {
            return None;
        }
        let trace = &sampled.trace;
        let mut watts = 0.0;
        for (&voltage, &current) in trace.voltage_v().iter().zip(trace.current_a()) {
            let (volts, amperes) = (f64::from(voltage).abs(), f64::from(current).abs());
            let (volts_off, amperes_off) = (self.voltage.error(voltage), self.current.error(current));
            watts += volts * amperes_off + amperes * volts_off + volts_off * amperes_off;
            watts += 64.0 * f64::EPSILON * volts * amperes;
        }
        // The bound's own sum of n positive terms is low by at most n epsilon.
        let slack = 1.0 + 2.0 * trace.samples() as f64 * f64::EPSILON;
        Some(watts * slack * trace.period_s())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curve::Curve;

    #[test]
    fn volts_times_amperes_is_the_power_and_the_rail_sags_by_r_i() {
        for (volts, ohm, power_w) in
            [(12.0, 0.004, 150.0), (3.85, 0.06, 3.2), (5.0, 0.0, 7.0), (1.0, 1.0, 0.25)]
        {
            let (v, i) = Rail::new(volts, ohm).solve(power_w).unwrap();
            assert!((v * i / power_w - 1.0).abs() < 1e-14);
            assert!((volts - ohm * i - v).abs() < 1e-14 * volts);
        }
    }

    #[test]
    fn the_limit_is_a_quarter_of_v_squared_over_r() {
        let rail = Rail::new(12.0, 0.5);
        assert_eq!(rail.limit_w(), 72.0);
        assert_eq!(rail.solve(72.0), Some((6.0, 12.0)));
        assert_eq!(rail.solve(72.0001), None);
    }

    #[test]
    fn the_error_is_within_its_bound_and_the_ends_are_codes() {
        let quantizer = Quantizer::new([-2.0, 6.0], 10);
        for index in 0..10_000 {
            let value = -2.0 + 8.0 * f64::from(index) / 9_999.0;
            let (stored, clipped) = quantizer.quantize(value);
            assert!(!clipped && (f64::from(stored) - value).abs() <= quantizer.error(stored));
        }
        assert_eq!(quantizer.quantize(6.0), (6.0, false));
        assert_eq!(quantizer.quantize(6.1), (6.0, true));
        assert_eq!(quantizer.quantize(-9.0), (-2.0, true));
    }

    #[test]
    fn there_is_no_bound_with_noise_filter_or_clipping() {
        let curve = Curve::new(vec![0.0, 1.0], vec![24.0]).unwrap();
        let noisy = Device::new(DeviceSpec { low_pass_s: Some(1e-4), ..DeviceSpec::default() }).unwrap();
        let sampled = noisy.sample(&curve, 0.0, 0.1).unwrap();
        assert_eq!(noisy.quantization_energy_bound_j(&sampled), None);
        let quiet = noisy.noise_free();
        let mut sampled = quiet.sample(&curve, 0.0, 0.1).unwrap();
        assert!(quiet.quantization_energy_bound_j(&sampled).is_some());
        sampled.clipped_currents = 1;
        assert_eq!(quiet.quantization_energy_bound_j(&sampled), None);
    }
}
