//! How evenly starts are spaced.

/// A gap within these shares of the median gap is regular.
const REGULAR: [f64; 2] = [0.6, 1.6];
/// With fewer gaps, regularity says nothing.
const LEAST_GAPS: usize = 4;

/// The share of `span` that lies between neighbours at a regular distance: 1 if all of it is evenly divided, less
/// where starts are missing (their gap is long), false (short), or absent at the ends. 0 if there are too few.
/// Offsets in samples, sorted.
pub(crate) fn regularity(offsets: &[usize], span: usize) -> f64 {
    let gaps: Vec<usize> = offsets.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if gaps.len() < LEAST_GAPS || span == 0 {
        return 0.0;
    }
    let mut others = gaps.clone();
    let median = *others.select_nth_unstable(gaps.len() / 2).1 as f64;
    let regular = |gap: &&usize| (REGULAR[0] * median..=REGULAR[1] * median).contains(&(**gap as f64));
    gaps.iter().filter(regular).sum::<usize>() as f64 / span as f64
}

#[cfg(test)]
mod tests {
    use super::*;

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
