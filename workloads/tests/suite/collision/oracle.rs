//! Pairs that are separated or kept, and an oracle of many instants.

use proptest::prelude::*;
use workloads::collision::{CollisionMethod, PairSearch};

use super::{Ends, SEARCHES, may_collide, random};

/// Paths that cross in space, but at different times (thesis, Paper VI, Fig. 6).
#[test]
fn paths_that_cross_at_different_times_are_separated_by_time_alone() {
    let square = |x: f64, y: f64| [[x, y, 0.0], [x + 0.2, y, 0.1], [x, y + 0.2, 0.2]];
    let a = [square(-2.0, 0.0), square(2.0, 0.0)];
    let b = [square(0.0, -1.0), square(0.0, 3.0)];
    let plain = PairSearch { resolution: 128, bins: 1, method: CollisionMethod::FragmentBox, zoom: false };
    assert!(!may_collide(a, b, &plain));
    assert!(may_collide(a, b, &PairSearch { method: CollisionMethod::DepthOnly, ..plain }));
}

/// A tip that approaches a face, stops at a gap and turns aside.
#[test]
fn near_misses_are_separated_by_refinement() {
    for gap in [1e-3, 1e-5, 1e-7] {
        let face = [[[-1.0, -1.0, -0.4], [1.0, -1.0, 0.2], [0.0, 1.0, 0.3]]; 2];
        let foot = -0.4 * 0.25 + 0.2 * 0.25 + 0.3 * 0.5;
        let tip = |z: f64| [[0.0, 0.0, z], [0.1, 0.0, z + 1.0], [0.0, 0.1, z + 1.0]];
        let falling = [tip(2.0), tip(foot + gap)];
        assert!(!may_collide(face, falling, &PairSearch::default()), "{gap}");
        assert!(may_collide(face, [tip(2.0), tip(foot - gap)], &PairSearch::default()), "{gap}");
    }
}

/// Limitation: tilted planes that slide along each other at less than a tile's width. Refinement does not
/// help, as they are near everywhere.
#[test]
fn sliding_planes_nearer_than_a_tile_are_not_separated() {
    let a: Ends = [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.3], [0.0, 1.0, 0.6]]; 2];
    let apart = |gap: f64| {
        let slid = |by: f64| a[0].map(|[x, y, z]| [x + by, y, z + 0.3 * by + gap]);
        !may_collide(a, [slid(0.0), slid(0.5)], &PairSearch::default())
    };
    assert!(apart(0.1) && !apart(1e-5));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    /// Crossings found at many instants are reported by every search.
    #[test]
    fn crossings_at_any_tested_instant_are_reported(seed in 0_u64..1 << 40) {
        let corner = |n: u64| [0, 1, 2].map(|axis| random(seed, 3 * n + axis));
        let a: Ends = [[corner(0), corner(1), corner(2)], [corner(3), corner(4), corner(5)]];
        let b: Ends = [[corner(6), corner(7), corner(8)], [corner(9), corner(10), corner(11)]];
        let mut crossing = false;
        for step in 0..=64 {
            let t = f64::from(step) / 64.0;
            let at = |ends: &Ends| [0, 1, 2].map(|k| glam::DVec3::from(ends[0][k]).lerp(glam::DVec3::from(ends[1][k]), t));
            let (p, q) = (at(&a), at(&b));
            crossing |= pierced(&p, &q) || pierced(&q, &p);
        }
        prop_assume!(crossing);
        for search in &SEARCHES {
            prop_assert!(may_collide(a, b, search), "{search:?}");
        }
    }
}

/// Whether an edge of `p` passes well inside `q`.
fn pierced(p: &[glam::DVec3; 3], q: &[glam::DVec3; 3]) -> bool {
    let normal = (q[1] - q[0]).cross(q[2] - q[0]);
    (0..3).any(|k| {
        let (from, to) = (p[k], p[(k + 1) % 3]);
        let (d0, d1) = (normal.dot(from - q[0]), normal.dot(to - q[0]));
        if d0 * d1 >= 0.0 {
            return false;
        }
        let point = from + (to - from) * (d0 / (d0 - d1));
        (0..3).all(|e| (q[(e + 1) % 3] - q[e]).cross(point - q[e]).dot(normal) > 1e-9)
    })
}
