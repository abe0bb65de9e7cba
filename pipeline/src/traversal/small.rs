//! Motion and blur too small to matter: how far a triangle is from where it would be drawn without.
//!
//! The image of a vertex in front of the camera moves monotonically in time on both axes, so it is never farther from its place in
//! mid-shutter than at an end. On the lens it moves on a line of which the ends are farthest, by `a - s / w`, which is
//! monotone in `w`. The image of a triangle wholly in front of the camera is the hull of those of its vertices, so no point of its
//! outline moves farther than they do.

use crate::geometry::{MovingVertex, Shear};

/// Multiply-adds of [`motion_px`]: two quotients for three places of each vertex, the middle of it, and two distances.
pub const MOTION_MADDS: u32 = 3 * (3 * 2 + 3 + 2 * 4);

/// Multiply-adds of [`blur_px`]: a quotient and a difference for each axis, vertex and end.
pub const BLUR_MADDS: u32 = 3 * 2 * 2 * 2;

/// The farthest that a vertex is from its image in mid-shutter, in pixels, through a pinhole or from anywhere on the lens; infinite where
/// one is not in front of the camera.
pub fn motion_px(vertices: [&MovingVertex; 3], shear: &Shear) -> f64 {
    let one = |vertex: &MovingVertex| {
        let (open, close) = (vertex.open.map(f64::from), vertex.close.map(f64::from));
        let middle = [0, 1, 2].map(|axis| 0.5 * (open[axis] + close[axis]));
        let away = |end: [f64; 3]| {
            let [x, y] = [0, 1].map(|axis| {
                let lens = f64::from(shear.s[axis]).abs() * (1.0 / end[2] - 1.0 / middle[2]).abs();
                (end[axis] / end[2] - middle[axis] / middle[2]).abs() + lens
            });
            x.hypot(y)
        };
        if open[2] > 0.0 && close[2] > 0.0 { away(open).max(away(close)) } else { f64::INFINITY }
    };
    vertices.map(one).into_iter().fold(0.0, f64::max)
}

/// The largest radius of the circle of confusion of a vertex at either end of the shutter, in pixels; infinite where one is not in front of
/// the camera.
pub fn blur_px(vertices: [&MovingVertex; 3], shear: &Shear) -> f64 {
    let radius = |w: f64, axis: usize| (f64::from(shear.a[axis]) - f64::from(shear.s[axis]) / w).abs();
    vertices
        .into_iter()
        .flat_map(|vertex| [vertex.open[2], vertex.close[2]])
        .map(|w| if w > 0.0 { radius(f64::from(w), 0).max(radius(f64::from(w), 1)) } else { f64::INFINITY })
        .fold(0.0, f64::max)
}

/// The vertex where it is in mid-shutter, at rest.
pub fn at_rest(vertex: &MovingVertex) -> MovingVertex {
    let middle = [0, 1, 2].map(|axis| vertex.open[axis] + 0.5 * (vertex.close[axis] - vertex.open[axis]));
    MovingVertex { open: middle, close: middle }
}
