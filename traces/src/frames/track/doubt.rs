//! Doubt that spreads: past a place where the sequence may have slipped to another phase of the frame, nothing ties it to a mark.

/// Ratios of gaps that are the same beat.
const SAME: [f64; 2] = [0.92, 1.085];
/// Ratios of gaps beyond which the later one is odd.
const ODD: [f64; 2] = [0.887, 1.13];
/// Two gaps in one, a start missed between them, are no slip if they are as long as two by this share.
const TWO: f64 = 0.1;
/// What is left of the confidence beyond a slip.
const LEFT: f64 = 0.3;

/// Whether the beat goes on as before after one odd gap that is not two of it. A clock step would change it for longer.
pub(super) fn slip(before: f64, between: f64, after: f64) -> bool {
    let ratio = between / before;
    !within(ratio, ODD) && (ratio - 2.0).abs() > TWO && within(after / before, SAME)
}

/// What is left of the confidence of each start: less by each slip between it and the nearest mark, and where that mark is itself off
/// the beat of the starts around it. Without marks all of it.
pub(super) fn left(offsets: &[usize], marks: &[usize]) -> Vec<f64> {
    let gaps: Vec<f64> = offsets.windows(2).map(|two| (two[1] - two[0]) as f64).collect();
    // How many slips lie before each start.
    let slips: Vec<i32> = (0..offsets.len())
        .scan(0, |count, index| {
            *count += i32::from(slipped(&gaps[..gaps.len().min(index + 1)]));
            Some(*count)
        })
        .collect();
    let marked: Vec<(usize, bool)> = marks
        .iter()
        .filter_map(|mark| offsets.binary_search(mark).ok())
        .map(|mark| (mark, off_beat(&gaps, mark)))
        .collect();
    let nearest = |start: usize| marked.iter().copied().min_by_key(|(mark, _)| mark.abs_diff(start));
    let between = |start: usize, (mark, off): (usize, bool)| {
        libm::pow(LEFT, f64::from((slips[start] - slips[mark]).abs() + i32::from(off)))
    };
    (0..offsets.len()).map(|start| nearest(start).map_or(1.0, |mark| between(start, mark))).collect()
}

/// Whether the last of these gaps takes up the beat from before one odd gap, or two, in another phase.
fn slipped(gaps: &[f64]) -> bool {
    match *gaps {
        [.., before, between, after] if slip(before, between, after) => true,
        [.., before, one, two, after] => {
            let odd = |gap: f64| !within(gap / before, ODD);
            odd(one) && odd(two) && within(after / before, SAME) && !whole((one + two) / before)
        }
        _ => false,
    }
}

/// Whether a start stands between two beats of the same phase, but not on a beat: then either it or all others are something else.
fn off_beat(gaps: &[f64], start: usize) -> bool {
    let Some(&[before, one, two, after]) = start.checked_sub(2).and_then(|from| gaps.get(from..from + 4))
    else {
        return false;
    };
    let odd = |gap: f64| !within(gap / before, ODD) && !whole(gap / before);
    within(after / before, SAME) && odd(one) && odd(two)
}

fn within(ratio: f64, [low, high]: [f64; 2]) -> bool {
    ratio > low && ratio < high
}

/// Whether so many beats are a whole number of them.
fn whole(beats: f64) -> bool {
    (beats - libm::round(beats)).abs() < TWO
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
    fn doubt_is_on_the_far_side_of_the_slip() {
        let offsets = [0, 100, 200, 300, 450, 550, 650];
        assert_eq!(left(&offsets, &[100]), [1.0, 1.0, 1.0, 1.0, LEFT, LEFT, LEFT]);
        assert_eq!(left(&offsets, &[650]), [LEFT, LEFT, LEFT, LEFT, 1.0, 1.0, 1.0]);
        assert_eq!(left(&offsets, &[]), [1.0; 7]);
    }

    #[test]
    fn two_odd_gaps_that_change_the_phase_are_a_slip_and_a_misplaced_start_is_none() {
        assert!(slipped(&[100.0, 140.0, 130.0, 101.0]));
        assert!(!slipped(&[100.0, 130.0, 70.0, 100.0]) && !slipped(&[100.0, 120.0, 140.0, 140.0]));
    }

    #[test]
    fn a_mark_that_is_off_the_beat_of_all_others_leaves_them_in_doubt() {
        let offsets = [0, 100, 200, 330, 400, 500, 600];
        assert!(left(&offsets, &[330]).iter().all(|left| *left <= LEFT));
        assert_eq!(left(&offsets, &[200]), [1.0; 7]);
        let missed = [0, 100, 200, 400, 600, 700, 800];
        assert_eq!(left(&missed, &[400]), [1.0; 7]);
    }
}
