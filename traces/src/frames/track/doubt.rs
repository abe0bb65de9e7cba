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
    let within = |ratio: f64, [low, high]: [f64; 2]| ratio > low && ratio < high;
    let ratio = between / before;
    !within(ratio, ODD) && (ratio - 2.0).abs() > TWO && within(after / before, SAME)
}

/// What is left of the confidence of each start: less by each slip between it and the nearest mark. Without marks all of it.
pub(super) fn left(offsets: &[usize], marks: &[usize]) -> Vec<f64> {
    let gap = |index: usize| (offsets[index + 1] - offsets[index]) as f64;
    let slipped = |index: usize| {
        index > 1 && index + 1 < offsets.len() && slip(gap(index - 2), gap(index - 1), gap(index))
    };
    // How many slips lie before each start.
    let slips: Vec<i32> = (0..offsets.len())
        .scan(0, |count, index| {
            *count += i32::from(slipped(index));
            Some(*count)
        })
        .collect();
    let marked: Vec<usize> = marks.iter().filter_map(|mark| offsets.binary_search(mark).ok()).collect();
    let nearest = |start: usize| marked.iter().copied().min_by_key(|mark| mark.abs_diff(start));
    let between = |start: usize, mark: usize| libm::pow(LEFT, f64::from((slips[start] - slips[mark]).abs()));
    (0..offsets.len()).map(|start| nearest(start).map_or(1.0, |mark| between(start, mark))).collect()
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
}
