//! Scenes with a closed-form solution.

use crate::common::{Builder, Files, load_glb};
use glam::{Quat, Vec3};
use serde_json::json;
use workloads::{Overrides, Scene};

fn near(found: Vec3, expected: Vec3) {
    assert!((found - expected).length() < 2e-6, "{found} against {expected}");
}

fn at_rate(scene: Scene, frame_rate_hz: f64, shutter: f64) -> Scene {
    let overrides =
        Overrides { frame_rate_hz: Some(frame_rate_hz), shutter: Some(shutter), ..Overrides::default() };
    scene.with_overrides(&overrides).unwrap()
}

#[test]
fn a_turning_node_carries_its_vertices_around_a_circle() {
    let mut file = Builder::triangle();
    let half = 0.5f32.sqrt();
    file.animate(
        "rotation",
        &[0.0, 1.0, 2.0],
        (&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half, 0.0, 0.0, 1.0, 0.0], "VEC4"),
        "LINEAR",
    );
    let scene = at_rate(load_glb(&file.bytes()).unwrap(), 8.0, 0.5);
    for index in 0..15 {
        let frame = scene.frame(index).unwrap();
        let on_circle = |time: f64| {
            let angle = std::f64::consts::FRAC_PI_2 * time;
            Vec3::new(angle.cos() as f32, angle.sin() as f32, 0.0)
        };
        near(frame.meshes[0].open[1], on_circle(f64::from(index) / 8.0));
        near(frame.meshes[0].close[1], on_circle((f64::from(index) + 0.5) / 8.0));
        let [still, closing] =
            [&frame.meshes[0].open, &frame.meshes[0].close].map(|p| p[0].to_array().map(f32::to_bits));
        assert_eq!(still, closing, "the vertex on the axis stays put to the bit");
    }
}

#[test]
fn a_cubic_spline_follows_its_cubic_and_a_step_jumps() {
    // x(t) = t^3 on [0, 2]: tangents 0 and 12.
    let mut file = Builder::triangle();
    let keys = [[0.0f32; 3], [0.0; 3], [0.0; 3], [12.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0; 3]].concat();
    file.animate("translation", &[0.0, 2.0], (&keys, "VEC3"), "CUBICSPLINE");
    file.animate("scale", &[0.0, 1.0], (&[1.0, 1.0, 1.0, 3.0, 3.0, 3.0], "VEC3"), "STEP");
    let scene = at_rate(load_glb(&file.bytes()).unwrap(), 10.0, 0.0);
    for index in 0..20 {
        let time = index as f32 / 10.0;
        let scale = if index < 10 { 1.0 } else { 3.0 };
        let mesh = &scene.frame(index).unwrap().meshes[0];
        let expected = Vec3::new(time * time * time + scale, 0.0, 0.0);
        assert!((mesh.open[1] - expected).length() < 1e-5, "{} against {expected}", mesh.open[1]);
        assert!(mesh.is_still(), "a shutter of zero sees no motion");
    }
}

#[test]
fn morph_targets_add_up_with_their_weights() {
    let mut file = Builder::triangle();
    let first = file.floats(&[0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], "VEC3");
    let second = file.floats(&[0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0], "VEC3");
    file.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": first}, {"POSITION": second}]);
    file.animate("weights", &[0.0, 1.0], (&[0.0, 1.0, 1.0, 0.5], "SCALAR"), "LINEAR");
    let scene = at_rate(load_glb(&file.bytes()).unwrap(), 4.0, 1.0);
    let mesh = &scene.frame(1).unwrap().meshes[0];
    near(mesh.open[0], Vec3::new(0.0, 0.0, 0.5));
    near(mesh.open[1], Vec3::new(1.0 + 4.0 * 0.875, 0.0, 0.0));
    near(mesh.close[0], Vec3::new(0.0, 0.0, 1.0));
    near(mesh.close[1], Vec3::new(1.0 + 4.0 * 0.75, 0.0, 0.0));
    assert_eq!(mesh.open[2], mesh.close[2]);
}

#[test]
fn a_skin_with_targets_morphs_first_and_bends_then() {
    let mut file = Builder::triangle();
    let joints = file.accessor(&[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], 3, "VEC4", 5121);
    let weights = file.accessor(&[255, 0, 0, 0, 255, 0, 0, 0, 51, 204, 0, 0], 3, "VEC4", 5121);
    file.json["accessors"][weights]["normalized"] = json!(true);
    let target = file.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0], "VEC3");
    let primitive = &mut file.json["meshes"][0]["primitives"][0];
    primitive["targets"] = json!([{"POSITION": target}]);
    primitive["attributes"]["JOINTS_0"] = json!(joints);
    primitive["attributes"]["WEIGHTS_0"] = json!(weights);
    let half = 0.5f32.sqrt();
    // The mesh's own node moves far away, but a skinned mesh follows its joints alone.
    file.json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "weights": [1.0], "translation": [100, 0, 0], "children": []},
        {"translation": [0, 0, 5]},
        {"rotation": [0.0, 0.0, half, half]}
    ]);
    file.json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    file.json["skins"] = json!([{"joints": [1, 2]}]);
    let mesh = &load_glb(&file.bytes()).unwrap().frame(0).unwrap().meshes[0];
    near(mesh.open[0], Vec3::new(0.0, 0.0, 5.0));
    near(mesh.open[1], Vec3::new(0.0, 2.0, 0.0));
    near(mesh.open[2], 0.2 * Vec3::new(0.0, 1.0, 5.0) + 0.8 * Vec3::new(-1.0, 0.0, 0.0));
}

#[test]
fn a_mirrored_node_keeps_its_facing() {
    let mut file = Builder::triangle();
    file.json["nodes"][0]["scale"] = json!([-1, 1, 1]);
    let mesh = &load_glb(&file.bytes()).unwrap().frame(0).unwrap().meshes[0];
    let [a, b, c] = mesh.triangles[0].map(|vertex| mesh.open[vertex as usize]);
    assert!((b - a).cross(c - a).z > 0.0);
}

#[test]
fn sparse_and_interleaved_accessors_are_read() {
    let mut file = Builder::new();
    let interleaved: Vec<u8> = [[0.0f32, 0.0, 0.0, 9.0], [1.0, 0.0, 0.0, 9.0], [0.0, 1.0, 0.0, 9.0]]
        .concat()
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    file.accessor(&interleaved, 3, "VEC3", 5126);
    file.json["bufferViews"][0]["byteStride"] = json!(16);
    let which = file.shorts(&[2]);
    let value = file.floats(&[0.0, 7.0, 0.0], "VEC3");
    let view = |file: &Builder, accessor: usize| file.json["accessors"][accessor]["bufferView"].clone();
    file.json["accessors"][0]["sparse"] = json!({
        "count": 1,
        "indices": {"bufferView": view(&file, which), "componentType": 5123},
        "values": {"bufferView": view(&file, value)}
    });
    file.list("meshes").push(json!({"primitives": [{"attributes": {"POSITION": 0}}]}));
    file.list("nodes").push(json!({"mesh": 0}));
    let mesh = &load_glb(&file.bytes()).unwrap().frame(0).unwrap().meshes[0];
    assert_eq!(mesh.open[..], [Vec3::ZERO, Vec3::X, Vec3::new(0.0, 7.0, 0.0)]);
}

#[test]
fn a_clip_starts_over_and_another_can_be_chosen() {
    let mut file = Builder::triangle();
    file.animate("translation", &[0.0, 1.0], (&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0], "VEC3"), "LINEAR");
    let other = file.json["animations"][0].clone();
    file.list("animations").push(other);
    let up = file.floats(&[0.0, 0.0, 0.0, 0.0, 1.0, 0.0], "VEC3");
    file.json["animations"][1]["samplers"][0]["output"] = json!(up);
    file.json["animations"][1]["name"] = json!("rise");
    let scene = at_rate(load_glb(&file.bytes()).unwrap(), 4.0, 0.0);
    near(scene.frame(5).unwrap().meshes[0].open[0], Vec3::new(0.25, 0.0, 0.0));
    for clip in ["rise", "1"] {
        let overrides = Overrides { clip: Some(clip.to_owned()), ..Overrides::default() };
        let rising = scene.clone().with_overrides(&overrides).unwrap();
        near(rising.frame(5).unwrap().meshes[0].open[0], Vec3::new(0.0, 0.25, 0.0));
    }
    let wrong = Overrides { clip: Some("rice".to_owned()), ..Overrides::default() };
    let error = scene.with_overrides(&wrong).unwrap_err();
    assert!(error.is_usage() && error.to_string().contains("did you mean `rise`?"), "{error}");
}

#[test]
fn a_camera_on_a_moving_node_looks_down_minus_z() {
    let mut file = Builder::triangle();
    file.animate("translation", &[0.0, 1.0], (&[0.0, 0.0, 0.0, 0.0, 0.0, 8.0], "VEC3"), "LINEAR");
    file.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.25}}]);
    file.json["nodes"] = json!([{"camera": 0, "rotation": [0, 1, 0, 0]}, {"mesh": 0}]);
    file.json["scenes"][0]["nodes"] = json!([0, 1]);
    let scene = at_rate(load_glb(&file.bytes()).unwrap(), 4.0, 1.0);
    let camera = scene.frame(1).unwrap().camera;
    // Half a turn around y maps -z of the node to +z of the world, and flips x.
    near(camera.open().transform_point3(Vec3::new(1.0, 2.0, 5.0)), Vec3::new(-1.0, 2.0, 3.0));
    near(camera.close().transform_point3(Vec3::new(1.0, 2.0, 5.0)), Vec3::new(-1.0, 2.0, 1.0));
    assert_eq!(camera.near(), 0.25);
    assert!((camera.half_height() - 0.5f32.tan()).abs() < 1e-6);
}

#[test]
fn an_orthographic_camera_sees_twice_its_ymag_at_any_depth() {
    let with = |lens: &str| {
        let mut file = Builder::triangle();
        let lens: serde_json::Value = serde_json::from_str(lens).unwrap();
        file.json["cameras"] = json!([{"type": "orthographic", "orthographic": lens}]);
        file.json["nodes"] = json!([{"camera": 0, "translation": [0, 0, 4]}, {"mesh": 0}]);
        file.json["scenes"][0]["nodes"] = json!([0, 1]);
        load_glb(&file.bytes()).unwrap()
    };
    let scene = with(r#"{"xmag": 3.0, "ymag": 2.0, "zfar": 10.0, "znear": 0.25}"#);
    let camera = scene.frame(0).unwrap().camera;
    assert!(camera.is_orthographic() && scene.warnings().is_empty(), "{:?}", scene.warnings());
    assert_eq!((camera.half_height(), camera.near()), (2.0, 0.25));
    near(camera.open().transform_point3(Vec3::new(1.0, 2.0, 3.0)), Vec3::new(1.0, 2.0, 1.0));
    // A near plane at zero, which the format allows, is replaced by the scene.
    let touching = with(r#"{"xmag": 3.0, "ymag": 2.0, "zfar": 10.0, "znear": 0.0}"#).frame(0).unwrap().camera;
    assert!(touching.is_orthographic() && touching.near() > 0.0 && touching.near() < 0.01);
    for bad in [
        r#"{"xmag": 1.0, "ymag": 0.0, "zfar": 9.0, "znear": 0.1}"#,
        r#"{"xmag": 1.0, "ymag": -1.0, "zfar": 9.0, "znear": 0.1}"#,
    ] {
        let scene = with(bad);
        assert!(scene.warnings().iter().any(|warning| warning.code == "camera-ignored"), "{bad}");
        assert!(!scene.frame(0).unwrap().camera.is_orthographic());
    }
}

#[test]
fn a_ron_camera_with_a_height_is_orthographic() {
    let text = "(settings: (lens_radius: 0.1), camera: (position: (0, 0, 7), target: (0, 0, 1), view_height: 3), \
                objects: [(shape: Sphere(radius: 1))])";
    let camera = workloads::load(Files::new().put("s.ron", text)).unwrap().frame(0).unwrap().camera;
    assert!(camera.is_orthographic());
    assert_eq!((camera.half_height(), camera.lens().unwrap().focus()), (1.5, 6.0));
}

#[test]
fn two_files_are_the_two_ends_of_a_motion() {
    let files = Files::new();
    files.put("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 4 3\n");
    files.put("b.obj", "v 0 0 0\nv 1 0 2\nv 0 1 0\nv 1 1 0\nf 1 2 4 3\n");
    let path = files.put(
        "s.ron",
        "(settings: (shutter: 1, frame_rate_hz: 10), objects: [(file: \"a.obj\", end: \"b.obj\")])",
    );
    let scene = workloads::load(&path).unwrap();
    assert_eq!(scene.triangle_count(), 2, "a quad is two triangles");
    let mesh = &scene.frame(0).unwrap().meshes[0];
    let moved = (0..4).find(|&v| mesh.open[v] == Vec3::X).unwrap();
    assert_eq!(mesh.close[moved], Vec3::new(1.0, 0.0, 2.0));
    assert_eq!((0..4).filter(|&v| mesh.open[v] == mesh.close[v]).count(), 3);
    assert!(scene.frame(1).unwrap().meshes[0].is_still(), "it stays where it arrived");
}

#[test]
fn ron_objects_turn_about_x_then_y_then_z_and_spin_about_their_own_axis() {
    let text = "(settings: (frame_rate_hz: 4, shutter: 0.5), objects: [(shape: Box(size: (2, 2, 2)), position: (1, 2, 3), \
                rotation_deg: (90, 0, 90), velocity: (4, 0, 0), spin: (axis: (0, 0, 2), rate_hz: 1))])";
    let scene = workloads::load(Files::new().put("s.ron", text)).unwrap();
    let frame = scene.frame(1).unwrap();
    let still =
        workloads::load(Files::new().put("s.ron", "(objects: [(shape: Box(size: (2, 2, 2)))])")).unwrap();
    let rest = still.frame(0).unwrap();
    let rotation = Quat::from_rotation_z(90f32.to_radians()) * Quat::from_rotation_x(90f32.to_radians());
    for (time, found) in [(0.25f32, &frame.meshes[0].open), (0.375, &frame.meshes[0].close)] {
        for (place, corner) in found.iter().zip(rest.meshes[0].open.iter()) {
            let spun = Quat::from_rotation_z(time * std::f32::consts::TAU) * *corner;
            near(*place, Vec3::new(1.0 + 4.0 * time, 2.0, 3.0) + rotation * spun);
        }
    }
}

#[test]
fn a_lens_focuses_on_the_target_by_default() {
    let text = "(settings: (lens_radius: 0.1), camera: (position: (0, 0, 7), target: (0, 0, 1)), objects: [(shape: Sphere(radius: 1))])";
    let scene = workloads::load(Files::new().put("s.ron", text)).unwrap();
    assert_eq!(scene.frame(0).unwrap().camera.lens().unwrap().focus(), 6.0);
    let focused = scene.with_overrides(&Overrides { focus: Some(4.5), ..Overrides::default() }).unwrap();
    assert_eq!(focused.frame(0).unwrap().camera.lens().unwrap().focus(), 4.5);
    let pinhole =
        focused.with_overrides(&Overrides { lens_radius: Some(0.0), ..Overrides::default() }).unwrap();
    assert!(pinhole.frame(0).unwrap().camera.lens().is_none());
}
