//! Correlation by overlap and save (Oppenheim and Schafer 2010, section 8.7.3), in f32 or f64.
//!
//! Templates are real, so two blocks of a signal share a transform, one as its real part and one as its
//! imaginary part (Press et al. 2007, section 12.3), and come out in the same way.

use rustfft::num_complex::Complex;
use rustfft::num_traits::Zero;
use rustfft::{Fft, FftNum, FftPlanner};
use std::sync::Arc;

/// The transforms of templates of one width and what is needed to apply them.
pub(crate) struct OverlapSave<T: FftNum> {
    forward: Arc<dyn Fft<T>>,
    inverse: Arc<dyn Fft<T>>,
    spectra: Vec<Vec<Complex<T>>>,
    width: usize,
    block: usize,
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
        let mut planner = FftPlanner::new();
        let (forward, inverse) = (planner.plan_fft_forward(block), planner.plan_fft_inverse(block));
        let value = |&watts: &f64| T::from_f64(factor * watts / block as f64).unwrap_or_else(T::zero);
        let spectrum = |template: &Vec<f64>| {
            let mut padded: Vec<Complex<T>> = template.iter().map(|watts| value(watts).into()).collect();
            padded.resize(block, Complex::zero());
            forward.process(&mut padded);
            padded.iter().map(Complex::conj).collect()
        };
        let spectra = templates.iter().map(spectrum).collect();
        let width = templates.first().map_or(1, Vec::len);
        Self { forward, inverse, spectra, width, block }
    }

    /// How many offsets a block answers for.
    pub fn step(&self) -> usize {
        self.block - self.width + 1
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
        let scratches = [self.forward.get_inplace_scratch_len(), self.inverse.get_inplace_scratch_len()];
        buffers.scratch.resize(scratches[0].max(scratches[1]), Complex::zero());
        let [first, second] = [from, from + self.step()].map(|from| self.segment(signal, from));
        buffers.signal.clear();
        buffers.signal.extend(first.iter().zip(second).map(|(&re, &im)| Complex { re, im }));
        buffers.signal.extend(first[second.len()..].iter().map(|&re| Complex::from(re)));
        buffers.signal.resize(self.block, Complex::zero());
        self.forward.process_with_scratch(&mut buffers.signal, &mut buffers.scratch[..scratches[0]]);
        for (index, spectrum) in self.spectra.iter().enumerate() {
            buffers.product.clear();
            buffers.product.extend(buffers.signal.iter().zip(spectrum).map(|(a, b)| a * b));
            self.inverse.process_with_scratch(&mut buffers.product, &mut buffers.scratch[..scratches[1]]);
            take(index, &buffers.product);
        }
    }

    /// The samples of the block whose first offset is `from`, as far as there are any.
    fn segment<'a>(&self, signal: &'a [T], from: usize) -> &'a [T] {
        &signal[from.min(signal.len())..signal.len().min(from + self.block)]
    }
}
