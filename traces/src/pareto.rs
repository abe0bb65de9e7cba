//! Frontiers of time and energy (Paper IV): the settings that no other beats in both.

use serde::Serialize;

/// One setting.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// What it is called.
    pub label: String,
    /// Time, s.
    pub time_s: f64,
    /// Energy, J.
    pub energy_j: f64,
    /// Standard deviation of the time, s; 0 if it is not known.
    pub time_deviation_s: f64,
    /// Standard deviation of the energy, J.
    pub energy_deviation_j: f64,
}

/// A point and its standing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Standing {
    /// The point; its energy is as given.
    #[serde(flatten)]
    pub point: Point,
    /// Energy with idling until the slowest is done, J: with no idle power the energy as given.
    pub compensated_j: f64,
    /// Whether no other is at least as good in both and better in one.
    pub on_frontier: bool,
    /// Share of draws within the deviations in which it is on the frontier.
    pub probability: f64,
}

/// Draws that probabilities are taken from.
pub const DRAWS: u32 = 4096;

/// Which points are on the frontier. With `idle_w`, the faster of two is charged idling for the time it saves (Paper IV,
/// section 5): all are charged up to the slowest, which compares any two alike.
pub fn frontier(points: &[Point], idle_w: f64, seed: u64) -> Vec<Standing> {
    let slowest_s = points.iter().map(|point| point.time_s).fold(0.0, f64::max);
    let compensated = |time_s: f64, energy_j: f64| energy_j + idle_w * (slowest_s - time_s);
    let pairs: Vec<(f64, f64)> =
        points.iter().map(|p| (p.time_s, compensated(p.time_s, p.energy_j))).collect();
    let on = nondominated(&pairs);
    let certain = points.iter().all(|p| p.time_deviation_s == 0.0 && p.energy_deviation_j == 0.0);
    let mut counts = vec![0_u32; points.len()];
    for draw in 0..if certain { 0 } else { DRAWS } {
        let moved = points.iter().enumerate().map(|(index, p)| {
            let (a, b) = normal(seed, u64::from(draw) * points.len() as u64 + index as u64);
            let time_s = p.time_s + a * p.time_deviation_s;
            (time_s, compensated(time_s, p.energy_j + b * p.energy_deviation_j))
        });
        let moved: Vec<(f64, f64)> = moved.collect();
        nondominated(&moved).iter().zip(&mut counts).for_each(|(on, count)| *count += u32::from(*on));
    }
    let standing = |(index, point): (usize, &Point)| Standing {
        point: point.clone(),
        compensated_j: pairs[index].1,
        on_frontier: on[index],
        probability: if certain {
            f64::from(u8::from(on[index]))
        } else {
            f64::from(counts[index]) / f64::from(DRAWS)
        },
    };
    points.iter().enumerate().map(standing).collect()
}

/// Whether each pair is beaten by no other (Kung, Luccio and Preparata 1975: sorted by one, a running minimum of the
/// other). Equal pairs do not beat one another.
pub fn nondominated(pairs: &[(f64, f64)]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..pairs.len()).collect();
    order.sort_by(|&a, &b| pairs[a].0.total_cmp(&pairs[b].0).then(pairs[a].1.total_cmp(&pairs[b].1)));
    let mut on = vec![false; pairs.len()];
    let mut best: Option<(f64, f64)> = None;
    for index in order {
        on[index] = best.is_none_or(|best| pairs[index].1 < best.1 || pairs[index] == best);
        if on[index] {
            best = Some(pairs[index]);
        }
    }
    on
}

/// Two independent standard normal numbers for a draw (Box and Muller 1958).
fn normal(seed: u64, draw: u64) -> (f64, f64) {
    crate::random::Random::new(seed, 0).normals(draw)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point(time_s: f64, energy_j: f64, deviation: f64) -> Point {
        let label = String::new();
        Point { label, time_s, energy_j, time_deviation_s: deviation, energy_deviation_j: deviation }
    }

    #[test]
    fn idle_charged_to_the_faster_one_turns_the_frontier() {
        let points = [point(1.0, 10.0, 0.0), point(2.0, 11.0, 0.0)];
        let on = |idle_w| frontier(&points, idle_w, 1).iter().map(|s| s.on_frontier).collect::<Vec<_>>();
        assert_eq!(on(0.0), [true, false]);
        // 14 W for the second saved: 24 J against 11 J.
        assert_eq!(frontier(&points, 14.0, 1)[0].compensated_j, 24.0);
        assert_eq!(on(14.0), [true, true]);
    }

    #[test]
    fn two_equal_points_share_the_frontier_and_two_blurred_ones_its_probability() {
        assert_eq!(nondominated(&[(1.0, 1.0), (1.0, 1.0), (1.0, 2.0)]), [true, true, false]);
        // Each is beaten by the other in a quarter of all draws.
        let blurred = frontier(&[point(1.0, 1.0, 0.1), point(1.0, 1.0, 0.1)], 0.0, 7);
        assert!(blurred.iter().all(|standing| (standing.probability - 0.75).abs() < 0.03), "{blurred:?}");
    }

    proptest! {
        #[test]
        fn oracle_by_comparing_all_pairs(pairs in prop::collection::vec((0_u8..12, 0_u8..12), 0..40)) {
            let pairs: Vec<(f64, f64)> = pairs.into_iter().map(|(a, b)| (f64::from(a), f64::from(b))).collect();
            let naive: Vec<bool> = pairs.iter().map(|p| {
                !pairs.iter().any(|q| q.0 <= p.0 && q.1 <= p.1 && q != p)
            }).collect();
            prop_assert_eq!(nondominated(&pairs), naive);
        }
    }
}
