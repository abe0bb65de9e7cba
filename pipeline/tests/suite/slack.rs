//! Rounding allowance of set-up for a vertex as a sample sees it, compared with the exact position, with one
//! dominant term.

use crate::common::*;
use pipeline::sampling::{Sample, TileSamples};
use pipeline::setup::{Corner, SetupResult};
use pipeline::*;

/// Dominant term: vertex position, image position, lens at depth zero, lens per unit of depth.
#[derive(Clone, Copy, Debug)]
enum Large {
    Vertex,
    Image,
    Base,
    Slope,
    All,
}

struct Setting {
    probe: Probe,
    triangle: [MovingVertex; 3],
}

fn setting(r: &mut Uniform, large: Large, moving: bool, parallel: bool, seed: u64) -> Setting {
    let image = matches!(large, Large::Image | Large::All);
    let side = if image { Viewport::MAX_PX } else { 8 };
    let size = |dominant: bool| if dominant { 4096.0 } else { 1e-3 };
    let [vertex, base, slope] = [
        matches!(large, Large::Vertex | Large::All),
        matches!(large, Large::Base | Large::All),
        matches!(large, Large::Slope | Large::All),
    ]
    .map(size);
    let mut end = || [r.within(-vertex, vertex), r.within(-vertex, vertex), r.within(0.5, 1.0)];
    let triangle = [(); 3].map(|()| {
        let open = end();
        MovingVertex { open, close: if moving { end() } else { open } }
    });
    let [s, a] = [base, slope].map(|c| [(); 2].map(|()| r.within(-c, c)));
    let shear = Shear { parallel, ..Shear::new(s, a) };
    let samples: Vec<_> = (0..64)
        .map(|_| Sample {
            x: r.next(),
            y: r.next(),
            u: r.within(-1.0, 1.0),
            v: r.within(-1.0, 1.0),
            t: r.next(),
        })
        .collect();
    let origin = [0, if seed.is_multiple_of(2) { side - 8 } else { 0 }];
    let probe = Probe::new(&repeated(1, &samples), Viewport::new(side, side).unwrap(), shear, origin, 0.25);
    Setting { probe, triangle }
}

/// A vertex as the sample in `slot` sees it, with the operations of the sample test in their order.
fn seen(corner: &Corner, samples: &TileSamples, slot: usize) -> [f32; 2] {
    let at = corner.at(samples.t[slot]);
    [0, 1].map(|axis| (-samples.slope[axis][slot]).mul_add(at[2], at[axis] - samples.lens[axis][slot]))
}

/// Largest error of a vertex over half the slack, its bound.
fn worst(large: Large, moving: bool, parallel: bool) -> f64 {
    let mut worst = 0.0_f64;
    for seed in 0..400 {
        let Setting { probe, triangle } = setting(&mut Uniform::new(seed), large, moving, parallel, seed);
        let SetupResult::Ready(ready) = probe.set_up(triangle, Cull::None) else { continue };
        for slot in 0..probe.samples.len {
            let position = probe.at(slot);
            for corner in &ready.corners {
                let seen = seen(corner, &probe.samples, slot);
                let at =
                    |axis: usize| f64::from(corner.open[axis]) + position.t * f64::from(corner.delta[axis]);
                let weight = weight(&probe.shear, at(2));
                for (axis, place, lens) in [(0, position.x, position.u), (1, position.y, position.v)] {
                    let [s, a] = [probe.shear.s, probe.shear.a].map(|c| f64::from(c[axis]));
                    let exact = at(axis) + lens * (a * at(2) - s) - place * weight;
                    let error = (f64::from(seen[axis]) - exact).abs();
                    worst = worst.max(error / (0.5 * f64::from(ready.slack[axis])));
                }
            }
        }
    }
    worst
}

/// No vertex is off by more than half the slack, and for each dominant term some vertices use a good part of
/// it.
#[test]
fn half_the_slack_is_enough_and_each_of_its_terms_is_needed() {
    for large in [Large::Vertex, Large::Image, Large::Base, Large::Slope, Large::All] {
        for [moving, parallel] in [[false, false], [false, true], [true, false], [true, true]] {
            let worst = worst(large, moving, parallel);
            println!("{large:?}, moving {moving}, parallel {parallel}: {worst}");
            assert!(worst <= 1.0, "{large:?}, moving {moving}, parallel {parallel}: {worst}");
            assert!(worst > 1.0 / 16.0, "{large:?}, moving {moving}, parallel {parallel}: {worst}");
        }
    }
}
