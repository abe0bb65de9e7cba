//! Best designs of a workload, the confidence in that, and what is nearly as good for less.

use serde::Serialize;

use super::design::SweepDesign;
use super::order::{Difference, LogCost};

/// Designs after the best that are compared with it.
const MAX_PAIRS: usize = 10;

/// Probability of the other order above which two designs are undecided.
const UNDECIDED: f64 = 0.025;

/// What designs are compared by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Measure {
    /// Busy time.
    #[default]
    Time,
    /// Busy energy.
    Energy,
    /// Energy times time.
    EnergyDelay,
    /// Area.
    Area,
}

impl Measure {
    /// Measures whose values have errors.
    const ALL: [Self; 3] = [Self::Time, Self::Energy, Self::EnergyDelay];

    /// Name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Energy => "energy",
            Self::EnergyDelay => "energy-delay",
            Self::Area => "area",
        }
    }

    /// Unit.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Time => "s",
            Self::Energy => "J",
            Self::EnergyDelay => "J s",
            Self::Area => "mm2",
        }
    }

    fn of(self, design: &SweepDesign) -> Option<f64> {
        match self {
            Self::Time => Some(design.time_s.value),
            Self::Energy => Some(design.energy_j.value),
            Self::EnergyDelay => Some(design.time_s.value * design.energy_j.value),
            Self::Area => design.area_mm2,
        }
    }

    fn log(self, design: &SweepDesign) -> LogCost {
        match self {
            Self::Energy => LogCost::of(&design.energy_j, design.runs),
            Self::EnergyDelay => LogCost::product(design),
            Self::Time | Self::Area => LogCost::of(&design.time_s, design.runs),
        }
    }
}

/// Best design of a workload by a measure.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Winner {
    /// The workload.
    pub workload: String,
    /// The measure.
    pub measure: Measure,
    /// The design.
    pub design: String,
    /// What it costs, in SI units.
    pub value: f64,
    /// Designs of the workload.
    pub designs: usize,
    /// Others whose order to it flips with more than 2.5 %: among all these the winner is undecided.
    pub undecided: usize,
    /// Whether platform and energy table are not those of its GPU.
    pub platform_mismatch: bool,
}

/// The best design against another.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Pair {
    /// The workload.
    pub workload: String,
    /// The measure.
    pub measure: Measure,
    /// The best design.
    pub best: String,
    /// The other.
    pub other: String,
    /// Cost of the other over that of the best.
    pub ratio: f64,
    /// Lower end of its 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Probability that the other is better.
    pub flips: f64,
}

/// Cheapest design by one measure of those near the best by another.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NearBest {
    /// The workload.
    pub workload: String,
    /// Measure by which it is near the best.
    pub near: Measure,
    /// Measure by which it is the cheapest.
    pub cheapest: Measure,
    /// The design.
    pub design: String,
    /// Designs to choose from.
    pub candidates: usize,
    /// Cost of the design by `near` over that of the best.
    pub near_ratio: f64,
    /// Cost of the design by `cheapest` over that of the best by `near`.
    pub cheapest_ratio: f64,
    /// Whether platform and energy table are not those of its GPU.
    pub platform_mismatch: bool,
}

/// Designs in the order of a measure; equal ones in the order of the plan.
fn sorted(designs: &[SweepDesign], measure: Measure) -> Vec<&SweepDesign> {
    let mut sorted: Vec<(f64, &SweepDesign)> =
        designs.iter().filter_map(|design| Some((measure.of(design)?, design))).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    sorted.into_iter().map(|(_, design)| design).collect()
}

/// Winners of a workload.
pub(crate) fn winners(workload: &str, designs: &[SweepDesign]) -> Vec<Winner> {
    let winner = |measure: Measure| {
        let sorted = sorted(designs, measure);
        let (best, others) = sorted.split_first()?;
        let log = measure.log(best);
        let is_undecided =
            |other: &&&SweepDesign| Difference::new(&log, &measure.log(other)).flips() > UNDECIDED;
        Some(Winner {
            workload: workload.to_owned(),
            measure,
            design: best.design.clone(),
            value: measure.of(best)?,
            designs: designs.len(),
            undecided: others.iter().filter(is_undecided).count(),
            platform_mismatch: best.is_mismatched(),
        })
    };
    Measure::ALL.into_iter().filter_map(winner).collect()
}

/// The best design by each measure against the next ones.
pub(crate) fn pairs(workload: &str, designs: &[SweepDesign]) -> Vec<Pair> {
    let of = |measure: Measure| {
        let sorted = sorted(designs, measure);
        let pair = |best: &SweepDesign, other: &SweepDesign| {
            let difference = Difference::new(&measure.log(best), &measure.log(other));
            let [low, high] = difference.interval();
            Pair {
                workload: workload.to_owned(),
                measure,
                best: best.design.clone(),
                other: other.design.clone(),
                ratio: difference.ratio(),
                low,
                high,
                flips: difference.flips(),
            }
        };
        let best = sorted.first().copied();
        let others: Vec<&SweepDesign> = sorted.into_iter().skip(1).take(MAX_PAIRS).collect();
        best.map_or(Vec::new(), |best| others.into_iter().map(|other| pair(best, other)).collect())
    };
    Measure::ALL.into_iter().flat_map(of).collect()
}

/// Cheapest designs of those that are `within` of the best by another measure.
pub(crate) fn near_best(workload: &str, designs: &[SweepDesign], within: f64) -> Vec<NearBest> {
    let of = |(near, cheapest): (Measure, Measure)| {
        let best = *sorted(designs, near).first()?;
        let limit = near.of(best)? * (1.0 + within);
        let candidates: Vec<SweepDesign> = designs
            .iter()
            .filter(|design| near.of(design).is_some_and(|cost| cost <= limit))
            .cloned()
            .collect();
        let chosen = *sorted(&candidates, cheapest).first()?;
        Some(NearBest {
            workload: workload.to_owned(),
            near,
            cheapest,
            design: chosen.design.clone(),
            candidates: candidates.len(),
            near_ratio: near.of(chosen)? / near.of(best)?,
            cheapest_ratio: cheapest.of(chosen)? / cheapest.of(best)?,
            platform_mismatch: chosen.is_mismatched(),
        })
    };
    let pairs = [
        (Measure::Time, Measure::Energy),
        (Measure::Energy, Measure::Time),
        (Measure::Time, Measure::Area),
        (Measure::Energy, Measure::Area),
        (Measure::EnergyDelay, Measure::Area),
    ];
    pairs.into_iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::exact;

    fn named(name: &str, time_s: f64, energy_j: f64) -> SweepDesign {
        exact(&[("gpu.a", name)], time_s, energy_j)
    }

    #[test]
    fn winners_and_what_is_nearly_as_good() {
        let designs = [named("fast", 1.0, 9.0), named("near", 1.04, 4.0), named("lean", 2.0, 3.9)];
        let won: Vec<String> = winners("w", &designs).into_iter().map(|winner| winner.design).collect();
        assert_eq!(won, ["gpu.a=fast", "gpu.a=lean", "gpu.a=near"]);
        let near = near_best("w", &designs, 0.05);
        assert_eq!(near.iter().map(|of| &*of.design).collect::<Vec<_>>(), ["gpu.a=near", "gpu.a=near"]);
        assert!((near[0].near_ratio - 1.04).abs() < 1e-12 && (near[1].cheapest_ratio - 0.52).abs() < 1e-12);
        assert_eq!(near_best("w", &designs, 0.01)[0].design, "gpu.a=fast");
    }

    #[test]
    fn winners_on_the_platform_of_another_gpu_are_marked() {
        let mut designs = [named("fast", 1.0, 9.0), named("lean", 2.0, 3.9)];
        designs[0].warnings = vec!["clipped".to_owned(), "platform-mismatch".to_owned()];
        let marks: Vec<bool> = winners("w", &designs).iter().map(|winner| winner.platform_mismatch).collect();
        assert_eq!(marks, [true, false, false]);
        assert!(near_best("w", &designs, 0.05)[0].platform_mismatch);
    }

    #[test]
    fn a_winner_within_the_errors_is_undecided() {
        let mut designs = [named("a", 1.0, 1.0), named("b", 1.01, 2.0), named("c", 3.0, 3.0)];
        assert!(winners("w", &designs).iter().all(|winner| winner.undecided == 0));
        designs.iter_mut().for_each(|design| design.time_s.error = 0.05);
        assert_eq!(winners("w", &designs)[0].undecided, 1);
        designs[2].time_s.error = 9.0;
        assert_eq!(winners("w", &designs)[0].undecided, 2);
        let pairs = pairs("w", &designs);
        assert!(pairs[0].flips > 0.3 && pairs[1].flips > 0.1);
    }
}
