//! A first guess of the period and of some starts, from the distances to the marked windows alone.

use super::bank::Bank;
use crate::frames::minima::spaced_minima;
use crate::frames::regularity::regularity;
use crate::frames::split::{Split, otsu_tree};
use crate::median::median;

/// How far around a mark, in windows.
const REACH_WINDOWS: usize = 200;
/// Minima are evenly spaced by construction; starts must be farther apart than that, by this factor.
const SPARSER: f64 = 1.3;
/// What is nearer than this share of the median minimum may be told apart after all: at coarse rates half a sample is much.
const FAR_BELOW: f64 = 0.1;
/// How much a separation, capped at 5, counts beside regularity.
const SEPARATION_SHARE: f64 = 0.1;

/// The period in samples and the starts of that split of the minima, by either measure, that leaves the most even beat.
pub(super) fn first(bank: &Bank, spacing: usize, marks: &[usize]) -> (usize, Vec<usize>) {
    let mut best = (f64::NEG_INFINITY, 2 * spacing, marks.to_vec());
    for profile in [&bank.shape, &bank.squares_w2] {
        let reach = 2 * spacing * REACH_WINDOWS;
        let mut minima = spaced_minima(profile, spacing);
        minima.retain(|offset| marks.iter().any(|mark| mark.abs_diff(*offset) <= reach));
        let usual = median_gap(&minima).unwrap_or(spacing) as f64;
        let span = minima.last().zip(minima.first()).map_or(0, |(last, first)| last - first);
        let mut among: Vec<f64> = minima.iter().map(|&offset| profile[offset]).collect();
        let least = half_a_sample(profile, marks).min(FAR_BELOW * median(&mut among)).max(1e-12);
        let mut logs: Vec<f64> = minima
            .iter()
            .filter(|offset| !marks.contains(offset))
            .map(|&offset| libm::log(profile[offset].max(least)))
            .collect();
        logs.sort_by(f64::total_cmp);
        for split in otsu_tree(&logs, 3) {
            let threshold = libm::exp(0.5 * (logs[split.count - 1] + logs[split.count]));
            let starts: Vec<usize> =
                minima.iter().copied().filter(|&offset| profile[offset] < threshold).collect();
            let Some(gap) = median_gap(&starts) else { continue };
            // As dense as minima are anyway: only if there is nothing else, as where frames are shorter than the window.
            let dense = if (gap as f64) < SPARSER * usual { 10.0 } else { 0.0 };
            let value = regularity(&starts, span) + SEPARATION_SHARE * separation(&split).min(5.0) - dense;
            if value > best.0 {
                best = (value, gap, starts);
            }
        }
    }
    (best.1, best.2)
}

/// What a match half a sample off leaves: a quarter of what a whole one does. Nearer ones are not told apart, or else, where a few
/// periods are a whole number of samples, only every so many frames would seem to match.
fn half_a_sample(profile: &[f64], marks: &[usize]) -> f64 {
    let beside = |mark: &usize| [mark.checked_sub(1), Some(mark + 1)];
    let values = marks.iter().flat_map(beside).flatten().filter_map(|offset| profile.get(offset));
    0.25 * values.fold(0.0, |most, &value| f64::max(most, value))
}

fn separation(split: &Split) -> f64 {
    (split.high.mean - split.low.mean) / (split.low.deviation + split.high.deviation).max(1e-3)
}

/// The (upper) median distance of neighbours; `None` for fewer than two.
pub(super) fn median_gap(offsets: &[usize]) -> Option<usize> {
    let mut gaps: Vec<usize> = offsets.windows(2).map(|pair| pair[1] - pair[0]).collect();
    gaps.sort_unstable();
    gaps.get(gaps.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_sample_off_is_four_times_half_of_one() {
        let profile = [9.0, 4.0, 0.0, 8.0, 9.0, 0.0];
        assert_eq!(half_a_sample(&profile, &[2]), 2.0);
        assert_eq!((half_a_sample(&profile, &[5]), half_a_sample(&profile, &[])), (2.25, 0.0));
    }

    #[test]
    fn the_median_gap_of_few_is_none() {
        assert_eq!((median_gap(&[]), median_gap(&[5]), median_gap(&[5, 8, 20, 24])), (None, None, Some(4)));
    }
}
