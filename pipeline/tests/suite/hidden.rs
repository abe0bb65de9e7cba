//! Hidden surfaces by depth, facing, the near depth and time, in scenes with a known result.

use crate::common::stage::*;
use crate::common::*;
use activity::Event;
use glam::Vec3;
use pipeline::depth::DepthSpec;
use pipeline::sampling::Sample;
use pipeline::*;

/// Two planes that intersect in the middle of the image: each is visible where it is nearer.
#[test]
fn of_two_crossing_surfaces_the_nearer_is_seen() {
    let stage = Stage::sampled(64, 32, 8);
    let slope = |left: f32, right: f32| {
        let corner = |x: f32, y: f32, w: f32| Vec3::new(x * w, y * w, w);
        [
            corner(-40.0, -20.0, left),
            corner(40.0, -20.0, right),
            corner(40.0, 20.0, right),
            corner(-40.0, 20.0, left),
        ]
    };
    let (falling, rising) = (slope(2.0, 6.0), slope(6.0, 2.0));
    for draws in
        [[still(&falling, &RED), still(&rising, &BLUE)], [still(&rising, &BLUE), still(&falling, &RED)]]
    {
        let image = stage.draw(&draws);
        for (i, &pixel) in (0..).zip(&image) {
            assert_eq!(pixel, if i % 64 < 32 { RED.0 } else { BLUE.0 }, "pixel {i}");
        }
    }
}

#[test]
fn a_front_face_is_counter_clockwise_and_the_other_is_culled() {
    let stage = Stage::sampled(16, 16, 4);
    let front = rectangle([-8.0, 8.0], [-8.0, 8.0], 2.0);
    let mut back = front;
    back.swap(1, 3);
    for (corners, cull, seen) in [
        (front, Cull::None, true),
        (back, Cull::None, true),
        (front, Cull::Back, true),
        (back, Cull::Back, false),
        (front, Cull::Front, false),
        (back, Cull::Front, true),
    ] {
        let lifted = corners.map(|p| p * 1.5);
        for close in [&corners, &lifted] {
            let image = stage.draw(&[quad(&corners, close, &RED).culling(cull)]);
            assert!(image.iter().all(|&pixel| (pixel == RED.0) == seen), "{cull:?} {corners:?}");
        }
    }
}

/// A card that turns over in mid-shutter shows its front before and its back after.
#[test]
fn a_card_that_turns_over_is_culled_for_half_the_shutter() {
    let stage = Stage::sampled(32, 32, 16);
    let open = rectangle([-8.0, 8.0], [-8.0, 8.0], 2.0);
    let close = open.map(|p| Vec3::new(-p.x, p.y, p.z));
    for (cull, early) in [(Cull::Back, true), (Cull::Front, false)] {
        let mut seen = [0; 2];
        for (_, s, id, _) in stage.see(&[quad(&open, &close, &RED).culling(cull)]) {
            if id < 2 {
                assert_eq!(s.t < 0.5, early, "{cull:?} {s:?}");
                seen[usize::from(s.t < 0.5)] += 1;
            }
        }
        assert!(seen[usize::from(early)] > 500, "{seen:?}");
    }
}

/// A floor that passes through the near plane and on behind the camera is visible beyond the near depth only.
#[test]
fn the_near_depth_cuts() {
    let stage = Stage::sampled(40, 40, 8);
    // y = -1/4 throughout; depth at image row Y below the horizon is 1 / (4 |Y|) pixels.
    let floor = [(-50.0, -8.0), (50.0, -8.0), (50.0, 8.0), (-50.0, 8.0)].map(|(x, z)| Vec3::new(x, -2.0, z));
    let mut seen = 0;
    for (px, s, id, depth) in stage.see(&[still(&floor, &RED)]) {
        let [x, y] = stage.at(px, &s);
        let ideal = -2.0 / y;
        let inside = y < 0.0 && ideal < 8.0 && (x * ideal).abs() < 50.0;
        if (ideal - NEAR).abs() > 1e-4 && (ideal - 8.0).abs() > 1e-3 {
            assert_eq!(id < 2, inside && ideal > NEAR, "{px:?} {s:?} {ideal}");
            if id < 2 {
                assert!((depth - ideal).abs() < 1e-5 * ideal, "{depth} for {ideal}");
                seen += 1;
            }
        }
    }
    assert!(seen > 1000, "{seen}");
}

/// Surfaces beyond the near depth are visible; a surface exactly at it is not, even if it is about to recede.
#[test]
fn at_the_near_depth_itself_nothing_is_seen() {
    let (open, close) =
        (rectangle([-99.0, 99.0], [-99.0, 99.0], NEAR), rectangle([-99.0, 99.0], [-99.0, 99.0], 1.0));
    for (t, seen) in [(0.0, false), (f32::EPSILON, true)] {
        let samples = vec![Sample { x: 0.25, y: 0.75, u: 0.0, v: 0.0, t }; 64];
        let stage = Stage::new(8, 8, repeated(1, &samples));
        assert!(stage.see(&[quad(&open, &close, &RED)]).iter().all(|&(_, _, id, _)| (id < 2) == seen), "{t}");
    }
}

#[test]
fn a_surface_through_the_near_plane_vanishes_over_time() {
    let stage = Stage::sampled(16, 16, 16);
    let (open, close) =
        (rectangle([-99.0, 99.0], [-99.0, 99.0], 1.0), rectangle([-99.0, 99.0], [-99.0, 99.0], -0.5));
    // The depth is 1 - 3/2 t, at the near depth of 1/4 when t is 1/2; the corners pass through the lens
    // later.
    for (_, s, id, _) in stage.see(&[quad(&open, &close, &RED)]) {
        if (s.t - 0.5).abs() > 1e-5 {
            assert_eq!(id < 2, s.t < 0.5, "{s:?}");
        }
    }
}

#[test]
fn at_equal_depth_the_lowest_triangle_wins() {
    let stage = Stage::sampled(32, 32, 4);
    let corners = rectangle([-16.0, 16.0], [-16.0, 16.0], 2.0);
    let moved = corners.map(|p| p + Vec3::X * 4.0);
    // The same plane through other corners, still and moving.
    for (other, close) in
        [(corners, corners), (corners.map(|p| p - Vec3::Y * 2.0), corners), (corners, moved)]
    {
        let first = stage.draw(&[still(&corners, &RED), quad(&other, &close, &BLUE)]);
        assert!(first.iter().all(|&pixel| pixel == RED.0));
        let swapped = stage.see(&[quad(&other, &close, &BLUE), still(&corners, &RED)]);
        let hidden = swapped.iter().filter(|seen| seen.2 >= 2).count();
        let alone =
            stage.see(&[quad(&other, &close, &BLUE)]).iter().filter(|seen| seen.2 == u32::MAX).count();
        assert_eq!(hidden, alone, "blue comes first wherever it is");
    }
}

/// A curtain moves through a wall in mid-shutter.
#[test]
fn occlusion_changes_with_time() {
    let stage = Stage::sampled(24, 24, 16);
    let wall = rectangle([-99.0, 99.0], [-99.0, 99.0], 4.0);
    let [open, close] = [6.0, 2.0].map(|z| rectangle([-99.0, 99.0], [-99.0, 99.0], z));
    for draws in
        [[still(&wall, &RED), quad(&open, &close, &BLUE)], [quad(&open, &close, &BLUE), still(&wall, &RED)]]
    {
        let wall_first = draws[0].geometry.open()[0] == wall[0];
        for (_, s, id, depth) in stage.see(&draws) {
            if (s.t - 0.5).abs() > 1e-5 {
                assert_eq!((id < 2) == wall_first, s.t < 0.5, "{s:?}");
                assert!((depth - (6.0 - 4.0 * s.t).min(4.0)).abs() < 1e-5, "{s:?} {depth}");
            }
        }
        let image = stage.draw(&draws);
        let red = image.iter().map(|pixel| f64::from(pixel.x)).sum::<f64>() / 576.0;
        // Time is stratified in every pixel.
        assert_eq!(red, 0.5);
    }
}

/// A curtain moves in front of a wall in the last quarter of the shutter. With four boxes of time it is
/// tested in that quarter only, and before the wall is drawn no depth is read.
#[test]
fn boxes_of_time_cull_during_a_part_of_the_shutter() {
    let stage = Stage::sampled(32, 32, 16);
    let wall = rectangle([-99.0, 99.0], [-99.0, 99.0], 4.0);
    let [open, close] = [7.0, 3.1].map(|z| rectangle([-99.0, 99.0], [-99.0, 99.0], z));
    let draws = [still(&wall, &RED), quad(&open, &close, &BLUE)];
    let counts = |boxes: [u32; 3]| {
        let depth = DepthSpec { boxes, z_min: true, ..DepthSpec::default() };
        let spec = PipelineSpec { depth, ..spec(Features { z_max: true, ..Features::NONE }) };
        let settings =
            Settings { spec: &spec, viewport: stage.viewport, samples: &stage.table, background: Vec3::ZERO };
        RasterPass::new(&stage.camera, &draws, &settings).render(|_, _| ()).unwrap().counts
    };
    let (one, four) = (counts([1; 3]), counts([1, 1, 4]));
    let samples = 32 * 32 * 16;
    // 7 - 3.9 t is beyond 4 up to t = 0.769, in the first three quarters. Every tile sees both triangles of
    // either rectangle.
    assert_eq!(one[Event::SamplesTested], 4 * samples);
    assert_eq!(four[Event::SamplesTested], 2 * samples + 2 * samples / 4);
    assert_eq!([one[Event::BoxesCulledZMax], four[Event::BoxesCulledZMax]], [0, 3 * 2 * 16]);
    // The first triangle of the wall finds every tile empty.
    let [skipped, of_one] = [four[Event::DepthReadsSkipped], one[Event::DepthReadsSkipped]];
    assert!(skipped >= of_one && of_one > samples / 3, "{skipped} {of_one}");
    assert_eq!(four[Event::DepthWrites], one[Event::DepthWrites]);
}
