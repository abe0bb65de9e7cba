//! `quintile trace` as a user calls it: files of recorders, each subcommand, and what it says to wrong input.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn quintile(folder: &Path, args: &[&str]) -> Output {
    let binary = env!("CARGO_BIN_EXE_quintile-e2e");
    Command::new(binary).current_dir(folder).arg("trace").args(args).output().unwrap()
}

/// What a call that has to succeed prints with `--json`.
fn json(folder: &Path, args: &[&str]) -> Value {
    let output = quintile(folder, &[args, &["--json"]].concat());
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// 40 frames of 10 ms at 5 kHz from 0.1 s on: 4 ms at 20 W falling to 12 W, then 2 W; 12 V. One frame has a disturbance.
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
    for (from, to) in [("t.csv", "t.parquet"), ("t.parquet", "u.tsv.gz"), ("u.tsv.gz", "v.csv")] {
        json(folder.path(), &["convert", from, to]);
    }
    let of = |args: &[&str]| json(folder.path(), &[args, &MARK[..]].concat())["frames"].clone();
    let first = of(&["frames", "t.parquet", "--method", "squares"]);
    assert_eq!(of(&["frames", "v.csv", "--method", "squares"]), first);
    let streamed = of(&["frames", "t.parquet", "--stream"]);
    for (a, b) in first.as_array().unwrap().iter().zip(streamed.as_array().unwrap()) {
        assert!((a["energy_J"].as_f64().unwrap() / b["energy_J"].as_f64().unwrap() - 1.0).abs() < 1e-6);
    }
    assert!(quintile(folder.path(), &["convert", "t.csv", "t.perfetto-trace"]).status.success());
}

#[test]
fn repairs_are_made_on_request_alone_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let rows = "time_s,voltage_V,current_A\n0,5,1\n0.001,5,nan\n0.003,5,3\n0.002,5,2\n0.006,5,6\n0.007,5,7\n";
    fs::write(folder.path().join("bad.csv"), rows).unwrap();
    let refused = quintile(folder.path(), &["convert", "bad.csv", "good.csv"]);
    assert_eq!(refused.status.code(), Some(1));
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
fn wrong_input_is_one_line_and_the_right_code() {
    let folder = tempfile::tempdir().unwrap();
    write_trace(folder.path());
    fs::write(folder.path().join("cut.parquet"), b"PAR1 and no more").unwrap();
    let cases: [(&[&str], i32, &str); 9] = [
        (&["frames", "t.csv"], 2, "--mark"),
        (&["frames", "t.csv", "--mark", "99"], 2, "marked at 99 s"),
        (&["frames", "t.csv", "--mark", "nan"], 2, "NaN"),
        (&["frames", "no.csv", "--mark", "1"], 2, "no.csv"),
        (&["frames", "t.csv", "--rail", "gpu", "--mark", "1"], 2, "rail gpu"),
        (&["frames", "cut.parquet", "--mark", "1"], 1, "cut.parquet"),
        (&["convert", "t.csv", "t.xyz"], 2, "ending"),
        (&["plot", "t.csv", "--from", "5", "--out", "a.svg"], 2, "--from 5"),
        (&["pareto", "t.csv"], 2, "time_ms"),
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
