//! The time base: start and sample rate from time stamps, or the row where they are uneven.
//!
//! Rates are estimated here alone, by as much as is known: [`grid`] from all stamps, which must be even;
//! [`usual_rate_hz`] from stamps with gaps that are to be filled; [`mean_rate_hz`] from a few rows with gaps;
//! [`rate_to_last_row_hz`] from the first rows and the last one; [`rate_of_steps_hz`] from a count.

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use multiversion::multiversion;

use super::ReadError;
use super::samples::Description;
use crate::stats::upper_median;

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

/// Largest distance of a stamp from its place, in sample periods; rounding alone stays below.
const MAX_OFFSET_PERIODS: f64 = 0.25;
/// Largest deviation of a step from the usual one, as a share of it.
const MAX_STEP_DEVIATION: f64 = 0.5;
/// Number of steps from which the period is first guessed.
const GUESS_STEPS: usize = 1001;
/// Share of a rate within which rounding may decide whether a row is in its place.
const ROUNDING: f64 = 1e-13;

/// Checks stamps in order. Errors are reported at the end, those that exclude any rate first: a row out of
/// order, then an odd step, then a row off its place.
#[derive(Debug)]
pub(crate) struct Fit {
    path: PathBuf,
    stated_hz: Option<f64>,
    stated_start_s: Option<f64>,
    rows: u64,
    first: Option<Stamp>,
    before: Option<Stamp>,
    /// The first rows, until there are enough to guess the step from.
    head: Vec<Stamp>,
    guess_s: Option<f64>,
    /// The rates that put every row so far in its place, Hz.
    rates_hz: [f64; 2],
    /// The smallest step forward so far, s: stamps are no finer than that.
    smallest_step_s: f64,
    /// Whether a stamp is that of the row before.
    repeats: bool,
    unsorted: Option<ReadError>,
    misstep: Option<ReadError>,
    /// With how far it is off, in periods.
    misplaced: Option<(f64, ReadError)>,
}

/// Start and rate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fitted {
    pub grid: Grid,
    /// Whether all rows are known to be in their places; if not, they must be checked again with this rate as
    /// stated.
    pub sure: bool,
}

impl Fit {
    pub fn new(path: &Path, stated_hz: Option<f64>, stated_start_s: Option<f64>) -> Self {
        Self {
            path: path.to_owned(),
            stated_hz,
            stated_start_s,
            rows: 0,
            first: None,
            before: None,
            head: Vec::new(),
            guess_s: None,
            rates_hz: [0.0, f64::INFINITY],
            smallest_step_s: f64::INFINITY,
            repeats: false,
            unsorted: None,
            misstep: None,
            misplaced: None,
        }
    }

    /// The stamps of the rows after those seen before.
    pub fn push(&mut self, stamps: &Stamps) {
        if self.unsorted.is_some() || self.push_even(stamps) {
            return;
        }
        for row in 0..stamps.len() {
            self.push_one(stamps.stamp(row));
            if self.unsorted.is_some() {
                return;
            }
        }
    }

    /// Takes nanoseconds of equal steps: if both ends are in place, all between are. `false` if that is not
    /// certain.
    fn push_even(&mut self, stamps: &Stamps) -> bool {
        let Stamps::Nanoseconds(times) = stamps else { return false };
        let ([a, b, ..], [.., last], Some(before)) = (&times[..], &times[..], self.before) else {
            return false;
        };
        let (step, len) = (b.wrapping_sub(*a), times.len());
        let straight = i128::from(*last) - i128::from(*a) == i128::from(step) * (len as i128 - 1);
        if step <= 0 || !straight || !all_apart(times, step) {
            return false;
        }
        let even = |step_s: f64| {
            step_s > 0.0
                && (self.stated_hz.is_some()
                    || self.guess_s.is_some_and(|guess_s| !off_step(step_s, guess_s)))
        };
        if !even(stamps.stamp(0).since_s(before)) || !even(step as f64 / 1e9) {
            return false;
        }
        for row in [0, len - 1] {
            let (stamp, row) = (stamps.stamp(row), self.rows + row as u64);
            if self.off(stamp, row).is_some_and(|off| off.abs() > 0.99 * MAX_OFFSET_PERIODS) {
                return false;
            }
            self.narrow(stamp, row);
        }
        self.smallest_step_s = self.smallest_step_s.min(step as f64 / 1e9);
        (self.before, self.rows) = (Some(stamps.stamp(len - 1)), self.rows + len as u64);
        true
    }

    fn push_one(&mut self, stamp: Stamp) {
        let row = self.rows;
        self.unsorted = self.out_of_order(stamp);
        self.look_at_resolution(stamp);
        if self.stated_hz.is_none() {
            self.look_at_step(stamp);
        }
        self.first.get_or_insert(stamp);
        if let Some((off, rate_hz)) = self.off(stamp, row).zip(self.stated_hz)
            && off.abs() > self.max_offset_periods(rate_hz)
            && self.misplaced.is_none()
        {
            self.misplaced = Some((off.abs(), self.uneven(row, stamp, off, rate_hz)));
        }
        self.narrow(stamp, row);
        (self.before, self.rows) = (Some(stamp), row + 1);
    }

    /// Learns how finely stamps are rounded; once they repeat, a row that is off by no more than that is in
    /// its place.
    fn look_at_resolution(&mut self, stamp: Stamp) {
        let Some(step_s) = self.before.map(|before| stamp.since_s(before)) else { return };
        if step_s > 0.0 {
            self.smallest_step_s = self.smallest_step_s.min(step_s);
        }
        self.repeats |= step_s == 0.0;
        if let Some(rate_hz) = self.stated_hz.filter(|_| self.repeats) {
            let max_periods = self.max_offset_periods(rate_hz);
            self.misplaced.take_if(|(off_periods, _)| *off_periods <= max_periods);
        }
    }

    fn max_offset_periods(&self, rate_hz: f64) -> f64 {
        max_offset_periods(self.repeats, self.smallest_step_s, rate_hz)
    }

    fn out_of_order(&self, stamp: Stamp) -> Option<ReadError> {
        let (path, row, time_s) = (|| self.path.clone(), self.rows + 1, stamp.time_s());
        if !time_s.is_finite() {
            let (column, value) = ("time_s".to_owned(), time_s.to_string());
            return Some(ReadError::Value { path: path(), row, column, value });
        }
        // With a stated rate, stamps may be coarser than the samples, and repeat.
        let repeats = |since_s: f64| since_s == 0.0 && self.stated_hz.is_none();
        let is_wrong = |since_s: f64| since_s < 0.0 || repeats(since_s);
        let before = self.before.filter(|before| is_wrong(stamp.since_s(*before)))?;
        Some(ReadError::Unsorted { path: path(), row, time_s, before_s: before.time_s() })
    }

    /// Compares a step with the usual one, once that is known.
    fn look_at_step(&mut self, stamp: Stamp) {
        if self.guess_s.is_none() {
            self.head.push(stamp);
            if self.head.len() > GUESS_STEPS {
                self.guess();
            }
        } else if let Some(before) = self.before {
            self.check_step(self.rows, before, stamp);
        }
    }

    /// Guesses the step from the first rows, and compares theirs with it.
    fn guess(&mut self) {
        let head = std::mem::take(&mut self.head);
        let mut steps: Vec<f64> = head.windows(2).map(|pair| pair[1].since_s(pair[0])).collect();
        if steps.is_empty() {
            return;
        }
        self.guess_s = Some(upper_median(&mut steps));
        for (row, pair) in head.windows(2).enumerate() {
            self.check_step(row as u64 + 1, pair[0], pair[1]);
        }
    }

    fn check_step(&mut self, row: u64, before: Stamp, stamp: Stamp) {
        let Some(guess_s) = self.guess_s.filter(|_| self.misstep.is_none()) else { return };
        let step_s = stamp.since_s(before);
        if off_step(step_s, guess_s) {
            self.misstep = Some(self.uneven(row, stamp, step_s / guess_s - 1.0, 1.0 / guess_s));
        }
    }

    /// How far a row is off its place by the stated rate, in periods.
    fn off(&self, stamp: Stamp, row: u64) -> Option<f64> {
        Some(stamp.since_s(self.first?) * self.stated_hz? - row as f64)
    }

    /// Excludes the rates that put a row off its place.
    fn narrow(&mut self, stamp: Stamp, row: u64) {
        if self.stated_hz.is_none()
            && let Some(first) = self.first.filter(|_| row > 0)
        {
            let (since_s, row, [low, high]) = (stamp.since_s(first), row as f64, self.rates_hz);
            self.rates_hz = [
                low.max((row - MAX_OFFSET_PERIODS) / since_s),
                high.min((row + MAX_OFFSET_PERIODS) / since_s),
            ];
        }
    }

    fn uneven(&self, row: u64, stamp: Stamp, off_periods: f64, rate_hz: f64) -> ReadError {
        let time_s = stamp.time_s();
        ReadError::Uneven { path: self.path.clone(), row: row + 1, time_s, off_periods, rate_hz }
    }

    /// Start and rate of all rows.
    ///
    /// # Errors
    /// [`ReadError`] names the first row that is wrong, or says that no rate is known.
    pub fn conclude(mut self) -> Result<Fitted, ReadError> {
        if let Some(error) = self.unsorted {
            return Err(error);
        }
        if self.guess_s.is_none() {
            self.guess();
        }
        if self.rows > 1
            && self.smallest_step_s.is_infinite()
            && let Some(time_s) = self.first.map(Stamp::time_s)
        {
            return Err(ReadError::Unsorted { path: self.path, row: 2, time_s, before_s: time_s });
        }
        if let Some(error) = self.misstep.take().or(self.misplaced.take().map(|(_, error)| error)) {
            return Err(error);
        }
        let unknown = || ReadError::NoRate { path: self.path.clone() };
        let Some((first, last)) = self.first.zip(self.before) else {
            let rate_hz = self.stated_hz.ok_or_else(unknown)?;
            return Ok(Fitted {
                grid: Grid { start_s: self.stated_start_s.unwrap_or(0.0), rate_hz },
                sure: true,
            });
        };
        let rate_hz = match self.stated_hz {
            Some(rate_hz) => rate_hz,
            None if self.rows == 1 => return Err(unknown()),
            None => rounded_rate_hz((self.rows - 1) as f64, last.since_s(first), first.resolution_s()),
        };
        let [low, high] = self.rates_hz;
        let sure = self.stated_hz.is_some()
            || (low * (1.0 + ROUNDING) <= rate_hz && rate_hz <= high * (1.0 - ROUNDING));
        let first_s = first.time_s();
        // The stated start is exact where the first stamp was rounded; if it is another time, the file was
        // edited.
        let stated =
            self.stated_start_s.filter(|start_s| (start_s - first_s).abs() * rate_hz <= MAX_OFFSET_PERIODS);
        Ok(Fitted { grid: Grid { start_s: stated.unwrap_or(first_s), rate_hz }, sure })
    }
}

/// Steps of stamps that are coarser than the samples take more periods than this; otherwise a stamp that
/// repeats is a row too many.
const COARSE_PERIODS: f64 = 1.1;

/// Largest distance of a stamp from its place, in sample periods. Stamps that repeat may be rounded to
/// `resolution_s`: half of it may be missing at the first row, half of it at this one.
pub(crate) fn max_offset_periods(repeats: bool, resolution_s: f64, rate_hz: f64) -> f64 {
    let resolution_periods = resolution_s * rate_hz;
    let is_coarse = repeats && resolution_periods > COARSE_PERIODS;
    MAX_OFFSET_PERIODS + if is_coarse { resolution_periods } else { 0.0 }
}

fn off_step(step_s: f64, guess_s: f64) -> bool {
    (step_s / guess_s - 1.0).abs() > MAX_STEP_DEVIATION
}
