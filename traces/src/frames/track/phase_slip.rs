//! Phase slips: past a place where the sequence may have slipped to another phase of the frame, confidence is
//! lower.

use crate::frames::SLIPPED_CONFIDENCE;

/// Ratios of gaps of the same period.
const SAME_RATIOS: [f64; 2] = [0.92, 1.085];
/// Ratios of gaps beyond which the later one is odd.
const ODD_RATIOS: [f64; 2] = [0.887, 1.13];
/// Two gaps in one (a missed start) are no phase slip if they are as long as two, within this share.
const MAX_DOUBLE_DEVIATION: f64 = 0.1;

/// Whether the period goes on as before after one odd gap that is not two periods. A clock step would change
/// it for longer.
pub(super) fn slip(before: f64, between: f64, after: f64) -> bool {
    let ratio = between / before;
    !within(ratio, ODD_RATIOS)
        && (ratio - 2.0).abs() > MAX_DOUBLE_DEVIATION
        && within(after / before, SAME_RATIOS)
}

/// Confidence factors of starts: lower by each slip between a start and the nearest `known` place, and if
/// that place is itself off the period of its neighbours, or was corrected beyond a slip from the nearest of
/// `marks`. A slip does not show which of its sides is in the right phase, so it counts on this side, too,
/// back to where the clock stepped, as the phase may have been lost there. Without marks all factors are 1.
pub(super) fn confidence_factors(offsets: &[usize], marks: &[usize], known: &[usize]) -> Vec<f64> {
    let sequence = GapSequence::new(offsets);
    let among = |places: &[usize]| -> Vec<usize> {
        places.iter().filter_map(|place| offsets.binary_search(place).ok()).collect()
    };
    let (marks, known) = (among(marks), among(known));
    let nearest = |places: &[usize], start: usize| places.iter().copied().min_by_key(|p| p.abs_diff(start));
    let uncertainty = |place: usize| {
        let beyond = nearest(&marks, place).is_some_and(|mark| {
            sequence.slips_between(place, mark) > 0 || sequence.may_have_been_lost(place, mark)
        });
        usize::from(off_period(&sequence.gaps, place)) + usize::from(beyond)
    };
    let of_start = |start: usize| {
        nearest(&known, start).map_or(1.0, |place| {
            let slips = sequence.slips_between(start, place) + uncertainty(place);
            let lost = slips == 0 && sequence.may_have_been_lost(start, place);
            libm::pow(SLIPPED_CONFIDENCE, (slips + usize::from(lost)) as f64)
        })
    };
    (0..offsets.len()).map(of_start).collect()
}

/// The gaps between starts, and the breaks of their period.
struct GapSequence {
    gaps: Vec<f64>,
    /// How many slips, and how many clock steps, lie before each start.
    slips: Vec<usize>,
    steps: Vec<usize>,
    /// Whether a slip lies between each two steps.
    slipped: Vec<bool>,
}

impl GapSequence {
    fn new(offsets: &[usize]) -> Self {
        let gaps: Vec<f64> = offsets.windows(2).map(|two| (two[1] - two[0]) as f64).collect();
        let count = |breaks: &dyn Fn(&[f64]) -> bool| -> Vec<usize> {
            let count = |count: &mut usize, index: usize| {
                *count += usize::from(gaps.get(..=index).is_some_and(breaks));
                Some(*count)
            };
            (0..offsets.len()).scan(0, count).collect()
        };
        let slips = count(&|gaps| slipped(gaps) || step_slipped(gaps));
        let steps = count(&|gaps| step(gaps).is_some());
        let mut slipped = vec![false; steps.last().map_or(0, |last| last + 1)];
        for start in 1..slips.len() {
            if slips[start] > slips[start - 1] {
                slipped[steps[start - 1]] = true;
                slipped[steps[start]] = true;
            }
        }
        Self { gaps, slips, steps, slipped }
    }

    fn slips_between(&self, a: usize, b: usize) -> usize {
        self.slips[a].abs_diff(self.slips[b])
    }

    /// Whether the clock stepped between a start and a place, and the sequence around the start slips.
    fn may_have_been_lost(&self, start: usize, place: usize) -> bool {
        self.steps[start] != self.steps[place] && self.slipped[self.steps[start]]
    }
}

/// The periods before and after the third last of these gaps, if the clock steps in it.
fn step(gaps: &[f64]) -> Option<[f64; 2]> {
    let same = |a: f64, b: f64| within(b / a, SAME_RATIOS);
    match *gaps {
        [.., a, b, _, c, d] if same(a, b) && same(c, d) && !same(b, c) && !whole(c / b) => Some([b, c]),
        _ => None,
    }
}

/// Whether the frame in which the clock steps is too short or too long for one frame of either period, and
/// for two.
fn step_slipped(gaps: &[f64]) -> bool {
    let Some([before, after]) = step(gaps) else { return false };
    let between = gaps[gaps.len() - 3];
    let (least, most) = (before.min(after), before.max(after));
    let outside =
        |frames: f64| !(ODD_RATIOS[0] * frames * least..ODD_RATIOS[1] * frames * most).contains(&between);
    outside(1.0) && outside(2.0)
}

/// Whether the last of these gaps resumes the period from before one odd gap, or two, in another phase.
fn slipped(gaps: &[f64]) -> bool {
    match *gaps {
        [.., before, between, after] if slip(before, between, after) => true,
        [.., before, one, two, after] => {
            let odd = |gap: f64| !within(gap / before, ODD_RATIOS);
            odd(one) && odd(two) && within(after / before, SAME_RATIOS) && !whole((one + two) / before)
        }
        _ => false,
    }
}

/// Whether a start lies between two starts of the same phase, but off the period: then either it or all
/// others are wrong.
fn off_period(gaps: &[f64], start: usize) -> bool {
    let Some(&[before, one, two, after]) = start.checked_sub(2).and_then(|from| gaps.get(from..from + 4))
    else {
        return false;
    };
    let odd = |gap: f64| !within(gap / before, ODD_RATIOS) && !whole(gap / before);
    within(after / before, SAME_RATIOS) && odd(one) && odd(two)
}

fn within(ratio: f64, [low, high]: [f64; 2]) -> bool {
    ratio > low && ratio < high
}

/// Whether a number of periods is whole.
fn whole(periods: f64) -> bool {
    (periods - libm::round(periods)).abs() < MAX_DOUBLE_DEVIATION
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_odd_gap_in_an_even_beat_is_a_slip_and_a_missed_start_or_a_clock_step_is_none() {
        assert!(slip(100.0, 140.0, 101.0) && slip(100.0, 60.0, 100.0));
        assert!(!slip(100.0, 200.0, 100.0) && !slip(100.0, 104.0, 100.0) && !slip(100.0, 120.0, 140.0));
    }

    #[test]
    fn a_frame_in_which_the_clock_steps_lasts_between_the_beats_or_is_a_slip() {
        let slipped =
            |before: f64, between: f64, after: f64| step_slipped(&[before, before, between, after, after]);
        assert!(slipped(144.0, 107.0, 187.0) && slipped(187.0, 240.0, 144.0));
        assert!(!slipped(144.0, 160.0, 187.0) && !slipped(187.0, 150.0, 144.0));
        // A start was missed where the clock stepped; a steady period is no slip, nor is a single start off
        // the period.
        assert!(!slipped(144.0, 330.0, 187.0) && !slipped(100.0, 60.0, 100.0));
        assert!(!step_slipped(&[100.0, 130.0, 70.0, 100.0, 100.0]));
        assert_eq!(
            confidence_factors(&[0, 144, 288, 395, 582, 769], &[0], &[0]),
            [1.0, 1.0, 1.0, 1.0, SLIPPED_CONFIDENCE, SLIPPED_CONFIDENCE]
        );
    }

    #[test]
    fn confidence_is_low_on_the_far_side_of_the_slip() {
        let offsets = [0, 100, 200, 300, 450, 550, 650];
        assert_eq!(
            confidence_factors(&offsets, &[100], &[100]),
            [1.0, 1.0, 1.0, 1.0, SLIPPED_CONFIDENCE, SLIPPED_CONFIDENCE, SLIPPED_CONFIDENCE]
        );
        assert_eq!(
            confidence_factors(&offsets, &[650], &[650]),
            [SLIPPED_CONFIDENCE, SLIPPED_CONFIDENCE, SLIPPED_CONFIDENCE, SLIPPED_CONFIDENCE, 1.0, 1.0, 1.0]
        );
        assert_eq!(confidence_factors(&offsets, &[], &[]), [1.0; 7]);
    }

    #[test]
    fn what_was_put_right_beyond_a_slip_is_no_surer_than_what_lies_there() {
        let offsets = [0, 100, 200, 300, 450, 550, 650];
        assert_eq!(confidence_factors(&offsets, &[100], &[100, 550])[5], SLIPPED_CONFIDENCE);
        assert_eq!(confidence_factors(&offsets, &[100], &[100, 300])[3], 1.0);
    }

    #[test]
    fn a_slip_lowers_confidence_on_this_side_of_it_back_to_the_last_clock_step() {
        // Periods of 100 at the mark, of 150 from 300 on, and a slip at 750.
        let offsets = [0, 100, 200, 300, 450, 600, 750, 830, 980, 1130];
        let left = confidence_factors(&offsets, &[0], &[0]);
        assert_eq!(left[..3], [1.0; 3]);
        assert!(left[5..].iter().all(|left| *left <= SLIPPED_CONFIDENCE), "{left:?}");
    }

    #[test]
    fn two_odd_gaps_that_change_the_phase_are_a_slip_and_a_misplaced_start_is_none() {
        assert!(slipped(&[100.0, 140.0, 130.0, 101.0]));
        assert!(!slipped(&[100.0, 130.0, 70.0, 100.0]) && !slipped(&[100.0, 120.0, 140.0, 140.0]));
    }

    #[test]
    fn a_mark_off_the_period_of_all_others_lowers_their_confidence() {
        let offsets = [0, 100, 200, 330, 400, 500, 600];
        assert!(confidence_factors(&offsets, &[330], &[330]).iter().all(|left| *left <= SLIPPED_CONFIDENCE));
        assert_eq!(confidence_factors(&offsets, &[200], &[200]), [1.0; 7]);
        let missed = [0, 100, 200, 400, 600, 700, 800];
        assert_eq!(confidence_factors(&missed, &[400], &[400]), [1.0; 7]);
    }
}
