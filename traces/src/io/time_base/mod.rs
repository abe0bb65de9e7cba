//! The time base: start and sample rate from time stamps, or the row where they are uneven.
//!
//! Rates are estimated here alone, by as much as is known: [`grid`] from all stamps, which must be even;
//! [`usual_rate_hz`] from stamps with gaps that are to be filled; [`mean_rate_hz`] from a few rows with gaps;
//! [`rate_to_last_row_hz`] from the first rows and the last one; [`rate_of_steps_hz`] from a count.

mod fit;
#[cfg(test)]
mod tests;

use super::ReadError;
use super::description::Description;
use crate::stats::upper_median;
pub(crate) use fit::{Fit, Fitted};
use multiversion::multiversion;
use std::path::Path;

/// Farthest that rounding of the rate may move the last sample, in sample periods.
const MAX_ROUNDING_PERIODS: f64 = 0.05;

/// No sample is missing if the last one is off by less than this, in sample periods.
const MIN_MISSING_PERIODS: f64 = 0.5;

/// Stands for a missing time until it is repaired: a nanosecond 292 years before 1970, and none of the first
/// that times reach when they wrap around.
pub(crate) const NO_TIME_NS: i64 = i64::MIN + 999_999_937;

/// Time stamps of a file.
#[derive(Clone, Debug)]
pub(crate) enum Stamps {
    Nanoseconds(Vec<i64>),
    Seconds(Vec<f64>),
    /// No times; the description must state the rate.
    Absent,
}

/// A time stamp of a file.
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

    /// Seconds since an earlier one; nanoseconds are subtracted as integers, so a large start costs no
    /// precision.
    fn since_s(self, earlier: Self) -> f64 {
        match (self, earlier) {
            (Self::Nanoseconds(time), Self::Nanoseconds(earlier)) => {
                (i128::from(time) - i128::from(earlier)) as f64 / 1e9
            }
            _ => self.time_s() - earlier.time_s(),
        }
    }

    /// Its resolution, s; unknown for seconds in a text.
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

/// The time base of all stamps.
pub(crate) fn grid(path: &Path, stamps: &Stamps, description: &Description) -> Result<Grid, ReadError> {
    let fit = |rate_hz: Option<f64>| {
        let mut fit = Fit::new(path, rate_hz, description.start_s);
        fit.push(stamps);
        fit.conclude()
    };
    let fitted = fit(description.rate_hz)?;
    if fitted.sure { Ok(fitted.grid) } else { Ok(fit(Some(fitted.grid.rate_hz))?.grid) }
}

/// The roundest rate (with most zeros) that moves the last sample by no more than the resolution of the
/// stamps.
fn rounded_rate_hz(periods: f64, span_s: f64, resolution_s: f64) -> f64 {
    let rate_hz = periods / span_s;
    let tolerance = f64::min(MAX_ROUNDING_PERIODS, resolution_s * rate_hz);
    let round_to = |unit_hz: f64| libm::round(rate_hz / unit_hz) * unit_hz;
    let snaps = |candidate: &f64| *candidate > 0.0 && (span_s * candidate - periods).abs() <= tolerance;
    [1e6, 1e5, 1e4, 1e3, 100.0, 10.0, 1.0].map(round_to).into_iter().find(snaps).unwrap_or(rate_hz)
}

/// The rate by all steps that are not gaps: rounding changes single steps, but not their mean.
pub(crate) fn mean_rate_hz(times: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let usual_s = upper_median(&mut steps);
    let single = || steps.iter().filter(|step_s| **step_s < 1.6 * usual_s);
    rounded_rate_hz(single().count() as f64, single().sum(), f64::INFINITY)
}

/// The rate that agrees with all rows, also across gaps. The usual step alone is not enough: it is off by up
/// to the rounding of the stamps, which adds up over the rows.
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

/// The rate of steps in a row, from their number and the time they take, as round as that allows.
pub(crate) fn rate_of_steps_hz(steps: f64, span_s: f64) -> f64 {
    rounded_rate_hz(steps, span_s, f64::INFINITY)
}

/// The rate of a whole file, from that of its first rows and the time from its first row to row number `last`
/// (from 0). The rate of the first rows is kept if it puts the last one in its place, or if it leaves no room
/// for another rate: then samples are missing.
pub(crate) fn rate_to_last_row_hz(first_rows: &Stamps, rate_hz: f64, last: u64, span_s: f64) -> f64 {
    let (off_periods, whole_hz) = (span_s * rate_hz - last as f64, last as f64 / span_s);
    let possible = off_periods.abs() < MIN_MISSING_PERIODS
        || (whole_hz / rate_hz - 1.0).abs() <= rate_uncertainty(first_rows, rate_hz);
    if off_periods.abs() > MAX_ROUNDING_PERIODS && span_s > 0.0 && possible { whole_hz } else { rate_hz }
}

/// Uncertainty of the rate of some rows, as a share: stamps at both ends may be as far off as any, and are
/// rounded.
fn rate_uncertainty(stamps: &Stamps, rate_hz: f64) -> f64 {
    let off = |row: usize| (stamps.since_s(row, 0) * rate_hz - row as f64).abs();
    let farthest = (1..stamps.len()).map(off).fold(0.0, f64::max);
    let rounded =
        if matches!(stamps, Stamps::Nanoseconds(_)) { 1.5e-9 * rate_hz } else { MAX_ROUNDING_PERIODS };
    2.0 * (farthest + rounded) / stamps.len().saturating_sub(1).max(1) as f64
}

/// Whether each time is one step after the one before; without an early exit, so that the loop vectorizes.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn all_apart(times: &[i64], step: i64) -> bool {
    times.iter().zip(&times[1..]).fold(0, |any, (a, b)| any | (b.wrapping_sub(*a) ^ step)) == 0
}
