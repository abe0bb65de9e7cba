//! Holes: what no point is near.

use super::buckets::Buckets;
use crate::points::poisson::Domain;
use crate::points::random::Stream;

/// The largest ball without a point in it whose centre is in the unit cube.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hole<const D: usize> {
    /// Its centre, or a place in the middle of nowhere else.
    pub at: [f64; D],
    /// The distance from there to the nearest point.
    pub radius: f64,
    /// No ball is larger than this.
    pub at_most: f64,
}

/// How near the bounds have to come, in parts of the radius.
const NEAR: f64 = 1e-9;
/// Halvings at most: what is beyond is rounding.
const MOST_LEVELS: u32 = 48;

/// The largest hole of at least one point, by branch and bound: the distance at a place is at most that at the middle of a cube
/// around it and half the cube's diagonal.
pub fn largest_hole<const D: usize>(points: &[[f64; D]], domain: Domain) -> Hole<D> {
    let buckets = Buckets::new(points, domain);
    let across = ((2.0 * points.len() as f64).powf(1.0 / D as f64) as u64).max(1);
    let cube = |n: u64| std::array::from_fn(|k| (n / across.pow(k as u32) % across) as f64 / across as f64);
    let mut cubes: Vec<[f64; D]> = (0..across.pow(D as u32)).map(cube).collect();
    let mut side = 1.0 / across as f64;
    let mut hole = Hole { at: [0.5; D], radius: 0.0, at_most: f64::INFINITY };
    for _ in 0..MOST_LEVELS {
        let half_diagonal = 0.5 * side * (D as f64).sqrt();
        let looked: Vec<_> = cubes.iter().map(|low| look(&buckets, low, side)).collect();
        for (at, radius) in &looked {
            if *radius > hole.radius {
                hole = Hole { at: *at, radius: *radius, ..hole };
            }
        }
        let enough = hole.radius * (1.0 + NEAR);
        let left = cubes.iter().zip(&looked).filter(|(_, (_, radius))| radius + half_diagonal > enough);
        let left: Vec<&[f64; D]> = left.map(|(low, _)| low).collect();
        hole.at_most = if left.is_empty() { enough } else { hole.radius + half_diagonal };
        if left.is_empty() {
            break;
        }
        side *= 0.5;
        cubes = left.into_iter().flat_map(|low| children(low, side)).collect();
    }
    hole
}

fn look<const D: usize>(buckets: &Buckets<'_, D>, low: &[f64; D], side: f64) -> ([f64; D], f64) {
    let middle = low.map(|low| low + 0.5 * side);
    (middle, buckets.nearest(&middle, None))
}

fn children<const D: usize>(low: &[f64; D], side: f64) -> impl Iterator<Item = [f64; D]> {
    (0..1_u32 << D).map(move |corner| std::array::from_fn(|k| low[k] + f64::from(corner >> k & 1) * side))
}

/// The share of the unit cube that is farther than `radius` from all points, by `darts` random places.
pub fn free_share<const D: usize>(points: &[[f64; D]], radius: f64, domain: Domain, darts: u64) -> f64 {
    let (buckets, stream) = (Buckets::new(points, domain), Stream::new(0, 0xF4EE));
    let at = |n: u64| std::array::from_fn(|k| stream.unit(n * D as u64 + k as u64));
    let free = (0..darts).filter(|&n| buckets.nearest(&at(n), None) > radius).count();
    free as f64 / darts as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hole_of_a_lattice_is_at_the_middle_of_its_cells() {
        let points: Vec<[f64; 2]> =
            (0..64).map(|n| [f64::from(n % 8) / 8.0, f64::from(n / 8) / 8.0]).collect();
        let hole = largest_hole(&points, Domain::Torus);
        let expected = 0.5_f64.sqrt() / 8.0;
        assert!((hole.radius / expected - 1.0).abs() < 1e-9 && hole.at_most >= expected, "{hole:?}");
        // Without the other side the far corner is alone.
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
}
