//! Moving meshes for `quintile visibility`: every file format, and messages about broken files.

use std::path::Path;

use crate::common::meshes::{gzip, m5d, mts, obj, ply};
use crate::common::{Files, expect, failure};
use glam::Vec3;
use proptest::prelude::*;
use workloads::LoadError;
use workloads::collision::{CaseFiles, load_cases};
use workloads::collision::{Object, PairSearch, detect};
use workloads::visibility::{CameraSpec, VisibilityScene, load, parse_m5d, parse_mts};

const SQUARE: [[f32; 3]; 4] = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
const HALVES: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];
/// A camera that looks at the origin from five units in front.
const CAMERA: &str = "(width: 32, height: 16, samples: 4, position: (0, 0, 5), look_at: (0, 0, 0))";

fn moved() -> [[f32; 3]; 4] {
    SQUARE.map(|[x, y, z]| [x + 0.5, y, z - 1.0])
}

fn pair(start: (&str, &str), end: (&str, &str)) -> Result<VisibilityScene, LoadError> {
    let files = Files::new();
    load(&[files.put(start.0, start.1), files.put(end.0, end.1)], Some(&files.put("c.ron", CAMERA)))
}

#[test]
fn every_format_gives_the_same_scene() {
    let files = Files::new();
    let camera = files.put("c.ron", CAMERA);
    let starts = [files.put("a.ply", ply(&SQUARE, &HALVES)), files.put("a.obj", obj(&SQUARE, &HALVES))];
    let ends = [
        files.put("b.ply.gz", gzip(ply(&moved(), &HALVES))),
        files.put("b.obj", gzip(obj(&moved(), &HALVES))),
    ];
    let mut cases: Vec<Vec<String>> =
        starts.iter().flat_map(|start| ends.iter().map(|end| vec![start.clone(), end.clone()])).collect();
    let whole = mts(&SQUARE, &moved(), &HALVES);
    cases.push(vec![files.put("a.mts", &whole)]);
    // The content decides the format, whatever the name.
    cases.push(vec![files.put("no-name", gzip(&whole))]);
    for case in cases {
        let scene = load(&case, Some(&camera)).unwrap();
        let corner = |point: [f32; 3]| Vec3::new(point[0], point[1], 5.0 - point[2]);
        assert_eq!(scene.open, SQUARE.map(corner), "{case:?}");
        assert_eq!(scene.close, moved().map(corner), "{case:?}");
        assert_eq!(scene.triangles, HALVES, "{case:?}");
        assert_eq!(scene.objects, std::slice::from_ref(&(0..2)));
        assert_eq!((scene.viewport.width(), scene.viewport.height(), scene.per_pixel), (32, 16, 4));
        assert!(scene.fitted.is_none() && scene.warnings.is_empty());
    }
}

#[test]
fn objects_of_an_mts_follow_each_other() {
    let files = Files::new();
    let one = mts(&SQUARE, &moved(), &HALVES);
    let (sizes, body) = one[16..].split_at(8);
    let header = &[one[..8].to_vec(), 2_u32.to_le_bytes().to_vec(), vec![0; 4]].concat();
    let two = [header, sizes, sizes, body, body].concat();
    let scene = load(&[files.put("a.mts", two)], None).unwrap();
    assert_eq!(scene.objects, [0..2, 2..4]);
    assert_eq!(scene.triangles, [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]);
    assert_eq!((&scene.open[..4], &scene.close[..4]), (&scene.open[4..], &scene.close[4..]));
}

#[test]
fn one_file_stays_still_and_an_end_of_the_camera_moves_it() {
    let files = Files::new();
    let mesh = files.put("a.ply", ply(&SQUARE, &HALVES));
    let still = load(&[&mesh], None).unwrap();
    assert_eq!(still.open, still.close);
    assert!(still.fitted.is_some_and(|camera| camera.is_placed()));
    let camera = files.put(
        "c.ron",
        "(position: (0, 0, 5), target: (0, 0, 0), end_position: (1, 0, 5), end_target: (1, 0, 0))",
    );
    let passing = load(&[&mesh], Some(&camera)).unwrap();
    let step = passing.open.iter().zip(&passing.close).map(|(open, close)| *open - *close);
    assert!(step.into_iter().all(|step| step == Vec3::X));
    let camera = files.put("c.ron", "(position: (0, 0, 5), target: (0, 0, 0), end_up: (1, 0, 0))");
    let rolling = load(&[&mesh], Some(&camera)).unwrap();
    let rolled = rolling.open.iter().map(|open| Vec3::new(-open.y, open.x, open.z));
    assert_eq!(rolling.close, rolled.collect::<Vec<_>>());
}

#[test]
fn a_fitted_camera_survives_a_round_trip_exactly() {
    let files = Files::new();
    let mesh = files.put("a.mts", mts(&SQUARE, &moved(), &HALVES));
    let view = files.put("v.ron", "(width: 320, height: 200, lens_radius: 0.1, fov_deg: 50)");
    let fitted = load(&[&mesh], Some(&view)).unwrap();
    let camera = files.put("c.ron", fitted.fitted.as_ref().unwrap().to_ron());
    let again = load(&[&mesh], Some(&camera)).unwrap();
    assert!(again.fitted.is_none());
    assert_eq!((fitted.open, fitted.close, fitted.camera), (again.open, again.close, again.camera));
    assert_eq!(
        (fitted.viewport, fitted.seed, fitted.per_pixel),
        (again.viewport, again.seed, again.per_pixel)
    );
}

#[test]
fn a_lens_too_large_for_a_fitted_camera_is_reported() {
    let files = Files::new();
    let mesh = files.put("a.ply", ply(&SQUARE, &HALVES));
    let camera = files.put("c.ron", "(lens_radius: 50, focus: 1)");
    let scene = load(&[&mesh], Some(&camera)).unwrap();
    assert!(scene.warnings.iter().any(|warning| warning.code == "lens-leaves-view"), "{:?}", scene.warnings);
}

#[test]
fn an_m5d_under_the_camera_it_carries_is_itself() {
    let files = Files::new();
    let mesh = files.put("a.m5d", m5d());
    let own = load(&[&mesh], None).unwrap();
    let text = "(width: 64, height: 48, samples: 4, seed: 7, position: (0, 0, 0), target: (0, 0, -1),
                 lens_radius: 0.25, focus: 8, near: 0.1, fov_deg: 59.96995)";
    let same = load(&[&mesh], Some(&files.put("c.ron", text))).unwrap();
    assert_eq!((&own.open, &own.close, own.viewport), (&same.open, &same.close, same.viewport));
    assert_eq!((own.camera.lens(), own.camera.near()), (same.camera.lens(), same.camera.near()));
    assert!((own.camera.half_height() - same.camera.half_height()).abs() < 1e-6);
}

#[test]
fn different_topologies_are_reported_with_their_place() {
    let square = ply(&SQUARE, &HALVES);
    let text = failure(pair(("a.ply", &square), ("b.ply", &ply(&SQUARE, &HALVES[..1]))).unwrap_err());
    expect(&text, &["b.ply: triangles: it has 1 triangles, but", "a.ply has 2", "equal topology"]);
    let more = [SQUARE.as_slice(), &[[0.0; 3]]].concat();
    let text = failure(pair(("a.ply", &square), ("b.ply", &ply(&more, &HALVES))).unwrap_err());
    expect(&text, &["b.ply: vertices: it has 5 vertices, but", "a.ply has 4", "export both"]);
    let text =
        failure(pair(("a.ply", &square), ("b.ply", &ply(&SQUARE, &[HALVES[0], [0, 3, 2]]))).unwrap_err());
    expect(&text, &["b.ply: triangle 1: its corners are [0, 3, 2], those in", "a.ply are [0, 2, 3]"]);
    for (start, end) in [(HALVES[1], [0, 3, 1]), ([0, 3, 1], HALVES[1])] {
        let [one, other] = [[HALVES[0], start], [HALVES[0], end]].map(|triangles| obj(&SQUARE, &triangles));
        let text = failure(pair(("a.obj", &one), ("b.obj", &other)).unwrap_err());
        expect(&text, &["b.obj: triangle 1: one vertex of", "is at [", "equal topology"]);
    }
    // Vertices that are shared in one file and split in the other, in either order.
    let torn = [SQUARE.as_slice(), &[[9.0, 9.0, 9.0]]].concat();
    let torn = ply(&torn, &[HALVES[0], [4, 2, 3]]);
    for (start, end) in [
        (&torn, obj(&SQUARE, &HALVES)),
        (&square, obj(&[SQUARE.as_slice(), &[[9.0; 3]]].concat(), &[HALVES[0], [4, 2, 3]])),
    ] {
        let text = failure(pair(("a.ply", start), ("b.obj", &end)).unwrap_err());
        expect(&text, &["b.obj: triangle 1: one vertex of"]);
    }
}

#[test]
fn obj_files_with_different_faces_are_incompatible() {
    let points = [SQUARE.as_slice(), &SQUARE.map(|[x, y, z]| [x + 4.0, y, z])].concat();
    let [one, other] = [[[0, 1, 2], [4, 5, 6]], [[4, 5, 6], [0, 1, 2]]].map(|faces| obj(&points, &faces));
    assert!(pair(("a.obj", &one), ("b.obj", &one)).is_ok());
    let text = failure(pair(("a.obj", &one), ("b.obj", &other)).unwrap_err());
    expect(
        &text,
        &[
            "b.obj: line 9: it joins vertices [5, 6, 7], but line 9 of",
            "a.obj joins [1, 2, 3]",
            "equal topology",
        ],
    );
}

#[test]
fn collision_cases_name_folders_and_numbers_beyond_f32() {
    let files = Files::new();
    let folder = std::env::temp_dir();
    let refused = load_cases(&[&folder]).unwrap_err();
    assert!(refused.is_usage());
    expect(&refused.to_string(), &["is a folder: give the .mts, .ply, .obj or .off files in it"]);
    let huge = files.put("a.obj", "v 1e308 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let text = failure(load_cases(&[&huge, &huge]).unwrap_err());
    expect(&text, &["vertex 0 has a coordinate that is infinite or beyond f32 (3.4e38)"]);
}

/// A point in the middle of a segment; rounding to f32 moves it off.
#[test]
fn a_contact_below_the_smallest_normal_f32_is_not_missed() {
    let files = Files::new();
    let point = "v 0 0 2e-45\n".repeat(3);
    let segment = "v -8e-44 0 0\nv 8e-44 0 4e-45\nv 8e-44 0 4e-45\n";
    let mesh = files.put("a.obj", format!("{point}{segment}f 1 2 3\nf 4 5 6\n"));
    let case = CaseFiles::of(&[&mesh, &mesh]).unwrap()[0].load().unwrap();
    let objects = case.objects.iter().map(|mesh| Object::new(mesh, case.uncertainty).unwrap());
    let found = detect(&objects.collect::<Vec<_>>(), &PairSearch::default());
    assert!(found.iter().any(|answer| answer.verdict.may_collide()), "{found:?}");
}

#[test]
fn obj_vertices_split_by_normals_still_match() {
    let points = obj(&SQUARE, &[]);
    let split = format!("{points}vn 0 0 1\nvn 0 1 0\nf 1//1 2//1 3//1\nf 1//2 3//2 4//2\n");
    let smooth = format!("{}vn 0 0 1\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n", obj(&moved(), &[]));
    for (start, end) in [(&split, &smooth), (&smooth, &split)] {
        let scene = pair(("a.obj", start), ("b.obj", end)).unwrap();
        let drift =
            scene.triangles.as_flattened().iter().map(|&v| scene.close[v as usize] - scene.open[v as usize]);
        let drift: Vec<Vec3> = drift.collect();
        assert!(drift.iter().all(|step| *step == drift[0] && step.x.abs() == 0.5), "{drift:?}");
    }
}

#[test]
fn incompatible_files_are_mistakes_of_usage() {
    let files = Files::new();
    let surface = files.put("a.ply", ply(&SQUARE, &HALVES));
    let whole = files.put("a.mts", mts(&SQUARE, &moved(), &HALVES));
    let other = files.put("a.png", b"\x89PNG\r\n\x1a\n");
    let carried = files.put("a.m5d", m5d());
    for (case, parts) in [
        (vec![&surface, &whole], ["files: ", "a.mts holds both ends"]),
        (vec![&carried, &surface], ["files: ", "a.m5d holds both ends"]),
        (vec![&surface, &surface, &surface], ["files: 3 were given", "give one, or two"]),
        (vec![&other], ["a.png: ", "known: .m5d, .mts, and .ply, .obj, .off or .stl"]),
        (vec![], ["files: 0 were given", "give one"]),
    ] {
        let error = load(&case, None).unwrap_err();
        assert!(error.is_usage(), "{error}");
        expect(&error.to_string(), &parts);
    }
}

#[test]
fn broken_files_are_failures_that_name_them() {
    let files = Files::new();
    let zipped = gzip(mts(&SQUARE, &moved(), &HALVES));
    let mut damaged = zipped.clone();
    damaged[14] ^= 0xff;
    for (name, bytes, word) in [
        ("a.mts", &b"not what it says"[..], "does not start with `MTS1`"),
        ("a.m5d", b"M5DSMP1\0", "does not start with `M5DSCN1`"),
        ("a.mts", b"", "truncated"),
        ("a.mts.gz", &zipped[..zipped.len() / 2], "get it again"),
        ("a.mts", &damaged, "get it again"),
        ("a.ply", b"ply\nformat ascii 1.0\nend_header\n", "no element `vertex`"),
        ("a.obj", b"v 0 0 0\n", "there are no triangles"),
        ("a.obj", b"v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3", "line 2: a coordinate that is NaN or infinite"),
    ] {
        let text = failure(load(&[files.put(name, bytes)], None).unwrap_err());
        expect(&text, &[name, word]);
    }
    for name in ["/nowhere/a.mts", "/nowhere/a", "/"] {
        expect(&failure(load(&[name], None).unwrap_err()), &[name, "cannot read it"]);
    }
    let far = [[1e38, 0.0, 0.0], [0.0, 3e38, 0.0], [3e38; 3]];
    let file = files.put("a.ply", ply(&far, &[[0, 1, 2]]));
    let camera = files.put("c.ron", "(position: (1, 1, 1), target: (0, 0, 0))");
    let text = failure(load(&[file], Some(&camera)).unwrap_err());
    expect(&text, &["a.ply: vertices: vertex 2", "out of the range", "scale the mesh"]);
}

/// Bytes with some changes, and possibly truncated.
fn damaged(bytes: &[u8], flips: &[(prop::sample::Index, u8)], cut: Option<prop::sample::Index>) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for (place, to) in flips {
        let at = place.index(bytes.len());
        bytes[at] = *to;
    }
    if let Some(cut) = cut {
        bytes.truncate(cut.index(bytes.len()));
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn damaged_meshes_and_cameras_never_panic(
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..5),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let path = Path::new("a");
        let _ = parse_m5d(path, &damaged(&m5d(), &flips, cut));
        if let Ok(objects) = parse_mts(path, &damaged(&mts(&SQUARE, &moved(), &HALVES), &flips, cut)) {
            for mesh in objects {
                prop_assert_eq!(mesh.open.len(), mesh.close.len());
                prop_assert!(mesh.triangles.as_flattened().iter().all(|vertex| (*vertex as usize) < mesh.open.len()));
            }
        }
        if let Ok(text) = String::from_utf8(damaged(CAMERA.as_bytes(), &flips, cut)) {
            let _ = CameraSpec::parse(&text, "c.ron");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn damaged_files_never_panic(
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let files = Files::new();
        let end = files.put("b.ply", ply(&moved(), &HALVES));
        let zipped = gzip(mts(&SQUARE, &moved(), &HALVES));
        let _ = load(&[files.put("a.mts.gz", damaged(&zipped, &flips, cut))], None);
        let _ = load(&[files.put("a.ply", damaged(ply(&SQUARE, &HALVES).as_bytes(), &flips, cut)), end.clone()], None);
        let _ = load(&[files.put("a.obj", damaged(obj(&SQUARE, &HALVES).as_bytes(), &flips, cut)), end], None);
        let _ = load(&[files.put("a.m5d", damaged(&m5d(), &flips, cut))], None);
    }
}

#[test]
fn the_camera_in_the_book_is_valid() {
    let book =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/guide/visibility.md"))
            .unwrap();
    let example = book.split("```ron\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    assert!(CameraSpec::parse(example, "visibility.md").unwrap().is_placed());
}
