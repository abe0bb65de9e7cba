//! Parquet as other programs write it: optional columns, dictionaries, every way of packing (pyarrow, see the
//! file's name).

use crate::common::foreign;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::path::Path;
use traces::io::{ReadOptions, read};
use traces::table::InputTable;

#[test]
fn packed_pages_hold_the_same_samples_as_the_text_beside_them() {
    let text = read(&foreign("pyarrow_zstd.csv"), &ReadOptions::default()).unwrap().trace;
    for packing in ["zstd", "gzip", "lz4"] {
        let path = foreign(&format!("pyarrow_{packing}.parquet"));
        let packed = read(&path, &ReadOptions::default()).unwrap().trace;
        assert_eq!(packed.voltage_v(), text.voltage_v(), "{packing}");
        assert_eq!(packed.current_a(), text.current_a(), "{packing}");
        assert_eq!((packed.rate_hz(), packed.start_s()), (text.rate_hz(), text.start_s()), "{packing}");
    }
}

#[test]
fn packed_tables_are_read_and_others_named_with_the_remedy() {
    for packing in ["zstd", "gzip", "lz4"] {
        let table = InputTable::read(&foreign(&format!("table_{packing}.parquet"))).unwrap();
        assert_eq!(table.texts("algorithm").unwrap(), ["VB", "TF", ""], "{packing}");
        assert_eq!(table.numbers("time_ms").unwrap(), [1.5, 2.0, 3.0], "{packing}");
    }
    let message = InputTable::read(&foreign("table_brotli.parquet")).unwrap_err().to_string();
    assert!(message.contains("column algorithm is compressed with BROTLI"), "{message}");
    assert!(message.contains("write it with Zstandard or Snappy"), "{message}");
}

#[test]
fn units_of_fields_count_as_those_of_names_do() {
    let read = |name: &str| read(&foreign(name), &ReadOptions::default());
    let trace = read("units.parquet").unwrap().trace;
    assert_eq!((trace.rate_hz(), trace.voltage_v()[0], trace.current_a()[5]), (2000.0, 12.0, 5.0));
    for (name, says) in [
        ("units_contradict.parquet", "column time_s has the unit ms"),
        ("units_other.parquet", "column voltage has the unit mA"),
    ] {
        let message = read(name).unwrap_err().to_string();
        assert!(message.contains(says), "{message}");
    }
}

/// `units.parquet` with something in the schema of its fields put in place of something else, of the same length.
fn changed(from: &str, to: &str) -> (tempfile::TempDir, std::path::PathBuf) {
    let mut bytes = std::fs::read(foreign("units.parquet")).unwrap();
    let find = |bytes: &[u8], what: &[u8]| bytes.windows(what.len()).position(|part| part == what);
    let is_text = |byte: &u8| byte.is_ascii_alphanumeric() || b"+/=".contains(byte);
    let key = find(&bytes, b"ARROW:schema").unwrap() + 12;
    let begin = key + bytes[key..].windows(9).position(|part| part.iter().all(is_text)).unwrap();
    let end = begin + bytes[begin..].iter().position(|byte| !is_text(byte)).unwrap();
    let mut schema = STANDARD.decode(&bytes[begin..end]).unwrap();
    while let Some(at) = find(&schema, from.as_bytes()) {
        schema[at..at + to.len()].copy_from_slice(to.as_bytes());
    }
    bytes[begin..end].copy_from_slice(STANDARD.encode(schema).as_bytes());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

#[test]
fn keys_of_units_are_read_in_any_case_and_units_that_are_not_known_refused() {
    let whole = read(&foreign("units.parquet"), &ReadOptions::default()).unwrap().trace;
    let (_folder, path) = changed("unit", "UNIT");
    let trace = read(&path, &ReadOptions::default()).unwrap().trace;
    assert_eq!((trace.voltage_v(), trace.rate_hz()), (whole.voltage_v(), whole.rate_hz()));
    assert_eq!(InputTable::read(&path).unwrap().unit("Voltage"), Some("mV"));
    let (_folder, path) = changed("mV", "zV");
    let message = read(&path, &ReadOptions::default()).unwrap_err().to_string();
    assert!(
        message.contains("column voltage has the unit zV in its metadata, which is not known"),
        "{message}"
    );
}

#[test]
fn a_changed_byte_gives_a_trace_or_an_error_but_no_panic() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign");
    let whole = std::fs::read(folder.join("pyarrow_zstd.parquet")).unwrap();
    let temporary = tempfile::tempdir().unwrap();
    let path = temporary.path().join("flip.parquet");
    let mut errors = 0;
    for position in (0..whole.len()).step_by(5) {
        let mut bytes = whole.clone();
        bytes[position] ^= [0x01, 0x80, 0xff][position / 5 % 3];
        std::fs::write(&path, &bytes).unwrap();
        errors += usize::from(read(&path, &ReadOptions::default()).is_err());
    }
    assert!(errors > whole.len() / 100, "{errors} of {}", whole.len() / 5);
}
