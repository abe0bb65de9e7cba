//! The plan of a sweep: its points with stable ids. Every value is tried once, before anything runs.

use std::path::Path;

use output::dir::sha256_of_text;
use serde::{Deserialize, Serialize};

use crate::SweepError;
use crate::points::Points;
use crate::setting::Setting;
use crate::spec::{Combination, SweepSpec};
use crate::trials::{Refusal, Trials};

/// Version of the files of a sweep.
pub(crate) const SCHEMA: u32 = 2;

/// Digits of an id: of a million points, two have the same with a probability below one in 10^11.
const ID_DIGITS: usize = 20;

/// A point of a sweep.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Hash of its settings, of the contents of its input files and of the version of the program.
    pub id: String,
    /// Settings beside those of all points.
    pub settings: Vec<Setting>,
}

/// A planned sweep.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Name of the sweep.
    pub name: String,
    /// Settings of all points; others are the defaults of `quintile run`.
    pub settings: Vec<Setting>,
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
        let file = || path.display().to_string();
        let spec = SweepSpec::load(path)?;
        let points = Points::new(&spec, quick);
        if points.varied.is_empty() {
            let (place, message) = ("forbidden", "all combinations are left out: forbid fewer");
            return Err(SweepError::Value {
                file: file(),
                place: place.to_owned(),
                message: message.to_owned(),
            });
        }
        let mut trials = Trials::new(&points);
        trials.try_settings(spec.points == Combination::Grid).map_err(|Refusal { message, is_usage }| {
            SweepError::Setting { file: file(), message, is_usage }
        })?;
        let version = format!("{} {}", env!("CARGO_PKG_VERSION"), revision.unwrap_or_default());
        let id = |at| Ok(id(points.settings(at), &trials.inputs_of(at)?, &version));
        let ids = (0..points.varied.len()).map(id).collect::<Result<Vec<_>, SweepError>>()?;
        let Points { common: settings, varied } = points;
        let points = ids.into_iter().zip(varied).map(|(id, settings)| Point { id, settings }).collect();
        Ok(Self { name: spec.name, settings, points })
    }

    /// All settings of a point.
    pub(crate) fn settings_of(&self, point: &Point) -> Vec<Setting> {
        self.settings.iter().chain(&point.settings).cloned().collect()
    }
}

/// Id of a point.
fn id(mut settings: Vec<Setting>, inputs: &str, version: &str) -> String {
    settings.sort();
    let lines: String =
        settings.iter().map(|setting| format!("{:?}={:?}\n", setting.path, setting.value)).collect();
    let hash = sha256_of_text(&format!("{SCHEMA}\n{version}\n{lines}\n{inputs}"));
    hash.chars().take(ID_DIGITS).collect()
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
    fn a_value_that_fits_some_others_is_planned() {
        let coarse = "Values(path: \"gpu.pipeline.coarse_tile_px\", values: [4, 32])";
        let tile = "Values(path: \"gpu.pipeline.tile_px\", values: [8, 2])";
        assert_eq!(of_axis(&format!("{tile}, {coarse}")).unwrap().points.len(), 4);
        let never = of_axis(&format!("{}, {coarse}", tile.replace("8", "7"))).unwrap_err();
        assert!(never.contains("tile_px=7"), "{never}");
    }
}
