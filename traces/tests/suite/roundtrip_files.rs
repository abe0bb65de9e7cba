//! Files are read back as they were written, to the bit, and have the same bytes every time.

use proptest::prelude::*;
use std::collections::BTreeMap;
use traces::io::{TraceChunk, TraceHeader, TraceReader, TraceWriter, WriteError, csv, parquet};
use traces::{Mark, MarkKind, Metadata, Trace};

fn metadata() -> Metadata {
    Metadata {
        device: "daq \"A\", 14 bit".to_owned(),
        scene: "Fuchs, dämmrig".to_owned(),
        platform: "phone".to_owned(),
        seed: u64::MAX,
        pixels: Some(921_600),
        marks: vec![
            Mark { time_s: 0.1 + 0.2, kind: MarkKind::FrameStart, label: "first".to_owned() },
            Mark { time_s: 1.0, kind: MarkKind::End, label: String::new() },
        ],
        other: BTreeMap::from([("operator".to_owned(), serde_json::json!({"name": "E.", "run": 3}))]),
    }
}

fn trace(samples: usize, rate_hz: f64, start_s: f64) -> Trace {
    let voltage_v = (0..samples).map(|i| 12.0 - (i % 977) as f32 * 0.000_732_5).collect();
    let current_a = (0..samples).map(|i| (i % 4093) as f32 * 0.003_663 - 1.0).collect();
    Trace::new(voltage_v, current_a, rate_hz, start_s, metadata()).unwrap()
}

fn both_ways(trace: &Trace) -> [Trace; 2] {
    let folder = tempfile::tempdir().unwrap();
    let (p, c) = (folder.path().join("t.parquet"), folder.path().join("t.csv"));
    parquet::save(trace, &p).unwrap();
    csv::save(trace, &c).unwrap();
    [parquet::read(&p).unwrap(), csv::read(&c).unwrap()]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn parquet_and_csv_round_trips_are_bit_exact(
        bits in prop::collection::vec((any::<u32>(), any::<u32>()), 1..300),
        rate_hz in prop_oneof![Just(50e3), Just(1e6), Just(44_100.0), 0.1..1e7_f64],
        start_s in prop_oneof![Just(0.0), -10.0..1e4_f64],
    ) {
        let finite = |bits: u32| Some(f32::from_bits(bits)).filter(|value| value.is_finite()).unwrap_or(-0.0);
        let (voltage_v, current_a): (Vec<f32>, Vec<f32>) = bits.into_iter().map(|(v, i)| (finite(v), finite(i))).unzip();
        let trace = Trace::new(voltage_v, current_a, rate_hz, start_s, metadata()).unwrap();
        for read in both_ways(&trace) {
            prop_assert_eq!(read.rate_hz().to_bits(), trace.rate_hz().to_bits());
            prop_assert_eq!(read.start_s().to_bits(), trace.start_s().to_bits());
            let to_bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            prop_assert_eq!(to_bits(read.voltage_v()), to_bits(trace.voltage_v()));
            prop_assert_eq!(to_bits(read.current_a()), to_bits(trace.current_a()));
            prop_assert_eq!(&read.metadata, &trace.metadata);
        }
    }
}

/// A trace whose chunks are handed on in other pieces.
struct Cut<'a>(&'a Trace, &'a [usize]);

struct Cutter<'a> {
    into: &'a mut dyn TraceWriter,
    sizes: std::iter::Cycle<std::slice::Iter<'a, usize>>,
}

impl TraceReader for Cut<'_> {
    fn header(&self) -> TraceHeader {
        self.0.header()
    }

    fn read_into(&self, writer: &mut dyn TraceWriter) -> Result<(), WriteError> {
        self.0.read_into(&mut Cutter { into: writer, sizes: self.1.iter().cycle() })
    }
}

impl TraceWriter for Cutter<'_> {
    fn write(&mut self, chunk: &TraceChunk<'_>) -> Result<(), WriteError> {
        let mut from = 0;
        while from < chunk.len() {
            let to = chunk.len().min(from + self.sizes.next().unwrap());
            self.into.write(&chunk.part(from, to))?;
            from = to;
        }
        Ok(())
    }
}

/// The bytes of every format.
fn written(trace: &dyn TraceReader) -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let path = |end: &str| folder.path().join(format!("t.{end}"));
    parquet::save(trace, &path("parquet")).unwrap();
    csv::save_as(trace, &path("tsv"), b'\t', false).unwrap();
    csv::save_as(trace, &path("csv.gz"), b',', true).unwrap();
    ["parquet", "tsv", "tsv.json", "csv.gz", "csv.gz.json"]
        .map(|end| std::fs::read(path(end)).unwrap())
        .into()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn property_pieces_of_any_size_give_the_bytes_of_one(
        samples in 1_usize..6000,
        rate_hz in prop_oneof![Just(50e3), 0.1..1e7_f64],
        sizes in prop::collection::vec(prop_oneof![1_usize..10, 100..3000_usize], 1..5),
        lost in prop::collection::vec((0_usize..400, 1_usize..300), 0..4),
    ) {
        let mut end = 0;
        let lost = lost.into_iter().map(|(apart, length)| {
            let range = end + apart + 1..end + apart + 1 + length;
            end = range.end;
            range
        });
        let trace = trace(samples, rate_hz, 0.3).without(lost.collect::<Vec<_>>());
        prop_assert!(written(&Cut(&trace, &sizes)) == written(&trace));
    }
}

#[test]
fn pieces_across_row_groups_with_losses_at_their_ends_give_the_same_bytes() {
    let group = 1 << 20;
    for lost in [group - 10..group + 20, group..group + 1, 100_000..group, group - 1..group + 400_000] {
        let trace = trace(group + 400_000, 50e3, 0.3).without([lost]);
        let bytes = |trace: &dyn TraceReader| {
            let mut bytes = Vec::new();
            parquet::write(trace, &mut bytes).unwrap();
            bytes
        };
        assert!(bytes(&Cut(&trace, &[77_777])) == bytes(&trace));
    }
}

#[test]
fn a_row_group_has_the_rows_of_its_2_to_the_20_samples_that_were_not_lost() {
    use ::parquet::file::reader::{FileReader, SerializedFileReader};
    let group = 1 << 20;
    let rows = |lost: std::ops::Range<usize>| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        parquet::save(&trace(2 * group + 400_000, 50e3, 0.3).without([lost]), &path).unwrap();
        let file = SerializedFileReader::new(std::fs::File::open(&path).unwrap()).unwrap();
        file.metadata().row_groups().iter().map(|group| group.num_rows() as usize).collect::<Vec<_>>()
    };
    assert_eq!(rows(0..0), [group, group, 400_000]);
    assert_eq!(rows(group - 10..group + 20), [group - 10, group - 20, 400_000]);
    assert_eq!(rows(group..2 * group), [group, 400_000]);
}

#[test]
fn several_row_groups_come_back_whole() {
    let trace = trace((1 << 20) + 12_345, 50e3, 0.3);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.parquet");
    parquet::save(&trace, &path).unwrap();
    assert!(parquet::read(&path).unwrap() == trace);
    let bytes_per_sample = std::fs::metadata(&path).unwrap().len() as f64 / trace.samples() as f64;
    assert!(bytes_per_sample < 4.0, "{bytes_per_sample}");
}

#[test]
fn the_same_trace_gives_the_same_bytes() {
    let trace = trace(20_000, 50e3, 0.3);
    let written = || {
        let (mut p, mut c, mut s) = (Vec::new(), Vec::new(), Vec::new());
        parquet::write(&trace, &mut p).unwrap();
        csv::write(&trace, &mut c).unwrap();
        csv::write_sidecar(&trace, &mut s).unwrap();
        (p, c, s)
    };
    assert_eq!(written(), written());
}

#[test]
fn golden_csv_of_three_samples_at_50_khz() {
    let trace =
        Trace::new(vec![3.85, 3.845_215, 0.0], vec![0.1, -0.25, 1e-7], 50e3, -2e-5, Metadata::default())
            .unwrap();
    let mut out = Vec::new();
    csv::write(&trace, &mut out).unwrap();
    assert_eq!(
        String::from_utf8(out).unwrap(),
        // The digits of the f32 in f64, so that either reads back the same.
        "time_s,voltage_V,current_A\n-0.00002,3.8499999046325684,0.10000000149011612\n\
         0.0,3.845215082168579,-0.25\n0.00002,0,0.00000010000000116860974\n"
    );
}

#[test]
fn without_a_description_csv_takes_rate_and_start_from_its_times() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("meter.csv");
    std::fs::write(
        &path,
        "note, CURRENT_a ,Time_S,voltage_v\nx,1,10.00002,5\ny,2,10.00004,5\nz,3,10.00006,5\n",
    )
    .unwrap();
    let trace = csv::read(&path).unwrap();
    assert_eq!(
        (trace.rate_hz(), trace.start_s(), trace.current_a()),
        (50e3, 10.000_02, &[1.0, 2.0, 3.0][..])
    );
}

#[test]
fn a_stated_rate_stands_in_for_missing_times() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("meter.csv");
    std::fs::write(&path, "voltage_V,current_A\n5,1\n5,2\n").unwrap();
    std::fs::write(csv::sidecar_path(&path), r#"{"sample_rate_hz": 1000.0, "start_s": 2.5, "case": "v30"}"#)
        .unwrap();
    let trace = csv::read(&path).unwrap();
    assert_eq!((trace.rate_hz(), trace.start_s()), (1000.0, 2.5));
    assert_eq!(trace.metadata.other["case"], "v30");
}
