//! Specification of a device, and ranges that fit a signal.

use crate::io::{TraceChunk, TraceReader, TraceWriter, WriteError};
use crate::trace::RATE_LIMITS_HZ;
use core::ops::RangeInclusive;
use serde::{Deserialize, Serialize};
use thiserror::Error;
use warnings::{Code, Warning};

/// A field of [`DeviceSpec`] that is out of range.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("device {device:?}: {field} = {value} is wrong: it must be {must}")]
pub struct DeviceError {
    /// Name of the device.
    pub device: String,
    /// The field.
    pub field: &'static str,
    /// Value of the field.
    pub value: f64,
    /// The valid range.
    pub must: &'static str,
}

/// Rates of the devices that are modelled, Hz.
pub const RATES_HZ: RangeInclusive<f64> = 1.0..=1e7;
/// The most samples of a packet.
pub const MAX_PACKET_SAMPLES: u32 = 1 << 24;

/// A recorder and the rail it is put into. Take the default and change what differs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DeviceSpec {
    /// Name, for the metadata of the trace.
    pub name: String,
    /// Samples per second.
    pub rate_hz: f64,
    /// Voltage of the unloaded rail, V.
    pub rail_v: f64,
    /// Resistance between the source and the point of measurement, ohm: a load makes the rail sag.
    pub rail_ohm: f64,
    /// Currents of the lowest and the highest code, A.
    pub current_range_a: [f64; 2],
    /// Voltages of the lowest and the highest code, V.
    pub voltage_range_v: [f64; 2],
    /// Resolution of both converters, 1 to 24 bits.
    pub bits: u32,
    /// Gain of the current: 1 for a device without gain error.
    pub current_gain: f64,
    /// Offset of the current, A.
    pub current_offset_a: f64,
    /// Gain of the voltage.
    pub voltage_gain: f64,
    /// Offset of the voltage, V.
    pub voltage_offset_v: f64,
    /// A voltage by specification, V, recorded in place of a measured one: what the rail sags is then missed.
    pub specified_voltage_v: Option<f64>,
    /// Noise of the current, A rms, white and Gaussian.
    pub current_noise_a: f64,
    /// Noise of the voltage, V rms, white and Gaussian.
    pub voltage_noise_v: f64,
    /// Time constant of a one-pole low-pass on the power (the rail's decoupling), s.
    pub low_pass_s: Option<f64>,
    /// Samples that travel together and are lost together.
    pub packet_samples: u32,
    /// Share of packets that are lost, 0 to below 1; the first one never is.
    pub packet_loss: f64,
    /// Seed of noise and losses.
    pub seed: u64,
}

impl Default for DeviceSpec {
    /// A 12 V rail through 4 mOhm into a 14-bit, 50 kHz recorder of +-30 A and +-20 V, with 5 mA and 2 mV of
    /// noise: assumed for a graphics card in a desktop computer, not any one product.
    fn default() -> Self {
        Self {
            name: "daq-50khz-14bit".to_owned(),
            rate_hz: 50e3,
            rail_v: 12.0,
            rail_ohm: 0.004,
            current_range_a: [-30.0, 30.0],
            voltage_range_v: [-20.0, 20.0],
            bits: 14,
            current_gain: 1.0,
            current_offset_a: 0.0,
            voltage_gain: 1.0,
            voltage_offset_v: 0.0,
            specified_voltage_v: None,
            current_noise_a: 0.005,
            voltage_noise_v: 0.002,
            low_pass_s: None,
            packet_samples: 512,
            packet_loss: 0.0,
            seed: 1,
        }
    }
}

impl DeviceSpec {
    /// Whether every field is in range.
    pub(super) fn check(&self) -> Result<(), DeviceError> {
        let not_negative = "a finite number at or above 0";
        let ordered = "two finite numbers, the lower one first";
        let spans = |range: [f64; 2]| range[0].is_finite() && range[1].is_finite() && range[0] < range[1];
        let above = |value: f64| value.is_finite() && value > 0.0;
        let quiet = |noise: f64| noise.is_finite() && noise >= 0.0;
        let rate_good = (RATE_LIMITS_HZ[0]..=RATE_LIMITS_HZ[1]).contains(&self.rate_hz);
        let low_pass_s = self.low_pass_s.unwrap_or(1.0);
        let checks = [
            ("rate_hz", self.rate_hz, rate_good, "between 1e-6 and 1e8 Hz"),
            ("rail_v", self.rail_v, above(self.rail_v), "a finite number above 0"),
            ("rail_ohm", self.rail_ohm, quiet(self.rail_ohm), not_negative),
            ("current_range_a", self.current_range_a[0], spans(self.current_range_a), ordered),
            ("voltage_range_v", self.voltage_range_v[0], spans(self.voltage_range_v), ordered),
            ("bits", f64::from(self.bits), (1..=24).contains(&self.bits), "between 1 and 24"),
            ("current_noise_a", self.current_noise_a, quiet(self.current_noise_a), not_negative),
            ("voltage_noise_v", self.voltage_noise_v, quiet(self.voltage_noise_v), not_negative),
            ("current_gain", self.current_gain, above(self.current_gain), "a finite number above 0"),
            ("current_offset_a", self.current_offset_a, self.current_offset_a.is_finite(), "a finite number"),
            ("voltage_gain", self.voltage_gain, above(self.voltage_gain), "a finite number above 0"),
            ("voltage_offset_v", self.voltage_offset_v, self.voltage_offset_v.is_finite(), "a finite number"),
            (
                "specified_voltage_v",
                self.specified_voltage_v.unwrap_or(1.0),
                self.specified_voltage_v.is_none_or(above),
                "a finite number above 0, or absent",
            ),
            ("low_pass_s", low_pass_s, above(low_pass_s), "a finite number above 0, or absent"),
            (
                "packet_samples",
                f64::from(self.packet_samples),
                (1..=MAX_PACKET_SAMPLES).contains(&self.packet_samples),
                "from 1 to 16777216",
            ),
            ("packet_loss", self.packet_loss, (0.0..1.0).contains(&self.packet_loss), "from 0 to below 1"),
        ];
        match checks.into_iter().find(|(_, _, good, _)| !good) {
            Some((field, value, _, must)) => {
                Err(DeviceError { device: self.name.clone(), field, value, must })
            }
            None => Ok(()),
        }
    }
}

/// The largest voltage, current and power of a trace, without their signs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peaks {
    /// V.
    pub voltage_v: f64,
    /// A.
    pub current_a: f64,
    /// W.
    pub power_w: f64,
    /// Whether there is a voltage at all: traces of power alone have 1 V throughout.
    pub has_voltage: bool,
}

impl Peaks {
    /// The peaks of `trace`, which is read once.
    ///
    /// # Errors
    /// [`WriteError::Read`] if it cannot be read.
    pub fn of(trace: &dyn TraceReader) -> Result<Self, WriteError> {
        let mut peaks = Self::default();
        trace.read_into(&mut peaks)?;
        Ok(peaks)
    }
}

impl TraceWriter for Peaks {
    fn write(&mut self, chunk: &TraceChunk<'_>) -> Result<(), WriteError> {
        let largest = |most: f64, numbers: &[f32]| {
            numbers.iter().map(|number| f64::from(number.abs())).fold(most, f64::max)
        };
        self.voltage_v = largest(self.voltage_v, chunk.voltage_v);
        self.has_voltage |= chunk.voltage_v.iter().any(|volts| *volts != 1.0);
        self.current_a = largest(self.current_a, chunk.current_a);
        self.power_w = chunk.powers_w().map(f64::abs).fold(self.power_w, f64::max);
        Ok(())
    }
}

/// Least share of a range that the largest current should use. At 8 bits 5 % are 6 codes of 127, and rounding
/// by half a code is then 8 % of the current.
const MIN_USED_SHARE: f64 = 0.05;

/// Ratio of a range to the peak.
const HEADROOM: f64 = 1.25;

/// Ranges of currents, A.
const RANGES_A: [f64; 18] =
    [1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 3e4, 1e5, 3e5];

impl DeviceSpec {
    /// The default recorder on a rail of `rail_v` volts, with the smallest range of currents of a 1-3-10
    /// series that holds a quarter more than `peak_w` takes, as one would choose in a laboratory. Its voltage
    /// range is half as large again as the rail; noise goes with the ranges.
    pub fn fitting(rail_v: f64, peak_w: f64) -> Self {
        let needed_a = HEADROOM * peak_w / rail_v;
        let range_a = RANGES_A.into_iter().find(|range| *range >= needed_a).unwrap_or(needed_a);
        Self { rail_v, ..Self::default() }.with_current_range(range_a).with_voltage_range(1.5 * rail_v)
    }

    /// With currents from `-range_a` to `range_a`, and the noise of a recorder of that range.
    #[must_use]
    pub fn with_current_range(self, range_a: f64) -> Self {
        let plain = Self::default();
        Self {
            current_range_a: [-range_a, range_a],
            current_noise_a: plain.current_noise_a * (range_a / plain.current_range_a[1]),
            // A tenth of a volt of sag at full scale at most, so that the rail carries any load in range.
            rail_ohm: plain.rail_ohm.min(0.1 / range_a),
            ..self
        }
    }

    /// With voltages from `-range_v` to `range_v`, and the noise of a recorder of that range.
    #[must_use]
    pub fn with_voltage_range(self, range_v: f64) -> Self {
        let plain = Self::default();
        Self {
            voltage_range_v: [-range_v, range_v],
            voltage_noise_v: plain.voltage_noise_v * range_v / plain.voltage_range_v[1],
            ..self
        }
    }

    /// With the name of its rate and bits, such as `daq-50khz-14bit`.
    #[must_use]
    pub fn named_by_rate_and_bits(self) -> Self {
        let rate = match self.rate_hz {
            hz if hz < 1e3 => format!("{hz}hz"),
            hz if hz < 1e6 => format!("{}khz", hz / 1e3),
            hz => format!("{}mhz", hz / 1e6),
        };
        Self { name: format!("daq-{rate}-{}bit", self.bits), ..self }
    }

    /// The largest current that a trace with these peaks brings, A: that of its power on the rail where it
    /// has no voltage.
    fn peak_a(&self, peaks: &Peaks) -> f64 {
        if peaks.has_voltage { peaks.current_a } else { peaks.power_w / self.rail_v }
    }

    /// Share of the codes of the current's converter that a trace with these peaks reaches.
    pub fn share_of_current_codes(&self, peaks: &Peaks) -> f64 {
        self.peak_a(peaks) / self.current_range_a.map(f64::abs).into_iter().fold(0.0, f64::max)
    }

    /// Warning if a trace with these peaks uses few codes.
    pub fn warning(&self, peaks: &Peaks) -> Option<Warning> {
        let (share, [low_a, high_a]) = (self.share_of_current_codes(peaks), self.current_range_a);
        let message = || {
            format!(
                "the largest current, {:.3e} A, uses {:.2} % of the device's range of {low_a} to {high_a} A: its energy is rounded \
                 to few codes",
                self.peak_a(peaks),
                share * 100.0
            )
        };
        (share < MIN_USED_SHARE).then(|| Warning::new(Code::RangeUnused, message()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Trace;

    type Spoil = fn(&mut DeviceSpec);

    #[test]
    fn the_default_is_valid_and_every_bad_field_is_named() {
        assert_eq!(DeviceSpec::default().check(), Ok(()));
        let spoils: [(&str, Spoil); 16] = [
            ("current_gain", |s| s.current_gain = f64::NAN),
            ("current_gain", |s| s.current_gain = -1.0),
            ("voltage_gain", |s| s.voltage_gain = 0.0),
            ("specified_voltage_v", |s| s.specified_voltage_v = Some(0.0)),
            ("specified_voltage_v", |s| s.specified_voltage_v = Some(f64::INFINITY)),
            ("rate_hz", |s| s.rate_hz = -1.0),
            ("rail_v", |s| s.rail_v = 0.0),
            ("rail_ohm", |s| s.rail_ohm = f64::NAN),
            ("current_range_a", |s| s.current_range_a = [1.0, 1.0]),
            ("voltage_range_v", |s| s.voltage_range_v = [0.0, f64::INFINITY]),
            ("bits", |s| s.bits = 25),
            ("current_noise_a", |s| s.current_noise_a = -1.0),
            ("voltage_noise_v", |s| s.voltage_noise_v = -1.0),
            ("low_pass_s", |s| s.low_pass_s = Some(0.0)),
            ("packet_samples", |s| s.packet_samples = 0),
            ("packet_loss", |s| s.packet_loss = 1.0),
        ];
        for (field, spoil) in spoils {
            let mut spec = DeviceSpec::default();
            spoil(&mut spec);
            let message = spec.check().unwrap_err().to_string();
            assert!(message.contains(field) && message.contains("daq-50khz"), "{message}");
        }
    }

    #[test]
    fn the_range_is_the_smallest_that_holds_the_peak() {
        for (peak_w, range_a) in [(0.2, 0.03), (2.4, 0.3), (30.0, 10.0), (280.0, 30.0), (0.0, 1e-3)] {
            let spec = DeviceSpec::fitting(12.0, peak_w);
            assert_eq!(spec.current_range_a, [-range_a, range_a], "{peak_w} W");
            assert_eq!(spec.check(), Ok(()));
        }
        let default = DeviceSpec::fitting(12.0, 280.0);
        assert_eq!((default.current_noise_a, default.voltage_range_v[1]), (0.005, 18.0));
    }

    #[test]
    fn names_follow_rate_and_bits() {
        let name = |rate_hz, bits| {
            DeviceSpec { rate_hz, bits, ..DeviceSpec::default() }.named_by_rate_and_bits().name
        };
        assert_eq!(name(50e3, 14), DeviceSpec::default().name);
        assert_eq!(
            [name(1e6, 10), name(2500.0, 8), name(10.0, 24)],
            ["daq-1mhz-10bit", "daq-2.5khz-8bit", "daq-10hz-24bit"]
        );
    }

    #[test]
    fn peaks_have_no_sign() {
        let trace =
            Trace::new(vec![12.0, 11.0], vec![0.5, -2.0], 1e3, 0.0, crate::Metadata::default()).unwrap();
        let peaks = Peaks::of(&trace).unwrap();
        assert_eq!((peaks.voltage_v, peaks.current_a, peaks.power_w), (12.0, 2.0, 22.0));
        assert_eq!(DeviceSpec::default().share_of_current_codes(&peaks), 2.0 / 30.0);
        assert!(DeviceSpec::default().warning(&peaks).is_none());
        let small = Peaks { current_a: 1.0, ..peaks };
        assert!(DeviceSpec::default().warning(&small).unwrap().message.contains("uses 3.33 % of"));
        let power = Trace::new(vec![1.0; 2], vec![3.0, 24.0], 1e3, 0.0, crate::Metadata::default()).unwrap();
        let power = Peaks::of(&power).unwrap();
        assert!(peaks.has_voltage && !power.has_voltage);
        assert_eq!(DeviceSpec::default().share_of_current_codes(&power), 2.0 / 30.0);
    }
}
