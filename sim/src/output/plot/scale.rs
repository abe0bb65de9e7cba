//! How values lie along an axis: as they are, or by their logarithm; and the ticks that fit.

use super::axis::{Axis, is_drawable, ticks};
use super::render::text_width;
use crate::output::table::power_of_ten;

/// How values lie along an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// By their logarithm, ticks at round multiples of powers of ten.
    #[default]
    Decades,
    /// By their logarithm, ticks at powers of two.
    Doublings,
    /// As they are, from zero on where that is not far.
    Even,
}

/// Which way an axis goes, as labels need room along it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    Across,
    Up,
}

/// Digits of ticks on a scale of decades, from many to few.
const DIGITS: [&[f64]; 3] = [&[1.0, 2.0, 3.0, 5.0, 7.0], &[1.0, 2.0, 5.0], &[1.0]];
/// Size of the labels of ticks in pixels.
const LABEL_PX: f64 = 12.0;

impl Scale {
    /// Where a value is on the axis; `None` where the scale has no place for it. Zero has one on every scale: see [`axis`](Self::axis).
    pub(super) fn place(self, value: f64, axis: &Axis) -> Option<f64> {
        match self {
            _ if !value.is_finite() => None,
            Self::Even => Some(value),
            _ if value > 0.0 => Some(libm::log10(value)),
            _ if value == 0.0 => Some(axis.low),
            _ => None,
        }
    }

    /// An axis of `length` pixels that holds all of `values`, or `None` where nothing can be shown. On a logarithmic scale zero is at the
    /// low end, and a tick says so.
    pub(super) fn axis(self, label: &str, values: &[f64], (way, length): (Way, f64)) -> Option<Axis> {
        let logarithm = |value: &f64| if self == Self::Even { *value } else { libm::log10(*value) };
        let shown = || values.iter().map(logarithm).filter(|value| value.is_finite());
        let (low, high) = shown().reduce(f64::min).zip(shown().reduce(f64::max))?;
        if !is_drawable(low, high) || (self != Self::Even && (low < -90.0 || high > 90.0)) {
            return None;
        }
        if self == Self::Even {
            return Some(even(label, low, high));
        }
        let pad = 0.05_f64.max(0.04 * (high - low));
        let (mut low, high) = (low - pad, high + pad);
        let mut ticks = self.fitting(low, high, (way, length));
        if values.contains(&0.0) {
            low -= 0.12 * (high - low);
            ticks.insert(0, (low, "0".to_owned()));
        }
        Some(Axis { low, high, ticks, label: label.to_owned() })
    }

    /// The most ticks whose labels have room.
    fn fitting(self, low: f64, high: f64, (way, length): (Way, f64)) -> Vec<(f64, String)> {
        let fits = |ticks: &[(f64, String)]| {
            let gap = |pair: &[(f64, String)]| length * (pair[1].0 - pair[0].0) / (high - low);
            let wide = |tick: &(f64, String)| text_width(&tick.1, LABEL_PX, false);
            let needs = |pair: &[(f64, String)]| match way {
                Way::Across => 0.5 * (wide(&pair[0]) + wide(&pair[1])) + 9.0,
                Way::Up => 22.0,
            };
            ticks.windows(2).all(|pair| gap(pair) >= needs(pair))
        };
        let mut all = self.candidates(low, high);
        let first = |least: usize| all.iter().position(|ticks| ticks.len() >= least && fits(ticks));
        let best = first(2).or_else(|| first(1)).unwrap_or(all.len() - 1);
        all.swap_remove(best)
    }

    /// Sets of ticks within the range, from many to few.
    fn candidates(self, low: f64, high: f64) -> Vec<Vec<(f64, String)>> {
        let within = |values: Vec<f64>| -> Vec<(f64, String)> {
            let ticks = values.into_iter().map(|value| (libm::log10(value), plain(value)));
            ticks.filter(|(at, _)| (low..=high).contains(at)).collect()
        };
        if self == Self::Doublings {
            let doublings = |step| (-20..40).step_by(step).map(|power| libm::ldexp(1.0, power)).collect();
            return [1, 2, 4].into_iter().map(|step| within(doublings(step))).collect();
        }
        let [first, last] = [libm::exp10(low), libm::exp10(high)];
        let round = ticks(first, last, 1.0).into_iter().map(|(value, _)| value).filter(|value| *value > 0.0);
        let round: Vec<f64> = if high - low < 0.7 { round.collect() } else { Vec::new() };
        let sparser = |step| within(round.iter().copied().step_by(step).collect());
        let mut all: Vec<_> = [1, 2, 3].map(sparser).into();
        let powers = libm::floor(low) as i32..=libm::ceil(high) as i32;
        let with = |digits: &[f64], step| -> Vec<f64> {
            let powers = powers.clone().filter(|power| power % step == 0);
            powers.flat_map(|power| digits.iter().map(move |digit| digit * power_of_ten(power))).collect()
        };
        all.extend(DIGITS.map(|digits| within(with(digits, 1))));
        all.extend([2, 3, 5, 10].map(|step| within(with(&[1.0], step))));
        all
    }
}

fn even(label: &str, low: f64, high: f64) -> Axis {
    let pad = 0.06 * (high - low).max(1e-3 * high.abs());
    let low = if low >= 0.0 && low < 0.6 * high { 0.0 } else { low - pad };
    Axis::new(label, "", low, high + pad)
}

fn plain(value: f64) -> String {
    if (1e-4..1e6).contains(&value) { format!("{}", value as f32) } else { format!("{value:.0e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(scale: Scale, values: &[f64], way: Way) -> Vec<String> {
        let axis = scale.axis("x", values, (way, 324.0)).unwrap();
        axis.ticks.into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn labels_have_room_and_are_more_than_one() {
        assert_eq!(labels(Scale::Doublings, &[1.0, 64.0], Way::Across).len(), 7);
        assert_eq!(
            labels(Scale::Doublings, &[4.0, 16_384.0], Way::Across),
            ["4", "16", "64", "256", "1024", "4096", "16384"]
        );
        for values in [[7.2, 9.2], [15_000.0, 22_000.0], [1e-5, 1e9], [0.05, 0.4], [1.0, 1.0], [3e-30, 2e30]]
        {
            for way in [Way::Across, Way::Up] {
                let labels = labels(Scale::Decades, &values, way);
                assert!((2..=14).contains(&labels.len()) || values[0] == values[1], "{values:?} {labels:?}");
            }
        }
    }

    #[test]
    fn zero_has_a_place_of_its_own_below() {
        let axis = Scale::Decades.axis("x", &[0.0, 1.0, 100.0], (Way::Up, 372.0)).unwrap();
        assert_eq!(axis.ticks[0], (axis.low, "0".to_owned()));
        let [zero, one] = [0.0, 1.0].map(|value| Scale::Decades.place(value, &axis).unwrap());
        assert!(zero < one - 0.2 && Scale::Decades.place(-1.0, &axis).is_none());
        assert!(Scale::Decades.axis("x", &[0.0], (Way::Up, 372.0)).is_none());
    }

    #[test]
    fn shares_start_at_zero_and_what_is_far_off_does_not() {
        let axis = Scale::Even.axis("share", &[0.2, 1.0], (Way::Up, 372.0)).unwrap();
        assert!(axis.low == 0.0 && axis.high > 1.0);
        assert!(Scale::Even.axis("x", &[95.0, 100.0], (Way::Up, 372.0)).unwrap().low > 90.0);
    }
}
