//! Repair of input, if requested: sort rows, fill gaps and non-finite values. Every repair is reported.

use super::ReadError;
use super::samples::Description;
use super::time_base::{Stamps, usual_rate_hz};
use serde::Serialize;
use std::ops::Range;
use std::path::Path;

/// Largest distance of a stamp from its place in the time base, in sample periods.
const MAX_OFFSET_PERIODS: f64 = 0.25;
/// Largest factor by which a repair may lengthen a trace.
const MAX_GROWTH: usize = 16;

/// All rows of a file, as they are in it.
pub(super) struct Columns {
    pub stamps: Stamps,
    pub voltage_v: Vec<f32>,
    pub current_a: Vec<f32>,
}

/// Kind of a repair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RepairKind {
    /// Signals that do not begin and end together were cut to what all have.
    CutSignals,
    /// Surplus fields of rows were dropped.
    UnevenRows,
    /// Rows without a time of their own were dropped.
    DroppedRows,
    /// Rows were sorted by time.
    SortedRows,
    /// Values that are not finite were filled from their neighbours.
    FilledValues,
    /// Missing samples were filled in.
    FilledGap,
    /// Rows off an even rate were resampled.
    Resampled,
}

/// A repair.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Repair {
    /// Kind of the repair.
    pub code: RepairKind,
    /// The first row (from 1, as in the file; after sorting, in the sorted order).
    pub row: u64,
    /// When, s; by rate and start where the file has no times.
    pub time_s: f64,
    /// How many rows or samples.
    pub count: u64,
    /// For people.
    pub message: String,
}

/// Repairs rows in place: drops those without a time, sorts them, fills non-finite values from their
/// neighbours, and adds missing samples.
pub(super) fn repair_rows(
    path: &Path,
    names: &[String; 2],
    columns: &mut Columns,
    description: &mut Description,
) -> Result<Vec<Repair>, ReadError> {
    let mut repairs = Vec::new();
    let times = seconds(&columns.stamps);
    let mut times = times.map(|times| order(times, columns, &mut repairs));
    let time_s = |row: usize| times.as_ref().map_or_else(|| description.time_s(row), |times| times[row]);
    let gaps = [(&names[0], &mut columns.voltage_v), (&names[1], &mut columns.current_a)]
        .map(|(name, values)| fill(path, name, values));
    let [voltage, current] = gaps;
    repairs.extend(filled(names, [voltage?, current?], time_s));
    if let Some(times) = &mut times
        && times.len() > 1
    {
        let grid = Grid::new(times, description);
        if !grid.holds(times) {
            repairs.extend(Resampling { path, grid: &grid, times, columns }.run()?);
            description.rate_hz = Some(grid.rate_hz);
        }
    }
    lengthen(path, columns, times.as_mut(), description, &mut repairs)?;
    if !repairs.is_empty() {
        description.samples = None;
        if let Some(times) = times {
            columns.stamps = Stamps::Seconds(times);
        }
    }
    Ok(repairs)
}

fn seconds(stamps: &Stamps) -> Option<Vec<f64>> {
    (stamps.len() > 0).then(|| (0..stamps.len()).map(|row| stamps.time_s(row)).collect())
}

/// Drops rows without a time or with one that was there before, and sorts the rest.
fn order(times: Vec<f64>, columns: &mut Columns, repairs: &mut Vec<Repair>) -> Vec<f64> {
    let mut rows: Vec<usize> = (0..times.len()).filter(|&row| times[row].is_finite()).collect();
    let unsorted = rows.windows(2).position(|pair| times[pair[1]] < times[pair[0]]).map(|at| rows[at + 1]);
    rows.sort_by(|&a, &b| times[a].total_cmp(&times[b]));
    let mut repeats = Vec::new();
    rows.dedup_by(|later, earlier| {
        let repeated = times[*later] == times[*earlier];
        repeats.extend(repeated.then_some(*later));
        repeated
    });
    let dropped = dropped(&times, &repeats);
    if let Some(row) = unsorted {
        let message = format!("rows were sorted by time; row {} was the first out of order", row + 1);
        let count = rows.len() as u64;
        repairs.push(Repair {
            code: RepairKind::SortedRows,
            row: row as u64 + 1,
            time_s: times[row],
            count,
            message,
        });
    }
    if dropped.is_some() || unsorted.is_some() {
        columns.voltage_v = rows.iter().map(|&row| columns.voltage_v[row]).collect();
        columns.current_a = rows.iter().map(|&row| columns.current_a[row]).collect();
    }
    repairs.splice(0..0, dropped);
    rows.iter().map(|&row| times[row]).collect()
}

/// Reports rows without a time and those that repeat one. The place is the first of them; where it has no
/// time, that of the last row before which has one, else of the first after.
fn dropped(times: &[f64], repeats: &[usize]) -> Option<Repair> {
    let count = times.iter().filter(|time| !time.is_finite()).count() + repeats.len();
    let lost = times.iter().position(|time| !time.is_finite());
    let row = lost.into_iter().chain(repeats.iter().copied()).min()?;
    let finite = |time: &&f64| time.is_finite();
    let near = times[..=row].iter().rfind(finite).or_else(|| times[row..].iter().find(finite));
    let (time_s, row) = (near.copied().unwrap_or(0.0), row as u64 + 1);
    let message = format!(
        "{count} rows without a time of their own were dropped ({} repeats), the first of them row {row} (about {time_s} s)",
        repeats.len()
    );
    Some(Repair { code: RepairKind::DroppedRows, row, time_s, count: count as u64, message })
}

/// Replaces non-finite values by the straight line between their neighbours. Returns the ranges of rows.
fn fill(path: &Path, name: &str, values: &mut [f32]) -> Result<Vec<Range<usize>>, ReadError> {
    let mut gaps: Vec<Range<usize>> = Vec::new();
    let mut from = 0;
    while let Some(first) = values[from..].iter().position(|value| !value.is_finite()).map(|at| from + at) {
        let end =
            values[first..].iter().position(|value| value.is_finite()).map_or(values.len(), |at| first + at);
        let (before, after) = (first.checked_sub(1).map(|at| values[at]), values.get(end).copied());
        let Some((before, after)) = before.or(after).zip(after.or(before)) else {
            return Err(ReadError::Repair {
                path: path.to_owned(),
                reason: format!("{name} has no finite value"),
            });
        };
        for (at, value) in values[first..end].iter_mut().enumerate() {
            let share = (at + 1) as f32 / (end + 1 - first) as f32;
            *value = before + share * (after - before);
        }
        gaps.push(first..end);
        from = end;
    }
    Ok(gaps)
}

/// Reports filled ranges, in order of rows; one that both columns have in common once.
fn filled(names: &[String; 2], gaps: [Vec<Range<usize>>; 2], time_s: impl Fn(usize) -> f64) -> Vec<Repair> {
    let [voltage, current] = gaps;
    let alone = current.iter().filter(|gap| !voltage.contains(gap)).map(|gap| (names[1].clone(), gap));
    let first = voltage.iter().map(|gap| match current.contains(gap) && names[0] != names[1] {
        true => (names.join(" and "), gap),
        false => (names[0].clone(), gap),
    });
    let mut all: Vec<(String, &Range<usize>)> = first.chain(alone).collect();
    all.sort_by_key(|(_, gap)| gap.start);
    let report = |(name, gap): (String, &Range<usize>)| {
        let (time_s, row, count) = (time_s(gap.start), gap.start as u64 + 1, gap.len() as u64);
        let values = if count == 1 { "value" } else { "values" };
        let message = format!("{name}: {count} {values} from row {row} ({time_s} s) on not finite");
        Repair { code: RepairKind::FilledValues, row, time_s, count, message }
    };
    all.into_iter().map(report).collect()
}

/// An even time base.
struct Grid {
    start_s: f64,
    rate_hz: f64,
}

impl Grid {
    fn new(times: &[f64], description: &Description) -> Self {
        Self { start_s: times[0], rate_hz: description.rate_hz.unwrap_or_else(|| usual_rate_hz(times)) }
    }

    /// The place of a time, in samples from the start.
    fn place(&self, time_s: f64) -> f64 {
        (time_s - self.start_s) * self.rate_hz
    }

    /// Rows that do not keep their values: too far from every place, or farther from theirs than another row.
    fn rows_off(&self, times: &[f64]) -> Vec<usize> {
        let nearest = |row: usize| libm::round(self.place(times[row]));
        let distance = |row: usize| (self.place(times[row]) - nearest(row)).abs();
        // Of two at the same distance the earlier one stays.
        let loses_to = |row: usize, other: usize| {
            let order = distance(other).total_cmp(&distance(row)).then(other.cmp(&row));
            nearest(row) == nearest(other) && order.is_lt()
        };
        let is_off = |&row: &usize| {
            distance(row) > MAX_OFFSET_PERIODS
                || row > 0 && loses_to(row, row - 1)
                || row + 1 < times.len() && loses_to(row, row + 1)
        };
        (0..times.len()).filter(is_off).collect()
    }

    /// Whether the rows are on it, one after the other.
    fn holds(&self, times: &[f64]) -> bool {
        let on = |(row, &time): (usize, &f64)| (self.place(time) - row as f64).abs() <= MAX_OFFSET_PERIODS;
        times.iter().enumerate().all(on)
    }
}

/// Rows that are resampled to an even time base, by straight lines between rows.
struct Resampling<'a> {
    /// The file, for errors.
    path: &'a Path,
    grid: &'a Grid,
    /// Times of the rows, s, in order; at least two.
    times: &'a mut Vec<f64>,
    columns: &'a mut Columns,
}

impl Resampling<'_> {
    /// Replaces times and columns.
    fn run(self) -> Result<Vec<Repair>, ReadError> {
        let Self { path, grid, times, columns } = self;
        let rate_hz = grid.rate_hz;
        let slots = libm::round(grid.place(times[times.len() - 1])) + 1.0;
        if !(slots >= 1.0 && slots <= (MAX_GROWTH * times.len()) as f64) {
            let rows = times.len();
            let reason =
                format!("filling it evenly at {rate_hz} Hz would take {slots:.0} samples for {rows} rows");
            return Err(ReadError::Repair { path: path.to_owned(), reason });
        }
        let mut repairs: Vec<Repair> = resampled(grid, times).into_iter().collect();
        repairs.extend(filled_gaps(grid, times));
        let places: Vec<f64> = (0..slots as usize).map(|slot| grid.start_s + slot as f64 / rate_hz).collect();
        for values in [&mut columns.voltage_v, &mut columns.current_a] {
            *values = interpolated(times, values, &places, MAX_OFFSET_PERIODS / rate_hz);
        }
        *times = places;
        Ok(repairs)
    }
}

/// Reports rows off the time base.
fn resampled(grid: &Grid, times: &[f64]) -> Option<Repair> {
    let off = grid.rows_off(times);
    let (&first, count) = (off.first()?, off.len());
    let rows = if count == 1 { "row" } else { "rows" };
    let row = first as u64 + 1;
    let message = format!("{count} {rows} off an even rate of {} Hz, from row {row} on", grid.rate_hz);
    Some(Repair { code: RepairKind::Resampled, row, time_s: times[first], count: count as u64, message })
}

/// Reports missing samples.
fn filled_gaps(grid: &Grid, times: &[f64]) -> Vec<Repair> {
    let gap = |(row, pair): (usize, &[f64])| {
        let missing = libm::round(grid.place(pair[1])) - libm::round(grid.place(pair[0])) - 1.0;
        let (row, time_s, count) = (row as u64 + 1, pair[0], missing.max(0.0) as u64);
        let message = missing_after(&format!("row {row}"), time_s, count);
        (count > 0).then_some(Repair { code: RepairKind::FilledGap, row, time_s, count, message })
    };
    times.windows(2).enumerate().filter_map(gap).collect()
}

fn missing_after(row: &str, time_s: f64, count: u64) -> String {
    let samples = if count == 1 { "sample" } else { "samples" };
    format!("{count} {samples} missing after {row} ({time_s} s)")
}

/// Repeats the last sample where the recorder lost the end.
fn lengthen(
    path: &Path,
    columns: &mut Columns,
    times: Option<&mut Vec<f64>>,
    description: &Description,
    repairs: &mut Vec<Repair>,
) -> Result<(), ReadError> {
    let rows = columns.voltage_v.len();
    let Some(lost) = description.lost_at_end.filter(|lost| *lost > 0 && rows > 0) else { return Ok(()) };
    let longer = usize::try_from(lost).ok().map(|lost| rows.saturating_add(lost));
    let Some(longer) = longer.filter(|longer| *longer <= MAX_GROWTH.saturating_mul(rows)) else {
        let reason = format!("{lost} samples are said to be lost after {rows} rows");
        return Err(ReadError::Repair { path: path.to_owned(), reason });
    };
    let time_s = match times {
        Some(times) => {
            let (last_s, rate_hz) =
                (times[rows - 1], description.rate_hz.unwrap_or_else(|| usual_rate_hz(times)));
            times.extend((1..=lost).map(|after| last_s + after as f64 / rate_hz));
            last_s
        }
        None => description.time_s(rows - 1),
    };
    for values in [&mut columns.voltage_v, &mut columns.current_a] {
        values.resize(longer, values[rows - 1]);
    }
    let message = missing_after("the last row", time_s, lost);
    repairs.push(Repair { code: RepairKind::FilledGap, row: rows as u64, time_s, count: lost, message });
    Ok(())
}

/// Values at the grid's times: those of the nearest row within `near_s`, else on the line between the rows around.
fn interpolated(times: &[f64], values: &[f32], grid: &[f64], near_s: f64) -> Vec<f32> {
    let mut row = 0;
    let at = |time: &f64| {
        while row + 1 < times.len() && times[row + 1] <= *time + near_s {
            row += 1;
        }
        let distance_s = |row: usize| (times[row] - time).abs();
        let nearest = if row > 0 && distance_s(row - 1) <= distance_s(row) { row - 1 } else { row };
        if distance_s(nearest) <= near_s || row + 1 >= times.len() {
            return values[nearest];
        }
        let share = (time - times[row]) / (times[row + 1] - times[row]);
        (f64::from(values[row]) + share * (f64::from(values[row + 1]) - f64::from(values[row]))) as f32
    };
    grid.iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stamps in whole microseconds at 44.1 kHz, without some of them.
    fn rounded(lost: Range<u32>) -> Vec<f64> {
        (0..20_000)
            .filter(|row| !lost.contains(row))
            .map(|row| libm::round(f64::from(row) * 1e6 / 44_100.0) / 1e6)
            .collect()
    }

    fn names() -> [String; 2] {
        ["voltage_V", "current_A"].map(str::to_owned)
    }

    fn repaired(times: Vec<f64>, spoilt: usize) -> (Vec<Repair>, Columns, Description) {
        let mut current_a: Vec<f32> = (0..times.len()).map(|row| row as f32).collect();
        current_a[spoilt] = f32::NAN;
        let mut columns =
            Columns { voltage_v: vec![1.0; times.len()], current_a, stamps: Stamps::Seconds(times) };
        let mut description = Description::default();
        let repairs = repair_rows(Path::new("t.csv"), &names(), &mut columns, &mut description).unwrap();
        (repairs, columns, description)
    }

    #[test]
    fn rounded_stamps_of_an_even_rate_stay_as_they_are() {
        let (repairs, columns, _) = repaired(rounded(0..0), 777);
        assert_eq!(repairs.iter().map(|repair| repair.code).collect::<Vec<_>>(), [RepairKind::FilledValues]);
        assert!(columns.current_a.iter().enumerate().all(|(row, amps)| *amps == row as f32));
    }

    #[test]
    fn a_gap_in_rounded_stamps_is_filled_with_as_many_as_are_missing() {
        let (repairs, columns, description) = repaired(rounded(5000..5100), 3);
        assert_eq!(description.rate_hz, Some(44_100.0));
        let gaps: Vec<_> = repairs.iter().map(|repair| (repair.code, repair.row, repair.count)).collect();
        assert_eq!(gaps, [(RepairKind::FilledValues, 4, 1), (RepairKind::FilledGap, 5000, 100)]);
        assert_eq!((columns.current_a.len(), columns.current_a[19_999]), (20_000, 19_899.0));
    }

    /// A row between two others, near one of them, has no place of its own at a stated rate.
    #[test]
    fn a_surplus_row_near_another_is_reported_and_leaves_as_many_times_as_values() {
        let mut times: Vec<f64> = (0..200).map(f64::from).collect();
        times.insert(101, 100.2);
        let mut columns = Columns {
            voltage_v: vec![1.0; 201],
            current_a: (0..201_u16).map(f32::from).collect(),
            stamps: Stamps::Seconds(times),
        };
        let mut description = Description { rate_hz: Some(1.0), ..Description::default() };
        let repairs = repair_rows(Path::new("t.csv"), &names(), &mut columns, &mut description).unwrap();
        let found: Vec<_> = repairs.iter().map(|repair| (repair.code, repair.row, repair.count)).collect();
        assert_eq!(found, [(RepairKind::Resampled, 102, 1)]);
        assert_eq!((columns.current_a.len(), columns.stamps.len()), (200, 200));
        assert_eq!((columns.current_a[100], columns.current_a[101]), (100.0, 102.0));
    }

    #[test]
    fn values_that_both_columns_lack_are_reported_once() {
        let lost = |row: usize| if (2..5).contains(&row) { f32::NAN } else { 1.0 };
        let mut columns = Columns {
            voltage_v: (0..9).map(lost).collect(),
            current_a: (0..9).map(|row| if row == 7 { f32::NAN } else { lost(row) }).collect(),
            stamps: Stamps::Absent,
        };
        let mut description = Description { rate_hz: Some(10.0), ..Description::default() };
        let repairs = repair_rows(Path::new("t.jls"), &names(), &mut columns, &mut description).unwrap();
        let messages: Vec<&str> = repairs.iter().map(|repair| repair.message.as_str()).collect();
        assert_eq!(
            messages,
            [
                "voltage_V and current_A: 3 values from row 3 (0.2 s) on not finite",
                "current_A: 1 value from row 8 (0.7 s) on not finite"
            ]
        );
    }
}
