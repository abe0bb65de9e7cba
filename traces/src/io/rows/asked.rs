//! Rates and starts that are asked for and contradict what a file says.

use super::{Chunk, Rows};
use crate::io::columns::Layout;
use crate::io::header::Header;
use crate::io::timing::rounded_rate_hz;
use crate::io::{ReadError, ReadOptions};
use std::path::Path;

/// By what share a rate that is asked for may differ from that of the file: clocks do, and JLS rounds by as much.
const RATE_OFF: f64 = 1e-3;
/// How far times may be off, in sample periods: rounded ones are, by less.
const OFF: f64 = 0.25;
/// Rows whose times are looked at.
const ROWS: usize = 1 << 12;

fn refused(path: &Path, reason: String) -> ReadError {
    ReadError::Asked { path: path.to_owned(), reason }
}

/// Refuses a rate and a start that contradict columns or description.
pub(super) fn check(
    path: &Path,
    layout: &Layout,
    header: &Header,
    options: &ReadOptions,
) -> Result<(), ReadError> {
    if let Some((start_s, column)) = options.start_s.zip(layout.time.as_ref()) {
        let reason = format!(
            "a start at {start_s} s was asked for, but column {} has the times: leave --start out",
            column.name
        );
        return Err(refused(path, reason));
    }
    if let Some((asked_hz, stated_hz)) = options.rate_hz.zip(header.rate_hz)
        && (asked_hz / stated_hz - 1.0).abs() > RATE_OFF
    {
        let reason = format!(
            "a rate of {asked_hz} Hz was asked for, but it or its description says {stated_hz} Hz: leave --rate out, or mend \
             rate_hz there"
        );
        return Err(refused(path, reason));
    }
    let rate_hz = header.rate_hz.or(options.rate_hz).unwrap_or(f64::INFINITY);
    if let Some((asked_s, stated_s)) = options.start_s.zip(header.start_s)
        && (asked_s - stated_s).abs() * rate_hz > OFF
    {
        let reason = format!(
            "a start at {asked_s} s was asked for, but it or its description says {stated_s} s: leave --start out, or mend \
             start_s there"
        );
        return Err(refused(path, reason));
    }
    Ok(())
}

/// Refuses a rate that contradicts the times of the first rows: samples would be made up or left out to keep it.
pub(super) fn check_times(rows: &Rows, options: &ReadOptions) -> Result<(), ReadError> {
    let (Some(asked_hz), Some(column)) = (options.rate_hz, &rows.layout.time) else { return Ok(()) };
    let mut again = Rows::of_kind(&rows.path, &ReadOptions { rate_hz: None, ..options.clone() })?;
    let mut chunk = Chunk::default();
    again.next(ROWS, &mut chunk)?;
    let stamps = &chunk.stamps;
    let times = (0..stamps.len()).map(|row| stamps.time_s(row)).filter(|time_s| time_s.is_finite());
    let mut times: Vec<f64> = times.collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    if times.len() < 2 {
        return Ok(());
    }
    let rate_hz = mean_rate_hz(&times);
    let off = (asked_hz / rate_hz - 1.0).abs();
    if off > RATE_OFF && off * times.len() as f64 > OFF {
        let reason = format!(
            "a rate of {asked_hz} Hz was asked for, but by column {} it is {rate_hz} Hz: leave --rate out",
            column.name
        );
        return Err(refused(&rows.path, reason));
    }
    Ok(())
}

/// The rate by all steps that are no gaps: where stamps are rounded, these differ, and their mean does not.
fn mean_rate_hz(times: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let middle = steps.len() / 2;
    let usual_s = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    let single = || steps.iter().filter(|step_s| **step_s < 1.6 * usual_s);
    rounded_rate_hz(single().count() as f64, single().sum(), f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coarse_stamps_with_gaps_have_their_rate() {
        let stamps = (0..4000_u32).filter(|row| row % 1000 != 500);
        let times: Vec<f64> = stamps.map(|row| libm::round(f64::from(row) * 2.2) / 1000.0).collect();
        assert!((mean_rate_hz(&times) * 0.0022 - 1.0).abs() < RATE_OFF, "{}", mean_rate_hz(&times));
    }
}
