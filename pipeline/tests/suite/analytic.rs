//! Images with a known closed form.
//!
//! Sampling errors are compared with four times the error of independent samples, `sqrt(p (1 - p) / n)` for a
//! share `p` of `n` samples. The low-discrepancy table is stratified within a pixel and scrambled anew in the
//! next, so its error is smaller.

use crate::common::stage::*;
use crate::common::*;
use glam::{Affine3A, Vec2, Vec3};
use pipeline::sampling::Sample;
use pipeline::*;

/// Four times the error of `n` independent samples with hit probability `p`.
fn four_sigma(p: f64, n: f64) -> f64 {
    4.0 * (p * (1.0 - p) / n).sqrt()
}

#[test]
fn a_quad_over_the_whole_image_covers_every_sample() {
    let stage = Stage::sampled(45, 31, 8);
    let corners = rectangle([-22.5, 22.5], [-15.5, 15.5], 3.0);
    assert!(stage.draw(&[still(&corners, &RED)]).iter().all(|&pixel| pixel == RED.0));
    assert!(stage.see(&[still(&corners, &RED)]).iter().all(|&(_, _, id, depth)| id < 2 && depth == 3.0));
}

#[test]
fn half_a_plane_covers_half_the_image() {
    let stage = Stage::sampled(40, 24, 8);
    let corners = rectangle([-4000.0, 0.0], [-4000.0, 4000.0], 1.0);
    let image = stage.draw(&[still(&corners, &RED)]);
    for y in 0..24 {
        for x in 0..40 {
            let expected = if x < 20 { RED.0 } else { Vec3::ZERO };
            assert_eq!(stage.pixel(&image, x, y), expected, "pixel {x}, {y}");
        }
    }
}

#[test]
fn an_edge_through_the_middle_of_pixels_covers_half_of_them() {
    let stage = Stage::sampled(33, 33, 64);
    let corners = rectangle([-50.0, 0.0], [-50.0, 50.0], 2.0);
    let image = stage.draw(&[still(&corners, &RED)]);
    for y in 0..33 {
        // The samples of a pixel are stratified in x.
        assert_eq!(stage.pixel(&image, 16, y).x, 0.5);
        assert_eq!([15, 17].map(|x| stage.pixel(&image, x, y).x), [1.0, 0.0]);
    }
}

/// A square of 16 pixels moves by `way` pixels to the right. At its right side, pixel `k` is covered from the
/// time the edge passes, a ramp of `1 - (k + 1/2) / way`.
#[test]
fn motion_is_a_linear_ramp_of_coverage() {
    for way in [1, 4, 8] {
        let stage = Stage::sampled(40, 40, 64);
        let open = rectangle([-8.0, 8.0], [-16.0, 16.0], 4.0);
        let close = open.map(|p| p + Vec3::X * 4.0 * way as f32);
        let image = stage.draw(&[quad(&open, &close, &RED)]);
        for k in 0..way {
            let expected = 1.0 - (f64::from(k) + 0.5) / f64::from(way);
            let mean = |column: u32| {
                (4..36).map(|y| f64::from(stage.pixel(&image, column, y).x)).sum::<f64>() / 32.0
            };
            let (leading, trailing) = (mean(28 + k), mean(12 + k));
            let bound = four_sigma(expected, 32.0 * 64.0);
            assert!((leading - expected).abs() < bound, "pixel {k} of {way}: {leading} for {expected}");
            assert!((trailing - (1.0 - expected)).abs() < bound, "pixel {k} of {way}: {trailing}");
        }
        for (px, s, id, _) in stage.see(&[quad(&open, &close, &RED)]) {
            let [x, y] = stage.at(px, &s);
            let from_edge = [-8.0, 8.0].map(|edge| x - (edge + s.t * way as f32));
            if y.abs() < 15.9 && from_edge.iter().all(|d| d.abs() > 1e-4) {
                assert_eq!(id < 2, from_edge[0] > 0.0 && from_edge[1] < 0.0, "{px:?} {s:?}");
            }
        }
    }
}

/// A quad of 4x4 pixels out of focus is a uniform disk with the radius of the circle of confusion, and no
/// light is lost.
#[test]
fn a_point_out_of_focus_is_a_disk_of_the_circle_of_confusion() {
    for (depth, focus) in [(4.0_f32, 8.0_f32), (16.0, 8.0), (8.0, 8.0)] {
        let mut stage = Stage::sampled(64, 64, 64);
        let radius = 100.0_f32;
        stage.camera = stage.camera.with_lens(Some(Lens::new(radius, focus).unwrap()));
        let circle = f64::from((radius / focus - radius / depth).abs());
        let side = 4.0;
        let corners = rectangle([-0.5 * side, 0.5 * side], [-0.5 * side, 0.5 * side], depth);
        let image = stage.draw(&[still(&corners, &RED)]);
        let (mut light, mut inner, mut widest) = (0.0, 0.0, 0.0_f64);
        for (i, pixel) in (0_u32..).zip(&image) {
            let away = [i % 64, i / 64].map(|c| (f64::from(c) - 31.5).abs());
            let distance = away[0].hypot(away[1]);
            light += f64::from(pixel.x);
            inner += if distance < 0.5 * circle { f64::from(pixel.x) } else { 0.0 };
            widest = if pixel.x > 0.0 { widest.max(distance) } else { widest };
        }
        let area = f64::from(side * side);
        if circle == 0.0 {
            assert_eq!(light, area, "in focus it is the quad itself");
            continue;
        }
        let disk = std::f64::consts::PI * circle * circle;
        let bound = area * four_sigma(area / disk, 64.0 * disk) / (area / disk);
        assert!((light - area).abs() < bound, "{light} of {area} at {depth}, bound {bound}");
        let reach = circle + f64::from(side) * std::f64::consts::FRAC_1_SQRT_2;
        assert!(widest < reach + 1.0 && widest > circle - 1.0, "{widest} for a circle of {circle}");
        // A uniform disk has a quarter of its light within half its radius; the pixel width blurs that
        // circle.
        let hits = 64.0 * area;
        let slack = four_sigma(0.25, hits) + 2.0 / circle;
        assert!((inner / light - 0.25).abs() < slack, "{} within half the radius", inner / light);
    }
}

/// Points nearer and farther than the focus move to opposite sides with the lens position.
#[test]
fn the_visible_point_depends_on_the_lens_position() {
    let lens = [0.5, -0.25];
    let block = vec![Sample { x: 0.5, y: 0.5, u: lens[0], v: lens[1], t: 0.0 }; 64];
    let mut stage = Stage::new(40, 40, repeated(1, &block));
    stage.camera = stage.camera.with_lens(Some(Lens::new(64.0, 8.0).unwrap()));
    for depth in [4.0_f32, 8.0, 16.0] {
        let corners = rectangle([-2.0, 2.0], [-2.0, 2.0], depth);
        let image = stage.draw(&[still(&corners, &RED)]);
        // x' = x + u (s / F - s / w), to the right and upwards.
        let moved = lens.map(|c| c * (64.0 / 8.0 - 64.0 / depth));
        let lit: Vec<_> = (0..1600_u32).filter(|&i| image[i as usize].x > 0.0).collect();
        let mean = |part: &dyn Fn(u32) -> u32| {
            lit.iter().map(|&i| f64::from(part(i)) + 0.5).sum::<f64>() / lit.len() as f64
        };
        assert_eq!(lit.len(), 16, "depth {depth}");
        assert_eq!(mean(&|i| i % 40), 20.0 + f64::from(moved[0]), "depth {depth}");
        assert_eq!(mean(&|i| i / 40), 20.0 - f64::from(moved[1]), "depth {depth}");
    }
}

/// A dyadic scene of many quads and a table that is the same in every pixel, so nothing rounds.
fn dyadic(seed: u64) -> (Vec<Vec3>, Vec<[u32; 3]>, Stage) {
    let mut r = Uniform::new(seed);
    let (mut corners, mut triangles) = (Vec::new(), Vec::new());
    for quad in 0..30 {
        let mut eighth = |lo: f32, hi: f32| (8.0 * r.within(lo, hi)).round() / 8.0;
        let (x, y, z) = (eighth(-20.0, 20.0), eighth(-12.0, 12.0), [1.0, 2.0, 4.0][quad as usize % 3]);
        corners.extend(rectangle([x, x + eighth(0.5, 9.0)], [y, y + eighth(0.5, 9.0)], z));
        triangles.extend(QUAD.map(|t| t.map(|k| 4 * quad + k)));
    }
    let mut part = |lo: f32, hi: f32, steps: f32| (r.within(lo, hi) * steps).floor() / steps;
    let block: Vec<_> = (0..4)
        .map(|_| Sample {
            x: part(0.0, 1.0, 16.0),
            y: part(0.0, 1.0, 16.0),
            u: part(-1.0, 1.0, 8.0),
            v: part(-1.0, 1.0, 8.0),
            t: part(0.0, 1.0, 8.0),
        })
        .collect();
    (corners, triangles, Stage::new(64, 40, repeated(4, &block.repeat(64))))
}

#[test]
fn an_off_centre_frustum_moves_the_image_by_whole_pixels() {
    for (right, down) in [(5, 0), (0, 3), (-4, 2)] {
        let (corners, triangles, mut stage) = dyadic(4);
        stage.camera = stage.camera.with_lens(Some(Lens::new(8.0, 2.0).unwrap()));
        let geometry = Geometry::new(&corners, &corners, &triangles).unwrap();
        let draws = [Draw::new(geometry, &Plain, Cull::None)];
        let centred = stage.see(&draws);
        let shift = Vec2::new(right as f32, down as f32) / 40.0;
        stage.camera = stage.camera.with_shift(shift).unwrap();
        let moved = stage.see(&draws);
        let key = |&([x, y], s, ..): &([u32; 2], Sample, u32, f32)| {
            (y, x, s.t.to_bits(), s.x.to_bits(), s.y.to_bits())
        };
        let mut compared = 0;
        for from in &centred {
            let [x, y] = [from.0[0] as i32 + right, from.0[1] as i32 + down];
            if (0..64).contains(&x) && (0..40).contains(&y) {
                let target = ([x as u32, y as u32], from.1, 0, 0.0);
                let to = moved.iter().filter(|to| key(to) == key(&target));
                assert!(to.into_iter().any(|to| (to.2, to.3) == (from.2, from.3)), "{from:?}");
                compared += u32::from(from.2 != u32::MAX);
            }
        }
        assert!(compared > 1000, "{compared}");
    }
}

#[test]
fn a_moving_camera_is_a_scene_that_moves_the_other_way() {
    let (corners, triangles, stage) = dyadic(6);
    for (way, lens) in
        [(Vec3::new(1.5, -0.75, 0.0), None), (Vec3::new(-0.5, 2.0, 0.25), Lens::new(8.0, 2.0).ok())]
    {
        let mut fixed = Stage { camera: stage.camera.with_lens(lens), ..dyadic(6).2 };
        let close: Vec<_> = corners.iter().map(|&p| p + way).collect();
        let scene = Geometry::new(&corners, &close, &triangles).unwrap();
        let moving_scene = fixed.see(&[Draw::new(scene, &Plain, Cull::None)]);
        let travel = Affine3A::from_translation(way);
        fixed.camera = fixed.camera.moving(Affine3A::IDENTITY, travel).unwrap();
        let still = Geometry::new(&corners, &corners, &triangles).unwrap();
        let moving_camera = fixed.see(&[Draw::new(still, &Plain, Cull::None)]);
        assert!(moving_scene == moving_camera);
        assert!(moving_scene.iter().filter(|seen| seen.2 != u32::MAX).count() > 1000);
    }
}
