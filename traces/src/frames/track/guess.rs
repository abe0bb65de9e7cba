//! A first guess of the period and of some starts, from the distances to the marked windows alone.

use super::templates::Templates;
use crate::frames::periodicity::regularity;
use crate::frames::profile::spaced_minima;
use crate::frames::threshold::{Split, otsu_tree};
use crate::stats::upper_median;

/// How far around a mark the first guess looks, in windows.
const REACH_WINDOWS: usize = 200;
/// Minima are evenly spaced by construction; starts must be farther apart by at least this factor.
const MIN_SPARSENESS: f64 = 1.3;
/// Minima below this share of the median minimum may be starts after all: at coarse rates half a sample is
/// much.
const MAX_NEAR_SHARE: f64 = 0.1;
/// Most frames that a gap of the first guess may hold.
const MAX_FRAMES_PER_GAP: usize = 5;
/// Weight of a separation, capped at 5, beside regularity.
const SEPARATION_WEIGHT: f64 = 0.1;

/// The period in samples and the starts by that split of the minima, by either measure, that is most even.
pub(super) fn first(templates: &Templates, spacing: usize, marks: &[usize]) -> (usize, Vec<usize>) {
    let mut best = (f64::NEG_INFINITY, 2 * spacing, marks.to_vec());
    let mut by = &templates.shape;
    for profile in [&templates.shape, &templates.squares_w2] {
        let reach = 2 * spacing * REACH_WINDOWS;
        let mut minima = spaced_minima(profile, spacing);
        minima.retain(|offset| marks.iter().any(|mark| mark.abs_diff(*offset) <= reach));
        let usual = median_gap(&minima).unwrap_or(spacing) as f64;
        let span = minima.last().zip(minima.first()).map_or(0, |(last, first)| last - first);
        let mut among: Vec<f64> = minima.iter().map(|&offset| profile[offset]).collect();
        let least = half_a_sample(profile, marks).min(MAX_NEAR_SHARE * upper_median(&mut among)).max(1e-12);
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
            // As dense as minima are anyway: only if there is nothing else, as where frames are shorter than
            // the window.
            let dense = if (gap as f64) < MIN_SPARSENESS * usual { 10.0 } else { 0.0 };
            let value = regularity(&starts, span) + SEPARATION_WEIGHT * separation(&split).min(5.0) - dense;
            if value > best.0 {
                (best, by) = ((value, gap, starts), profile);
            }
        }
    }
    let (_, period, starts) = best;
    match (2..=MAX_FRAMES_PER_GAP)
        .rev()
        .find_map(|parts| between(by, &starts, [period, spacing], parts, marks))
    {
        Some(starts) => (median_gap(&starts).unwrap_or(period), starts),
        None => (period, starts),
    }
}

/// The starts and those between them, where what divides every gap of a period into so many equal parts
/// resembles the mark as well as half a sample and noise let anything: of V-synchronized frames whose period
/// is no whole number of samples, only some fall on the mark's place between samples, and they have a period
/// of their own.
fn between(
    profile: &[f64],
    starts: &[usize],
    [period, spacing]: [usize; 2],
    parts: usize,
    marks: &[usize],
) -> Option<Vec<usize>> {
    if period / parts <= spacing {
        return None;
    }
    let even = |pair: &&[usize]| (pair[1] - pair[0]).abs_diff(period) <= 1;
    let divided = |pair: &[usize]| -> Vec<usize> {
        let (from, gap) = (pair[0], pair[1] - pair[0]);
        (1..parts).map(|part| lowest_beside(profile, from + (gap * part + parts / 2) / parts)).collect()
    };
    if starts.windows(2).filter(even).count() * 10 < starts.len() * 9 {
        return None;
    }
    let more: Vec<usize> = starts.windows(2).filter(even).flat_map(divided).collect();
    // At edges half a sample leaves half of what a whole one does. Parts of whole samples would fall on the
    // mark's place, too.
    let off = if period.is_multiple_of(parts) { 1.0 } else { 2.0 } * half_a_sample(profile, marks);
    // Noise leaves as much of them as of the starts.
    let usual = |offsets: &[usize]| {
        upper_median(&mut offsets.iter().map(|&offset| profile[offset]).collect::<Vec<_>>())
    };
    if more.is_empty() || usual(&more) > off + usual(starts) {
        return None;
    }
    let mut all = [starts, &more].concat();
    all.sort_unstable();
    Some(all)
}

/// The lowest of an offset and its two neighbours.
fn lowest_beside(profile: &[f64], offset: usize) -> usize {
    let three = offset.saturating_sub(1)..(offset + 2).min(profile.len());
    three.min_by(|a, b| profile[*a].total_cmp(&profile[*b])).unwrap_or(offset)
}

/// Distance of a match half a sample off: a quarter of that of a whole one. Nearer ones count as equal, or
/// else, where a few periods are a whole number of samples, only one in several frames would seem to match.
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

    #[test]
    fn frames_between_those_that_fall_on_the_marks_place_between_samples_are_seen() {
        // A period of 33 1/3 samples: every third start is nearest to the mark, the others a third of a
        // sample off.
        let near = |offset: f64| {
            let phase = (offset / (100.0 / 3.0)).fract();
            let off = phase.min(1.0 - phase) * (100.0 / 3.0);
            (off * off).min(9.0)
        };
        let profile: Vec<f64> = (0..2000).map(|offset| near(f64::from(offset))).collect();
        let thirds: Vec<usize> = (0..19).map(|k| 100 * k).collect();
        let all = between(&profile, &thirds, [100, 10], 3, &[500]).unwrap();
        assert_eq!((all.len(), &all[..4]), (55, &[0, 33, 67, 100][..]));
        assert_eq!(between(&profile, &thirds, [100, 10], 2, &[500]), None);
        assert_eq!(between(&profile, &thirds, [100, 40], 3, &[500]), None);
    }
}
