//! Axes: a range, round ticks, and a prefix for the unit.

use crate::output::table::{Prefix, power_of_ten};

/// A range of values in the plain unit and how it is labelled.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub low: f64,
    pub high: f64,
    /// Where ticks are, in the plain unit, with their labels.
    pub ticks: Vec<(f64, String)>,
    /// What the axis shows, with prefix and unit: `power (mW)`.
    pub label: String,
}

/// Whether an axis can be drawn from `low` to `high`: finite, and with room for a sum of them in f64.
pub(super) fn is_drawable(low: f64, high: f64) -> bool {
    low.abs() < 1e100 && high.abs() < 1e100
}

impl Axis {
    /// An axis of `name` in `unit` over `low..high`, which must be drawable ([`is_drawable`]); an empty range is widened.
    pub fn new(name: &str, unit: &str, low: f64, high: f64) -> Self {
        let (low, high) = widened(low, high);
        let prefix = if unit.is_empty() { Prefix::NONE } else { Prefix::of(low.abs().max(high.abs())) };
        let label = if unit.is_empty() { name.to_owned() } else { format!("{name} ({}{unit})", prefix.sign) };
        Self { low, high, ticks: ticks(low, high, prefix.factor), label }
    }

    /// An axis from 0 to a little above `high`.
    pub fn from_zero(name: &str, unit: &str, high: f64) -> Self {
        Self::new(name, unit, 0.0, high * 1.06)
    }

    /// Whole numbers only, for counted things such as frames.
    pub fn whole(name: &str, low: f64, high: f64) -> Self {
        let mut axis = Self::new(name, "", low, high);
        axis.ticks.retain(|(value, _)| libm::round(*value) == *value);
        for (value, label) in &mut axis.ticks {
            *label = format!("{value:.0}");
        }
        axis
    }

    /// A logarithmic axis: `low` and `high`, and the values drawn on it, are powers of ten. At most about eight ticks.
    pub fn log(name: &str, low: f64, high: f64) -> Self {
        let (low, high) = (low.min(high) - 0.1, high.max(low) + 0.1);
        let (first, last) = (libm::ceil(low) as i32, libm::floor(high) as i32);
        let step = ((last - first) / 8 + 1) as usize;
        let mut ticks: Vec<_> =
            (first..=last).step_by(step).map(|power| (f64::from(power), format!("1e{power}"))).collect();
        if ticks.len() < 2 {
            // Within one decade: a few plain values.
            let values =
                [1.0, 1.5, 2.0, 3.0, 5.0, 7.0].map(|digit| digit * power_of_ten(libm::floor(low) as i32));
            let values = values.into_iter().flat_map(|value| [value, value * 10.0]);
            ticks = values
                .map(|value| (libm::log10(value), format!("{value:.4e}")))
                .map(|(at, label)| (at, trimmed(&label)))
                .filter(|(at, _)| (low..=high).contains(at))
                .collect();
        }
        Self { low, high, ticks, label: name.to_owned() }
    }

    /// Where `value` lies, 0 at the low end and 1 at the high one, held to [0, 1].
    pub fn fraction(&self, value: f64) -> f64 {
        let fraction = (value - self.low) / (self.high - self.low);
        if fraction.is_nan() { 0.0 } else { fraction.clamp(0.0, 1.0) }
    }
}

/// `1.5000e3` as `1.5e3`.
fn trimmed(label: &str) -> String {
    let (digits, power) = label.split_once('e').unwrap_or((label, "0"));
    format!("{}e{power}", digits.trim_end_matches('0').trim_end_matches('.'))
}

fn widened(low: f64, high: f64) -> (f64, f64) {
    // Below a millionth of the value the labels of neighbouring ticks would need more digits than there is room for.
    if high - low > 1e-6 * low.abs().max(high.abs()) {
        (low, high)
    } else if low == 0.0 && high == 0.0 {
        (0.0, 1.0)
    } else {
        (low - 0.1 * low.abs(), high + 0.1 * high.abs())
    }
}

/// Multiples of 1, 2 or 5 times a power of ten within the range, at most about eight.
pub(super) fn ticks(low: f64, high: f64, factor: f64) -> Vec<(f64, String)> {
    let (step, power) = step((high - low) * factor / 8.0);
    let decimals = (-power).clamp(0, 7) as usize;
    let plain = high.abs().max(low.abs()) * factor < 1e6 && power >= -7;
    let label = |value: f64| if plain { format!("{value:.decimals$}") } else { format!("{value:.2e}") };
    let first = libm::ceil(low * factor / step - 1e-9);
    (0..12)
        .map(|i| (first + f64::from(i)) * step)
        .filter(|scaled| *scaled <= high * factor + 1e-9 * step && scaled.is_finite())
        .map(|scaled| (scaled / factor, label(scaled + 0.0)))
        .collect()
}

/// The smallest 1, 2 or 5 times a power of ten that is at least `wanted`, and that power.
fn step(wanted: f64) -> (f64, i32) {
    let mut power = libm::floor(libm::log10(wanted)).clamp(-300.0, 300.0) as i32;
    for _ in 0..2 {
        for digit in [1.0, 2.0, 5.0] {
            let step = digit * power_of_ten(power);
            if step >= wanted * (1.0 - 1e-9) {
                return (step, power);
            }
        }
        power += 1;
    }
    (power_of_ten(power), power)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|(_, label)| label.as_str()).collect()
    }

    #[test]
    fn ticks_are_round_and_inside() {
        let axis = Axis::new("time", "s", 0.0, 0.016);
        assert_eq!(axis.label, "time (ms)");
        assert_eq!(labels(&axis), ["0", "2", "4", "6", "8", "10", "12", "14", "16"]);
        let axis = Axis::new("power", "W", 10.05, 10.45);
        assert_eq!(
            labels(&axis),
            ["10.05", "10.10", "10.15", "10.20", "10.25", "10.30", "10.35", "10.40", "10.45"]
        );
    }

    #[test]
    fn an_empty_range_is_widened() {
        for (low, high) in [(0.0, 0.0), (5.0, 5.0), (-3.0, -3.0), (1e-30, 1e-30)] {
            let axis = Axis::new("x", "W", low, high);
            assert!(axis.low < axis.high && !axis.ticks.is_empty(), "{axis:?}");
        }
    }

    #[test]
    fn decades_are_ticked() {
        assert_eq!(labels(&Axis::log("madds", 0.5, 3.2)), ["1e1", "1e2", "1e3"]);
        assert_eq!(labels(&Axis::log("madds", -20.0, 20.0)).len(), 7);
        assert_eq!(labels(&Axis::log("madds", 3.15, 3.2)), ["1.5e3"]);
    }

    #[test]
    fn frames_are_whole() {
        assert_eq!(labels(&Axis::whole("frame", 0.0, 2.0)), ["0", "1", "2"]);
    }
}
