//! Running the points of a shard, and the state of a sweep.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use ::run::duration;
use output::progress::Progress;
use output::table::{counted, si};
use rayon::prelude::*;
use serde::Serialize;

use crate::execute::{Outcome, PointResult};
use crate::folder::Stored;
use crate::plan::{Plan, Point};
use crate::report::label;
use crate::screen::{note, screened};
use crate::shared::{Costs, Group, groups};
use crate::{Folder, Shard, SweepError};

/// Number of points that a probe runs.
const PROBE_POINTS: usize = 2;
/// Number of groups that run before the expected time is printed.
const PROBE_GROUPS: usize = 2;

/// Number of runs to come, and their expected time on the threads of the current pool.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Expected {
    /// Runs of the shard.
    pub runs: usize,
    /// Runs that are not finished.
    pub pending: usize,
    /// Expected wall-clock time of the pending runs in seconds; `None` if there are none.
    pub host_s: Option<f64>,
}

impl Expected {
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
pub struct Work<'a> {
    plan: &'a Plan,
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

impl<'a> Work<'a> {
    /// Points of `plan` in `shard` without a whole result in `folder`; with `retry` also those that failed.
    ///
    /// # Errors
    /// If a result cannot be read.
    pub fn new(plan: &'a Plan, folder: &'a Folder, shard: Shard, retry: bool) -> Result<Self, SweepError> {
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
    pub fn probe(&self) -> Expected {
        let middle = self.pending.len() / 2;
        let probed = self.pending.iter().step_by(middle.max(1)).take(PROBE_POINTS);
        let costs: Costs = probed.map(|point| Costs::of(self.plan, point)).sum();
        let host_s = costs.expected_s(&self.pending) / rayon::current_num_threads() as f64;
        Expected { runs: self.runs, pending: self.pending.len(), host_s: costs.is_known().then_some(host_s) }
    }

    /// Runs all pending points on the current pool, those with equal drawings together. Each result is on disk, whole, before it
    /// counts; a point that fails is a result with a reason. The first groups are the probe for the expected time. In a sweep that
    /// screens, one level after the other runs, each on the designs that the one before has left. The state is that of the
    /// shard; points are left over if the work was to stop.
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
            progress.note(&Expected { runs: self.runs, pending: count - finished, host_s }.line());
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
