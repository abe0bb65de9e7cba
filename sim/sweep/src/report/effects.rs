//! Main effects, two-way interactions and shares of variance of the settings, on the logarithms of time and energy.
//!
//! Main effects are those of an additive model, fitted by least squares (backfitting: Buja, Hastie and
//! Tibshirani 1989), so that missing points do not mix effects. In a grid they are the means of the analysis
//! of variance. Intervals are Student's, over what the other settings do to an effect: a product of factors
//! has intervals without width. Shares of variance are those of Sobol' (1993) and, with all interactions, of
//! Homma and Saltelli (1996); on a whole grid both are exact sums.

use std::collections::HashMap;

use serde::Serialize;
use timing::sampled::student_t;

use super::design::{Factor, SweepDesign, cells, codes, factors};

/// Most values of a setting that have effects of their own: of more, a value is in too few points.
const MAX_VALUES: usize = 20;

/// Most rounds of the fit, and the change of an effect at which it ends.
const MAX_ROUNDS: usize = 100;
const SETTLED: f64 = 1e-13;

/// A ratio with its 95 % interval; the ends are missing where there is one point only.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Ratio {
    value: f64,
    low: Option<f64>,
    high: Option<f64>,
}

/// Main effect of a value of a setting: over the mean of all values.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Effect {
    /// The workload.
    pub workload: String,
    /// The setting; linked settings are one, with ` + `.
    pub setting: String,
    /// Value of the setting, or the first and the last of a group of values.
    pub value: String,
    /// Designs with this value.
    pub points: usize,
    /// Busy time over the mean.
    pub time_ratio: f64,
    /// Lower end of its 95 % interval.
    pub time_low: Option<f64>,
    /// Upper end.
    pub time_high: Option<f64>,
    /// Busy energy over the mean.
    pub energy_ratio: f64,
    /// Lower end of its 95 % interval.
    pub energy_low: Option<f64>,
    /// Upper end.
    pub energy_high: Option<f64>,
}

/// Interaction of two values of two settings: over what their main effects predict.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Interaction {
    /// The workload.
    pub workload: String,
    /// First setting.
    pub setting: String,
    /// Value of the setting.
    pub value: String,
    /// Second setting.
    pub with_setting: String,
    /// Value of the other setting.
    pub with_value: String,
    /// Designs with both values.
    pub points: usize,
    /// Busy time over the product of the main effects.
    pub time_ratio: f64,
    /// Lower end of its 95 % interval.
    pub time_low: Option<f64>,
    /// Upper end.
    pub time_high: Option<f64>,
    /// Busy energy over the product of the main effects.
    pub energy_ratio: f64,
    /// Lower end of its 95 % interval.
    pub energy_low: Option<f64>,
    /// Upper end.
    pub energy_high: Option<f64>,
}

/// Share of a setting in the variance of the logarithm of time or energy, on a whole grid.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Share {
    /// The workload.
    pub workload: String,
    /// The setting.
    pub setting: String,
    /// `time` or `energy`.
    pub of: &'static str,
    /// Of the setting alone.
    pub first_order: f64,
    /// With all its interactions.
    pub total_order: f64,
}

/// A setting whose values have no effects of their own.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NoEffect {
    /// The workload.
    pub workload: String,
    /// The setting.
    pub setting: String,
    /// Number of its values.
    pub values: usize,
    /// Why, and what there is in place of them.
    pub reason: String,
}

impl NoEffect {
    fn new(workload: &str, factor: &Factor, grouped: Option<&Factor>) -> Self {
        let reason = match grouped {
            Some(grouped) => format!(
                "of more than {MAX_VALUES} values: effects are those of {} groups of neighbouring ones, with equal numbers of designs",
                grouped.values.len()
            ),
            None => {
                format!("more than {MAX_VALUES} values, which are no numbers that can be grouped: no effects")
            }
        };
        let (workload, setting) = (workload.to_owned(), factor.name.clone());
        Self { workload, setting, values: factor.values.len(), reason }
    }
}

/// Additive model of a quantity.
struct Additive {
    logs: Vec<f64>,
    /// Effects by factor and value.
    effects: Vec<Vec<f64>>,
    /// What it does not explain, by design.
    rests: Vec<f64>,
}

/// Designs of a workload by their settings.
pub(crate) struct Factorial {
    workload: String,
    factors: Vec<Factor>,
    time: Additive,
    energy: Additive,
    /// Whether each combination of values is one design.
    is_whole: bool,
    no_effects: Vec<NoEffect>,
}

impl Factorial {
    /// Designs by the settings of the hardware, and with `conditions` by those of the work.
    pub fn new(workload: &str, designs: &[&SweepDesign], conditions: bool) -> Self {
        let settings = |design: &SweepDesign| {
            let work = design.conditions.clone().into_iter().filter(|_| conditions);
            design.settings.clone().into_iter().chain(work).collect::<Vec<_>>()
        };
        let settings: Vec<Vec<(String, String)>> = designs.iter().map(|design| settings(design)).collect();
        let all = factors(&settings);
        let whole: usize = all.iter().map(|factor| factor.values.len()).product();
        let mut seen: HashMap<Vec<usize>, usize> = HashMap::new();
        (0..designs.len()).for_each(|at| *seen.entry(codes(&all, at, None)).or_default() += 1);
        let is_few = |factor: &Factor| factor.values.len() <= MAX_VALUES;
        let is_whole = whole == designs.len() && seen.len() == whole && all.iter().all(is_few);
        let mut no_effects = Vec::new();
        let with_effects = |factor: Factor| {
            if is_few(&factor) {
                return Some(factor);
            }
            let grouped = factor.grouped();
            no_effects.push(NoEffect::new(workload, &factor, grouped.as_ref()));
            grouped
        };
        let factors: Vec<Factor> = all.into_iter().filter_map(with_effects).collect();
        let logs = |of: fn(&SweepDesign) -> f64| designs.iter().map(|design| libm::log(of(design))).collect();
        let time = Additive::fitted(logs(|design| design.time_s.value), &factors);
        let energy = Additive::fitted(logs(|design| design.energy_j.value), &factors);
        Self { workload: workload.to_owned(), factors, time, energy, is_whole, no_effects }
    }

    /// Settings with too many values.
    pub fn no_effects(&self) -> &[NoEffect] {
        &self.no_effects
    }

    /// Main effects, by setting and value.
    pub fn effects(&self) -> Vec<Effect> {
        let mut effects = Vec::new();
        for (place, factor) in self.factors.iter().enumerate() {
            let cells = cells(factor.codes.iter().copied(), factor.values.len());
            for (value, members) in factor.values.iter().zip(cells).enumerate().map(|(n, (v, m))| ((n, v), m))
            {
                let ratio =
                    |model: &Additive| interval(model.effects[place][value.0], &model.rests, &members, 0.0);
                let [time, energy] = [&self.time, &self.energy].map(ratio);
                effects.push(Effect {
                    workload: self.workload.clone(),
                    setting: factor.name.clone(),
                    value: value.1.clone(),
                    points: members.len(),
                    time_ratio: time.value,
                    time_low: time.low,
                    time_high: time.high,
                    energy_ratio: energy.value,
                    energy_low: energy.low,
                    energy_high: energy.high,
                });
            }
        }
        effects
    }

    /// Interactions of each two settings, the strongest first.
    pub fn interactions(&self) -> Vec<Interaction> {
        let mut found = Vec::new();
        for (place, a) in self.factors.iter().enumerate() {
            for b in &self.factors[place + 1..] {
                found.extend(self.interaction(a, b));
            }
        }
        let strength =
            |of: &Interaction| libm::log(of.time_ratio).abs().max(libm::log(of.energy_ratio).abs());
        found.sort_by(|a, b| strength(b).total_cmp(&strength(a)));
        found
    }

    fn interaction(&self, a: &Factor, b: &Factor) -> Vec<Interaction> {
        let count = b.values.len();
        let both = a.codes.iter().zip(&b.codes).map(|(a, b)| a * count + b);
        let cells = cells(both, a.values.len() * count);
        let one = |(cell, members): (usize, Vec<usize>)| {
            let ratio = |model: &Additive| {
                let mean = mean(&model.rests, &members);
                interval(mean, &model.rests, &members, mean)
            };
            let [time, energy] = [&self.time, &self.energy].map(ratio);
            Interaction {
                workload: self.workload.clone(),
                setting: a.name.clone(),
                value: a.values[cell / count].clone(),
                with_setting: b.name.clone(),
                with_value: b.values[cell % count].clone(),
                points: members.len(),
                time_ratio: time.value,
                time_low: time.low,
                time_high: time.high,
                energy_ratio: energy.value,
                energy_low: energy.low,
                energy_high: energy.high,
            }
        };
        cells.into_iter().enumerate().filter(|(_, members)| !members.is_empty()).map(one).collect()
    }

    /// Shares of variance; none unless the designs are a whole grid.
    pub fn shares(&self) -> Vec<Share> {
        if !self.is_whole {
            return Vec::new();
        }
        let mut shares = Vec::new();
        for (of, model) in [("time", &self.time), ("energy", &self.energy)] {
            let all = variance(&model.logs, &(0..model.logs.len()).collect::<Vec<_>>());
            for (place, factor) in self.factors.iter().enumerate() {
                let total_order = self.within(place, &model.logs) / all;
                if total_order.is_finite() {
                    let (workload, setting) = (self.workload.clone(), factor.name.clone());
                    let first_order = model.first_order(place, factor) / all;
                    shares.push(Share { workload, setting, of, first_order, total_order });
                }
            }
        }
        shares
    }

    /// Mean variance over the values of one setting while all others stay.
    fn within(&self, place: usize, logs: &[f64]) -> f64 {
        let mut groups: HashMap<Vec<usize>, Vec<usize>> = HashMap::new();
        (0..logs.len())
            .for_each(|at| groups.entry(codes(&self.factors, at, Some(place))).or_default().push(at));
        let mut groups: Vec<_> = groups.into_iter().collect();
        // The order of a sum decides its last bits.
        groups.sort_unstable();
        groups.iter().map(|(_, members)| variance(logs, members)).sum::<f64>() / groups.len() as f64
    }
}

impl Additive {
    fn fitted(logs: Vec<f64>, factors: &[Factor]) -> Self {
        let all: Vec<usize> = (0..logs.len()).collect();
        let centre = mean(&logs, &all);
        let mut rests: Vec<f64> = logs.iter().map(|log| log - centre).collect();
        let mut effects: Vec<Vec<f64>> =
            factors.iter().map(|factor| vec![0.0; factor.values.len()]).collect();
        let cells: Vec<Vec<Vec<usize>>> =
            factors.iter().map(|factor| cells(factor.codes.iter().copied(), factor.values.len())).collect();
        for _ in 0..MAX_ROUNDS {
            let mut change: f64 = 0.0;
            for (effects, cells) in effects.iter_mut().zip(&cells) {
                for (effect, members) in effects.iter_mut().zip(cells) {
                    let more = mean(&rests, members);
                    *effect += more;
                    members.iter().for_each(|&at| rests[at] -= more);
                    change = change.max(more.abs());
                }
            }
            if change < SETTLED {
                break;
            }
        }
        Self { logs, effects, rests }
    }

    /// Variance of the means of the values of a setting.
    fn first_order(&self, place: usize, factor: &Factor) -> f64 {
        let of_designs: Vec<f64> = factor.codes.iter().map(|&code| self.effects[place][code]).collect();
        variance(&of_designs, &(0..of_designs.len()).collect::<Vec<_>>())
    }
}

fn mean(values: &[f64], members: &[usize]) -> f64 {
    members.iter().map(|&at| values[at]).sum::<f64>() / members.len().max(1) as f64
}

fn variance(values: &[f64], members: &[usize]) -> f64 {
    let mean = mean(values, members);
    let square = |&at: &usize| (values[at] - mean) * (values[at] - mean);
    members.iter().map(square).sum::<f64>() / members.len().max(1) as f64
}

/// The ratio of an effect, and its interval by the scatter of `rests` around `centre`.
fn interval(effect: f64, rests: &[f64], members: &[usize], centre: f64) -> Ratio {
    let count = members.len();
    let squares: f64 = members.iter().map(|&at| (rests[at] - centre) * (rests[at] - centre)).sum();
    let half = (count > 1).then(|| {
        let freedom = u32::try_from(count - 1).unwrap_or(u32::MAX).min(1000);
        student_t(0.95, freedom) * libm::sqrt(squares / (count - 1) as f64 / count as f64)
    });
    Ratio {
        value: libm::exp(effect),
        low: half.map(|half| libm::exp(effect - half)),
        high: half.map(|half| libm::exp(effect + half)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::exact;
    use traces::stats::Random;

    /// Designs over x, y and z, with the logarithm of time by `log`.
    fn grid(count: usize, log: impl Fn(usize, usize, usize) -> f64) -> Vec<SweepDesign> {
        let mut designs = Vec::new();
        for (x, y) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            for z in 0..count {
                let [a, b, c] = [x, y, z].map(|n: usize| n.to_string());
                let settings = [("gpu.x", a.as_str()), ("gpu.y", &b), ("gpu.z", &c)];
                designs.push(exact(&settings, log(x, y, z).exp(), 2.0));
            }
        }
        designs
    }

    fn factorial(designs: &[SweepDesign]) -> Factorial {
        Factorial::new("w", &designs.iter().collect::<Vec<_>>(), false)
    }

    #[test]
    fn a_product_has_its_factors_as_effects_and_no_interactions() {
        let designs = grid(3, |x, y, z| 4_f64.ln() * x as f64 + 3_f64.ln() * y as f64 + 0.1 * z as f64);
        let found = factorial(&designs);
        let effects = found.effects();
        let ratios: Vec<f64> = effects.iter().map(|effect| effect.time_ratio).collect();
        let expected = [0.5, 2.0, 1.0 / 3_f64.sqrt(), 3_f64.sqrt(), (-0.1_f64).exp(), 1.0, 0.1_f64.exp()];
        assert!(ratios.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{ratios:?}");
        let near = |end: Option<f64>, ratio: f64| (end.unwrap() - ratio).abs() < 1e-12;
        assert!(
            effects.iter().all(|of| near(of.time_low, of.time_ratio) && near(of.time_high, of.time_ratio))
        );
        assert!(effects.iter().all(|of| of.energy_ratio == 1.0));
        assert!(found.interactions().iter().all(|of| (of.time_ratio - 1.0).abs() < 1e-12));
        let shares = found.shares();
        let of_time: Vec<&Share> = shares.iter().filter(|share| share.of == "time").collect();
        assert!(of_time.iter().all(|share| (share.first_order - share.total_order).abs() < 1e-12));
        assert!((of_time.iter().map(|share| share.first_order).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(shares.iter().all(|share| share.of == "time"), "energy does not vary");
    }

    #[test]
    fn effects_of_a_product_do_not_mix_where_points_are_missing() {
        let mut designs = grid(3, |x, y, z| 4_f64.ln() * x as f64 + 3_f64.ln() * y as f64 + 0.1 * z as f64);
        designs.drain(..2);
        let effects = factorial(&designs).effects();
        assert!((effects[1].time_ratio / effects[0].time_ratio - 4.0).abs() < 1e-9, "{effects:?}");
        assert!(factorial(&designs).shares().is_empty());
    }

    #[test]
    fn an_interaction_is_found_within_its_interval() {
        let noise = Random::new(5, 0);
        let log = |x: usize, y: usize, z: usize| {
            let (noise, _) = noise.normals((x * 100 + y * 10 + z) as u64);
            0.5 * x as f64 + 0.3 * y as f64 + if x == 1 && y == 1 { 0.8 } else { 0.0 } + 0.02 * noise
        };
        let found = factorial(&grid(10, log)).interactions();
        let both = |of: &&Interaction| of.setting == "gpu.x" && of.with_setting == "gpu.y";
        // Each of four cells has a quarter of it.
        for of in found.iter().filter(both) {
            let truth = if of.value == of.with_value { 0.2_f64.exp() } else { (-0.2_f64).exp() };
            let (low, high) = (of.time_low.unwrap(), of.time_high.unwrap());
            assert!(low < truth && truth < high && (high / low).ln() < 0.06, "{of:?}");
        }
        assert_eq!(found.iter().take(4).filter(both).count(), 4, "the strongest first");
    }

    #[test]
    fn settings_of_many_values_have_effects_of_groups() {
        // The logarithm of time rises by 1 over the range; quarters are 1/4 apart.
        let of = |count: usize, name: &dyn Fn(usize) -> String| -> Vec<SweepDesign> {
            // Not in the order of their values.
            let design = |n: usize| {
                let n = n * 7 % count;
                exact(&[("gpu.a", &name(n)), ("gpu.b", "1")], (n as f64 / count as f64).exp(), 1.0)
            };
            (0..count).map(design).collect()
        };
        let found = factorial(&of(40, &|n| format!("{}", 1000 * n)));
        let effects = found.effects();
        let values: Vec<&str> = effects.iter().map(|effect| effect.value.as_str()).collect();
        assert_eq!(values, ["0 to 9000", "10000 to 19000", "20000 to 29000", "30000 to 39000"]);
        for pair in effects.windows(2) {
            let step = pair[1].time_ratio / pair[0].time_ratio;
            assert!((step - 0.25_f64.exp()).abs() < 1e-12 && pair[0].points == 10, "{effects:?}");
            // What values within a group do is in the interval.
            assert!(pair[0].time_low.unwrap() < 0.96 * pair[0].time_ratio, "{effects:?}");
        }
        assert!(found.no_effects()[0].reason.contains("4 groups") && found.shares().is_empty());
        let named = factorial(&of(30, &|n| format!("gpu{n}.ron")));
        assert!(named.effects().is_empty());
        assert_eq!((named.no_effects()[0].setting.as_str(), named.no_effects()[0].values), ("gpu.a", 30));
    }

    #[test]
    fn effects_are_in_the_order_of_values() {
        let designs = ["16", "2", "8"].map(|value| exact(&[("gpu.a", value)], 1.0, 1.0));
        let values: Vec<String> =
            factorial(&designs).effects().into_iter().map(|effect| effect.value).collect();
        assert_eq!(values, ["2", "8", "16"]);
    }

    #[test]
    fn shares_of_an_interaction_are_those_of_sobol() {
        // x + y + 2 x y on {-1, 1}: variances 1, 1 and 4.
        let sign = |n: usize| 2.0 * n as f64 - 1.0;
        let shares = factorial(&grid(1, |x, y, _| sign(x) + sign(y) + 2.0 * sign(x) * sign(y))).shares();
        for share in &shares {
            assert!((share.first_order - 1.0 / 6.0).abs() < 1e-12, "{share:?}");
            assert!((share.total_order - 5.0 / 6.0).abs() < 1e-12, "{share:?}");
        }
        assert_eq!(shares.len(), 2);
    }

    #[test]
    fn linked_settings_are_one() {
        let design = |a: &str, b: &str, time_s| exact(&[("gpu.a", a), ("gpu.b", b)], time_s, 1.0);
        let effects = factorial(&[design("1", "2", 1.0), design("2", "4", 4.0)]).effects();
        assert_eq!(effects.len(), 2);
        assert_eq!((&*effects[1].setting, &*effects[1].value), ("gpu.a + gpu.b", "2 + 4"));
        assert!((effects[1].time_ratio - 2.0).abs() < 1e-12 && effects[1].time_low.is_none());
    }
}
