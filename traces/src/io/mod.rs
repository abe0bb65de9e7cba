//! Trace files: one file or folder per format, with its reader and its writer.
//!
//! [`FORMATS`] lists all of them: one table for readers, writers, the command, its help and its errors.
//! [`read`] reads a file, as [`ReadOptions`] say; [`Rows`] reads one in pieces that does not fit into memory.
//! [`save`] and the modules of the formats write a [`TraceReader`]: a trace in memory, or a [`TraceFile`], a
//! file of any length. [`perfetto`] also writes timelines of frames and units.

pub mod atomic;
mod columns;
pub mod csv;
mod error;
pub mod jls;
pub mod parquet;
pub mod perfetto;
mod recording;
mod repair;
mod rows;
mod samples;
mod time_base;

use columns::Open;
use std::path::{Path, PathBuf};

pub use error::{ReadError, WriteError};
pub use recording::{Loaded, TraceFile, open, read};
pub use repair::{Repair, RepairKind};
pub use rows::{Rows, SumOfRails, rail_of_sums, unread_power_ratio};
#[cfg(test)]
pub(crate) use samples::SplitTrace;
pub use samples::{TraceChunk, TraceHeader, TraceReader, TraceWriter};

pub(crate) use columns::RowBatch;
pub(crate) use parquet::{PagedFile, field_units};
pub(crate) use time_base::{Stamps, all_apart, grid, rate_of_steps_hz, rate_to_last_row_hz};

/// The names of the columns that files are written with; read without regard to case.
pub const COLUMNS: [&str; 4] = [TIME_NS, TIME_S, VOLTAGE_V, CURRENT_A];
pub(crate) const TIME_NS: &str = "time_ns";
pub(crate) const TIME_S: &str = "time_s";
pub(crate) const VOLTAGE_V: &str = "voltage_V";
pub(crate) const CURRENT_A: &str = "current_A";
pub(crate) const POWER_W: &str = "power_W";

/// How to read a file. By default all rails that the names of the columns show are added up, and nothing is
/// repaired.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Rails to add up, by name; all of them if empty.
    pub rails: Vec<String>,
    /// The column of times, by name or by number from 1; by default found by its name.
    pub time: Option<String>,
    /// The column of voltages, likewise.
    pub voltage: Option<String>,
    /// The column of currents, likewise.
    pub current: Option<String>,
    /// A column of powers in place of voltage and current, likewise.
    pub power: Option<String>,
    /// Voltage by specification, V, in place of a measured one.
    pub fixed_voltage_v: Option<f64>,
    /// Samples per second, in place of the rate in the file and of its times, Hz.
    pub rate_hz: Option<f64>,
    /// Left edge of the first sample of a file without times, s.
    pub start_s: Option<f64>,
    /// Delimiter between the fields of a text; by default guessed from its first line.
    pub delimiter: Option<u8>,
    /// Whether the first line of a text holds names; by default it does unless all its fields are numbers.
    pub header: Option<bool>,
    /// Whether to repair non-finite values, unsorted rows and missing samples.
    pub repair: bool,
}

impl ReadOptions {
    /// Whether columns are chosen by hand, so that their names need no meaning.
    fn by_hand(&self) -> bool {
        self.voltage.is_some() || self.current.is_some() || self.power.is_some()
    }
}

type Save = fn(&dyn TraceReader, &Path) -> Result<(), WriteError>;

/// A format of trace files.
#[derive(Debug)]
pub struct TraceFormat {
    /// Ending of the names of its files, without the dot.
    pub ending: &'static str,
    /// Name in help and messages.
    pub name: &'static str,
    /// Whether a terminal can show its files.
    pub is_text: bool,
    /// Largest number of samples in a file; longer traces are thinned out.
    pub max_samples: Option<u64>,
    /// First bytes of its files; texts without compression have none.
    magic: Option<&'static [u8]>,
    open: Option<Open>,
    save: Save,
    description_path: Option<fn(&Path) -> PathBuf>,
}

const GZIP: Option<&[u8]> = Some(&[0x1f, 0x8b]);

/// Format of texts, with a description beside each file.
const fn text(ending: &'static str, name: &'static str, open: Open, save: Save) -> TraceFormat {
    TraceFormat {
        ending,
        name,
        is_text: true,
        max_samples: None,
        magic: None,
        open: Some(open),
        save,
        description_path: Some(csv::description_path),
    }
}

/// The formats that traces are written in; all but those for viewers are also read.
pub static FORMATS: [TraceFormat; 7] = [
    TraceFormat {
        ending: "parquet",
        name: "Parquet",
        is_text: false,
        max_samples: None,
        magic: Some(b"PAR1"),
        open: Some(parquet::open_rows),
        save: parquet::save,
        description_path: None,
    },
    TraceFormat {
        ending: "jls",
        name: "JLS (Joulescope)",
        is_text: false,
        max_samples: None,
        magic: Some(b"jlsfmt\r\n"),
        open: Some(jls::open_rows),
        save: jls::save,
        description_path: None,
    },
    text("csv", "CSV", csv::open_rows, csv::save),
    text("tsv", "TSV", csv::open_rows, |trace, path| csv::save_as(trace, path, b'\t', false)),
    TraceFormat {
        is_text: false,
        magic: GZIP,
        ..text("csv.gz", "CSV with gzip", csv::open_gzip_rows, |trace, path| {
            csv::save_as(trace, path, b',', true)
        })
    },
    TraceFormat {
        is_text: false,
        magic: GZIP,
        ..text("tsv.gz", "TSV with gzip", csv::open_gzip_rows, |trace, path| {
            csv::save_as(trace, path, b'\t', true)
        })
    },
    TraceFormat {
        ending: "perfetto-trace",
        name: "Perfetto timeline",
        is_text: false,
        max_samples: Some(perfetto::MAX_POINTS as u64),
        magic: None,
        open: None,
        save: perfetto::save,
        description_path: None,
    },
];

impl TraceFormat {
    /// The format of a file, by the ending of its name in any case.
    pub fn of(path: &Path) -> Option<&'static Self> {
        let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
        let ends =
            |format: &&Self| name.strip_suffix(format.ending).is_some_and(|before| before.ends_with('.'));
        FORMATS.iter().find(ends)
    }

    /// Whether traces are read in this format.
    pub fn is_read(&self) -> bool {
        self.open.is_some()
    }

    /// Place of the description that is written beside a file, in formats that have one there.
    pub fn description_path(&self, path: &Path) -> Option<PathBuf> {
        self.description_path.map(|place| place(path))
    }
}

/// Names of the formats that are read, as a list for messages: `Parquet, ... or TSV`.
pub fn readable() -> String {
    let names: Vec<&str> =
        FORMATS.iter().filter(|format| format.is_read()).map(|format| format.name).collect();
    any_of(&names)
}

/// Endings of the formats that are written, as a list for messages: `.parquet, ... or .csv`.
pub fn endings() -> String {
    any_of(&FORMATS.each_ref().map(|format| format!(".{}", format.ending)))
}

fn any_of<T: AsRef<str>>(names: &[T]) -> String {
    let mut text = String::new();
    for (index, name) in names.iter().enumerate() {
        text += match index {
            0 => "",
            _ if index + 1 == names.len() => " or ",
            _ => ", ",
        };
        text += name.as_ref();
    }
    text
}

/// Writes a trace in the format of the ending of the name, in any case.
///
/// # Errors
/// [`WriteError`] names the file.
pub fn save(trace: &dyn TraceReader, path: &Path) -> Result<(), WriteError> {
    let unknown = || WriteError::Ending { path: path.to_owned(), endings: endings() };
    let format = TraceFormat::of(path).ok_or_else(unknown)?;
    (format.save)(trace, path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::{Metadata, Trace};

    #[test]
    fn every_format_is_written_by_its_ending_and_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let trace = Trace::new(vec![2.0; 50], vec![0.5; 50], 1e3, 0.0, Metadata::default()).unwrap();
        for format in &FORMATS {
            let path = folder.path().join(format!("a.{}", format.ending.to_ascii_uppercase()));
            save(&trace, &path).unwrap();
            let bytes = std::fs::read(&path).unwrap();
            assert!(bytes.starts_with(format.magic.unwrap_or_default()), "{}", format.ending);
            assert_eq!(
                std::str::from_utf8(&bytes).is_ok_and(|text| text.starts_with("time_s")),
                format.is_text
            );
            assert!(format.description_path(&path).is_none_or(|beside| beside.exists()), "{}", format.ending);
            let loaded = read(&path, &ReadOptions::default());
            assert_eq!(loaded.is_ok(), format.is_read(), "{}", format.ending);
            if let Ok(loaded) = loaded {
                assert_eq!((loaded.trace.samples(), loaded.trace.rate_hz()), (50, 1e3), "{}", format.ending);
            }
        }
    }

    #[test]
    fn other_endings_are_refused_with_those_that_are_known() {
        let trace = Trace::new(vec![2.0; 50], vec![0.5; 50], 1e3, 0.0, Metadata::default()).unwrap();
        for name in ["a.txt", "csv", "acsv", "a.gz"] {
            let error = save(&trace, Path::new(name)).unwrap_err().to_string();
            assert!(error.contains(&format!("{name}: its ending is not {}", endings())), "{error}");
        }
        assert!(endings().starts_with(".parquet, .jls, ") && endings().ends_with(" or .perfetto-trace"));
        assert!(readable().starts_with("Parquet, JLS (Joulescope), ") && !readable().contains("Perfetto"));
    }
}
