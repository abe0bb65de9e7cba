//! The true interval of lens and time in which a triangle touches a tile.
//!
//! For a pinhole it is exact ([`SweptTriangle`]). For a lens it is a lower bound: places where a point of the
//! triangle is seen at a point of the tile (solved for `u, v`), widened from the outermost of these by exact
//! roots along `t`, `u` and `v` in turn.
//!
//! Roots in time: on the homogeneous image plane a vertex is `p(s) = p_0 + s (p_1 - p_0)`. The triangle
//! begins or ceases to touch a rectangle only where a vertex crosses a side (`x(s) - X w(s)`, linear), a
//! corner of the rectangle crosses an edge (`p_i x p_j` seen from the corner, quadratic) or, where it reaches
//! to the near plane, where the cut does (linear, quadratic). Between two such instants nothing changes, so
//! one test in the middle decides (the idea of Gribel et al. 2010 for a point, here for a tile).

use glam::{DVec2, DVec3};
use pipeline::Shear;
use pipeline::setup::Triangle;
use pipeline::traversal::TileRect;

/// Hulls of what is true of `u`, `v` and `t`, the lens in [-1, 1].
pub type Hulls = [[f64; 2]; 3];

/// A point of the lens and the shutter at the end of a hull, as `[u, v, t]`.
type ExtremePoint = [f64; 3];

/// A triangle, a lens and a tile.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    ends: SweptTriangle,
    s: DVec2,
    a: DVec2,
    rect: ImageRect,
    near: f64,
    moving: bool,
}

impl Truth {
    /// For `triangle` as seen by a camera with `shear` and the near depth `near`.
    pub fn new(triangle: &Triangle, shear: &Shear, tile: &TileRect, near: f32) -> Self {
        let wide = |p: [f32; 3]| DVec3::from(p.map(f64::from));
        let from = triangle.corners.map(|corner| wide(corner.open));
        let to = triangle.corners.map(|corner| wide(corner.open) + wide(corner.delta));
        let [s, a] = [shear.s, shear.a].map(|c| DVec2::from(c.map(f64::from)));
        let (near, moving) = (f64::from(near), triangle.moving);
        Self { ends: SweptTriangle { from, to }, s, a, rect: ImageRect::new(tile), near, moving }
    }

    /// Whether [`Self::hulls`] is exact rather than found from below.
    pub fn is_exact(&self) -> bool {
        self.s == DVec2::ZERO && self.ends.is_beyond(self.near)
    }

    /// The hulls, or `None` where nothing was found to touch.
    pub fn hulls(&self) -> Option<Hulls> {
        let whole = [[-1.0, 1.0], [-1.0, 1.0]];
        if self.s == DVec2::ZERO {
            let t = self.ends.touching(&self.rect, self.near)?;
            return Some([whole[0], whole[1], t]);
        }
        let mut found = Found::default();
        self.seeds(&mut found);
        for _ in 0..3 {
            let Some(outermost) = found.outermost else { break };
            outermost.as_flattened().iter().for_each(|point| self.along_axes(*point, &mut found));
            if found.outermost == Some(outermost) {
                break;
            }
        }
        found.hulls()
    }

    /// A vertex seen from `(u, v)` of the lens.
    fn sheared(&self, p: DVec3, u: f64, v: f64) -> DVec3 {
        (p.truncate() + DVec2::new(u, v) * (self.a * p.z - self.s)).extend(p.z)
    }

    /// Places where points of the triangle are seen at points of the tile, and times along a few places of the lens.
    fn seeds(&self, found: &mut Found) {
        const STEPS: i32 = 4;
        for place in 0..9 {
            let [u, v] = [place % 3, place / 3].map(|step| f64::from(step) - 1.0);
            self.along_axes([u, v, 0.5], found);
        }
        for instant in 0..if self.moving { 9 } else { 1 } {
            let t = f64::from(instant) / 8.0;
            let corners = self.ends.at(t);
            for step in 0..(STEPS + 1) * (STEPS + 1) {
                let [i, j] = [step % (STEPS + 1), step / (STEPS + 1)];
                if i + j <= STEPS {
                    let [i, j] = [i, j].map(|weight| f64::from(weight) / f64::from(STEPS));
                    let p = corners[0] + i * (corners[1] - corners[0]) + j * (corners[2] - corners[0]);
                    self.seen(p, t, found);
                }
            }
        }
    }

    /// From where on the lens `p` is seen at points of the tile.
    fn seen(&self, p: DVec3, t: f64, found: &mut Found) {
        let sway = self.a * p.z - self.s;
        for place in 0..9 {
            let at = self.rect.at(f64::from(place % 3) * 0.5, f64::from(place / 3) * 0.5);
            let lens = (at * p.z - p.truncate()) / sway;
            if p.z > self.near && lens.abs().max_element() <= 1.0 {
                found.add([lens.x, lens.y, t]);
            }
        }
    }

    /// Exact roots along each axis through a point.
    fn along_axes(&self, [u, v, t]: ExtremePoint, found: &mut Found) {
        let along = |sweep: SweptTriangle| sweep.touching(&self.rect, self.near);
        let ends = |point: fn(f64, ExtremePoint) -> ExtremePoint, hull: [f64; 2], found: &mut Found| {
            hull.into_iter().for_each(|s| found.add(point(s, [u, v, t])));
        };
        let of = |corners: [DVec3; 3], u: f64, v: f64| corners.map(|p| self.sheared(p, u, v));
        let now = self.ends.at(t);
        if let Some(hull) =
            along(SweptTriangle { from: of(self.ends.from, u, v), to: of(self.ends.to, u, v) })
        {
            ends(|s, [u, v, _]| [u, v, s], hull, found);
        }
        if let Some(hull) = along(SweptTriangle { from: of(now, -1.0, v), to: of(now, 1.0, v) }) {
            ends(|s, [_, v, t]| [2.0 * s - 1.0, v, t], hull, found);
        }
        if let Some(hull) = along(SweptTriangle { from: of(now, u, -1.0), to: of(now, u, 1.0) }) {
            ends(|s, [u, _, t]| [u, 2.0 * s - 1.0, t], hull, found);
        }
    }
}

/// The outermost places found so far: for each of `u, v, t` the lowest and the highest.
#[derive(Clone, Copy, Debug, Default)]
struct Found {
    outermost: Option<[[ExtremePoint; 2]; 3]>,
}

impl Found {
    fn add(&mut self, point: ExtremePoint) {
        let outermost = self.outermost.get_or_insert([[point; 2]; 3]);
        for (axis, [low, high]) in outermost.iter_mut().enumerate() {
            if point[axis] < low[axis] {
                *low = point;
            }
            if point[axis] > high[axis] {
                *high = point;
            }
        }
    }

    fn hulls(&self) -> Option<Hulls> {
        let outermost = self.outermost?;
        Some([0, 1, 2].map(|axis| outermost[axis].map(|point| point[axis])))
    }
}

/// Three vertices `[x, y, w]` at both ends of a parameter that runs from 0 to 1.
#[derive(Clone, Copy, Debug)]
pub struct SweptTriangle {
    /// At 0.
    pub from: [DVec3; 3],
    /// At 1.
    pub to: [DVec3; 3],
}

/// A rectangle of the image in pixels from its centre.
#[derive(Clone, Copy, Debug)]
pub struct ImageRect {
    low: DVec2,
    high: DVec2,
}

impl ImageRect {
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

impl SweptTriangle {
    /// The vertices at `s`.
    pub fn at(&self, s: f64) -> [DVec3; 3] {
        [0, 1, 2].map(|k| self.from[k] + s * (self.to[k] - self.from[k]))
    }

    /// Whether all of it lies beyond `near` all the time, so that every instant is an exact root.
    pub fn is_beyond(&self, near: f64) -> bool {
        self.from.iter().chain(&self.to).all(|p| p.z > near)
    }

    /// The hull of the values of the parameter at which the part beyond `near` touches `rect`.
    pub fn touching(&self, rect: &ImageRect, near: f64) -> Option<[f64; 2]> {
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

    fn instants(&self, rect: &ImageRect, near: f64, into: &mut Vec<f64>) {
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

fn sides(rect: &ImageRect) -> [(usize, f64); 4] {
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
fn touches(corners: &[DVec3; 3], rect: &ImageRect, near: f64) -> bool {
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
    use pipeline::setup::{SetupResult, set_up};
    use pipeline::{Cull, MovingVertex};

    use super::*;

    fn truth(open: [[f32; 3]; 3], close: [[f32; 3]; 3], shear: Shear, tile: TileRect) -> Truth {
        let v = [0, 1, 2].map(|k| MovingVertex { open: open[k], close: close[k] });
        let SetupResult::Ready(triangle) =
            set_up(0, [&v[0], &v[1], &v[2]], Cull::None, &shear, 0.1, [64.0; 2])
        else {
            panic!("the triangle is visible");
        };
        Truth::new(&triangle, &shear, &tile, 0.1)
    }

    const TILE: TileRect = TileRect { x: [0.0, 8.0], y: [0.0, 8.0] };

    #[test]
    fn before_a_pinhole_it_is_exact() {
        let open = [[-20.0, 4.0, 2.0], [-12.0, 4.0, 2.0], [-20.0, 12.0, 2.0]];
        let close = open.map(|[x, y, w]| [x + 60.0, y, w]);
        let truth = truth(open, close, Shear::default(), TILE);
        let [_, _, t] = truth.hulls().unwrap();
        assert!(truth.is_exact());
        // Pixels are halves of these: the front at -6, the rear at -10, 30 to go.
        assert!((t[0] - 0.2).abs() < 1e-12 && (t[1] - 0.6).abs() < 1e-12, "{t:?}");
    }

    #[test]
    fn a_point_out_of_focus_is_seen_from_where_it_should() {
        // At depth 4 and focus 2 with s = 80 the blur is 20 px in radius: u moves the image by 20 px. A
        // triangle of a hundredth of a pixel about (-10, 4) touches the tile for u from 0.5 to 0.9, v
        // from -0.2 to 0.2.
        let corner = |x: f32, y: f32| [4.0 * (-10.0 + x), 4.0 * (4.0 + y), 4.0];
        let open = [corner(0.0, 0.0), corner(0.01, 0.0), corner(0.0, 0.01)];
        let truth = truth(open, open, Shear::new([80.0, -80.0], [40.0, -40.0]), TILE);
        let [u, v, t] = truth.hulls().unwrap();
        let expected = [[0.5, 0.9], [-0.2, 0.2], [0.0, 1.0]];
        for (found, expected) in [u, v, t].into_iter().zip(expected) {
            for end in [0, 1] {
                assert!((found[end] - expected[end]).abs() < 1e-3, "{u:?} {v:?} {t:?}");
            }
        }
        assert!(!truth.is_exact());
    }

    fn rect() -> ImageRect {
        ImageRect { low: DVec2::ZERO, high: DVec2::splat(8.0) }
    }

    fn triangle(x: f64, w: f64) -> [DVec3; 3] {
        [[x, 2.0], [x + 4.0, 2.0], [x, 6.0]].map(|[x, y]| DVec3::new(x * w, y * w, w))
    }

    #[test]
    fn a_passing_triangle_touches_from_its_front_to_its_rear() {
        // The front, 4 px ahead, is at 0 after 6 of 30 px; the rear is at 8 after 18.
        let sweep = SweptTriangle { from: triangle(-10.0, 2.0), to: triangle(20.0, 2.0) };
        let [first, last] = sweep.touching(&rect(), 0.1).unwrap();
        assert!((first - 0.2).abs() < 1e-12 && (last - 0.6).abs() < 1e-12, "{first} {last}");
        assert!(sweep.is_beyond(0.1));
    }

    #[test]
    fn a_corner_met_by_an_edge_alone_counts() {
        // An edge that runs along the diagonal passes the corner (0, 0); no vertex comes near.
        let at = |d: f64| [[d - 50.0, d + 50.0], [d + 50.0, d - 50.0], [d - 90.0, d - 90.0]];
        let [from, to] = [-10.0, 10.0].map(|d| at(d).map(|[x, y]| DVec3::new(x, y, 1.0)));
        let [first, last] = SweptTriangle { from, to }.touching(&rect(), 0.1).unwrap();
        assert!((first - 0.5).abs() < 1e-12 && last == 1.0, "{first} {last}");
    }

    #[test]
    fn what_is_too_near_does_not_touch() {
        let sweep = SweptTriangle { from: triangle(1.0, 2.0), to: triangle(1.0, -2.0) };
        let [first, last] = sweep.touching(&rect(), 1.0).unwrap();
        assert!(first == 0.0 && (last - 0.25).abs() < 1e-12, "{first} {last}");
        assert!(!sweep.is_beyond(1.0));
        assert!(
            SweptTriangle { from: triangle(1.0, 0.5), to: triangle(1.0, 0.5) }
                .touching(&rect(), 1.0)
                .is_none()
        );
    }

    #[test]
    fn a_quadratic_gives_both_roots() {
        let mut roots = Vec::new();
        quadratic(|s| (s - 0.25) * (s - 0.75) * 1e9, &mut roots);
        roots.sort_by(f64::total_cmp);
        assert!((roots[0] - 0.25).abs() < 1e-9 && (roots[1] - 0.75).abs() < 1e-9, "{roots:?}");
    }
}
