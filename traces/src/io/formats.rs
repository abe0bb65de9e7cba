//! The formats of trace files: one table for readers, writers, the command, its help and its errors.

use super::columns::Open;
use super::samples::TraceReader;
use super::{WriteError, csv, jls, parquet, perfetto};
use std::path::{Path, PathBuf};

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
    pub(super) magic: Option<&'static [u8]>,
    pub(super) open: Option<Open>,
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
    let format = TraceFormat::of(path).ok_or_else(|| WriteError::Ending { path: path.to_owned() })?;
    (format.save)(trace, path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{ReadOptions, read};
    use crate::trace::Metadata;
    use crate::trace::Trace;

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
