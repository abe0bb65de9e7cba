//! Walls, whole or in slats, with boxes behind them.

use std::sync::Arc;

use glam::{Affine3A, Vec3};
use pipeline::random::mix;
use pipeline::{Camera, Cull, Draw, DrawError, Geometry, Lens, Shader};

use super::MovingBox;

/// What a yard is like. Lengths are metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YardSpec {
    /// Walls, 8 metres away.
    pub walls: u32,
    /// Slats that each wall is made of.
    pub slats: u32,
    /// The part of a wall that is gaps between slats.
    pub gaps: f32,
    /// Boxes, most of them behind a wall.
    pub boxes: u32,
    /// How far walls move while the shutter is open, to either side; the boxes behind a wall move with it as it is seen.
    pub motion: f32,
    /// Radius of the lens, which is focused at 2 metres; 0 is a pinhole.
    pub lens: f32,
    /// Decides where all is.
    pub seed: u64,
}

/// A yard.
#[derive(Clone, Debug)]
pub struct Yard {
    /// Who looks.
    pub camera: Camera,
    /// Corners of the walls when the shutter opens.
    pub open: Arc<[Vec3]>,
    /// And when it closes.
    pub close: Arc<[Vec3]>,
    /// Triangles of the walls.
    pub triangles: Vec<[u32; 3]>,
    /// The boxes.
    pub boxes: Vec<MovingBox>,
}

/// Distance and half the side of walls.
const FAR: f32 = 8.0;
const HALF: f32 = 1.5;
const FOCUS: f32 = 2.0;

impl Yard {
    /// The walls, to be drawn with `shader`.
    ///
    /// # Errors
    /// When a wall is infinitely large or far.
    pub fn walls<'a>(&'a self, shader: &'a dyn Shader) -> Result<Draw<'a>, DrawError> {
        Ok(Draw {
            geometry: Geometry::new(&self.open, &self.close, &self.triangles)?,
            shader,
            cull: Cull::None,
        })
    }
}

impl YardSpec {
    /// The yard, or `None` where the lens or the gaps make no sense.
    pub fn yard(&self) -> Option<Yard> {
        let finite = self.motion.is_finite() && (0.0..=1.0).contains(&self.gaps);
        let lens = match self.lens {
            0.0 => None,
            radius => Some(Lens::new(radius, FOCUS).ok()?),
        };
        let camera = Camera::new(Affine3A::IDENTITY, 0.5, 0.1).ok()?.with_lens(lens);
        let (mut open, mut close, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
        for wall in 0..self.walls {
            let (middle, way) = self.wall(wall);
            for slat in 0..self.slats.max(1) {
                let width = 2.0 * HALF / self.slats.max(1) as f32;
                let left = middle.x - HALF + slat as f32 * width;
                let (right, first) = (left + width * (1.0 - self.gaps), open.len() as u32);
                let corner = |x: f32, y: f32| Vec3::new(x, y, middle.z);
                let [low, high] = [middle.y - HALF, middle.y + HALF];
                let four = [corner(left, low), corner(right, low), corner(left, high), corner(right, high)];
                open.extend(four.map(|p| p - way));
                close.extend(four.map(|p| p + way));
                triangles.extend([[first, first + 1, first + 3], [first, first + 3, first + 2]]);
            }
        }
        let boxes = (0..self.boxes).map(|n| self.moving_box(n)).collect();
        finite.then_some(Yard { camera, open: open.into(), close: close.into(), triangles, boxes })
    }

    fn uniform(&self, of: u64, n: u32, low: f32, high: f32) -> f32 {
        let word = mix(mix(self.seed ^ of << 32) ^ u64::from(n));
        low + (high - low) * ((word >> 40) as f32 / 16_777_216.0)
    }

    /// The middle of a wall, and half its way.
    fn wall(&self, n: u32) -> (Vec3, Vec3) {
        let middle = Vec3::new(self.uniform(1, n, -6.0, 6.0), self.uniform(2, n, -2.5, 2.5), FAR);
        let side = if n.is_multiple_of(2) { 1.0 } else { -1.0 };
        (middle, Vec3::X * 0.5 * self.motion * side)
    }

    /// A box near the line from the eye through a wall, up to twice as far; it moves as the wall does on the image, and turns to no side.
    fn moving_box(&self, n: u32) -> MovingBox {
        let (middle, way) =
            if self.walls > 0 { self.wall(n % self.walls) } else { (Vec3::Z * FAR, Vec3::ZERO) };
        let farther = self.uniform(3, n, 1.3, 2.0);
        let aside = Vec3::new(self.uniform(4, n, -1.6, 1.6), self.uniform(5, n, -1.6, 1.6), 0.0);
        let half = Vec3::splat(self.uniform(6, n, 0.1, 0.6));
        let (at, way) = ((middle + aside) * farther, way * farther);
        let about = |at: Vec3| [at - half, at + half];
        MovingBox { open: about(at - way), close: about(at + way) }
    }
}
