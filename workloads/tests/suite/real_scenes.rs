//! Real scenes from the folder in `QUINTILE_SCENES`; ignored where it is not set.

use std::collections::HashSet;

use glam::{DQuat, DVec3, Vec3};
use workloads::{Fingerprint, Overrides, Scene, load};

fn scene(name: &str) -> Scene {
    let path = crate::common::real_scenes().join(name);
    load(path.display().to_string()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn every_scene_has_its_triangles_and_gives_every_frame() {
    // Triangle counts of the folder's README; the eight of SimpleSkin are counted from its indices.
    let known = [
        ("ToyCar/ToyCar.gltf", 108_936, false),
        ("Fox.glb", 576, true),
        ("CesiumMilkTruck/CesiumMilkTruck.gltf", 3_624, true),
        ("RiggedFigure/RiggedFigure.gltf", 256, true),
        ("AnimatedMorphCube/AnimatedMorphCube.gltf", 12, true),
        ("SimpleSkin/SimpleSkin.gltf", 8, true),
        ("SimpleSkin/SimpleSkin-multi-joint-set.gltf", 8, true),
        ("SimpleSkin/SimpleSkin-multi-target.gltf", 8, true),
        ("MosquitoInAmber/MosquitoInAmber.gltf", 14_349, false),
        ("dragon_vrip_res2.ply.gz", 202_520, false),
        ("dragon_vrip_res3.ply.gz", 47_794, false),
        ("cloth-ball/cloth_ball92.ply", 92_230, false),
    ];
    for (name, triangles, animated) in known {
        let scene = scene(name);
        let mut prints = HashSet::new();
        for index in scene.settings().frames.clone() {
            let frame = scene.frame(index).unwrap();
            frame.draws(&scene).unwrap();
            assert_eq!(frame.triangle_count(), triangles);
            prints.insert(Fingerprint::of(&frame).unwrap());
        }
        assert_eq!((scene.triangle_count(), prints.len() > 1), (triangles, animated), "{name}");
    }
}

#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn missing_images_are_warnings_and_the_fox_has_its_own() {
    for name in
        ["ToyCar/ToyCar.gltf", "MosquitoInAmber/MosquitoInAmber.gltf", "CesiumMilkTruck/CesiumMilkTruck.gltf"]
    {
        let scene = scene(name);
        assert!(scene.warnings().iter().any(|warning| warning.code == "missing-image"), "{name}");
    }
    let fox = scene("Fox.glb");
    assert!(fox.warnings().iter().all(|warning| warning.code != "missing-image"));
    assert_eq!(fox.materials()[0].texture.as_ref().unwrap().size(), [1024, 1024]);
    assert_eq!(fox.info().unwrap().clips.len(), 3);
}

#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn simple_skin_bends_as_its_joint_turns() {
    for name in ["SimpleSkin/SimpleSkin.gltf", "SimpleSkin/SimpleSkin-multi-target.gltf"] {
        let scene = scene(name);
        let overrides = Overrides { frame_rate_hz: Some(2.0), shutter: Some(0.5), ..Overrides::default() };
        let scene = scene.with_overrides(&overrides).unwrap();
        // Keys at 0, 0.5 and 1 s: identity, then the file's (rounded) eighth and quarter turn around z.
        let keys = [(0.383f32, 0.924f32), (0.707, 0.707)]
            .map(|(z, w)| DQuat::from_xyzw(0.0, 0.0, f64::from(z), f64::from(w)).normalize());
        let frame = scene.frame(1).unwrap();
        let mesh = &frame.meshes[0];
        let bent = [(keys[0], &mesh.open), (keys[0].slerp(keys[1], 0.5), &mesh.close)];
        for (rotation, found) in bent {
            for (vertex, place) in found.iter().enumerate() {
                let rest =
                    DVec3::new(if vertex % 2 == 0 { -0.5 } else { 0.5 }, 0.5 * (vertex / 2) as f64, 0.0);
                let about_joint = rotation * (rest - DVec3::Y) + DVec3::Y;
                let weight = rest.y / 2.0;
                let expected = (1.0 - weight) * rest + weight * about_joint;
                assert!(
                    (place.as_dvec3() - expected).length() < 1e-6,
                    "{name} vertex {vertex}: {place} {expected}"
                );
            }
        }
        for foot in 0..2 {
            assert_eq!(
                mesh.open[foot].to_array().map(f32::to_bits),
                mesh.close[foot].to_array().map(f32::to_bits)
            );
        }
        assert_ne!(mesh.open[9], mesh.close[9]);
    }
}

#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn the_wheels_of_the_truck_turn_about_themselves_and_the_rest_stays() {
    let truck = scene("CesiumMilkTruck/CesiumMilkTruck.gltf");
    let frame = truck.frame(2).unwrap();
    let (wheels, body): (Vec<_>, Vec<_>) = frame.meshes.iter().partition(|mesh| !mesh.is_still());
    assert_eq!((wheels.len(), body.len()), (2, 3));
    for wheel in wheels {
        let middle = |points: &[Vec3]| points.iter().sum::<Vec3>() / points.len() as f32;
        let (from, to) = (middle(&wheel.open), middle(&wheel.close));
        assert!((from - to).length() < 1e-2, "the hub stays: {from} {to}");
    }
}

#[test]
#[cfg_attr(not(real_scenes), ignore = "QUINTILE_SCENES is not set")]
fn two_frames_of_cloth_are_two_ends_of_a_shutter() {
    let folder = crate::common::real_scenes();
    let folder = folder.join("cloth-ball");
    let text = format!(
        "(settings: (shutter: 1, frames: (0, 1)), objects: [(file: {:?}, end: {:?})])",
        folder.join("cloth_ball92.ply"),
        folder.join("cloth_ball93.ply")
    );
    let scene = load(crate::common::Files::new().put("cloth.ron", text)).unwrap();
    let ends = ["cloth_ball92.ply", "cloth_ball93.ply"]
        .map(|name| load(folder.join(name).display().to_string()).unwrap().frame(0).unwrap());
    let frame = scene.frame(0).unwrap();
    let off =
        frame.meshes[0].close.iter().zip(ends[1].meshes[0].open.iter()).map(|(a, b)| (*a - *b).length());
    assert!(off.fold(0.0, f32::max) < 1e-6);
    assert_eq!(frame.meshes[0].open, ends[0].meshes[0].open);
    assert!(!frame.meshes[0].is_still());
}
