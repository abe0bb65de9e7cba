//! Triangle set-up: everything known of a triangle before any tile is visited.

use std::ops::{Add, Mul, Sub};

use crate::geometry::{Cull, MovingVertex, Shear, Viewport};
use crate::shader::Lane;

/// A vertex `open + t delta` on the image plane, as `[x, y, w]` (see [`MovingVertex`]). In this form a still
/// vertex equals `open` to the last bit at all times.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Corner<C = f32> {
    /// Position when the shutter opens.
    pub open: [C; 3],
    /// Closing minus opening position, rounded once.
    pub delta: [C; 3],
}

impl Corner {
    /// The corner at `vertex`.
    pub fn new(vertex: &MovingVertex) -> Self {
        Self { open: vertex.open, delta: difference(vertex.close, vertex.open) }
    }

    /// Vertex at time `t` ([`Self::at`]), computed on a lane; a still one is not moved.
    pub fn vertex_on(lane: &Lane, vertex: &MovingVertex, t: f32, is_still: bool) -> [f32; 3] {
        if is_still {
            return vertex.open;
        }
        std::array::from_fn(|axis| {
            let open = vertex.open[axis];
            lane.fused(t, lane.sub(vertex.close[axis], open), open)
        })
    }

    /// Vertex when the shutter opens and closes, rounded as in the sample test.
    #[inline]
    pub fn ends(&self) -> [[f32; 3]; 2] {
        [self.open, std::array::from_fn(|axis| self.open[axis] + self.delta[axis])]
    }

    /// Vertex at time `t`, rounded as in the sample test: monotone in `t` on every axis.
    #[inline]
    pub fn at(&self, t: f32) -> [f32; 3] {
        let ([x, y, w], [dx, dy, dw]) = (self.open, self.delta);
        [t.mul_add(dx, x), t.mul_add(dy, y), t.mul_add(dw, w)]
    }
}

/// A triangle for traversal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle<C = f32> {
    /// Triangle number in the pass. At equal depth the lower number wins.
    pub id: u32,
    /// Vertices.
    pub corners: [Corner<C>; 3],
    /// Whether any vertex moves; still triangles drop the time dimension.
    pub moving: bool,
    /// Whether any vertex is behind the camera at an end of the shutter, where perspective mirrors it; always
    /// false in an orthographic view.
    pub behind: bool,
    /// Whether samples may see the face that appears clockwise (`[0]`) and counter-clockwise (`[1]`) on the
    /// screen.
    pub faces: [bool; 2],
    /// Rounding allowance of a tile test in `x` and `y`, in their units.
    pub slack: [C; 2],
}

/// Result of set-up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SetupResult {
    /// The triangle goes on to traversal.
    Ready(Triangle),
    /// Two of its corners coincide at all times.
    Degenerate,
    /// The triangle is nearer than the near depth at all times.
    Outside,
    /// The triangle is still and shows a culled face.
    FaceCulled,
}

/// Multiply-adds of the differences between both ends of the vertices of a triangle; none for a still one.
pub const fn difference_madds(moving: bool) -> u32 {
    if moving { 9 } else { 0 }
}

/// Multiply-adds of the determinant that says which face a triangle shows.
const FACING_MADDS: u32 = 9;

/// Set up the triangle `id` with the given vertices; `half_px` is half the size of the image in pixels.
pub fn set_up(
    id: u32,
    vertices: [&MovingVertex; 3],
    cull: Cull,
    shear: &Shear,
    near: f32,
    half_px: [f32; 2],
) -> SetupResult {
    set_up_counted(id, vertices, cull, shear, near, half_px).0
}

/// The same with its multiply-adds. The bounds of rounding are the model's own and are not counted.
pub fn set_up_counted(
    id: u32,
    vertices: [&MovingVertex; 3],
    cull: Cull,
    shear: &Shear,
    near: f32,
    half_px: [f32; 2],
) -> (SetupResult, u32) {
    if has_no_area(vertices) {
        return (SetupResult::Degenerate, 0);
    }
    let (corners, moving) = (vertices.map(Corner::new), vertices.iter().any(|vertex| !vertex.is_still()));
    let madds = difference_madds(moving);
    // The depth of a sample is between those of the vertices, which are farthest at an end of the shutter.
    if corners.iter().all(|c| c.ends().iter().all(|p| p[2] <= near)) {
        return (SetupResult::Outside, madds);
    }
    let faces = [cull != Cull::Back, cull != Cull::Front];
    let slack = slack(&corners, shear, half_px);
    let images = corners.map(|corner| shear.homogeneous(corner.open));
    // Triangles that reach behind the camera are left to the sample test.
    let asks_face =
        !moving && shear.is_none() && !(faces[0] && faces[1]) && images.iter().all(|vertex| vertex[2] > 0.0);
    let madds = madds + if asks_face { FACING_MADDS } else { 0 };
    if asks_face && shows_culled_face(&images, faces, slack) {
        return (SetupResult::FaceCulled, madds);
    }
    let behind = corners.iter().any(|c| c.ends().iter().any(|p| shear.weight(p[2]) < 0.0));
    (SetupResult::Ready(Triangle { id, corners, moving, behind, faces, slack }), madds)
}

/// Whether two vertices coincide at both ends. No sample is on any side of such an edge. Three collinear
/// vertices may still surround a sample after rounding, and neighbours rely on that, so they are kept.
fn has_no_area([a, b, c]: [&MovingVertex; 3]) -> bool {
    a == b || b == c || c == a
}

/// Whether three vertices are collinear at all times, to the last bit. Their area is a vector quadratic in
/// time, whose three Bernstein coefficients vanish together.
pub fn is_flat([a, b, c]: [&MovingVertex; 3]) -> bool {
    let side = |from: &[f32; 3], to: &[f32; 3]| [0, 1, 2].map(|i| f64::from(to[i]) - f64::from(from[i]));
    let (ab0, ab1) = (side(&a.open, &b.open), side(&a.close, &b.close));
    let (ac0, ac1) = (side(&a.open, &c.open), side(&a.close, &c.close));
    let mixed = [0, 1, 2].map(|i| cross(ab0, ac1)[i] + cross(ab1, ac0)[i]);
    [cross(ab0, ac0), mixed, cross(ab1, ac1)].iter().flatten().all(|&part| part == 0.0)
}

/// `a - b`.
fn difference<N: Copy + Sub<Output = N>>(a: [N; 3], b: [N; 3]) -> [N; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

/// `det[a, b, c]`.
fn determinant<N: Copy + Add<Output = N> + Sub<Output = N> + Mul<Output = N>>([a, b, c]: [[N; 3]; 3]) -> N {
    let normal = cross(b, c);
    a[0] * normal[0] + a[1] * normal[1] + a[2] * normal[2]
}

pub(crate) fn cross<N: Copy + Sub<Output = N> + Mul<Output = N>>(a: [N; 3], b: [N; 3]) -> [N; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Whether a still triangle in front of the camera, seen through a pinhole and given by homogeneous points,
/// shows a culled face. The sign of det[p0, p1, p2] is used only beyond its rounding error in the sample
/// test.
fn shows_culled_face(images: &[[f32; 3]; 3], faces: [bool; 2], slack: [f32; 2]) -> bool {
    let p = images.map(|image| image.map(f64::from));
    let det = determinant(p);
    // A sample inside sees every vertex within the extent of the triangle. An edge is a cross product of two
    // vertices, each rounded by the slack at most, and the determinant weights three edges by depth.
    let reach = [0, 1].map(|axis| {
        let seen = |i: usize, j: usize| (p[i][axis] - p[j][axis] / p[j][2] * p[i][2]).abs();
        (0..9).map(|pair| seen(pair / 3, pair % 3)).fold(0.0, f64::max)
    });
    let [slack_x, slack_y] = slack.map(f64::from);
    let depth = p.iter().map(|vertex| vertex[2]).fold(0.0, f64::max);
    let rounding = 6.0 * depth * (slack_x * reach[1] + slack_y * reach[0] + slack_x * slack_y);
    det.abs() > rounding && !faces[usize::from(det < 0.0)]
}

/// Bound of the rounding error of `(x - u s) - (X - u a) w`, or `(x - (X + u s)) + u a w`, for any sample, in
/// x and y. It is more than eight ulp of the largest intermediate value: 2^-20 of the sum of magnitudes.
fn slack(corners: &[Corner; 3], shear: &Shear, half_px: [f32; 2]) -> [f32; 2] {
    const ROUNDING: f32 = 1.0 / 1_048_576.0;
    let mut largest = [0.0_f32; 3];
    for corner in corners {
        for (axis, largest) in largest.iter_mut().enumerate() {
            *largest = largest.max(corner.open[axis].abs() + corner.delta[axis].abs());
        }
    }
    [0, 1].map(|axis| {
        let (image, s, a) = (half_px[axis] + 1.0, shear.s[axis].abs(), shear.a[axis].abs());
        let by_depth = if shear.parallel { image + a * largest[2] } else { (image + a) * largest[2] };
        ROUNDING * (largest[axis] + s + by_depth)
    })
}

/// Pixels `x0..x1` by `y0..y1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelRect {
    /// First column.
    pub x0: u32,
    /// First row.
    pub y0: u32,
    /// One past the last column.
    pub x1: u32,
    /// One past the last row.
    pub y1: u32,
}

impl PixelRect {
    /// The whole viewport.
    pub fn whole(viewport: Viewport) -> Self {
        Self { x0: 0, y0: 0, x1: viewport.width(), y1: viewport.height() }
    }

    /// Pixels with samples in a range of image coordinates x and y, in pixels from the centre of the image,
    /// and one more on each side, as the position of a sample may be rounded up to the next pixel.
    pub fn around(range: [[f32; 2]; 2], viewport: Viewport) -> Self {
        let sides = [viewport.width(), viewport.height()];
        let [x, y] = [0, 1].map(|axis| {
            let ([lo, hi], side) = (range[axis].map(f64::from), f64::from(sides[axis]));
            // The cast truncates, which rounds non-negative values down.
            [lo - 1.0, hi + 2.0].map(|at| (at + 0.5 * side).clamp(0.0, side) as u32)
        });
        Self { x0: x[0], y0: y[0], x1: x[1], y1: y[1] }
    }

    /// Whether it contains no pixel.
    pub fn is_empty(&self) -> bool {
        self.x0 >= self.x1 || self.y0 >= self.y1
    }

    /// Tiles of `side_px` pixels that it touches, as a rectangle in tiles.
    pub fn tiles(&self, side_px: u32) -> Self {
        Self {
            x0: self.x0 / side_px,
            y0: self.y0 / side_px,
            x1: self.x1.div_ceil(side_px),
            y1: self.y1.div_ceil(side_px),
        }
    }

    /// Intersection of both.
    pub fn intersection(&self, other: &Self) -> Self {
        Self {
            x0: self.x0.max(other.x0),
            y0: self.y0.max(other.y0),
            x1: self.x1.min(other.x1),
            y1: self.y1.min(other.y1),
        }
    }
}

/// Pixels that `triangle` may touch: the bounding box of its vertices at the corners of shutter and lens,
/// widened by the rounding of the sample test. While `w` stays positive the image of a vertex is monotone in
/// time and lens position, so the corners are the extremes. Otherwise nothing is divided and the bounds are
/// the whole viewport. In an orthographic view the image moves as the vertex does and is linear in the lens
/// position, so corners suffice again.
pub fn bounds(triangle: &Triangle, shear: &Shear, viewport: Viewport) -> PixelRect {
    let mut nearest = f32::INFINITY;
    let mut range = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for corner in &triangle.corners {
        for p in &corner.ends()[..1 + usize::from(triangle.moving)] {
            let weight = shear.weight(p[2]);
            nearest = nearest.min(weight);
            let inverse = 1.0 / f64::from(weight);
            for (axis, range) in range.iter_mut().enumerate() {
                let (s, a) = (f64::from(shear.s[axis]), f64::from(shear.a[axis]));
                let circle = ((a * f64::from(p[2]) - s) * inverse).abs();
                let x = f64::from(p[axis]) * inverse;
                *range = [range[0].min(x - circle), range[1].max(x + circle)];
            }
        }
    }
    if nearest <= 0.0 {
        return PixelRect::whole(viewport);
    }
    let side = [viewport.width(), viewport.height()];
    let [x, y] = [0, 1].map(|axis| {
        let slack = 2.0 * f64::from(triangle.slack[axis]) / f64::from(nearest);
        let half = 0.5 * f64::from(side[axis]);
        // The cast truncates, which rounds non-negative values down.
        let pixel = |at: f64| at.clamp(0.0, f64::from(side[axis])) as u32;
        [pixel(range[axis][0] - slack + half), pixel(range[axis][1] + slack + half + 1.0)]
    });
    PixelRect { x0: x[0], y0: y[0], x1: x[1], y1: y[1] }
}

/// For each square of `side_px` pixels of the image, row by row, the indices of the rectangles that intersect
/// it, in order.
pub(crate) fn distribute(
    rects: impl IntoIterator<Item = (u32, PixelRect)>,
    viewport: Viewport,
    side_px: u32,
) -> Vec<Vec<u32>> {
    let squares = PixelRect::whole(viewport).tiles(side_px);
    let mut lists = vec![Vec::new(); (squares.x1 * squares.y1) as usize];
    for (index, rect) in rects {
        let met = rect.tiles(side_px);
        for row in met.y0..met.y1 {
            for column in met.x0..met.x1 {
                lists[(row * squares.x1 + column) as usize].push(index);
            }
        }
    }
    lists
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Cull, MovingVertex};
    use crate::setup::{SetupResult, set_up};
    use crate::tally::{Counting, Tally};

    #[test]
    fn the_cost_of_set_up_is_that_of_its_kernels() {
        let tally = Tally::default();
        let points = [[1.0, 2.0, 3.0], [4.0, 5.0, 7.0], [2.0, 8.0, 6.0]];
        let [a, b, c] = points.map(|point| point.map(|value| Counting::new(value, &tally)));
        assert_eq!(determinant([a, b, c]).value(), 20.0);
        assert_eq!(tally.madds(), FACING_MADDS);
        for (close, open) in [(a, b), (b, c), (c, a)] {
            let _ = difference(close, open);
        }
        assert_eq!(tally.madds() - FACING_MADDS, difference_madds(true));
    }

    #[test]
    fn only_what_set_up_computes_is_counted() {
        let open = [[0.0, 0.0, 1.0], [10.0, 0.0, 1.0], [0.0, 10.0, 1.0]];
        let madds = |points: [[f32; 3]; 3], moved: f32, cull: Cull, shear: Shear| {
            let v = points.map(|[x, y, w]| MovingVertex { open: [x, y, w], close: [x + moved, y, w] });
            set_up_counted(0, v.each_ref(), cull, &shear, 0.1, [64.0; 2]).1
        };
        let (pinhole, lens) = (Shear::default(), Shear::new([9.0, -9.0], [3.0, -3.0]));
        for cull in [Cull::Back, Cull::Front] {
            assert_eq!(madds(open, 0.0, cull, pinhole), FACING_MADDS);
            assert_eq!(madds(open, 0.0, cull, lens), 0, "the face depends on the lens position");
            assert_eq!(madds(open, 1.0, cull, pinhole), difference_madds(true), "and on the time");
            let behind = [[0.0, 0.0, -1.0], open[1], open[2]];
            assert_eq!(madds(behind, 0.0, cull, pinhole), 0);
        }
        assert_eq!(madds(open, 0.0, Cull::None, pinhole), 0);
        assert_eq!(madds(open, 1.0, Cull::None, lens), difference_madds(true));
        assert_eq!(madds([open[0], open[0], open[2]], 1.0, Cull::Back, pinhole), 0, "dropped at once");
        let near = open.map(|[x, y, _]| [x, y, 0.05]);
        assert_eq!(madds(near, 1.0, Cull::Back, pinhole), difference_madds(true));
    }

    fn still(p: [f32; 3]) -> MovingVertex {
        MovingVertex { open: p, close: p }
    }

    fn outcome(points: [[f32; 3]; 3], cull: Cull) -> SetupResult {
        let v = points.map(still);
        set_up(3, [&v[0], &v[1], &v[2]], cull, &Shear::default(), 0.1, [64.0, 64.0])
    }

    #[test]
    fn still_vertices_stay_to_the_last_bit() {
        let corner = Corner::new(&still([0.1, -7.3e-5, 1e6]));
        for t in [0.0, 0.1, 0.7, 1.0] {
            assert_eq!(corner.at(t), [0.1, -7.3e-5, 1e6]);
        }
    }

    #[test]
    fn two_corners_in_one_are_dropped_and_a_line_is_kept() {
        let twice = [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [2.0, 1.0, 1.0]];
        assert_eq!(outcome(twice, Cull::None), SetupResult::Degenerate);
        let line = [[0.0, 0.0, 1.0], [1.0, 1.0, 1.0], [2.0, 2.0, 1.0]];
        assert!(matches!(outcome(line, Cull::None), SetupResult::Ready(_)), "rounding may give it an area");
        assert!(is_flat([&still(line[0]), &still(line[1]), &still(line[2])]));
    }

    #[test]
    fn no_area_at_one_instant_is_kept() {
        let v = [
            still([0.0, 0.0, 1.0]),
            still([2.0, 0.0, 1.0]),
            MovingVertex { open: [1.0, 1.0, 1.0], close: [1.0, -1.0, 1.0] },
        ];
        let outcome = set_up(0, [&v[0], &v[1], &v[2]], Cull::None, &Shear::default(), 0.1, [64.0; 2]);
        assert!(matches!(outcome, SetupResult::Ready(t) if t.moving), "{outcome:?}");
    }

    #[test]
    fn faces_are_culled_by_their_winding_on_the_screen() {
        // y points down, so this order is clockwise on the screen: a back face.
        let clockwise = [[0.0, 0.0, 1.0], [10.0, 0.0, 1.0], [0.0, 10.0, 1.0]];
        assert_eq!(outcome(clockwise, Cull::Back), SetupResult::FaceCulled);
        assert!(matches!(outcome(clockwise, Cull::Front), SetupResult::Ready(_)));
        assert!(matches!(outcome(clockwise, Cull::None), SetupResult::Ready(_)));
    }

    #[test]
    fn triangles_nearer_than_the_near_depth_are_outside() {
        let behind = [[0.0, 0.0, -1.0], [10.0, 0.0, -1.0], [0.0, 10.0, 0.05]];
        assert_eq!(outcome(behind, Cull::None), SetupResult::Outside);
    }

    fn triangle(open: [[f32; 3]; 3], close: [[f32; 3]; 3]) -> Triangle {
        let v = [0, 1, 2].map(|i| MovingVertex { open: open[i], close: close[i] });
        match set_up(0, [&v[0], &v[1], &v[2]], Cull::None, &Shear::default(), 0.1, [64.0; 2]) {
            SetupResult::Ready(triangle) => triangle,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_moving_box_spans_both_ends() {
        let open = [[-20.0, -20.0, 1.0], [-10.5, -20.0, 1.0], [-20.0, -10.5, 1.0]];
        let close = open.map(|[x, y, w]| [x + 30.0, y, w]);
        let rect = bounds(&triangle(open, close), &Shear::default(), Viewport::new(128, 128).unwrap());
        assert_eq!(rect, PixelRect { x0: 43, y0: 43, x1: 84, y1: 54 });
    }

    #[test]
    fn a_vertex_behind_the_camera_asks_for_everything() {
        let open = [[-20.0, -20.0, 1.0], [-10.0, -20.0, -1.0], [-20.0, -10.0, 1.0]];
        let viewport = Viewport::new(128, 96).unwrap();
        assert_eq!(bounds(&triangle(open, open), &Shear::default(), viewport), PixelRect::whole(viewport));
    }

    #[test]
    fn off_screen_is_empty() {
        let open = [[500.0, 0.0, 1.0], [600.0, 0.0, 1.0], [500.0, 10.0, 1.0]];
        assert!(bounds(&triangle(open, open), &Shear::default(), Viewport::new(128, 96).unwrap()).is_empty());
    }
}
