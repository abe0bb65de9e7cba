//! Alignment of recorded time stamps with a curve: by two anchors, or by the best fit to the starts found in
//! it.
//!
//! Frame times are a fingerprint: a short run of stamps fits the starts in hardly more than one place. Where
//! stamps or starts are missing, runs of stamps are laid on runs of starts. The lines that fit best are
//! compared with all stamps, each paired with the nearest start, and fitted again to these pairs.

use crate::stats::upper_median;
use crate::trace::is_within;
use rayon::prelude::*;
use serde::Serialize;
use thiserror::Error;
use warnings::{Code, Warning};

/// Fewest pairs of a fit: fewer fit anything.
const MIN_PAIRS: usize = 4;
/// A fit is ambiguous if the second best leaves at most this many times the residual of the best.
const MAX_RIVAL_RATIO: f64 = 2.0;
/// A fit is ambiguous if chance alone leaves as little in more than this many other places: one in a hundred
/// times, a fit by chance is not known as such.
const MAX_CHANCE_FITS: f64 = 0.01;

/// Largest residual of a fit, as a share of the median gap of the starts.
const MAX_RESIDUAL_SHARE: f64 = 0.1;

/// Largest deviation of the clock of the stamps from that of the trace by anchors, as a share. The crystals
/// of computers deviate by less than 1e-4; more than this is another unit or another recording.
const MAX_CLOCK_DEVIATION: f64 = 0.02;

/// Residuals below this are rounding, s.
const EXACT_S: f64 = 1e-9;

/// Why stamps cannot be aligned.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum AlignError {
    /// Two anchors at the same stamp, or not finite.
    #[error("anchors {a:?} and {b:?} (stamp, time): two finite, different stamps and times are needed")]
    Anchors {
        /// The first.
        a: (f64, f64),
        /// The second.
        b: (f64, f64),
    },
    /// Too few stamps or starts for a fit.
    #[error("{stamps} stamps and {starts} starts: a fit needs at least 4 of each; give two anchors instead")]
    Few {
        /// Stamps given.
        stamps: usize,
        /// Starts found.
        starts: usize,
    },
    /// No place where stamps and starts fit.
    #[error(
        "stamps fit the starts nowhere: the best pairing leaves {left_s:.3e} s of {gap_s:.3e} s between starts; look at the frames \
         found, or give two anchors instead"
    )]
    Unlike {
        /// Root mean square of the residuals, s.
        left_s: f64,
        /// Median gap of the starts, s.
        gap_s: f64,
    },
    /// Stamps that are equal.
    #[error("too many of the {stamps} stamps are the same for a fit; give two anchors instead")]
    Equal {
        /// Stamps given.
        stamps: usize,
    },
}

/// `time = offset + scale x stamp`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Alignment {
    /// Seconds of the trace for a second of the stamps.
    pub scale: f64,
    /// Time of stamp 0, s.
    pub offset_s: f64,
    /// Root mean square of the residuals, s; 0 by anchors.
    pub residual_s: f64,
    /// How many pairs it rests on.
    pub pairs: usize,
    /// Whether another pairing fits about as well: even frame times fit at any shift.
    pub ambiguous: bool,
}

impl Alignment {
    /// A stamp's time in the trace, s.
    pub fn time_s(&self, stamp_s: f64) -> f64 {
        self.offset_s + self.scale * stamp_s
    }

    /// Through two pairs of (stamp, time), s.
    ///
    /// # Errors
    /// [`AlignError::Anchors`] unless both are finite and differ.
    pub fn by_anchors(a: (f64, f64), b: (f64, f64)) -> Result<Self, AlignError> {
        let scale = (b.1 - a.1) / (b.0 - a.0);
        if !(scale.is_finite() && scale > 0.0) {
            return Err(AlignError::Anchors { a, b });
        }
        Ok(Self { scale, offset_s: a.1 - scale * a.0, residual_s: 0.0, pairs: 2, ambiguous: false })
    }

    /// Warnings about anchors (stamp, time) that are likely wrong: stamps in another unit, or of another
    /// recording. The stamps are sorted, s.
    pub fn warnings(&self, anchors: [(f64, f64); 2], stamps_s: &[f64]) -> Vec<Warning> {
        let mut messages = Vec::new();
        if (self.scale - 1.0).abs() > MAX_CLOCK_DEVIATION {
            messages
                .push(format!("by the anchors, a second of the stamps lasts {} s of the trace", self.scale));
        }
        if let [first, .., last] | [first @ last] = *stamps_s {
            let beyond = anchors.into_iter().filter(|(stamp, _)| !is_within([first, last], *stamp));
            messages.extend(beyond.map(|(stamp, _)| {
                format!("stamp {stamp} s of an anchor is beyond those of the file, {first} s to {last} s")
            }));
        }
        messages.into_iter().map(|message| Warning::new(Code::AnchorsOff, message)).collect()
    }

    /// The pairing of stamps with starts of the least residual: one after another from some shift on or, if
    /// that does not fit, with gaps in either. Both sorted, s. Starts are known to `resolution_s` rms:
    /// residuals below that say nothing.
    ///
    /// # Errors
    /// [`AlignError::Few`] for fewer than four of either, [`AlignError::Equal`] for stamps of which too many
    /// are the same, [`AlignError::Unlike`] where nothing fits.
    pub fn by_fit(stamps_s: &[f64], starts_s: &[f64], resolution_s: f64) -> Result<Self, AlignError> {
        let in_step = Self::in_step(stamps_s, starts_s, resolution_s.max(EXACT_S))?;
        let gap_s = usual_gap(starts_s).unwrap_or(0.0);
        if in_step.residual_s <= EXACT_S.max(MAX_RESIDUAL_SHARE * MAX_RESIDUAL_SHARE * gap_s) {
            return Ok(in_step);
        }
        let least = (stamps_s.len().min(starts_s.len()) / 2).max(MIN_PAIRS);
        let with_gaps = paired(stamps_s, starts_s, least).filter(|fit| fit.residual_s < in_step.residual_s);
        let best = with_gaps.unwrap_or(in_step);
        if best.residual_s > MAX_RESIDUAL_SHARE * gap_s {
            return Err(AlignError::Unlike { left_s: best.residual_s, gap_s });
        }
        Ok(best)
    }

    /// The shift by which one after another leaves least.
    fn in_step(stamps_s: &[f64], starts_s: &[f64], least_s: f64) -> Result<Self, AlignError> {
        let fewer = stamps_s.len().min(starts_s.len());
        if fewer < MIN_PAIRS {
            return Err(AlignError::Few { stamps: stamps_s.len(), starts: starts_s.len() });
        }
        let overlap = (fewer / 2).max(MIN_PAIRS);
        // Stamps before `skip` lie before the first start, starts before `skip` before the first stamp.
        let later_starts = (0..=starts_s.len() - overlap).map(|skip| fit(stamps_s, &starts_s[skip..]));
        let later_stamps = (1..=stamps_s.len() - overlap).map(|skip| fit(&stamps_s[skip..], starts_s));
        let mut fits: Vec<Self> = later_starts.chain(later_stamps).filter(|fit| fit.scale > 0.0).collect();
        if fits.is_empty() {
            return Err(AlignError::Equal { stamps: stamps_s.len() });
        }
        fits.sort_by(|a, b| a.residual_s.total_cmp(&b.residual_s));
        let by_chance = chance_fits(&fits, least_s) > MAX_CHANCE_FITS;
        // Of all that fit about as well, the one that pairs most.
        let limit_s = MAX_RIVAL_RATIO * fits[0].residual_s.max(least_s);
        fits.retain(|fit| fit.residual_s <= limit_s);
        let ambiguous = by_chance || fits.len() > 1;
        fits.sort_by_key(|fit| core::cmp::Reverse(fit.pairs));
        Ok(Self { ambiguous, ..fits[0] })
    }
}

/// In how many other places chance leaves as little as in the best, at most, where the places are no better
/// than each other: with few pairs one of many residuals is small. `fits` are in order of their residuals, of
/// which those below `least_s` say nothing.
///
/// `n` pairs leave `n - 2` degrees of freedom `k`; chi-square is at most a share `x` of `k` with a
/// probability of at most `(x e^(1 - x))^(k / 2)` (Chernoff 1952). The median of the residuals stands for the
/// usual one.
fn chance_fits(fits: &[Alignment], least_s: f64) -> f64 {
    let Some((best, others)) = fits.split_first().filter(|(_, others)| !others.is_empty()) else {
        return 0.0;
    };
    let ratio = best.residual_s.max(least_s) / others[others.len() / 2].residual_s.max(least_s);
    let (share, freedom) = (ratio * ratio, (best.pairs - 2) as f64);
    others.len() as f64 * libm::pow(share * libm::exp(1.0 - share), 0.5 * freedom)
}

/// Least squares of the first stamp with the first start, the second with the second, and so on.
fn fit(stamps_s: &[f64], starts_s: &[f64]) -> Alignment {
    let pairs = stamps_s.len().min(starts_s.len());
    let mean = |values: &[f64]| values[..pairs].iter().sum::<f64>() / pairs as f64;
    let (x, y) = (mean(stamps_s), mean(starts_s));
    let both = || stamps_s.iter().zip(starts_s).map(|(&a, &b)| (a - x, b - y));
    let (xy, xx) = both().fold((0.0, 0.0), |(xy, xx), (a, b)| (xy + a * b, xx + a * a));
    let scale = xy / xx;
    let left: f64 = both().map(|(a, b)| (b - scale * a) * (b - scale * a)).sum();
    let residual_s = libm::sqrt(left / pairs as f64);
    Alignment { scale, offset_s: y - scale * x, residual_s, pairs, ambiguous: false }
}

/// Stamps in a run: long ones decide better, short ones may be free of gaps where every fifth stamp is
/// missing.
const RUN_STAMPS: [usize; 2] = [12, 4];
/// Short runs are tried if a smaller share of the stamps, or of the starts, pairs.
const MIN_PAIRED_SHARE: f64 = 0.95;
/// Most runs that are tried, evenly picked.
const MAX_RUNS: usize = 24;
/// Most lines that are refined.
const MAX_LINES: usize = 150;
/// A stamp pairs with a start nearer than this share of the median gap.
const MAX_PAIR_DISTANCE: f64 = 0.1;
/// Rounds in which pairs and line are refined in turn.
const MAX_ROUNDS: usize = 8;
/// Scales within this factor of that of the median gaps are tried: a run may also match every second start.
const MAX_SCALE_RATIO: f64 = 1.3;

/// The line that pairs most stamps, and of those with as many the one that leaves least; with whether another
/// place pairs nearly as many. `None` where none pairs `least`.
fn paired(stamps_s: &[f64], starts_s: &[f64], least: usize) -> Option<Alignment> {
    let gap_s = usual_gap(starts_s)?;
    let scale = gap_s / usual_gap(stamps_s)?;
    let fewer = stamps_s.len().min(starts_s.len());
    let mut fits: Vec<Alignment> = Vec::new();
    for run in RUN_STAMPS {
        let lines = lines(stamps_s, starts_s, run.min(fewer), scale);
        let settled = |line: &Alignment| settled(*line, stamps_s, starts_s, MAX_PAIR_DISTANCE * gap_s);
        fits.par_extend(lines.par_iter().filter_map(settled));
        fits.sort_by(|a, b| b.pairs.cmp(&a.pairs).then(a.residual_s.total_cmp(&b.residual_s)));
        if fits.first().is_some_and(|best| best.pairs as f64 >= MIN_PAIRED_SHARE * fewer as f64) {
            break;
        }
    }
    let best = *fits.first().filter(|best| best.pairs >= least)?;
    let middle_s = stamps_s[stamps_s.len() / 2];
    let elsewhere = |fit: &Alignment| (fit.time_s(middle_s) - best.time_s(middle_s)).abs() > 0.5 * gap_s;
    let ambiguous = fits.iter().any(|fit| elsewhere(fit) && fit.pairs * 10 >= best.pairs * 9);
    Some(Alignment { ambiguous, ..best })
}

/// The lines through runs of stamps laid on runs of starts that leave least, of about the scale that is
/// expected.
fn lines(stamps_s: &[f64], starts_s: &[f64], run: usize, scale: f64) -> Vec<Alignment> {
    let last = stamps_s.len() - run;
    let laid = |at: usize| {
        let stamps = &stamps_s[at..at + run];
        starts_s.windows(run).map(move |starts| fit(stamps, starts))
    };
    let mut lines: Vec<Alignment> =
        (0..MAX_RUNS).flat_map(|pick| laid(pick * last / (MAX_RUNS - 1))).collect();
    lines.retain(|line| (scale / MAX_SCALE_RATIO..scale * MAX_SCALE_RATIO).contains(&line.scale));
    lines.sort_by(|a, b| a.residual_s.total_cmp(&b.residual_s));
    lines.truncate(MAX_LINES);
    lines
}

/// A line fitted to the pairs it makes, until those stay; `None` where hardly any are left.
fn settled(line: Alignment, stamps_s: &[f64], starts_s: &[f64], near_s: f64) -> Option<Alignment> {
    let mut line = line;
    for _ in 0..MAX_ROUNDS {
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
        if stamps.len() < MIN_PAIRS {
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
fn usual_gap(times_s: &[f64]) -> Option<f64> {
    let mut gaps: Vec<f64> = times_s.windows(2).map(|two| two[1] - two[0]).collect();
    let gap_s = if gaps.is_empty() { 0.0 } else { upper_median(&mut gaps) };
    (gap_s > 0.0).then_some(gap_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uneven() -> Vec<f64> {
        (0..40)
            .scan(3.0, |t, i| {
                *t += 0.01 + 0.003 * f64::from(i * i * 7 % 31) / 8.0;
                Some(*t)
            })
            .collect()
    }

    #[test]
    fn anchors_of_another_unit_or_recording_are_warned_about() {
        let warned = |anchors: [(f64, f64); 2], stamps_s: &[f64]| {
            Alignment::by_anchors(anchors[0], anchors[1]).unwrap().warnings(anchors, stamps_s).len()
        };
        let stamps_s = [0.0, 10.0, 20.0];
        assert_eq!(warned([(0.0, 5.0), (20.0, 25.0)], &stamps_s), 0);
        assert_eq!(warned([(0.0, 5.0), (20.0, 26.0)], &stamps_s), 1);
        assert_eq!(warned([(-1.0, 5.0), (21.0, 27.0)], &stamps_s), 2);
        assert_eq!(warned([(-1.0, 5.0), (21.0, 28.0)], &[3.0]), 3);
    }

    #[test]
    fn anchors_and_fit_recover_a_shift_and_a_fast_clock() {
        let starts = uneven();
        let stamp = |time: f64| (time - 1.5) / 1.0001;
        let anchors = Alignment::by_anchors((stamp(3.0), 3.0), (stamp(9.0), 9.0)).unwrap();
        assert!((anchors.time_s(stamp(5.0)) - 5.0).abs() < 1e-12);
        let stamps: Vec<f64> = starts[7..30].iter().map(|&t| stamp(t)).collect();
        let fit = Alignment::by_fit(&stamps, &starts, 1e-5).unwrap();
        assert!((fit.scale - 1.0001).abs() < 1e-9 && fit.residual_s < 1e-12 && fit.pairs == 23, "{fit:?}");
        assert!(!fit.ambiguous);
    }

    #[test]
    fn stamps_that_are_missing_and_ones_too_many_are_left_out() {
        let starts = uneven();
        let stamp = |time: f64| (time - 1.5) / 1.0001;
        let all: Vec<f64> = starts.iter().map(|&time| stamp(time)).collect();
        let without = |every: usize| -> Vec<f64> {
            all.iter().enumerate().filter(|(i, _)| i % every != every - 1).map(|(_, stamp)| *stamp).collect()
        };
        let mut extra = all.clone();
        extra.insert(20, 0.5 * (all[19] + all[20]));
        for stamps in [without(17), without(5), extra] {
            let fit = Alignment::by_fit(&stamps, &starts, 1e-5).unwrap();
            assert!((fit.scale - 1.0001).abs() < 1e-9 && !fit.ambiguous, "{fit:?}");
            assert_eq!(fit.pairs, stamps.len().min(40));
        }
    }

    #[test]
    fn stamps_of_something_else_are_refused() {
        let others: Vec<f64> =
            (0..40).map(|i| 0.01 * f64::from(i) + 0.009 * f64::from(i * 37 % 11) / 11.0).collect();
        let fit = Alignment::by_fit(&others, &uneven(), 1e-5);
        assert!(matches!(fit, Err(AlignError::Unlike { .. })), "{fit:?}");
    }

    /// 138 starts 40 ms apart, each off by at most `most_s` either way, on a grid of that if `whole`.
    fn even(seed: u64, most_s: f64, whole: bool) -> Vec<f64> {
        let random = crate::stats::Random::new(seed, 0);
        let off = |index| random.between(index, [-1.0, 1.0]);
        let off = |index| if whole { libm::round(1.5 * off(index)) } else { off(index) };
        (0..138_u32).map(|index| 0.04 * f64::from(index) + most_s * off(index.into())).collect()
    }

    #[test]
    fn a_few_even_stamps_fit_an_even_beat_by_chance_and_are_ambiguous() {
        let resolution_s = 2e-5 / 12_f64.sqrt();
        for (most_s, whole) in [(2e-5, false), (2e-5, true), (1e-3, false)] {
            for count in [4, 5, 8, 20] {
                let stamps: Vec<f64> = (0..count).map(|index| 0.04 * f64::from(index)).collect();
                let fit =
                    |seed| Alignment::by_fit(&stamps, &even(seed, most_s, whole), resolution_s).unwrap();
                let sure = (0..200).filter(|seed| !fit(*seed).ambiguous).count();
                assert!(sure as f64 <= 200.0 * MAX_CHANCE_FITS, "{sure} of 200: {most_s} s, {count} stamps");
            }
        }
    }

    #[test]
    fn four_stamps_of_uneven_frames_decide() {
        let starts = uneven();
        let stamps: Vec<f64> = starts[11..15].iter().map(|time_s| time_s - 1.5).collect();
        let fit = Alignment::by_fit(&stamps, &starts, 1e-5).unwrap();
        assert!(!fit.ambiguous && (fit.offset_s - 1.5).abs() < 1e-9, "{fit:?}");
    }

    #[test]
    fn an_even_beat_is_ambiguous_and_bad_input_refused() {
        let beat: Vec<f64> = (0..20).map(|i| f64::from(i) / 30.0).collect();
        assert!(Alignment::by_fit(&beat[..10], &beat, 0.0).unwrap().ambiguous);
        assert!(Alignment::by_fit(&beat[..2], &beat, 0.0).unwrap_err().to_string().contains("2 stamps"));
        assert!(Alignment::by_anchors((1.0, 2.0), (1.0, 3.0)).is_err());
        assert_eq!(Alignment::by_fit(&[5.0; 6], &beat, 0.0), Err(AlignError::Equal { stamps: 6 }));
    }
}
