//! `quintile record` and `quintile time`: the numbers of a run, and refusals.

use crate::support::{Inputs, Refusals, quintile};
use serde_json::Value;

/// Recording of three frames of `tiny` on the reference GPU.
fn recorded(inputs: &Inputs) -> String {
    let file = inputs.path("tiny.rec");
    let ended = quintile().call(["record", "tiny", "--frames", "0..3", "--samples", "2", "--out", &file]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(ended.stdout.contains("3 frames of tiny, "), "{}", ended.stdout);
    file
}

/// Rows of `quintile time --json`.
fn timed(args: &[&str]) -> Vec<Value> {
    let ended = quintile().call(["time"].iter().chain(args).chain(&["--json"]));
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    serde_json::from_str(&ended.stdout).unwrap()
}

#[test]
fn recorded_frames_have_the_numbers_of_a_run() {
    let inputs = Inputs::new();
    let file = recorded(&inputs);
    let change = "gpu.units.setup.rates.triangles_in=0.5";
    for (timing, set) in [("packet", None), ("bound", Some(change)), ("stepped", Some(change))] {
        let set: Vec<&str> = set.iter().flat_map(|change| ["--set", change]).collect();
        let rows = timed(&[&[file.as_str(), "--timing", timing], &set[..]].concat());
        let args = [&["--frames", "0..3", "--samples", "2", "--timing", timing], &set[..]].concat();
        let run = quintile().run("tiny", &args).summary();
        let cycles = run["frames"].as_array().unwrap().iter().map(|frame| frame["cycles"].as_u64().unwrap());
        assert_eq!(rows[0]["cycles"].as_u64(), Some(cycles.sum()), "{timing}");
        let mean_j = run["truth"]["energy_j"]["mean"].as_f64().unwrap();
        let error = rows[0]["frame_mj"].as_f64().unwrap() * 1e-3 / mean_j - 1.0;
        assert!(error.abs() < 1e-12, "{timing}: {error:e}");
        assert_eq!(rows[0]["counts"]["samples_tested"], run["counts"]["samples_tested"]);
    }
}

#[test]
fn many_machines_are_timed_in_the_order_given_by_any_number_of_threads() {
    let inputs = Inputs::new();
    let file = recorded(&inputs);
    let reference = include_str!("../../sim/run/gpus/reference.ron");
    let gpu = |number: u32| {
        let text = reference.replace("core_hz: 400e6", &format!("core_hz: {}e6", 200 + 10 * number));
        inputs.put(&format!("gpu{number}.ron"), text)
    };
    let gpus: Vec<String> = (0..20).map(gpu).collect();
    let args: Vec<&str> =
        [file.as_str(), "--gpu"].into_iter().chain(gpus.iter().map(String::as_str)).collect();
    let one = timed(&[&args[..], &["--threads", "1"]].concat());
    assert_eq!(one, timed(&[&args[..], &["--threads", "3"]].concat()));
    let names: Vec<&str> = one.iter().map(|row| row["gpu"].as_str().unwrap()).collect();
    assert_eq!(names, gpus);
}

#[test]
fn what_cannot_be_timed_is_refused() {
    let inputs = Inputs::new();
    let file = recorded(&inputs);
    let cut = inputs.put("cut.rec", &std::fs::read(&file).unwrap()[..200]);
    let (missing, unwritable) = (inputs.path("no.rec"), inputs.path("none/tiny.rec"));
    let mut refusals = Refusals::default();
    let mut check = |args: &[&str], code, says: &[&str], remedy| {
        refusals.check(&quintile().call(args), code, says, remedy);
    };
    check(&["time", &file, "--gpu", "mobile"], 2, &["`mobile`", "`pipeline.", "`reference`"], "record them");
    let tile = ["time", &file, "--set", "gpu.pipeline.tile_px=4"];
    check(&tile, 2, &["`pipeline.tile_px` 4", "with 8"], "record them");
    let scene = ["time", &file, "--set", "scene.settings.samples=4"];
    check(&scene, 2, &["scene.settings"], "record them anew");
    check(&["time", &file, "--set", "bins=4"], 2, &["bins=4"], "only gpu., platform. and table.");
    check(&["time", &file, "--timing", "pakket"], 2, &["`pakket`"], "`packet`");
    check(&["time", &missing], 2, &["no.rec"], "check the path");
    check(&["time", &cut], 2, &["cut.rec"], "record the frames again");
    check(&["record", "tiny", "--out", &unwritable], 2, &["none"], "does not exist; create it");
    refusals.done();
}

#[test]
fn a_recording_replaces_recordings_alone() {
    let inputs = Inputs::new();
    assert_eq!(recorded(&inputs), recorded(&inputs));
    let mut refusals = Refusals::default();
    for (name, text) in [("notes.txt", "mine"), ("empty.rec", "")] {
        let file = inputs.put(name, text);
        let ended = quintile().call(["record", "tiny", "--frames", "0..1", "--samples", "1", "--out", &file]);
        refusals.check(&ended, 2, &[name, "is not from `quintile record`"], "move or rename it");
        assert_eq!(std::fs::read_to_string(&file).unwrap(), text);
    }
    refusals.done();
}
