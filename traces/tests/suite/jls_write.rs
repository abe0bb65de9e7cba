//! JLS as we write it: read back, refused, cut and damaged. `benches/jls_beside_pyjls.py` reads it with pyjls.

use crate::common::jls::{crc32c, sealed};
use crate::common::jls_traces::{channels, metadata, trace, written};
use proptest::prelude::*;
use std::io::Cursor;
use traces::io::{ReadError, ReadOptions, atomic, jls, read};
use traces::{Mark, MarkKind, Metadata, Trace};

/// Without losses, in pieces of these sizes by turns.
fn in_pieces(trace: &Trace, sizes: &[usize]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = jls::Writer::new(&mut bytes, trace.rate_hz(), trace.start_s(), &trace.metadata).unwrap();
    let (mut from, mut turn) = (0, sizes.iter().cycle());
    while from < trace.samples() {
        let end = trace.samples().min(from + turn.next().unwrap());
        writer.push(&trace.voltage_v()[from..end], &trace.current_a()[from..end]).unwrap();
        from = end;
    }
    assert_eq!(writer.samples(), from as u64);
    writer.finish().unwrap();
    bytes.into_inner()
}

fn read_bytes(bytes: &[u8], repair: bool) -> Result<Trace, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jls");
    std::fs::write(&path, bytes).unwrap();
    read(&path, &ReadOptions { repair, ..ReadOptions::default() }).map(|loaded| loaded.trace)
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[track_caller]
fn same(left: &Trace, right: &Trace) {
    assert!(bits(left.voltage_v()) == bits(right.voltage_v()));
    assert!(bits(left.current_a()) == bits(right.current_a()));
    let key = |trace: &Trace| (trace.rate_hz().to_bits(), trace.start_s().to_bits());
    assert_eq!(key(left), key(right));
    assert_eq!(left.metadata, right.metadata);
}

/// Lengths about those at which a chunk, an index or a summary is full.
fn lengths() -> impl Strategy<Value = usize> {
    let about = |count: usize| (count - 1..=count + 1).boxed();
    prop_oneof![
        1_usize..300,
        about(128),
        about(8192),
        about(8192 + 128),
        about(81_920),
        about(81_920 + 8192),
        about(100_000),
        1_usize..200_000,
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn what_is_read_is_what_was_written_in_pieces_of_any_size(
        samples in lengths(),
        sizes in prop::collection::vec(1_usize..30_000, 1..4),
        rate_hz in prop_oneof![Just(1.0), Just(50e3), Just(44_100.0), Just(1e7), Just(1e8), 49_999.5..50_000.5, 1000.0..1e6_f64],
        start_s in prop_oneof![Just(0.0), -10.0..1e4_f64, 1.5e9..1.8e9_f64],
        seed in any::<u32>(),
    ) {
        // Every pattern of bits that is finite.
        let value = |index: usize, salt: u32| {
            let mixed = (index as u32 ^ salt).wrapping_mul(2_654_435_761).rotate_left(11).wrapping_mul(0x85eb_ca6b);
            Some(f32::from_bits(mixed)).filter(|value| value.is_finite()).unwrap_or(-0.0)
        };
        let channel = |salt: u32| (0..samples).map(|index| value(index, salt)).collect();
        let trace = Trace::new(channel(seed), channel(!seed), rate_hz, start_s, metadata()).unwrap();
        let bytes = written(&trace);
        prop_assert!(in_pieces(&trace, &sizes) == bytes);
        same(&read_bytes(&bytes, false).unwrap(), &trace);
    }
}

#[test]
fn a_file_that_pyjls_reads_stays_as_it_is() {
    // Written on 22 November 2026 and read by pyjls 0.17 (`benches/jls_beside_pyjls.py --golden`): samples to
    // the bit, every summary, UTC and user data.
    let golden = Trace::new(channels(30_000).0, channels(30_000).1, 50e3, 1.25, Metadata::default()).unwrap();
    let bytes = written(&golden.without([1000..1100, 29_000..30_000]));
    if let Some(to) = std::env::var_os("JLS_GOLDEN") {
        std::fs::write(to, &bytes).unwrap();
    }
    assert_eq!((bytes.len(), u32::from_le_bytes(crc32c(&bytes))), (252_168, 2_379_377_962));
}

#[test]
fn a_recording_without_samples_is_reported_as_empty() {
    let mut bytes = Cursor::new(Vec::new());
    jls::Writer::new(&mut bytes, 1e3, 0.0, &Metadata::default()).unwrap().finish().unwrap();
    let message = read_bytes(&bytes.into_inner(), false).unwrap_err().to_string();
    assert!(message.contains("no samples"), "{message}");
}

#[test]
fn lost_samples_are_missing_and_filled_on_request() {
    for lost in [vec![5000..5001, 6000..6002], vec![1..130, 8000..17_000, 19_990..20_000]] {
        let trace = trace(20_000).without(lost.clone());
        let message = read_bytes(&written(&trace), false).unwrap_err().to_string();
        let row = lost[0].start + 1;
        assert!(message.contains(&format!("row {row}: voltage is NaN")), "{message}");
        let repaired = read_bytes(&written(&trace), true).unwrap();
        assert_eq!((repaired.samples(), repaired.start_s()), (20_000, 1.25));
        // Between stretches nothing is changed, and in them it is the line that the trace in memory has.
        for (index, pair) in repaired.current_a().iter().zip(trace.current_a()).enumerate() {
            let near = lost.iter().any(|lost| lost.contains(&index));
            assert!(pair.0 == pair.1 || near && (pair.0 - pair.1).abs() < 1e-5, "{index}: {pair:?}");
        }
    }
}

#[test]
fn what_jls_cannot_say_is_refused() {
    let refused = |rate_hz: f64, start_s: f64, metadata: &Metadata| {
        let begun = jls::Writer::new(Cursor::new(Vec::new()), rate_hz, start_s, metadata);
        begun.map(|_| ()).unwrap_err().to_string()
    };
    let none = Metadata::default();
    for rate_hz in [0.4, 0.9, 1.5, 100.4, 0.0, -5.0, f64::NAN, f64::INFINITY, 5e9] {
        assert!(refused(rate_hz, 0.0, &none).contains(&format!("{rate_hz} Hz is none")));
    }
    assert!(refused(1e3, -9e9, &none).contains("-9000000000 s from 1970"));
    let mut marked = none.clone();
    marked.marks.push(Mark { time_s: f64::NAN, kind: MarkKind::Other, label: String::new() });
    assert!(refused(1e3, 0.0, &marked).contains("mark 0 is at NaN s"));
    let mut writer = jls::Writer::new(Cursor::new(Vec::new()), 1e3, 0.0, &none).unwrap();
    assert!(writer.push(&[1.0], &[]).unwrap_err().to_string().contains("1 voltages but 0 currents"));
}

#[test]
fn a_writer_that_fails_anywhere_is_an_error_and_leaves_no_file() {
    let whole = written(&trace(400_000)).len();
    for room in [0, 100, 3000, 3_200_000, whole - 1] {
        let mut space = vec![0; room];
        assert!(jls::write(&trace(400_000), Cursor::new(&mut space[..])).is_err(), "{room}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jls");
    let error = atomic::write_file(&path, |out| {
        let mut writer = jls::Writer::new(out, 1e3, 0.0, &Metadata::default())?;
        writer.push(&[1.0; 9000], &[1.0; 8000])
    });
    assert!(error.unwrap_err().to_string().contains("a.jls: cannot write the trace: 9000 voltages"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_file_cut_anywhere_is_an_error() {
    let (trace, mut errors) = (trace(9000), 0);
    let whole = written(&trace);
    for length in (8..whole.len()).step_by(64).chain([whole.len() - 1]) {
        for repair in [false, true] {
            let message = read_bytes(&whole[..length], repair).unwrap_err().to_string();
            assert!(message.contains(&format!("byte {length}: ")), "{message}");
        }
        // Where the header agrees with what is left, only what is not read may be missing.
        match read_bytes(&sealed(&whole[..length]), false) {
            Ok(left) => same(&left, &trace),
            Err(_) => errors += 1,
        }
    }
    assert!(errors > whole.len() / 70, "{errors}");
}

#[test]
fn a_changed_byte_is_an_error_or_changes_nothing() {
    let (trace, mut errors) = (trace(9000), 0);
    let whole = written(&trace);
    for position in (8..whole.len()).step_by(37) {
        let mut bytes = whole.clone();
        bytes[position] ^= [0x01, 0x80, 0xff][position % 3];
        match read_bytes(&bytes, false) {
            Ok(changed) => same(&changed, &trace),
            Err(_) => errors += 1,
        }
    }
    // All but summaries and UTC, which are a twentieth.
    assert!(errors > whole.len() / 37 * 9 / 10, "{errors} of {}", whole.len() / 37);
}

/// The file with one text in place of another, checksums made right.
fn edited(bytes: &[u8], text: &str, by: &str) -> Vec<u8> {
    assert_eq!(text.len(), by.len());
    let at = bytes.windows(text.len()).position(|window| window == text.as_bytes()).unwrap();
    let mut bytes = bytes.to_vec();
    bytes[at..at + text.len()].copy_from_slice(by.as_bytes());
    sealed(&bytes)
}

#[test]
fn notes_of_other_programs_are_passed_over_and_wrong_descriptions_reported() {
    let bytes = written(&trace(500));
    let plain = read_bytes(&edited(&bytes, "{\"trace\":", "{\"tracf\":"), false).unwrap();
    // What is left is what any recorder writes.
    assert_eq!((plain.rate_hz(), plain.start_s(), plain.samples()), (50e3, 0.0, 500));
    assert_eq!(plain.metadata.device, "daq \"A\" 1_5, 14 bit_");
    let broken = read_bytes(&edited(&bytes, "{\"trace\":", "{ trace\":"), false).unwrap();
    assert_eq!(broken.start_s(), 0.0);
    let message = read_bytes(&edited(&bytes, "\"rate_hz\":50000.0", "\"rate_hz\":-5000.0"), false)
        .unwrap_err()
        .to_string();
    assert!(message.contains("a.jls: the JSON description: rate_hz is -5000, not above 0"), "{message}");
    // Of another rate than the signals: somebody else's samples.
    let other = read_bytes(&edited(&bytes, "\"rate_hz\":50000.0", "\"rate_hz\":25000.0"), false).unwrap();
    assert_eq!((other.rate_hz(), other.start_s(), &other.metadata.scene), (50e3, 0.0, &metadata().scene));
}
