//! Sample patterns: how the samples of a pixel are distributed over pixel, lens and shutter. Also hashed samples:
//! plain random samples, reproducible to the bit in other programs.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};

use super::{LensShape, Sample, SampleSource};
use crate::random::{GOLDEN, mix, word};

/// Distribution of the samples of a pixel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Pattern {
    /// First points of the five-dimensional Sobol sequence, Owen scrambled by pixel and dimension (Laine and
    /// Karras 2011, constants of Burley 2020).
    #[default]
    Owen,
    /// First points of the unscrambled Sobol sequence (Joe and Kuo 2008), the same in every pixel.
    Sobol,
    /// Independent uniform numbers, hashed from the seed.
    Random,
    /// Jittered (Cook 1986). Pixel and lens are each divided into as many cells as there are samples, the
    /// shutter into as many intervals. Each has one random point, and they are paired at random.
    Jittered,
    /// A fixed set of lens positions and times, shared by all pixels. Each pixel uses a range of the set, and
    /// its neighbours the following ranges, in the order of a Z-curve (interleaved sampling, Keller and
    /// Heidrich 2001). With as many points as samples all pixels have the same ones. The set is the first
    /// points of the scrambled Sobol sequence; positions in the pixel are those of [`Pattern::Owen`].
    Interleaved {
        /// Points of the set, best a power of two and a multiple of the samples of a pixel.
        #[serde(deserialize_with = "points")]
        points: u32,
    },
    /// The standard positions of multisample antialiasing with 1, 2, 4, 8 or 16 samples, the same in every
    /// pixel, at the centre of the lens and in the middle of the shutter (Direct3D 11 Functional
    /// Specification 3.0, section 19.2.4).
    Multisample,
    /// The same as [`Pattern::Interleaved`] with a given set: `(u, v, t)` on the lens and in time, used unchanged.
    Given {
        /// Lens coordinates from -1 to 1, time from 0 to below 1.
        #[serde(deserialize_with = "given")]
        points: Vec<(f32, f32, f32)>,
    },
}

fn points<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
    let count = u32::deserialize(from)?;
    let fits = Pattern::POINTS.contains(&count);
    fits.then_some(count).ok_or_else(|| D::Error::custom(format!("{count} points; it takes 1 to 65536")))
}

fn given<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<(f32, f32, f32)>, D::Error> {
    let points = Vec::<(f32, f32, f32)>::deserialize(from)?;
    if !Pattern::POINTS.contains(&(points.len() as u32)) {
        return Err(D::Error::custom(format!("{} points; it takes 1 to 65536", points.len())));
    }
    match points.iter().position(|&point| !in_range(point)) {
        Some(index) => Err(D::Error::custom(format!(
            "point {index} lies outside [-1, 1] in u or v, or outside [0, 1) in t"
        ))),
        None => Ok(points),
    }
}

fn in_range((u, v, t): (f32, f32, f32)) -> bool {
    Sample { u, v, t, ..Sample::default() }.is_in_range()
}

/// Dimension of a number in the Sobol sequence and in hashes.
const X: usize = 0;
const Y: usize = 1;
const U: usize = 2;
const V: usize = 3;
const T: usize = 4;

impl Pattern {
    /// Allowed number of points of a fixed set.
    pub const POINTS: std::ops::RangeInclusive<u32> = 1..=65_536;

    /// Whether `u, v` are lens positions rather than points of the unit square.
    pub(super) fn is_on_lens(&self) -> bool {
        matches!(self, Self::Given { .. } | Self::Multisample)
    }

    /// Whether there is a pattern of so many samples.
    pub(super) fn has(&self, per_pixel: u32) -> bool {
        *self != Self::Multisample || !multisample(per_pixel).is_empty()
    }

    /// Whether the points are valid in number and range.
    pub(super) fn is_sane(&self) -> bool {
        match self {
            Self::Interleaved { points } => Self::POINTS.contains(points),
            Self::Given { points } => {
                Self::POINTS.contains(&(points.len() as u32)) && points.iter().all(|&point| in_range(point))
            }
            _ => true,
        }
    }

    /// Fill the samples of pixel (`px`, `py`) of a block `side` pixels wide. `u, v` are in the unit square
    /// unless [`Self::is_on_lens`].
    pub(super) fn fill(&self, seed: u64, [px, py]: [u32; 2], side: u32, into: &mut [Sample]) {
        let pixel = py * side + px;
        let run = z_curve(px, py) * into.len() as u64;
        if matches!(self, Self::Jittered) {
            return jittered(seed, pixel, into);
        }
        let fixed = multisample(into.len() as u32);
        for (sample, index) in into.iter_mut().zip(0_u32..) {
            let scrambled =
                |dim| fraction(owen(sobol(index, dim), word(seed, pixel.into(), dim as u64) as u32));
            let all = |of: &dyn Fn(usize) -> f32| from_array([X, Y, U, V, T].map(of));
            let in_set = |count: usize| ((run + u64::from(index)) % count as u64) as u32;
            let here = Sample { x: scrambled(X), y: scrambled(Y), ..Sample::default() };
            *sample = match self {
                Self::Owen => all(&scrambled),
                Self::Sobol => all(&|dim| fraction(sobol(index, dim))),
                Self::Random | Self::Jittered => all(&|dim| random(seed, pixel, index, dim)),
                Self::Interleaved { points } => {
                    let at = in_set(*points as usize);
                    let set = |dim| fraction(owen(sobol(at, dim), word(seed, u64::MAX, dim as u64) as u32));
                    Sample { u: set(U), v: set(V), t: set(T), ..here }
                }
                Self::Given { points } => {
                    let (u, v, t) = points[in_set(points.len()) as usize];
                    Sample { u, v, t, ..here }
                }
                Self::Multisample => {
                    let [x, y] = fixed[index as usize].map(|sixteenths| 0.5 + f32::from(sixteenths) / 16.0);
                    Sample { x, y, t: 0.5, ..Sample::default() }
                }
            };
        }
    }
}

/// Standard positions of this many samples in sixteenths of a pixel from its centre, `y` downwards; empty for
/// other numbers.
fn multisample(count: u32) -> &'static [[i8; 2]] {
    match count {
        1 => &[[0, 0]],
        2 => &[[4, 4], [-4, -4]],
        4 => &[[-2, -6], [6, -2], [-6, 2], [2, 6]],
        8 => &[[1, -3], [-1, 3], [5, 1], [-3, -5], [-5, 5], [-7, -1], [3, 7], [7, -7]],
        16 => &[
            [1, 1],
            [-1, -3],
            [-3, 2],
            [4, -1],
            [-5, -2],
            [2, 5],
            [5, 3],
            [3, -5],
            [-2, 6],
            [0, -7],
            [-4, -6],
            [-6, 4],
            [-8, 0],
            [7, -4],
            [6, 7],
            [-7, -8],
        ],
        _ => &[],
    }
}

fn from_array([x, y, u, v, t]: [f32; 5]) -> Sample {
    Sample { x, y, u, v, t }
}

/// 24 bits, so that the fraction is exact in f32 and below 1.
fn fraction(bits: u32) -> f32 {
    (bits >> 8) as f32 / 16_777_216.0
}

fn random(seed: u64, pixel: u32, index: u32, dim: usize) -> f32 {
    fraction((word(word(seed, pixel.into(), index.into()), dim as u64, 0) >> 32) as u32)
}

/// Position of a pixel on a Z-curve: the interleaved bits of its column and row (Morton 1966).
fn z_curve(px: u32, py: u32) -> u64 {
    (0..32).fold(0, |code, bit| {
        let [x, y] = [px, py].map(|c| u64::from(c >> bit & 1));
        code | x << (2 * bit) | y << (2 * bit + 1)
    })
}

fn jittered(seed: u64, pixel: u32, into: &mut [Sample]) {
    let count = into.len() as u32;
    let columns = columns(count);
    let rows = count / columns;
    let [lens, time] = [U, T].map(|dim| shuffled(seed, pixel, count, dim));
    for (sample, index) in into.iter_mut().zip(0_u32..) {
        let r = |dim| f64::from(random(seed, pixel, index, dim));
        let within = |cell: u32, of: u32, dim| below_one((f64::from(cell) + r(dim)) / f64::from(of));
        let (on_lens, at) = (lens[index as usize], time[index as usize]);
        *sample = Sample {
            x: within(index % columns, columns, X),
            y: within(index / columns, rows, Y),
            u: within(on_lens % columns, columns, U),
            v: within(on_lens / columns, rows, V),
            t: within(at, count, T),
        };
    }
}

fn below_one(value: f64) -> f32 {
    (value as f32).min(1.0 - f32::EPSILON / 2.0)
}

/// Largest divisor of `count` up to its square root, for cells as square as possible.
fn columns(count: u32) -> u32 {
    (1..=count.isqrt()).rev().find(|&columns| count.is_multiple_of(columns)).unwrap_or(1)
}

/// Numbers below `count` in random order (Fisher and Yates 1938, downwards).
fn shuffled(seed: u64, pixel: u32, count: u32, dim: usize) -> Vec<u32> {
    let mut order: Vec<u32> = (0..count).collect();
    for last in (1..count).rev() {
        let pick = word(word(!seed, pixel.into(), dim as u64), last.into(), 1) % u64::from(last + 1);
        order.swap(last as usize, pick as usize);
    }
    order
}

/// Primitive polynomial degree, coefficients and initial odd numbers of dimensions 2 to 5. Direction numbers:
/// Joe and Kuo 2008, `new-joe-kuo-6`, dimensions 1 to 5.
const JOE_KUO: [(usize, u32, &[u32]); 4] =
    [(1, 0, &[1]), (2, 1, &[1, 3]), (3, 1, &[1, 3, 1]), (3, 2, &[1, 1, 1])];

const fn directions() -> [[u32; 32]; 5] {
    let mut v = [[0_u32; 32]; 5];
    let mut bit = 0;
    while bit < 32 {
        v[0][bit] = 1 << (31 - bit);
        bit += 1;
    }
    let mut dim = 0;
    while dim < 4 {
        let (degree, coefficients, initial) = JOE_KUO[dim];
        let mut i = 0;
        while i < 32 {
            v[dim + 1][i] = if i < degree {
                initial[i] << (31 - i)
            } else {
                let mut value = v[dim + 1][i - degree] ^ (v[dim + 1][i - degree] >> degree);
                let mut k = 1;
                while k < degree {
                    if (coefficients >> (degree - 1 - k)) & 1 == 1 {
                        value ^= v[dim + 1][i - k];
                    }
                    k += 1;
                }
                value
            };
            i += 1;
        }
        dim += 1;
    }
    v
}

const DIRECTIONS: [[u32; 32]; 5] = directions();

/// Point `index` of dimension `dim` (0 to 4) as a 32-bit fraction.
pub(super) fn sobol(index: u32, dim: usize) -> u32 {
    let mut bits = index;
    let mut value = 0;
    while bits != 0 {
        value ^= DIRECTIONS[dim][bits.trailing_zeros() as usize];
        bits &= bits - 1;
    }
    value
}

/// Nested uniform scrambling of a 32-bit fraction, which preserves the net structure and randomizes the rest
/// (Laine and Karras 2011 as improved by Burley 2020, "Practical Hash-based Owen Scrambling", listing 3).
pub(super) fn owen(value: u32, seed: u32) -> u32 {
    let mut x = value.reverse_bits();
    x ^= x.wrapping_mul(0x3D20_ADEA);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6C56);
    x ^= x.wrapping_mul(0x53A2_2864);
    x.reverse_bits()
}

/// Independent uniform samples, each a hash of (seed, pixel, index).
///
/// All arithmetic is modulo 2^64, with `G = 0x9E3779B97F4A7C15` and `index = (py * width + px) * per_pixel +
/// s`. Then `state = mix(seed + G (index + 1))`, and the numbers are `r(d) = mix(state + G (d + 1)) >> 40`,
/// 24 bits each. `x, y, t` are `r(0), r(1), r(2)` over 2^24. The lens uses the first pair `2 r(3 + 2k) -
/// 2^24, 2 r(4 + 2k) - 2^24` inside the disk, or the first pair for a square.
#[derive(Clone, Copy, Debug)]
pub struct HashedSamples {
    seed: u64,
    width: u32,
    per_pixel: u32,
    shape: LensShape,
}

/// 2^24.
const RANGE: i64 = 1 << 24;

impl HashedSamples {
    /// Samples for an image of `width` pixels, or `None` if `per_pixel` is not 1 to 256.
    pub fn new(seed: u64, width: u32, per_pixel: u32, shape: LensShape) -> Option<Self> {
        (1..=256).contains(&per_pixel).then_some(Self { seed, width, per_pixel, shape })
    }

    fn sample(&self, index: u64) -> Sample {
        let state = mix(self.seed.wrapping_add(GOLDEN.wrapping_mul(index.wrapping_add(1))));
        let number = |d: u64| mix(state.wrapping_add(GOLDEN.wrapping_mul(d + 1))) >> 40;
        let unit = |d: u64| number(d) as f32 / RANGE as f32;
        let place = |d: u64| 2 * number(d) as i64 - RANGE;
        let mut pair = 3;
        let [u, v] = loop {
            let [u, v] = [place(pair), place(pair + 1)];
            let inside = match self.shape {
                LensShape::Square => true,
                LensShape::Disk => u * u + v * v < RANGE * RANGE,
                polygon => polygon.contains([u, v].map(|c| c as f32 / RANGE as f32)),
            };
            if inside {
                break [u, v];
            }
            pair += 2;
        };
        Sample { x: unit(0), y: unit(1), u: u as f32 / RANGE as f32, v: v as f32 / RANGE as f32, t: unit(2) }
    }
}

impl SampleSource for HashedSamples {
    fn per_pixel(&self) -> u32 {
        self.per_pixel
    }

    fn pixel_into(&self, px: u32, py: u32, into: &mut [Sample]) {
        let first = (u64::from(py) * u64::from(self.width) + u64::from(px)) * u64::from(self.per_pixel);
        for (sample, index) in into.iter_mut().zip(first..) {
            *sample = self.sample(index);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixel(pattern: &Pattern, at: [u32; 2], count: usize) -> Vec<Sample> {
        let mut samples = vec![Sample::default(); count];
        pattern.fill(9, at, 64, &mut samples);
        samples
    }

    fn strata(values: impl Iterator<Item = f32>, count: usize) -> Vec<usize> {
        let mut strata: Vec<usize> = values.map(|value| (value * count as f32) as usize).collect();
        strata.sort_unstable();
        strata
    }

    #[test]
    fn jittered_samples_have_a_cell_each() {
        for count in [1, 4, 7, 12, 16, 256] {
            let samples = pixel(&Pattern::Jittered, [3, 5], count);
            let each: Vec<usize> = (0..count).collect();
            assert_eq!(strata(samples.iter().map(|s| s.t), count), each);
            let across = columns(count as u32) as usize;
            let cell = |a: f32, b: f32| {
                (a * across as f32) as usize + (b * (count / across) as f32) as usize * across
            };
            for cells in [|s: &Sample| (s.x, s.y), |s: &Sample| (s.u, s.v)] {
                let mut found: Vec<usize> = samples.iter().map(cells).map(|(a, b)| cell(a, b)).collect();
                found.sort_unstable();
                assert_eq!(found, each, "{count} samples");
            }
        }
    }

    #[test]
    fn random_samples_are_uniform_and_differ_by_pixel() {
        let pattern = Pattern::Random;
        assert_ne!(pixel(&pattern, [0, 0], 4), pixel(&pattern, [1, 0], 4));
        let all: Vec<Sample> = (0..64).flat_map(|px| pixel(&pattern, [px, 7], 64)).collect();
        for of in [|s: &Sample| s.x, |s: &Sample| s.y, |s: &Sample| s.u, |s: &Sample| s.v, |s: &Sample| s.t] {
            let mean = all.iter().map(|s| f64::from(of(s))).sum::<f64>() / 4096.0;
            // Four standard errors of the mean of 4096 uniform numbers.
            assert!((mean - 0.5).abs() < 4.0 / (12.0_f64 * 4096.0).sqrt(), "{mean}");
        }
    }

    #[test]
    fn plain_sobol_is_the_same_everywhere() {
        let here = pixel(&Pattern::Sobol, [0, 0], 4);
        assert_eq!(here, pixel(&Pattern::Sobol, [40, 9], 4));
        assert_eq!((here[0], here[1].t), (Sample::default(), 0.5));
    }

    #[test]
    fn two_by_two_pixels_share_a_set_of_four_runs() {
        let pattern = Pattern::Interleaved { points: 64 };
        let uvt = |s: &Sample| [s.u, s.v, s.t].map(f32::to_bits);
        let set = |origin: [u32; 2]| {
            let corners = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[x, y]| [origin[0] + x, origin[1] + y]);
            let mut set: Vec<_> =
                corners.iter().flat_map(|&at| pixel(&pattern, at, 16)).map(|s| uvt(&s)).collect();
            set.sort_unstable();
            set
        };
        let mut distinct = set([0, 0]);
        assert_eq!(set([0, 0]), set([34, 6]), "every block of 2x2 holds the same set");
        distinct.dedup();
        assert_eq!(distinct.len(), 64);
        // With as many samples as points each pixel has all of them.
        let whole = |at| {
            let mut set: Vec<_> = pixel(&pattern, at, 64).iter().map(uvt).collect();
            set.sort_unstable();
            set
        };
        assert_eq!(whole([5, 9]), set([0, 0]));
    }

    #[test]
    fn given_points_are_taken_as_they_are() {
        let pattern = Pattern::Given { points: vec![(0.5, -1.0, 0.0), (-0.25, 1.0, 0.75)] };
        let samples = pixel(&pattern, [1, 0], 3);
        assert_eq!(samples.iter().map(|s| s.t).collect::<Vec<_>>(), [0.75, 0.0, 0.75]);
        assert_eq!(samples[0].u, -0.25);
        assert!(!Pattern::Given { points: vec![(0.0, 0.0, 1.0)] }.is_sane());
        assert!(!Pattern::Given { points: vec![] }.is_sane());
    }

    #[test]
    fn the_z_curve_fills_squares() {
        let mut first: Vec<u64> = (0..4).flat_map(|y| (0..4).map(move |x| z_curve(x, y))).collect();
        first.sort_unstable();
        assert_eq!(first, (0..16).collect::<Vec<_>>());
    }

    #[test]
    fn first_points_are_the_published_ones() {
        let point = |i| [0, 1, 2, 3, 4].map(|d| f64::from(sobol(i, d)) / 4_294_967_296.0);
        assert_eq!(point(1), [0.5; 5]);
        // Values of scipy 1.17's qmc.Sobol(5, scramble=False), whose Gray code order swaps these two.
        assert_eq!(point(2), [0.25, 0.75, 0.75, 0.75, 0.25]);
        assert_eq!(point(3), [0.75, 0.25, 0.25, 0.25, 0.75]);
    }

    #[test]
    fn every_dimension_is_stratified_scrambled_or_not() {
        for dim in 0..5 {
            for seed in [None, Some(1), Some(0xDEAD_BEEF)] {
                let mut strata: Vec<u32> =
                    (0..16).map(|i| seed.map_or(sobol(i, dim), |s| owen(sobol(i, dim), s)) >> 28).collect();
                strata.sort_unstable();
                assert_eq!(strata, (0..16).collect::<Vec<_>>(), "dimension {dim}, seed {seed:?}");
            }
        }
    }

    #[test]
    fn a_polygon_rejects_points_outside() {
        let shape = LensShape::Polygon { blades: 5, rotation_deg: 10 };
        let source = HashedSamples::new(3, 64, 16, shape).unwrap();
        let mut found = [Sample::default(); 16];
        source.pixel_into(5, 6, &mut found);
        assert!(found.iter().all(|s| shape.contains([s.u, s.v])));
    }

    #[test]
    fn the_first_samples_are_those_of_the_peer() {
        // Digest from an independent implementation (a ray caster on Embree): seed 71, 128x128, one sample
        // per pixel, little-endian bytes of x y u v t.
        let source = HashedSamples::new(71, 128, 1, LensShape::Disk).unwrap();
        let bytes = [
            [0x3d20_6530, 0x3f5c_690b, 0x3ddc_5ab0_u32, 0xbd88_efc0, 0x3f01_3905],
            [0x3f55_45c4, 0x3e20_c740, 0xbf1f_fc24, 0xbed1_a8ac, 0x3efb_39fc],
        ];
        for (index, [x, y, u, v, t]) in (0..).zip(bytes) {
            let mut found = [Sample::default()];
            source.pixel_into(index, 0, &mut found);
            let [x, y, u, v, t] = [x, y, u, v, t].map(f32::from_bits);
            assert_eq!(found, [Sample { x, y, u, v, t }]);
        }
    }
}
