//! Roots in [0, 1] of a cubic in Bernstein form.

use glam::DVec3;

/// A cubic by its Bernstein coefficients.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cubic([f64; 4]);

/// What rounding may make of nothing, in parts of the largest coefficient.
const NOTHING: f64 = 16.0 * f64::EPSILON;

impl Cubic {
    /// `det[a(t), b(t), c(t)]` of three vectors that go straight from `first` to `last`: the polar form of a product.
    pub fn of_determinant(first: &[DVec3; 3], last: &[DVec3; 3]) -> Self {
        let det = |at: [usize; 3]| {
            let [a, b, c] = [0, 1, 2].map(|k| if at[k] == 0 { first[k] } else { last[k] });
            a.cross(b).dot(c)
        };
        let mean = |of: [[usize; 3]; 3]| (det(of[0]) + det(of[1]) + det(of[2])) / 3.0;
        Self([
            det([0, 0, 0]),
            mean([[1, 0, 0], [0, 1, 0], [0, 0, 1]]),
            mean([[0, 1, 1], [1, 0, 1], [1, 1, 0]]),
            det([1, 1, 1]),
        ])
    }

    /// De Casteljau's value.
    fn at(&self, t: f64) -> f64 {
        let step = |a: f64, b: f64| a + t * (b - a);
        let [a, b, c, d] = self.0;
        let (ab, bc, cd) = (step(a, b), step(b, c), step(c, d));
        step(step(ab, bc), step(bc, cd))
    }

    /// Its roots in order, a double one once. None where it is nothing all the time: then all that is asked lies in one plane.
    pub fn roots(&self) -> [Option<f64>; 3] {
        let [a, b, c, d] = self.0;
        let nothing = NOTHING * self.0.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        let mut found = [None; 3];
        if self.0.iter().all(|value| *value > nothing) || self.0.iter().all(|value| *value < -nothing) {
            return found;
        }
        let turns = quadratic_roots([b - a, c - b, d - c]).filter(|t| *t > 0.0 && *t < 1.0);
        let (mut from, mut count) = (0.0, 0);
        for to in turns.chain([1.0]) {
            let root = self.monotone_root(from, to, nothing);
            // A turning point that is a root ends one piece and begins the next.
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

    /// The root in a piece in which it only grows or only falls.
    fn monotone_root(&self, from: f64, to: f64, nothing: f64) -> Option<f64> {
        let (mut low, mut high) = (from, to);
        let (first, last) = (self.at(low), self.at(high));
        if first.abs() <= nothing {
            return (last.abs() > nothing).then_some(low);
        }
        if last.abs() <= nothing {
            return Some(high);
        }
        if first * last > 0.0 {
            return None;
        }
        while high - low > 2.0 * f64::EPSILON * high {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            if self.at(middle) * first > 0.0 { low = middle } else { high = middle }
        }
        Some(0.5 * (low + high))
    }
}

/// The real roots, in order, of a quadratic by its Bernstein coefficients, wherever they are; a double one may come twice.
pub(super) fn quadratic_roots([a, b, c]: [f64; 3]) -> impl Iterator<Item = f64> {
    // a (1 - t)^2 + 2 b t (1 - t) + c t^2 = p t^2 + 2 q t + a
    let (p, q) = (a - 2.0 * b + c, b - a);
    let discriminant = q * q - p * a;
    let root = libm::sqrt(discriminant.max(0.0));
    // The larger in magnitude first, so that nothing cancels.
    let far = if q > 0.0 { -q - root } else { root - q };
    let roots = if discriminant < 0.0 { [f64::NAN; 2] } else { [far / p, a / far] };
    let sorted = if roots[0] > roots[1] { [roots[1], roots[0]] } else { roots };
    sorted.into_iter().filter(|t| t.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From its values at four places.
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
                let found = with_roots(roots, scale).roots();
                let inside: Vec<f64> = roots.into_iter().filter(|t| (0.0..=1.0).contains(t)).collect();
                let found: Vec<f64> = found.into_iter().flatten().collect();
                assert_eq!(found.len(), inside.len(), "{roots:?}: {found:?}");
                assert!(found.iter().zip(&inside).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
            }
        }
        assert_eq!(Cubic([0.0; 4]).roots(), [None; 3]);
    }

    #[test]
    fn quadratics_are_solved() {
        let found: Vec<f64> = quadratic_roots([-1.0, 0.0, 1.0]).collect();
        assert_eq!(found, [0.5], "a line");
        let found: Vec<f64> = quadratic_roots([2.0, -3.0, 2.0]).collect();
        assert!(found.len() == 2 && found.iter().all(|t| (10.0 * t * t - 10.0 * t + 2.0).abs() < 1e-12));
        assert_eq!(quadratic_roots([1.0, 1.0, 1.0]).count(), 0);
    }
}
