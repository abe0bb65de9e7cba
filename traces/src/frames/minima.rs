//! Non-maximum suppression, on minima.

/// Offsets that are lowest within less than `spacing` on either side, in order and at least `spacing` apart.
///
/// On a plateau the first offset stands for its neighbours, so that a level without any structure still yields
/// one candidate per `spacing` (the threshold needs to see such levels).
pub(super) fn spaced_minima(profile: &[f64], spacing: usize) -> Vec<usize> {
    let spacing = spacing.max(1);
    let mut found: Vec<usize> = Vec::new();
    for (block, values) in profile.chunks(spacing).enumerate() {
        let offset = block * spacing + first_lowest(values);
        let value = profile[offset];
        let before = &profile[(offset + 1).saturating_sub(spacing)..offset];
        let after = &profile[offset + 1..profile.len().min(offset + spacing)];
        let tied = found.last().is_some_and(|&last| offset - last < spacing);
        if !tied && before.iter().chain(after).all(|&other| other >= value) {
            found.push(offset);
        }
    }
    found
}

fn first_lowest(values: &[f64]) -> usize {
    let mut lowest = 0;
    for (index, value) in values.iter().enumerate() {
        if *value < values[lowest] {
            lowest = index;
        }
    }
    lowest
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_lower_of_two_near_minima_wins_and_plateaus_count() {
        assert_eq!(spaced_minima(&[5.0, 1.0, 5.0, 0.0, 5.0, 5.0, 5.0, 2.0, 5.0], 3), [3, 7]);
        assert_eq!(spaced_minima(&[4.0; 7], 3), [0, 3, 6]);
        assert_eq!(spaced_minima(&[], 3), [0_usize; 0]);
    }

    proptest! {
        #[test]
        fn oracle_each_is_the_lowest_around_and_none_is_missed(
            profile in prop::collection::vec(0.0..1.0_f64, 1..200), spacing in 1_usize..30,
        ) {
            // Distinct values (almost surely), so ties do not matter here.
            let naive: Vec<usize> = (0..profile.len())
                .filter(|&k| (0..profile.len()).all(|o| o == k || o.abs_diff(k) >= spacing || profile[o] > profile[k]))
                .collect();
            prop_assert_eq!(spaced_minima(&profile, spacing), naive);
        }
    }
}
