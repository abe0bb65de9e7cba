//! The edges of a still triangle in a pinhole camera against a tile.

use super::TileRect;
use crate::setup::Triangle;

/// Edge functions `A + X B + Y C` of a still triangle, in `f64` so that only the rounding of the sample test has to be
/// allowed for.
#[derive(Clone, Copy, Debug)]
pub struct StillEdges {
    points: [[f64; 3]; 3],
    edges: [[f64; 3]; 3],
    slack: [f64; 2],
}

impl StillEdges {
    /// Multiply-adds of making the edges.
    pub const SETUP_MADDS: u32 = 18;
    /// Multiply-adds of testing one tile: for each edge the value at the centre and the half extent, two each; for each
    /// vertex its largest distance, two; and three for the allowance.
    pub const TILE_MADDS: u32 = 3 * 4 + 3 * 2 + 3;

    /// The edges of a triangle that does not move, seen through a pinhole.
    pub fn new(triangle: &Triangle) -> Self {
        let points = triangle.corners.map(|corner| corner.open.map(f64::from));
        let edges = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| {
            let ([xi, yi, wi], [xj, yj, wj]) = (points[i], points[j]);
            [xi * yj - xj * yi, yi * wj - yj * wi, wi * xj - wj * xi]
        });
        Self { points, edges, slack: triangle.slack.map(f64::from) }
    }

    /// Whether no sample of `tile` can be inside: one edge is below zero everywhere and another above.
    pub fn miss(&self, tile: &TileRect) -> bool {
        let side = [tile.x, tile.y].map(|side| side.map(f64::from));
        let centre = side.map(|[lo, hi]| 0.5 * (lo + hi));
        let half = side.map(|[lo, hi]| 0.5 * (hi - lo));
        let allowance = self.allowance(&centre, &half);
        let [mut below, mut above] = [false; 2];
        for [a, b, c] in self.edges {
            let value = a + centre[0] * b + centre[1] * c;
            let extent = half[0] * b.abs() + half[1] * c.abs() + allowance;
            below |= value + extent < 0.0;
            above |= value - extent > 0.0;
        }
        below && above
    }

    /// The sample test is exact for points seen from the sample, of which an edge is a cross product, and these are
    /// rounded by up to half the slack on each axis.
    fn allowance(&self, centre: &[f64; 2], half: &[f64; 2]) -> f64 {
        let farthest = |axis: usize| {
            let distance = |p: &[f64; 3]| (p[axis] - centre[axis] * p[2]).abs() + half[axis] * p[2].abs();
            self.points.iter().map(distance).fold(0.0, f64::max)
        };
        let [sx, sy] = self.slack;
        2.0 * (sx * farthest(1) + sy * farthest(0) + sx * sy)
    }
}
