//! From time stamps to a start and a rate, or to the row where they are not even.

use super::ReadError;
use super::header::Header;
use std::path::Path;

/// How far a stamp may be off its place, in sample periods: rounded stamps are, by less.
const OFF: f64 = 0.25;
/// A rate is rounded only if that moves the last sample by less than this share of a period.
const SNAP: f64 = 0.05;
/// From how many steps the period is first guessed.
const GUESS_FROM: usize = 1001;

/// Time stamps as a file has them.
#[derive(Clone, Debug)]
pub(crate) enum Stamps {
    Nanoseconds(Vec<i64>),
    Seconds(Vec<f64>),
    /// No column of times; the description must state the rate.
    Absent,
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

    /// How finely the stamps tell time, s. Of seconds in a text it is not known; [`SNAP`] limits them.
    fn resolution_s(&self) -> f64 {
        if matches!(self, Self::Nanoseconds(_)) { 1.5e-9 } else { f64::INFINITY }
    }

    pub(crate) fn time_s(&self, row: usize) -> f64 {
        match self {
            Self::Nanoseconds(times) => times[row] as f64 / 1e9,
            Self::Seconds(times) => times[row],
            Self::Absent => 0.0,
        }
    }

    /// Seconds since an earlier row; nanoseconds are subtracted as integers, so a large start costs no precision.
    pub(crate) fn since_s(&self, row: usize, earlier: usize) -> f64 {
        match self {
            Self::Nanoseconds(times) => (i128::from(times[row]) - i128::from(times[earlier])) as f64 / 1e9,
            Self::Seconds(times) => times[row] - times[earlier],
            Self::Absent => 0.0,
        }
    }
}

/// The grid all stamps lie on.
pub(crate) fn grid(path: &Path, stamps: &Stamps, header: &Header) -> Result<Grid, ReadError> {
    if stamps.len() == 0 {
        let rate_hz = header.rate_hz.ok_or(ReadError::NoRate { path: path.to_owned() })?;
        return Ok(Grid { start_s: header.start_s.unwrap_or(0.0), rate_hz });
    }
    check_order(path, stamps)?;
    let rate_hz = match (header.rate_hz, stamps.len()) {
        (Some(rate_hz), _) => rate_hz,
        (None, 1) => return Err(ReadError::NoRate { path: path.to_owned() }),
        (None, _) => fitted_rate_hz(path, stamps)?,
    };
    for row in 1..stamps.len() {
        let off_periods = stamps.since_s(row, 0) * rate_hz - row as f64;
        if off_periods.abs() > OFF {
            return Err(uneven(path, stamps, row, off_periods, rate_hz));
        }
    }
    let first_s = stamps.time_s(0);
    // The stated start is exact where the first stamp was rounded; if it is another time, the file was edited.
    let stated = header.start_s.filter(|start_s| (start_s - first_s).abs() * rate_hz <= OFF);
    Ok(Grid { start_s: stated.unwrap_or(first_s), rate_hz })
}

fn check_order(path: &Path, stamps: &Stamps) -> Result<(), ReadError> {
    for row in 0..stamps.len() {
        let time_s = stamps.time_s(row);
        if !time_s.is_finite() {
            let value = time_s.to_string();
            return Err(ReadError::Value {
                path: path.to_owned(),
                row: row as u64 + 1,
                column: "time_s".to_owned(),
                value,
            });
        }
        if row > 0 && stamps.since_s(row, row - 1) <= 0.0 {
            let before_s = stamps.time_s(row - 1);
            return Err(ReadError::Unsorted { path: path.to_owned(), row: row as u64 + 1, time_s, before_s });
        }
    }
    Ok(())
}

fn fitted_rate_hz(path: &Path, stamps: &Stamps) -> Result<f64, ReadError> {
    let mut steps: Vec<f64> =
        (1..stamps.len().min(GUESS_FROM + 1)).map(|row| stamps.since_s(row, row - 1)).collect();
    let middle = steps.len() / 2;
    let guess_s = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    for row in 1..stamps.len() {
        let off_periods = stamps.since_s(row, row - 1) / guess_s - 1.0;
        if off_periods.abs() > 0.5 {
            return Err(uneven(path, stamps, row, off_periods, 1.0 / guess_s));
        }
    }
    let periods = (stamps.len() - 1) as f64;
    let span_s = stamps.since_s(stamps.len() - 1, 0);
    Ok(rounded_rate_hz(periods, span_s, stamps.resolution_s()))
}

/// The roundest rate (the one with most zeros) that moves the last sample by no more than the stamps can tell.
pub(crate) fn rounded_rate_hz(periods: f64, span_s: f64, resolution_s: f64) -> f64 {
    let rate_hz = periods / span_s;
    let tolerance = f64::min(SNAP, resolution_s * rate_hz);
    let round_to = |unit_hz: f64| libm::round(rate_hz / unit_hz) * unit_hz;
    let snaps = |candidate: &f64| *candidate > 0.0 && (span_s * candidate - periods).abs() <= tolerance;
    [1e6, 1e5, 1e4, 1e3, 100.0, 10.0, 1.0].map(round_to).into_iter().find(snaps).unwrap_or(rate_hz)
}

fn uneven(path: &Path, stamps: &Stamps, row: usize, off_periods: f64, rate_hz: f64) -> ReadError {
    ReadError::Uneven {
        path: path.to_owned(),
        row: row as u64 + 1,
        time_s: stamps.time_s(row),
        off_periods,
        rate_hz,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fit(stamps: Stamps) -> Result<Grid, ReadError> {
        grid(Path::new("t.csv"), &stamps, &Header::default())
    }

    #[test]
    fn rates_come_out_whole_from_rounded_stamps() {
        let nanoseconds = |rate: f64| {
            Stamps::Nanoseconds((0..5000).map(|i| (f64::from(i) * 1e9 / rate).round() as i64).collect())
        };
        assert_eq!(fit(nanoseconds(50e3)).unwrap().rate_hz, 50e3);
        assert_eq!(fit(nanoseconds(3e6)).unwrap().rate_hz, 3e6);
        let microseconds =
            Stamps::Seconds((0..5000).map(|i| (f64::from(i) * 1e6 / 44_100.0).round() / 1e6).collect());
        assert_eq!(fit(microseconds).unwrap().rate_hz, 44_100.0);
        let slow = fit(Stamps::Seconds((0..9).map(|i| 100.0 + 2.5 * f64::from(i)).collect())).unwrap();
        assert_eq!(slow, Grid { start_s: 100.0, rate_hz: 0.4 });
    }

    #[test]
    fn each_bad_stamp_is_named_with_its_row() {
        let message = |times: &[f64]| fit(Stamps::Seconds(times.to_vec())).unwrap_err().to_string();
        assert!(message(&[0.0, 1.0, 1.0]).contains("t.csv: row 3: time 1 s is not after 1 s"));
        assert!(
            message(&[0.0, 1.0, 2.0, 4.0, 5.0])
                .contains("row 4: time 4 s is 1.00 sample periods off an even rate of 1 Hz")
        );
        assert!(message(&[0.0, 1.0, 2.0, 3.4, 4.0]).contains("row 4"));
        assert!(message(&[0.0, f64::NAN]).contains("row 2: time_s is NaN"));
        assert!(message(&[0.0]).contains("sample rate is unknown"));
    }

    #[test]
    fn a_wrong_stated_rate_is_found() {
        let header = Header { rate_hz: Some(2.0), ..Header::default() };
        let error = grid(Path::new("t.csv"), &Stamps::Seconds(vec![0.0, 1.0]), &header).unwrap_err();
        assert!(error.to_string().contains("row 2") && error.to_string().contains("2 Hz"), "{error}");
    }
}
