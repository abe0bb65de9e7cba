//! Accumulation buffering (Haeberli and Akeley 1990): the mean of many pinhole renderings of still geometry.
//! It is the method that one 5D pass is compared with.
//!
//! - [`SharedSamples`]: the same samples in all pixels, which accumulation requires.
//! - [`Snapshot`]: moving geometry at one time and one lens position, for a rendering without either.
//! - [`pinhole`]: the camera at one lens position.
//! - [`RayCaster`]: ray casting, as the ground truth of visibility and as a rival.

use glam::{Affine3A, DVec3, Vec2, Vec3};
use pipeline::geometry::Projection;
use pipeline::sampling::{Pattern, Sample, SampleSource, SampleSpec, SampleTableError, TimedBlock};
use pipeline::setup::Corner;
use pipeline::{Camera, CameraError, Clip, Draw, DrawError, Geometry, Lane, SampleTable, Viewport};

pub use crate::bvh::RayWork;
use crate::bvh::{Bvh, Ray, bounds_of};

/// A triangle in world space, at both ends of the shutter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// Corners at shutter open and at shutter close.
    pub ends: [[Vec3; 3]; 2],
    /// Index of its draw.
    pub draw: usize,
}

impl Face {
    /// Corners at time `t`.
    pub fn at(&self, t: f32) -> [DVec3; 3] {
        self.at_on(&Lane::default(), t, false)
    }

    /// The same, computed on a lane. Corners of a draw that is still are not moved.
    pub fn at_on(&self, lane: &Lane, t: f32, is_still: bool) -> [DVec3; 3] {
        let [open, close] = self.ends.map(|end| end.map(|corner| corner.as_dvec3()));
        if is_still {
            return open;
        }
        let t = DVec3::splat(f64::from(t));
        std::array::from_fn(|k| lane.madd(t, lane.sub(close[k], open[k]), open[k]))
    }
}

/// Moving triangles for ray casting, numbered as in a pass, in a bounding volume hierarchy.
#[derive(Clone, Debug, Default)]
pub struct RayCaster {
    faces: Vec<Face>,
    tree: Bvh,
    /// Clip planes of each draw.
    clips: Vec<Clip>,
}

impl RayCaster {
    /// The triangles of `draws`.
    pub fn new(draws: &[Draw<'_>]) -> Self {
        let faces = draws.iter().enumerate().flat_map(|(draw, of)| {
            let geometry = of.geometry;
            let ends = move |corners: &[u32; 3]| {
                [geometry.open(), geometry.close()].map(|end| corners.map(|vertex| end[vertex as usize]))
            };
            geometry.triangles().iter().map(move |corners| Face { ends: ends(corners), draw })
        });
        Self::of(faces.collect(), draws.iter().map(|draw| draw.geometry.clip()).collect())
    }

    fn of(faces: Vec<Face>, clips: Vec<Clip>) -> Self {
        let bounds = |face: &Face| face.ends.map(|end| bounds_of(&end.map(|corner| corner.as_dvec3())));
        let tree = Bvh::new(&faces.iter().map(bounds).collect::<Vec<_>>());
        Self { faces, tree, clips }
    }

    /// The triangles.
    pub fn faces(&self) -> &[Face] {
        &self.faces
    }

    /// Whether a triangle other than `but` lies between a point and another at lens position `lens`, at time `t`;
    /// the cost is added to `work`. Clip planes across lens and shutter count, those across an image do not.
    pub fn is_blocked(
        &self,
        from: DVec3,
        (to, lens): (DVec3, [f32; 2]),
        t: f32,
        but: u32,
        work: &mut RayWork,
    ) -> bool {
        let ray = Ray { from, along: to - from, t, beyond: 1e-6 };
        let is_there = |face: &Face| self.clips[face.draw].holds(lens, t);
        let other =
            |id: usize| (id != but as usize && is_there(&self.faces[id])).then(|| self.faces[id].at(t));
        self.tree.any(&ray, 1.0 - 1e-6, other, work)
    }

    /// First triangle along a ray at time `t` beyond `nearest` times `along`, with its distance in lengths of
    /// `along`; the cost is added to `work`.
    pub fn first(
        &self,
        (from, along): (DVec3, DVec3),
        t: f32,
        nearest: f64,
        work: &mut RayWork,
    ) -> Option<(usize, f64)> {
        self.tree.first(&Ray { from, along, t, beyond: nearest }, |id| self.faces[id].at(t), work)
    }
}

/// Samples that all pixels share.
#[derive(Clone, Debug, PartialEq)]
pub struct SharedSamples {
    samples: Vec<Sample>,
    by_time: TimedBlock,
}

impl SharedSamples {
    /// Takes 1 to 256 samples in range; `None` otherwise.
    pub fn new(samples: Vec<Sample>) -> Option<Self> {
        let fits = (1..=SampleTable::MAX_PER_PIXEL as usize).contains(&samples.len());
        (fits && samples.iter().all(Sample::is_in_range)).then(|| Self::of(samples))
    }

    /// Takes samples that are in range.
    fn of(samples: Vec<Sample>) -> Self {
        Self { by_time: TimedBlock::new(|_| &samples), samples }
    }

    /// A fixed set of `count` samples of lens and time: those of the first pixel of a table. Patterns that
    /// differ between pixels are accepted.
    ///
    /// # Errors
    /// [`SampleTableError`] if the table cannot be made.
    pub fn from_spec(spec: &SampleSpec, count: u32, seed: u64) -> Result<Self, SampleTableError> {
        Ok(Self::of(SampleTable::new(spec, count, seed)?.pixel(0, 0).to_vec()))
    }

    /// The first `count` samples of a scrambled Sobol sequence.
    ///
    /// # Errors
    /// [`SampleTableError`] unless `count` is 1 to 256.
    pub fn interleaved(spec: &SampleSpec, count: u32, seed: u64) -> Result<Self, SampleTableError> {
        let pattern = Pattern::Interleaved { points: count.max(1) };
        Self::from_spec(&SampleSpec { pattern, ..spec.clone() }, count, seed)
    }

    /// The samples.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// The same samples at the pixel centre.
    #[must_use]
    pub fn centred(&self) -> Self {
        Self::of(self.samples.iter().map(|sample| Sample { x: 0.5, y: 0.5, ..*sample }).collect())
    }

    /// One sample at the lens centre and time 0.
    pub fn still(&self, index: usize) -> Self {
        let Sample { x, y, .. } = self.samples[index];
        Self::of(vec![Sample { x, y, ..Sample::default() }])
    }
}

impl SampleSource for SharedSamples {
    fn per_pixel(&self) -> u32 {
        self.samples.len() as u32
    }

    fn pixel_into(&self, _px: u32, _py: u32, into: &mut [Sample]) {
        into.copy_from_slice(&self.samples);
    }

    fn block_by_time(&self, _px: u32, _py: u32) -> Option<&TimedBlock> {
        Some(&self.by_time)
    }
}

/// The pinhole at lens position `(u, v)` of `camera`, with the image shifted so that points in focus stay in
/// place. A lens of radius `R` focused at `F` shifts a point at depth `w` by `u R (1 / F - 1 / w)` in the
/// image at depth 1. Moving the camera by `u R` and its image by `u R / F` does the same (Haeberli and Akeley
/// 1990). A camera without a lens, or an orthographic one, is returned unchanged.
///
/// # Errors
/// [`CameraError`] if the lens is so large that the position is not finite.
pub fn pinhole(camera: &Camera, [u, v]: [f32; 2]) -> Result<Camera, CameraError> {
    let Some(lens) = camera.lens().filter(|_| !camera.is_orthographic()) else { return Ok(*camera) };
    let by = Vec2::new(u, v) * lens.radius();
    let moved = |pose: Affine3A| Affine3A::from_translation(Vec3::new(-by.x, -by.y, 0.0)) * pose;
    // The image is twice the tangent high, and its y points down.
    let shift = by * Vec2::new(1.0, -1.0) / (2.0 * camera.half_height() * lens.focus());
    let still = camera.with_lens(None).moving(moved(camera.open()), moved(camera.close()))?;
    still.with_shift(camera.shift() + shift)
}

/// Still meshes on the image plane of a pinhole, and their camera.
///
/// Vertices are projected and moved to their position at time `t` and lens position `(u, v)`, each with the
/// single rounding of the sample test of a 5D pass. So without a lens, or with its focus at infinity, the
/// snapshot equals the sample `(u, v, t)` of that pass bit for bit. (A lens with a finite focus shifts a
/// sample by its depth, which rounds in another order.)
pub struct Snapshot<'a> {
    meshes: Vec<Vec<Vec3>>,
    draws: Vec<Draw<'a>>,
    /// A pinhole without projection: the meshes are already on its image plane.
    pub camera: Camera,
}

/// Reason why a snapshot cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the variants are the sources, documented there")]
pub enum SnapshotError {
    #[error(transparent)]
    Camera(#[from] CameraError),
    #[error(transparent)]
    Draw(#[from] DrawError),
}

impl<'a> Snapshot<'a> {
    /// Snapshot of `draws` in `camera`, for an image of the size of `viewport`, at the time and lens position
    /// of `at`.
    ///
    /// # Errors
    /// [`SnapshotError`] if no camera exists for the viewport.
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
            // In the image y points down, in world space up.
            Vec3::new(x - base[0], -(y - base[1]), w)
        };
        let mesh = |draw: &Draw<'a>| {
            draw.geometry.open().iter().zip(draw.geometry.close()).map(place).collect::<Vec<_>>()
        };
        // One scene unit at depth 1 is a pixel.
        let still = Camera::new(Affine3A::IDENTITY, 0.5 * viewport.height() as f32, camera.near())?;
        let frozen = |clip: Clip| clip.frozen([at.u, at.v], at.t);
        let clipped = |draw: &Draw<'a>| Draw {
            geometry: draw.geometry.with_clip(frozen(draw.geometry.clip())),
            ..*draw
        };
        Ok(Self {
            meshes: draws.iter().map(mesh).collect(),
            draws: draws.iter().map(clipped).collect(),
            camera: still.with_clip(frozen(camera.clip())),
        })
    }

    /// The still draws, with the order, triangles, shaders, culling and clip planes of the original ones.
    ///
    /// # Errors
    /// [`SnapshotError`] if a vertex is not finite.
    pub fn draws(&self) -> Result<Vec<Draw<'_>>, SnapshotError> {
        let pairs = self.meshes.iter().zip(&self.draws);
        let still = pairs.map(|(mesh, draw)| {
            let geometry = Geometry::new(mesh, mesh, draw.geometry.triangles())?;
            Ok(Draw { geometry: geometry.with_clip(draw.geometry.clip()), ..*draw })
        });
        still.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pipeline::geometry::Projection;
    use pipeline::{Lens, Viewport};

    #[test]
    fn a_ray_hits_a_moving_triangle_at_its_time() {
        let at = |x: f32| [Vec3::new(x, -1.0, 2.0), Vec3::new(x + 2.0, -1.0, 2.0), Vec3::new(x, 3.0, 2.0)];
        let rays = RayCaster::of(vec![Face { ends: [at(-4.5), at(3.5)], draw: 0 }], vec![Clip::NONE]);
        let work = &mut RayWork::default();
        let mut first = |t| rays.first((DVec3::ZERO, DVec3::Z), t, 0.0, work);
        assert_eq!(first(0.5), Some((0, 2.0)));
        assert_eq!((first(0.0), first(1.0)), (None, None));
        let is_blocked = |along, but| {
            rays.is_blocked(DVec3::ZERO, (DVec3::Z * along, [0.0; 2]), 0.5, but, &mut RayWork::default())
        };
        assert!(is_blocked(4.0, 7));
        assert!(!is_blocked(4.0, 0), "its own triangle does not count");
        assert!(!is_blocked(1.9, 7));
    }

    /// Compares with the lens formula, at depths before, in and behind the focus.
    #[test]
    fn a_pinhole_sees_the_same_as_its_lens_position() {
        let lens = Lens::new(0.3, 4.0).unwrap();
        let camera = Camera::new(Affine3A::from_rotation_y(0.2), 0.7, 0.1).unwrap();
        let camera = camera.with_shift(Vec2::new(0.1, -0.05)).unwrap().with_lens(Some(lens));
        let viewport = Viewport::new(640, 480).unwrap();
        let wide = Projection::new(&camera, viewport);
        for [u, v] in [[0.0, 0.0], [1.0, 0.0], [-0.4, 0.9]] {
            let one = Projection::new(&pinhole(&camera, [u, v]).unwrap(), viewport);
            for point in [Vec3::new(0.2, -0.3, 2.0), Vec3::new(-1.0, 0.4, 4.0), Vec3::new(2.0, 1.0, 19.0)] {
                let [x, y, w] = wide.vertex(point, point).open.map(f64::from);
                let place = [(x, 0, u), (y, 1, v)].map(|(at, axis, place)| {
                    at / w
                        + f64::from(place)
                            * (f64::from(wide.shear.a[axis]) - f64::from(wide.shear.s[axis]) / w)
                });
                let [px, py, pw] = one.vertex(point, point).open.map(f64::from);
                let error_px = (place[0] - px / pw).abs().max((place[1] - py / pw).abs());
                assert!(error_px < 2e-4, "{error_px} px at {u} {v} {point}");
            }
        }
        let bare = camera.with_lens(None);
        assert_eq!(pinhole(&bare, [1.0, 1.0]).unwrap(), bare);
    }
}
