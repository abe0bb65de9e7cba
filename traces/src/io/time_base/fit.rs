//! The time base of stamps that are read once, in pieces.

use super::{Grid, Stamp, Stamps, all_apart, rounded_rate_hz};
use crate::io::ReadError;
use crate::stats::upper_median;
use std::path::{Path, PathBuf};

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
    unsorted: Option<ReadError>,
    misstep: Option<ReadError>,
    misplaced: Option<ReadError>,
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
        (self.before, self.rows) = (Some(stamps.stamp(len - 1)), self.rows + len as u64);
        true
    }

    fn push_one(&mut self, stamp: Stamp) {
        let row = self.rows;
        self.unsorted = self.out_of_order(stamp);
        if self.stated_hz.is_none() {
            self.look_at_step(stamp);
        }
        self.first.get_or_insert(stamp);
        if let Some((off, rate_hz)) = self.off(stamp, row).zip(self.stated_hz)
            && off.abs() > MAX_OFFSET_PERIODS
            && self.misplaced.is_none()
        {
            self.misplaced = Some(self.uneven(row, stamp, off, rate_hz));
        }
        self.narrow(stamp, row);
        (self.before, self.rows) = (Some(stamp), row + 1);
    }

    fn out_of_order(&self, stamp: Stamp) -> Option<ReadError> {
        let (path, row, time_s) = (|| self.path.clone(), self.rows + 1, stamp.time_s());
        if !time_s.is_finite() {
            let (column, value) = ("time_s".to_owned(), time_s.to_string());
            return Some(ReadError::Value { path: path(), row, column, value });
        }
        let before = self.before.filter(|before| stamp.since_s(*before) <= 0.0)?;
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
        if let Some(error) = self.misstep.take().or(self.misplaced.take()) {
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

fn off_step(step_s: f64, guess_s: f64) -> bool {
    (step_s / guess_s - 1.0).abs() > MAX_STEP_DEVIATION
}
