//! The plan of a sweep: its points with stable ids. Every value is tried once, before anything runs.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use output::dir::sha256_of_text;
use run::{ChangeError, Input, RunError};
use serde::{Deserialize, Serialize};

use crate::setting::{self, Setting};
use crate::spec::SweepSpec;
use crate::{SweepError, points};

/// Version of the files of a sweep.
pub(crate) const SCHEMA: u32 = 1;

/// Digits of an id: of a million points, two have the same with a probability below one in 10^11.
const ID_DIGITS: usize = 20;

/// Most values of a setting that are tried; a value that was not tried fails when it runs.
const MAX_TRIED: usize = 100;

/// A point of a sweep.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Hash of its settings, of the contents of its input files and of the version of the program.
    pub id: String,
    /// Settings that differ from the defaults of `quintile run`.
    pub settings: Vec<Setting>,
}

/// A planned sweep.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Name of the sweep.
    pub name: String,
    /// Points in order.
    pub points: Vec<Point>,
}

impl Plan {
    /// Plans the sweep in the file at `path`, with the settings of `--quick` if it is given. `revision` is the git revision of
    /// the program.
    ///
    /// # Errors
    /// If the file is invalid, a setting is unknown, a value can never be valid, or an input cannot be read.
    pub fn load(path: &Path, quick: bool, revision: Option<&str>) -> Result<Self, SweepError> {
        let spec = SweepSpec::load(path)?;
        let settings = points::points(&spec, quick);
        if settings.is_empty() {
            let (file, place) = (path.display().to_string(), "forbidden".to_owned());
            let message = "all combinations are left out: forbid fewer".to_owned();
            return Err(SweepError::Value { file, place, message });
        }
        let mut trials = Trials::new(path);
        let version = format!("{} {}", env!("CARGO_PKG_VERSION"), revision.unwrap_or_default());
        let point = |settings: Vec<Setting>| {
            let id = trials.inputs_of(&settings).and_then(|inputs| id(&settings, &inputs, &version))?;
            Ok(Point { id, settings })
        };
        let points = settings.into_iter().map(point).collect::<Result<_, SweepError>>()?;
        Ok(Self { name: spec.name, points })
    }
}

/// Id of a point.
fn id(settings: &[Setting], inputs: &str, version: &str) -> Result<String, SweepError> {
    let mut sorted: Vec<&Setting> = settings.iter().collect();
    sorted.sort();
    let lines: String =
        sorted.iter().map(|setting| format!("{:?}={:?}\n", setting.path, setting.value)).collect();
    let hash = sha256_of_text(&format!("{SCHEMA}\n{version}\n{lines}\n{inputs}"));
    Ok(hash.chars().take(ID_DIGITS).collect())
}

/// Values that were tried, and the input files that were found by it.
struct Trials<'a> {
    file: &'a Path,
    tried: HashMap<String, HashSet<String>>,
    /// Hashes of input files as text, by the settings that name them.
    inputs: HashMap<Vec<Setting>, String>,
    hashes: HashMap<PathBuf, String>,
}

impl<'a> Trials<'a> {
    fn new(file: &'a Path) -> Self {
        Self { file, tried: HashMap::new(), inputs: HashMap::new(), hashes: HashMap::new() }
    }

    /// Names and hashes of the input files of a point. It is planned as a run if it has a value that was not tried yet.
    fn inputs_of(&mut self, settings: &[Setting]) -> Result<String, SweepError> {
        let key: Vec<Setting> = settings.iter().filter(|setting| setting.names_files()).cloned().collect();
        let known = self.inputs.get(&key).cloned();
        if let Some(known) = known.as_ref().filter(|_| !self.has_new_value(settings)) {
            return Ok(known.clone());
        }
        let planned = setting::options(settings).and_then(run::Plan::resolve);
        match planned {
            Ok(plan) => {
                let inputs = self.hashed(&plan.files)?;
                self.inputs.insert(key, inputs.clone());
                Ok(inputs)
            }
            Err(source) if is_never_valid(&source) => {
                Err(SweepError::Setting { file: self.file.display().to_string(), source })
            }
            // Other values may go together: the point fails when it runs.
            Err(_) => Ok(known.unwrap_or_default()),
        }
    }

    /// Whether a point has a value that was not tried yet, of a setting with few values.
    fn has_new_value(&mut self, settings: &[Setting]) -> bool {
        let mut is_new = false;
        for Setting { path, value } in settings {
            let tried = self.tried.entry(path.clone()).or_default();
            is_new |= tried.len() < MAX_TRIED && tried.insert(value.clone());
        }
        is_new
    }

    fn hashed(&mut self, files: &[PathBuf]) -> Result<String, SweepError> {
        let mut text = String::new();
        for file in files {
            let hash = match self.hashes.get(file) {
                Some(hash) => hash.clone(),
                None => Input::now(file).map_err(SweepError::Input)?.sha256.unwrap_or_default(),
            };
            text += &format!("{:?} {hash}\n", file.display().to_string());
            self.hashes.insert(file.clone(), hash);
        }
        Ok(text)
    }
}

/// Whether an error of a point holds for its value in any other point, too: a name, a path or a type is wrong.
fn is_never_valid(error: &RunError) -> bool {
    match error {
        RunError::Change(ChangeError::Invalid { .. })
        | RunError::Model(_)
        | RunError::Groups { .. }
        | RunError::Job(_) => false,
        error => error.is_usage(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planned(text: &str) -> Result<Plan, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sweep.ron");
        std::fs::write(&path, text).unwrap();
        Plan::load(&path, false, Some("r1")).map_err(|error| error.to_string())
    }

    fn of_axis(axis: &str) -> Result<Plan, String> {
        planned(&format!("(name: \"a\", settings: {{\"scene\": \"tiny\"}}, axes: [{axis}])"))
    }

    #[test]
    fn ids_depend_on_settings_inputs_and_version() {
        let folder = tempfile::tempdir().unwrap();
        let [sweep, gpu] = ["sweep.ron", "gpu.ron"].map(|name| folder.path().join(name));
        let mobile = include_str!("../../run/gpus/mobile.ron");
        let text = format!(
            "(name: \"a\", settings: {{\"scene\": \"tiny\", \"gpu\": {:?}}}, axes: [Values(path: \"samples\", values: [1, 2])])",
            gpu.display().to_string()
        );
        std::fs::write(&sweep, text).unwrap();
        let ids = |gpu_text: &str, revision| {
            std::fs::write(&gpu, gpu_text).unwrap();
            let plan = Plan::load(&sweep, false, Some(revision)).unwrap();
            plan.points.into_iter().map(|point| point.id).collect::<Vec<_>>()
        };
        let first = ids(mobile, "r1");
        assert!(first.len() == 2 && first[0] != first[1] && first[0].len() == ID_DIGITS);
        assert_eq!(first, ids(mobile, "r1"));
        assert_ne!(first, ids(mobile, "r2"));
        assert_ne!(first, ids(&mobile.replace("latency_cycles: 12", "latency_cycles: 13"), "r1"));
    }

    #[test]
    fn values_that_are_never_valid_are_refused_before_a_run() {
        for (axis, says) in [
            (
                "Values(path: \"gpu.pipeline.tile_pix\", values: [8])",
                "unknown field `tile_pix`, did you mean `tile_px`?",
            ),
            ("Values(path: \"gpu.pipeline.tile_px\", values: [8, \"x\"])", "--set gpu.pipeline.tile_px=x: "),
            ("Values(path: \"timing\", values: [\"boundd\"])", "did you mean `bound`?"),
            ("Values(path: \"workload.bins\", values: [8])", "only workloads have options"),
            ("Values(path: \"platform.units.shade.idle_unit_w\", values: [0])", "did you mean `shader`?"),
            ("Values(path: \"table.rows.draws.nominal_pi\", values: [200])", "did you mean `nominal_pj`?"),
        ] {
            let error = of_axis(axis).unwrap_err();
            assert!(error.contains("sweep.ron: ") && error.contains(says), "{error}");
        }
    }

    #[test]
    fn an_unknown_scene_is_refused() {
        let error = planned("(name: \"a\", axes: [Values(path: \"scene\", values: [\"tiny\", \"tinny\"])])")
            .unwrap_err();
        assert!(error.contains("no scene called `tinny`; did you mean `tiny`?"), "{error}");
    }

    #[test]
    fn a_value_that_fits_others_is_planned() {
        let plan = of_axis("Values(path: \"gpu.pipeline.tile_px\", values: [8, 7])").unwrap();
        assert_eq!(plan.points.len(), 2);
    }
}
