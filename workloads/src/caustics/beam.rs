//! The warped volume behind a generator triangle.

use glam::DVec3;

use super::cubic::{Cubic, quadratic_roots};

/// A beam: the points `sum b_i ((1 - t) open_i + t close_i)` for barycentric weights `b` and `t` in [0, 1]. Its flux is spread evenly over the
/// generator triangle `open`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// The generator triangle.
    pub open: [DVec3; 3],
    /// Where the light of its corners ends.
    pub close: [DVec3; 3],
    /// The light it carries, in watts.
    pub flux_w: f64,
}

/// A place in a beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Barycentric weights of the corners.
    pub weights: [f64; 3],
    /// How far along the beam, 0 to 1.
    pub t: f64,
}

/// How far outside of a triangle, in barycentric weights, a point counts as in it: rounding of the root, and less than anybody sees.
const EDGE: f64 = 1e-9;

impl Beam {
    /// The corners at `t`.
    pub fn corners(&self, t: f64) -> [DVec3; 3] {
        [0, 1, 2].map(|k| self.open[k] + t * (self.close[k] - self.open[k]))
    }

    /// What the light of a corner goes through.
    pub fn path(&self, corner: usize) -> DVec3 {
        self.close[corner] - self.open[corner]
    }

    /// The point at a place.
    pub fn point(&self, hit: &Hit) -> DVec3 {
        weigh(&self.corners(hit.t), hit.weights)
    }

    /// The motion at a place: its light's direction times its length.
    pub fn motion(&self, hit: &Hit) -> DVec3 {
        weigh(&[0, 1, 2].map(|k| self.path(k)), hit.weights)
    }

    /// The Bernstein coefficients in `t` of the vector area `(x1 - x0) x (x2 - x0)`, twice that of the triangle.
    pub fn areas(&self) -> [DVec3; 3] {
        let [first, last] = [&self.open, &self.close].map(|x| [x[1] - x[0], x[2] - x[0]]);
        let middle = 0.5 * (first[0].cross(last[1]) + last[0].cross(first[1]));
        [first[0].cross(first[1]), middle, last[0].cross(last[1])]
    }

    /// `det(dx/db1, dx/db2, dx/dt)` at a place: how much room the light has there. Where it changes sign the light crosses itself.
    pub fn jacobian(&self, hit: &Hit) -> f64 {
        let [a, b, c] = self.corners(hit.t);
        (b - a).cross(c - a).dot(self.motion(hit))
    }

    /// The places at which `point` lies in the beam, up to three: `det[x1 - x0, x2 - x0, point - x0] = 0` is a cubic in `t`.
    pub fn inside(&self, point: DVec3) -> impl Iterator<Item = Hit> {
        let sides = |x: &[DVec3; 3]| [x[1] - x[0], x[2] - x[0], point - x[0]];
        let (first, last) = (sides(&self.open), sides(&self.close));
        let roots = Cubic::of_determinant(&first, &last).roots();
        roots.into_iter().flatten().filter_map(move |t| self.at(point, t))
    }

    /// The weights of a point in the plane of the triangle at `t`, if it is in the triangle.
    fn at(&self, point: DVec3, t: f64) -> Option<Hit> {
        let [a, b, c] = self.corners(t);
        let (along, across, to) = (b - a, c - a, point - a);
        let area = along.cross(across);
        let squared = area.length_squared();
        if squared == 0.0 {
            return None;
        }
        let second = to.cross(across).dot(area) / squared;
        let third = along.cross(to).dot(area) / squared;
        let weights = [1.0 - second - third, second, third];
        // Rounding of the corners, in parts of the triangle.
        let size = [a, b, c, point].iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
        let side = libm::sqrt(along.length_squared().max(across.length_squared()));
        let slack = EDGE + 64.0 * f64::EPSILON * size * side / libm::sqrt(squared);
        weights.iter().all(|weight| *weight >= -slack).then_some(Hit { weights, t })
    }

    /// The times at which the light of corner `k` crosses that of its neighbours, and between which it may: roots of
    /// the Jacobian at the corners, in order. Between two of them its sign is one over all of the triangle, or differs all the time.
    pub fn folds(&self) -> Vec<f64> {
        let areas = self.areas();
        let at_corner = |k: usize| quadratic_roots(areas.map(|area| area.dot(self.path(k))));
        let mut folds: Vec<f64> = (0..3).flat_map(at_corner).filter(|t| *t > 0.0 && *t < 1.0).collect();
        folds.sort_by(f64::total_cmp);
        folds
    }

    /// The sign of the Jacobian at `t`, or `None` where it differs over the triangle: sides cross there.
    pub fn sign(&self, t: f64) -> Option<f64> {
        let [a, b, c] = self.corners(t);
        let area = (b - a).cross(c - a);
        let signs = [0, 1, 2].map(|k| area.dot(self.path(k)));
        let all = |sign: f64| signs.iter().all(|s| s * sign >= 0.0).then_some(sign);
        all(1.0).or_else(|| all(-1.0))
    }

    /// For how much of its length sides cross, 0 to 1. Nothing for a beam that is pinched at a point or a line, much for one whose light the
    /// corners do not stand for.
    pub fn crossing(&self) -> f64 {
        let cuts = self.cuts();
        let crossed = |ends: &&[f64]| self.sign(0.5 * (ends[0] + ends[1])).is_none();
        cuts.windows(2).filter(crossed).map(|ends| ends[1] - ends[0]).fold(0.0, |sum, part| sum + part)
    }

    /// 0, the [folds](Self::folds), and 1.
    pub fn cuts(&self) -> Vec<f64> {
        [0.0].into_iter().chain(self.folds()).chain([1.0]).collect()
    }

    /// The part from `from` to `to`.
    #[must_use]
    pub fn part(&self, from: f64, to: f64) -> Self {
        Self { open: self.corners(from), close: self.corners(to), flux_w: self.flux_w }
    }
}

fn weigh(of: &[DVec3; 3], weights: [f64; 3]) -> DVec3 {
    of[0] * weights[0] + of[1] * weights[1] + of[2] * weights[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caustics::generator::tests::{Uniform, turned, warped};

    #[test]
    fn every_place_in_a_beam_is_found() {
        let (mut random, mut several) = (Uniform::new(1), 0);
        for round in 0..4000 {
            let beam = match round % 4 {
                0 => turned(&mut random),
                kind => warped(&mut random, [0.0, 0.4, 1.5][kind - 1]),
            };
            let hit = random.hit();
            let point = beam.point(&hit);
            let found: Vec<Hit> = beam.inside(point).collect();
            several += usize::from(found.len() > 1);
            let near = |a: &Hit| (a.t - hit.t).abs() < 1e-6;
            assert!(found.iter().any(near), "{round}: {hit:?} {found:?}");
            for other in &found {
                assert!((beam.point(other) - point).length() < 1e-7, "{round}: {other:?}");
            }
        }
        assert!(several > 100, "{several}");
    }

    #[test]
    fn three_hits_there_are() {
        let mut random = Uniform::new(7);
        let most = (0..3000).map(|_| {
            let beam = turned(&mut random);
            let point = beam.point(&random.hit());
            beam.inside(point).count()
        });
        assert_eq!(most.max(), Some(3));
    }

    #[test]
    fn points_outside_are_outside() {
        // Brute force: the triangle at many times, its plane crossed between two of them.
        let mut random = Uniform::new(3);
        let mut outside = 0;
        for _ in 0..400 {
            let beam = warped(&mut random, 0.6);
            let point =
                DVec3::new(random.within(-2.0, 2.0), random.within(-2.0, 2.0), random.within(-0.5, 3.5));
            let steps = 4000;
            let beside = |t: f64| {
                let [a, b, c] = beam.corners(t);
                let area = (b - a).cross(c - a);
                let weights = [(b - point).cross(c - point), (c - point).cross(a - point)];
                let weights = weights.map(|w| w.dot(area) / area.length_squared());
                let least = weights[0].min(weights[1]).min(1.0 - weights[0] - weights[1]);
                (area.dot(point - a), least)
            };
            let mut crossings = 0;
            let mut unsure = false;
            for step in 0..steps {
                let [one, other] = [step, step + 1].map(|s| beside(f64::from(s) / f64::from(steps)));
                if one.0 * other.0 <= 0.0 {
                    crossings += usize::from(one.1 > 0.0);
                    unsure |= one.1.abs() < 0.02;
                }
            }
            if !unsure {
                assert_eq!(beam.inside(point).count(), crossings);
                outside += usize::from(crossings == 0);
            }
        }
        assert!(outside > 50, "{outside}");
    }

    #[test]
    fn the_jacobian_is_the_derivative_and_its_sign_says_where_sides_cross() {
        let mut random = Uniform::new(5);
        let mut crossed = 0;
        for round in 0..500 {
            let beam = if round % 2 == 0 { warped(&mut random, 0.8) } else { turned(&mut random) };
            let hit = random.hit();
            let h = 1e-6;
            let moved = |weights: [f64; 3], t: f64| beam.point(&Hit { weights, t });
            let [a, b, c] = hit.weights;
            let here = moved(hit.weights, hit.t);
            let d1 = (moved([a - h, b + h, c], hit.t) - here) / h;
            let d2 = (moved([a - h, b, c + h], hit.t) - here) / h;
            let dt = (moved(hit.weights, hit.t + h) - here) / h;
            let by_difference = d1.cross(d2).dot(dt);
            let off = (by_difference - beam.jacobian(&hit)).abs();
            assert!(off < 1e-3 * (1.0 + by_difference.abs()), "{by_difference}: {off}");
            if let Some(sign) = beam.sign(hit.t) {
                assert!(sign * beam.jacobian(&hit) >= -1e-12);
            } else {
                crossed += 1;
            }
        }
        assert!(crossed > 20, "{crossed}");
        let straight = warped(&mut random, 0.0);
        assert_eq!(straight.crossing(), 0.0);
    }
}
