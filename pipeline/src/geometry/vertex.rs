//! From world space to the homogeneous image plane.

use glam::{DAffine3, DVec3, Vec3};

use rayon::prelude::*;

use super::{Camera, Geometry};

/// The size of an image in pixels; both sides are 1 to 16384.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Viewport {
    width: u32,
    height: u32,
}

impl Viewport {
    /// The longest side an image may have, in pixels.
    pub const MAX_PX: u32 = 16_384;

    /// A viewport of `width` x `height` pixels, or `None` when a side is zero or above [`Self::MAX_PX`].
    pub fn new(width: u32, height: u32) -> Option<Self> {
        let fits = |side| (1..=Self::MAX_PX).contains(&side);
        (fits(width) && fits(height)).then_some(Self { width, height })
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Half the size in pixels: the largest |X| and |Y| of an image coordinate.
    pub fn half_px(&self) -> [f32; 2] {
        [0.5 * self.width as f32, 0.5 * self.height as f32]
    }

    /// Pixels of the image.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The image coordinate of the left edge of pixel column `px` (or the top edge of row `px` when given the
    /// height): the origin is the centre of the image, whatever the tile size, and the value is exact.
    pub(crate) fn edge(px: u32, side: u32) -> f32 {
        px as f32 - 0.5 * side as f32
    }
}

/// A vertex on the homogeneous image plane at both ends of the shutter, as `[x, y, w]`: its image is at
/// `(x / w, y / w)` pixels from the centre of the image, `y` downwards, and `w` is its depth in scene units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingVertex {
    /// When the shutter opens.
    pub open: [f32; 3],
    /// When the shutter closes.
    pub close: [f32; 3],
}

impl MovingVertex {
    /// Whether both ends agree to the last bit.
    pub fn is_still(&self) -> bool {
        self.open == self.close
    }
}

/// The shear of a thin lens: a point at depth `w` seen from `(u, v)` of the lens moves by `u (a.x w - s.x)` and
/// `v (a.y w - s.y)` on the homogeneous image plane. `s` is projection scale times lens radius and `a = s / F`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shear {
    /// Projection scale times lens radius, pixels times scene units.
    pub s: [f32; 2],
    /// `s` over the focus depth, pixels.
    pub a: [f32; 2],
}

impl Shear {
    /// Whether the camera is a pinhole, so that the lens dimensions can be dropped.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// A camera fitted to a viewport. Works in `f64` and rounds once, so that equal input gives equal vertices.
#[derive(Clone, Copy, Debug)]
pub struct Projection {
    open: DAffine3,
    close: DAffine3,
    scale_px: f64,
    shift_px: [f64; 2],
    /// The shear of the lens, nothing for a pinhole.
    pub shear: Shear,
    /// Depth in scene units below which samples are not seen.
    pub near: f32,
}

impl Projection {
    /// The projection of `camera` onto an image of the size of `viewport`.
    pub fn new(camera: &Camera, viewport: Viewport) -> Self {
        let height = f64::from(viewport.height);
        let scale_px = 0.5 * height / f64::from(camera.tan_half_height());
        let shear = camera.lens().map_or(Shear::default(), |lens| {
            let s = scale_px * f64::from(lens.radius());
            let a = s / f64::from(lens.focus());
            // v points up on the lens and y down in the image.
            Shear { s: [s as f32, -s as f32], a: [a as f32, -a as f32] }
        });
        Self {
            open: widen(camera.open()),
            close: widen(camera.close()),
            scale_px,
            shift_px: camera.shift().to_array().map(|shift| f64::from(shift) * height),
            shear,
            near: camera.near(),
        }
    }

    /// The image of a vertex that is at `open` and `close`, in world space, at the ends of the shutter.
    pub fn vertex(&self, open: Vec3, close: Vec3) -> MovingVertex {
        MovingVertex { open: self.image(&self.open, open), close: self.image(&self.close, close) }
    }

    /// The images of all vertices of `geometry`.
    pub(crate) fn images(&self, geometry: &Geometry<'_>) -> Vec<MovingVertex> {
        if self.open == self.close && std::ptr::eq(geometry.open(), geometry.close()) {
            let still = |&world: &Vec3| {
                let open = self.image(&self.open, world);
                MovingVertex { open, close: open }
            };
            return geometry.open().par_iter().with_min_len(1024).map(still).collect();
        }
        geometry
            .open()
            .par_iter()
            .zip(geometry.close())
            .with_min_len(1024)
            .map(|(&open, &close)| self.vertex(open, close))
            .collect()
    }

    fn image(&self, pose: &DAffine3, world: Vec3) -> [f32; 3] {
        let p = pose.transform_point3(DVec3::from(world));
        let x = self.scale_px * p.x + self.shift_px[0] * p.z;
        let y = -self.scale_px * p.y + self.shift_px[1] * p.z;
        [x as f32, y as f32, p.z as f32]
    }

    /// The position of the camera in world space at mid-shutter.
    pub fn eye(&self) -> Vec3 {
        let at = |pose: &DAffine3| pose.inverse().translation;
        (0.5 * (at(&self.open) + at(&self.close))).as_vec3()
    }
}

fn widen(pose: glam::Affine3A) -> DAffine3 {
    DAffine3::from_cols_array(&pose.to_cols_array().map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Lens;
    use glam::Affine3A;

    #[test]
    fn the_corner_of_the_view_is_the_corner_of_the_image() {
        let camera = Camera::new(Affine3A::IDENTITY, 0.5, 0.1).unwrap();
        let projection = Projection::new(&camera, Viewport::new(400, 200).unwrap());
        let [x, y, w] = projection.vertex(Vec3::new(2.0, 1.0, 2.0), Vec3::ZERO).open;
        assert_eq!((x / w, y / w, w), (200.0, -100.0, 2.0));
    }

    #[test]
    fn a_lens_does_not_move_what_is_in_focus() {
        let lens = Lens::new(0.25, 8.0).unwrap();
        let camera = Camera::new(Affine3A::IDENTITY, 1.0, 0.1).unwrap().with_lens(Some(lens));
        let shear = Projection::new(&camera, Viewport::new(512, 512).unwrap()).shear;
        assert_eq!(shear.a[0] * 8.0 - shear.s[0], 0.0);
        assert!(shear.s[0] > 0.0 && shear.s[1] < 0.0);
    }

    #[test]
    fn viewports_have_an_area() {
        assert!(Viewport::new(0, 4).is_none());
        assert!(Viewport::new(4, 16_385).is_none());
        assert_eq!(Viewport::new(3, 5).unwrap().pixels(), 15);
    }
}
