//! Distance by shape alone.

use super::correlate::Correlator;

/// A window's norm is taken to be at least this share of the template's, so that steady power resembles nothing.
const LEAST_NORM: f64 = 0.05;

/// z-normalized squared distance (Goldin and Kanellakis 1995; Mueen's MASS) at every offset, in W^2: `2 |q|^2 (1 - r)`, with `r` the
/// correlation coefficient and `|q|` the template's norm about its mean. It is what the summed squared difference would be had the
/// stretch the template's mean and norm: neither idle power nor a factor on power changes it.
pub(super) fn normalized(power: &[f64], template: &[f64]) -> Vec<f64> {
    let width = template.len();
    if width == 0 || power.len() < width {
        return Vec::new();
    }
    let mean = template.iter().sum::<f64>() / width as f64;
    let centred: Vec<f64> = template.iter().map(|watts| watts - mean).collect();
    let own = libm::sqrt(centred.iter().map(|x| x * x).sum());
    let signal: Vec<f64> = power.iter().map(|watts| watts - mean).collect();
    let mut profile = Correlator::new(&centred).correlate(&signal);
    let (mut sum, mut squares) = (0.0, 0.0);
    for (k, value) in profile.iter_mut().enumerate() {
        if k % RESTART == 0 {
            sum = signal[k..k + width].iter().sum();
            squares = signal[k..k + width].iter().map(|x| x * x).sum();
        }
        let norm = libm::sqrt((squares - sum * sum / width as f64).max(0.0)).max(LEAST_NORM * own);
        let r = *value / (norm * own).max(f64::MIN_POSITIVE);
        *value = 2.0 * own * own * (1.0 - r).max(0.0);
        let (gone, next) = (signal[k], signal.get(k + width).copied().unwrap_or(0.0));
        sum += next - gone;
        squares += next * next - gone * gone;
    }
    profile
}

/// Offsets after which running sums are begun anew, so that rounding does not grow with the trace.
const RESTART: usize = 1 << 14;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn analytic_offset_and_factor_change_nothing_and_steady_power_resembles_nothing() {
        let template: Vec<f64> = (0..60).map(|i| f64::from(i * i % 17)).collect();
        let other = template.iter().map(|watts| 40.0 + 0.3 * watts);
        let power: Vec<f64> = core::iter::repeat_n(40.0, 80).chain(other).chain([40.0; 80]).collect();
        let profile = normalized(&power, &template);
        let mean = template.iter().sum::<f64>() / 60.0;
        let own: f64 = template.iter().map(|x| (x - mean) * (x - mean)).sum();
        assert!(profile[80] < 1e-9 * own, "{}", profile[80]);
        assert!((profile[0] - 2.0 * own).abs() < 1e-9 * own);
    }

    proptest! {
        #[test]
        fn oracle_it_is_the_squared_distance_of_normalized_windows(
            power in prop::collection::vec(0.0..9.0_f64, 60..200), at in 0_usize..20,
        ) {
            let template = &power[at..at + 30];
            let scaled = |window: &[f64]| {
                let mean = window.iter().sum::<f64>() / 30.0;
                let norm = window.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>().sqrt();
                (window.iter().map(|x| (x - mean) / norm).collect::<Vec<_>>(), norm)
            };
            let (q, own) = scaled(template);
            for (k, value) in normalized(&power, template).into_iter().enumerate() {
                let (x, _) = scaled(&power[k..k + 30]);
                let exact: f64 = q.iter().zip(&x).map(|(a, b)| (a - b) * (a - b)).sum();
                prop_assert!((value - own * own * exact).abs() < 1e-9 * own * own);
            }
        }
    }
}
