//! The time base of a file of samples, before all of them have been read, and the check of their stamps.

use crate::io::{ReadError, ReadOptions, RowBatch, Rows, Stamps, all_apart, grid, rate_to_last_row_hz};
use std::path::Path;

/// Rows from which the rate is first estimated.
const FIRST_ROWS: usize = 1001;
/// Largest distance of a stamp from its place, in sample periods.
const MAX_OFFSET_PERIODS: f64 = 0.25;

/// Evenly spaced samples in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleClock {
    /// Left edge of the first sample, s.
    pub start_s: f64,
    /// Samples per second.
    pub rate_hz: f64,
    /// How many there are; `None` where the file does not say before it is read.
    pub samples: Option<u64>,
}

impl SampleClock {
    /// Position of a time in samples, fractional.
    pub fn position(&self, time_s: f64) -> f64 {
        (time_s - self.start_s) * self.rate_hz
    }

    /// Left edge of a sample, s.
    pub fn time_s(&self, position: f64) -> f64 {
        self.start_s + position / self.rate_hz
    }

    /// Refuses stamps that are not in their places; `first` is the row of the first of them, from 0.
    pub(crate) fn check(&self, path: &Path, stamps: &Stamps, first: u64) -> Result<(), ReadError> {
        if let Stamps::Nanoseconds(times) = stamps
            && let [a, b, ..] = times[..]
        {
            // Equal steps and both ends in place: so is all between.
            if all_apart(times, b.wrapping_sub(a))
                && self.off(stamps, 0, first).abs() <= MAX_OFFSET_PERIODS
                && self.off(stamps, times.len() - 1, first).abs() <= MAX_OFFSET_PERIODS
            {
                return Ok(());
            }
        }
        match (0..stamps.len())
            .map(|row| (row, self.off(stamps, row, first)))
            .find(|(_, off)| off.is_nan() || off.abs() > MAX_OFFSET_PERIODS)
        {
            Some((row, off_periods)) => Err(ReadError::Uneven {
                path: path.to_owned(),
                row: first + row as u64 + 1,
                time_s: stamps.time_s(row),
                off_periods,
                rate_hz: self.rate_hz,
            }),
            None => Ok(()),
        }
    }

    fn off(&self, stamps: &Stamps, row: usize, first: u64) -> f64 {
        self.position(stamps.time_s(row)) - (first + row as u64) as f64
    }
}

/// Start, rate and number of a file's samples, from its description, its first rows and its last one.
///
/// # Errors
/// [`ReadError`] if it cannot be read or its first rows are not even.
pub fn clock(path: &Path, options: &ReadOptions) -> Result<SampleClock, ReadError> {
    let mut rows = Rows::open(path, options)?;
    let samples = rows.count();
    let mut batch = RowBatch::default();
    if rows.next(FIRST_ROWS, &mut batch)? == 0 {
        return Err(ReadError::Empty { path: path.to_owned() });
    }
    let stated = rows.description.rate_hz.is_some();
    let first = grid(path, &batch.stamps, &rows.description)?;
    let mut clock = SampleClock { start_s: first.start_s, rate_hz: first.rate_hz, samples };
    let Some(last) = samples.filter(|&n| !stated && n > FIRST_ROWS as u64).map(|n| n - 1) else {
        return Ok(clock);
    };
    let first_rows = std::mem::take(&mut batch);
    let mut rows = Rows::open(path, options)?;
    rows.skip(last)?;
    if rows.next(1, &mut batch)? == 1 {
        let span_s = batch.stamps.time_s(0) - first_rows.stamps.time_s(0);
        clock.rate_hz = rate_to_last_row_hz(&first_rows.stamps, clock.rate_hz, last, span_s);
    }
    Ok(clock)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::parquet;
    use crate::trace::{Metadata, Trace};

    /// The clock of a file of some rows of which some are lost.
    fn clock_of(
        samples: usize,
        rate_hz: f64,
        lost: Option<core::ops::Range<usize>>,
    ) -> (SampleClock, Result<(), ReadError>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        let trace =
            Trace::new(vec![1.0; samples], vec![1.0; samples], rate_hz, 0.0, Metadata::default()).unwrap();
        // Without a description, which would state the rate.
        let rows = trace.without(lost);
        let json = parquet::bare(&rows, &path);
        json.unwrap();
        let clock = clock(&path, &ReadOptions::default()).unwrap();
        let mut rows = Rows::open(&path, &ReadOptions::default()).unwrap();
        let mut batch = RowBatch::default();
        rows.next(samples, &mut batch).unwrap();
        (clock, clock.check(&path, &batch.stamps, 0))
    }

    #[test]
    fn a_rate_that_nanoseconds_round_is_that_of_the_whole_but_a_gap_changes_none() {
        for rate_hz in [44_117.65, 1e6 / 3.0, 3e5 / 7.0] {
            let (clock, even) = clock_of(30_000, rate_hz, None);
            assert!((clock.rate_hz / rate_hz - 1.0).abs() < 0.05 / 3e4 && even.is_ok(), "{clock:?} {even:?}");
        }
        for lost in [5000..5001, 5000..5100, 20_000..29_000] {
            let (clock, result) = clock_of(30_000, 1e4, Some(lost.clone()));
            assert_eq!(clock.rate_hz, 1e4);
            let message = result.unwrap_err().to_string();
            let says = format!("row {}: time", lost.start + 1);
            assert!(message.contains(&says), "{message}");
        }
    }
}
