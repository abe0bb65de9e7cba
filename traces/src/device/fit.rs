//! Recorders whose range fits what they record.

use super::DeviceSpec;
use crate::io::{Sink, Source, Stretch, WriteError};

/// The largest voltage, current and power of a trace, without their signs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peaks {
    /// V.
    pub voltage_v: f64,
    /// A.
    pub current_a: f64,
    /// W.
    pub power_w: f64,
}

impl Peaks {
    /// The peaks of `trace`, which is read once.
    ///
    /// # Errors
    /// [`WriteError::Read`] if it cannot be read.
    pub fn of(trace: &dyn Source) -> Result<Self, WriteError> {
        let mut peaks = Self::default();
        trace.pour(&mut peaks)?;
        Ok(peaks)
    }
}

impl Sink for Peaks {
    fn take(&mut self, stretch: &Stretch<'_>) -> Result<(), WriteError> {
        let largest = |most: f64, numbers: &[f32]| {
            numbers.iter().map(|number| f64::from(number.abs())).fold(most, f64::max)
        };
        self.voltage_v = largest(self.voltage_v, stretch.voltage_v);
        self.current_a = largest(self.current_a, stretch.current_a);
        self.power_w = stretch.powers_w().map(f64::abs).fold(self.power_w, f64::max);
        Ok(())
    }
}

/// What a range holds above the peak, as a factor.
const HEADROOM: f64 = 1.25;

/// Ranges of currents, A.
const RANGES_A: [f64; 18] =
    [1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 3e4, 1e5, 3e5];

impl DeviceSpec {
    /// The default recorder on a rail of `rail_v` volts, with the smallest range of currents of a 1-3-10 series that holds
    /// a quarter more than `peak_w` takes, as one would choose in a laboratory. Its voltage range is half as large again as
    /// the rail; noise goes with the ranges.
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

    /// Which share of the codes of the current's converter a trace with these peaks reaches.
    pub fn share_of_current_codes(&self, peaks: &Peaks) -> f64 {
        peaks.current_a / self.current_range_a.map(f64::abs).into_iter().fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Trace;

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
    }
}
