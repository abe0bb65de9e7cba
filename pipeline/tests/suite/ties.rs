//! Samples on edges and vertices are decided as if they were moved by an infinitely small step, and near ties
//! exactly.

use pipeline::sample_test::{depth, weights};
use proptest::prelude::*;

/// The sign of each edge when the sample is moved by `(2^-20, 2^-40)`, in integers. Coordinates up to 1000
/// and depths up to 3 make every term less than 2^13, so no later term can reach the first nonzero one.
fn moved(points: &[[i128; 3]; 3]) -> Option<bool> {
    const STEP: u32 = 20;
    let p = points.map(|[x, y, w]| [(x << STEP) - w, (y << (2 * STEP)) - w]);
    let e = [(1, 2), (2, 0), (0, 1)].map(|(i, j): (usize, usize)| p[i][0] * p[j][1] - p[j][0] * p[i][1]);
    if e.iter().all(|&e| e > 0) {
        Some(false)
    } else if e.iter().all(|&e| e < 0) {
        Some(true)
    } else {
        None
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]
    /// Ties are broken as if the sample were moved by an infinitely small step; coordinates are small so that
    /// most samples tie.
    #[test]
    fn ties_are_broken_by_moving_the_sample(
        points in prop::array::uniform3((-2..=2_i32, -2..=2_i32, -2..=3_i32)), scale_xy in 1..500_i32, shift in -100..60_i32,
    ) {
        let scale = libm::exp2f(shift as f32);
        let exact_points = points.map(|(x, y, w)| [i128::from(x * scale_xy), i128::from(y * scale_xy), i128::from(w)]);
        let rounded = exact_points.map(|p| p.map(|c| c as f32 * scale));
        let ours = weights(&rounded);
        prop_assert_eq!(ours.map(|(_, counter_clockwise)| counter_clockwise), moved(&exact_points), "{:?}", points);
        if let Some((weights, _)) = ours {
            prop_assert!(weights.iter().all(|&w| (0.0..=1.0).contains(&w)), "{:?}", weights);
            prop_assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            // The weights map back to the ray through the sample.
            let back = |axis: usize| -> f64 { rounded.iter().zip(weights).map(|(p, weight)| weight * f64::from(p[axis])).sum() };
            for back in [back(0), back(1)] {
                prop_assert!(back.abs() < 1e-9 * f64::from(scale) * f64::from(scale_xy), "{:?} {:?}", weights, points);
            }
            let depth = depth(&rounded, &weights);
            let w = rounded.map(|p| p[2]);
            prop_assert!(depth >= w[0].min(w[1]).min(w[2]) && depth <= w[0].max(w[1]).max(w[2]));
        }
    }

    /// The same for near ties, whose products differ in their last bits only.
    #[test]
    fn near_ties_are_decided_exactly(
        base in prop::array::uniform2(1_000_000..16_000_000_i64), nudge in prop::array::uniform2(-2..=2_i64), third in 1..1000_i64,
    ) {
        let [x, y] = base;
        let points = [[x, y, 1], [-x + nudge[0], -y + nudge[1], 2], [-third, third, 3]];
        let e = |i: usize, j: usize| points[i][0] * points[j][1] - points[j][0] * points[i][1];
        let signs = [e(1, 2).signum(), e(2, 0).signum(), e(0, 1).signum()];
        prop_assume!(!signs.contains(&0));
        let inside = signs[0] == signs[1] && signs[1] == signs[2];
        let ours = weights(&points.map(|p| p.map(|c| c as f32)));
        prop_assert_eq!(ours.map(|(_, ccw)| ccw), inside.then_some(signs[0] < 0));
    }
}
