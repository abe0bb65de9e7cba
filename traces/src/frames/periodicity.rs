//! Periodicity: how regular the gaps between starts are. Wrong starts rarely keep the period.

use super::profile::normalized;
use crate::stats::{moments, upper_median};
use rayon::prelude::*;

/// Gaps on either side that give the usual gap.
const NEIGHBOUR_GAPS: usize = 4;
/// Fewest gaps a thread works on at once.
const MIN_TASK_GAPS: usize = 1024;
/// Largest deviation of an even gap from the usual one, as a share of that.
const MAX_EVEN_DEVIATION: f64 = 0.1;

/// For each gap, the median of its neighbours and their median deviation from it. `None` for fewer than two
/// neighbours.
pub(super) fn usual_gaps(gaps: &[f64]) -> Vec<Option<[f64; 2]>> {
    let one = |index: usize| {
        let around = index.saturating_sub(NEIGHBOUR_GAPS)..gaps.len().min(index + NEIGHBOUR_GAPS + 1);
        let (mut held, mut count) = ([0.0; 2 * NEIGHBOUR_GAPS], 0);
        for other in around.filter(|&other| other != index) {
            held[count] = gaps[other];
            count += 1;
        }
        let around = &mut held[..count];
        if count < 2 {
            return None;
        }
        let usual = upper_median(around);
        around.iter_mut().for_each(|gap| *gap = (*gap - usual).abs());
        Some([usual, upper_median(around)])
    };
    (0..gaps.len()).into_par_iter().with_min_len(MIN_TASK_GAPS).map(one).collect()
}

/// Whether each gap is as long as its neighbours: within a tenth, and within `max_deviation`.
pub(super) fn even_gaps(gaps: &[f64], max_deviation: f64) -> Vec<bool> {
    let fits = |(gap, usual): (&f64, Option<[f64; 2]>)| {
        usual.is_some_and(|[usual, _]| (gap - usual).abs() < (MAX_EVEN_DEVIATION * usual).min(max_deviation))
    };
    gaps.iter().zip(usual_gaps(gaps)).map(fits).collect()
}

/// The sum of the even gaps.
pub(super) fn even_coverage(gaps: &[f64]) -> f64 {
    gaps.iter().zip(even_gaps(gaps, f64::INFINITY)).filter(|(_, even)| *even).map(|(gap, _)| gap).sum()
}

/// Ratios to the median gap between which a gap is regular.
const REGULAR_RATIOS: [f64; 2] = [0.6, 1.6];
/// Fewest gaps whose regularity means anything.
const MIN_GAPS: usize = 4;

/// The share of `span` that lies between neighbours at a regular distance: 1 if all of it is evenly divided,
/// less where starts are missing (their gap is long), false (short), or absent at the ends. 0 if there are
/// too few. Offsets in samples, sorted.
pub(crate) fn regularity(offsets: &[usize], span: usize) -> f64 {
    let gaps: Vec<usize> = offsets.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if gaps.len() < MIN_GAPS || span == 0 {
        return 0.0;
    }
    let mut others = gaps.clone();
    let median = *others.select_nth_unstable(gaps.len() / 2).1 as f64;
    let regular =
        |gap: &&usize| (REGULAR_RATIOS[0] * median..=REGULAR_RATIOS[1] * median).contains(&(**gap as f64));
    gaps.iter().filter(regular).sum::<usize>() as f64 / span as f64
}

/// Greatest lag of a repetition, samples.
const MAX_LAG_SAMPLES: usize = 1 << 15;
/// The first of all peaks at least this share of the highest is the repetition (McLeod and Wyvill 2005, who take 0.8 to 1).
const FIRST_PEAK_SHARE: f64 = 0.9;
/// Least correlation of a repetition: half of the variance.
const MIN_REPETITION: f64 = 0.5;

/// After how many samples power repeats itself in the middle of a trace, whatever frames are: the first high peak of its
/// autocorrelation (McLeod and Wyvill, *A Smarter Way to Find Pitch*, 2005). `None` where none is high.
pub(crate) fn repetition_samples(power: &[f64]) -> Option<usize> {
    let lags = (power.len() / 2).min(MAX_LAG_SAMPLES);
    let from = power.len() / 2 - lags;
    let segment = &power[from..from + 2 * lags];
    let deviation = moments(&segment[..lags]).deviation;
    let most = 2.0 * lags as f64 * deviation * deviation;
    let profile = normalized(segment, &segment[..lags]);
    let similarity = |distance: &f64| 1.0 - distance / most.max(f64::MIN_POSITIVE);
    let correlation: Vec<f64> = profile.iter().map(similarity).collect();
    // A peak is the highest of its positive segment; that around no lag at all does not count.
    let mut lag = correlation.iter().position(|r| *r < 0.0)?;
    let mut peaks: Vec<(usize, f64)> = Vec::new();
    for part in correlation[lag..].chunk_by(|a, b| (*a < 0.0) == (*b < 0.0)) {
        let highest = part.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        peaks.extend(highest.map(|(place, r)| (lag + place, r)));
        lag += part.len();
    }
    let highest = peaks.iter().map(|(_, r)| *r).fold(MIN_REPETITION / FIRST_PEAK_SHARE, f64::max);
    peaks.into_iter().find(|(_, r)| *r >= FIRST_PEAK_SHARE * highest).map(|(lag, _)| lag)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn power_repeats_after_a_frame_and_noise_never_does() {
        let random = Random::new(3, 0);
        let frames = |gap: usize| -> Vec<f64> {
            let watts = |i: usize| {
                1.0 + [4.0, 1.0, 3.0, 0.0, 0.0][i % gap * 5 / gap] + 0.2 * random.normals(i as u64).0
            };
            (0..20_000).map(watts).collect()
        };
        for gap in [40, 333, 1000] {
            let found = repetition_samples(&frames(gap)).unwrap();
            assert!(found.abs_diff(gap) <= 1, "{found} for {gap}");
        }
        let noise: Vec<f64> = (0..20_000).map(|i| random.normals(i).0).collect();
        assert_eq!(repetition_samples(&noise), None);
        assert_eq!((repetition_samples(&[]), repetition_samples(&[1.0; 500])), (None, None));
    }

    #[test]
    fn gaps_stay_even_at_a_clock_step_and_those_of_alternating_halves_are_not() {
        let step: Vec<f64> = [vec![10.0; 8], vec![14.0; 8]].concat();
        assert!(even_gaps(&step, f64::INFINITY).iter().filter(|even| !**even).count() <= 2);
        let halves: Vec<f64> = (0..16).map(|i| if i % 2 == 0 { 6.0 } else { 4.0 }).collect();
        assert!(even_gaps(&halves, f64::INFINITY).iter().filter(|even| **even).count() <= 8);
    }

    #[test]
    fn what_is_uneven_does_not_count_as_covered() {
        assert_eq!(even_coverage(&[10.0, 10.5, 20.0, 10.0, 10.0, 9.9]), 50.4);
        assert_eq!((even_coverage(&[]), even_coverage(&[3.0, 3.0])), (0.0, 0.0));
    }

    #[test]
    fn a_bound_in_samples_is_kept() {
        assert_eq!(even_gaps(&[10.0, 10.0, 10.4, 10.0], 0.5), [true; 4]);
        assert_eq!(even_gaps(&[10.0, 10.0, 10.6, 10.0], 0.5), [true, true, false, true]);
    }

    #[test]
    fn missing_and_false_starts_cost_their_time() {
        let even: Vec<usize> = (0..11).map(|i| i * 100).collect();
        assert_eq!(regularity(&even, 1000), 1.0);
        let missing: Vec<usize> = even.iter().copied().filter(|&o| o != 300).collect();
        assert_eq!(regularity(&missing, 1000), 0.8);
        let mut extra = even.clone();
        extra.insert(4, 330);
        assert_eq!(regularity(&extra, 1000), 0.97);
        assert_eq!(regularity(&even[..4], 1000), 0.0);
    }
}
