//! Orthographic views of the light.

use glam::{Affine3A, DAffine3, DMat3, DVec3};
use pipeline::geometry::Projection;
use pipeline::{Camera, Cull, MovingVertex, Shear, Viewport};

use pipeline::setup::{SetupResult, Triangle, set_up};

use super::Beam;

/// An orthographic view.
#[derive(Clone, Copy, Debug)]
pub struct Eye {
    projection: Projection,
    viewport: Viewport,
    /// Pixels per metre.
    scale_px: f64,
    /// Transformation from view space to world space.
    pose: DAffine3,
}

/// A beam as the rasterizer sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// The beam in world space.
    pub world: Beam,
    /// The beam in pixels and depth, from the rasterizer's rounded coordinates.
    pub image: Beam,
    /// The moving triangle, from one end of the beam to the other.
    pub triangle: Triangle,
}

/// Distance of the near plane. The camera stands far behind the scene, so it clips nothing.
const NEAR: f32 = 1e-6;

impl Eye {
    /// A view from `from` at `target`, with `up` upwards in the image, and `half_height` metres above and
    /// below the centre. `None` if `from` equals `target`, `up` is parallel to the view, or a value is not
    /// finite and positive.
    pub fn new([from, target, up]: [DVec3; 3], half_height: f64, [width, height]: [u32; 2]) -> Option<Self> {
        let viewport = Viewport::new(width, height)?;
        let forward = (target - from).try_normalize()?;
        let right = forward.cross(up).try_normalize()?;
        let axes = DMat3::from_cols(right, right.cross(forward), forward).transpose();
        let pose = DAffine3 { matrix3: axes, translation: -(axes * from) };
        let rounded = Affine3A::from_cols_array(&pose.to_cols_array().map(|c| c as f32));
        let camera = Camera::orthographic(rounded, half_height as f32, NEAR).ok()?;
        let rounded = DAffine3::from_cols_array(&rounded.to_cols_array().map(f64::from));
        let scale_px = 0.5 * f64::from(height) / f64::from(half_height as f32);
        Some(Self {
            projection: Projection::new(&camera, viewport),
            viewport,
            scale_px,
            pose: rounded.inverse(),
        })
    }

    /// Image size.
    pub fn viewport(&self) -> Viewport {
        self.viewport
    }

    /// Pixels per metre.
    pub fn scale_px(&self) -> f64 {
        self.scale_px
    }

    /// Projection of vertices.
    pub(super) fn projection(&self) -> &Projection {
        &self.projection
    }

    /// Projection shear of the rasterizer.
    pub(super) fn shear(&self) -> &Shear {
        &self.projection.shear
    }

    /// Centre of a pixel, in pixels from the centre of the image.
    pub(super) fn pixel_centre(&self, [column, row]: [u32; 2]) -> [f64; 2] {
        let pixel_centre = |at: u32, side: u32| f64::from(at) + 0.5 - 0.5 * f64::from(side);
        [pixel_centre(column, self.viewport.width()), pixel_centre(row, self.viewport.height())]
    }

    /// World position of an image point at a depth.
    pub fn world(&self, [x, y]: [f64; 2], depth: f64) -> DVec3 {
        self.pose.transform_point3(DVec3::new(x / self.scale_px, -y / self.scale_px, depth))
    }

    /// Image position of a world point: pixels from the centre, and depth.
    pub fn image(&self, point: DVec3) -> DVec3 {
        let p = self.pose.inverse().transform_point3(point);
        DVec3::new(p.x * self.scale_px, -p.y * self.scale_px, p.z)
    }

    /// The beam in this view; `None` if it has no volume or reaches behind the camera.
    pub(super) fn see(&self, beam: &Beam) -> Option<Seen> {
        let vertices =
            [0, 1, 2].map(|k| self.projection.vertex(beam.open[k].as_vec3(), beam.close[k].as_vec3()));
        let [a, b, c]: [&MovingVertex; 3] = vertices.each_ref();
        let half_px = self.viewport.half_px();
        let SetupResult::Ready(triangle) = set_up(0, [a, b, c], Cull::None, self.shear(), NEAR, half_px)
        else {
            return None;
        };
        let ends = triangle.corners.map(|corner| {
            let [open, delta] = [corner.open, corner.delta].map(|p| DVec3::from_array(p.map(f64::from)));
            [open, open + delta]
        });
        let [open, close] = [0, 1].map(|end| ends.map(|corner| corner[end]));
        let in_front = open.iter().chain(&close).all(|p| p.z > f64::from(NEAR));
        in_front.then_some(Seen { world: *beam, image: Beam { open, close, flux_w: beam.flux_w }, triangle })
    }
}
