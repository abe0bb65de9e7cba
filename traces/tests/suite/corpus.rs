//! The kept corpus of the fuzz targets (`tests/fuzz/seeds/trace_*`): every file is read or refused, none ends
//! the program.

use std::fs;
use std::path::{Path, PathBuf};
use traces::io::{self, ReadOptions};
use traces::table::InputTable;

fn corpus(target: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/fuzz/seeds").join(target);
    let mut files: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() > 40, "{} files of {target}", files.len());
    files
}

/// How many of the files are read.
fn read<T, E: ToString>(target: &str, read: impl Fn(&Path) -> Result<T, E>) -> usize {
    let files = corpus(target);
    let refused = files.iter().filter_map(|path| read(path).err());
    let messages: Vec<String> = refused.map(|error| error.to_string()).collect();
    assert!(messages.iter().all(|message| message.len() > 20), "{messages:?}");
    files.len() - messages.len()
}

#[test]
fn failure_modes_of_the_fuzzed_csv_are_errors() {
    assert!(read("trace_csv", io::csv::read) > 0);
}

#[test]
fn failure_modes_of_the_fuzzed_parquet_are_errors() {
    assert!(read("trace_parquet", io::parquet::read) > 0);
}

#[test]
fn failure_modes_of_the_fuzzed_jls_are_errors() {
    // As the fuzz target does, with their checksums made right.
    let folder = tempfile::tempdir().unwrap();
    let sealed = |path: &Path| {
        let copy = folder.path().join("a.jls");
        fs::write(&copy, crate::common::jls::sealed(&fs::read(path).unwrap())).unwrap();
        io::read(&copy, &ReadOptions { repair: true, ..ReadOptions::default() })
    };
    assert!(read("trace_jls", sealed) > 0);
}

#[test]
fn failure_modes_of_traces_to_be_repaired_are_errors() {
    let options = ReadOptions { repair: true, rate_hz: Some(1e3), ..ReadOptions::default() };
    assert!(read("trace_repair", |path| io::read(path, &options)) > 0);
}

#[test]
fn failure_modes_of_the_fuzzed_tables_are_errors() {
    assert!(read("trace_table", InputTable::read) > 0);
}
