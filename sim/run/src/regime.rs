//! Triangles of a frame in the regimes of the failure catalogue, where tile tests are known to pay little.

use glam::Vec3;
use pipeline::geometry::Projection;
use pipeline::setup::{Triangle, bounds};
use pipeline::{Camera, Draw, Viewport};
use workloads::scene::NearSpace;
use workloads::stress::set_up_all;

/// How many triangles of a frame are in each regime. One may be in several.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Regime {
    /// Triangles that set-up lets pass and whose box meets the image.
    pub in_view: u64,
    /// Those that reach to the camera plane or behind it, so that their box is the whole image.
    pub behind: u64,
    /// Those whose image at both ends of the shutter is smaller than the spacing of samples.
    pub tiny: u64,
    /// Those whose image is a hundred times as long as high when the shutter opens.
    pub slivers: u64,
    /// Those with a vertex that moves by more than the longer side of the image.
    pub fast: u64,
    /// Those out of focus by more than the longer side of the image.
    pub blurred: u64,
    /// Those so far or so near that products of their coordinates leave the range of f32.
    pub extreme: u64,
    /// Those with a corner in view where a step of 32-bit coordinates is coarse for the pixels.
    pub coarse: u64,
    /// Triangles in view and in front of the camera that are nearer than the near plane, as a whole or in part.
    pub cut: u64,
}

/// A triangle this many times as long as high is a sliver.
const SLIVER: f64 = 100.0;
/// Products of three lengths beyond these lose digits or overflow in f32.
const PRODUCTS: [f64; 2] = [1e-36, 1e37];
/// A step of 32-bit coordinates is coarse from so many pixels on.
const COARSE_PX: f64 = 0.25;

impl Regime {
    /// Of a frame with `per_pixel` samples in each pixel.
    pub fn of(camera: &Camera, draws: &[Draw<'_>], viewport: Viewport, per_pixel: u32) -> Self {
        let shear = Projection::new(camera, viewport).shear;
        let look = Look::new(camera, viewport, per_pixel);
        let mut found = Self { cut: cut(camera, draws, viewport), ..Self::default() };
        let mut corners = corners(draws);
        let mut next = 0;
        for triangle in set_up_all(camera, draws, viewport) {
            let world = corners.nth((triangle.id - next) as usize).map(|(_, ends)| ends);
            next = triangle.id + 1;
            if !bounds(&triangle, &shear, viewport).is_empty() {
                found.add(&triangle, &world.unwrap_or_default(), &look);
            }
        }
        found
    }

    fn add(&mut self, triangle: &Triangle, world: &[[Vec3; 3]; 2], look: &Look) {
        let seen = [0.0, 1.0].map(|t| triangle.corners.map(|c| c.at(t).map(f64::from)));
        self.in_view += 1;
        self.extreme += u64::from(look.is_extreme(&seen));
        if seen.as_flattened().iter().any(|p| look.weight(p[2]) <= 0.0) {
            self.behind += 1;
            return;
        }
        let image = seen.map(|corners| corners.map(|[x, y, w]| [x, y].map(|c| c / look.weight(w))));
        self.tiny += u64::from(image.iter().all(|corners| look.is_tiny(corners)));
        self.slivers += u64::from(!look.is_tiny(&image[0]) && is_sliver(&image[0]));
        let way = |k: usize| distance(image[0][k], image[1][k]);
        self.fast += u64::from((0..3).any(|k| way(k) > look.side_px));
        self.blurred += u64::from(seen.as_flattened().iter().all(|p| look.blur_px(p[2]) > look.side_px));
        let depths = seen.as_flattened().iter().map(|p| p[2]);
        let places = image.as_flattened().iter().zip(world.as_flattened());
        self.coarse += u64::from(depths.zip(places).any(|(depth, place)| look.is_coarse(depth, place)));
    }
}

/// The corners of every triangle in world space when the shutter opens and when it closes, in the order of set-up.
fn corners<'a>(draws: &'a [Draw<'a>]) -> impl Iterator<Item = (&'a Draw<'a>, [[Vec3; 3]; 2])> {
    let of_draw = |draw: &'a Draw<'a>| {
        let ends = [draw.geometry.open(), draw.geometry.close()];
        let at = move |triangle: &[u32; 3]| ends.map(|end| triangle.map(|vertex| end[vertex as usize]));
        draw.geometry.triangles().iter().map(move |triangle| (draw, at(triangle)))
    };
    draws.iter().flat_map(of_draw)
}

/// How many triangles in view the near plane cuts, or hides.
fn cut(camera: &Camera, draws: &[Draw<'_>], viewport: Viewport) -> u64 {
    let aspect = f64::from(viewport.width()) / f64::from(viewport.height());
    let space = NearSpace::new(camera, aspect, f64::from(camera.near()));
    let nearest = |(draw, [open, close]): (&Draw<'_>, [[Vec3; 3]; 2])| space.nearest(open, close, draw.cull);
    corners(draws).filter_map(nearest).count() as u64
}

/// What decides the regime of a triangle besides itself.
struct Look {
    spacing_px: f64,
    side_px: f64,
    lens: pipeline::Shear,
    /// Pixels of a scene unit at depth 1, or at any depth of an orthographic view.
    scale_px: f64,
    /// Half of the width and height of the image.
    half_px: [f64; 2],
    /// The largest coordinate of the camera.
    eye: f32,
}

impl Look {
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

    /// Whether a corner, which has a place on the image and one in the world, is in view and may only move there in large steps.
    fn is_coarse(&self, depth: f64, (image, world): (&[f64; 2], &Vec3)) -> bool {
        let largest = world.abs().max_element().max(self.eye);
        let step_px = f64::from(largest.next_up() - largest) * self.scale_px / self.weight(depth);
        step_px > COARSE_PX && image.iter().zip(self.half_px).all(|(at, half)| at.abs() <= half)
    }

    fn is_tiny(&self, corners: &[[f64; 2]; 3]) -> bool {
        (0..3).all(|k| distance(corners[k], corners[(k + 1) % 3]) < self.spacing_px)
    }

    /// The radius of the circle of confusion at depth `w`.
    fn blur_px(&self, w: f64) -> f64 {
        self.lens.circle(0, w).abs()
    }

    /// What a place on the image is multiplied with for a vertex at this depth.
    fn weight(&self, depth: f64) -> f64 {
        if self.lens.parallel { 1.0 } else { depth }
    }

    /// Whether the product of an edge and a depth, both as a sample may see them, leaves the range.
    fn is_extreme(&self, seen: &[[[f64; 3]; 3]; 2]) -> bool {
        let largest = |axis: usize| seen.as_flattened().iter().map(|p| p[axis].abs()).fold(0.0, f64::max);
        let (w, half) = (largest(2), 0.5 * self.side_px * self.weight(largest(2)));
        let edge = 2.0 * (largest(0) + half) * (largest(1) + half);
        edge * w > PRODUCTS[1] || w * self.weight(w) * self.weight(w) < PRODUCTS[0]
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(a[0] - b[0], a[1] - b[1])
}

/// Whether the longest side is so many times the height above it.
fn is_sliver(corners: &[[f64; 2]; 3]) -> bool {
    let [a, b, c] = corners;
    let twice_area = ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])).abs();
    let longest = (0..3).map(|k| distance(corners[k], corners[(k + 1) % 3])).fold(0.0, f64::max);
    longest * longest > SLIVER * twice_area
}

#[cfg(test)]
mod tests {
    use super::*;
    use workloads::stress::{PER_PIXEL, Size, family};
    use workloads::visibility::Unshaded;

    /// The share of triangles in a regime, of a family at one of its values.
    fn share(name: &str, value: f64, of: fn(&Regime) -> u64) -> f64 {
        let size = Size { side_px: 64, triangles: 200 };
        let scene = family(name).unwrap().scene(value, size, 1).unwrap();
        let draws = [scene.draw(&Unshaded).unwrap()];
        let regime = Regime::of(&scene.camera, &draws, scene.viewport, PER_PIXEL);
        assert!(regime.in_view > 50, "{name}: {regime:?}");
        of(&regime) as f64 / regime.in_view as f64
    }

    #[test]
    fn families_are_in_their_regimes_at_one_end_and_not_at_the_other() {
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
