//! Geometry as it stands at one time, seen from one place on the lens.

use glam::{Affine3A, Vec3};
use pipeline::geometry::Projection;
use pipeline::sampling::Sample;
use pipeline::setup::Corner;
use pipeline::{Camera, CameraError, Draw, DrawError, Geometry, Viewport};

/// Still meshes on the image plane of a pinhole, and the camera that leaves them there.
///
/// Vertices are projected, moved to their place at the time `t` and by the lens to where `(u, v)` sees them, each with the one
/// rounding that the sample test of a five-dimensional pass has. So where the lens is focused at infinity, or there is none, a
/// rendering of the snapshot equals the sample `(u, v, t)` of that pass bit for bit. (A lens with a focus moves the image of a
/// sample with depth, which is another order of rounding.)
pub struct Snapshot<'a> {
    meshes: Vec<Vec<Vec3>>,
    draws: Vec<Draw<'a>>,
    /// A pinhole that projects nothing: the meshes are on its image plane already.
    pub camera: Camera,
}

/// Why there is no snapshot.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the variants are the sources, documented there")]
pub enum SnapshotError {
    #[error(transparent)]
    Camera(#[from] CameraError),
    #[error(transparent)]
    Draw(#[from] DrawError),
}

impl<'a> Snapshot<'a> {
    /// What `camera` sees of `draws` on an image of the size of `viewport` at the time and place of `at`.
    ///
    /// # Errors
    /// When no camera can be made for such a viewport.
    pub fn new(
        camera: &Camera,
        draws: &[Draw<'a>],
        viewport: Viewport,
        at: &Sample,
    ) -> Result<Self, SnapshotError> {
        let projection = Projection::new(camera, viewport);
        let base = [at.u * projection.shear.s[0], at.v * projection.shear.s[1]];
        let place = |(open, close): (&Vec3, &Vec3)| {
            let [x, y, w] = Corner::new(&projection.vertex(*open, *close)).at(at.t);
            // In the image y points down, in the world up.
            Vec3::new(x - base[0], -(y - base[1]), w)
        };
        let mesh = |draw: &Draw<'a>| {
            draw.geometry.open().iter().zip(draw.geometry.close()).map(place).collect::<Vec<_>>()
        };
        // One scene unit at depth 1 is a pixel.
        let camera = Camera::new(Affine3A::IDENTITY, 0.5 * viewport.height() as f32, camera.near())?;
        Ok(Self { meshes: draws.iter().map(mesh).collect(), draws: draws.to_vec(), camera })
    }

    /// The still draws, in the order and with the triangles, shaders and faces of those they were made from.
    ///
    /// # Errors
    /// When a vertex has left the range of numbers.
    pub fn draws(&self) -> Result<Vec<Draw<'_>>, SnapshotError> {
        let pairs = self.meshes.iter().zip(&self.draws);
        let still = pairs.map(|(mesh, draw)| {
            Ok(Draw { geometry: Geometry::new(mesh, mesh, draw.geometry.triangles())?, ..*draw })
        });
        still.collect()
    }
}
