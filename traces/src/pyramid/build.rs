//! Building the lowest level, block by block as a file is read.

use super::{BLOCK, Entry, Pyramid};
use crate::io::{ReadError, ReadOptions, RowBatch, Rows, Stamps, rate_of_steps_hz};
use crate::stream::clock;
use std::path::Path;

/// Rows read at once.
const PIECE_ROWS: usize = 1 << 20;
/// Largest difference between a step of two stamps and a period, in periods.
const MAX_STEP_OFFSET: f64 = 0.5;

pub(super) fn of_file(path: &Path, options: &ReadOptions) -> Result<Pyramid, ReadError> {
    let mut clock = clock(path, options)?;
    let mut rows = Rows::open(path, options)?;
    // Texts do not say how many rows they have: the rate is then that of the first rows until all are read.
    let mut steps = (clock.samples.is_none() && rows.description.rate_hz.is_none()).then(Steps::default);
    let mut batch = RowBatch::default();
    let (mut voltage_v, mut current_a) = (Vec::new(), Vec::new());
    let (mut base, mut samples) = (Vec::new(), 0);
    loop {
        let read = rows.append(PIECE_ROWS, &mut batch, &mut voltage_v, &mut current_a)? as u64;
        match &mut steps {
            Some(steps) => steps.check(path, &batch.stamps, samples, clock.rate_hz)?,
            None => clock.check(path, &batch.stamps, samples)?,
        }
        rows.check_finite(&voltage_v, &current_a, base.len() as u64 * BLOCK)?;
        samples += read;
        let whole =
            if read == 0 { voltage_v.len() } else { voltage_v.len() / BLOCK as usize * BLOCK as usize };
        base.extend(blocks(&voltage_v[..whole], &current_a[..whole]));
        voltage_v.drain(..whole);
        current_a.drain(..whole);
        if read == 0 {
            break;
        }
    }
    rows.description.check_rows(path, samples)?;
    rows.description.check_end(path)?;
    clock.rate_hz = steps.and_then(|steps| steps.rate_hz(samples)).unwrap_or(clock.rate_hz);
    Ok(Pyramid::of_blocks(clock, samples, base))
}

pub(super) fn blocks<'a>(
    voltage_v: &'a [f32],
    current_a: &'a [f32],
) -> impl Iterator<Item = Entry> + use<'a> {
    let both = voltage_v.chunks(BLOCK as usize).zip(current_a.chunks(BLOCK as usize));
    both.map(|(v, i)| Entry::of_samples(v, i))
}

/// Stamps, each compared with the one before.
#[derive(Default)]
struct Steps {
    first_s: Option<f64>,
    before_s: f64,
}

impl Steps {
    fn check(&mut self, path: &Path, stamps: &Stamps, first: u64, rate_hz: f64) -> Result<(), ReadError> {
        for at in 0..stamps.len() {
            let (time_s, before_s, row) = (stamps.time_s(at), self.before_s, first + at as u64 + 1);
            let path = || path.to_owned();
            if self.first_s.is_none() {
                self.first_s = Some(time_s);
            } else if time_s.is_nan() || time_s <= before_s {
                return Err(ReadError::Unsorted { path: path(), row, time_s, before_s });
            } else {
                let off_periods = (time_s - before_s) * rate_hz - 1.0;
                if off_periods.abs() > MAX_STEP_OFFSET {
                    return Err(ReadError::Uneven { path: path(), row, time_s, off_periods, rate_hz });
                }
            }
            self.before_s = time_s;
        }
        Ok(())
    }

    /// The rate of all stamps.
    fn rate_hz(&self, samples: u64) -> Option<f64> {
        let (first_s, periods) = (self.first_s?, samples.checked_sub(1)? as f64);
        (periods > 0.0).then(|| rate_of_steps_hz(periods, self.before_s - first_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::write;

    fn text(rows: impl Iterator<Item = (f64, f32)>) -> String {
        rows.fold("time_s,voltage_V,current_A\n".to_owned(), |text, (time_s, amps)| {
            text + &format!("{time_s},2,{amps}\n")
        })
    }

    #[test]
    fn unusable_values_are_named_with_their_row_and_repaired_on_request() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        let (plain, repair) =
            (ReadOptions::default(), ReadOptions { repair: true, ..ReadOptions::default() });
        let even = |row: u32| f64::from(row) / 1000.0;
        for (at, says) in [
            (
                |row: u32| f64::from(if row < 1500 { row } else { row + 20 }) / 1000.0,
                "row 1501: time 1.52 s is 20.00",
            ),
            (
                |row: u32| f64::from(if row < 1500 { row } else { row - 20 }) / 1000.0,
                "row 1501: time 1.48 s is not after",
            ),
        ] as [(fn(u32) -> f64, &str); 2]
        {
            write(&path, text((0..3000).map(|row| (at(row), 1.0)))).unwrap();
            let message = Pyramid::build(&path, &plain).unwrap_err().to_string();
            assert!(message.contains(says), "{message}");
            let (built, trace) =
                (Pyramid::build(&path, &repair).unwrap(), crate::io::read(&path, &repair).unwrap().trace);
            assert_eq!((built.start_s(), built.end_s()), (trace.start_s(), trace.end_s()));
        }
        write(&path, text((0..3000).map(|row| (even(row), 1.0)))).unwrap();
        assert_eq!(Pyramid::build(&path, &plain).unwrap().end_s(), 3.0);
    }

    #[test]
    fn stamps_rounded_to_microseconds_give_the_rate_of_the_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        let time = |row: u32| (f64::from(row) * 1e6 / 44_117.65).round() / 1e6;
        write(&path, text((0..20_000).map(|row| (time(row), 1.0)))).unwrap();
        let options = ReadOptions::default();
        let (built, trace) =
            (Pyramid::build(&path, &options).unwrap(), crate::io::read(&path, &options).unwrap().trace);
        assert_eq!(built.end_s(), trace.end_s());
    }

    #[test]
    fn values_of_a_table_that_are_not_finite_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        let trace =
            crate::trace::Trace::new(vec![1.0; 3000], vec![1.0; 3000], 1000.0, 0.0, Default::default())
                .unwrap();
        crate::io::parquet::save(&trace, &path).unwrap();
        let nan = ReadOptions { fixed_voltage_v: Some(f64::NAN), ..ReadOptions::default() };
        let message = Pyramid::build(&path, &nan).unwrap_err().to_string();
        assert!(message.contains("row 1: voltage_V is NaN"), "{message}");
    }
}
