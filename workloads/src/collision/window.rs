//! When a triangle may be inside a box: a bound that costs a few divisions.

use super::bounds::{Bounds, Ends, NOTHING, hull, meet};

/// Times come from one quotient of differences, so they are off by a few units in 2^53 of numbers up to one.
const ROUNDING: f64 = 1e-14;

/// The times in `within` at which a triangle may touch it, or `None` where it never does. Each of the six sides alone: the triangle is
/// on the outside as long as all its corners are. `swept` is the box that it sweeps.
pub(super) fn times_inside(
    ends: &Ends,
    swept: &Bounds,
    within: &Bounds,
    uncertainty: f64,
) -> Option<[f64; 2]> {
    let mut times = within.time;
    for axis in 0..3 {
        let [low, high] = within.space[axis];
        let [least, most] = swept.space[axis];
        let corners = || [0, 1, 2].map(|corner| [ends[0][corner][axis], ends[1][corner][axis]]);
        // What does not reach beyond a side need not be asked for it.
        if least < low {
            times = meet(times, inside(corners().map(|ends| ends.map(|at| at - (low - uncertainty)))))?;
        }
        if most > high {
            times = meet(times, inside(corners().map(|ends| ends.map(|at| (high + uncertainty) - at))))?;
        }
    }
    Some(times)
}

/// The hull of the times at which any of the corners is on the inside; their distances to the side are given at both ends.
fn inside(corners: [[f64; 2]; 3]) -> [f64; 2] {
    corners.into_iter().map(since).fold(NOTHING, hull)
}

/// The times at which a number that runs from `from` to `to` is not below zero.
fn since([from, to]: [f64; 2]) -> [f64; 2] {
    let root = || from / (from - to);
    match (from >= 0.0, to >= 0.0) {
        (true, true) => [0.0, 1.0],
        (true, false) => [0.0, root() + ROUNDING],
        (false, true) => [root() - ROUNDING, 1.0],
        (false, false) => NOTHING,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn times(ends: &Ends, within: &Bounds) -> Option<[f64; 2]> {
        times_inside(ends, &Bounds::of(ends.as_flattened().iter().copied()), within, 0.0)
    }

    #[test]
    fn a_point_that_passes_a_box_is_inside_between_its_sides() {
        let ends = [[[-1.0, 0.5, 0.5]; 3], [[3.0, 0.5, 0.5]; 3]];
        let within = Bounds { space: [[0.0, 1.0]; 3], time: [0.0, 1.0] };
        let [first, last] = times(&ends, &within).unwrap();
        assert!((first - 0.25).abs() < 1e-12 && (last - 0.5).abs() < 1e-12, "{first} {last}");
        assert!(first <= 0.25 && last >= 0.5);
        assert!(times(&ends, &Bounds { time: [0.6, 1.0], ..within }).is_none());
        assert!(times(&ends, &Bounds { space: [[0.0, 1.0], [0.0, 0.25], [0.0, 1.0]], ..within }).is_none());
    }

    proptest! {
        #[test]
        fn no_time_at_which_a_point_is_inside_is_left_out(
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
