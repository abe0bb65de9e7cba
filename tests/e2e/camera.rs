//! Cameras: chosen, described, placed inside, printed and reused.

use crate::support::{Glb, Inputs, Refusals, Results, quintile};
use serde_json::{Value, json};

/// A short, small run.
const SMALL: [&str; 6] = ["--size", "48x32", "--frames", "0..2", "--samples", "2"];

fn run(scene: &str, args: &[&str]) -> Results {
    quintile().run(scene, &[&SMALL, args].concat())
}

/// The images of both frames.
fn images(scene: &str, args: &[&str]) -> [Vec<u8>; 2] {
    let results = run(scene, args);
    [0, 1].map(|frame| results.bytes(&format!("images/frame_000{frame}.png")))
}

/// Output of `quintile info` for the scene of such a run.
fn info(scene: &str, args: &[&str]) -> Value {
    let ended = quintile().call([&["info", scene, "--json"], &SMALL[..], args].concat());
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    serde_json::from_str(&ended.stdout).expect("JSON")
}

fn printed(scene: &str, args: &[&str]) -> String {
    info(scene, args)["camera"]["ron"].as_str().expect("a camera").to_owned()
}

/// A box from (-6, 0, -2) to (6, 3, 2) as OBJ, its faces seen from inside or from outside.
fn room(inward: bool) -> String {
    let mut text = String::new();
    for corner in 0..8 {
        let at = |bit: u32, low: i32, high: i32| if corner >> bit & 1 == 0 { low } else { high };
        text += &format!("v {} {} {}\n", at(0, -6, 6), at(1, 0, 3), at(2, -2, 2));
    }
    for [a, b, c, d] in [[1, 5, 7, 3], [2, 4, 8, 6], [1, 2, 6, 5], [3, 7, 8, 4], [1, 3, 4, 2], [5, 6, 8, 7]] {
        text += &if inward { format!("f {d} {c} {b} {a}\n") } else { format!("f {a} {b} {c} {d}\n") };
    }
    text
}

/// A square seen by two cameras, from in front and from the side, neither of them looking along an axis.
fn two_cameras() -> Glb {
    let mut glb = Glb::square();
    glb.json["cameras"] = json!([
        {"name": "front", "type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.05}},
        {"name": "side", "type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1.3, "znear": 0.1, "zfar": 9}},
    ]);
    let turned = |x: f64, y: f64| {
        let w = (1.0 - x * x - y * y).sqrt();
        json!([x, y, 0.0, w])
    };
    glb.json["nodes"] = json!([
        {"mesh": 0, "children": [1, 2]},
        {"camera": 0, "translation": [0.7, 0.4, 3.1], "rotation": turned(-0.03, 0.02)},
        {"camera": 1, "translation": [1.9, 0.6, 1.3], "rotation": turned(0.05, 0.35), "scale": [2, 2, 2]},
    ]);
    glb.material(json!({"doubleSided": true}));
    glb
}

#[test]
fn a_printed_camera_gives_the_same_bytes_when_reused() {
    let inputs = Inputs::new();
    let moving = |camera: &str| {
        format!(
            "(settings: (lens_radius: 0.05, frames: (0, 8)), camera: ({camera}), \
             objects: [(shape: Sphere(radius: 0.7, segments: 12)), (shape: Plane(size: 6))])"
        )
    };
    let keys = "position: (1, 2, 4), target: (0, 0, 0), fov_deg: 33.3, up: (0.1, 1, 0), interpolation: Step, \
                keyframes: [(time_s: 0, target: (0.1, 0, 0)), (time_s: 0.01, position: (1.5, 2, 4))]";
    let scenes = [
        "tiny".to_owned(),
        inputs.put("solid.obj", room(false)),
        inputs.put("room.obj", room(true)),
        inputs.put("cameras.glb", two_cameras().bytes()),
        inputs.put("ends.ron", moving("position: (1, 2, 4), target: (0, 0.1, 0), end_position: (2, 1, 4)")),
        inputs.put("keys.ron", moving(keys)),
        inputs
            .put("given.ron", moving("position: (1, 2, 4), direction: (-1, -2, -4), focus: 4.2, near: 0.3")),
    ];
    for scene in &scenes {
        for args in [&[][..], &["--lens", "0.07"]] {
            let before = info(scene, args);
            assert_eq!(before["camera"]["exact"], true, "{scene}");
            let camera = before["camera"]["ron"].as_str().expect("a camera");
            assert!(
                images(scene, args) == images(scene, &["--camera", camera]),
                "{scene} {args:?}: {camera}"
            );
        }
    }
}

#[test]
fn a_camera_in_a_file_or_typed_with_parentheses_is_the_same() {
    let inputs = Inputs::new();
    let fields = "position: (1, 1.5, 4), target: (0, 0.5, 0), fov_deg: 35";
    let file = inputs.put("c.ron", format!("// from the side\n(\n    {fields},\n)\n"));
    let expected = images("tiny", &["--camera", fields]);
    assert!(expected == images("tiny", &["--camera", &format!("({fields})")]));
    assert!(expected == images("tiny", &["--camera", &file]));
    assert!(expected != images("tiny", &[]));
    // The file may set image and samples; the command line overrides them.
    let whole = inputs.put("whole.ron", format!("(width: 48, height: 32, samples: 2, {fields})"));
    let results = quintile().run("tiny", &["--frames", "0..2", "--camera", &whole]);
    assert!(expected[0] == results.bytes("images/frame_0000.png"));
}

#[test]
fn cameras_of_a_file_are_chosen_by_name_or_number() {
    let inputs = Inputs::new();
    let scene = inputs.put("cameras.glb", two_cameras().bytes());
    let first = images(&scene, &[]);
    assert!(first == images(&scene, &["--camera", "front"]) && first == images(&scene, &["--camera", "0"]));
    let second = images(&scene, &["--camera", "side"]);
    assert!(first != second && second == images(&scene, &["--camera", "1"]));
    let found = info(&scene, &["--camera", "side"]);
    assert_eq!((&found["camera"]["kind"], &found["camera"]["index"]), (&json!("own"), &json!(1)));
    assert_eq!(found["cameras"][0]["name"], "front");
    assert_eq!(found["cameras"][1]["view_height"], json!(f64::from(1.3_f32) * 2.0));
    let placed = info(&scene, &["--camera", "outside"]);
    assert_eq!((&placed["camera"]["kind"], &placed["camera"]["side"]), (&json!("placed"), &json!("Outside")));
}

#[test]
fn the_camera_of_a_scene_file_is_its_number_0() {
    assert!(images("tiny", &[]) == images("tiny", &["--camera", "0"]));
    assert!(images("tiny", &[]) == images("tiny", &["--camera", "scene"]));
}

#[test]
fn the_command_line_overrides_lens_and_focus_of_a_camera() {
    let camera = "position: (0, 1.5, 5), target: (0, 1.5, 0)";
    let lens = format!("{camera}, lens_radius: 0.2");
    let found = info("tiny", &["--camera", &lens]);
    assert_eq!((&found["camera"]["lens_radius"], &found["camera"]["focus"]), (&json!(0.2), &json!(5.0)));
    assert!(images("tiny", &["--camera", &lens]) == images("tiny", &["--camera", &lens, "--focus", "5"]));
    let pinhole = images("tiny", &["--camera", &lens, "--lens", "0"]);
    assert!(pinhole == images("tiny", &["--camera", &format!("{camera}, lens_radius: 0, focus: 3")]));
    assert!(pinhole != images("tiny", &["--camera", &lens]));
    // The focus depth of the scene's own camera does not apply to another one.
    let inputs = Inputs::new();
    let scene = inputs.put(
        "focused.ron",
        "(settings: (lens_radius: 0.1, focus: 2.5), camera: (position: (0, 0, 4), target: (0, 0, 0)), \
         objects: [(shape: Sphere(radius: 1, segments: 12))])",
    );
    assert_eq!(info(&scene, &[])["camera"]["focus"], 2.5);
    assert_eq!(info(&scene, &["--camera", "position: (0, 0, 7), target: (0, 0, 0)"])["camera"]["focus"], 7.0);
}

#[test]
fn a_room_is_seen_from_inside_and_a_solid_from_outside() {
    let inputs = Inputs::new();
    let [room_file, solid] = [inputs.put("room.obj", room(true)), inputs.put("solid.obj", room(false))];
    let inside = run(&room_file, &[]);
    assert!(inside.warning_codes().contains(&"camera-inside".to_owned()));
    assert!(inside.ended.stderr.contains("--camera outside"), "{}", inside.ended.stderr);
    let eye = &info(&room_file, &[])["camera"];
    let coordinate = |axis: usize| eye["position"][axis].as_f64().unwrap_or(f64::NAN);
    assert!(
        coordinate(0).abs() < 6.0 && (1.0..2.0).contains(&coordinate(1)) && coordinate(2).abs() < 2.0,
        "{eye}"
    );
    assert_eq!(eye["side"], "Inside");
    // Every sample sees a wall.
    assert!(inside.image(0).pixels().all(|pixel| pixel.0 != [173, 188, 203]), "the background is seen");
    for (scene, args) in [(&room_file, ["--camera", "outside"]), (&solid, ["--camera", "outside"])] {
        assert!(!run(scene, &args).warning_codes().contains(&"camera-inside".to_owned()));
        assert_eq!(info(scene, &args)["camera"]["side"], "Outside");
    }
    assert_eq!(info(&solid, &[])["camera"]["side"], "Outside");
    assert!(images(&solid, &[]) == images(&solid, &["--camera", "outside"]));
    let inside = info(&solid, &["--camera", "inside"]);
    assert_eq!(inside["camera"]["side"], "Inside");
    let wide = info(&room_file, &["--camera", "fitted: Inside, fov_deg: 85"]);
    assert_eq!((&wide["camera"]["fov_deg"], &wide["camera"]["position"]), (&json!(85.0), &eye["position"]));
}

#[test]
fn workloads_with_a_scene_take_a_camera_and_others_refuse_it() {
    let camera = "position: (0.5, 2, 5), target: (0, 0.2, 0)";
    let args = ["--size", "48x32", "--frames", "0..1", "--samples", "2"];
    let bytes =
        |more: &[&str]| quintile().run("glossy", &[&args, more].concat()).bytes("images/frame_0000.png");
    assert!(bytes(&[]) != bytes(&["--camera", camera]));
    let mut refusals = Refusals::default();
    refusals.call(
        &["ccd", "--camera", camera],
        2,
        &["--camera: the workload `ccd` has no use for it"],
        "leave it out",
    );
    refusals.done();
}

#[test]
fn errors_in_a_camera_name_their_place() {
    let mut refusals = Refusals::default();
    for (camera, says, remedy) in [
        ("positon: (0, 0, 3)", "--camera:1:1: unknown field `positon`", "did you mean `position`?"),
        ("position: (0, 0, 3)", "--camera: camera: `position` and `target`", "give both, or none"),
        (
            "position: (0, 0, 3), target: (0, 0, 3)",
            "--camera: target: the camera has no direction",
            "move one of them",
        ),
        (
            "position: (0, 0, 3), target: (0, 0, 0), fov_deg: 200",
            "--camera:1:50: `fov_deg`: 200",
            "from 0.1 to 175 degrees",
        ),
        (
            "position: (0, 0, 3), target: (0, 0, 0), shift: (1, 0)",
            "shift: only `quintile visibility`",
            "leave it out",
        ),
        ("upside", "camera: unknown camera `upside`: known: scene", "give `inside` or `outside`"),
        ("scen", "camera: unknown camera `scen`", "did you mean `scene`?"),
        ("7", "camera: unknown camera `7`", "give `inside` or `outside`"),
    ] {
        refusals.call(&["tiny", "--camera", camera], 2, &[says], remedy);
    }
    refusals.call(
        &["tiny", "--camera", "/nowhere/c.ron"],
        2,
        &["/nowhere/c.ron: cannot read it"],
        "check the path",
    );
    let twice = "(settings: (lens_radius: 1), camera: (position: (0, 0, 3), target: (0, 0, 0), lens_radius: 1), \
                 objects: [(shape: Sphere(radius: 1))])";
    refusals.file("twice.ron", twice, 2, &["camera.lens_radius"], "remove one of them");
    let image = "(camera: (position: (0, 0, 3), target: (0, 0, 0), width: 64), objects: [(shape: Sphere(radius: 1))])";
    refusals.file("image.ron", image, 2, &["camera.width"], "put `width` there");
    refusals.done();
}

#[test]
fn visibility_takes_the_cameras_of_scenes() {
    let inputs = Inputs::new();
    let solid = inputs.put("solid.obj", room(false));
    let hits = |camera: &str, name: &str| {
        let out = inputs.path(name);
        let ended = quintile().call(["visibility", &solid, "--camera", camera, "--out", &out]);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        std::fs::read(out).expect("the result")
    };
    let fields = "position: (3, 4, 14), target: (0, 1, 0), width: 48, height: 32, samples: 2";
    let file = inputs.put("c.ron", format!("({fields})"));
    assert!(hits(fields, "a.hit") == hits(&file, "b.hit"));
    // The camera that `info` prints for a scene is one here, too.
    hits(&printed(&solid, &[]), "c.hit");
}
