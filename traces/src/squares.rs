//! What spreads are made of.

/// The mean of some values; no values have none.
pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The mean of some values and the sum of their squared differences from it; no values have no mean.
pub(crate) fn about_mean(values: &[f64]) -> (f64, f64) {
    let mean = mean(values);
    (mean, values.iter().map(|value| (value - mean) * (value - mean)).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_known_numbers_and_of_none() {
        assert_eq!(about_mean(&[1.0, 2.0, 6.0]), (3.0, 14.0));
        let (mean, squares) = about_mean(&[]);
        assert!(mean.is_nan() && squares == 0.0);
    }
}
