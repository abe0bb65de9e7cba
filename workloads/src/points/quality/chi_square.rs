//! Pearson's chi-square test (1900).

/// Result of the test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChiSquare {
    /// Sum of squared differences over the expectation.
    pub statistic: f64,
    /// Degrees of freedom: cells in use, less one.
    pub freedom: u64,
    /// Probability of at least this difference if the counts follow the expectation. Near 0 they do not
    /// follow it; near 1 they follow better than independent points would.
    pub p: f64,
}

/// Least expected count of a cell in use.
const MIN_EXPECTED: f64 = 5.0;

/// Tests counts against expected shares, which need not add up to 1.
pub fn chi_square(counts: &[u64], shares: &[f64]) -> ChiSquare {
    let (count, whole) = (counts.iter().sum::<u64>() as f64, shares.iter().sum::<f64>());
    let cells = counts.iter().zip(shares).map(|(&found, share)| (found as f64, share / whole * count));
    let used: Vec<(f64, f64)> = cells.filter(|(_, expected)| *expected >= MIN_EXPECTED).collect();
    let statistic = used.iter().map(|(found, expected)| (found - expected).powi(2) / expected).sum();
    let freedom = used.len().saturating_sub(1) as u64;
    ChiSquare { statistic, freedom, p: upper_tail(statistic, freedom) }
}

/// Probability that chi-square of `freedom` degrees is at least `statistic`: the regularized incomplete gamma
/// function Q(freedom / 2, statistic / 2), by its series or its continued fraction (Press et al. 2007,
/// section 6.2).
pub fn upper_tail(statistic: f64, freedom: u64) -> f64 {
    let (a, x) = (0.5 * freedom as f64, 0.5 * statistic);
    if a <= 0.0 || x <= 0.0 {
        return 1.0;
    }
    let front = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    if x < a + 1.0 { 1.0 - front * series(a, x) } else { front * fraction(a, x) }
}

fn series(a: f64, x: f64) -> f64 {
    let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
    while term > sum * 1e-16 {
        n += 1.0;
        term *= x / n;
        sum += term;
    }
    sum
}

/// Lentz's method.
fn fraction(a: f64, x: f64) -> f64 {
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut value = d;
    for i in 1..100_000 {
        let term = -f64::from(i) * (f64::from(i) - a);
        b += 2.0;
        d = 1.0 / (term * d + b);
        c = b + term / c;
        value *= d * c;
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_agree_with_tables() {
        // Two degrees of freedom are an exponential; the others are percentiles of printed tables.
        for x in [0.1, 1.0, 5.0, 40.0] {
            assert!((upper_tail(x, 2) / (-0.5_f64 * x).exp() - 1.0).abs() < 1e-13);
        }
        for (x, freedom, p) in
            [(3.841_459, 1, 0.05), (18.307_04, 10, 0.05), (124.342_1, 100, 0.05), (2.558_212, 10, 0.99)]
        {
            assert!((upper_tail(x, freedom) - p).abs() < 1e-6, "{freedom}: {}", upper_tail(x, freedom));
        }
    }

    #[test]
    fn p_is_low_for_wrong_counts_and_high_for_too_even_ones() {
        let shares = [1.0; 50];
        assert_eq!(chi_square(&[100; 50], &shares).p, 1.0);
        let far: Vec<u64> = (0..50).map(|n| 80 + 40 * (n % 2)).collect();
        assert!(chi_square(&far, &shares).p < 1e-6);
        assert_eq!(chi_square(&[100, 0], &[1.0, 1e-6]).freedom, 0);
    }
}
