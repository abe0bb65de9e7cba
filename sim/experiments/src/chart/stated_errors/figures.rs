//! What the errors of many runs say: accuracy of levels, stated errors, and designs whose order turns.

use run::{CONFIDENCE, StatedError};
use serde::Serialize;
use timing::{Checked, Level, error_size};

use super::{ErrorRow, LEVELS, StatedErrorsChart};
use crate::chart::quantiles;
use crate::study::table::{Sheet, TableBuilder, optional, percent, plain, share};

/// Errors of a level over all runs, in percent, and what its warnings say about them.
#[derive(Clone, Debug, Serialize)]
pub struct Accuracy {
    /// The level.
    pub level: Level,
    /// Frames on GPUs.
    pub runs: usize,
    /// Of cycles.
    pub cycles_median_percent: f64,
    /// See above.
    pub cycles_p95_percent: f64,
    /// See above.
    pub cycles_worst_percent: f64,
    /// Of energy.
    pub energy_median_percent: f64,
    /// See above.
    pub energy_p95_percent: f64,
    /// Runs more than 8 % off in cycles, with a warning.
    pub far_warned: usize,
    /// Runs more than 8 % off in cycles, without a warning.
    pub far_silent: usize,
    /// Runs within 8 %, with a warning.
    pub near_warned: usize,
    /// Runs within 8 %, without a warning.
    pub near_silent: usize,
}

/// The logarithm of an error of a run.
type Log = fn(&ErrorRow) -> f64;

impl Accuracy {
    /// Over the rows of a level.
    pub(super) fn of(level: Level, rows: &[ErrorRow]) -> Self {
        let rows: Vec<&ErrorRow> = rows.iter().filter(|row| row.level == level).collect();
        let of = |log: Log| quantiles(rows.iter().map(move |row| 100.0 * error_size(log(row))));
        let (cycles, energy) = (of(|row| row.cycles_log), of(|row| row.energy_log));
        let count = |far: bool, warned: bool| {
            let is =
                |row: &&&ErrorRow| (error_size(row.cycles_log) > Checked::FAR, row.warns) == (far, warned);
            rows.iter().filter(is).count()
        };
        Self {
            level,
            runs: rows.len(),
            cycles_median_percent: cycles(0.5),
            cycles_p95_percent: cycles(0.95),
            cycles_worst_percent: cycles(1.0),
            energy_median_percent: energy(0.5),
            energy_p95_percent: energy(0.95),
            far_warned: count(true, true),
            far_silent: count(true, false),
            near_warned: count(false, true),
            near_silent: count(false, false),
        }
    }
}

/// What is added to the error that the check of a run finds, so that the sum holds for 95 % of runs at a level.
/// Errors are factors less one.
#[derive(Clone, Debug, Serialize)]
pub struct StatedMargin {
    /// The level.
    pub level: Level,
    /// Frames on GPUs.
    pub runs: usize,
    /// The margin of cycles from these runs; infinite with too few of them.
    pub cycles: f64,
    /// Margin of energy.
    pub energy: f64,
    /// Share of runs whose cycles are within the error that the program states; `None` without runs.
    pub held_cycles: Option<f64>,
    /// Share of those whose energy is.
    pub held_energy: Option<f64>,
    /// Share of runs within the error from other frames on other GPUs; `None` if there are too few.
    pub held_out_cycles: Option<f64>,
    /// The same of energy.
    pub held_out_energy: Option<f64>,
}

/// By how much an error is larger than what the check of its run found.
fn beyond_check(row: &ErrorRow, log: Log) -> f64 {
    (error_size(log(row)) - error_size(row.checked_log)).max(0.0)
}

impl StatedMargin {
    /// Over the rows of a level.
    pub(super) fn of(level: Level, rows: &[ErrorRow]) -> Self {
        let rows: Vec<&ErrorRow> = rows.iter().filter(|row| row.level == level).collect();
        let all = |log: Log| rows.iter().map(move |row| beyond_check(row, log));
        let (cycles, energy): (Log, Log) = (|row| row.cycles_log, |row| row.energy_log);
        let stated = StatedError::of(level, Some(0.0));
        Self {
            level,
            runs: rows.len(),
            cycles: bound(all(cycles)),
            energy: bound(all(energy)),
            held_cycles: held(all(cycles), stated.cycles),
            held_energy: held(all(energy), stated.energy),
            held_out_cycles: held_out(&rows, cycles),
            held_out_energy: held_out(&rows, energy),
        }
    }
}

/// The bound that a further error stays within with a probability of 95 %, if it is like these: the conformal
/// quantile, infinite with too few errors (Papadopoulos et al. 2002).
fn bound(errors: impl Iterator<Item = f64>) -> f64 {
    let mut errors: Vec<f64> = errors.collect();
    errors.sort_by(f64::total_cmp);
    let rank = ((errors.len() + 1) as f64 * CONFIDENCE).ceil() as usize;
    errors.get(rank - 1).copied().unwrap_or(f64::INFINITY)
}

/// Share of the errors within a bound.
fn held(errors: impl Iterator<Item = f64>, bound: f64) -> Option<f64> {
    let (mut within, mut all) = (0_u32, 0_u32);
    for error in errors {
        (within, all) = (within + u32::from(error <= bound), all + 1);
    }
    (all > 0).then(|| f64::from(within) / f64::from(all))
}

/// Share of errors within the bounds from the other half of frames and of GPUs.
fn held_out(rows: &[&ErrorRow], log: Log) -> Option<f64> {
    let part = |half: usize| {
        let is = move |row: &&&ErrorRow| row.subject_number % 2 == half && row.gpu % 2 == half as u64;
        rows.iter().filter(is).map(move |row| beyond_check(row, log))
    };
    let bounds = [0, 1].map(|half| bound(part(half)));
    if bounds.iter().any(|bound| bound.is_infinite()) {
        return None;
    }
    let shares = [0, 1].map(|half| held(part(half), bounds[1 - half]));
    let counts = [0, 1].map(|half| part(half).count() as f64);
    Some((shares[0]? * counts[0] + shares[1]? * counts[1]) / (counts[0] + counts[1]))
}

/// Pairs of GPUs on one frame whose order a level turns round.
#[derive(Clone, Debug, Serialize)]
pub struct Flips {
    /// The level.
    pub level: Level,
    /// What they are ordered by.
    pub by: &'static str,
    /// Pairs.
    pub pairs: u64,
    /// Share of pairs in another order than at `stepped`.
    pub flipped: f64,
    /// Share of these whose difference is within their stated errors, so that a report leaves them undecided;
    /// `None` if none flipped.
    pub undecided: Option<f64>,
}

/// All pairs at all levels, by time and by energy.
pub(super) fn flips(rows: &[ErrorRow]) -> Vec<Flips> {
    LEVELS.into_iter().flat_map(|level| ["time", "energy"].map(|by| flips_by(rows, level, by))).collect()
}

fn flips_by(rows: &[ErrorRow], level: Level, by: &'static str) -> Flips {
    let (mut pairs, mut flipped, mut undecided) = (0_u64, 0_u64, 0_u64);
    let of_level: Vec<&ErrorRow> = rows.iter().filter(|row| row.level == level).collect();
    // Logarithm of the truth, of what was found, and of the stated error.
    let logs = |row: &ErrorRow| {
        let stated = StatedError::of(level, Some(libm::expm1(row.checked_log)));
        let [truth, error, stated] = match by {
            "time" => [row.stepped_s, row.cycles_log, stated.cycles],
            _ => [row.stepped_j, row.energy_log, stated.energy],
        };
        [libm::log(truth), libm::log(truth) + error, libm::log1p(stated)]
    };
    for frame in of_level.chunk_by(|a, b| a.subject_number == b.subject_number) {
        let logs: Vec<[f64; 3]> = frame.iter().map(|row| logs(row)).collect();
        for (at, a) in logs.iter().enumerate() {
            for b in &logs[at + 1..] {
                pairs += 1;
                if (a[0] < b[0]) != (a[1] < b[1]) {
                    flipped += 1;
                    undecided += u64::from((a[1] - b[1]).abs() <= a[2] + b[2]);
                }
            }
        }
    }
    let undecided = (flipped > 0).then(|| undecided as f64 / flipped as f64);
    Flips { level, by, pairs, flipped: flipped as f64 / pairs.max(1) as f64, undecided }
}

impl StatedErrorsChart {
    /// Errors and warnings of the levels.
    pub(super) fn level_sheet(&self) -> Sheet {
        TableBuilder::of(&self.levels)
            .shown("level", |row| row.level.name(), plain)
            .shown("runs", |row| row.runs, plain)
            .shown("cycles: median", |row| row.cycles_median_percent, percent(2))
            .shown("95 %", |row| row.cycles_p95_percent, percent(1))
            .shown("worst", |row| row.cycles_worst_percent, percent(0))
            .shown("energy: median", |row| row.energy_median_percent, percent(2))
            .shown("95 %", |row| row.energy_p95_percent, percent(1))
            .shown("beyond 8 %: warned", |row| row.far_warned, plain)
            .shown("silent", |row| row.far_silent, plain)
            .shown("within: warned", |row| row.near_warned, plain)
            .shown("silent", |row| row.near_silent, plain)
            .sheet()
    }

    /// Margins of stated errors. The file is the one that the program reads.
    pub(super) fn margin_sheet(&self) -> Sheet {
        TableBuilder::of(&self.margins)
            .column("level", "level", |row| row.level.name(), plain)
            .column("runs", "runs", |row| row.runs, plain)
            .column("cycles", "to add: cycles", |row| row.cycles, share(1))
            .column("energy", "energy", |row| row.energy, share(1))
            .shown("stated holds: cycles", |row| row.held_cycles, optional(share(1)))
            .shown("energy", |row| row.held_energy, optional(share(1)))
            .shown("held out: cycles", |row| row.held_out_cycles, optional(share(1)))
            .shown("energy", |row| row.held_out_energy, optional(share(1)))
            .csv("stated_errors.csv")
            .sheet()
    }

    /// Pairs of GPUs.
    pub(super) fn flip_sheet(&self) -> Sheet {
        TableBuilder::of(&self.flips)
            .shown("level", |row| row.level.name(), plain)
            .shown("order by", |row| row.by, plain)
            .shown("pairs of GPUs", |row| row.pairs, plain)
            .shown("in another order", |row| row.flipped, share(2))
            .shown("of these undecided", |row| row.undecided, optional(share(1)))
            .sheet()
    }

    /// Every run.
    pub(super) fn row_sheet(&self) -> Sheet {
        TableBuilder::of(&self.rows)
            .data("subject", |row| row.subject.as_str())
            .data("gpu", |row| row.gpu)
            .data("level", |row| row.level.name())
            .data("warns", |row| row.warns.to_string())
            .data("checked_log", |row| row.checked_log)
            .data("cycles_log", |row| row.cycles_log)
            .data("energy_log", |row| row.energy_log)
            .data("stepped_s", |row| row.stepped_s)
            .data("stepped_j", |row| row.stepped_j)
            .data("distance", |row| row.distance)
            .data("channels", |row| row.channels)
            .data("row_bytes", |row| row.row_bytes)
            .data("packets_per_cycle", |row| row.packets_per_cycle)
            .csv("stated_errors_runs.csv")
            .sheet()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_holds_for_95_percent_of_further_errors() {
        assert_eq!(bound((1..=18).map(f64::from)), f64::INFINITY);
        assert_eq!(bound((1..=19).map(f64::from)), 19.0);
        assert_eq!(bound((1..=99).map(f64::from)), 95.0);
        assert_eq!(held([1.0, 2.0, 3.0, 4.0].into_iter(), 3.0), Some(0.75));
        assert_eq!(held(std::iter::empty(), 3.0), None);
    }

    fn row(gpu: u64, stepped_s: f64, cycles_log: f64) -> ErrorRow {
        ErrorRow {
            subject: "frame".to_owned(),
            subject_number: 0,
            gpu,
            level: Level::Packet,
            checked_log: cycles_log,
            warns: false,
            cycles_log,
            energy_log: 0.0,
            stepped_s,
            stepped_j: stepped_s,
            distance: 1.0,
            channels: 1,
            row_bytes: 1024,
            packets_per_cycle: 0.1,
        }
    }

    #[test]
    fn an_order_that_a_level_turns_round_is_a_flip() {
        // The first two are 1 % apart and found 1 % apart the other way; the third is far from both.
        let rows = [row(0, 1.0, 0.02), row(1, 1.01, 0.0), row(2, 9.0, 0.0)];
        let [by_time, by_energy, ..] = &flips(&rows)[..] else { panic!() };
        assert_eq!((by_time.pairs, by_time.flipped, by_time.undecided), (3, 1.0 / 3.0, Some(1.0)));
        assert_eq!((by_energy.flipped, by_energy.undecided), (0.0, None));
    }

    #[test]
    fn accuracy_counts_what_is_far_and_warned() {
        let mut rows = vec![row(0, 1.0, 0.01), row(1, 1.0, 0.2), row(2, 1.0, -0.2), row(3, 1.0, 0.0)];
        rows[1].warns = true;
        let found = Accuracy::of(Level::Packet, &rows);
        let counts = [found.far_warned, found.far_silent, found.near_warned, found.near_silent];
        assert_eq!(counts, [1, 1, 0, 2]);
        assert!((found.cycles_worst_percent - 100.0 * (0.2_f64.exp() - 1.0)).abs() < 1e-9);
    }
}
