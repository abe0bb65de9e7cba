//! `--dry-run` and the expected time: their output, and that they change no results.

use crate::support::{Inputs, number, quintile};
use serde_json::Value;

const SMALL: [&str; 4] = ["--size", "96x54", "--samples", "2"];

/// The JSON of a dry run into a folder that must not appear.
fn dry(args: &[&str]) -> Value {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    let ended = quintile().call(["run"].iter().chain(args).chain(&["--dry-run", "--json", "--out", &out]));
    assert_eq!((ended.code, ended.stderr.as_str()), (Some(0), ""), "{args:?}");
    assert!(!std::path::Path::new(&out).exists(), "{args:?} wrote into {out}");
    serde_json::from_str(&ended.stdout).expect("JSON")
}

#[test]
fn a_dry_run_describes_the_run_and_writes_nothing() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    let args = [
        "run",
        "default",
        "--size",
        "96x54",
        "--frames",
        "2..8",
        "--gpu",
        "mobile",
        "--lens",
        "0.2",
        "--dry-run",
        "--out",
        &out,
    ];
    let ended = quintile().call(args);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(!std::path::Path::new(&out).exists());
    for part in [
        "scene     default",
        "triangles",
        "96x54, 8 samples per pixel (owen)",
        "lens 0.2, shutter 0.5",
        "6 (2..8), of which 6 differ and 6 are simulated",
        "mobile, platform iphone_4s, energy table 28nm",
        "packet, pacing vsync",
        "expected  about ",
        " MB of memory",
        &out,
    ] {
        assert!(ended.stdout.contains(part), "`{part}` is missing:\n{}", ended.stdout);
    }
}

#[test]
fn distinct_frames_are_counted() {
    let inputs = Inputs::new();
    let still = "(settings: (width: 48, height: 32, samples: 2, frames: (0, 30)), camera: (position: (0, 0, 5), target: (0, 0, 0)), \
                 objects: [(shape: Sphere(radius: 1, segments: 12))])";
    let found = dry(&[&inputs.put("still.ron", still)]);
    assert_eq!(["/distinct_frames", "/simulated_frames"].map(|at| number(&found, at)), [1.0, 1.0]);
    let sampled = dry(&[&["default", "--timing", "sampled", "--frames", "0..30"], &SMALL[..]].concat());
    assert_eq!(["/distinct_frames", "/simulated_frames"].map(|at| number(&sampled, at)), [30.0, 6.0]);
    let seconds = number(&sampled, "/expected/host_s");
    assert!(
        seconds.is_finite() && seconds > 0.0 && number(&sampled, "/expected/memory_bytes") > 1e6,
        "{sampled}"
    );
}

#[test]
fn choice_and_warnings_are_shown_before_the_run() {
    let chosen = dry(&[&["default", "--frames", "0..2", "--accuracy", "50%"], &SMALL[..]].concat());
    assert!(chosen["chosen"].as_str().is_some_and(|line| line.contains("expected error")), "{chosen}");
    let warned = dry(&[&["default", "--frames", "0..2", "--gpu", "discrete"], &SMALL[..]].concat());
    assert_eq!(warned["warnings"][0]["code"], "platform-mismatch");
}

/// Workloads are drawn at reduced sizes too, whether by `--size` or by an option of their own.
#[test]
fn workloads_have_an_expected_time() {
    for workload in workloads::catalog::names().map(|(name, _)| name) {
        let found = dry(&[workload, "--frames", "0..3"]);
        let seconds = number(&found, "/expected/host_s");
        assert!(seconds > 0.0 && seconds < 3600.0, "{workload}: {seconds} s");
        assert!(found["expected"]["memory_bytes"].is_null(), "{workload}");
    }
    let [small, large] = ["8", "64"].map(|resolution| {
        number(&dry(&["ccd", "--set", &format!("resolution={resolution}")]), "/expected/host_s")
    });
    assert!(large > 2.0 * small, "{small} s and {large} s");
}

#[test]
fn errors_are_found_without_running() {
    let ended = quintile().call(["run", "tiny", "--gpu", "referense", "--dry-run"]);
    assert_eq!(ended.code, Some(2));
    assert!(ended.stderr.contains("did you mean `reference`?"), "{}", ended.stderr);
}

/// The note at the start is on standard error; files are the same with and without it.
#[test]
fn the_expected_time_is_noted_and_changes_no_result() {
    let run = |args: &[&str]| quintile().run("default", &[&SMALL[..], &["--frames", "0..2"], args].concat());
    let (noted, quiet, json) = (run(&[]), run(&["--quiet"]), run(&["--json"]));
    let note = noted.ended.stderr.lines().find(|line| line.starts_with("note: expected time: about "));
    assert!(note.is_some_and(|line| line.ends_with(" MB of memory")), "{}", noted.ended.stderr);
    assert!(!quiet.ended.stderr.contains("expected time") && !json.ended.stderr.contains("expected time"));
    for name in ["images/frame_0000.png", "images/frame_0001.png", "frames.csv", "trace.csv"] {
        assert!(noted.bytes(name) == quiet.bytes(name) && noted.bytes(name) == json.bytes(name), "{name}");
    }
    let rows = [&noted, &quiet, &json].map(|results| results.summary()["frames"].clone());
    assert!(rows[0].is_array() && rows[0] == rows[1] && rows[0] == rows[2]);
}
