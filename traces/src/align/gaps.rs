//! Pairs of stamps and starts where some of either are missing.
//!
//! Frame times are a fingerprint: a short run of stamps fits the starts in hardly more than one place. So runs of stamps are laid on runs
//! of starts; the lines that fit best are held against all stamps, each paired with the nearest start, and fitted anew to what pairs.

use super::{Alignment, fit};
use crate::median::median;
use rayon::prelude::*;

/// Stamps in a run: many tell more, few may be without a gap where every fifth is missing.
const RUN: [usize; 2] = [12, 4];
/// Runs of few are tried where less than this share of stamps, or of starts, pairs.
const MOSTLY: f64 = 0.95;
/// Runs tried, evenly picked.
const RUNS: usize = 24;
/// Lines looked at closer.
const LINES: usize = 150;
/// A stamp has a start where that is nearer than this share of the median gap.
const NEAR: f64 = 0.1;
/// How often pairs and line are put right in turn.
const ROUNDS: usize = 8;
/// Scales within this factor of that of the median gaps are tried: a run may also lie on every second start.
const SCALES: f64 = 1.3;

/// The line that pairs most stamps, and of those with as many the one that leaves least; with whether another place pairs nearly
/// as many. `None` where none pairs `least`.
pub(super) fn paired(stamps_s: &[f64], starts_s: &[f64], least: usize) -> Option<Alignment> {
    let gap_s = usual_gap(starts_s)?;
    let scale = gap_s / usual_gap(stamps_s)?;
    let fewer = stamps_s.len().min(starts_s.len());
    let mut fits: Vec<Alignment> = Vec::new();
    for run in RUN {
        let lines = lines(stamps_s, starts_s, run.min(fewer), scale);
        let settled = |line: &Alignment| settled(*line, stamps_s, starts_s, NEAR * gap_s);
        fits.par_extend(lines.par_iter().filter_map(settled));
        fits.sort_by(|a, b| b.pairs.cmp(&a.pairs).then(a.residual_s.total_cmp(&b.residual_s)));
        if fits.first().is_some_and(|best| best.pairs as f64 >= MOSTLY * fewer as f64) {
            break;
        }
    }
    let best = *fits.first().filter(|best| best.pairs >= least)?;
    let middle_s = stamps_s[stamps_s.len() / 2];
    let elsewhere = |fit: &Alignment| (fit.time_s(middle_s) - best.time_s(middle_s)).abs() > 0.5 * gap_s;
    let ambiguous = fits.iter().any(|fit| elsewhere(fit) && fit.pairs * 10 >= best.pairs * 9);
    Some(Alignment { ambiguous, ..best })
}

/// The lines through runs of stamps laid on runs of starts that leave least, of about the scale that is expected.
fn lines(stamps_s: &[f64], starts_s: &[f64], run: usize, scale: f64) -> Vec<Alignment> {
    let last = stamps_s.len() - run;
    let laid = |at: usize| {
        let stamps = &stamps_s[at..at + run];
        starts_s.windows(run).map(move |starts| fit(stamps, starts))
    };
    let mut lines: Vec<Alignment> = (0..RUNS).flat_map(|pick| laid(pick * last / (RUNS - 1))).collect();
    lines.retain(|line| (scale / SCALES..scale * SCALES).contains(&line.scale));
    lines.sort_by(|a, b| a.residual_s.total_cmp(&b.residual_s));
    lines.truncate(LINES);
    lines
}

/// A line fitted to the pairs it makes, until those stay; `None` where hardly any are left.
fn settled(line: Alignment, stamps_s: &[f64], starts_s: &[f64], near_s: f64) -> Option<Alignment> {
    let mut line = line;
    for _ in 0..ROUNDS {
        let nearest = |stamp: &f64| {
            let time_s = line.time_s(*stamp);
            let after = starts_s.partition_point(|start| *start < time_s);
            let beside = [after.checked_sub(1), Some(after)].into_iter().flatten();
            let off = |index: &usize| (starts_s[*index] - time_s).abs();
            let index =
                beside.filter(|index| *index < starts_s.len()).min_by(|a, b| off(a).total_cmp(&off(b)))?;
            (off(&index) < near_s).then_some((*stamp, starts_s[index]))
        };
        let mut pairs: Vec<(f64, f64)> = stamps_s.iter().filter_map(nearest).collect();
        pairs.dedup_by_key(|pair| pair.1);
        let (stamps, starts): (Vec<f64>, Vec<f64>) = pairs.into_iter().unzip();
        if stamps.len() < super::LEAST_PAIRS {
            return None;
        }
        let next = fit(&stamps, &starts);
        if next == line {
            break;
        }
        line = next;
    }
    Some(line)
}

/// The median distance of neighbours, s; `None` where that is nothing.
pub(super) fn usual_gap(times_s: &[f64]) -> Option<f64> {
    let mut gaps: Vec<f64> = times_s.windows(2).map(|two| two[1] - two[0]).collect();
    let gap_s = if gaps.is_empty() { 0.0 } else { median(&mut gaps) };
    (gap_s > 0.0).then_some(gap_s)
}
