//! Axes: the values of one setting, or of several that change together.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use serde::Deserialize;

use crate::setting::{Setting, Text, check_path, is_label, plain};

/// What is varied.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Axis {
    /// Listed values of a setting.
    Values {
        /// The setting.
        path: Arc<str>,
        /// Values of the axis.
        values: Vec<Text>,
    },
    /// Numbers from one to another.
    Range {
        /// The setting.
        path: Arc<str>,
        /// First number.
        from: f64,
        /// Last number.
        to: f64,
        /// Number of values, both ends included.
        #[serde(default)]
        count: Option<u32>,
        /// Difference of neighbours, or their ratio with `log`.
        #[serde(default)]
        step: Option<f64>,
        /// Whether ratios of neighbours are equal rather than differences.
        #[serde(default)]
        log: bool,
        /// Whether the setting takes whole numbers only, so that a place between two of them is the lower one.
        #[serde(skip)]
        whole: bool,
    },
    /// Settings that change together: their first values, then their second ones, and so on.
    Linked {
        /// Lists of equal length.
        settings: BTreeMap<Arc<str>, Vec<Text>>,
    },
}

impl Axis {
    /// Settings that it varies.
    pub(crate) fn paths(&self) -> Box<dyn Iterator<Item = &str> + '_> {
        match self {
            Self::Values { path, .. } | Self::Range { path, .. } => Box::new(std::iter::once(&**path)),
            Self::Linked { settings } => Box::new(settings.keys().map(|path| &**path)),
        }
    }

    /// Checks the axis; in a `grid` its values have to be countable.
    ///
    /// # Errors
    /// In words.
    pub(crate) fn check(&self, grid: bool) -> Result<(), String> {
        self.paths().try_for_each(check_path)?;
        if let Some(path) = self.paths().next().filter(|_| self.paths().all(is_label)) {
            return Err(format!(
                "`{path}` changes no number of a run: vary what it names, with it in a Linked"
            ));
        }
        match self {
            Self::Values { path, values } if values.is_empty() => {
                Err(format!("`{path}` has no values: list some"))
            }
            Self::Values { path, values } => {
                let mut seen = BTreeSet::new();
                let repeated = values.iter().find(|value| !seen.insert(&*value.0));
                repeated.map_or(Ok(()), |value| Err(format!("`{path}` has {} twice", value.0)))
            }
            Self::Linked { settings } => {
                let lengths: Vec<usize> = settings.values().map(Vec::len).collect();
                let fits =
                    lengths.first().is_some_and(|&first| first > 0 && lengths.iter().all(|&n| n == first));
                if fits {
                    Ok(())
                } else {
                    Err("linked settings need lists of equal length that are not empty".to_owned())
                }
            }
            Self::Range { .. } => self.check_range(grid),
        }
    }

    fn check_range(&self, grid: bool) -> Result<(), String> {
        let Self::Range { path, from, to, count, step, log, .. } = self else { return Ok(()) };
        let wrong = |message: &str| Err(format!("`{path}`: {message}"));
        if !(from.is_finite() && to.is_finite() && from < to) {
            return wrong("`from` has to be below `to`, both finite");
        }
        if *log && *from <= 0.0 {
            return wrong("`from` has to be above 0 with `log`");
        }
        let least = if *log { 1.0 } else { 0.0 };
        match (count, step) {
            (Some(_), Some(_)) => wrong("give `count` or `step`, not both"),
            (None, None) if grid => {
                wrong("give `count` or `step`; without both, points have to be LatinHypercube or Sobol")
            }
            (Some(count), _) if *count < 2 => wrong("`count` has to be 2 or more: both ends are values"),
            (_, Some(step)) if !(step.is_finite() && *step > least) => {
                wrong("`step` has to be above 0, and above 1 with `log`")
            }
            _ => Ok(()),
        }
    }

    /// Number of values; 0 if they are not countable.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Values { values, .. } => values.len(),
            Self::Linked { settings } => settings.values().next().map_or(0, Vec::len),
            Self::Range { count: Some(count), .. } => *count as usize,
            Self::Range { from, to, step: Some(step), log, .. } => {
                let steps = if *log { libm::log(to / from) / libm::log(*step) } else { (to - from) / step };
                // A last value that rounding moves just beyond the end counts.
                ((steps + 1e-9) as usize).saturating_add(1)
            }
            Self::Range { .. } => 0,
        }
    }

    /// Settings of value `index`, below [`Self::len`].
    pub(crate) fn value(&self, index: usize) -> Vec<Setting> {
        match self {
            Self::Values { path, values } => vec![Setting::new(path.clone(), values[index].0.clone())],
            Self::Linked { settings } => {
                let linked = settings.iter();
                linked.map(|(path, values)| Setting::new(path.clone(), values[index].0.clone())).collect()
            }
            Self::Range { path, from, step: Some(step), log, .. } => {
                let steps = index as f64;
                let value = if *log { from * libm::pow(*step, steps) } else { from + step * steps };
                vec![Setting::new(path.clone(), number(value))]
            }
            Self::Range { count, .. } => self.between(index as f64 / (count.unwrap_or(2) - 1) as f64),
        }
    }

    /// Settings at `share` of the axis, from 0 to below 1: one of its values, or any number of a range
    /// without `count` and `step`.
    pub(crate) fn at(&self, share: f64) -> Vec<Setting> {
        match self.len() {
            0 => self.between(share),
            count => self.value(((share * count as f64) as usize).min(count - 1)),
        }
    }

    /// The number of a range at `share` of the way from its first to its last. Whole numbers have equal parts
    /// of the way, or with `log` parts as wide as the ratio to the next one.
    fn between(&self, share: f64) -> Vec<Setting> {
        let Self::Range { path, from, to, log, whole, .. } = self else { return Vec::new() };
        let (low, high) = if *whole { (from.ceil(), to.floor() + 1.0) } else { (*from, *to) };
        let value = match share {
            0.0 => low,
            1.0 => high,
            _ if *log => low * libm::pow(high / low, share),
            _ => low + (high - low) * share,
        };
        let value = if *whole { value.floor().min(high - 1.0) } else { value };
        vec![Setting::new(path.clone(), number(value))]
    }

    /// The path of a range of any numbers that holds a whole one, and that number.
    pub(crate) fn whole_number_between(&self) -> Option<(&str, f64)> {
        match self {
            Self::Range { path, from, to, count: None, step: None, .. } if from.ceil() <= *to => {
                Some((path, from.ceil()))
            }
            _ => None,
        }
    }

    /// Makes a range of any numbers one of whole numbers.
    pub(crate) fn round(&mut self) {
        if let Self::Range { whole, .. } = self {
            *whole = true;
        }
    }
}

/// A number as text, rounded to twelve digits so that no rounding error shows.
fn number(value: f64) -> String {
    plain(format!("{value:.11e}").parse().unwrap_or(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range(count: Option<u32>, step: Option<f64>, log: bool, [from, to]: [f64; 2]) -> Vec<String> {
        let path = "gpu.core_hz".into();
        let axis = Axis::Range { path, from, to, count, step, log, whole: false };
        axis.check(true).unwrap();
        (0..axis.len()).map(|index| axis.value(index)[0].value.to_string()).collect()
    }

    #[test]
    fn ranges_are_linear_or_logarithmic_by_count_or_step() {
        assert_eq!(range(Some(3), None, false, [2e8, 8e8]), ["200000000", "500000000", "800000000"]);
        assert_eq!(range(Some(4), None, true, [1.0, 1000.0]), ["1", "10", "100", "1000"]);
        assert_eq!(range(None, Some(0.1), false, [0.0, 0.3]), ["0", "0.1", "0.2", "0.3"]);
        assert_eq!(range(None, Some(4.0), false, [4.0, 15.0]), ["4", "8", "12"]);
        assert_eq!(range(None, Some(2.0), true, [4.0, 64.0]), ["4", "8", "16", "32", "64"]);
    }

    #[test]
    fn a_share_picks_a_value_or_a_number() {
        let listed = Axis::Values { path: "seed".into(), values: ["1", "2"].map(|n| Text(n.into())).into() };
        let at = |share| listed.at(share)[0].value.to_string();
        assert_eq!([at(0.0), at(0.49), at(0.5), at(0.999)], ["1", "1", "2", "2"]);
        let any = |log, [from, to]: [f64; 2], whole| Axis::Range {
            path: "gpu.core_hz".into(),
            from,
            to,
            count: None,
            step: None,
            log,
            whole,
        };
        let log = any(true, [1.0, 100.0], false);
        assert!(log.check(false).is_ok() && &*log.at(0.5)[0].value == "10");
        // Whole numbers have equal parts of a range, or equal ratios.
        let at = |axis: &Axis, share| axis.at(share)[0].value.to_string();
        let whole = any(false, [3.5, 7.2], true);
        assert_eq!(
            [0.0, 0.24, 0.26, 0.74, 0.76, 1.0].map(|at_| at(&whole, at_)),
            ["4", "4", "5", "6", "7", "7"]
        );
        let whole = any(true, [1.0, 7.0], true);
        assert_eq!(
            [0.0, 0.3, 0.34, 0.66, 0.67, 1.0].map(|at_| at(&whole, at_)),
            ["1", "1", "2", "3", "4", "7"]
        );
    }

    #[test]
    fn names_alone_are_no_axis() {
        let values = |path: &str| Axis::Values { path: path.into(), values: vec![Text("a".into())] };
        let error = values("gpu.name").check(true).unwrap_err();
        assert!(error.contains("changes no number of a run") && error.contains("Linked"), "{error}");
        let linked = |paths: &[&str]| Axis::Linked {
            settings: paths.iter().map(|path| ((*path).into(), vec![Text("1".into())])).collect(),
        };
        assert!(linked(&["gpu.name", "gpu.core_hz"]).check(true).is_ok());
        assert!(linked(&["gpu.name", "gpu.doc"]).check(true).is_err());
    }
}
