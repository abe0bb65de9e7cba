//! Culling changes nothing on the failure catalogue: for every family, value and combination of tests, each
//! sample sees the same as by brute force.

use glam::Vec3;
use pipeline::geometry::Projection;
use pipeline::setup::Triangle;
use pipeline::traversal::{Box5, TileRect, narrow};
use pipeline::{Features, PipelineSpec, RasterPass, Settings};
use workloads::stress::{Family, Size, StressScene, brute_force, families, family, within_bounds};
use workloads::visibility::Unshaded;

const NO_TRIANGLE: u32 = u32::MAX;
const SMALL: Size = Size { side_px: 32, triangles: 30 };

/// No test, each test alone, all but each, all, and all that pay off.
fn combinations() -> impl Iterator<Item = Features> {
    let alone = [
        Features { lens_lines: true, ..Features::NONE },
        Features { side_planes: true, ..Features::NONE },
        Features { facing: true, facing_splits: 3, ..Features::NONE },
        Features { edges: true, ..Features::NONE },
        Features { edges: true, coarse: true, ..Features::NONE },
        Features { screen: true, ..Features::NONE },
        Features { z_max: true, ..Features::NONE },
    ];
    let without = [
        Features { lens_lines: false, ..Features::ALL },
        Features { side_planes: false, ..Features::ALL },
        Features { facing: false, ..Features::ALL },
        Features { edges: false, ..Features::ALL },
        Features { coarse: false, ..Features::ALL },
        Features { screen: false, ..Features::ALL },
        Features { z_max: false, ..Features::ALL },
    ];
    let whole = [Features::NONE, Features::ALL, Features { auto: true, ..Features::ALL }];
    alone.into_iter().chain(without).chain(whole)
}

fn seen(scene: &StressScene, features: Features) -> Vec<(u32, u32)> {
    let spec = PipelineSpec { features, ..crate::common::spec() };
    let (viewport, samples) = (scene.viewport, &scene.samples);
    let settings = Settings { spec: &spec, viewport, samples, background: Vec3::ZERO };
    RasterPass::new(&scene.camera, &[scene.draw(&Unshaded).unwrap()], &settings).visibility().unwrap()
}

fn truth(scene: &StressScene) -> Vec<(u32, u32)> {
    brute_force(&scene.camera, &[scene.draw(&Unshaded).unwrap()], scene.viewport, &scene.samples)
}

fn differ(a: &[(u32, u32)], b: &[(u32, u32)]) -> usize {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).filter(|(a, b)| a != b).count()
}

/// Compares every value of a family, in every combination of tests, with brute force; returns the number of
/// covered samples.
fn compare(family: &Family) -> usize {
    let mut hits = 0;
    for (&value, seed) in family.sweep(true).iter().zip(1..) {
        let scene = family.scene(value, SMALL, seed).unwrap();
        let truth = truth(&scene);
        hits += truth.iter().filter(|(triangle, _)| *triangle != NO_TRIANGLE).count();
        for features in combinations() {
            let lost = differ(&seen(&scene, features), &truth);
            assert_eq!(lost, 0, "{} at {value} with {features:?}", family.name);
        }
    }
    hits
}

#[test]
fn no_combination_of_tests_loses_a_sample() {
    for family in families() {
        let hits = compare(family);
        assert!(hits > 200, "only {hits} samples see anything of {}: it shows little", family.name);
    }
}

/// An interval without its first 2 %.
fn short([lo, hi]: [f32; 2]) -> [f32; 2] {
    [lo + 0.02 * (hi - lo), hi]
}

/// A deliberately wrong bound: modifies the box that the side planes leave.
type Mutant = fn(Box5) -> Option<Box5>;

fn lost_to(mutant: Mutant, name: &str) -> usize {
    let family = family(name).unwrap();
    let scene = family.scene(family.values[2], SMALL, 1).unwrap();
    let shear = Projection::new(&scene.camera, scene.viewport).shear;
    let bound = |triangle: &Triangle, tile: &TileRect| {
        narrow(triangle, &shear, tile, &Box5::whole(!shear.is_none())).and_then(mutant)
    };
    let draws = [scene.draw(&Unshaded).unwrap()];
    let seen = within_bounds(&scene.camera, &draws, scene.viewport, &scene.samples, bound);
    differ(&seen, &truth(&scene))
}

#[test]
fn a_wrong_bound_is_noticed_and_a_right_one_is_not() {
    let mutants: [(Mutant, &[&str]); 4] = [
        (|b| Some(Box5 { t: short(b.t), ..b }), &["speed", "zero-area", "large-lens"]),
        (|b| Some(Box5 { u: short(b.u), ..b }), &["large-lens", "through-lens"]),
        (|b| Some(Box5 { v: short(b.v), ..b }), &["large-lens", "through-lens"]),
        (|b| (b.t[1] - b.t[0] > 0.6).then_some(b), &["speed"]),
    ];
    for (place, (mutant, names)) in mutants.into_iter().enumerate() {
        for name in names {
            assert_eq!(lost_to(Some, name), 0, "{name}");
            assert!(lost_to(mutant, name) > 0, "{name} does not notice mutant {place}");
        }
    }
}

#[test]
fn results_do_not_depend_on_threads() {
    let at = |threads: usize, scene: &StressScene| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| seen(scene, Features::ALL))
    };
    for family in families() {
        let scene = family.scene(family.values[family.values.len() / 2], SMALL, 3).unwrap();
        assert_eq!(at(1, &scene), at(3, &scene), "{}", family.name);
    }
}

/// The camera is inside a closed surface, so every sample sees it at every lens position and time. A hole at
/// a shared edge would let a sample through.
#[test]
fn no_sample_escapes_a_closed_surface() {
    let family = family("inside-closed").unwrap();
    for &value in family.values {
        let scene = family.scene(value, Size { side_px: 64, triangles: 0 }, 1).unwrap();
        for features in [Features::NONE, Features::ALL] {
            let out = seen(&scene, features).iter().filter(|(triangle, _)| *triangle == NO_TRIANGLE).count();
            assert_eq!(out, 0, "{out} samples look out at {value}");
        }
    }
}

/// Each sample of the grid belongs to one triangle: triangles drawn one by one cover together what they cover
/// in one draw.
#[test]
fn samples_on_shared_edges_and_vertices_have_one_owner() {
    let family = family("shared-edges").unwrap();
    for &cell_px in family.values {
        let scene = family.scene(cell_px, SMALL, 1).unwrap();
        let mut owners = vec![0; seen(&scene, Features::ALL).len()];
        for corners in &scene.triangles {
            let alone = StressScene { triangles: vec![*corners], ..scene.clone() };
            for (count, (triangle, _)) in owners.iter_mut().zip(seen(&alone, Features::ALL)) {
                *count += u32::from(triangle != NO_TRIANGLE);
            }
        }
        let together = seen(&scene, Features::ALL);
        let reach = (0.75 * 32.0 / cell_px).floor() * cell_px;
        for (place, (count, (triangle, _))) in owners.iter().zip(together).enumerate() {
            let [x, y] = [place / 4 % 32, place / 4 / 32].map(|pixel| pixel as f64 - 16.0);
            let sample = scene.samples.pixel((x + 16.0) as u32, (y + 16.0) as u32)[place % 4];
            let [dx, dy, u, v, t] = [sample.x, sample.y, sample.u, sample.v, sample.t].map(f64::from);
            // Half-open rule: the sample is moved by an infinitesimal step towards +x and, smaller still, +y.
            let at = [x + dx - u - 2.0 * t, y + dy + v - 2.0 * t].map(|c| c + 0.5 * reach);
            let expected = at.iter().all(|c| (0.0..reach).contains(c));
            assert_eq!(*count, u32::from(expected), "cells of {cell_px} pixels: {at:?} {sample:?}");
            assert_eq!(*count, u32::from(triangle != NO_TRIANGLE), "cells of {cell_px} pixels");
        }
    }
}
