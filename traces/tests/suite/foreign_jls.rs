//! JLS as pyjls writes it (`tests/foreign/make_jls.py`), whole and damaged.

use crate::common::foreign;
use crate::common::jls::sealed;
use proptest::prelude::*;
use std::path::Path;
use traces::Trace;
use traces::io::{ReadError, ReadOptions, RepairKind, Rows, read};

fn named(voltage: &str, current: &str) -> ReadOptions {
    let column = |name: &str| Some(name.to_owned());
    ReadOptions { voltage: column(voltage), current: column(current), ..ReadOptions::default() }
}

fn power(name: &str) -> ReadOptions {
    ReadOptions { power: Some(name.to_owned()), ..ReadOptions::default() }
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[track_caller]
fn same(left: &Trace, right: &Trace) {
    assert_eq!(bits(left.voltage_v()), bits(right.voltage_v()));
    assert_eq!(bits(left.current_a()), bits(right.current_a()));
    assert_eq!((left.rate_hz(), left.start_s()), (right.rate_hz(), right.start_s()));
}

#[track_caller]
fn refused(path: &Path, options: &ReadOptions, parts: &[&str]) {
    let message = read(path, options).map(|_| ()).unwrap_err().to_string();
    assert!(parts.iter().all(|part| message.contains(part)), "{message} should say {parts:?}");
}

fn whole() -> Trace {
    read(&foreign("pyjls.jls"), &ReadOptions::default()).unwrap().trace
}

#[test]
fn a_recording_holds_the_same_samples_as_the_text_beside_it() {
    let text = ReadOptions { rate_hz: Some(1e5), ..ReadOptions::default() };
    let text = read(&foreign("pyjls.csv"), &text).unwrap().trace;
    same(&whole(), &text);
    assert_eq!(whole().metadata.device, "Jetperch JS220 000001");
    let alone = read(&foreign("pyjls.jls"), &power("power")).unwrap().trace;
    let product: Vec<f32> = text.voltage_v().iter().zip(text.current_a()).map(|(v, i)| v * i).collect();
    assert_eq!(bits(alone.current_a()), bits(&product));
    same(&whole(), &read(&foreign("pyjls.jls"), &named("VOLTAGE", "Current")).unwrap().trace);
}

#[test]
fn doubles_whole_numbers_and_units_of_several_sources_are_those_of_the_text() {
    for options in
        [ReadOptions { rails: vec!["left".to_owned()], ..ReadOptions::default() }, power("right.power")]
    {
        let recorded = read(&foreign("pyjls_types.jls"), &options).unwrap().trace;
        let power = options.power.clone().map(|name| format!("{}_W", name.replace('.', "_")));
        let text = ReadOptions { rate_hz: Some(2000.0), power, ..options };
        same(&recorded, &read(&foreign("pyjls_types.csv"), &text).unwrap().trace);
    }
}

/// Rows from `skip` on in pieces of `limit`, through the public reader of long traces.
#[test]
fn a_clock_and_frames_in_pieces_are_those_of_the_whole() {
    let (path, trace) = (foreign("pyjls.jls"), whole());
    assert_eq!(Rows::open(&path, &ReadOptions::default()).unwrap().count(), Some(3003));
    let clock = traces::stream::clock(&path, &ReadOptions::default()).unwrap();
    assert_eq!((clock.rate_hz, clock.start_s, clock.samples), (trace.rate_hz(), 0.0, Some(3003)));
}

#[test]
fn lost_samples_are_named_with_their_row_and_filled_on_request() {
    let path = foreign("pyjls_gaps.jls");
    refused(&path, &ReadOptions::default(), &["row 501: ", "NaN, not a finite number"]);
    let repaired = read(&path, &ReadOptions { repair: true, ..ReadOptions::default() }).unwrap();
    assert_eq!((repaired.trace.samples(), repaired.repairs.is_empty()), (1000, false));
    let place = repaired.trace.time_s(500);
    assert!(place > 0.0 && repaired.repairs.iter().any(|repair| (repair.row, repair.time_s) == (501, place)));
    assert!(repaired.trace.current_a().iter().all(|value| value.is_finite()));
}

#[test]
fn chunks_that_were_left_out_are_an_error_also_with_repair() {
    let path = foreign("pyjls_gaps.jls");
    for repair in [false, true] {
        let options = ReadOptions { repair, ..named("spare voltage", "current") };
        refused(&path, &options, &["row 161: time 0.96 s is 800.00 sample periods off", "missing samples"]);
    }
}

#[test]
fn numbers_that_jump_are_named_with_their_row() {
    // Each chunk of data of 160 samples in turn gets a number of 7 more or less.
    let whole = std::fs::read(foreign("pyjls.jls")).unwrap();
    let starts: Vec<usize> = (32..whole.len())
        .step_by(8)
        .filter(|&at| {
            whole.len() > at + 48 && whole[at + 16..at + 20] == [0x22, 0, 4, 0] && whole[at + 48 - 4] == 32
        })
        .collect();
    assert_eq!(starts.len(), 19);
    for (index, at) in starts.into_iter().enumerate().skip(1).take(17) {
        let row = 160 * index as i64;
        for jump in [7, -7] {
            let mut bytes = whole.clone();
            bytes[at + 32..at + 40].copy_from_slice(&(1000 + row + jump).to_le_bytes());
            let message = read_bytes(&sealed(&bytes)).map(|_| ()).unwrap_err().to_string();
            let parts = [
                format!("row {}: time", row + 1),
                format!("{jump}.00 sample periods off an even rate of 100000 Hz"),
            ];
            assert!(parts.iter().all(|part| message.contains(part)), "{message}");
        }
    }
}

#[test]
fn signals_that_make_up_no_rows_are_refused_by_name() {
    let path = foreign("pyjls_rates.jls");
    refused(
        &path,
        &named("voltage", "current"),
        &[
            "voltage has 200 samples from number 0 on at 500 Hz",
            "current has 400",
            "at 1000 Hz",
            "read one alone",
        ],
    );
    refused(&path, &named("short voltage", "current"), &["short voltage has 399 samples"]);
    refused(&path, &named("late voltage", "current"), &["from number 1 on"]);
    let fixed =
        ReadOptions { fixed_voltage_v: Some(5.0), current: Some("current".to_owned()), ..Default::default() };
    assert_eq!(read(&path, &fixed).unwrap().trace.samples(), 400);
}

#[test]
fn signals_that_are_missing_or_of_other_types_are_named() {
    refused(
        &foreign("pyjls.jls"),
        &named("volts", "current"),
        &["no column volts (found: current, voltage, power)"],
    );
    let options = ReadOptions {
        fixed_voltage_v: Some(1.0),
        current: Some("right.current".to_owned()),
        ..Default::default()
    };
    refused(
        &foreign("pyjls_types.jls"),
        &options,
        &["column current is u4, it must be f32, f64 or a whole number"],
    );
}

#[test]
fn a_recording_that_was_not_closed_names_the_remedy() {
    refused(
        &foreign("pyjls_unclosed.jls"),
        &ReadOptions::default(),
        &["not a whole JLS file", "byte 6152: the recording was not closed", "pyjls repairs a copy"],
    );
}

#[test]
fn a_recording_that_was_cut_and_repaired_gives_what_all_its_signals_have() {
    // What pyjls finds in them: current and voltage (m2_*.npz of `make_jls.py`'s reader).
    for (name, current, voltage) in
        [("pyjls_repaired_19000.jls", 960, 640), ("pyjls_repaired_44500.jls", 2560, 1920)]
    {
        let (path, whole) = (foreign(name), whole());
        refused(
            &path,
            &ReadOptions::default(),
            &[
                &format!("voltage has {voltage} samples from number 1000"),
                &format!("current has {current} samples"),
            ],
        );
        let loaded = read(&path, &ReadOptions { repair: true, ..ReadOptions::default() }).unwrap();
        let reported: Vec<_> = loaded.repairs.iter().map(|repair| (repair.code, repair.count)).collect();
        assert_eq!(reported, [(RepairKind::CutSignals, current as u64 - voltage as u64)]);
        let last_s = loaded.trace.time_s(voltage - 1);
        assert!((loaded.repairs[0].time_s - last_s).abs() < 1e-9, "{:?}", loaded.repairs);
        assert_eq!(bits(loaded.trace.voltage_v()), bits(&whole.voltage_v()[..voltage]));
        assert_eq!(bits(loaded.trace.current_a()), bits(&whole.current_a()[..voltage]));
        let alone =
            ReadOptions { fixed_voltage_v: Some(5.0), current: Some("current".into()), ..Default::default() };
        let alone = read(&path, &alone).unwrap().trace;
        assert_eq!(bits(alone.current_a()), bits(&whole.current_a()[..current]));
    }
}

#[test]
fn signals_that_begin_and_end_apart_are_cut_on_request_but_not_where_rates_differ() {
    let repaired = |voltage: &str| ReadOptions { repair: true, ..named(voltage, "current") };
    let path = foreign("pyjls_rates.jls");
    refused(&path, &repaired("voltage"), &["at 500 Hz"]);
    let values = |voltage| {
        let loaded = read(&path, &repaired(voltage)).unwrap();
        assert!(
            loaded.repairs[0].message.contains("399 samples from number"),
            "{}",
            loaded.repairs[0].message
        );
        loaded
            .trace
            .voltage_v()
            .iter()
            .zip(loaded.trace.current_a())
            .map(|(v, i)| (*v, *i))
            .collect::<Vec<_>>()
    };
    // All were written from the same numbers: that of the late one's sample 1 is the first.
    assert!(values("short voltage").iter().all(|(v, i)| v == i));
    let late = values("late voltage");
    assert!(late.len() == 399 && late.windows(2).all(|two| two[1].0 == two[0].1));
}

#[test]
fn a_recording_cut_anywhere_is_an_error() {
    let (whole, trace) = (std::fs::read(foreign("pyjls.jls")).unwrap(), whole());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.jls");
    let mut errors = 0;
    for length in (8..whole.len()).step_by(64).chain([whole.len() - 1]) {
        std::fs::write(&path, &whole[..length]).unwrap();
        refused(
            &path,
            &ReadOptions::default(),
            &["cut.jls: not a whole JLS file", &format!("byte {length}: ")],
        );
        // Where the header agrees with what is left, only what is not read may be missing.
        match read_bytes(&sealed(&whole[..length])) {
            Ok(left) => same(&left, &trace),
            Err(_) => errors += 1,
        }
    }
    assert!(errors > whole.len() / 70, "{errors}");
}

fn read_bytes(bytes: &[u8]) -> Result<Trace, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("changed.jls");
    std::fs::write(&path, bytes).unwrap();
    read(&path, &ReadOptions::default()).map(|loaded| loaded.trace)
}

#[test]
fn a_changed_byte_is_an_error_or_changes_nothing() {
    let (whole, trace) = (std::fs::read(foreign("pyjls.jls")).unwrap(), whole());
    let mut errors = 0;
    for position in (8..whole.len()).step_by(11) {
        let mut bytes = whole.clone();
        bytes[position] ^= [0x01, 0x80, 0xff][position % 3];
        match read_bytes(&bytes) {
            Ok(changed) => same(&changed, &trace),
            Err(_) => errors += 1,
        }
    }
    // Current and voltage are about a third of the file; of the power, ranges and summaries nothing is read.
    assert!(errors > whole.len() / 11 / 4, "{errors} of {}", whole.len() / 11);
}

#[test]
fn the_file_that_is_sealed_anew_is_the_file() {
    let whole = std::fs::read(foreign("pyjls.jls")).unwrap();
    assert!(sealed(&whole) == whole);
}

proptest! {
    /// Contents that are wrong behind checksums that are right.
    #[test]
    fn damage_behind_right_checksums_gives_a_trace_or_an_error(
        changes in prop::collection::vec((32_usize..6000, any::<u8>()), 1..6),
        words in prop::collection::vec((4_usize..1500, prop::sample::select(vec![0_u32, 1, 32, 0x7fff_ffff, u32::MAX])), 0..3),
        options in prop::sample::select(vec![named("voltage", "current"), named("spare voltage", "voltage"), power("current")]),
    ) {
        let mut bytes = std::fs::read(foreign("pyjls_gaps.jls")).unwrap();
        for (position, byte) in changes {
            bytes[position] = byte;
        }
        for (word, value) in words {
            bytes[4 * word..4 * word + 4].copy_from_slice(&value.to_le_bytes());
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("damaged.jls");
        std::fs::write(&path, sealed(&bytes)).unwrap();
        if let Ok(loaded) = read(&path, &ReadOptions { repair: true, ..options }) {
            prop_assert!(loaded.trace.samples() <= bytes.len() / 4);
        }
    }
}
