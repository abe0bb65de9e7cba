//! Median, quartiles, 95th percentile, worst: the same rule for every chart.

/// The quantiles of some values, linear between ranks, so that the median of an even number of values is the mean of the
/// two in the middle; 0 where there are none.
pub(super) fn quantiles(values: impl Iterator<Item = f64>) -> impl Fn(f64) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    move |quantile| {
        let rank = quantile * values.len().saturating_sub(1) as f64;
        let at = |rank: f64| values.get(rank as usize).copied().unwrap_or(0.0);
        let (below, above) = (at(rank.floor()), at(rank.ceil()));
        // Equal neighbours may be infinite.
        if below == above { below } else { below + rank.fract() * (above - below) }
    }
}

#[cfg(test)]
mod tests {
    use super::quantiles;

    #[test]
    fn linear_between_ranks() {
        let of = quantiles([3.0, 1.0, 2.0, 4.0].into_iter());
        assert_eq!([0.0, 0.25, 0.5, 1.0].map(of), [1.0, 1.75, 2.5, 4.0]);
        let of = quantiles([1.0, 5.0, 2.0].into_iter());
        assert_eq!([0.0, 0.25, 0.5, 0.75, 1.0].map(of), [1.0, 1.5, 2.0, 3.5, 5.0]);
        assert_eq!(quantiles([7.0].into_iter())(0.95), 7.0);
        assert_eq!(quantiles(std::iter::empty())(0.5), 0.0);
    }

    /// Six animations at level `packet`: the upper of the two in the middle is 0.126.
    #[test]
    fn the_median_of_six_is_the_mean_of_the_third_and_the_fourth() {
        let of = quantiles([0.002, 0.006, 0.021, 0.126, 0.243, 0.753].into_iter());
        assert!((of(0.5) - 0.0735).abs() < 1e-12);
    }
}
