//! Frontier over time, energy and area: the designs that no other dominates.

use serde::Serialize;
use traces::stats::Random;

use super::design::Design;
use super::flips::LogCost;
use super::ranks::ranks;

/// Most designs of a workload for which probabilities are drawn.
const MAX_DRAWN: usize = 400;

/// Number of draws of a probability, and their seed.
const DRAWS: u64 = 1000;
const SEED: u64 = 1;

/// A design, compared with the others of its workload.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RatedDesign {
    /// The design.
    #[serde(flatten)]
    pub design: Design,
    /// Whether no other is at least as good in time, energy and area, and better in one of them.
    pub on_frontier: bool,
    /// Share of random draws within all stated uncertainties in which it is on the frontier. `None` of more than 400 designs.
    pub probability: Option<f64>,
    /// Best and worst rank by time within the stated error of the timing level; undecided if they differ.
    pub time_ranks: [usize; 2],
    /// Best and worst rank by energy, likewise.
    pub energy_ranks: [usize; 2],
}

/// Compares the designs of a workload.
pub(crate) fn rated(designs: Vec<Design>) -> Vec<RatedDesign> {
    let points: Vec<[f64; 3]> =
        designs.iter().map(|design| [design.time_s.value, design.energy_j.value, area(design)]).collect();
    let on = nondominated(&points);
    let probabilities = probabilities(&designs);
    let by_time = ranks(&designs.iter().map(|design| &design.time_s).collect::<Vec<_>>());
    let by_energy = ranks(&designs.iter().map(|design| &design.energy_j).collect::<Vec<_>>());
    let rate = |(at, design)| RatedDesign {
        design,
        on_frontier: on[at],
        probability: probabilities.as_ref().map(|shares| shares[at]),
        time_ranks: by_time[at],
        energy_ranks: by_energy[at],
    };
    designs.into_iter().enumerate().map(rate).collect()
}

/// Area; the same for all where it is not known.
fn area(design: &Design) -> f64 {
    design.area_mm2.unwrap_or(0.0)
}

/// Whether each point is dominated by no other, of those that are as good in all three and better in one (Kung, Luccio and
/// Preparata 1975: sorted by the first, a staircase of the others). Equal points do not dominate one another.
pub(crate) fn nondominated(points: &[[f64; 3]]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    let compare = |a: &[f64; 3], b: &[f64; 3]| {
        a.iter()
            .zip(b)
            .map(|(a, b)| a.total_cmp(b))
            .find(|order| order.is_ne())
            .unwrap_or(core::cmp::Ordering::Equal)
    };
    order.sort_by(|&a, &b| compare(&points[a], &points[b]));
    let mut on = vec![false; points.len()];
    // Rising in the second, falling in the third.
    let mut stairs: Vec<[f64; 2]> = Vec::new();
    let mut before: Option<usize> = None;
    for at in order {
        let [_, second, third] = points[at];
        let place = stairs.partition_point(|step| step[0] <= second);
        let is_dominated = place > 0 && stairs[place - 1][1] <= third;
        let is_equal = before.is_some_and(|before| on[before] && points[before] == points[at]);
        on[at] = !is_dominated || is_equal;
        before = Some(at);
        if !is_dominated {
            let from = stairs.partition_point(|step| step[0] < second);
            let worse = stairs[from..].iter().take_while(|step| step[1] >= third).count();
            stairs.splice(from..from + worse, [[second, third]]);
        }
    }
    on
}

/// Share of draws in which each design is on the frontier.
fn probabilities(designs: &[Design]) -> Option<Vec<f64>> {
    if designs.len() > MAX_DRAWN {
        return None;
    }
    let costs: Vec<[LogCost; 2]> = designs
        .iter()
        .map(|design| [&design.time_s, &design.energy_j].map(|cost| LogCost::of(cost, design.runs)))
        .collect();
    let (shared, own) = (Random::new(SEED, 0), Random::new(SEED, 1));
    let mut counts = vec![0_u32; designs.len()];
    for draw in 0..DRAWS {
        let (table, _) = shared.normals(draw);
        let drawn = |(at, (design, costs)): (usize, (&Design, &[LogCost; 2]))| {
            let (a, b) = own.normals(draw * designs.len() as u64 + at as u64);
            [costs[0].drawn(table, a), costs[1].drawn(table, b), area(design)]
        };
        let points: Vec<[f64; 3]> = designs.iter().zip(&costs).enumerate().map(drawn).collect();
        nondominated(&points).iter().zip(&mut counts).for_each(|(on, count)| *count += u32::from(*on));
    }
    Some(counts.into_iter().map(|count| f64::from(count) / DRAWS as f64).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::exact;
    use proptest::prelude::*;

    #[test]
    fn two_blurred_designs_share_the_frontier() {
        let blurred = || {
            let mut design = exact(&[], 1.0, 1.0);
            (design.time_s.error, design.energy_j.error) = (0.1, 0.1);
            design
        };
        // Each is dominated by the other in a quarter of all draws.
        let rated = rated(vec![blurred(), blurred()]);
        assert!(rated.iter().all(|design| (design.probability.unwrap() - 0.75).abs() < 0.05), "{rated:?}");
        assert!(rated.iter().all(|design| design.time_ranks == [1, 2]));
    }

    proptest! {
        #[test]
        fn oracle_by_comparing_all_pairs(
            points in prop::collection::vec((0_u8..8, 0_u8..8, 0_u8..8), 0..60)
        ) {
            let points: Vec<[f64; 3]> = points.into_iter().map(|(a, b, c)| [a, b, c].map(f64::from)).collect();
            let dominates = |a: &[f64; 3], b: &[f64; 3]| a != b && a.iter().zip(b).all(|(a, b)| a <= b);
            let naive: Vec<bool> =
                points.iter().map(|point| !points.iter().any(|other| dominates(other, point))).collect();
            prop_assert_eq!(nondominated(&points), naive);
        }
    }
}
