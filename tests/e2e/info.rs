//! `quintile info`: description of a scene as text and as JSON.

use crate::support::{Glb, Inputs, Refusals, mts, quintile};
use serde_json::{Value, json};

fn info(args: &[&str]) -> (String, Value) {
    let text = quintile().call(["info"].iter().chain(args));
    assert_eq!(text.code, Some(0), "{}", text.stderr);
    let json = quintile().call(["info", "--json"].iter().chain(args));
    assert_eq!(json.code, Some(0), "{}", json.stderr);
    (text.stdout, serde_json::from_str(&json.stdout).expect("JSON"))
}

/// A square that turns in one clip and slides in another, with features that are not drawn.
fn animated() -> Glb {
    let mut glb = Glb::square();
    let times = glb.floats(&[0.0, 0.5, 1.25], 1);
    let turns = glb.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.6, 0.8, 0.0, 0.0, 0.0, 1.0], 4);
    let steps = glb.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 3);
    let clip = |name: &str, path: &str, output: usize| {
        json!({
            "name": name,
            "channels": [{"sampler": 0, "target": {"node": 0, "path": path}}],
            "samplers": [{"input": times, "output": output}],
        })
    };
    glb.json["animations"] = json!([clip("Turn", "rotation", turns), clip("Slide", "translation", steps)]);
    let half = json!({"baseColorFactor": [1, 1, 1, 0.5], "metallicFactor": 0});
    glb.material(
        json!({"name": "leaf", "alphaMode": "BLEND", "doubleSided": true, "pbrMetallicRoughness": half}),
    );
    glb
}

#[test]
fn a_scene_file_is_described_in_full() {
    let inputs = Inputs::new();
    let scene = inputs.put("a.glb", animated().bytes());
    let (text, found) = info(&[&scene, "--shutter", "0"]);
    assert_eq!((&found["triangles"], &found["vertices"]), (&json!(2), &json!(4)));
    assert_eq!(
        (&found["bounds"], &found["extent"]),
        (&json!([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]]), &json!([1.0, 1.0, 0.0]))
    );
    assert_eq!(found["clips"][0], json!({"name": "Turn", "duration_s": 1.25, "tracks": 1, "keys": 3}));
    assert_eq!(found["clips"][1]["name"], "Slide");
    assert_eq!((&found["animated"], &found["meshes"][0]["moves"]), (&json!(true), &json!(true)));
    assert_eq!(found["materials"][0]["name"], "leaf");
    assert_eq!(found["settings"]["frames"], json!([0, 36]));
    let codes: Vec<&Value> = found["warnings"].as_array().into_iter().flatten().map(|w| &w["code"]).collect();
    assert_eq!(codes, [""; 0]);
    assert_eq!(found["materials"][0]["alpha"], "Blended");
    for says in
        ["triangles 2", "Turn", "1.250 s", "1 of 1 meshes move", "leaf", "0.5000 blended", "--camera '("]
    {
        assert!(text.contains(says), "`{says}` is not in:\n{text}");
    }
}

#[test]
fn a_suggested_lens_blurs_a_little_and_is_taken() {
    let (text, found) = info(&["default"]);
    let lens = found["suggested"]["lens_radius"].as_f64().expect("a lens");
    assert!(lens > 0.0 && text.contains(&format!("--lens {lens} --focus")), "{text}");
    let (_, again) = info(&["tiny", "--lens", "0.01", "--focus", "3"]);
    assert_eq!((&again["camera"]["lens_radius"], &again["camera"]["focus"]), (&json!(0.01), &json!(3.0)));
}

#[test]
fn the_flags_of_a_run_change_what_is_printed() {
    let inputs = Inputs::new();
    let scene = inputs.put("a.glb", animated().bytes());
    let (_, found) = info(&[
        &scene,
        "--clip",
        "Slide",
        "--frames",
        "30..31",
        "--size",
        "64x64",
        "--samples",
        "3",
        "--shutter",
        "0",
    ]);
    assert_eq!(found["bounds"], json!([[1.0, 0.0, 0.0], [2.0, 1.0, 0.0]]));
    assert_eq!((&found["settings"]["width"], &found["settings"]["samples"]), (&json!(64), &json!(3)));
}

#[test]
fn meshes_samples_and_workloads_are_described_too() {
    let inputs = Inputs::new();
    let mesh = inputs.put("a.mts", mts(&[[[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]; 2]]));
    let (text, found) = info(&[&mesh]);
    assert_eq!(
        (&found["triangles"], &found["objects"], &found["moves"]),
        (&json!(1), &json!(1), &json!(false))
    );
    assert!(text.contains("--camera '("), "{text}");
    let samples = inputs.path("a.smp");
    let ended = quintile().call(["samples", "--samples", "4", "--size", "8x6", "--out", &samples]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let (_, found) = info(&[&samples]);
    assert_eq!(
        (&found["width"], &found["height"], &found["samples_per_pixel"]),
        (&json!(8), &json!(6), &json!(4))
    );
    let (text, found) = info(&["soft-shadows"]);
    assert!(text.contains("area light") && found["settings"]["samples"].is_u64(), "{text}");
}

#[test]
fn unreadable_files_are_refused() {
    let mut refusals = Refusals::default();
    let inputs = Inputs::new();
    for (scene, code, says, remedy) in [
        ("nothing".to_owned(), 2, "no scene called `nothing`", "built in: default, tiny"),
        (inputs.path("gone.obj"), 2, "gone.obj: cannot read it", "check the path"),
        (inputs.put("broken.glb", "glTF"), 2, "broken.glb: GLB header", "get the file again"),
        (inputs.put("broken.mts", "MTS1"), 2, "broken.mts: byte 4", "get the file again"),
    ] {
        refusals.check(&quintile().call(["info", &scene]), code, &[says], remedy);
    }
    refusals.done();
}
