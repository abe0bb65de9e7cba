//! `quintile trace`: files of recorders, each subcommand, and errors for bad input.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use traces::io::{FORMATS, TraceFormat};

fn quintile(folder: &Path, args: &[&str]) -> Output {
    let binary = env!("CARGO_BIN_EXE_quintile");
    Command::new(binary).current_dir(folder).arg("trace").args(args).output().unwrap()
}

/// Output of a successful call with `--json`.
fn json(folder: &Path, args: &[&str]) -> Value {
    let output = quintile(folder, &[args, &["--json"]].concat());
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// 40 frames of 10 ms at 5 kHz from 0.1 s on: 4 ms at 20 W falling to 12 W, then 2 W; 12 V. One frame has a
/// disturbance.
fn write_trace(folder: &Path) {
    let mut text = String::from("Time(s),Main Voltage(V),Main(mA)\n");
    for i in 0..2600_u32 {
        let (frame, within) = ((i.max(500) - 500) / 50, (i.max(500) - 500) % 50);
        let busy = (500..2500).contains(&i) && within < 20;
        let mut watts = if busy { 20.0 - 0.4 * f64::from(within) } else { 2.0 };
        watts += 0.02 * (f64::from(i * 7919 % 101) / 101.0 - 0.5) + if frame == 30 { 3.0 } else { 0.0 };
        text += &format!("{},12,{}\n", f64::from(i) / 5000.0, watts / 12.0 * 1000.0);
    }
    fs::write(folder.join("t.csv"), text).unwrap();
}

const MARK: [&str; 4] = ["--mark", "0.2", "--end", "0.5"];

#[test]
fn frames_of_a_recorders_csv_have_the_columns_and_add_up() {
    let folder = tempfile::tempdir().unwrap();
    write_trace(folder.path());
    let report = json(folder.path(), &[&["frames", "t.csv", "--out", "f.csv"], &MARK[..]].concat());
    let frames = report["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 40);
    let sum: f64 = frames.iter().map(|frame| frame["energy_J"].as_f64().unwrap()).sum();
    let whole = json(folder.path(), &["energy", "t.csv", "--from", "0.1", "--to", "0.5"]);
    assert!((sum / whole["energy_J"].as_f64().unwrap() - 1.0).abs() < 1e-3, "{sum} {whole}");
    let table = fs::read_to_string(folder.path().join("f.csv")).unwrap();
    for column in ["start_s", "end_s", "energy_J", "power_W", "confidence", "flags", "outlier"] {
        assert!(table.lines().next().unwrap().split(',').any(|name| name == column), "{column}");
    }
    let outliers: Vec<usize> = (0..40).filter(|&i| frames[i]["outlier"] == 1).collect();
    assert_eq!(outliers, [30]);
}

#[test]
fn converted_files_hold_the_same_and_streaming_finds_the_same() {
    let folder = tempfile::tempdir().unwrap();
    write_trace(folder.path());
    let read = FORMATS.iter().filter(|format| format.is_read());
    let mut chain: Vec<String> = read.map(|format| format!("u.{}", format.ending)).collect();
    chain.insert(0, "t.csv".to_owned());
    chain.extend(["t.parquet", "v.jls", "v.csv"].map(str::to_owned));
    for pair in chain.windows(2) {
        json(folder.path(), &["convert", &pair[0], &pair[1]]);
    }
    json(folder.path(), &["convert", "v.csv", "--out", "w.csv"]);
    let [named, last] = ["v.csv", "w.csv"].map(|name| fs::read(folder.path().join(name)).unwrap());
    assert!(named == last, "OUT and --out write the same");
    let both = quintile(folder.path(), &["convert", "v.csv", "w.csv", "--out", "x.csv"]);
    assert_eq!(both.status.code(), Some(2));
    let of = |args: &[&str]| json(folder.path(), &[args, &MARK[..]].concat())["frames"].clone();
    let first = of(&["frames", "t.parquet", "--method", "squares"]);
    for same in ["v.jls", "v.csv"] {
        assert_eq!(of(&["frames", same, "--method", "squares"]), first);
    }
    let streamed = of(&["frames", "t.parquet", "--stream"]);
    for (a, b) in first.as_array().unwrap().iter().zip(streamed.as_array().unwrap()) {
        assert!((a["energy_J"].as_f64().unwrap() / b["energy_J"].as_f64().unwrap() - 1.0).abs() < 1e-6);
    }
    assert!(quintile(folder.path(), &["convert", "t.csv", "t.perfetto-trace"]).status.success());
}

#[test]
fn help_names_every_format_and_standard_output_takes_it() {
    let folder = tempfile::tempdir().unwrap();
    write_trace(folder.path());
    let help = quintile(folder.path(), &["convert", "--help"]);
    let help = String::from_utf8_lossy(&help.stdout).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(help.contains(&traces::io::readable()) && help.contains(&traces::io::endings()), "{help}");
    for TraceFormat { ending, .. } in &FORMATS {
        let file = format!("o.{ending}");
        assert!(quintile(folder.path(), &["convert", "t.csv", &file]).status.success(), "{ending}");
        let piped = quintile(folder.path(), &["convert", "t.csv", "-", "--format", ending]);
        assert!(piped.stdout == fs::read(folder.path().join(file)).unwrap(), "{ending}");
    }
    refused(folder.path(), &["convert", "t.csv", "-", "--format", "cvs"], "csv");
}

#[test]
fn repairs_are_made_only_on_request_and_reported() {
    let folder = tempfile::tempdir().unwrap();
    let rows = "time_s,voltage_V,current_A\n0,5,1\n0.001,5,nan\n0.003,5,3\n0.002,5,2\n0.006,5,6\n0.007,5,7\n";
    fs::write(folder.path().join("bad.csv"), rows).unwrap();
    let refused = quintile(folder.path(), &["convert", "bad.csv", "good.csv"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("row 2"));
    let report = json(folder.path(), &["convert", "bad.csv", "good.csv", "--repair"]);
    let codes: Vec<&str> =
        report["repairs"].as_array().unwrap().iter().map(|r| r["code"].as_str().unwrap()).collect();
    assert_eq!(codes, ["sorted-rows", "filled-values", "filled-gap"]);
    let good = fs::read_to_string(folder.path().join("good.csv")).unwrap();
    let current: Vec<&str> = good.lines().skip(1).map(|line| line.rsplit(',').next().unwrap()).collect();
    assert_eq!(current.len(), 8);
    assert_eq!(current[2..4], ["2", "3"]);
}

#[test]
fn samples_that_a_device_loses_are_missing_in_jls_and_filled_as_in_parquet() {
    let folder = tempfile::tempdir().unwrap();
    write_trace(folder.path());
    for out in ["a.parquet", "a.jls"] {
        let lossy = ["--device-rate", "5000", "--packet-samples", "50", "--packet-loss", "0.1", "--out", out];
        let report = json(folder.path(), &[&["sample", "t.csv"], &lossy[..]].concat());
        assert!(report["lost_samples"].as_u64().unwrap() > 0);
        let refused = quintile(folder.path(), &["convert", out, "b.csv"]);
        assert_eq!(refused.status.code(), Some(2));
    }
    let filled = |from: &str, to: &str| {
        json(folder.path(), &["convert", from, to, "--repair"]);
        fs::read_to_string(folder.path().join(to)).unwrap()
    };
    let (rows, nan) = (filled("a.parquet", "a.csv"), filled("a.jls", "b.csv"));
    let numbers = |text: &str| -> Vec<f64> {
        text.lines().skip(1).flat_map(|line| line.split(',')).map(|field| field.parse().unwrap()).collect()
    };
    let (rows, nan) = (numbers(&rows), numbers(&nan));
    // The last packets may be lost: Parquet then ends before.
    assert!(rows.len() <= nan.len() && rows.len() > nan.len() - 450);
    assert!(rows.iter().zip(&nan).all(|(a, b)| (a - b).abs() < 1e-6), "filled with the same values");
}

#[test]
fn a_refusal_names_the_place_and_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let row = |time_ms: u32, amperes: &str| format!("{},12,{amperes}\n", f64::from(time_ms) / 1000.0);
    let text = |spoil: &dyn Fn(u32) -> String| {
        "time_s,voltage_V,current_A\n".to_owned() + &(0..5000).map(spoil).collect::<String>()
    };
    let write =
        |name: &str, spoil: &dyn Fn(u32) -> String| fs::write(folder.path().join(name), text(spoil)).unwrap();
    write("good.csv", &|i| row(i, "1"));
    write("nan.csv", &|i| row(i, if i == 4997 { "nan" } else { "1" }));
    write("gap.csv", &|i| row(if i < 4000 { i } else { i + 30 }, "1"));
    write("back.csv", &|i| row(if i == 4500 { 4400 } else { i }, "1"));
    let before = fs::read_dir(folder.path()).unwrap().count();
    let cases: [(&[&str], &str, i32, &str); 5] = [
        (&["convert", "nan.csv"], "out", 2, "nan.csv: row 4998: current_A"),
        (&["convert", "gap.csv"], "out", 2, "gap.csv: row 4001: time 4.03 s is 30.00 sample periods off"),
        (&["convert", "back.csv"], "out", 2, "back.csv: row 4501: time 4.4 s is not after"),
        (&["convert", "good.csv"], "no/such/folder/out", 2, "the folder no/such/folder does not exist"),
        (&["convert", "good.csv"], "/proc/self/out", 1, "cannot be written"),
    ];
    for (args, out, code, says) in cases {
        for end in ["parquet", "csv", "tsv.gz", "perfetto-trace"] {
            let out = format!("{out}.{end}");
            let output = quintile(folder.path(), &[args, &[&out]].concat());
            let message = String::from_utf8_lossy(&output.stderr).into_owned();
            assert_eq!(output.status.code(), Some(code), "{args:?} {out}: {message}");
            assert!(message.contains(says) && message.lines().count() == 1, "{args:?} {out}: {message}");
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), before, "{args:?} {out}");
        }
    }
}

#[test]
fn energies_and_plots_of_energies_are_the_same_in_pieces() {
    let folder = tempfile::tempdir().unwrap();
    write_trace(folder.path());
    let of = |more: &[&str]| {
        let args = [
            "energy", "t.csv", "--method", "squares", "--idle", "0..0.09", "--pass", "rest=4", "--run",
            "t.csv",
        ];
        json(folder.path(), &[&args, &MARK[..], more].concat())
    };
    let (whole, pieces) = (of(&[]), of(&["--stream"]));
    for path in [
        "/pooled/mean",
        "/runs/0/energy_J/mean",
        "/runs/1/begin_to_finish_J/mean",
        "/runs/0/passes/0/energy_J/mean",
    ] {
        let value = |report: &Value| report.pointer(path).and_then(Value::as_f64).unwrap();
        assert!((value(&pieces) / value(&whole) - 1.0).abs() < 1e-6, "{path}: {whole} {pieces}");
    }
    assert_eq!(whole["runs"][0]["frames"], pieces["runs"][0]["frames"]);
    let plot = ["plot", "t.csv", "--kind", "energy", "--stream", "--out", "e.svg"];
    assert_eq!(json(folder.path(), &[&plot, &MARK[..]].concat())["shown"], "40 frames");
}

#[test]
fn wrong_input_is_one_line_and_the_right_code() {
    let folder = tempfile::tempdir().unwrap();
    write_trace(folder.path());
    fs::write(folder.path().join("cut.parquet"), b"PAR1 and no more").unwrap();
    let cases: [(&[&str], i32, &str); 11] = [
        (&["frames", "t.csv"], 2, "--mark"),
        (&["frames", "t.csv", "--mark", "99"], 2, "mark at 99 s"),
        (&["frames", "no.csv", "--mark", "1"], 2, "no.csv"),
        (&["frames", "t.csv", "--rail", "gpu", "--mark", "1"], 2, "rail gpu"),
        (&["frames", "cut.parquet", "--mark", "1"], 2, "cut.parquet"),
        (&["sample", "t.csv", "--device", "joulescope", "--out", "a.csv"], 2, "joulescope"),
        (&["convert", "t.csv", "t.xyz"], 2, "ending"),
        (&["plot", "t.csv", "--from", "5", "--out", "a.svg"], 2, "--from and --to: 5 s"),
        (&["pareto", "t.csv"], 2, "time_ms"),
        (&["convert", "t.csv", "t.parquet", "--rail", "main", "--rail", "Main"], 2, "Main is given twice"),
        (
            &["energy", "t.csv", "--mark", "0.2", "--end", "0.5", "--pass", "late=50"],
            2,
            "--pass late begins 50 ms after the start of its frame, but no frame is longer than 10.",
        ),
    ];
    for (args, code, says) in cases {
        let output = quintile(folder.path(), args);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{args:?}: {message}");
        assert!(message.contains(says) && message.lines().count() == 1, "{args:?}: {message}");
    }
}

#[test]
fn every_plot_is_drawn_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    write_trace(folder.path());
    for kind in ["curve", "frame", "overlay", "energy", "histogram", "discard", "repeats"] {
        for end in ["svg", "png", "pdf"] {
            let out = format!("{kind}.{end}");
            let mut args = vec!["plot", "t.csv", "--kind", kind, "--out", &out, "--run", "t.csv"];
            args.extend(MARK);
            let output = quintile(folder.path(), &args);
            assert!(output.status.success(), "{kind} {end}: {}", String::from_utf8_lossy(&output.stderr));
            assert!(fs::metadata(folder.path().join(&out)).unwrap().len() > 500);
        }
    }
}

#[test]
fn sampling_alignment_energy_and_frontiers_answer() {
    let folder = tempfile::tempdir().unwrap();
    write_trace(folder.path());
    let coarse = [
        "sample",
        "t.csv",
        "--device-rate",
        "1000",
        "--rail-ohm",
        "0.5",
        "--specified-voltage",
        "12",
        "--out",
        "c.parquet",
    ];
    // The rail sags by R I; a voltage by specification misses that and finds too much.
    assert!(json(folder.path(), &coarse)["relative_error"].as_f64().unwrap() > 0.02);
    let as_fine = json(folder.path(), &["sample", "t.csv", "--out", "same.parquet"]);
    assert_eq!(as_fine["device"]["rate_hz"], 5000.0, "no finer than the trace");
    let finer =
        quintile(folder.path(), &["sample", "t.csv", "--device-rate", "1e4", "--out", "finer.parquet"]);
    assert!(String::from_utf8_lossy(&finer.stderr).contains("more than the 5000 Hz of the trace"));
    fs::write(folder.path().join("s.csv"), "0\n10\n20\n").unwrap();
    let aligned =
        json(folder.path(), &["align", "t.csv", "s.csv", "--anchor", "0=0.1", "--anchor", "10=0.2"]);
    assert!((aligned["times_s"][2].as_f64().unwrap() - 0.3).abs() < 1e-12);
    let energy = json(
        folder.path(),
        &[
            &[
                "energy",
                "t.csv",
                "--idle",
                "0..0.09",
                "--pass",
                "draw=0",
                "--pass",
                "rest=4",
                "--drop-outliers",
            ],
            &MARK[..],
        ]
        .concat(),
    );
    let run = &energy["runs"][0];
    let passes: f64 =
        run["passes"].as_array().unwrap().iter().map(|p| p["energy_J"]["mean"].as_f64().unwrap()).sum();
    assert!((passes / run["energy_J"]["mean"].as_f64().unwrap() - 1.0).abs() < 1e-9);
    assert!((run["energy_J"]["mean"].as_f64().unwrap() - 0.0568).abs() < 5e-4, "{run}");
    fs::write(folder.path().join("p.csv"), "a,time_ms,energy_mJ\nx,1,10\ny,2,11\nz,3,9\n").unwrap();
    let on = |args: &[&str]| {
        let report = json(folder.path(), &[&["pareto", "p.csv", "--label", "a"], args].concat());
        report["groups"][""].as_array().unwrap().iter().map(|s| s["on_frontier"] == true).collect::<Vec<_>>()
    };
    assert_eq!(on(&[]), [true, false, true]);
    assert_eq!(on(&["--idle-w", "14"]), [true, true, true]);
}

/// A real recorder at idle.
#[test]
fn noise_below_zero_is_sampled_like_anything_else() {
    let folder = tempfile::tempdir().unwrap();
    let row = |i: u32| format!("{},12,{}\n", f64::from(i) / 1000.0, ["0.002", "-0.001"][(i % 2) as usize]);
    let text = "time_s,voltage_V,current_A\n".to_owned() + &(0..5000).map(row).collect::<String>();
    fs::write(folder.path().join("idle.csv"), text).unwrap();
    let output = quintile(folder.path(), &["sample", "idle.csv", "--bits", "24", "--out", "out.csv"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let energy = json(folder.path(), &["energy", "out.csv", "--from", "0", "--to", "5"]);
    let energy_j = energy["runs"][0]["energy_J"]["mean"].as_f64().or(energy["energy_J"].as_f64()).unwrap();
    assert!((energy_j - 0.03).abs() < 1e-3, "{energy}");
}

#[test]
fn a_trace_without_energy_has_no_relative_error() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..2000).map(|i| format!("{},12,0\n", f64::from(i) / 1000.0)).collect();
    fs::write(folder.path().join("off.csv"), "time_s,voltage_V,current_A\n".to_owned() + &rows).unwrap();
    let out = quintile(folder.path(), &["sample", "off.csv", "--out", "out.csv"]);
    let text = String::from_utf8_lossy(&out.stdout).into_owned() + &String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success() && !text.contains("inf") && !text.contains("NaN"), "{text}");
    assert!(json(folder.path(), &["sample", "off.csv", "--out", "again.csv"])["relative_error"].is_null());
}

/// Output of a call that fails with a usage error in one line.
fn refused(folder: &Path, args: &[&str], says: &str) {
    let output = quintile(folder, args);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
    assert!(message.contains(says) && !message.contains("internal error"), "{args:?}: {message}");
}

#[test]
fn invalid_numbers_and_flags_without_effect_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    write_trace(folder.path());
    let cases: [(&[&str], &str); 18] = [
        (&["energy", "t.csv", "--mark", "0.2", "--idle-w", "nan"], "`nan` is not a power"),
        (&["energy", "t.csv", "--mark", "0.2", "--busy-above", "inf"], "`inf` is not a power"),
        (&["energy", "t.csv", "--mark", "0.2", "--from", "0.1"], "cannot be used with"),
        (&["energy", "t.csv", "--from", "0.1", "--drop-outliers"], "cannot be used with"),
        (&["energy", "t.csv", "--mark", "0.2", "--idle-by", "instant"], "--idle-trace"),
        (&["plot", "t.csv", "--kind", "frame", "--mark", "0.2", "--stream", "--out", "a.svg"], "--stream"),
        (&["frames", "t.csv", "--mark", "0.2", "--pixels", "0"], "--pixels"),
        (&["frames", "t.csv", "--mark", "0.2", "--voltage", "nan"], "`nan` is not a voltage"),
        (&["frames", "t.csv", "--mark", "0.2", "--start", "nan"], "`nan` is not a time"),
        (&["frames", "t.csv", "--mark", "0.2", "--rate", "1e99"], "a rate has to be from"),
        (&["frames", "t.csv", "--mark", "0.2", "--rail", "main", "--power-column", "1"], "leave one out"),
        (
            &["plot", "t.csv", "--low-pass", "nan", "--out", "a.svg"],
            "`nan` is not a time; write a number in ms",
        ),
        (
            &["plot", "t.csv", "--kind", "energy", "--mark", "0.2", "--from", "0.1", "--out", "a.svg"],
            "--kind curve",
        ),
        (&["sample", "t.csv", "--device-rate", "0.5", "--out", "a.csv"], "--device-rate 0.5"),
        (&["pareto", "t.csv", "--idle-w", "-1"], "`-1` is not a power of at least 0"),
        (&["frames", "t.csv", "--mark", "nan"], "`nan` is not a time"),
        (&["energy", "t.csv", "--from", "0.3", "--to", "0.1"], "0.3 s to 0.1 s ends before it begins"),
        (&["sample", "t.csv", "--device-rate", "1mhz", "--out", "a.csv"], "for example 50kHz or 1MHz"),
    ];
    for (args, says) in cases {
        refused(folder.path(), args, says);
    }
}

#[test]
fn times_before_zero_are_times() {
    let folder = tempfile::tempdir().unwrap();
    write_trace(folder.path());
    let text = fs::read_to_string(folder.path().join("t.csv")).unwrap();
    let values = text.lines().skip(1).map(|line| line.split_once(',').unwrap().1.to_owned() + "\n");
    fs::write(
        folder.path().join("n.csv"),
        "Main Voltage(V),Main(mA)\n".to_owned() + &values.collect::<String>(),
    )
    .unwrap();
    let early = ["n.csv", "--rate", "5000", "--start", "-5"];
    let of = |args: &[&str]| json(folder.path(), &[&args[..1], &early[..], &args[1..]].concat());
    let whole = json(folder.path(), &["energy", "t.csv", "--from", "0", "--to", "0.52"]);
    let same = of(&["energy", "--from", "-5", "--to", "-4.48"]);
    assert!((same["energy_J"].as_f64().unwrap() / whole["energy_J"].as_f64().unwrap() - 1.0).abs() < 1e-9);
    let frames = of(&["frames", "--mark", "-4.8", "--end", "-4.5"]);
    assert_eq!(frames["frames"].as_array().unwrap().len(), 40);
    let idle = of(&[
        "energy",
        "--mark",
        "-4.8",
        "--end",
        "-4.5",
        "--idle",
        "-5..-4.91",
        "--pixels",
        "1000",
        "--drop-outliers",
    ]);
    assert!(
        (idle["pooled"]["mean"].as_f64().unwrap() - 0.0568).abs() < 5e-4 && idle["pixels"] == 1000,
        "{idle}"
    );
    fs::write(folder.path().join("s.csv"), "0\n10\n").unwrap();
    let aligned = of(&["align", "s.csv", "--anchor", "-10=-4.9", "--anchor", "0=-4.8"]);
    assert!((aligned["times_s"][1].as_f64().unwrap() + 4.7).abs() < 1e-12);
}

#[test]
fn marks_in_the_file_are_taken_in_pieces_as_well() {
    let folder = tempfile::tempdir().unwrap();
    write_trace(folder.path());
    fs::write(
        folder.path().join("t.json"),
        r#"{"marks": [{"time_s": 0.2, "kind": "frame_start"}, {"time_s": 0.5, "kind": "end"}]}"#,
    )
    .unwrap();
    let starts = |args: &[&str]| {
        let report = json(folder.path(), &[&["frames", "t.csv", "--method", "squares"], args].concat());
        report["frames"]
            .as_array()
            .unwrap()
            .iter()
            .map(|frame| frame["start_s"].as_f64().unwrap())
            .collect::<Vec<_>>()
    };
    let (whole, pieces) = (starts(&[]), starts(&["--stream"]));
    assert_eq!((whole.len(), pieces.len()), (40, 40));
    assert!(whole.iter().zip(&pieces).all(|(a, b)| (a - b).abs() < 1e-6));
}

#[test]
fn stamps_that_are_equal_or_not_named_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    write_trace(folder.path());
    fs::write(folder.path().join("same.csv"), "5\n".repeat(6)).unwrap();
    refused(folder.path(), &["align", "t.csv", "same.csv", "--mark", "0.2"], "stamps are the same");
    fs::write(folder.path().join("table.csv"), "frame,when\n1,0\n2,10\n").unwrap();
    let anchors = ["--anchor", "0=0.1", "--anchor", "10=0.2"];
    refused(
        folder.path(),
        &[&["align", "t.csv", "table.csv"], &anchors[..]].concat(),
        "none of its columns (frame, when)",
    );
    fs::write(folder.path().join("table.csv"), "frame,stamp_s\n1,0\n2,10\n").unwrap();
    let aligned = json(folder.path(), &[&["align", "t.csv", "table.csv"], &anchors[..]].concat());
    assert_eq!(aligned["times_s"].as_array().unwrap().len(), 2);
}

#[test]
fn a_plot_reports_gaps_and_fills_them_on_request() {
    let folder = tempfile::tempdir().unwrap();
    write_trace(folder.path());
    let text = fs::read_to_string(folder.path().join("t.csv")).unwrap();
    let kept = text.lines().enumerate().filter(|(line, _)| !(1001..1101).contains(line));
    let kept: String = kept.map(|(_, line)| line.to_owned() + "\n").collect();
    fs::write(folder.path().join("gap.csv"), kept).unwrap();
    let output = quintile(folder.path(), &["plot", "gap.csv", "--out", "a.svg"]);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(2) && message.contains("row 1001"), "{message}");
    let output = quintile(folder.path(), &["plot", "gap.csv", "--repair", "--out", "a.svg"]);
    let (message, shown) = (String::from_utf8_lossy(&output.stderr), String::from_utf8_lossy(&output.stdout));
    assert!(message.contains("100 samples missing") && shown.contains("0 s to 0.52 s"), "{message}{shown}");
}

#[test]
fn invalid_settings_are_refused_and_deviations_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let table = |name: &str, rows: &str| {
        fs::write(folder.path().join(name), format!("time_ms,energy_mJ,sd\n{rows}")).unwrap();
    };
    table("none.csv", "");
    table("zero.csv", "1,10,0\n0,5,0\n");
    table("negative.csv", "1,10,0\n2,5,-1\n");
    table("good.csv", "1,10,1\n2,5,1\n3,20,1\n");
    let none = quintile(folder.path(), &["pareto", "none.csv"]);
    let message = String::from_utf8_lossy(&none.stderr).into_owned();
    assert!(none.status.code() == Some(2) && message.contains("has no row"), "{message}");
    refused(folder.path(), &["pareto", "zero.csv"], "row 2: time_ms is not above 0");
    refused(folder.path(), &["pareto", "negative.csv", "--energy-sd", "sd"], "row 2: a standard deviation");
    let svg = |args: &[&str]| {
        json(folder.path(), &[&["pareto", "good.csv", "--out", "p.svg"], args].concat());
        fs::read_to_string(folder.path().join("p.svg")).unwrap()
    };
    assert!(svg(&["--energy-sd", "sd"]).contains("one standard deviation"));
    assert!(!svg(&[]).contains("one standard deviation"));
    assert!(svg(&["--show", "power"]).contains("mean power"));
}
