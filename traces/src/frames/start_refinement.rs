//! Start refinement: starts move to where neighbouring frames begin to agree.
//!
//! Frames are aligned by the power after their start. If the part in between has become shorter since the
//! mark (a front end with less to do), a start at the distance of the mark lies in the end of the frame
//! before. That end varies from frame to frame, so neighbours differ there, and the energy from start to
//! start varies with them. A start therefore moves to the first sample from which on neighbours agree about
//! as well as anywhere near. Starts that agree already do not move; nor do starts at an edge, which each
//! frame samples at another phase, nor up into more power, as power falls at the end of a frame; nor past
//! most of the work in the window, as a frame that is busy for a few samples differs from its neighbours
//! while it works, and agrees with them in the idle gap after it.

use super::subsample::between;
use crate::stats::{mean, moments, upper_median};
use rayon::prelude::*;

/// Largest move of a start, as a share of the window.
const MAX_MOVE_SHARE: f64 = 0.12;
/// Neighbours on either side whose differences are averaged.
const NEIGHBOURS: usize = 16;
/// Samples on either side whose differences are averaged.
const SMOOTHED_SAMPLES: usize = 1;
/// A start at most this many samples before the agreeing ones lies at their edge: neighbours differ in the
/// edge itself.
const MAX_EDGE_SAMPLES: usize = 3;
/// Neighbours agree where their squared difference is below this many times the least within reach.
const MAX_AGREEMENT_RATIO: f64 = 6.0;
/// They agree also below this share of the variance of the trace: the steps of a coarse recorder may hide all
/// noise.
const MAX_AGREEMENT_SHARE: f64 = 1e-4;
/// Neighbours on either side over which moves are smoothed, as content changes slowly.
const SMOOTHED_MOVES: usize = 8;

/// Positions of windows, samples, moved forward; `anchor` is the place of the start in a window of `width`
/// samples. What a start is the `fixed` ones say: where neighbours differ after those by as much, all starts stay.
pub(super) fn refine_starts(
    power: &[f64],
    positions: Vec<f64>,
    fixed: &[bool],
    anchor: f64,
    width: usize,
) -> Vec<f64> {
    let reach = (MAX_MOVE_SHARE * width as f64) as usize;
    let starts: Vec<f64> = positions.iter().map(|position| position + anchor).collect();
    let differences = differences(power, &starts, reach + 1);
    let deviation_w = moments(power).deviation;
    let agreement_w2 = MAX_AGREEMENT_SHARE * deviation_w * deviation_w;
    let moves: Vec<f64> = (0..positions.len())
        .map(|frame| {
            let near = frame.saturating_sub(NEIGHBOURS)..(frame + NEIGHBOURS).min(differences.len());
            let by = first_agreeing(&mean_of_each(&differences[near.clone()], reach + 1), agreement_w2);
            let starts = &starts[near];
            let is_down = level(power, starts, by) < level(power, starts, 0.0);
            if by > 0.0 && is_down && has_work_ahead(power, starts, by, width as f64 - anchor) {
                by
            } else {
                0.0
            }
        })
        .collect();
    let moves = smoothed(&smoothed(&moves, upper_median), |near| mean(near));
    let of_marks =
        moves.iter().zip(fixed).filter(|(_, fixed)| **fixed).map(|(by, _)| *by).fold(0.0, f64::max);
    positions.iter().zip(moves).map(|(position, by)| position + (by - of_marks).max(0.0)).collect()
}

/// How much each frame and the next differ at each of `length` samples from their starts on, W^2.
fn differences(power: &[f64], starts: &[f64], length: usize) -> Vec<Vec<f64>> {
    let sample = |start: f64, index: usize| between(power, start + index as f64 - SMOOTHED_SAMPLES as f64);
    let square = |pair: &[f64], index: usize| match [pair[0], pair[1]].map(|start| sample(start, index)) {
        [Some(a), Some(b)] => (a - b) * (a - b),
        _ => 0.0,
    };
    let of_pair = |pair: &[f64]| -> Vec<f64> {
        let squares: Vec<f64> = (0..length + 2 * SMOOTHED_SAMPLES).map(|index| square(pair, index)).collect();
        squares.windows(1 + 2 * SMOOTHED_SAMPLES).map(mean).collect()
    };
    starts.par_windows(2).map(of_pair).collect()
}

/// The element-wise mean of some rows of `columns` values.
fn mean_of_each(rows: &[Vec<f64>], columns: usize) -> Vec<f64> {
    let mut sums = vec![0.0; columns];
    for row in rows {
        sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value / rows.len() as f64);
    }
    sums
}

/// The first sample at which neighbours agree, in samples from the start.
fn first_agreeing(differ: &[f64], agreement_w2: f64) -> f64 {
    let least = differ.iter().copied().fold(f64::INFINITY, f64::min);
    let limit = agreement_w2.max(MAX_AGREEMENT_RATIO * least);
    differ.iter().position(|value| *value <= limit).filter(|first| *first > MAX_EDGE_SAMPLES).unwrap_or(0)
        as f64
}

/// Whether more of the work in a window lies after the first `by` of its `length` samples than in them:
/// energy above the power there.
fn has_work_ahead(power: &[f64], starts: &[f64], by: f64, length: f64) -> bool {
    let base = level(power, starts, by);
    let work = |samples: std::ops::Range<usize>| -> f64 {
        samples.map(|sample| (level(power, starts, sample as f64) - base).max(0.0)).sum()
    };
    let split = by as usize;
    work(0..split) < work(split..length as usize)
}

/// Mean power at `after` samples after some starts, W.
fn level(power: &[f64], starts: &[f64], after: f64) -> f64 {
    let sampled: Vec<f64> = starts.iter().filter_map(|start| between(power, start + after)).collect();
    mean(&sampled)
}

/// Each value, averaged over its neighbours.
fn smoothed(values: &[f64], by: impl Fn(&mut [f64]) -> f64) -> Vec<f64> {
    let near =
        |index: usize| index.saturating_sub(SMOOTHED_MOVES)..(index + SMOOTHED_MOVES + 1).min(values.len());
    (0..values.len()).map(|index| by(&mut values[near(index)].to_vec())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const WIDTH: usize = 250;

    /// Frames with a rest of 8 to 12 samples of 0.1 W, a front end of `front` samples of 0.2 W, and draws of
    /// 1 to 1.5 W; and where each starts.
    fn frames(count: usize, front: impl Fn(usize) -> usize) -> (Vec<f64>, Vec<f64>) {
        let (mut power, mut starts) = (vec![1.0; 60], Vec::new());
        for frame in 0..count {
            power.extend(vec![0.1; 8 + frame * 7 % 5]);
            starts.push(power.len() as f64);
            power.extend(vec![0.2; front(frame)]);
            power.extend((0..300).map(|sample| 1.0 + f64::from(sample / 2 * 37 % 11) / 22.0));
        }
        power.iter_mut().enumerate().for_each(|(i, watts)| *watts += 1e-3 * ((i * 7919 % 97) as f64 / 97.0));
        (power, starts)
    }

    #[test]
    fn a_start_in_the_end_of_the_frame_before_is_moved_out_of_it() {
        // The front end was 20 samples at the mark and is 4 now: starts are 16 early, before the rest.
        let (power, right) = frames(60, |_| 4);
        let early: Vec<f64> = right.iter().map(|start| start - 16.0).collect();
        for (found, right) in refine_starts(&power, early, &[false; 60], 0.0, WIDTH).iter().zip(&right) {
            // Into the rest, of which all have the last 8 samples.
            assert!((-8.0..=0.0).contains(&(found - right)), "{found} for {right}");
        }
    }

    #[test]
    fn where_neighbours_agree_nothing_moves_and_marks_never_do() {
        let (power, right) = frames(40, |_| 20);
        assert_eq!(refine_starts(&power, right.clone(), &[false; 40], 0.0, WIDTH), right);
        let early: Vec<f64> = right.iter().map(|start| start - 11.0).collect();
        assert_eq!(refine_starts(&power, early.clone(), &[true; 40], 0.0, WIDTH), early);
    }

    #[test]
    fn what_a_start_is_the_mark_says_and_no_frame_beside_it_becomes_longer() {
        // Neighbours differ after every start, also after the marked one: moving all but that would make the frame before
        // it shorter and it longer by the move.
        let (power, right) = frames(60, |_| 4);
        let early: Vec<f64> = right.iter().map(|start| start - 16.0).collect();
        let mut marked = [false; 60];
        marked[30] = true;
        let found = refine_starts(&power, early.clone(), &marked, 0.0, WIDTH);
        assert_eq!(found[30], early[30]);
        for (found, early) in found.windows(2).zip(early.windows(2)) {
            let longer = (found[1] - found[0]) - (early[1] - early[0]);
            assert!(longer.abs() < 0.5, "{longer}");
        }
    }

    #[test]
    fn exact_equality_of_a_coarse_recorder_moves_nothing() {
        // Without noise some samples are equal to the last bit; those before them differ by less than what
        // matters.
        let power: Vec<f64> = (0..6000)
            .map(|i| match i % 300 {
                0..10 => 0.1 + 1e-4 * f64::from((i / 300) % 2),
                10..30 => 0.1,
                _ => 1.0,
            })
            .collect();
        let starts: Vec<f64> = (0..19).map(|i| f64::from(300 * i + 2)).collect();
        assert_eq!(refine_starts(&power, starts.clone(), &[false; 19], 0.0, WIDTH), starts);
    }

    #[test]
    fn few_starts_and_coarse_windows_are_left_alone() {
        let (power, right) = frames(1, |_| 20);
        assert_eq!(refine_starts(&power, right.clone(), &[false], 0.0, WIDTH), right);
        assert!(refine_starts(&power, Vec::new(), &[], 0.0, WIDTH).is_empty());
        let (power, right) = frames(20, |_| 4);
        let early: Vec<f64> = right.iter().map(|start| start - 11.0).collect();
        assert_eq!(refine_starts(&power, early.clone(), &[false; 20], 0.0, 8), early);
    }

    #[test]
    fn a_start_is_not_moved_past_a_frame_of_a_few_samples() {
        // Each frame works for seven samples, another amount each time, and is idle for long after it.
        let power: Vec<f64> = (0..40 * 600)
            .map(|i| {
                let work = if i % 600 < 7 { 2.0 + 0.3 * f64::from(i / 600 * 7 % 5) } else { 0.0 };
                0.5 + work + 1e-3 * f64::from(i * 79 % 97) / 97.0
            })
            .collect();
        let starts: Vec<f64> = (0..40).map(|frame| f64::from(600 * frame)).collect();
        assert_eq!(refine_starts(&power, starts.clone(), &[false; 40], 50.0, WIDTH), starts);
        let early: Vec<f64> = starts.iter().skip(1).map(|start| start - 50.0).collect();
        assert_eq!(refine_starts(&power, early.clone(), &[false; 39], 50.0, WIDTH), early);
    }

    proptest! {
        #[test]
        fn moves_go_on_and_no_farther_than_the_reach(
            power in proptest::collection::vec(0.0..9.0_f64, 400..600),
            gaps in proptest::collection::vec(5.0..40.0_f64, 1..20),
        ) {
            let starts: Vec<f64> = gaps.iter().scan(0.0, |at, gap| { *at += gap; Some(*at) }).collect();
            let found = refine_starts(&power, starts.clone(), &vec![false; starts.len()], 3.0, 100);
            for (found, start) in found.iter().zip(&starts) {
                prop_assert!((0.0..=12.0).contains(&(found - start)));
            }
        }
    }
}
