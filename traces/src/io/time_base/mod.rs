//! From time stamps to a start and a rate, or to the row where they are not even.

mod fit;
#[cfg(test)]
mod tests;

use super::ReadError;
use super::description::Description;
use crate::stats::upper_median;
pub(crate) use fit::{Fit, Fitted};
use multiversion::multiversion;
use std::path::Path;

/// A rate is rounded only if that moves the last sample by less than this share of a period.
const SNAP: f64 = 0.05;

/// Stands for a time that is missing, where missing values are to be mended: a nanosecond 292 years before 1970, and not one of
/// the first that times come to that wrap around.
pub(crate) const NO_TIME_NS: i64 = i64::MIN + 999_999_937;

/// Time stamps as a file has them.
#[derive(Clone, Debug)]
pub(crate) enum Stamps {
    Nanoseconds(Vec<i64>),
    Seconds(Vec<f64>),
    /// No column of times; the description must state the rate.
    Absent,
}

/// One stamp as a file has it.
#[derive(Clone, Copy, Debug)]
enum Stamp {
    Nanoseconds(i64),
    Seconds(f64),
}

impl Stamp {
    fn time_s(self) -> f64 {
        match self {
            Self::Nanoseconds(NO_TIME_NS) => f64::NAN,
            Self::Nanoseconds(time) => time as f64 / 1e9,
            Self::Seconds(time) => time,
        }
    }

    /// Seconds since an earlier one; nanoseconds are subtracted as integers, so a large start costs no precision.
    fn since_s(self, earlier: Self) -> f64 {
        match (self, earlier) {
            (Self::Nanoseconds(time), Self::Nanoseconds(earlier)) => {
                (i128::from(time) - i128::from(earlier)) as f64 / 1e9
            }
            _ => self.time_s() - earlier.time_s(),
        }
    }

    /// How finely it tells time, s. Of seconds in a text it is not known.
    fn resolution_s(self) -> f64 {
        if matches!(self, Self::Nanoseconds(_)) { 1.5e-9 } else { f64::INFINITY }
    }
}

/// When the first sample begins (s) and the rate (Hz).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grid {
    pub start_s: f64,
    pub rate_hz: f64,
}

impl Stamps {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Nanoseconds(times) => times.len(),
            Self::Seconds(times) => times.len(),
            Self::Absent => 0,
        }
    }

    pub(crate) fn time_s(&self, row: usize) -> f64 {
        self.stamp(row).time_s()
    }

    /// Seconds since an earlier row.
    pub(crate) fn since_s(&self, row: usize, earlier: usize) -> f64 {
        self.stamp(row).since_s(self.stamp(earlier))
    }

    fn stamp(&self, row: usize) -> Stamp {
        match self {
            Self::Nanoseconds(times) => Stamp::Nanoseconds(times[row]),
            Self::Seconds(times) => Stamp::Seconds(times[row]),
            Self::Absent => Stamp::Seconds(0.0),
        }
    }
}

/// The grid all stamps lie on.
pub(crate) fn grid(path: &Path, stamps: &Stamps, description: &Description) -> Result<Grid, ReadError> {
    let fit = |rate_hz: Option<f64>| {
        let mut fit = Fit::new(path, rate_hz, description.start_s);
        fit.push(stamps);
        fit.conclude()
    };
    let fitted = fit(description.rate_hz)?;
    if fitted.sure { Ok(fitted.grid) } else { Ok(fit(Some(fitted.grid.rate_hz))?.grid) }
}

/// The roundest rate (the one with most zeros) that moves the last sample by no more than the stamps can tell.
pub(crate) fn rounded_rate_hz(periods: f64, span_s: f64, resolution_s: f64) -> f64 {
    let rate_hz = periods / span_s;
    let tolerance = f64::min(SNAP, resolution_s * rate_hz);
    let round_to = |unit_hz: f64| libm::round(rate_hz / unit_hz) * unit_hz;
    let snaps = |candidate: &f64| *candidate > 0.0 && (span_s * candidate - periods).abs() <= tolerance;
    [1e6, 1e5, 1e4, 1e3, 100.0, 10.0, 1.0].map(round_to).into_iter().find(snaps).unwrap_or(rate_hz)
}

/// The rate by all steps that are no gaps: where stamps are rounded, these differ, and their mean does not.
pub(crate) fn mean_rate_hz(times: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let usual_s = upper_median(&mut steps);
    let single = || steps.iter().filter(|step_s| **step_s < 1.6 * usual_s);
    rounded_rate_hz(single().count() as f64, single().sum(), f64::INFINITY)
}

/// The rate that all rows agree on, those with missing samples between them too. The usual step alone would not do: where
/// stamps are rounded, it is off by up to that much, which adds up over the rows.
pub(crate) fn usual_rate_hz(times: &[f64]) -> f64 {
    let steps = || times.windows(2).map(|pair| pair[1] - pair[0]);
    let mut sorted: Vec<f64> = steps().collect();
    let usual_s = upper_median(&mut sorted);
    let (sum_s, count) = steps()
        .filter(|step_s| (step_s / usual_s - 1.0).abs() < 0.5)
        .fold((0.0, 0.0), |(sum_s, count), step_s| (sum_s + step_s, count + 1.0));
    let period_s = sum_s / count;
    let periods: f64 = steps().map(|step_s| libm::round(step_s / period_s).max(1.0)).sum();
    rounded_rate_hz(periods, times[times.len() - 1] - times[0], f64::INFINITY)
}

/// Whether each time is one step after the one before; without a way out on the way, so that many pairs are held at once.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn all_apart(times: &[i64], step: i64) -> bool {
    times.iter().zip(&times[1..]).fold(0, |any, (a, b)| any | (b.wrapping_sub(*a) ^ step)) == 0
}
