//! How even the beat of starts is, told from the gaps around each: what a start is found by need not be right, but what is wrong
//! seldom keeps time.

use crate::median::median;
use rayon::prelude::*;

/// How many gaps on either side tell what a usual one is here.
const AROUND: usize = 4;
/// Gaps a thread takes at once, at least.
const TASK: usize = 1024;
/// A gap is even if it differs from the usual one by less than this share of it.
const EVEN: f64 = 0.1;

/// Of each gap of `gaps`, the gaps around it: their median, and the median of how far they are from that. `None` where there are fewer
/// than two.
pub(super) fn usual(gaps: &[f64]) -> Vec<Option<[f64; 2]>> {
    let one = |index: usize| {
        let around = index.saturating_sub(AROUND)..gaps.len().min(index + AROUND + 1);
        let (mut held, mut count) = ([0.0; 2 * AROUND], 0);
        for other in around.filter(|&other| other != index) {
            held[count] = gaps[other];
            count += 1;
        }
        let around = &mut held[..count];
        if count < 2 {
            return None;
        }
        let usual = median(around);
        around.iter_mut().for_each(|gap| *gap = (*gap - usual).abs());
        Some([usual, median(around)])
    };
    (0..gaps.len()).into_par_iter().with_min_len(TASK).map(one).collect()
}

/// Whether each gap is as long as those around it: within a tenth, and within `most`.
pub(super) fn even(gaps: &[f64], most: f64) -> Vec<bool> {
    let fits = |(gap, usual): (&f64, Option<[f64; 2]>)| {
        usual.is_some_and(|[usual, _]| (gap - usual).abs() < (EVEN * usual).min(most))
    };
    gaps.iter().zip(usual(gaps)).map(fits).collect()
}

/// The sum of the even gaps.
pub(super) fn covered(gaps: &[f64]) -> f64 {
    gaps.iter().zip(even(gaps, f64::INFINITY)).filter(|(_, even)| *even).map(|(gap, _)| gap).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_step_keeps_the_beat_and_halves_that_alternate_do_not() {
        let step: Vec<f64> = [vec![10.0; 8], vec![14.0; 8]].concat();
        assert!(even(&step, f64::INFINITY).iter().filter(|even| !**even).count() <= 2);
        let halves: Vec<f64> = (0..16).map(|i| if i % 2 == 0 { 6.0 } else { 4.0 }).collect();
        assert!(even(&halves, f64::INFINITY).iter().filter(|even| **even).count() <= 8);
    }

    #[test]
    fn what_is_uneven_does_not_count_as_covered() {
        assert_eq!(covered(&[10.0, 10.5, 20.0, 10.0, 10.0, 9.9]), 50.4);
        assert_eq!((covered(&[]), covered(&[3.0, 3.0])), (0.0, 0.0));
    }

    #[test]
    fn a_bound_in_samples_is_kept() {
        assert_eq!(even(&[10.0, 10.0, 10.4, 10.0], 0.5), [true; 4]);
        assert_eq!(even(&[10.0, 10.0, 10.6, 10.0], 0.5), [true, true, false, true]);
    }
}
