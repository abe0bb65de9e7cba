//! Correlation by overlap and save (Oppenheim and Schafer 2010, section 8.7.3), in f32 or f64.

use realfft::num_complex::Complex;
use realfft::num_traits::Zero;
use realfft::{ComplexToReal, FftNum, RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// The transform of one template and what is needed to apply it.
pub(crate) struct OverlapSave<T: FftNum> {
    forward: Arc<dyn RealToComplex<T>>,
    inverse: Arc<dyn ComplexToReal<T>>,
    spectrum: Vec<Complex<T>>,
    width: usize,
    block: usize,
}

/// What a thread works in.
#[derive(Default)]
pub(crate) struct Buffers<T> {
    real: Vec<T>,
    complex: Vec<Complex<T>>,
    scratch: Vec<Complex<T>>,
}

impl<T: FftNum> OverlapSave<T> {
    /// Prepares a template, each of its values times `factor`, for transforms of `block` samples.
    pub fn new(template: &[f64], factor: f64, block: usize) -> Self {
        let mut planner = RealFftPlanner::new();
        let (forward, inverse) = (planner.plan_fft_forward(block), planner.plan_fft_inverse(block));
        let mut padded = forward.make_input_vec();
        let mut spectrum = forward.make_output_vec();
        for (to, from) in padded.iter_mut().zip(template) {
            *to = T::from_f64(factor * from / block as f64).unwrap_or_else(T::zero);
        }
        // Only a wrong length is refused, here and below, and the lengths are the plan's own.
        let _ = forward.process(&mut padded, &mut spectrum);
        spectrum.iter_mut().for_each(|value| *value = value.conj());
        Self { forward, inverse, spectrum, width: template.len(), block }
    }

    /// How many offsets a block answers for.
    pub fn step(&self) -> usize {
        self.block - self.width + 1
    }

    /// The stretch of a signal for the block whose first offset is `from`.
    pub fn stretch<'a>(&self, signal: &'a [T], from: usize) -> &'a [T] {
        &signal[from..signal.len().min(from + self.block)]
    }

    /// The correlation with one block, cyclic beyond its end. Every block is worked out alike by whichever thread.
    pub fn block<'a>(&self, stretch: &[T], buffers: &'a mut Buffers<T>) -> &'a [T] {
        let Buffers { real, complex, scratch } = buffers;
        let scratches = [self.forward.get_scratch_len(), self.inverse.get_scratch_len()];
        real.resize(self.block, T::zero());
        complex.resize(self.block / 2 + 1, Complex::zero());
        scratch.resize(scratches[0].max(scratches[1]), Complex::zero());
        real[..stretch.len()].copy_from_slice(stretch);
        real[stretch.len()..].fill(T::zero());
        let _ = self.forward.process_with_scratch(real, complex, &mut scratch[..scratches[0]]);
        for (value, factor) in complex.iter_mut().zip(&self.spectrum) {
            *value = *value * *factor;
        }
        // The first and the last bin of a real signal are real; rounding may leave them not quite so, which would be refused.
        for bin in [0, complex.len() - 1] {
            complex[bin].im = T::zero();
        }
        let _ = self.inverse.process_with_scratch(complex, real, &mut scratch[..scratches[1]]);
        real
    }
}
