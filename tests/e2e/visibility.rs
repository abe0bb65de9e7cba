//! `quintile visibility`: files in the layouts of the ray-casting peer.

use std::ffi::OsStr;

use crate::support::quintile;

/// One still triangle that covers the upper left half of a 16x16 image, four samples a pixel.
fn scene() -> Vec<u8> {
    let mut data = b"M5DSCN1\0".to_vec();
    [1_u32, 0, 16, 16, 4, 0].iter().for_each(|word| data.extend(word.to_le_bytes()));
    data.extend(7_u64.to_le_bytes());
    [90.0_f64, 1.0, 0.0, 1.0, 0.1].iter().for_each(|number| data.extend(number.to_le_bytes()));
    let corners = [-2.0_f32, 2.0, 2.0, 2.0, 2.0, 2.0, -2.0, -2.0, 2.0];
    corners.iter().chain(&corners).for_each(|number| data.extend(number.to_le_bytes()));
    data
}

#[test]
fn a_triangle_over_half_the_image_covers_half_the_samples() {
    let folder = tempfile::tempdir().unwrap();
    let (file, hits) = (folder.path().join("half.m5d"), folder.path().join("half.hit"));
    std::fs::write(&file, scene()).unwrap();
    let [verb, out, json] = ["visibility", "--out", "--json"].map(OsStr::new);
    let ended = quintile().call([verb, file.as_os_str(), out, hits.as_os_str(), json]);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let found: serde_json::Value = serde_json::from_str(&ended.stdout).unwrap();
    assert_eq!(found["samples"], 1024);
    let share = found["hits"].as_u64().unwrap() as f64 / 1024.0;
    assert!((share - 0.5).abs() < 0.05, "{share}");
    let hits = std::fs::read(hits).unwrap();
    assert_eq!(&hits[..8], b"M5DHIT1\0");
    assert_eq!(hits.len(), 24 + 1024 * 8);
    let seen = hits[24..24 + 4096].chunks_exact(4).filter(|id| *id == [0; 4]).count();
    let at_two = hits[24 + 4096..].chunks_exact(4).filter(|z| *z == 2.0_f32.to_le_bytes()).count();
    assert_eq!((seen as u64, at_two), (found["hits"].as_u64().unwrap(), seen));
}

/// Four layers of triangles that move and are out of focus, one of them through the camera plane.
fn moving_scene() -> Vec<u8> {
    let mut data = b"M5DSCN1\0".to_vec();
    [4_u32, 0, 40, 30, 4, 0].iter().for_each(|word| data.extend(word.to_le_bytes()));
    data.extend(7_u64.to_le_bytes());
    [60.0_f64, 0.577, 0.2, 4.0, 0.1].iter().for_each(|number| data.extend(number.to_le_bytes()));
    for layer in 0..4 {
        let z = 2.0 + layer as f32;
        let open = [[-1.0, -1.0, z], [1.5, -0.8, z], [0.1, 1.2, z + 1.0]];
        let close = open.map(|[x, y, z]: [f32; 3]| [x + 0.5, y - 0.3, if layer == 0 { -1.0 } else { z }]);
        open.iter().chain(&close).flatten().for_each(|number| data.extend(number.to_le_bytes()));
    }
    data
}

#[test]
fn tile_tests_do_not_change_the_result() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("moving.m5d");
    std::fs::write(&file, moving_scene()).unwrap();
    let look = |more: &[&str]| {
        let hits = folder.path().join("seen.hit");
        let [verb, out, json] = ["visibility", "--out", "--json"].map(OsStr::new);
        let args = [verb, file.as_os_str(), out, hits.as_os_str(), json];
        let ended = quintile().call(args.into_iter().chain(more.iter().map(OsStr::new)));
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        let found: serde_json::Value = serde_json::from_str(ended.stdout.lines().last().unwrap()).unwrap();
        (std::fs::read(&hits).unwrap(), found)
    };
    let (expected, found) = look(&[]);
    assert!(found["hits"].as_u64().unwrap() > 500, "{found}");
    let ways: [&[&str]; 6] = [
        &["--repeat", "3", "--threads", "2"],
        &["--tests", "none"],
        &["--tests", "all"],
        &["--tests", "auto"],
        &["--tests", "side_planes,edges", "--threads", "3"],
        &["--tests", "facing, z-max", "--repeat", "2"],
    ];
    for way in ways {
        let (hits, found) = look(way);
        assert!(hits == expected, "{way:?}");
        let rate = |name: &str| found[name].as_f64().unwrap();
        assert!(rate("samples_per_s") > 0.0 && rate("end_to_end_samples_per_s") > 0.0, "{found}");
        assert!(rate("best_samples_per_s") >= rate("samples_per_s"), "{found}");
    }
}

#[test]
fn a_tile_test_that_is_none_is_refused() {
    let ended = quintile().call(["visibility", "a.m5d", "--tests", "edges,hiz"].map(OsStr::new));
    assert_eq!(ended.code, Some(2));
    assert!(ended.stderr.contains("unknown tile test `hiz`"), "{}", ended.stderr);
}

#[test]
fn a_truncated_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("cut.m5d");
    std::fs::write(&file, &scene()[..100]).unwrap();
    let ended = quintile().call([OsStr::new("visibility"), file.as_os_str()]);
    assert_eq!(ended.code, Some(2));
    assert!(ended.stderr.contains("cut.m5d") && ended.stderr.contains("bytes follow"), "{}", ended.stderr);
}
