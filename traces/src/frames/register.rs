//! Registration of starts finer than a sample: each is aligned with its neighbours, and all alignments are
//! reconciled by least squares.
//!
//! Where content changes, the window of the marked frame is a poor reference, as draws after the start move. Successive
//! frames differ little, and least right after the start. So the shift of each frame against its next few is measured
//! around the start, and positions `x_i` are chosen to fit all shifts: minimize
//! `sum w_ij (x_j - x_i - s_ij)^2 + sum u (x_i - c_i)^2`, with `c_i` the position by template and marks fixed, by Gauss-Seidel
//! sweeps. An edge just at the end of the compared window enters some shifts only and pulls the result by up to a quarter of
//! a sample (a test shows it).

use super::subsample::{ScaledPair, nearest, vertex};
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
    let of_frame = |earlier: usize| {
        let later = LAGS.into_iter().map(move |lag| earlier + lag).filter(|later| *later < offsets.len());
        later.filter_map(move |later| {
            let (ratio, shift, weight) = (later - earlier <= MAX_CLOCK_LAG)
                .then(|| scaled(power, [offsets[earlier], offsets[later]], anchor, width))
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

/// Ratio, shift and its inverse variance where two frames, by the offsets of their windows, are clearly at
/// different clocks.
fn scaled(power: &[f64], offsets: [usize; 2], anchor: usize, width: usize) -> Option<(f64, f64, f64)> {
    let [before, after, reach] = SCALED_SHARES.map(|share| (share * width as f64) as usize);
    let starts = offsets.map(|offset| offset + anchor);
    let pair = ScaledPair { power, starts, before, after, reach: reach.max(MIN_MAX_SHIFT_SAMPLES) };
    let plain = pair.unscaled()?;
    let fit = (plain.unexplained > POOR_UNEXPLAINED).then(|| pair.best()).flatten()?;
    let clear = fit.unexplained < MAX_SCALED_RATIO * plain.unexplained
        && (fit.ratio - 1.0).abs() > MIN_CLOCK_DEVIATION;
    let variance = 2.0 * fit.unexplained / (before + after) as f64 / fit.curvature + 1.0;
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
