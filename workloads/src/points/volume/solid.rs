//! What a closed surface encloses.

use std::collections::HashMap;

use glam::DVec3;
use pipeline::conservative::{Grid, MovingTriangle};

use super::Inside;
use super::bounds::{Bounds, Hull};

/// The inside of a closed surface of triangles: where it winds around a point.
#[derive(Clone, Debug)]
pub struct Solid {
    triangles: Vec<[DVec3; 3]>,
    bounds: Bounds,
}

/// Why a surface encloses nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SolidError {
    /// There are edges without a partner.
    #[error(
        "the surface is not closed: {0} edges of triangles have no partner that runs the other way; close its holes, and let all triangles be turned outward"
    )]
    Open(usize),
    /// There is no surface.
    #[error("the surface has no triangles; export it with its faces")]
    NoTriangles,
    /// There are numbers that cannot be computed with.
    #[error("the surface has a coordinate that is not finite or beyond 1e60; mend or scale it")]
    TooFar,
    /// There is nothing inside.
    #[error("the surface encloses no volume: it is flat, or its parts cancel out; give one that does")]
    Flat,
}

impl Solid {
    /// The inside of the triangles, with bounds over `tiles` times `tiles` tiles. Vertices at equal places are one.
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
        let solid = Self { bounds: Bounds::new(&hull, grid(&triangles, tiles)), triangles };
        if solid.volume().abs() > 0.0 { Ok(solid) } else { Err(SolidError::Flat) }
    }

    /// What the surface encloses, by the divergence theorem; negative where triangles are turned inward.
    pub fn volume(&self) -> f64 {
        self.triangles.iter().map(|[a, b, c]| a.dot(b.cross(*c)) / 6.0).sum()
    }

    /// Where to look for its points.
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }
}

impl Inside for Solid {
    fn contains(&self, point: &[f64; 3], tile: usize) -> bool {
        let above = |&triangle: &u32| crossing(&self.triangles[triangle as usize], point);
        self.bounds.lists[tile].iter().map(above).sum::<i32>() != 0
    }
}

/// A grid a little larger than what the triangles cover.
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

/// How a triangle is crossed on the way up from a point: 1 from within, -1 from without, 0 if it is not.
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

/// On which side of an edge a point is, seen from above, with the double area: always computed in one order of the two corners, so
/// that the triangles on both sides agree.
fn side(from: &DVec3, to: &DVec3, point: &[f64; 3]) -> (f64, bool) {
    let turned = (to.x, to.y, to.z) < (from.x, from.y, from.z);
    let (p, q) = if turned { (to, from) } else { (from, to) };
    let area = (q.x - p.x) * (point[1] - p.y) - (q.y - p.y) * (point[0] - p.x);
    if turned { (-area, area < 0.0) } else { (area, area >= 0.0) }
}

/// How many edges have no partner.
fn open_edges(positions: &[DVec3], triangles: &[[u32; 3]]) -> usize {
    // Zero has two signs and one place.
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
