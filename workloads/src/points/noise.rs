//! White noise of any density from drawn columns (thesis, Paper VI, section 5, "Adaptive White Noise", Fig. 12).
//!
//! The density is lifted by a dimension: columns over equal cells bound the region below it. They are tessellated into
//! triangles (1D), prisms (2D), and simploids of four and five dimensions (3D, 4D), drawn in conservative mode, and the
//! shader keeps the random candidates below the density. Without their height they are the points.
//!
//! | D | axes of the domain | height |
//! |---|---|---|
//! | 1 | x | y |
//! | 2 | x, y | t |
//! | 3 | x, y, u | t |
//! | 4 | x, y, u, v | t |

use pipeline::{Gpu, Lane};

use super::drawn::{AXES, Cell, Kept, Lattice, MAX_MEAN, Within, draw};
use super::white::{Columns, Shaded, WhiteError, low, shares};

/// Parameters of drawn noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseSpec {
    /// Points on average; their number is Poisson distributed.
    pub count: f64,
    /// Seed of the points.
    pub seed: u64,
    /// Columns along an axis, 1 to 4096, at most 2^20 in all.
    pub across: u32,
}

/// Points, and the work that made them.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnNoise<const D: usize> {
    /// Points of the unit cube, in random order.
    pub points: Vec<[f64; D]>,
    /// Candidates that were made.
    pub candidates: u64,
    /// Runs of the shader: pairs of a simploid and a tile that it may touch.
    pub fragments: u64,
    /// Columns that were drawn.
    pub columns: usize,
}

/// Candidates in a cell of the lattice on average, at most: half of what a cell can have.
const MEAN: f64 = 0.5 * MAX_MEAN;
/// Most columns that are drawn.
const MAX_COLUMNS: u64 = 1 << 20;
/// Parts of a column along an axis over which the density is integrated.
const FINE: u64 = 4;

/// Axis of each dimension of the domain, and that of the height.
fn axes(dimensions: usize) -> (&'static [usize], usize) {
    match dimensions {
        1 => (&[0], 1),
        2 => (&[0, 1], 2),
        3 => (&[0, 1, 3], 2),
        _ => (&[0, 1, 3, 4], 2),
    }
}

/// The lifted density: columns, the lattice of candidates, and the test.
struct Lifted<'a, const D: usize> {
    density: &'a dyn Shaded<D>,
    cells: Vec<Cell>,
    lattice: Lattice,
    /// Density at height 1.
    highest: f64,
}

impl<'a, const D: usize> Lifted<'a, D> {
    fn new(density: &'a dyn Shaded<D>, spec: &NoiseSpec) -> Result<Self, WhiteError> {
        let columns = u64::from(spec.across).checked_pow(D as u32);
        if columns.is_none_or(|columns| columns > MAX_COLUMNS) {
            return Err(WhiteError::Columns(spec.across));
        }
        let bounds = Columns::new(density, spec.across)?;
        let highest = bounds.heights.iter().copied().fold(0.0, f64::max);
        let (domain, up) = axes(D);
        let wide = u64::from(spec.across);
        let cell = |(number, height): (u64, &f64)| {
            let first: [f64; D] = low(number, wide);
            let last: [f64; D] = std::array::from_fn(|k| {
                ((number / wide.pow(k as u32) % wide) + 1) as f64 / f64::from(spec.across)
            });
            let mut cell = Cell::WHOLE;
            for (k, &axis) in domain.iter().enumerate() {
                (cell.low[axis], cell.high[axis]) = (first[k], last[k]);
            }
            cell.high[up] = height / highest;
            cell
        };
        let cells = (0..).zip(&bounds.heights).filter(|(_, height)| **height > 0.0).map(cell).collect();
        // Share of the lifted cube that is below the density.
        let parts = wide.min(MAX_INTEGRAL) * FINE;
        let integral = shares(density, wide.min(MAX_INTEGRAL), FINE).iter().sum::<f64>()
            / (parts as f64).powi(D as i32)
            / highest;
        let candidates = spec.count / integral;
        let slabs = (candidates / bounds.heights.len() as f64 / MEAN).ceil().max(1.0);
        let mut across = [1; AXES];
        domain.iter().for_each(|&axis| across[axis] = spec.across);
        across[up] = slabs as u32;
        let mean = candidates / bounds.heights.len() as f64 / slabs;
        let used = [domain, &[up]].concat();
        let lattice = Lattice::new(across, &used, mean, spec.seed).ok_or(WhiteError::Nothing)?;
        Ok(Self { density, cells, lattice, highest })
    }

    fn projected(points: &[[f64; AXES]]) -> Vec<[f64; D]> {
        let (domain, _) = axes(D);
        points.iter().map(|point| std::array::from_fn(|k| point[domain[k]])).collect()
    }
}

/// Most cells along an axis over which the density is integrated.
const MAX_INTEGRAL: u64 = 16;

impl<const D: usize> Within for Lifted<'_, D> {
    fn contains(&self, lane: &Lane, point: &[f64; AXES]) -> bool {
        let (domain, up) = axes(D);
        let at = std::array::from_fn(|k| point[domain[k]]);
        lane.branch(lane.mul(point[up], self.highest) < self.density.on(lane, &at))
    }
}

/// Draws the columns in a pass of `gpu` and returns the points below the density.
///
/// # Errors
/// [`WhiteError`].
pub fn draw_noise<const D: usize>(
    density: &dyn Shaded<D>,
    spec: &NoiseSpec,
    gpu: &mut Gpu<'_>,
) -> Result<DrawnNoise<D>, WhiteError> {
    let lifted = Lifted::new(density, spec)?;
    let Kept { points, candidates, fragments, .. } =
        draw(gpu, "columns", &lifted.cells, &lifted.lattice, &lifted);
    let columns = lifted.cells.len();
    Ok(DrawnNoise { points: Lifted::<D>::projected(&points), candidates, fragments, columns })
}

#[cfg(test)]
mod tests {
    use super::super::drawn;
    use super::super::quality::chi_square;
    use super::super::white::{Named, counts};
    use super::*;
    use crate::job::testing::hardware;

    fn drawn<const D: usize>(density: Named, spec: &NoiseSpec) -> DrawnNoise<D> {
        let hardware = hardware();
        draw_noise(&density, spec, &mut Gpu::quiet(&hardware).unwrap()).unwrap()
    }

    fn on_host<const D: usize>(density: &Named, spec: &NoiseSpec) -> Vec<[f64; D]> {
        let lifted: Lifted<D> = Lifted::new(density, spec).unwrap();
        Lifted::<D>::projected(&drawn::on_host(&lifted.cells, &lifted.lattice, &lifted))
    }

    fn same<const D: usize>(across: u32, cells: u64) {
        for density in [Named::Constant, Named::Ramp, Named::Gauss, Named::Waves] {
            let spec = NoiseSpec { count: 3000.0, seed: 7, across };
            let found = drawn::<D>(density, &spec);
            assert_eq!(found.points, on_host::<D>(&density, &spec), "{D} {density:?}");
            // The number is Poisson distributed: five standard deviations.
            assert!(
                (found.points.len() as f64 - 3000.0).abs() < 280.0,
                "{D} {density:?} {}",
                found.points.len()
            );
            let fit = chi_square(&counts(&found.points, cells), &shares::<D>(&density, cells, 8));
            assert!(fit.p > 1e-4 && fit.p < 1.0 - 1e-4, "{D} {density:?} {fit:?}");
            assert!(found.fragments > 0 && found.candidates >= found.points.len() as u64);
        }
    }

    #[test]
    fn drawn_points_are_those_of_the_host_in_every_dimension() {
        same::<1>(37, 16);
        same::<2>(12, 5);
        same::<2>(64, 5);
        same::<3>(5, 3);
        same::<4>(3, 2);
    }

    #[test]
    fn seeds_differ_and_threads_do_not() {
        let spec = NoiseSpec { count: 500.0, seed: 1, across: 8 };
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| drawn::<2>(Named::Gauss, &spec))
        };
        assert_eq!(with(1), with(3));
        assert_ne!(with(1).points, drawn::<2>(Named::Gauss, &NoiseSpec { seed: 2, ..spec }).points);
    }

    /// Neighbouring seeds once had the same cells in another order.
    #[test]
    fn neighbouring_seeds_share_no_place_within_a_column() {
        let places = |seed| {
            let spec = NoiseSpec { count: 2000.0, seed, across: 16 };
            let within = |point: &[f64; 1]| ((point[0] * 16.0).fract() * 1e10) as u64;
            let points = drawn::<1>(Named::Constant, &spec).points;
            points.iter().map(within).collect::<std::collections::HashSet<u64>>()
        };
        assert!(places(2).len() > 1000);
        assert!(places(2).is_disjoint(&places(3)));
    }

    #[test]
    fn too_many_columns_are_refused() {
        let hardware = hardware();
        let mut gpu = Gpu::quiet(&hardware).unwrap();
        for across in [0, 33] {
            let spec = NoiseSpec { count: 10.0, seed: 1, across };
            assert_eq!(draw_noise::<4>(&Named::Gauss, &spec, &mut gpu), Err(WhiteError::Columns(across)));
        }
    }
}
