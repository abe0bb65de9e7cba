//! Multiply-adds of `auto` beside those of every fixed choice of tests.

use pipeline::Features;
use serde::Serialize;
use workloads::stress::{Family, Size};

use super::measure::{MethodWork, combinations, on_subject};
use crate::study::table::{Sheet, TableBuilder};
use output::plot::{Matrix, MatrixPanel, Picture, PlotStyle};
use run::{GpuSpec, RunError};

/// Multiply-adds at one value of a family.
#[derive(Clone, Debug, PartialEq)]
pub struct FamilyCosts {
    /// The family.
    pub family: &'static str,
    /// The value of its parameter.
    pub value: f64,
    /// Multiply-adds of `auto`.
    pub auto: u64,
    /// Multiply-adds of each of [`combinations`], in their order.
    pub fixed: Vec<u64>,
}

/// `auto` against the best fixed choice, at one value or over a whole family.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AutoAgainstBest {
    /// The family.
    pub family: &'static str,
    /// The value of its parameter; `None` for all of them added up.
    pub value: Option<f64>,
    /// Multiply-adds of tile tests, screens and sample tests under `auto`.
    pub auto_madds: u64,
    /// The letters of the best fixed choice.
    pub best: String,
    /// Multiply-adds of the best choice.
    pub best_madds: u64,
    /// Multiply-adds with every test on.
    pub all_madds: u64,
    /// `auto` over the best.
    pub over_best: f64,
}

/// The most that `auto` may take over the best fixed choice.
const MAX_OVER_BEST: f64 = 1.05;

/// `auto` and every fixed choice on `family` at `value`.
///
/// # Errors
/// When the scene cannot be made or the hardware cannot be built.
pub fn trial(
    family: &'static Family,
    value: f64,
    size: Size,
    seed: u64,
    gpu: &GpuSpec,
) -> Result<FamilyCosts, RunError> {
    on_subject(family, value, size, seed, gpu, |subject| {
        let madds = |features| subject.counts(features).map(|counts| MethodWork::new(&counts).madds());
        let auto = madds(Features { auto: true, ..Features::ALL })?;
        let fixed = fixed(subject.camera.lens().is_some(), madds)?;
        Ok(FamilyCosts { family: family.name, value, auto, fixed })
    })
}

/// Multiply-adds of each combination; those that cannot differ are measured once.
fn fixed<E>(lens: bool, madds: impl Fn(Features) -> Result<u64, E>) -> Result<Vec<u64>, E> {
    let mut known: Vec<(Features, u64)> = Vec::new();
    let all = combinations().into_iter().map(|(_, features)| Features {
        lens_lines: features.lens_lines && lens,
        coarse: features.coarse && (features.facing || features.edges),
        ..features
    });
    all.map(|features| {
        if let Some((_, madds)) = known.iter().find(|(other, _)| *other == features) {
            return Ok(*madds);
        }
        known.push((features, madds(features)?));
        Ok(known[known.len() - 1].1)
    })
    .collect()
}

impl AutoAgainstBest {
    /// Of one value.
    pub fn of(trial: &FamilyCosts) -> Self {
        Self::new(trial.family, Some(trial.value), trial.auto, &trial.fixed)
    }

    /// Of all values of a family, one choice for all of them; `None` where there is none.
    pub fn over(trials: &[FamilyCosts]) -> Option<Self> {
        let family = trials.first()?.family;
        let sum = |at: usize| trials.iter().map(|trial| trial.fixed[at]).sum();
        let fixed: Vec<u64> = (0..trials[0].fixed.len()).map(sum).collect();
        Some(Self::new(family, None, trials.iter().map(|trial| trial.auto).sum(), &fixed))
    }

    fn new(family: &'static str, value: Option<f64>, auto_madds: u64, fixed: &[u64]) -> Self {
        let (best_madds, at) = fixed.iter().copied().zip(0..).min().unwrap_or((auto_madds, 0));
        Self {
            family,
            value,
            auto_madds,
            best: combinations()[at].0.clone(),
            best_madds,
            all_madds: fixed.last().copied().unwrap_or(auto_madds),
            over_best: auto_madds.max(1) as f64 / best_madds.max(1) as f64,
        }
    }
}

/// `auto` against the best fixed choice, on every family and at every value.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Choices {
    /// Each family as a whole, one fixed choice for all of its values.
    pub families: Vec<AutoAgainstBest>,
    /// Each value, with the best choice for it alone.
    pub values: Vec<AutoAgainstBest>,
}

impl Choices {
    /// Of the trials, those of a family one after the other.
    pub fn new(trials: &[FamilyCosts]) -> Self {
        let families = trials.chunk_by(|a, b| a.family == b.family);
        Self {
            families: families.filter_map(AutoAgainstBest::over).collect(),
            values: trials.iter().map(AutoAgainstBest::of).collect(),
        }
    }

    /// The families on which `auto` takes more than `MAX_OVER_BEST` of the best fixed choice.
    pub fn families_over(&self) -> usize {
        over(&self.families)
    }

    /// The values at which it does.
    pub fn values_over(&self) -> usize {
        over(&self.values)
    }

    /// Printed text: the worst family, and how many values are worse than that may be.
    pub fn text(&self) -> String {
        let (Some(family), Some(value)) = (worst(&self.families), worst(&self.values)) else {
            return String::new();
        };
        format!(
            "auto takes at most {:.3} of the best fixed choice on a family ({}), {} of {} families over {MAX_OVER_BEST}\n\
             and at most {:.3} of the best choice for a single value ({} at {}), {} of {} values over {MAX_OVER_BEST}\n",
            family.over_best,
            family.family,
            self.families_over(),
            self.families.len(),
            value.over_best,
            value.family,
            value.value.unwrap_or(f64::NAN),
            self.values_over(),
            self.values.len(),
        )
    }

    /// `auto` and every test on, over the best fixed choice: of each family as a whole, and at the value that
    /// is worst for it.
    pub(super) fn picture(&self, plot_style: &PlotStyle) -> Picture {
        type Cost = fn(&AutoAgainstBest) -> f64;
        let costs: [(&str, Cost); 2] = [
            ("auto", |choice| choice.over_best),
            ("all", |choice| choice.all_madds.max(1) as f64 / choice.best_madds.max(1) as f64),
        ];
        let worst = |family: &AutoAgainstBest, cost: Cost| {
            let values = self.values.iter().filter(|value| value.family == family.family);
            values.map(cost).reduce(f64::max)
        };
        let whole = costs.map(|(name, cost)| (name, self.families.iter().map(|f| Some(cost(f))).collect()));
        let values = costs.map(|(name, cost)| (name, self.families.iter().map(|f| worst(f, cost)).collect()));
        Matrix {
            title: "What auto takes beside the best fixed choice of tests",
            subject: "multiply-adds over those of the best of all combinations of tests",
            scale: ["the best", "32 times as much"],
            columns: self.families.iter().map(|family| family.family).collect(),
            panels: vec![
                MatrixPanel {
                    name: "each family as a whole, one choice for all its values",
                    rows: whole.to_vec(),
                },
                MatrixPanel { name: "the worst value, with a choice for it alone", rows: values.to_vec() },
            ],
        }
        .picture(plot_style)
    }

    /// Families and values as a table.
    pub(super) fn sheet(&self) -> Sheet {
        TableBuilder::of(self.families.iter().chain(&self.values))
            .data("family", |choice| choice.family)
            .data("value", |choice| choice.value)
            .data("auto_madds", |choice| choice.auto_madds)
            .data("best", |choice| choice.best.as_str())
            .data("best_madds", |choice| choice.best_madds)
            .data("all_madds", |choice| choice.all_madds)
            .data("over_best", |choice| choice.over_best)
            .csv("auto.csv")
            .sheet()
    }
}

fn over(choices: &[AutoAgainstBest]) -> usize {
    choices.iter().filter(|choice| choice.over_best > MAX_OVER_BEST).count()
}

fn worst(choices: &[AutoAgainstBest]) -> Option<&AutoAgainstBest> {
    choices.iter().max_by(|a, b| a.over_best.total_cmp(&b.over_best))
}

#[cfg(test)]
mod tests {
    use rayon::prelude::*;
    use workloads::stress::family;

    use super::*;

    fn trial(value: f64, auto: u64, fixed: [u64; 2]) -> FamilyCosts {
        FamilyCosts { family: "speed", value, auto, fixed: fixed.to_vec() }
    }

    #[test]
    fn over_a_family_one_choice_holds_for_all_values() {
        let choices = Choices::new(&[trial(0.0, 110, [100, 300]), trial(1.0, 110, [300, 100])]);
        assert_eq!((choices.values_over(), choices.families_over()), (2, 0));
        let family = &choices.families[0];
        assert_eq!((family.best_madds, family.auto_madds, family.best.as_str()), (400, 220, "-"));
        assert!((family.over_best - 0.55).abs() < 1e-12);
        assert!(choices.text().contains("1.100"), "{}", choices.text());
    }

    #[test]
    fn choices_that_cannot_differ_are_measured_once() {
        let runs = std::cell::Cell::new(0);
        let found = fixed(false, |features| {
            runs.set(runs.get() + 1);
            assert!(!features.lens_lines);
            Ok::<_, ()>(u64::from(features.screen))
        });
        // Screen, depth and side planes; three sets of facing and edges, with and without coarse ones, and none.
        assert_eq!(runs.get(), 8 * 7);
        let screens = combinations().iter().map(|(letters, _)| u64::from(letters.contains('c'))).collect();
        assert_eq!(found, Ok::<Vec<u64>, ()>(screens));
    }

    /// Families on which no set of tests is best at all values, and some that were hard to choose on;
    /// `quintile stress` has all.
    #[test]
    fn auto_is_as_good_as_the_best_fixed_choice_on_a_family() {
        let gpu = GpuSpec::load("reference").unwrap();
        for (name, seed) in [("shared-edges", 4), ("slivers", 5), ("through-lens", 6), ("speed", 7)] {
            let family = family(name).unwrap();
            let values = family.sweep(true).par_iter();
            let trials = values.map(|&value| super::trial(family, value, Size::QUICK, seed, &gpu).unwrap());
            let choices = Choices::new(&trials.collect::<Vec<_>>());
            assert_eq!(choices.families_over(), 0, "{}", choices.text());
        }
    }
}
