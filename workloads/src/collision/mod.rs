//! Continuous collision detection with a conservative rasterizer in screen and time (thesis, Paper VI,
//! section 3.2).
//!
//! Two objects collide if, at some time in [0, 1], a triangle of each shares a point. Every vertex moves on a
//! straight line, touching counts, and only surfaces count. The result is a *potentially colliding set*: it
//! contains every pair that collides, and may contain pairs that do not.
//!
//! Objects are drawn orthographically along each of the three axes. A contact lies, at its time, in a tile
//! that both objects touch, within the intervals of time and depth of both. If the intervals overlap in no
//! tile, the objects are apart, for any size of tiles and time bins. Otherwise the remaining space and time
//! bound every contact, and can be searched again with smaller tiles.
//!
//! - [`Object`]: moving triangles of a mesh; [`components`] splits a mesh.
//! - [`Bounds`]: boxes of space and time, swept and exact; boxes of time and depth per tile.
//! - [`candidates`]: the broad phase, pairs whose swept boxes touch.
//! - [`PairSearch`], [`CollisionMethod`]: parameters of a search; [`PairVerdict`]: its result.
//! - [`detect`]: all pairs of a case.
//! - [`Sweeps`]: the method of the paper for many objects, in two sweeps over all of them.
//! - [`PlainPasses`]: the passes of the paper for two objects, without narrowing on the CPU.
//! - [`families`]: test cases with known ground truth.
//! - [`job`]: the passes as a workload of the modelled hardware.

mod contact_probe;
mod detect;
pub mod families;
mod job;
mod object;
mod on_gpu;
mod pair;
mod pass;
mod plain;

pub use detect::{PairAnswer, candidates, detect, detect_each};
pub use job::{CollisionOptions, job};
pub(crate) use job::{FACTS, FLAGS};
pub use object::{CaseFiles, CollisionCase, Object, components, load_cases};
pub use pair::{CollisionMethod, PairSearch, PairVerdict};
pub use plain::{CollidingSet, Overlaps, PassWork, PlainPasses, Sweeps};

/// Corners of a triangle at time 0 and at time 1.
type Ends = [[[f64; 3]; 3]; 2];

/// A closed box of space and a range of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least and greatest x, y and z.
    pub space: [[f64; 2]; 3],
    /// First and last time.
    pub time: [f64; 2],
}

/// Intersection of two closed ranges; touching counts.
#[inline]
fn meet(a: [f64; 2], b: [f64; 2]) -> Option<[f64; 2]> {
    let both = [a[0].max(b[0]), a[1].min(b[1])];
    (both[0] <= both[1]).then_some(both)
}

/// Smallest range that contains both.
#[inline]
fn hull(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// The empty range.
const NOTHING: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

impl Bounds {
    /// The empty box.
    const NOTHING: Self = Self { space: [NOTHING; 3], time: NOTHING };

    /// Smallest box that contains both.
    #[must_use]
    fn hull(&self, other: &Self) -> Self {
        let space = [0, 1, 2].map(|axis| hull(self.space[axis], other.space[axis]));
        Self { space, time: hull(self.time, other.time) }
    }

    /// Bounding box of points, for times 0 to 1.
    pub fn of(points: impl IntoIterator<Item = [f64; 3]>) -> Self {
        let mut space = [NOTHING; 3];
        for point in points {
            for (range, at) in space.iter_mut().zip(point) {
                *range = [range[0].min(at), range[1].max(at)];
            }
        }
        Self { space, time: [0.0, 1.0] }
    }

    /// Intersection of both boxes, if any.
    #[inline]
    pub fn meet(&self, other: &Self) -> Option<Self> {
        let shared = |axis: usize| meet(self.space[axis], other.space[axis]);
        Some(Self { space: [shared(0)?, shared(1)?, shared(2)?], time: meet(self.time, other.time)? })
    }

    /// The box with every side moved `margin` outwards in space.
    #[must_use]
    pub fn inflated(&self, margin: f64) -> Self {
        Self { space: self.space.map(|[low, high]| [low - margin, high + margin]), ..*self }
    }

    /// Bound of the rounding error of a few operations on coordinates in the box.
    fn rounding(&self) -> f64 {
        8.0 * f64::EPSILON * self.space.as_flattened().iter().fold(0.0, |size: f64, at| size.max(at.abs()))
    }

    /// Volume as a share of `whole`: the product of the shares of all extents. An extent of zero counts as 1.
    pub fn share_of(&self, whole: &Self) -> f64 {
        let ranges = self.space.iter().chain([&self.time]).zip(whole.space.iter().chain([&whole.time]));
        let share = |(part, all): (&[f64; 2], &[f64; 2])| {
            let length = all[1] - all[0];
            if length > 0.0 { ((part[1] - part[0]) / length).clamp(0.0, 1.0) } else { 1.0 }
        };
        ranges.map(share).product()
    }
}

/// Times are quotients of differences. Their error is a few ulps of numbers up to one.
const TIME_ERROR: f64 = 1e-14;

/// Times in `within` at which a triangle may touch it, or `None`. Each of the six sides is tested alone: the
/// triangle is outside while all its corners are. `swept` is the triangle's swept box.
fn times_inside(ends: &Ends, swept: &Bounds, within: &Bounds, uncertainty: f64) -> Option<[f64; 2]> {
    let mut times = within.time;
    for axis in 0..3 {
        let [low, high] = within.space[axis];
        let [swept_low, swept_high] = swept.space[axis];
        let corners = || [0, 1, 2].map(|corner| [ends[0][corner][axis], ends[1][corner][axis]]);
        // A triangle that stays inside a plane needs no test against it.
        if swept_low < low {
            times = meet(times, inside(corners().map(|ends| ends.map(|at| at - (low - uncertainty)))))?;
        }
        if swept_high > high {
            times = meet(times, inside(corners().map(|ends| ends.map(|at| (high + uncertainty) - at))))?;
        }
    }
    Some(times)
}

/// Hull of the times at which any corner is inside a plane, from their distances to it at both ends.
fn inside(corners: [[f64; 2]; 3]) -> [f64; 2] {
    corners.into_iter().map(nonnegative_times).fold(NOTHING, hull)
}

/// Times at which a linear function from `from` to `to` is not negative.
fn nonnegative_times([from, to]: [f64; 2]) -> [f64; 2] {
    let root = || from / (from - to);
    match (from >= 0.0, to >= 0.0) {
        (true, true) => [0.0, 1.0],
        (true, false) => [0.0, root() + TIME_ERROR],
        (false, true) => [root() - TIME_ERROR, 1.0],
        (false, false) => NOTHING,
    }
}

/// Times and depths at which an object may be in a tile, in one time bin.
#[derive(Clone, Copy, Debug)]
struct TzBox {
    pub t: [f64; 2],
    pub z: [f64; 2],
    /// One of the triangles in the tile.
    pub triangle: u32,
}

impl TzBox {
    const EMPTY: Self = Self { t: NOTHING, z: NOTHING, triangle: 0 };

    /// Intersection with the times `t` and depths `z`.
    pub fn meet(&self, t: [f64; 2], z: [f64; 2]) -> Option<[[f64; 2]; 2]> {
        Some([meet(self.t, t)?, meet(self.z, z)?])
    }
}

/// Boxes by tile index. Clearing costs as much as filling, since most tiles stay empty.
#[derive(Default)]
struct TzBuffer {
    boxes: Vec<TzBox>,
    used: Vec<u32>,
}

impl TzBuffer {
    /// Empties the buffer and makes room for `tiles`.
    pub fn clear(&mut self, tiles: usize) {
        for tile in self.used.drain(..) {
            self.boxes[tile as usize] = TzBox::EMPTY;
        }
        if self.boxes.len() < tiles {
            self.boxes.resize(tiles, TzBox::EMPTY);
        }
    }

    /// Grows the box of a tile by another (union, by blending with min and max).
    pub fn add(&mut self, tile: u32, added: &TzBox) {
        let known = &mut self.boxes[tile as usize];
        if known.t[0] > known.t[1] {
            self.used.push(tile);
        }
        *known = TzBox { t: hull(known.t, added.t), z: hull(known.z, added.z), triangle: added.triangle };
    }

    /// The box of a tile; empty if nothing was added.
    pub fn at(&self, tile: u32) -> &TzBox {
        &self.boxes[tile as usize]
    }

    /// All boxes that are not empty, in the order of the first addition.
    pub fn used(&self) -> impl Iterator<Item = (u32, &TzBox)> {
        self.used.iter().map(|&tile| (tile, self.at(tile)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn boxes_that_touch_share_their_border() {
        let a = Bounds::of([[0.0; 3], [1.0; 3]]);
        let b = Bounds::of([[1.0, 0.5, -1.0], [2.0, 2.0, 0.0]]);
        let both = a.meet(&b).map(|both| both.space);
        assert_eq!(both, Some([[1.0, 1.0], [0.5, 1.0], [0.0, 0.0]]));
        assert_eq!(a.meet(&Bounds::of([[1.0 + 1e-15, 0.0, 0.0]])), None);
    }

    #[test]
    fn a_share_ignores_extents_of_zero() {
        let whole = Bounds { space: [[0.0, 4.0], [0.0, 2.0], [3.0, 3.0]], time: [0.0, 1.0] };
        let part = Bounds { space: [[1.0, 2.0], [0.0, 1.0], [3.0, 3.0]], time: [0.5, 1.0] };
        assert_eq!(part.share_of(&whole), 0.25 * 0.5 * 0.5);
    }

    fn times(ends: &Ends, within: &Bounds) -> Option<[f64; 2]> {
        times_inside(ends, &Bounds::of(ends.as_flattened().iter().copied()), within, 0.0)
    }

    #[test]
    fn a_passing_point_is_inside_between_the_planes() {
        let ends = [[[-1.0, 0.5, 0.5]; 3], [[3.0, 0.5, 0.5]; 3]];
        let within = Bounds { space: [[0.0, 1.0]; 3], time: [0.0, 1.0] };
        let [first, last] = times(&ends, &within).unwrap();
        assert!((first - 0.25).abs() < 1e-12 && (last - 0.5).abs() < 1e-12, "{first} {last}");
        assert!(first <= 0.25 && last >= 0.5);
        assert!(times(&ends, &Bounds { time: [0.6, 1.0], ..within }).is_none());
        assert!(times(&ends, &Bounds { space: [[0.0, 1.0], [0.0, 0.25], [0.0, 1.0]], ..within }).is_none());
    }

    #[test]
    fn boxes_grow_and_are_empty_after_a_clear() {
        let mut buffer = TzBuffer::default();
        buffer.clear(4);
        buffer.add(2, &TzBox { t: [0.25, 0.5], z: [1.0, 2.0], triangle: 7 });
        buffer.add(2, &TzBox { t: [0.5, 0.75], z: [0.0, 1.0], triangle: 8 });
        let found: Vec<_> = buffer.used().map(|(tile, found)| (tile, found.t, found.z)).collect();
        assert_eq!(found, [(2, [0.25, 0.75], [0.0, 2.0])]);
        assert_eq!(buffer.at(2).meet([0.75, 1.0], [-1.0, 0.0]), Some([[0.75, 0.75], [0.0, 0.0]]));
        assert!(
            buffer.at(2).meet([0.0, 0.2], [-1.0, 3.0]).is_none()
                && buffer.at(1).meet([0.0, 1.0], [0.0, 1.0]).is_none()
        );
        buffer.clear(4);
        assert_eq!(buffer.used().count(), 0);
        assert!(buffer.at(2).meet([0.0, 1.0], [0.0, 1.0]).is_none());
    }

    proptest! {
        #[test]
        fn every_time_at_which_a_point_is_inside_is_included(
            numbers in prop::array::uniform32(-4.0..4.0_f64),
            weights in prop::array::uniform2(0.0..1.0_f64),
            t in 0.0..1.0_f64,
        ) {
            let corner = |n: usize| [numbers[3 * n], numbers[3 * n + 1], numbers[3 * n + 2]];
            let ends: Ends = [[corner(0), corner(1), corner(2)], [corner(3), corner(4), corner(5)]];
            let bounds = Bounds::of([corner(6), corner(7)]);
            let [a, b] = [weights[0].sqrt(), weights[1]];
            let share = [1.0 - a, a * (1.0 - b), a * b];
            let at = |axis: usize| -> f64 {
                (0..3).map(|k| share[k] * (ends[0][k][axis] + t * (ends[1][k][axis] - ends[0][k][axis]))).sum()
            };
            if (0..3).all(|axis| (bounds.space[axis][0]..=bounds.space[axis][1]).contains(&at(axis))) {
                let times = times(&ends, &bounds);
                prop_assert!(times.is_some_and(|[first, last]| first <= t && t <= last), "{times:?} {t}");
            }
        }
    }
}
