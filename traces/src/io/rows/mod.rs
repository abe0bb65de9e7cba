//! Rows of a file in pieces, so that no file has to fit into memory.

mod asked;
mod csv;
mod jls;
mod lines;
mod packed;
mod parquet;
mod power;
mod sums;
mod zstd;

pub(crate) use packed::PackedFile;
pub(crate) use parquet::units as field_units;
pub use sums::{SumOfRails, rail_of_sums};

use super::columns::Layout;
use super::header::Header;
use super::timing::Stamps;
use super::{ReadError, ReadOptions, Repair};
use crate::metadata::Metadata;
use std::fs::File;
use std::io::Read;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// The first bytes of formats that are not read, and what to do about them.
const FOREIGN: [(&[u8], &str, &str); 6] = [
    (b"\xd3tagfmt", "a JLS recording of version 1", "export it to CSV from the program that made it"),
    (b"\x89HDF\r\n", "an HDF5 file", "export its channels to CSV or Parquet"),
    (
        b"PK\x03\x04",
        "an archive (sigrok .sr, .ppk2 or a spreadsheet)",
        "export it to CSV from its own program",
    ),
    (b"\x89PNG", "a PNG image", TRACE_FORMATS),
    (b"\xff\xd8\xff", "a JPEG image", TRACE_FORMATS),
    (b"%PDF", "a PDF document", TRACE_FORMATS),
];
const TRACE_FORMATS: &str = "give a trace in Parquet, JLS, CSV or TSV";

/// Whether these bytes are none of a text: control characters other than white space. Those of UTF-16 are not either.
fn is_binary(start: &[u8]) -> bool {
    start.iter().any(|byte| byte.is_ascii_control() && !byte.is_ascii_whitespace())
}

/// Some rows.
#[derive(Debug)]
pub(crate) struct Chunk {
    /// When they were taken, empty where the file does not say.
    pub stamps: Stamps,
    /// One list per column of the layout, as they stand in the file.
    values: Vec<Vec<f32>>,
}

impl Default for Chunk {
    fn default() -> Self {
        Self { stamps: Stamps::Absent, values: Vec::new() }
    }
}

enum Source {
    Csv(Box<csv::CsvRows>),
    Jls(Box<jls::JlsRows>),
    Parquet(Box<parquet::ParquetRows>),
}

/// A file being read.
pub struct Rows {
    path: PathBuf,
    source: Source,
    layout: Layout,
    pub(crate) header: Header,
    repair: bool,
}

impl Rows {
    /// Opens Parquet, JLS, CSV, TSV, or the latter two compressed with gzip; which it is, its first bytes tell.
    ///
    /// # Errors
    /// [`ReadError`] if there is no such file, it is of no known format, or columns are missing.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        let rows = Self::of_kind(path, options)?;
        asked::check_times(&rows, options)?;
        Ok(rows)
    }

    fn of_kind(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        match first_bytes(path)? {
            start if start.starts_with(b"PAR1") => Self::parquet(path, options),
            start if start.starts_with(b"jlsfmt\r\n") => Self::jls(path, options),
            start => match FOREIGN.iter().find(|(magic, _, _)| start.starts_with(magic)) {
                Some((_, found, mend)) => Err(ReadError::Format { path: path.to_owned(), found, mend }),
                None if is_binary(&start) && !start.starts_with(&[0x1f, 0x8b]) => {
                    let found = "a binary file of an unknown kind";
                    Err(ReadError::Format { path: path.to_owned(), found, mend: TRACE_FORMATS })
                }
                None => Self::csv(path, options, start.starts_with(&[0x1f, 0x8b])),
            },
        }
    }

    pub(crate) fn parquet(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        let opened = catch_unwind(AssertUnwindSafe(|| parquet::ParquetRows::open(path, options)));
        let (source, layout, header) = opened.unwrap_or_else(|_| Err(gave_up(path)))?;
        Self::new(path, Source::Parquet(Box::new(source)), layout, header, options, "time_ns")
    }

    pub(crate) fn csv(path: &Path, options: &ReadOptions, gzip: bool) -> Result<Self, ReadError> {
        let (source, layout, header) = csv::CsvRows::open(path, options, gzip)?;
        Self::new(path, Source::Csv(Box::new(source)), layout, header, options, "time_s")
    }

    fn jls(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        let (source, layout, header) = jls::JlsRows::open(path, options)?;
        Self::new(path, Source::Jls(Box::new(source)), layout, header, options, "time_s")
    }

    fn new(
        path: &Path,
        source: Source,
        layout: Layout,
        mut header: Header,
        options: &ReadOptions,
        time: &str,
    ) -> Result<Self, ReadError> {
        asked::check(path, &layout, &header, options)?;
        header.rate_hz = options.rate_hz.or(header.rate_hz);
        header.start_s = options.start_s.or(header.start_s);
        if layout.time.is_none() && header.rate_hz.is_none() {
            let found = source.names().join(", ");
            return Err(ReadError::MissingColumn { path: path.to_owned(), column: time.to_owned(), found });
        }
        if layout.names.len() > 1 {
            header.metadata.other.insert("rails".to_owned(), layout.names.clone().into());
        }
        Ok(Self { path: path.to_owned(), source, layout, header, repair: options.repair })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the file says about itself.
    pub fn metadata(&self) -> &Metadata {
        &self.header.metadata
    }

    /// How many rows there are, where the file says so before it has been read.
    pub fn count(&self) -> Option<u64> {
        match &self.source {
            Source::Csv(_) => None,
            Source::Jls(rows) => Some(rows.count()),
            Source::Parquet(rows) => Some(rows.count()),
        }
    }

    /// Names the first value that is not finite, if one is; `first` is the number of rows before these.
    pub(crate) fn check_finite(
        &self,
        voltage_v: &[f32],
        current_a: &[f32],
        first: u64,
    ) -> Result<(), ReadError> {
        for (values, column) in [(voltage_v, "voltage_V"), (current_a, "current_A")] {
            // Without a way out on the way, so that many are held at once; the place is looked for only then.
            if values.iter().fold(true, |all, value| all & value.is_finite()) {
                continue;
            }
            if let Some(at) = values.iter().position(|value| !value.is_finite()) {
                return Err(ReadError::Value {
                    path: self.path.clone(),
                    row: first + at as u64 + 1,
                    column: column.to_owned(),
                    value: values[at].to_string(),
                });
            }
        }
        Ok(())
    }

    /// What was mended when the file was opened and in the rows read since.
    pub(crate) fn repair(&self) -> Option<Repair> {
        match &self.source {
            Source::Csv(rows) => rows.repair(&self.header),
            Source::Jls(rows) => rows.cut(&self.header),
            Source::Parquet(_) => None,
        }
    }

    /// Names of the columns that are read, in order: of the trace's rails.
    pub fn rails(&self) -> &[String] {
        &self.layout.names
    }

    /// Whether what is wrong is to be mended.
    pub(crate) fn mends(&self) -> bool {
        self.repair
    }

    /// Leaves out the next rows.
    pub(crate) fn skip(&mut self, rows: u64) -> Result<(), ReadError> {
        let path = self.path.clone();
        match &mut self.source {
            Source::Csv(source) => source.skip(rows),
            Source::Jls(source) => source.skip(rows),
            Source::Parquet(source) => {
                catch_unwind(AssertUnwindSafe(|| source.skip(rows))).unwrap_or_else(|_| Err(gave_up(&path)))
            }
        }
    }

    /// Reads up to `limit` rows over what `chunk` held before; how many there were, 0 at the end.
    pub(crate) fn next(&mut self, limit: usize, chunk: &mut Chunk) -> Result<usize, ReadError> {
        chunk.values.resize_with(self.layout.values.len(), Vec::new);
        chunk.values.iter_mut().for_each(Vec::clear);
        self.read(limit, chunk)
    }

    /// Reads up to `limit` rows and appends them, all rails together, to voltages (V) and currents (A); how many there were.
    pub(crate) fn append(
        &mut self,
        limit: usize,
        chunk: &mut Chunk,
        voltage_v: &mut Vec<f32>,
        current_a: &mut Vec<f32>,
    ) -> Result<usize, ReadError> {
        let (Source::Parquet(_), Some([voltage, current])) = (&self.source, self.layout.as_they_stand())
        else {
            let read = self.next(limit, chunk)?;
            self.channels(chunk, voltage_v, current_a);
            return Ok(read);
        };
        // Decoded where they belong: copies of long traces cost a twentieth of all.
        chunk.values.resize_with(self.layout.values.len(), Vec::new);
        let mut exchange = |chunk: &mut Chunk| {
            std::mem::swap(&mut chunk.values[voltage], voltage_v);
            std::mem::swap(&mut chunk.values[current], current_a);
        };
        exchange(chunk);
        let read = self.read(limit, chunk);
        exchange(chunk);
        read
    }

    /// Appends up to `limit` rows to what `chunk` holds of values; the stamps are those of these rows alone.
    fn read(&mut self, limit: usize, chunk: &mut Chunk) -> Result<usize, ReadError> {
        let path = &self.path;
        match &mut self.source {
            Source::Csv(source) => source.next(&self.layout, limit, self.repair, chunk),
            Source::Jls(source) => source.next(limit, chunk),
            Source::Parquet(source) => {
                let read = catch_unwind(AssertUnwindSafe(|| source.next(limit, chunk)));
                read.unwrap_or_else(|_| Err(gave_up(path)))
            }
        }
    }
}

impl Source {
    fn names(&self) -> &[String] {
        match self {
            Self::Csv(rows) => rows.names(),
            Self::Jls(rows) => rows.names(),
            Self::Parquet(rows) => rows.names(),
        }
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

/// What is said where the decoder of Parquet panicked: it does on some damaged files.
fn gave_up(path: &Path) -> ReadError {
    ReadError::Damaged { path: path.to_owned(), format: "Parquet", reason: "its decoder gave up".to_owned() }
}
