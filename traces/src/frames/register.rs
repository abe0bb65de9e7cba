//! Registration of starts finer than a sample: each is aligned with its neighbours, and all alignments are
//! reconciled by least squares.
//!
//! Where content changes, the window of the marked frame is a poor reference, as draws after the start move.
//! Successive frames differ little, and least right after the start. So the shift of each frame against its
//! next few is measured around the start, and positions `x_i` are chosen to fit all shifts: minimize `sum
//! w_ij (x_j - x_i - s_ij)^2 + sum u (x_i - c_i)^2`, with `c_i` the position by template and marks fixed, by
//! Gauss-Seidel sweeps. An edge just at the end of the compared window enters some shifts only and pulls the
//! result by up to a quarter of a sample (a test shows it).
//!
//! *Refinement*: starts move to where neighbouring frames begin to agree. Frames are aligned by the power
//! after their start. If the part in between has become shorter since the mark (a front end with less to do),
//! a start at the distance of the mark lies in the end of the frame before. That end varies from frame to
//! frame, so neighbours differ there, and the energy from start to start varies with them. A start therefore
//! moves to the first sample from which on neighbours agree about as well as anywhere near. Starts that agree
//! already do not move; nor do starts at an edge, which each frame samples at another phase, nor up into more
//! power, as power falls at the end of a frame; nor past most of the work in the window, as a frame that is
//! busy for a few samples differs from its neighbours while it works, and agrees with them in the idle gap
//! after it.

use super::subsample::{ScaledSearch, between, nearest, vertex};
use crate::stats::{mean, moments, upper_median};
use rayon::prelude::*;

/// Distances, in frames, of the frames that each is aligned with. Near ones are most similar; far ones keep
/// errors from adding up along the trace.
const LAGS: [usize; 8] = [1, 2, 3, 4, 8, 16, 32, 64];
/// Largest shift tried, as a share of the window: at a clock step, a template fits best up to a sixth of its
/// length behind the start.
const MAX_SHIFT_SHARE: f64 = 0.12;
/// Lower limit of the largest shift, in samples.
const MIN_MAX_SHIFT_SAMPLES: usize = 6;
/// About the most shifts tried coarsely; then all those between the neighbours of the best one.
const MAX_COARSE_SHIFTS: usize = 64;
/// Shares of the window before and after the start that are compared.
const COMPARED_SHARES: [f64; 2] = [0.02, 0.2];
/// Fewest samples compared after the start, and half as many before, since the offset to be corrected may put
/// the edge there.
const MIN_COMPARED_SAMPLES: usize = 8;
/// Weight of a position by template, per squared sample.
const TEMPLATE_WEIGHT: f64 = 0.05;
/// A shift that leaves more than this share of the variance unexplained is not used.
const MAX_UNEXPLAINED: f64 = 0.7;
/// Gauss-Seidel sweeps.
const SWEEPS: usize = 200;

/// Largest lag, in frames, at which frames of different clocks are aligned.
const MAX_CLOCK_LAG: usize = 8;
/// Frames that leave more than this share of the variance unexplained may be at different clocks.
const POOR_UNEXPLAINED: f64 = 0.15;
/// They are, if scaling one in time leaves less than this share of that variance.
const MAX_SCALED_RATIO: f64 = 0.5;
/// The ratio of the clocks must differ from 1 by more than this.
const MIN_CLOCK_DEVIATION: f64 = 0.05;
/// Shares of the window before and after the start that are compared at different clocks, and the largest
/// shift.
const SCALED_SHARES: [f64; 3] = [0.04, 0.4, 0.24];

/// A measured shift of a later frame against an earlier one: with `m` the moves from their offsets,
/// `m_later = ratio m_earlier + shift`.
#[derive(Clone, Copy, Debug)]
struct Link {
    earlier: usize,
    later: usize,
    /// How much longer things take in the later frame: 1 unless the clock differs.
    ratio: f64,
    /// In samples.
    shift: f64,
    weight: f64,
}

/// Positions of windows, samples, from their offsets (in order). `anchor` is where in a window of `width`
/// samples the start is; windows for which `fixed` is true keep their offset.
pub(super) fn register(
    power: &[f64],
    offsets: &[usize],
    fixed: &[bool],
    anchor: usize,
    width: usize,
) -> Vec<f64> {
    let before = ((COMPARED_SHARES[0] * width as f64) as usize).max(MIN_COMPARED_SAMPLES / 2).min(anchor);
    let after = ((COMPARED_SHARES[1] * width as f64) as usize)
        .max(MIN_COMPARED_SAMPLES)
        .min(width - anchor.min(width - 1));
    let (skip, length) = (anchor - before, before + after);
    let reach = ((MAX_SHIFT_SHARE * width as f64) as usize).max(MIN_MAX_SHIFT_SAMPLES);
    let [scaled_before, scaled_after, scaled_reach] =
        SCALED_SHARES.map(|share| (share * width as f64) as usize);
    let search = &ScaledSearch::new(scaled_before, scaled_after, scaled_reach.max(MIN_MAX_SHIFT_SAMPLES));
    let of_frame = |earlier: usize| {
        let later = LAGS.into_iter().map(move |lag| earlier + lag).filter(|later| *later < offsets.len());
        later.filter_map(move |later| {
            let (ratio, shift, weight) = (later - earlier <= MAX_CLOCK_LAG)
                .then(|| {
                    scaled(power, [offsets[earlier], offsets[later]].map(|offset| offset + anchor), search)
                })
                .flatten()
                .or_else(|| shift(power, [offsets[earlier] + skip, offsets[later] + skip], length, reach))?;
            Some(Link { earlier, later, ratio, shift, weight })
        })
    };
    let links: Vec<Link> = (0..offsets.len()).into_par_iter().flat_map_iter(of_frame).collect();
    let most = (SCALED_SHARES[2] * width as f64).max(reach as f64);
    let moves = reconcile(&links, fixed, most);
    offsets.iter().zip(moves).map(|(&offset, by)| offset as f64 + by).collect()
}

/// Ratio, shift and its inverse variance where two frames, by their starts, are clearly at different clocks.
fn scaled(power: &[f64], starts: [usize; 2], search: &ScaledSearch) -> Option<(f64, f64, f64)> {
    let plain = search.unscaled(power, starts)?;
    let fit = (plain.unexplained > POOR_UNEXPLAINED).then(|| search.best(power, starts)).flatten()?;
    let clear = fit.unexplained < MAX_SCALED_RATIO * plain.unexplained
        && (fit.ratio - 1.0).abs() > MIN_CLOCK_DEVIATION;
    let variance = 2.0 * fit.unexplained / search.width() as f64 / fit.curvature + 1.0;
    clear.then_some((fit.ratio, fit.shift, 1.0 / variance))
}

/// How much later than at `b` the segment at `a` is found again, in samples, and the inverse variance of
/// that; after a ratio of 1.
fn shift(power: &[f64], [a, b]: [usize; 2], length: usize, reach: usize) -> Option<(f64, f64, f64)> {
    let template = power.get(a..a + length)?;
    let from = b.checked_sub(reach)?;
    let segment = power.get(from..b + reach + length)?;
    let residual = |shift: usize| unexplained(&segment[shift..shift + length], template);
    let last = 2 * reach - 1;
    let at = nearest(1..=last, (last - 1).div_ceil(MAX_COARSE_SHIFTS).max(1), residual);
    let [left, middle, right] = [at - 1, at, at + 1].map(residual);
    let curvature = left - 2.0 * middle + right;
    if middle > left.min(right)
        || curvature <= 0.0
        || middle > MAX_UNEXPLAINED * unexplained(template, &vec![0.0; length])
    {
        return None;
    }
    // Of a parabola `c d^2 / 2` with noise of variance v a sample in each segment, the vertex has about
    // variance 2 v / c; the floor is the parabola's own error on sharp edges.
    let variance = 2.0 * middle / length as f64 / curvature + 0.01;
    Some((1.0, at as f64 - reach as f64 + vertex(left, middle, right), 1.0 / variance))
}

/// Summed squared difference of two segments beyond their difference in mean.
fn unexplained(a: &[f64], b: &[f64]) -> f64 {
    let (mut sum, mut squares) = (0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        sum += x - y;
        squares += (x - y) * (x - y);
    }
    squares - sum * sum / a.len() as f64
}

/// The moves that fit all links best.
fn reconcile(links: &[Link], fixed: &[bool], reach: f64) -> Vec<f64> {
    let mut of = vec![Vec::new(); fixed.len()];
    for link in links {
        let Link { ratio, shift, weight, .. } = *link;
        of[link.later].push((link.earlier, ratio, shift, weight));
        of[link.earlier].push((link.later, 1.0 / ratio, -shift / ratio, weight * ratio * ratio));
    }
    let mut moves = vec![0.0_f64; fixed.len()];
    for _ in 0..SWEEPS {
        let mut largest = 0.0_f64;
        for node in (0..fixed.len()).filter(|&node| !fixed[node]) {
            let (mut sum, mut weights) = (0.0, TEMPLATE_WEIGHT);
            for &(other, ratio, shift, weight) in &of[node] {
                sum += weight * (ratio * moves[other] + shift);
                weights += weight;
            }
            largest = largest.max((sum / weights - moves[node]).abs());
            moves[node] = sum / weights;
        }
        if largest < 1e-4 {
            break;
        }
    }
    moves.iter().map(|by| by.clamp(-reach, reach)).collect()
}

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

    /// Box samples of pulses of `length` samples and height `height(i)` at `at`, on 1 W.
    fn pulses(at: &[f64], length: f64, samples: usize) -> Vec<f64> {
        let covered = |x: f64, a: f64| (x.min(a + length) - a).max(0.0);
        (0..samples)
            .map(|i| 1.0 + at.iter().map(|&a| covered(i as f64 + 1.0, a) - covered(i as f64, a)).sum::<f64>())
            .collect()
    }

    /// The worst deviation from the mean error over pulses of `length` samples off the grid, one of them
    /// fixed.
    fn worst_error(length: f64) -> f64 {
        let at: Vec<f64> = (0..30).map(|i| 50.0 + 80.37 * f64::from(i)).collect();
        let power = pulses(&at, length, 2600);
        let offsets: Vec<usize> =
            at.iter().enumerate().map(|(i, a)| a.round() as usize - 10 + i % 3 - 1).collect();
        let mut fixed = vec![false; 30];
        fixed[12] = true;
        let found = register(&power, &offsets, &fixed, 10, 60);
        assert_eq!(found[12], offsets[12] as f64);
        let errors: Vec<f64> = found.iter().zip(&at).map(|(position, at)| position - at).collect();
        let free: Vec<f64> = (0..30).filter(|i| *i != 12).map(|i| errors[i]).collect();
        let mean = free.iter().sum::<f64>() / 29.0;
        free.iter().map(|error| (error - mean).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn analytic_one_sharp_edge_is_found_as_well_as_by_one_alignment() {
        // A single alignment is off by up to 0.13 of a sample (`refine`); errors do not add up over the
        // links.
        assert!(worst_error(30.0) < 0.13, "{}", worst_error(30.0));
    }

    #[test]
    fn known_limit_a_second_edge_at_the_end_of_the_window_costs_up_to_a_quarter_of_a_sample() {
        // The segment compared ends 12 samples after the start; an edge there enters at some shifts only.
        assert!(worst_error(13.4) < 0.25, "{}", worst_error(13.4));
    }

    #[test]
    fn a_window_off_by_a_tenth_of_itself_is_brought_back() {
        // 15 of 60 frames were found 20 of 250 samples late, as after a clock step; links across its ends
        // show it.
        let at: Vec<f64> = (0..60).map(|i| 100.0 + 400.37 * f64::from(i)).collect();
        let draws: Vec<f64> = at.iter().flat_map(|a| [a + 27.0, a + 58.0]).collect();
        let (frames, draws) = (pulses(&at, 90.0, 24_400), pulses(&draws, 9.0, 24_400));
        let power: Vec<f64> = frames.iter().zip(&draws).map(|(frame, draw)| frame + 0.5 * draw).collect();
        let late = |i: usize| if (20..35).contains(&i) { 20 } else { 0 };
        let offsets: Vec<usize> =
            at.iter().enumerate().map(|(i, a)| a.round() as usize - 50 + late(i)).collect();
        let mut fixed = vec![false; 60];
        fixed[5] = true;
        let found = register(&power, &offsets, &fixed, 50, 250);
        let worst = found.iter().zip(&at).map(|(f, a)| (f - (a - 50.0)).abs()).fold(0.0, f64::max);
        let errors: Vec<f64> = found.iter().zip(&at).map(|(f, a)| (f - (a - 50.0)).round()).collect();
        assert!(worst < 1.0, "{errors:?}");
    }

    #[test]
    fn steady_power_moves_nothing() {
        assert_eq!(register(&[1.0; 400], &[50, 150, 250], &[false; 3], 10, 50), [50.0, 150.0, 250.0]);
    }

    #[test]
    fn stretches_at_the_ends_are_left_where_they_are() {
        assert_eq!(register(&[1.0; 60], &[0, 10], &[false; 2], 10, 50), [0.0, 10.0]);
        assert!(register(&[], &[], &[], 10, 50).is_empty());
    }

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
        // Neighbours differ after every start, also after the marked one: moving all but that would make the
        // frame before it shorter and it longer by the move.
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
