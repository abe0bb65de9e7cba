//! How likely the order of two designs is the other one.
//!
//! The logarithm of a cost is its mean, plus a part that all designs share, plus a part of its own. Shared is the place of the truth
//! between the ends of the energy table: one standard normal number for the table, with 95 % of it between low and high, so that
//! what moves both designs in the same way moves no order. Of its own are the stated error of the timing level and the mean over seeds, both
//! normal and independent.

use core::f64::consts::{FRAC_1_SQRT_2, PI};

use super::design::{Cost, Design};

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
    pub fn product(design: &Design) -> Self {
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
    use super::*;

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
