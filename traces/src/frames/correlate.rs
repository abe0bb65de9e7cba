//! Correlation of a template with a whole trace by the Fourier transform, block by block.

use super::profile::summed_squared_difference;
use crate::overlap::{Buffers, OverlapSave};
use rayon::prelude::*;

/// Least length of a block: long enough that little is computed twice, short enough to stay in the caches.
const LEAST_BLOCK: usize = 1 << 14;

/// Wider templates are correlated by transforms, narrower ones summed directly.
const WIDE: usize = 48;

/// Summed squared difference at every offset, W^2, by whichever way is faster. By transforms it is exact to about 1e-13 of the
/// template's and the stretch's own squares.
pub(super) fn squares(power: &[f64], template: &[f64]) -> Vec<f64> {
    let width = template.len();
    if width < WIDE || power.len() < width {
        return summed_squared_difference(power, template);
    }
    // Rounding goes with the numbers' size, so both are taken about the template's mean.
    let mean = template.iter().sum::<f64>() / width as f64;
    let centred: Vec<f64> = template.iter().map(|watts| watts - mean).collect();
    let own: f64 = centred.iter().map(|x| x * x).sum();
    let signal: Vec<f64> = power.iter().map(|watts| watts - mean).collect();
    let mut profile = Correlator::new(&centred).correlate(&signal);
    let square = |x: &f64| x * x;
    profile.par_chunks_mut(RESTART).enumerate().for_each(|(index, profile)| {
        // The running sum starts anew in every chunk, so that its rounding does not grow with the trace.
        let from = index * RESTART;
        let mut sum: f64 = signal[from..from + width].iter().map(square).sum();
        for (k, value) in profile.iter_mut().enumerate() {
            *value = (sum + own - 2.0 * *value).max(0.0);
            sum += signal.get(from + k + width).map_or(0.0, square) - square(&signal[from + k]);
        }
    });
    profile
}

/// Offsets after which a running sum is begun anew.
const RESTART: usize = 1 << 14;

/// One template, ready to be correlated with whole traces.
pub(super) struct Correlator {
    overlap: OverlapSave<f64>,
    width: usize,
}

impl Correlator {
    /// Prepares a template.
    pub fn new(template: &[f64]) -> Self {
        let block = (8 * template.len()).next_power_of_two().max(LEAST_BLOCK);
        Self { overlap: OverlapSave::new(&[template.to_vec()], 1.0, block), width: template.len() }
    }

    /// `c[k] = sum over j of signal[k + j] template[j]`, at every offset at which the template fits.
    pub fn correlate(&self, signal: &[f64]) -> Vec<f64> {
        let Some(last) = signal.len().checked_sub(self.width) else { return Vec::new() };
        let mut out = vec![0.0; last + 1];
        let step = self.overlap.step();
        out.par_chunks_mut(2 * step).enumerate().for_each_init(Buffers::default, |buffers, (index, out)| {
            let (first, second) = out.split_at_mut(step.min(out.len()));
            self.overlap.pair(signal, 2 * step * index, buffers, |_, pair| {
                first.iter_mut().zip(pair).for_each(|(to, pair)| *to = pair.re);
                second.iter_mut().zip(pair).for_each(|(to, pair)| *to = pair.im);
            });
        });
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn noise(samples: usize, level: f64) -> Vec<f64> {
        let mut state = 1_u64;
        let mut next = || {
            state = state * 48_271 % 2_147_483_647;
            state as f64 / 2_147_483_647.0
        };
        (0..samples).map(|_| level + next()).collect()
    }

    #[test]
    fn oracle_transforms_agree_with_the_definition_over_many_blocks_and_levels() {
        for level in [0.0, 300.0] {
            let power = noise(3 * LEAST_BLOCK + 77, level);
            let template = &power[5000..5250];
            let (fast, exact) = (squares(&power, template), summed_squared_difference(&power, template));
            assert_eq!(fast.len(), exact.len());
            for (fast, exact) in fast.iter().zip(&exact) {
                assert!((fast - exact).abs() < 1e-9, "{fast} {exact}");
            }
        }
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bits() {
        let power = noise(5 * LEAST_BLOCK, 3.0);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| squares(&power, &power[100..350]))
        };
        assert_eq!(on(1), on(3));
    }

    proptest! {
        #[test]
        fn property_any_lengths(samples in 1_usize..400, width in 1_usize..120) {
            let power = noise(samples, 2.0);
            let template = noise(width, 2.5);
            let (fast, exact) = (squares(&power, &template), summed_squared_difference(&power, &template));
            prop_assert_eq!(fast.len(), exact.len());
            for (fast, exact) in fast.iter().zip(&exact) {
                prop_assert!((fast - exact).abs() < 1e-10);
            }
        }
    }
}
