//! Motion and blur thresholds: how far motion and blur move the outline of a triangle on the image.
//!
//! The image of a vertex in front of the camera moves monotonically in time on both axes, so its distance
//! from its mid-shutter image is largest at an end. Over the lens it moves on a line, with the largest
//! distance at the ends, by `a - s / w`, which is monotone in `w`. In an orthographic view the distance is `a
//! w - s`, also monotone. The image of a triangle in front of the camera is the hull of the images of its
//! vertices, so no point of its outline moves farther than they do.

use super::number::Number;
use crate::geometry::{MovingVertex, Shear};

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

#[cfg(test)]
mod tests {
    use super::super::number::counted::{Counted, count};
    use super::super::testing::{Uniform, cases};
    use super::*;

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

    fn vertices(case: &super::super::testing::Case) -> [MovingVertex; 3] {
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
}
