//! Distances between points, and the largest holes among them, by a grid of buckets.

use crate::points::poisson::{Domain, closer};
use crate::points::random::Stream;

/// Points sorted by cell.
pub(super) struct Buckets<'a, const D: usize> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::random::Stream;

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
}
