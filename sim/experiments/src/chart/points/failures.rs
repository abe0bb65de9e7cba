//! Failure modes: voids thinner than an ulp, and densities that columns do not follow.

use serde::Serialize;
use workloads::points::poisson::{Domain, PoissonError, PoissonSpec, Spacing, poisson_disk};
use workloads::points::quality::{chi_square, largest_hole};
use workloads::points::white::{Density, Named, Numbers, WhiteError, WhiteSpec, counts, shares, white_noise};

use super::Effort;

/// Poisson-disk points of the plane on coarse numbers.
#[derive(Clone, Debug, Serialize)]
pub struct Coarse {
    /// Coordinates are multiples of 2 to the power of minus this.
    pub bits: u32,
    /// The least distance in spacings of numbers.
    pub radius_in_numbers: f64,
    /// How many points there are.
    pub points: usize,
    /// Voids left, without a number in them.
    pub thin_voids: u64,
    /// How far the largest hole is beyond r, as a share of r.
    pub beyond: f64,
}

/// The least distance of the points on coarse numbers: what fails depends on how many numbers wide it is alone.
pub(super) const COARSE_RADIUS: f64 = 1.0 / 64.0;
/// The coarsest numbers with which that can be asked for.
const COARSEST_BITS: u32 = 12;

/// Finer and finer numbers, from disks on that are as few numbers wide as may be.
pub(super) fn coarse(effort: &Effort) -> Result<Vec<Coarse>, PoissonError> {
    let each = (COARSEST_BITS..=effort.finest_bits).step_by(2).map(|bits| {
        let spacing = Spacing::Bits(bits);
        let spec = PoissonSpec { radius: COARSE_RADIUS, domain: Domain::Torus, seed: 1, spacing };
        let found = poisson_disk::<2>(&spec)?;
        let hole = largest_hole(&found.points, Domain::Torus);
        Ok(Coarse {
            bits,
            radius_in_numbers: COARSE_RADIUS * spacing.per_unit(),
            points: found.points.len(),
            thin_voids: found.thin_regions,
            beyond: (hole.radius / COARSE_RADIUS - 1.0).max(0.0),
        })
    });
    each.collect()
}

/// Points that follow the bell.
#[derive(Clone, Debug, Serialize)]
pub struct Columns {
    /// In how many dimensions.
    pub dimensions: usize,
    /// Columns along an axis.
    pub across: u32,
    /// Candidates for a point.
    pub candidates_each: f64,
    /// Of chi-square, independent candidates.
    pub p: f64,
    /// The same of a low-discrepancy sequence, which fits too well.
    pub p_low_discrepancy: f64,
}

/// More and more columns in one to four dimensions.
pub(super) fn columns(effort: &Effort) -> Result<Vec<Columns>, WhiteError> {
    let mut all = of::<1>(effort, &[1, 4, 16, 64, 256, 1024], 64)?;
    all.extend(of::<2>(effort, &[1, 4, 16, 64, 256], 24)?);
    all.extend(of::<3>(effort, &[1, 4, 8, 16, 32], 8)?);
    all.extend(of::<4>(effort, &[1, 2, 4, 8, 12], 4)?);
    Ok(all)
}

fn of<const D: usize>(effort: &Effort, across: &[u32], cells: u64) -> Result<Vec<Columns>, WhiteError> {
    let bell: &dyn Density<D> = &Named::Gauss;
    let expected = shares(bell, cells, 8);
    let measure = |&across: &u32| {
        let spec = WhiteSpec { count: effort.white, seed: 1, across, numbers: Numbers::Independent };
        let found = white_noise(bell, &spec)?;
        let even = white_noise(bell, &WhiteSpec { numbers: Numbers::LowDiscrepancy, ..spec })?;
        let p = |points: &[[f64; D]]| chi_square(&counts(points, cells), &expected).p;
        Ok(Columns {
            dimensions: D,
            across,
            candidates_each: found.candidates as f64 / effort.white as f64,
            p: p(&found.points),
            p_low_discrepancy: p(&even.points),
        })
    };
    across.iter().map(measure).collect()
}
