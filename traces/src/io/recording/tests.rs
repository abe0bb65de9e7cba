//! Looked at in pieces of any size, a file is what it is in memory: the same trace, the same bytes, or the same complaint.

use super::*;
use crate::io::{csv, parquet, read};
use crate::trace::Trace;
use proptest::prelude::*;
use std::fmt::Write as _;
use std::fs;

/// What is wrong with a file, and at which row.
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

/// What a file holds, or what is wrong with it.
fn outcome(trace: &dyn Source, folder: &Path) -> Vec<Vec<u8>> {
    let name = |end: &str| folder.join(format!("out.{end}"));
    parquet::save(trace, &name("parquet")).unwrap();
    csv::save(trace, &name("csv")).unwrap();
    csv::save_as(trace, &name("tsv.gz"), b'\t', true).unwrap();
    ["parquet", "csv", "csv.json", "tsv.gz", "tsv.gz.json"].map(|end| fs::read(name(end)).unwrap()).into()
}

fn both(path: &Path, options: &ReadOptions, piece: usize) -> Result<(), TestCaseError> {
    let folder = tempfile::tempdir().unwrap();
    let whole = read(path, options).map(|loaded| loaded.trace);
    let pieces = Recording::in_pieces(path, options, piece);
    match (whole, pieces) {
        (Ok(whole), Ok(pieces)) => {
            prop_assert_eq!(whole.heading(), pieces.heading());
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
fn a_file_that_changes_between_the_looks_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (path, out) = (folder.path().join("t.csv"), folder.path().join("out.parquet"));
    fs::write(&path, text(1000.0, 9, &[])).unwrap();
    let recording = Recording::open(&path, &ReadOptions::default()).unwrap();
    fs::write(&path, text(1000.0, 9, &[]) + "5.5,1,1\n").unwrap();
    let message = parquet::save(&recording, &out).unwrap_err().to_string();
    assert!(message.contains("t.csv: changed while it was read"), "{message}");
    fs::write(&path, text(1000.0, 9, &[Fault::Endless(2000)])).unwrap();
    let message = parquet::save(&recording, &out).unwrap_err().to_string();
    assert!(message.contains("t.csv: changed"), "{message}");
    fs::remove_file(&path).unwrap();
    assert!(csv::save(&recording, &out).unwrap_err().to_string().contains("t.csv: cannot be read"));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}
