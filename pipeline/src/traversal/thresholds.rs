//! Motion and blur thresholds: how far motion and blur move the outline of a triangle on the image.
//!
//! The image of a vertex in front of the camera moves monotonically in time on both axes, so its distance
//! from its mid-shutter image is largest at an end. Over the lens it moves on a line, with the largest
//! distance at the ends, by `a - s / w`, which is monotone in `w`. In an orthographic view the distance is `a
//! w - s`, also monotone. The image of a triangle in front of the camera is the hull of the images of its
//! vertices, so no point of its outline moves farther than they do.

use crate::geometry::{MovingVertex, Shear};

/// Multiply-adds of [`motion_px`]: two quotients for three positions of each vertex, its middle, and two
/// distances.
pub const MOTION_MADDS: u32 = 3 * (3 * 2 + 3 + 2 * 4);

/// Multiply-adds of [`blur_px`]: a quotient and a difference for each axis, vertex and end.
pub const BLUR_MADDS: u32 = 3 * 2 * 2 * 2;

/// Largest distance in pixels of a vertex from its mid-shutter image, through a pinhole or from anywhere on
/// the lens. Infinite if a vertex is not in front of the camera.
pub fn motion_px(vertices: [&MovingVertex; 3], shear: &Shear) -> f64 {
    let weight = |depth: f64| if shear.parallel { 1.0 } else { depth };
    let one = |vertex: &MovingVertex| {
        let (open, close) = (vertex.open.map(f64::from), vertex.close.map(f64::from));
        let middle = [0, 1, 2].map(|axis| 0.5 * (open[axis] + close[axis]));
        let away = |end: [f64; 3]| {
            let [x, y] = [0, 1].map(|axis| {
                let circles = [end, middle].map(|p| shear.circle(axis, p[2]));
                let images = [end, middle].map(|p| p[axis] / weight(p[2]));
                (images[0] - images[1]).abs() + (circles[0] - circles[1]).abs()
            });
            x.hypot(y)
        };
        if weight(open[2]) > 0.0 && weight(close[2]) > 0.0 {
            away(open).max(away(close))
        } else {
            f64::INFINITY
        }
    };
    vertices.map(one).into_iter().fold(0.0, f64::max)
}

/// Largest radius in pixels of the circle of confusion of a vertex at either end of the shutter. Infinite if
/// one is not in front of the camera.
pub fn blur_px(vertices: [&MovingVertex; 3], shear: &Shear) -> f64 {
    let radius = |w: f64, axis: usize| shear.circle(axis, w).abs();
    vertices
        .into_iter()
        .flat_map(|vertex| [vertex.open[2], vertex.close[2]])
        .map(|w| {
            if shear.weight(w) > 0.0 {
                radius(f64::from(w), 0).max(radius(f64::from(w), 1))
            } else {
                f64::INFINITY
            }
        })
        .fold(0.0, f64::max)
}

/// The vertex at its mid-shutter position, still.
pub fn at_rest(vertex: &MovingVertex) -> MovingVertex {
    let middle = [0, 1, 2].map(|axis| vertex.open[axis] + 0.5 * (vertex.close[axis] - vertex.open[axis]));
    MovingVertex { open: middle, close: middle }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Uniform, cases};
    use super::*;

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
