//! Images alone: `--timing none` draws the bytes of a run that is counted, and has neither counts nor time.

use serde_json::json;

use crate::support::{Glb, Inputs, Refusals, Schema, quintile};

/// Checks that a run of images alone draws the bytes of a run that is counted.
fn assert_same_images(scene: &str, args: &[&str]) {
    let args = [args, &["--exr"]].concat();
    let counted = quintile().run(scene, &args);
    let alone = quintile().run(scene, &[&args[..], &["--timing", "none"]].concat());
    let images = |files: Vec<std::path::PathBuf>| -> Vec<_> {
        files.into_iter().filter(|file| file.starts_with("images")).collect()
    };
    let (counted, alone) = (counted.files(), alone.files());
    let names = images(counted.keys().cloned().collect());
    assert!(names.len() > 1);
    assert_eq!(names, images(alone.keys().cloned().collect()));
    for name in names {
        assert!(counted[&name] == alone[&name], "{scene} {args:?}: {}", name.display());
    }
}

#[test]
fn images_alone_are_those_of_a_counted_run() {
    assert_same_images("tiny", &[]);
    let small = ["--size", "200x120", "--frames", "17..19"];
    assert_same_images("default", &small);
    // Everything moves far, and is far out of focus.
    assert_same_images(
        "default",
        &[&small[..], &["--lens", "2", "--shutter", "1", "--samples", "5"]].concat(),
    );
    assert_same_images("default", &[&small[..], &["--lens", "0", "--shutter", "0"]].concat());
    assert_same_images("tiny", &["--set", "gpu.pipeline.shading=PerSample", "--table", "interleaved"]);
}

/// Blended surfaces depend on the order of triangles and are drawn by the modelled hardware.
#[test]
fn images_of_gltf_scenes_are_those_of_a_counted_run() {
    let inputs = Inputs::new();
    let mut square = Glb::square();
    square.texture_coordinates();
    square.material(json!({"pbrMetallicRoughness": {"baseColorFactor": [0.9, 0.2, 0.1, 0.5]}}));
    let size = ["--size", "96x64", "--samples", "4", "--lens", "0.1"];
    assert_same_images(&inputs.put("square.glb", square.bytes()), &size);
    square.material(
        json!({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [0.9, 0.2, 0.1, 0.5]}}),
    );
    assert_same_images(&inputs.put("blended.glb", square.bytes()), &size);
}

#[test]
fn images_alone_have_no_counts_time_and_energy() {
    let results = quintile().run("tiny", &["--timing", "none"]);
    let summary = results.summary();
    assert_eq!(Schema::of_book("summary.schema.json").faults(&summary), [""; 0]);
    for absent in ["counts", "frames", "truth", "energy_by_part_j", "modelled", "stated_error", "hardware"] {
        assert!(summary.get(absent).is_none(), "{absent}");
    }
    assert!(summary["request"]["timing"].is_null());
    assert_eq!(summary["images"][3], json!({"frame": 3, "image": "images/frame_0003.png"}));
    let files = results.files();
    assert!(!files.keys().any(|file| file.starts_with("plots") || file.starts_with("trace.csv")));
    for text in [&results.text("report.html"), &results.ended.stdout] {
        assert!(text.contains("no cycles and no joules"), "{text}");
    }
}

#[test]
fn a_run_of_images_alone_is_repeated_to_the_same_bytes() {
    let first = quintile().run("tiny", &["--timing", "none", "--threads", "1"]);
    let summary = first.path("summary.json");
    let again = Inputs::new();
    let out = again.path("out");
    let ended = quintile().call(["run", "--again", &summary.display().to_string(), "--out", &out]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let frame = std::fs::read(again.path("out/images/frame_0002.png")).expect("an image");
    assert!(frame == first.bytes("images/frame_0002.png"));
    let dry = ["run", "--again", &summary.display().to_string(), "--dry-run", "--out", &again.path("dry")];
    let ended = quintile().call(dry);
    assert!(ended.code == Some(0) && !std::path::Path::new(&again.path("dry")).exists(), "{}", ended.stderr);
    for part in ["of which 4 differ", "GPU       reference\n", "timing    none: images alone"] {
        assert!(ended.stdout.contains(part) && !ended.stdout.contains("platform"), "{}", ended.stdout);
    }
}

#[test]
fn runs_of_images_alone_are_compared_by_their_images() {
    let alone = quintile().run("tiny", &["--timing", "none", "--frames", "0..1"]);
    let summary = alone.path("summary.json").display().to_string();
    let ended = quintile().call(["compare", &summary, &summary]);
    let images = alone.path("images").display().to_string();
    assert!(
        ended.code == Some(2) && ended.stderr.contains("no numbers to compare: compare its images, "),
        "{}",
        ended.stderr
    );
    assert!(ended.stderr.contains(&images), "{}", ended.stderr);
    assert_eq!(quintile().call(["compare", &images, &images]).code, Some(0));
}

#[test]
fn what_needs_counts_or_time_is_refused_with_images_alone() {
    let mut refusals = Refusals::default();
    let with = |more: &[&'static str]| [&["tiny", "--timing", "none"], more].concat();
    for (more, named) in [
        (&["--heat", "samples_tested"][..], "--heat"),
        (&["--verify"], "--verify"),
        (&["--bound", "low", "--pacing", "free"], "--bound, --pacing"),
        (&["--trace-rate", "1MHz"], "--trace-rate"),
        (&["--energy", "28nm"], "--energy"),
    ] {
        refusals.call(&with(more), 2, &["--timing none", named], "leave one of both out");
    }
    refusals.call(
        &with(&["--pacing", "vsync", "--set", "samples=2"]),
        2,
        &["--timing none", "--pacing"],
        "leave one of both out",
    );
    let changed = with(&["--set", "platform.v_v=0.85", "--set", "table.rows.draws.nominal_pj=700"]);
    let named = ["--set platform.v_v, --set table.rows.draws.nominal_pj"];
    refusals.call(&changed, 2, &named, "leave one of both out");
    refusals.call(&with(&["--accuracy", "2%"]), 2, &["--accuracy"], "cannot be used with");
    refusals.call(&["glossy", "--timing", "none"], 2, &["glossy", "workload"], "take another timing level");
    refusals.call(
        &["glossy", "--timing", "none", "--dry-run"],
        2,
        &["glossy", "workload"],
        "take another timing level",
    );
    refusals.done();
}
