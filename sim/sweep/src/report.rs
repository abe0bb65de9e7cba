//! What a sweep found: the designs that no other dominates in time and energy, and the main effect of each setting.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};

use output::MeanSd;
use serde::Serialize;
use traces::pareto::{Point as Measurement, RatedPoint, frontier};

use crate::execute::{Measured, Outcome};
use crate::plan::{Plan, Point};
use crate::setting::Setting;
use crate::{Folder, SweepError};

/// Most values of a setting for which effects are given: of more, a value is in too few points.
const MAX_VALUES: usize = 20;

/// Seed of the draws for probabilities.
const SEED: u64 = 1;

/// Report of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Designs by workload: busy time and energy of a frame, compared within the workload. Runs that differ in their seed alone
    /// are one design, with standard deviations.
    pub workloads: BTreeMap<String, Vec<RatedPoint>>,
    /// Main effects.
    pub effects: Vec<Effect>,
    /// Points that failed or are not finished; they are left out.
    pub left_out: usize,
}

/// Main effect of a value of a setting: geometric means over all points with it, over those of all points of the workload.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Effect {
    /// The workload.
    pub workload: String,
    /// The setting.
    pub setting: String,
    /// Its value.
    pub value: String,
    /// Points with this value.
    pub points: usize,
    /// Busy time over the mean.
    pub time_ratio: f64,
    /// Busy energy over the mean.
    pub energy_ratio: f64,
}

/// A measured point.
struct Row<'a> {
    workload: String,
    design: String,
    settings: Vec<&'a Setting>,
    time_s: f64,
    energy_j: f64,
}

impl Report {
    /// Report of the sweep in `folder`.
    ///
    /// # Errors
    /// If the plan or a result cannot be read.
    pub fn of(folder: &Folder) -> Result<Self, SweepError> {
        let plan = folder.plan()?;
        let names = short_names(&plan);
        let mut rows = Vec::new();
        for point in &plan.points {
            if let Some(Outcome::Measured(measured)) = folder.result(point)?.map(|result| result.outcome) {
                rows.push(Row::new(point, &measured, &names));
            }
        }
        let left_out = plan.points.len() - rows.len();
        let mut by_workload: BTreeMap<String, Vec<Row<'_>>> = BTreeMap::new();
        for row in rows {
            by_workload.entry(row.workload.clone()).or_default().push(row);
        }
        let effects = by_workload.iter().flat_map(|(workload, rows)| effects(workload, rows)).collect();
        let rated =
            |(workload, rows): (String, Vec<Row<'_>>)| (workload, frontier(&designs(&rows), 0.0, SEED));
        Ok(Self { workloads: by_workload.into_iter().map(rated).collect(), effects, left_out })
    }

    /// Writes the effects as CSV.
    ///
    /// # Errors
    /// The errors of `out`.
    pub fn write_effects(&self, out: impl Write) -> io::Result<()> {
        let mut csv = csv::Writer::from_writer(out);
        self.effects.iter().try_for_each(|effect| csv.serialize(effect))?;
        csv.flush()
    }
}

impl<'a> Row<'a> {
    fn new(point: &'a Point, measured: &Measured, names: &BTreeMap<&str, &str>) -> Self {
        let name = |set: &Setting| format!("{}={}", names.get(&*set.path).unwrap_or(&&*set.path), set.value);
        let (settings, conditions): (Vec<&Setting>, Vec<&Setting>) = point
            .settings
            .iter()
            .filter(|setting| setting.path != "seed")
            .partition(|setting| setting.is_of_design());
        let scene = measured.used.get("scene").cloned();
        let others = conditions.iter().filter(|set| set.path != "scene");
        let workload = scene.into_iter().chain(others.map(|set| name(set)));
        let design = settings.iter().map(|set| name(set));
        Self {
            workload: workload.collect::<Vec<_>>().join(", "),
            design: design.collect::<Vec<_>>().join(" "),
            settings,
            time_s: measured.busy_ms * 1e-3,
            energy_j: measured.busy_mj * 1e-3,
        }
    }
}

fn last_name(path: &str) -> &str {
    path.rsplit('.').next().unwrap_or(path)
}

/// The last name of each path that varies, or the whole path where two end in the same one.
fn short_names<'a>(plan: &'a Plan) -> BTreeMap<&'a str, &'a str> {
    let settings = plan.points.iter().flat_map(|point| &point.settings);
    let paths: BTreeSet<&str> = settings.map(|setting| setting.path.as_str()).collect();
    let name = |path: &&'a str| {
        let last = last_name(path);
        let is_unique = paths.iter().filter(|other| last_name(other) == last).count() == 1;
        (*path, if is_unique { last } else { *path })
    };
    paths.iter().map(name).collect()
}

/// Designs in order of first use, with means and standard deviations over their runs.
fn designs(rows: &[Row<'_>]) -> Vec<Measurement> {
    let mut order: Vec<&str> = Vec::new();
    let mut runs: BTreeMap<&str, Vec<&Row<'_>>> = BTreeMap::new();
    for row in rows {
        let known = runs.entry(&row.design).or_default();
        if known.is_empty() {
            order.push(&row.design);
        }
        known.push(row);
    }
    let measured = |design: &&str| {
        let of = |value: fn(&Row<'_>) -> f64| MeanSd::of(runs[design].iter().map(|row| value(row)));
        let (time, energy) = (of(|row| row.time_s)?, of(|row| row.energy_j)?);
        Some(Measurement {
            label: (*design).to_owned(),
            time_s: time.mean,
            energy_j: energy.mean,
            time_deviation_s: time.sd,
            energy_deviation_j: energy.sd,
        })
    };
    order.iter().filter_map(measured).collect()
}

/// Main effects of all settings with few values.
fn effects(workload: &str, rows: &[Row<'_>]) -> Vec<Effect> {
    let mut values: Vec<(&str, Vec<&str>)> = Vec::new();
    for setting in rows.iter().flat_map(|row| &row.settings) {
        match values.iter_mut().find(|(path, _)| *path == setting.path) {
            Some((_, known)) if known.contains(&setting.value.as_str()) || known.len() > MAX_VALUES => {}
            Some((_, known)) => known.push(&setting.value),
            None => values.push((&setting.path, vec![&setting.value])),
        }
    }
    values.retain(|(_, known)| (2..=MAX_VALUES).contains(&known.len()));
    let all = LogMeans::of(rows.iter());
    let effect = |path: &str, value: &str| {
        let has = |row: &&Row<'_>| row.settings.iter().any(|set| set.path == path && set.value == value);
        let with = LogMeans::of(rows.iter().filter(has));
        Effect {
            workload: workload.to_owned(),
            setting: path.to_owned(),
            value: value.to_owned(),
            points: with.points,
            time_ratio: libm::exp(with.time - all.time),
            energy_ratio: libm::exp(with.energy - all.energy),
        }
    };
    values.iter().flat_map(|(path, known)| known.iter().map(|value| effect(path, value))).collect()
}

/// Means of the logarithms of time and energy.
struct LogMeans {
    points: usize,
    time: f64,
    energy: f64,
}

impl LogMeans {
    fn of<'a, 'b: 'a>(rows: impl Iterator<Item = &'a Row<'b>>) -> Self {
        let logs: Vec<(f64, f64)> =
            rows.map(|row| (libm::log(row.time_s), libm::log(row.energy_j))).collect();
        let count = logs.len().max(1) as f64;
        let sum = logs.iter().fold((0.0, 0.0), |sum, log| (sum.0 + log.0, sum.1 + log.1));
        Self { points: logs.len(), time: sum.0 / count, energy: sum.1 / count }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row<'a>(settings: &'a [Setting], time_s: f64, energy_j: f64) -> Row<'a> {
        let design =
            settings.iter().map(|set| format!("{}={}", set.path, set.value)).collect::<Vec<_>>().join(" ");
        Row { workload: String::new(), design, settings: settings.iter().collect(), time_s, energy_j }
    }

    fn settings() -> Vec<[Setting; 2]> {
        let pairs = [("1", "a"), ("1", "b"), ("2", "a"), ("2", "b")];
        pairs.map(|(x, y)| [Setting::new("gpu.x", x), Setting::new("gpu.y", y)]).into()
    }

    #[test]
    fn effects_are_the_factors_of_a_product() {
        let settings = settings();
        let times = [1.0, 3.0, 4.0, 12.0];
        let rows: Vec<Row<'_>> =
            settings.iter().zip(times).map(|(set, time_s)| row(set, time_s, 2.0)).collect();
        let found = effects("w", &rows);
        let ratios: Vec<f64> = found.iter().map(|effect| effect.time_ratio).collect();
        // Factors 4 for x and 3 for y, each split around the mean.
        let expected = [0.5, 2.0, 1.0 / 3_f64.sqrt(), 3_f64.sqrt()];
        assert!(ratios.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{ratios:?}");
        assert!(found.iter().all(|effect| effect.points == 2 && (effect.energy_ratio - 1.0).abs() < 1e-12));
    }

    #[test]
    fn names_are_short_where_they_are_unique() {
        let paths = ["gpu.a.queue", "gpu.b.queue", "gpu.core_hz"];
        let settings = paths.map(|path| Setting::new(path, "1")).into();
        let points = vec![Point { id: String::new(), settings }];
        let plan = Plan { name: String::new(), settings: Vec::new(), points, screen: Vec::new() };
        let names: Vec<&str> = short_names(&plan).into_values().collect();
        assert_eq!(names, ["gpu.a.queue", "gpu.b.queue", "core_hz"]);
    }

    #[test]
    fn runs_of_one_design_are_averaged() {
        let settings = settings();
        let rows = [row(&settings[0], 1.0, 5.0), row(&settings[1], 9.0, 9.0), row(&settings[0], 3.0, 5.0)];
        let designs = designs(&rows);
        assert_eq!(designs.len(), 2);
        assert_eq!((designs[0].time_s, designs[0].energy_j), (2.0, 5.0));
        assert!(
            (designs[0].time_deviation_s - 2_f64.sqrt()).abs() < 1e-12 && designs[1].time_deviation_s == 0.0
        );
    }
}
