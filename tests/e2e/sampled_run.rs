//! `--timing sampled`, `--accuracy`, `--budget` and `--verify`.

use crate::support::{Inputs, Results, number, quintile};
use serde_json::Value;

const SMALL: [&str; 4] = ["--size", "160x90", "--samples", "2"];

fn run(args: &[&str]) -> Results {
    quintile().run("default", &[&SMALL, args].concat())
}

fn rows(results: &Results) -> Vec<Value> {
    results.summary()["frames"].as_array().cloned().expect("frames")
}

#[test]
fn predicted_frames_are_marked_in_every_file() {
    let results = run(&["--timing", "sampled", "--frames", "0..30"]);
    let (summary, rows) = (results.summary(), rows(&results));
    let simulated = summary["sampled"]["simulated_frames"].as_array().cloned().expect("a list");
    assert_eq!(simulated.len(), 6);
    assert_eq!(rows.len(), 30);
    for row in &rows {
        let known = simulated.contains(&row["frame"]);
        assert_eq!(row["predicted"] == false, known);
        // Simulated frames have images and hashes, predicted ones have intervals.
        let image = format!("images/frame_{:04}.png", row["frame"].as_u64().unwrap_or_default());
        assert_eq!(results.path(&image).exists(), known, "{image}");
        assert_eq!(row["image"].as_str(), known.then_some(image.as_str()));
        assert_eq!(row["counts_hash"].is_null(), !known);
        assert_eq!(row["cycles_interval"].is_null(), known);
        if !known {
            let [low, high] = [0, 1].map(|end| number(row, &format!("/energy_interval_j/{end}")));
            let energy = number(row, "/energy_j");
            assert!(low <= energy && energy <= high && number(row, "/cycles") > 0.0);
        }
    }
    assert_eq!(number(&summary, "/modelled/distinct_frames"), 6.0);
    assert_eq!(number(&summary, "/modelled/predicted_frames"), 24.0);
    let table = results.text("frames.csv");
    let header = table.lines().next().unwrap_or_default();
    assert!(header.ends_with("outlier,predicted,predicted_energy_low_J,predicted_energy_high_J"), "{header}");
    // A frame that was not found in the trace has no row.
    let rows = |end: &str, mark: &str| {
        table.lines().skip(1).filter(|line| line.contains(mark) && line.ends_with(end)).count()
    };
    assert!((1..=6).contains(&rows(",0,,", "")), "{table}");
    assert!((1..=24).contains(&rows("", ",1,0.")), "{table}");
    assert!(results.text("report.html").contains("predicted"));
    assert!(results.ended.stdout.contains("predicted: from 6 simulated frames"), "{}", results.ended.stdout);
}

/// Other levels predict no frames and add no columns.
#[test]
fn other_levels_predict_nothing() {
    let results = run(&["--frames", "0..4"]);
    assert!(results.summary()["sampled"].is_null() && results.summary()["choice"].is_null());
    assert!(rows(&results).iter().all(|row| row["predicted"] == false && row["image"].is_string()));
    assert!(results.text("frames.csv").lines().next().is_some_and(|header| header.ends_with("outlier")));
}

/// Totals of a sampled run, compared with those of all frames.
#[test]
fn totals_are_near_the_truth_and_sums_agree() {
    let [sampled, whole] =
        ["sampled", "packet"].map(|level| run(&["--timing", level, "--frames", "0..60", "--pacing", "free"]));
    let cycles =
        |results: &Results| rows(results).iter().map(|row| number(row, "/cycles")).sum::<f64>() / 60.0;
    let predicted = number(&sampled.summary(), "/sampled/cycles_per_frame/value");
    // Rounded to whole cycles, frames add up to what was estimated.
    assert!((cycles(&sampled) - predicted).abs() <= 1.0);
    let error = predicted / cycles(&whole) - 1.0;
    assert!(error.abs() < 0.05, "{error}");
    for check in ["frames_against_integral_relative", "parts_against_curve_relative"] {
        assert!(number(&sampled.summary(), &format!("/checks/{check}")) < 1e-6, "{check}");
    }
}

#[test]
fn a_still_scene_and_a_short_one_need_no_prediction() {
    let inputs = Inputs::new();
    let scene = "(settings: (width: 48, height: 32, samples: 2, frames: (0, 30)), \
                 camera: (position: (0, 0, 5), target: (0, 0, 0)), objects: [(shape: Sphere(radius: 1, segments: 12))])";
    let still = quintile().run(&inputs.put("still.ron", scene), &["--timing", "sampled"]);
    assert!(still.summary()["sampled"].is_null());
    let short = run(&["--timing", "sampled", "--frames", "0..4"]);
    assert_eq!(number(&short.summary(), "/modelled/predicted_frames"), 0.0);
    assert_eq!(number(&short.summary(), "/sampled/cycles_per_frame/relative_half_width"), 0.0);
}

/// The actual error is within the requested accuracy, with and without predicted frames.
#[test]
fn the_requested_accuracy_is_met() {
    for (frames, accuracy) in [("0..3", "2%"), ("0..3", "30%"), ("0..36", "3%")] {
        let results = run(&["--frames", frames, "--accuracy", accuracy, "--verify"]);
        let summary = results.summary();
        let requested = number(&summary, "/choice/accuracy");
        let [expected, actual] = ["/choice/expected_error", "/verified/error"].map(|at| number(&summary, at));
        assert!(expected <= requested, "{frames} {accuracy}: expected {expected}");
        assert!(actual <= requested, "{frames} {accuracy}: actual {actual}, expected {expected}");
        assert_eq!(summary["choice"]["meets_accuracy"], true);
        for text in ["chosen: ", "actual error: "] {
            assert!(results.ended.stdout.contains(text), "{}", results.ended.stdout);
        }
        assert!(results.text("report.html").contains("actual error"));
    }
}

/// Small images of every workload.
fn workload(name: &str, args: &[&str]) -> Results {
    let size: &[&str] = match name {
        "ccd" => &["--set", "resolution=16", "--set", "balls=8"],
        "sampling" => &["--size", "64x64"],
        _ => &["--size", "64x36"],
    };
    quintile().run(name, &[size, args].concat())
}

fn workloads() -> impl Iterator<Item = &'static str> {
    workloads::catalog::names().map(|(name, _)| name)
}

/// The expected error of a workload is within the requested accuracy, and so is the actual one of every
/// frame.
#[test]
fn workloads_meet_the_requested_accuracy() {
    for name in workloads() {
        let results = workload(name, &["--frames", "0..2", "--accuracy", "3%", "--verify"]);
        let summary = results.summary();
        let [expected, actual, worst] =
            ["/choice/expected_error", "/verified/error", "/verified/worst_frame_error"]
                .map(|at| number(&summary, at));
        assert!(expected <= 0.03 && summary["choice"]["meets_accuracy"] == true, "{name}: {expected}");
        assert!(actual <= 0.03 && worst <= 0.03, "{name}: {actual}, {worst}, expected {expected}");
        // Where `packet` was chosen, the actual error is its own.
        if summary["choice"]["level"] != "packet" {
            packet_is_near_stepped(name);
        }
    }
}

/// Cycles of every frame at `packet` are near those at `stepped`, or the run warns.
fn packet_is_near_stepped(name: &str) {
    let results = workload(name, &["--frames", "0..2", "--verify"]);
    let worst = number(&results.summary(), "/verified/worst_frame_error");
    let warns = results.warning_codes().contains(&"timing-inaccurate".to_owned());
    assert!(worst <= 0.08 || warns, "{name}: {worst}");
}

/// Frames of workloads are predicted as those of scenes are. Simulated ones are those of `packet`, and the
/// total is near.
#[test]
fn frames_of_workloads_are_predicted() {
    for name in workloads() {
        let [sampled, whole] =
            ["sampled", "packet"].map(|level| workload(name, &["--frames", "0..10", "--timing", level]));
        let pairs: Vec<_> = rows(&sampled).into_iter().zip(rows(&whole)).collect();
        for (row, truth) in &pairs {
            let same = row["cycles"] == truth["cycles"] && row["counts_hash"] == truth["counts_hash"];
            assert!(same || row["predicted"] == true, "{name}: {row} {truth}");
        }
        let [found, right] =
            [&sampled, &whole].map(|run| rows(run).iter().map(|row| number(row, "/cycles")).sum::<f64>());
        let half = match sampled.summary()["sampled"].is_null() {
            true => 0.0,
            false => number(&sampled.summary(), "/sampled/cycles_per_frame/relative_half_width"),
        };
        // Twice the 95 % interval.
        assert!((found / right - 1.0).abs() <= 2.0 * half + 1e-9, "{name}: {found} of {right} within {half}");
    }
}

#[test]
fn a_budget_limits_workloads() {
    let none = workload("occlusion", &["--frames", "0..3", "--budget", "0.01ms"]).summary();
    assert_eq!(none["choice"]["level"], "bound");
}

/// The reference has no error, and is chosen if no other level is accurate enough.
#[test]
fn an_accuracy_beyond_other_levels_gives_stepped() {
    let results = run(&["--frames", "0..2", "--accuracy", "0.0001%", "--verify"]);
    assert_eq!(results.summary()["choice"]["level"], "stepped");
    assert_eq!(number(&results.summary(), "/verified/error"), 0.0);
    assert_eq!(number(&results.summary(), "/verified/worst_frame_error"), 0.0);
}

#[test]
fn a_budget_limits_level_and_frames() {
    let ample = run(&["--frames", "0..2", "--budget", "10h"]).summary();
    assert_eq!(ample["choice"]["level"], "stepped");
    assert!(number(&ample, "/choice/expected_host_s") < 36e3);
    let none = run(&["--frames", "0..30", "--budget", "0.01ms"]).summary();
    assert_eq!(none["choice"]["level"], "bound");
    assert!(none["choice"]["sampling"]["count"].is_u64());
}

#[test]
fn invalid_combinations_are_refused() {
    let cases = [
        (["--accuracy", "2"], "write it as 2%"),
        (["--accuracy", "0%"], "more than 0%"),
        (["--accuracy", "200%"], "at most 100%"),
        (["--budget", "30"], "write it as 30s"),
        (["--budget", "-3s"], "write it as 30s"),
    ];
    for (args, says) in cases {
        let ended = quintile().call(["run", "tiny"].iter().chain(&args));
        assert_eq!(ended.code, Some(2), "{args:?}");
        assert!(ended.stderr.contains(says), "{args:?}: {}", ended.stderr);
    }
    let both = quintile().call(["run", "tiny", "--timing", "packet", "--accuracy", "2%"]);
    assert_eq!(both.code, Some(2));
    assert!(both.stderr.contains("--accuracy") && both.stderr.contains("--timing"), "{}", both.stderr);
    let help = quintile().call(["help", "run"]);
    assert!(help.stdout.contains("--accuracy 2% --verify"), "{}", help.stdout);
}
