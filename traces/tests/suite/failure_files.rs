//! Every way a file can be wrong gives one error that names the file, the place and the remedy, and no panic.

use ::parquet::basic::{LogicalType, Repetition, TimeUnit, Type as Physical};
use ::parquet::data_type::{DoubleType, FloatType, Int64Type};
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::SerializedFileWriter;
use ::parquet::schema::types::Type;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;
use traces::io::{self, ReadError, ReadOptions, RepairKind, csv, parquet};
use traces::{Mark, MarkKind, Metadata, Trace};

fn in_folder(name: &str, content: &[u8]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    (folder, path)
}

fn csv_error(content: &str) -> ReadError {
    let (_folder, path) = in_folder("bad.csv", content.as_bytes());
    csv::read(&path).unwrap_err()
}

#[track_caller]
fn says(error: &ReadError, parts: &[&str]) {
    let message = error.to_string();
    assert!(parts.iter().all(|part| message.contains(part)), "{message} should say {parts:?}");
}

#[test]
fn csv_errors_name_file_row_and_column() {
    let head = "time_s,voltage_V,current_A\n";
    let with = |rows: &str| csv_error(&format!("{head}{rows}"));
    says(
        &csv_error("time_s,voltage_V\n0,1\n"),
        &["bad.csv", "no column current_A", "time_s, voltage_V", "rename or add"],
    );
    says(&csv_error("voltage_V,current_A\n0,1\n"), &["no column time_s"]);
    says(&csv_error(""), &["bad.csv", "no samples"]);
    says(&csv_error("voltage_V,Voltage_v,current_A\n"), &["column voltage_V occurs twice"]);
    says(&with(""), &["bad.csv", "no samples"]);
    says(&with("0,1,2\n1,nan,2\n"), &["bad.csv: row 2: voltage_V is \"nan\""]);
    says(&with("0,1,2\n1,1,1e99\n"), &["row 2: current_A is \"1e99\""]);
    says(&with("0,1,2\n1,,2\n"), &["row 2: voltage_V is empty"]);
    says(&with("0,1,2\nx,1,2\n"), &["row 2: time_s is \"x\""]);
    says(&with("0,1,2\n1,1\n"), &["row 2: 2 fields instead of 3", "cut off"]);
    says(&with("0,1,2\n1,1,2\n0.5,1,2\n"), &["row 3: time 0.5 s is not after 1 s", "sort"]);
    says(
        &with("0,1,2\n1,1,2\n2,1,2\n7,1,2\n"),
        &["row 4: time 7 s", "off an even rate", "cut the trace there"],
    );
    says(&with("0,1,2\n"), &["single row", "rate_hz"]);
    says(&with("0,1,2\n1e-12,1,2\n"), &["bad.csv: sample rate 1000000000000 Hz"]);
    assert!(matches!(with("0,1,2\n1e-12,1,2\n"), ReadError::Trace { .. }));
}

/// Loggers write what they are at the top of a file.
#[test]
fn comment_lines_of_a_csv_file_are_skipped() {
    let (_folder, path) = in_folder(
        "a.csv",
        b"# logger 3; 1 kHz\ntime_s,voltage_V,current_A\n0,1,2\n# paused\n0.5,1,3\n1,1,4\n",
    );
    let trace = csv::read(&path).unwrap();
    assert_eq!((trace.samples(), trace.current_a()), (3, &[2.0, 3.0, 4.0][..]));
}

#[test]
fn what_contradicts_a_file_or_may_mean_another_number_is_refused() {
    let (_folder, path) = in_folder("a.csv", b"time_s;voltage_V;current_A\n0,0;1,5;2,5\n0,1;1,5;2,5\n");
    for repair in [false, true] {
        let options = ReadOptions { repair, ..ReadOptions::default() };
        says(&io::read(&path, &options).unwrap_err(), &["row 1: time_s is \"0,0\"", "decimal comma"]);
    }
    says(&csv_error("time_s,voltage_V,current_A\n0,1,1e308\n"), &["current_A is \"1e308\"", "beyond 3.4e38"]);
    let (_folder, path) = in_folder("b.csv", b"voltage_V,current_A\n1,2\n1,2\n");
    let swapped = ReadOptions {
        voltage: Some("current_A".to_owned()),
        current: Some("voltage_V".to_owned()),
        rate_hz: Some(10.0),
        ..ReadOptions::default()
    };
    says(&io::read(&path, &swapped).unwrap_err(), &["column voltage_V holds voltages", "currents"]);
    std::fs::write(csv::sidecar_path(&path), r#"{"rate_hz": 20}"#).unwrap();
    let other = ReadOptions { rate_hz: Some(10.0), ..ReadOptions::default() };
    says(&io::read(&path, &other).unwrap_err(), &["10 Hz is requested", "says 20 Hz", "--rate"]);
    std::fs::write(csv::sidecar_path(&path), r#"{"rate_hz": 20, "start_s": 3}"#).unwrap();
    let late = |start_s| ReadOptions { start_s: Some(start_s), ..ReadOptions::default() };
    says(&io::read(&path, &late(4.0)).unwrap_err(), &["start at 4 s is requested", "says 3 s", "--start"]);
    assert!(io::read(&path, &late(3.0)).is_ok());
}

#[test]
fn a_rate_that_contradicts_the_times_is_refused_also_where_they_are_to_be_repaired() {
    let rows: String = (0..500).map(|i| format!("{},1,2\n", f64::from(i) / 1000.0)).collect();
    let (_folder, path) = in_folder("a.csv", format!("time_s,voltage_V,current_A\n{rows}").as_bytes());
    for repair in [false, true] {
        let of = |rate_hz| ReadOptions { repair, rate_hz: Some(rate_hz), ..ReadOptions::default() };
        for rate_hz in [2000.0, 500.0, 1002.0] {
            let error = io::read(&path, &of(rate_hz)).unwrap_err();
            says(&error, &[&format!("a rate of {rate_hz} Hz is requested"), "column time_s it is 1000 Hz"]);
            assert!(matches!(error, ReadError::Conflict { .. }));
        }
        assert_eq!(io::read(&path, &of(1000.0)).unwrap().trace.samples(), 500);
    }
}

#[test]
fn rows_with_halves_of_numbers_are_not_cut_to_length() {
    let (repair, many) = (ReadOptions { repair: true, ..ReadOptions::default() }, 1500);
    for rows in [3, many] {
        let text: String = (0..rows).map(|i| format!("0,{i:04},1,5,2,5\n")).collect();
        let (_folder, path) = in_folder("a.csv", format!("time_s,voltage_V,current_A\n{text}").as_bytes());
        says(
            &io::read(&path, &repair).unwrap_err(),
            &[&format!("first {} rows", rows.min(1000)), "decimal comma"],
        );
    }
    // A comma after the last value is no half of a number.
    let (_folder, path) = in_folder("b.csv", b"time_s,voltage_V,current_A\n0,1,2,\n0.5,1,2,\n1,1,2,\n");
    assert_eq!(io::read(&path, &repair).unwrap().trace.samples(), 3);
}

#[test]
fn a_row_of_units_is_refused_and_not_dropped_by_repair() {
    // Dropped, its "mA" would be read as A.
    let (_folder, path) =
        in_folder("units.csv", b"time_s,voltage_V,current_A\ns,V,mA\n0,1,100\n0.001,1,110\n0.002,1,90\n");
    for repair in [false, true] {
        let options = ReadOptions { repair, ..ReadOptions::default() };
        says(&io::read(&path, &options).unwrap_err(), &["units.csv", "row 1", "units"]);
    }
}

#[test]
fn a_file_that_is_not_there_or_not_text() {
    let error = csv::read(Path::new("/no/such/trace.csv")).unwrap_err();
    says(&error, &["/no/such/trace.csv: cannot read it"]);
    assert!(matches!(parquet::read(Path::new("/no/such/trace.parquet")), Err(ReadError::Io { .. })));
    let (_folder, path) = in_folder("bad.csv", b"time_s,voltage_V,current_A\n0,\xff\xfe,1\n");
    says(&csv::read(&path).unwrap_err(), &["row 1: voltage_V"]);
    // A folder where a file should be: the CSV reader fails while reading.
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(csv::read(folder.path()), Err(ReadError::Damaged { .. } | ReadError::Io { .. })));
}

#[test]
fn descriptions_are_compared_with_the_rows() {
    let (_folder, path) = in_folder("a.csv", b"time_s,voltage_V,current_A\n0,1,2\n1,1,2\n");
    let describe = |json: &str| {
        std::fs::write(csv::sidecar_path(&path), json).unwrap();
        csv::read(&path).unwrap_err()
    };
    says(&describe("{"), &["a.json: the JSON description"]);
    says(&describe(r#"{"rate_hz": -1}"#), &["a.json", "rate_hz is -1"]);
    says(&describe(r#"{"samples": 3}"#), &["a.csv: 2 rows, but its description says 3", "cut off"]);
    says(&describe(r#"{"rate_hz": 3.0}"#), &["a.csv: row 2", "3 Hz"]);
}

/// Writes a Parquet file of the given columns.
enum Values {
    Int(Vec<i64>),
    /// Microseconds since 1970.
    Stamp(Vec<i64>),
    Float(Vec<f32>),
    /// Optional doubles: `None` is a null.
    Maybe(Vec<Option<f64>>),
}

fn parquet_file(columns: Vec<(&str, Values)>) -> (TempDir, PathBuf) {
    in_folder("bad.parquet", &parquet_bytes(columns))
}

fn parquet_bytes(columns: Vec<(&str, Values)>) -> Vec<u8> {
    let field = |(name, values): &(&str, Values)| {
        let (physical, repetition) = match values {
            Values::Int(_) | Values::Stamp(_) => (Physical::INT64, Repetition::REQUIRED),
            Values::Float(_) => (Physical::FLOAT, Repetition::REQUIRED),
            Values::Maybe(_) => (Physical::DOUBLE, Repetition::OPTIONAL),
        };
        let stamp =
            matches!(values, Values::Stamp(_)).then(|| LogicalType::timestamp(true, TimeUnit::MICROS));
        let field = Type::primitive_type_builder(name, physical).with_repetition(repetition);
        Arc::new(field.with_logical_type(stamp).build().unwrap())
    };
    let fields = columns.iter().map(field).collect();
    let schema = Arc::new(Type::group_type_builder("t").with_fields(fields).build().unwrap());
    let mut bytes = Vec::new();
    let mut writer =
        SerializedFileWriter::new(&mut bytes, schema, Arc::new(WriterProperties::builder().build())).unwrap();
    let mut group = writer.next_row_group().unwrap();
    for (_, values) in &columns {
        let mut column = group.next_column().unwrap().unwrap();
        match values {
            Values::Int(values) | Values::Stamp(values) => {
                column.typed::<Int64Type>().write_batch(values, None, None)
            }
            Values::Float(values) => column.typed::<FloatType>().write_batch(values, None, None),
            Values::Maybe(values) => {
                let present: Vec<f64> = values.iter().flatten().copied().collect();
                let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
                column.typed::<DoubleType>().write_batch(&present, Some(&levels), None)
            }
        }
        .unwrap();
        column.close().unwrap();
    }
    group.close().unwrap();
    writer.close().unwrap();
    bytes
}

fn parquet_error(columns: Vec<(&str, Values)>) -> ReadError {
    let (_folder, path) = parquet_file(columns);
    parquet::read(&path).unwrap_err()
}

#[test]
fn parquet_errors_name_file_row_and_column() {
    use Values::{Float, Int, Maybe, Stamp};
    let ones = || Float(vec![1.0; 3]);
    let times = || Int(vec![0, 1000, 2000]);
    says(
        &parquet_error(vec![("time_ns", times()), ("voltage_V", ones())]),
        &["bad.parquet", "no column current_A", "time_ns, voltage_V"],
    );
    says(&parquet_error(vec![("voltage_V", ones()), ("current_A", ones())]), &["no column time_ns"]);
    says(
        &parquet_error(vec![("time_ns", times()), ("voltage_V", Stamp(vec![0; 3])), ("current_A", ones())]),
        &["column voltage_V is INT64", "FLOAT", "write it as"],
    );
    says(
        &parquet_error(vec![("time_ns", ones()), ("voltage_V", ones()), ("current_A", ones())]),
        &["column time_ns is FLOAT", "INT64"],
    );
    says(
        &parquet_error(vec![("VOLTAGE_v", ones()), ("voltage_V", ones()), ("current_A", ones())]),
        &["occurs twice"],
    );
    let nan = Float(vec![1.0, f32::NAN, 1.0]);
    says(
        &parquet_error(vec![("time_ns", times()), ("voltage_V", nan), ("current_A", ones())]),
        &["row 2: voltage_V is NaN"],
    );
    let null = Maybe(vec![Some(1.0), Some(1.0), None]);
    says(
        &parquet_error(vec![("time_ns", times()), ("voltage_V", null), ("current_A", ones())]),
        &["row 3: voltage_V is missing"],
    );
    let gap = Int(vec![0, 1000, 9000]);
    says(
        &parquet_error(vec![("time_ns", gap), ("voltage_V", ones()), ("current_A", ones())]),
        &["row 2", "off an even rate"],
    );
    let empty = || Float(vec![]);
    says(
        &parquet_error(vec![("time_ns", Int(vec![])), ("voltage_V", empty()), ("current_A", empty())]),
        &["no samples"],
    );
}

#[test]
fn whole_numbers_are_read_as_in_text_and_stamps_of_a_file_have_their_unit() {
    use Values::{Int, Stamp};
    let stamps = Stamp(vec![0, 1000, 2000]);
    let (_folder, path) = parquet_file(vec![("timestamp", stamps), ("power_mW", Int(vec![1500, -2, 7]))]);
    let trace = parquet::read(&path).unwrap();
    assert_eq!((trace.rate_hz(), trace.current_a()), (1000.0, &[1.5, -2e-3, 7e-3][..]));
    let rows = io::Rows::open(&path, &ReadOptions::default()).unwrap();
    assert_eq!(rows.without_unit().count(), 0);
}

#[test]
fn of_several_faults_a_recording_names_the_one_that_a_trace_in_memory_names() {
    use Values::{Float, Int};
    let (nan, times) = (f32::NAN, || Int(vec![0, 1000, 2000, 3000]));
    let late = || Float(vec![1.0, 1.0, 1.0, nan]);
    let early = || Float(vec![1.0, nan, 1.0, 1.0]);
    let uneven = || Int(vec![0, 1000, 2000, 9000]);
    for (times, voltage, current, says) in [
        (times(), late(), early(), "row 4: voltage_V is NaN"),
        (times(), early(), late(), "row 2: voltage_V is NaN"),
        (uneven(), late(), early(), "row 4: time 0.000009 s"),
    ] {
        let (_folder, path) =
            parquet_file(vec![("time_ns", times), ("voltage_V", voltage), ("current_A", current)]);
        says_both(&path, says);
    }
}

#[track_caller]
fn says_both(path: &Path, part: &str) {
    let options = ReadOptions::default();
    says(&io::read(path, &options).unwrap_err(), &[part]);
    says(&io::TraceFile::open(path, &options).unwrap_err(), &[part]);
}

#[test]
fn a_compression_that_is_not_read_is_named_with_the_remedy() {
    // The footer ends with its length (4 bytes) and PAR1; in it each column's codec is the thrift i32 field
    // 4, `15 00` for none, `15 08` for Brotli (4, zigzag). Only the first such pair after the path
    // `voltage_V` is changed.
    let ones = || Values::Float(vec![1.0; 3]);
    let mut bytes = parquet_bytes(vec![
        ("time_ns", Values::Int(vec![0, 1000, 2000])),
        ("voltage_V", ones()),
        ("current_A", ones()),
    ]);
    let find = |bytes: &[u8], from: usize, what: &[u8]| {
        from + bytes[from..].windows(what.len()).position(|window| window == what).unwrap()
    };
    let schema = find(&bytes, 0, b"\x09voltage_V");
    let chunk = find(&bytes, schema + 10, b"\x09voltage_V");
    let codec = find(&bytes, chunk, &[0x15, 0x00]);
    bytes[codec + 1] = 0x08;
    let (_folder, path) = in_folder("brotli.parquet", &bytes);
    let error = parquet::read(&path).unwrap_err();
    says(
        &error,
        &["brotli.parquet: column voltage_V is compressed with BROTLI", "write it with Zstandard or Snappy"],
    );
}

#[test]
fn missing_values_are_filled_by_repair_and_reported_with_their_place() {
    use Values::{Float, Maybe};
    let times = Maybe(vec![Some(0.0), Some(0.5), Some(1.0), None, Some(2.0), Some(2.5)]);
    let voltage = Maybe(vec![Some(1.0), None, Some(3.0), Some(1.0), Some(5.0), None]);
    let (_folder, path) =
        parquet_file(vec![("time_s", times), ("voltage_V", voltage), ("current_A", Float(vec![1.0; 6]))]);
    says(&io::read(&path, &ReadOptions::default()).unwrap_err(), &["row 2: voltage_V is missing"]);
    let options = ReadOptions { repair: true, ..ReadOptions::default() };
    let loaded = io::read(&path, &options).unwrap();
    assert_eq!(loaded.trace.voltage_v(), [1.0, 2.0, 3.0, 4.0, 5.0, 5.0]);
    let reported: Vec<_> = loaded.repairs.iter().map(|r| (r.code, r.row, r.time_s, r.count)).collect();
    assert_eq!(
        reported,
        [
            (RepairKind::DroppedRows, 4, 1.0, 1),
            (RepairKind::FilledValues, 2, 0.5, 1),
            (RepairKind::FilledValues, 5, 2.5, 1),
            (RepairKind::FilledGap, 3, 1.0, 1)
        ]
    );
}

#[test]
fn surplus_fields_that_repair_drops_are_reported_with_their_place() {
    let rows = "time_s,voltage_V,current_A\n0,1,1\n0.5,1,2,9\n1,1,3\n1.5,1,4,9,9\n";
    let (_folder, path) = in_folder("surplus.csv", rows.as_bytes());
    let options = ReadOptions { repair: true, ..ReadOptions::default() };
    let reported = io::read(&path, &options).unwrap().repairs;
    assert_eq!(io::TraceFile::open(&path, &options).unwrap().repairs(), reported);
    let [reported] = &reported[..] else { panic!("{reported:?}") };
    assert_eq!(
        (reported.code, reported.row, reported.time_s, reported.count),
        (RepairKind::UnevenRows, 2, 0.5, 2)
    );
}

#[test]
fn optional_doubles_and_any_letter_case_are_read() {
    let column = |values: [f64; 3]| Values::Maybe(values.map(Some).to_vec());
    let (_folder, path) = parquet_file(vec![
        ("Current_a", column([1.0, 2.0, 3.0])),
        ("TIME_S", column([0.5, 0.75, 1.0])),
        ("voltage_v", column([4.0; 3])),
    ]);
    let trace = parquet::read(&path).unwrap();
    assert_eq!((trace.rate_hz(), trace.start_s(), trace.current_a()), (4.0, 0.5, &[1.0, 2.0, 3.0][..]));
}

fn small() -> Vec<u8> {
    let ramp: Vec<f32> = (0..400_u16).map(|i| f32::from(i % 100)).collect();
    let trace = Trace::new(ramp.clone(), ramp, 50e3, 0.0, Metadata::default()).unwrap();
    let mut bytes = Vec::new();
    parquet::write(&trace, &mut bytes).unwrap();
    bytes
}

#[test]
fn a_truncated_parquet_file_is_an_error_wherever_it_is_cut() {
    let whole = small();
    for length in (0..whole.len()).step_by(7).chain([whole.len() - 1]) {
        let (_folder, path) = in_folder("cut.parquet", &whole[..length]);
        says(
            &parquet::read(&path).unwrap_err(),
            &["cut.parquet", "cut off or damaged", "copy or export it again"],
        );
    }
}

#[test]
fn a_parquet_file_with_any_byte_changed_gives_a_trace_or_an_error_but_no_panic() {
    let whole = small();
    let (_folder, path) = in_folder("flip.parquet", &whole);
    let mut errors = 0;
    for position in (0..whole.len()).step_by(3) {
        let mut bytes = whole.clone();
        bytes[position] ^= [0x01, 0x80, 0xff][position / 3 % 3];
        std::fs::write(&path, &bytes).unwrap();
        errors += usize::from(parquet::read(&path).is_err());
    }
    assert!(errors > whole.len() / 30, "{errors} of {}", whole.len() / 3);
}

#[test]
fn marks_that_are_no_times_are_not_written() {
    let mark = Mark { time_s: f64::NAN, kind: MarkKind::End, label: String::new() };
    let metadata = Metadata { marks: vec![mark], ..Metadata::default() };
    let trace = Trace::new(vec![1.0], vec![1.0], 1.0, 0.0, metadata).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.parquet");
    let error = parquet::save(&trace, &path).unwrap_err();
    assert!(error.to_string().contains("t.parquet: mark 0 is at NaN s"), "{error}");
    assert!(!path.exists());
}

/// A disk with some room left, bytes.
struct Full(usize);

impl std::io::Write for Full {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0 = self.0.checked_sub(bytes.len()).ok_or(std::io::ErrorKind::StorageFull)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_full_disk_is_reported_wherever_it_fills_up() {
    let ramp: Vec<f32> = (0..30_000_u16).map(f32::from).collect();
    let trace = Trace::new(ramp.clone(), ramp, 50e3, 0.0, Metadata::default()).unwrap();
    let of = |writes: &dyn Fn(&mut Full) -> Result<(), io::WriteError>| {
        let mut roomy = Full(1 << 30);
        writes(&mut roomy).unwrap();
        let length = (1 << 30) - roomy.0;
        for room in [0, 1, 20, length / 2, length - 1] {
            let message = writes(&mut Full(room)).unwrap_err().to_string();
            assert!(message.starts_with("cannot write the trace: "), "{room} of {length}: {message}");
        }
        writes(&mut Full(length)).unwrap();
    };
    of(&|out| parquet::write(&trace, out));
    of(&|out| csv::write(&trace, out));
    of(&|out| csv::write_sidecar(&trace, out));
}
