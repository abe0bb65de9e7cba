//! `quintile trace` protects inputs and descriptions, and checks units and the end of a recording.

use crate::support::{Inputs, quintile};
use serde_json::Value;

/// Frames of 10 ms at 5 kHz from 0.1 s on: 4 ms at 20 W, then 2 W. The last is followed by an idle gap as
/// long as seven frames.
fn recording() -> String {
    let row = |i: u32| {
        let busy = (500..2000).contains(&i) && (i - 500) % 50 < 20;
        let watts = if busy { 20.0 - 0.4 * f64::from((i - 500) % 50) } else { 2.0 };
        let noise = 0.02 * (f64::from(i * 7919 % 101) / 101.0 - 0.5);
        format!("{},{}\n", f64::from(i) / 5000.0, watts + noise)
    };
    "time_s,power_W\n".to_owned() + &(0..2350).map(row).collect::<String>()
}

fn read(path: &str) -> Vec<u8> {
    std::fs::read(path).unwrap_or_default()
}

#[test]
fn inputs_are_not_overwritten() {
    let inputs = Inputs::new();
    let trace = inputs.put("t.csv", recording());
    let (marks, stamps) = (inputs.put("marks.txt", "0.2\n"), inputs.put("stamps.txt", "1\n2\n3\n4\n"));
    let table = inputs.put("table.csv", "time_ms,energy_mJ\n1,2\n");
    for args in [
        vec!["trace", "frames", &trace, "--mark", "0.2", "--out", &trace],
        vec!["trace", "frames", &trace, "--mark-file", &marks, "--out", &marks],
        vec!["trace", "sample", &trace, "--device-rate", "100", "--out", &trace],
        vec!["trace", "convert", &trace, &trace],
        vec!["trace", "align", &trace, &stamps, "--anchor", "1=1", "--anchor", "2=2", "--out", &stamps],
        vec!["trace", "pareto", &table, "--out", &table],
    ] {
        let before: Vec<Vec<u8>> = [&trace, &marks, &stamps, &table].map(|path| read(path)).into();
        let ended = quintile().call(&args);
        assert_eq!(ended.code, Some(2), "{args:?}: {}", ended.stderr);
        assert!(ended.stderr.contains("is what is read"), "{args:?}: {}", ended.stderr);
        assert_eq!(before, [&trace, &marks, &stamps, &table].map(|path| read(path)), "{args:?}");
    }
}

#[test]
fn a_description_of_something_else_stays() {
    let inputs = Inputs::new();
    let (trace, beside) = (inputs.put("t.csv", recording()), inputs.put("u.csv.json", "{\"my\": 1}"));
    let out = inputs.path("u.csv");
    let ended = quintile().call(["trace", "convert", &trace, &out]);
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    assert!(ended.stderr.contains("u.csv.json is there already"), "{}", ended.stderr);
    assert_eq!(read(&beside), b"{\"my\": 1}");
    let (out, again) = (inputs.path("v.csv"), ["trace", "convert", &trace, &inputs.path("v.csv")]);
    assert_eq!(quintile().call(again).code, Some(0));
    assert_eq!(quintile().call(again).code, Some(0), "{out} and its own description are replaced");
}

/// Files of one name with different endings have descriptions of their own.
#[test]
fn conversions_beside_each_other_keep_their_descriptions() {
    let inputs = Inputs::new();
    let files = [("c.csv.gz", 2350), ("c.tsv", 2000)];
    for (name, samples) in files {
        let rows: String = recording().lines().take(1 + samples).map(|row| format!("{row}\n")).collect();
        let trace = inputs.put("t.csv", rows);
        let ended = quintile().call(["trace", "convert", &trace, &inputs.path(name)]);
        assert_eq!(ended.code, Some(0), "{name}: {}", ended.stderr);
    }
    for (name, samples) in files {
        let text = String::from_utf8(read(&inputs.path(&format!("{name}.json")))).unwrap_or_default();
        assert!(text.contains(&format!("\"samples\": {samples}")), "{name}: {text}");
        let back = inputs.path(&format!("{name}.parquet"));
        assert_eq!(quintile().call(["trace", "convert", &inputs.path(name), &back]).code, Some(0), "{name}");
    }
}

/// Drawing writes only the plot, unless --keep-pyramid is given.
#[test]
fn plots_leave_nothing_beside_the_trace() {
    let inputs = Inputs::new();
    let trace = inputs.put("t.csv", recording());
    let svg = inputs.path("o.svg");
    let pyramid = inputs.path("t.csv.pyramid");
    for (flags, kept) in [(&[][..], false), (&["--keep-pyramid"], true)] {
        let ended = quintile().call(["trace", "plot", &trace, "--out", &svg].iter().chain(flags));
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        assert_eq!(std::path::Path::new(&pyramid).exists(), kept);
    }
}

#[test]
fn frames_are_csv_and_say_so() {
    let inputs = Inputs::new();
    let trace = inputs.put("t.csv", recording());
    let out = inputs.path("f.parquet");
    let ended = quintile().call(["trace", "frames", &trace, "--mark", "0.2", "--out", &out]);
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    assert!(ended.stderr.contains("which is no .parquet"), "{}", ended.stderr);
}

#[test]
fn a_last_frame_that_runs_to_the_end_of_the_trace_is_no_frame_to_average() {
    let inputs = Inputs::new();
    let trace = inputs.put("t.csv", recording());
    let ended = quintile().call(["trace", "frames", &trace, "--mark", "0.2", "--json"]);
    let report: Value = serde_json::from_str(&ended.stdout).unwrap_or_default();
    let summary = &report["summary"];
    assert_eq!(
        (&report["frames"][29]["flags"], &summary["frames"]),
        (&"last+long".into(), &29.into()),
        "{ended:?}"
    );
    let number = |key: &str| summary[key]["mean"].as_f64().unwrap_or(f64::NAN);
    let power_w = summary["overall_power_w"].as_f64().unwrap_or(f64::NAN);
    assert!((number("duration_s") - 0.01).abs() < 1e-5, "{summary}");
    assert!((power_w - number("energy_j") / number("duration_s")).abs() < 1e-9, "{summary}");
}

#[test]
fn an_idle_recording_that_is_too_short_is_refused_by_instant() {
    let inputs = Inputs::new();
    let trace = inputs.put("t.csv", recording());
    let rows: String = (0..500).map(|i| format!("{},2\n", f64::from(i) / 5000.0)).collect();
    let idle = inputs.put("idle.csv", "time_s,power_W\n".to_owned() + &rows);
    let segment =
        ["trace", "energy", &trace, "--from", "0.1", "--to", "0.2", "--idle-trace", &idle, "--idle-by"];
    let ended = quintile().call(segment.into_iter().chain(["instant"]));
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    assert!(ended.stderr.contains("the idle recording lasts 0.1 s, the trace 0.47 s"), "{}", ended.stderr);
    assert_eq!(quintile().call(segment.into_iter().chain(["mean"])).code, Some(0));
}

#[test]
fn pareto_reads_units_or_refuses_them() {
    let inputs = Inputs::new();
    let table = inputs.put("table.csv", "Time [ms],energy_kWh,power_W\n10,1,3\n");
    let pareto = |time: &str, energy: &str| {
        quintile().call(["trace", "pareto", &table, "--time", time, "--energy", energy, "--json"])
    };
    let printed: Value = serde_json::from_str(&pareto("Time [ms]", "energy_kWh").stdout).unwrap_or_default();
    let text = printed.to_string();
    assert!(text.contains("0.01") && text.contains("3600000"), "{text}");
    for (time, energy) in [("power_W", "energy_kWh"), ("energy_kWh", "Time [ms]"), ("Time [ms]", "power_W")] {
        assert_eq!(pareto(time, energy).code, Some(2), "{time} {energy}");
    }
}

/// 0.1 s at 5 kHz of 12 V and about 0.2 A, as CSV.
fn small_currents(inputs: &Inputs) -> String {
    let row = |i: u32| format!("{},12,{}\n", f64::from(i) / 5000.0, 0.15 + 0.05 * f64::from(i % 25) / 25.0);
    let rows: String = (0..500).map(row).collect();
    inputs.put("small.csv", format!("time_s,voltage_V,current_A\n{rows}"))
}

#[test]
fn the_recorder_of_a_small_trace_has_a_range_that_fits_it() {
    let inputs = Inputs::new();
    let (trace, out) = (small_currents(&inputs), inputs.path("coarse.csv"));
    let sample = |args: &[&str]| {
        let call = ["trace", "sample", &trace, "--out", &out, "--json"];
        let ended = quintile().call(call.iter().chain(args));
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        let found: Value = serde_json::from_str(&ended.stdout).expect("JSON");
        (found, ended.stderr)
    };
    let (found, warnings) = sample(&["--bits", "8", "--device-rate", "1kHz"]);
    assert_eq!(found["device"]["current_range_a"], serde_json::json!([-0.3, 0.3]));
    assert_eq!(found["device"]["name"], "daq-1khz-8bit");
    let error = found["relative_error"].as_f64().expect("a number");
    // At most half a code of 12 V in 36 V and half a code of 0.17 A in 0.6 A, each of 255.
    let bound = 0.5 * (36.0 / 12.0 + 0.6 / 0.17) / 255.0;
    assert!(error.abs() < bound && warnings.is_empty(), "{error}: {warnings}");
    let (_, warnings) = sample(&["--bits", "8", "--current-range", "30A"]);
    assert!(warnings.contains("[range-unused]") && warnings.contains("--current-range"), "{warnings}");
    let (found, warnings) = sample(&["--current-range", "100mA"]);
    assert!(warnings.contains("[clipped]"), "{warnings}");
    assert_eq!(found["warnings"][0]["code"], "clipped");
}

/// Without a voltage of its own, a trace is drawn from a rail at the specified one.
#[test]
fn a_specified_voltage_keeps_the_energy_of_a_trace_of_power_alone() {
    let inputs = Inputs::new();
    let (power, out) = (inputs.put("t.csv", recording()), inputs.path("coarse.csv"));
    let sample = |trace: &str, args: &[&str]| {
        let ended = quintile().call(["trace", "sample", trace, "--out", &out].iter().chain(args));
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        ended
    };
    let at_12_v = ["--specified-voltage", "12V", "--device-rate", "100Hz", "--bits", "8", "--json"];
    let ended = sample(&power, &at_12_v);
    let found: Value = serde_json::from_str(&ended.stdout).unwrap_or_default();
    assert_eq!((&found["device"]["rail_v"], &found["warnings"]), (&12.0.into(), &serde_json::json!([])));
    let error = found["relative_error"].as_f64().unwrap_or(f64::NAN);
    assert!(error.abs() < 0.03, "{found}: {}", ended.stderr);
    let trace = small_currents(&inputs);
    let ended = sample(&trace, &["--specified-voltage", "5V"]);
    assert!(ended.stderr.contains("warning: [energy-changed] the device records "), "{}", ended.stderr);
}

#[test]
fn samples_that_are_lost_are_not_counted_as_written() {
    let inputs = Inputs::new();
    let (power, out) = (inputs.put("t.csv", recording()), inputs.path("gaps.csv"));
    let loss = ["--packet-samples", "50", "--packet-loss", "0.3"];
    let ended = quintile().call(["trace", "sample", &power, "--out", &out].iter().chain(&loss));
    let rows = String::from_utf8_lossy(&read(&out)).lines().count() - 1;
    let whole = ended.stdout.replace(',', "");
    assert!(rows < 2350 && whole.contains(&format!(": {rows} samples and {} lost", 2350 - rows)), "{whole}");
}

#[test]
fn binary_files_are_refused_without_their_bytes() {
    let inputs = Inputs::new();
    let files: [(&str, &[u8], &str); 3] = [
        ("a.png", b"\x89PNG\r\n\x1a\n\x00\x00\x00\x0dIHDR", "a PNG image"),
        ("a.jpg", b"\xff\xd8\xff\xe0\x00\x10JFIF", "a JPEG image"),
        ("a.dat", b"\x00\x01\x02\x03\x04\x05\x06\x07\n", "a binary file"),
    ];
    for (name, bytes, says) in files {
        let trace = inputs.put(name, bytes);
        let ended = quintile().call(["trace", "frames", &trace, "--mark", "1"]);
        assert_eq!(ended.code, Some(2), "{}", ended.stderr);
        assert!(
            ended.stderr.contains(says) && ended.stderr.contains(&traces::io::readable()),
            "{}",
            ended.stderr
        );
        assert!(
            !ended.stderr.contains('\u{fffd}') && ended.stderr.lines().count() == 1,
            "{:?}",
            ended.stderr
        );
    }
}

/// Calls the command with `input` on its standard input.
fn piped(args: &[&str], input: &[u8]) -> std::process::Output {
    use std::io::Write;
    use std::process::{Command, Stdio};
    let mut command = Command::new(env!("CARGO_BIN_EXE_quintile"));
    let command = command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("it starts");
    let mut stdin = child.stdin.take().expect("a pipe");
    // A command that refuses its arguments reads nothing.
    let _ = stdin.write_all(input);
    drop(stdin);
    child.wait_with_output().expect("it ends")
}

#[test]
fn a_dash_is_standard_input_and_standard_output() {
    let inputs = Inputs::new();
    let (trace, file) = (inputs.put("t.csv", recording()), inputs.path("o.parquet"));
    let direct = quintile().call(["trace", "convert", &trace, &file]);
    assert_eq!(direct.code, Some(0), "{}", direct.stderr);
    let bytes = recording().into_bytes();
    let through = piped(&["trace", "convert", "-", "-", "--format", "parquet"], &bytes);
    assert_eq!(String::from_utf8_lossy(&through.stderr), "");
    assert!(through.stdout == read(&file), "other bytes through pipes");
    let back = piped(&["trace", "convert", "-", "-"], &through.stdout);
    assert!(back.stdout.starts_with(b"time_s,"), "{}", String::from_utf8_lossy(&back.stderr));
    let frames = piped(&["trace", "frames", "-", "--mark", "0.2", "--out", "-"], &bytes);
    assert!(frames.stdout.starts_with(b"frame,"), "{}", String::from_utf8_lossy(&frames.stdout));
    let plot = piped(&["trace", "plot", "-", "--out", "-"], &bytes);
    let svg = String::from_utf8_lossy(&plot.stdout);
    assert!(
        svg.starts_with("<svg") && svg.contains("standard input"),
        "{}",
        String::from_utf8_lossy(&plot.stderr)
    );
}

#[test]
fn errors_of_a_pipe_name_standard_input() {
    let refused = |args: &[&str], input: &[u8], says: &str| {
        let ended = piped(args, input);
        let message = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert!(matches!(ended.status.code(), Some(1 | 2)) && message.contains(says), "{args:?}: {message}");
        assert!(!message.contains(".tmp") && ended.stdout.is_empty(), "{args:?}: {message}");
    };
    refused(&["trace", "frames", "-", "--mark", "1"], b"a,b\n1,2\n", "standard input: ");
    refused(&["trace", "frames", "-", "--mark", "1"], b"", "standard input: ");
    refused(&["trace", "convert", "-", "-", "--json"], b"", "or --json, not both");
    refused(&["trace", "convert", "-", "o.csv", "--format", "jls"], b"", "--format jls goes with `-`");
}

/// Frames of `samples` samples at 5 kHz, one after another from 0.1 s on, each 4 ms at 20 W and then 2 W.
fn frames_of(samples: &[u32]) -> String {
    let starts = samples.iter().scan(500, |next, &length| {
        let start = *next;
        *next += length;
        Some(start)
    });
    let starts: Vec<u32> = starts.collect();
    let row = |i: u32| {
        let into = starts.iter().rev().find(|&&start| start <= i).map_or(u32::MAX, |&start| i - start);
        let watts = if into < 20 { 20.0 - 0.4 * f64::from(into) } else { 2.0 };
        let noise = 0.02 * (f64::from(i * 7919 % 101) / 101.0 - 0.5);
        format!("{},{}\n", f64::from(i) / 5000.0, watts + noise)
    };
    let end = 500 + samples.iter().sum::<u32>() + 350;
    "time_s,power_W\n".to_owned() + &(0..end).map(row).collect::<String>()
}

/// Warnings of a command, on standard error.
fn warned(args: &[&str], code: &str) -> String {
    let ended = quintile().call(args);
    assert_eq!(ended.code, Some(0), "{args:?}: {}", ended.stderr);
    assert!(ended.stderr.contains(&format!("warning: [{code}] ")), "{args:?}: {}", ended.stderr);
    ended.stderr
}

#[test]
fn a_pass_that_begins_after_the_end_of_some_frames_is_warned_about() {
    let inputs = Inputs::new();
    let trace = inputs.put("t.csv", frames_of(&[&[60; 7][..], &[50], &[60; 8]].concat()));
    let energy = ["trace", "energy", &trace, "--mark", "0.1", "--pass", "late=11"];
    assert!(warned(&energy, "pass-beyond").contains("] 1 of 15 frames end before pass late begins, 11 ms"));
}

#[test]
fn a_power_that_differs_from_voltage_times_current_is_warned_about() {
    let inputs = Inputs::new();
    let rows: String = (0..100).map(|i| format!("{},12,1,24\n", f64::from(i) / 5000.0)).collect();
    let trace = inputs.put("t.csv", format!("time_s,voltage_V,current_A,power_W\n{rows}"));
    let segment = ["trace", "energy", &trace, "--from", "0.001", "--to", "0.002"];
    assert!(warned(&segment, "power-differs").contains("power_W is 2.0000 times voltage times current"));
}

#[test]
fn idle_that_is_none_and_a_current_in_reverse_are_warned_about() {
    let inputs = Inputs::new();
    let trace = inputs.put("t.csv", recording());
    let energy = ["trace", "energy", &trace, "--mark", "0.2"];
    let with = |args: &[&'static str]| warned(&[&energy[..], args].concat(), "idle-busy");
    assert!(with(&["--idle", "0.151..0.199"]).contains("overlaps 5 of 29 frames"));
    assert!(with(&["--idle-w", "25"]).contains("is above that of the frames"));
    let ended = quintile().call(energy.iter().chain(&["--idle", "0..0.09", "--json"]));
    let report: Value = serde_json::from_str(&ended.stdout).unwrap_or_default();
    assert_eq!(report["warnings"], serde_json::json!([]), "{}", ended.stderr);
    let reversed = recording().replace(',', ",-").replacen("time_s,-power_W", "time_s,power_W", 1);
    let reversed = inputs.put("r.csv", reversed);
    warned(&["trace", "energy", &reversed, "--from", "0.1", "--to", "0.2"], "negative-power");
}

#[test]
fn an_alignment_of_even_frames_without_anchors_is_ambiguous() {
    let inputs = Inputs::new();
    let stamps: String = (0..20).map(|frame| format!("{}\n", 7.0 + 0.01 * f64::from(frame))).collect();
    let (trace, stamps) = (inputs.put("t.csv", recording()), inputs.put("stamps.txt", stamps));
    let align = ["trace", "align", &trace, &stamps, "--mark", "0.1"];
    warned(&align, "ambiguous-alignment");
    let ended = quintile().call(align.iter().chain(&["--json"]));
    let report: Value = serde_json::from_str(&ended.stdout).unwrap_or_default();
    let codes = report["warnings"]
        .as_array()
        .map_or(0, |all| all.iter().filter(|warning| warning["code"] == "ambiguous-alignment").count());
    assert_eq!(codes, 1, "{report}");
}

#[test]
fn what_columns_without_names_are_taken_for_is_noted() {
    let inputs = Inputs::new();
    let rows: String = (0..100).map(|i| format!("{},1.5\n", f64::from(i) / 1000.0)).collect();
    let trace = inputs.put("t.csv", rows);
    let energy = |args: &[&str]| {
        quintile().call(["trace", "energy", &trace, "--from", "0", "--to", "0.01"].iter().chain(args))
    };
    let ended = energy(&[]);
    assert!(ended.code == Some(2) && ended.stderr.contains("columns without names"), "{}", ended.stderr);
    let ended = energy(&["--time-column", "1", "--power-column", "2"]);
    assert!(ended.code == Some(0) && ended.stdout.contains("0.015000 J"), "{}{}", ended.stdout, ended.stderr);
    let ended = energy(&["--rate", "1000"]);
    assert!(ended.stderr.contains("column 1 as voltages, column 2 as currents"), "{}", ended.stderr);
}

#[test]
fn inverse_units_come_with_a_warning_about_their_mean() {
    let inputs = Inputs::new();
    let trace = inputs.put("t.csv", recording());
    warned(&["trace", "frames", &trace, "--mark", "0.1", "--inverse"], "inverse-units");
}

#[test]
fn runs_of_different_length_are_compared_as_far_as_the_shorter_goes() {
    let inputs = Inputs::new();
    let [long, short] =
        [30, 22].map(|frames| inputs.put(&format!("{frames}.csv"), frames_of(&vec![50; frames])));
    let out = inputs.path("o.svg");
    let plot = ["trace", "plot", &long, "--mark", "0.1", "--kind", "repeats", "--run", &short, "--out", &out];
    assert!(warned(&plot, "uneven-runs").contains("runs have 22 to 30 frames; the first 22 are shown"));
}
