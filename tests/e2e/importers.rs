//! Scene files of other programs: materials, colours, formats, coordinates, and reports of ignored features.

use std::fs;

use crate::support::{Glb, Inputs, Refusals, Results, mean_where, number, quintile};
use image::{Rgb, RgbImage};
use serde_json::{Value, json};

const SMALL: [&str; 6] = ["--size", "64x48", "--frames", "0..1", "--samples", "4"];

fn run(path: &str, args: &[&str]) -> Results {
    quintile().run(path, &[&SMALL, args].concat())
}

fn is_red(pixel: &Rgb<u8>) -> bool {
    i32::from(pixel[0]) > i32::from(pixel[1]) + 60 && i32::from(pixel[0]) > i32::from(pixel[2]) + 60
}

fn is_blue(pixel: &Rgb<u8>) -> bool {
    i32::from(pixel[2]) > i32::from(pixel[0]) + 60 && i32::from(pixel[2]) > i32::from(pixel[1]) + 60
}

/// Asserts that the image is red on the left and blue on the right, each on more than one in `one_in` pixels.
fn assert_red_then_blue(image: &RgbImage, one_in: usize, what: &str) {
    let many =
        |is: fn(&Rgb<u8>) -> bool| image.pixels().filter(|p| is(p)).count() > image.pixels().len() / one_in;
    let [red, blue] = [is_red as fn(&Rgb<u8>) -> bool, is_blue].map(|is| (many(is), mean_where(image, is)));
    let ((true, Some(red)), (true, Some(blue))) = (red, blue) else { panic!("{what}: {red:?} {blue:?}") };
    assert!(red[0] + 10.0 < blue[0], "{what}: red at {red:?}, blue at {blue:?}");
}

/// Two squares side by side in the xy plane, `statements` before the first and before the second.
fn two_squares(head: &str, statements: [&str; 2]) -> String {
    let vertices = "v -1 0 0\nv 0 0 0\nv 0 1 0\nv -1 1 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    let [first, second] = statements;
    format!("{head}{vertices}{first}f 1/1 2/2 3/3 4/4\n{second}f 2/1 5/2 6/3 3/4\n")
}

#[test]
fn an_obj_file_is_drawn_in_the_materials_it_names() {
    let inputs = Inputs::new();
    let plain = "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n";
    inputs.put("plain.mtl", plain);
    let picture = RgbImage::from_pixel(2, 2, Rgb([0, 0, 255]));
    picture.save(inputs.path("blue.png")).expect("an image can be written");
    picture.save(inputs.path("blue.bmp")).expect("an image can be written");
    picture.save(inputs.path("blue.tga")).expect("an image can be written");
    for ending in ["png", "bmp", "tga"] {
        let text = format!("newmtl red\nKd 1 0 0\n\nnewmtl blue\nmap_Kd C:\\textures\\blue.{ending}\n");
        inputs.put(&format!("{ending}.mtl"), text);
    }
    for library in ["plain", "png", "bmp", "tga"] {
        let text = two_squares(&format!("mtllib {library}.mtl\n"), ["usemtl red\n", "usemtl blue\n"]);
        let results = run(&inputs.put("a.obj", text), &[]);
        assert_red_then_blue(&results.image(0), 8, library);
        assert!(!results.warning_codes().iter().any(|code| code.starts_with("missing")), "{library}");
    }
    let gone = two_squares("mtllib gone.mtl\n", ["usemtl red\n", "usemtl blue\n"]);
    let results = run(&inputs.put("a.obj", gone), &[]);
    assert!(results.ended.stderr.contains("gone.mtl"), "{}", results.ended.stderr);
    assert!(results.warning_codes().contains(&"missing-material".to_owned()));
    inputs.put("red.mtl", "newmtl red\nmap_Kd gone.png\n");
    let unknown = two_squares("mtllib red.mtl\n", ["usemtl red\n", "usemtl blue\n"]);
    let results = run(&inputs.put("a.obj", unknown), &[]);
    assert!(["gone.png", "`blue`"].iter().all(|name| results.ended.stderr.contains(name)));
}

/// A square, its left corners red and its right ones blue, in every format that holds colours.
#[test]
fn vertex_colours_are_drawn() {
    let corners = [[0, 0], [1, 0], [1, 1], [0, 1]];
    let colour = |x: i32| [1 - x, 0, x];
    let line = |scale: i32| {
        move |[x, y]: &[i32; 2]| {
            let [r, g, b] = colour(*x).map(|channel| channel * scale);
            format!("{x} {y} 0 {r} {g} {b}\n")
        }
    };
    let lines = |scale: i32| corners.iter().map(line(scale)).collect::<String>();
    let properties: String = ["x", "y", "z"].map(|name| format!("property float {name}\n")).concat()
        + &["red", "green", "blue"].map(|name| format!("property uchar {name}\n")).concat();
    let faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let ply =
        format!("ply\nformat ascii 1.0\nelement vertex 4\n{properties}{faces}{}4 0 1 2 3\n", lines(255));
    let obj =
        |scale| lines(scale).lines().map(|line| format!("v {line}\n")).collect::<String>() + "f 1 2 3 4\n";
    let off = format!("COFF\n4 1 0\n{}4 0 1 2 3\n", lines(255));
    let mut glb = Glb::square();
    let rgba: Vec<f32> = corners
        .iter()
        .flat_map(|[x, _]| [colour(*x).map(|c| c as f32).to_vec(), vec![1.0]].concat())
        .collect();
    let colours = glb.floats(&rgba, 4);
    glb.primitive()["attributes"]["COLOR_0"] = json!(colours);
    let inputs = Inputs::new();
    let files = [
        inputs.put("a.ply", ply),
        inputs.put("a.obj", obj(1)),
        inputs.put("b.obj", obj(255)),
        inputs.put("a.off", off),
        inputs.put("a.glb", glb.bytes()),
    ];
    let images = files.map(|path| {
        let image = run(&path, &[]).image(0);
        // Most pixels of a gradient are neither red nor blue.
        assert_red_then_blue(&image, 24, &path);
        image
    });
    assert!(images.iter().all(|image| *image == images[0]), "formats differ");
}

fn counts(results: &Results) -> Value {
    results.summary()["counts"].clone()
}

#[test]
fn vertex_colours_are_counted_unless_white() {
    let inputs = Inputs::new();
    let with = |name: &str, colour: Option<[f32; 4]>| {
        let mut glb = Glb::square();
        if let Some(colour) = colour {
            let colours = glb.floats(&[colour; 4].concat(), 4);
            glb.primitive()["attributes"]["COLOR_0"] = json!(colours);
        }
        run(&inputs.put(name, glb.bytes()), &[])
    };
    let plain = with("plain.glb", None);
    let white = with("white.glb", Some([1.0; 4]));
    let grey = with("grey.glb", Some([0.5, 0.5, 0.5, 1.0]));
    assert_eq!(counts(&plain), counts(&white));
    assert_eq!(plain.image(0), white.image(0));
    let of = |results: &Results, name: &str| number(&counts(results), &format!("/{name}"));
    let pixels = of(&plain, "pixel_invocations");
    assert_eq!(of(&grey, "shader_ops"), of(&plain, "shader_ops") + 3.0 * pixels);
    let fetched = of(&plain, "vertices_fetched");
    assert_eq!(of(&grey, "vertex_bytes"), of(&plain, "vertex_bytes") + 12.0 * fetched);
}

/// A square with all ignored features, on three primitives and three nodes.
fn demanding() -> Glb {
    let mut glb = Glb::square();
    glb.texture_coordinates();
    glb.json["images"] = json!([{"uri": format!("data:image/png;base64,{PIXEL}")}]);
    glb.json["textures"] = json!([{"source": 0}]);
    let map = json!({"index": 0});
    let material = |name: &str| {
        json!({"name": name, "normalTexture": map, "occlusionTexture": map, "emissiveFactor": [1, 1, 1], "alphaMode": "BLEND",
               "pbrMetallicRoughness": {"metallicFactor": 1, "baseColorFactor": [1, 1, 1, 0.5]}})
    };
    glb.json["materials"] = json!([material("one"), material("two"), material("three"), material("unused")]);
    let primitive = |index: usize| json!({"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": index});
    glb.json["meshes"] = json!([{"primitives": [primitive(0), primitive(1), primitive(2)]}]);
    let faint = glb.floats(&[1.0, 1.0, 1.0, 0.5].repeat(4), 4);
    for index in 0..3 {
        glb.json["meshes"][0]["primitives"][index]["attributes"]["COLOR_0"] = json!(faint);
    }
    let lamp = |light: usize| json!({"extensions": {"KHR_lights_punctual": {"light": light}}});
    glb.json["nodes"] = json!([{"mesh": 0, "children": [1, 2, 3]}, lamp(0), lamp(0), lamp(0)]);
    let lights = json!([{"type": "point", "intensity": 10}, {"type": "spot", "spot": {}, "intensity": 0}]);
    glb.json["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
    glb.json["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_materials_clearcoat"]);
    glb
}

/// A PNG of one grey pixel.
const PIXEL: &str =
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGNoAAAAggCBd81ytgAAAABJRU5ErkJggg==";

#[test]
fn ignored_features_give_one_line_per_kind_with_a_count() {
    let inputs = Inputs::new();
    let results = run(&inputs.put("a.glb", demanding().bytes()), &[]);
    let kinds = [
        ("alpha-ignored", 3, "3 materials with opacities of vertices"),
        ("emissive-ignored", 3, "3 emissive materials"),
        ("extension-ignored", 1, "1 extension ignored"),
        ("light-ignored", 3, "3 point lights ignored"),
        ("metallic-ignored", 3, "3 metallic materials"),
        ("normal-map-ignored", 3, "3 normal maps ignored"),
        ("occlusion-map-ignored", 3, "3 occlusion maps ignored"),
    ];
    let summary = results.summary();
    let warnings: Vec<&Value> = summary["warnings"].as_array().expect("a list").iter().collect();
    for (code, count, says) in kinds {
        let all: Vec<_> = warnings.iter().filter(|warning| warning["code"] == code).collect();
        assert_eq!(all.len(), 1, "{code}: {all:?}");
        assert_eq!(all[0]["count"], count, "{code}");
        assert_eq!(all[0]["details"].as_array().map(Vec::len), Some(count as usize), "{code}");
        assert!(all[0]["message"].as_str().is_some_and(|message| message.starts_with(says)), "{:?}", all[0]);
        let lines = results.ended.stderr.lines().filter(|line| line.contains(code)).count();
        assert_eq!(lines, 1, "{}", results.ended.stderr);
    }
    assert!(results.ended.stderr.contains("KHR_materials_clearcoat"), "{}", results.ended.stderr);
    let details = run(&inputs.path("a.glb"), &["--verbose"]).ended.stderr;
    let lines = ["detail: node 1", "detail: node 2", "detail: node 3", "detail: material `two`"];
    assert!(lines.iter().all(|detail| details.lines().any(|line| line == *detail)), "{details}");
    assert!(!summary.to_string().contains("unused"));
}

#[test]
fn features_without_effect_are_not_reported() {
    let mut glb = demanding();
    let map = json!({"index": 0});
    let strengthless = json!({"index": 0, "strength": 0});
    for material in glb.json["materials"].as_array_mut().expect("a list") {
        *material = json!({"occlusionTexture": strengthless, "emissiveTexture": map, "emissiveFactor": [0, 0, 0],
                           "alphaMode": "BLEND", "pbrMetallicRoughness": {"metallicFactor": 0}});
    }
    glb.json["extensions"]["KHR_lights_punctual"]["lights"][0]["intensity"] = json!(0);
    glb.json["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_xmp_json_ld"]);
    let white = glb.floats(&[1.0; 16], 4);
    for index in 0..3 {
        glb.json["meshes"][0]["primitives"][index]["attributes"]["COLOR_0"] = json!(white);
    }
    let inputs = Inputs::new();
    let codes = run(&inputs.put("a.glb", glb.bytes()), &[]).warning_codes();
    assert!(!codes.iter().any(|code| code.contains("ignored")), "{codes:?}");
}

/// A red pane before a wall: opaque, blended or with holes, in a scene file and in an OBJ file.
#[test]
fn opacity_shows_what_is_behind() {
    let inputs = Inputs::new();
    let pane = |material: &str| {
        let plane = "rotation_deg: (90, 0, 0), shape: Plane(size: 2, cells: 1, tiles: 1)";
        let pane =
            format!("({plane}, position: (0, 0, 1), material: (color: (1, 0, 0), unlit: true, {material}))");
        let wall = format!(
            "({plane}, position: (0, 0, 0), scale: (4, 4, 4), material: (color: (0, 0, 1), unlit: true))"
        );
        format!(
            "(camera: (position: (0, 0, 5), target: (0, 0, 0)), settings: (width: 32, height: 32, samples: 1, frames: (0, 1)), \
              objects: [{pane}, {wall}])"
        )
    };
    let middle = |material: &str| {
        let results = run(&inputs.put("a.ron", pane(material)), &[]);
        let image = results.image(0);
        (image.get_pixel(32, 24).0, counts(&results))
    };
    let of = |counts: &Value, event: &str| number(counts, &format!("/{event}"));
    let (red, opaque) = middle("");
    assert_eq!((red, of(&opaque, "samples_blended")), ([255, 0, 0], 0.0));
    let (violet, blended) = middle("opacity: 0.5");
    assert_eq!(violet, [188, 0, 188], "half the light of each");
    assert!(of(&blended, "samples_blended") > 50.0, "{blended}");
    assert!(of(&blended, "shader_ops") > of(&opaque, "shader_ops"));
    let (hole, cut) = middle("opacity: 0.25, alpha: CutOut(cutoff: 0.5)");
    assert_eq!((hole, of(&cut, "samples_blended")), ([0, 0, 255], 0.0));
}

/// User clip planes: an object that is drawn in one half of the shutter has half of the samples.
#[test]
fn an_object_may_be_drawn_in_a_part_of_the_shutter() {
    let inputs = Inputs::new();
    let scene = |visible: &str| {
        let plane = "rotation_deg: (90, 0, 0), scale: (9, 9, 9), shape: Plane(size: 2, cells: 1, tiles: 1)";
        format!(
            "(camera: (position: (0, 0, 5), target: (0, 0, 0)), background: (0, 0, 0), objects: [({plane}, {visible} material: \
              (color: (1, 1, 1), unlit: true))], settings: (width: 16, height: 16, samples: 16, frames: (0, 1)))"
        )
    };
    let level = |visible: &str| run(&inputs.put("a.ron", scene(visible)), &[]).image(0).get_pixel(8, 8).0[0];
    // Half the light is 188 of 255 in sRGB.
    assert_eq!(
        [level(""), level("visible: (t: (0, 0.5)),"), level("visible: (t: (0.5, 1)),")],
        [255, 188, 188]
    );
    assert_eq!(level("visible: (u: (-1, 1), t: (0, 1)),"), 255);
    let ended = quintile().call(["run", &inputs.put("b.ron", scene("visible: (t: (0.5, 0.2)),"))]);
    assert_eq!(ended.code, Some(2));
    let says = ["b.ron:1:", "a range within 0 and 1, the lower end first"];
    assert!(says.iter().all(|says| ended.stderr.contains(says)), "{}", ended.stderr);
}

#[test]
fn a_material_from_a_scene_file_replaces_all_that_the_file_would_be_reported_for() {
    let inputs = Inputs::new();
    inputs.put("a.glb", demanding().bytes());
    inputs.put("a.obj", two_squares("mtllib gone.mtl\n", ["usemtl red\n", "usemtl blue\n"]));
    for file in ["a.glb", "a.obj"] {
        let scene = format!("(objects: [(file: {file:?}, material: (color: (1, 0, 0)))])");
        let codes = run(&inputs.put("s.ron", scene), &[]).warning_codes();
        let materials = ["alpha", "emissive", "metallic", "normal", "occlusion", "missing"];
        assert!(
            !codes.iter().any(|code| materials.iter().any(|kind| code.contains(kind))),
            "{file}: {codes:?}"
        );
    }
}

/// The same square as OFF and as STL of both kinds, against that of an OBJ file.
#[test]
fn off_and_stl_files_are_drawn() {
    let off = "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
    let obj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
    let triangles = [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]];
    let corner = |[x, y, z]: &[i32; 3]| format!("vertex {x} {y} {z}\n");
    let facet = |corners: &[[i32; 3]; 3]| {
        let corners: String = corners.iter().map(corner).collect();
        format!("facet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\n")
    };
    let ascii = format!("solid square\n{}endsolid square\n", triangles.iter().map(facet).collect::<String>());
    let mut binary = vec![b' '; 80];
    binary.extend(2_u32.to_le_bytes());
    for triangle in &triangles {
        binary.extend([0; 12]);
        binary.extend(triangle.as_flattened().iter().flat_map(|&value| (value as f32).to_le_bytes()));
        binary.extend([0; 2]);
    }
    let inputs = Inputs::new();
    let image = |name: &str, bytes: &[u8]| run(&inputs.put(name, bytes), &[]).image(0);
    let expected = image("a.obj", obj.as_bytes());
    assert!(expected.pixels().any(|pixel| pixel != expected.get_pixel(0, 0)), "nothing is drawn");
    assert_eq!(image("a.off", off.as_bytes()), expected);
    assert_eq!(image("a.stl", ascii.as_bytes()), expected);
    assert_eq!(image("B.STL", &binary), expected);
    inputs.put("a.stl", &binary);
    let scene = inputs.put("s.ron", "(objects: [(file: \"a.stl\"), (file: \"a.off\", position: (2, 0, 0))])");
    assert_eq!(run(&scene, &[]).summary()["settings"]["triangles"], 4);
    let visibility = quintile().call(["visibility", &inputs.path("a.stl")]);
    assert_eq!(visibility.code, Some(0), "{}", visibility.stderr);
}

#[test]
fn other_formats_are_refused_with_a_remedy() {
    let inputs = Inputs::new();
    let mut refusals = Refusals::default();
    for (name, what) in [
        ("car.fbx", "an FBX file"),
        ("car.usdz", "a USD file"),
        ("car.3ds", "a 3DS file"),
        ("car.DAE", "a COLLADA file"),
        ("car.blend", "a Blender file"),
    ] {
        let says = [name, what, "File > Export > glTF 2.0"];
        let remedy = "convert it to glTF";
        refusals.call(&[&inputs.put(name, "x")], 2, &says, remedy);
        let scene = inputs.put("s.ron", format!("(objects: [(file: {name:?})])"));
        refusals.call(&[&scene], 2, &says, remedy);
    }
    refusals.call(
        &[&inputs.put("notes.txt", "x")],
        2,
        &["notes.txt: its ending is not one of a scene file"],
        "give a .ron, .gltf",
    );
    refusals.call(
        &[&inputs.put("bare", "x")],
        2,
        &["bare: its ending is not one of a scene file"],
        "give a .ron, .gltf",
    );
    let folder = inputs.path("folder");
    fs::create_dir(&folder).expect("a folder can be made");
    refusals.call(&[&folder], 2, &["folder: it is a folder"], "give a .ron, .gltf");
    refusals.done();
}

/// A patch of 1 m with bumps, its middle at `x` and `z`; every coordinate is a multiple of 1/64.
fn patch(x: f64, z: f64) -> String {
    const SIDE: i32 = 9;
    let mut text = String::new();
    for (row, column) in (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| (row, column))) {
        let height = f64::from((row * 7 + column * 5) % 9 - 4) / 64.0;
        let [dx, dz] = [column, row].map(|step| f64::from(step - SIDE / 2) / 8.0);
        text += &format!("v {} {height} {}\n", x + dx, z + dz);
    }
    for (row, column) in (1..SIDE).flat_map(|row| (1..SIDE).map(move |column| (row, column))) {
        let at = row * SIDE + column + 1;
        text += &format!("f {at} {} {} {}\n", at - SIDE, at - SIDE - 1, at - 1);
    }
    text
}

const UTM: [f64; 2] = [500_000.0, 4_000_000.0];

#[test]
fn a_patch_far_from_the_origin_draws_the_same_picture_as_at_it() {
    let inputs = Inputs::new();
    inputs.put("near.obj", patch(0.0, 0.0));
    inputs.put("far.obj", patch(UTM[0], UTM[1]));
    let image = |path: &str| run(&inputs.path(path), &["--lens", "0.01"]).image(0);
    assert_eq!(image("near.obj"), image("far.obj"));
    // A camera and a moving object in the coordinates of the file.
    for (file, [x, z]) in [("near", [0.0, 0.0]), ("far", UTM)] {
        let camera = format!("camera: (position: ({}, 1, {}), target: ({x}, 0, {z}))", x + 0.5, z + 1.5);
        let objects = format!("(file: \"{file}.obj\", velocity: (4, 0, 0))");
        inputs.put(&format!("{file}.ron"), format!("({camera}, objects: [{objects}])"));
    }
    assert_eq!(image("near.ron"), image("far.ron"));
    // A node of a glTF scene is as far away.
    let glb = |name: &str, [x, z]: [f64; 2]| {
        let mut glb = Glb::square();
        glb.json["nodes"][0]["translation"] = json!([x - 0.5, -0.5, z]);
        inputs.put(name, glb.bytes());
    };
    glb("near.glb", [0.0, 0.0]);
    glb("far.glb", UTM);
    assert_eq!(image("near.glb"), image("far.glb"));
    let results = run(&inputs.path("far.obj"), &[]);
    let reported = results.ended.stderr.lines().filter(|line| line.contains("coordinates-recentred")).count();
    assert!(
        reported == 1 && results.ended.stderr.contains("(500000, 0, 4000000)"),
        "{}",
        results.ended.stderr
    );
    assert!(
        !run(&inputs.path("near.obj"), &[]).warning_codes().iter().any(|code| code.contains("coordinates"))
    );
}

#[test]
fn a_file_whose_numbers_are_too_coarse_for_its_shape_is_reported() {
    let inputs = Inputs::new();
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]: [f32; 2]| [x + 4e6, y, 0.0]);
    let glb = inputs.put("far.glb", Glb::with_positions(&corners).bytes());
    let header = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let ply = |kind: &str| {
        let properties = ["x", "y", "z"].map(|name| format!("property {kind} {name}\n")).concat();
        let vertices = corners.map(|[x, y, z]| format!("{x} {y} {z}\n")).concat();
        format!("ply\nformat ascii 1.0\nelement vertex 4\n{properties}{header}{vertices}4 0 1 2 3\n")
    };
    for path in [glb, inputs.put("single.ply", ply("float"))] {
        let results = run(&path, &[]);
        assert!(results.warning_codes().contains(&"coordinates-far-from-origin".to_owned()), "{path}");
    }
    let codes = run(&inputs.put("double.ply", ply("double")), &[]).warning_codes();
    assert!(!codes.contains(&"coordinates-far-from-origin".to_owned()), "{codes:?}");
}

#[test]
fn a_byte_order_mark_is_skipped() {
    let inputs = Inputs::new();
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 5 5 5\nf 1 2 3 4\n";
    let off = "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
    let scene = "(objects: [(file: \"a.obj\")])";
    for (name, text) in [("a.obj", square), ("a.off", off), ("a.ron", scene)] {
        let image = |text: String| run(&inputs.put(name, text), &[]).image(0);
        assert_eq!(image(format!("\u{feff}{text}")), image(text.to_owned()), "{name}");
    }
}
