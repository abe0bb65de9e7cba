//! Median, 95th percentile, worst: the same rule for every chart.

/// The quantiles of some values: of those in between two the greater; 0 where there are none.
pub(super) fn quantiles(values: impl Iterator<Item = f64>) -> impl Fn(f64) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    move |quantile| {
        let last = values.len().saturating_sub(1);
        values.get((quantile * last as f64).ceil() as usize).copied().unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::quantiles;

    #[test]
    fn the_greater_of_two_neighbours() {
        let of = quantiles([3.0, 1.0, 2.0, 4.0].into_iter());
        assert_eq!([0.0, 0.5, 0.95, 1.0].map(of), [1.0, 3.0, 4.0, 4.0]);
        assert_eq!(quantiles(std::iter::empty())(0.5), 0.0);
    }
}
