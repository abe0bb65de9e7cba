//! Points in cells, one at most in each: the grid that every rival has.

use crate::points::poisson::{Domain, PoissonError, PoissonSpec, check_room, closer};

pub(super) struct Cells<const D: usize> {
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
