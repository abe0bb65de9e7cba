//! Triangles dropped by set-up have no visible sample.

use crate::common::case::*;
use crate::common::*;
use pipeline::setup::SetupResult;
use pipeline::*;

/// Triangles dropped by set-up have no visible sample.
#[test]
fn set_up_drops_nothing_that_a_sample_sees() {
    let mut dropped = [0; 2];
    for seed in 0..2400_u64 {
        let bit = |k: u32| seed >> k & 1 == 1;
        let case = Case {
            moving: false,
            lens: false,
            parallel: bit(0),
            behind: bit(2),
            far: bit(3),
            sliver: bit(4),
            scale: (seed % 5) as i32 - 2,
        };
        let Setting { mut triangle, probe } = setting(case, seed);
        // Small in the image and large in depth: where it passes through the camera plane, samples see it at
        // a large distance.
        let small = libm::exp2f(-((seed / 32 % 13) as f32));
        for vertex in &mut triangle {
            let [x, y, w] = vertex.open;
            let open = [x * small, y * small, w];
            *vertex = MovingVertex { open, close: open };
        }
        for cull in [Cull::Back, Cull::Front] {
            let (SetupResult::FaceCulled | SetupResult::Outside, SetupResult::Ready(mut ready)) =
                (probe.set_up(triangle, cull), probe.set_up(triangle, Cull::None))
            else {
                continue;
            };
            ready.faces = [cull != Cull::Back, cull != Cull::Front];
            dropped[usize::from(cull == Cull::Back)] += 1;
            let (seen, _) = probe.test(&ready, &probe.whole());
            assert!(seen.iter().all(Option::is_none), "seed {seed} {cull:?} {triangle:?}");
        }
    }
    assert!(dropped.iter().all(|&count| count > 200), "{dropped:?}");
}

/// The same for triangles that pass through the camera plane just behind a sample. Their determinant is
/// small, but the terms of the sample test are not.
#[test]
fn set_up_drops_nothing_seen_close_to_the_camera_plane() {
    let mut r = Uniform::new(3);
    let table = SampleTable::low_discrepancy(4, 1, LensShape::Disk).unwrap();
    let mut dropped = 0;
    for _ in 0..12_000 {
        let depth = libm::exp2f(r.within(-14.0, 0.0));
        let probe = Probe::new(&table, Viewport::new(8, 8).unwrap(), Shear::default(), [0, 0], 0.5 * depth);
        let position = probe.at((r.next() * probe.samples.len as f32) as usize);
        let seen = [position.x, position.y, 1.0].map(|c| c as f32 * depth);
        let flat = libm::exp2f(r.within(-10.0, 1.0));
        let mut side = || [r.within(-1.0, 1.0) * flat, r.within(-1.0, 1.0) * flat, r.within(-1.0, 1.0)];
        let (a, b) = (side(), side());
        let corner = |k: usize| -> [f32; 3] {
            std::array::from_fn(|axis| seen[axis] + [a[axis], b[axis], -a[axis] - b[axis]][k])
        };
        let triangle = [0, 1, 2].map(|k| MovingVertex { open: corner(k), close: corner(k) });
        for cull in [Cull::Back, Cull::Front] {
            let (SetupResult::FaceCulled, SetupResult::Ready(mut ready)) =
                (probe.set_up(triangle, cull), probe.set_up(triangle, Cull::None))
            else {
                continue;
            };
            dropped += 1;
            ready.faces = [cull != Cull::Back, cull != Cull::Front];
            let (seen, _) = probe.test(&ready, &probe.whole());
            let slot = seen.iter().position(Option::is_some);
            assert_eq!(slot.map(|s| (s, probe.at(s))), None, "{cull:?} {triangle:?} near {}", 0.5 * depth);
        }
    }
    assert!(dropped > 400, "{dropped}");
}

/// Collinear when the shutter opens and, on another line, when it closes, but wide in between.
#[test]
fn a_triangle_without_area_at_both_ends_is_seen_in_between() {
    let along = |x: f32, y: f32| [16.0 * x - 4.0, 16.0 * y - 4.0, 1.0];
    let corner = |open: f32, close: f32| MovingVertex { open: along(open, 0.0), close: along(0.0, close) };
    let triangle = [corner(0.0, 0.0), corner(1.0, 2.0), corner(2.0, 1.0)];
    let table = SampleTable::low_discrepancy(16, 1, LensShape::Disk).unwrap();
    let probe = Probe::new(&table, Viewport::new(8, 8).unwrap(), Shear::default(), [0, 0], 0.25);
    assert!(probe.see(triangle, Cull::None).iter().flatten().count() > 50);
}
