//! `quintile visibility`: all file formats of a moving mesh give the same visible triangles.

use crate::support::{Ended, Inputs, quintile};

/// Triangles in camera space, at both ends of the shutter.
type Soup = Vec<[[[f32; 3]; 3]; 2]>;

const SIDE: u32 = 48;
const SAMPLES: u32 = 4;
const SEED: u64 = 11;

/// Small triangles before the camera, each on its own way.
fn soup() -> Soup {
    let mut state = 1_u64;
    let mut random = |from: f32, to: f32| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        from + (to - from) * ((state >> 40) as f32 / (1 << 24) as f32)
    };
    let mut triangle = || {
        let centre = [random(-3.0, 3.0), random(-3.0, 3.0), random(4.0, 9.0)];
        let corners = [(); 3].map(|()| centre.map(|part| part + random(-1.0, 1.0)));
        [corners, corners.map(|corner| corner.map(|part| part + random(-0.5, 0.5)))]
    };
    (0..60).map(|_| triangle()).collect()
}

/// The world of files is right-handed: what lies before the camera has a negative z.
fn world(corner: [f32; 3]) -> [f32; 3] {
    [corner[0], corner[1], -corner[2]]
}

fn corners(soup: &Soup, end: usize) -> Vec<[f32; 3]> {
    soup.iter().flat_map(|triangle| triangle[end].map(world)).collect()
}

fn m5d(soup: &Soup) -> Vec<u8> {
    let mut data = b"M5DSCN1\0".to_vec();
    let words = [soup.len() as u32, 0, SIDE, SIDE, SAMPLES, 0];
    words.iter().for_each(|word| data.extend(word.to_le_bytes()));
    data.extend(SEED.to_le_bytes());
    let half = 30.0_f64.to_radians().tan();
    [60.0, half, 0.25, 8.0, 0.1].iter().for_each(|number: &f64| data.extend(number.to_le_bytes()));
    soup.iter().flatten().flatten().flatten().for_each(|number| data.extend(number.to_le_bytes()));
    data
}

/// The camera of that file.
fn camera() -> String {
    format!(
        "(width: {SIDE}, height: {SIDE}, samples: {SAMPLES}, seed: {SEED}, fov_deg: 60, position: (0, 0, 0),
          target: (0, 0, -1), lens_shape: Disk, lens_radius: 0.25, focus: 8, near: 0.1)"
    )
}

fn ply(soup: &Soup, end: usize) -> String {
    let count = soup.len();
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {count}\nproperty list uchar int vertex_indices\nend_header\n",
        3 * count
    );
    corners(soup, end).iter().for_each(|[x, y, z]| text += &format!("{x} {y} {z}\n"));
    (0..count).for_each(|i| text += &format!("3 {} {} {}\n", 3 * i, 3 * i + 1, 3 * i + 2));
    text
}

fn obj(soup: &Soup, end: usize) -> String {
    let vertices = corners(soup, end).into_iter().map(|[x, y, z]| format!("v {x} {y} {z}\n"));
    let faces = (0..soup.len()).map(|i| format!("f {} {} {}\n", 3 * i + 1, 3 * i + 2, 3 * i + 3));
    vertices.chain(faces).collect()
}

/// Two objects, the triangles dealt out between them in order.
fn mts(soup: &Soup, scalar_bytes: u32) -> Vec<u8> {
    let (first, second) = soup.split_at(soup.len() / 3);
    let objects = [first.to_vec(), second.to_vec()];
    let mut data = b"MTS1".to_vec();
    [scalar_bytes, 2, 0].iter().for_each(|word| data.extend(word.to_le_bytes()));
    for object in &objects {
        let count = object.len() as u32;
        [3 * count, count].iter().for_each(|word| data.extend(word.to_le_bytes()));
    }
    for object in &objects {
        for number in [0, 1].iter().flat_map(|end| corners(object, *end)).flatten() {
            match scalar_bytes {
                4 => data.extend(number.to_le_bytes()),
                _ => data.extend(f64::from(number).to_le_bytes()),
            }
        }
        (0..3 * object.len() as u32).for_each(|index| data.extend(index.to_le_bytes()));
    }
    data
}

fn visibility(files: &[String], flags: &[&str]) -> Ended {
    let files = files.iter().map(String::as_str);
    quintile().call(["visibility"].into_iter().chain(files).chain(flags.iter().copied()))
}

/// The bytes of the result.
fn hits(inputs: &Inputs, files: &[String], flags: &[&str]) -> Vec<u8> {
    let out = inputs.path("a.hit");
    let ended = visibility(files, &[flags, &["--out", &out]].concat());
    assert_eq!(ended.code, Some(0), "{files:?}: {}", ended.stderr);
    std::fs::read(out).unwrap_or_else(|error| panic!("{files:?}: {error}"))
}

#[test]
fn the_same_mesh_in_any_file_gives_the_same_bytes() {
    let inputs = Inputs::new();
    let soup = soup();
    let expected = hits(&inputs, &[inputs.put("a.m5d", m5d(&soup))], &[]);
    let ids = expected[24..24 + (SIDE * SIDE * SAMPLES * 4) as usize].chunks_exact(4);
    let seen: std::collections::BTreeSet<&[u8]> = ids.collect();
    assert!(seen.len() > 50, "only {} triangles are seen: the test says nothing", seen.len());
    let camera = inputs.put("c.ron", camera());
    let [start, end] = [0, 1].map(|i| inputs.put(&format!("{i}.ply"), ply(&soup, i)));
    let [first, last] = [0, 1].map(|i| inputs.put(&format!("{i}.obj"), obj(&soup, i)));
    for files in [
        vec![inputs.path("a.m5d")],
        vec![start.clone(), end.clone()],
        vec![first.clone(), last.clone()],
        vec![start, last],
        vec![first, end],
        vec![inputs.put("single.mts", mts(&soup, 4))],
        vec![inputs.put("double.mts", mts(&soup, 8))],
    ] {
        assert!(hits(&inputs, &files, &["--camera", &camera]) == expected, "{files:?}");
    }
    let still = hits(&inputs, &[inputs.path("0.ply")], &["--camera", &camera]);
    assert!(still != expected, "the end of the shutter has to matter");
}

#[test]
fn the_fitted_camera_is_printed_and_can_be_reused() {
    let inputs = Inputs::new();
    let files = [inputs.put("a.mts", mts(&soup(), 8))];
    let ended = visibility(&files, &["--json"]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let found: serde_json::Value = serde_json::from_str(ended.stdout.trim()).expect("JSON");
    assert_eq!(
        (&found["triangles"], &found["width"], &found["samples_per_pixel"]),
        (&60.into(), &512.into(), &16.into())
    );
    assert!(
        found["hits"].as_u64() > Some(100_000) && found["hits"].as_u64() < found["samples"].as_u64(),
        "{found}"
    );
    assert_eq!(found["camera"]["fov_deg"], 40.0);
    assert!(visibility(&files, &[]).stdout.contains("the camera was fitted: ("));
    let printed = visibility(&files, &["--print-camera"]);
    assert_eq!(printed.code, Some(0), "{}", printed.stderr);
    let camera = inputs.put("c.ron", printed.stdout);
    assert!(hits(&inputs, &files, &[]) == hits(&inputs, &files, &["--camera", &camera]));
    let seen = visibility(&files, &["--camera", &camera, "--json"]);
    assert!(!seen.stdout.contains("fov_deg"), "only a fitted camera is printed: {}", seen.stdout);
}

/// Orthographic cameras are modelled with a warning; the result does not depend on the tile tests.
#[test]
fn an_orthographic_camera_is_modelled_with_a_warning() {
    let inputs = Inputs::new();
    let files = [inputs.put("a.mts", mts(&soup(), 8))];
    for lens in ["", "lens_radius: 0.25, focus: 6, "] {
        let view = format!(
            "(width: {SIDE}, height: 32, samples: 4, {lens}position: (0, 0, 0), target: (0, 0, -1), view_height: 7)"
        );
        let camera = inputs.put("c.ron", view);
        let expected = hits(&inputs, &files, &["--camera", &camera]);
        for tests in ["none", "all", "auto"] {
            assert!(
                hits(&inputs, &files, &["--camera", &camera, "--tests", tests]) == expected,
                "{tests} {lens}"
            );
        }
        let codes = |flags: &[&str]| {
            let ended = visibility(&files, &[&["--camera", &camera, "--json"], flags].concat());
            let found: serde_json::Value = serde_json::from_str(ended.stdout.trim()).expect("JSON");
            assert!(found["hits"].as_u64() > Some(500), "{found}");
            found["warnings"].to_string().contains("orthographic-view")
        };
        assert!(codes(&[]) && !codes(&["--tests", "all"]));
    }
}

/// Files, flags, exit code, and parts of the message.
type Case<'a> = (&'a [&'a String], &'a [&'a str], i32, &'a [&'a str]);

#[test]
fn usage_errors_and_failures_have_their_exit_codes() {
    let inputs = Inputs::new();
    let soup = soup();
    let [start, end] = [0, 1].map(|i| inputs.put(&format!("{i}.ply"), ply(&soup, i)));
    let short = inputs.put("short.ply", ply(&soup[1..].to_vec(), 1));
    let whole = inputs.put("a.mts", mts(&soup, 8));
    let cut = inputs.put("cut.mts", &mts(&soup, 8)[..4000]);
    let carried = inputs.put("a.m5d", m5d(&soup));
    let strange = inputs.put("a.glb", b"glTF\x02\0\0\0");
    let gone = inputs.path("gone.mts");
    let typo = inputs.put("typo.ron", "(\n  widht: 3,\n)");
    let both =
        inputs.put("both.ron", "(position: (0, 0, 1), target: (0, 0, 0), fov_deg: 40, view_height: 2)");
    let adrift = inputs.put("adrift.ron", "(view_height: 2)");
    let cases: [Case<'_>; 13] = [
        (
            &[&start, &end],
            &["--camera", &both],
            2,
            &["both.ron: camera", "`view_height`", "remove one of them"],
        ),
        (&[&start, &end], &["--camera", &adrift], 2, &["adrift.ron: camera", "give `position` and `target`"]),
        (
            &[&start, &short],
            &[],
            2,
            &["short.ply: triangles: it has 59 triangles", "0.ply has 60", "export both"],
        ),
        (&[&cut], &[], 2, &["cut.mts: object 1", "only 3968 follow", "get it again"]),
        (&[&gone], &[], 2, &["gone.mts: cannot read it", "check the path"]),
        (&[&start, &end], &["--camera", &gone], 2, &["gone.mts` is not a camera: give `inside`"]),
        (&[&start, &end], &["--camera", &typo], 2, &["typo.ron:2:", "`widht`, did you mean `width`?"]),
        (&[&start, &whole], &[], 2, &["a.mts holds both ends", "give it alone"]),
        (&[&strange], &[], 2, &["a.glb: ", "known: .m5d, .mts"]),
        (&[&carried], &["--print-camera"], 2, &["a.m5d has a camera of its own", "leave it out"]),
        (&[&start, &end, &end], &[], 2, &["no more were expected"]),
        (&[], &[], 2, &["<FILE>"]),
        (&[&whole], &["--print-camera", "--camera", &typo], 2, &["--print-camera", "--camera"]),
    ];
    for (files, flags, code, parts) in cases {
        let files: Vec<String> = files.iter().map(|file| (*file).clone()).collect();
        let ended = visibility(&files, flags);
        assert_eq!(ended.code, Some(code), "{files:?} {flags:?}: {}", ended.stderr);
        assert!(ended.stdout.is_empty(), "{}", ended.stdout);
        for part in parts {
            assert!(ended.stderr.contains(part), "`{part}` is not in: {}", ended.stderr);
        }
    }
}

#[test]
fn an_input_is_not_written_over() {
    let inputs = Inputs::new();
    let scene = inputs.put("a.m5d", m5d(&soup()));
    let before = std::fs::read(&scene).unwrap_or_default();
    let ended = quintile().call(["visibility", &scene, "--out", &scene]);
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    assert!(ended.stderr.contains("--out") && ended.stderr.contains("name another file"), "{}", ended.stderr);
    assert!(std::fs::read(&scene).is_ok_and(|after| after == before));
}

#[test]
fn what_does_not_fit_into_memory_is_refused_at_once() {
    let inputs = Inputs::new();
    let mut data = m5d(&soup());
    for (word, value) in [(2, 16384_u32), (3, 16384), (4, 256)] {
        data[8 + 4 * word..][..4].copy_from_slice(&value.to_le_bytes());
    }
    let scene = inputs.put("huge.m5d", data);
    let ended = quintile().call(["visibility", &scene]);
    assert_eq!(ended.code, Some(2), "{}", ended.stderr);
    assert!(ended.stderr.contains("GiB") && ended.stderr.contains("ask for fewer"), "{}", ended.stderr);
}

#[test]
fn lengths_beyond_the_range_and_empty_views_are_warned_of() {
    let inputs = Inputs::new();
    let codes = |name: &str, soup: &Soup| {
        let scene = inputs.put(name, m5d(soup));
        let json: serde_json::Value =
            serde_json::from_str(&quintile().call(["visibility", &scene, "--json"]).stdout)
                .unwrap_or_default();
        json["warnings"].to_string()
    };
    let scaled = |factor: f32| -> Soup {
        soup()
            .into_iter()
            .map(|ends| ends.map(|end| end.map(|corner| corner.map(|at| at * factor))))
            .collect()
    };
    assert_eq!(codes("plain.m5d", &soup()), "[]");
    assert!(codes("far.m5d", &scaled(1e13)).contains("coordinates-out-of-range"));
    assert!(codes("none.m5d", &Vec::new()).contains("empty-frame"));
}
