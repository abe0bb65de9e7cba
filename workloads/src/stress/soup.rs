//! Triangles strewn over the image whose blur is known in pixels, for measuring how cost grows.

use std::ops::Range;

use glam::DVec2;
use pipeline::{Geometry, LensShape, SampleTable, Viewport};

use super::easel::Easel;
use super::{PER_PIXEL, Size, StressError, StressScene};

/// Triangles of one size strewn over the image that together cover it so many times, however many they are: a scene cut
/// ever finer. Each moves straight and without turning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Soup {
    /// Size of the image, and how many triangles.
    pub size: Size,
    /// Area of all triangles over that of the image.
    pub layers: f64,
    /// Pixels that each moves across the image while the shutter is open.
    pub motion_px: f64,
    /// Diameter in pixels of the circle that the lens makes of the middle of a triangle, to within some per cent.
    pub defocus_px: f64,
}

/// Depths of triangles, far from where the lens is sharp: all are blurred alike.
const DEPTHS: Range<f64> = 9.0..11.0;
/// Depth at which the lens is sharp.
const FOCUS: f64 = 1.0;

impl Soup {
    /// The scene; `seed` decides where triangles are and where they go.
    ///
    /// # Errors
    /// When there is no image of that size or no lens of that blur.
    pub fn scene(&self, seed: u64) -> Result<StressScene, StressError> {
        let side = self.size.side_px;
        let viewport = Viewport::new(side, side).ok_or(StressError::Side(side))?;
        let samples = SampleTable::low_discrepancy(PER_PIXEL, seed, LensShape::Disk)?;
        let mut easel = Easel::new(self.size, viewport, samples, seed)?;
        // The blur at depth z over that at infinity is 1 - focus / z.
        let far = 1.0 - FOCUS / (0.5 * (DEPTHS.start + DEPTHS.end));
        easel.lens(0.5 * self.defocus_px / far, FOCUS)?;
        (0..self.size.triangles).for_each(|_| self.strew(&mut easel));
        let scene = easel.finish();
        Geometry::new(&scene.open, &scene.close, &scene.triangles)?;
        Ok(scene)
    }

    /// Side of a triangle in pixels; one with equal sides has the area sqrt(3)/4 side^2.
    fn side_px(&self) -> f64 {
        let image = f64::from(self.size.side_px);
        image * libm::sqrt(4.0 * self.layers / (libm::sqrt(3.0) * f64::from(self.size.triangles)))
    }

    fn strew(&self, easel: &mut Easel) {
        let (spot, half_way) = (easel.spot(), 0.5 * self.motion_px * easel.heading());
        let depth = easel.between(DEPTHS.start, DEPTHS.end);
        // As steep as a triangle turned anyhow is on the average, and always before the camera.
        let tilt = 0.5 * (self.side_px() / easel.scale()).min(1.0);
        let corners = easel.corners(self.side_px());
        let depths = [0, 1, 2].map(|_| depth * (1.0 + tilt * easel.between(-1.0, 1.0)));
        let at = |k: usize, shift: DVec2| easel.at(spot + corners[k] + shift, depths[k]);
        let (open, close) = ([0, 1, 2].map(|k| at(k, -half_way)), [0, 1, 2].map(|k| at(k, half_way)));
        easel.triangle(open, close);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    const SOUP: Soup =
        Soup { size: Size { side_px: 128, triangles: 200 }, layers: 4.0, motion_px: 24.0, defocus_px: 12.0 };

    /// Where a vertex is seen through a place on the lens, in pixels from the middle.
    fn seen(scene: &StressScene, vertex: glam::Vec3, lens: Vec2) -> Vec2 {
        let optics = scene.camera.lens().unwrap();
        let shift = lens * optics.radius() * (1.0 / vertex.z - 1.0 / optics.focus());
        64.0 * (vertex.truncate() / vertex.z - shift)
    }

    #[test]
    fn triangles_move_and_blur_by_as_many_pixels_as_asked_for() {
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
