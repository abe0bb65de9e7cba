//! Designs: what is set in GPU, platform and energy table, with what it costs. Their settings are factors of
//! a model, with values by number.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use output::MeanSd;
use serde::Serialize;

use crate::execute::Measured;
use crate::plan::{Point, SweepPlan};
use crate::setting::Setting;

/// A measured point.
pub(crate) struct Row<'a> {
    pub workload: String,
    pub design: String,
    settings: Vec<&'a Setting>,
    conditions: Vec<&'a Setting>,
    time_s: f64,
    /// Nominal, low and high.
    energy_j: [f64; 3],
    time_error: f64,
    energy_error: f64,
    area_mm2: Option<f64>,
    /// Codes of warnings, comma-separated.
    warnings: String,
}

/// A quantity of a design: mean over its runs, and what is known of its error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// Mean.
    pub value: f64,
    /// Standard deviation between runs that differ in their seed.
    pub deviation: f64,
    /// Stated error of the timing level: the truth is at most `1 + error` times as large and at least `1 /
    /// (1 + error)` times.
    pub error: f64,
    /// With all energies of the table at their low end.
    pub low: f64,
    /// With all energies of the table at their high end.
    pub high: f64,
}

/// A design of a workload.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepDesign {
    /// Settings of the design in short.
    pub design: String,
    /// Settings of the hardware that vary, by path.
    pub settings: BTreeMap<String, String>,
    /// Settings of the work that vary, by path.
    pub conditions: BTreeMap<String, String>,
    /// Runs, which differ in their seed.
    pub runs: usize,
    /// Busy time of a frame in seconds.
    pub time_s: Cost,
    /// Busy energy of a frame in joules.
    pub energy_j: Cost,
    /// Area in square millimetres, if it is known.
    pub area_mm2: Option<f64>,
    /// Codes of the warnings of its runs, sorted.
    pub warnings: Vec<String>,
}

impl SweepDesign {
    /// Whether platform and energy table are not those of its GPU, so that its energy is less certain than stated.
    pub fn is_mismatched(&self) -> bool {
        self.warnings.iter().any(|code| code == "platform-mismatch")
    }
}

/// Settings in short; a name for the design without any.
pub(crate) fn label<'a>(
    settings: impl IntoIterator<Item = &'a Setting>,
    names: &BTreeMap<&str, &str>,
) -> String {
    let name = |set: &Setting| format!("{}={}", names.get(&*set.path).unwrap_or(&&*set.path), set.value);
    let names: Vec<String> = settings.into_iter().map(name).collect();
    if names.is_empty() { "the only one".to_owned() } else { names.join(" ") }
}

impl<'a> Row<'a> {
    /// A point with its numbers, and short names of settings; those in `same` distinguish neither designs nor
    /// workloads.
    pub fn new(point: &'a Point, measured: &Measured, names: &BTreeMap<&str, &str>, same: &[&str]) -> Self {
        let others = point.settings.iter().filter(|setting| !same.contains(&&*setting.path));
        let (settings, conditions): (Vec<&Setting>, Vec<&Setting>) =
            others.partition(|setting| setting.is_of_design());
        let scene = measured.used.get("scene").cloned();
        let others = conditions.iter().filter(|set| &*set.path != "scene");
        let workload = scene.into_iter().chain(others.map(|set| label([*set], names)));
        Self {
            workload: workload.collect::<Vec<_>>().join(", "),
            design: label(settings.iter().copied(), names),
            settings,
            conditions,
            time_s: measured.busy_ms * 1e-3,
            energy_j: [measured.busy_mj, measured.busy_low_mj, measured.busy_high_mj].map(|mj| mj * 1e-3),
            time_error: measured.cycles_error,
            energy_error: measured.energy_error,
            area_mm2: Some(measured.area_mm2[0]),
            warnings: measured.warnings.clone(),
        }
    }
}

fn last_name(path: &str) -> &str {
    path.rsplit('.').next().unwrap_or(path)
}

/// The last name of each path that varies, or the whole path where two end in the same one.
pub(crate) fn short_names(plan: &SweepPlan) -> BTreeMap<&str, &str> {
    let settings = plan.points.iter().flat_map(|point| &point.settings);
    let paths: BTreeSet<&str> = settings.map(|setting| &*setting.path).collect();
    let name = |path: &&'_ str| {
        let last = last_name(path);
        paths.iter().filter(|other| last_name(other) == last).count() == 1
    };
    paths.iter().map(|path| (*path, if name(path) { last_name(path) } else { *path })).collect()
}

/// Designs in order of first use, with means and standard deviations over their runs.
pub(crate) fn designs(rows: &[Row<'_>]) -> Vec<SweepDesign> {
    let mut places: HashMap<&str, usize> = HashMap::new();
    let mut runs: Vec<Vec<&Row<'_>>> = Vec::new();
    for row in rows {
        let place = *places.entry(&row.design).or_insert_with(|| {
            runs.push(Vec::new());
            runs.len() - 1
        });
        runs[place].push(row);
    }
    runs.iter().filter_map(|runs| mean(runs)).collect()
}

fn mean(runs: &[&Row<'_>]) -> Option<SweepDesign> {
    let of = |value: &dyn Fn(&Row<'_>) -> f64| MeanSd::of(runs.iter().map(|row| value(row)));
    // The largest error of the runs.
    let error = |of: fn(&Row<'_>) -> f64| runs.iter().map(|row| of(row)).fold(0.0, f64::max);
    let time = of(&|row| row.time_s)?;
    let energy = of(&|row| row.energy_j[0])?;
    let [low, high] = [1, 2].map(|end| of(&|row| row.energy_j[end]).map_or(energy.mean, |ends| ends.mean));
    let texts = |settings: &[&Setting]| {
        settings.iter().map(|set| (set.path.to_string(), set.value.to_string())).collect::<BTreeMap<_, _>>()
    };
    let first = runs.first()?;
    let codes = runs.iter().flat_map(|run| run.warnings.split(',')).filter(|code| !code.is_empty());
    let codes: BTreeSet<&str> = codes.collect();
    Some(SweepDesign {
        design: first.design.clone(),
        settings: texts(&first.settings),
        conditions: texts(&first.conditions),
        runs: runs.len(),
        time_s: Cost {
            value: time.mean,
            deviation: time.sd.unwrap_or(0.0),
            error: error(|row| row.time_error),
            low: time.mean,
            high: time.mean,
        },
        energy_j: Cost {
            value: energy.mean,
            deviation: energy.sd.unwrap_or(0.0),
            error: error(|row| row.energy_error),
            low,
            high,
        },
        area_mm2: first.area_mm2,
        warnings: codes.into_iter().map(str::to_owned).collect(),
    })
}

/// Number of groups of a setting with many values.
const GROUPS: usize = 4;

/// A setting, or several that are linked: their values by number.
pub(crate) struct Factor {
    pub name: String,
    /// Numbers in their order; other values in order of first use.
    pub values: Vec<String>,
    /// Value of each design.
    pub codes: Vec<usize>,
}

impl Factor {
    /// The values as numbers, linked ones by the first setting; `None` if one is no number.
    fn numbers(&self) -> Option<Vec<f64>> {
        let number = |value: &String| {
            value.split(" + ").next()?.parse().ok().filter(|number: &f64| number.is_finite())
        };
        self.values.iter().map(number).collect()
    }

    /// Sorts the values, if they are numbers.
    fn sort(&mut self) {
        let Some(numbers) = self.numbers() else { return };
        let mut order: Vec<usize> = (0..numbers.len()).collect();
        order.sort_by(|&a, &b| numbers[a].total_cmp(&numbers[b]));
        let mut places = vec![0; order.len()];
        order.iter().enumerate().for_each(|(place, &from)| places[from] = place);
        self.values = order.iter().map(|&from| self.values[from].clone()).collect();
        self.codes.iter_mut().for_each(|code| *code = places[*code]);
    }

    /// The factor with groups of neighbouring values in place of values, of about as many designs each;
    /// `None` if values are no numbers.
    pub fn grouped(&self) -> Option<Self> {
        self.numbers()?;
        let counts: Vec<usize> =
            cells(self.codes.iter().copied(), self.values.len()).iter().map(Vec::len).collect();
        let (mut before, mut groups) = (0, Vec::with_capacity(counts.len()));
        for count in &counts {
            // By the middle of the designs with this value.
            groups.push((2 * before + count) * GROUPS / (2 * self.codes.len()));
            before += count;
        }
        // A value with many designs may leave a group empty.
        let mut used = groups.clone();
        used.dedup();
        let value = |group: &usize| {
            let mut members =
                self.values.iter().zip(&groups).filter(|(_, of)| *of == group).map(|(value, _)| value);
            let first = members.next().cloned().unwrap_or_default();
            members.next_back().map_or(first.clone(), |last| format!("{first} to {last}"))
        };
        let code = |code: &usize| used.iter().position(|group| *group == groups[*code]).unwrap_or_default();
        Some(Self {
            name: self.name.clone(),
            values: used.iter().map(value).collect(),
            codes: self.codes.iter().map(code).collect(),
        })
    }
}

/// Settings that vary, of which those that always change together are one.
pub(crate) fn factors(settings: &[Vec<(String, String)>]) -> Vec<Factor> {
    let mut factors = linked(varied(settings));
    factors.iter_mut().for_each(Factor::sort);
    factors
}

/// Settings that vary, with values in order of first use.
fn varied(settings: &[Vec<(String, String)>]) -> Vec<Factor> {
    let mut factors: Vec<Factor> = Vec::new();
    let mut places: HashMap<&str, usize> = HashMap::new();
    let mut known: Vec<HashMap<&str, usize>> = Vec::new();
    for (at, (path, value)) in
        settings.iter().enumerate().flat_map(|(at, set)| set.iter().map(move |s| (at, s)))
    {
        let place = *places.entry(path).or_insert_with(|| {
            factors.push(Factor { name: path.clone(), values: Vec::new(), codes: vec![0; settings.len()] });
            known.push(HashMap::new());
            known.len() - 1
        });
        let factor = &mut factors[place];
        let code = *known[place].entry(value).or_insert_with(|| {
            factor.values.push(value.clone());
            factor.values.len() - 1
        });
        factor.codes[at] = code;
    }
    factors.retain(|factor| factor.values.len() > 1);
    factors
}

/// Factors of which settings that always change together are one.
fn linked(factors: Vec<Factor>) -> Vec<Factor> {
    let mut kept: Vec<Factor> = Vec::new();
    for factor in factors {
        match kept.iter_mut().find(|other| other.codes == factor.codes) {
            Some(other) => {
                other.name = format!("{} + {}", other.name, factor.name);
                other.values =
                    other.values.iter().zip(&factor.values).map(|(a, b)| format!("{a} + {b}")).collect();
            }
            None => kept.push(factor),
        }
    }
    kept
}

/// Values of a design, with 0 for the one that is left out.
pub(crate) fn codes(factors: &[Factor], at: usize, without: Option<usize>) -> Vec<usize> {
    let code = |(place, factor): (usize, &Factor)| if Some(place) == without { 0 } else { factor.codes[at] };
    factors.iter().enumerate().map(code).collect()
}

/// Members of each of `count` cells.
pub(crate) fn cells(of: impl Iterator<Item = usize>, count: usize) -> Vec<Vec<usize>> {
    let mut cells = vec![Vec::new(); count];
    of.enumerate().for_each(|(at, cell)| cells[cell].push(at));
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_short_where_they_are_unique() {
        let paths = ["gpu.a.queue", "gpu.b.queue", "gpu.core_hz"];
        let settings = paths.map(|path| Setting::new(path, "1")).into();
        let points = vec![Point { id: String::new(), settings }];
        let plan = SweepPlan { points, ..SweepPlan::default() };
        let names: Vec<&str> = short_names(&plan).into_values().collect();
        assert_eq!(names, ["gpu.a.queue", "gpu.b.queue", "core_hz"]);
    }

    #[test]
    fn runs_of_one_design_are_averaged() {
        let row = |design: &str, time_s: f64, time_error| Row {
            workload: String::new(),
            design: design.to_owned(),
            settings: Vec::new(),
            conditions: Vec::new(),
            time_s,
            energy_j: [5.0, 4.0, 9.0],
            time_error,
            energy_error: 0.0,
            area_mm2: None,
            warnings: if time_error < 0.2 { "b,c" } else { "a,b" }.to_owned(),
        };
        let rows = [row("a", 1.0, 0.1), row("b", 9.0, 0.4), row("a", 3.0, 0.2)];
        let designs = designs(&rows);
        assert_eq!(designs.len(), 2);
        let a = &designs[0];
        assert_eq!((a.time_s.value, a.time_s.error, a.runs), (2.0, 0.2, 2));
        assert_eq!((a.energy_j.value, a.energy_j.low, a.energy_j.high), (5.0, 4.0, 9.0));
        assert!((a.time_s.deviation - 2_f64.sqrt()).abs() < 1e-12 && designs[1].time_s.deviation == 0.0);
        assert_eq!(designs[1].time_s.error, 0.4);
        assert_eq!((a.warnings.concat(), designs[1].warnings.concat()), ("abc".to_owned(), "ab".to_owned()));
    }
}
