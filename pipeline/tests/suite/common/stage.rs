//! A camera, a sample table and an image.

use glam::Vec3;
use pipeline::sampling::Sample;
use pipeline::*;

use super::{Flat, QUAD, pixel_camera, sample_positions, spec};

pub const RED: Flat = Flat(Vec3::new(1.0, 0.0, 0.0));
pub const BLUE: Flat = Flat(Vec3::new(0.0, 0.0, 1.0));
pub const NEAR: f32 = 0.25;

pub struct Stage {
    pub viewport: Viewport,
    pub table: SampleTable,
    pub camera: Camera,
}

impl Stage {
    pub fn new(width: u32, height: u32, table: SampleTable) -> Self {
        let viewport = Viewport::new(width, height).unwrap();
        Self { viewport, table, camera: pixel_camera(viewport, NEAR) }
    }

    /// A stage with the default table.
    pub fn sampled(width: u32, height: u32, per_pixel: u32) -> Self {
        Self::new(width, height, SampleTable::low_discrepancy(per_pixel, 1, LensShape::Disk).unwrap())
    }

    pub fn draw(&self, draws: &[Draw<'_>]) -> Vec<Vec3> {
        let spec = spec(Features::ALL);
        let settings =
            Settings { spec: &spec, viewport: self.viewport, samples: &self.table, background: Vec3::ZERO };
        RasterPass::new(&self.camera, draws, &settings).render(|_, _| ()).unwrap().into_image()
    }

    /// For each sample its pixel, the sample, its visible triangle and its depth.
    pub fn see(&self, draws: &[Draw<'_>]) -> Vec<([u32; 2], Sample, u32, f32)> {
        let spec = spec(Features::ALL);
        let settings =
            Settings { spec: &spec, viewport: self.viewport, samples: &self.table, background: Vec3::ZERO };
        let seen = RasterPass::new(&self.camera, draws, &settings).visibility().unwrap();
        let sample_positions = sample_positions(&self.table, self.viewport);
        assert_eq!(seen.len(), sample_positions.len());
        sample_positions
            .into_iter()
            .zip(seen)
            .map(|((px, s), (id, depth))| (px, s, id, f32::from_bits(depth)))
            .collect()
    }

    pub fn pixel(&self, image: &[Vec3], x: u32, y: u32) -> Vec3 {
        image[(y * self.viewport.width() + x) as usize]
    }

    /// Position of a sample in pixels from the centre of the image, `y` upwards.
    pub fn at(&self, px: [u32; 2], s: &Sample) -> [f32; 2] {
        let half = [self.viewport.width(), self.viewport.height()].map(|side| 0.5 * side as f32);
        [px[0] as f32 + s.x - half[0], half[1] - (px[1] as f32 + s.y)]
    }
}

pub fn quad<'a>(open: &'a [Vec3], close: &'a [Vec3], shader: &'a dyn Shader) -> Draw<'a> {
    Draw::new(Geometry::new(open, close, &QUAD).unwrap(), shader, Cull::None)
}

pub fn still<'a>(corners: &'a [Vec3], shader: &'a Flat) -> Draw<'a> {
    quad(corners, corners, shader)
}
