//! Moving triangles in `f64`, and their vertices relative to a tile.

use super::{Rect, Region, View};
use crate::depth::{Numbers, Real};

/// A triangle whose vertices `[x, y, depth]` move linearly from `open` to `close`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingTriangle {
    open: [[f64; 3]; 3],
    close: [[f64; 3]; 3],
    uncertainty: [f64; 3],
}

/// Larger coordinates may overflow in the tests.
const MAX_COORDINATE: f64 = 1e60;

impl MovingTriangle {
    /// An exact triangle, or `None` if a coordinate is not finite or beyond 1e60.
    pub fn new(open: [[f64; 3]; 3], close: [[f64; 3]; 3]) -> Option<Self> {
        Self::uncertain(open, close, [0.0; 3])
    }

    /// A triangle whose vertices have an error of at most `uncertainty` on each axis, at both ends. `None` as
    /// for [`Self::new`].
    pub fn uncertain(open: [[f64; 3]; 3], close: [[f64; 3]; 3], uncertainty: [f64; 3]) -> Option<Self> {
        let mut all = open.iter().chain(&close).chain([&uncertainty]).flatten();
        all.all(|c| c.abs() <= MAX_COORDINATE).then_some(Self { open, close, uncertainty })
    }

    /// Vertices when the shutter opens.
    pub fn open(&self) -> &[[f64; 3]; 3] {
        &self.open
    }
}

/// Smallest uncertainty of a coordinate. Products of three such errors do not underflow, so values that
/// underflow stay within the noise.
pub const MIN_UNCERTAINTY: f64 = 1e-90;

/// A triangle prepared for the tests of tiles.
#[derive(Clone, Copy, Debug)]
pub struct Prepared {
    pub(super) triangle: MovingTriangle,
    /// Closing minus opening position.
    delta: [[f64; 3]; 3],
    pub(super) moving: bool,
    /// Largest magnitude on each axis.
    pub(super) size: [f64; 3],
    /// Largest magnitude of a weight.
    pub(super) weight: f64,
    /// Error bound of a weight.
    pub(super) weight_off: f64,
}

impl Prepared {
    pub(super) fn new<N: Numbers>(numbers: N, triangle: &MovingTriangle, view: &View) -> Self {
        let all = || triangle.open.iter().chain(&triangle.close);
        let size = [0, 1, 2].map(|axis| all().map(|p| p[axis].abs()).fold(0.0, f64::max));
        let perspective = view.is_perspective();
        let uncertainty = triangle.uncertainty.map(|off| off.max(MIN_UNCERTAINTY));
        let moving = numbers.branch(triangle.open != triangle.close);
        let difference = |k: usize, axis: usize| {
            let [open, close] = [triangle.open, triangle.close].map(|end| numbers.number(end[k][axis]));
            (close - open).value()
        };
        let delta = if moving {
            [0, 1, 2].map(|k| [0, 1, 2].map(|axis| difference(k, axis)))
        } else {
            Default::default()
        };
        Self {
            triangle: MovingTriangle { uncertainty, ..*triangle },
            delta,
            moving,
            size,
            weight: if perspective { size[2] } else { 1.0 },
            weight_off: if perspective { uncertainty[2] } else { 0.0 },
        }
    }

    pub(super) fn uncertainty(&self) -> &[f64; 3] {
        &self.triangle.uncertainty
    }

    /// Coordinates of the vertices along `axes` at time `t`; at the ends of the shutter exactly as given.
    pub(super) fn at<N: Numbers, const AXES: usize>(
        &self,
        numbers: N,
        axes: [usize; AXES],
        t: f64,
    ) -> [[N::Number; AXES]; 3] {
        let of = |end: &[[f64; 3]; 3]| end.map(|p| axes.map(|axis| numbers.number(p[axis])));
        let open = of(&self.triangle.open);
        if numbers.branch(t == 0.0 || !self.moving) {
            return open;
        }
        if numbers.branch(t == 1.0) {
            return of(&self.triangle.close);
        }
        let (t, delta) = (numbers.number(t), of(&self.delta));
        [0, 1, 2].map(|k| std::array::from_fn(|axis| open[k][axis] + t * delta[k][axis]))
    }
}

/// Rounding error of a few operations, relative to the sum of magnitudes: sixteen of 2^-53 each, and twice
/// that.
pub(super) const ROUNDING: f64 = 1.0 / (1_u64 << 48) as f64;

/// Vertices at both ends of a time interval, relative to the middle of a tile, so that large coordinates lose
/// little precision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen<R> {
    pub view: View,
    /// `[x - X w, y - Y w, depth]` by end and vertex; `(X, Y)` is the middle of the tile.
    pub points: [[[R; 3]; 3]; 2],
    middle: [R; 2],
    /// Distances of the tile's sides from its middle.
    pub tile: [[R; 2]; 2],
    /// Error bound in x and y of a vertex seen from a point of the tile and a lens position.
    pub noise: [R; 2],
    /// Error bound of a depth.
    pub depth_noise: R,
    /// Largest magnitudes of the terms of `points`, uncertainty included.
    pub size: [R; 3],
}

impl Seen<f64> {
    /// The same in the numbers of a kernel.
    pub fn on<N: Numbers>(&self, numbers: N) -> Seen<N::Number> {
        let number = |value: f64| numbers.number(value);
        Seen {
            view: self.view,
            points: self.points.map(|end| end.map(|p| p.map(number))),
            middle: self.middle.map(number),
            tile: self.tile.map(|side| side.map(number)),
            noise: self.noise.map(number),
            depth_noise: number(self.depth_noise),
            size: self.size.map(number),
        }
    }
}

impl<R: Real> Seen<R> {
    pub fn new<N: Numbers<Number = R>>(
        numbers: N,
        view: &View,
        prepared: &Prepared,
        rect: &Rect,
        region: &Region,
    ) -> Self {
        let number = |value: f64| numbers.number(value);
        let rounding = R::new(ROUNDING);
        let sides = [rect.x, rect.y].map(|side| side.map(number));
        let middle = sides.map(|[lo, hi]| R::new(0.5) * (lo + hi));
        let largest = prepared.size.map(number);
        let (weight, unsure) = (number(prepared.weight), prepared.uncertainty().map(number));
        let off = number(prepared.weight_off);
        let is_perspective = numbers.branch(view.is_perspective());
        let has_lens = numbers.branch(view.has_lens());
        let noise = [0, 1].map(|axis| {
            let side = sides[axis][0].magnitude().larger(sides[axis][1].magnitude());
            let lens = has_lens.then(|| {
                let (s, a) = view.shear();
                [s, a].map(|of| number(of[axis]).magnitude())
            });
            let sum = lens.map_or(largest[axis], |[s, a]| largest[axis] + s + a * largest[2]);
            let noise = rounding * (sum + side * weight) + unsure[axis];
            let noise = lens.map_or(noise, |[_, a]| noise + a * unsure[2]);
            if is_perspective { noise + side * off } else { noise }
        });
        let size = [0, 1, 2].map(|axis| {
            let (mut size, mut unsure) = (largest[axis], unsure[axis]);
            if axis < 2 {
                size = size + middle[axis].magnitude() * weight;
            }
            if axis < 2 && is_perspective {
                unsure = unsure + middle[axis].magnitude() * off;
            }
            // A plane uses `ROUNDING` times this as noise.
            size + unsure / rounding
        });
        Self {
            view: *view,
            points: points(numbers, view, prepared, middle, region),
            middle,
            tile: [0, 1].map(|axis| sides[axis].map(|side| side - middle[axis])),
            noise,
            depth_noise: rounding * largest[2] + unsure[2],
            size,
        }
    }

    /// [`Self::points`] within another region.
    pub fn points_within<N: Numbers<Number = R>>(
        &self,
        numbers: N,
        prepared: &Prepared,
        region: &Region,
    ) -> [[[R; 3]; 3]; 2] {
        points(numbers, &self.view, prepared, self.middle, region)
    }

    /// Weight of a point on the homogeneous image plane.
    fn weight(&self, depth: R) -> R {
        weight(&self.view, depth)
    }

    /// Vertex `k` at `end` of the time along `axis`, seen through a pinhole from `side`, relative to the
    /// middle of the tile.
    pub fn through_pinhole(&self, axis: usize, k: usize, end: usize, side: R) -> R {
        let p = &self.points[end][k];
        p[axis] - side * self.weight(p[2])
    }

    /// The same vertex seen from `lens` on the lens.
    pub fn from<N: Numbers<Number = R>>(
        &self,
        numbers: N,
        axis: usize,
        [k, end]: [usize; 2],
        [lens, side]: [R; 2],
    ) -> R {
        let depth = self.points[end][k][2];
        self.through_pinhole(axis, k, end, side) + lens * self.shift(numbers, axis, depth)
    }

    /// Shift of a point at this depth from the middle of the lens to its rim.
    fn shift<N: Numbers<Number = R>>(&self, numbers: N, axis: usize, depth: R) -> R {
        let (s, a) = self.view.shear();
        numbers.number(a[axis]) * depth - numbers.number(s[axis])
    }

    /// Vertices at both ends as homogeneous points of the image, seen through a pinhole from the middle of
    /// the tile.
    pub fn homogeneous(&self) -> [[[R; 3]; 3]; 2] {
        self.points.map(|end| end.map(|[x, y, depth]| [x, y, self.weight(depth)]))
    }

    /// The same vertices seen from `lens` on the lens.
    pub fn homogeneous_from<N: Numbers<Number = R>>(&self, numbers: N, lens: [R; 2]) -> [[[R; 3]; 3]; 2] {
        self.points.map(|end| {
            end.map(|[x, y, depth]| {
                let at = |axis: usize, x: R| x + lens[axis] * self.shift(numbers, axis, depth);
                [at(0, x), at(1, y), self.weight(depth)]
            })
        })
    }
}

fn weight<R: Real>(view: &View, depth: R) -> R {
    if view.is_perspective() { depth } else { R::new(1.0) }
}

/// Vertices at both ends of a region's time, seen from `middle`.
fn points<N: Numbers>(
    numbers: N,
    view: &View,
    prepared: &Prepared,
    middle: [N::Number; 2],
    region: &Region,
) -> [[[N::Number; 3]; 3]; 2] {
    region.t.map(|t| {
        prepared.at(numbers, [0, 1, 2], t).map(|[x, y, depth]| {
            let w = weight(view, depth);
            [x - middle[0] * w, y - middle[1] * w, depth]
        })
    })
}
