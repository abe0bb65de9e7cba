//! JLS version 2, what Joulescope instruments record: traces from and to the signals of the crate [`::jls`].
//!
//! [`Writer`] writes samples in pieces, [`save`] a whole trace. Current and voltage are signals of fixed
//! rate. A JSON text among the user data (`{"trace": ...}`) holds the exact rate and start and the metadata
//! of the trace, which [`read`](super::read()) takes back.

use super::columns::{Layout, Opened, RowBatch, RowSource, layout};
use super::samples::{Description, TraceChunk, TraceReader, TraceWriter, describe};
use super::time_base::Stamps;
use super::{ReadError, ReadOptions, Repair, RepairKind, TIME_S, WriteError, atomic};
use crate::trace::Metadata;
use crate::units;
use ::jls::{MAX_PAYLOAD_BYTES, Reader, SAMPLE_TYPES, SampleReader, Signal, SignalName, Timestamp};
use rayon::prelude::*;
use std::io::{self, Seek, Write};
use std::path::Path;

/// The signals, as Joulescope's recorders call them.
const SIGNALS: [SignalName<'_>; 2] =
    [SignalName { name: "current", unit: "A" }, SignalName { name: "voltage", unit: "V" }];
/// Largest difference between a rate and the whole number in the file, as a share of the rate.
const MAX_RATE_DEVIATION: f64 = 1e-3;

/// A JLS file being written: voltage and current of one trace, in pieces of any size, which do not show in
/// the bytes.
///
/// Memory does not grow with the samples: about 4 MiB, and 25 KiB a signal for each level of summaries (five
/// at 1e9).
///
/// ```
/// use traces::io::{atomic, jls};
///
/// # let folder = std::env::temp_dir().join(format!("traces-jls-doc-{}", std::process::id()));
/// # std::fs::create_dir_all(&folder)?;
/// atomic::write_file(&folder.join("a.jls"), |out| {
///     let mut file = jls::Writer::new(out, 50e3, 0.0, &traces::Metadata::default())?;
///     for _ in 0..100 {
///         file.push(&[3.8; 1000], &[0.25; 1000])?;
///     }
///     file.finish()
/// })?;
/// # std::fs::remove_dir_all(&folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Writer<W> {
    file: ::jls::JlsWriter<W, { SIGNALS.len() }>,
    rate_hz: f64,
    start_s: f64,
}

fn failed(error: io::Error) -> WriteError {
    WriteError::Encode(error.to_string())
}

/// The rate as the file holds it.
fn whole_rate_hz(rate_hz: f64) -> Result<u32, WriteError> {
    let whole_hz = libm::round(rate_hz);
    if (1.0..=f64::from(u32::MAX)).contains(&whole_hz)
        && (rate_hz - whole_hz).abs() <= MAX_RATE_DEVIATION * rate_hz
    {
        return Ok(whole_hz as u32);
    }
    Err(WriteError::JlsRate { rate_hz })
}

impl<W: Write + Seek> Writer<W> {
    /// Begins a recording in an empty file. Sample 0 is at `start_s`, in s since 1970-01-01 UTC for readers
    /// that show the time of day.
    ///
    /// # Errors
    /// [`WriteError`] if the rate (Hz) is not whole to 1 in 1000, the start is beyond about 8.5e9 s from
    /// 2018, a mark is not finite, the description is longer than 64 MiB, or `out` cannot be written.
    pub fn new(out: W, rate_hz: f64, start_s: f64, metadata: &Metadata) -> Result<Self, WriteError> {
        let whole_hz = whole_rate_hz(rate_hz)?;
        let description = describe(rate_hz, start_s, None, metadata)?.to_keyed_json()?;
        if description.len() >= MAX_PAYLOAD_BYTES as usize {
            return Err(WriteError::Encode("the description is longer than 64 MiB: leave out marks".into()));
        }
        let file = ::jls::JlsWriter::new(out, &metadata.device, whole_hz, SIGNALS, &description);
        let mut writer = Self { file: file.map_err(failed)?, rate_hz, start_s };
        writer.stamp()?;
        Ok(writer)
    }

    /// Number of samples so far, skipped ones included.
    pub fn samples(&self) -> u64 {
        self.file.samples()
    }

    /// Adds samples, V and A. Non-finite samples are written as they are; summaries leave them out.
    ///
    /// # Errors
    /// [`WriteError::Encode`] if there are not as many voltages as currents, or the writer fails.
    pub fn push(&mut self, voltage_v: &[f32], current_a: &[f32]) -> Result<(), WriteError> {
        if voltage_v.len() != current_a.len() {
            let [voltages, currents] = [voltage_v.len(), current_a.len()];
            return Err(WriteError::Encode(format!("{voltages} voltages but {currents} currents")));
        }
        self.file.push([current_a, voltage_v]).map_err(failed)
    }

    /// Adds lost samples: NaN, as pyjls writes them.
    ///
    /// # Errors
    /// [`WriteError::Encode`] if the writer fails.
    pub fn skip(&mut self, samples: u64) -> Result<(), WriteError> {
        self.file.skip(samples).map_err(failed)
    }

    /// Adds the time of the last sample so far, or of the first one.
    fn stamp(&mut self) -> Result<(), WriteError> {
        let sample = self.samples().saturating_sub(1);
        let after_s = sample as f64 / self.rate_hz;
        let time_s = self.start_s + after_s;
        let time = Timestamp::from_unix_s(self.start_s, after_s).ok_or(WriteError::JlsTime { time_s })?;
        self.file.stamp(sample, time).map_err(failed)
    }

    /// Writes the rest. Without it, the file counts as not closed.
    ///
    /// # Errors
    /// [`WriteError`] if the writer fails, or the last sample is later than JLS can say.
    pub fn finish(mut self) -> Result<(), WriteError> {
        if self.samples() > 1 {
            self.stamp()?;
        }
        self.file.finish().map_err(failed)
    }
}

impl<W: Write + Seek + Send> TraceWriter for Writer<W> {
    fn write(&mut self, chunk: &TraceChunk<'_>) -> Result<(), WriteError> {
        if chunk.lost { self.skip(chunk.len() as u64) } else { self.push(chunk.voltage_v, chunk.current_a) }
    }
}

/// Writes a trace, lost samples as NaN. The same trace gives the same bytes, whatever pieces it comes in.
///
/// # Errors
/// As [`Writer`], or [`WriteError::Read`] where the samples cannot be read.
pub fn write<W: Write + Seek + Send>(trace: &dyn TraceReader, out: W) -> Result<(), WriteError> {
    let header = trace.header();
    let mut writer = Writer::new(out, header.rate_hz, header.start_s, &header.metadata)?;
    trace.read_into(&mut writer)?;
    writer.finish()
}

/// Writes a file, whole or not at all.
///
/// # Errors
/// [`WriteError`] names the file.
pub fn save(trace: &dyn TraceReader, path: &Path) -> Result<(), WriteError> {
    atomic::write_trace(path, |out| write(trace, out))
}

/// The signals of a JLS file, read as rows: each signal by a reader of its own, all of them in parallel.
struct JlsRows {
    path: std::path::PathBuf,
    names: Vec<String>,
    tracks: Vec<Track>,
    count: u64,
    /// The repair by which signals of different lengths make up rows.
    trimmed: Option<Repair>,
}

/// A signal that is read.
struct Track {
    name: String,
    rate_hz: u32,
    samples: SampleReader,
}

/// An error of the crate `jls` as one that names the file.
fn read_error(path: &Path, error: ::jls::JlsReadError) -> ReadError {
    let path = path.to_owned();
    match error {
        ::jls::JlsReadError::Io(source) => ReadError::Io { path, source },
        ::jls::JlsReadError::NewerVersion => ReadError::Format {
            path,
            found: "a JLS recording of a newer version",
            remedy: "export it with pyjls or the Joulescope UI to CSV or Parquet".to_owned(),
        },
        ::jls::JlsReadError::Damaged(reason) => ReadError::Damaged { path, format: "JLS", reason },
        ::jls::JlsReadError::SampleType { signal, found } => {
            ReadError::ColumnType { path, column: signal, found, must: SAMPLE_TYPES }
        }
        ::jls::JlsReadError::Gap { samples, jump, rate_hz, .. } => ReadError::Uneven {
            path,
            row: samples + 1,
            time_s: (samples as f64 + jump as f64) / f64::from(rate_hz),
            off_periods: jump as f64,
            rate_hz: f64::from(rate_hz),
        },
    }
}

/// Factor from the unit of a signal to A, V or W; `None` for other units.
fn scale(signal: &Signal) -> Option<f64> {
    units::jls_unit(&signal.unit)
}

/// Whether a signal can be part of a trace: ranges, inputs, charge and energy cannot.
fn is_channel(signal: &Signal) -> bool {
    scale(signal).is_some() || signal.unit.is_empty() && signal.is_float()
}

/// The names of signals, with those of their sources before them where there are several.
fn names(reader: &Reader, signals: &[&Signal]) -> Vec<String> {
    let several = signals.iter().any(|signal| signal.source != signals[0].source);
    let name = |signal: &&Signal| match reader.source(signal).filter(|_| several) {
        Some(source) => format!("{}.{}", source.name(), signal.name),
        None => signal.name.clone(),
    };
    signals.iter().map(name).collect()
}

/// The instrument of a signal: vendor, model and serial number, or else its name.
fn device(reader: &Reader, signal: &Signal) -> String {
    let Some(source) = reader.source(signal) else { return String::new() };
    let texts = [source.vendor(), source.model(), source.serial_number()];
    let stated: Vec<&str> = texts.into_iter().filter(|text| !text.is_empty()).collect();
    if stated.is_empty() { source.name().to_owned() } else { stated.join(" ") }
}

/// Opens a file.
pub(super) fn open_rows(path: &Path, options: &ReadOptions) -> Result<Opened, ReadError> {
    let (rows, layout, description) = JlsRows::open(path, options)?;
    Ok(Opened { rows: Box::new(rows), layout, description, time: TIME_S })
}

impl JlsRows {
    fn open(path: &Path, options: &ReadOptions) -> Result<(Self, Layout, Description), ReadError> {
        let refuse = |error| read_error(path, error);
        let mut reader = Reader::open(path).map_err(refuse)?;
        let signals: Vec<&Signal> = reader.signals().iter().filter(|signal| is_channel(signal)).collect();
        let names = names(&reader, &signals);
        let mut layout = layout(path, &names, options)?;
        // Rates are fixed: no signal holds times.
        layout.time = None;
        let mut tracks = Vec::with_capacity(layout.values.len());
        for picked in &mut layout.values {
            let signal = signals[picked.index];
            picked.scale = scale(signal).unwrap_or(picked.scale);
            picked.has_unit |= scale(signal).is_some();
            let samples = reader.samples(signal).map_err(refuse)?;
            tracks.push(Track { name: signal.name.clone(), rate_hz: signal.rate_hz, samples });
        }
        let trimmed = if options.repair {
            trim(path, &mut tracks)?
        } else {
            check_same_extent(path, &tracks).map(|()| None)?
        };
        let count = tracks.first().map_or(0, |track| track.samples.remaining());
        let mut description = Description::default();
        if let (Some(track), Some(picked)) = (tracks.first(), layout.values.first()) {
            description.metadata.device = device(&reader, signals[picked.index]);
            let described = stated_description(path, &mut reader)?.unwrap_or(description);
            description = placed(described, f64::from(track.rate_hz), track.samples.next_sample());
            description.rate_hz = description.rate_hz.filter(|&rate_hz| rate_hz > 0.0);
        }
        let path = path.to_owned();
        Ok((Self { path, names, tracks, count, trimmed }, layout, description))
    }
}

impl RowSource for JlsRows {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn count(&self) -> Option<u64> {
        Some(self.count)
    }

    /// The samples left out, and when, by the rate and start of the description.
    fn repair(&self, description: &Description) -> Option<Repair> {
        let mut trimmed = self.trimmed.clone()?;
        trimmed.time_s = description.time_s(trimmed.row as usize - 1);
        trimmed.message += &format!("; row {} is at {} s", trimmed.row, trimmed.time_s);
        Some(trimmed)
    }

    fn skip(&mut self, rows: u64) -> Result<(), ReadError> {
        let skip = |track: &mut Track| track.samples.skip(rows);
        self.tracks.iter_mut().try_for_each(skip).map_err(|error| read_error(&self.path, error))
    }

    fn next(&mut self, _: &Layout, limit: usize, batch: &mut RowBatch) -> Result<usize, ReadError> {
        batch.stamps = Stamps::Absent;
        let each = self.tracks.par_iter_mut().zip(&mut batch.values);
        let read: Vec<_> = each.map(|(track, list)| track.samples.read(limit, list)).collect();
        // All have as many: each was checked against its own number, and the numbers are equal.
        read.into_iter().try_fold(0, |_, rows| rows).map_err(|error| read_error(&self.path, error))
    }
}

/// Trims signals of one rate, which need not begin and end together, to what all have.
fn trim(path: &Path, tracks: &mut [Track]) -> Result<Option<Repair>, ReadError> {
    let from = tracks.iter().map(|track| i128::from(track.samples.first())).max().unwrap_or(0);
    let to = tracks.iter().map(|track| track.samples.end()).min().unwrap_or(0);
    let longest = tracks.iter().map(|track| track.samples.count()).max().unwrap_or(0);
    let rate_hz = tracks.first().map_or(0, |track| track.rate_hz);
    let kept = u64::try_from(to - from).unwrap_or(0);
    // Where they begin together, only samples after the last row are left out.
    let together = tracks.iter().all(|track| i128::from(track.samples.first()) == from);
    let row = if together { kept } else { 1 };
    if kept == longest || kept == 0 || tracks.iter().any(|track| track.rate_hz != rate_hz) {
        return check_same_extent(path, tracks).map(|()| None);
    }
    let trim = |track: &mut Track| track.samples.limit_to(from, to);
    tracks.iter_mut().try_for_each(trim).map_err(|error| read_error(path, error))?;
    let count = longest - kept;
    let message = format!(
        "signals do not begin and end together: the {kept} samples from number {from} on are read, which all have; the \
         longest signal has {count} more"
    );
    Ok(Some(Repair { code: RepairKind::CutSignals, row, time_s: 0.0, count, message }))
}

/// Refuses signals that do not make up rows: of different rates, or from other samples to others.
fn check_same_extent(path: &Path, tracks: &[Track]) -> Result<(), ReadError> {
    let Some((one, others)) = tracks.split_first() else { return Ok(()) };
    let key = |track: &Track| (track.rate_hz, track.samples.first(), track.samples.count());
    let extent = |track: &Track| {
        let (name, rate_hz) = (&track.name, track.rate_hz);
        let (rows, first) = (track.samples.count(), track.samples.first());
        format!("{name} has {rows} samples from number {first} on at {rate_hz} Hz")
    };
    match others.iter().find(|other| key(other) != key(one)) {
        Some(other) => {
            Err(ReadError::Signals { path: path.to_owned(), one: extent(one), other: extent(other) })
        }
        None => Ok(()),
    }
}

/// The description that our own writer put among the user data, if it is there.
fn stated_description(path: &Path, reader: &mut Reader) -> Result<Option<Description>, ReadError> {
    let mut found = Ok(None);
    let read = reader.each_json(|json| {
        if matches!(found, Ok(None)) {
            found = Description::from_keyed_json(path, json);
        }
    });
    read.map_err(|error| read_error(path, error))?;
    found
}

/// A description moved to the samples from number `first` on at `rate_hz`. If it is of another rate, another
/// program has resampled our samples, and their times are unknown.
fn placed(mut description: Description, rate_hz: f64, first: i128) -> Description {
    // The number of samples is checked by the file itself.
    description.samples = None;
    match description.rate_hz.filter(|stated_hz| (stated_hz - rate_hz).abs() <= 0.5) {
        Some(stated_hz) => {
            description.start_s = description.start_s.map(|start_s| start_s + first as f64 / stated_hz);
        }
        None => (description.rate_hz, description.start_s) = (Some(rate_hz), None),
    }
    description
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::Rows;
    use std::path::PathBuf;

    #[test]
    fn a_description_counts_from_sample_0_and_only_at_its_own_rate() {
        let stated = || Description {
            rate_hz: Some(999.6),
            start_s: Some(5.0),
            samples: Some(3),
            ..Description::default()
        };
        let of = |description: Description| (description.rate_hz, description.start_s, description.samples);
        assert_eq!(of(placed(stated(), 1000.0, 0)), (Some(999.6), Some(5.0), None));
        assert_eq!(of(placed(stated(), 1000.0, 2499)), (Some(999.6), Some(7.5), None));
        assert_eq!(of(placed(stated(), 1001.0, 2499)), (Some(1001.0), None, None));
        assert_eq!(of(placed(Description::default(), 50.0, 7)), (Some(50.0), None, None));
    }

    fn file() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign/pyjls.jls")
    }

    /// All samples after some skips, voltages before currents.
    fn samples_after(skip: &[u64], limit: usize) -> Vec<f32> {
        let mut rows = Rows::open(&file(), &ReadOptions::default()).unwrap();
        skip.iter().for_each(|&skipped| rows.skip(skipped).unwrap());
        let (mut voltage_v, mut current_a, mut batch) = (Vec::new(), Vec::new(), RowBatch::default());
        while rows.append(limit, &mut batch, &mut voltage_v, &mut current_a).unwrap() > 0 {}
        assert_eq!(voltage_v.len(), current_a.len());
        voltage_v.extend(current_a);
        voltage_v
    }

    #[test]
    fn rows_in_pieces_after_any_skip_are_those_of_the_whole() {
        let whole = samples_after(&[], 10_000);
        assert_eq!(whole.len(), 2 * 3003);
        for limit in [1, 159, 160, 161, 1000] {
            assert_eq!(samples_after(&[], limit), whole);
        }
        for skip in [1, 159, 160, 161, 320, 1000, 2879, 2880, 2881, 3002, 3003] {
            let left = [&whole[skip..3003], &whole[3003 + skip..]].concat();
            assert_eq!(samples_after(&[skip as u64], 700), left, "{skip}");
            assert_eq!(samples_after(&[1, skip as u64 - 1], 700), left, "{skip}");
        }
        assert!(samples_after(&[5000], 10).is_empty());
    }

    #[test]
    fn a_skip_between_pieces_goes_on_from_there() {
        let whole = samples_after(&[], 10_000);
        let Opened { mut rows, layout, .. } = open_rows(&file(), &ReadOptions::default()).unwrap();
        let mut batch = RowBatch { values: vec![Vec::new(); 2], ..RowBatch::default() };
        assert_eq!(rows.next(&layout, 100, &mut batch).unwrap(), 100);
        rows.skip(1500).unwrap();
        batch.values.iter_mut().for_each(Vec::clear);
        assert_eq!(rows.next(&layout, 100, &mut batch).unwrap(), 100);
        assert_eq!(batch.values, [&whole[1600..1700], &whole[3003 + 1600..3003 + 1700]]);
    }
}
