//! Trials: points are planned as runs, to refuse settings with which no point can run, and to find their input files.

use std::collections::HashMap;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use output::progress::Progress;
use run::Input;

use crate::SweepError;
use crate::axis::Axis;
use crate::points::Points;
use crate::setting::{self, Setting};

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

    /// Tries each setting in points that have it, spread over the sweep, until one of them can run. In a `grid` each value is
    /// tried for itself; otherwise a value may be in one point alone, where others may be to blame.
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

    /// Names and hashes of the input files of a point. There are none if no point with the same settings for files can run.
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

/// Rounds ranges of any numbers where a setting takes whole numbers only: there a number that runs, or is refused for another reason,
/// is refused when it is written with a decimal point. `common` are the settings of all points.
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

/// All points, and those of each setting that varies, in order of first use: of each of its values if `by_value`, of the first [`MAX_VALUES`] of them. With the path of
/// that setting.
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
