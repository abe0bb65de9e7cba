//! Numbers of triangles in the regimes of the failure catalogue, where tile tests are ineffective.

use glam::Vec3;
use pipeline::geometry::Projection;
use pipeline::setup::{Triangle, bounds};
use pipeline::{Camera, Draw, Viewport};

use crate::scene::NearSpace;
use crate::stress::set_up_all;

/// Number of triangles of a frame in each regime. A triangle may be in several.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Regime {
    /// Triangles that pass set-up and whose bounding box overlaps the image.
    pub in_view: u64,
    /// Triangles that reach the camera plane or go behind it. Their bounding box is the whole image.
    pub behind: u64,
    /// Triangles whose image is smaller than the sample spacing at both ends of the shutter.
    pub tiny: u64,
    /// Triangles whose image is a hundred times as long as high when the shutter opens.
    pub slivers: u64,
    /// Triangles with a vertex that moves by more than the longer side of the image.
    pub fast: u64,
    /// Triangles with a circle of confusion above the longer side of the image.
    pub blurred: u64,
    /// Triangles whose products of coordinates leave the range of f32.
    pub extreme: u64,
    /// Triangles with a corner in view where one step of 32-bit coordinates exceeds a quarter of a pixel.
    pub coarse: u64,
    /// Triangles in front of the camera and in view that the near plane cuts off, as a whole or in part.
    pub cut: u64,
}

/// Smallest ratio of length to height of a sliver.
const MIN_SLIVER_RATIO: f64 = 100.0;
/// Range of products of three lengths that keep all digits in f32.
const F32_PRODUCT_RANGE: [f64; 2] = [1e-36, 1e37];
/// Largest step of 32-bit coordinates in pixels that is accurate enough.
const MAX_STEP_PX: f64 = 0.25;

impl Regime {
    /// Counts the triangles of a frame with `per_pixel` samples per pixel.
    pub fn of(camera: &Camera, draws: &[Draw<'_>], viewport: Viewport, per_pixel: u32) -> Self {
        let shear = Projection::new(camera, viewport).shear;
        let scale = ImageScale::new(camera, viewport, per_pixel);
        let mut found = Self { cut: cut(camera, draws, viewport), ..Self::default() };
        let mut corners = corners(draws);
        let mut next = 0;
        for triangle in set_up_all(camera, draws, viewport) {
            let world = corners.nth((triangle.id - next) as usize).map(|(_, ends)| ends);
            next = triangle.id + 1;
            if !bounds(&triangle, &shear, viewport).is_empty() {
                found.add(&triangle, &world.unwrap_or_default(), &scale);
            }
        }
        found
    }

    fn add(&mut self, triangle: &Triangle, world: &[[Vec3; 3]; 2], scale: &ImageScale) {
        let seen = [0.0, 1.0].map(|t| triangle.corners.map(|c| c.at(t).map(f64::from)));
        self.in_view += 1;
        self.extreme += u64::from(scale.is_extreme(&seen));
        if seen.as_flattened().iter().any(|p| scale.weight(p[2]) <= 0.0) {
            self.behind += 1;
            return;
        }
        let image = seen.map(|corners| corners.map(|[x, y, w]| [x, y].map(|c| c / scale.weight(w))));
        self.tiny += u64::from(image.iter().all(|corners| scale.is_tiny(corners)));
        self.slivers += u64::from(!scale.is_tiny(&image[0]) && is_sliver(&image[0]));
        let way = |k: usize| distance(image[0][k], image[1][k]);
        self.fast += u64::from((0..3).any(|k| way(k) > scale.side_px));
        self.blurred += u64::from(seen.as_flattened().iter().all(|p| scale.blur_px(p[2]) > scale.side_px));
        let depths = seen.as_flattened().iter().map(|p| p[2]);
        let places = image.as_flattened().iter().zip(world.as_flattened());
        self.coarse += u64::from(depths.zip(places).any(|(depth, place)| scale.is_coarse(depth, place)));
    }
}

/// Corners of every triangle in world space at both ends of the shutter, in the order of set-up.
fn corners<'a>(draws: &'a [Draw<'a>]) -> impl Iterator<Item = (&'a Draw<'a>, [[Vec3; 3]; 2])> {
    let of_draw = |draw: &'a Draw<'a>| {
        let ends = [draw.geometry.open(), draw.geometry.close()];
        let at = move |triangle: &[u32; 3]| ends.map(|end| triangle.map(|vertex| end[vertex as usize]));
        draw.geometry.triangles().iter().map(move |triangle| (draw, at(triangle)))
    };
    draws.iter().flat_map(of_draw)
}

/// Number of triangles in view that the near plane cuts off, as a whole or in part.
fn cut(camera: &Camera, draws: &[Draw<'_>], viewport: Viewport) -> u64 {
    let aspect = f64::from(viewport.width()) / f64::from(viewport.height());
    let space = NearSpace::new(camera, aspect, f64::from(camera.near()));
    let nearest =
        |(draw, [open, close]): (&Draw<'_>, [[Vec3; 3]; 2])| space.nearest(open, close, draw.state.cull);
    corners(draws).filter_map(nearest).count() as u64
}

/// Image scale that regimes are relative to.
struct ImageScale {
    spacing_px: f64,
    side_px: f64,
    lens: pipeline::Shear,
    /// Pixels per scene unit at depth 1, or at any depth for an orthographic camera.
    scale_px: f64,
    /// Half the width and height of the image in pixels.
    half_px: [f64; 2],
    /// Largest absolute coordinate of the camera position.
    eye: f32,
}

impl ImageScale {
    fn new(camera: &Camera, viewport: Viewport, per_pixel: u32) -> Self {
        let [width, height] = [viewport.width(), viewport.height()].map(f64::from);
        Self {
            spacing_px: (1.0 / f64::from(per_pixel)).sqrt(),
            side_px: width.max(height),
            lens: Projection::new(camera, viewport).shear,
            scale_px: 0.5 * height / f64::from(camera.half_height()),
            half_px: [0.5 * width, 0.5 * height],
            eye: camera.open().translation.abs().max_element(),
        }
    }

    /// Whether a corner, with its positions on the image and in the world, is in view and one step of its
    /// coordinates exceeds [`MAX_STEP_PX`].
    fn is_coarse(&self, depth: f64, (image, world): (&[f64; 2], &Vec3)) -> bool {
        let largest = world.abs().max_element().max(self.eye);
        let step_px = f64::from(largest.next_up() - largest) * self.scale_px / self.weight(depth);
        step_px > MAX_STEP_PX && image.iter().zip(self.half_px).all(|(at, half)| at.abs() <= half)
    }

    fn is_tiny(&self, corners: &[[f64; 2]; 3]) -> bool {
        (0..3).all(|k| distance(corners[k], corners[(k + 1) % 3]) < self.spacing_px)
    }

    /// Radius of the circle of confusion at depth `w`, in pixels.
    fn blur_px(&self, w: f64) -> f64 {
        self.lens.circle(0, w).abs()
    }

    /// Homogeneous weight of a vertex at this depth: 1 for an orthographic camera.
    fn weight(&self, depth: f64) -> f64 {
        if self.lens.parallel { 1.0 } else { depth }
    }

    /// Whether the product of an edge and a depth leaves the range, for any lens position and time.
    fn is_extreme(&self, seen: &[[[f64; 3]; 3]; 2]) -> bool {
        let largest = |axis: usize| seen.as_flattened().iter().map(|p| p[axis].abs()).fold(0.0, f64::max);
        let (w, half) = (largest(2), 0.5 * self.side_px * self.weight(largest(2)));
        let edge = 2.0 * (largest(0) + half) * (largest(1) + half);
        edge * w > F32_PRODUCT_RANGE[1] || w * self.weight(w) * self.weight(w) < F32_PRODUCT_RANGE[0]
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(a[0] - b[0], a[1] - b[1])
}

/// Whether the longest side is at least [`MIN_SLIVER_RATIO`] times the height above it.
fn is_sliver(corners: &[[f64; 2]; 3]) -> bool {
    let [a, b, c] = corners;
    let twice_area = ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])).abs();
    let longest = (0..3).map(|k| distance(corners[k], corners[(k + 1) % 3])).fold(0.0, f64::max);
    longest * longest > MIN_SLIVER_RATIO * twice_area
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stress::{PER_PIXEL, Size, family};
    use crate::visibility::Unshaded;

    /// Share of triangles in a regime, of a stress family at one value.
    fn share(name: &str, value: f64, of: fn(&Regime) -> u64) -> f64 {
        let size = Size { side_px: 64, triangles: 200 };
        let scene = family(name).unwrap().scene(value, size, 1).unwrap();
        let draws = [scene.draw(&Unshaded).unwrap()];
        let regime = Regime::of(&scene.camera, &draws, scene.viewport, PER_PIXEL);
        assert!(regime.in_view > 50, "{name}: {regime:?}");
        of(&regime) as f64 / regime.in_view as f64
    }

    #[test]
    fn stress_families_reach_their_regimes_at_one_end_only() {
        type Case = (&'static str, f64, f64, fn(&Regime) -> u64);
        let cases: [Case; 6] = [
            ("slivers", 1.0, 1e4, |regime| regime.slivers),
            ("behind", 1.0, -1.0, |regime| regime.behind),
            ("micro", 0.1, 10.0, |regime| regime.tiny),
            ("speed", 0.1, 10.0, |regime| regime.fast),
            ("large-lens", 0.1, 1e4, |regime| regime.blurred),
            ("scale", 1e6, 1e15, |regime| regime.extreme),
        ];
        for (name, harmless, hopeless, of) in cases {
            let shares = [harmless, hopeless].map(|value| share(name, value, of));
            assert!(shares[0] < 0.01 && shares[1] > 0.9, "{name}: {shares:?}");
        }
        assert!(share("scale", 1e-15, |regime| regime.extreme) > 0.9);
    }
}
