//! When samples were taken, before all of them have been seen.

use crate::io::{Chunk, ReadError, ReadOptions, Rows, Stamps, grid};
use multiversion::multiversion;
use std::path::Path;

/// Rows from which the rate is first taken.
const FIRST_ROWS: usize = 1001;
/// How far a stamp may be off its place, in sample periods.
const OFF: f64 = 0.25;
/// A rate from the first rows is kept if it puts the last row right by this share of a period.
const SNAP: f64 = 0.05;

/// Evenly spaced samples in time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Left edge of the first sample, s.
    pub start_s: f64,
    /// Samples per second.
    pub rate_hz: f64,
    /// How many there are; `None` where the file does not say before it is read.
    pub samples: Option<u64>,
}

impl Clock {
    /// Position of a time in samples, fractional.
    pub fn position(&self, time_s: f64) -> f64 {
        (time_s - self.start_s) * self.rate_hz
    }

    /// Left edge of a sample, s.
    pub fn time_s(&self, position: f64) -> f64 {
        self.start_s + position / self.rate_hz
    }

    /// Holds stamps against their places; `first` is the row of the first of them, from 0.
    pub(super) fn check(&self, path: &Path, stamps: &Stamps, first: u64) -> Result<(), ReadError> {
        if let Stamps::Nanoseconds(times) = stamps
            && let [a, b, ..] = times[..]
        {
            // Equal steps and both ends in place: so is all between.
            if all_apart(times, b.wrapping_sub(a))
                && self.off(stamps, 0, first).abs() <= OFF
                && self.off(stamps, times.len() - 1, first).abs() <= OFF
            {
                return Ok(());
            }
        }
        match (0..stamps.len())
            .map(|row| (row, self.off(stamps, row, first)))
            .find(|(_, off)| off.is_nan() || off.abs() > OFF)
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

/// Whether each time is one step after the one before; without a way out on the way, so that many pairs are held at once.
#[multiversion(targets("x86_64+avx2"))]
fn all_apart(times: &[i64], step: i64) -> bool {
    times.iter().zip(&times[1..]).fold(0, |any, (a, b)| any | (b.wrapping_sub(*a) ^ step)) == 0
}

/// Start, rate and number of a file's samples, from its description, its first rows and its last one.
///
/// # Errors
/// [`ReadError`] if it cannot be read or its first rows are not even.
pub fn clock(path: &Path, options: &ReadOptions) -> Result<Clock, ReadError> {
    let mut rows = Rows::open(path, options)?;
    let samples = rows.count();
    let mut chunk = Chunk::default();
    if rows.next(FIRST_ROWS, &mut chunk)? == 0 {
        return Err(ReadError::Empty { path: path.to_owned() });
    }
    let stated = rows.header.rate_hz.is_some();
    let first = grid(path, &chunk.stamps, &rows.header)?;
    let mut clock = Clock { start_s: first.start_s, rate_hz: first.rate_hz, samples };
    let Some(last) = samples.filter(|&n| !stated && n > FIRST_ROWS as u64).map(|n| n - 1) else {
        return Ok(clock);
    };
    let start_s = chunk.stamps.time_s(0);
    let mut rows = Rows::open(path, options)?;
    rows.skip(last)?;
    if rows.next(1, &mut chunk)? == 1 {
        let span_s = chunk.stamps.time_s(0) - start_s;
        if (span_s * clock.rate_hz - last as f64).abs() > SNAP && span_s > 0.0 {
            clock.rate_hz = last as f64 / span_s;
        }
    }
    Ok(clock)
}
