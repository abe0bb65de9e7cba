//! How far the energy of a trace can be from that of the curve it was sampled from.

use super::{Device, Sampled};

impl Device {
    /// A bound on |trace integral - curve integral| over the whole trace, J, for a device without noise and filter;
    /// `None` for a device with either, and where samples were clipped (no bound holds then).
    ///
    /// With `V = V' + a`, `I = I' + b`, `|a| <= e_V`, `|b| <= e_I`, the power is off by at most
    /// `|V'| e_I + |I'| e_V + e_V e_I`; `e` is half a code plus the f32 rounding of the stored value. The last term
    /// covers the f64 arithmetic of means, rail and integral.
    pub fn quantization_energy_bound_j(&self, sampled: &Sampled) -> Option<f64> {
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

    /// Standard deviation that the device's noise alone gives the trace's whole energy, J:
    /// `dt sqrt(sum (V s_I)^2 + (I s_V)^2)`, the noise being independent from sample to sample.
    pub fn noise_energy_sigma_j(&self, sampled: &Sampled) -> f64 {
        let trace = &sampled.trace;
        let variance: f64 = trace
            .voltage_v()
            .iter()
            .zip(trace.current_a())
            .map(|(&voltage, &current)| {
                let by_current = f64::from(voltage) * self.spec.current_noise_a;
                let by_voltage = f64::from(current) * self.spec.voltage_noise_v;
                by_current * by_current + by_voltage * by_voltage
            })
            .sum();
        libm::sqrt(variance) * trace.period_s()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::curve::Curve;
    use crate::device::DeviceSpec;

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
