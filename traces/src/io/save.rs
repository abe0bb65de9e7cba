//! Writing a file of any format.

use super::samples::TraceReader;
use super::{WriteError, csv, jls, parquet};
use std::path::Path;

/// Endings of the names of files that [`save`] writes; those that [`read`](super::read()) reads have a variant of
/// `Format` in `rows.rs`.
pub const FORMATS: [&str; 6] = [".parquet", ".jls", ".csv", ".tsv", ".csv.gz", ".tsv.gz"];

/// Writes a trace in the format that the ending of the name stands for, in any case; CSV and TSV with a
/// description beside the file.
///
/// # Errors
/// [`WriteError`] names the file.
pub fn save(trace: &dyn TraceReader, path: &Path) -> Result<(), WriteError> {
    let name = path.file_name().map_or(String::new(), |name| name.to_string_lossy().to_ascii_lowercase());
    match FORMATS.into_iter().find(|ending| name.ends_with(ending)) {
        Some(".parquet") => parquet::save(trace, path),
        Some(".jls") => jls::save(trace, path),
        // All other endings are texts: a new binary format needs an arm above.
        Some(text) => {
            let delimiter = if text.starts_with(".tsv") { b'\t' } else { b',' };
            csv::save_as(trace, path, delimiter, text.ends_with(".gz"))
        }
        None => Err(WriteError::Ending { path: path.to_owned() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{ReadOptions, read};
    use crate::metadata::Metadata;
    use crate::trace::Trace;

    #[test]
    fn every_format_is_written_by_its_ending_and_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let trace = Trace::new(vec![2.0; 50], vec![0.5; 50], 1e3, 0.0, Metadata::default()).unwrap();
        for ending in FORMATS {
            let path = folder.path().join(format!("a{}", ending.to_ascii_uppercase()));
            save(&trace, &path).unwrap();
            let loaded = read(&path, &ReadOptions::default()).unwrap();
            assert_eq!((loaded.trace.samples(), loaded.trace.rate_hz()), (50, 1e3), "{ending}");
        }
        let error = save(&trace, &folder.path().join("a.txt")).unwrap_err().to_string();
        assert!(error.contains("a.txt: its ending is none of .parquet, .jls"), "{error}");
    }
}
