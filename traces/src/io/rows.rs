//! Rows of a file of any format, in pieces, so that no file has to fit into memory; and rails among their
//! columns that are the sum of others and would count twice.

use super::columns::{Layout, Open, Opened, Rail, RowBatch, RowSource, no_names};
use super::samples::Description;
use super::time_base::{max_offset_periods, mean_rate_hz};
use super::{FORMATS, ReadError, ReadOptions, Repair, TraceFormat, VOLTAGE_V, readable};
use crate::trace::Metadata;
use std::fmt::{Display, Formatter, Result as Written};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The first bytes of files that hold no trace, or none that is read; what they are, and the remedy if it is
/// not to give a trace.
const FOREIGN: [(&[u8], &str, Option<&str>); 9] = [
    (b"\xd3tagfmt", "a JLS recording of version 1", Some("export it to CSV from the program that made it")),
    (b"\x89HDF\r\n", "an HDF5 file", Some("export its channels to CSV or Parquet")),
    (
        b"PK\x03\x04",
        "an archive (sigrok .sr, .ppk2 or a spreadsheet)",
        Some("export it to CSV from its own program"),
    ),
    (b"{", "a JSON file", Some("give a trace; that of a run is trace.parquet beside its summary.json")),
    (b"\x89PNG", "a PNG image", None),
    (b"\xff\xd8\xff", "a JPEG image", None),
    (b"%PDF", "a PDF document", None),
    (b"\xff\xfe", "a text in UTF-16", Some("save it as UTF-8")),
    (b"\xfe\xff", "a text in UTF-16", Some("save it as UTF-8")),
];

/// Whether these bytes are not text: control characters other than white space, as in UTF-16.
fn is_binary(start: &[u8]) -> bool {
    start.iter().any(|byte| byte.is_ascii_control() && !byte.is_ascii_whitespace())
}

/// The opener for a file, by its first bytes: that of a format with these, else that of texts.
fn opener(path: &Path) -> Result<Open, ReadError> {
    let start = first_bytes(path)?;
    let refused = |found, remedy: Option<&str>| {
        let remedy = remedy.map_or_else(|| format!("give a trace in {}", readable()), str::to_owned);
        Err(ReadError::Format { path: path.to_owned(), found, remedy })
    };
    let begins = |format: &&TraceFormat| format.magic.is_some_and(|magic| start.starts_with(magic));
    if let Some(open) = FORMATS.iter().find(begins).and_then(|format| format.open) {
        return Ok(open);
    }
    let text = || FORMATS.iter().find(|format| format.is_text).and_then(|format| format.open);
    match FOREIGN.iter().find(|(magic, _, _)| start.starts_with(magic)) {
        Some((_, found, remedy)) => refused(found, *remedy),
        None if is_binary(&start) => refused("a binary file of an unknown kind", None),
        None => text().map_or_else(|| refused("a text", None), Ok),
    }
}

/// A file being read.
pub struct Rows {
    path: PathBuf,
    source: Box<dyn RowSource>,
    layout: Layout,
    pub(crate) description: Description,
    repair: bool,
}

impl Rows {
    /// Opens a file; its format follows from its first bytes.
    ///
    /// # Errors
    /// [`ReadError`] if the file does not exist, is of no known format, or columns are missing.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        let open = opener(path)?;
        let rows = Self::open_as(open, path, options)?;
        check_rate(&rows, open, options)?;
        Ok(rows)
    }

    /// Opens a file of a known format.
    pub(super) fn open_as(open: Open, path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        let Opened { rows: source, layout, mut description, time } = open(path, options)?;
        check_overrides(path, &layout, &description, options)?;
        description.rate_hz = options.rate_hz.or(description.rate_hz);
        description.start_s = options.start_s.or(description.start_s);
        if layout.time.is_none() && description.rate_hz.is_none() {
            if layout.guess.is_some() {
                return Err(no_names(path, time, source.names().len()));
            }
            let found = source.names().join(", ");
            return Err(ReadError::MissingColumn { path: path.to_owned(), column: time.to_owned(), found });
        }
        if layout.names.len() > 1 {
            description.metadata.other.insert("rails".to_owned(), layout.names.clone().into());
        }
        Ok(Self { path: path.to_owned(), source, layout, description, repair: options.repair })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The metadata of the file.
    pub fn metadata(&self) -> &Metadata {
        &self.description.metadata
    }

    /// Number of rows, in formats that state it.
    pub fn count(&self) -> Option<u64> {
        self.source.count()
    }

    /// Refuses non-finite values and names the first one; `first` is the number of rows before these.
    pub(crate) fn check_finite(
        &self,
        voltage_v: &[f32],
        current_a: &[f32],
        first: u64,
    ) -> Result<(), ReadError> {
        for (values, column) in [voltage_v, current_a].into_iter().zip(self.channel_names()) {
            // Without an early exit, so that the loop vectorizes; the place is searched only afterwards.
            if values.iter().fold(true, |all, value| all & value.is_finite()) {
                continue;
            }
            if let Some(at) = values.iter().position(|value| !value.is_finite()) {
                return Err(ReadError::Value {
                    path: self.path.clone(),
                    row: first + at as u64 + 1,
                    column,
                    value: values[at].to_string(),
                });
            }
        }
        Ok(())
    }

    /// The repair made when the file was opened and in the rows read since.
    pub(crate) fn repair(&self) -> Option<Repair> {
        self.source.repair(&self.description)
    }

    /// Names of the rails that are read, in order.
    pub fn rails(&self) -> &[String] {
        &self.layout.names
    }

    /// Columns without a unit in their name or beside it: they are read as s, V, A and W.
    pub fn without_unit(&self) -> impl Iterator<Item = &str> {
        let columns = self.layout.time.iter().chain(&self.layout.values);
        columns.filter(|column| !column.has_unit).map(|column| column.name.as_str())
    }

    /// What columns without names are taken for, such as `column 1 as times`; absent where all is stated.
    pub fn guess(&self) -> Option<&str> {
        self.layout.guess.as_deref()
    }

    /// Columns of power that are not read: the power is their rail's voltage times its current.
    pub fn unread(&self) -> &[String] {
        &self.layout.unread
    }

    /// The columns that voltages and currents are read from, for messages; one of powers twice.
    pub(crate) fn channel_names(&self) -> [String; 2] {
        let name = |column: usize| self.layout.values[column].name.clone();
        match self.layout.rails[..] {
            [Rail::Measured { voltage, current }] => [name(voltage), name(current)],
            [Rail::Specified { current, .. }] => [VOLTAGE_V.to_owned(), name(current)],
            [Rail::Power { power }] => [name(power), name(power)],
            _ => ["the power of all rails", "the power of all rails"].map(str::to_owned),
        }
    }

    /// Whether wrong input is to be repaired.
    pub(crate) fn repairs_input(&self) -> bool {
        self.repair
    }

    /// Skips rows.
    pub(crate) fn skip(&mut self, rows: u64) -> Result<(), ReadError> {
        self.source.skip(rows)
    }

    /// Reads up to `limit` rows into `batch`, over its content; returns how many, 0 at the end.
    pub(crate) fn next(&mut self, limit: usize, batch: &mut RowBatch) -> Result<usize, ReadError> {
        batch.values.resize_with(self.layout.values.len(), Vec::new);
        batch.values.iter_mut().for_each(Vec::clear);
        self.source.next(&self.layout, limit, batch)
    }

    /// Reads up to `limit` rows and appends them, all rails together, to voltages (V) and currents (A);
    /// returns how many.
    pub(crate) fn append(
        &mut self,
        limit: usize,
        batch: &mut RowBatch,
        voltage_v: &mut Vec<f32>,
        current_a: &mut Vec<f32>,
    ) -> Result<usize, ReadError> {
        let Some([voltage, current]) = self.layout.unscaled_channels() else {
            let read = self.next(limit, batch)?;
            self.channels(batch, voltage_v, current_a);
            return Ok(read);
        };
        // Decoded in place: copying long traces costs a twentieth of the time.
        batch.values.resize_with(self.layout.values.len(), Vec::new);
        let mut exchange = |batch: &mut RowBatch| {
            std::mem::swap(&mut batch.values[voltage], voltage_v);
            std::mem::swap(&mut batch.values[current], current_a);
        };
        exchange(batch);
        let read = self.source.next(&self.layout, limit, batch);
        exchange(batch);
        read
    }

    /// Appends a batch's rows, all rails together, to voltages (V) and currents (A). Where rails are added or
    /// only the power is known, the voltage is 1 V and the current is the power.
    fn channels(&self, batch: &mut RowBatch, voltage_v: &mut Vec<f32>, current_a: &mut Vec<f32>) {
        self.layout.scale(&mut batch.values);
        match self.layout.rails[..] {
            [Rail::Measured { voltage, current }] => {
                voltage_v.extend_from_slice(&batch.values[voltage]);
                current_a.extend_from_slice(&batch.values[current]);
            }
            [Rail::Specified { volts, current }] => {
                voltage_v.resize(voltage_v.len() + batch.values[current].len(), volts as f32);
                current_a.extend_from_slice(&batch.values[current]);
            }
            ref rails => {
                let rows = batch.values.first().map_or(0, Vec::len);
                voltage_v.resize(voltage_v.len() + rows, 1.0);
                let power_w =
                    |row: usize| rails.iter().map(|rail| rail.power_w(&batch.values, row)).sum::<f64>();
                current_a.extend((0..rows).map(|row| power_w(row) as f32));
            }
        }
    }

    /// The power of each rail in each row of a batch, W.
    pub(super) fn powers_w(&self, batch: &mut RowBatch) -> Vec<Vec<f64>> {
        self.layout.scale(&mut batch.values);
        let rows = batch.values.first().map_or(0, Vec::len);
        let of = |rail: &Rail| (0..rows).map(|row| rail.power_w(&batch.values, row)).collect();
        self.layout.rails.iter().map(of).collect()
    }
}

fn first_bytes(path: &Path) -> Result<Vec<u8>, ReadError> {
    let mut start = Vec::new();
    let file = File::open(path).map_err(|error| ReadError::io(path, error))?;
    if file.metadata().is_ok_and(|metadata| metadata.is_dir()) {
        return Err(ReadError::Folder { path: path.to_owned() });
    }
    file.take(8).read_to_end(&mut start).map_err(|error| ReadError::io(path, error))?;
    if start.is_empty() { Err(ReadError::Empty { path: path.to_owned() }) } else { Ok(start) }
}

/// Largest difference between a requested rate and that of the file, as a share: clocks differ, and JLS
/// rounds by as much.
const MAX_RATE_DEVIATION: f64 = 1e-3;
/// Largest difference of times, in sample periods; rounding alone stays below.
const MAX_OFFSET_PERIODS: f64 = 0.25;
/// Rows whose times are compared with a requested rate.
const CHECKED_ROWS: usize = 1 << 12;

fn conflict(path: &Path, reason: String) -> ReadError {
    ReadError::Conflict { path: path.to_owned(), reason }
}

/// Refuses a rate and a start that contradict columns or description.
fn check_overrides(
    path: &Path,
    layout: &Layout,
    description: &Description,
    options: &ReadOptions,
) -> Result<(), ReadError> {
    if let Some((start_s, column)) = options.start_s.zip(layout.time.as_ref()) {
        let reason = format!(
            "a start at {start_s} s is requested, but column {} has the times: leave --start out",
            column.name
        );
        return Err(conflict(path, reason));
    }
    if let Some((requested_hz, stated_hz)) = options.rate_hz.zip(description.rate_hz)
        && (requested_hz / stated_hz - 1.0).abs() > MAX_RATE_DEVIATION
    {
        let reason = format!(
            "a rate of {requested_hz} Hz is requested, but it or its description says {stated_hz} Hz: leave --rate out, or fix \
             rate_hz there"
        );
        return Err(conflict(path, reason));
    }
    let rate_hz = description.rate_hz.or(options.rate_hz).unwrap_or(f64::INFINITY);
    if let Some((requested_s, stated_s)) = options.start_s.zip(description.start_s)
        && (requested_s - stated_s).abs() * rate_hz > MAX_OFFSET_PERIODS
    {
        let reason = format!(
            "a start at {requested_s} s is requested, but it or its description says {stated_s} s: leave --start out, or fix \
             start_s there"
        );
        return Err(conflict(path, reason));
    }
    Ok(())
}

/// Refuses a rate that contradicts the times of the first rows: repairing to that rate would add or drop
/// samples.
fn check_rate(rows: &Rows, open: Open, options: &ReadOptions) -> Result<(), ReadError> {
    let (Some(requested_hz), Some(column)) = (options.rate_hz, &rows.layout.time) else { return Ok(()) };
    let mut again = Rows::open_as(open, &rows.path, &ReadOptions { rate_hz: None, ..options.clone() })?;
    let mut batch = RowBatch::default();
    again.next(CHECKED_ROWS, &mut batch)?;
    let stamps = &batch.stamps;
    let times = (0..stamps.len()).map(|row| stamps.time_s(row)).filter(|time_s| time_s.is_finite());
    let mut times: Vec<f64> = times.collect();
    times.sort_by(f64::total_cmp);
    let (count, span_s) =
        (times.len(), times.last().zip(times.first()).map_or(0.0, |(last, first)| last - first));
    let steps = times.windows(2).map(|pair| pair[1] - pair[0]).filter(|step_s| *step_s > 0.0);
    let resolution_s = steps.fold(f64::INFINITY, f64::min);
    times.dedup();
    let off_periods = requested_hz * span_s - (count as f64 - 1.0);
    let is_rounding =
        times.len() < count && off_periods.abs() <= max_offset_periods(true, resolution_s, requested_hz);
    if times.len() < 2 || is_rounding {
        return Ok(());
    }
    let rate_hz = mean_rate_hz(&times);
    let off = (requested_hz / rate_hz - 1.0).abs();
    if off > MAX_RATE_DEVIATION && off * times.len() as f64 > MAX_OFFSET_PERIODS {
        let reason = format!(
            "a rate of {requested_hz} Hz is requested, but by column {} it is {rate_hz} Hz: leave --rate out",
            column.name
        );
        return Err(conflict(&rows.path, reason));
    }
    Ok(())
}

/// Rows that are compared.
const COMPARED_ROWS: usize = 1 << 12;
/// Fewest rows that decide.
const MIN_ROWS: usize = 8;
/// Largest deviation of a sum, as a share of its highest power, for rounded numbers.
const MAX_DEVIATION: f64 = 2e-3;
/// Two equal rails count as one and its sum if they vary by more than this share of their highest power.
const MIN_VARIATION: f64 = 0.01;
/// Names of sums. As a part of a name they decide nothing: `gpu_total` may stand beside `cpu_total`.
const SUM_WORDS: [&str; 5] = ["total", "sum", "all", "overall", "combined"];

/// A rail among several that seems to be the sum of the others.
#[derive(Clone, Debug, PartialEq)]
pub struct SumOfRails {
    /// Name of the rail; empty if its columns carry none.
    pub rail: String,
    /// The others, in order.
    pub others: Vec<String>,
    /// Whether it follows from the values, not from the name alone.
    pub by_values: bool,
}

impl Display for SumOfRails {
    fn fmt(&self, f: &mut Formatter<'_>) -> Written {
        let rail = if self.rail.is_empty() { "the rail without a name" } else { &self.rail };
        let how = if self.by_values { "is, to rounding," } else { "is by its name" };
        write!(f, "{rail} {how} the sum of {}, and all are added up", self.others.join(", "))
    }
}

/// Searches the first rows of a file whose rails are all added up for a rail that is the sum of the others.
///
/// # Errors
/// [`ReadError`] if the file cannot be read.
pub fn rail_of_sums(path: &Path, options: &ReadOptions) -> Result<Option<SumOfRails>, ReadError> {
    let mut rows = Rows::open(path, options)?;
    if rows.rails().len() < 2 {
        return Ok(None);
    }
    let mut batch = RowBatch::default();
    rows.next(COMPARED_ROWS, &mut batch)?;
    let powers_w = rows.powers_w(&mut batch);
    let names = rows.rails();
    let by_values = (0..names.len()).rev().find(|&rail| is_sum(rail, &powers_w));
    let by_name = || names.iter().position(|name| SUM_WORDS.contains(&name.as_str()));
    let found = by_values.or_else(by_name);
    Ok(found.map(|rail| SumOfRails {
        rail: names[rail].clone(),
        others: names
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != rail)
            .map(|(_, name)| name.clone())
            .collect(),
        by_values: by_values.is_some(),
    }))
}

/// Least difference of a power that is not read from voltage times current that is said, as a share: that of
/// means of products from products of means, and of the gains of two meters, is a percent or so.
const MIN_POWER_DIFFERENCE: f64 = 0.02;

/// How many times voltage times current, on average over the first rows, a column of power is that is beside
/// them and not read; `None` if they agree, if either cannot be read, and unless there is one rail with one
/// such column.
pub fn unread_power_ratio(path: &Path, options: &ReadOptions) -> Option<f64> {
    let rows = Rows::open(path, options).ok()?;
    let ([_], [power]) = (rows.rails(), rows.unread()) else { return None };
    let power = Some(power.clone());
    let by_power = ReadOptions { rails: Vec::new(), power, fixed_voltage_v: None, ..options.clone() };
    let ratio = total_w(Rows::open(path, &by_power).ok()?)? / total_w(rows)?;
    (ratio.is_finite() && (ratio - 1.0).abs() > MIN_POWER_DIFFERENCE).then_some(ratio)
}

/// The sum of the powers of the first rows, W; `None` if they cannot be read.
fn total_w(mut rows: Rows) -> Option<f64> {
    let mut batch = RowBatch::default();
    rows.next(COMPARED_ROWS, &mut batch).ok()?;
    Some(rows.powers_w(&mut batch).iter().flatten().filter(|power_w| power_w.is_finite()).sum())
}

/// Whether a rail's power is that of all others together, in every row that has all.
fn is_sum(rail: usize, powers_w: &[Vec<f64>]) -> bool {
    let rows = powers_w[rail].len();
    let others_w = |row: usize| powers_w.iter().map(|powers| powers[row]).sum::<f64>() - powers_w[rail][row];
    let whole: Vec<(f64, f64)> = (0..rows).map(|row| (powers_w[rail][row], others_w(row))).collect();
    let whole: Vec<_> =
        whole.into_iter().filter(|(sum, others)| sum.is_finite() && others.is_finite()).collect();
    let high = whole.iter().map(|(sum, _)| *sum).fold(f64::NEG_INFINITY, f64::max);
    let low = whole.iter().map(|(sum, _)| *sum).fold(f64::INFINITY, f64::min);
    let decided =
        whole.len() >= MIN_ROWS && high > 0.0 && (powers_w.len() > 2 || high - low > MIN_VARIATION * high);
    decided && whole.iter().all(|(sum, others)| (sum - others).abs() <= MAX_DEVIATION * high)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum_in(names: &str, row: impl Fn(u32) -> String) -> Option<(String, bool)> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        let rows: String = (0..100).map(|i| format!("{},{}\n", f64::from(i) / 100.0, row(i))).collect();
        std::fs::write(&path, format!("time_s,{names}\n{rows}")).unwrap();
        let found = rail_of_sums(&path, &ReadOptions::default()).unwrap();
        found.map(|sum| (sum.rail, sum.by_values))
    }

    #[test]
    fn a_power_that_is_not_read_is_compared_with_voltage_times_current() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        let ratio = |names: &str, factor: f64| {
            let row = |i: u32| {
                format!("{},12,{},{}\n", f64::from(i) / 100.0, 1 + i % 3, factor * f64::from(1 + i % 3))
            };
            std::fs::write(&path, format!("{names}\n{}", (0..100).map(row).collect::<String>())).unwrap();
            unread_power_ratio(&path, &ReadOptions::default())
        };
        let names = "time_s,voltage_V,current_A,power_W";
        assert!((ratio(names, 24.0).unwrap() - 2.0).abs() < 1e-6);
        assert!((ratio("time_s,voltage_V,current_A,power_mW", 12.0).unwrap() - 1e-3).abs() < 1e-9);
        assert_eq!((ratio(names, 12.1), ratio("time_s,voltage_V,current_A,note", 24.0)), (None, None));
        std::fs::write(&path, format!("{names}\n0,12,1,12\n0.01,12,1,N/A\n")).unwrap();
        assert_eq!(unread_power_ratio(&path, &ReadOptions::default()), None);
    }

    /// The columns that a file without names is read from, and what was guessed, or the error.
    fn unnamed(rows: &str, options: &ReadOptions) -> Result<(Vec<usize>, Option<String>), String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        std::fs::write(&path, rows).unwrap();
        let rows = Rows::open(&path, options).map_err(|error| error.to_string())?;
        let columns = rows.layout.time.iter().chain(&rows.layout.values);
        Ok((columns.map(|column| column.index + 1).collect(), rows.guess().map(str::to_owned)))
    }

    #[test]
    fn columns_without_names_are_chosen_by_number_and_a_guess_is_said() {
        let (two, three) = ("0,1.5\n1,1.6\n2,1.7\n", "0,12,1.5\n1,12,1.6\n");
        let plain = ReadOptions::default();
        let refused = unnamed(two, &plain).unwrap_err();
        assert!(
            refused.contains("2 columns without names") && refused.contains("--time-column 1"),
            "{refused}"
        );
        let at = |time: Option<&str>, power: Option<&str>, rate_hz| ReadOptions {
            time: time.map(str::to_owned),
            power: power.map(str::to_owned),
            rate_hz,
            ..ReadOptions::default()
        };
        assert_eq!(unnamed(two, &at(Some("1"), Some("2"), None)), Ok((vec![1, 2], None)));
        let first = Some("column 1 as times".to_owned());
        assert_eq!(unnamed(two, &at(None, Some("2"), None)), Ok((vec![1, 2], first)));
        assert_eq!(unnamed(two, &at(None, Some("2"), Some(1.0))), Ok((vec![2], None)));
        assert_eq!(unnamed(two, &at(None, Some("1"), Some(1.0))), Ok((vec![1], None)));
        let both = Some("column 1 as voltages, column 2 as currents".to_owned());
        assert_eq!(unnamed(two, &at(None, None, Some(1.0))), Ok((vec![1, 2], both)));
        assert!(unnamed(two, &at(Some("1"), None, None)).unwrap_err().contains("without names"));
        let all = Some("column 1 as times, column 2 as voltages, column 3 as currents".to_owned());
        assert_eq!(unnamed(three, &plain), Ok((vec![1, 2, 3], all)));
    }

    #[test]
    fn sums_are_found_by_values_or_name_and_other_rails_are_not() {
        let [cpu, gpu] = [|i: u32| f64::from(i % 7), |i: u32| f64::from(i % 11)];
        let names = "cpu_power_W,board_power_W,gpu_power_W";
        let sum = |i: u32| format!("{},{:.2},{}", cpu(i), cpu(i) + gpu(i) + 0.003, gpu(i));
        assert_eq!(sum_in(names, sum), Some(("board".to_owned(), true)));
        assert_eq!(sum_in(names, |i| format!("{},{},{}", cpu(i), f64::from(i % 5), gpu(i))), None);
        let two = "cpu_power_W,total_power_mW";
        let total = Some(("total".to_owned(), false));
        assert_eq!(sum_in(two, |i| format!("{},{}", cpu(i), 1e3 * (cpu(i) + 2.0))), total);
        assert_eq!(
            sum_in("a_power_W,b_power_W", |i| format!("{0},{0}", cpu(i))),
            Some(("b".to_owned(), true))
        );
        let parts = "gpu_total_power_W,cpu_total_power_W";
        assert_eq!(sum_in(parts, |i| format!("{},{}", cpu(i), gpu(i))), None);
        assert_eq!(sum_in("a_power_W,b_power_W", |_| "2,2".to_owned()), None);
    }
}
