//! A first guess of the period and of some starts, from the distances to the marked windows alone.

use super::bank::Bank;
use crate::frames::minima::spaced_minima;
use crate::frames::regularity::regularity;
use crate::frames::split::{Split, otsu_tree};

/// How far around a mark, in windows.
const REACH_WINDOWS: usize = 200;
/// Minima are evenly spaced by construction; starts must be farther apart than that, by this factor.
const SPARSER: f64 = 1.3;
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
        let mut logs: Vec<f64> = minima
            .iter()
            .filter(|offset| !marks.contains(offset))
            .map(|&offset| libm::log(profile[offset].max(1e-12)))
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
    fn the_median_gap_of_few_is_none() {
        assert_eq!((median_gap(&[]), median_gap(&[5]), median_gap(&[5, 8, 20, 24])), (None, None, Some(4)));
    }
}
