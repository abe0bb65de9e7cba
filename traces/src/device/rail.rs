//! The supply rail between its source and the point of measurement.

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
    /// Kirchhoff: `V = V0 - R I`, `P = V I`, so `R I^2 - V0 I + P = 0`. Of its roots the smaller current is the
    /// stable one; the form below has no cancellation and holds for `R = 0`.
    pub(super) fn solve(&self, power_w: f64) -> Option<(f64, f64)> {
        let discriminant = self.volts * self.volts - 4.0 * self.ohm * power_w;
        if discriminant < 0.0 {
            return None;
        }
        let current = 2.0 * power_w / (self.volts + libm::sqrt(discriminant));
        Some((self.volts - self.ohm * current, current))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
