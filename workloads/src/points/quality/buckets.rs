//! Points sorted into cells, to find those nearby.

use crate::points::poisson::{Domain, closer};

/// Points by the cell they are in.
pub(super) struct Buckets<'a, const D: usize> {
    points: &'a [[f64; D]],
    domain: Domain,
    across: i64,
    /// Where in `order` each cell starts.
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl<'a, const D: usize> Buckets<'a, D> {
    /// Points of the unit cube, about one to a cell.
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

    /// Hands `each` point in the cells at a distance of exactly `ring` cells.
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

    /// The distance from a place to the nearest point other than `but`.
    pub fn nearest(&self, at: &[f64; D], but: Option<u32>) -> f64 {
        let (cell, side) = (self.cell(at), 1.0 / self.across as f64);
        let mut least = f64::INFINITY;
        for ring in 0..=self.across {
            // What is further out is at least this far away.
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

/// The smallest distance of two points of the unit cube; infinite where there are fewer than two.
pub fn least_distance<const D: usize>(points: &[[f64; D]], domain: Domain) -> f64 {
    let buckets = Buckets::new(points, domain);
    let nearest = points.iter().zip(0..).map(|(point, number)| buckets.nearest(point, Some(number)));
    nearest.fold(f64::INFINITY, f64::min)
}

/// How many pairs of points, multiples of 2^-52, are closer than `radius` (0 to 1/2), exactly.
pub fn closer_than<const D: usize>(points: &[[f64; D]], radius: f64, domain: Domain) -> u64 {
    let buckets = Buckets::new(points, domain);
    let rings = (radius * buckets.across as f64).ceil() as i64;
    // On a torus wide rings would meet themselves.
    let by_rings = domain == Domain::Box || 2 * rings < buckets.across;
    let mut pairs = 0;
    for (number, point) in (0..).zip(points) {
        let mut look = |other: u32| {
            let close = other > number && closer(point, &points[other as usize], radius, domain);
            pairs += u64::from(close);
        };
        if by_rings {
            (0..=rings).for_each(|ring| buckets.ring(&buckets.cell(point), ring, &mut look));
        } else {
            (0..points.len() as u32).for_each(look);
        }
    }
    pairs
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
    fn neighbours_are_those_of_brute_force() {
        agrees::<1>(40);
        agrees::<2>(150);
        agrees::<3>(120);
        agrees::<4>(90);
        assert_eq!(least_distance::<2>(&[[0.5, 0.5]], Domain::Box), f64::INFINITY);
    }
}
