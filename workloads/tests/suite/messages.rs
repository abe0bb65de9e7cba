//! Messages say which file, where in it, what is wrong and what to do; warnings come in the right cases.

use crate::common::{Files, expect, failure};
use workloads::catalog::find;
use workloads::job::{JobRequest, OptionSource};
use workloads::{LoadError, Overrides, load};

#[test]
fn files_that_cannot_be_read_say_what_to_do() {
    let files = Files::new();
    let at = files.put("here", "");
    for kind in ["ron", "gltf", "glb", "ply", "ply.gz", "obj", "obj.gz", "off", "off.gz", "stl", "stl.gz"] {
        let path = format!("{at}-gone.{kind}");
        let text = failure(load(&path).unwrap_err());
        expect(&text, &[&path, "cannot read it: No such file", "; check the path"]);
        let folder = format!("{at}.{kind}");
        std::fs::create_dir(&folder).unwrap();
        let text = failure(load(&folder).unwrap_err());
        expect(
            &text,
            &[
                &folder,
                "is a folder: give the path of a .ron, .gltf, .glb, .obj, .ply, .off or .stl file in it",
            ],
        );
        expect(&text.to_lowercase(), &["directory"]);
    }
    let text = failure(load(files.put("a.ron", b"(\xff)")).unwrap_err());
    expect(&text, &["a.ron", "UTF-8", "check "]);
}

#[test]
fn a_ply_header_that_cannot_be_used_says_what_to_do() {
    let files = Files::new();
    let vertex = "element vertex 1\nproperty float x\nproperty float y\n";
    let whole = format!("{vertex}property float z\n");
    for (header, wrong) in [
        (String::new(), "no element `vertex`"),
        (whole.clone(), "no element `face`"),
        (format!("{vertex}element face 0\nproperty list uchar int vertex_indices\n"), "no property `z`"),
        (format!("{whole}element face 0\nproperty float area\n"), "no property `vertex_indices`"),
    ] {
        let text = format!("ply\nformat ascii 1.0\n{header}end_header\n");
        let text = failure(load(files.put("a.ply", text)).unwrap_err());
        expect(&text, &["a.ply: header: ", wrong, "; export it again as a PLY file"]);
    }
    for bytes in [&b""[..], b"solid", b"\x89PNG\r\n\x1a\n\0\0\xff\xfe"] {
        for name in ["a.ply", "a.ply.gz"] {
            let text = failure(load(files.put(name, bytes)).unwrap_err());
            expect(&text, &[name, ": header: not a PLY file: ", "; export it again as a PLY file"]);
            assert!(!text.contains('\n'), "{text}");
        }
    }
}

#[test]
fn a_file_that_ends_early_says_so_wherever_it_is_cut() {
    let files = Files::new();
    let header = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n";
    for length in "ply".len()..header.len() {
        let text = failure(load(files.put("a.ply", &header[..length])).unwrap_err());
        let line = 1 + header[..length].trim_end().matches('\n').count();
        let at_end = [line, line + 1].map(|line| format!("a.ply: header: the file ends at line {line}, "));
        assert!(at_end.iter().any(|start| text.contains(start)), "{text}");
        expect(&text, &["it is truncated; get it again"]);
    }
    let json = "{\n\"asset\": {\"version\": \"2.0\"},\n\"nodes\": [{}]\n";
    for length in 1..json.len() {
        let text = failure(load(files.put("a.gltf", &json[..length])).unwrap_err());
        expect(&text, &["a.gltf: JSON: the file ends at line ", "it is truncated; get the file again"]);
    }
}

#[test]
fn a_wrong_line_of_a_ply_header_is_quoted_without_words_of_the_parser() {
    let files = Files::new();
    for (lines, quoted) in [
        ("format ascii 1.0\nelment vertex 1", "line 3 cannot be read: `elment vertex 1`"),
        ("format asc 1.0", "line 2 cannot be read: `format asc 1.0`"),
        ("property float x", "line 2 cannot be read: `property float x`"),
    ] {
        let text = format!("ply\n{lines}\nend_header\n");
        let text = failure(load(files.put("a.ply", text)).unwrap_err());
        expect(&text, &["a.ply: header: not a PLY file: ", quoted, "; export it again as a PLY file"]);
        assert!(!text.contains('{'), "{text}");
    }
}

#[test]
fn an_empty_scene_is_reported_with_its_file() {
    let files = Files::new();
    files.put("empty.obj", "v 0 0 0\n");
    let scene = files.put("s.ron", "(name: \"nice\", objects: [(file: \"empty.obj\")])");
    for path in [scene, files.put("a.obj", "v 0 0 0\n"), files.put("b.obj", "")] {
        let text = failure(load(&path).unwrap_err());
        expect(&text, &[&path, ": scene: it has no triangles", "name another file, or export it"]);
    }
}

#[test]
fn a_clip_of_a_scene_without_any_is_to_be_left_out() {
    let overrides = Overrides { clip: Some("Run".to_owned()), ..Overrides::default() };
    let error = load("tiny").unwrap().with_overrides(&overrides).unwrap_err();
    assert!(error.is_usage());
    expect(&error.to_string(), &["unknown clip `Run`", "no animation clips; leave it out"]);
}

#[test]
fn materials_that_no_file_describes_are_a_warning_unless_the_scene_has_its_own() {
    let files = Files::new();
    let faces = "v 0 0 0\nv 1 0 0\nv 0 1 0\ng usemtl\n# mtllib a.mtl\n";
    for (statement, warned) in [("mtllib a.mtl\nusemtl red\n", true), ("usemtl red\n", true), ("", false)] {
        let path = files.put("a.obj", format!("{faces}{statement}f 1 2 3\n"));
        let object = files.put("s.ron", "(objects: [(file: \"a.obj\")])");
        for scene in [&path, &object].map(|path| load(path).unwrap()) {
            let codes: Vec<_> = scene.warnings().iter().map(|warning| warning.code).collect();
            assert_eq!(codes == ["missing-material"], warned, "{statement:?}: {codes:?}");
            assert!(warned || codes.is_empty(), "{codes:?}");
        }
        let own = files.put("own.ron", "(objects: [(file: \"a.obj\", material: (color: (1, 0, 0)))])");
        assert_eq!(load(&own).unwrap().warnings(), []);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_pipe_and_a_truncated_file_have_different_messages() {
    use std::io::Write;
    use std::os::fd::AsRawFd;
    let (reader, mut writer) = std::io::pipe().unwrap();
    writer.write_all(&crate::common::meshes::mts(&[[0.0; 3]; 3], &[[1.0; 3]; 3], &[[0, 1, 2]])).unwrap();
    drop(writer);
    let error = workloads::collision::load_cases(&[format!("/dev/fd/{}", reader.as_raw_fd())]).unwrap_err();
    assert!(error.is_usage());
    expect(&error.to_string(), &["/dev/fd/", "is a pipe", "write it to a file"]);
}

/// The error of a workload with these options.
fn refusal(job: &str, options: &OptionSource) -> Option<LoadError> {
    find(job, options, &JobRequest { overrides: &Overrides::default(), seed: 1 }).unwrap().err()
}

#[test]
fn options_out_of_range_give_the_valid_range() {
    for (job, name, value, says) in [
        ("occlusion", "walls", "1001", "0 to 1000"),
        ("occlusion", "boxes", "[0, 1, 1]", "1 to 16"),
        ("ccd", "file", "", "leave it out"),
        ("ccd", "balls", "1", "2 to 100"),
        ("ccd", "resolution", "0", "1 to 1024"),
        ("caustics", "cells", "0", "1 to 1024"),
        ("caustics", "pleat", "1", "0 to 0.9"),
        ("sampling", "radius", "0.6", "0.005 to 0.5"),
        ("glossy", "texels", "0", "1 to 16384"),
        ("glossy", "map_samples", "257", "1 to 256"),
        ("soft-shadows", "map_px", "3", "an even number"),
        ("soft-shadows", "light", "(fov_deg: 180)", "1 to 170 degrees"),
        ("multiview", "views", "129", "1 to 128"),
        ("multiview", "spacing", "1e30", "move the views closer or widen the aperture"),
        ("multiview", "aperture", "1e-30", "move the views closer or widen the aperture"),
        ("multiview", "panel", "(pitch: 0)", "1 to 1000000 subpixels"),
        ("multiview", "aperture", "1e-300", "1e-35 or more"),
        ("multiview", "panel", "(slant: 1e300)", "slant 1e300: it has to be -1000000 to 1000000"),
        ("caustics", "wave_m", "1e300", "1e300: it has to be 0.001 to 10000 metres"),
        ("glossy", "half", "[1e300, 1]", "[1e300, 1.0]: both have to be 1e-15 to 1e15"),
        ("glossy", "centre", "[1e300, 0, 0]", "-1e15 to 1e15"),
        ("glossy", "roughness", "1e-300", "0, or a radius of 1e-15 to 120.0"),
        ("soft-shadows", "points", "[]", "1 to 65536 points"),
        ("soft-shadows", "light", "(radius: 1e10)", "100 times the way to the target"),
        ("soft-shadows", "light", "(1, 2)", "known: fov_deg, near, position, radius, target"),
        ("soft-shadows", "light", "(raduis: 1)", "did you mean `radius`?"),
    ] {
        let shown = (name == "panel").then(|| ("show".to_owned(), "interlaced".to_owned()));
        let set = shown.into_iter().chain([(name.to_owned(), value.to_owned())]).collect();
        let error = refusal(job, &OptionSource { file: None, set }).unwrap();
        assert!(error.is_usage(), "{job} {name}: {error}");
        expect(&error.to_string(), &[name, says]);
        let set = vec![(format!("{name}x"), value.to_owned())];
        let error = refusal(job, &OptionSource { file: None, set }).unwrap();
        expect(&error.to_string(), &[&format!("unknown option `{name}x`, did you mean `{name}`?")]);
    }
}

#[test]
fn views_without_a_common_scene_are_refused() {
    let set =
        [("aperture", "1e10"), ("spacing", "1e11")].map(|(name, value)| (name.into(), value.into())).to_vec();
    let error = refusal("multiview", &OptionSource { file: None, set }).unwrap();
    assert!(error.is_usage());
    expect(&error.to_string(), &["aperture: ", "100 times the depth at which views agree"]);
}

#[test]
fn nan_options_are_refused() {
    let files = Files::new();
    let numbers: [(&str, &[&str]); 6] = [
        ("occlusion", &["gaps: #", "motion: #", "lens: #"]),
        ("caustics", &["side_m: #", "depth_m: #", "wave_m: #", "slope: #", "pleat: #"]),
        ("sampling", &["radius: #"]),
        ("glossy", &["roughness: #", "fresnel: #", "index: Some(#)", "half: (1, #)", "centre: (0, #, 0)"]),
        (
            "soft-shadows",
            &[
                "bias: #",
                "light: (radius: #)",
                "light: (near: #)",
                "light: (fov_deg: #)",
                "light: (position: (0, #, 0))",
            ],
        ),
        (
            "multiview",
            &[
                "spacing: #",
                "aperture: #",
                "focus: Some(#)",
                "panel: (pitch: #)",
                "panel: (slant: #)",
                "panel: (offset: #)",
            ],
        ),
    ];
    for (job, options) in numbers {
        for (option, bad) in
            options.iter().flat_map(|option| ["NaN", "inf", "-inf", "-1e30"].map(|bad| (option, bad)))
        {
            // A light may be anywhere.
            if bad == "-1e30" && option.contains("position") {
                continue;
            }
            let text = format!("({})", option.replace('#', bad));
            let file = Some(files.put("options.ron", &text).into());
            let error = refusal(job, &OptionSource { file, set: Vec::new() });
            assert!(error.as_ref().is_some_and(LoadError::is_usage), "{job} {text}: {error:?}");
        }
    }
}
