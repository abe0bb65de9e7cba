//! Points that a search requests one after another: a place on each axis in, time and energy out.

use std::collections::HashSet;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::axis::Axis;
use crate::execute::{Outcome, execute};
use crate::plan::{Point, SweepPlan, id_of, version};
use crate::points::{Points, round_whole};
use crate::setting::Setting;
use crate::spec::SweepSpec;
use crate::{Folder, SweepError};

/// A search in the space of a sweep file. Points that were run before are read from the folder.
pub struct Search<'a> {
    spec: SweepSpec,
    common: Vec<Setting>,
    program: Option<&'a str>,
    folder: &'a Folder,
    requested: Vec<Point>,
    known: HashSet<String>,
}

/// An axis as the optimizer gets it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Dimension {
    /// Settings that change along it.
    pub paths: Vec<String>,
    /// Number of its values; `None` for any number of a range.
    pub values: Option<usize>,
}

/// A request: a place on each axis.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Question {
    /// From 0 to 1 along each axis, in their order. Value `i` of `n` is at `(i + 0.5) / n`.
    pub at: Vec<f64>,
}

/// The answer: what a point costs, or why there is no answer.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Answer {
    /// Settings of the point.
    pub settings: Vec<Setting>,
    /// Id of the point, if it is one.
    pub id: Option<String>,
    /// Busy time of a frame in milliseconds.
    #[serde(rename = "busy_ms")]
    pub busy_ms: Option<f64>,
    /// Busy energy of a frame in millijoules.
    #[serde(rename = "busy_mJ")]
    pub busy_mj: Option<f64>,
    /// Nominal area in square millimetres.
    pub area_mm2: Option<f64>,
    /// Why there are no numbers.
    pub error: Option<String>,
}

impl<'a> Search<'a> {
    /// A search in the sweep file at `path`. `program` is the version of the program, as for [`SweepPlan::load`].
    ///
    /// # Errors
    /// If the file is invalid, or the folder holds another sweep.
    pub fn new(
        path: &Path,
        quick: bool,
        program: Option<&'a str>,
        folder: &'a Folder,
    ) -> Result<Self, SweepError> {
        let mut spec = SweepSpec::load(path)?;
        if !spec.screen.is_empty() || spec.repetitions != 1 {
            let message = "a search runs each point once, at one level: leave `screen` and `repetitions` out"
                .to_owned();
            return Err(SweepError::Setting { file: path.display().to_string(), message });
        }
        let common = spec.base(quick);
        round_whole(&mut spec.axes, &common);
        let search = Self { spec, common, program, folder, requested: Vec::new(), known: HashSet::new() };
        folder.check(&search.plan(Vec::new()))?;
        Ok(search)
    }

    /// The axes.
    pub fn dimensions(&self) -> Vec<Dimension> {
        let dimension = |axis: &Axis| Dimension {
            paths: axis.paths().map(str::to_owned).collect(),
            values: Some(axis.len()).filter(|count| *count > 0),
        };
        self.spec.axes.iter().map(dimension).collect()
    }

    /// Answers a question. A question that cannot be answered is an answer with its reason.
    ///
    /// # Errors
    /// If a result cannot be read or written.
    pub fn answer(&mut self, question: &Question) -> Result<Answer, SweepError> {
        let settings = match self.settings(question) {
            Ok(settings) => settings,
            Err(error) => return Ok(Answer { error: Some(error), ..Answer::default() }),
        };
        let points = Points { common: self.common.clone(), varied: vec![settings.clone()], idle: Vec::new() };
        let point = Point { id: id_of(&points, self.program)?, settings };
        let result = match self.folder.result(&point)? {
            Some(result) => result,
            None => {
                let result = execute(&point.id, &points.settings(0));
                self.folder.write_result(&point, &result)?;
                result
            }
        };
        if self.known.insert(point.id.clone()) {
            self.requested.push(point.clone());
        }
        let answer = Answer { settings: point.settings, id: Some(point.id), ..Answer::default() };
        Ok(match result.outcome {
            Outcome::Measured(measured) => Answer {
                busy_ms: Some(measured.busy_ms),
                busy_mj: Some(measured.busy_mj),
                area_mm2: Some(measured.area_mm2[0]),
                ..answer
            },
            other => Answer { error: other.reason(), ..answer },
        })
    }

    /// Settings of a question.
    fn settings(&self, question: &Question) -> Result<Vec<Setting>, String> {
        let (given, axes) = (question.at.len(), self.spec.axes.len());
        if given != axes {
            return Err(format!("`at` has {given} numbers for {axes} axes"));
        }
        if let Some(wrong) = question.at.iter().find(|place| !(0.0..=1.0).contains(*place)) {
            return Err(format!("`at` has {wrong}; places on an axis are 0 to 1"));
        }
        let places = self.spec.axes.iter().zip(&question.at);
        let settings: Vec<Setting> = places.flat_map(|(axis, &place)| axis.at(place)).collect();
        match self.spec.excludes(&settings, &self.common) {
            Some(place) => Err(format!("{place} leaves this point out")),
            None => Ok(settings),
        }
    }

    /// Writes the plan of all points that were requested, beside those of an earlier plan, so that they can
    /// be merged.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(self) -> Result<usize, SweepError> {
        let mut points = if self.folder.holds_plan() { self.folder.plan()?.points } else { Vec::new() };
        let earlier: HashSet<String> = points.iter().map(|point| point.id.clone()).collect();
        points.extend(self.requested.iter().filter(|point| !earlier.contains(&point.id)).cloned());
        if !points.is_empty() {
            self.folder.write_plan(&self.plan(points))?;
        }
        Ok(self.requested.len())
    }

    fn plan(&self, points: Vec<Point>) -> SweepPlan {
        let (name, settings) = (self.spec.name.clone(), self.common.clone());
        SweepPlan { name, settings, points, program: version(self.program), ..SweepPlan::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Status, merge};

    const SPACE: &str = r#"(
        name: "space",
        settings: {"scene": "tiny", "frames": (0, 1), "size": (16, 12), "samples": 1},
        axes: [
            Values(path: "gpu.pipeline.tile_px", values: [4, 8]),
            Range(path: "gpu.core_hz", from: 200e6, to: 800e6, count: 4),
        ],
        constraints: ["gpu.core_hz < 700e6 || gpu.pipeline.tile_px == 8"],
    )"#;

    #[test]
    fn answers_are_those_of_a_sweep_and_can_be_merged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("space.ron");
        std::fs::write(&path, SPACE).unwrap();
        let out = Folder::at(folder.path().join("out"));
        let mut search = Search::new(&path, false, None, &out).unwrap();
        let counts: Vec<_> = search.dimensions().iter().map(|dimension| dimension.values).collect();
        assert_eq!(counts, [Some(2), Some(4)]);
        let mut ask = |at: &[f64]| search.answer(&Question { at: at.to_vec() }).unwrap();
        let first = ask(&[0.25, 0.375]);
        assert_eq!(first.settings.iter().map(|set| &*set.value).collect::<Vec<_>>(), ["4", "400000000"]);
        assert!(first.busy_ms.unwrap() > 0.0 && first.error.is_none());
        assert_eq!(first, ask(&[0.3, 0.4]), "another place in the same part of each axis");
        assert_ne!(first.busy_ms, ask(&[0.25, 0.6]).busy_ms);
        let reason = |answer: Answer| answer.error.unwrap();
        assert!(reason(ask(&[0.25, 0.9])).contains("constraints[0] leaves this point out"));
        assert!(reason(ask(&[0.5])).contains("1 numbers for 2 axes"));
        assert!(reason(ask(&[0.5, 1.5])).contains("0 to 1"));
        assert_eq!(search.finish().unwrap(), 2);
        assert_eq!(Status::of(&out).unwrap().0.finished, 2);
        assert!(merge(&out, false).is_ok());
    }
}
