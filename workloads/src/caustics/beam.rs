//! Light volumes (beams): the warped volume behind a generator triangle, and the cubics that test points in
//! it.

use glam::DVec3;
use pipeline::Lane;

/// A beam: the points `sum b_i ((1 - t) open_i + t close_i)` for barycentric weights `b` and `t` in [0, 1].
/// The flux of a beam is uniform over the generator triangle `open`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// The generator triangle.
    pub open: [DVec3; 3],
    /// End points of the light of the corners.
    pub close: [DVec3; 3],
    /// Radiant flux, in watts.
    pub flux_w: f64,
}

/// A position in a beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Barycentric weights of the corners.
    pub weights: [f64; 3],
    /// Parameter along the beam, 0 to 1.
    pub t: f64,
}

/// Largest negative barycentric weight that counts as inside. It allows for rounding of the roots, and is
/// invisible.
const MAX_NEGATIVE_WEIGHT: f64 = 1e-9;

impl Beam {
    /// The corners at `t`.
    pub fn corners(&self, t: f64) -> [DVec3; 3] {
        self.corners_on(&Lane::default(), t)
    }

    /// The same on a lane.
    pub(super) fn corners_on(&self, lane: &Lane, t: f64) -> [DVec3; 3] {
        let at = DVec3::splat(t);
        [0, 1, 2].map(|k| lane.madd(at, lane.sub(self.close[k], self.open[k]), self.open[k]))
    }

    /// Path of the light of a corner, from start to end.
    pub fn path(&self, corner: usize) -> DVec3 {
        self.close[corner] - self.open[corner]
    }

    /// Point at a position.
    pub fn point(&self, hit: &Hit) -> DVec3 {
        weigh(&Lane::default(), &self.corners(hit.t), hit.weights)
    }

    /// Motion at a position: the direction of its light, times its length.
    pub fn motion(&self, lane: &Lane, hit: &Hit) -> DVec3 {
        weigh(lane, &[0, 1, 2].map(|k| lane.sub(self.close[k], self.open[k])), hit.weights)
    }

    /// Bernstein coefficients in `t` of the vector area `(x1 - x0) x (x2 - x0)`, twice that of the triangle.
    pub fn areas(&self, lane: &Lane) -> [DVec3; 3] {
        let [first, last] = [&self.open, &self.close].map(|x| [lane.sub(x[1], x[0]), lane.sub(x[2], x[0])]);
        let both = lane.add(lane.cross(first[0], last[1]), lane.cross(last[0], first[1]));
        let middle = lane.mul(DVec3::splat(0.5), both);
        [lane.cross(first[0], first[1]), middle, lane.cross(last[0], last[1])]
    }

    /// Jacobian `det(dx/db1, dx/db2, dx/dt)` at a position. Light crosses itself where it changes sign.
    pub fn jacobian(&self, lane: &Lane, hit: &Hit) -> f64 {
        let [a, b, c] = self.corners_on(lane, hit.t);
        lane.dot(lane.cross(lane.sub(b, a), lane.sub(c, a)), self.motion(lane, hit))
    }

    /// Positions at which `point` lies in the beam, up to three: roots in `t` of the cubic `det[x1 - x0, x2 -
    /// x0, point - x0] = 0`.
    pub fn inside(&self, lane: &Lane, point: DVec3) -> impl Iterator<Item = Hit> {
        let sides = |x: &[DVec3; 3]| [lane.sub(x[1], x[0]), lane.sub(x[2], x[0]), lane.sub(point, x[0])];
        let (first, last) = (sides(&self.open), sides(&self.close));
        let roots = Cubic::of_determinant(lane, &first, &last).roots(lane);
        roots.into_iter().flatten().filter_map(move |t| self.at(lane, point, t))
    }

    /// Weights of a point in the plane of the triangle at `t`, if it is in the triangle.
    fn at(&self, lane: &Lane, point: DVec3, t: f64) -> Option<Hit> {
        let [a, b, c] = self.corners_on(lane, t);
        let (along, across, to) = (lane.sub(b, a), lane.sub(c, a), lane.sub(point, a));
        let area = lane.cross(along, across);
        let squared = lane.dot(area, area);
        if lane.branch(squared == 0.0) {
            return None;
        }
        let second = lane.div(lane.dot(lane.cross(to, across), area), squared);
        let third = lane.div(lane.dot(lane.cross(along, to), area), squared);
        let weights = [lane.sub(lane.sub(1.0, second), third), second, third];
        // Rounding error of the corners, relative to the triangle.
        let size = [a, b, c, point].iter().fold(DVec3::ZERO, |most, p| lane.max(most, p.abs()));
        let size = lane.max(lane.max(size.x, size.y), size.z);
        let side = lane.root(lane.max(lane.dot(along, along), lane.dot(across, across)));
        let sized = lane.mul(lane.mul(64.0 * f64::EPSILON, size), side);
        let slack = lane.add(MAX_NEGATIVE_WEIGHT, lane.div(sized, lane.root(squared)));
        weights.iter().all(|weight| lane.branch(*weight >= -slack)).then_some(Hit { weights, t })
    }

    /// Roots of the Jacobian at the corners, sorted: the light of a corner crosses that of its neighbours.
    /// Between two roots, the Jacobian has either one sign over all of the triangle, or different signs all
    /// the time.
    pub fn folds(&self, lane: &Lane) -> Vec<f64> {
        let areas = self.areas(lane);
        let at_corner = |k: usize| {
            let path = lane.sub(self.close[k], self.open[k]);
            quadratic_roots(lane, areas.map(|area| lane.dot(area, path)))
        };
        let mut folds = Vec::new();
        for t in (0..3).flat_map(at_corner).filter(|t| lane.branch(*t > 0.0 && *t < 1.0)) {
            let place = folds.iter().position(|other| lane.branch(t < *other)).unwrap_or(folds.len());
            folds.insert(place, t);
        }
        folds
    }

    /// Sign of the Jacobian at `t`; `None` if it differs over the triangle, where sides cross.
    pub fn sign(&self, lane: &Lane, t: f64) -> Option<f64> {
        let [a, b, c] = self.corners_on(lane, t);
        let area = lane.cross(lane.sub(b, a), lane.sub(c, a));
        let signs = [0, 1, 2].map(|k| lane.dot(area, lane.sub(self.close[k], self.open[k])));
        let all = |sign: f64| signs.iter().all(|s| lane.branch(s * sign >= 0.0)).then_some(sign);
        all(1.0).or_else(|| all(-1.0))
    }

    /// Share of its length over which sides cross, 0 to 1. A beam that is pinched at a point or a line has 0;
    /// a beam that its corners do not represent has much.
    pub fn crossing(&self) -> f64 {
        let lane = Lane::default();
        let cuts = self.cuts(&lane);
        let crossed = |ends: &&[f64]| self.sign(&lane, 0.5 * (ends[0] + ends[1])).is_none();
        cuts.windows(2).filter(crossed).map(|ends| ends[1] - ends[0]).fold(0.0, |sum, part| sum + part)
    }

    /// 0, the [folds](Self::folds), and 1.
    pub fn cuts(&self, lane: &Lane) -> Vec<f64> {
        [0.0].into_iter().chain(self.folds(lane)).chain([1.0]).collect()
    }

    /// The part of the beam from `from` to `to`.
    #[must_use]
    pub fn part(&self, lane: &Lane, from: f64, to: f64) -> Self {
        let [open, close] = [from, to].map(|t| self.corners_on(lane, t));
        Self { open, close, flux_w: self.flux_w }
    }
}

fn weigh(lane: &Lane, of: &[DVec3; 3], weights: [f64; 3]) -> DVec3 {
    let [a, b, c] = weights.map(DVec3::splat);
    lane.madd(of[2], c, lane.madd(of[1], b, lane.mul(of[0], a)))
}

/// A cubic, by its Bernstein coefficients.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cubic([f64; 4]);

/// Rounding error of a zero, relative to the largest coefficient.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

impl Cubic {
    /// `det[a(t), b(t), c(t)]` of three vectors that are linear in `t`, by the polar form of a product.
    pub fn of_determinant(lane: &Lane, first: &[DVec3; 3], last: &[DVec3; 3]) -> Self {
        let det = |at: [usize; 3]| {
            let [a, b, c] = [0, 1, 2].map(|k| if at[k] == 0 { first[k] } else { last[k] });
            lane.dot(lane.cross(a, b), c)
        };
        let mean = |of: [[usize; 3]; 3]| {
            let sum = lane.add(lane.add(det(of[0]), det(of[1])), det(of[2]));
            lane.div(sum, 3.0)
        };
        Self([
            det([0, 0, 0]),
            mean([[1, 0, 0], [0, 1, 0], [0, 0, 1]]),
            mean([[0, 1, 1], [1, 0, 1], [1, 1, 0]]),
            det([1, 1, 1]),
        ])
    }

    /// Value by de Casteljau's algorithm.
    fn at(&self, lane: &Lane, t: f64) -> f64 {
        let step = |a: f64, b: f64| lane.madd(t, lane.sub(b, a), a);
        let [a, b, c, d] = self.0;
        let (ab, bc, cd) = (step(a, b), step(b, c), step(c, d));
        step(step(ab, bc), step(bc, cd))
    }

    /// Roots in order, a double one once. None if the cubic is zero everywhere: then all points lie in one
    /// plane.
    pub fn roots(&self, lane: &Lane) -> [Option<f64>; 3] {
        let [a, b, c, d] = self.0;
        let zero =
            lane.mul(ROUNDING, self.0.iter().fold(0.0, |most: f64, value| lane.max(most, value.abs())));
        let mut found = [None; 3];
        let all = |sign: f64| self.0.iter().all(|value| lane.branch(sign * value > zero));
        if all(1.0) || all(-1.0) {
            return found;
        }
        let sides = [lane.sub(b, a), lane.sub(c, b), lane.sub(d, c)];
        let turns = quadratic_roots(lane, sides).filter(|t| lane.branch(*t > 0.0 && *t < 1.0));
        let (mut from, mut count) = (0.0, 0);
        for to in turns.chain([1.0]) {
            let root = self.monotone_root(lane, from, to, zero);
            // A turning point that is a root belongs to two pieces.
            let again = |t: f64| count > 0 && found[count - 1].is_some_and(|last| t - last < 1e-12);
            if let Some(t) = root.filter(|t| !again(*t))
                && count < 3
            {
                found[count] = Some(t);
                count += 1;
            }
            from = to;
        }
        found
    }

    /// Root in a monotonic piece.
    fn monotone_root(&self, lane: &Lane, from: f64, to: f64, zero: f64) -> Option<f64> {
        let (mut low, mut high) = (from, to);
        let (first, last) = (self.at(lane, low), self.at(lane, high));
        if lane.branch(first.abs() <= zero) {
            return lane.branch(last.abs() > zero).then_some(low);
        }
        if lane.branch(last.abs() <= zero) {
            return Some(high);
        }
        if lane.branch(lane.mul(first, last) > 0.0) {
            return None;
        }
        let half_way = |low: f64, high: f64| lane.mul(0.5, lane.add(low, high));
        while lane.branch(lane.sub(high, low) > lane.mul(2.0 * f64::EPSILON, high)) {
            let middle = half_way(low, high);
            if lane.branch(middle <= low || middle >= high) {
                break;
            }
            let is_before = lane.branch(lane.mul(self.at(lane, middle), first) > 0.0);
            if is_before { low = middle } else { high = middle }
        }
        Some(half_way(low, high))
    }
}

/// Real roots of a quadratic by its Bernstein coefficients, in order and unbounded; a double root may occur
/// twice.
fn quadratic_roots(lane: &Lane, [a, b, c]: [f64; 3]) -> impl Iterator<Item = f64> + use<> {
    // a (1 - t)^2 + 2 b t (1 - t) + c t^2 = p t^2 + 2 q t + a
    let (p, q) = (lane.add(lane.madd(-2.0, b, a), c), lane.sub(b, a));
    let discriminant = lane.madd(-p, a, lane.mul(q, q));
    let root = lane.root(lane.max(discriminant, 0.0));
    // Computes the larger root first, which avoids cancellation.
    let far = if lane.branch(q > 0.0) { lane.sub(-q, root) } else { lane.sub(root, q) };
    let is_real = !lane.branch(discriminant < 0.0);
    let roots = if is_real { [lane.div(far, p), lane.div(a, far)] } else { [f64::NAN; 2] };
    let sorted = if roots[0] > roots[1] { [roots[1], roots[0]] } else { roots };
    sorted.into_iter().filter(|t| t.is_finite())
}

#[cfg(test)]
mod tests {
    use super::super::generator::tests::{hit, turned, uniform, warped};
    use super::*;

    #[test]
    fn every_position_in_a_beam_is_found() {
        let (mut random, mut several) = (uniform(1), 0);
        for round in 0..4000 {
            let beam = match round % 4 {
                0 => turned(&mut random),
                kind => warped(&mut random, [0.0, 0.4, 1.5][kind - 1]),
            };
            let hit = hit(&mut random);
            let point = beam.point(&hit);
            let found: Vec<Hit> = beam.inside(&Lane::default(), point).collect();
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
    fn a_point_can_have_three_hits() {
        let mut random = uniform(7);
        let most = (0..3000).map(|_| {
            let beam = turned(&mut random);
            let point = beam.point(&hit(&mut random));
            beam.inside(&Lane::default(), point).count()
        });
        assert_eq!(most.max(), Some(3));
    }

    #[test]
    fn points_outside_are_outside() {
        // Brute force: counts how often the triangle's plane crosses the point over many times.
        let mut random = uniform(3);
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
                assert_eq!(beam.inside(&Lane::default(), point).count(), crossings);
                outside += usize::from(crossings == 0);
            }
        }
        assert!(outside > 50, "{outside}");
    }

    #[test]
    fn the_jacobian_is_the_derivative_and_its_sign_shows_crossed_sides() {
        let mut random = uniform(5);
        let mut crossed = 0;
        for round in 0..500 {
            let beam = if round % 2 == 0 { warped(&mut random, 0.8) } else { turned(&mut random) };
            let hit = hit(&mut random);
            let h = 1e-6;
            let moved = |weights: [f64; 3], t: f64| beam.point(&Hit { weights, t });
            let [a, b, c] = hit.weights;
            let here = moved(hit.weights, hit.t);
            let d1 = (moved([a - h, b + h, c], hit.t) - here) / h;
            let d2 = (moved([a - h, b, c + h], hit.t) - here) / h;
            let dt = (moved(hit.weights, hit.t + h) - here) / h;
            let by_difference = d1.cross(d2).dot(dt);
            let difference = (by_difference - beam.jacobian(&Lane::default(), &hit)).abs();
            assert!(difference < 1e-3 * (1.0 + by_difference.abs()), "{by_difference}: {difference}");
            if let Some(sign) = beam.sign(&Lane::default(), hit.t) {
                assert!(sign * beam.jacobian(&Lane::default(), &hit) >= -1e-12);
            } else {
                crossed += 1;
            }
        }
        assert!(crossed > 20, "{crossed}");
        let straight = warped(&mut random, 0.0);
        assert_eq!(straight.crossing(), 0.0);
    }

    /// A cubic through its values at four positions.
    fn with_roots(roots: [f64; 3], scale: f64) -> Cubic {
        let at = |t: f64| scale * (t - roots[0]) * (t - roots[1]) * (t - roots[2]);
        let [f0, f1, f2, f3] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].map(at);
        let b = (-5.0 * f0 + 18.0 * f1 - 9.0 * f2 + 2.0 * f3) / 6.0;
        let c = (2.0 * f0 - 9.0 * f1 + 18.0 * f2 - 5.0 * f3) / 6.0;
        Cubic([f0, b, c, f3])
    }

    #[test]
    fn roots_are_found() {
        for roots in
            [[0.2, 0.5, 0.9], [-1.0, 0.3, 4.0], [0.1, 0.11, 0.12], [0.0, 0.25, 1.0], [-3.0, -2.0, 7.0]]
        {
            for scale in [1e-6, 1.0, -1e7] {
                let found = with_roots(roots, scale).roots(&Lane::default());
                let inside: Vec<f64> = roots.into_iter().filter(|t| (0.0..=1.0).contains(t)).collect();
                let found: Vec<f64> = found.into_iter().flatten().collect();
                assert_eq!(found.len(), inside.len(), "{roots:?}: {found:?}");
                assert!(found.iter().zip(&inside).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
            }
        }
        assert_eq!(Cubic([0.0; 4]).roots(&Lane::default()), [None; 3]);
    }

    #[test]
    fn quadratics_are_solved() {
        let found: Vec<f64> = quadratic_roots(&Lane::default(), [-1.0, 0.0, 1.0]).collect();
        assert_eq!(found, [0.5], "a line");
        let found: Vec<f64> = quadratic_roots(&Lane::default(), [2.0, -3.0, 2.0]).collect();
        assert!(found.len() == 2 && found.iter().all(|t| (10.0 * t * t - 10.0 * t + 2.0).abs() < 1e-12));
        assert_eq!(quadratic_roots(&Lane::default(), [1.0, 1.0, 1.0]).count(), 0);
    }
}
