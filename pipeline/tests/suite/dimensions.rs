//! Dropping a dimension changes nothing, and a box of lens and time removes exactly the samples outside it.

use crate::common::*;
use glam::Vec3;
use pipeline::sampling::Sample;
use pipeline::setup::{SetupResult, Triangle};
use pipeline::traversal::Box5;
use pipeline::*;
use proptest::prelude::*;

fn random_triangle(r: &mut Uniform, moving: bool) -> [MovingVertex; 3] {
    let end = |r: &mut Uniform| {
        let w = r.within(-1.0, 8.0);
        [r.within(-20.0, 20.0) * w, r.within(-20.0, 20.0) * w, w]
    };
    [(); 3].map(|()| {
        let (open, close) = (end(r), end(r));
        MovingVertex { open, close: if moving { close } else { open } }
    })
}

fn ready(probe: &Probe, vertices: [MovingVertex; 3]) -> Option<Triangle> {
    match probe.set_up(vertices, Cull::None) {
        SetupResult::Ready(triangle) => Some(triangle),
        _ => None,
    }
}

fn probe(r: &mut Uniform, optics: impl Into<Optics>, seed: u64) -> Probe {
    let Optics { lens, parallel } = optics.into();
    let table = if seed.is_multiple_of(2) {
        border_table(seed)
    } else {
        SampleTable::low_discrepancy(5, seed, LensShape::Disk).unwrap()
    };
    let s = [r.within(-20.0, 20.0), r.within(-20.0, 20.0)];
    let shear = if lens { Shear::new(s, s.map(|s| s / r.within(1.0, 8.0))) } else { Shear::default() };
    let shear = Shear { parallel, ..shear };
    Probe::new(&table, Viewport::new(20, 20).unwrap(), shear, [8, 8], 0.25)
}

type Bits = Vec<Option<u32>>;

fn bits(seen: &[Option<f32>]) -> Bits {
    seen.iter().map(|depth| depth.map(f32::to_bits)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn every_path_that_holds_the_dimensions_in_use_gives_the_same_bits(moving: bool, lens: bool, parallel: bool, seed: u64) {
        let mut r = Uniform::new(seed);
        let probe = probe(&mut r, Optics { lens, parallel }, seed);
        for _ in 0..8 {
            let Some(triangle) = ready(&probe, random_triangle(&mut r, moving)) else { continue };
            prop_assert_eq!(triangle.moving, moving);
            let (own, hits) = probe.test(&triangle, &Box5::whole(lens));
            for (with_time, with_lens) in [(moving, true), (true, lens), (true, true)] {
                let (full, same) = probe.test(&Triangle { moving: with_time, ..triangle }, &Box5::whole(with_lens));
                prop_assert_eq!(bits(&own), bits(&full));
                prop_assert_eq!(&hits, &same);
            }
        }
    }

    #[test]
    fn a_box_removes_exactly_the_samples_outside(lens: bool, parallel: bool, seed: u64) {
        let mut r = Uniform::new(seed);
        let probe = probe(&mut r, Optics { lens, parallel }, seed);
        let mut range = |lo: f32, hi: f32| {
            let ends = [r.within(lo, hi), r.within(lo, hi)];
            // Sometimes the ends are those of samples, and the box is empty.
            if r.next() < 0.3 { [0.0, 0.5] } else if r.next() < 0.1 { ends } else { [ends[0].min(ends[1]), ends[0].max(ends[1])] }
        };
        let within = Box5 { t: range(0.0, 1.0), u: range(-1.0, 1.0), v: range(-1.0, 1.0), lens };
        let vertices = random_triangle(&mut r, true);
        if let Some(triangle) = ready(&probe, vertices) {
            let inside: Vec<_> = (0..probe.samples.len).map(|slot| {
                let position = probe.at(slot);
                let holds = |c: f64, [lo, hi]: [f32; 2]| (f64::from(lo)..=f64::from(hi)).contains(&c);
                holds(position.t, within.t) && (!lens || holds(position.u, within.u) && holds(position.v, within.v))
            }).collect();
            let (all, _) = probe.test(&triangle, &Box5::whole(lens));
            let (some, hits) = probe.test(&triangle, &within);
            let expected: Vec<_> = all.iter().zip(&inside).map(|(seen, &inside)| seen.filter(|_| inside)).collect();
            prop_assert_eq!(bits(&expected), bits(&some));
            prop_assert_eq!(hits.tested as usize, inside.iter().filter(|&&inside| inside).count());
            prop_assert_eq!(hits.hit as usize, expected.iter().flatten().count());
            prop_assert_eq!(hits.written.len(), expected.iter().flatten().count());
        }
    }

    /// Scaling all lengths by a power of two changes no bit. Depth uses products of three lengths, which
    /// limits the range: vertices at 20 units from 2^-30 to 2^30 stay within the range of f32.
    #[test]
    fn scaling_by_a_power_of_two_changes_nothing(moving: bool, lens: bool, down in 1..=30_i32, up in 1..=30_i32, seed: u64) {
        let mut r = Uniform::new(seed);
        let one = probe(&mut r, lens, seed);
        let vertices = random_triangle(&mut r, moving);
        for power in [-down, up] {
            let scale = libm::exp2f(power as f32);
            let shear = Shear { s: one.shear.s.map(|s| s * scale), ..one.shear };
            let table = if seed.is_multiple_of(2) { border_table(seed) } else { SampleTable::low_discrepancy(5, seed, LensShape::Disk).unwrap() };
            let other = Probe::new(&table, Viewport::new(20, 20).unwrap(), shear, [8, 8], 0.25 * scale);
            let scaled = vertices.map(|v| MovingVertex { open: v.open.map(|c| c * scale), close: v.close.map(|c| c * scale) });
            let seen = one.see(vertices, Cull::None);
            let far = other.see(scaled, Cull::None);
            let back: Vec<_> = far.iter().map(|depth| depth.map(|depth| depth / scale)).collect();
            prop_assert_eq!(bits(&seen), bits(&back));
        }
    }

    /// Equal ends in two arrays are as still as one array.
    #[test]
    fn a_frame_of_equal_ends_is_the_frame_of_a_still_mesh(lens: bool, seed: u64) {
        let soup = Soup::new(SoupKind::Still, 40, seed);
        let twice = soup.open.clone();
        let viewport = Viewport::new(40, 24).unwrap();
        let table = SampleTable::low_discrepancy(4, seed, LensShape::Disk).unwrap();
        let spec = spec(Features::ALL);
        let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
        let see = |close| {
            let geometry = Geometry::new(&soup.open, close, &soup.triangles).unwrap();
            RasterPass::new(&camera(lens), &[Draw::new(geometry, &Plain, Cull::None)], &settings).visibility().unwrap()
        };
        prop_assert_eq!(see(&soup.open), see(&twice));
    }
}

/// A single vertex that moves by the smallest amount takes the triangle off the still path. Before it has
/// moved, the result is that of the still triangle.
#[test]
fn a_triangle_that_moves_late_starts_like_a_still_one() {
    let mut r = Uniform::new(9);
    let block: Vec<_> =
        (0..64).map(|_| Sample { x: r.next(), y: r.next(), u: 0.0, v: 0.0, t: 0.0 }).collect();
    let probe =
        Probe::new(&repeated(1, &block), Viewport::new(8, 8).unwrap(), Shear::default(), [0, 0], 0.25);
    let mut hits = 0;
    for _ in 0..500 {
        let still = random_triangle(&mut r, false);
        let moving = still.map(|v| MovingVertex { close: v.open.map(|c| c + 1.0), ..v });
        let [a, b] = [still, moving].map(|v| bits(&probe.see(v, Cull::None)));
        hits += a.iter().flatten().count();
        assert_eq!(a, b);
    }
    assert!(hits > 500, "{hits}");
}
