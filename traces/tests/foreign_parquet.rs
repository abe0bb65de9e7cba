//! Parquet as other programs write it: optional columns, dictionaries, Zstandard (pyarrow, see the file's name).
#![allow(clippy::unwrap_used)]

use std::path::Path;
use traces::io::{ReadOptions, read};

#[test]
fn zstandard_pages_hold_the_same_samples_as_the_text_beside_them() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign");
    let packed = read(&folder.join("pyarrow_zstd.parquet"), &ReadOptions::default()).unwrap().trace;
    let text = read(&folder.join("pyarrow_zstd.csv"), &ReadOptions::default()).unwrap().trace;
    assert_eq!(packed.voltage_v(), text.voltage_v());
    assert_eq!(packed.current_a(), text.current_a());
    assert_eq!((packed.rate_hz(), packed.start_s()), (text.rate_hz(), text.start_s()));
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
