//! When a triangle that moves on straight lines touches a tile: exact roots.
//!
//! On the homogeneous image plane a vertex is `p(s) = p_0 + s (p_1 - p_0)`. The triangle begins or ceases to touch a rectangle
//! only where a vertex crosses a side (`x(s) - X w(s)`, linear), a corner of the rectangle crosses an edge (`p_i x p_j`
//! seen from the corner, quadratic) or, where it reaches to the near plane, where the cut does (linear, quadratic). Between two
//! such instants nothing changes, so one test in the middle decides (the idea of Gribel et al. 2010 for a point, here for a tile).

use glam::{DVec2, DVec3};
use pipeline::traversal::TileRect;

/// Three vertices `[x, y, w]` at both ends of a parameter that runs from 0 to 1.
#[derive(Clone, Copy, Debug)]
pub struct Sweep {
    /// At 0.
    pub from: [DVec3; 3],
    /// At 1.
    pub to: [DVec3; 3],
}

/// A rectangle of the image in pixels from its centre.
#[derive(Clone, Copy, Debug)]
pub struct Rect {
    low: DVec2,
    high: DVec2,
}

impl Rect {
    /// The rectangle of a tile.
    pub fn new(tile: &TileRect) -> Self {
        let at = |end: usize| DVec2::new(f64::from(tile.x[end]), f64::from(tile.y[end]));
        Self { low: at(0), high: at(1) }
    }

    /// The four corners.
    pub fn corners(&self) -> [DVec2; 4] {
        let Self { low, high } = *self;
        [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)]
    }

    /// The point at fractions `across` and `down` of its sides.
    pub fn at(&self, across: f64, down: f64) -> DVec2 {
        self.low + (self.high - self.low) * DVec2::new(across, down)
    }
}

impl Sweep {
    /// The vertices at `s`.
    pub fn at(&self, s: f64) -> [DVec3; 3] {
        [0, 1, 2].map(|k| self.from[k] + s * (self.to[k] - self.from[k]))
    }

    /// Whether all of it lies beyond `near` all the time, so that every instant is an exact root.
    pub fn is_beyond(&self, near: f64) -> bool {
        self.from.iter().chain(&self.to).all(|p| p.z > near)
    }

    /// The hull of the values of the parameter at which the part beyond `near` touches `rect`.
    pub fn touching(&self, rect: &Rect, near: f64) -> Option<[f64; 2]> {
        let mut instants = vec![0.0, 1.0];
        self.instants(rect, near, &mut instants);
        instants.sort_by(f64::total_cmp);
        let mut hull: Option<[f64; 2]> = None;
        for pair in instants.windows(2).filter(|pair| pair[0] < pair[1]) {
            if touches(&self.at(0.5 * (pair[0] + pair[1])), rect, near) {
                hull = Some([hull.map_or(pair[0], |[first, _]| first), pair[1]]);
            }
        }
        hull
    }

    fn instants(&self, rect: &Rect, near: f64, into: &mut Vec<f64>) {
        let cut = !self.is_beyond(near);
        for k in 0..3 {
            for (axis, side) in sides(rect) {
                linear(|s| self.at(s)[k][axis] - side * self.at(s)[k].z, into);
            }
            for corner in rect.corners() {
                quadratic(|s| edge(&self.at(s), k, corner), into);
            }
            if cut {
                linear(|s| self.at(s)[k].z - near, into);
                for (axis, side) in sides(rect) {
                    quadratic(|s| at_the_cut(&self.at(s), k, near, axis, side), into);
                }
            }
        }
        if cut {
            // Where the cut passes over a corner is a cubic that is not solved; these stand in for its roots.
            into.extend((1..64).map(|step| f64::from(step) / 64.0));
        }
    }
}

fn sides(rect: &Rect) -> [(usize, f64); 4] {
    [(0, rect.low.x), (0, rect.high.x), (1, rect.low.y), (1, rect.high.y)]
}

/// The edge from vertex `k` to the next as seen from `point`.
fn edge(p: &[DVec3; 3], k: usize, point: DVec2) -> f64 {
    let [i, j] = [p[k], p[(k + 1) % 3]].map(|p| p.truncate() - point * p.z);
    i.perp_dot(j)
}

/// Zero where the point of edge `k` at depth `near` lies on the side.
fn at_the_cut(p: &[DVec3; 3], k: usize, near: f64, axis: usize, side: f64) -> f64 {
    let (i, j) = (p[k], p[(k + 1) % 3]);
    i[axis] * (j.z - near) - j[axis] * (i.z - near) - side * near * (j.z - i.z)
}

fn linear(f: impl Fn(f64) -> f64, into: &mut Vec<f64>) {
    let (f0, f1) = (f(0.0), f(1.0));
    keep(f0 / (f0 - f1), into);
}

/// The roots of a quadratic known by three values, without cancellation.
fn quadratic(f: impl Fn(f64) -> f64, into: &mut Vec<f64>) {
    let (f0, middle, f1) = (f(0.0), f(0.5), f(1.0));
    let (a, b, c) = (2.0 * f0 - 4.0 * middle + 2.0 * f1, 4.0 * middle - 3.0 * f0 - f1, f0);
    let discriminant = b * b - 4.0 * a * c;
    if discriminant >= 0.0 {
        let q = -0.5 * (b + discriminant.sqrt().copysign(b));
        keep(q / a, into);
        keep(c / q, into);
    }
}

fn keep(root: f64, into: &mut Vec<f64>) {
    if root > 0.0 && root < 1.0 {
        into.push(root);
    }
}

/// Whether the part of a triangle beyond `near` touches the rectangle: clipped, projected, then separating axes.
fn touches(corners: &[DVec3; 3], rect: &Rect, near: f64) -> bool {
    let (points, count) = clipped(corners, near);
    let points = &points[..count];
    if count < 3 {
        return false;
    }
    let apart = |axis: DVec2| {
        let [polygon, tile] = [extent(points, axis), extent(&rect.corners(), axis)];
        polygon[1] < tile[0] || polygon[0] > tile[1]
    };
    let sides = (0..count).map(|k| (points[(k + 1) % count] - points[k]).perp());
    ![DVec2::X, DVec2::Y].into_iter().chain(sides).any(apart)
}

fn extent(points: &[DVec2], axis: DVec2) -> [f64; 2] {
    points
        .iter()
        .map(|p| p.dot(axis))
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], d| [low.min(d), high.max(d)])
}

/// The image of the part beyond `near`: up to four points.
fn clipped(corners: &[DVec3; 3], near: f64) -> ([DVec2; 4], usize) {
    let (mut points, mut count) = ([DVec2::ZERO; 4], 0);
    let mut push = |p: DVec3| {
        if count < 4 {
            points[count] = p.truncate() / p.z;
            count += 1;
        }
    };
    for k in 0..3 {
        let (p, q) = (corners[k], corners[(k + 1) % 3]);
        if p.z >= near {
            push(p);
        }
        if (p.z >= near) != (q.z >= near) {
            let mut at = p + (q - p) * ((near - p.z) / (q.z - p.z));
            at.z = near;
            push(at);
        }
    }
    (points, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rect() -> Rect {
        Rect { low: DVec2::ZERO, high: DVec2::splat(8.0) }
    }

    fn triangle(x: f64, w: f64) -> [DVec3; 3] {
        [[x, 2.0], [x + 4.0, 2.0], [x, 6.0]].map(|[x, y]| DVec3::new(x * w, y * w, w))
    }

    #[test]
    fn a_passing_triangle_touches_from_its_front_to_its_rear() {
        // The front, 4 px ahead, is at 0 after 6 of 30 px; the rear is at 8 after 18.
        let sweep = Sweep { from: triangle(-10.0, 2.0), to: triangle(20.0, 2.0) };
        let [first, last] = sweep.touching(&rect(), 0.1).unwrap();
        assert!((first - 0.2).abs() < 1e-12 && (last - 0.6).abs() < 1e-12, "{first} {last}");
        assert!(sweep.is_beyond(0.1));
    }

    #[test]
    fn a_corner_met_by_an_edge_alone_counts() {
        // An edge that runs along the diagonal passes the corner (0, 0); no vertex comes near.
        let at = |d: f64| [[d - 50.0, d + 50.0], [d + 50.0, d - 50.0], [d - 90.0, d - 90.0]];
        let [from, to] = [-10.0, 10.0].map(|d| at(d).map(|[x, y]| DVec3::new(x, y, 1.0)));
        let [first, last] = Sweep { from, to }.touching(&rect(), 0.1).unwrap();
        assert!((first - 0.5).abs() < 1e-12 && last == 1.0, "{first} {last}");
    }

    #[test]
    fn what_is_too_near_does_not_touch() {
        let sweep = Sweep { from: triangle(1.0, 2.0), to: triangle(1.0, -2.0) };
        let [first, last] = sweep.touching(&rect(), 1.0).unwrap();
        assert!(first == 0.0 && (last - 0.25).abs() < 1e-12, "{first} {last}");
        assert!(!sweep.is_beyond(1.0));
        assert!(Sweep { from: triangle(1.0, 0.5), to: triangle(1.0, 0.5) }.touching(&rect(), 1.0).is_none());
    }

    #[test]
    fn a_quadratic_gives_both_roots() {
        let mut roots = Vec::new();
        quadratic(|s| (s - 0.25) * (s - 0.75) * 1e9, &mut roots);
        roots.sort_by(f64::total_cmp);
        assert!((roots[0] - 0.25).abs() < 1e-9 && (roots[1] - 0.75).abs() < 1e-9, "{roots:?}");
    }
}
