//! Power spectrum of points: `|sum over points of exp(-2 pi i k x)|^2 / n` at integer frequencies `k`,
//! averaged over directions (Ulichney 1987).

use std::f64::consts::TAU;

use rayon::prelude::*;

/// Power averaged over all directions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spectrum {
    /// By frequency from 1: mean over all `k` with a length that rounds to it. White noise has power 1.
    pub power: Vec<f64>,
    /// Number of points.
    pub count: usize,
    dimensions: usize,
}

impl Spectrum {
    /// Spectrum of points of the unit cube up to frequency `most`. The time grows as `count x
    /// most^dimensions`.
    pub fn new<const D: usize>(points: &[[f64; D]], most: usize) -> Self {
        let waves: Vec<Vec<Waves>> = (0..D).map(|axis| waves(points, axis, most)).collect();
        let along = 2 * most + 1;
        let rows: Vec<Vec<(f64, f64)>> = (0..along.pow(D as u32 - 1))
            .into_par_iter()
            .map(|number| {
                let other = |axis: usize| (number / along.pow(axis as u32 - 1) % along) as i64 - most as i64;
                row(&waves, &(1..D).map(other).collect::<Vec<_>>(), points.len(), most)
            })
            .collect();
        let mut sums = vec![(0.0, 0.0); most + 1];
        for (frequency, (power, weight)) in rows.into_iter().flat_map(|row| row.into_iter().enumerate()) {
            sums[frequency].0 += power;
            sums[frequency].1 += weight;
        }
        let power = sums[1..].iter().map(|(power, weight)| power / weight.max(1.0)).collect();
        Self { power, count: points.len(), dimensions: D }
    }

    /// Mean of spectra up to the same frequency; empty for no spectra.
    pub fn mean(spectra: &[Self]) -> Self {
        let Some(first) = spectra.first() else { return Self::default() };
        let mean = |k: usize| spectra.iter().map(|s| s.power[k]).sum::<f64>() / spectra.len() as f64;
        Self {
            power: (0..first.power.len()).map(mean).collect(),
            count: first.count,
            dimensions: first.dimensions,
        }
    }

    /// Frequencies, in units of the mean rate of points along an axis, with their power.
    pub fn curve(&self) -> Vec<(f64, f64)> {
        let rate = (self.count as f64).powf(1.0 / self.dimensions as f64);
        (1..).zip(&self.power).map(|(k, &power)| (f64::from(k) / rate, power)).collect()
    }

    /// Mean power below half the rate.
    pub fn low(&self) -> f64 {
        let low: Vec<f64> =
            self.curve().iter().filter(|(at, _)| *at < 0.5).map(|(_, power)| *power).collect();
        low.iter().sum::<f64>() / low.len().max(1) as f64
    }

    /// Frequency and power of the highest peak, smoothed over three frequencies.
    pub fn peak(&self) -> (f64, f64) {
        let curve = self.curve();
        let smooth = curve.windows(3).map(|w| (w[1].0, (w[0].1 + w[1].1 + w[2].1) / 3.0));
        smooth.fold((0.0, 0.0), |best, at| if at.1 > best.1 { at } else { best })
    }
}

/// Cosine and sine of every point at a frequency along an axis.
type Waves = (Vec<f64>, Vec<f64>);

fn waves<const D: usize>(points: &[[f64; D]], axis: usize, most: usize) -> Vec<Waves> {
    let wave = |k: usize| {
        let angle = |point: &[f64; D]| TAU * (k as f64 * point[axis]).fract();
        let both = points.iter().map(|point| libm::sincos(angle(point)));
        both.map(|(sine, cosine)| (cosine, sine)).unzip()
    };
    (0..=most).into_par_iter().map(wave).collect()
}

/// Power and weight by length of `k`, over half of the frequencies along the first axis; the other half is
/// the mirror image.
fn row(waves: &[Vec<Waves>], others: &[i64], count: usize, most: usize) -> Vec<(f64, f64)> {
    let mut product = (vec![1.0; count], vec![0.0; count]);
    for (axis, &k) in others.iter().enumerate() {
        let (cosines, sines) = &waves[axis + 1][k.unsigned_abs() as usize];
        for n in 0..count {
            let (c, s) = (cosines[n], if k < 0 { -sines[n] } else { sines[n] });
            let (re, im) = (product.0[n], product.1[n]);
            (product.0[n], product.1[n]) = (re * c - im * s, re * s + im * c);
        }
    }
    let mut sums = vec![(0.0, 0.0); most + 1];
    let square: i64 = others.iter().map(|k| k * k).sum();
    for (first, (cosines, sines)) in waves[0].iter().enumerate() {
        let length = ((square + (first * first) as i64) as f64).sqrt().round() as usize;
        if length > most {
            break;
        }
        let (mut re, mut im) = (0.0, 0.0);
        for n in 0..count {
            re += product.0[n] * cosines[n] - product.1[n] * sines[n];
            im += product.0[n] * sines[n] + product.1[n] * cosines[n];
        }
        let weight = if first == 0 { 1.0 } else { 2.0 };
        sums[length].0 += weight * (re * re + im * im) / count as f64;
        sums[length].1 += weight;
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::random::Stream;

    #[test]
    fn a_lattice_has_power_at_its_own_frequency_alone() {
        let points: Vec<[f64; 2]> =
            (0..64).map(|n| [f64::from(n % 8) / 8.0, f64::from(n / 8) / 8.0]).collect();
        let spectrum = Spectrum::new(&points, 10);
        let at = |k: usize| spectrum.power[k - 1];
        assert!((1..8).all(|k| at(k) < 1e-20), "{spectrum:?}");
        // Of the frequencies whose length rounds to 8, four belong to the lattice, with power 64.
        let near = (-8..=8_i32).flat_map(|x| (-8..=8_i32).map(move |y| f64::from(x * x + y * y).sqrt()));
        let shell = near.filter(|length| length.round() == 8.0).count();
        assert!((at(8) - 4.0 * 64.0 / shell as f64).abs() < 1e-9, "{}", at(8));
    }

    #[test]
    fn white_noise_is_white_in_any_dimension() {
        let stream = Stream::new(3, 3);
        let line: Vec<[f64; 1]> = (0..4000).map(|n| [stream.unit(n)]).collect();
        let cloud: Vec<[f64; 3]> =
            (0..400).map(|n| std::array::from_fn(|k| stream.unit(9000 + n * 3 + k as u64))).collect();
        for power in [Spectrum::new(&line, 400).power, Spectrum::new(&cloud, 8).power] {
            let mean = power.iter().sum::<f64>() / power.len() as f64;
            assert!((mean - 1.0).abs() < 0.2, "{mean}");
        }
    }
}
