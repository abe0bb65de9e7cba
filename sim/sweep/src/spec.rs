//! The sweep file: what is varied, and how the values are combined.

use std::collections::BTreeMap;
use std::path::Path;

use activity::spec;
use serde::Deserialize;
use timing::Level;

use crate::SweepError;
use crate::axis::Axis;
use crate::constraint::Constraint;
use crate::setting::{Setting, Text, check_path};

/// Largest number of points of a sweep.
pub const MAX_POINTS: usize = 1_000_000;

/// Largest number of Sobol' points: that of the generator.
const MAX_SOBOL_POINTS: u32 = 1 << 16;

/// Largest number of axes: that of the generator of Sobol' points.
const MAX_AXES: usize = 256;

/// A sweep file. `docs/guide/sweeps.md` documents every field.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SweepSpec {
    /// Name of the sweep; a folder holds the results of one sweep.
    pub name: String,
    /// Description, one sentence.
    #[serde(default)]
    pub doc: String,
    /// Settings of all points.
    #[serde(default)]
    pub settings: BTreeMap<String, Text>,
    /// Settings that replace others with `--quick`.
    #[serde(default)]
    pub quick: BTreeMap<String, Text>,
    /// What is varied.
    pub axes: Vec<Axis>,
    /// How the values of axes are combined.
    #[serde(default)]
    pub points: Combination,
    /// Number of runs of each point, with one seed after another.
    #[serde(default = "one")]
    pub repetitions: u32,
    /// Timing levels, from the coarsest: designs that one of them shows to be far from the frontier do not
    /// run at the next.
    #[serde(default)]
    pub screen: Vec<Level>,
    /// Combinations that are left out: a point with all values of an entry.
    #[serde(default)]
    pub forbidden: Vec<BTreeMap<String, Text>>,
    /// Expressions over settings of the file that hold for every point, such as `gpu.pipeline.tile_px <= 8`;
    /// others are left out.
    #[serde(default)]
    pub constraints: Vec<String>,
}

const fn one() -> u32 {
    1
}

/// How the values of axes are combined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Combination {
    /// Each value with each; the last axis varies fastest.
    #[default]
    Grid,
    /// Latin hypercube (McKay, Beckman and Conover 1979): each axis is cut into `count` equal parts, with a
    /// point in each.
    LatinHypercube {
        /// Number of points.
        count: u32,
        /// Seed.
        #[serde(default)]
        seed: u32,
    },
    /// First points of the Sobol' sequence, Owen scrambled by the seed.
    Sobol {
        /// Number of points, at most 65536.
        count: u32,
        /// Seed.
        #[serde(default)]
        seed: u32,
    },
}

impl Combination {
    /// Number of points, if it does not follow from the axes.
    pub(crate) const fn count(self) -> Option<u32> {
        match self {
            Self::Grid => None,
            Self::LatinHypercube { count, .. } | Self::Sobol { count, .. } => Some(count),
        }
    }
}

impl SweepSpec {
    /// Reads and checks the sweep file at `path`.
    ///
    /// # Errors
    /// [`SweepError`] with the place in the file.
    pub fn load(path: &Path) -> Result<Self, SweepError> {
        Self::parse(&spec::read(path)?, &path.display().to_string())
    }

    /// Parses and checks RON `text`; messages name `file`.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn parse(text: &str, file: &str) -> Result<Self, SweepError> {
        if text.trim().is_empty() {
            let message = "it is empty: write a sweep, such as (name: \"a\", axes: [])".to_owned();
            return Err(SweepError::Setting { file: file.to_owned(), message });
        }
        let spec: Self = spec::parse(text, file)?;
        spec.check().map_err(SweepError::at(text, file))?;
        Ok(spec)
    }

    /// Settings of all points, with those of `--quick` if it is given.
    pub(crate) fn base(&self, quick: bool) -> Vec<Setting> {
        let mut all = self.settings.clone();
        if quick {
            all.extend(self.quick.clone());
        }
        all.into_iter().map(|(path, value)| Setting::new(path, value.0)).collect()
    }

    /// Checks all fields. Error: place in the file and message.
    fn check(&self) -> Result<(), (String, String)> {
        let wrong = |place: &str, message: &str| Err((place.to_owned(), message.to_owned()));
        if self.name.trim().is_empty() {
            return wrong("name", "it is empty: give the sweep a name");
        }
        for (place, settings) in [("settings", &self.settings), ("quick", &self.quick)] {
            settings
                .keys()
                .try_for_each(|path| check_path(path))
                .map_err(|error| (place.to_owned(), error))?;
        }
        self.check_screen()?;
        self.check_axes()?;
        self.check_forbidden()?;
        self.parsed_constraints()?;
        if self.repetitions == 0 || self.repetitions > 1 && self.varies("seed") {
            return wrong("repetitions", "it has to be 1 or more, and 1 where `seed` is an axis");
        }
        if self.points.count() == Some(0) {
            return wrong("points", "`count` is 0: give 1 or more");
        }
        if matches!(self.points, Combination::Sobol { count, .. } if count > MAX_SOBOL_POINTS) {
            return wrong("points", "there are at most 65536 Sobol' points: give a smaller `count`");
        }
        if self.axes.len() > MAX_AXES {
            return wrong("axes", "there are more than 256: link some, or leave some out");
        }
        if self.size().is_none_or(|size| size > MAX_POINTS) {
            return wrong(
                "axes",
                "they make more than a million runs: give fewer values, or `points: Sobol(count: 64)`",
            );
        }
        Ok(())
    }

    fn check_screen(&self) -> Result<(), (String, String)> {
        let wrong = |message: &str| Err(("screen".to_owned(), message.to_owned()));
        let sets_timing =
            [&self.settings, &self.quick].iter().any(|settings| settings.contains_key("timing"));
        match self.screen.as_slice() {
            [] => Ok(()),
            [_] => wrong("one level screens nothing: give two or three, such as [bound, packet]"),
            levels if !levels.is_sorted_by(|coarse, fine| coarse > fine) => {
                wrong("levels go from the coarsest to the finest: bound, packet, stepped")
            }
            _ if sets_timing || self.varies("timing") => {
                wrong("it sets `timing`, which is also set elsewhere: leave that out")
            }
            _ => Ok(()),
        }
    }

    fn check_axes(&self) -> Result<(), (String, String)> {
        let is_grid = self.points == Combination::Grid;
        for (index, axis) in self.axes.iter().enumerate() {
            axis.check(is_grid).map_err(|message| (format!("axes[{index}]"), message))?;
        }
        let mut seen: Vec<&str> = Vec::new();
        for path in self.paths() {
            if seen.contains(&path) || self.settings.contains_key(path) {
                return Err(("axes".to_owned(), format!("`{path}` is set twice: keep it in one place")));
            }
            seen.push(path);
        }
        match self.quick.keys().find(|path| seen.contains(&path.as_str())) {
            Some(path) => Err(("quick".to_owned(), format!("`{path}` is an axis: leave it out here"))),
            None => Ok(()),
        }
    }

    fn check_forbidden(&self) -> Result<(), (String, String)> {
        let known: Vec<&str> = self.paths().collect();
        for (index, entry) in self.forbidden.iter().enumerate() {
            let place = format!("forbidden[{index}]");
            if entry.is_empty() {
                return Err((place, "it is empty, and would leave out all points".to_owned()));
            }
            if let Some(path) = entry.keys().find(|path| !known.contains(&path.as_str())) {
                let suggestion = spec::suggestion(path, &known);
                return Err((place, format!("`{path}` is not varied, {suggestion}")));
            }
        }
        Ok(())
    }

    /// The constraints. Error: place in the file and message.
    pub(crate) fn parsed_constraints(&self) -> Result<Vec<Constraint>, (String, String)> {
        let known: Vec<&str> =
            self.paths().chain(self.settings.keys().chain(self.quick.keys()).map(String::as_str)).collect();
        let parsed = |(index, text): (usize, &String)| {
            let place = || format!("constraints[{index}]");
            let wrong = |message: String| (place(), format!("`{text}`: {message}"));
            let constraint = Constraint::parse(text).map_err(wrong)?;
            match constraint.paths().into_iter().find(|path| !known.contains(path)) {
                Some(path) => {
                    let suggestion = spec::suggestion(path, &known);
                    Err(wrong(format!("`{path}` is no setting of this file, {suggestion}")))
                }
                None => Ok(constraint),
            }
        };
        self.constraints.iter().enumerate().map(parsed).collect()
    }

    /// Place in the file of the setting `path`.
    pub(crate) fn place_of(&self, path: &str) -> String {
        match self.axes.iter().position(|axis| axis.paths().any(|known| known == path)) {
            Some(axis) => format!("axes[{axis}]"),
            None => "settings".to_owned(),
        }
    }

    /// Whether an axis varies `path`.
    pub(crate) fn varies(&self, path: &str) -> bool {
        self.paths().any(|known| known == path)
    }

    /// Whether a range varies `path`.
    pub(crate) fn is_range(&self, path: &str) -> bool {
        self.axes.iter().any(|axis| matches!(axis, Axis::Range { path: known, .. } if **known == *path))
    }

    /// Paths of all axes.
    pub(crate) fn paths(&self) -> impl Iterator<Item = &str> {
        self.axes.iter().flat_map(Axis::paths)
    }

    /// Number of points before constraints, at all levels and with repetitions; `None` if it overflows.
    pub(crate) fn size(&self) -> Option<usize> {
        let points = match self.points.count() {
            Some(count) => count as usize,
            None => self.axes.iter().try_fold(1_usize, |size, axis| size.checked_mul(axis.len()))?,
        };
        points.checked_mul(self.repetitions as usize)?.checked_mul(self.screen.len().max(1))
    }

    /// Entries of `forbidden` that leave out a point with these values, by number.
    pub(crate) fn forbids<'a>(&'a self, settings: &'a [Setting]) -> impl Iterator<Item = usize> + 'a {
        let has = |(path, value): (&String, &Text)| {
            settings.iter().any(|setting| *setting.path == **path && same(&setting.value, &value.0))
        };
        let entries = self.forbidden.iter().enumerate();
        entries.filter(move |(_, entry)| entry.iter().all(has)).map(|(index, _)| index)
    }

    /// The place in the file that leaves out a point with these settings beside those of all points.
    pub(crate) fn excludes(&self, settings: &[Setting], common: &[Setting]) -> Option<String> {
        if let Some(index) = self.forbids(settings).next() {
            return Some(format!("forbidden[{index}]"));
        }
        let constraints = self.parsed_constraints().unwrap_or_default();
        let holds = |constraint: &Constraint| constraint.holds(&[settings, common]).unwrap_or(false);
        let broken = constraints.iter().position(|constraint| !holds(constraint));
        broken.map(|index| format!("constraints[{index}]"))
    }
}

/// Whether two values are equal, as numbers where both are.
fn same(a: &str, b: &str) -> bool {
    match (a.parse::<f64>(), b.parse::<f64>()) {
        (Ok(a), Ok(b)) => a == b,
        _ => a == b,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn message(text: &str) -> String {
        SweepSpec::parse(text, "a.ron").unwrap_err().to_string()
    }

    #[test]
    fn values_keep_their_text() {
        let text = r#"(name: "a", settings: {"samples": 4, "size": (64, 48), "gpu.core_hz": 2e8, "scene": "tiny",
            "gpu.pipeline.features.edges": true}, axes: [])"#;
        let spec = SweepSpec::parse(text, "a.ron").unwrap();
        let values: Vec<_> = spec.base(false).into_iter().map(|setting| setting.value).collect();
        assert_eq!(
            values.iter().map(|value| &**value).collect::<Vec<_>>(),
            ["200000000", "true", "4", "tiny", "(64, 48)"]
        );
    }

    #[test]
    fn wrong_files_say_where_and_what() {
        let axes = |axes: &str| message(&format!("(name: \"a\", axes: [{axes}])"));
        for (text, says) in [
            (message("(nam: \"a\", axes: [])"), "a.ron:1:2: unknown field `nam`, did you mean `name`?"),
            (message(" \n"), "a.ron: it is empty"),
            (message("(name: \" \", axes: [])"), "a.ron:1: name: it is empty"),
            (axes("Values(path: \"timming\", values: [1])"), "a.ron:1: axes[0]: unknown setting `timming`"),
            (axes("Values(path: \"samples\", values: [])"), "axes[0]: `samples` has no values"),
            (
                axes("Values(path: \"seed\", values: [1]), Values(path: \"seed\", values: [2])"),
                "`seed` is set twice",
            ),
            (axes("Range(path: \"gpu.core_hz\", from: 1, to: 2)"), "give `count` or `step`"),
            (axes("Range(path: \"gpu.core_hz\", from: 0, to: 2, count: 3, log: true)"), "above 0"),
            (axes("Values(path: \"samples\", values: [1, 2, 1])"), "`samples` has 1 twice"),
            (axes("Linked(settings: {\"seed\": [1], \"samples\": [1, 2]})"), "lists of equal length"),
            (message("(name: \"a\", axes: [], points: Sobol(count: 0))"), "points: `count` is 0"),
            (message("(name: \"a\", axes: [], forbidden: [{\"seed\": 1}])"), "`seed` is not varied"),
            (axes("Range(path: \"gpu.core_hz\", from: 1, to: 2, count: 9999999)"), "more than a million"),
            (
                message("(name: \"a\", axes: [], constraints: [\"1 <\"])"),
                "a.ron:1: constraints[0]: `1 <`: a value is missing",
            ),
            (
                message("(name: \"a\", axes: [], settings: {\"samples\": 1}, constraints: [\"sample < 2\"])"),
                "`sample` is no setting of this file, did you mean `samples`?",
            ),
        ] {
            assert!(text.contains(says), "{text}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_parsed_or_refused(text in "[(){}\\[\\]:,\"a-z0-9. ]{0,200}") {
            let _ = SweepSpec::parse(&text, "a.ron");
        }

        #[test]
        fn damaged_files_are_parsed_or_refused(at in 0_usize..400, byte in any::<char>()) {
            let whole = "(name: \"a\", settings: {\"samples\": 4}, axes: [Values(path: \"gpu.pipeline.tile_px\", values: [4, 8]), \
                Range(path: \"gpu.core_hz\", from: 1e8, to: 8e8, count: 4, log: true), \
                Linked(settings: {\"seed\": [1, 2], \"lens_radius\": [0.1, 0.2]})], points: Sobol(count: 8, seed: 1), \
                repetitions: 1, forbidden: [{\"seed\": 1}])";
            prop_assert!(SweepSpec::parse(whole, "a.ron").is_ok());
            let damaged: String = whole.chars().enumerate().map(|(n, c)| if n == at { byte } else { c }).collect();
            let _ = SweepSpec::parse(&damaged, "a.ron");
        }
    }
}
