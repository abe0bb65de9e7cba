//! Every warning code that a run can produce, in `summary.json`, on the terminal and in the report. The list
//! of all codes is checked for completeness.

use std::collections::BTreeSet;
use std::fs;

use crate::support::{Glb, Inputs, Results, number, quintile, root};
use serde_json::json;
use warnings::Code;

/// Reason for a warning of a workload without a test here.
const TESTED: &str = "tests of the workload bring it about, each in a run of its own";

/// Reason for a warning of `quintile trace` without a test here.
const COMMAND: &str = "a run does not give it";

/// A code without a test here.
struct NotProvoked {
    code: &'static str,
    /// File of the test that provokes it, from the root of the repository.
    test: &'static str,
    reason: &'static str,
}

/// Codes without a test here.
const NOT_PROVOKED: [NotProvoked; 31] = [
    NotProvoked {
        code: "clipped-samples",
        test: "sim/run/src/warn/mod.rs",
        reason: "it takes a rail below half a volt, whose voltage falls under load",
    },
    NotProvoked { code: "ambiguous-alignment", test: "tests/e2e/trace_guards.rs", reason: COMMAND },
    NotProvoked { code: "anchors-off", test: "tests/e2e/trace_refusals.rs", reason: COMMAND },
    NotProvoked { code: "clipped", test: "tests/e2e/trace_guards.rs", reason: COMMAND },
    NotProvoked { code: "energy-changed", test: "tests/e2e/trace_guards.rs", reason: COMMAND },
    NotProvoked { code: "idle-busy", test: "tests/e2e/trace_guards.rs", reason: COMMAND },
    NotProvoked { code: "negative-power", test: "tests/e2e/trace_guards.rs", reason: COMMAND },
    NotProvoked { code: "inverse-units", test: "tests/e2e/trace_guards.rs", reason: COMMAND },
    NotProvoked { code: "pass-beyond", test: "tests/e2e/trace_guards.rs", reason: COMMAND },
    NotProvoked { code: "power-differs", test: "tests/e2e/trace_guards.rs", reason: COMMAND },
    NotProvoked { code: "rail-counted-twice", test: "tests/e2e/trace_refusals.rs", reason: COMMAND },
    NotProvoked { code: "range-unused", test: "tests/e2e/trace_guards.rs", reason: COMMAND },
    NotProvoked { code: "uneven-runs", test: "tests/e2e/trace_guards.rs", reason: COMMAND },
    NotProvoked {
        code: "collision-near-everywhere",
        test: "workloads/src/collision/job.rs",
        reason: "it takes surfaces that slide along each other",
    },
    NotProvoked {
        code: "flat-mark",
        test: "traces/src/frames/marks.rs",
        reason: "a run marks starts of its frames, where power rises",
    },
    NotProvoked { code: "atomic-contention", test: "workloads/tests/suite/compute.rs", reason: TESTED },
    NotProvoked { code: "bank-conflicts", test: "workloads/tests/suite/compute.rs", reason: TESTED },
    NotProvoked { code: "deferred-moving-camera", test: "workloads/tests/suite/deferred.rs", reason: TESTED },
    NotProvoked { code: "deferred-one-surface", test: "workloads/tests/suite/deferred.rs", reason: TESTED },
    NotProvoked { code: "lens-wider-than-receiver", test: "workloads/tests/suite/glossy.rs", reason: TESTED },
    NotProvoked { code: "light-lists-full", test: "workloads/tests/suite/compute.rs", reason: TESTED },
    NotProvoked {
        code: "materials-simplified",
        test: "workloads/tests/suite/soft_shadows.rs",
        reason: TESTED,
    },
    NotProvoked { code: "shading-cache-small", test: "workloads/tests/suite/multiview.rs", reason: TESTED },
    NotProvoked { code: "shadow-banding", test: "workloads/tests/suite/soft_shadows.rs", reason: TESTED },
    NotProvoked { code: "shadow-bias", test: "workloads/tests/suite/soft_shadows.rs", reason: TESTED },
    NotProvoked {
        code: "view-dependent-shading",
        test: "workloads/tests/suite/multiview.rs",
        reason: TESTED,
    },
    NotProvoked {
        code: "wide-prediction-interval",
        test: "sim/run/src/warn/mod.rs",
        reason: "it takes an animation whose previews mislead by more than a few percent",
    },
    NotProvoked {
        code: "stated-error-exceeded",
        test: "sim/run/src/warn/mod.rs",
        reason: "built-in scenes are within their stated errors",
    },
    NotProvoked {
        code: "start-error",
        test: "sim/run/src/warn/mod.rs",
        reason: "it takes a start that counts as found and is off by more than half of its frame",
    },
    NotProvoked {
        code: "low-confidence",
        test: "traces/src/frames/assess.rs",
        reason: "it takes a trace in which frames go astray",
    },
    NotProvoked {
        code: "uncovered",
        test: "traces/src/frames/assess.rs",
        reason: "it takes a trace whose frames change until they are not followed",
    },
];

/// Codes that the tests below produce, and `orthographic-view`, which `visibility_inputs` tests.
const PROVOKED: [&str; 60] = [
    "accuracy-missed",
    "alpha-ignored",
    "behind-camera",
    "blur-beyond-image",
    "budget-missed",
    "camera-ignored",
    "camera-inside",
    "caustics-coarse",
    "caustics-crossed",
    "caustics-from-host",
    "coordinates-coarse",
    "coordinates-far-from-origin",
    "coordinates-out-of-range",
    "coordinates-recentred",
    "costly-preview",
    "degenerate-triangle",
    "displacement-ignored",
    "emissive-ignored",
    "empty-frame",
    "extension-ignored",
    "face-colors-ignored",
    "fast-motion",
    "few-samples",
    "focus-of-fitted-camera",
    "frames-missed",
    "heat-outside-image",
    "idle-above-busy",
    "irregular-spacing",
    "leaves-fitted-view",
    "lens-leaves-view",
    "light-ignored",
    "metallic-ignored",
    "mip-chain-odd",
    "missed-vsync",
    "missing-image",
    "missing-material",
    "missing-texcoord",
    "near-plane-cuts",
    "normal-map-ignored",
    "occlusion-map-ignored",
    "occlusion-small-occluders",
    "only-mark",
    "orthographic-view",
    "packets-lost",
    "platform-mismatch",
    "points-from-host",
    "points-rejected",
    "points-thin-regions",
    "primitive-dropped",
    "reflection-ignored",
    "samples-without-blur",
    "short-frame",
    "sliver-triangles",
    "sub-sample-triangles",
    "texture-filter-ignored",
    "texture-ignored",
    "timing-inaccurate",
    "weak-separation",
    "window-cut",
    "window-longer-than-frame",
];

/// Asserts that the run warns with `code` in all three places, in the same words.
fn assert_warns(results: &Results, code: &str) {
    assert!(PROVOKED.contains(&code), "{code} is missing in the list");
    let summary = results.summary();
    let mut warnings = summary["warnings"].as_array().into_iter().flatten();
    let warning = warnings.find(|warning| warning["code"] == code);
    let warning = warning.unwrap_or_else(|| panic!("no {code} in {:?}", results.warning_codes()));
    let message = warning["message"].as_str().unwrap_or_default();
    assert!(message.len() > 20, "{code} says too little: {message}");
    let line = format!("warning: [{code}] {message}");
    assert!(
        results.ended.stderr.lines().any(|printed| printed.starts_with(&line)),
        "{}",
        results.ended.stderr
    );
    let report = results.text("report.html");
    assert!(report.contains(code), "{code} is not in the report");
    let word = message.split_whitespace().max_by_key(|word| word.len()).unwrap_or_default();
    assert!(report.contains(escaped(word).as_str()), "`{word}` of {code} is not in the report");
}

/// Text as escaped in the report.
fn escaped(text: &str) -> String {
    let pairs =
        [('&', "&amp;"), ('<', "&lt;"), ('>', "&gt;"), ('"', "&quot;"), ('\'', "&#x27;"), ('/', "&#x2f;")];
    let escape = |letter: char| {
        pairs
            .iter()
            .find(|(raw, _)| *raw == letter)
            .map_or(letter.to_string(), |(_, text)| (*text).to_owned())
    };
    text.chars().map(escape).collect()
}

fn run_file(name: &str, bytes: impl AsRef<[u8]>, args: &[&str]) -> Results {
    let inputs = Inputs::new();
    let small = ["--size", "48x32", "--frames", "0..2", "--samples", "2"];
    quintile().run(&inputs.put(name, bytes), &[&small, args].concat())
}

const SPHERE: &str = "(shape: Sphere(radius: 1, segments: 12))";

#[test]
fn frames_too_short_for_the_recorder() {
    let results = quintile().run("tiny", &["--trace-rate", "50000"]);
    assert_warns(&results, "short-frame");
    // One message is enough, and no value is reported as measured.
    assert_eq!(results.warning_codes(), ["short-frame"]);
    let summary = results.summary();
    assert!(summary["measured"].is_null() && summary["truth"].is_object());
    let rows = summary["frames"].as_array().into_iter().flatten();
    assert!(rows.into_iter().all(|row| row.get("measured_energy_j") == Some(&json!(null))));
    let printed = &results.ended.stdout;
    let row = printed.lines().find(|line| line.starts_with("time per frame")).unwrap_or_default();
    assert_eq!(row.split_whitespace().nth(3), Some("-"), "{printed}");
    assert!(printed.contains("no frame but the marked one was found"), "{printed}");
    assert!(summary["warnings"].to_string().contains("--trace-rate 200000"), "{}", summary["warnings"]);
}

/// Without a rate of the recorder, the frames decide: those of `tiny` are measured as they are.
#[test]
fn the_recorder_follows_short_frames() {
    let results = quintile().run("tiny", &[]);
    let summary = results.summary();
    assert_eq!(number(&summary, "/recorder/rate_hz"), 200e3);
    assert_eq!(number(&summary, "/settings/trace_rate_hz"), 200e3);
    assert!(
        results.ended.stdout.contains("recorder: 200 kHz, raised from 50.0 kHz"),
        "{}",
        results.ended.stdout
    );
    for pointer in ["duration_s", "energy_j", "power_w"] {
        let [measured, truth] =
            ["measured", "truth"].map(|of| number(&summary, &format!("/{of}/{pointer}/mean")));
        assert!((measured / truth - 1.0).abs() < 0.001, "{pointer}: {measured} for {truth}");
    }
    let larger = quintile().run("tiny", &["--size", "320x180"]).summary();
    assert_eq!((number(&larger, "/recorder/rate_hz"), &larger["recorder"]["raised"]), (50e3, &json!(false)));
}

/// The book's page on warnings lists commands with their warnings; each is checked.
#[test]
fn warnings_of_the_page_are_as_listed() {
    let page = fs::read_to_string(root().join("docs/warnings.md")).expect("the book's chapter on warnings");
    let section = page.split("## In a fresh checkout").nth(1).unwrap_or_default();
    let promises: Vec<(&str, &str)> = section.lines().filter_map(promise).collect();
    assert!(promises.len() >= 5, "{section}");
    for (command, promised) in promises {
        let args: Vec<&str> = command.split_whitespace().skip(2).collect();
        // The whole default run takes too long for a test; part of it is used.
        let (scene, args) = match args.split_first() {
            Some((scene, args)) => (*scene, args.to_vec()),
            None => ("default", vec!["--frames", "17..19"]),
        };
        let codes = quintile().run(scene, &args).warning_codes();
        assert_eq!(codes.join(" "), promised, "{command}");
    }
}

/// Command of a line and its warning code; `None` without a warning.
fn promise(line: &str) -> Option<(&str, &str)> {
    let (command, rest) = line.strip_prefix("- `")?.split_once("` warns of ")?;
    let code = if rest.starts_with("nothing") { "" } else { rest.strip_prefix('`')?.split('`').next()? };
    Some((command, code))
}

#[test]
fn a_heat_map_of_work_outside_the_image() {
    let run = |workload, args: &[&str]| {
        quintile().run(workload, &[args, &["--frames", "0..1", "--heat", "samples_tested"]].concat())
    };
    let results = run("soft-shadows", &["--size", "32x18", "--set", "map_px=128"]);
    assert_warns(&results, "heat-outside-image");
    let results = run("ccd", &["--set", "resolution=8"]);
    assert!(
        !results.warning_codes().contains(&"heat-outside-image".to_owned()),
        "a quantity that is 0 has no part outside the image"
    );
    assert!(
        !results.warning_codes().contains(&"empty-frame".to_owned()),
        "conservative passes are no empty frames"
    );
}

#[test]
fn a_gpu_on_a_platform_of_another() {
    let warned = |args: &[&str]| quintile().run("tiny", args);
    assert_warns(&warned(&["--gpu", "discrete"]), "platform-mismatch");
    assert_warns(&warned(&["--gpu", "mobile", "--platform", "hd_4000"]), "platform-mismatch");
    let large = ["--set", "gpu.pipeline.memory.l2.entries=1048576"];
    assert_warns(&warned(&large), "platform-mismatch");
    let same_class = ["--set", "gpu.pipeline.memory.l2.entries=8192"];
    assert!(!warned(&same_class).warning_codes().contains(&"platform-mismatch".to_owned()));
}

#[test]
fn a_platform_with_idle_power_above_busy_power() {
    let inputs = Inputs::new();
    let path = root().join("power-model/platforms/reference.ron");
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let idle = text.replace("idle_w: Assumed(0.95", "idle_w: Assumed(9.5");
    assert_ne!(text, idle, "the platform idles at other watts now");
    let results = quintile().run("tiny", &["--platform", &inputs.put("idle.ron", idle)]);
    assert_warns(&results, "idle-above-busy");
    assert_eq!(
        results.warning_codes().iter().filter(|code| *code == "platform-mismatch").count(),
        1,
        "a changed copy is another machine, although its name is still `reference`"
    );
}

#[test]
fn packets_that_the_recorder_lost_are_gaps_in_its_file() {
    let lossy = ["--packet-loss", "0.2", "--packet-samples", "64"];
    let results = quintile().run("tiny", &lossy);
    assert_warns(&results, "packets-lost");
    let trace = results.path("trace.parquet");
    let refused = traces::io::read(&trace, &traces::io::ReadOptions::default()).unwrap_err();
    assert!(matches!(refused, traces::io::ReadError::Uneven { .. }), "{refused}");
    let repairing = traces::io::ReadOptions { repair: true, ..Default::default() };
    assert!(!traces::io::read(&trace, &repairing).unwrap().repairs.is_empty());
    let ended = quintile().call(["run", "tiny", "--packet-loss", "1"]);
    assert!(ended.code == Some(2) && ended.stderr.contains("--packet-loss"), "{}", ended.stderr);
}

#[test]
fn an_accuracy_beyond_the_budget() {
    let args = ["--size", "96x54", "--frames", "0..2", "--accuracy", "0.0001%", "--budget", "0.001ms"];
    let results = quintile().run("default", &args);
    assert_warns(&results, "budget-missed");
    assert_warns(&results, "accuracy-missed");
}

#[test]
fn frames_that_are_not_found() {
    let results = quintile().run("tiny", &["--pacing", "free", "--frames", "0..20", "--trace-rate", "6000"]);
    assert_warns(&results, "frames-missed");
    assert_warns(&results, "few-samples");
}

/// A torus that is in view in some frames only, according to `keys`.
fn flashing(frames: u32, keys: &str) -> String {
    format!(
        "(settings: (width: 320, height: 180, samples: 16, frames: (0, {frames}), shutter: 0), \
         camera: (position: (0, 0, 5), target: (0, 0, 0)), \
         objects: [(shape: Sphere(radius: 0.02, segments: 8)), \
         (shape: Torus(ring: 1, tube: 0.5, segments: 256), interpolation: Step, repeat: true, keyframes: [{keys}])])"
    )
}

#[test]
fn a_marked_frame_without_similar_frames() {
    let once = "(time_s: 0, position: (0, 0, 99)), (time_s: 0.0666, position: (0, 0, 0)), \
                (time_s: 0.0832, position: (0, 0, 99)), (time_s: 9, position: (0, 0, 99))";
    let inputs = Inputs::new();
    let results = quintile().run(&inputs.put("once.ron", flashing(9, once)), &[]);
    assert_warns(&results, "only-mark");
    assert_warns(&results, "frames-missed");
}

#[test]
fn starts_of_frames_no_longer_than_a_sample() {
    let results = quintile().run("tiny", &["--pacing", "free", "--frames", "0..20", "--trace-rate", "4500"]);
    assert_warns(&results, "irregular-spacing");
}

/// Whether noise resembles a start depends on the frames' length: at least one of these lengths has to.
#[test]
fn starts_below_the_noise_floor() {
    let runs = [("0..1", "100"), ("0..3", "200"), ("0..12", "200"), ("0..3", "300"), ("0..20", "500")];
    let run = |(frames, rate)| quintile().run("tiny", &["--frames", frames, "--trace-rate", rate]);
    let found =
        runs.into_iter().map(run).find(|run| run.warning_codes().contains(&"weak-separation".to_owned()));
    assert_warns(&found.expect("no run of these warns of weak separation"), "weak-separation");
}

/// Frames that grow from almost nothing, free-running: the window is as long as the rate of the recorder allows, and
/// longer than most of them.
#[test]
fn a_window_longer_than_most_frames() {
    let zoom = "(settings: (width: 320, height: 180, samples: 16, frames: (0, 24)), \
                camera: (position: (0, 0, 25), target: (0, 0, 0), end_position: (0, 0, 2)), \
                objects: [(shape: Torus(ring: 1, tube: 0.5, segments: 128))])";
    let inputs = Inputs::new();
    let args = ["--pacing", "free", "--trace-rate", "2000"];
    let results = quintile().run(&inputs.put("zoom.ron", zoom), &args);
    assert_warns(&results, "window-longer-than-frame");
}

#[test]
fn frames_longer_than_the_display_waits() {
    let results = quintile().run("tiny", &["--rate", "100000"]);
    assert_warns(&results, "missed-vsync");
}

#[test]
fn a_triangle_without_area() {
    let flat = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nf 1 2 3\nf 1 2 4\n";
    assert_warns(&run_file("flat.obj", flat, &[]), "degenerate-triangle");
}

#[test]
fn an_empty_image() {
    let away = format!("(camera: (position: (0, 0, 5), target: (0, 0, 9)), objects: [{SPHERE}])");
    assert_warns(&run_file("away.ron", &away, &[]), "empty-frame");
    // Their passes over the whole screen fill the image.
    let inputs = Inputs::new();
    let scene = format!("scene={}", inputs.put("away.ron", &away));
    for (workload, more) in [("deferred", &[][..]), ("soft-shadows", &["--set", "map_px=32"])] {
        let args = ["--size", "32x18", "--frames", "0..1", "--samples", "2", "--set", &scene];
        assert_warns(&quintile().run(workload, &[&args[..], more].concat()), "empty-frame");
        let seen = quintile().run(workload, &[&args[..6], more].concat());
        assert!(!seen.warning_codes().iter().any(|code| code == "empty-frame"), "{workload}");
    }
}

#[test]
fn missing_images() {
    let object = "(shape: Plane(size: 2), material: (texture: Image(file: \"gone.png\")))";
    assert_warns(&run_file("a.ron", format!("(objects: [{object}])"), &[]), "missing-image");
    let mut glb = Glb::square();
    glb.texture_coordinates();
    glb.material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    glb.json["textures"] = json!([{"source": 0}]);
    glb.json["images"] = json!([{"uri": "gone.png"}]);
    assert_warns(&run_file("a.glb", glb.bytes(), &[]), "missing-image");
}

#[test]
fn unsupported_material_features() {
    let mut glb = Glb::square();
    let faint = glb.floats(&[1.0, 1.0, 1.0, 0.5].repeat(4), 4);
    glb.primitive()["attributes"]["COLOR_0"] = json!(faint);
    let see_through = json!({"baseColorFactor": [1, 1, 1, 0.5], "metallicFactor": 1});
    let map = json!({"index": 0});
    glb.material(json!({"alphaMode": "BLEND", "pbrMetallicRoughness": see_through, "normalTexture": map,
                        "occlusionTexture": map, "emissiveFactor": [1, 0, 0]}));
    glb.json["textures"] = json!([{"source": 0}]);
    glb.json["images"] = json!([{"uri": "not read"}]);
    glb.json["extensionsUsed"] = json!(["KHR_materials_sheen"]);
    let results = run_file("a.glb", glb.bytes(), &[]);
    let ignored = ["alpha", "metallic", "normal-map", "occlusion-map", "emissive", "extension"];
    ignored.iter().for_each(|what| assert_warns(&results, &format!("{what}-ignored")));
    let mut glb = Glb::square();
    glb.texture_coordinates();
    glb.material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    glb.json["textures"] = json!([{"source": 0, "sampler": 0}]);
    glb.json["samplers"] = json!([{"magFilter": 9728}]);
    glb.json["images"] = json!([{"uri": format!("data:image/png;base64,{PIXEL}")}]);
    assert_warns(&run_file("a.glb", glb.bytes(), &[]), "texture-filter-ignored");
    let mut glb = Glb::square();
    glb.material(json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    glb.json["textures"] = json!([{"source": 0}]);
    glb.json["images"] = json!([{"uri": format!("data:image/png;base64,{PIXEL}")}]);
    assert_warns(&run_file("a.glb", glb.bytes(), &[]), "missing-texcoord");
    let obj = "mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n";
    assert_warns(&run_file("a.obj", obj, &[]), "missing-material");
    let properties = "property float x\nproperty float y\nproperty float z\n";
    let face = "property list uchar int vertex_indices\nproperty uchar red\n";
    let ply = format!(
        "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 3\n{properties}element face 1\n{face}end_header\n\
         0 0 0\n1 0 0\n0 1 0\n3 0 1 2 9\n"
    );
    let results = run_file("a.ply", ply, &[]);
    assert_warns(&results, "face-colors-ignored");
    assert_warns(&results, "texture-ignored");
}

/// Materials of OBJ and glTF files that shine or lie elsewhere, and the same in words that change no picture.
#[test]
fn highlights_and_displacements_are_reported_where_they_change_the_picture() {
    let codes_of = |mtl: &str| {
        let inputs = Inputs::new();
        inputs.put("a.mtl", format!("newmtl m\nKd 0.5 0.5 0.5\n{mtl}\n"));
        let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";
        quintile().run(&inputs.put("a.obj", obj), &["--size", "48x32", "--frames", "0..1", "--samples", "2"])
    };
    let results = codes_of("Ks 1 1 1\nNs 500\nrefl a.png\ndisp b.png");
    assert_warns(&results, "reflection-ignored");
    assert_warns(&results, "displacement-ignored");
    let glossy = |roughness: f64| {
        let mut glb = Glb::square();
        glb.material(json!({"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": roughness}}));
        run_file("a.glb", glb.bytes(), &[])
    };
    assert_warns(&glossy(0.05), "reflection-ignored");
    for harmless in [codes_of("Ks 0 0 0\nNs 500\nillum 2"), glossy(1.0)] {
        let codes = harmless.warning_codes();
        assert!(!codes.iter().any(|code| code.ends_with("-ignored")), "{codes:?}");
    }
}

#[test]
fn coordinates_far_from_the_origin() {
    let far = "v 4000000 0 0\nv 4000001 0 0\nv 4000000 1 0\nf 1 2 3\n";
    assert_warns(&run_file("far.obj", far, &[]), "coordinates-recentred");
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]: [f32; 2]| [x + 4e6, y, 0.0]);
    let results = run_file("far.glb", Glb::with_positions(&corners).bytes(), &[]);
    assert_warns(&results, "coordinates-far-from-origin");
}

/// A PNG of one grey pixel.
const PIXEL: &str =
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGNoAAAAggCBd81ytgAAAABJRU5ErkJggg==";

#[test]
fn ignored_parts_of_a_gltf_scene() {
    let mut glb = Glb::square();
    let points = json!({"attributes": {"POSITION": 0}, "mode": 0});
    glb.json["meshes"][0]["primitives"] = json!([glb.json["meshes"][0]["primitives"][0], points]);
    assert_warns(&run_file("a.glb", glb.bytes(), &[]), "primitive-dropped");
    let lines = run_file("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nl 1 2\nl 2 3\n", &[]);
    assert_warns(&lines, "primitive-dropped");
    let mut glb = Glb::square();
    let lens = json!({"xmag": 1.0, "ymag": 0.0, "zfar": 10.0, "znear": 0.1});
    glb.json["cameras"] = json!([{"type": "orthographic", "orthographic": lens}]);
    glb.json["nodes"] = json!([{"mesh": 0, "children": [1]}, {"camera": 0, "translation": [0.5, 0.5, 3.0]}]);
    assert_warns(&run_file("a.glb", glb.bytes(), &[]), "camera-ignored");
    let mut glb = Glb::square();
    glb.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    glb.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}});
    let lamp = json!({"extensions": {"KHR_lights_punctual": {"light": 0}}});
    glb.json["nodes"] = json!([{"mesh": 0, "children": [1]}, lamp]);
    assert_warns(&run_file("a.glb", glb.bytes(), &[]), "light-ignored");
}

/// A box whose faces are seen from inside.
const ROOM: &str = "v 0 0 0\nv 9 0 0\nv 0 3 0\nv 9 3 0\nv 0 0 4\nv 9 0 4\nv 0 3 4\nv 9 3 4\n\
                    f 3 7 5 1\nf 6 8 4 2\nf 5 6 2 1\nf 4 8 7 3\nf 2 4 3 1\nf 7 8 6 5\n";

#[test]
fn a_camera_inside_a_room() {
    assert_warns(&run_file("a.obj", ROOM, &[]), "camera-inside");
    let outside = run_file("a.obj", ROOM, &["--camera", "outside"]);
    assert!(!outside.warning_codes().iter().any(|code| code == "camera-inside"));
}

#[test]
fn a_lens_for_an_automatically_placed_camera() {
    let focus = format!("(settings: (lens_radius: 0.1, focus: 3), objects: [{SPHERE}])");
    assert_warns(&run_file("a.ron", focus, &[]), "focus-of-fitted-camera");
    let wide = format!("(objects: [{SPHERE}])");
    assert_warns(&run_file("a.ron", wide, &["--lens", "1", "--focus", "1"]), "lens-leaves-view");
    let leaves = "(settings: (frames: (0, 1)), objects: [(shape: Sphere(radius: 1, segments: 12), velocity: (900, 0, 0))])";
    assert_warns(&run_file("a.ron", leaves, &[]), "leaves-fitted-view");
}

/// A code, a scene with flags that gives the warning, and one that does not.
type Regime<'a> = (&'a str, String, &'a [&'a str], String, &'a [&'a str]);

/// Scenes in the regimes of the failure catalogue, each with a similar scene that gives no warning.
#[test]
fn regimes_in_which_tile_tests_are_ineffective() {
    let camera = "camera: (position: (0, 0, 5), target: (0, 0, 0))";
    let scene = |camera: &str, object: &str| format!("({camera}, objects: [{object}])");
    let floor = |y: &str| format!("(shape: Plane(size: 100), position: (0, {y}, 0))");
    let moving = |speed: &str| format!("(shape: Sphere(radius: 1, segments: 12), velocity: ({speed}, 0, 0))");
    let sphere = |segments: &str| format!("(shape: Sphere(radius: 1, segments: {segments}))");
    let thin = |height: &str| format!("(shape: Box(size: (2, {height}, 2)))");
    let boxed = |scale: &str| {
        let camera = format!("camera: (position: (0, 0, 5{scale}), target: (0, 0, 0))");
        scene(&camera, &format!("(shape: Box(size: (1{scale}, 1{scale}, 1{scale})))"))
    };
    let sphere = |segments: &str| scene(camera, &sphere(segments));
    let (sharp, soft) = (["--lens", "0.1", "--focus", "1"], ["--lens", "100", "--focus", "1"]);
    let two = |place: &str, near: &str| {
        let camera = format!("camera: (position: ({place}, 1, 5), target: ({place}, 0, 0), near: {near})");
        let spheres = ["0", "4e6"].map(|x| format!("(shape: Sphere(radius: 1), position: ({x}, 0, 0))"));
        scene(&camera, &spheres.join(", "))
    };
    let cases: [Regime<'_>; 8] = [
        ("behind-camera", scene(camera, &floor("-1")), &[], sphere("12"), &[]),
        ("sub-sample-triangles", sphere("1000"), &[], sphere("12"), &[]),
        ("sliver-triangles", scene(camera, &thin("0.001")), &[], scene(camera, &thin("1")), &[]),
        ("fast-motion", scene(camera, &moving("2000")), &[], scene(camera, &moving("1")), &[]),
        ("blur-beyond-image", sphere("12"), &soft, sphere("12"), &sharp),
        ("coordinates-out-of-range", boxed("e13"), &[], boxed("e3"), &[]),
        ("coordinates-coarse", two("4e6", "0.1"), &[], two("0", "0.1"), &[]),
        ("near-plane-cuts", two("0", "4.5"), &[], two("0", "0.1"), &[]),
    ];
    let small = ["--size", "160x90", "--frames", "0..2", "--samples", "2"];
    let run = |scene: &str, args: &[&str]| {
        let inputs = Inputs::new();
        quintile().run(&inputs.put("a.ron", scene), &[&small, args].concat())
    };
    for (code, hopeless, args, harmless, quiet) in cases {
        let results = run(&hopeless, args);
        assert_warns(&results, code);
        // Whatever their number.
        let messages = results.summary()["warnings"].to_string();
        assert!(!messages.contains(" triangles in view"), "{messages}");
        let codes = run(&harmless, quiet).warning_codes();
        assert!(!codes.contains(&code.to_owned()), "{code} without need: {codes:?}");
    }
}

/// A frame on a GPU with two places in the queues of memory.
#[test]
fn a_level_that_its_check_finds_far_off() {
    let run = |level, queue| {
        let queue = format!("gpu.units.dram.queue={queue}");
        let args =
            ["--gpu", "discrete", "--size", "160x90", "--frames", "0..1", "--timing", level, "--set", &queue];
        quintile().run("default", &args)
    };
    let code = "timing-inaccurate";
    assert_warns(&run("packet", 2), code);
    for quiet in [run("stepped", 2), run("packet", 64)] {
        assert!(!quiet.warning_codes().contains(&code.to_owned()), "{:?}", quiet.warning_codes());
    }
}

/// Light passes of caustics are as long for a small image; a scene has small previews.
#[test]
fn previews_that_are_as_long_as_frames() {
    let size = ["--timing", "sampled", "--frames", "0..7"];
    let caustics = quintile().run("caustics", &[&size[..], &["--size", "64x36"]].concat());
    assert_warns(&caustics, "costly-preview");
    let scene = quintile().run("default", &[&size[..], &["--size", "640x360", "--samples", "8"]].concat());
    let share = number(&scene.summary(), "/sampled/preview_share");
    assert!(!scene.warning_codes().contains(&"costly-preview".to_owned()), "a share of {share}");
}

/// The reference platform with less time recorded before the first frame and after the last.
fn without_margins(inputs: &Inputs) -> String {
    let path = root().join("power-model/platforms/reference.ron");
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let short = text
        .replace("lead_in_s: Assumed(0.25", "lead_in_s: Assumed(0")
        .replace("tail_s: Assumed(0.25", "tail_s: Assumed(0");
    assert_ne!(text, short, "the platform has other margins now");
    inputs.put("short.ron", short)
}

#[test]
fn points_that_passes_do_not_make_and_rejected_candidates() {
    let frame = ["--frames", "0..1", "--size", "64x64"];
    let run = |set: &[&str]| quintile().run("sampling", &[&frame[..], set].concat());
    assert_warns(&run(&["--set", "rounds=1", "--set", "radius=0.1"]), "points-from-host");
    let loose = ["--set", "points=noise", "--set", "dimensions=4", "--set", "count=100"];
    assert_warns(&run(&loose), "points-rejected");
}

#[test]
fn samples_of_one_time_and_odd_mip_chains() {
    let frame = ["--frames", "18..19", "--size", "80x45"];
    let sharp = ["--table", "msaa", "--samples", "4", "--lens", "0"];
    assert_warns(&quintile().run("default", &[&frame[..], &sharp].concat()), "samples-without-blur");
    let blurred = quintile().run("deferred", &[&frame[..], &["--samples", "4", "--shutter", "0.5"]].concat());
    assert!(
        !blurred.warning_codes().contains(&"samples-without-blur".to_owned()),
        "samples spread over the open shutter"
    );
    assert_warns(
        &quintile().run("compute", &[&frame[..], &["--set", "kernel=mip_chain"]].concat()),
        "mip-chain-odd",
    );
}

#[test]
fn a_mark_at_the_edge_of_the_recording() {
    let inputs = Inputs::new();
    let platform = without_margins(&inputs);
    let args = ["--size", "160x90", "--frames", "0..1", "--platform", &platform];
    assert_warns(&quintile().run("default", &args), "window-cut");
}

/// Every code is in one of the two lists here, and in the chapter of the book that it names.
#[test]
fn every_code_is_accounted_for() {
    let listed = PROVOKED.into_iter().chain(NOT_PROVOKED.map(|of| of.code));
    let listed: BTreeSet<&str> = listed.collect();
    assert_eq!(listed, Code::ALL.iter().map(|code| code.name()).collect());
    let chapter =
        fs::read_to_string(root().join("docs/warnings.md")).expect("the book's chapter on warnings");
    for code in Code::ALL {
        let heading = format!("## {}\n", code.section().heading());
        let section = chapter.split(&heading).nth(1).unwrap_or_else(|| panic!("no {heading}"));
        let section = section.split("\n## ").next().unwrap_or_default();
        assert!(section.contains(&format!("`{code}`")), "the book does not explain `{code}` under {heading}");
    }
}

/// Name of the variant of a code: `UnevenRuns` of `uneven-runs`.
fn variant(code: &str) -> String {
    let capital = |word: &str| word[..1].to_uppercase() + &word[1..];
    code.split('-').map(capital).collect()
}

#[test]
fn codes_that_are_not_provoked_here_are_named_by_the_test_that_provokes_them() {
    for NotProvoked { code, test, reason } in NOT_PROVOKED {
        assert!(!reason.is_empty(), "{code}");
        let text = fs::read_to_string(root().join(test)).unwrap_or_else(|error| panic!("{test}: {error}"));
        // Unit tests come last in a file.
        let tests = if test.contains("/src/") { text.split("mod tests {").nth(1) } else { Some(&text[..]) };
        let tests = tests.unwrap_or_else(|| panic!("{test} has no tests"));
        let names = [format!("\"{code}\""), format!("[{code}]"), format!("Code::{}", variant(code))];
        assert!(names.iter().any(|name| tests.contains(name)), "{test} does not name {code}");
    }
}

#[test]
fn light_volumes_with_crossing_sides() {
    let set = ["cells=24", "slope=0.3", "depth_m=10", "pleat=0.6"].map(|option| ["--set", option]);
    let args = [&["--size", "64x36"][..], set.as_flattened()].concat();
    let results = quintile().run("caustics", &args);
    assert_warns(&results, "caustics-crossed");
    assert_warns(&results, "caustics-coarse");
    let args = ["--size", "16x9", "--frames", "0..1", "--set", "cells=8", "--gpu"];
    let mobile = quintile().run("caustics", &[&args[..], &["mobile"]].concat());
    assert_warns(&mobile, "caustics-from-host");
    let reference = quintile().run("caustics", &[&args[..], &["reference"]].concat());
    assert!(!reference.warning_codes().iter().any(|code| code == "caustics-from-host"));
}

/// No run samples points in single precision: the warning is that of `quintile sample`.
#[test]
fn points_limited_by_precision() {
    let warnings = |single: &[&str]| {
        let args = [&["sample", "poisson", "--dim", "1", "--r", "1e-5", "--json"], single].concat();
        let ended = quintile().call(&args);
        let printed: serde_json::Value = serde_json::from_str(&ended.stdout).expect(&ended.stderr);
        printed["warnings"].clone()
    };
    assert_eq!(warnings(&["--single"])[0]["code"], "points-thin-regions");
    assert_eq!(warnings(&[]), json!([]));
}

#[test]
fn occluders_smaller_than_tiles() {
    let args = ["--size", "96x54", "--set", "slats=24", "--set", "gaps=0.02", "--set", "walls=40"];
    assert_warns(&quintile().run("occlusion", &args), "occlusion-small-occluders");
    let nothing_asked = [&args[..], &["--set", "objects=0"]].concat();
    let codes = quintile().run("occlusion", &nothing_asked).warning_codes();
    assert!(!codes.contains(&"occlusion-small-occluders".to_owned()), "{codes:?}");
}
