//! The wall scene: walls, solid or slatted, with boxes behind them.

use std::sync::Arc;

use glam::{Affine3A, Vec3};
use pipeline::random::mix;
use pipeline::{Camera, Cull, Draw, DrawError, Geometry, Lens, Shader};

use super::MovingBox;

/// Parameters of a wall scene. Lengths are in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallSceneSpec {
    /// Number of walls, 8 metres away.
    pub walls: u32,
    /// Slats per wall.
    pub slats: u32,
    /// Share of a wall that is gaps between slats.
    pub gaps: f32,
    /// Number of boxes, most of them behind a wall.
    pub boxes: u32,
    /// Motion of walls during the shutter, to either side. The boxes behind a wall follow it in the image.
    pub motion: f32,
    /// Radius of the lens, which is focused at 2 metres; 0 is a pinhole.
    pub lens: f32,
    /// Seed of all positions.
    pub seed: u64,
}

/// A wall scene.
#[derive(Clone, Debug)]
pub struct WallScene {
    /// The camera.
    pub camera: Camera,
    /// Corners of the walls at shutter open.
    pub open: Arc<[Vec3]>,
    /// Corners of the walls at shutter close.
    pub close: Arc<[Vec3]>,
    /// Triangles of the walls.
    pub triangles: Vec<[u32; 3]>,
    /// The boxes.
    pub boxes: Vec<MovingBox>,
}

/// Distance of the walls.
const DISTANCE: f32 = 8.0;
/// Half the side of a wall.
const HALF_SIDE: f32 = 1.5;
/// Focus depth of the lens.
const FOCUS: f32 = 2.0;

impl WallScene {
    /// The draw of the walls with `shader`.
    ///
    /// # Errors
    /// [`DrawError`] if a coordinate is not finite.
    pub fn walls<'a>(&'a self, shader: &'a dyn Shader) -> Result<Draw<'a>, DrawError> {
        Ok(Draw {
            geometry: Geometry::new(&self.open, &self.close, &self.triangles)?,
            shader,
            cull: Cull::None,
        })
    }
}

impl WallSceneSpec {
    /// Makes the scene; `None` if the lens or the gaps are invalid.
    pub fn wall_scene(&self) -> Option<WallScene> {
        let finite = self.motion.is_finite() && (0.0..=1.0).contains(&self.gaps);
        let lens = match self.lens {
            0.0 => None,
            radius => Some(Lens::new(radius, FOCUS).ok()?),
        };
        let camera = Camera::new(Affine3A::IDENTITY, 0.5, 0.1).ok()?.with_lens(lens);
        let (mut open, mut close, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
        for wall in 0..self.walls {
            let (middle, half_motion) = self.wall(wall);
            for slat in 0..self.slats.max(1) {
                let width = 2.0 * HALF_SIDE / self.slats.max(1) as f32;
                let left = middle.x - HALF_SIDE + slat as f32 * width;
                let (right, first) = (left + width * (1.0 - self.gaps), open.len() as u32);
                let corner = |x: f32, y: f32| Vec3::new(x, y, middle.z);
                let [low, high] = [middle.y - HALF_SIDE, middle.y + HALF_SIDE];
                let four = [corner(left, low), corner(right, low), corner(left, high), corner(right, high)];
                open.extend(four.map(|p| p - half_motion));
                close.extend(four.map(|p| p + half_motion));
                triangles.extend([[first, first + 1, first + 3], [first, first + 3, first + 2]]);
            }
        }
        let boxes = (0..self.boxes).map(|n| self.moving_box(n)).collect();
        finite.then_some(WallScene { camera, open: open.into(), close: close.into(), triangles, boxes })
    }

    fn uniform(&self, of: u64, n: u32, low: f32, high: f32) -> f32 {
        let word = mix(mix(self.seed ^ of << 32) ^ u64::from(n));
        low + (high - low) * ((word >> 40) as f32 / 16_777_216.0)
    }

    /// Centre of a wall, and half of its motion.
    fn wall(&self, n: u32) -> (Vec3, Vec3) {
        let middle = Vec3::new(self.uniform(1, n, -6.0, 6.0), self.uniform(2, n, -2.5, 2.5), DISTANCE);
        let side = if n.is_multiple_of(2) { 1.0 } else { -1.0 };
        (middle, Vec3::X * 0.5 * self.motion * side)
    }

    /// A box near the line from the camera through a wall, up to twice as far. It follows the wall in the
    /// image and does not rotate.
    fn moving_box(&self, n: u32) -> MovingBox {
        let (middle, half_motion) =
            if self.walls > 0 { self.wall(n % self.walls) } else { (Vec3::Z * DISTANCE, Vec3::ZERO) };
        let farther = self.uniform(3, n, 1.3, 2.0);
        let aside = Vec3::new(self.uniform(4, n, -1.6, 1.6), self.uniform(5, n, -1.6, 1.6), 0.0);
        let half = Vec3::splat(self.uniform(6, n, 0.1, 0.6));
        let (at, half_motion) = ((middle + aside) * farther, half_motion * farther);
        let about = |at: Vec3| [at - half, at + half];
        MovingBox { open: about(at - half_motion), close: about(at + half_motion) }
    }
}
