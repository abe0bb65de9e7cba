//! Work that points share: what is drawn does not depend on clocks, rates and energies, and the time of a
//! frame does not depend on energies. So points with the same drawing are a group, which is drawn once; those
//! of them with the same machine are timed once.

use std::collections::HashMap;
use std::iter::Sum;

use cpu_time::ProcessTime;
use output::terminal::Progress;
use rayon::prelude::*;
use run::{Distinct, DrawnFrames, MACHINES_IN_TURN, RunError, TimedFrames};

use crate::SweepError;
use crate::execute::{Measured, Outcome, PointResult, execute, guarded, measured};
use crate::plan::{Point, SweepPlan};
use crate::setting::{self, Setting, Stage};

/// Most bytes of the packets that are kept for a group. Points of a larger one are drawn one by one.
const MAX_BYTES: usize = 1 << 30;

/// Points with the same drawing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Group<'a> {
    /// Points of the group, those with the same times together.
    timings: Vec<Vec<&'a Point>>,
}

/// Groups of `points`, in the order of their first points.
pub(crate) fn groups<'a>(points: &[&'a Point]) -> Vec<Group<'a>> {
    let drawings = by_settings(points, |setting| setting.stage() == Stage::Drawing);
    let timings = |points: Vec<&'a Point>| by_settings(&points, |setting| setting.stage() != Stage::Power);
    drawings.into_iter().map(|points| Group { timings: timings(points) }).collect()
}

/// Points with the same settings of those that `counts` says matter.
fn by_settings<'a>(points: &[&'a Point], counts: fn(&Setting) -> bool) -> Vec<Vec<&'a Point>> {
    let mut places: HashMap<Vec<&Setting>, usize> = HashMap::new();
    let mut parts: Vec<Vec<&'a Point>> = Vec::new();
    for point in points {
        let key = point.settings.iter().filter(|setting| counts(setting)).collect();
        let place = *places.entry(key).or_insert_with(|| {
            parts.push(Vec::new());
            parts.len() - 1
        });
        parts[place].push(point);
    }
    parts
}

impl<'a> Group<'a> {
    /// Points of the group.
    pub fn points(&self) -> impl Iterator<Item = &'a Point> {
        self.timings.iter().flatten().copied()
    }

    /// Runs its points and passes each result on. A failure and a panic are results, too. Nothing is begun
    /// once `stop` holds.
    ///
    /// # Errors
    /// Errors of `done`.
    pub fn run(
        &self,
        plan: &SweepPlan,
        stop: &(dyn Fn() -> bool + Sync),
        done: &(impl Fn(&Point, PointResult) -> Result<(), SweepError> + Sync),
    ) -> Result<(), SweepError> {
        let alone = |point: &Point| match stop() {
            true => Ok(()),
            false => done(point, execute(&point.id, &plan.settings_of(point))),
        };
        if stop() {
            return Ok(());
        }
        let drawing = (self.points().count() > 1).then(|| Drawing::new(plan, self.points())).flatten();
        let Some(drawing) = drawing else { return self.points().try_for_each(alone) };
        let in_turn = self.timings.len().div_ceil(rayon::current_num_threads()).min(MACHINES_IN_TURN);
        self.timings.par_chunks(in_turn).filter(|_| !stop()).try_for_each(|timings| {
            let planned: Vec<Vec<PlannedPoint<'_>>> = timings
                .iter()
                .map(|points| points.iter().map(|point| drawing.planned(plan, point)).collect())
                .collect();
            let results = guarded(|| drawing.results(&planned));
            match results {
                Ok(mut results) => results.drain(..).try_for_each(|(point, result)| done(point, result)),
                // One of the machines is to blame; alone each point gets its own reason.
                Err(_) => timings.iter().flatten().try_for_each(|point| alone(point)),
            }
        })
    }
}

/// A point with its run, or why it cannot run.
struct PlannedPoint<'a> {
    point: &'a Point,
    run: Result<run::Plan, String>,
}

/// The run whose times are those of all `points`.
fn machine<'p>(points: &'p [PlannedPoint<'_>]) -> Option<&'p run::Plan> {
    points.iter().find_map(|point| point.run.as_ref().ok())
}

fn run_of(plan: &SweepPlan, point: &Point) -> Result<run::Plan, RunError> {
    setting::planned(&plan.settings_of(point))
}

/// The frames of a group, drawn once.
struct Drawing {
    /// A run that draws them.
    run: run::Plan,
    distinct: Distinct,
    recording: DrawnFrames,
}

impl Drawing {
    /// The frames of the first point that can run; `None` if there is none, or the frames are too large to be kept.
    fn new<'a>(plan: &SweepPlan, mut points: impl Iterator<Item = &'a Point>) -> Option<Self> {
        let run = points.find_map(|point| run_of(plan, point).ok())?;
        let draw = || {
            let distinct = Distinct::new(&*run.job)?;
            let recording = DrawnFrames::draw(&run, distinct.numbers(), MAX_BYTES, &Progress::new(true))?;
            Ok(recording.map(|recording| Self { run, distinct, recording }))
        };
        // What fails here fails again with the reason of each point.
        guarded(draw).ok().flatten()
    }

    /// The run of a point; what it draws is not loaded again.
    fn planned<'a>(&self, plan: &SweepPlan, point: &'a Point) -> PlannedPoint<'a> {
        PlannedPoint { point, run: guarded(|| setting::planned_beside(&self.run, &plan.settings_of(point))) }
    }

    /// Results of points, those with the same times together: their frames are timed once.
    fn results<'a>(
        &self,
        timings: &[Vec<PlannedPoint<'a>>],
    ) -> Result<Vec<(&'a Point, PointResult)>, RunError> {
        let machines: Vec<&run::Plan> = timings.iter().filter_map(|points| machine(points)).collect();
        let mut timed = self.recording.timed(&machines)?.into_iter();
        let mut results = Vec::new();
        for points in timings {
            let timed = machine(points).and_then(|_| timed.next());
            for PlannedPoint { point, run } in points {
                let outcome = match (run, &timed) {
                    (Ok(run), Some(timed)) => guarded(|| self.measured(run, timed)),
                    (Ok(_), None) => continue,
                    (Err(reason), _) => Err(reason.clone()),
                };
                results.push((*point, PointResult { id: point.id.clone(), outcome: Outcome::from(outcome) }));
            }
        }
        Ok(results)
    }

    fn measured(&self, run: &run::Plan, timed: &TimedFrames<'_>) -> Result<Measured, RunError> {
        measured(run, timed.powered(run.model())?, self.distinct.groups())
    }
}

/// Processor time of the stages of some points, in seconds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Costs {
    points: usize,
    drawing_s: f64,
    timing_s: f64,
    power_s: f64,
}

impl Costs {
    /// Costs of a point; none if it cannot run.
    pub fn of(plan: &SweepPlan, point: &Point) -> Self {
        let mut started = ProcessTime::now();
        let mut lap_s = || std::mem::replace(&mut started, ProcessTime::now()).elapsed().as_secs_f64();
        let stages = guarded(|| {
            let run = run_of(plan, point)?;
            let resolved_s = lap_s();
            let distinct = Distinct::new(&*run.job)?;
            // Nothing is drawn twice for the probe, so all of it may be kept.
            let recording = DrawnFrames::draw(&run, distinct.numbers(), usize::MAX, &Progress::new(true))?;
            let drawing_s = lap_s();
            let timed = recording.as_ref().map(|recording| recording.timed(&[&run])).transpose()?;
            let timing_s = lap_s();
            timed.into_iter().flatten().try_for_each(|timed| timed.powered(run.model()).map(drop))?;
            Ok(Self { points: 1, drawing_s, timing_s, power_s: resolved_s + lap_s() })
        });
        stages.unwrap_or_default()
    }

    /// Whether any point could run.
    pub fn is_known(&self) -> bool {
        self.points > 0
    }

    /// Expected processor time of `points` in seconds.
    pub fn expected_s(&self, points: &[&Point]) -> f64 {
        let groups = groups(points);
        let timings: usize = groups.iter().map(|group| group.timings.len()).sum();
        let all_s = self.drawing_s * groups.len() as f64
            + self.timing_s * timings as f64
            + self.power_s * points.len() as f64;
        all_s / self.points.max(1) as f64
    }
}

impl Sum for Costs {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |sum, one| Self {
            points: sum.points + one.points,
            drawing_s: sum.drawing_s + one.drawing_s,
            timing_s: sum.timing_s + one.timing_s,
            power_s: sum.power_s + one.power_s,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    const SETTINGS: [[(&str, &str); 2]; 8] = [
        [("samples", "2"), ("gpu.core_hz", "400e6")],
        [("samples", "2"), ("table.rows.draws.nominal_pj", "700")],
        [("samples", "1"), ("gpu.units.setup.rates.triangles_in", "0.5")],
        [("samples", "2"), ("bound", "high")],
        [("samples", "2"), ("gpu.pipeline.tile_px", "4")],
        [("samples", "2"), ("timing", "bound")],
        [("samples", "2"), ("gpu.core_hz", "-1")],
        [("samples", "2"), ("pacing", "free")],
    ];

    fn plan() -> SweepPlan {
        let settings = |pairs: &[(&str, &str)]| -> Vec<Setting> {
            pairs.iter().map(|(path, value)| Setting::new(*path, *value)).collect()
        };
        let point = |(number, pairs): (usize, &[(&str, &str); 2])| Point {
            id: number.to_string(),
            settings: settings(pairs),
        };
        let points = SETTINGS.iter().enumerate().map(point).collect();
        SweepPlan {
            name: "a".to_owned(),
            settings: settings(&[("scene", "tiny"), ("frames", "0..2")]),
            points,
            ..SweepPlan::default()
        }
    }

    #[test]
    fn points_are_grouped_by_drawing_and_by_machine() {
        let plan = plan();
        let points: Vec<&Point> = plan.points.iter().collect();
        let ids = |group: &Group<'_>| -> Vec<String> {
            let of = |points: &Vec<&Point>| points.iter().map(|point| point.id.as_str()).collect();
            group.timings.iter().map(of).collect()
        };
        let found: Vec<Vec<String>> = groups(&points).iter().map(ids).collect();
        assert_eq!(found, [vec!["0", "137", "5", "6"], vec!["2"], vec!["4"]]);
    }

    #[test]
    fn shared_work_gives_the_results_of_single_runs() {
        let plan = plan();
        let points: Vec<&Point> = plan.points.iter().collect();
        let results = Mutex::new(Vec::new());
        let keep = |_: &Point, result: PointResult| {
            results.lock().unwrap().push(result);
            Ok(())
        };
        groups(&points).iter().try_for_each(|group| group.run(&plan, &|| false, &keep)).unwrap();
        let mut results = results.into_inner().unwrap();
        results.sort_by(|a, b| a.id.cmp(&b.id));
        let alone = plan.points.iter().map(|point| execute(&point.id, &plan.settings_of(point)));
        assert_eq!(results, alone.collect::<Vec<_>>());
        let failed = results.iter().filter(|result| matches!(result.outcome, Outcome::Error(_)));
        assert_eq!(failed.map(|result| result.id.as_str()).collect::<Vec<_>>(), ["6"]);
    }
}
