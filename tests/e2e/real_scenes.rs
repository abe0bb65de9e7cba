//! Real scenes from the folder in `QUINTILE_SCENES`, through the command; ignored where it is not set.

use crate::support::{Inputs, Results, lit_bounds, number, quintile, real_scene};
use image::{Rgb, RgbImage};
use serde_json::Value;

/// Pixels that differ from the background, which the upper left corner shows.
fn subject(picture: &RgbImage) -> Vec<Rgb<u8>> {
    let background = *picture.get_pixel(0, 0);
    let far = |pixel: &Rgb<u8>| pixel.0.iter().zip(background.0).any(|(a, b)| a.abs_diff(b) > 8);
    picture.pixels().copied().filter(far).collect()
}

/// Share of the picture that the subject covers.
fn coverage(picture: &RgbImage) -> f64 {
    subject(picture).len() as f64 / f64::from(picture.width() * picture.height())
}

/// Standard deviation of red's share of a pixel's light over the subject: shading moves it little, texture a lot.
fn variety(picture: &RgbImage) -> f64 {
    let share = |pixel: &Rgb<u8>| {
        let sum: f64 = pixel.0.iter().map(|part| f64::from(*part)).sum();
        f64::from(pixel.0[0]) / sum.max(1.0)
    };
    let shares: Vec<f64> = subject(picture).iter().map(share).collect();
    let count = shares.len() as f64;
    let mean = shares.iter().sum::<f64>() / count;
    (shares.iter().map(|share| (share - mean) * (share - mean)).sum::<f64>() / count).sqrt()
}

/// Mean squared difference of neighbours in a row: what blur takes away.
fn sharpness(picture: &RgbImage) -> f64 {
    let square = |(a, b): (&u8, &u8)| f64::from(a.abs_diff(*b)).powi(2);
    let row = picture.as_raw().chunks(3 * picture.width() as usize);
    let sum: f64 = row.flat_map(|row| row.iter().zip(&row[3..]).map(square)).sum();
    sum / picture.len() as f64
}

fn triangles_in(summary: &Value) -> u64 {
    summary["counts"]["triangles_in"].as_u64().unwrap_or(0)
}

/// Properties of every scene: it is in view, drawn whole, and has a cost.
fn assert_sound(results: &Results, triangles: u64, frames: u32) {
    let summary = results.summary();
    assert_eq!(summary["settings"]["triangles"].as_u64(), Some(triangles));
    let distinct = summary["modelled"]["distinct_frames"].as_u64().unwrap_or(0);
    assert!(distinct == 1 || distinct == u64::from(frames));
    assert_eq!(triangles_in(&summary), triangles * u64::from(frames));
    let set_up: u64 = ["set_up", "degenerate", "outside", "face_culled"]
        .iter()
        .filter_map(|fate| summary["counts"][format!("triangles_{fate}")].as_u64())
        .sum();
    assert_eq!(set_up, triangles * u64::from(frames), "every triangle has one fate");
    let covered = coverage(&results.image(0));
    assert!((0.03..0.9).contains(&covered), "the subject covers {covered} of the picture");
    assert!(number(&summary, "/sample_test_efficiency") > 0.0);
    assert!(number(&summary, "/truth/energy_per_pixel_j/mean") > 0.0);
}

/// The fitted camera holds the whole scene: nothing touches the border.
fn assert_whole_in_view(picture: &RgbImage) {
    let background = *picture.get_pixel(0, 0);
    let far = |pixel: &Rgb<u8>| pixel.0.iter().zip(background.0).any(|(a, b)| a.abs_diff(b) > 8);
    let bounds = lit_bounds(picture, far).expect("something is seen");
    let inside =
        bounds.x[0] > 0 && bounds.y[0] > 0 && bounds.x[1] < picture.width() && bounds.y[1] < picture.height();
    assert!(inside, "{bounds:?} touches the border");
}

#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn the_fox_runs_moves_and_wears_its_texture() {
    let fox = real_scene("Fox.glb");
    let args = ["--size", "320x180", "--frames", "0..6", "--clip", "Run"];
    let results = quintile().run(&fox, &args);
    assert_sound(&results, 576, 6);
    let picture = results.image(0);
    assert_whole_in_view(&picture);
    assert!(results.image(0) != results.image(3), "the fox stands still");
    let inputs = Inputs::new();
    let grey = format!("(objects: [(file: {fox:?}, clip: \"Run\", material: (color: (0.5, 0.5, 0.5)))])");
    let plain = quintile().run(&inputs.put("grey.ron", grey), &args[..4]);
    let (textured, grey) = (variety(&picture), variety(&plain.image(0)));
    assert!(
        textured > 0.03 && textured > 5.0 * grey,
        "colours vary by {textured}, without texture by {grey}"
    );
    assert!(results.summary()["counts"]["texture_fetches"].as_u64() > Some(10_000));
    assert!(!results.warning_codes().contains(&"missing-image".to_owned()));
}

#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn no_real_object_is_taken_for_a_room() {
    for name in [
        "AnimatedMorphCube/AnimatedMorphCube.gltf",
        "CesiumMilkTruck/CesiumMilkTruck.gltf",
        "Fox.glb",
        "MosquitoInAmber/MosquitoInAmber.gltf",
        "RiggedFigure/RiggedFigure.gltf",
        "SimpleSkin/SimpleSkin.gltf",
        "ToyCar/ToyCar.gltf",
        "cloth-ball/cloth_ball92.ply",
        "dragon_vrip_res3.ply.gz",
    ] {
        let scene = real_scene(name);
        let ended = quintile().call(["info", &scene, "--camera", "fitted: Auto", "--json"]);
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        let found: Value = serde_json::from_str(&ended.stdout).expect("JSON");
        assert_eq!(found["camera"]["side"], "Outside", "{name}");
    }
}

#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn a_shutter_that_is_open_blurs_the_fox() {
    let fox = real_scene("Fox.glb");
    let run = |shutter: &str| {
        let args =
            ["--size", "320x180", "--frames", "0..2", "--clip", "Run", "--rate", "10", "--shutter", shutter];
        quintile().run(&fox, &args)
    };
    let (open, shut) = (run("1"), run("0"));
    assert_eq!(open.summary()["modelled"]["motion"], true);
    assert_eq!(shut.summary()["modelled"]["motion"], false);
    let (open, shut) = (open.image(0), shut.image(0));
    let differing = open.pixels().zip(shut.pixels()).filter(|(a, b)| a != b).count();
    assert!(differing > 1000, "only {differing} pixels are blurred");
    let (blurred, sharp) = (sharpness(&open), sharpness(&shut));
    assert!(blurred < 0.9 * sharp, "contrast of {blurred} with, {sharp} without blur");
}

/// Frames of enough samples, V-synced, are found, each one, and cost what the simulator says. What is enough
/// is what the warning says; frames a little above it count as well.
#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn every_frame_of_the_fox_is_found_where_frames_are_long_enough() {
    let fox = real_scene("Fox.glb");
    let mut long_enough = 0;
    for (samples, seed) in [("16", "1"), ("16", "2"), ("16", "3"), ("32", "1")] {
        let settings = ["--samples", samples, "--seed", seed];
        let args = [&["--size", "640x360", "--frames", "0..6", "--lens", "4"], &settings[..]].concat();
        let results = quintile().run(&fox, &args);
        if results.warning_codes().contains(&"short-frame".to_owned()) {
            continue;
        }
        long_enough += 1;
        let summary = results.summary();
        let found = ["recall", "precision"].map(|key| number(&summary, &format!("/detection/{key}")));
        assert_eq!(found, [1.0, 1.0], "recall and precision with {settings:?}: {}", summary["detection"]);
        assert!(number(&summary, "/detection/worst_energy_error").abs() < 0.02);
    }
    assert!(long_enough > 0, "no frame is long enough to be looked at");
}

/// Whatever the length of frames: all starts are found, or a warning says that they are not.
#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn frames_that_are_missed_are_owned_up_to() {
    let fox = real_scene("Fox.glb");
    for size in ["64x36", "160x90", "320x180", "640x360"] {
        let results = quintile().run(&fox, &["--size", size, "--frames", "0..5"]);
        let detection = &results.summary()["detection"];
        let perfect = number(detection, "/recall") == 1.0 && number(detection, "/precision") == 1.0;
        let warned = results.warning_codes().contains(&"frames-missed".to_owned());
        assert!(perfect != warned, "{size}: {detection}");
    }
}

#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn the_truck_turns_its_wheels_and_says_what_it_lacks() {
    let truck = real_scene("CesiumMilkTruck/CesiumMilkTruck.gltf");
    let results = quintile().run(&truck, &["--size", "192x108", "--frames", "0..3"]);
    assert_sound(&results, 3_624, 3);
    assert_whole_in_view(&results.image(0));
    let summary = results.summary();
    assert_eq!(summary["modelled"]["motion"], true);
    let codes = results.warning_codes();
    for code in ["missing-image", "degenerate-triangle"] {
        assert!(codes.contains(&code.to_owned()), "{code} is missing in {codes:?}");
    }
}

#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn the_toy_car_of_a_hundred_thousand_triangles() {
    let car = real_scene("ToyCar/ToyCar.gltf");
    let results = quintile().run(&car, &["--size", "320x180", "--frames", "0..1"]);
    assert_sound(&results, 108_936, 1);
    assert!(results.warning_codes().contains(&"missing-image".to_owned()));
    assert_eq!(results.summary()["modelled"]["dimensions"], 2);
    let blurred = quintile().run(&car, &["--size", "320x180", "--frames", "0..1", "--lens", "0.001"]);
    assert_eq!(blurred.summary()["modelled"]["dimensions"], 4);
    assert!(results.image(0) != blurred.image(0), "the lens does nothing");
}

#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn the_dragon_from_a_gzipped_ply() {
    let dragon = real_scene("dragon_vrip_res3.ply.gz");
    let results = quintile().run(&dragon, &["--size", "192x108", "--frames", "0..1"]);
    assert_sound(&results, 47_794, 1);
    assert_whole_in_view(&results.image(0));
}

#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn two_frames_of_cloth_are_the_ends_of_a_shutter() {
    let start = real_scene("cloth-ball/cloth_ball92.ply");
    let end = start.replace("cloth_ball92", "cloth_ball93");
    let inputs = Inputs::new();
    let text = format!(
        "(settings: (width: 160, height: 120, shutter: 1, frames: (0, 1)), objects: [(file: {start:?}, end: {end:?})])"
    );
    let scene = inputs.put("cloth.ron", text);
    let moving = quintile().run(&scene, &[]);
    assert_sound(&moving, 92_230, 1);
    assert_eq!(moving.summary()["modelled"]["motion"], true);
    let frozen = quintile().run(&scene, &["--shutter", "0"]);
    assert!(moving.image(0) != frozen.image(0), "the cloth does not blur");
}
