//! Properties of the built-in and the example scenes.

use std::sync::Arc;

use workloads::{Scene, load};

fn positions(scene: &Scene) -> Vec<u32> {
    let frames = scene.settings().frames.clone().map(|index| scene.frame(index).unwrap());
    frames
        .flat_map(|frame| frame.meshes)
        .flat_map(|mesh| {
            mesh.open.iter().chain(mesh.close.iter()).flat_map(|p| p.to_array()).collect::<Vec<_>>()
        })
        .map(f32::to_bits)
        .collect()
}

#[test]
fn every_built_in_scene_loads_and_draws() {
    for (name, description) in workloads::builtin_names() {
        let scene = load(name).unwrap();
        assert!(!description.is_empty() && scene.warnings().is_empty());
        let frame = scene.frame(scene.settings().frames.start).unwrap();
        assert!(!frame.draws(&scene).unwrap().is_empty());
    }
}

#[test]
fn the_default_scene_matches_its_description() {
    let scene = load("default").unwrap();
    let settings = scene.settings();
    assert_eq!((settings.width, settings.height, settings.frames.clone()), (1280, 720, 0..36));
    assert_eq!((settings.frame_rate_hz, settings.shutter, settings.samples), (60.0, 0.5, 8));
    assert!((20_000..=60_000).contains(&scene.triangle_count()), "{}", scene.triangle_count());
    let frame = scene.frame(3).unwrap();
    assert!(frame.camera.lens().is_some());
    assert!(
        frame.meshes.iter().any(|mesh| !mesh.is_still()) && frame.meshes.iter().any(|mesh| mesh.is_still())
    );
}

#[test]
fn the_tiny_scene_has_motion_lens_and_texture_in_few_triangles() {
    let scene = load("tiny").unwrap();
    assert!(scene.triangle_count() <= 64);
    let frame = scene.frame(0).unwrap();
    assert!(frame.camera.lens().is_some() && frame.meshes.iter().any(|mesh| !mesh.is_still()));
    assert!(scene.materials().iter().any(|material| material.texture.is_some()));
}

#[test]
fn scenes_are_deterministic() {
    for name in ["default", "tiny"] {
        assert_eq!(positions(&load(name).unwrap()), positions(&load(name).unwrap()));
    }
}

#[test]
fn still_meshes_are_shared_between_frames() {
    let scene = load("default").unwrap();
    let (first, second) = (scene.frame(0).unwrap(), scene.frame(1).unwrap());
    for (one, two) in first.meshes.iter().zip(&second.meshes) {
        assert_eq!(one.is_still(), Arc::ptr_eq(&one.open, &two.open), "{}", one.name);
    }
}

#[test]
fn the_example_files_load() {
    for name in ["pendulum", "carousel"] {
        let scene = load(format!("{}/scenes/{name}.ron", env!("CARGO_MANIFEST_DIR"))).unwrap();
        assert_eq!(scene.name(), name);
        assert!(scene.warnings().is_empty(), "{:?}", scene.warnings());
        let frame = scene.frame(1).unwrap();
        assert_eq!(frame.draws(&scene).unwrap().len(), frame.meshes.len());
    }
}
