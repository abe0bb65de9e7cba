//! The distance of a template to every stretch, in f32: good enough to tell where minima are.

use multiversion::multiversion;

use crate::overlap::{self, OverlapSave};

/// Least length of a transform: its arrays stay in the first cache.
const LEAST_BLOCK: usize = 1 << 12;

/// A template, ready to be compared.
pub(super) struct Screen {
    overlap: OverlapSave<f32>,
    own: f64,
    width: usize,
}

/// What a thread works in.
#[derive(Default)]
pub(super) struct Buffers {
    overlap: overlap::Buffers<f32>,
    squares: Vec<f64>,
}

impl Screen {
    /// Prepares a template, W less the mean that signals will have taken off, too.
    pub fn new(centred: &[f64]) -> Self {
        let block = (16 * centred.len()).next_power_of_two().max(LEAST_BLOCK);
        // The factor is that of the cross term.
        let overlap = OverlapSave::new(centred, -2.0, block);
        Self { overlap, own: centred.iter().map(|x| x * x).sum(), width: centred.len() }
    }

    /// Lowers `into` to the summed squared difference at each offset, where that is less. `signal` is
    /// `width - 1` longer.
    pub fn lower(&self, signal: &[f32], into: &mut [f32], buffers: &mut Buffers) {
        let Buffers { overlap, squares } = buffers;
        running_squares(signal, squares);
        let step = self.overlap.step();
        for (index, out) in into.chunks_mut(step).enumerate() {
            let from = index * step;
            let crosses = self.overlap.block(self.overlap.stretch(signal, from), overlap);
            let (before, after) = (&squares[from..], &squares[from + self.width..]);
            lower(out, crosses, [before, after], self.own);
        }
    }
}

/// Lowers values to the distances that their cross terms and the sums of squares before and after make.
#[multiversion(targets("x86_64+avx2"))]
fn lower(values: &mut [f32], crosses: &[f32], [before, after]: [&[f64]; 2], own: f64) {
    for (((value, cross), before), after) in values.iter_mut().zip(crosses).zip(before).zip(after) {
        let distance = ((after - before) + own) as f32 + cross;
        *value = if distance < *value { distance } else { *value };
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
