//! Properties of all scenes: fitted cameras see everything, and importers never panic.

use crate::common::{Builder, Files, load_glb};
use glam::Vec3;
use proptest::prelude::*;
use serde_json::json;
use workloads::{Frame, Overrides, load};

/// Every vertex at both ends, from five points of the lens, lies in the image and beyond the near depth.
fn all_in_view(frame: &Frame, aspect: f32) -> Result<(), TestCaseError> {
    let camera = &frame.camera;
    let tan = camera.half_height();
    let lens = camera.lens().map_or((0.0, 1.0), |lens| (lens.radius(), lens.focus()));
    for mesh in &frame.meshes {
        for (points, pose) in [(&mesh.open, camera.open()), (&mesh.close, camera.close())] {
            for point in points.iter().map(|point| pose.transform_point3(*point)) {
                prop_assert!(point.z > camera.near(), "{point} is nearer than {}", camera.near());
                let shear = lens.0 * (point.z / lens.1 - 1.0);
                for (u, v) in [(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
                    let (x, y) = ((point.x + u * shear) / point.z, (point.y + v * shear) / point.z);
                    prop_assert!(x.abs() <= tan * aspect && y.abs() <= tan, "({x}, {y}) is out of view");
                }
            }
        }
    }
    Ok(())
}

prop_compose! {
    fn corner()(x in -50.0..50.0f32, y in -50.0..50.0f32, z in -50.0..50.0f32) -> Vec3 { Vec3::new(x, y, z) }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_fitted_camera_sees_everything_all_the_time_from_all_over_the_lens(
        corners in prop::collection::vec(corner(), 3),
        scale in 0.001..100.0f64,
        velocity in corner(),
        radius in 0.0..0.5f32,
        size in (16..600u32, 16..600u32),
    ) {
        let files = Files::new();
        let vertices: String = corners.iter().map(|c| format!("v {} {} {}\n", c.x, c.y, c.z)).collect();
        files.put("a.obj", vertices + "f 1 2 3\n");
        let text = format!(
            "(settings: (frames: (0, 9), shutter: 1), objects: [(file: \"a.obj\", scale: ({scale}, {scale}, {scale}),
              velocity: ({}, {}, {}), spin: (axis: (1, 2, 3), rate_hz: 4))])", velocity.x, velocity.y, velocity.z);
        let scene = load(files.put("s.ron", text)).unwrap();
        let radius = radius * scale as f32;
        let overrides = Overrides { size: Some(size), lens_radius: Some(radius), ..Overrides::default() };
        let scene = scene.with_overrides(&overrides).unwrap();
        prop_assert!(scene.warnings().iter().all(|warning| warning.code != "lens-leaves-view"));
        for index in 0..9 {
            all_in_view(&scene.frame(index).unwrap(), size.0 as f32 / size.1 as f32)?;
        }
    }
}

/// A small file with many features.
fn rich() -> Vec<u8> {
    let mut file = Builder::triangle();
    let joints = file.accessor(&[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], 3, "VEC4", 5121);
    let weights = file.floats(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0], "VEC4");
    let target = file.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0], "VEC3");
    let uvs = file.floats(&[0.0; 6], "VEC2");
    let sparse = file.shorts(&[1]);
    let primitive = &mut file.json["meshes"][0]["primitives"][0];
    primitive["targets"] = json!([{"POSITION": target}]);
    primitive["attributes"]["JOINTS_0"] = json!(joints);
    primitive["attributes"]["WEIGHTS_0"] = json!(weights);
    primitive["attributes"]["TEXCOORD_0"] = json!(uvs);
    primitive["material"] = json!(0);
    file.json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    file.json["textures"] = json!([{"source": 0}]);
    file.json["images"] = json!([{"bufferView": 0, "mimeType": "image/png"}]);
    file.json["accessors"][0]["sparse"] = json!({
        "count": 1, "indices": {"bufferView": sparse, "componentType": 5123}, "values": {"bufferView": target}});
    file.animate("weights", &[0.0, 1.0], (&[0.0, 1.0], "SCALAR"), "LINEAR");
    file.json["nodes"] =
        json!([{"mesh": 0, "skin": 0, "children": [1]}, {"children": [2]}, {"translation": [0, 1, 0]}]);
    file.json["skins"] = json!([{"joints": [1, 2]}]);
    file.bytes()
}

/// Loads the file and its first frame: errors are fine, panics are not.
fn survives(path: &str) {
    if let Ok(scene) = load(path)
        && let Ok(frame) = scene.frame(0)
    {
        let _ = frame.draws(&scene);
    }
}

#[test]
fn the_undamaged_file_is_valid() {
    let scene = load_glb(&rich()).unwrap();
    scene.frame(1).unwrap().draws(&scene).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn damaged_glb_files_never_panic(
        flips in prop::collection::vec((any::<prop::sample::Index>(), 0..8u8), 0..6),
        digits in prop::collection::vec((any::<prop::sample::Index>(), b'0'..=b'9'), 0..3),
        cut in any::<prop::sample::Index>(), cuts in any::<bool>(),
    ) {
        let mut bytes = rich();
        // Changed digits keep the JSON valid, so the damage reaches beyond the parser.
        let places: Vec<usize> = (0..bytes.len()).filter(|at| bytes[*at].is_ascii_digit()).collect();
        for (place, digit) in &digits {
            bytes[places[place.index(places.len())]] = *digit;
        }
        if digits.is_empty() {
            for (place, bit) in &flips {
                let at = place.index(bytes.len());
                bytes[at] ^= 1 << bit;
            }
        }
        if cuts && digits.is_empty() {
            bytes.truncate(cut.index(bytes.len()));
        }
        survives(&Files::new().put("damaged.glb", &bytes));
    }

    #[test]
    fn damaged_surface_files_never_panic(
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5),
        binary in any::<bool>(),
    ) {
        let files = Files::new();
        let kind = if binary { "binary_big_endian" } else { "ascii" };
        let header = format!("ply\nformat {kind} 1.0\nelement vertex 3\nproperty float x\nproperty double y\nproperty short z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n");
        let mut ply = header.into_bytes();
        if binary {
            ply.extend([0; 42]);
            ply.extend([3, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 2]);
        } else {
            ply.extend(b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
        }
        let obj = b"mtllib a.mtl\nv 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nvt 0 1\nvn 0 0 1\nusemtl a\nf 1/1/1 2/1/1 -1/1/1\nl 1 2\n".to_vec();
        let mtl = b"newmtl a\nKd 1 0.5 0\nmap_Kd -s 2 2 -o 0.5 -clamp on a.png\nd 0.5\nTr 0\nbump -bm 1 b.png\nKe 0 0 0\n".to_vec();
        let off = b"STCNOFF\n3 1 0\n0 0 0 0 0 1 255 0 0 0 1\n1 0 0 0 0 1 1 0 0 0 1\n0 1 0 0 0 1 0 0 0 1 1\n3 0 1 2 9\n".to_vec();
        let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
        let ascii = format!("solid a\n{facet}endsolid a\n").into_bytes();
        let mut stl = vec![b' '; 80];
        stl.extend([1, 0, 0, 0].into_iter().chain([0; 50]));
        let whole = files.put("whole.obj", &obj);
        let kinds = [("ply", ply), ("obj", obj), ("off", off), ("stl", if binary { stl } else { ascii })];
        let damaged = |mut bytes: Vec<u8>| {
            for (place, byte) in &flips {
                let at = place.index(bytes.len());
                bytes[at] = *byte;
            }
            bytes
        };
        files.put("a.mtl", damaged(mtl));
        survives(&whole);
        for (kind, bytes) in kinds {
            survives(&files.put(&format!("damaged.{kind}"), damaged(bytes)));
        }
    }
}
