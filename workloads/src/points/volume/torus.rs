//! A torus in space and time, bounded by moving triangles (Fig. 9), and its points in standard mode.

use std::f64::consts::{PI, TAU};

use glam::{Affine3A, Vec3};
use pipeline::conservative::{Grid, MovingTriangle};
use pipeline::sampling::{Sample, SampleSource};
use pipeline::{Camera, Clip, Cull, Draw, Geometry, PassError, PipelineSpec, RasterPass, Settings, Viewport};

use super::{Bounds, Hull, Inside};
use crate::visibility::Unshaded;

/// A torus in the middle of the unit cube, with its axis along the third coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Torus {
    /// Distance from the axis to the middle of the tube.
    pub ring: f64,
    /// Radius of the tube, less than `ring`; both together at most 0.5.
    pub tube: f64,
}

impl Default for Torus {
    fn default() -> Self {
        Self { ring: 0.3, tube: 0.15 }
    }
}

/// Moving triangles of a time span.
pub(super) struct Layer {
    pub t: [f64; 2],
    /// Vertices at time 0 and time 1, `[x, y]`: the ends of their lines of motion.
    pub ends: [Vec<[f64; 2]>; 2],
    pub triangles: Vec<[u32; 3]>,
}

/// Margin of the bounds for rounding to single precision.
const MARGIN: f64 = 1e-5;

impl Torus {
    /// Volume (Pappus).
    pub fn volume(&self) -> f64 {
        2.0 * PI * PI * self.ring * self.tube * self.tube
    }

    /// Integral of the squared distance from the axis.
    pub fn moment(&self) -> f64 {
        self.volume() * (self.ring * self.ring + 0.75 * self.tube * self.tube)
    }

    /// Half the width of the tube at a time.
    fn half_width(&self, t: f64) -> f64 {
        (self.tube * self.tube - (t - 0.5) * (t - 0.5)).max(0.0).sqrt()
    }

    /// Generalized prisms around the torus: rings of `sectors` quadrilaterals of two triangles, over `layers`
    /// time spans. The half width is concave, so its tangent at the middle of a span bounds it. Outer corners
    /// are moved out so that chords do not cut the circle.
    pub(super) fn layers(&self, layers: u32, sectors: u32) -> Vec<Layer> {
        let first = 0.5 - self.tube;
        let height = 2.0 * self.tube / f64::from(layers);
        let span = |layer: u32| first + f64::from(layer) * height;
        (0..layers).map(|layer| self.layer([span(layer), span(layer + 1)], sectors)).collect()
    }

    fn layer(&self, t: [f64; 2], sectors: u32) -> Layer {
        let middle = 0.5 * (t[0] + t[1]);
        let slope = -(middle - 0.5) / self.half_width(middle);
        let chord = 1.0 / (PI / f64::from(sectors)).cos();
        // The width is negative only outside the span.
        let width = |at: f64| self.half_width(middle) + slope * (at - middle) + MARGIN;
        let radius = |outer: bool, at: f64| {
            if outer { (self.ring + width(at)) * chord } else { self.ring - width(at) }
        };
        let corner = |at: f64, number: u32| {
            let (angle, radius) =
                (TAU * f64::from(number / 2) / f64::from(sectors), radius(number % 2 == 1, at));
            [0.5 + radius * libm::cos(angle), 0.5 + radius * libm::sin(angle)]
        };
        let ends = [0.0, 1.0].map(|at| (0..2 * sectors).map(|number| corner(at, number)).collect());
        let quad = |sector: u32| {
            let [a, b] = [2 * sector, 2 * ((sector + 1) % sectors)];
            [[a, a + 1, b + 1], [a, b + 1, b]]
        };
        Layer { t, ends, triangles: (0..sectors).flat_map(quad).collect() }
    }

    /// Bounds over `tiles` by `tiles` tiles of the unit square, from prisms as in [`super::standard_mode`].
    pub fn bounds(&self, tiles: u32) -> Bounds {
        let (mut triangles, mut times) = (Vec::new(), Vec::new());
        for layer in self.layers(16, 32) {
            let at = |end: usize, vertex: u32| {
                let [x, y] = layer.ends[end][vertex as usize];
                [x, y, 0.0]
            };
            let moving = |corners: &[u32; 3]| {
                MovingTriangle::new(corners.map(|vertex| at(0, vertex)), corners.map(|vertex| at(1, vertex)))
            };
            triangles.extend(layer.triangles.iter().filter_map(moving));
            times.resize(triangles.len(), layer.t);
        }
        let side = 1.0 / f64::from(tiles);
        let grid = Grid { origin: [0.0; 2], tile: [side; 2], columns: tiles, rows: tiles };
        Bounds::new(&Hull { triangles: &triangles, times: &times, by_time: true }, grid)
    }
}

impl Inside for Torus {
    fn contains(&self, point: &[f64; 3], _tile: usize) -> bool {
        let [x, y, t] = point.map(|at| at - 0.5);
        let from_ring = (x * x + y * y).sqrt() - self.ring;
        from_ring * from_ring + t * t <= self.tube * self.tube
    }
}

/// Samples of the rasterizer over the unit cube `x, y, t`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Covered {
    /// Samples inside the solid.
    pub points: Vec<[f64; 3]>,
    /// Number of samples that a moving triangle covers.
    pub covered: u64,
    /// Number of all samples.
    pub samples: u64,
}

/// Prisms along the axis.
const LAYERS: u32 = 16;
/// Prisms around the axis.
const SECTORS: u32 = 48;

/// Geometry of one draw.
struct Prisms {
    ends: [Vec<Vec3>; 2],
    triangles: Vec<[u32; 3]>,
    clip: Clip,
}

impl Prisms {
    /// Prisms around a torus, one draw per time span.
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

    /// Draws of the prisms with a shader.
    pub fn draws<'a>(all: &'a [Self], shader: &'a dyn pipeline::Shader) -> Vec<Draw<'a>> {
        let draw = |prisms: &'a Self| {
            let geometry = Geometry::new(&prisms.ends[0], &prisms.ends[1], &prisms.triangles).ok()?;
            Some(Draw::new(geometry.with_clip(prisms.clip), shader, Cull::None))
        };
        all.iter().filter_map(draw).collect()
    }
}

/// Camera of the unit square, with y up, for a square image.
pub(in crate::points) fn camera() -> Option<Camera> {
    let middle = Affine3A::from_translation(Vec3::new(-0.5, -0.5, 0.0));
    Camera::orthographic(middle, 0.5, 0.01).ok()
}

/// Position of a sample in the unit cube.
pub(in crate::points) fn place(sample: &Sample, pixel: [u32; 2], side: u32) -> [f64; 3] {
    let across = (f64::from(pixel[0]) + f64::from(sample.x)) / f64::from(side);
    let down = (f64::from(pixel[1]) + f64::from(sample.y)) / f64::from(side);
    [across, 1.0 - down, f64::from(sample.t)]
}

/// Samples of an image of `side` by `side` pixels inside a torus, found by drawing moving triangles around
/// it.
///
/// # Errors
/// [`PassError`] if a cache of `spec` cannot be built.
pub fn standard_mode(
    torus: &Torus,
    side: u32,
    samples: &dyn SampleSource,
    spec: &PipelineSpec,
) -> Result<Covered, PassError> {
    let (prisms, viewport) = (Prisms::of(torus), Viewport::new(side, side));
    let (Some(camera), Some(viewport)) = (camera(), viewport) else { return Ok(Covered::default()) };
    let settings = Settings { spec, viewport, samples, background: Vec3::ZERO };
    let seen = RasterPass::new(&camera, &Prisms::draws(&prisms, &Unshaded), &settings).visibility()?;
    Ok(inside(torus, side, samples, &seen))
}

/// The visible samples inside a torus.
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
