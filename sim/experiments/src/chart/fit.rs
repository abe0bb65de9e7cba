//! Exponents of curves: a power law fitted by least squares on logarithms.

/// The exponent `p` of `y = c x^p` that fits the points best in the logarithms of both, or `None` where fewer than two
/// points above zero differ in `x`.
pub fn exponent(points: impl IntoIterator<Item = (f64, f64)>) -> Option<f64> {
    let positive = points.into_iter().filter(|(x, y)| *x > 0.0 && *y > 0.0 && x.is_finite() && y.is_finite());
    let logs: Vec<(f64, f64)> = positive.map(|(x, y)| (libm::log(x), libm::log(y))).collect();
    let count = logs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / count;
    let (x_mean, y_mean) = (mean(|p| p.0), mean(|p| p.1));
    let spread: f64 = logs.iter().map(|(x, _)| (x - x_mean) * (x - x_mean)).sum();
    let joint: f64 = logs.iter().map(|(x, y)| (x - x_mean) * (y - y_mean)).sum();
    (logs.len() > 1 && spread > 0.0).then(|| joint / spread)
}

/// Where the upper half of a range begins on a logarithmic axis, ends above zero: at the root of their product.
pub fn upper_half(low: f64, high: f64) -> f64 {
    libm::sqrt(low) * libm::sqrt(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_gives_its_exponent() {
        for p in [-1.5, -0.5, 0.0, 2.0] {
            let points = [1.0_f64, 2.0, 7.0, 64.0].map(|x| (x, 3.0 * x.powf(p)));
            assert!((exponent(points).unwrap() - p).abs() < 1e-12);
        }
    }

    #[test]
    fn the_upper_half_leaves_a_floor_out() {
        let from = upper_half(1.0, 256.0);
        assert_eq!(from, 16.0);
        let curve = [1.0, 4.0, 16.0, 64.0, 256.0].map(|x: f64| (x, 2.0 * x.powf(0.75).max(8.0)));
        let upper = curve.into_iter().filter(|(x, _)| *x >= from);
        assert!((exponent(upper).unwrap() - 0.75).abs() < 1e-12);
        assert!(exponent(curve).unwrap() < 0.7, "the floor would flatten the fit");
    }

    #[test]
    fn too_little_to_fit_gives_none() {
        assert_eq!(exponent([]), None);
        assert_eq!(exponent([(4.0, 1.0)]), None);
        assert_eq!(exponent([(4.0, 1.0), (4.0, 2.0)]), None);
        assert_eq!(exponent([(4.0, 1.0), (8.0, 0.0), (16.0, f64::NAN)]), None);
    }
}
