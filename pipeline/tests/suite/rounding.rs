//! No tile test rejects a sample that the sample test accepts, in the hardest case: a box of exactly one
//! sample, on an edge of a triangle within f32 precision. There only the rounding allowance of a test is
//! left.

use crate::common::case::{Case, NEAR, cases, setting};
use crate::common::*;
use pipeline::sample_test::{Hits, SampleTest, StoredSamples, VectorWidth};
use pipeline::setup::{SetupResult, Triangle};
use pipeline::traversal::*;
use pipeline::*;
use proptest::prelude::*;

/// Number of hits on the outer side of an edge in exact arithmetic.
struct Found {
    hits: u32,
    beyond: u32,
}

fn hold(case: Case, seed: u64) -> Found {
    let setting = setting(case, seed);
    let probe = &setting.probe;
    let mut found = Found { hits: 0, beyond: 0 };
    let SetupResult::Ready(triangle) = probe.set_up(setting.triangle, Cull::None) else { return found };
    let near = NEAR * libm::exp2f(case.scale as f32);
    let lines = LensLines::<f64>::new(&triangle, &probe.shear, near);
    let (seen, _) = probe.test(&triangle, &probe.whole());
    for slot in (0..seen.len()).filter(|&slot| seen[slot].is_some()) {
        found.hits += 1;
        let s = &probe.samples;
        let (point, lens) = (|value: f32| [value, value], !probe.shear.is_none());
        let tile = TileRect { x: point(s.x[slot]), y: point(s.y[slot]) };
        let [u, v] = if lens { [point(s.u[slot]), point(s.v[slot])] } else { [[-1.0, 1.0]; 2] };
        let within = Box5 { u, v, t: point(s.t[slot]), lens };
        let context = format!("{case:?} {seed} slot {slot}");
        assert_eq!(narrow(&triangle, &probe.shear, &tile, &within), Some(within), "side planes: {context}");
        assert_eq!(lines.narrow(&tile, &within).0, Some(within), "lens lines: {context}");
        found.beyond += u32::from(edges_keep(&triangle, probe, &tile, &within, &context));
    }
    found
}

/// Facing, edge bounds and screens over one sample, with either face drawn. Returns whether the exact edges
/// reject it.
fn edges_keep(triangle: &Triangle, probe: &Probe, tile: &TileRect, within: &Box5, context: &str) -> bool {
    let edges = Edges::<f64>::new(TileView::new(triangle, &probe.shear, tile, within));
    let slot = (0..probe.samples.len)
        .find(|&slot| {
            [probe.samples.x[slot], probe.samples.y[slot], probe.samples.t[slot]]
                == [tile.x[0], tile.y[0], within.t[0]]
        })
        .unwrap();
    let signs = exact_signs(triangle, probe, slot);
    // Screens take positions from the middle of their tile, which is smaller here.
    let mut samples = probe.samples.clone();
    for slot in 0..samples.len {
        for (axis, at, [lo, hi]) in [(0, samples.x[slot], tile.x), (1, samples.y[slot], tile.y)] {
            samples.from_middle[axis][slot] = at - 0.5 * (lo + hi);
        }
    }
    for drawn in [[true, false], [false, true]] {
        let seen = Triangle { faces: drawn, ..*triangle };
        let hit = |screen: Option<&Screen>| {
            let mut depth = vec![f32::INFINITY; probe.samples.len];
            let mut owner = vec![u32::MAX; probe.samples.len];
            let mut target = StoredSamples { depth: &mut depth, triangle: &mut owner };
            let (samples, near, hits) = (&samples, -1.0, &mut Hits::default());
            let target = &mut target;
            SampleTest { triangle: &seen, samples, within, image: None, screen, near, target, hits }
                .run(VectorWidth::widest());
            owner[slot] == triangle.id
        };
        if !hit(None) {
            continue;
        }
        let (times, _) = Facing::new(&edges).timeline(within.t, drawn, 3);
        assert!(times.hull().is_some(), "facing {drawn:?}: {context}");
        let whole = TimePieces::one(Piece { t: within.t, faces: [true; 2] });
        for faces in [drawn, [true; 2]] {
            let (left, _) = EdgeBounds::new(&edges).timeline(&edges, &whole, faces);
            assert!(left.hull().is_some(), "edge bounds {faces:?}: {context}");
            assert!(hit(Some(&Screen::new(&edges, within.t, faces))), "screen {faces:?}: {context}");
        }
    }
    signs.contains(&1) && signs.contains(&-1)
}

/// Exact signs of the edges of the triangle at a sample.
fn exact_signs(triangle: &Triangle, probe: &Probe, slot: usize) -> [i8; 3] {
    let position = probe.at(slot);
    let [s, a] = [probe.shear.s, probe.shear.a].map(|c| c.map(f64::from));
    let p = triangle.corners.map(|corner| {
        let [x, y, w] =
            [0, 1, 2].map(|k| f64::from(corner.open[k]) + position.t * f64::from(corner.delta[k]));
        let weight = weight(&probe.shear, w);
        [
            x + position.u * (a[0] * w - s[0]) - position.x * weight,
            y + position.v * (a[1] * w - s[1]) - position.y * weight,
        ]
    });
    [(1, 2), (2, 0), (0, 1)].map(|(i, j): (usize, usize)| {
        let e = p[i][0] * p[j][1] - p[j][0] * p[i][1];
        i8::from(e > 0.0) - i8::from(e < 0.0)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn no_test_rejects_what_the_sample_test_accepts(case in cases(), seed: u64) {
        hold(case, seed);
    }
}

/// The relevant cases occur: samples that are hit although the exact edges reject them.
#[test]
fn many_hits_lie_beyond_an_edge_by_rounding_alone() {
    for ways in 0..8 {
        let [moving, lens, parallel] = [1, 2, 4].map(|bit| ways & bit != 0);
        for far in [false, true] {
            let case = Case { moving, lens, parallel, behind: false, far, sliver: false, scale: 0 };
            let (mut hits, mut beyond) = (0, 0);
            for seed in 0..60 {
                let found = hold(case, seed);
                (hits, beyond) = (hits + found.hits, beyond + found.beyond);
            }
            println!("{case:?}: {beyond} of {hits} hits");
            // So far out the position of a still vertex relative to a sample, rounded once, is exact.
            let exact = far && !moving && !lens;
            assert!(
                hits > 1000 && if exact { beyond == 0 } else { beyond >= 20 },
                "{case:?}: {beyond} of {hits} hits"
            );
        }
    }
}
