//! Times at which a point of the image is inside a moving triangle, seen through a pinhole or in an
//! orthographic view (after Gribel, Doggett and Akenine-Moeller 2010, "Analytical motion blur rasterization
//! with compression").
//!
//! At a fixed point each edge, `e = (p_i x p_j) . (X, Y, 1)` in perspective, is a quadratic in time. The
//! point is inside if all three edges are non-negative (it sees the clockwise face) or all are non-positive
//! (the other face). Both sets are intersections of intervals between roots.
//!
//! A homogeneous triangle also covers its mirror image behind the camera. If vertices have depths of both
//! signs, the caller has to check the depth at the times found.

use super::number::{Number, Pieces, Quadratic};
use crate::geometry::Shear;
use crate::setup::Triangle;
use crate::tally::{Branches, Costs, Counting, Kernel};

/// Closed intervals of time in order, within [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeIntervals {
    intervals: [[f64; 2]; Self::MAX],
    len: usize,
}

impl TimeIntervals {
    /// Largest number of intervals for one face: each of three quadratics cuts out one gap.
    pub const MAX: usize = 4;

    const WHOLE: Self = Self { intervals: [[0.0, 1.0]; Self::MAX], len: 1 };

    /// The intervals.
    pub fn as_slice(&self) -> &[[f64; 2]] {
        &self.intervals[..self.len]
    }

    fn intersect<N: Number>(&self, pieces: Pieces<N>, path: impl Branches) -> Self {
        let mut both = Self { len: 0, ..*self };
        let (error, none) = (N::constant(ROOT_ERROR), [N::zero(); 2]);
        let (count, parts) = match pieces {
            Pieces::None => (0, [none; 2]),
            Pieces::One(piece) => (1, [piece; 2]),
            Pieces::Two(first, last) if path.branch(last[0] - first[1] <= error + error) => {
                (1, [[first[0], last[1]]; 2])
            }
            Pieces::Two(first, last) => (2, [first, last]),
        };
        let widened = |[lo, hi]: [N; 2]| [(lo - error).into(), (hi + error).into()];
        let parts: [[f64; 2]; 2] = parts.map(widened);
        for mine in self.as_slice() {
            for part in &parts[..count] {
                let [lo, hi] = [mine[0].max(part[0]), mine[1].min(part[1])];
                if lo <= hi && both.len < Self::MAX {
                    both.intervals[both.len] = [lo, hi];
                    both.len += 1;
                }
            }
        }
        both
    }
}

/// Bound of the rounding error of a root, for a quadratic raised by [`RAISE_OF_LARGEST_COEFFICIENT`].
const ROOT_ERROR: f64 = 4.0 * f64::EPSILON;

/// Amount by which a quadratic is raised, relative to its largest coefficient. It is far above the rounding
/// errors of the coefficients, the discriminant and the roots.
const RAISE_OF_LARGEST_COEFFICIENT: f64 = 64.0 * f64::EPSILON;

/// Times at which the point `(x, y)`, in pixels from the centre of the image, is inside `triangle` and sees
/// its clockwise face, and those at which it sees the other face. `shear` only says whether the view is
/// orthographic. The intervals are widened by the rounding of `f64`.
pub fn time_interval(triangle: &Triangle, shear: &Shear, x: f64, y: f64) -> [TimeIntervals; 2] {
    times(f64::from, [x, y], triangle, shear, ())
}

/// The same with its multiply-adds, counted with `costs`.
pub fn time_interval_counted(
    triangle: &Triangle,
    shear: &Shear,
    at: [f64; 2],
    costs: &Costs,
) -> ([TimeIntervals; 2], u32) {
    costs.run(
        Kernel::Times,
        |path| times(f64::from, at, triangle, shear, path),
        |tally| {
            let number = |value: f64| Counting::new(value, tally);
            times(|value| number(f64::from(value)), at.map(number), triangle, shear, tally);
        },
    )
}

fn times<N: Number>(
    number: impl Fn(f32) -> N,
    at: [N; 2],
    triangle: &Triangle,
    shear: &Shear,
    path: impl Branches,
) -> [TimeIntervals; 2] {
    path.branch(shear.parallel);
    let (one, half) = (N::from(1.0), N::from(0.5));
    let ends = [false, true].map(|closes| {
        triangle.corners.map(|corner| {
            let [x, y, w] = [0, 1, 2].map(|k| {
                let open = number(corner.open[k]);
                if closes { open + number(corner.delta[k]) } else { open }
            });
            let weight = if shear.parallel { one } else { w };
            [x - at[0] * weight, y - at[1] * weight]
        })
    });
    let edge = |i: usize, j: usize| {
        let cross = |s: usize, e: usize| ends[s][i][0] * ends[e][j][1] - ends[s][i][1] * ends[e][j][0];
        Quadratic([cross(0, 0), half * (cross(0, 1) + cross(1, 0)), cross(1, 1)])
    };
    let edges = [edge(1, 2), edge(2, 0), edge(0, 1)];
    // Magnitude of the terms that cancel in an edge.
    let size = [0, 1].map(|axis| ends.iter().flatten().map(|p| p[axis].abs()).fold(N::zero(), N::max));
    let raised = N::constant(RAISE_OF_LARGEST_COEFFICIENT);
    let largest = [0, 1].map(|axis| largest(&number, at[axis], axis, triangle, shear));
    // The second term is the error of an edge by the rounding of positions.
    let error = raised * (size[0] * size[1]) + raised * (largest[0] * size[1] + largest[1] * size[0]);
    [false, true].map(|flips| {
        inside(edges.map(|edge| Quadratic(edge.0.map(|b| if flips { error - b } else { b + error }))), path)
    })
}

/// Largest magnitude along `axis` of the terms of a vertex seen from a point of the image.
fn largest<N: Number>(
    number: &impl Fn(f32) -> N,
    at: N,
    axis: usize,
    triangle: &Triangle,
    shear: &Shear,
) -> N {
    let reach = |k: usize| triangle.corners.map(|c| number(c.open[k].abs() + c.delta[k].abs()));
    let [places, depths] = [reach(axis), reach(2)];
    let weight = |k: usize| if shear.parallel { N::from(1.0) } else { depths[k] };
    (0..3).map(|k| places[k] + at.abs() * weight(k)).fold(N::zero(), N::max)
}

fn inside<N: Number>(edges: [Quadratic<N>; 3], path: impl Branches) -> TimeIntervals {
    edges.iter().fold(TimeIntervals::WHOLE, |left, edge| left.intersect(edge.pieces(path), path))
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Uniform, cases};
    use super::*;
    use crate::setup::Corner;

    /// The three edges at a point and the time `k / 64`, exactly, for vertices with small integer
    /// coordinates.
    fn exact(corners: &[Corner; 3], at: [i128; 2], k: i128) -> [i128; 3] {
        let seen = corners.map(|corner| {
            let p = [0, 1, 2].map(|axis| corner.open[axis] as i128 * 64 + k * corner.delta[axis] as i128);
            [p[0] - at[0] * p[2], p[1] - at[1] * p[2]]
        });
        [(1, 2), (2, 0), (0, 1)]
            .map(|(i, j): (usize, usize)| seen[i][0] * seen[j][1] - seen[j][0] * seen[i][1])
    }

    fn contains(set: &TimeIntervals, t: f64) -> bool {
        set.as_slice().iter().any(|[lo, hi]| (lo..=hi).contains(&&t))
    }

    fn whole_number_triangle(r: &mut Uniform) -> Triangle {
        let (_, case) = cases(1).nth(1).unwrap();
        let mut number = |lo: f32, hi: f32| r.within(lo, hi).round();
        let corners = [0; 3].map(|_| {
            let open = [number(-9.0, 9.0), number(-9.0, 9.0), number(1.0, 4.0)];
            Corner { open, delta: [number(-9.0, 9.0), number(-9.0, 9.0), number(-5.0, 3.0)] }
        });
        Triangle { corners, moving: true, ..case.triangle }
    }

    #[test]
    fn every_time_is_in_or_out_as_whole_numbers_say() {
        let (mut r, mut found, mut several) = (Uniform::new(9), [0; 2], 0);
        for _ in 0..20_000 {
            let triangle = whole_number_triangle(&mut r);
            let at = [0; 2].map(|_| r.within(-4.0, 4.0).round());
            let sets = time_interval(&triangle, &Shear::default(), f64::from(at[0]), f64::from(at[1]));
            several += usize::from(sets.iter().any(|set| set.as_slice().len() > 1));
            for k in 0..=64 {
                let e = exact(&triangle.corners, at.map(|c| c as i128), k);
                let t = k as f64 / 64.0;
                let inside = [e.iter().all(|&e| e >= 0), e.iter().all(|&e| e <= 0)];
                for face in [0, 1] {
                    found[face] += u32::from(inside[face]);
                    // Away from the roots both agree; on a root, and only there, they may differ by rounding.
                    let on_a_root = e.contains(&0);
                    let says = contains(&sets[face], t);
                    assert!(says == inside[face] || (on_a_root && says), "{face} {t} {e:?} {sets:?}");
                }
            }
        }
        assert!(found[0] > 10_000 && found[1] > 10_000 && several > 20, "{found:?} {several}");
    }

    /// A path seen before has the multiply-adds of a run that is counted; times on a coarse grid reach all branches.
    #[test]
    fn operations_found_by_path_are_those_of_counting() {
        let (known, none, mut r) = (Costs::remembered(), Costs::default(), Uniform::new(14));
        let mut costs = std::collections::BTreeSet::new();
        for _ in 0..20_000 {
            let triangle = whole_number_triangle(&mut r);
            let at = [0; 2].map(|_| f64::from(r.within(-4.0, 4.0).round()));
            let shear = Shear { parallel: r.within(0.0, 1.0) < 0.5, ..Shear::default() };
            let (times, madds) = time_interval_counted(&triangle, &shear, at, &known);
            assert_eq!((times, madds), time_interval_counted(&triangle, &shear, at, &none), "{at:?}");
            assert_eq!(times, time_interval(&triangle, &shear, at[0], at[1]));
            costs.insert(madds);
        }
        assert!(costs.len() > 20, "{costs:?}");
    }

    #[test]
    fn dense_sampling_finds_no_other_time_and_the_intervals_are_no_wider() {
        let mut r = Uniform::new(10);
        for (seed, case) in cases(300).filter(|(_, case)| case.triangle.moving && !case.within.lens) {
            let place = case.position(&mut r);
            let sets = time_interval(&case.triangle, &case.shear, place[0], place[1]);
            let mut lasted = [0.0; 2];
            for step in 0..=4000 {
                let t = f64::from(step) / 4000.0;
                let e = case.edges([place[0], place[1], 0.0, 0.0, t]);
                for face in [0, 1] {
                    let sign = if face == 0 { 1.0 } else { -1.0 };
                    let inside = e.iter().all(|&e| sign * e >= 0.0);
                    assert!(!inside || contains(&sets[face], t), "{seed}: {t} {e:?} {sets:?}");
                    lasted[face] += if inside { 1.0 / 4000.0 } else { 0.0 };
                }
            }
            for face in [0, 1] {
                let length: f64 = sets[face].as_slice().iter().map(|[lo, hi]| hi - lo).sum();
                assert!((length - lasted[face]).abs() < 3e-3, "{seed}: {lasted:?} {sets:?}");
            }
        }
    }

    #[test]
    fn a_triangle_that_flies_past_is_there_while_it_covers_the_point() {
        // 4 wide, moving 16 to the right: its edges x = t 16 - 8 and x = t 16 - 4 pass the origin at 1/4 and
        // 1/2.
        let corner = |x: f32, y: f32| Corner { open: [x, y, 1.0], delta: [16.0, 0.0, 0.0] };
        let (_, case) = cases(1).nth(1).unwrap();
        let triangle = Triangle {
            corners: [corner(-8.0, -9.0), corner(-4.0, 0.0), corner(-8.0, 9.0)],
            moving: true,
            ..case.triangle
        };
        let sets = time_interval(&triangle, &Shear::default(), 0.0, 0.0);
        assert!(sets[1].as_slice().is_empty(), "{sets:?}");
        let [[lo, hi]] = sets[0].as_slice() else { panic!("{sets:?}") };
        assert!(
            (lo - 0.25).abs() < 1e-12 && *lo <= 0.25 && (hi - 0.5).abs() < 1e-12 && *hi >= 0.5,
            "{sets:?}"
        );
    }
}
