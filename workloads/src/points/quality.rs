//! Quality measures of points.
//!
//! - [`least_distance`], [`closer_than`]: the minimum distance, exactly.
//! - [`largest_hole`], [`free_share`]: whether another point would fit.
//! - [`Spectrum`]: power over frequency, averaged over directions.
//! - [`chi_square`]: whether counts follow their expectation.
//!
//! `docs/guide/sampling.md` compares points by these values with those of other programs.

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::points::Stream;
use crate::points::poisson::{Domain, closer};

/// Result of the test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChiSquare {
    /// Sum of squared differences over the expectation.
    pub statistic: f64,
    /// Degrees of freedom: cells in use, less one.
    pub freedom: u64,
    /// Probability of at least this difference if the counts follow the expectation. Near 0 they do not
    /// follow it; near 1 they follow better than independent points would.
    pub p: f64,
}

/// Least expected count of a cell in use.
const MIN_EXPECTED: f64 = 5.0;

/// Tests counts against expected shares, which need not add up to 1.
pub fn chi_square(counts: &[u64], shares: &[f64]) -> ChiSquare {
    let (count, whole) = (counts.iter().sum::<u64>() as f64, shares.iter().sum::<f64>());
    let cells = counts.iter().zip(shares).map(|(&found, share)| (found as f64, share / whole * count));
    let used: Vec<(f64, f64)> = cells.filter(|(_, expected)| *expected >= MIN_EXPECTED).collect();
    let statistic = used.iter().map(|(found, expected)| (found - expected).powi(2) / expected).sum();
    let freedom = used.len().saturating_sub(1) as u64;
    ChiSquare { statistic, freedom, p: upper_tail(statistic, freedom) }
}

/// Probability that chi-square of `freedom` degrees is at least `statistic`: the regularized incomplete gamma
/// function Q(freedom / 2, statistic / 2), by its series or its continued fraction (Press et al. 2007,
/// section 6.2).
pub fn upper_tail(statistic: f64, freedom: u64) -> f64 {
    let (a, x) = (0.5 * freedom as f64, 0.5 * statistic);
    if a <= 0.0 || x <= 0.0 {
        return 1.0;
    }
    let front = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    if x < a + 1.0 { 1.0 - front * series(a, x) } else { front * fraction(a, x) }
}

fn series(a: f64, x: f64) -> f64 {
    let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
    while term > sum * 1e-16 {
        n += 1.0;
        term *= x / n;
        sum += term;
    }
    sum
}

/// Lentz's method.
fn fraction(a: f64, x: f64) -> f64 {
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut value = d;
    for i in 1..100_000 {
        let term = -f64::from(i) * (f64::from(i) - a);
        b += 2.0;
        d = 1.0 / (term * d + b);
        c = b + term / c;
        value *= d * c;
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    value
}

/// Points sorted by cell.
struct Buckets<'a, const D: usize> {
    points: &'a [[f64; D]],
    domain: Domain,
    across: i64,
    /// Start of each cell in `order`.
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl<'a, const D: usize> Buckets<'a, D> {
    /// Sorts points of the unit cube, about one per cell.
    pub fn new(points: &'a [[f64; D]], domain: Domain) -> Self {
        let across = ((points.len() as f64).powf(1.0 / D as f64) as i64).max(1);
        let mut buckets = Self { points, domain, across, starts: Vec::new(), order: Vec::new() };
        let cells: Vec<usize> = points.iter().map(|point| buckets.number(&buckets.cell(point))).collect();
        let mut starts = vec![0_u32; across.pow(D as u32) as usize + 1];
        cells.iter().for_each(|&cell| starts[cell + 1] += 1);
        (1..starts.len()).for_each(|cell| starts[cell] += starts[cell - 1]);
        let (mut next, mut order) = (starts.clone(), vec![0; points.len()]);
        for (point, &cell) in cells.iter().enumerate() {
            order[next[cell] as usize] = point as u32;
            next[cell] += 1;
        }
        (buckets.starts, buckets.order) = (starts, order);
        buckets
    }

    fn cell(&self, at: &[f64; D]) -> [i64; D] {
        at.map(|x| ((x * self.across as f64) as i64).clamp(0, self.across - 1))
    }

    fn number(&self, cell: &[i64; D]) -> usize {
        (0..D).rev().fold(0, |number, k| number * self.across as usize + cell[k] as usize)
    }

    /// Passes the points at a distance of exactly `ring` cells to `each`.
    fn ring(&self, around: &[i64; D], ring: i64, mut each: impl FnMut(u32)) {
        let along = 2 * ring + 1;
        for number in 0..along.pow(D as u32) {
            let away: [i64; D] = std::array::from_fn(|k| number / along.pow(k as u32) % along - ring);
            if away.iter().all(|at| at.abs() != ring) {
                continue;
            }
            let mut cell: [i64; D] = std::array::from_fn(|k| around[k] + away[k]);
            if self.domain == Domain::Torus {
                cell = cell.map(|at| at.rem_euclid(self.across));
            } else if cell.iter().any(|at| !(0..self.across).contains(at)) {
                continue;
            }
            let cell = self.number(&cell);
            let (from, to) = (self.starts[cell] as usize, self.starts[cell + 1] as usize);
            self.order[from..to].iter().for_each(|&point| each(point));
        }
    }

    fn distance2(&self, a: &[f64; D], b: &[f64; D]) -> f64 {
        let apart = |k: usize| {
            let apart = (a[k] - b[k]).abs();
            if self.domain == Domain::Torus { apart.min(1.0 - apart) } else { apart }
        };
        (0..D).map(|k| apart(k) * apart(k)).sum()
    }

    /// Distance from a position to the nearest point other than `but`.
    pub fn nearest(&self, at: &[f64; D], but: Option<u32>) -> f64 {
        let (cell, side) = (self.cell(at), 1.0 / self.across as f64);
        let mut least = f64::INFINITY;
        for ring in 0..=self.across {
            // Points of this ring are at least this far away.
            let reach = (ring - 1).max(0) as f64 * side;
            if least <= reach * reach {
                break;
            }
            self.ring(&cell, ring, |point| {
                if Some(point) != but {
                    least = least.min(self.distance2(at, &self.points[point as usize]));
                }
            });
        }
        least.sqrt()
    }
}

/// Smallest distance of two points of the unit cube; infinite for fewer than two.
pub fn least_distance<const D: usize>(points: &[[f64; D]], domain: Domain) -> f64 {
    let buckets = Buckets::new(points, domain);
    let nearest = points.iter().zip(0..).map(|(point, number)| buckets.nearest(point, Some(number)));
    nearest.fold(f64::INFINITY, f64::min)
}

/// Number of pairs of points, multiples of 2^-52, that are closer than `radius` (0 to 1/2), exactly.
pub fn closer_than<const D: usize>(points: &[[f64; D]], radius: f64, domain: Domain) -> u64 {
    let buckets = Buckets::new(points, domain);
    let rings = (radius * buckets.across as f64).ceil() as i64;
    // On a torus, wide rings would overlap themselves.
    let by_rings = domain == Domain::Box || 2 * rings < buckets.across;
    let mut pairs = 0;
    for (number, point) in (0..).zip(points) {
        let mut test = |other: u32| {
            let close = other > number && closer(point, &points[other as usize], radius, domain);
            pairs += u64::from(close);
        };
        if by_rings {
            (0..=rings).for_each(|ring| buckets.ring(&buckets.cell(point), ring, &mut test));
        } else {
            (0..points.len() as u32).for_each(test);
        }
    }
    pairs
}

/// Largest ball without a point, with its centre in the unit cube.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hole<const D: usize> {
    /// Centre; the middle of the cube if there is no hole.
    pub at: [f64; D],
    /// Distance from the centre to the nearest point.
    pub radius: f64,
    /// Upper bound of the radius.
    pub at_most: f64,
}

/// Relative difference of the bounds at which the search ends.
const MAX_RELATIVE_GAP: f64 = 1e-9;
/// Most halvings; smaller cubes are below rounding.
const MAX_LEVELS: u32 = 48;

/// Largest hole of at least one point, by branch and bound. The distance at a position is at most that at the
/// middle of a cube around it, plus half the cube's diagonal.
pub fn largest_hole<const D: usize>(points: &[[f64; D]], domain: Domain) -> Hole<D> {
    let buckets = Buckets::new(points, domain);
    let across = ((2.0 * points.len() as f64).powf(1.0 / D as f64) as u64).max(1);
    let cube = |n: u64| std::array::from_fn(|k| (n / across.pow(k as u32) % across) as f64 / across as f64);
    let mut cubes: Vec<[f64; D]> = (0..across.pow(D as u32)).map(cube).collect();
    let mut side = 1.0 / across as f64;
    let mut hole = Hole { at: [0.5; D], radius: 0.0, at_most: f64::INFINITY };
    for _ in 0..MAX_LEVELS {
        let half_diagonal = 0.5 * side * (D as f64).sqrt();
        let tested: Vec<_> = cubes.iter().map(|low| at_middle(&buckets, low, side)).collect();
        for (at, radius) in &tested {
            if *radius > hole.radius {
                hole = Hole { at: *at, radius: *radius, ..hole };
            }
        }
        let enough = hole.radius * (1.0 + MAX_RELATIVE_GAP);
        let remaining = cubes.iter().zip(&tested).filter(|(_, (_, radius))| radius + half_diagonal > enough);
        let remaining: Vec<&[f64; D]> = remaining.map(|(low, _)| low).collect();
        hole.at_most = if remaining.is_empty() { enough } else { hole.radius + half_diagonal };
        if remaining.is_empty() {
            break;
        }
        side *= 0.5;
        cubes = remaining.into_iter().flat_map(|low| children(low, side)).collect();
    }
    hole
}

fn at_middle<const D: usize>(buckets: &Buckets<'_, D>, low: &[f64; D], side: f64) -> ([f64; D], f64) {
    let middle = low.map(|low| low + 0.5 * side);
    (middle, buckets.nearest(&middle, None))
}

fn children<const D: usize>(low: &[f64; D], side: f64) -> impl Iterator<Item = [f64; D]> {
    (0..1_u32 << D).map(move |corner| std::array::from_fn(|k| low[k] + f64::from(corner >> k & 1) * side))
}

/// Share of the unit cube that is farther than `radius` from all points, estimated with `darts` random
/// positions.
pub fn free_share<const D: usize>(points: &[[f64; D]], radius: f64, domain: Domain, darts: u64) -> f64 {
    let (buckets, stream) = (Buckets::new(points, domain), Stream::new(0, 0xF4EE));
    let at = |n: u64| std::array::from_fn(|k| stream.unit(n * D as u64 + k as u64));
    let free = (0..darts).filter(|&n| buckets.nearest(&at(n), None) > radius).count();
    free as f64 / darts as f64
}

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
    use crate::points::Stream;

    #[test]
    fn tails_agree_with_tables() {
        // Two degrees of freedom are an exponential; the others are percentiles of printed tables.
        for x in [0.1, 1.0, 5.0, 40.0] {
            assert!((upper_tail(x, 2) / (-0.5_f64 * x).exp() - 1.0).abs() < 1e-13);
        }
        for (x, freedom, p) in
            [(3.841_459, 1, 0.05), (18.307_04, 10, 0.05), (124.342_1, 100, 0.05), (2.558_212, 10, 0.99)]
        {
            assert!((upper_tail(x, freedom) - p).abs() < 1e-6, "{freedom}: {}", upper_tail(x, freedom));
        }
    }

    #[test]
    fn p_is_low_for_wrong_counts_and_high_for_too_even_ones() {
        let shares = [1.0; 50];
        assert_eq!(chi_square(&[100; 50], &shares).p, 1.0);
        let far: Vec<u64> = (0..50).map(|n| 80 + 40 * (n % 2)).collect();
        assert!(chi_square(&far, &shares).p < 1e-6);
        assert_eq!(chi_square(&[100, 0], &[1.0, 1e-6]).freedom, 0);
    }

    fn cloud<const D: usize>(count: u64) -> Vec<[f64; D]> {
        let stream = Stream::new(7, D as u64);
        let at = |n: u64, k: usize| stream.unit(n * D as u64 + k as u64);
        (0..count).map(|n| std::array::from_fn(|k| (at(n, k) * 4096.0).floor() / 4096.0)).collect()
    }

    fn agrees<const D: usize>(count: u64) {
        let points = cloud::<D>(count);
        for domain in [Domain::Torus, Domain::Box] {
            let buckets = Buckets::new(&points, domain);
            for (at, number) in cloud::<D>(count).iter().zip(0..) {
                let others = points.iter().zip(0..).filter(|(_, other)| *other != number);
                let brute = others.map(|(p, _)| buckets.distance2(at, p)).fold(f64::INFINITY, f64::min);
                assert_eq!(buckets.nearest(at, Some(number)), brute.sqrt());
            }
            for radius in [0.01, 0.11, 0.35, 0.5] {
                let mut brute = 0;
                for (number, a) in points.iter().enumerate() {
                    brute += points[number + 1..].iter().filter(|b| closer(a, b, radius, domain)).count();
                }
                assert_eq!(closer_than(&points, radius, domain), brute as u64, "{D} {domain:?} {radius}");
            }
        }
    }

    #[test]
    fn neighbours_agree_with_brute_force() {
        agrees::<1>(40);
        agrees::<2>(150);
        agrees::<3>(120);
        agrees::<4>(90);
        assert_eq!(least_distance::<2>(&[[0.5, 0.5]], Domain::Box), f64::INFINITY);
    }

    #[test]
    fn the_hole_of_a_lattice_is_at_the_middle_of_its_cells() {
        let points: Vec<[f64; 2]> =
            (0..64).map(|n| [f64::from(n % 8) / 8.0, f64::from(n / 8) / 8.0]).collect();
        let hole = largest_hole(&points, Domain::Torus);
        let expected = 0.5_f64.sqrt() / 8.0;
        assert!((hole.radius / expected - 1.0).abs() < 1e-9 && hole.at_most >= expected, "{hole:?}");
        // Without the periodic border the far corner is alone.
        let hole = largest_hole(&points, Domain::Box);
        assert!((hole.radius / (2.0 * expected) - 1.0).abs() < 1e-8, "{hole:?}");
    }

    #[test]
    fn one_missing_point_is_found() {
        let mut points: Vec<[f64; 3]> =
            (0..125).map(|n| [n % 5, n / 5 % 5, n / 25].map(|at| f64::from(at) / 5.0)).collect();
        points.remove(62);
        let hole = largest_hole(&points, Domain::Torus);
        assert!((hole.radius - 0.2).abs() < 1e-8, "{hole:?}");
        let free = free_share(&points, 0.18, Domain::Torus, 100_000);
        assert!(free > 0.0 && free < 0.0003, "{free}");
        assert_eq!(free_share(&points, 0.2001, Domain::Torus, 20_000), 0.0);
    }

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
