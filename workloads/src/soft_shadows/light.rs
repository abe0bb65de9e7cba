//! An area light as a camera with a lens.

use glam::{DAffine3, DVec3, Vec3};
use pipeline::{Camera, Lens};
use serde::{Deserialize, Serialize};

use crate::error::LoadError;
use crate::scene::camera::Stand;
use crate::scene::{View, tan_half};

/// Where a light is and what it shines at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LightSpec {
    /// Its middle, scene units.
    pub position: [f64; 3],
    /// What it faces, scene units.
    pub target: [f64; 3],
    /// Its radius, scene units; the shape is that of the samples' lens.
    pub radius: f64,
    /// The angle its map sees, in degrees, across and down.
    pub fov_deg: f64,
    /// Depth below which nothing throws a shadow, scene units.
    pub near: f64,
}

impl Default for LightSpec {
    fn default() -> Self {
        Self { position: [2.6, 5.2, 2.2], target: [0.0; 3], radius: 0.45, fov_deg: 62.0, near: 0.5 }
    }
}

impl LightSpec {
    /// Moves the light and what it faces.
    pub(super) fn move_by(&mut self, way: DVec3) {
        for point in [&mut self.position, &mut self.target] {
            *point = (DVec3::from_array(*point) + way).to_array();
        }
    }

    /// Refuses an angle or a length that cannot be, `way` scene units from the target.
    fn must_fit(&self, way: f64) -> Result<(), String> {
        let Self { radius, fov_deg, near, .. } = *self;
        let widest = WIDEST * way;
        if !(1.0..=170.0).contains(&fov_deg) {
            return Err(format!("fov_deg {fov_deg:?}: a map sees 1 to 170 degrees"));
        }
        if near >= way {
            return Err(format!(
                "near {near:?}: nothing before the target would throw a shadow; it has to be below {way:?}, the way to it"
            ));
        }
        if !(SMALLEST..=widest).contains(&radius) {
            return Err(format!(
                "radius {radius:?}: it has to be {SMALLEST:e} to {widest:?} scene units, {WIDEST} times the way to the target"
            ));
        }
        Ok(())
    }
}

/// An area light: its camera, whose lens is the light.
#[derive(Clone, Copy, Debug)]
pub struct AreaLight {
    stand: Stand,
    radius: f64,
    tan_half: f64,
    camera: Camera,
}

/// As good as infinitely far, in scene units: the lens moves the image of a texel by less than its rounding.
const INFINITY: f32 = 1e30;

/// The widest light over its distance from the target: beyond it the map sees nothing of what is lit.
const WIDEST: f64 = 100.0;
/// The smallest, in scene units: single precision holds it.
const SMALLEST: f64 = 1e-30;

impl AreaLight {
    /// The light that is described.
    ///
    /// # Errors
    /// When it faces nowhere, or a length or angle cannot be.
    pub fn new(spec: &LightSpec) -> Result<Self, LoadError> {
        let refused = |message: String| LoadError::Setting { setting: "light", message };
        let position = DVec3::from_array(spec.position);
        let stand = Stand::new(position, DVec3::from_array(spec.target) - position, DVec3::Y);
        let stand = stand.ok_or_else(|| {
            refused("position and target coincide or are not finite: move one of them".to_owned())
        })?;
        let way = (DVec3::from_array(spec.target) - position).length();
        spec.must_fit(way).map_err(refused)?;
        let view = View::Perspective { tan_half_height: tan_half(spec.fov_deg) };
        let camera = view.camera(stand.pose(), spec.near as f32).map_err(|e| refused(e.to_string()))?;
        let lens = Lens::new(spec.radius as f32, INFINITY).map_err(|e| refused(e.to_string()))?;
        let camera = camera.with_lens(Some(lens));
        Ok(Self { stand, radius: spec.radius, tan_half: tan_half(spec.fov_deg), camera })
    }

    /// The camera that renders its map.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The place `(u, v)` of the light in the world.
    pub fn point(&self, [u, v]: [f32; 2]) -> DVec3 {
        let [u, v] = [u, v].map(|c| f64::from(c) * self.radius);
        self.stand.eye + u * self.stand.right + v * self.stand.up
    }

    /// The texel of a map `side` texels wide and the depth at which place `(u, v)` of the light sees `point`; nothing beyond the map.
    pub fn texel(&self, point: Vec3, lens: [f32; 2], side: u32) -> Option<([u32; 2], f64)> {
        let seen = self.stand.view(point.as_dvec3());
        let [u, v] = lens.map(|c| f64::from(c) * self.radius);
        let per_unit = 0.5 * f64::from(side) / (self.tan_half * seen.z);
        let at = [(seen.x - u) * per_unit, -(seen.y - v) * per_unit].map(|c| c + 0.5 * f64::from(side));
        let inside = seen.z > 0.0 && at.iter().all(|c| (0.0..f64::from(side)).contains(c));
        inside.then(|| (at.map(|c| c as u32), seen.z))
    }

    /// How wide a texel is at the light's target, scene units.
    pub fn texel_width(&self, target: DVec3, side: u32) -> f64 {
        2.0 * self.tan_half * self.stand.depth(target).max(0.0) / f64::from(side)
    }

    /// World to camera, for those who project themselves.
    pub fn pose(&self) -> DAffine3 {
        DAffine3::from_cols_array(&self.camera.open().to_cols_array().map(f64::from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_the_light_sees_its_target_in_the_middle() {
        let spec =
            LightSpec { position: [0.0, 4.0, 0.0], radius: 0.5, fov_deg: 90.0, ..LightSpec::default() };
        let light = AreaLight::new(&spec).unwrap();
        assert_eq!(light.texel(Vec3::new(0.01, 0.0, 0.01), [0.0; 2], 64).map(|(_, w)| w), Some(4.0));
        // Half a unit at depth 4, of 8 units over 64 texels: four texels, the other way round.
        let [right, up] = [light.point([1.0, 0.0]), light.point([0.0, 1.0])];
        assert!((right - light.point([0.0; 2])).length() == 0.5 && (up - right).length() > 0.5);
        let shifted = |lens| light.texel(Vec3::new(0.01, 0.0, 0.01), lens, 64).unwrap().0;
        let [here, u, v] = [[0.0; 2], [1.0, 0.0], [0.0, 1.0]].map(shifted);
        assert_eq!([here[0] - u[0], v[1] - here[1]], [4, 4]);
        assert!((light.texel_width(DVec3::ZERO, 64) - 0.125).abs() < 1e-12);
        assert_eq!(light.texel(Vec3::new(9.0, 0.0, 0.0), [0.0; 2], 64), None);
        assert_eq!(light.texel(Vec3::new(0.0, 5.0, 0.0), [0.0; 2], 64), None, "behind the light");
    }

    #[test]
    fn a_light_that_cannot_be_is_refused() {
        let base = LightSpec::default();
        for bad in [
            LightSpec { target: base.position, ..base },
            LightSpec { radius: 0.0, ..base },
            LightSpec { radius: 1e-300, ..base },
            LightSpec { radius: 1e4, ..base },
            LightSpec { fov_deg: 200.0, ..base },
            LightSpec { near: -1.0, ..base },
            LightSpec { near: 1e30, ..base },
        ] {
            assert!(AreaLight::new(&bad).unwrap_err().is_usage());
        }
    }
}
