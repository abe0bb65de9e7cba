//! Traversal: tile tests, which bound the lens positions and times at which a tile may contain a sample that
//! sees the triangle.
//!
//! A test is conservative: it may keep too much but never too little. It evaluates the expressions of the
//! sample test at the corners of the tile, with an allowance for the rounding of both.
//!
//! Both modes of the pipeline run these tests. They take vertices in `f32` that may be off by half of
//! [`slack`](crate::setup::Triangle::slack): in standard mode by the rounding of the sample test, in
//! conservative mode by that of the input ([`conservative`](crate::conservative)).
//!
//! *Cost* of each test in multiply-adds, the same for perspective and orthographic views. The kernels are
//! generic over [`Number`]. The tests below run them with counting numbers and compare the counts with these
//! constants.
//!
//! *Motion and blur thresholds*: how far motion and blur move the outline of a triangle on the image. The
//! image of a vertex in front of the camera moves monotonically in time on both axes, so its distance from
//! its mid-shutter image is largest at an end. Over the lens it moves on a line, with the largest distance at
//! the ends, by `a - s / w`, which is monotone in `w`. In an orthographic view the distance is `a w - s`,
//! also monotone. The image of a triangle in front of the camera is the hull of the images of its vertices,
//! so no point of its outline moves farther than they do.

mod edges;
mod lens;
mod number;
mod region;
mod screen;
mod side_planes;
mod time_interval;

use crate::geometry::{MovingVertex, Shear};
pub use edges::{EdgeBounds, Edges};
pub use lens::{LensLines, LensSpan, LensSpans};
pub use number::{Coordinate, Number, Pieces, Quadratic, Scalar};
pub use region::{Box5, Faces, Piece, TileRect, TileView, TimePieces};
pub use screen::{Facing, SCREEN_GAIN_MADDS, Screen, screen_madds};
pub use side_planes::{narrow, narrow_by_sides, narrow_counted, narrow_near};
pub use time_interval::{TimeIntervals, time_interval, time_interval_counted};

#[cfg(test)]
pub(crate) use number::counted;

/// Multiply-adds of [`motion_px`], through a pinhole or a lens.
pub const fn motion_madds(lens: bool) -> u32 {
    3 * if lens { 42 } else { 22 }
}

/// Multiply-adds of [`blur_px`].
pub const BLUR_MADDS: u32 = 3 * 2 * 2 * 2;

/// Largest distance in pixels of a vertex from its mid-shutter image, through a pinhole or from anywhere on
/// the lens. Infinite if a vertex is not in front of the camera.
pub fn motion_px(vertices: [&MovingVertex; 3], shear: &Shear) -> f64 {
    let one = |vertex: &MovingVertex| {
        let ends = [vertex.open, vertex.close];
        let is_in_front = ends.iter().all(|end| shear.weight(end[2]) > 0.0);
        if is_in_front { distance(ends.map(|end| end.map(f64::from)), shear) } else { f64::INFINITY }
    };
    vertices.map(one).into_iter().fold(0.0, f64::max)
}

/// Largest radius in pixels of the circle of confusion of a vertex at either end of the shutter. Infinite if
/// one is not in front of the camera.
pub fn blur_px(vertices: [&MovingVertex; 3], shear: &Shear) -> f64 {
    let ends = vertices.into_iter().flat_map(|vertex| [vertex.open[2], vertex.close[2]]);
    let radius = |w: f32| if shear.weight(w) > 0.0 { radius(f64::from(w), shear) } else { f64::INFINITY };
    ends.map(radius).fold(0.0, f64::max)
}

/// Largest distance of a vertex in front of the camera, given by its ends, from its image in the middle.
fn distance<N: Number>([open, close]: [[N; 3]; 2], shear: &Shear) -> N {
    let middle = [0, 1, 2].map(|axis| (open[axis] + close[axis]) * N::from(0.5));
    let image = |p: [N; 3]| [0, 1].map(|axis| if shear.parallel { p[axis] } else { p[axis] / p[2] });
    let circles = |p: [N; 3]| [0, 1].map(|axis| circle(axis, p[2], shear));
    let (has_lens, images) = (!shear.is_none(), [open, middle, close].map(image));
    let circles = has_lens.then(|| [open, middle, close].map(circles));
    let away = |end: usize| {
        let [x, y] = [0, 1].map(|axis| {
            let moved = (images[end][axis] - images[1][axis]).abs();
            let blurred = circles.map(|circles| (circles[end][axis] - circles[1][axis]).abs());
            blurred.map_or(moved, |blurred| moved + blurred)
        });
        (x * x + y * y).sqrt()
    };
    away(0).max(away(2))
}

/// Larger radius of the circle of confusion at a depth in front of the camera.
fn radius<N: Number>(depth: N, shear: &Shear) -> N {
    circle(0, depth, shear).abs().max(circle(1, depth, shear).abs())
}

/// [`Shear::circle`] in any numbers.
fn circle<N: Number>(axis: usize, depth: N, shear: &Shear) -> N {
    let [s, a] = [shear.s, shear.a].map(|of| N::from(of[axis]));
    if shear.parallel { a * depth - s } else { a - s / depth }
}

/// The vertex at its mid-shutter position, still.
pub fn at_rest(vertex: &MovingVertex) -> MovingVertex {
    let middle = [0, 1, 2].map(|axis| vertex.open[axis] + 0.5 * (vertex.close[axis] - vertex.open[axis]));
    MovingVertex { open: middle, close: middle }
}

/// Solving one quadratic for its roots.
const ROOT: u32 = 8;

/// Converting a time to its position in the interval of a box.
const PHASE: u32 = 3;

/// Finding the zero of a distance to a side, and mapping it to a range.
const SIDE_ROOT: u32 = 4;

/// Testing a triangle against one side of a tile, without roots.
pub const fn side_madds(moving: bool, lens: bool, behind: bool) -> u32 {
    by(moving, lens, [6, 24, 18, 48]) * if behind { 2 } else { 1 }
}

/// Testing a triangle against the near depth, without roots.
const fn near_madds(moving: bool) -> u32 {
    by(moving, false, [4, 13, 0, 0])
}

/// Select by dimensions in use: 2D, with time, with lens, both.
const fn by(moving: bool, lens: bool, madds: [u32; 4]) -> u32 {
    madds[moving as usize + 2 * lens as usize]
}

/// Finding the dual-space lines of a triangle.
pub const fn lens_line_setup_madds(moving: bool) -> u32 {
    by(moving, true, [0, 0, 74, 152])
}

/// Testing the lines against a tile, with `crossings` computed.
pub const fn lens_line_madds(crossings: u32) -> u32 {
    8 + 3 * crossings
}

/// Transforming a triangle's vertices and edges to a box.
pub const fn edge_madds(moving: bool, lens: bool) -> u32 {
    by(moving, lens, [39, 141, 79, 217])
}

/// Bounding the determinant over a box, with `bisections` of the time.
pub const fn facing_madds(moving: bool, lens: bool, bisections: u32) -> u32 {
    by(moving, lens, [10, 33, 26, 69]) + bisections * 27
}

/// Bounding the edges over a box, without roots and phases.
pub const fn edge_bound_madds(moving: bool, lens: bool) -> u32 {
    by(moving, lens, [12, 30, 28, 64])
}

/// Linearizing the edges over a box; a part of its time costs more than the whole.
pub const fn screen_setup_madds(moving: bool, lens: bool, whole: bool) -> u32 {
    by(moving, lens, [8, 86, 30, 162]) + if whole { 0 } else { by(moving, lens, [0, 132, 0, 228]) }
}

/// Random triangles over random boxes, with direct evaluation in `f64`, for tests.
#[cfg(test)]
mod testing {
    use super::{Box5, TileRect};
    use crate::geometry::{Cull, MovingVertex, Shear};
    use crate::random::{GOLDEN, SplitMix, mix};
    use crate::setup::{SetupResult, Triangle, set_up};

    pub const NEAR: f32 = 0.25;

    /// Uniform numbers.
    pub struct Uniform(SplitMix);

    impl Uniform {
        pub fn new(seed: u64) -> Self {
            Self(SplitMix::new(mix(seed.wrapping_add(GOLDEN))))
        }

        pub fn within(&mut self, lo: f32, hi: f32) -> f32 {
            self.0.within_single(lo, hi)
        }

        /// A number of a range, often an end of it.
        pub fn often_an_end(&mut self, [lo, hi]: [f32; 2]) -> f32 {
            match self.within(0.0, 4.0) as u32 {
                0 => lo,
                1 => hi,
                _ => self.within(lo, hi).clamp(lo, hi),
            }
        }

        /// Non-negative weights that add up to 1.
        pub fn weights(&mut self) -> [f64; 3] {
            let parts = [0; 3].map(|_| f64::from(self.within(0.0, 1.0)).powi(3));
            let sum: f64 = parts.iter().sum();
            parts.map(|part| part / sum.max(1e-30))
        }
    }

    /// A triangle over a box.
    pub struct Case {
        pub triangle: Triangle,
        pub shear: Shear,
        pub tile: TileRect,
        pub within: Box5,
    }

    /// A random case; a third of the vertices of every other triangle may be behind the camera.
    pub fn case(seed: u64, moving: bool, lens: bool, parallel: bool) -> Case {
        let mut r = Uniform::new(seed);
        let size = [4.0, 40.0, 400.0][(seed % 3) as usize];
        let shear = if lens { Shear::new([90.0, -90.0], [15.0, -15.0]) } else { Shear::default() };
        // A short focus depth, so that terms with depth dominate, with opposite signs on the two axes.
        let shear = match (parallel, lens) {
            (true, true) => Shear { parallel, ..Shear::new([12.0, -30.0], [18.0, -5.0]) },
            _ => Shear { parallel, ..shear },
        };
        let [px, py] = [r.within(-60.0, 52.0).floor(), r.within(-60.0, 52.0).floor()];
        let side = [1.0, 8.0, 32.0][(seed / 3 % 3) as usize];
        let tile = TileRect { x: [px, px + side], y: [py, py + side] };
        let mut end = || {
            let behind = seed.is_multiple_of(2) && r.within(0.0, 1.0) < 0.33;
            let w = if behind { r.within(-3.0, 1.0) } else { r.within(2.0, 9.0) };
            let weight = shear.weight(w);
            [(px + r.within(-size, size)) * weight, (py + r.within(-size, size)) * weight, w]
        };
        let v = [0; 3].map(|_| {
            let (open, close) = (end(), end());
            let close = [0, 1, 2].map(|k| open[k] + 0.3 * (close[k] - open[k]));
            MovingVertex { open, close: if moving { close } else { open } }
        });
        let mut range = |lo: f32, hi: f32| {
            let ends = [r.within(lo, hi), r.within(lo, hi)];
            [ends[0].min(ends[1]), ends[0].max(ends[1])]
        };
        let within = Box5 { u: range(-1.0, 1.0), v: range(-1.0, 1.0), t: range(0.0, 1.0), lens };
        match set_up(0, [&v[0], &v[1], &v[2]], Cull::None, &shear, NEAR, [64.0; 2]) {
            SetupResult::Ready(triangle) => Case { triangle, shear, tile, within },
            _ => case(seed + 1_000_003, moving, lens, parallel),
        }
    }

    /// All combinations of dimensions, with `count` random cases each, in perspective and in orthographic views.
    pub fn cases(count: u64) -> impl Iterator<Item = (u64, Case)> {
        [false, true]
            .into_iter()
            .flat_map(move |parallel| (0..count).flat_map(move |seed| mixed(seed, parallel)))
    }

    fn mixed(seed: u64, parallel: bool) -> impl Iterator<Item = (u64, Case)> {
        let all = [[false, false], [true, false], [false, true], [true, true]];
        let one =
            move |first: u64| move |[moving, lens]: [bool; 2]| (seed, case(first, moving, lens, parallel));
        all.map(one(seed * 4 + 1)).into_iter().chain([[true, false], [true, true]].map(one(seed * 4)))
    }

    impl Case {
        /// A position in the box, often on its border: X, Y, u, v, t.
        pub fn position(&self, r: &mut Uniform) -> [f64; 5] {
            let lens = if self.within.lens { [self.within.u, self.within.v] } else { [[0.0; 2]; 2] };
            [self.tile.x, self.tile.y, lens[0], lens[1], self.within.t]
                .map(|range| f64::from(r.often_an_end(range)))
        }

        /// Factor of an image coordinate for a vertex at this depth.
        pub fn weight(&self, depth: f64) -> f64 {
            if self.shear.parallel { 1.0 } else { depth }
        }

        /// Vertices as seen from a position of the box: `[x', y', w]`.
        pub fn seen(&self, [x, y, u, v, t]: [f64; 5]) -> [[f64; 3]; 3] {
            let [s, a] = [self.shear.s, self.shear.a].map(|c| c.map(f64::from));
            self.triangle.corners.map(|corner| {
                let p = [0, 1, 2].map(|k| f64::from(corner.open[k]) + t * f64::from(corner.delta[k]));
                let weight = self.weight(p[2]);
                [
                    p[0] + u * (a[0] * p[2] - s[0]) - x * weight,
                    p[1] + v * (a[1] * p[2] - s[1]) - y * weight,
                    p[2],
                ]
            })
        }

        /// The three edges there.
        pub fn edges(&self, at: [f64; 5]) -> [f64; 3] {
            let p = self.seen(at);
            [(1, 2), (2, 0), (0, 1)].map(|(i, j): (usize, usize)| p[i][0] * p[j][1] - p[j][0] * p[i][1])
        }

        /// The determinant there.
        pub fn det(&self, at: [f64; 5]) -> f64 {
            let p = self.seen(at);
            (0..3).map(|k| self.edges(at)[k] * self.weight(p[k][2])).sum()
        }

        /// Depth of the triangle's plane there.
        pub fn depth(&self, at: [f64; 5]) -> f64 {
            let (p, e) = (self.seen(at), self.edges(at));
            (0..3).map(|k| e[k] * p[k][2]).sum::<f64>() / e.iter().sum::<f64>()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::number::counted::{Counted, count};
    use super::testing::{Case, Uniform, cases};
    use super::*;
    use crate::geometry::{Cull, MovingVertex, Shear};
    use crate::setup::{SetupResult, Triangle, set_up};

    #[test]
    fn the_costs_are_those_of_the_kernels() {
        let ends = [[-50.0, 20.0, 3.0], [60.0, 10.0, 5.0]].map(|end| end.map(Counted::from));
        for (s, a) in [([0.0; 2], [0.0; 2]), ([90.0, -90.0], [15.0, -15.0])] {
            let shear = Shear::new(s, a);
            let parallel = Shear { parallel: true, ..shear };
            let motion = |shear: &Shear| 3 * count(|| distance(ends, shear)).0;
            let cost = motion_madds(!shear.is_none());
            assert_eq!(motion(&shear), cost);
            assert!(motion(&parallel) < cost, "one unit serves both views");
            let blur = |shear: &Shear| 3 * 2 * count(|| radius(ends[0][2], shear)).0;
            assert_eq!(blur(&shear), BLUR_MADDS);
            assert!(blur(&parallel) < BLUR_MADDS);
        }
    }

    fn vertices(case: &Case) -> [MovingVertex; 3] {
        case.triangle.corners.map(|corner| MovingVertex {
            open: corner.open,
            close: [0, 1, 2].map(|k| corner.open[k] + corner.delta[k]),
        })
    }

    #[test]
    fn no_vertex_is_farther_than_said_and_some_is_as_far() {
        let (mut r, mut finite) = (Uniform::new(12), 0);
        for (seed, case) in cases(200) {
            let v = vertices(&case);
            let (motion, blur) = (motion_px(v.each_ref(), &case.shear), blur_px(v.each_ref(), &case.shear));
            if motion.is_infinite() {
                assert!(
                    blur.is_infinite()
                        && case.triangle.corners.iter().any(|c| c.at(0.0)[2] <= 0.0 || c.at(1.0)[2] <= 0.0)
                );
                continue;
            }
            finite += 1;
            let at_centre = |t: f64, [u, v]: [f64; 2]| {
                case.seen([0.0, 0.0, u, v, t]).map(|[x, y, w]| [x, y].map(|c| c / case.weight(w)))
            };
            let far = |a: [[f64; 2]; 3], b: [[f64; 2]; 3]| {
                (0..3).map(|i| (a[i][0] - b[i][0]).hypot(a[i][1] - b[i][1])).fold(0.0, f64::max)
            };
            for _ in 0..40 {
                let angle = f64::from(r.within(0.0, 7.0));
                let lens = if case.within.lens { [angle.cos(), angle.sin()] } else { [0.0; 2] };
                let t = f64::from(r.within(0.0, 1.0));
                let moved = far(at_centre(t, lens), at_centre(0.5, lens));
                assert!(moved <= motion * (1.0 + 1e-9) + 1e-4, "{seed}: {moved} > {motion}");
                let blurred = far(at_centre(t, lens), at_centre(t, [0.0; 2]));
                assert!(blurred <= blur * (1.0 + 1e-9) + 1e-4, "{seed}: {blurred} > {blur}");
            }
            if !case.within.lens {
                let most = [0.0, 1.0].map(|t| far(at_centre(t, [0.0; 2]), at_centre(0.5, [0.0; 2])));
                assert!((most[0].max(most[1]) - motion).abs() <= 1e-4 * (1.0 + motion), "{seed}");
                assert_eq!(blur, 0.0);
            }
        }
        assert!(finite > 300, "{finite}");
    }

    #[test]
    fn at_rest_is_the_mid_shutter_position() {
        let vertex = MovingVertex { open: [1.0, -2.0, 4.0], close: [3.0, 2.0, 2.0] };
        assert_eq!(at_rest(&vertex), MovingVertex { open: [2.0, 0.0, 3.0], close: [2.0, 0.0, 3.0] });
    }

    const SHEAR: Shear = Shear::new([90.0, -90.0], [15.0, -15.0]);

    fn triangle(moving: bool, shear: &Shear) -> Triangle {
        let v = [
            ([-50.0, 20.0, 3.0], [60.0, 10.0, 5.0]),
            ([30.0, -70.0, 4.0], [-20.0, 40.0, 2.5]),
            ([80.0, 90.0, 6.0], [70.0, 30.0, 7.0]),
        ]
        .map(|(open, close)| MovingVertex { open, close: if moving { close } else { open } });
        match set_up(0, [&v[0], &v[1], &v[2]], Cull::None, shear, 0.1, [64.0; 2]) {
            SetupResult::Ready(triangle) => triangle,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn every_cost_is_that_of_its_kernel() {
        for (moving, lens) in [(false, false), (true, false), (false, true), (true, true)] {
            let shear = if lens { SHEAR } else { Shear::default() };
            let triangle = triangle(moving, &shear);
            let tile = TileRect { x: [0.0, 8.0], y: [16.0, 24.0] };
            let within = Box5 { t: [0.25, 0.75], ..Box5::whole(lens) };
            let (madds, edges) =
                count(|| Edges::<Counted>::new(TileView::new(&triangle, &shear, &tile, &within)));
            println!("edges {moving} {lens} {madds}");
            assert_eq!(madds, edge_madds(moving, lens), "edges {moving} {lens}");
            let (madds, facing) = count(|| Facing::new(&edges));
            println!("facing {moving} {lens} {madds}");
            assert_eq!(madds, facing_madds(moving, lens, 0), "facing {moving} {lens}");
            let (madds, (_, bisections)) = count(|| facing.timeline(within.t, [true; 2], 3));
            println!("bisect {moving} {lens} {madds} {bisections}");
            assert_eq!(madds, facing_madds(moving, lens, bisections) - facing_madds(moving, lens, 0));
            let (madds, bounds) = count(|| EdgeBounds::new(&edges));
            println!("bounds {moving} {lens} {madds}");
            assert_eq!(madds, edge_bound_madds(moving, lens), "bounds {moving} {lens}");
            let times = TimePieces::one(Piece { t: within.t, faces: [true; 2] });
            let (madds, (_, more)) = count(|| bounds.timeline(&edges, &times, [true; 2]));
            println!("narrow {moving} {lens} {madds} {more}");
            assert!(madds <= more, "{madds} > {more}");
            let (madds, _) = count(|| Screen::new(&edges, within.t, [true; 2]));
            println!("screen {moving} {lens} {madds}");
            assert_eq!(madds, screen_setup_madds(moving, lens, true), "screen {moving} {lens}");
            let (madds, _) = count(|| Screen::new(&edges, [0.25, 0.5], [true; 2]));
            println!("screen part {moving} {lens} {madds}");
            assert_eq!(madds, screen_setup_madds(moving, lens, !moving), "part {moving} {lens}");
        }
    }

    /// One unit serves both views, so both have the same cost. An orthographic view needs less, or at most a
    /// tenth more.
    #[test]
    fn orthographic_views_cost_about_as_much() {
        for (moving, lens) in [(false, false), (true, false), (false, true), (true, true)] {
            let shear = Shear { parallel: true, ..if lens { SHEAR } else { Shear::default() } };
            let triangle = triangle(moving, &shear);
            let tile = TileRect { x: [0.0, 8.0], y: [16.0, 24.0] };
            let within = Box5 { t: [0.25, 0.75], ..Box5::whole(lens) };
            let (found, edges) =
                count(|| Edges::<Counted>::new(TileView::new(&triangle, &shear, &tile, &within)));
            let (facing, _) = count(|| Facing::new(&edges));
            let (bounds, _) = count(|| EdgeBounds::new(&edges));
            let (screen, _) = count(|| Screen::new(&edges, within.t, [true; 2]));
            let (sides, (_, madds_found)) =
                count(|| narrow_counted::<Counted>(&triangle, &shear, &tile, &within));
            println!("{moving} {lens}: {found} {facing} {bounds} {screen} {sides}");
            assert!(10 * found <= 11 * edge_madds(moving, lens) + 1, "{found}");
            assert!(10 * facing <= 11 * facing_madds(moving, lens, 0), "{facing}");
            assert!(bounds <= edge_bound_madds(moving, lens) && sides <= madds_found);
            assert!(screen <= screen_setup_madds(moving, lens, true));
        }
        for moving in [false, true] {
            let shear = Shear { parallel: true, ..SHEAR };
            let triangle = triangle(moving, &shear);
            let (madds, _) = count(|| LensLines::<Counted>::new(&triangle, &shear, 0.1));
            assert!(madds <= lens_line_setup_madds(moving));
        }
    }

    #[test]
    fn the_cost_of_side_planes_is_that_of_their_kernel() {
        for (moving, lens) in [(false, false), (true, false), (false, true), (true, true)] {
            let shear = if lens { SHEAR } else { Shear::default() };
            for behind in [false, true] {
                let triangle = Triangle { behind, ..triangle(moving, &shear) };
                for x in [-60.0, -20.0, 0.0, 40.0, 70.0, 300.0] {
                    let tile = TileRect { x: [x, x + 8.0], y: [16.0, 24.0] };
                    let within = Box5 { t: [0.25, 0.75], ..Box5::whole(lens) };
                    let (madds, (_, madds_found)) =
                        count(|| narrow_counted::<Counted>(&triangle, &shear, &tile, &within));
                    assert_eq!(madds, madds_found, "{moving} {lens} {behind} {x}");
                }
            }
        }
    }

    #[test]
    fn the_cost_of_the_near_depth_is_that_of_its_kernel() {
        for (moving, near) in
            [false, true].into_iter().flat_map(|moving| [0.1, 3.5, 5.0, 9.0].map(|near| (moving, near)))
        {
            let triangle = triangle(moving, &SHEAR);
            let mut within = Box5 { t: [0.25, 0.75], ..Box5::whole(true) };
            let (madds, (_, found)) = count(|| narrow_near::<Counted, _>(&triangle, near, 0.01, &mut within));
            assert_eq!(madds, found, "{moving} {near}");
        }
    }

    #[test]
    fn the_cost_of_lens_lines_is_that_of_their_kernel() {
        for moving in [false, true] {
            let triangle = triangle(moving, &SHEAR);
            let (madds, lines) = count(|| LensLines::<Counted>::new(&triangle, &SHEAR, 0.1));
            println!("lines {moving} {madds}");
            assert_eq!(madds, lens_line_setup_madds(moving), "set-up {moving}");
            for x in [-60.0, -20.0, 0.0, 40.0, 70.0] {
                let tile = TileRect { x: [x, x + 8.0], y: [16.0, 24.0] };
                let (madds, (left, crossings)) = count(|| lines.narrow(&tile, &Box5::whole(true)));
                let most = lens_line_madds(crossings);
                println!("line tile {moving} {madds} {most}");
                assert!(madds <= most && (left.is_none() || madds == most), "{moving} {x}: {madds} {most}");
            }
        }
    }
}
