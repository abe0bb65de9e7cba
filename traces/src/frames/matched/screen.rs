//! The distance of the nearest template to every window, in f32: exact enough to show where minima are; and
//! these minima, piece by piece.

use super::{MIN_NORM_SHARE, Template};

use crate::frames::profile::{self, OverlapSave};
use multiversion::multiversion;
use rustfft::num_complex::Complex;

/// Least length of a transform: its arrays nearly stay in the first cache.
const MIN_BLOCK_SAMPLES: usize = 1 << 12;

/// Templates of one width, ready to be compared.
pub(super) struct Screen {
    overlap: OverlapSave<f32>,
    /// Sum of squares of each template.
    own: Vec<f64>,
    normalized: bool,
    width: usize,
}

/// The buffers of a thread.
#[derive(Default)]
pub(super) struct Buffers {
    overlap: profile::Buffers<f32>,
    squares: Vec<f64>,
    norms: Vec<f64>,
}

impl Screen {
    /// Prepares templates of equal width for signals that have had `mean_w` taken off.
    pub fn new(templates: &[Template], mean_w: f64) -> Self {
        let width = templates.first().map_or(1, |template| template.watts.len());
        let normalized = templates.first().is_some_and(|template| template.normalized);
        let block = (16 * width).next_power_of_two().max(MIN_BLOCK_SAMPLES);
        let centred: Vec<Vec<f64>> = templates
            .iter()
            .map(|template| {
                let mean_w = if normalized { template.mean_w } else { mean_w };
                template.watts.iter().map(|watts| watts - mean_w).collect()
            })
            .collect();
        let own = centred.iter().map(|template| template.iter().map(|x| x * x).sum()).collect();
        // The factor is that of the cross term.
        Self { overlap: OverlapSave::new(&centred, -2.0, block), own, normalized, width }
    }

    /// The distance of the nearest template at each offset. `signal` is `width - 1` longer.
    pub fn profile(&self, signal: &[f32], into: &mut [f32], buffers: &mut Buffers) {
        let Buffers { overlap, squares, norms } = buffers;
        let step = self.overlap.step();
        for (index, out) in into.chunks_mut(2 * step).enumerate() {
            let from = index * 2 * step;
            let segment = &signal[from..from + out.len() + self.width - 1];
            running_squares(segment, squares);
            if self.normalized {
                window_norms(segment, squares, self.width, norms);
            }
            out.fill(f32::INFINITY);
            let (first, second) = out.split_at_mut(step.min(out.len()));
            self.overlap.pair(signal, from, overlap, |template, crosses| {
                let own = self.own[template];
                if self.normalized {
                    lower_normalized(first, crosses, |cross| cross.re, norms, own);
                    lower_normalized(second, crosses, |cross| cross.im, &norms[first.len()..], own);
                    return;
                }
                lower(first, crosses, |cross| cross.re, squares, self.width, own);
                lower(second, crosses, |cross| cross.im, &squares[first.len()..], self.width, own);
            });
        }
    }
}

/// Lowers values to the distances that their cross terms, one part of each number, and the sums of squares up
/// to each sample make.
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

/// As [`lower`], to normalized distances, from the norm of each window about its mean.
fn lower_normalized(
    values: &mut [f32],
    crosses: &[Complex<f32>],
    part: impl Fn(&Complex<f32>) -> f32,
    norms: &[f64],
    own: f64,
) {
    let norm = libm::sqrt(own);
    for ((value, cross), window) in values.iter_mut().zip(crosses).zip(norms) {
        let scale = norm / window.max(MIN_NORM_SHARE * norm).max(f64::MIN_POSITIVE);
        let distance = (2.0 * own + f64::from(part(cross)) * scale).max(0.0) as f32;
        *value = if distance < *value { distance } else { *value };
    }
}

/// The norm of every window about its mean, from the sums of squares before each sample.
fn window_norms(signal: &[f32], squares: &[f64], width: usize, norms: &mut Vec<f64>) {
    norms.clear();
    let mut sum: f64 = signal[..width].iter().map(|x| f64::from(*x)).sum();
    for from in 0..=signal.len() - width {
        let about = squares[from + width] - squares[from] - sum * sum / width as f64;
        norms.push(libm::sqrt(about.max(0.0)));
        let next = signal.get(from + width).map_or(0.0, |x| f64::from(*x));
        sum += next - f64::from(signal[from]);
    }
}

/// Samples that are summed by themselves: a single sum would wait for itself at every sample.
const GROUP_SAMPLES: usize = 8;

/// Sums of the squares before each sample, and of all.
#[multiversion(targets("x86_64+avx2"))]
fn running_squares(signal: &[f32], squares: &mut Vec<f64>) {
    squares.resize(signal.len() + 1, 0.0);
    squares[0] = 0.0;
    let (groups, rest) = signal.as_chunks::<GROUP_SAMPLES>();
    let (sums, rest_sums) = squares[1..].as_chunks_mut::<GROUP_SAMPLES>();
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

/// Offsets in `from..to` of `profile` (which begins before `from` and reaches beyond `to`) that are lowest
/// within less than `spacing` on either side; `from` is a multiple of `spacing` in the whole. Of ties, the
/// first of each segment of `spacing`; who joins segments drops those nearer than `spacing` to the one
/// before.
pub(super) fn minima(profile: &[f32], from: usize, to: usize, spacing: usize, mut take: impl FnMut(usize)) {
    let mut block = from;
    while block < to {
        let values = &profile[block..to.min(block + spacing)];
        let least = lowest(values);
        if let Some(at) = first(values, least) {
            let offset = block + at;
            let before = &profile[(offset + 1).saturating_sub(spacing)..offset];
            let after = &profile[offset + 1..profile.len().min(offset + spacing)];
            if least <= lowest(before) && least <= lowest(after) {
                take(offset);
            }
        }
        block += spacing;
    }
}

/// Values that are compared together: as many as the compiler keeps in few registers.
const LANES: usize = 16;

/// The lowest value; infinity of none.
#[multiversion(targets("x86_64+avx2"))]
fn lowest(values: &[f32]) -> f32 {
    let less = |a: f32, b: f32| if b < a { b } else { a };
    let mut lanes = [f32::INFINITY; LANES];
    let (chunks, rest) = values.as_chunks::<LANES>();
    // The last lanes once more, rather than the rest one by one.
    let again = values.last_chunk::<LANES>().filter(|_| !rest.is_empty());
    for chunk in chunks.iter().chain(again) {
        for (low, &value) in lanes.iter_mut().zip(chunk) {
            *low = less(*low, value);
        }
    }
    let few = if chunks.is_empty() { rest } else { &[] };
    few.iter().copied().chain(lanes).fold(f32::INFINITY, less)
}

/// The first index of a value.
#[multiversion(targets("x86_64+avx2"))]
fn first(values: &[f32], value: f32) -> Option<usize> {
    let (chunks, _) = values.as_chunks::<LANES>();
    // Without a way out from within a chunk.
    let without = chunks
        .iter()
        .take_while(|chunk| !chunk.iter().fold(false, |any, &other| any | (other == value)))
        .count();
    let from = without * LANES;
    Some(from + values[from..].iter().position(|&other| other == value)?)
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
            let watts: Vec<f64> = signal.iter().map(|x| f64::from(*x)).collect();
            for normalized in [false, true] {
                let templates: Vec<Template> =
                    templates.iter().map(|watts| Template::new(watts.clone(), normalized)).collect();
                Screen::new(&templates, 0.0).profile(&signal, &mut profile, &mut Buffers::default());
                for (offset, &value) in profile.iter().enumerate() {
                    let exact = |template: &Template| template.distance_w2(&watts[offset..]);
                    let exact = templates.iter().map(exact).fold(f64::INFINITY, f64::min);
                    assert!(
                        (f64::from(value) - exact).abs() < 2e-2 + 1e-5 * exact,
                        "{offset}: {value} {exact}"
                    );
                }
            }
        }
    }

    #[test]
    fn oracle_by_comparing_all() {
        let profile: Vec<f32> = (0..5000_u32).map(|i| (i * 7919 % 4999) as f32).collect();
        for spacing in [1, 2, 7, 40, 125] {
            let (from, to) = (spacing * 3, 4000);
            let mut found = Vec::new();
            minima(&profile, from, to, spacing, |offset| found.push(offset));
            let alone = |k: &usize| {
                let around = (k + 1).saturating_sub(spacing)..(k + spacing).min(profile.len());
                around.filter(|other| other != k).all(|other| profile[other] > profile[*k])
            };
            assert_eq!(found, (from..to).filter(alone).collect::<Vec<_>>(), "{spacing}");
        }
    }
}
