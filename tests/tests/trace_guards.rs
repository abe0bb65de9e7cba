//! What `quintile trace` keeps from being lost or mistaken: inputs, descriptions, units, the end of a recording.

use serde_json::Value;
use tests::{Inputs, quintile};

/// Frames of 10 ms at 5 kHz from 0.1 s on: 4 ms at 20 W, then 2 W. After the last there is rest for as long as seven.
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
fn what_is_read_is_not_written_over() {
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
        let ended = quintile!().call(&args);
        assert_eq!(ended.code, Some(2), "{args:?}: {}", ended.stderr);
        assert!(ended.stderr.contains("is what is read"), "{args:?}: {}", ended.stderr);
        assert_eq!(before, [&trace, &marks, &stamps, &table].map(|path| read(path)), "{args:?}");
    }
}

#[test]
fn a_description_of_something_else_stays() {
    let inputs = Inputs::new();
    let (trace, beside) = (inputs.put("t.csv", recording()), inputs.put("u.json", "{\"my\": 1}"));
    let out = inputs.path("u.csv");
    let ended = quintile!().call(["trace", "convert", &trace, &out]);
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    assert!(ended.stderr.contains("u.json is there already"), "{}", ended.stderr);
    assert_eq!(read(&beside), b"{\"my\": 1}");
    let (out, again) = (inputs.path("v.csv"), ["trace", "convert", &trace, &inputs.path("v.csv")]);
    assert_eq!(quintile!().call(again).code, Some(0));
    assert_eq!(quintile!().call(again).code, Some(0), "{out} and its own description are replaced");
}

#[test]
fn frames_are_csv_and_say_so() {
    let inputs = Inputs::new();
    let trace = inputs.put("t.csv", recording());
    let out = inputs.path("f.parquet");
    let ended = quintile!().call(["trace", "frames", &trace, "--mark", "0.2", "--out", &out]);
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    assert!(ended.stderr.contains("which is no .parquet"), "{}", ended.stderr);
}

#[test]
fn a_last_frame_that_runs_to_the_end_of_the_trace_is_no_frame_to_average() {
    let inputs = Inputs::new();
    let trace = inputs.put("t.csv", recording());
    let ended = quintile!().call(["trace", "frames", &trace, "--mark", "0.2", "--json"]);
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
    let stretch =
        ["trace", "energy", &trace, "--from", "0.1", "--to", "0.2", "--idle-trace", &idle, "--idle-by"];
    let ended = quintile!().call(stretch.into_iter().chain(["instant"]));
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    assert!(ended.stderr.contains("the idle recording lasts 0.1 s, the trace 0.47 s"), "{}", ended.stderr);
    assert_eq!(quintile!().call(stretch.into_iter().chain(["mean"])).code, Some(0));
}

#[test]
fn pareto_reads_units_or_says_that_it_cannot() {
    let inputs = Inputs::new();
    let table = inputs.put("table.csv", "Time [ms],energy_kWh,power_W\n10,1,3\n");
    let asked = |time: &str, energy: &str| {
        quintile!().call(["trace", "pareto", &table, "--time", time, "--energy", energy, "--json"])
    };
    let told: Value = serde_json::from_str(&asked("Time [ms]", "energy_kWh").stdout).unwrap_or_default();
    let text = told.to_string();
    assert!(text.contains("0.01") && text.contains("3600000"), "{text}");
    for (time, energy) in [("power_W", "energy_kWh"), ("energy_kWh", "Time [ms]"), ("Time [ms]", "power_W")] {
        assert_eq!(asked(time, energy).code, Some(2), "{time} {energy}");
    }
}
