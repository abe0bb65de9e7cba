//! The distance of the nearest template to every stretch, in f32: good enough to tell where minima are.

use multiversion::multiversion;
use rustfft::num_complex::Complex;

use crate::overlap::{self, OverlapSave};

/// Least length of a transform: its arrays stay in the first cache, or nearly so.
const LEAST_BLOCK: usize = 1 << 12;

/// Templates of one width, ready to be compared.
pub(super) struct Screen {
    overlap: OverlapSave<f32>,
    /// Sum of squares of each template.
    own: Vec<f64>,
    width: usize,
}

/// What a thread works in.
#[derive(Default)]
pub(super) struct Buffers {
    overlap: overlap::Buffers<f32>,
    squares: Vec<f64>,
}

impl Screen {
    /// Prepares templates of equal width, W less the mean that signals will have taken off, too.
    pub fn new(centred: &[Vec<f64>]) -> Self {
        let width = centred.first().map_or(1, Vec::len);
        let block = (16 * width).next_power_of_two().max(LEAST_BLOCK);
        let own = centred.iter().map(|template| template.iter().map(|x| x * x).sum()).collect();
        // The factor is that of the cross term.
        Self { overlap: OverlapSave::new(centred, -2.0, block), own, width }
    }

    /// The summed squared difference of the nearest template at each offset. `signal` is `width - 1` longer.
    pub fn profile(&self, signal: &[f32], into: &mut [f32], buffers: &mut Buffers) {
        let Buffers { overlap, squares } = buffers;
        let step = self.overlap.step();
        for (index, out) in into.chunks_mut(2 * step).enumerate() {
            let from = index * 2 * step;
            running_squares(&signal[from..from + out.len() + self.width - 1], squares);
            out.fill(f32::INFINITY);
            let (first, second) = out.split_at_mut(step.min(out.len()));
            self.overlap.pair(signal, from, overlap, |template, crosses| {
                let own = self.own[template];
                lower(first, crosses, |cross| cross.re, squares, self.width, own);
                lower(second, crosses, |cross| cross.im, &squares[first.len()..], self.width, own);
            });
        }
    }
}

/// Lowers values to the distances that their cross terms, one part of each number, and the sums of squares up to each sample
/// make.
#[multiversion(targets("x86_64+avx2"))]
fn lower(
    values: &mut [f32],
    crosses: &[Complex<f32>],
    part: impl Fn(&Complex<f32>) -> f32,
    squares: &[f64],
    width: usize,
    own: f64,
) {
    // There may be no second block.
    let after = squares.get(width..).unwrap_or_default();
    for (((value, cross), before), after) in values.iter_mut().zip(crosses).zip(squares).zip(after) {
        let distance = ((after - before) + own) as f32 + part(cross);
        *value = if distance < *value { distance } else { *value };
    }
}

/// Samples that are summed up by themselves: one sum of all would wait for itself at every sample.
const GROUP: usize = 8;

/// Sums of the squares before each sample, and of all.
#[multiversion(targets("x86_64+avx2"))]
fn running_squares(signal: &[f32], squares: &mut Vec<f64>) {
    squares.resize(signal.len() + 1, 0.0);
    squares[0] = 0.0;
    let (groups, rest) = signal.as_chunks::<GROUP>();
    let (sums, rest_sums) = squares[1..].as_chunks_mut::<GROUP>();
    let mut sum = 0.0;
    for (group, sums) in groups.iter().zip(sums) {
        sum = add_up(group, sum, sums);
    }
    add_up(rest, sum, rest_sums);
}

/// The sum of what was before and the squares of a group, step by step.
#[inline(always)]
fn add_up(group: &[f32], before: f64, sums: &mut [f64]) -> f64 {
    let mut own = 0.0;
    for (&x, to) in group.iter().zip(sums) {
        own += f64::from(x) * f64::from(x);
        *to = before + own;
    }
    before + own
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn oracle_the_screen_is_the_definition_to_f32() {
        for samples in [250, 251, 4_096, 7_943, 20_000] {
            let signal: Vec<f32> = (0..samples).map(|i| ((i * 7919) % 1013) as f32 / 100.0 - 5.0).collect();
            let templates: Vec<Vec<f64>> = [0, samples / 3]
                .map(|from| (0..250).map(|j| f64::from(signal[(from + j) % samples])).collect())
                .into();
            let mut profile = vec![0.0; samples - 249];
            Screen::new(&templates).profile(&signal, &mut profile, &mut Buffers::default());
            for (offset, &value) in profile.iter().enumerate() {
                let square = |(t, x): (&f64, &f32)| (f64::from(*x) - t) * (f64::from(*x) - t);
                let exact = |template: &Vec<f64>| template.iter().zip(&signal[offset..]).map(square).sum();
                let exact = templates.iter().map(exact).fold(f64::INFINITY, f64::min);
                assert!((f64::from(value) - exact).abs() < 2e-2 + 1e-5 * exact, "{offset}: {value} {exact}");
            }
        }
    }
}
