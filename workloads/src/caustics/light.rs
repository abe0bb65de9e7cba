//! Light of a beam at a pixel: the pixel shader.

use glam::DVec3;

use super::cover::times;
use super::eye::Seen;
use super::{Eye, Hit};

/// A horizontal floor that receives light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floor {
    /// Height in metres.
    pub height_m: f64,
}

/// Quantity that is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Light in the volume: fluence along the ray of a pixel, in watts per metre. Times the scattering
    /// coefficient, it is what a camera sees.
    Volume,
    /// Irradiance on a floor, in watts per square metre, from either side.
    Floor(Floor),
}

/// Multiply-adds of one shader execution in the volume, counted from the code below: three edges and their
/// quadratics, both faces, the area at three positions and the integral.
const VOLUME_OPS: u32 = 120;
/// The same on a floor: the cubic of the inside test, some thirty halvings, and weights and Jacobian of a
/// hit.
const FLOOR_OPS: u32 = 260;

impl Light {
    /// Cost of a shader execution, in multiply-adds.
    pub const fn ops(&self) -> u32 {
        match self {
            Self::Volume => VOLUME_OPS,
            Self::Floor(_) => FLOOR_OPS,
        }
    }

    /// Light of a beam at a pixel centre.
    pub(super) fn shade(&self, eye: &Eye, seen: &Seen, at: [f64; 2]) -> f64 {
        match self {
            Self::Volume => fluence_along(eye, seen, at),
            Self::Floor(floor) => floor.irradiance(eye, seen, at),
        }
    }
}

/// Integral of the fluence along a ray. Fluence is `2 flux |dx/dt| / |det(dx/db1, dx/db2, dx/dt)|`. Along a
/// ray, `dz / |det(dx/db1, dx/db2, dx/dt)|` is `dt` over twice the area of the triangle in the image. So the
/// integral runs over the times at which the pixel is inside.
fn fluence_along(eye: &Eye, seen: &Seen, at: [f64; 2]) -> f64 {
    let scale = eye.scale_px();
    let areas = seen.image.areas().map(|area| area.z);
    let piece = |&[from, to]: &[f64; 2]| {
        let (from, to) = (from.max(0.0), to.min(1.0));
        speed(seen, at, 0.5 * (from + to)) * over_area(areas, from, to)
    };
    let sets = times(eye, seen, at);
    let sum: f64 = sets.iter().flat_map(|set| set.as_slice()).map(piece).sum();
    2.0 * seen.world.flux_w * scale * scale * sum
}

/// `|dx/dt|` where the ray meets the triangle. It varies little within a beam, so one value represents an
/// interval.
fn speed(seen: &Seen, [x, y]: [f64; 2], t: f64) -> f64 {
    let corners = seen.image.corners(t);
    let edge = |i: usize, j: usize| {
        let (a, b) = (corners[i], corners[j]);
        (a.x - x) * (b.y - y) - (b.x - x) * (a.y - y)
    };
    let edges = [edge(1, 2), edge(2, 0), edge(0, 1)];
    let sum: f64 = edges.iter().sum();
    let weights = if sum == 0.0 { [1.0 / 3.0; 3] } else { edges.map(|e| (e / sum).clamp(0.0, 1.0)) };
    seen.world.motion(&Hit { weights, t }).length()
}

/// Integral of `1 / |area|` over an interval in which a pixel is inside, so that the quadratic `area` keeps
/// its sign. With `B` its polar form at both times and `w^2 = B^2 - area(from) area(to)`, it is `(to - from)
/// atanh(w / B) / w`.
fn over_area(area: [f64; 3], from: f64, to: f64) -> f64 {
    let polar = |s: f64, t: f64| {
        (1.0 - s) * (1.0 - t) * area[0] + ((1.0 - s) * t + s * (1.0 - t)) * area[1] + s * t * area[2]
    };
    // At a focus the light is limited by floating-point precision. A pixel centre exactly on it would be
    // infinitely bright.
    let least = f64::EPSILON * area.iter().fold(1e-200, |most: f64, a| most.max(a.abs()));
    let sign = if polar(from, from) + polar(to, to) < 0.0 { -1.0 } else { 1.0 };
    let [first, last] = [from, to].map(|t| (sign * polar(t, t)).max(least));
    let middle = sign * polar(from, to);
    let squared = middle * middle - first * last;
    let w = libm::sqrt(squared.abs());
    let per_length = if w <= 1e-6 * middle.abs() {
        1.0 / middle.max(least)
    } else if squared > 0.0 {
        // atanh(w / middle) / w, without cancellation: middle - w = first last / (middle + w).
        let sum = middle.abs() + w;
        libm::log(sum * sum / (first * last)) / (2.0 * w)
    } else {
        libm::atan2(w, middle) / w
    };
    (to - from).max(0.0) * per_length.max(0.0)
}

impl Floor {
    /// Irradiance of all hits: `2 flux |dx/dt . n| / |det(dx/db1, dx/db2, dx/dt)|`.
    fn irradiance(&self, eye: &Eye, seen: &Seen, at: [f64; 2]) -> f64 {
        let Some(point) = self.point(eye, at) else { return 0.0 };
        let scale = eye.scale_px();
        let of = |hit: Hit| {
            let through = seen.world.motion(&hit).y.abs();
            let room = seen.image.jacobian(&hit).abs() / (scale * scale);
            if room > 0.0 { 2.0 * seen.world.flux_w * through / room } else { 0.0 }
        };
        seen.image.inside(point).map(of).sum()
    }

    /// Floor point at an image position, in pixels and depth; `None` if the floor is seen edge-on.
    pub fn point(&self, eye: &Eye, at: [f64; 2]) -> Option<DVec3> {
        let (near, ahead) = (eye.world(at, 0.0), eye.world(at, 1.0));
        let depth = (self.height_m - near.y) / (ahead.y - near.y);
        depth.is_finite().then_some(DVec3::new(at[0], at[1], depth))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_integral_over_the_area_is_that_of_many_steps() {
        // Two real roots outside, no roots, a line, a constant, a double root, and a negative area.
        for area in [
            [2.0, 3.0, 1.0],
            [1.0, 0.2, 1.0],
            [1.0, 2.0, 3.0],
            [4.0; 3],
            [1.0, 1.9, 3.61],
            [-3.0, -1.0, -2.0],
        ] {
            for [from, to] in [[0.0, 1.0], [0.25, 0.5], [0.3, 0.3]] {
                let value = |t: f64| {
                    let s = 1.0 - t;
                    (s * s * area[0] + 2.0 * s * t * area[1] + t * t * area[2]).abs()
                };
                let steps = 20_000;
                let at = |k: usize| from + (to - from) * (k as f64 + 0.5) / steps as f64;
                let by_steps =
                    (0..steps).map(|k| 1.0 / value(at(k))).sum::<f64>() * (to - from) / steps as f64;
                let found = over_area(area, from, to);
                assert!(
                    (found - by_steps).abs() <= 1e-7 * by_steps,
                    "{area:?} {from} {to}: {found} {by_steps}"
                );
            }
        }
        assert!(over_area([0.0; 3], 0.0, 1.0).is_finite());
    }
}
