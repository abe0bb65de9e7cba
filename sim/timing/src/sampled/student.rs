//! Student's t distribution: confidence intervals of means of few values.

use std::f64::consts::{FRAC_PI_2, PI};

/// Half width, in standard errors, of an interval that contains the truth with probability `confidence` (0 to
/// 1). The standard error is estimated with `freedom` degrees of freedom, at least 1.
///
/// Student (1908). For integer degrees of freedom the distribution is a finite sum (Abramowitz and Stegun
/// 1964, 26.7.3 and 26.7.4), inverted here by bisection to the last bits of an f64.
pub fn student_t(confidence: f64, freedom: u32) -> f64 {
    let inside = |angle: f64| within(angle, freedom.max(1));
    let (mut low, mut high) = (0.0, FRAC_PI_2);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if inside(middle) < confidence { low = middle } else { high = middle }
    }
    libm::tan(low) * f64::from(freedom.max(1)).sqrt()
}

/// Probability of |t| < sqrt(n) tan(angle) for `n` degrees of freedom.
fn within(angle: f64, n: u32) -> f64 {
    let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
    let square = cosine * cosine;
    // The sum runs over every other factor: 2/3 4/5 ... for odd n, 1/2 3/4 ... for even n.
    let odd = n % 2;
    let terms = if odd == 1 { (n - 1) / 2 } else { n / 2 };
    let (mut term, mut sum) = (1.0, 0.0);
    for k in 1..=terms {
        sum += term;
        let k = 2.0 * f64::from(k);
        term *= square * if odd == 1 { k / (k + 1.0) } else { (k - 1.0) / k };
    }
    if odd == 1 { (angle + sine * cosine * sum) * 2.0 / PI } else { sine * sum }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fisher and Yates 1938, table III, two-sided.
    #[test]
    fn golden_values_of_the_published_table() {
        let rows = [
            (1, 0.95, 12.706),
            (2, 0.95, 4.303),
            (3, 0.95, 3.182),
            (4, 0.95, 2.776),
            (5, 0.95, 2.571),
            (10, 0.95, 2.228),
            (30, 0.95, 2.042),
            (120, 0.95, 1.980),
            (1, 0.5, 1.0),
            (3, 0.99, 5.841),
            (10, 0.9, 1.812),
        ];
        for (freedom, confidence, expected) in rows {
            let found = student_t(confidence, freedom);
            assert!((found - expected).abs() < 6e-4, "{freedom} {confidence}: {found}, not {expected}");
        }
    }

    /// One degree is the Cauchy distribution; two have a closed form.
    #[test]
    fn closed_forms() {
        for confidence in [0.5, 0.8, 0.95, 0.999] {
            let cauchy = libm::tan(FRAC_PI_2 * confidence);
            assert!((student_t(confidence, 1) / cauchy - 1.0).abs() < 1e-9);
            let two = confidence * (2.0 / (1.0 - confidence * confidence)).sqrt();
            assert!((student_t(confidence, 2) / two - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn the_interval_narrows_with_freedom_and_0_counts_as_1() {
        let widths: Vec<f64> = (1..60).map(|n| student_t(0.95, n)).collect();
        assert!(widths.windows(2).all(|pair| pair[1] < pair[0]));
        assert!(widths[58] > 1.95996);
        assert_eq!(student_t(0.95, 0), student_t(0.95, 1));
    }
}
