//! Input of a visibility run, from any file format.

use std::ops::Range;
use std::path::Path;

use glam::{Vec3, Vec4};
use pipeline::sampling::HashedSamples;
use pipeline::{Camera, Lane, LensShape, Shader, ShadingPoint, Viewport};
use warnings::Warning;

use super::camera::{View, fit};
use super::mesh::MovingMesh;
use crate::error::{LoadError, Source};
use crate::scene::measure::lens_leaves_view;
use crate::scene::{CameraSpec, Wrong};

/// Moving triangles in camera space (x right, y up, z forward), with camera and sampling.
#[derive(Clone, Debug)]
pub struct VisibilityScene {
    /// Size of the image.
    pub viewport: Viewport,
    /// Samples per pixel.
    pub per_pixel: u32,
    /// Seed of hashed samples.
    pub seed: u64,
    /// The camera at the origin of its own space; a pinhole if the lens radius is zero.
    pub camera: Camera,
    /// Shape of the aperture.
    pub shape: LensShape,
    /// Vertices at shutter open.
    pub open: Vec<Vec3>,
    /// Vertices at shutter close.
    pub close: Vec<Vec3>,
    /// Vertex indices of each triangle, all in range.
    pub triangles: Vec<[u32; 3]>,
    /// Triangle range of each object, in order; one object for formats without objects.
    pub objects: Vec<Range<u32>>,
    /// The fitted camera, if none was given.
    pub fitted: Option<CameraSpec>,
    /// Warnings about the scene.
    pub warnings: Vec<Warning>,
}

/// Meshes with the file that messages name.
pub(super) struct Subject<'a> {
    /// File of the meshes.
    pub path: &'a Path,
    /// The objects.
    pub objects: Vec<MovingMesh>,
}

impl VisibilityScene {
    /// Hashed samples with the scene's seed; `None` if their number is out of range.
    pub fn hashed_samples(&self) -> Option<HashedSamples> {
        HashedSamples::new(self.seed, self.viewport.width(), self.per_pixel, self.shape)
    }

    /// `subject` in a camera's space; the camera is fitted if it has no pose.
    pub(super) fn from_subject(subject: Subject<'_>, spec: &CameraSpec) -> Result<Self, LoadError> {
        let source = Source { path: subject.path };
        let (mesh, objects) =
            joined(subject.objects).map_err(|message| source.broken("triangles", message))?;
        let (placed, warnings) = if spec.is_placed() {
            (spec.completed(), Vec::new())
        } else {
            let message = "there are no triangles of usable size to fit a camera to: give one with --camera";
            let (placed, holds_lens) = fit(spec, &mesh).ok_or_else(|| source.broken("triangles", message))?;
            (placed, if holds_lens { Vec::new() } else { vec![lens_leaves_view()] })
        };
        let unusable = |(place, message): Wrong| source.broken(format!("camera: {place}"), message);
        let view = placed.stands_and_image().map_err(unusable)?;
        let [open, close] =
            in_camera_space(&view, &mesh).map_err(|message| source.broken("vertices", message))?;
        Ok(Self {
            viewport: view.viewport,
            per_pixel: placed.samples_per_pixel(),
            seed: placed.sample_seed(),
            camera: view.camera,
            shape: placed.shape(),
            open,
            close,
            triangles: mesh.triangles,
            objects,
            fitted: (!spec.is_placed()).then_some(placed),
            warnings,
        })
    }
}

/// Joins all objects to one mesh, with the triangle range of each.
fn joined(objects: Vec<MovingMesh>) -> Result<(MovingMesh, Vec<Range<u32>>), String> {
    let mut ranges = Vec::with_capacity(objects.len());
    let count = |length: usize| {
        u32::try_from(length)
            .map_err(|_| "there are more than 2^32 in all objects; make fewer of them".to_owned())
    };
    let mut whole = MovingMesh::default();
    for object in objects {
        let (first, start) = (count(whole.open.len())?, count(whole.triangles.len())?);
        count(whole.open.len() + object.open.len())?;
        whole.open.extend(object.open);
        whole.close.extend(object.close);
        whole.triangles.extend(object.triangles.iter().map(|corners| corners.map(|vertex| first + vertex)));
        ranges.push(start..count(whole.triangles.len())?);
    }
    Ok((whole, ranges))
}

/// Vertices in camera space at both ends, rounded once. A still vertex and a still camera stay exactly still.
fn in_camera_space(view: &View, mesh: &MovingMesh) -> Result<[Vec<Vec3>; 2], String> {
    let [open, close] = &view.stands;
    let see = |(stand, points): (&crate::scene::camera::CameraFrame, &[glam::DVec3])| {
        let seen = points.iter().enumerate().map(|(vertex, point)| {
            let seen = stand.view(*point).as_vec3();
            let far =
                || format!("vertex {vertex} at {point} is out of the range of numbers here: scale the mesh");
            if seen.is_finite() { Ok(seen) } else { Err(far()) }
        });
        seen.collect::<Result<Vec<_>, _>>()
    };
    Ok([see((open, &mesh.open))?, see((close, &mesh.close))?])
}

/// A shader without cost, for visibility alone.
#[derive(Clone, Copy, Debug)]
pub struct Unshaded;

impl Shader for Unshaded {
    fn shade(&self, _lane: &Lane, _at: &ShadingPoint, _texel: Vec4) -> Vec4 {
        Vec4::ZERO
    }
}
