//! Every kind of broken scene file gives one message with file, place and remedy, and never panics.

use crate::common::{Builder, Files, expect, failure, load_glb};
use serde_json::json;
use workloads::{Alpha, load};

/// The error of a broken file, which must be a failure (not a mistake of usage) that names the file.
fn broken(change: impl FnOnce(&mut Builder)) -> String {
    let mut file = Builder::triangle();
    change(&mut file);
    failure(load_glb(&file.bytes()).unwrap_err())
}

#[test]
fn a_truncated_glb_says_so_wherever_it_is_cut() {
    let whole = Builder::triangle().bytes();
    for length in 0..whole.len() {
        let text = failure(load_glb(&whole[..length]).unwrap_err());
        expect(&text, &["scene.glb: "]);
        if length >= 4 {
            expect(&text, &["truncated", "get the file again"]);
        }
    }
}

#[test]
fn a_header_shorter_than_itself_never_panics() {
    let mut bytes = Builder::triangle().bytes();
    bytes[8..12].copy_from_slice(&3u32.to_le_bytes());
    let _ = load_glb(&bytes);
}

#[test]
fn indices_out_of_range_are_named() {
    let text = broken(|file| file.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(77));
    expect(
        &text,
        &["scene.glb: meshes[0].primitives[0].attributes.POSITION: index out of range", "export it again"],
    );
    let text = broken(|file| file.json["meshes"][0]["primitives"][0]["indices"] = json!(5));
    expect(&text, &["meshes[0].primitives[0].indices: index out of range"]);
    let text = broken(|file| file.json["nodes"][0]["mesh"] = json!(9));
    expect(&text, &["nodes[0].mesh: index out of range"]);
    let text = broken(|file| {
        let bytes = [0u16, 1, 9].map(u16::to_le_bytes).concat();
        let start = file.json["bufferViews"][1]["byteOffset"].as_u64().unwrap() as usize;
        file.binary[start..start + 6].copy_from_slice(&bytes);
    });
    expect(
        &text,
        &["meshes[0].primitives[0]: triangle 0 uses vertex 9, but there are only 3: export it again"],
    );
}

#[test]
fn accessors_beyond_their_buffers_are_named() {
    let text = broken(|file| file.json["accessors"][0]["count"] = json!(1000));
    expect(
        &text,
        &[
            "meshes[0].primitives[0] Positions, accessor 0: it needs 12000 bytes of buffer view 0, which has 36",
        ],
    );
    let text = broken(|file| file.json["accessors"][0]["byteOffset"] = json!(u64::MAX));
    expect(&text, &["accessor 0"]);
    let text = broken(|file| file.json["bufferViews"][0]["byteLength"] = json!(99_999));
    expect(&text, &["accessor 0: buffer view 0 ends at byte 99999"]);
    let text = broken(|file| file.json["buffers"][0]["byteLength"] = json!(1u64 << 40));
    expect(&text, &["buffers[0]: truncated"]);
    let text = broken(|file| file.json["accessors"][0]["type"] = json!("SCALAR"));
    expect(&text, &["accessor 0: it has the type Scalar instead of [Vec3]"]);
}

#[test]
fn absurd_counts_do_not_take_memory() {
    let text = broken(|file| file.json["accessors"][0]["count"] = json!(u64::MAX));
    expect(&text, &["accessor 0", "too many"]);
    let text = broken(|file| {
        file.json["accessors"][0]["count"] = json!(50_000_000);
        file.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
        file.json["accessors"][0]["sparse"] = json!({"count": 0,
            "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 0}});
    });
    expect(&text, &["accessor 0", "too many"]);
}

#[test]
fn nan_vertices_and_transforms_are_named() {
    let text = broken(|file| file.binary[12..16].copy_from_slice(&f32::NAN.to_le_bytes()));
    expect(
        &text,
        &[
            "scene.glb: meshes[0].primitives[0]: vertex 1 has a coordinate that is NaN or infinite: export it again",
        ],
    );
    let text = broken(|file| file.json["nodes"][0]["scale"] = json!([1e38, 1e38, 1e39]));
    expect(&text, &["scene.glb"]);
    let text = broken(|file| {
        file.json["nodes"][0]["scale"] = json!([1e38, 1e38, 1e38]);
        file.list("nodes").push(json!({"children": [0], "scale": [1e38, 1, 1]}));
        file.json["scenes"][0]["nodes"] = json!([1]);
    });
    expect(&text, &["vertex 1 is not finite", "overflows"]);
}

#[test]
fn bad_hierarchies_are_named() {
    let text = broken(|file| file.json["nodes"][0]["children"] = json!([0]));
    expect(&text, &["nodes[0]: it is its own ancestor"]);
    let text = broken(|file| {
        file.list("nodes").push(json!({"children": [2]}));
        file.list("nodes").push(json!({}));
        file.json["nodes"][0]["children"] = json!([2]);
    });
    expect(&text, &["nodes[2]: it is a child of nodes 0 and 1"]);
}

#[test]
fn bad_animations_and_skins_are_named() {
    let animate = |times: &'static [f32], values: &'static [f32]| {
        move |file: &mut Builder| file.animate("translation", times, (values, "VEC3"), "LINEAR")
    };
    let text = broken(animate(&[0.0, 1.0], &[0.0, 0.0, 0.0]));
    expect(&text, &["animations[0].channels[0]: 2 keys need 6 numbers, there are 3"]);
    let text = broken(animate(&[1.0, 0.0], &[0.0; 6]));
    expect(&text, &["the time of key 1 lies before that of key 0"]);
    let text = broken(|file| {
        file.animate("translation", &[0.0], (&[0.0; 3], "VEC3"), "LINEAR");
        file.json["animations"][0]["channels"][0]["target"]["node"] = json!(4);
    });
    expect(&text, &["animations[0].channels[0]: node 4 does not exist (there are "]);
    let text = broken(|file| {
        let joints = file.accessor(&[5; 12], 3, "VEC4", 5121);
        let weights = file.floats(&[1.0; 12], "VEC4");
        let attributes = &mut file.json["meshes"][0]["primitives"][0]["attributes"];
        attributes["JOINTS_0"] = json!(joints);
        attributes["WEIGHTS_0"] = json!(weights);
        file.json["skins"] = json!([{"joints": [0]}]);
        file.json["nodes"][0]["skin"] = json!(0);
    });
    expect(&text, &["node 0", "a vertex uses joint 5, but the skin has only 1"]);
}

#[test]
fn files_that_are_something_else_are_refused() {
    let files = Files::new();
    for (name, bytes) in [
        ("a.gltf", "{}"),
        ("a.gltf", "not json"),
        ("a.ply", "solid"),
        ("a.ply", "ply\nformat ascii 1.0\nend_header\n"),
        ("a.obj", "f 1 2 3\n"),
        ("a.off", "solid"),
        ("a.off", "OFF\n4000000000 1 0\n"),
        ("a.stl", "ply"),
        ("a.stl", "solid a\nfacet\n"),
        ("a.obj", ""),
        ("a.obj.gz", "v 0 0 0"),
    ] {
        let text = failure(load(files.put(name, bytes)).unwrap_err());
        expect(&text, &[name]);
    }
    let text = broken(|file| {
        let extensions =
            json!(["KHR_draco_mesh_compression", "KHR_materials_unlit", "EXT_mesh_gpu_instancing"]);
        file.json["extensionsRequired"] = extensions.clone();
        file.json["extensionsUsed"] = extensions;
    });
    let named = "extensionsRequired: `KHR_draco_mesh_compression`, `EXT_mesh_gpu_instancing` not supported";
    expect(&text, &[named, "export it without"]);
}

#[test]
fn a_missing_buffer_is_a_failure_and_a_missing_image_a_warning() {
    let files = Files::new();
    let mut file = Builder::triangle();
    file.json["buffers"][0]["uri"] = json!("gone.bin");
    let text = failure(load(files.put("a.gltf", file.json.to_string())).unwrap_err());
    expect(&text, &["a.gltf: buffers[0]: cannot read", "gone.bin", "put the file there"]);

    let png = |width: u32| {
        let mut bytes = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec();
        bytes.extend([width.to_be_bytes(), 1u32.to_be_bytes()].concat());
        bytes.extend([8, 6, 0, 0, 0, 0, 0, 0, 0]);
        bytes
    };
    for (name, bytes) in [
        ("gone.png", None),
        ("text.png", Some(b"no image".to_vec())),
        ("empty.png", Some(png(0))),
        ("vast.png", Some(png(2_000_000))),
    ] {
        let mut file = Builder::triangle();
        let uvs = file.floats(&[0.0; 6], "VEC2");
        file.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uvs);
        file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
        file.json["materials"] = json!([{"name": "skin", "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {"index": 0}, "baseColorFactor": [0.5, 0.25, 1, 1]}}]);
        file.json["textures"] = json!([{"source": 0}]);
        file.json["images"] = json!([{"uri": name}]);
        if let Some(bytes) = bytes {
            files.put(name, bytes);
        }
        let scene = load(files.put("b.glb", file.bytes())).unwrap();
        let warning = &scene.warnings()[0];
        assert_eq!(warning.code, "missing-image");
        expect(&warning.to_string(), &["1 texture not read", "material `skin`", name]);
        assert_eq!(scene.materials()[0].base_color, glam::Vec3::new(0.5, 0.25, 1.0));
    }
}

#[test]
fn points_are_dropped_with_a_warning_and_needless_alpha_is_opaque() {
    let mut file = Builder::triangle();
    let points = json!({"attributes": {"POSITION": 0}, "mode": 0});
    file.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(points);
    let half = json!({"baseColorFactor": [1, 1, 1, 0.5], "metallicFactor": 0});
    file.json["materials"] = json!([
        {"alphaMode": "MASK", "alphaCutoff": 0.75, "pbrMetallicRoughness": half},
        {"alphaMode": "BLEND", "pbrMetallicRoughness": half},
        {"alphaMode": "MASK", "pbrMetallicRoughness": half},
        {"alphaMode": "BLEND", "pbrMetallicRoughness": {"metallicFactor": 0}},
    ]);
    for material in 0..4 {
        let primitive = json!({"attributes": {"POSITION": 0}, "material": material});
        file.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
    }
    let scene = load_glb(&file.bytes()).unwrap();
    let warnings: Vec<_> =
        scene.warnings().iter().map(|warning| (warning.code.name(), warning.count)).collect();
    assert_eq!(warnings, [("primitive-dropped", 1)]);
    // A mask at 0.5 keeps half-transparent texels, and a blended material of opacity 1 hides what is behind.
    let alpha: Vec<_> = scene.materials().iter().map(|material| material.alpha).collect();
    assert_eq!(alpha[..4], [Alpha::CutOut { cutoff: 0.75 }, Alpha::Blended, Alpha::Opaque, Alpha::Opaque]);
    assert_eq!(scene.triangle_count(), 5);
    let text = broken(|file| file.json["meshes"][0]["primitives"][0]["mode"] = json!(1));
    expect(&text, &["it has no triangles"]);
}

#[test]
fn mistakes_in_ron_have_a_place_and_a_remedy() {
    let files = Files::new();
    let sphere = "objects: [(shape: Sphere(radius: 1))]";
    let bad = [
        (format!("(\n settings: (frame_rate_hz: -60),\n {sphere})"), "s.ron:2:", "`frame_rate_hz`: -60.0 is not a rate from 0.1 to 100000 frames per second"),
        (format!("(\n\n settings: (widht: 3), {sphere})"), "s.ron:3:", "unknown field `widht`, did you mean `width`?"),
        (format!("(settings: (width: 0), {sphere})"), "s.ron:1:", "0 is not a number of pixels"),
        (format!("(settings: (frames: (3, 3)), {sphere})"), "s.ron:1:", "a range of frames"),
        (format!("(settings: (shutter: 1.5), {sphere})"), "s.ron:1:", "a fraction of the frame period"),
        (format!("(settings: (focus: 2), {sphere})"), "s.ron: settings", "there is no lens to focus"),
        ("(objects: [(shape: Spere(radius: 1))])".to_owned(), "s.ron:1:", "did you mean `Sphere`?"),
        ("(objects: [(shape: Sphere(radius: -1))])".to_owned(), "s.ron:1:", "`radius`: -1.0 is not a length above 0 and up to 1e15"),
        ("(objects: [\n (shape: Torus(ring: 1, tube: 1, segments: 100000))])".to_owned(), "s.ron:2:", "`segments`: 100000 is not a number of segments from 3 to 2048"),
        ("(objects: [(shape: Sphere(radius: 1), position: (0, nan, 0))])".to_owned(), "s.ron:1:", "`position`: `nan` is not a number"),
        ("(objects: [(shape: Sphere(radius: 1), position: (0, 1e300, 0))])".to_owned(), "s.ron:1:", "`position`: [0.0, 1e300, 0.0] is not three numbers from -1e15 to 1e15"),
        ("(objects: [])".to_owned(), "s.ron: objects", "add a `file` or a `shape`"),
        ("(objects: [(name: \"x\")])".to_owned(), "s.ron: object `x`", "either a `file` or a `shape`"),
        ("(objects: [(file: \"x.txt\")])".to_owned(), "s.ron: objects[0]", "it is no .gltf, .glb or .obj"),
        ("(objects: [(file: \"x.fbx\")])".to_owned(), "s.ron: objects[0]", "an FBX file, which is not read; convert it"),
        (format!("(camera: (position: (1, 1, 1), target: (1, 1, 1)), {sphere})"), "s.ron: camera", "coincide"),
        (format!("(camera: (position: (0, 0, 1), target: (0, 0, 0), view_height: 0), {sphere})"), "s.ron:1:", "a height above zero"),
        (format!("(camera: (position: (0, 0, 1), target: (0, 0, 0), view_height: -3), {sphere})"), "s.ron:1:", "a height above zero"),
        (format!("(camera: (position: (0, 0, 1), target: (0, 0, 0), view_height: 3, fov_deg: 40), {sphere})"), "s.ron: camera", "remove one of them"),
        (format!("(light: (toward: (0, 0, 0)), {sphere})"), "s.ron: light.toward", "no length"),
        ("(objects: [(shape: Sphere(radius: 1), spin: (axis: (0, 0, 0), rate_hz: 1))])".to_owned(), "spin", "needs a length"),
        ("(objects: [(shape: Sphere(radius: 1), keyframes: [(time_s: 1, position: (0, 0, 0)), (time_s: 0)])])".to_owned(), "keyframes", "lies before"),
    ];
    for (text, place, message) in bad {
        let error = load(files.put("s.ron", &text)).unwrap_err();
        assert!(error.is_usage(), "{error}");
        expect(&error.to_string(), &[place, message]);
    }
    let text = failure(load(files.put("s.ron", "(objects: [(file: \"gone.ply\")])")).unwrap_err());
    expect(&text, &["gone.ply: cannot read it"]);
}

#[test]
fn two_ends_of_different_topology_are_refused() {
    let files = Files::new();
    files.put("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    files.put("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 3 4\n");
    let text =
        failure(load(files.put("s.ron", "(objects: [(file: \"a.obj\", end: \"b.obj\")])")).unwrap_err());
    expect(&text, &["b.obj: end: its 4 vertices and 2 triangles", "equal topology"]);
}

#[test]
fn truncated_and_absurd_ply_files_are_failures() {
    let files = Files::new();
    let header = |vertices: &str| {
        format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    for (vertices, word) in
        [("3", "truncated"), ("99999999", "truncated"), ("4000000000", "up to 100000000 are taken")]
    {
        let mut bytes = header(vertices).into_bytes();
        bytes.extend([0; 20]);
        let text = failure(load(files.put("a.ply", bytes)).unwrap_err());
        expect(&text, &["a.ply: ", word]);
    }
    let index = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n3 0 0 7\n";
    let text = failure(load(files.put("a.ply", index)).unwrap_err());
    expect(&text, &["a.ply: geometry: triangle 0 uses vertex 7, but there are only 1"]);
    for (word, says) in [
        ("x", "a.ply: element vertex: Line 10"),
        ("nan", "a.ply: line 10: the coordinate `y` is `nan`, which is not finite"),
    ] {
        let bad = index.replace("0 0 0\n3", &format!("0 {word} 0\n3"));
        let text = failure(load(files.put("a.ply", bad)).unwrap_err());
        expect(&text, &[says]);
        assert!(!text.contains('\n'));
    }
    let mut nan = header("1").into_bytes();
    nan.extend([0.0, f32::NAN, 0.0].map(f32::to_le_bytes).concat());
    nan.extend([[3, 0, 0, 0], [0; 4], [0; 4], [0; 4]].concat());
    expect(&failure(load(files.put("a.ply", nan)).unwrap_err()), &["vertex 0 has a coordinate that is NaN"]);
}
