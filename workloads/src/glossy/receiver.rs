//! A rectangle that reflects or refracts, and the eye behind it.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// A rectangle in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// Its middle.
    pub centre: DVec3,
    /// Unit vector along its first side.
    pub right: DVec3,
    /// Unit vector at right angles to it, towards the viewer.
    pub normal: DVec3,
    /// Half of its sides, along `right` and across; scene units.
    pub half: [f64; 2],
}

/// What happens to light there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Effect {
    /// It is reflected.
    Reflection,
    /// It is refracted, into a medium with this index.
    Refraction(f64),
}

impl Receiver {
    /// A rectangle that lies in a plane of constant height and is seen from above.
    pub fn lying(centre: DVec3, half: [f64; 2]) -> Self {
        Self { centre, right: DVec3::X, normal: DVec3::Y, half }
    }

    /// How far a point is above it, scene units.
    pub fn height(&self, point: DVec3) -> f64 {
        (point - self.centre).dot(self.normal)
    }

    /// Where the eye of the map is (Figure 13): mirrored in the plane, or moved along the normal so that the ray `along`, refracted by
    /// Snell's law, comes straight from it. `None` where the eye is not above the receiver or the ray does not come down on it.
    pub fn eye(&self, eye: DVec3, along: DVec3, effect: Effect) -> Option<DVec3> {
        let height = self.height(eye);
        if !(height > 0.0 && height.is_finite()) {
            return None;
        }
        let Effect::Refraction(index) = effect else { return Some(eye - 2.0 * height * self.normal) };
        let down = -along.dot(self.normal) / along.length();
        if !(down > 1e-6 && index > 0.0) {
            return None;
        }
        let sine = (1.0 - down * down).max(0.0).sqrt();
        // Straight down, the ratio of the tangents becomes that of the sines.
        let refracted = sine / index;
        let cosine = (1.0 - refracted * refracted).max(0.0).sqrt();
        let ratio = if sine < 1e-9 { index } else { (sine / down) * cosine / refracted };
        (ratio.is_finite() && ratio > 0.0).then(|| eye + (ratio - 1.0) * height * self.normal)
    }

    /// Its corners, counter-clockwise seen from above, from the first row of the map on.
    pub fn corners(&self) -> [Vec3; 4] {
        let across = self.right.cross(self.normal);
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| (self.centre + x * self.half[0] * self.right + y * self.half[1] * across).as_vec3())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mirrored_eye_is_as_far_below() {
        let floor = Receiver::lying(DVec3::new(0.0, 1.0, 0.0), [1.0, 1.0]);
        let eye = floor.eye(DVec3::new(2.0, 4.0, 1.0), DVec3::NEG_Y, Effect::Reflection);
        assert_eq!(eye, Some(DVec3::new(2.0, -2.0, 1.0)));
        assert_eq!(floor.eye(DVec3::ZERO, DVec3::NEG_Y, Effect::Reflection), None, "from below");
    }

    /// Snell's law itself, at the middle ray.
    #[test]
    fn the_middle_ray_is_refracted_as_it_should_be() {
        let water = Receiver::lying(DVec3::ZERO, [1.0, 1.0]);
        for (along, index) in [(DVec3::new(0.6, -0.8, 0.0), 1.33), (DVec3::new(0.3, -0.2, 0.4), 1.5)] {
            let eye = DVec3::new(-1.0, 2.0, 0.5);
            let met = eye + along * (eye.y / -along.y);
            let from = water.eye(eye, along, Effect::Refraction(index)).unwrap();
            assert_eq!([from.x, from.z], [eye.x, eye.z], "it moves along the normal");
            let sine = |ray: DVec3| (1.0 - (ray.normalize().y).powi(2)).sqrt();
            assert!((sine(along) / sine(met - from) - index).abs() < 1e-9);
        }
        let down = water.eye(DVec3::Y, DVec3::NEG_Y, Effect::Refraction(1.5)).unwrap();
        assert!((down.y - 1.5).abs() < 1e-9, "apparent depth");
        assert_eq!(water.eye(DVec3::Y, DVec3::X, Effect::Refraction(1.5)), None);
    }
}
