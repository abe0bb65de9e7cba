//! Random points in squares, cubes, volumes and densities (thesis, Paper VI, section 5).
//!
//! - [`poisson`]: maximal Poisson disk points, by dart throwing over uncovered regions; [`rivals`]: other
//!   methods.
//! - [`volume`]: uniform points in volumes bounded by moving triangles, and in closed surfaces.
//! - [`white`]: independent points that follow a density, in one to four dimensions.
//! - [`noise`]: the same, from columns that are drawn, one dimension higher.
//! - [`job`]: all three drawn on the modelled hardware, as a workload.
//! - [`quality`]: minimum distance, holes, spectra, chi-square; [`thin_regions_warning`]: when precision
//!   limits the result.

mod drawn;
pub mod job;
pub mod noise;
pub mod poisson;
pub mod quality;
pub mod rivals;
pub mod volume;
pub mod white;

use pipeline::random::{mix, unit};
use warnings::{Code, Warning};

const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// A sequence of random words with random access: SplitMix64 (Steele, Lea, Flood 2014) with its own start.
#[derive(Clone, Copy, Debug)]
struct Stream(u64);

impl Stream {
    /// Stream of a seed for one purpose.
    pub fn new(seed: u64, purpose: u64) -> Self {
        Self(mix(mix(seed.wrapping_add(GOLDEN)) ^ mix(GOLDEN.wrapping_mul(purpose.wrapping_add(2)))))
    }

    /// Sub-stream for one of many items.
    #[inline]
    pub fn of(self, number: u64) -> Self {
        Self(mix(self.0 ^ mix(number.wrapping_add(GOLDEN))))
    }

    /// Word at a position.
    #[inline]
    pub fn word(self, at: u64) -> u64 {
        mix(self.0.wrapping_add(GOLDEN.wrapping_mul(at.wrapping_add(1))))
    }

    /// Number in [0, 1), a multiple of 2^-53.
    #[inline]
    pub fn unit(self, at: u64) -> f64 {
        unit(self.word(at))
    }

    /// Integer below `count`.
    #[inline]
    pub fn below(self, at: u64, count: u64) -> u64 {
        ((u128::from(self.word(at)) * u128::from(count)) >> 64) as u64
    }
}

/// Thin uncovered regions per point above which a warning is given.
pub const MAX_THIN_PER_POINT: f64 = 0.01;

/// Warns if dart throwing left many uncovered regions without a representable point.
pub fn thin_regions_warning(points: usize, thin_regions: u64) -> Option<Warning> {
    let per_point = thin_regions as f64 / points.max(1) as f64;
    (per_point > MAX_THIN_PER_POINT).then(|| {
        Warning::new(
            Code::PointsThinRegions,
            format!(
                "{thin_regions} uncovered regions among {points} points contain no number of the coordinates' format (more than one per {:.0} \
                 points): no point can be written there, so places farther than r from all points remain; use double \
                 precision or a larger r",
                1.0 / MAX_THIN_PER_POINT
            ),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::poisson::{Domain, PoissonSpec, Spacing, poisson_disk};
    use super::*;

    #[test]
    fn numbers_are_uniform_and_streams_independent() {
        let (one, other) = (Stream::new(1, 0), Stream::new(1, 1));
        let mean = (0..10_000).map(|at| one.unit(at)).sum::<f64>() / 1e4;
        assert!((mean - 0.5).abs() < 0.01, "{mean}");
        let both: f64 = (0..10_000).map(|at| (one.unit(at) - 0.5) * (other.unit(at) - 0.5)).sum();
        assert!(both.abs() / 1e4 < 0.005, "{both}");
        assert!((0..10_000).all(|at| one.below(at, 7) < 7));
    }

    #[test]
    fn coarse_coordinates_are_warned_about_and_fine_ones_are_not() {
        let warned = |bits| {
            let spec =
                PoissonSpec { radius: 0.03, domain: Domain::Torus, seed: 1, spacing: Spacing::Bits(bits) };
            let found = poisson_disk::<2>(&spec).unwrap();
            thin_regions_warning(found.points.len(), found.thin_regions).is_some()
        };
        assert!(warned(12) && !warned(24) && !warned(52));
        assert!(thin_regions_warning(0, 0).is_none());
    }
}
