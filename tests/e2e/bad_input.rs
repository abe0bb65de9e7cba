//! Bad input: one message with file, place and remedy. Exit code 2; no panic.

use std::fs;

use crate::support::{Glb, Inputs, Refusals, mts, quintile, real_scene};
use serde_json::json;

#[test]
fn flags() {
    let mut refusals = Refusals::default();
    let cases: [(&[&str], &[&str], &str); 31] = [
        (
            &["--size", "0x48"],
            &["size", "0x48", "1 to 16384 pixels"],
            "write it as 1280x720, each side 1 to 16384 pixels",
        ),
        (&["--size", "64x0"], &["size", "64x0"], "write it as 1280x720, each side 1 to 16384 pixels"),
        (
            &["--size", "99999x99999"],
            &["size", "99999x99999"],
            "write it as 1280x720, each side 1 to 16384 pixels",
        ),
        (&["--size", "1280"], &["--size", "1280x720"], "write it as 1280x720, each side 1 to 16384 pixels"),
        (&["--size", "4294967297x1"], &["--size"], "write it as 1280x720, each side 1 to 16384 pixels"),
        (&["--frames", "3..3"], &["frames", "3..3", "empty"], "one frame is 3..4"),
        (&["--frames", "5..2"], &["frames", "5..2", "empty"], "one frame is 5..6"),
        (&["--frames", "0-4"], &["--frames", "0..36"], "write it as 0..36"),
        (&["--frames", "0..4294967295"], &["frames", "10000000"], "frames go up to 10000000"),
        (&["--frames", "0..99999999999"], &["--frames"], "write it as 0..36"),
        (&["--samples", "0"], &["samples", "1 to 256"], "it has to be 1 to 256"),
        (&["--samples", "257"], &["samples", "1 to 256"], "it has to be 1 to 256"),
        (&["--samples", "many"], &["--samples", "many"], "it has to be 1 to 256"),
        (&["--lens", "-1"], &["lens", "-1"], "it has to be a finite number of at least 0"),
        (&["--lens", "NaN"], &["lens", "NaN"], "it has to be a finite number of at least 0"),
        (&["--focus", "0"], &["focus", "above zero"], "it has to be a finite number above zero"),
        (&["--focus", "inf"], &["focus", "finite"], "it has to be a finite number above zero"),
        (
            &["--lens", "0", "--focus", "3"],
            &["focus", "no lens"],
            "give a lens radius above zero, too, or leave it out",
        ),
        (&["--shutter", "1.5"], &["shutter", "0 to 1"], "it has to be 0 to 1"),
        (&["--shutter", "-0.5"], &["shutter", "0 to 1"], "it has to be 0 to 1"),
        (&["--threads", "0"], &["--threads", "1..=1024"], "1..=1024"),
        (&["--threads", "99999"], &["--threads", "1..=1024"], "1..=1024"),
        (&["--clip", "Run"], &["clip", "Run"], "leave it out"),
        (
            &["--trace-rate", "-5"],
            &["--trace-rate", "`-5` is not a rate above 0"],
            "for example 50kHz or 1MHz",
        ),
        (&["--trace-rate", "1mhz"], &["--trace-rate", "50kHz or 1MHz"], "for example 50kHz or 1MHz"),
        (&["--rate", "0"], &["--rate", "`0` is not a rate above 0"], "for example 50kHz or 1MHz"),
        (
            &["--lens=-1"],
            &["--lens", "finite number of at least 0"],
            "it has to be a finite number of at least 0",
        ),
        (&["--lens", "2mm"], &["--lens", "in scene units"], "it has to be a finite number of at least 0"),
        (&["--trace-rate", "0.001"], &["trace rate"], "takes 1 to 1e7 samples a second"),
        (&["--nonsense"], &["--nonsense"], "try '--help'"),
        (&["--bound", "highest"], &["--bound", "low, nominal, high"], "possible values: low, nominal, high"),
    ];
    for (flags, says, remedy) in cases {
        refusals.call(&[&["tiny"], flags].concat(), 2, says, remedy);
    }
    refusals.done();
}

#[test]
fn flags_without_effect_on_a_workload_are_refused() {
    let mut refusals = Refusals::default();
    let cases: [(&[&str], &[&str], &str); 6] = [
        (
            &["compute", "--set", "bins=64"],
            &["`light_culling`", "`bins`"],
            "it needs kernel=histogram, or leave it out",
        ),
        (&["occlusion", "--lens", "0.3"], &["--lens", "`occlusion`"], "give --set lens=... instead"),
        (&["ccd", "--samples", "8"], &["--samples", "`ccd`"], "leave it out"),
        (&["ccd", "--size", "64x64"], &["--size", "`ccd`"], "give --set resolution=... instead"),
        (&["caustics", "--focus", "3"], &["--focus", "`caustics`"], "leave it out"),
        (&["multiview", "--lens", "0.5"], &["--lens", "`multiview`"], "give --set aperture=... instead"),
    ];
    for (args, says, remedy) in cases {
        refusals.call(args, 2, says, remedy);
    }
    refusals.done();
}

#[test]
fn files_without_triangles_are_refused_by_ccd() {
    let mut refusals = Refusals::default();
    let inputs = Inputs::new();
    let empty = inputs.put("empty.mts", mts(&[]));
    refusals.call(
        &["ccd", "--set", &format!("file={empty}")],
        2,
        &[&empty, "holds no objects"],
        "give another file",
    );
    for name in ["a.ply", "a.obj", "a.txt"] {
        let file = inputs.put(name, "nothing");
        refusals.call(
            &["ccd", "--set", &format!("file={file}")],
            2,
            &[&file, "is not an .mts file"],
            "use `quintile ccd`",
        );
    }
    refusals.done();
}

#[test]
fn invalid_frame_rates() {
    let mut refusals = Refusals::default();
    for rate in ["-60", "0", "NaN"] {
        refusals.call(&["tiny", "--rate", rate], 2, &["--rate", rate], "for example 50kHz or 1MHz");
    }
    for rate in ["1e9", "1e-9"] {
        refusals.call(
            &["tiny", "--rate", rate],
            2,
            &["frame_rate_hz", rate],
            "has to be 0.001 to 1000000 frames per second",
        );
    }
    refusals.done();
}

#[test]
fn unknown_names() {
    let mut refusals = Refusals::default();
    refusals.call(&["tinny"], 2, &["tinny"], "did you mean `tiny`?");
    refusals.call(&["samplng"], 2, &["samplng", "workloads: caustics, ccd, "], "did you mean `sampling`?");
    refusals.call(
        &["wibble-wobble"],
        2,
        &["wibble-wobble"],
        "built in: default, tiny; workloads: caustics, ccd, ",
    );
    refusals.call(&["scene.blend"], 2, &["scene.blend"], "convert it to glTF");
    refusals.call(&[""], 2, &["SCENE|WORKLOAD|FILE"], "try '--help'");
    refusals.call(&["."], 2, &[".: it is a folder"], "give a .ron, .gltf");
    refusals.call(&["tiny", "--gpu", "referense"], 2, &["referense"], "did you mean `reference`?");
    refusals.call(&["tiny", "--platform", "referense"], 2, &["referense"], "did you mean `reference`?");
    refusals.call(&["tiny", "--energy", "28mm"], 2, &["28mm"], "did you mean `28nm`?");
    refusals.call(&["tiny", "--gpu", "nothing.like.it"], 2, &["nothing.like.it"], "known: reference, mobile");
    refusals.done();
}

#[test]
fn missing_files() {
    let mut refusals = Refusals::default();
    for scene in ["gone.glb", "gone.gltf", "gone.ron", "gone.ply", "gone.ply.gz", "gone.obj"] {
        refusals.call(&[scene], 2, &[scene, "No such file"], "check the path");
    }
    for flag in ["--gpu", "--platform", "--energy"] {
        refusals.call(&["tiny", flag, "gone.ron"], 2, &["gone.ron", "No such file"], "check the path");
    }
    let inputs = Inputs::new();
    let folder = inputs.path("folder.glb");
    fs::create_dir(&folder).expect("a folder can be made");
    refusals.call(&[&folder], 2, &[&folder, "directory"], "give the path of a .ron, .gltf");
    let scene = inputs.put("s.ron", "(objects: [(file: \"gone.obj\")])");
    refusals.call(
        &[&scene],
        2,
        &["s.ron:1:19: ", "gone.obj: cannot read it: No such file"],
        "check the path",
    );
    let cut = inputs.put("cut.ron", "(\n  objects: [\n    (shape: ");
    refusals.call(&[&cut], 2, &["cut.ron:3:12: the file ends early"], "add what is missing");
    refusals.done();
}

#[cfg(unix)]
#[test]
fn names_that_are_not_unicode() {
    let mut refusals = Refusals::default();
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let name = OsStr::from_bytes(b"sc\xffene.glb");
    let ended = quintile().call([OsStr::new("run"), name]);
    refusals.check(&ended, 2, &["ene.glb: cannot read it"], "check the path");
    refusals.done();
}

#[test]
fn truncated_glb_files() {
    let mut refusals = Refusals::default();
    let whole = Glb::square().bytes();
    for length in [4, 11, 12, 19, 40, whole.len() / 2, whole.len() - 60, whole.len() - 1] {
        refusals.file("cut.glb", &whole[..length], 2, &["truncated"], "get the file again");
    }
    refusals.file("empty.glb", b"", 2, &["not a glTF 2.0 file"], "export it again");
    refusals.done();
}

#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn a_truncated_real_glb_file() {
    let bytes = fs::read(real_scene("Fox.glb")).expect("the fox is there");
    let mut refusals = Refusals::default();
    refusals.file("fox.glb", &bytes[..bytes.len() / 3], 2, &["truncated"], "get the file again");
    refusals.done();
}

#[test]
fn indices_out_of_range() {
    let mut refusals = Refusals::default();
    let mut glb = Glb::square();
    let indices = glb.binary.len() - 2;
    glb.binary[indices] = 77;
    refusals.file("index.glb", glb.bytes(), 2, &["meshes[0].primitives[0]", "77"], "export it again");
    let mut glb = Glb::square();
    glb.primitive()["indices"] = json!(9);
    refusals.file(
        "accessor.glb",
        glb.bytes(),
        2,
        &["meshes[0].primitives[0].indices", "out of range"],
        "export it again",
    );
    let mut glb = Glb::square();
    glb.json["accessors"][0]["count"] = json!(4_000_000_000u32);
    refusals.file("count.glb", glb.bytes(), 2, &["accessor 0", "4000000000"], "export it again");
    let mut glb = Glb::square();
    glb.json["bufferViews"][0]["byteLength"] = json!(u64::from(u32::MAX));
    refusals.file("view.glb", glb.bytes(), 2, &["buffer view 0"], "export it again");
    refusals.file(
        "a.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
        2,
        &["line 4: a face uses vertex 9"],
        "fix the file",
    );
    refusals.file(
        "a.ply",
        ply("3", "0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n"),
        2,
        &["triangle 0", "vertex 9"],
        "fix the file",
    );
    refusals.done();
}

/// ASCII PLY file with one face and this number of vertices.
fn ply(vertices: &str, body: &str) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         element face 1\nproperty list uchar int vertex_indices\nend_header\n{body}"
    )
}

#[test]
fn vertices_that_are_not_finite() {
    let mut refusals = Refusals::default();
    for (bad, word) in [(f32::NAN, "NaN"), (f32::INFINITY, "infinite")] {
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, bad, 0.0], [0.0, 1.0, 0.0]];
        let glb = Glb::with_positions(&corners);
        refusals.file(
            "nan.glb",
            glb.bytes(),
            2,
            &["meshes[0].primitives[0]", "vertex 2", word],
            "export it again",
        );
    }
    refusals.file(
        "nan.obj",
        "v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n",
        2,
        &["line 2: a coordinate that is NaN"],
        "fix the file",
    );
    refusals.file(
        "nan.ply",
        ply("3", "0 0 0\n1 x 0\n0 1 0\n3 0 1 2\n"),
        2,
        &["element vertex", "Line 11"],
        "get it again",
    );
    for bad in ["nan", "-inf"] {
        let body = format!("0 0 0\n1 {bad} 0\n0 1 0\n3 0 1 2\n");
        refusals.file(
            "nan.ply",
            ply("3", &body),
            2,
            &["line 11: the coordinate `y`", bad, "not finite"],
            "fix the file",
        );
    }
    refusals.done();
}

#[test]
fn geometry_files_of_another_format() {
    let mut refusals = Refusals::default();
    let gltf = ("not a glTF 2.0 file", "export it again");
    let ply_file = ("not a PLY file", "export it again as a PLY file of vertices and faces");
    let obj = ("it has no triangles", "name another file, or export it with its surfaces as triangles");
    let names = ["a.glb", "a.gltf", "a.ply", "a.obj", "a.ply.gz", "a.obj.gz"];
    for (name, (says, remedy)) in names.into_iter().zip([gltf, gltf, ply_file, obj, ply_file, obj]) {
        refusals.file(name, b"\x89PNG\r\n\x1a\n\0\0\xff\xfe no geometry", 2, &[says], remedy);
        refusals.file(name, b"", 2, &[says], remedy);
    }
    refusals.file("a.ply", ply("4000000000", ""), 2, &["header", "4000000000"], "up to 100000000 are taken");
    refusals.file("a.ply", ply("3", "0 0 0\n1 0 0\n"), 2, &["element vertex", "truncated"], "get it again");
    let mut glb = Glb::square();
    glb.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    refusals.file("draco.glb", glb.bytes(), 2, &["KHR_draco_mesh_compression"], "export it without");
    refusals.done();
}

#[test]
fn empty_scenes() {
    let mut refusals = Refusals::default();
    refusals.file("a.ron", "(objects: [])", 2, &["objects"], "add a `file` or a `shape`");
    refusals.file("a.obj", "v 0 0 0\n", 2, &["it has no triangles"], "name another file");
    let mut glb = Glb::square();
    glb.json["nodes"] = json!([{}]);
    refusals.file("a.glb", glb.bytes(), 2, &["it has no triangles"], "name another file");
    refusals.done();
}

#[test]
fn invalid_scene_files() {
    let mut refusals = Refusals::default();
    let sphere = "objects: [(shape: Sphere(radius: 1))]";
    let cases = [
        (format!("(\n  settings: (widht: 640),\n  {sphere})"), ":2:", "did you mean `width`?"),
        (format!("(\n\n  settings: (width: 0), {sphere})"), ":3:", "from 1 to 16384"),
        (format!("(settings: (frame_rate_hz: -60), {sphere})"), ":1:28:", "0.1 to 100000 frames per second"),
        (format!("(settings: (shutter: -1), {sphere})"), ":1:", "from 0 to 1"),
        (format!("(settings: (samples: 0), {sphere})"), ":1:", "from 1 to 256"),
        (format!("(settings: (frames: (4, 4)), {sphere})"), ":1:", "give the first, and one after the last"),
        ("(objects: [(shape: Spere(radius: 1))])".to_owned(), ":1:", "did you mean `Sphere`?"),
        ("(objects: [(shape: Sphere(radius: NaN))])".to_owned(), ":1:35:", "a length above 0 and up to 1e15"),
        (
            format!("(camera: (position: (0, 0, 0), target: (0, 0, 0)), {sphere})"),
            "camera.target",
            "move one of them",
        ),
        ("(".to_owned(), ":1:", "the file ends early: add what is missing"),
        (String::new(), ":1:", "the file ends early: add what is missing"),
    ];
    for (text, place, remedy) in cases {
        refusals.file("scene.ron", text, 2, &[place], remedy);
    }
    refusals.file(
        "scene.ron",
        b"(\xff\xfe)",
        2,
        &["did not contain valid UTF-8"],
        "check the path, and that it is a text file in UTF-8",
    );
    refusals.done();
}

#[test]
fn invalid_gpu_and_platform_files() {
    let mut refusals = Refusals::default();
    let source =
        |path: &str| fs::read_to_string(crate::support::root().join(path)).expect("a file of the repository");
    let gpu = source("sim/run/gpus/reference.ron");
    let platform = source("power-model/platforms/reference.ron");
    let table = source("power-model/tables/28nm.ron");
    let (hertz, range) = ("has to be 1e6 to 1e11 hertz", "give one in that range");
    let cases = [
        (
            "--gpu",
            gpu,
            vec![
                ("tile_px: 8", "tile_sise: 8", "`tile_sise`", "did you mean `tile_px`?"),
                ("core_hz: 400e6", "core_hz: -400e6", "`core_hz` is -400000000", hertz),
                ("core_hz: 400e6", "core_hz: NaN", "`core_hz` is NaN", hertz),
                ("queue: 32", "queue: 0", "`queue`: 0", "it has to be 1 to 65536"),
            ],
        ),
        (
            "--platform",
            platform,
            vec![
                ("idle_w:", "idel_w:", "`idel_w`", "did you mean `idle_w`?"),
                ("constant_w: Assumed(0.80", "constant_w: Assumed(-0.80", "`constant_w`: -0.8 W", range),
            ],
        ),
        (
            "--energy",
            table,
            vec![
                ("low_pj: 100,", "low_pj: -100,", "`low_pj`: -100 pJ", range),
                ("node_nm: 28", "node_mn: 28", "`node_mn`", "did you mean `node_nm`?"),
            ],
        ),
    ];
    for (flag, text, edits) in cases {
        for (right, wrong, says, remedy) in edits {
            assert!(text.contains(right), "{flag}: `{right}` is not there to break");
            let inputs = Inputs::new();
            let file = inputs.put("bad.ron", text.replace(right, wrong));
            refusals.call(&["tiny", flag, &file], 2, &[file.as_str(), ":", says], remedy);
        }
    }
    refusals.done();
}

#[cfg(unix)]
#[test]
fn paths_that_are_no_utf8_are_read() {
    use std::ffi::OsString;
    use std::os::unix::ffi::OsStringExt;
    use std::path::Path;
    let inputs = Inputs::new();
    let named = |name: &[u8]| Path::new(&inputs.path("")).join(OsString::from_vec(name.to_vec()));
    let copies = [
        (named(b"sc\xe9ne.ron"), "workloads/scenes/pendulum.ron"),
        (named(b"g\xe9ant.ron"), "sim/run/gpus/mobile.ron"),
    ];
    for (path, source) in &copies {
        fs::copy(crate::support::root().join(source), path).expect("a copy");
    }
    let out = named(b"\xe9t\xe9");
    let options = ["--size", "32x18", "--samples", "1", "--frames", "0..1", "--gpu"].map(OsString::from);
    let mut args = vec![OsString::from("run"), copies[0].0.clone().into()];
    args.extend(options);
    args.extend([copies[1].0.clone().into(), OsString::from("--out"), out.clone().into()]);
    let ended = quintile().call(args);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(out.join("summary.json").is_file());
}
