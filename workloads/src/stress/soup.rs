//! Random triangles with a known blur in pixels, for measuring how the cost grows.

use std::ops::Range;

use glam::DVec2;
use pipeline::{Geometry, LensShape, SampleTable, Viewport};

use super::builder::SceneBuilder;
use super::{PER_PIXEL, Size, StressError, StressScene};

/// Random triangles of one size that together cover the image a given number of times, whatever their count.
/// Each is translated linearly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Soup {
    /// Image size and number of triangles.
    pub size: Size,
    /// Total area of the triangles, relative to the image.
    pub layers: f64,
    /// Motion across the image during the shutter, in pixels.
    pub motion_px: f64,
    /// Diameter in pixels of the circle of confusion at the middle of a triangle, within a few per cent.
    pub defocus_px: f64,
}

/// Depths of triangles, far behind the focus so that all have a similar blur.
const DEPTHS: Range<f64> = 9.0..11.0;
/// Focus depth.
const FOCUS: f64 = 1.0;

impl Soup {
    /// Makes the scene; `seed` determines positions and directions.
    ///
    /// # Errors
    /// [`StressError`] for an invalid image size or lens.
    pub fn scene(&self, seed: u64) -> Result<StressScene, StressError> {
        let side = self.size.side_px;
        let viewport = Viewport::new(side, side).ok_or(StressError::Side(side))?;
        let samples = SampleTable::low_discrepancy(PER_PIXEL, seed, LensShape::Disk)?;
        let mut builder = SceneBuilder::new(self.size, viewport, samples, seed)?;
        // The blur at depth z relative to that at infinity is 1 - focus / z.
        let blur_share = 1.0 - FOCUS / (0.5 * (DEPTHS.start + DEPTHS.end));
        builder.lens(0.5 * self.defocus_px / blur_share, FOCUS)?;
        (0..self.size.triangles).for_each(|_| self.add_triangle(&mut builder));
        let scene = builder.finish();
        Geometry::new(&scene.open, &scene.close, &scene.triangles)?;
        Ok(scene)
    }

    /// Side of a triangle in pixels; the area of an equilateral one is sqrt(3)/4 side^2.
    fn side_px(&self) -> f64 {
        let image = f64::from(self.size.side_px);
        image * libm::sqrt(4.0 * self.layers / (libm::sqrt(3.0) * f64::from(self.size.triangles)))
    }

    fn add_triangle(&self, builder: &mut SceneBuilder) {
        let (position, half_way) = (builder.position(), 0.5 * self.motion_px * builder.direction());
        let depth = builder.between(DEPTHS.start, DEPTHS.end);
        // The mean tilt of a randomly rotated triangle, limited to stay in front of the camera.
        let tilt = 0.5 * (self.side_px() / builder.scale()).min(1.0);
        let corners = builder.corners(self.side_px());
        let depths = [0, 1, 2].map(|_| depth * (1.0 + tilt * builder.between(-1.0, 1.0)));
        let at = |k: usize, shift: DVec2| builder.at(position + corners[k] + shift, depths[k]);
        let (open, close) = ([0, 1, 2].map(|k| at(k, -half_way)), [0, 1, 2].map(|k| at(k, half_way)));
        builder.triangle(open, close);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    const SOUP: Soup =
        Soup { size: Size { side_px: 128, triangles: 200 }, layers: 4.0, motion_px: 24.0, defocus_px: 12.0 };

    /// Image position of a vertex through a lens position, in pixels from the centre.
    fn seen(scene: &StressScene, vertex: glam::Vec3, lens: Vec2) -> Vec2 {
        let optics = scene.camera.lens().unwrap();
        let shift = lens * optics.radius() * (1.0 / vertex.z - 1.0 / optics.focus());
        64.0 * (vertex.truncate() / vertex.z - shift)
    }

    #[test]
    fn triangles_move_and_blur_as_requested() {
        let scene = SOUP.scene(7).unwrap();
        for (open, close) in scene.open.iter().zip(&scene.close) {
            let moved = seen(&scene, *close, Vec2::ZERO) - seen(&scene, *open, Vec2::ZERO);
            assert!((moved.length() - 24.0).abs() < 1e-2, "{moved}");
        }
        for corners in &scene.triangles {
            let corners = corners.map(|corner| scene.open[corner as usize]);
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            let blur = seen(&scene, middle, Vec2::X) - seen(&scene, middle, Vec2::NEG_X);
            assert!((blur.length() / 12.0 - 1.0).abs() < 0.05, "{blur}");
        }
    }

    #[test]
    fn more_triangles_cover_as_much() {
        for triangles in [50, 800] {
            let soup = Soup { size: Size { triangles, ..SOUP.size }, ..SOUP };
            let scene = soup.scene(7).unwrap();
            let area = |corners: &[u32; 3]| {
                let [a, b, c] = corners.map(|corner| seen(&scene, scene.open[corner as usize], Vec2::ZERO));
                f64::from(0.5 * (b - a).perp_dot(c - a).abs())
            };
            let layers = scene.triangles.iter().map(area).sum::<f64>() / (128.0 * 128.0);
            assert!((layers - 4.0).abs() < 1e-3, "{layers}");
        }
    }

    #[test]
    fn without_blur_there_is_neither_lens_nor_motion() {
        let scene = Soup { motion_px: 0.0, defocus_px: 0.0, ..SOUP }.scene(7).unwrap();
        assert!(scene.camera.lens().is_none() && scene.open == scene.close);
    }
}
