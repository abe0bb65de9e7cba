//! Correlation of a template with a whole trace by the Fourier transform, block by block.

use rayon::prelude::*;
use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// Least length of a block: long enough that little is computed twice, short enough to stay in the caches.
const LEAST_BLOCK: usize = 1 << 14;

/// The transform of one template and what is needed to apply it.
pub(super) struct Correlator {
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
    spectrum: Vec<Complex<f64>>,
    width: usize,
    block: usize,
}

impl Correlator {
    /// Prepares a template.
    pub fn new(template: &[f64]) -> Self {
        let width = template.len();
        let block = (8 * width).next_power_of_two().max(LEAST_BLOCK);
        let mut planner = RealFftPlanner::new();
        let (forward, inverse) = (planner.plan_fft_forward(block), planner.plan_fft_inverse(block));
        let mut padded = forward.make_input_vec();
        let mut spectrum = forward.make_output_vec();
        for (to, from) in padded.iter_mut().zip(template) {
            *to = from / block as f64;
        }
        // Only a wrong length is refused, and the lengths are the plan's own.
        let _ = forward.process(&mut padded, &mut spectrum);
        for value in &mut spectrum {
            *value = value.conj();
        }
        Self { forward, inverse, spectrum, width, block }
    }

    /// `c[k] = sum over j of signal[k + j] template[j]`, at every offset at which the template fits.
    pub fn correlate(&self, signal: &[f64]) -> Vec<f64> {
        let Some(last) = signal.len().checked_sub(self.width) else { return Vec::new() };
        let mut out = vec![0.0; last + 1];
        let step = self.block - self.width + 1;
        out.par_chunks_mut(step).enumerate().for_each_init(
            || (self.forward.make_input_vec(), self.forward.make_output_vec(), self.forward.make_scratch_vec(), self.inverse.make_scratch_vec()),
            |(real, complex, scratch, back), (index, out)| {
                let from = &signal[index * step..signal.len().min(index * step + self.block)];
                real[..from.len()].copy_from_slice(from);
                real[from.len()..].fill(0.0);
                let _ = self.forward.process_with_scratch(real, complex, scratch);
                for (value, factor) in complex.iter_mut().zip(&self.spectrum) {
                    *value *= factor;
                }
                // The imaginary parts of the first and last bin of a real signal are zero; rounding may leave them not quite so.
                complex[0].im = 0.0;
                if let Some(last) = complex.last_mut() {
                    last.im = 0.0;
                }
                let _ = self.inverse.process_with_scratch(complex, real, back);
                out.copy_from_slice(&real[..out.len()]);
            },
        );
        out
    }
}
