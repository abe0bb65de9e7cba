//! `quintile sweep`: plan, shards, merge, an end in the middle, failures, and refusals.

mod ends;
mod failures;
mod python;
mod slurm;

use std::fs;
use std::path::{Path, PathBuf};

use crate::support::{Ended, Inputs, quintile};
use traces::table::InputTable;

/// Four points; a tile of 8 pixels does not fit into a coarse tile of 4.
const SWEEP: &str = r#"(
    name: "tiles",
    settings: {"scene": "tiny", "frames": (0, 2)},
    quick: {"samples": 1},
    axes: [
        Values(path: "gpu.pipeline.tile_px", values: [4, 8]),
        Range(path: "gpu.pipeline.coarse_tile_px", from: 4, to: 8, step: 2, log: true),
    ],
)"#;

fn sweep(args: &[&str]) -> Ended {
    quintile().call(["sweep"].iter().chain(args))
}

fn done(args: &[&str]) -> Ended {
    let ended = sweep(args);
    assert_eq!(ended.code, Some(0), "{args:?}: {}", ended.stderr);
    ended
}

/// Runs points of which some fail.
fn failing(args: &[&str]) -> Ended {
    let ended = sweep(args);
    let failed = ended.stderr.contains("failed: the lines above and the table have the reasons");
    assert!(ended.code == Some(1) && failed, "{args:?}: {}", ended.stderr);
    ended
}

/// Runs all points of [`SWEEP`].
fn run_all(file: &str, out: &str) -> Ended {
    failing(&["run", file, "--out", out])
}

/// `results.parquet` of the sweep in a folder.
fn merged(folder: &str) -> Vec<u8> {
    done(&["merge", folder]);
    fs::read(Path::new(folder).join("results.parquet")).unwrap()
}

/// Files below `points` of the sweep in a folder, by name.
fn files(folder: &str) -> Vec<PathBuf> {
    let entries = |path: &Path| -> Vec<PathBuf> {
        let entries = fs::read_dir(path).into_iter().flatten();
        entries.map(|entry| entry.unwrap().path()).collect()
    };
    let mut files: Vec<PathBuf> =
        entries(&Path::new(folder).join("points")).iter().flat_map(|path| entries(path)).collect();
    files.sort();
    files
}

/// Files of finished points.
fn point_files(folder: &str) -> Vec<PathBuf> {
    let mut files = files(folder);
    files.retain(|path| path.extension().is_some_and(|ending| ending == "json"));
    files
}

/// Files of points that are being written, or were.
fn unfinished_files(folder: &str) -> Vec<PathBuf> {
    let mut files = files(folder);
    files.retain(|path| path.extension().is_some_and(|ending| ending != "json"));
    files
}

#[test]
fn shards_merge_to_the_bytes_of_a_local_run() {
    let inputs = Inputs::new();
    let file = inputs.put("tiles.ron", SWEEP);
    let [local, shards] = ["local", "shards"].map(|name| inputs.path(name));
    let ended = run_all(&file, &local);
    assert!(ended.stdout.contains("4 of 4 runs finished, 1 failed"), "{}", ended.stdout);
    assert!(ended.stderr.contains("4/4 ") && ended.stderr.contains("expected to take"), "{}", ended.stderr);

    let planned = done(&["plan", &file, "--out", &shards]);
    assert!(planned.stdout.contains("4 of 4 runs to do, expected to take about"), "{}", planned.stdout);
    assert!(point_files(&shards).is_empty());
    let half = done(&["run", &file, "--out", &shards, "--shard", "2/2", "--threads", "1"]);
    let says = "shard 2/2: 2 of 2 runs finished, 0 failed; the sweep has 4 runs";
    assert!(half.stdout.contains(says), "{}", half.stdout);
    assert_eq!(point_files(&shards).len(), 2);
    let refused = sweep(&["merge", &shards]);
    assert_eq!(refused.code, Some(1));
    assert!(refused.stderr.contains("2 of 4 points are not finished"), "{}", refused.stderr);
    failing(&["run", &file, "--out", &shards, "--shard", "1/2"]);
    assert_eq!(merged(&local), merged(&shards));
}

#[test]
fn every_point_is_a_row_with_its_settings_and_numbers_or_a_reason() {
    let inputs = Inputs::new();
    let (file, out) = (inputs.put("tiles.ron", SWEEP), inputs.path("out"));
    run_all(&file, &out);
    merged(&out);
    let table = InputTable::read(&Path::new(&out).join("results.parquet")).unwrap();
    assert_eq!(table.numbers("gpu.pipeline.tile_px").unwrap(), [4.0, 4.0, 8.0, 8.0]);
    assert_eq!(table.numbers("gpu.pipeline.coarse_tile_px").unwrap(), [4.0, 8.0, 4.0, 8.0]);
    let errors = table.texts("error").unwrap();
    assert!(
        [0, 1, 3].iter().all(|&row| errors[row].is_empty()) && errors[2].contains("tile_px"),
        "{errors:?}"
    );
    let (cycles, ms) = (table.texts("cycles").unwrap(), table.texts("busy_ms").unwrap());
    assert!(cycles[2].is_empty() && ms[2].is_empty());
    // The numbers are those of `quintile run`.
    let sets =
        ["--set", "gpu.pipeline.tile_px=4", "--set", "gpu.pipeline.coarse_tile_px=4", "--frames", "0..2"];
    let summary = quintile().run("tiny", &sets).summary();
    let frames = summary["frames"].as_array().unwrap();
    let sum = |key: &str| frames.iter().map(|frame| frame[key].as_f64().unwrap()).sum::<f64>();
    assert_eq!(cycles[0].parse::<f64>().unwrap(), sum("cycles"));
    let near = |column: &str, expected: f64| {
        let found: f64 = table.texts(column).unwrap()[0].parse().unwrap();
        assert!((found / expected - 1.0).abs() < 1e-12, "{column}: {found} {expected}");
    };
    near("busy_ms", sum("busy_s") / 2.0 * 1e3);
    near("frame_mJ", sum("energy_j") / 2.0 * 1e3);
    near("energy_per_pixel_nJ", sum("energy_per_pixel_j") / 2.0 * 1e9);
    let counts = &summary["counts"];
    let tested = table.texts("count.samples_tested").unwrap();
    assert_eq!(tested[0].parse::<u64>().unwrap(), counts["samples_tested"].as_u64().unwrap());
}

#[test]
fn a_killed_sweep_continues_where_it_was() {
    let inputs = Inputs::new();
    let many = SWEEP.replace("axes: [", "repetitions: 20, axes: [");
    let file = inputs.put("tiles.ron", many);
    let [killed, whole] = ["killed", "whole"].map(|name| inputs.path(name));
    let begun = || point_files(&killed).len() >= 3;
    let ended = quintile().spawn(["sweep", "run", &file, "--out", &killed]).once(begun).signal("KILL").end();
    assert_eq!(ended.code, None);
    let kept = point_files(&killed);
    assert!((3..80).contains(&kept.len()), "{}", kept.len());
    let written = |path: &PathBuf| fs::metadata(path).unwrap().modified().unwrap();
    let before: Vec<_> = kept.iter().map(written).collect();
    let status = done(&["status", &killed]);
    assert!(status.stdout.contains(&format!("{} of 80 runs finished", kept.len())), "{}", status.stdout);
    let ended = run_all(&file, &killed);
    assert!(ended.stderr.contains(&format!("{} of 80 runs to do", 80 - kept.len())), "{}", ended.stderr);
    assert_eq!(before, kept.iter().map(written).collect::<Vec<_>>());
    run_all(&file, &whole);
    assert_eq!(merged(&killed), merged(&whole));
}

#[test]
fn only_points_whose_inputs_changed_run_again() {
    let inputs = Inputs::new();
    let gpu = include_str!("../../sim/run/gpus/mobile.ron");
    let [one, other] = ["one.ron", "other.ron"].map(|name| inputs.put(name, gpu));
    let text = format!(
        "(name: \"gpus\", settings: {{\"scene\": \"tiny\", \"frames\": (0, 1)}}, axes: [Values(path: \"gpu\", values: [{one:?}, {other:?}])])"
    );
    let (file, out) = (inputs.put("gpus.ron", text), inputs.path("out"));
    done(&["run", &file, "--out", &out]);
    let again = done(&["run", &file, "--out", &out]);
    assert!(again.stderr.contains("0 of 2 runs to do"), "{}", again.stderr);
    inputs.put("other.ron", gpu.replace("latency_cycles: 12", "latency_cycles: 13"));
    let again = done(&["run", &file, "--out", &out]);
    assert!(again.stderr.contains("1 of 2 runs to do"), "{}", again.stderr);
}

#[test]
fn a_dry_run_writes_nothing_and_quick_makes_runs_small() {
    let inputs = Inputs::new();
    let (file, out) = (inputs.put("tiles.ron", SWEEP), inputs.path("out"));
    let ended = done(&["run", &file, "--out", &out, "--dry-run", "--json"]);
    let expected: serde_json::Value = serde_json::from_str(&ended.stdout).unwrap();
    assert!(expected["pending"] == 4 && expected["host_s"].as_f64() > Some(0.0), "{expected}");
    assert!(!Path::new(&out).exists());
    failing(&["run", &file, "--out", &out, "--quick"]);
    merged(&out);
    let table = InputTable::read(&Path::new(&out).join("results.parquet")).unwrap();
    assert_eq!(table.numbers("samples").unwrap(), [1.0; 4]);
}

#[test]
fn constraints_leave_out_points_and_are_named_if_they_leave_out_none() {
    let inputs = Inputs::new();
    let constraints =
        "constraints: [\"gpu.pipeline.tile_px <= gpu.pipeline.coarse_tile_px\", \"samples < 3\"], axes: [";
    let text = SWEEP.replace("axes: [", constraints).replace("(0, 2)}", "(0, 2), \"samples\": 2}");
    let (file, out) = (inputs.put("tiles.ron", text), inputs.path("out"));
    let ended = done(&["run", &file, "--out", &out]);
    assert!(ended.stdout.contains("3 of 3 runs finished, 0 failed"), "{}", ended.stdout);
    let idle = ended.stderr.lines().filter(|line| line.contains("leaves out no point")).collect::<Vec<_>>();
    assert!(idle.len() == 1 && idle[0].contains("tiles.ron:5: constraints[1] "), "{}", ended.stderr);
    let report = done(&["report", &out]).stdout;
    assert!(report.starts_with("constraints[1] leaves out no point: check it, or remove it\n"), "{report}");
}

#[test]
fn tasks_of_a_scheduler_take_their_shards() {
    let inputs = Inputs::new();
    let (file, out) = (inputs.put("tiles.ron", SWEEP), inputs.path("out"));
    let task = |variables: &[(&str, &str)], args: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_quintile"));
        command.args(["sweep", "run", &file, "--out", &out]).args(args).envs(variables.iter().copied());
        command.output().unwrap()
    };
    let slurm = task(&[("SLURM_ARRAY_TASK_ID", "3"), ("SLURM_ARRAY_TASK_COUNT", "4")], &[]);
    assert!(slurm.status.success() && point_files(&out).len() == 1);
    let pbs = task(&[("PBS_ARRAY_INDEX", "1")], &["--shards", "2"]);
    assert!(pbs.status.success() && point_files(&out).len() == 2);
    let unknown = task(&[("HQ_TASK_ID", "1")], &[]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("give --shards N"));
}

#[test]
fn a_report_has_frontier_and_effects() {
    let inputs = Inputs::new();
    let (file, out) = (inputs.put("tiles.ron", SWEEP), inputs.path("out"));
    run_all(&file, &out);
    let report: serde_json::Value = serde_json::from_str(&done(&["report", &out, "--json"]).stdout).unwrap();
    assert_eq!(report["left_out"], 1);
    let designs = report["workloads"]["tiny"].as_array().unwrap();
    let of = |design: &serde_json::Value, key: &str| design[key]["value"].as_f64().unwrap();
    let best = |key: &str| designs.iter().map(|design| of(design, key)).fold(f64::INFINITY, f64::min);
    for key in ["time_s", "energy_j"] {
        let first = designs.iter().find(|design| of(design, key) == best(key)).unwrap();
        assert!(designs.len() == 3 && first["on_frontier"] == true, "{designs:?}");
    }
    // Three points: tiles of 4 pixels with both coarse tiles, tiles of 8 pixels with one.
    let effects = report["effects"].as_array().unwrap();
    let points: Vec<u64> = effects.iter().map(|effect| effect["points"].as_u64().unwrap()).collect();
    assert_eq!(points, [1, 2, 2, 1]);
    let read = |name: &str| fs::read_to_string(Path::new(&out).join(name)).unwrap();
    assert!(read("frontier.svg").contains("coarse_tile_px="));
    assert_eq!((read("designs.csv").lines().count(), read("effects.csv").lines().count()), (4, 5));
    assert!(read("report.html").contains("3 designs in 1 workload"));
    let text = done(&["report", &out]).stdout;
    assert!(
        text.contains("design on the frontier") && text.starts_with("1 point left out: 1 failed\n"),
        "{text}"
    );
}

#[test]
fn a_report_of_an_unfinished_sweep_says_so_first_and_by_cause() {
    let inputs = Inputs::new();
    let (file, out) = (inputs.put("tiles.ron", SWEEP), inputs.path("out"));
    failing(&["run", &file, "--out", &out, "--shard", "1/2"]);
    let text = done(&["report", &out]).stdout;
    let says = "3 points left out: 2 not finished (`quintile sweep run` runs them), 1 failed\n";
    assert!(text.starts_with(says), "{text}");
    let report: serde_json::Value = serde_json::from_str(&done(&["report", &out, "--json"]).stdout).unwrap();
    assert_eq!((&report["left_out_failed"], &report["left_out_unfinished"]), (&1.into(), &2.into()));
    // Two designs on one axis have no interactions: a table with a header alone.
    let table = fs::read_to_string(Path::new(&out).join("interactions.csv")).unwrap();
    assert!(table.starts_with("workload,setting,value,") && table.lines().count() == 1, "{table}");
}

#[test]
fn a_screened_sweep_is_compared_at_its_last_level() {
    let inputs = Inputs::new();
    let text = SWEEP.replace("axes: [", "screen: [bound, packet], axes: [");
    let (file, out) = (inputs.put("tiles.ron", text), inputs.path("out"));
    let ended = run_all(&file, &out);
    assert!(ended.stderr.contains("3 of 4 designs ran at packet"), "{}", ended.stderr);
    let report: serde_json::Value = serde_json::from_str(&done(&["report", &out, "--json"]).stdout).unwrap();
    let workloads: Vec<&String> = report["workloads"].as_object().unwrap().keys().collect();
    assert_eq!(workloads, ["tiny"]);
    assert_eq!((&report["left_out"], &report["left_out_screened"]), (&1.into(), &1.into()));
}

#[test]
fn warnings_of_runs_are_in_rows_and_mark_designs() {
    let inputs = Inputs::new();
    let text = SWEEP.replace("\"tiny\"", "\"tiny\", \"platform\": \"hd_4000\"");
    let (file, out) = (inputs.put("tiles.ron", text), inputs.path("out"));
    run_all(&file, &out);
    merged(&out);
    let table = InputTable::read(&Path::new(&out).join("results.parquet")).unwrap();
    let warnings = table.texts("warnings").unwrap();
    let expected = quintile().run("tiny", &["--platform", "hd_4000", "--frames", "0..2"]).warning_codes();
    assert!(expected.contains(&"platform-mismatch".to_owned()), "{expected:?}");
    for codes in [0, 1, 3].map(|row| warnings[row].split(',').collect::<Vec<_>>()) {
        assert!(codes.contains(&"platform-mismatch") && codes.is_sorted(), "{codes:?}");
        assert!(
            codes.iter().all(|code| expected.iter().any(|known| known == code)),
            "{codes:?} {expected:?}"
        );
    }
    let text = done(&["report", &out]).stdout;
    assert!(text.contains("on the frontier with platform-mismatch (*)"), "{text}");
    let marked = |line: &&str| line.starts_with("tiny") && line.ends_with(" *");
    assert_eq!(
        text.lines().filter(marked).count(),
        text.lines().filter(|line| line.starts_with("tiny")).count()
    );
    let csv = fs::read_to_string(Path::new(&out).join("designs.csv")).unwrap();
    assert!(csv.lines().next().unwrap().ends_with(",warnings") && csv.contains("platform-mismatch"), "{csv}");
}

/// The scripts, run without Slurm: by the shell, with the variables of a task.
#[test]
fn scripts_for_slurm_run_all_points_and_merge_them() {
    let inputs = Inputs::new();
    let (file, out, local) =
        (inputs.put("tiles.ron", SWEEP), inputs.path("with space"), inputs.path("local"));
    let ended = done(&["slurm", &file, "--out", &out, "--tasks", "3"]);
    assert!(
        ended.stdout.contains("3 tasks") && ended.stdout.contains("sbatch --dependency=afterany"),
        "{}",
        ended.stdout
    );
    let script = |name: &str, task: &str| {
        let path = Path::new(&out).join(name);
        let ended =
            std::process::Command::new("sh").arg(path).env("SLURM_ARRAY_TASK_ID", task).output().unwrap();
        ended.status.code()
    };
    // The third point fails, and all are merged.
    assert_eq!(["0", "1", "2"].map(|task| script("array.sh", task)), [Some(0), Some(0), Some(1)]);
    assert_eq!(script("merge.sh", ""), Some(0));
    run_all(&file, &local);
    assert_eq!(fs::read(Path::new(&out).join("results.parquet")).unwrap(), merged(&local));
}

#[test]
fn wrong_sweeps_and_folders_are_refused() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    let refused = |text: &str, code: i32, says: &str| {
        let file = inputs.put("wrong.ron", text);
        let ended = sweep(&["run", &file, "--out", &out, "--dry-run"]);
        assert_eq!(ended.code, Some(code), "{}", ended.stderr);
        assert!(ended.stderr.contains("wrong.ron") && ended.stderr.contains(says), "{}", ended.stderr);
    };
    refused(&SWEEP.replace(".tile_px", ".tile_pix"), 2, "unknown field `tile_pix`, did you mean `tile_px`?");
    refused(&SWEEP.replace("[4, 8]", "[4, \"big\"]"), 2, "wrong.ron:6: axes[0]: gpu.pipeline.tile_px=big");
    refused(
        &SWEEP.replace("\"tiny\"", "\"Fox.glb\", \"scene.settings.samples\": 4"),
        2,
        "use `samples` in its place",
    );
    refused(&SWEEP.replace("[4, 8]", "[]"), 2, "wrong.ron:6: axes[0]: `gpu.pipeline.tile_px` has no values");
    refused(
        &SWEEP.replace(".pipeline.tile_px", "").replace("[4, 8]", "[\"nope.ron\"]"),
        2,
        "wrong.ron:6: axes[0]: `gpu`: nope.ron: cannot read it",
    );
    refused(&SWEEP.replace("axes", "axis"), 2, "unknown field `axis`, did you mean `axes`?");
    refused(&SWEEP.replace("\"tiny\"", "\"tinny\""), 2, "did you mean `tiny`?");
    let (file, other) =
        (inputs.put("a.ron", SWEEP), inputs.put("b.ron", SWEEP.replace("\"tiles\"", "\"other\"")));
    run_all(&file, &out);
    let files = point_files(&out);
    let ended = sweep(&["run", &other, "--out", &out]);
    assert!(ended.code == Some(2) && ended.stderr.contains("holds the sweep `tiles`"), "{}", ended.stderr);
    assert_eq!(point_files(&out), files);
    let ended = sweep(&["run", &file, "--out", &format!("{file}/below")]);
    assert!(ended.code == Some(2) && ended.stderr.contains("check that it is a folder"), "{}", ended.stderr);
    for (file, says) in [(inputs.path("."), "Is a directory"), (inputs.put("binary.ron", b"\xff\0"), "UTF-8")]
    {
        let ended = sweep(&["run", &file, "--out", &out]);
        assert!(ended.code == Some(2) && ended.stderr.contains(says), "{}", ended.stderr);
    }
    let ended = sweep(&["plan", &inputs.path("missing.ron"), "--out", &out]);
    assert!(
        ended.code == Some(2) && ended.stderr.contains("missing.ron: cannot read it"),
        "{}",
        ended.stderr
    );
    let ended = sweep(&["status", &inputs.path("nothing")]);
    assert!(ended.code == Some(2) && ended.stderr.contains("it does not exist"), "{}", ended.stderr);
}
