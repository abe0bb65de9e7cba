//! Bounds of a solid, one column per tile, and random points in them that are inside.

use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, Region, View};
use rayon::prelude::*;

use super::{Inside, Stream};

/// The triangles that bound a solid.
pub(super) struct Hull<'a> {
    pub triangles: &'a [MovingTriangle],
    /// Time interval of each triangle.
    pub times: &'a [[f64; 2]],
    /// Whether the third coordinate is time instead of depth.
    pub by_time: bool,
}

/// Range of the third coordinate of a solid in every tile.
#[derive(Clone, Debug)]
pub struct Bounds {
    grid: Grid,
    columns: Vec<Option<[f64; 2]>>,
    /// Triangles that touch each tile.
    pub(super) lists: Vec<Vec<u32>>,
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

impl Bounds {
    pub(super) fn new(hull: &Hull<'_>, grid: Grid) -> Self {
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

    /// Number of tiles that the solid may touch.
    pub fn tiles(&self) -> usize {
        self.columns.iter().flatten().count()
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
