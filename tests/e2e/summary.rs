//! `summary.json`: schema, provenance, and repeating a run by it.

use std::fs;
use std::path::Path;

use crate::support::{Glb, Inputs, Results, Schema, quintile, without_host};
use serde_json::{Value, json};

const SMALL: [&str; 4] = ["--size", "64x36", "--samples", "2"];

/// A scene that does not move.
const STILL: &str =
    "(settings: (width: 32, height: 18, samples: 2, frames: (0, 3)), objects: [(shape: Sphere(radius: 1))])";

fn run(scene: &str, args: &[&str]) -> Results {
    quintile().run(scene, args)
}

#[test]
fn summaries_match_their_schema() {
    let schema = Schema::of_book("summary.schema.json");
    let inputs = Inputs::new();
    let still = inputs.put("still.ron", STILL);
    let small = |args: &[&'static str]| [&SMALL[..], args].concat();
    let runs: [(&str, &str, Vec<&str>); 8] = [
        ("a scene", "tiny", vec!["--heat", "samples_tested", "--exr"]),
        ("every unit's stalls", "tiny", vec!["--timing", "stepped"]),
        ("a workload", "multiview", small(&["--frames", "0..2", "--set", "views=2"])),
        ("frames predicted", "default", small(&["--frames", "0..12", "--timing", "sampled"])),
        ("an accuracy", "default", small(&["--frames", "0..24", "--accuracy", "20%", "--verify"])),
        ("a budget", "default", small(&["--frames", "0..2", "--budget", "1h"])),
        ("a still scene", &still, vec!["--lens", "0.1"]),
        ("all of the flags", "tiny", vec!["--pacing", "free", "--packet-loss", "0.1", "--bound", "low"]),
    ];
    for (what, scene, args) in runs {
        let faults = schema.faults(&run(scene, &args).summary());
        assert!(faults.is_empty(), "{what}:\n{}", faults.join("\n"));
    }
}

/// Control: the schema has to be strict.
#[test]
fn the_schema_describes_every_key_and_needs_it() {
    let schema = Schema::of_book("summary.schema.json");
    assert_eq!(schema.gaps(), [""; 0]);
    let summary = run("tiny", &[]).summary();
    let broken = |change: fn(&mut Value)| {
        let mut summary = summary.clone();
        change(&mut summary);
        schema.faults(&summary).join("\n")
    };
    assert!(broken(|s| s["frames"][1]["energy_mj"] = 1.0.into()).starts_with("/frames/1/energy_mj: not in"));
    assert!(
        broken(|s| drop(s["host"].as_object_mut().and_then(|host| host.remove("cpu"))))
            .starts_with("/host/cpu")
    );
    assert!(broken(|s| s["settings"]["width"] = (-1).into()).starts_with("/settings/width: -1"));
    assert!(broken(|s| s["schema"] = 1.into()).starts_with("/schema: 1"));
}

#[test]
fn a_summary_records_the_provenance_of_the_run() {
    let inputs = Inputs::new();
    // Where a camera is placed depends on the focus depth, if one is given.
    let camera = "(camera: (position: (1, 1, 3), target: (0, 0, 0)), ";
    let scene = inputs.put("still.ron", STILL.replacen('(', camera, 1));
    let gpu = inputs
        .put("gpu.ron", fs::read(crate::support::root().join("sim/run/gpus/reference.ron")).expect("a GPU"));
    let results = run(&scene, &["--lens", "0.2", "--gpu", &gpu, "--threads", "2", "--seed", "5"]);
    let (summary, report) = (results.summary(), results.text("report.html"));
    assert_eq!((&summary["schema"], &summary["request"]["seed"]), (&Value::from(3), &Value::from(5)));
    assert_eq!(summary["settings"]["table"], "owen");
    let listed = summary["inputs"].as_array().expect("inputs");
    assert_eq!(listed.iter().map(|input| &input["path"]).collect::<Vec<_>>(), [&gpu, &scene]);
    for input in listed {
        assert_eq!(input["sha256"].as_str().map(str::len), Some(64));
        assert!(report.contains(input["sha256"].as_str().unwrap_or("?")), "no hash in the report");
    }
    let host = &summary["host"];
    let command: Vec<&str> =
        host["command"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    assert_eq!(command[..5], ["quintile", "run", &scene, "--out", &results.folder().display().to_string()]);
    assert_eq!(host["threads"], 2);
    assert!(report.contains("--threads 2") && report.contains("found automatically"));
    // The sphere's centre, which an automatic focus is at, as a number.
    let focus = crate::support::number(&summary, "/camera/focus");
    assert!(focus > 1.0 && report.contains(&format!("depth {focus} scene units")), "{focus}");
    let sharp = run(&scene, &["--lens", "0.2", "--gpu", &gpu, "--seed", "5", "--focus", &focus.to_string()]);
    assert!(sharp.bytes("images/frame_0000.png") == results.bytes("images/frame_0000.png"));
}

/// Buffers and textures that a file references are inputs, including missing ones.
#[test]
fn referenced_files_are_inputs() {
    let inputs = Inputs::new();
    let mut square = Glb::square();
    square.texture_coordinates();
    square.material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    square.json["textures"] = json!([{"source": 0}]);
    square.json["images"] = json!([{"uri": "missing.png"}]);
    square.json["buffers"][0]["uri"] = json!("square.bin");
    let buffer = inputs.put("square.bin", &square.binary);
    let model = inputs.put("square.gltf", square.json.to_string());
    let part = inputs.put("part.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let scene = inputs.put(
        "scene.ron",
        "(settings: (width: 16, height: 16, samples: 1, frames: (0, 1)), objects: [(file: \"part.obj\"), (file: \"square.gltf\")])",
    );
    let listed = run(&scene, &[]).summary()["inputs"].clone();
    let listed = listed.as_array().expect("inputs");
    let paths: Vec<&str> = listed.iter().filter_map(|input| input["path"].as_str()).collect();
    assert_eq!(paths, [&inputs.path("missing.png"), &part, &scene, &buffer, &model]);
    let missing: Vec<bool> = listed.iter().map(|input| input["sha256"].is_null()).collect();
    assert_eq!(missing, [true, false, false, false, false]);
}

#[test]
fn a_run_is_repeated_to_the_same_bytes() {
    let inputs = Inputs::new();
    let still = inputs.put("still.ron", STILL);
    let options = inputs.put("options.ron", "(views: 2)");
    let table = inputs.put("table.ron", "(pattern: Jittered)");
    let runs: [(&str, &[&str]); 6] = [
        ("tiny", &["--exr", "--heat", "depth_writes", "--seed", "18446744073709551615", "--rate", "59.94"]),
        (&still, &["--lens", "0.1", "--table", &table, "--samples", "3", "--trace-rate", "123456.7"]),
        (
            "multiview",
            &["--size", "64x36", "--frames", "1..3", "--options", &options, "--set", "spacing=0.3"],
        ),
        (
            "default",
            &["--size", "64x36", "--samples", "2", "--frames", "0..24", "--accuracy", "20%", "--verify"],
        ),
        ("default", &["--size", "64x36", "--samples", "2", "--frames", "0..24", "--budget", "300ms"]),
        (
            "default",
            &[
                "--size",
                "64x36",
                "--samples",
                "2",
                "--frames",
                "3..15",
                "--timing",
                "sampled",
                "--pacing",
                "free",
            ],
        ),
    ];
    for (scene, args) in runs {
        let first = run(scene, args);
        let summary = first.path("summary.json").display().to_string();
        let out = inputs.path("again");
        let ended = quintile().call(["run", "--again", &summary, "--out", &out, "--threads", "1"]);
        assert_eq!(ended.code, Some(0), "{scene} {args:?}: {}", ended.stderr);
        let again = Results::in_folder(Path::new(&out), ended);
        let (one, other) = (without_host(first.files()), without_host(again.files()));
        assert_eq!(one.keys().collect::<Vec<_>>(), other.keys().collect::<Vec<_>>());
        for (name, bytes) in &one {
            assert!(*bytes == other[name], "{scene} {args:?}: {} differs", name.display());
        }
    }
}

#[test]
fn a_changed_program_or_input_is_refused() {
    let inputs = Inputs::new();
    let scene = inputs.put("still.ron", STILL);
    let results = run(&scene, &[]);
    let recorded = results.summary();
    let again = |summary: &str, extra: &[&str]| {
        let out = inputs.path("again");
        quintile().call(["run", "--again", summary, "--out", &out].iter().chain(extra))
    };
    let summary = results.path("summary.json").display().to_string();
    let refused = |summary: &str, says: &[&str]| {
        let ended = again(summary, &[]);
        assert_eq!(ended.code, Some(2), "{}", ended.stderr);
        says.iter().for_each(|part| assert!(ended.stderr.contains(part), "{part}: {}", ended.stderr));
        assert!(!Path::new(&inputs.path("again")).exists());
    };
    inputs.put("still.ron", STILL.replace("radius: 1", "radius: 2"));
    refused(&summary, &[&scene, "was changed after the run was made", "--force"]);
    assert_eq!(again(&summary, &["--force"]).code, Some(0));
    fs::remove_dir_all(inputs.path("again")).expect("a folder");
    fs::remove_file(&scene).expect("a scene");
    refused(&summary, &[&scene, "is missing", "--force"]);
    inputs.put("still.ron", STILL);
    let changed = |key: &str, value: Value| {
        let mut changed = recorded.clone();
        changed[key] = value;
        inputs.put("summary.json", changed.to_string())
    };
    refused(&changed("version", "0.0.1".into()), &["Quintile 0.0.1", env!("CARGO_PKG_VERSION"), "--force"]);
    assert_eq!(again(&inputs.path("summary.json"), &["--force"]).code, Some(0));
    fs::remove_dir_all(inputs.path("again")).expect("a folder");
    refused(&changed("schema", 1.into()), &["its schema is 1"]);
    refused(&changed("request", 2.into()), &["it is cut off or damaged"]);
    refused(&inputs.put("summary.json", "{}"), &["not the summary of a run"]);
    for flag in [&["--seed", "2"][..], &["--lens", "1"], &["--heat", "depth_writes"], &["--verify"]] {
        let ended = again(&summary, flag);
        assert_eq!(ended.code, Some(2), "{}", ended.stderr);
        assert!(ended.stderr.contains("cannot be used with"), "{}", ended.stderr);
    }
    assert_eq!(quintile().call(["run", "tiny", "--again", &summary]).code, Some(2));
}

/// A variable of the environment makes a frame panic.
#[test]
fn a_crash_reports_its_place_and_a_command_to_repeat_it() {
    let inputs = Inputs::new();
    let out = inputs.path("out");
    let results = quintile().run_in(Path::new(&out), "tiny", &[]);
    let before = results.files();
    let program = env!("CARGO_BIN_EXE_quintile");
    for backtrace in ["0", "1"] {
        let shell =
            "export QUINTILE_PANIC_IN_FRAME=2 RUST_BACKTRACE=$1; exec \"$0\" run tiny --seed 3 --out \"$2\"";
        let ended = crate::support::Quintile::new("sh").call(["-c", shell, program, backtrace, &out]);
        assert_eq!(ended.code, Some(1), "{}", ended.stderr);
        for says in [
            "error: sim/run/src/frame.rs:",
            "internal error in frame 2: requested by a test",
            env!("CARGO_PKG_VERSION"),
            "quintile run tiny --seed 3 --frames 2..3 --out frame_2",
        ] {
            assert!(ended.stderr.contains(says), "{says}: {}", ended.stderr);
        }
        assert_eq!(
            ended.stderr.contains("stack backtrace") || ended.stderr.contains("   0: "),
            backtrace == "1"
        );
        assert!(before == results.files());
    }
}

/// Draws and what is of no single draw are the pass: time, energy and counts at every level, busy time where
/// stalls are recorded.
#[test]
fn the_draws_of_a_pass_add_up_to_it() {
    for level in ["stepped", "packet", "bound"] {
        let summary = run("default", &["--size", "64x36", "--frames", "0..1", "--timing", level]).summary();
        let pass = &summary["passes"][0];
        let mut parts: Vec<&Value> = pass["draws"].as_array().expect("draws").iter().collect();
        assert!(parts.len() > 1, "{level}");
        parts.push(&pass["others"]);
        for key in ["time_s", "energy_j", "events_j"] {
            let sum: f64 = parts.iter().filter_map(|part| part[key].as_f64()).sum();
            let whole = pass[key].as_f64().expect("a number");
            assert!((sum / whole - 1.0).abs() < 1e-9, "{level}: {key} {sum} of {whole}");
        }
        for (event, count) in pass["counts"].as_object().expect("counts") {
            let sum: u64 = parts.iter().filter_map(|part| part["counts"][event].as_u64()).sum();
            assert_eq!(count.as_u64(), Some(sum), "{level}: {event}");
        }
        let busy = |part: &Value| {
            let share = part["stalls"]["sample_test"]["busy"].as_f64();
            share.map_or(0.0, |share| share * part["time_s"].as_f64().unwrap_or(0.0))
        };
        let (sum, whole) = (parts.iter().map(|part| busy(part)).sum::<f64>(), busy(pass));
        assert_eq!(whole > 0.0, level == "stepped");
        assert!((sum - whole).abs() <= 1e-3 * whole, "{level}: busy for {sum} s of {whole} s");
    }
}

#[test]
fn the_work_of_passes_adds_up_to_that_of_the_run() {
    let small = ["--size", "64x36", "--frames", "0..1"];
    for (work, passes) in [
        ("tiny", &["scene", "write back"][..]),
        ("occlusion", &["occluders", "farthest depths", "queries", "image", "write back"]),
        ("compute", &["depth pre-pass", "light culling", "image", "display", "write back"]),
        ("deferred", &["g-buffer", "lighting", "resolve", "write back"]),
        ("caustics", &["refraction", "beams", "light", "tone", "write back"]),
        ("glossy", &["map", "image", "write back"]),
        ("soft-shadows", &["depths", "triangles", "look-ups", "write back"]),
    ] {
        let summary = run(work, &small).summary();
        let rows = summary["passes"].as_array().expect("passes");
        let names: Vec<_> = rows.iter().map(|row| row["name"].as_str().expect("a name")).collect();
        assert_eq!(names, passes, "{work}");
        for (event, count) in summary["counts"].as_object().expect("counts") {
            let sum: u64 = rows.iter().filter_map(|row| row["counts"][event].as_u64()).sum();
            assert_eq!(count.as_u64(), Some(sum), "{work}: {event}");
        }
        let sum = |rows: &[Value], key: &str| rows.iter().filter_map(|row| row[key].as_f64()).sum::<f64>();
        let frames = summary["frames"].as_array().expect("frames");
        let (events_j, energy_j) = (sum(rows, "events_j"), sum(rows, "energy_j"));
        assert!(events_j > 0.0 && events_j < energy_j, "{work}: {events_j} of {energy_j} J");
        let parts = summary["energy_by_part_j"].as_object().expect("parts");
        let busy_j: f64 =
            parts.iter().filter(|(part, _)| *part != "idle").filter_map(|(_, joules)| joules.as_f64()).sum();
        for (of_passes, of_run) in [(sum(rows, "time_s"), sum(frames, "busy_s")), (energy_j, busy_j)] {
            assert!((of_passes / of_run - 1.0).abs() < 1e-6, "{work}: {of_passes} against {of_run}");
        }
    }
}
