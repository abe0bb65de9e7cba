//! Screening of single samples by edges linearized in (X, Y, u, v, t) (Munkberg and Akenine-Moeller 2012,
//! whose hyperplanes these are; the remainder bound is new here).

use super::edges::{Edge, Edges};
use super::number::{Number, Quadratic, Scalar};
use super::region::{Faces, View};

/// Linear edges in the arithmetic of the sample test. A sample is outside if one edge is below `-margin` and
/// another above `margin`.
#[derive(Clone, Copy, Debug)]
pub struct Screen {
    /// Value of each edge in the middle of the box.
    pub value: [f32; 3],
    /// Value of each edge in the middle of the tile, extrapolated to the middle of the lens and the start of the shutter, from which
    /// positions of samples are.
    pub base: [f32; 3],
    /// Slope of each edge along X, Y, u, v, t.
    pub gradient: [[f32; 5]; 3],
    /// Error bound of the linear value of each edge.
    pub margin: [f32; 3],
    /// Largest difference of each edge from its value in the middle, without the margin.
    pub extent: [f32; 3],
}

/// Multiply-adds of [`Screen::gain`].
pub const SCREEN_GAIN_MADDS: u32 = 28;

impl Screen {
    /// Screen for single samples of the box of `edges` at times `t`, within those of the box, if only `faces`
    /// can be visible.
    pub fn new<N: Number>(edges: &Edges<N>, t: [f32; 2], faces: Faces) -> Self {
        let (view, skew) = (&edges.view, edges.skew());
        let ([.., u, v], middle_t) = (view.middle, 0.5 * (t[0] + t[1]));
        let middle = [(2, u, view.lens), (3, v, view.lens), (4, middle_t, view.moving)];
        let part = (view.moving && t != view.t).then(|| t.map(|t| view.phase(t)));
        let half_t = (N::from(t[1]) - N::from(t[0])) * N::from(0.5);
        let linear = edges.edges.map(|edge| edge.linear(view, part, half_t, skew));
        let mut screen = Self {
            value: [0.0; 3],
            base: [0.0; 3],
            gradient: [[0.0; 5]; 3],
            margin: [0.0; 3],
            extent: [0.0; 3],
        };
        for (k, linear) in linear.iter().enumerate() {
            let away = middle
                .iter()
                .filter(|(.., is_used)| *is_used)
                .map(|(axis, at, _)| (linear.slopes[*axis], N::of(*at)));
            let base = away.clone().fold(linear.value, |base, (slope, at)| base - slope * at);
            let reach: f64 = away.map(|(slope, at)| (slope.into() * at.into()).abs()).sum();
            // The middle of the times is rounded; the resulting shift goes into the margin.
            let off = Into::<f64>::into(linear.slopes[4]).abs() * f64::from(f32::EPSILON * middle_t.abs());
            let [shift, margin] = one_sided(linear, [off, reach], faces);
            let [value, base] = [linear.value, base].map(|at| (Into::<f64>::into(at) + shift) as f32);
            (screen.value[k], screen.base[k], screen.margin[k]) =
                (value, base, margin as f32 + margin.abs() as f32 * 1e-6);
            screen.extent[k] = Into::<f64>::into(linear.extent) as f32;
            screen.gradient[k] = linear.slopes.map(|slope| Into::<f64>::into(slope) as f32);
        }
        screen
    }

    /// Expected fraction of samples rejected, for edges distributed evenly over their extents and independent
    /// of each other.
    pub fn gain(&self) -> f32 {
        gain(self.value, self.margin, self.extent.map(|extent| extent.max(f32::MIN_POSITIVE)))
    }
}

/// [`Screen::gain`] of edges with positive extents.
fn gain<N: Scalar>(value: [N; 3], margin: [N; 3], extent: [N; 3]) -> N {
    let [zero, one] = [0.0, 1.0].map(N::from);
    let share = |part: N| {
        if part < zero {
            zero
        } else if part > one {
            one
        } else {
            part
        }
    };
    let mut kept = [one; 2];
    for k in 0..3 {
        let per = N::from(0.5) / extent[k];
        let [below, above] =
            [-value[k], value[k]].map(|value| share(one - (value - margin[k] + extent[k]) * per));
        kept = [kept[0] * below, kept[1] * above];
    }
    (one - kept[0]) * (one - kept[1])
}

/// `value + slopes . d` over a box, within `remainder` of the result of the sample test.
#[derive(Clone, Copy, Debug)]
pub(super) struct Linear<N> {
    pub value: N,
    pub slopes: [N; 5],
    pub remainder: N,
    /// Largest difference of the linear part from its middle value.
    pub extent: N,
}

/// Multiply-adds of screening one sample: three edges, one per dimension in use. The sample table has positions from the middle of
/// the tile.
pub const fn screen_madds(moving: bool, lens: bool) -> u32 {
    3 * (2 + moving as u32 + 2 * lens as u32)
}

/// Shift of the values of an edge, and its margin. If only one face can be visible, one edge on the wrong side suffices. The
/// threshold is then shifted so far that the other side always passes. `off` is an error of the values, and `reach` how far the edge
/// changes from the box to where positions are from.
fn one_sided<N: Number>(linear: &Linear<N>, [off, reach]: [f64; 2], faces: Faces) -> [f64; 2] {
    // The linear value is rounded a dozen times, each by at most 2^-24 of the sum of magnitudes.
    const ROUNDING: f64 = 1.0 / 1_048_576.0;
    let [value, extent, remainder]: [f64; 3] =
        [linear.value, linear.extent, linear.remainder].map(Into::into);
    let tallest = 1.001 * (value.abs() + extent);
    let both = faces[0] == faces[1];
    let rounded = if both { tallest } else { 4.0 * (tallest + remainder) } + 4.0 * reach;
    let margin = remainder + off + ROUNDING * rounded;
    if both {
        return [0.0, margin];
    }
    let beyond = 2.0 * (tallest + margin);
    let shift = 0.5 * (beyond + margin);
    [if faces[0] { shift } else { -shift }, 0.5 * (margin - beyond)]
}

impl<N: Number> Edge<N> {
    /// The edge linearized over `part` of the time, or over all of it; `half_t` is half the length.
    fn linear(&self, view: &View<N>, part: Option<[N; 2]>, half_t: N, skew: N) -> Linear<N> {
        let over = |q: &Quadratic<N>| match part {
            Some(part) => q.over(part),
            None => *q,
        };
        let mut linear = Linear {
            value: self.value.0[0],
            slopes: [N::zero(); 5],
            remainder: view.rounding,
            extent: N::zero(),
        };
        if view.moving {
            let [m0, m1, m2] = over(&self.value).centred();
            // `c^2` is not negative: half of its term goes into the value.
            let bend = m2 * N::from(0.5);
            linear.value = m0 + bend;
            linear.remainder = linear.remainder + bend.abs();
            linear.extent = m1.abs();
            linear.slopes[4] = if half_t > N::zero() { m1 / half_t } else { N::zero() };
        }
        for axis in 0..if view.lens { 4 } else { 2 } {
            let half = view.half[axis];
            linear.slopes[axis] = self.slopes[axis].0[0];
            if view.moving {
                let [m0, m1, m2] = over(&self.slopes[axis]).centred();
                linear.slopes[axis] = m0;
                linear.remainder = linear.remainder + half * (m1.abs() + m2.abs());
            }
            linear.extent = linear.extent + linear.slopes[axis].abs() * half;
        }
        if view.lens {
            let bend = self.depths[0].abs().max(self.depths[1].abs());
            linear.remainder = linear.remainder + skew * bend;
        }
        linear
    }
}

#[cfg(test)]
mod tests {
    use super::super::number::counted::{Counted, count};
    use super::super::testing::{Uniform, cases};
    use super::super::{Edges, Screen, View};
    use super::{SCREEN_GAIN_MADDS, gain};

    #[test]
    fn the_cost_of_a_gain_is_that_of_its_kernel() {
        let part = |value: f32| [value; 3].map(Counted::from);
        for value in [-9.0, -0.5, 0.0, 0.25, 9.0] {
            let (madds, _) = count(|| gain(part(value), part(0.1), part(1.0)));
            assert_eq!(madds, SCREEN_GAIN_MADDS, "{value}");
        }
    }

    #[test]
    fn edges_stay_within_the_margin_and_one_sided_screens_say_the_same() {
        let (mut r, mut outside) = (Uniform::new(5), [0; 3]);
        for (seed, case) in cases(300) {
            let edges = Edges::<f64>::new(View::new(&case.triangle, &case.shear, &case.tile, &case.within));
            let [start, end] = case.within.t;
            let part = if seed % 2 == 0 {
                [start, end]
            } else {
                [start + 0.25 * (end - start), 0.5 * (start + end)]
            };
            for (kind, faces) in [[true, true], [true, false], [false, true]].into_iter().enumerate() {
                let screen = Screen::new(&edges, part, faces);
                let [x, y] = [case.tile.x, case.tile.y].map(|[lo, hi]| 0.5 * (lo + hi));
                let origin = [x, y, 0.0, 0.0, 0.0].map(f64::from);
                for _ in 0..30 {
                    let mut place = case.position(&mut r);
                    place[4] = f64::from(r.often_an_end(part));
                    let e = case.edges(place);
                    // As in the sample test, but without rounding.
                    let signs: Vec<_> = (0..3)
                        .map(|k| {
                            let linear: f64 = (0..5)
                                .map(|axis| {
                                    let offset = place[axis] - origin[axis];
                                    f64::from(screen.gradient[k][axis]) * offset
                                })
                                .sum();
                            let value = f64::from(screen.base[k]) + linear;
                            let margin = f64::from(screen.margin[k]);
                            (value < -margin, value > margin)
                        })
                        .collect();
                    let out = signs.iter().any(|s| s.0) && signs.iter().any(|s| s.1);
                    outside[kind] += u32::from(out);
                    let seen = (faces[0] && e.iter().all(|&e| e >= 0.0))
                        || (faces[1] && e.iter().all(|&e| e <= 0.0));
                    assert!(!(out && seen), "{seed} {faces:?}: {e:?} {screen:?}");
                    let room = edges.view.rounding * 0.9;
                    if kind == 0 {
                        for (k, value) in e.into_iter().enumerate() {
                            assert!(
                                !(signs[k].0 && value > -room || signs[k].1 && value < room),
                                "{seed}: {value}"
                            );
                        }
                    } else {
                        let edge_says = e.iter().any(|&e| if kind == 1 { e < 0.0 } else { e > 0.0 });
                        assert!(!out || edge_says);
                    }
                }
            }
        }
        assert!(outside[0] > 1000 && outside[1] > outside[0] && outside[2] > outside[0], "{outside:?}");
    }
}
