//! A camera that moves past a still scene: every frame is drawn, at every level of timing and in every
//! workload that takes a scene; and a frame is the same whether it is run alone or among others.

use std::collections::BTreeSet;

use crate::support::{Glb, Inputs, Results, number, quintile};
use serde_json::{Value, json};

const OBJECTS: &str = "objects: [(shape: Sphere(radius: 1, segments: 12)), (shape: Plane(size: 8), position: (0, -1, 0)), \
                       (shape: Box(size: (0.5, 1, 0.5)), position: (1.5, 0, 1))]";
const STILL: &str = "position: (-4, 1, 5), target: (0, 0, 0)";
const PATH: &str = "position: (-4, 1, 5), target: (0, 0, 0), end_position: (4, 1, 5)";
const KEYS: &str = "position: (-4, 1, 5), target: (0, 0, 0), \
                    keyframes: [(time_s: 0, position: (-4, 1, 5)), (time_s: 0.3, position: (0, 2, 6)), (time_s: 0.6, position: (4, 1, 5))]";

/// A scene in which only the camera may move.
fn scene(inputs: &Inputs, name: &str, camera: &str, settings: &str) -> String {
    let text = format!(
        "(settings: (width: 64, height: 36, samples: 2, frames: (0, 36){settings}), camera: ({camera}), {OBJECTS})"
    );
    inputs.put(name, text)
}

/// A glTF square seen from a node that moves for 0.6 s.
fn camera_node() -> Glb {
    let mut glb = Glb::square();
    let times = glb.floats(&[0.0, 0.6], 1);
    let places = glb.floats(&[0.2, 0.5, 3.0, 0.8, 0.6, 2.0], 3);
    glb.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}]);
    glb.json["nodes"] = json!([{"mesh": 0}, {"camera": 0, "translation": [0.2, 0.5, 3.0]}]);
    glb.json["scenes"][0]["nodes"] = json!([0, 1]);
    glb.json["animations"] = json!([{
        "samplers": [{"input": times, "output": places}],
        "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}],
    }]);
    glb
}

fn image(results: &Results, frame: u32) -> Vec<u8> {
    results.bytes(&format!("images/frame_{frame:04}.png"))
}

/// How many of the images of frames 0 to `count` differ.
fn pictures(results: &Results, count: u32) -> usize {
    (0..count).map(|frame| image(results, frame)).collect::<BTreeSet<_>>().len()
}

fn distinct(results: &Results) -> f64 {
    number(&results.summary(), "/modelled/distinct_frames")
}

fn limits(results: &Results) -> String {
    results.summary()["modelled"]["limits"].to_string()
}

#[test]
fn frames_of_a_camera_path_have_distinct_images() {
    let inputs = Inputs::new();
    let glb = inputs.put("node.glb", camera_node().bytes());
    let small = ["--size", "64x36", "--samples", "2"];
    for (name, args) in [
        (scene(&inputs, "path.ron", PATH, ""), &[][..]),
        (scene(&inputs, "keys.ron", KEYS, ""), &["--timing", "bound"]),
        (scene(&inputs, "instant.ron", PATH, ", shutter: 0"), &["--timing", "stepped"]),
        (glb, &small),
    ] {
        let results = quintile().run(&name, args);
        assert_eq!((pictures(&results, 36), distinct(&results)), (36, 36.0), "{name} {args:?}");
        assert!(!limits(&results).contains("repeated"), "{}", limits(&results));
        let dimensions = if args.contains(&"stepped") { "2D (screen" } else { "3D (screen, time" };
        assert!(
            results.ended.stdout.contains(&format!("modelled: {dimensions}")),
            "{}",
            results.ended.stdout
        );
    }
}

#[test]
fn choice_and_verification_cover_every_frame_of_a_path() {
    let inputs = Inputs::new();
    let path = scene(&inputs, "path.ron", PATH, "");
    let chosen = quintile().run(&path, &["--accuracy", "50%", "--frames", "0..12", "--verify"]);
    assert_eq!((pictures(&chosen, 12), distinct(&chosen)), (12, 12.0));
    assert!(number(&chosen.summary(), "/verified/error") < 0.5);
    assert_eq!(chosen.summary()["choice"]["probe"]["frames"], json!([2, 6, 10]));
    let sampled = quintile().run(&path, &["--timing", "sampled"]);
    assert_eq!((distinct(&sampled), number(&sampled.summary(), "/modelled/predicted_frames")), (6.0, 30.0));
    let cycles = sampled.summary()["frames"]
        .as_array()
        .into_iter()
        .flatten()
        .map(|row| number(row, "/cycles") as u64)
        .collect::<BTreeSet<_>>();
    assert!(cycles.len() > 6, "predicted frames differ, too: {cycles:?}");
}

#[test]
fn a_still_camera_over_a_still_scene_is_simulated_once() {
    let inputs = Inputs::new();
    let still = scene(&inputs, "path.ron", STILL, "");
    for args in [&[][..], &["--timing", "sampled"], &["--accuracy", "20%"]] {
        let results = quintile().run(&still, args);
        assert_eq!((pictures(&results, 36), distinct(&results)), (1, 1.0), "{args:?}");
        assert!(limits(&results).contains("one frame was simulated and repeated"), "{}", limits(&results));
        assert!(
            results.ended.stdout.contains("2D (screen; pinhole and nothing moves)"),
            "{}",
            results.ended.stdout
        );
    }
}

/// A clip that starts over exactly with a frame: its frames are simulated once, at each level.
#[test]
fn repeated_frames_are_simulated_once() {
    let inputs = Inputs::new();
    let mut glb = camera_node();
    let times = glb.floats(&[0.0, 0.5], 1);
    glb.json["animations"][0]["samplers"][0]["input"] = json!(times);
    let file = inputs.put("loop.glb", glb.bytes());
    let args = ["--size", "64x36", "--samples", "2", "--rate", "8", "--frames", "0..32"];
    for level in ["packet", "sampled"] {
        let results = quintile().run(&file, &[&args[..], &["--timing", level]].concat());
        assert_eq!((pictures(&results, 32), distinct(&results)), (4, 4.0), "{level}");
        assert!(limits(&results).contains("some frames equal an earlier one"), "{}", limits(&results));
        let rows = results.summary()["frames"].as_array().cloned().unwrap_or_default();
        let hash = |frame: usize| rows[frame]["counts_hash"].clone();
        assert_eq!((rows.len(), hash(1), hash(31)), (32, hash(29), hash(27)));
        assert!(image(&results, 3) == image(&results, 31) && image(&results, 3) != image(&results, 30));
    }
}

fn row(results: &Results, frame: u32) -> Value {
    let summary = results.summary();
    let mut rows = summary["frames"].as_array().into_iter().flatten();
    rows.find(|row| row["frame"] == frame).cloned().unwrap_or_default()
}

/// Light, focus and a fitted camera are placed for the whole scene, not for the selected frames.
#[test]
fn a_single_frame_equals_that_of_the_whole_path() {
    let inputs = Inputs::new();
    let glb = inputs.put("node.glb", camera_node().bytes());
    let fitted = format!(
        "(settings: (width: 64, height: 36, samples: 2, frames: (0, 8)), {})",
        OBJECTS.replacen("segments: 12)", "segments: 12), velocity: (5, 0, 0)", 1)
    );
    let fitted = inputs.put("fitted.ron", fitted);
    let lens = inputs.put("lens.ron", format!("(settings: (width: 64, height: 36, samples: 2, frames: (0, 36), lens_radius: 0.1), camera: ({KEYS}), {OBJECTS})"));
    for name in [lens.as_str(), &glb, &fitted, "tiny"] {
        let small = ["--size", "64x36", "--samples", "2"];
        let of_all = quintile().run(name, &small);
        let alone = quintile().run(name, &[&small[..], &["--frames", "3..4"]].concat());
        assert!(image(&of_all, 3) == image(&alone, 3), "{name}: another picture");
        for key in ["counts_hash", "cycles"] {
            assert_eq!(row(&of_all, 3)[key], row(&alone, 3)[key], "{name}: {key}");
        }
    }
}

#[test]
fn workloads_follow_the_camera_of_their_scene() {
    let inputs = Inputs::new();
    let workloads = [
        ("glossy", &["--set", "texels=16", "--set", "map_samples=2"][..]),
        ("soft-shadows", &["--set", "map_px=16"]),
        ("multiview", &["--set", "views=2", "--set", "check_cache=false"]),
    ];
    for (name, options) in workloads {
        for (camera, pictures_wanted, moves) in [(PATH, 4, true), (STILL, 1, false)] {
            let from = format!("scene={}", scene(&inputs, "path.ron", camera, ", lens_radius: 0.05"));
            let args = [&["--size", "48x28", "--samples", "2", "--frames", "0..4", "--set", &from], options]
                .concat();
            let results = quintile().run(name, &args);
            assert_eq!(
                (pictures(&results, 4), distinct(&results)),
                (pictures_wanted, pictures_wanted as f64),
                "{name} {camera}"
            );
            let modelled =
                if moves { "5D (screen, lens, time)" } else { "4D (screen, lens; nothing moves: no time)" };
            assert!(results.ended.stdout.contains(modelled), "{name}: {}", results.ended.stdout);
            assert_eq!(limits(&results).contains("one frame was simulated and repeated"), !moves, "{name}");
        }
    }
}

/// All frames of `occlusion` are equal; those of `caustics` and `sampling` all differ.
#[test]
fn workloads_without_a_scene_repeat_equal_frames() {
    for (name, args, differ) in [
        ("occlusion", &["--size", "48x28", "--set", "objects=4"][..], 1),
        ("caustics", &["--size", "48x28", "--set", "cells=8"], 3),
        ("sampling", &["--size", "32x32", "--set", "radius=0.1"], 3),
    ] {
        let results = quintile().run(name, &[args, &["--frames", "0..3"]].concat());
        assert_eq!((pictures(&results, 3), distinct(&results)), (differ, differ as f64), "{name}");
    }
}
