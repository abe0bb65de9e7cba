//! What follows from where a camera looks: its near depth and its focus.

use crate::common::Files;
use workloads::{Overrides, Scene, load};

/// A sphere of radius 1 at the origin, seen by `camera`, and `others`.
fn scene(camera: &str, others: &str) -> Scene {
    let files = Files::new();
    let text = format!("(camera: ({camera}), objects: [(shape: Sphere(radius: 1)), {others}])");
    let scene = load(files.put("s.ron", text)).unwrap();
    let lens = Overrides { lens_radius: Some(1e-4), ..Overrides::default() };
    scene.with_overrides(&lens).unwrap()
}

/// Near depth and focus depth of a frame.
fn depths(scene: &Scene, frame: u32) -> [f32; 2] {
    let camera = scene.frame(frame).unwrap().camera;
    [camera.near(), camera.lens().unwrap().focus()]
}

fn assert_close(found: [f32; 2], expected: [f32; 2]) {
    let close = |(a, b): (&f32, &f32)| (a / b - 1.0).abs() < 1e-4;
    assert!(found.iter().zip(&expected).all(close), "{found:?} instead of {expected:?}");
}

#[test]
fn near_depth_and_focus_are_those_of_the_target_however_large_the_scene() {
    let camera = "position: (0, 1, 5), target: (0, 0, 0)";
    let target = 26_f32.sqrt();
    for [size, place] in [[1.0, 0.0], [8000.0, 3900.0], [16_000.0, 7000.0]] {
        let floor = format!("(shape: Plane(size: {size}), position: ({place}, -1, 0))");
        assert_close(depths(&scene(camera, &floor), 0), [1e-3 * target, target]);
    }
    let second = "(shape: Sphere(radius: 1), position: (1e4, 0, 0))";
    let there = scene("position: (1e4, 0, 5), target: (1e4, 0, 0)", second);
    assert_close(depths(&there, 0), [5e-3, 5.0]);
}

#[test]
fn an_automatic_near_depth_yields_to_what_is_in_view_and_a_given_one_does_not() {
    let near = |camera: &str| depths(&scene(camera, ""), 0)[0];
    let far_target = "position: (0, 0, 3), target: (0, 0, -9997)";
    assert!(
        (near(far_target) / 1.0 - 1.0).abs() < 0.01,
        "half the depth of the sphere: {}",
        near(far_target)
    );
    assert_eq!(near(&format!("{far_target}, near: 5")), 5.0);
    // Nothing is in view where the camera looks away.
    assert_close([near("position: (0, 0, 3), target: (0, 0, 10003)"); 2], [10.0; 2]);
    // On the surface itself there is an end.
    let touching = near("position: (0, 0, 1.0000001), target: (0, 0, -9)");
    assert!((0.99e-5..1.1e-5).contains(&touching), "{touching}");
}

/// The camera comes nearer, frame by frame, with its target far away; given back it is the same in every frame.
#[test]
fn the_near_depth_of_a_path_is_that_of_each_frame() {
    let path = "position: (0, 0, 50), target: (0, 0, -1e5), end_position: (0, 0, 2)";
    let scene = scene(path, "");
    let [first, last] = [0, 11].map(|frame| depths(&scene, frame)[0]);
    assert!(first > 20.0 && last < 4.0, "{first} {last}");
    let used = scene.camera_used().unwrap();
    assert!((used.near / f64::from(first) - 1.0).abs() < 1e-6 && used.exact);
}

/// A still camera, and something that comes nearer: the near depth of the first frame would cut it later.
#[test]
fn a_near_depth_that_may_change_is_not_given_back_as_a_number() {
    let camera = "position: (0, 0, 50), target: (0, 0, -1e5)";
    let comes = "(shape: Sphere(radius: 1), velocity: (0, 0, 240))";
    let ron = |others: &str| scene(camera, others).camera_used().unwrap().ron;
    assert!(ron("").contains("near") && !ron(comes).contains("near"), "{}", ron(comes));
    let scene = scene(camera, comes);
    assert!(depths(&scene, 11)[0] < 0.5 * depths(&scene, 0)[0]);
}
