//! Points of a sweep: the values of its axes, combined. In trials, points are planned as runs, to refuse
//! settings with which no point can run, and to find their input files.

use std::collections::HashMap;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use output::terminal::Progress;
use pipeline::random::{mix, unit};
use run::Input;
use timing::Level;

use crate::SweepError;
use crate::axis::Axis;
use crate::setting::{self, Setting, Text};
use crate::spec::{Combination, SweepSpec};

/// Points of a sweep.
pub(crate) struct Points {
    /// Settings of all points.
    pub common: Vec<Setting>,
    /// Further settings of each point, in order: with repetitions and without forbidden combinations.
    pub varied: Vec<Vec<Setting>>,
    /// Places in the file of constraints that leave out no point.
    pub idle: Vec<String>,
}

impl Points {
    /// Points of `spec`, with the settings of `--quick` if it is given.
    ///
    /// # Errors
    /// Place in the file and message: a constraint compares values that do not fit, or no point is left.
    pub fn new(spec: &SweepSpec, quick: bool) -> Result<Self, (String, String)> {
        let once = kept(spec, spec.base(quick))?;
        Ok(once.repeated(spec.repetitions).at_levels(&spec.screen))
    }

    /// Each point with one seed after another.
    fn repeated(self, repetitions: u32) -> Self {
        if repetitions == 1 {
            return self;
        }
        let Self { mut common, varied, idle } = self;
        let seed = common.iter().find(|setting| &*setting.path == "seed");
        let first: u64 = seed.and_then(|seed| seed.value.parse().ok()).unwrap_or(1);
        common.retain(|setting| &*setting.path != "seed");
        let seeds = (0..u64::from(repetitions)).map(|repetition| first.wrapping_add(repetition));
        let seeds: Vec<Setting> = seeds.map(|seed| Setting::new("seed", seed.to_string())).collect();
        let repeated = |point: &Vec<Setting>| {
            let with = |seed| [point.as_slice(), std::slice::from_ref(seed)].concat();
            seeds.iter().map(with).collect::<Vec<_>>()
        };
        Self { varied: varied.iter().flat_map(repeated).collect(), common, idle }
    }

    /// All points at the first level, then all of them at the next.
    fn at_levels(self, levels: &[Level]) -> Self {
        if levels.is_empty() {
            return self;
        }
        let at = |level: &Level| {
            let timing = Setting::new("timing", level.name());
            self.varied.iter().map(move |point| [point.as_slice(), std::slice::from_ref(&timing)].concat())
        };
        Self { varied: levels.iter().flat_map(at).collect(), ..self }
    }

    /// All settings of point `at`.
    pub fn settings(&self, at: usize) -> Vec<Setting> {
        self.common.iter().chain(&self.varied[at]).cloned().collect()
    }
}

/// Points that no constraint leaves out, without repetitions.
fn kept(spec: &SweepSpec, common: Vec<Setting>) -> Result<Points, (String, String)> {
    let constraints = spec.parsed_constraints()?;
    let mut forbids = vec![false; spec.forbidden.len()];
    let mut excludes = vec![false; constraints.len()];
    let mut points = Vec::new();
    for point in varied(spec) {
        let mut is_kept = true;
        for index in spec.forbids(&point) {
            (forbids[index], is_kept) = (true, false);
        }
        for (index, constraint) in constraints.iter().enumerate() {
            let holds = constraint.holds(&[&point, &common]).map_err(|message| {
                (format!("constraints[{index}]"), format!("`{}`: {message}", spec.constraints[index]))
            })?;
            excludes[index] |= !holds;
            is_kept &= holds;
        }
        if is_kept {
            points.push(point);
        }
    }
    if points.is_empty() {
        let place = if spec.constraints.is_empty() { "forbidden" } else { "constraints" };
        return Err((place.to_owned(), "all combinations are left out: leave out fewer".to_owned()));
    }
    let idle = |place: &'static str, matched: Vec<bool>| {
        let idle = matched.into_iter().enumerate().filter(|(_, matched)| !matched);
        idle.map(move |(index, _)| format!("{place}[{index}]"))
    };
    let idle = idle("forbidden", forbids).chain(idle("constraints", excludes)).collect();
    Ok(Points { common, varied: points, idle })
}

/// Settings of the axes, point by point.
fn varied(spec: &SweepSpec) -> Box<dyn Iterator<Item = Vec<Setting>> + '_> {
    let count = spec.points.count().unwrap_or(0);
    let at = |shares: &dyn Fn(u32) -> f64| -> Vec<Setting> {
        (0..).zip(&spec.axes).flat_map(|(dimension, axis)| axis.at(shares(dimension))).collect()
    };
    match spec.points {
        Combination::Grid => Box::new(grid(&spec.axes)),
        Combination::LatinHypercube { seed, .. } => {
            let parts: Vec<Vec<f64>> =
                (0..spec.axes.len()).map(|axis| latin(count, seed, axis as u64)).collect();
            Box::new((0..count as usize).map(move |point| at(&|axis| parts[axis as usize][point])))
        }
        Combination::Sobol { seed, .. } => Box::new(
            (0..count).map(move |point| at(&|axis| f64::from(sobol_burley::sample(point, axis, seed)))),
        ),
    }
}

/// Each value of each axis with all others; the last axis varies fastest. Points share the text of a value.
fn grid(axes: &[Axis]) -> impl Iterator<Item = Vec<Setting>> {
    let values = |axis: &Axis| (0..axis.len()).map(|index| axis.value(index)).collect();
    let axes: Vec<Vec<Vec<Setting>>> = axes.iter().map(values).collect();
    (0..axes.iter().map(Vec::len).product()).map(move |point: usize| {
        let mut rest = point;
        let mut settings: Vec<&[Setting]> = Vec::with_capacity(axes.len());
        for values in axes.iter().rev() {
            settings.push(&values[rest % values.len()]);
            rest /= values.len();
        }
        settings.reverse();
        settings.concat()
    })
}

/// Settings for each combination of listed values; the last list varies fastest.
///
/// # Errors
/// In words, if a path is unknown or a value is listed twice.
pub fn combinations(lists: Vec<(String, Vec<String>)>) -> Result<Vec<Vec<Setting>>, String> {
    let axis = |(path, values): (String, Vec<String>)| Axis::Values {
        path: path.into(),
        values: values.into_iter().map(|value| Text(value.into())).collect(),
    };
    let axes: Vec<Axis> = lists.into_iter().map(axis).collect();
    axes.iter().try_for_each(|axis| axis.check(true))?;
    Ok(grid(&axes).collect())
}

/// A number in each of `count` equal parts of 0 to 1, in random order.
fn latin(count: u32, seed: u32, axis: u64) -> Vec<f64> {
    let mut state = mix(mix(u64::from(seed)) ^ axis);
    let mut next = move || {
        state = state.wrapping_add(1);
        unit(mix(state))
    };
    let mut parts: Vec<u32> = (0..count).collect();
    // Fisher and Yates.
    for last in (1..parts.len()).rev() {
        parts.swap(last, ((next() * (last + 1) as f64) as usize).min(last));
    }
    parts.into_iter().map(|part| (f64::from(part) + next()) / f64::from(count)).collect()
}

/// Most values of a setting that are tried.
const MAX_VALUES: usize = 100;

/// Most points in which a value is tried.
const MAX_TRIALS: usize = 16;

/// Time between two notes.
const TICK: Duration = Duration::from_secs(5);

/// Why a point cannot run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Refusal {
    /// What is wrong, and what to do.
    pub message: String,
    /// Number of the point.
    pub at: usize,
    /// Setting whose points were refused.
    pub path: Option<String>,
}

/// Notes about work that takes long, one in some seconds.
pub(crate) struct Ticker<'a> {
    progress: &'a Progress,
    last: Instant,
}

impl<'a> Ticker<'a> {
    /// Notes to `progress`.
    pub fn new(progress: &'a Progress) -> Self {
        Self { progress, last: Instant::now() }
    }

    /// A step is done; `text` says how many are.
    pub fn tick(&mut self, text: impl FnOnce() -> String) {
        if self.last.elapsed() >= TICK {
            self.last = Instant::now();
            self.progress.note(&text());
        }
    }
}

/// Points of a sweep, and what trials found about them.
pub(crate) struct Trials<'a> {
    points: &'a Points,
    /// Points that were tried.
    tried: HashMap<usize, Result<(), Refusal>>,
    /// Input files by the settings that name them.
    inputs: HashMap<Vec<&'a Setting>, Inputs>,
    /// Hashes of files.
    hashes: HashMap<PathBuf, String>,
}

/// Input files of the points with equal settings that name files.
#[derive(Default)]
struct Inputs {
    /// The files, once a point was planned.
    files: Option<Vec<PathBuf>>,
    /// Points that could not be planned.
    failures: usize,
}

impl<'a> Trials<'a> {
    /// Trials of `points`.
    pub fn new(points: &'a Points) -> Self {
        Self { points, tried: HashMap::new(), inputs: HashMap::new(), hashes: HashMap::new() }
    }

    /// Tries each setting in points that have it, spread over the sweep, until one of them can run. In a
    /// `grid` each value is tried for itself; otherwise a value may be in one point alone, where others may
    /// be to blame.
    ///
    /// # Errors
    /// The first refusal of a setting that was refused in all of them.
    pub fn try_settings(&mut self, grid: bool, ticker: &mut Ticker<'_>) -> Result<(), Refusal> {
        let all = owners(&self.points.varied, grid);
        let count = all.len();
        for (number, (path, owners)) in all.into_iter().enumerate() {
            let step = owners.len().div_ceil(MAX_TRIALS);
            let mut first = Ok(());
            for &at in owners.iter().step_by(step) {
                let tried = self.plan(at);
                ticker.tick(|| format!("{number} of {count} values tried"));
                if tried.is_ok() {
                    first = Ok(());
                    break;
                }
                first = first.and(tried);
            }
            first.map_err(|refusal| Refusal { path: path.map(str::to_owned), ..refusal })?;
        }
        Ok(())
    }

    /// Plans a point as a run, once.
    fn plan(&mut self, at: usize) -> Result<(), Refusal> {
        if let Some(tried) = self.tried.get(&at) {
            return tried.clone();
        }
        let planned = setting::planned(&self.points.settings(at));
        let inputs = self.inputs.entry(key(&self.points.varied[at])).or_default();
        let tried = match planned {
            Ok(plan) => {
                inputs.files = Some(plan.files);
                Ok(())
            }
            Err(error) => {
                inputs.failures += 1;
                Err(Refusal { message: error.to_string(), at, path: None })
            }
        };
        self.tried.insert(at, tried.clone());
        tried
    }

    /// Names and hashes of the input files of a point. There are none if no point with the same settings for
    /// files can run.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn inputs_of(&mut self, at: usize) -> Result<String, SweepError> {
        let key = key(&self.points.varied[at]);
        let is_open = |inputs: &Inputs| inputs.files.is_none() && inputs.failures < MAX_TRIALS;
        if self.inputs.get(&key).is_none_or(is_open) {
            // A refused point is a row with a reason.
            let _ = self.plan(at);
        }
        let files = self.inputs.get(&key).and_then(|inputs| inputs.files.as_deref()).unwrap_or_default();
        let mut text = String::new();
        for file in files {
            if !self.hashes.contains_key(file) {
                let hash = Input::now(file).map_err(SweepError::Input)?.sha256.unwrap_or_default();
                self.hashes.insert(file.clone(), hash);
            }
            text += &format!("{:?} {}\n", file.display().to_string(), self.hashes[file]);
        }
        Ok(text)
    }
}

/// Rounds ranges of any numbers where a setting takes whole numbers only: there a number that runs, or is
/// refused for another reason, is refused when it is written with a decimal point. `common` are the settings
/// of all points.
pub(crate) fn round_whole(axes: &mut [Axis], common: &[Setting]) {
    let start = |axis: &Axis| match axis.whole_number_between() {
        Some((path, number)) => vec![Setting::new(path, number.to_string())],
        None => axis.at(0.0),
    };
    let starts: Vec<Vec<Setting>> = axes.iter().map(start).collect();
    let is_whole = |(at, axis): (usize, &Axis)| {
        let Some((path, number)) = axis.whole_number_between() else { return false };
        let others = starts.iter().enumerate().filter(|(other, _)| *other != at).flat_map(|(_, sets)| sets);
        let refused = |value: &str| {
            let mut settings: Vec<Setting> = common.iter().chain(others.clone()).cloned().collect();
            settings.push(Setting::new(path, value));
            setting::planned(&settings).err().map(|error| error.to_string())
        };
        let (whole, point) = (number.to_string(), format!("{number}.0"));
        refused(&point).map(|message| message.replace(&point, &whole)) != refused(&whole)
    };
    let whole: Vec<bool> = axes.iter().enumerate().map(is_whole).collect();
    axes.iter_mut().zip(whole).filter(|(_, whole)| *whole).for_each(|(axis, _)| axis.round());
}

/// The settings of a point on which its input files may depend.
fn key(settings: &[Setting]) -> Vec<&Setting> {
    settings.iter().filter(|setting| setting.names_files()).collect()
}

/// All points, and those of each setting that varies, in order of first use: of each of its values if
/// `by_value`, of the first [`MAX_VALUES`] of them. With the path of that setting.
fn owners(points: &[Vec<Setting>], by_value: bool) -> Vec<(Option<&str>, Vec<usize>)> {
    let mut groups: HashMap<(&str, &str), usize> = HashMap::new();
    let mut values: HashMap<&str, usize> = HashMap::new();
    let mut owners: Vec<(Option<&str>, Vec<usize>)> = vec![(None, (0..points.len()).collect())];
    for (at, setting) in
        points.iter().enumerate().flat_map(|(at, point)| point.iter().map(move |set| (at, set)))
    {
        let key = (&*setting.path, if by_value { &*setting.value } else { "" });
        let group = groups.get(&key).copied().or_else(|| {
            let count = values.entry(key.0).or_default();
            *count += 1;
            (*count <= MAX_VALUES).then(|| {
                owners.push((Some(key.0), Vec::new()));
                groups.insert(key, owners.len() - 1);
                owners.len() - 1
            })
        });
        if let Some(group) = group {
            owners[group].1.push(at);
        }
    }
    owners
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made(text: &str) -> Vec<Vec<String>> {
        let spec = SweepSpec::parse(&format!("(name: \"a\", {text})"), "a.ron").unwrap();
        let values =
            |settings: Vec<Setting>| settings.into_iter().map(|setting| setting.value.to_string()).collect();
        let points = Points::new(&spec, false).unwrap();
        (0..points.varied.len()).map(|at| values(points.settings(at))).collect()
    }

    const AXES: &str = r#"axes: [Values(path: "samples", values: [1, 2]),
        Linked(settings: {"lens_radius": [0, 1], "shutter": [0.5, 1]})]"#;

    #[test]
    fn a_grid_combines_all_values_and_links_some() {
        assert_eq!(made(AXES), [["1", "0", "0.5"], ["1", "1", "1"], ["2", "0", "0.5"], ["2", "1", "1"]]);
        let fewer = made(&format!("{AXES}, forbidden: [{{\"samples\": 2, \"shutter\": 1.0}}]"));
        assert_eq!(fewer, [["1", "0", "0.5"], ["1", "1", "1"], ["2", "0", "0.5"]]);
    }

    #[test]
    fn constraints_leave_out_points_and_are_reported_if_they_leave_out_none() {
        let text = format!(
            "(name: \"a\", settings: {{\"gpu.core_hz\": 2}}, {AXES}, forbidden: [{{\"samples\": 3}}], constraints: \
             [\"samples * shutter < gpu.core_hz\", \"samples > 0\"])"
        );
        let of = |text: &str| Points::new(&SweepSpec::parse(text, "a.ron").unwrap(), false);
        let points = of(&text).unwrap();
        assert_eq!(
            (points.varied.len(), points.idle),
            (3, ["forbidden[0]", "constraints[1]"].map(str::to_owned).into())
        );
        let error = of(&text.replace("> 0", "> 9")).err().unwrap();
        assert!(error.0 == "constraints" && error.1.contains("all combinations are left out"), "{error:?}");
        let error = of(&text.replace("samples > 0", "samples > 'x'")).err().unwrap();
        assert_eq!(error.0, "constraints[1]");
    }

    #[test]
    fn repetitions_have_one_seed_after_another() {
        let text =
            r#"settings: {"seed": 7}, axes: [Values(path: "samples", values: [1, 2])], repetitions: 2"#;
        assert_eq!(made(text), [["1", "7"], ["1", "8"], ["2", "7"], ["2", "8"]]);
    }

    /// Two axes, each with eight equal parts.
    const PARTS: &str = r#"axes: [Range(path: "gpu.core_hz", from: 0, to: 8),
        Range(path: "gpu.memory_hz", from: 0, to: 8)]"#;

    #[test]
    fn sampled_points_fill_each_part_of_each_axis_once() {
        for points in ["LatinHypercube(count: 8, seed: 3)", "Sobol(count: 8, seed: 3)"] {
            let text = format!("{PARTS}, points: {points}");
            let made = made(&text);
            for axis in 0..2 {
                let mut parts: Vec<usize> =
                    made.iter().map(|point| point[axis].parse::<f64>().unwrap() as usize).collect();
                parts.sort_unstable();
                assert_eq!(parts, [0, 1, 2, 3, 4, 5, 6, 7], "{points}: {made:?}");
            }
            assert_ne!(made, self::made(&text.replace("seed: 3", "seed: 4")));
        }
    }

    fn points(values: &[[&str; 2]]) -> Points {
        let point = |[tile, coarse]: &[&str; 2]| {
            vec![
                Setting::new("gpu.pipeline.tile_px", *tile),
                Setting::new("gpu.pipeline.coarse_tile_px", *coarse),
            ]
        };
        Points {
            common: vec![Setting::new("scene", "tiny")],
            varied: values.iter().map(point).collect(),
            idle: Vec::new(),
        }
    }

    #[test]
    fn owners_are_grouped_by_value_or_by_path() {
        let points = points(&[["4", "4"], ["8", "4"]]).varied;
        let of = |by_value| owners(&points, by_value).into_iter().map(|(_, at)| at).collect::<Vec<_>>();
        assert_eq!(of(true), [vec![0, 1], vec![0], vec![0, 1], vec![1]]);
        assert_eq!(of(false), [vec![0, 1], vec![0, 1], vec![0, 1]]);
        let paths: Vec<_> = owners(&points, false).into_iter().map(|(path, _)| path).collect();
        assert_eq!(paths, [None, Some("gpu.pipeline.tile_px"), Some("gpu.pipeline.coarse_tile_px")]);
    }

    #[test]
    fn a_value_is_refused_if_no_point_can_run_with_it() {
        let refused = |values: &[[&str; 2]], grid| {
            let progress = Progress::new(true);
            Trials::new(&points(values)).try_settings(grid, &mut Ticker::new(&progress)).err()
        };
        assert_eq!(refused(&[["8", "4"], ["8", "32"], ["2", "4"], ["2", "32"]], true), None);
        let never = refused(&[["7", "4"], ["7", "32"], ["2", "4"], ["2", "32"]], true).unwrap();
        assert!(never.at == 0 && never.message.contains("tile_px=7"), "{never:?}");
        // Sampled points: one that fails may be a matter of both values.
        assert_eq!(refused(&[["8", "4"], ["4", "32"]], false), None);
        assert!(refused(&[["7", "4"], ["x", "32"]], false).is_some());
    }
}
