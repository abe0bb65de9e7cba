//! Standard mode: moving triangles are drawn and every sample that they cover becomes a point.

use glam::{Affine3A, Vec3};
use pipeline::frame::visibility;
use pipeline::memory::CacheError;
use pipeline::sampling::{Sample, SampleSource};
use pipeline::{Camera, Clip, Cull, Draw, Geometry, PipelineSpec, Settings, Viewport};

use super::Inside;
use super::torus::{Layer, Torus};
use crate::visibility::Unshaded;

/// Samples of the rasterizer over the unit cube `x, y, t`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Covered {
    /// Those inside the solid.
    pub points: Vec<[f64; 3]>,
    /// Those that a moving triangle covers.
    pub covered: u64,
    /// All of them.
    pub samples: u64,
}

/// Prisms along the axis and around it.
const LAYERS: u32 = 16;
const SECTORS: u32 = 48;

/// A draw in the making.
pub(in crate::points) struct Prisms {
    ends: [Vec<Vec3>; 2],
    triangles: Vec<[u32; 3]>,
    clip: Clip,
}

impl Prisms {
    /// The prisms around a torus, span by span.
    pub fn of(torus: &Torus) -> Vec<Self> {
        torus.layers(LAYERS, SECTORS).into_iter().filter_map(Self::new).collect()
    }

    fn new(layer: Layer) -> Option<Self> {
        let all = [f32::NEG_INFINITY, f32::INFINITY];
        let clip = Clip::new(all, all, layer.t.map(|t| t as f32))?;
        let ends =
            layer.ends.map(|end| end.iter().map(|[x, y]| Vec3::new(*x as f32, *y as f32, 1.0)).collect());
        Some(Self { ends, triangles: layer.triangles, clip })
    }

    /// Draws of them, with a shader.
    pub fn draws<'a>(all: &'a [Self], shader: &'a dyn pipeline::Shader) -> Vec<Draw<'a>> {
        let draw = |prisms: &'a Self| {
            let geometry = Geometry::new(&prisms.ends[0], &prisms.ends[1], &prisms.triangles).ok()?;
            Some(Draw { geometry: geometry.with_clip(prisms.clip), shader, cull: Cull::None })
        };
        all.iter().filter_map(draw).collect()
    }
}

/// A camera that sees the unit square, with y upwards, in a square image.
pub(in crate::points) fn camera() -> Option<Camera> {
    let middle = Affine3A::from_translation(Vec3::new(-0.5, -0.5, 0.0));
    Camera::orthographic(middle, 0.5, 0.01).ok()
}

/// The place of a sample in the unit cube.
pub(in crate::points) fn place(sample: &Sample, pixel: [u32; 2], side: u32) -> [f64; 3] {
    let across = (f64::from(pixel[0]) + f64::from(sample.x)) / f64::from(side);
    let down = (f64::from(pixel[1]) + f64::from(sample.y)) / f64::from(side);
    [across, 1.0 - down, f64::from(sample.t)]
}

/// The samples of an image of `side` times `side` pixels that lie in a torus, found by drawing moving triangles around it.
///
/// # Errors
/// When a cache of `spec` cannot be built.
pub fn standard_mode(
    torus: &Torus,
    side: u32,
    samples: &dyn SampleSource,
    spec: &PipelineSpec,
) -> Result<Covered, CacheError> {
    let (prisms, viewport) = (Prisms::of(torus), Viewport::new(side, side));
    let (Some(camera), Some(viewport)) = (camera(), viewport) else { return Ok(Covered::default()) };
    let settings = Settings { spec, viewport, samples, background: Vec3::ZERO };
    let seen = visibility(&camera, &Prisms::draws(&prisms, &Unshaded), &settings)?;
    Ok(inside(torus, side, samples, &seen))
}

/// The samples that are seen and lie in a torus.
pub(in crate::points) fn inside(
    torus: &Torus,
    side: u32,
    samples: &dyn SampleSource,
    seen: &[(u32, u32)],
) -> Covered {
    let per_pixel = samples.per_pixel() as usize;
    let (mut own, mut found) = (vec![Sample::default(); per_pixel], Covered::default());
    found.samples = seen.len() as u64;
    for (pixel, seen) in (0..).zip(seen.chunks(per_pixel)) {
        let at = [pixel % side, pixel / side];
        samples.pixel_into(at[0], at[1], &mut own);
        for (sample, _) in own.iter().zip(seen).filter(|(_, (triangle, _))| *triangle != u32::MAX) {
            found.covered += 1;
            let point = place(sample, at, side);
            if torus.contains(&point, 0) {
                found.points.push(point);
            }
        }
    }
    found
}
