//! Reading a file: whole, or in pieces as often as its samples are needed.

use std::path::{Path, PathBuf};

use super::columns::RowBatch;
use super::repair::{Columns, Repair, repair_rows};
use super::rows::Rows;
use super::samples::{TraceChunk, TraceHeader, TraceReader, TraceWriter};
use super::time_base::{Fit, Fitted, Stamps};
use super::{ReadError, ReadOptions, WriteError, time_base};
use crate::trace::{Metadata, Trace, check_times};

/// Rows read at once.
const PIECE_ROWS: usize = 1 << 18;

/// A file that was checked once and is a trace: finite samples at an even rate, as many as it states. It
/// holds what [`read`](super::read()) would return, except the samples.
#[derive(Clone, Debug)]
pub struct TraceFile {
    path: PathBuf,
    options: ReadOptions,
    /// Rows read at once.
    piece: usize,
    header: TraceHeader,
    repairs: Vec<Repair>,
}

impl TraceFile {
    /// Reads a file through, once.
    ///
    /// # Errors
    /// [`ReadError`] as [`read`](super::read()) without [`ReadOptions::repair`]: repairs need the whole trace.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        Self::in_pieces(path, options, PIECE_ROWS)
    }

    fn in_pieces(path: &Path, options: &ReadOptions, piece: usize) -> Result<Self, ReadError> {
        let seen = Seen::of(path, options, piece, None)?;
        let Fitted { mut grid, sure } = seen.fit.conclude()?;
        if !sure {
            grid = Seen::of(path, options, piece, Some(grid.rate_hz))?.fit.conclude()?.grid;
        }
        check_times(seen.rows, grid.rate_hz, grid.start_s).map_err(|error| ReadError::trace(path, error))?;
        if let Some(error) = seen.voltage.or(seen.current).or(seen.end) {
            return Err(error);
        }
        let header = TraceHeader {
            start_s: grid.start_s,
            rate_hz: grid.rate_hz,
            samples: seen.rows,
            lost_samples: 0,
            lost_at_end: 0,
            metadata: seen.metadata,
        };
        Ok(Self { path: path.to_owned(), options: options.clone(), piece, header, repairs: seen.repairs })
    }

    /// The repairs made when the file was checked.
    pub fn repairs(&self) -> &[Repair] {
        &self.repairs
    }

    fn changed(&self) -> WriteError {
        WriteError::Read(ReadError::Changed { path: self.path.clone() })
    }
}

/// The result of one pass over all rows.
struct Seen {
    fit: Fit,
    rows: u64,
    metadata: Metadata,
    repairs: Vec<Repair>,
    /// The first value of each channel that is not finite.
    voltage: Option<ReadError>,
    current: Option<ReadError>,
    /// The error at the end of a recording that is whole up to there.
    end: Option<ReadError>,
}

impl Seen {
    fn of(path: &Path, options: &ReadOptions, limit: usize, rate_hz: Option<f64>) -> Result<Self, ReadError> {
        let mut rows = Rows::open(path, options)?;
        let mut fit = Fit::new(path, rate_hz.or(rows.description.rate_hz), rows.description.start_s);
        let (mut voltage, mut current, mut count) = (None, None, 0);
        let (mut batch, mut piece) = (RowBatch::default(), Piece::default());
        while piece.read(&mut rows, limit, &mut batch)? > 0 {
            fit.push(&batch.stamps);
            voltage = voltage.or_else(|| rows.check_finite(&piece.voltage_v, &[], count).err());
            current = current.or_else(|| rows.check_finite(&[], &piece.current_a, count).err());
            count += piece.voltage_v.len() as u64;
        }
        if count == 0 {
            return Err(ReadError::Empty { path: path.to_owned() });
        }
        rows.description.check_rows(path, count)?;
        let (repairs, end) = (rows.repair().into_iter().collect(), rows.description.check_end(path).err());
        Ok(Self { fit, rows: count, metadata: rows.description.metadata, repairs, voltage, current, end })
    }
}

/// The current samples.
#[derive(Default)]
struct Piece {
    voltage_v: Vec<f32>,
    current_a: Vec<f32>,
}

impl Piece {
    /// Reads the next samples over those before; how many rows there were, 0 at the end.
    fn read(&mut self, rows: &mut Rows, limit: usize, batch: &mut RowBatch) -> Result<usize, ReadError> {
        self.voltage_v.clear();
        self.current_a.clear();
        rows.append(limit, batch, &mut self.voltage_v, &mut self.current_a)
    }
}

impl TraceReader for TraceFile {
    fn header(&self) -> TraceHeader {
        self.header.clone()
    }

    fn read_into(&self, writer: &mut dyn TraceWriter) -> Result<(), WriteError> {
        let mut rows = Rows::open(&self.path, &self.options)?;
        let (mut piece, mut coming, mut batch) = (Piece::default(), Piece::default(), RowBatch::default());
        let (mut first, mut read) = (0, piece.read(&mut rows, self.piece, &mut batch)?);
        while read > 0 {
            let Piece { voltage_v, current_a } = &piece;
            if rows.check_finite(voltage_v, current_a, first).is_err() {
                return Err(self.changed());
            }
            let chunk = TraceChunk { first, voltage_v, current_a, lost: false };
            // The next rows are decoded while these are taken.
            let (next, taken) =
                rayon::join(|| coming.read(&mut rows, self.piece, &mut batch), || writer.write(&chunk));
            taken?;
            (first, read) = (first + chunk.len() as u64, next?);
            std::mem::swap(&mut piece, &mut coming);
        }
        if first == self.header.samples { Ok(()) } else { Err(self.changed()) }
    }
}

/// A trace and its repairs.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The trace.
    pub trace: Trace,
    /// The repairs; always empty without [`ReadOptions::repair`].
    pub repairs: Vec<Repair>,
}

/// Reads a trace in any of the [`FORMATS`](super::FORMATS) that are read; the first bytes of the file decide which.
///
/// # Errors
/// [`ReadError`] names the file, the row and what to do.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Loaded, ReadError> {
    load(Rows::open(path, options)?)
}

/// Opens a trace of any length: as a [`TraceFile`], or in memory where it has to be repaired, as repairs
/// depend on all of it. Also returns the repairs.
///
/// # Errors
/// As [`read`].
pub fn open(path: &Path, options: &ReadOptions) -> Result<(Box<dyn TraceReader>, Vec<Repair>), ReadError> {
    match TraceFile::open(path, options) {
        Ok(recording) => {
            let repairs = recording.repairs().to_vec();
            Ok((Box::new(recording), repairs))
        }
        Err(_) if options.repair => {
            let Loaded { trace, repairs } = read(path, options)?;
            Ok((Box::new(trace), repairs))
        }
        Err(error) => Err(error),
    }
}

pub(super) fn load(mut rows: Rows) -> Result<Loaded, ReadError> {
    let path = rows.path().to_owned();
    let mut columns = gather(&mut rows)?;
    let read = columns.voltage_v.len();
    if read == 0 {
        return Err(ReadError::Empty { path });
    }
    rows.description.check_rows(&path, read as u64)?;
    let mut repairs: Vec<Repair> = rows.repair().into_iter().collect();
    let mut description = std::mem::take(&mut rows.description);
    if rows.repairs_input() {
        repairs.extend(repair_rows(&path, &rows.channel_names(), &mut columns, &mut description)?);
    }
    let Columns { stamps, voltage_v, current_a } = columns;
    let grid = time_base::grid(&path, &stamps, &description)?;
    if !rows.repairs_input() {
        description.check_end(&path)?;
    }
    rows.check_finite(&voltage_v, &current_a, 0)?;
    let trace = Trace::new(voltage_v, current_a, grid.rate_hz, grid.start_s, description.metadata)
        .map_err(|error| ReadError::trace(&path, error))?;
    Ok(Loaded { trace, repairs })
}

fn gather(rows: &mut Rows) -> Result<Columns, ReadError> {
    let mut all = Columns { stamps: Stamps::Absent, voltage_v: Vec::new(), current_a: Vec::new() };
    let mut batch = RowBatch::default();
    while rows.append(PIECE_ROWS, &mut batch, &mut all.voltage_v, &mut all.current_a)? > 0 {
        match (&mut all.stamps, &batch.stamps) {
            (Stamps::Nanoseconds(all), Stamps::Nanoseconds(more)) => all.extend_from_slice(more),
            (Stamps::Seconds(all), Stamps::Seconds(more)) => all.extend_from_slice(more),
            (all, more) => *all = more.clone(),
        }
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;
    use std::fs;

    use proptest::prelude::*;

    use super::*;
    use crate::io::{csv, parquet, read};
    use crate::trace::Trace;

    /// A fault of a file, with its row.
    #[derive(Clone, Copy, Debug)]
    enum Fault {
        None,
        Gap(usize),
        Back(usize),
        Off(usize),
        NoValue(usize),
        Endless(usize),
        Drift,
        Rows,
    }

    fn fault() -> impl Strategy<Value = Fault> {
        let row = 1..2999_usize;
        prop_oneof![
            3 => Just(Fault::None),
            1 => row.clone().prop_map(Fault::Gap),
            1 => row.clone().prop_map(Fault::Back),
            1 => row.clone().prop_map(Fault::Off),
            1 => row.clone().prop_map(Fault::NoValue),
            1 => row.prop_map(Fault::Endless),
            1 => Just(Fault::Drift),
            1 => Just(Fault::Rows),
        ]
    }

    const SAMPLES: usize = 3000;

    /// A text with one or two faults; `mW` columns make powers that are beyond f32 where they are added up.
    fn text(rate_hz: f64, digits: usize, faults: &[Fault]) -> String {
        let mut text = "time_s,a_power_W,b_power_W\n".to_owned();
        for row in 0..SAMPLES {
            let (mut time_s, mut watts) = (2.5 + row as f64 / rate_hz, format!("{}", row % 77));
            for fault in faults {
                match *fault {
                    Fault::Gap(at) if row >= at => time_s += 7.0 / rate_hz,
                    Fault::Back(at) if row == at => time_s -= 3.0 / rate_hz,
                    Fault::Off(at) if row == at => time_s += 0.4 / rate_hz,
                    Fault::NoValue(at) if row == at => watts = "nan".to_owned(),
                    Fault::Endless(at) if row == at => watts = "3e38".to_owned(),
                    Fault::Drift => time_s += (row as f64).powi(2) / rate_hz * 2e-6,
                    _ => {}
                }
            }
            let other = if watts == "3e38" { "2e38" } else { "1.5" };
            writeln!(text, "{time_s:.digits$},{watts},{other}").unwrap();
        }
        text
    }

    /// Content of a file, or its fault.
    fn outcome(trace: &dyn TraceReader, folder: &Path) -> Vec<Vec<u8>> {
        let name = |end: &str| folder.join(format!("out.{end}"));
        parquet::save(trace, &name("parquet")).unwrap();
        csv::save(trace, &name("csv")).unwrap();
        csv::save_as(trace, &name("tsv.gz"), b'\t', true).unwrap();
        ["parquet", "csv", "csv.json", "tsv.gz", "tsv.gz.json"].map(|end| fs::read(name(end)).unwrap()).into()
    }

    fn both(path: &Path, options: &ReadOptions, piece: usize) -> Result<(), TestCaseError> {
        let folder = tempfile::tempdir().unwrap();
        let whole = read(path, options).map(|loaded| loaded.trace);
        let pieces = TraceFile::in_pieces(path, options, piece);
        match (whole, pieces) {
            (Ok(whole), Ok(pieces)) => {
                prop_assert_eq!(whole.header(), pieces.header());
                prop_assert!(outcome(&whole, folder.path()) == outcome(&pieces, folder.path()));
            }
            (whole, pieces) => {
                let said = pieces.map(|_| "nothing".to_owned()).unwrap_or_else(|error| error.to_string());
                let says = whole.map(|_| "nothing".to_owned()).unwrap_or_else(|error| error.to_string());
                prop_assert_eq!(said, says);
            }
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(96))]
        #[test]
        fn property_a_text_in_pieces_is_what_it_is_in_memory(
            rate_hz in prop_oneof![Just(1000.0), Just(44_117.65), 10.0..1e5_f64],
            digits in prop_oneof![Just(6_usize), Just(9)],
            faults in prop::collection::vec(fault(), 1..3),
            stated in any::<bool>(),
            piece in prop_oneof![1_usize..50, 900..1100_usize, Just(2999), Just(5000)],
        ) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("t.csv");
            fs::write(&path, text(rate_hz, digits, &faults)).unwrap();
            let rows = if faults.iter().any(|fault| matches!(fault, Fault::Rows)) { 2999 } else { SAMPLES };
            if stated {
                let json = format!(r#"{{"rate_hz": {rate_hz}, "start_s": 2.5, "samples": {rows}, "scene": "x"}}"#);
                fs::write(csv::sidecar_path(&path), json).unwrap();
            }
            both(&path, &ReadOptions::default(), piece)?;
        }

        #[test]
        fn property_a_table_in_pieces_is_what_it_is_in_memory(
            rate_hz in prop_oneof![Just(50e3), Just(44_117.65), Just(3e6), 10.0..1e5_f64],
            lost in prop_oneof![Just(None), (1..2999_usize, 1..40_usize).prop_map(Some)],
            spoilt in prop_oneof![Just(None), (0..3000_usize).prop_map(Some)],
            described in any::<bool>(),
            piece in prop_oneof![1_usize..50, 900..1100_usize, Just(2999), Just(5000)],
        ) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("t.parquet");
            let ramp: Vec<f32> = (0..SAMPLES).map(|i| (i % 977) as f32 * 0.25).collect();
            let trace = Trace::new(ramp.clone(), ramp, rate_hz, -1.0, Metadata::default()).unwrap();
            let trace = trace.without(lost.map(|(from, length)| from..from + length));
            if described { parquet::save(&trace, &path).unwrap() } else { parquet::bare(&trace, &path).unwrap() }
            let fixed_voltage_v = spoilt.map(|row| if row % 2 == 0 { 5.0 } else { f64::INFINITY });
            both(&path, &ReadOptions { fixed_voltage_v, ..ReadOptions::default() }, piece)?;
        }
    }

    #[test]
    fn a_file_that_changes_between_passes_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let (path, out) = (folder.path().join("t.csv"), folder.path().join("out.parquet"));
        fs::write(&path, text(1000.0, 9, &[])).unwrap();
        let recording = TraceFile::open(&path, &ReadOptions::default()).unwrap();
        fs::write(&path, text(1000.0, 9, &[]) + "5.5,1,1\n").unwrap();
        let message = parquet::save(&recording, &out).unwrap_err().to_string();
        assert!(message.contains("t.csv: changed while it was read"), "{message}");
        fs::write(&path, text(1000.0, 9, &[Fault::Endless(2000)])).unwrap();
        let message = parquet::save(&recording, &out).unwrap_err().to_string();
        assert!(message.contains("t.csv: changed"), "{message}");
        fs::remove_file(&path).unwrap();
        assert!(csv::save(&recording, &out).unwrap_err().to_string().contains("t.csv: cannot read it"));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
