//! Overviews at any zoom without reading the samples again: lowest, highest and mean power of blocks, blocks
//! of blocks, and so on, built once and kept in a file beside the trace. Columns narrower than blocks come
//! from the samples themselves.

mod cache;

use core::ops::Range;
use std::path::{Path, PathBuf};

use crate::clock::{SampleClock, clock};
use crate::io::{ReadError, ReadOptions, RowBatch, Rows, Stamps, rate_of_steps_hz, read};
use crate::pyramid::cache::Cached;
use crate::trace::Trace;

/// Samples in a block of the lowest level: 12 bytes for 64 samples, with all levels above 0.2 bytes a sample,
/// 2.5 % of the 8 bytes of voltage and current.
pub const BLOCK: u64 = 64;
/// Blocks of a level that make one of the next.
const FANOUT: usize = 16;
/// Fewest blocks of a column, if the level below has as many.
const MIN_BLOCKS_PER_COLUMN: u64 = 4;
const ENTRY_BYTES: u64 = 12;
/// Distance from an edge of a sample within which a time counts as on it, in samples.
const EDGE_SAMPLES: f64 = 1e-6;

/// A segment of time and the powers in it, W.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// Begin of the column, s.
    pub from_s: f64,
    /// End of the column, s.
    pub to_s: f64,
    /// The lowest power of any sample in it.
    pub low_w: f32,
    /// The highest.
    pub high_w: f32,
    /// The mean.
    pub mean_w: f32,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    low_w: f32,
    high_w: f32,
    mean_w: f32,
}

/// Blocks of a trace's power.
#[derive(Debug)]
pub struct PowerPyramid {
    clock: SampleClock,
    samples: u64,
    store: Store,
    /// Whether what was kept was damaged, so that this was made in its place.
    was_damaged: bool,
}

#[derive(Debug)]
enum Store {
    Memory(Vec<Vec<Entry>>),
    File(cache::Kept),
}

/// Mean power of each column and of those within half of `width_s` on either side, W.
pub fn moving_means_w(columns: &[Column], width_s: f64) -> Vec<f64> {
    let Some(first) = columns.first() else { return Vec::new() };
    let reach = libm::round(0.5 * width_s / (first.to_s - first.from_s)) as usize;
    let mut sums_w = vec![0.0];
    for column in columns {
        sums_w.push(sums_w[sums_w.len() - 1] + f64::from(column.mean_w));
    }
    let mean_w = |index: usize| {
        let (from, to) = (index.saturating_sub(reach), (index + reach + 1).min(columns.len()));
        (sums_w[to] - sums_w[from]) / (to - from) as f64
    };
    (0..columns.len()).map(mean_w).collect()
}

/// The cache file of the pyramid of a trace.
pub fn pyramid_path(trace: &Path) -> PathBuf {
    let mut name = trace.as_os_str().to_owned();
    name.push(".pyramid");
    name.into()
}

impl PowerPyramid {
    /// The pyramid kept beside a file if it is that of the file as it is now and is read as `options` say;
    /// else made anew and kept, if the folder lets itself be written to.
    ///
    /// # Errors
    /// [`ReadError`] if the trace cannot be read.
    pub fn of_file(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        match cache::kept(&pyramid_path(path), cache::stamp(path, options)) {
            Cached::Whole(pyramid) => Ok(pyramid),
            Cached::Other => Self::anew(path, options),
            Cached::Damaged => Ok(Self { was_damaged: true, ..Self::anew(path, options)? }),
        }
    }

    /// The pyramid kept beside a file if it is that of the file as it is now and is read as `options` say;
    /// else made anew and not kept.
    ///
    /// # Errors
    /// [`ReadError`] if the trace cannot be read.
    pub fn look(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        match cache::kept(&pyramid_path(path), cache::stamp(path, options)) {
            Cached::Whole(pyramid) => Ok(pyramid),
            Cached::Other => Self::build(path, options),
            Cached::Damaged => Ok(Self { was_damaged: true, ..Self::build(path, options)? }),
        }
    }

    /// Whether the pyramid that was kept was damaged, as far as was seen when it was opened, so that this was
    /// made in its place.
    pub fn was_damaged(&self) -> bool {
        self.was_damaged
    }

    /// Makes the pyramid of a file and keeps it, whatever is kept there: it may be damaged.
    ///
    /// # Errors
    /// [`ReadError`] if the trace cannot be read.
    pub fn anew(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        let stamp = cache::stamp(path, options);
        let pyramid = Self::build(path, options)?;
        // Without it the next look takes as long as this one; that is all.
        let _ = cache::keep(&pyramid, &pyramid_path(path), stamp);
        Ok(pyramid)
    }

    /// Reads a whole trace, in pieces; at once if it is to be repaired, as the places of its samples then
    /// depend on all of them.
    ///
    /// # Errors
    /// [`ReadError`] if the trace cannot be read, or its samples are not even or finite.
    pub fn build(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        if options.repair { Ok(Self::of_trace(&read(path, options)?.trace)) } else { of_file(path, options) }
    }

    /// The pyramid of a trace in memory.
    pub fn of_trace(trace: &Trace) -> Self {
        let samples = trace.samples() as u64;
        let clock =
            SampleClock { start_s: trace.start_s(), rate_hz: trace.rate_hz(), samples: Some(samples) };
        Self::of_blocks(clock, samples, blocks(trace.voltage_v(), trace.current_a()).collect())
    }

    fn of_blocks(clock: SampleClock, samples: u64, base: Vec<Entry>) -> Self {
        let mut levels = vec![base];
        while levels[levels.len() - 1].len() > FANOUT {
            levels.push(levels[levels.len() - 1].chunks(FANOUT).map(Entry::of_entries).collect());
        }
        Self { clock, samples, store: Store::Memory(levels), was_damaged: false }
    }

    /// Left edge of the first sample, s.
    pub fn start_s(&self) -> f64 {
        self.clock.start_s
    }

    /// Right edge of the last sample, s.
    pub fn end_s(&self) -> f64 {
        self.clock.time_s(self.samples as f64)
    }

    /// About `columns` columns from one time to another, snapped outwards to blocks, which are of at least 64
    /// samples. Lowest and highest are those of all samples within (as f32), none missed. `None` where what
    /// was kept cannot be read or is damaged: it is to be made [anew](PowerPyramid::anew).
    pub fn columns(&self, from_s: f64, to_s: f64, columns: usize) -> Option<Vec<Column>> {
        let (from, to) = self.places(from_s, to_s);
        let wanted = (to.saturating_sub(from) / columns.max(1) as u64).max(1);
        let (mut level, mut size) = (0, BLOCK);
        while size * FANOUT as u64 * MIN_BLOCKS_PER_COLUMN <= wanted {
            (level, size) = (level + 1, size * FANOUT as u64);
        }
        let per_column = wanted.div_ceil(size).max(1);
        let (first, last) = (from / size, to.div_ceil(size));
        let entries = self.entries(level, first, last.saturating_sub(first))?;
        let column = |(index, entries): (usize, &[Entry])| {
            let begin = (first + index as u64 * per_column) * size;
            let end = (begin + entries.len() as u64 * size).min(self.samples);
            self.column(begin, end, Entry::of_entries(entries))
        };
        Some(entries.chunks(per_column as usize).enumerate().map(column).collect())
    }

    /// The sample that a time lies in, and the one after that in which another ends.
    fn places(&self, from_s: f64, to_s: f64) -> (u64, u64) {
        let place = |time_s: f64| {
            let (at, whole) = (self.clock.position(time_s), libm::round(self.clock.position(time_s)));
            // Times of samples are rounded; what is an edge but for that is one.
            let at = if (at - whole).abs() < EDGE_SAMPLES { whole } else { at };
            at.clamp(0.0, self.samples as f64)
        };
        (place(from_s) as u64, libm::ceil(place(to_s)) as u64)
    }

    fn column(&self, begin: u64, end: u64, all: Entry) -> Column {
        Column {
            from_s: self.clock.time_s(begin as f64),
            to_s: self.clock.time_s(end as f64),
            low_w: all.low_w,
            high_w: all.high_w,
            mean_w: all.mean_w,
        }
    }

    fn entries(&self, level: usize, first: u64, count: u64) -> Option<Vec<Entry>> {
        match &self.store {
            Store::Memory(levels) => {
                let level = levels.get(level)?;
                let end = ((first + count) as usize).min(level.len());
                Some(level[(first as usize).min(end)..end].to_vec())
            }
            Store::File(kept) => kept.entries(level, first, count),
        }
    }
}

impl Entry {
    fn of_samples(voltage_v: &[f32], current_a: &[f32]) -> Self {
        let (mut low_w, mut high_w, mut sum) = (f32::INFINITY, f32::NEG_INFINITY, 0.0_f64);
        for (v, i) in voltage_v.iter().zip(current_a) {
            let watts = f64::from(*v) * f64::from(*i);
            sum += watts;
            let watts = watts as f32;
            low_w = low_w.min(watts);
            high_w = high_w.max(watts);
        }
        Self { low_w, high_w, mean_w: (sum / voltage_v.len() as f64) as f32 }
    }

    fn of_entries(entries: &[Self]) -> Self {
        let low_w = entries.iter().map(|e| e.low_w).fold(f32::INFINITY, f32::min);
        let high_w = entries.iter().map(|e| e.high_w).fold(f32::NEG_INFINITY, f32::max);
        let mean = entries.iter().map(|e| f64::from(e.mean_w)).sum::<f64>() / entries.len().max(1) as f64;
        Self { low_w, high_w, mean_w: mean as f32 }
    }

    fn to_bytes(self) -> [u8; ENTRY_BYTES as usize] {
        let mut bytes = [0; ENTRY_BYTES as usize];
        for (to, value) in bytes.chunks_exact_mut(4).zip([self.low_w, self.high_w, self.mean_w]) {
            to.copy_from_slice(&value.to_le_bytes());
        }
        bytes
    }

    fn from_bytes(bytes: &[u8]) -> Self {
        let value = |at: usize| f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        Self { low_w: value(0), high_w: value(4), mean_w: value(8) }
    }
}

impl PowerPyramid {
    /// As [`PowerPyramid::columns`] of a file, but where columns are narrower than blocks, from its samples: those
    /// before are passed over, which takes texts as long as reading them.
    ///
    /// # Errors
    /// [`ReadError`] if samples cannot be read.
    pub fn columns_of_file(
        &self,
        path: &Path,
        options: &ReadOptions,
        span_s: [f64; 2],
        columns: usize,
    ) -> Result<Option<Vec<Column>>, ReadError> {
        let Some(range) = self.few(span_s, columns) else {
            return Ok(self.columns(span_s[0], span_s[1], columns));
        };
        let mut rows = Rows::open(path, options)?;
        rows.skip(range.start)?;
        let (mut batch, mut voltage_v, mut current_a) = (RowBatch::default(), Vec::new(), Vec::new());
        let wanted = (range.end - range.start) as usize;
        while voltage_v.len() < wanted {
            let missing = wanted - voltage_v.len();
            if rows.append(missing, &mut batch, &mut voltage_v, &mut current_a)? == 0 {
                return Err(ReadError::Changed { path: path.to_owned() });
            }
        }
        rows.check_finite(&voltage_v, &current_a, range.start)?;
        Ok(Some(self.of_samples(range.start, [&voltage_v, &current_a], columns)))
    }

    /// As [`PowerPyramid::columns_of_file`], of a trace in memory.
    pub fn columns_of_trace(&self, trace: &Trace, span_s: [f64; 2], columns: usize) -> Option<Vec<Column>> {
        let Some(range) = self.few(span_s, columns) else {
            return self.columns(span_s[0], span_s[1], columns);
        };
        let within = range.start as usize..range.end as usize;
        let channels = [&trace.voltage_v()[within.clone()], &trace.current_a()[within]];
        Some(self.of_samples(range.start, channels, columns))
    }

    /// The samples of a segment, if they are fewer than as many blocks would hold as there are to be columns.
    fn few(&self, [from_s, to_s]: [f64; 2], columns: usize) -> Option<Range<u64>> {
        let (from, to) = self.places(from_s, to_s);
        (to > from && to - from < columns as u64 * BLOCK).then_some(from..to)
    }

    fn of_samples(&self, first: u64, [voltage_v, current_a]: [&[f32]; 2], columns: usize) -> Vec<Column> {
        let per_column = voltage_v.len().div_ceil(columns.max(1)).max(1);
        let both = voltage_v.chunks(per_column).zip(current_a.chunks(per_column)).enumerate();
        let column = |(index, (volts, amps)): (usize, (&[f32], &[f32]))| {
            let begin = first + (index * per_column) as u64;
            self.column(begin, begin + volts.len() as u64, Entry::of_samples(volts, amps))
        };
        both.map(column).collect()
    }
}

/// Rows read at once.
const PIECE_ROWS: usize = 1 << 20;
/// Largest difference between a step of two stamps and a period, in periods.
const MAX_STEP_OFFSET: f64 = 0.5;

fn of_file(path: &Path, options: &ReadOptions) -> Result<PowerPyramid, ReadError> {
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
    Ok(PowerPyramid::of_blocks(clock, samples, base))
}

fn blocks<'a>(voltage_v: &'a [f32], current_a: &'a [f32]) -> impl Iterator<Item = Entry> + use<'a> {
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
    use std::fs;
    use std::fs::write;

    use super::*;
    use crate::io::{csv, parquet};
    use crate::trace::Metadata;

    #[test]
    fn moving_means_are_of_the_columns_around_as_far_as_there_are_any() {
        let column = |index: u8| Column {
            from_s: f64::from(index),
            to_s: f64::from(index) + 1.0,
            low_w: 0.0,
            high_w: 9.0,
            mean_w: f32::from(index * index),
        };
        let columns: Vec<Column> = (0..5).map(column).collect();
        assert_eq!(moving_means_w(&columns, 0.0), [0.0, 1.0, 4.0, 9.0, 16.0]);
        assert_eq!(moving_means_w(&columns, 2.0), [0.5, 5.0 / 3.0, 14.0 / 3.0, 29.0 / 3.0, 12.5]);
        assert_eq!(moving_means_w(&columns, 1e9), [6.0; 5]);
        assert!(moving_means_w(&[], 1.0).is_empty());
    }

    #[test]
    fn oracle_extremes_are_exact_at_every_zoom_from_memory_and_from_the_file() {
        let samples = 300_001_usize;
        let current = (0..samples).map(|i| ((i * 7919) % 10_007) as f32 / 1000.0).collect();
        let trace = Trace::new(vec![2.0; samples], current, 50e3, 1.0, Metadata::default()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        parquet::save(&trace, &path).unwrap();
        let options = ReadOptions::default();
        let made = PowerPyramid::of_file(&path, &options).unwrap();
        let kept = PowerPyramid::of_file(&path, &options).unwrap();
        assert!(matches!((&made.store, &kept.store), (Store::Memory(_), Store::File(_))));
        let bytes = fs::metadata(pyramid_path(&path)).unwrap().len() as f64;
        assert!(bytes < 0.03 * 8.0 * samples as f64, "{bytes}");
        for (from_s, to_s, columns) in [(1.0, 7.1, 1000), (1.0, 7.1, 3), (2.5, 2.6, 20), (6.99, 7.00002, 7)] {
            let found = kept.columns(from_s, to_s, columns).unwrap();
            assert_eq!(Some(&found), made.columns(from_s, to_s, columns).as_ref());
            assert!(
                found[0].from_s <= from_s && found[found.len() - 1].to_s >= to_s.min(trace.end_s()) - 1e-9
            );
            for column in found {
                let place = |time_s: f64| libm::round(trace.position(time_s)) as usize;
                let powers = (place(column.from_s)..place(column.to_s)).map(|i| trace.power_w(i) as f32);
                let (low, high) = powers.fold((f32::MAX, f32::MIN), |(l, h), w| (l.min(w), h.max(w)));
                assert_eq!((column.low_w, column.high_w), (low, high));
            }
        }
        write(&path, b"changed").unwrap();
        assert!(PowerPyramid::of_file(&path, &options).is_err());
    }

    #[test]
    fn a_short_range_shows_every_sample() {
        let amps: Vec<f32> = (0..5000_u16).map(|i| f32::from(i % 97)).collect();
        let trace = Trace::new(vec![2.0; 5000], amps.clone(), 1e3, 1.0, Default::default()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let options = ReadOptions::default();
        for name in ["t.parquet", "t.csv"] {
            let path = folder.path().join(name);
            match name {
                "t.csv" => csv::save(&trace, &path).unwrap(),
                _ => parquet::save(&trace, &path).unwrap(),
            }
            let pyramid = PowerPyramid::of_file(&path, &options).unwrap();
            let look =
                |columns| pyramid.columns_of_file(&path, &options, [3.0, 3.1], columns).unwrap().unwrap();
            let each: Vec<f32> = look(1000).iter().map(|column| column.mean_w).collect();
            let powers: Vec<f32> = amps[2000..2100].iter().map(|amps| 2.0 * amps).collect();
            assert_eq!(each, powers);
            let pairs = look(50);
            assert_eq!((pairs.len(), pairs[0].from_s, pairs[49].to_s), (50, 3.0, 3.1));
            assert_eq!((pairs[1].low_w, pairs[1].high_w), (powers[2], powers[3]));
            assert_eq!(pyramid.columns_of_trace(&trace, [3.0, 3.1], 50).unwrap(), pairs);
        }
    }

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
            let message = PowerPyramid::build(&path, &plain).unwrap_err().to_string();
            assert!(message.contains(says), "{message}");
            let (built, trace) =
                (PowerPyramid::build(&path, &repair).unwrap(), read(&path, &repair).unwrap().trace);
            assert_eq!((built.start_s(), built.end_s()), (trace.start_s(), trace.end_s()));
        }
        write(&path, text((0..3000).map(|row| (even(row), 1.0)))).unwrap();
        assert_eq!(PowerPyramid::build(&path, &plain).unwrap().end_s(), 3.0);
    }

    #[test]
    fn stamps_rounded_to_microseconds_give_the_rate_of_the_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        let time = |row: u32| (f64::from(row) * 1e6 / 44_117.65).round() / 1e6;
        write(&path, text((0..20_000).map(|row| (time(row), 1.0)))).unwrap();
        let options = ReadOptions::default();
        let (built, trace) =
            (PowerPyramid::build(&path, &options).unwrap(), read(&path, &options).unwrap().trace);
        assert_eq!(built.end_s(), trace.end_s());
    }

    #[test]
    fn values_of_a_table_that_are_not_finite_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        let trace = Trace::new(vec![1.0; 3000], vec![1.0; 3000], 1000.0, 0.0, Default::default()).unwrap();
        parquet::save(&trace, &path).unwrap();
        let nan = ReadOptions { fixed_voltage_v: Some(f64::NAN), ..ReadOptions::default() };
        let message = PowerPyramid::build(&path, &nan).unwrap_err().to_string();
        assert!(message.contains("row 1: voltage_V is NaN"), "{message}");
    }
}
