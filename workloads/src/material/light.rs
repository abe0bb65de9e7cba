//! The light of a scene: one lamp at infinity and a sky over a ground.

use glam::Vec3;

/// One directional light and an ambient term that depends on which way a surface looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Unit vector from the scene towards the lamp; `None` for a lamp over the camera's shoulder, placed when
    /// the camera is known.
    pub toward: Option<Vec3>,
    /// Linear RGB radiance that a white surface facing the lamp sends back.
    pub color: Vec3,
    /// Linear RGB radiance of a white surface that looks straight up, from the sky alone.
    pub sky: Vec3,
    /// The same for one that looks straight down.
    pub ground: Vec3,
}

impl Default for Light {
    fn default() -> Self {
        Self {
            toward: None,
            color: Vec3::new(0.74, 0.71, 0.66),
            sky: Vec3::new(0.26, 0.29, 0.34),
            ground: Vec3::new(0.12, 0.11, 0.10),
        }
    }
}
