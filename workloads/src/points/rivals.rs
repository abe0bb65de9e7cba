//! Other methods of making points with a minimum distance, for comparison with [`poisson`](super::poisson):
//! plain dart throwing and the method of Bridson.

use super::Stream;
use super::poisson::{Domain, PoissonError, PoissonSpec, check_room, closer};

/// Plain dart throwing until `misses` in a row (Cook 1986).
///
/// # Errors
/// As [`crate::points::poisson::poisson_disk`].
pub fn plain_darts<const D: usize>(spec: &PoissonSpec, misses: u64) -> Result<Vec<[f64; D]>, PoissonError> {
    let (mut cells, stream) = (Cells::new(spec)?, Stream::new(spec.seed, 0x914E));
    let (mut missed, mut number) = (0, 0);
    while missed < misses {
        let at = std::array::from_fn(|k| rounded_down(stream.unit(number + k as u64)));
        number += D as u64;
        let free = cells.is_free(&at);
        missed = if free { 0 } else { missed + 1 };
        if free {
            cells.add(at);
        }
    }
    Ok(cells.points)
}

/// The next lower multiple of 2^-52.
fn rounded_down(x: f64) -> f64 {
    let whole = (1_u64 << 52) as f64;
    (x * whole).floor() / whole
}

/// Bridson's method (2007). Starts from a random point and tries `candidates` positions between one and two
/// radii from a random active point, uniform by volume. The first free one becomes a point; if none is free,
/// the active point retires.
///
/// # Errors
/// As [`crate::points::poisson::poisson_disk`].
pub fn bridson<const D: usize>(spec: &PoissonSpec, candidates: u32) -> Result<Vec<[f64; D]>, PoissonError> {
    let (mut cells, stream) = (Cells::new(spec)?, Stream::new(spec.seed, 0xB51D));
    let mut number = D as u64;
    cells.add(std::array::from_fn(|k| rounded_down(stream.unit(k as u64))));
    let mut active = vec![0_usize];
    while !active.is_empty() {
        let chosen = stream.below(number, active.len() as u64) as usize;
        let from = cells.points[active[chosen]];
        number += 1;
        let found = (0..candidates).find_map(|_| {
            let at = around(&from, spec, stream, &mut number)?;
            cells.is_free(&at).then_some(at)
        });
        match found {
            Some(at) => {
                active.push(cells.points.len());
                cells.add(at);
            }
            None => _ = active.swap_remove(chosen),
        }
    }
    Ok(cells.points)
}

/// A random position in the shell around a point, if it is in the domain.
fn around<const D: usize>(
    from: &[f64; D],
    spec: &PoissonSpec,
    stream: Stream,
    number: &mut u64,
) -> Option<[f64; D]> {
    let away: [f64; D] = loop {
        let place: [f64; D] = std::array::from_fn(|k| 4.0 * stream.unit(*number + k as u64) - 2.0);
        *number += D as u64;
        let square: f64 = place.iter().map(|x| x * x).sum();
        if (1.0..4.0).contains(&square) {
            break place;
        }
    };
    let at: [f64; D] = std::array::from_fn(|k| from[k] + away[k] * spec.radius);
    match spec.domain {
        Domain::Torus => Some(at.map(|x| rounded_down(x.rem_euclid(1.0)).min(1.0 - f64::EPSILON))),
        Domain::Box => at.iter().all(|x| (0.0..1.0).contains(x)).then(|| at.map(rounded_down)),
    }
}

/// Grid of cells with at most one point each.
struct Cells<const D: usize> {
    spec: PoissonSpec,
    across: i64,
    index: Vec<u32>,
    pub points: Vec<[f64; D]>,
}

impl<const D: usize> Cells<D> {
    pub fn new(spec: &PoissonSpec) -> Result<Self, PoissonError> {
        let least = 1e-9;
        if !(spec.radius >= least && spec.radius <= 0.5) {
            return Err(PoissonError::Radius { radius: spec.radius, least, one: f64::INFINITY });
        }
        let across = ((D as f64).sqrt() / spec.radius).ceil();
        let cells = across.powi(D as i32);
        check_room(spec.radius, D, cells)?;
        Ok(Self {
            spec: *spec,
            across: across as i64,
            index: vec![u32::MAX; cells as usize],
            points: Vec::new(),
        })
    }

    fn cell(&self, at: &[f64; D]) -> [i64; D] {
        at.map(|x| ((x * self.across as f64) as i64).min(self.across - 1))
    }

    fn number(&self, cell: &[i64; D]) -> usize {
        (0..D).rev().fold(0, |number, k| number * self.across as usize + cell[k] as usize)
    }

    /// Whether no point is closer than the radius.
    pub fn is_free(&self, at: &[f64; D]) -> bool {
        let (cell, reach) = (self.cell(at), ((D as f64).sqrt().ceil() as i64 + 1).min(self.across / 2));
        let along = 2 * reach + 1;
        (0..along.pow(D as u32)).all(|number| {
            let mut near: [i64; D] =
                std::array::from_fn(|k| cell[k] + number / along.pow(k as u32) % along - reach);
            if self.spec.domain == Domain::Torus {
                near = near.map(|at| at.rem_euclid(self.across));
            } else if near.iter().any(|at| !(0..self.across).contains(at)) {
                return true;
            }
            let point = self.index[self.number(&near)];
            point == u32::MAX || !closer(&self.points[point as usize], at, self.spec.radius, self.spec.domain)
        })
    }

    pub fn add(&mut self, at: [f64; D]) {
        let number = self.number(&self.cell(&at));
        self.index[number] = self.points.len() as u32;
        self.points.push(at);
    }
}

#[cfg(test)]
mod tests {
    use super::super::poisson::{Spacing, ball};
    use super::super::quality::{closer_than, free_share, largest_hole};
    use super::*;

    const SPEC: PoissonSpec =
        PoissonSpec { radius: 0.03, domain: Domain::Torus, seed: 1, spacing: Spacing::Double };

    #[test]
    fn both_keep_the_distance_and_leave_holes() {
        let density = |n: usize| n as f64 * ball(2) * 0.03 * 0.03;
        let plain = plain_darts::<2>(&SPEC, 300).unwrap();
        let near = bridson::<2>(&SPEC, 30).unwrap();
        for points in [&plain, &near] {
            assert_eq!(closer_than(points, 0.03, Domain::Torus), 0);
            assert!(largest_hole(points, Domain::Torus).radius > 0.03 * 1.0001);
        }
        assert!(density(plain.len()) < 0.547, "{}", density(plain.len()));
        assert!(free_share(&plain, 0.03, Domain::Torus, 20_000) > 0.0);
        let volume = bridson::<3>(&PoissonSpec { radius: 0.12, domain: Domain::Box, ..SPEC }, 30).unwrap();
        assert!(volume.len() > 200 && closer_than(&volume, 0.12, Domain::Box) == 0);
    }
}
