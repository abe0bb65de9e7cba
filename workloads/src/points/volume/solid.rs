//! The volume inside a closed surface.

use std::collections::HashMap;

use glam::DVec3;
use pipeline::conservative::{Grid, MovingTriangle};

use super::Inside;
use super::bounds::{Bounds, Hull};

/// The inside of a closed triangle surface, by winding number.
#[derive(Clone, Debug)]
pub struct Solid {
    triangles: Vec<[DVec3; 3]>,
    bounds: Bounds,
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
        let solid = Self { bounds: Bounds::new(&hull, grid(&triangles, tiles)), triangles };
        if solid.volume().abs() > 0.0 { Ok(solid) } else { Err(SolidError::Flat) }
    }

    /// Enclosed volume, by the divergence theorem; negative if the triangles face inwards.
    pub fn volume(&self) -> f64 {
        self.triangles.iter().map(|[a, b, c]| a.dot(b.cross(*c)) / 6.0).sum()
    }

    /// Bounds for random points.
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
