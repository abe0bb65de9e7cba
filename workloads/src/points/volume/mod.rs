//! Uniform points in volumes (thesis, Paper VI, section 5, "The 5D Rasterizer as a Volumetric Sampler").
//!
//! - [`Torus`], [`Solid`]: volumes with an exact inside test.
//! - [`SolidBounds`]: *conservative mode*. The rasterizer bounds the third coordinate of a volume in every tile:
//!   the time of moving triangles for a [`Torus`], the depth of the surface for a [`Solid`]. Random points of
//!   these bounds are tested.
//! - [`standard_mode`]: samples of a pass that moving triangles cover and whose pixel shader finds them
//!   inside the volume (Fig. 9), in three ([`Torus`]), four and five dimensions ([`Blurred`]).

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, Region, View};
use pipeline::{Clip, Cull, Draw, Geometry, Lane};
use rayon::prelude::*;

use super::Stream;

/// A volume with an inside test.
pub trait Inside: Sync {
    /// Whether a point is inside; `tile` is the point's tile of the bounds.
    fn contains(&self, point: &[f64; 3], tile: usize) -> bool;
}

/// The triangles that bound a solid.
struct Hull<'a> {
    pub triangles: &'a [MovingTriangle],
    /// Time interval of each triangle.
    pub times: &'a [[f64; 2]],
    /// Whether the third coordinate is time instead of depth.
    pub by_time: bool,
}

/// Range of the third coordinate of a solid in every tile.
#[derive(Clone, Debug)]
pub struct SolidBounds {
    grid: Grid,
    columns: Vec<Option<[f64; 2]>>,
    /// Triangles that touch each tile.
    lists: Vec<Vec<u32>>,
    /// Cumulative lengths of the columns.
    sums: Vec<f64>,
}

/// Points inside, and the number of candidates.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampled {
    /// The points.
    pub points: Vec<[f64; 3]>,
    /// Random points of the bounds that were tested.
    pub candidates: u64,
}

/// Candidates per parallel task.
const CHUNK: u64 = 1 << 14;
/// Most candidates per point.
const MAX_CANDIDATES_PER_POINT: u64 = 1 << 20;

impl SolidBounds {
    fn new(hull: &Hull<'_>, grid: Grid) -> Self {
        let tiles = grid.columns as usize * grid.rows as usize;
        let (mut columns, mut lists) = (vec![None; tiles], vec![Vec::new(); tiles]);
        for ((number, triangle), &t) in (0..).zip(hull.triangles).zip(hull.times) {
            let clip = Region { t, ..Region::WHOLE };
            let rasterizer = Rasterizer::new(View::orthographic()).clipped(clip);
            rasterizer.rasterize(triangle, &grid, |[column, row], touch| {
                let tile = (row * grid.columns + column) as usize;
                let range = if hull.by_time { touch.t } else { touch.z };
                let known: &mut Option<[f64; 2]> = &mut columns[tile];
                *known = Some(known.map_or(range, |[lo, hi]| [lo.min(range[0]), hi.max(range[1])]));
                lists[tile].push(number);
            });
        }
        let mut sum = 0.0;
        let length = |column: &Option<[f64; 2]>| column.map_or(0.0, |[lo, hi]| hi - lo);
        let sums = columns.iter().map(|column| (sum += length(column), sum).1).collect();
        Self { grid, columns, lists, sums }
    }

    /// Volume of all columns.
    pub fn volume(&self) -> f64 {
        self.grid.tile[0] * self.grid.tile[1] * self.sums.last().copied().unwrap_or(0.0)
    }

    /// `count` uniform points of the solid; fewer if it is too thin for random points to hit.
    pub fn sample(&self, solid: &dyn Inside, count: usize, seed: u64) -> Sampled {
        let stream = Stream::new(seed, 0x7015);
        let (mut points, mut candidates) = (Vec::with_capacity(count), 0);
        while points.len() < count
            && candidates < MAX_CANDIDATES_PER_POINT * count as u64
            && self.volume() > 0.0
        {
            let chunks = rayon::current_num_threads() as u64;
            let kept: Vec<Vec<_>> = (0..chunks)
                .into_par_iter()
                .map(|chunk| self.kept(solid, stream, candidates + chunk * CHUNK, CHUNK))
                .collect();
            candidates += chunks * CHUNK;
            let missing = count - points.len();
            let taken: Vec<_> = kept.into_iter().flatten().take(missing).collect();
            points.extend(taken.iter().map(|(_, point)| *point));
            if let Some((last, _)) = taken.last().filter(|_| points.len() == count) {
                candidates = last + 1;
            }
        }
        Sampled { points, candidates }
    }

    /// Uniform points of the solid, `density` per unit of volume on average; the number of candidates follows
    /// from the volume of the bounds.
    pub fn sample_density(&self, solid: &dyn Inside, density: f64, seed: u64) -> Sampled {
        let stream = Stream::new(seed, 0xDE45);
        let candidates = (density * self.volume()).round() as u64;
        let firsts: Vec<u64> = (0..candidates).step_by(CHUNK as usize).collect();
        let kept: Vec<Vec<_>> = firsts
            .into_par_iter()
            .map(|first| self.kept(solid, stream, first, CHUNK.min(candidates - first)))
            .collect();
        Sampled { points: kept.into_iter().flatten().map(|(_, point)| point).collect(), candidates }
    }

    fn kept(&self, solid: &dyn Inside, stream: Stream, first: u64, count: u64) -> Vec<(u64, [f64; 3])> {
        let test = |number: u64| {
            let (tile, point) = self.candidate(stream, number)?;
            solid.contains(&point, tile).then_some((number, point))
        };
        (first..first + count).filter_map(test).collect()
    }

    /// A random point of the bounds, and its tile.
    fn candidate(&self, stream: Stream, number: u64) -> Option<(usize, [f64; 3])> {
        let unit = |k: u64| stream.unit(4 * number + k);
        let chosen = unit(0) * self.sums.last()?;
        let tile = self.sums.partition_point(|sum| *sum <= chosen).min(self.sums.len() - 1);
        let [lo, hi] = self.columns[tile]?;
        let place = [tile as u32 % self.grid.columns, tile as u32 / self.grid.columns];
        let across =
            |k: usize| self.grid.origin[k] + (f64::from(place[k]) + unit(1 + k as u64)) * self.grid.tile[k];
        Some((tile, [across(0), across(1), lo + unit(3) * (hi - lo)]))
    }
}

/// The inside of a closed triangle surface, by winding number.
#[derive(Clone, Debug)]
pub struct Solid {
    triangles: Vec<[DVec3; 3]>,
    bounds: SolidBounds,
}

/// Reason why a surface encloses no volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SolidError {
    /// Some edges have no partner.
    #[error(
        "the surface is not closed: {0} edges of triangles have no partner that runs the other way; close its holes, and let all triangles be turned outward"
    )]
    Open(usize),
    /// There are no triangles.
    #[error("the surface has no triangles; export it with its faces")]
    NoTriangles,
    /// A coordinate is not finite or too large.
    #[error("the surface has a coordinate that is not finite or beyond 1e60; fix or scale it")]
    TooFar,
    /// The volume is zero.
    #[error("the surface encloses no volume: it is flat, or its parts cancel out; give one that does")]
    Flat,
}

impl Solid {
    /// Makes a solid, with bounds over `tiles` by `tiles` tiles. Vertices at equal positions are merged.
    ///
    /// # Errors
    /// [`SolidError`].
    pub fn new(positions: &[DVec3], triangles: &[[u32; 3]], tiles: u32) -> Result<Self, SolidError> {
        if triangles.is_empty() {
            return Err(SolidError::NoTriangles);
        }
        let open = open_edges(positions, triangles);
        if open > 0 {
            return Err(SolidError::Open(open));
        }
        let triangles: Vec<[DVec3; 3]> =
            triangles.iter().map(|corners| corners.map(|vertex| positions[vertex as usize])).collect();
        let whole: Option<Vec<MovingTriangle>> = triangles
            .iter()
            .map(|corners| corners.map(|corner| corner.to_array()))
            .map(|corners| MovingTriangle::new(corners, corners))
            .collect();
        let moving = whole.ok_or(SolidError::TooFar)?;
        let times = vec![[0.0, 1.0]; moving.len()];
        let hull = Hull { triangles: &moving, times: &times, by_time: false };
        let solid = Self { bounds: SolidBounds::new(&hull, grid(&triangles, tiles)), triangles };
        if solid.volume().abs() > 0.0 { Ok(solid) } else { Err(SolidError::Flat) }
    }

    /// Enclosed volume, by the divergence theorem; negative if the triangles face inwards.
    pub fn volume(&self) -> f64 {
        self.triangles.iter().map(|[a, b, c]| a.dot(b.cross(*c)) / 6.0).sum()
    }

    /// Bounds for random points.
    pub fn bounds(&self) -> &SolidBounds {
        &self.bounds
    }
}

impl Inside for Solid {
    fn contains(&self, point: &[f64; 3], tile: usize) -> bool {
        let above = |&triangle: &u32| crossing(&self.triangles[triangle as usize], point);
        self.bounds.lists[tile].iter().map(above).sum::<i32>() != 0
    }
}

/// A grid slightly larger than the bounding box of the triangles.
fn grid(triangles: &[[DVec3; 3]], tiles: u32) -> Grid {
    let all = || triangles.as_flattened().iter();
    let low = all().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = all().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let side = |low: f64, high: f64| {
        let margin = (high - low) * 1e-9 + (low.abs() + high.abs()) * 4.0 * f64::EPSILON + 1e-300;
        (low - margin, (high - low + 2.0 * margin) / f64::from(tiles))
    };
    let (x, y) = (side(low.x, high.x), side(low.y, high.y));
    Grid { origin: [x.0, y.0], tile: [x.1, y.1], columns: tiles, rows: tiles }
}

/// Crossing of a triangle on the way up from a point: 1 from inside, -1 from outside, 0 if there is none.
fn crossing(triangle: &[DVec3; 3], point: &[f64; 3]) -> i32 {
    let [a, b, c] = triangle;
    let weights = [side(b, c, point), side(c, a, point), side(a, b, point)];
    let up = weights.iter().filter(|weight| weight.1).count();
    if up != 0 && up != 3 {
        return 0;
    }
    let [u, v, w] = weights.map(|weight| weight.0);
    let height = (u * a.z + v * b.z + w * c.z) / (u + v + w);
    match (height > point[2], up == 3) {
        (false, _) => 0,
        (true, true) => 1,
        (true, false) => -1,
    }
}

/// Double area and side of an edge that a point is on, seen from above. Both corners are used in one fixed
/// order, so that the triangles on both sides of the edge agree.
fn side(from: &DVec3, to: &DVec3, point: &[f64; 3]) -> (f64, bool) {
    let turned = (to.x, to.y, to.z) < (from.x, from.y, from.z);
    let (p, q) = if turned { (to, from) } else { (from, to) };
    let area = (q.x - p.x) * (point[1] - p.y) - (q.y - p.y) * (point[0] - p.x);
    if turned { (-area, area < 0.0) } else { (area, area >= 0.0) }
}

/// Number of edges without a partner.
fn open_edges(positions: &[DVec3], triangles: &[[u32; 3]]) -> usize {
    // Adding zero makes -0.0 equal to 0.0.
    let place = |vertex: u32| (positions[vertex as usize] + DVec3::ZERO).to_array().map(f64::to_bits);
    let mut edges: HashMap<_, i64> = HashMap::new();
    for corners in triangles {
        let [a, b, c] = corners.map(place);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *edges.entry((from.min(to), from.max(to))).or_default() +=
                if from < to { 1 } else { -i64::from(from != to) };
        }
    }
    edges.values().map(|count| count.unsigned_abs() as usize).sum()
}

#[cfg(test)]
mod tests;

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
struct Layer {
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
    fn layers(&self, layers: u32, sectors: u32) -> Vec<Layer> {
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

    /// Bounds over `tiles` by `tiles` tiles of the unit square, from prisms as in [`standard_mode`].
    pub fn bounds(&self, tiles: u32) -> SolidBounds {
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
        SolidBounds::new(&Hull { triangles: &triangles, times: &times, by_time: true }, grid)
    }
}

impl Inside for Torus {
    fn contains(&self, point: &[f64; 3], _tile: usize) -> bool {
        let [x, y, t] = *point;
        self.has(&Lane::default(), &[x, y, t, 0.0, 0.0])
    }
}

impl Volume for Torus {
    fn has(&self, lane: &Lane, &[x, y, t, ..]: &SamplePoint) -> bool {
        let [x, y, t] = [x, y, t].map(|at| lane.sub(at, 0.5));
        let from_ring = lane.sub(lane.root(lane.madd(y, y, lane.mul(x, x))), self.ring);
        lane.branch(lane.madd(t, t, lane.mul(from_ring, from_ring)) <= self.tube * self.tube)
    }

    fn prisms(&self) -> Vec<Prisms> {
        Prisms::of(self)
    }
}

/// Depth of the triangles.
const DEPTH: f32 = 1.0;
/// Prisms along the axis.
const LAYERS: u32 = 16;
/// Prisms around the axis.
const SECTORS: u32 = 48;

/// Geometry of one draw: moving triangles in a span of time.
pub struct Prisms {
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
            layer.ends.map(|end| end.iter().map(|[x, y]| Vec3::new(*x as f32, *y as f32, DEPTH)).collect());
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

/// The space of samples: x and y (up) of the unit square, time, and both axes of the lens, -1 to 1.
pub type SamplePoint = [f64; 5];

mod standard;
pub use standard::{Blurred, CoveredSamples, Volume, every_sample, fill, standard_mode};
