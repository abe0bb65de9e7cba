//! Order of designs: the frontier over time, energy and area, ranks as far as the stated errors decide them,
//! and how likely the order of two designs is the other one.
//!
//! The logarithm of a cost is its mean, plus a part that all designs share, plus a part of its own. Shared is
//! the place of the truth between the ends of the energy table: one standard normal number for the table,
//! with 95 % of it between low and high, so that what moves both designs in the same way moves no order. Of
//! its own are the stated error of the timing level and the mean over seeds, both normal and independent.

use core::f64::consts::{FRAC_1_SQRT_2, PI};

use serde::Serialize;
use traces::stats::Random;

use super::design::{Cost, SweepDesign};

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
    pub design: SweepDesign,
    /// Whether no other is at least as good in time, energy and area, and better in one of them.
    pub on_frontier: bool,
    /// Share of random draws within all stated uncertainties in which it is on the frontier. `None` of more
    /// than 400 designs.
    pub probability: Option<f64>,
    /// Best and worst rank by time within the stated error of the timing level; undecided if they differ.
    pub time_ranks: [usize; 2],
    /// Best and worst rank by energy, likewise.
    pub energy_ranks: [usize; 2],
}

/// Compares the designs of a workload.
pub(crate) fn rated(designs: Vec<SweepDesign>) -> Vec<RatedDesign> {
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
fn area(design: &SweepDesign) -> f64 {
    design.area_mm2.unwrap_or(0.0)
}

/// Whether each point is dominated by no other, of those that are as good in all three and better in one
/// (Kung, Luccio and Preparata 1975: sorted by the first, a staircase of the others). Equal points do not
/// dominate one another.
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
fn probabilities(designs: &[SweepDesign]) -> Option<Vec<f64>> {
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
        let drawn = |(at, (design, costs)): (usize, (&SweepDesign, &[LogCost; 2]))| {
            let (a, b) = own.normals(draw * designs.len() as u64 + at as u64);
            [costs[0].drawn(table, a), costs[1].drawn(table, b), area(design)]
        };
        let points: Vec<[f64; 3]> = designs.iter().zip(&costs).enumerate().map(drawn).collect();
        nondominated(&points).iter().zip(&mut counts).for_each(|(on, count)| *count += u32::from(*on));
    }
    Some(counts.into_iter().map(|count| f64::from(count) / DRAWS as f64).collect())
}

/// For each cost the best and the worst rank that it can have within the stated errors, from 1. Both are the
/// same if the rank is decided; that of costs equal to the last bit is not.
pub(crate) fn ranks(costs: &[&Cost]) -> Vec<[usize; 2]> {
    let ends: Vec<[f64; 2]> = costs.iter().map(|cost| ends(cost)).collect();
    let sorted = |end: usize| {
        let mut values: Vec<f64> = ends.iter().map(|ends| ends[end]).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let [lows, highs] = [0, 1].map(sorted);
    let of = |[low, high]: &[f64; 2]| {
        let surely_before = highs.partition_point(|other| other < low);
        let surely_after = lows.len() - lows.partition_point(|other| other <= high);
        [1 + surely_before, costs.len() - surely_after]
    };
    ends.iter().map(of).collect()
}

/// Interval of a cost by the stated error of its timing level.
fn ends(cost: &Cost) -> [f64; 2] {
    [cost.value / (1.0 + cost.error), cost.value * (1.0 + cost.error)]
}

/// Standard deviations on either side of the mean that hold 95 %.
const SD_95: f64 = 1.959_963_984_540_054;

/// Intervals of the integral over the shared number, on either side of zero, and where it ends.
const STEPS: u32 = 200;
const END: f64 = 8.0;

/// A cost of a design as a random number: its logarithm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LogCost {
    mean: f64,
    /// Slopes over the shared number, below and above zero.
    slopes: [f64; 2],
    /// Standard deviation of its own part.
    deviation: f64,
}

impl LogCost {
    pub fn of(cost: &Cost, runs: usize) -> Self {
        let log = |ratio: f64| if ratio > 0.0 { libm::log(ratio) / SD_95 } else { 0.0 };
        let of_seeds = cost.deviation / cost.value / (runs.max(1) as f64).sqrt();
        Self {
            mean: libm::log(cost.value),
            slopes: [-log(cost.low / cost.value), log(cost.high / cost.value)],
            deviation: libm::hypot(libm::log1p(cost.error) / SD_95, of_seeds),
        }
    }

    /// Energy times time. Errors of the level in both may have one cause, so they add up.
    pub fn product(design: &SweepDesign) -> Self {
        let [a, b] = [&design.time_s, &design.energy_j].map(|cost| Self::of(cost, design.runs));
        Self {
            mean: a.mean + b.mean,
            slopes: [0, 1].map(|side| a.slopes[side] + b.slopes[side]),
            deviation: a.deviation + b.deviation,
        }
    }

    /// A random value: the shared number and its own one are standard normal.
    pub fn drawn(&self, shared: f64, own: f64) -> f64 {
        let slope = self.slopes[usize::from(shared > 0.0)];
        libm::exp(self.mean + slope * shared + self.deviation * own)
    }
}

/// Difference of the logarithms of two costs.
pub(crate) struct Difference {
    mean: f64,
    slopes: [f64; 2],
    deviation: f64,
}

impl Difference {
    /// Of `b` over `a`.
    pub fn new(a: &LogCost, b: &LogCost) -> Self {
        Self {
            mean: b.mean - a.mean,
            slopes: [0, 1].map(|side| b.slopes[side] - a.slopes[side]),
            deviation: libm::hypot(a.deviation, b.deviation),
        }
    }

    /// `b` over `a`.
    pub fn ratio(&self) -> f64 {
        libm::exp(self.mean)
    }

    /// Probability that the order is the other one; a half for equal costs.
    pub fn flips(&self) -> f64 {
        let below = self.below(0.0);
        match self.mean {
            0.0 => 0.5,
            mean if mean > 0.0 => below,
            _ => 1.0 - below,
        }
    }

    /// Interval that holds 95 % of the ratio.
    pub fn interval(&self) -> [f64; 2] {
        [0.025, 0.975].map(|share| libm::exp(self.quantile(share)))
    }

    /// By bisection, over ten standard deviations on either side.
    fn quantile(&self, share: f64) -> f64 {
        let reach = 10.0 * (self.deviation + self.slopes[0].abs().max(self.slopes[1].abs()));
        let (mut low, mut high) = (self.mean - reach, self.mean + reach);
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if self.below(middle) < share { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    /// Probability that the difference is below `limit`.
    fn below(&self, limit: f64) -> f64 {
        let side = |side: usize| {
            let sign = if side == 0 { -1.0 } else { 1.0 };
            half(limit - self.mean, sign * self.slopes[side], self.deviation)
        };
        side(0) + side(1)
    }
}

/// Probability that `slope * z + deviation * e < limit` and `z > 0`, for independent standard normal `z` and `e`.
fn half(limit: f64, slope: f64, deviation: f64) -> f64 {
    if deviation == 0.0 {
        let share = |z: f64| normal_below(z.max(0.0)) - 0.5;
        return match slope {
            0.0 => {
                if limit > 0.0 {
                    0.5
                } else {
                    0.0
                }
            }
            slope if slope > 0.0 => share(limit / slope),
            slope => 0.5 - share(limit / slope),
        };
    }
    // Simpson's rule.
    let step = END / f64::from(2 * STEPS);
    let at = |n: u32| {
        let z = step * f64::from(n);
        libm::exp(-0.5 * z * z) * normal_below((limit - slope * z) / deviation)
    };
    let inner: f64 = (1..2 * STEPS).map(|n| at(n) * if n % 2 == 1 { 4.0 } else { 2.0 }).sum();
    (at(0) + inner + at(2 * STEPS)) * step / 3.0 / (2.0 * PI).sqrt()
}

/// Standard normal distribution.
fn normal_below(x: f64) -> f64 {
    0.5 * libm::erfc(-x * FRAC_1_SQRT_2)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::report::exact;

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
        fn frontier_by_comparing_all_pairs(
            points in prop::collection::vec((0_u8..8, 0_u8..8, 0_u8..8), 0..60)
        ) {
            let points: Vec<[f64; 3]> = points.into_iter().map(|(a, b, c)| [a, b, c].map(f64::from)).collect();
            let dominates = |a: &[f64; 3], b: &[f64; 3]| a != b && a.iter().zip(b).all(|(a, b)| a <= b);
            let naive: Vec<bool> =
                points.iter().map(|point| !points.iter().any(|other| dominates(other, point))).collect();
            prop_assert_eq!(nondominated(&points), naive);
        }
    }

    fn ranked(costs: &[(f64, f64)]) -> Vec<[usize; 2]> {
        let cost = |&(value, error)| Cost { value, deviation: 0.0, error, low: value, high: value };
        let costs: Vec<Cost> = costs.iter().map(cost).collect();
        ranks(&costs.iter().collect::<Vec<_>>())
    }

    #[test]
    fn ranks_within_the_error_are_undecided() {
        let exact = 0.0;
        assert_eq!(ranked(&[(2.0, exact), (1.0, exact), (3.0, exact)]), [[2, 2], [1, 1], [3, 3]]);
        let five = 0.05;
        assert_eq!(ranked(&[(1.0, five), (1.08, five), (2.0, five)]), [[1, 2], [1, 2], [3, 3]]);
        assert_eq!(ranked(&[(1.0, exact), (5.0, 9.0), (2.0, exact)]), [[1, 2], [1, 3], [2, 3]]);
        assert_eq!(ranked(&[(1.0, exact), (1.0, exact)]), [[1, 2], [1, 2]]);
    }

    proptest! {
        #[test]
        fn ranks_by_comparing_all_pairs(costs in prop::collection::vec((1_u8..20, 0_u8..30), 0..30)) {
            let costs: Vec<(f64, f64)> =
                costs.into_iter().map(|(a, b)| (f64::from(a), f64::from(b) / 100.0)).collect();
            let ends = |(value, error): (f64, f64)| [value / (1.0 + error), value * (1.0 + error)];
            let expected: Vec<[usize; 2]> = costs.iter().map(|&own| {
                let [low, high] = ends(own);
                let count = |is: &dyn Fn([f64; 2]) -> bool| costs.iter().filter(|&&other| is(ends(other))).count();
                [1 + count(&|other| other[1] < low), costs.len() - count(&|other| other[0] > high)]
            }).collect();
            prop_assert_eq!(ranked(&costs), expected);
        }
    }

    fn cost(value: f64, error: f64, spread: [f64; 2]) -> LogCost {
        let [low, high] = spread.map(|ratio| ratio * value);
        LogCost::of(&Cost { value, deviation: 0.0, error, low, high }, 1)
    }

    fn flips(a: &LogCost, b: &LogCost) -> f64 {
        Difference::new(a, b).flips()
    }

    #[test]
    fn flips_are_those_of_a_normal_difference() {
        // Both are off by a factor of at most 1.1 in 95 % of all cases.
        let (a, b) = (cost(1.0, 0.1, [1.0; 2]), cost(1.05, 0.1, [1.0; 2]));
        let exact = normal_below(-1.05_f64.ln() / (1.1_f64.ln() / SD_95 * 2_f64.sqrt()));
        assert!((flips(&a, &b) - exact).abs() < 1e-9 && (flips(&b, &a) - exact).abs() < 1e-9);
        // The table alone moves one of them by a factor of 2 either way.
        let (a, b) = (cost(1.0, 0.0, [1.0; 2]), cost(1.5, 0.0, [0.5, 2.0]));
        let exact = normal_below(-1.5_f64.ln() / (2_f64.ln() / SD_95));
        assert!((flips(&a, &b) - exact).abs() < 1e-12);
        // Both together: variances add.
        let b = cost(1.5, 0.3, [0.5, 2.0]);
        let exact = normal_below(-1.5_f64.ln() * SD_95 / libm::hypot(2_f64.ln(), 1.3_f64.ln()));
        assert!((flips(&a, &b) - exact).abs() < 1e-8, "{} {exact}", flips(&a, &b));
    }

    #[test]
    fn what_moves_both_in_the_same_way_moves_no_order() {
        let (a, b) = (cost(1.0, 0.0, [0.2, 5.0]), cost(1.01, 0.0, [0.2, 5.0]));
        assert!(flips(&a, &b) < 1e-12, "{}", flips(&a, &b));
        let [low, high] = Difference::new(&a, &b).interval();
        assert!((low - 1.01).abs() < 1e-6 && (high - 1.01).abs() < 1e-6);
    }

    #[test]
    fn the_interval_of_a_ratio_is_that_of_the_error() {
        let (a, b) = (cost(2.0, 0.0, [1.0; 2]), cost(4.0, 0.1, [1.0; 2]));
        let [low, high] = Difference::new(&a, &b).interval();
        assert!((low - 2.0 / 1.1).abs() < 1e-6 && (high - 2.0 * 1.1).abs() < 1e-6);
    }

    #[test]
    fn equal_costs_flip_in_half_of_all_cases() {
        assert_eq!(flips(&cost(1.0, 0.0, [1.0; 2]), &cost(1.0, 0.0, [1.0; 2])), 0.5);
    }
}
