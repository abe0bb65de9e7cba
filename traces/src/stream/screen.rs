//! The distance of a template to every stretch, in f32: good enough to tell where minima are.

use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// Least length of a transform: its arrays stay in the first cache.
const LEAST_BLOCK: usize = 1 << 12;

/// A template's transform.
pub(super) struct Screen {
    forward: Arc<dyn RealToComplex<f32>>,
    inverse: Arc<dyn ComplexToReal<f32>>,
    spectrum: Vec<Complex<f32>>,
    own: f64,
    width: usize,
    block: usize,
}

/// What a thread works in.
#[derive(Default)]
pub(super) struct Buffers {
    real: Vec<f32>,
    complex: Vec<Complex<f32>>,
    scratch: Vec<Complex<f32>>,
    squares: Vec<f64>,
    /// For whoever calls: the signal and the profile of one task.
    pub signal: Vec<f32>,
    pub profile: Vec<f32>,
}

impl Screen {
    /// Prepares a template, W less the mean that signals will have taken off, too.
    pub fn new(centred: &[f64]) -> Self {
        let width = centred.len();
        let block = (16 * width).next_power_of_two().max(LEAST_BLOCK);
        let mut planner = RealFftPlanner::new();
        let (forward, inverse) = (planner.plan_fft_forward(block), planner.plan_fft_inverse(block));
        let mut padded = forward.make_input_vec();
        let mut spectrum = forward.make_output_vec();
        for (to, from) in padded.iter_mut().zip(centred) {
            // The factor -2 of the cross term, and the transforms' length.
            *to = (-2.0 * from / block as f64) as f32;
        }
        // Only a wrong length is refused, and the lengths are the plan's own.
        let _ = forward.process(&mut padded, &mut spectrum);
        spectrum.iter_mut().for_each(|value| *value = value.conj());
        Self { forward, inverse, spectrum, own: centred.iter().map(|x| x * x).sum(), width, block }
    }

    /// Lowers `into` to the summed squared difference at each offset, where that is less. `signal` is
    /// `width - 1` longer. By overlap and save (Oppenheim and Schafer 2010, section 8.7.3).
    pub fn lower(&self, signal: &[f32], into: &mut [f32], buffers: &mut Buffers) {
        let Buffers { real, complex, scratch, squares, .. } = buffers;
        running_squares(signal, squares);
        real.resize(self.block, 0.0);
        complex.resize(self.block / 2 + 1, Complex::default());
        scratch
            .resize(self.forward.get_scratch_len().max(self.inverse.get_scratch_len()), Complex::default());
        let step = self.block - self.width + 1;
        for (index, out) in into.chunks_mut(step).enumerate() {
            let from = index * step;
            let part = &signal[from..signal.len().min(from + self.block)];
            real[..part.len()].copy_from_slice(part);
            real[part.len()..].fill(0.0);
            let _ = self.forward.process_with_scratch(
                real,
                complex,
                &mut scratch[..self.forward.get_scratch_len()],
            );
            complex.iter_mut().zip(&self.spectrum).for_each(|(value, factor)| *value *= factor);
            // The first and the last bin of a real signal are real; rounding may leave them not quite so.
            complex[0].im = 0.0;
            complex[self.block / 2].im = 0.0;
            let _ = self.inverse.process_with_scratch(
                complex,
                real,
                &mut scratch[..self.inverse.get_scratch_len()],
            );
            let (before, after) = (&squares[from..], &squares[from + self.width..]);
            for (((value, cross), before), after) in out.iter_mut().zip(real.iter()).zip(before).zip(after) {
                let distance = ((after - before) + self.own) as f32 + cross;
                *value = if distance < *value { distance } else { *value };
            }
        }
    }
}

/// Sums of the squares before each sample, and of all.
fn running_squares(signal: &[f32], squares: &mut Vec<f64>) {
    squares.clear();
    squares.reserve(signal.len() + 1);
    squares.push(0.0);
    let mut sum = 0.0;
    squares.extend(signal.iter().map(|&x| {
        sum += f64::from(x) * f64::from(x);
        sum
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_the_screen_is_the_definition_to_f32() {
        let signal: Vec<f32> = (0..20_000).map(|i| ((i * 7919) % 1013) as f32 / 100.0 - 5.0).collect();
        let template: Vec<f64> = signal[3_000..3_250].iter().map(|&x| f64::from(x)).collect();
        let mut profile = vec![f32::INFINITY; signal.len() - 249];
        Screen::new(&template).lower(&signal, &mut profile, &mut Buffers::default());
        for (offset, &value) in profile.iter().enumerate() {
            let exact: f64 = template
                .iter()
                .zip(&signal[offset..])
                .map(|(t, &x)| (f64::from(x) - t) * (f64::from(x) - t))
                .sum();
            assert!((f64::from(value) - exact).abs() < 2e-2 + 1e-5 * exact, "{offset}: {value} {exact}");
        }
    }
}
