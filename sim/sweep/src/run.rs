//! Running the points of a shard, where each of `n` tasks runs every n-th point, and the state of a sweep.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use ::run::duration;
use output::table::{counted, si};
use output::terminal::Progress;
use rayon::prelude::*;
use serde::Serialize;

use crate::execute::{Outcome, PointResult};
use crate::folder::Stored;
use crate::plan::{Point, SweepPlan};
use crate::report::label;
use crate::screen::{note, screened};
use crate::shared::{Costs, Group, groups};
use crate::{Folder, SweepError};

/// Number of points that a probe runs.
const PROBE_POINTS: usize = 2;
/// Number of groups that run before the expected time is printed.
const PROBE_GROUPS: usize = 2;

/// Number of runs to come, and their expected time on the threads of the current pool.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ExpectedRuns {
    /// Runs of the shard.
    pub runs: usize,
    /// Runs that are not finished.
    pub pending: usize,
    /// Expected wall-clock time of the pending runs in seconds; `None` if there are none.
    pub host_s: Option<f64>,
}

impl ExpectedRuns {
    /// Line for the terminal.
    pub fn line(&self) -> String {
        let time = self
            .host_s
            .map_or(String::new(), |host_s| format!(", expected to take about {}", duration(host_s)));
        format!("{} of {} runs to do{time}", self.pending, self.runs)
    }
}

/// State of a sweep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Status {
    /// Planned points.
    pub points: usize,
    /// Points with a result, failed ones included.
    pub finished: usize,
    /// Points that failed.
    pub failed: usize,
    /// Points that a coarser timing level left out, undecided ones included.
    pub screened_out: usize,
}

impl Status {
    /// State of the sweep in `folder`, from its files alone; and what is wrong with files that do not count.
    ///
    /// # Errors
    /// If there is no plan, or a file cannot be read.
    pub fn of(folder: &Folder) -> Result<(Self, Vec<String>), SweepError> {
        let plan = folder.plan()?;
        let mut status = Self { points: plan.points.len(), ..Self::default() };
        let (mut damaged, mut others) = (Vec::new(), 0);
        for point in &plan.points {
            match folder.stored(point)? {
                Stored::Whole(result) => {
                    status.finished += 1;
                    status.failed += usize::from(matches!(result.outcome, Outcome::Error(_)));
                    status.screened_out += usize::from(!result.outcome.ran());
                }
                Stored::Damaged(message) => damaged.push(message),
                Stored::OtherBuild => others += 1,
                Stored::Missing => {}
            }
        }
        damaged.extend(of_other_build(others));
        Ok((status, damaged))
    }
}

/// That results of another build do not count.
fn of_other_build(count: usize) -> Option<String> {
    let message = "written by another build of quintile, which keeps other numbers: read them with that build, or `quintile sweep run` \
                   runs the points again";
    (count > 0).then(|| format!("{} {message}", counted(count, "result")))
}

/// The points of a shard that are not finished.
pub struct ShardWork<'a> {
    plan: &'a SweepPlan,
    folder: &'a Folder,
    runs: usize,
    pending: Vec<&'a Point>,
    /// Points that failed before and do not run again.
    failed: usize,
    /// What is wrong with damaged files of these points.
    damaged: Vec<String>,
    /// Whether to begin no further points.
    stop: &'a (dyn Fn() -> bool + Sync),
}

impl<'a> ShardWork<'a> {
    /// Points of `plan` in `shard` without a whole result in `folder`; with `retry` also those that failed.
    ///
    /// # Errors
    /// If a result cannot be read.
    pub fn new(
        plan: &'a SweepPlan,
        folder: &'a Folder,
        shard: Shard,
        retry: bool,
    ) -> Result<Self, SweepError> {
        if !plan.screen.is_empty() && !shard.is_whole() {
            let message = "a sweep that screens runs as one task, as a level needs all results of the one before: leave --shard out";
            return Err(SweepError::Shard(message.to_owned()));
        }
        // Finer levels begin when it is known which designs are left.
        let points = plan.of_level(0).iter().enumerate();
        let points: Vec<&Point> = points.filter(|(at, _)| shard.has(*at)).map(|(_, point)| point).collect();
        let (mut damaged, mut others, mut failed) = (Vec::new(), 0, 0);
        let mut is_pending = |point: &Point| match folder.stored(point)? {
            Stored::Whole(result) => {
                let has_failed = matches!(result.outcome, Outcome::Error(_));
                failed += usize::from(has_failed && !retry);
                Ok(has_failed && retry)
            }
            Stored::Missing => Ok(true),
            Stored::OtherBuild => {
                others += 1;
                Ok(true)
            }
            Stored::Damaged(message) => {
                damaged.push(message);
                Ok(true)
            }
        };
        let keep = |point: &&'a Point| is_pending(point).map(|keep| keep.then_some(*point)).transpose();
        let pending = points.iter().filter_map(keep).collect::<Result<Vec<_>, SweepError>>()?;
        damaged.extend(of_other_build(others));
        let runs = if plan.screen.is_empty() { points.len() } else { plan.points.len() };
        Ok(Self { plan, folder, runs, pending, failed, damaged, stop: &|| false })
    }

    /// The same work; [`Self::run`] begins no further point once `stop` holds.
    #[must_use]
    pub fn until(self, stop: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Self { stop, ..self }
    }

    /// Expected time, from runs of the first and the middle pending point whose results are not kept.
    pub fn probe(&self) -> ExpectedRuns {
        let middle = self.pending.len() / 2;
        let probed = self.pending.iter().step_by(middle.max(1)).take(PROBE_POINTS);
        let costs: Costs = probed.map(|point| Costs::of(self.plan, point)).sum();
        let host_s = costs.expected_s(&self.pending) / rayon::current_num_threads() as f64;
        ExpectedRuns {
            runs: self.runs,
            pending: self.pending.len(),
            host_s: costs.is_known().then_some(host_s),
        }
    }

    /// Runs all pending points on the current pool, those with equal drawings together. Each result is on
    /// disk, whole, before it counts; a point that fails is a result with a reason. The first groups are the
    /// probe for the expected time. In a sweep that screens, one level after the other runs, each on the
    /// designs that the one before has left. The state is that of the shard; points are left over if the work
    /// was to stop.
    ///
    /// # Errors
    /// If a result cannot be written. Those that were written stay.
    pub fn run(&self, progress: &Progress) -> Result<Status, SweepError> {
        self.damaged.iter().for_each(|message| progress.note(message));
        let status = if self.plan.screen.is_empty() {
            let (done, failed) = self.run_points(&self.pending, progress)?;
            Status {
                points: self.runs,
                finished: self.runs - self.pending.len() + done,
                failed: self.failed + failed,
                screened_out: 0,
            }
        } else {
            self.run_levels(progress)?;
            Status::of(self.folder)?.0
        };
        if self.runs == self.plan.points.len() {
            self.folder.clean()?;
        }
        Ok(status)
    }

    /// Runs level after level.
    fn run_levels(&self, progress: &Progress) -> Result<(), SweepError> {
        self.run_points(&self.pending, progress)?;
        for fine in 1..self.plan.screen.len() {
            let screened = loop {
                let screened = screened(self.plan, self.folder, fine)?;
                if screened.pending.is_empty() || (self.stop)() {
                    break screened;
                }
                self.run_points(&screened.pending, progress)?;
            };
            if (self.stop)() {
                return Ok(());
            }
            progress.note(&note(self.plan.screen[fine - 1], self.plan.screen[fine], &screened));
            for (point, outcome) in screened.dropped {
                self.folder.write_result(point, &PointResult { id: point.id.clone(), outcome })?;
            }
        }
        Ok(())
    }

    /// Runs points; returns how many are done, and how many of them failed.
    fn run_points(&self, points: &[&Point], progress: &Progress) -> Result<(usize, usize), SweepError> {
        let count = points.len();
        progress.note(&format!("{count} of {} runs to do", self.runs));
        let started = Instant::now();
        let (done, failed) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let left_s =
            |done: usize| started.elapsed().as_secs_f64() / done.max(1) as f64 * (count - done) as f64;
        let record = |point: &Point, result: PointResult| {
            self.folder.write_result(point, &result)?;
            let is_failed = matches!(result.outcome, Outcome::Error(_));
            failed.fetch_add(usize::from(is_failed), Ordering::Relaxed);
            let done = 1 + done.fetch_add(1, Ordering::Relaxed);
            progress.note(&line(point, &result, (done, count), left_s(done)));
            Ok::<(), SweepError>(())
        };
        let groups = groups(points);
        let (first, others) = groups.split_at(groups.len().min(PROBE_GROUPS));
        let run = |group: &Group<'_>| group.run(self.plan, self.stop, &record);
        first.iter().try_for_each(run)?;
        let finished = done.load(Ordering::Relaxed);
        if !others.is_empty() && !(self.stop)() {
            // The first groups use one core where their points do not share.
            let cores = if finished == PROBE_GROUPS { rayon::current_num_threads() } else { 1 };
            let host_s = Some(left_s(finished) / cores as f64);
            progress.note(&ExpectedRuns { runs: self.runs, pending: count - finished, host_s }.line());
        }
        others.par_iter().try_for_each(run)?;
        Ok((done.into_inner(), failed.into_inner()))
    }
}

/// Line about a finished run.
fn line(point: &Point, result: &PointResult, (done, count): (usize, usize), left_s: f64) -> String {
    let outcome = match &result.outcome {
        Outcome::Measured(measured) => {
            format!("{} cycles, {}", measured.cycles, si(measured.frame_mj * 1e-3, "J"))
        }
        Outcome::Error(reason) => format!("failed: {reason}"),
        Outcome::ScreenedOut(reason) => format!("screened out: {reason}"),
        Outcome::Undecided(reason) => format!("undecided: {reason}"),
    };
    let left = if done < count { format!(" ({} left)", duration(left_s)) } else { String::new() };
    format!("{done}/{count} {}: {outcome}{left}", label(&point.settings, &BTreeMap::new()))
}

/// Part `index` of `count` parts of the points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(into = "String")]
pub struct Shard {
    /// Number of the part, from 0.
    index: usize,
    /// Number of parts, at least 1.
    count: usize,
}

impl Default for Shard {
    /// All points.
    fn default() -> Self {
        Self { index: 0, count: 1 }
    }
}

impl fmt::Display for Shard {
    /// As [`Shard::parse`] reads it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index + 1, self.count)
    }
}

impl From<Shard> for String {
    fn from(shard: Shard) -> Self {
        shard.to_string()
    }
}

/// Variables with the number of a task, and with the number of tasks where the scheduler gives it.
const VARIABLES: [(&str, Option<&str>); 3] = [
    ("SLURM_ARRAY_TASK_ID", Some("SLURM_ARRAY_TASK_COUNT")),
    ("PBS_ARRAY_INDEX", None),
    ("HQ_TASK_ID", None),
];

impl Shard {
    /// The shard `text`, such as `2/8`: the second of eight.
    ///
    /// # Errors
    /// In words, if it is no such pair.
    pub fn parse(text: &str) -> Result<Self, String> {
        let numbers =
            text.split_once('/').and_then(|(i, n)| Some((i.trim().parse().ok()?, n.trim().parse().ok()?)));
        match numbers {
            Some((number, count)) if (1..=count).contains(&number) => Ok(Self { index: number - 1, count }),
            _ => Err(format!("`{text}` is no shard; write 1/8 to 8/8 for eight of them")),
        }
    }

    /// The shard of this task by the variables of Slurm, PBS or HyperQueue, which `variable` looks up; all
    /// points outside of a task. `count` is the number of tasks if it is given; PBS and HyperQueue do not say
    /// it.
    ///
    /// Numbers of tasks may start at 0, 1 or elsewhere: those that follow each other are different shards.
    ///
    /// # Errors
    /// If a variable is not a number, or the number of tasks is unknown.
    pub fn of_task(
        count: Option<usize>,
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<Self, SweepError> {
        let number = |name: &str, text: String| {
            let parsed = text.trim().parse::<usize>();
            parsed.map_err(|_| {
                SweepError::Shard(format!("{name}: `{text}` is not a number of a task; give --shard i/n"))
            })
        };
        let task = VARIABLES.into_iter().find_map(|(task, tasks)| Some((task, variable(task)?, tasks)));
        let Some((task, text, tasks)) = task else {
            return match count {
                None => Ok(Self::default()),
                Some(_) => Err(SweepError::Shard(
                    "--shards: no scheduler gives the number of this task; give --shard i/n".to_owned(),
                )),
            };
        };
        let given = tasks.and_then(|tasks| Some((tasks, variable(tasks)?)));
        let count = match (count, given) {
            (Some(count), _) => count,
            (None, Some((tasks, text))) => number(tasks, text)?,
            (None, None) => {
                return Err(SweepError::Shard(format!(
                    "{task} is set, and the number of tasks is not: give --shards N"
                )));
            }
        };
        let count = count.max(1);
        Ok(Self { index: number(task, text)? % count, count })
    }

    /// Whether it is all points.
    pub const fn is_whole(self) -> bool {
        self.count == 1
    }

    /// Whether point `index` belongs to it.
    pub(crate) const fn has(self, index: usize) -> bool {
        index % self.count == self.index
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(count: Option<usize>, variables: &[(&str, &str)]) -> Result<Shard, String> {
        let variable = |name: &str| Some(variables.iter().find(|(known, _)| *known == name)?.1.to_owned());
        Shard::of_task(count, variable).map_err(|error| error.to_string())
    }

    #[test]
    fn shards_are_read_from_options_and_variables() {
        let slurm = |id| [("SLURM_ARRAY_TASK_ID", id), ("SLURM_ARRAY_TASK_COUNT", "4")];
        assert_eq!(Shard::parse("2/4"), Ok(Shard { index: 1, count: 4 }));
        assert_eq!(Shard::parse("2/4").unwrap().to_string(), "2/4");
        assert_eq!(of(None, &slurm("4")), Ok(Shard { index: 0, count: 4 }));
        assert_eq!(of(Some(8), &slurm("5")), Ok(Shard { index: 5, count: 8 }));
        assert_eq!(of(Some(3), &[("PBS_ARRAY_INDEX", "2")]), Ok(Shard { index: 2, count: 3 }));
        assert_eq!(of(Some(3), &[("HQ_TASK_ID", "0")]), Ok(Shard { index: 0, count: 3 }));
        assert_eq!(of(None, &[]), Ok(Shard::default()));
    }

    #[test]
    fn wrong_shards_say_what_to_give() {
        for text in ["0/4", "5/4", "1", "a/b", "1/0"] {
            assert!(Shard::parse(text).unwrap_err().contains("is no shard"), "{text}");
        }
        assert!(of(None, &[("PBS_ARRAY_INDEX", "2")]).unwrap_err().contains("give --shards N"));
        assert!(of(Some(2), &[("HQ_TASK_ID", "x")]).unwrap_err().contains("not a number of a task"));
        assert!(of(Some(2), &[]).unwrap_err().contains("give --shard i/n"));
    }

    #[test]
    fn shards_share_all_points() {
        for point in 0..20 {
            let owners = (1..=3).filter(|n| Shard::parse(&format!("{n}/3")).unwrap().has(point)).count();
            assert_eq!(owners, 1);
        }
    }
}
