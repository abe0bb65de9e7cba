//! The plan of a sweep: its points with stable ids. Every value is tried once, before anything runs.

use std::path::Path;

use output::dir::sha256_of_text;
use output::terminal::Progress;
use serde::{Deserialize, Serialize};
use timing::Level;

use crate::SweepError;
use crate::error::placed;
use crate::points::{Points, Refusal, Ticker, Trials, round_whole};
use crate::setting::Setting;
use crate::spec::{Combination, SweepSpec};

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
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SweepPlan {
    /// Name of the sweep.
    pub name: String,
    /// Settings of all points; others are the defaults of `quintile run`.
    pub settings: Vec<Setting>,
    /// Points in order.
    pub points: Vec<Point>,
    /// Timing levels that screen designs, from the coarsest; empty without screening. All points at one level
    /// come before those at the next.
    pub screen: Vec<Level>,
    /// Version of the program that planned it, as in the ids.
    pub program: String,
    /// Places in the sweep file of constraints and forbidden entries that leave out no point.
    pub idle: Vec<String>,
}

/// What to do about a constraint or a forbidden entry at `place` that leaves out no point.
pub(crate) fn idle(place: &str) -> String {
    format!("{place} leaves out no point: check it, or remove it")
}

impl SweepPlan {
    /// Plans the sweep in the file at `path`, with the settings of `--quick` if it is given. `program` is the
    /// git revision of the program and whatever else changes with it.
    ///
    /// # Errors
    /// If the file is invalid, a setting is unknown, a value can never be valid, or an input cannot be read.
    pub fn load(path: &Path, quick: bool, program: Option<&str>) -> Result<Self, SweepError> {
        Self::load_with_progress(path, quick, program, &Progress::new(true))
    }

    /// As [`Self::load`], with notes about long planning and about constraints that leave out no point.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_with_progress(
        path: &Path,
        quick: bool,
        program: Option<&str>,
        progress: &Progress,
    ) -> Result<Self, SweepError> {
        let file = path.display().to_string();
        let text = activity::spec::read(path)?;
        let mut spec = SweepSpec::parse(&text, &file)?;
        let common = spec.base(quick);
        round_whole(&mut spec.axes, &common);
        let points = Points::new(&spec, quick).map_err(SweepError::at(&text, &file))?;
        for place in &points.idle {
            progress.note(&format!("{}: {}", placed(&text, &file, place), idle(place)));
        }
        let mut ticker = Ticker::new(progress);
        let mut trials = Trials::new(&points);
        trials
            .try_settings(spec.points == Combination::Grid, &mut ticker)
            .map_err(|refusal| refused(refusal, &spec, (&file, &text), &points))?;
        let version = version(program);
        let count = points.varied.len();
        let id = |at| {
            ticker.tick(|| format!("{at} of {count} points planned"));
            Ok(id(points.settings(at), &trials.inputs_of(at)?, &version))
        };
        let ids = (0..count).map(id).collect::<Result<Vec<_>, SweepError>>()?;
        let Points { common: settings, varied, idle } = points;
        let points = ids.into_iter().zip(varied).map(|(id, settings)| Point { id, settings }).collect();
        Ok(Self { name: spec.name, settings, points, screen: spec.screen, program: version, idle })
    }

    /// Points at the last level of [`Self::screen`], which designs are compared at; all points without screening.
    pub(crate) fn last_level(&self) -> &[Point] {
        self.of_level(self.screen.len().saturating_sub(1))
    }

    /// Points at level number `level` of [`Self::screen`]; all points without screening.
    pub(crate) fn of_level(&self, level: usize) -> &[Point] {
        let count = self.points.len() / self.screen.len().max(1);
        &self.points[level * count..(level + 1) * count]
    }

    /// All settings of a point.
    pub(crate) fn settings_of(&self, point: &Point) -> Vec<Setting> {
        self.settings.iter().chain(&point.settings).cloned().collect()
    }
}

/// The refusal of a setting, with its place in the sweep file.
fn refused(refusal: Refusal, spec: &SweepSpec, (file, text): (&str, &str), points: &Points) -> SweepError {
    let Refusal { message, at, path } = refusal;
    // Messages are those of `quintile run`.
    let message = message.strip_prefix("--set ").or(message.strip_prefix("--")).unwrap_or(&message);
    let settings = points.settings(at);
    let of = |setting: &&Setting| {
        let rest = [&*setting.path, setting.option()].into_iter().find_map(|name| message.strip_prefix(name));
        let rest = rest.filter(|rest| rest.starts_with(['=', ':']))?;
        Some((setting.path.to_string(), format!("{}{rest}", setting.path)))
    };
    let is_quoted = |setting: &&Setting| {
        let Setting { value, .. } = setting;
        message.contains(&format!("`{value}`")) || message.starts_with(&format!("{value}: "))
    };
    let quoted = || settings.iter().find(is_quoted).map(|setting| setting.path.to_string());
    let named = settings.iter().find_map(|setting| of(&setting));
    let named =
        named.or_else(|| path.or_else(quoted).map(|path| (path.clone(), format!("`{path}`: {message}"))));
    let Some((path, message)) = named else {
        return SweepError::Setting { file: file.to_owned(), message: message.to_owned() };
    };
    let value = |path: &str| settings.iter().find(|setting| &*setting.path == path).map(|set| &*set.value);
    let line = text.find(&format!("{path:?}")).map(|at| 1 + text[..at].matches('\n').count());
    let file = line.map_or_else(|| file.to_owned(), |line| format!("{file}:{line}"));
    let with = match value("scene").filter(|_| path.starts_with("workload.") && spec.varies("scene")) {
        Some(scene) => format!("with the scene `{scene}`, "),
        None => String::new(),
    };
    let is_fraction = spec.is_range(&path) && value(&path).is_some_and(|value| value.contains('.'));
    let remedy = if is_fraction { "; for whole numbers give the range a whole `step`" } else { "" };
    let message = format!("{}: {with}{message}{remedy}", spec.place_of(&path));
    SweepError::Setting { file, message }
}

/// Version of the program in ids.
pub(crate) fn version(program: Option<&str>) -> String {
    format!("{} {}", env!("CARGO_PKG_VERSION"), program.unwrap_or_default())
}

/// Id of the first of `points`.
///
/// # Errors
/// If one of its input files cannot be read.
pub(crate) fn id_of(points: &Points, program: Option<&str>) -> Result<String, SweepError> {
    Ok(id(points.settings(0), &Trials::new(points).inputs_of(0)?, &version(program)))
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

    fn planned(text: &str) -> Result<SweepPlan, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sweep.ron");
        std::fs::write(&path, text).unwrap();
        SweepPlan::load(&path, false, Some("r1")).map_err(|error| error.to_string())
    }

    fn of_axis(axis: &str) -> Result<SweepPlan, String> {
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
            let plan = SweepPlan::load(&sweep, false, Some(revision)).unwrap();
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
            (
                "Values(path: \"gpu.pipeline.tile_px\", values: [8, \"x\"])",
                "sweep.ron:1: axes[0]: gpu.pipeline.tile_px=x: ",
            ),
            (
                "Values(path: \"samples\", values: [\"x\"])",
                "sweep.ron:1: axes[0]: samples: `x`: it is not a whole number",
            ),
            ("Values(path: \"timing\", values: [\"boundd\"])", "did you mean `bound`?"),
            (
                "Values(path: \"workload.bins\", values: [8])",
                "workload.bins=8: `tiny` is a scene; only workloads have options",
            ),
            ("Values(path: \"lens_radius\", values: [-1])", "lens_radius: -1: the radius of the lens"),
            ("Values(path: \"gpu\", values: [\"none.ron\"])", "`gpu`: none.ron: cannot read it"),
            ("Values(path: \"platform.units.shade.idle_unit_w\", values: [0])", "did you mean `shader`?"),
            ("Values(path: \"table.rows.draws.nominal_pi\", values: [200])", "did you mean `nominal_pj`?"),
        ] {
            let error = of_axis(axis).unwrap_err();
            assert!(error.contains("sweep.ron:1: axes[0]: ") && error.contains(says), "{error}");
        }
    }

    #[test]
    fn an_option_of_one_workload_names_the_other_and_its_place() {
        let text = "(name: \"a\", axes: [Values(path: \"scene\", values: [\"glossy\", \"deferred\"]),\n\
            Values(path: \"workload.texels\", values: [64])])";
        let error = planned(text).unwrap_err();
        let says =
            "sweep.ron:2: axes[1]: with the scene `deferred`, workload.texels=64: unknown option `texels`";
        assert!(error.contains(says), "{error}");
    }

    #[test]
    fn whole_settings_get_whole_numbers_of_a_range() {
        let sweep = |axes: &str| {
            let text =
                "(name: \"a\", settings: {\"scene\": \"tiny\"}, points: Sobol(count: 32), axes: [AXES])";
            planned(&text.replace("AXES", axes))
        };
        let axes = "Range(path: \"samples\", from: 1, to: 4), Range(path: \"gpu.core_hz\", from: 1e8, to: 4e8), \
            Range(path: \"gpu.units.depth.queue\", from: 2.5, to: 64, log: true)";
        let plan = sweep(axes).unwrap();
        let of = |path: &str| -> Vec<f64> {
            let all = plan.points.iter().flat_map(|point| &point.settings).filter(|set| &*set.path == path);
            all.map(|setting| setting.value.parse().unwrap()).collect()
        };
        let samples = of("samples");
        let count = |value: f64| samples.iter().filter(|sample| **sample == value).count();
        assert_eq!([1.0, 2.0, 3.0, 4.0].map(count), [8; 4]);
        assert!(
            of("gpu.units.depth.queue")
                .iter()
                .all(|queue| queue.fract() == 0.0 && (3.0..=64.0).contains(queue))
        );
        assert!(of("gpu.core_hz").iter().any(|hz| hz.fract() != 0.0));
        // Without a whole number in the range, and in a grid, the message says what to do.
        let error = sweep("Range(path: \"samples\", from: 1.2, to: 1.8)").unwrap_err();
        assert!(
            error.contains("samples: `1.") && error.ends_with("give the range a whole `step`"),
            "{error}"
        );
        let error = of_axis("Range(path: \"samples\", from: 1, to: 2, count: 3)").unwrap_err();
        assert!(
            error.contains("samples: `1.5`") && error.ends_with("give the range a whole `step`"),
            "{error}"
        );
    }

    #[test]
    fn an_unknown_scene_is_refused() {
        let error = planned("(name: \"a\", axes: [Values(path: \"scene\", values: [\"tiny\", \"tinny\"])])")
            .unwrap_err();
        assert!(error.contains("axes[0]: `scene`: no scene called `tinny`; did you mean `tiny`?"), "{error}");
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
