//! Distance profiles: the distance of a template to every window of a trace, by summed squares or by shape,
//! and its minima.
//!
//! Narrow templates are summed directly, wide ones correlated by the Fourier transform, block by block: by
//! overlap and save (Oppenheim and Schafer 2010, section 8.7.3), in f32 or f64.
//!
//! Templates are real, so two blocks of a signal share a transform, one as its real part and one as its
//! imaginary part (Press et al. 2007, section 12.3), and come out in the same way.

use rayon::prelude::*;
use rustfft::num_complex::Complex;
use rustfft::num_traits::Zero;
use rustfft::{Fft, FftNum, FftPlanner};
use std::sync::Arc;

/// Offsets computed together: their sums stay in registers while the template is read once.
const LANES: usize = 16;

/// Summed squared difference `d[k] = sum over j of (power[k + j] - template[j])^2`, in W^2 for powers in W.
///
/// One value per offset at which the template fits, `power.len() - template.len() + 1`; none if it does not
/// fit or is empty. Terms are added in the order of the template, so the result does not depend on how it is
/// blocked. Time: `O(n m)`, `O(n)` memory.
pub fn summed_squared_difference(power: &[f64], template: &[f64]) -> Vec<f64> {
    let width = template.len();
    if width == 0 || power.len() < width {
        return Vec::new();
    }
    let count = power.len() - width + 1;
    let mut profile = vec![0.0; count];
    let mut blocks = profile.chunks_exact_mut(LANES);
    let mut offset = 0;
    for block in &mut blocks {
        block.copy_from_slice(&lanes(&power[offset..offset + width + LANES - 1], template));
        offset += LANES;
    }
    for value in blocks.into_remainder() {
        *value = difference(&power[offset..offset + width], template);
        offset += 1;
    }
    profile
}

/// [`LANES`] successive offsets; `power` is `LANES - 1` longer than the template.
fn lanes(power: &[f64], template: &[f64]) -> [f64; LANES] {
    let mut sums = [0.0; LANES];
    for (segment, &reference) in power.windows(LANES).zip(template) {
        for (sum, &value) in sums.iter_mut().zip(segment) {
            let difference = value - reference;
            *sum += difference * difference;
        }
    }
    sums
}

/// The summed squared difference of two segments of the same length.
pub(super) fn difference(power: &[f64], template: &[f64]) -> f64 {
    power.iter().zip(template).map(|(&value, &reference)| (value - reference) * (value - reference)).sum()
}

/// Least length of a block: long enough that little is computed twice, short enough to stay in the caches.
const MIN_BLOCK_SAMPLES: usize = 1 << 14;

/// One template, ready to be correlated with whole traces.
pub(super) struct Correlator {
    overlap: OverlapSave<f64>,
    width: usize,
}

impl Correlator {
    /// Prepares a template.
    pub fn new(template: &[f64]) -> Self {
        let block = (8 * template.len()).next_power_of_two().max(MIN_BLOCK_SAMPLES);
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

/// Least norm of a window, as a share of the template's: steady power then resembles nothing.
const MIN_NORM_SHARE: f64 = 0.05;

/// z-normalized squared distance (Goldin and Kanellakis 1995; Mueen's MASS) at every offset, in W^2: `2 |q|^2
/// (1 - r)`, with `r` the correlation coefficient and `|q|` the template's norm about its mean. It is what
/// the summed squared difference would be had the segment the template's mean and norm: neither idle power
/// nor a factor on power changes it.
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
        if k % RESTART_NORM_OFFSETS == 0 {
            sum = signal[k..k + width].iter().sum();
            squares = signal[k..k + width].iter().map(|x| x * x).sum();
        }
        let norm = libm::sqrt((squares - sum * sum / width as f64).max(0.0)).max(MIN_NORM_SHARE * own);
        let r = *value / (norm * own).max(f64::MIN_POSITIVE);
        *value = 2.0 * own * own * (1.0 - r).max(0.0);
        let (gone, next) = (signal[k], signal.get(k + width).copied().unwrap_or(0.0));
        sum += next - gone;
        squares += next * next - gone * gone;
    }
    profile
}

/// Offsets after which running sums begin anew, so that rounding does not grow with the trace.
const RESTART_NORM_OFFSETS: usize = 1 << 14;

/// Offsets that are lowest within less than `spacing` on either side, in order and at least `spacing` apart.
///
/// On a plateau the first offset stands for its neighbours, so that a level without any structure still
/// yields one candidate per `spacing` (the threshold needs to see such levels).
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

/// Transforms of blocks of one length, there and back.
#[derive(Clone)]
pub(crate) struct Transforms<T> {
    forward: Arc<dyn Fft<T>>,
    inverse: Arc<dyn Fft<T>>,
    block: usize,
}

impl<T: FftNum> Transforms<T> {
    pub fn new(block: usize) -> Self {
        let mut planner = FftPlanner::new();
        Self { forward: planner.plan_fft_forward(block), inverse: planner.plan_fft_inverse(block), block }
    }
}

/// The transforms of templates of one width and what is needed to apply them.
pub(crate) struct OverlapSave<T: FftNum> {
    transforms: Transforms<T>,
    spectra: Vec<Vec<Complex<T>>>,
    width: usize,
}

/// The buffers of a thread.
#[derive(Default)]
pub(crate) struct Buffers<T> {
    signal: Vec<Complex<T>>,
    product: Vec<Complex<T>>,
    scratch: Vec<Complex<T>>,
}

impl<T: FftNum> OverlapSave<T> {
    /// Prepares templates of equal width, each value times `factor`, for transforms of `block` samples.
    pub fn new(templates: &[Vec<f64>], factor: f64, block: usize) -> Self {
        Self::with(Transforms::new(block), templates.iter().map(Vec::as_slice), factor)
    }

    /// The same, with transforms that are ready.
    pub fn with<'a>(
        transforms: Transforms<T>,
        templates: impl ExactSizeIterator<Item = &'a [f64]> + Clone,
        factor: f64,
    ) -> Self {
        let block = transforms.block;
        let value = |&watts: &f64| T::from_f64(factor * watts / block as f64).unwrap_or_else(T::zero);
        let spectrum = |template: &[f64]| {
            let mut padded: Vec<Complex<T>> = template.iter().map(|watts| value(watts).into()).collect();
            padded.resize(block, Complex::zero());
            transforms.forward.process(&mut padded);
            padded.iter().map(Complex::conj).collect()
        };
        let width = templates.clone().next().map_or(1, <[f64]>::len);
        let spectra = templates.map(spectrum).collect();
        Self { transforms, spectra, width }
    }

    /// How many offsets a block answers for.
    pub fn step(&self) -> usize {
        self.transforms.block - self.width + 1
    }

    /// Hands every template's correlation with two blocks, whose first offsets are `from` and a step later,
    /// to `take`: in real and imaginary parts, cyclic beyond a step. Every thread computes a pair in the same
    /// way.
    pub fn pair(
        &self,
        signal: &[T],
        from: usize,
        buffers: &mut Buffers<T>,
        mut take: impl FnMut(usize, &[Complex<T>]),
    ) {
        let Transforms { forward, inverse, block } = &self.transforms;
        let scratches = [forward.get_inplace_scratch_len(), inverse.get_inplace_scratch_len()];
        buffers.scratch.resize(scratches[0].max(scratches[1]), Complex::zero());
        let [first, second] = [from, from + self.step()].map(|from| self.segment(signal, from));
        buffers.signal.clear();
        buffers.signal.extend(first.iter().zip(second).map(|(&re, &im)| Complex { re, im }));
        buffers.signal.extend(first[second.len()..].iter().map(|&re| Complex::from(re)));
        buffers.signal.resize(*block, Complex::zero());
        forward.process_with_scratch(&mut buffers.signal, &mut buffers.scratch[..scratches[0]]);
        for (index, spectrum) in self.spectra.iter().enumerate() {
            buffers.product.clear();
            buffers.product.extend(buffers.signal.iter().zip(spectrum).map(|(a, b)| a * b));
            inverse.process_with_scratch(&mut buffers.product, &mut buffers.scratch[..scratches[1]]);
            take(index, &buffers.product);
        }
    }

    /// The samples of the block whose first offset is `from`, as far as there are any.
    fn segment<'a>(&self, signal: &'a [T], from: usize) -> &'a [T] {
        &signal[from.min(signal.len())..signal.len().min(from + self.transforms.block)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn templates_that_do_not_fit_give_nothing() {
        assert!(summed_squared_difference(&[1.0], &[]).is_empty());
        assert!(summed_squared_difference(&[1.0], &[1.0, 2.0]).is_empty());
    }

    proptest! {
        #[test]
        fn oracle_every_offset_is_the_definition_to_the_bit(
            power in prop::collection::vec(-5.0..50.0_f64, 1..200),
            template in prop::collection::vec(-5.0..50.0_f64, 1..40),
        ) {
            let profile = summed_squared_difference(&power, &template);
            prop_assert_eq!(profile.len(), (power.len() + 1).saturating_sub(template.len()));
            for (offset, &value) in profile.iter().enumerate() {
                let mut sum = 0.0;
                for (j, reference) in template.iter().enumerate() {
                    sum += (power[offset + j] - reference) * (power[offset + j] - reference);
                }
                prop_assert_eq!(value, sum);
            }
        }
    }

    fn noise(samples: usize, level: f64) -> Vec<f64> {
        let mut state = 1_u64;
        let mut next = || {
            state = state * 48_271 % 2_147_483_647;
            state as f64 / 2_147_483_647.0
        };
        (0..samples).map(|_| level + next()).collect()
    }

    #[test]
    fn any_number_of_threads_gives_the_same_bits() {
        let power = noise(5 * MIN_BLOCK_SAMPLES, 3.0);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| normalized(&power, &power[100..350]))
        };
        assert_eq!(on(1), on(3));
    }

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
