//! `quintile visibility`: files in the layouts of the ray-casting peer.

use std::ffi::OsStr;

use tests::quintile;

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
fn half_the_samples_see_a_triangle_over_half_the_image() {
    let folder = tempfile::tempdir().unwrap();
    let (file, hits) = (folder.path().join("half.m5d"), folder.path().join("half.hit"));
    std::fs::write(&file, scene()).unwrap();
    let [verb, out, json] = ["visibility", "--out", "--json"].map(OsStr::new);
    let ended = quintile!().call([verb, file.as_os_str(), out, hits.as_os_str(), json]);
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

#[test]
fn a_cut_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("cut.m5d");
    std::fs::write(&file, &scene()[..100]).unwrap();
    let ended = quintile!().call([OsStr::new("visibility"), file.as_os_str()]);
    assert_eq!(ended.code, Some(1));
    assert!(ended.stderr.contains("cut.m5d") && ended.stderr.contains("bytes follow"), "{}", ended.stderr);
}
