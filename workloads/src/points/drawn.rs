//! Random points of boxes, by a pass in conservative mode (thesis, Paper VI, section 5: "the conservative
//! mode can be used and any number of random samples generated over the bounds").
//!
//! A box of the image, time and lens is drawn as two right triangles clipped to spans of `t`, `u` and `v`:
//! (2,1), (2,1,1) or (2,1,1,1)-simploids. The pass has a tile for every column of a [`Lattice`], whose cells
//! have a Poisson number of random candidates each. For every simploid and tile that it may touch, the shader
//! makes the candidates of the cells within the bounds `t^ u^ v^`, and keeps those that are in the simploid
//! and in the domain. Candidates depend on the cell alone, so a candidate falls into one box at most, however
//! bounds overlap, and together they are a Poisson process.
//!
//! In tests `on_host` makes the candidates of all cells and compares each with all boxes: the reference
//! without a rasterizer.

use std::ops::Range;

use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, Region, View};
use pipeline::memory::MemoryRange;
use pipeline::random::mix;
use pipeline::{
    ConservativeDraw, Gpu, Lane, Lanes, PassError, Placement, Primitive, TileIntervals, TileShader, Uses,
};

/// Axes: x, y, time, and both of the lens, each 0 to 1. Of the lens, -1 to 1, one half is used.
pub(super) const AXES: usize = 5;

/// A half-open box of image, time and lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    /// Low corner.
    pub low: [f64; AXES],
    /// High corner.
    pub high: [f64; AXES],
}

impl Cell {
    /// The whole of every axis.
    pub const WHOLE: Self = Self { low: [0.0; AXES], high: [1.0; AXES] };
}

/// Cells of random candidates.
#[derive(Clone, Debug)]
pub(super) struct Lattice {
    /// Cells along each axis.
    pub across: [u32; AXES],
    /// Which axes the candidates have; along the others they are in the middle.
    used: [bool; AXES],
    /// Seed of the candidates.
    pub seed: u32,
    /// Cumulative Poisson probabilities of the number of candidates in a cell, in units of 2^-32.
    cumulative: Vec<u32>,
}

/// Candidates that were kept, in pseudo-random order.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Kept {
    /// Positions of the candidates.
    pub points: Vec<[f64; AXES]>,
    /// Candidates that were made, over all simploids and tiles.
    pub candidates: u64,
    /// Pairs of a simploid and a tile for which the shader ran.
    pub fragments: u64,
    /// Candidates beyond the places of their box in the buffer of results; those overwrite each other's cache lines.
    pub crowded: u64,
}

/// Domain within the boxes; what it does is counted on the lane.
pub(super) trait Within: Sync {
    /// Whether a candidate in a box is in the domain.
    fn contains(&self, lane: &Lane, point: &[f64; AXES]) -> bool;
}

/// The boxes are the domain.
pub(super) struct Everywhere;

impl Within for Everywhere {
    fn contains(&self, _: &Lane, _: &[f64; AXES]) -> bool {
        true
    }
}

/// Most candidates of a cell on average.
pub(super) const MAX_MEAN: f64 = 8.0;
/// Most candidates of a cell. The probability of more is below 2^-64.
const MAX_PER_CELL: usize = 64;
/// Steps of 2^32 by the golden ratio, between the random words of a cell.
const STEP: u32 = 0x9E37_79B9;
/// Places for candidates of a box in the buffer of results.
const PLACES: u64 = 32;
/// Bytes of a coordinate.
const COORDINATE_BYTES: u64 = 8;
/// Bytes of a vertex, without the spans of its box.
const VERTEX_BYTES: u32 = 12;
/// Bytes of a span of time or lens.
const SPAN_BYTES: u32 = 8;

/// A random bijection of 32-bit words ("lowbias32", Wellons 2018).
fn mixed(lane: &Lane, word: u32) -> u32 {
    let word = lane.xor(word, lane.shift_right(word, 16));
    let word = lane.mul_low(word, 0x7FEB_352D);
    let word = lane.xor(word, lane.shift_right(word, 15));
    let word = lane.mul_low(word, 0x846C_A68B);
    lane.xor(word, lane.shift_right(word, 16))
}

impl Lattice {
    /// A lattice with `mean` candidates in a cell on average, random along the axes `used`; `None` if that is
    /// not within 0 and [`MAX_MEAN`].
    pub fn new(across: [u32; AXES], used: &[usize], mean: f64, seed: u64) -> Option<Self> {
        let is_usable = (0.0..=MAX_MEAN).contains(&mean) && across.iter().all(|count| *count > 0);
        let (mut one, mut sum) = (libm::exp(-mean), 0.0);
        let cumulative = (1..=MAX_PER_CELL).map(|count| {
            sum += one;
            one *= mean / count as f64;
            // The cast saturates.
            (sum * 2.0_f64.powi(32)) as u32
        });
        // Mixed, as neighbouring seeds would have the same cells in another order.
        let seed = (mix(seed) >> 32) as u32;
        let used = std::array::from_fn(|axis| used.contains(&axis));
        is_usable.then(|| Self { across, used, seed, cumulative: cumulative.collect() })
    }

    /// Makes the candidates of a cell.
    fn candidates(&self, lane: &Lane, cell: [u32; AXES], mut each: impl FnMut(u32, [f64; AXES])) -> u32 {
        let state = cell.iter().fold(self.seed, |state, &at| mixed(lane, lane.xor(state, at)));
        let word = |number: u32| mixed(lane, lane.xor(state, lane.mul_low(number, STEP)));
        let (chosen, mut count) = (word(1), 0);
        while lane.branch(self.cumulative.get(count as usize).is_some_and(|&sum| sum < chosen)) {
            let first = 2 + count * (AXES as u32 + 1);
            let along = |axis: usize| {
                if !self.used[axis] {
                    return 0.5;
                }
                // In the middle of the words' intervals, so that rounding moves no point out of its cell.
                let unit = lane.madd(lane.number(word(first + axis as u32)), UNIT, 0.5 * UNIT);
                lane.mul(lane.add(f64::from(cell[axis]), unit), 1.0 / f64::from(self.across[axis]))
            };
            let point = std::array::from_fn(along);
            each(word(first + AXES as u32), point);
            count += 1;
        }
        count
    }

    /// Whether a box is beside a tile of cells.
    fn is_apart(&self, lane: &Lane, tile: [u32; 2], cell: &Cell) -> bool {
        (0..2).any(|axis| {
            let at = f64::from(tile[axis]);
            let [low, high] = [at, at + 1.0].map(|at| lane.mul(at, 1.0 / f64::from(self.across[axis])));
            lane.branch(high <= cell.low[axis]) || lane.branch(low >= cell.high[axis])
        })
    }

    /// Cells along an axis that an interval may touch.
    fn span(&self, lane: &Lane, axis: usize, ends: [f64; 2]) -> Range<u32> {
        let count = f64::from(self.across[axis]);
        let [low, high] = ends.map(|end| lane.mul(end, count));
        lane.floor(low) as u32..lane.min(lane.ceil(high) as u32, self.across[axis])
    }
}

/// 2^-32.
const UNIT: f64 = 1.0 / 4_294_967_296.0;

/// Whether a point is in one of the two halves of a box, without what the other one has.
fn is_in(lane: &Lane, cell: &Cell, is_upper: bool, point: &[f64; AXES]) -> bool {
    for (axis, ((&at, &low), &high)) in point.iter().zip(&cell.low).zip(&cell.high).enumerate() {
        let is_limited = axis < 2 || [low, high] != [0.0, 1.0];
        if is_limited && (lane.branch(at < low) || lane.branch(at >= high)) {
            return false;
        }
    }
    let [along, up] = [0, 1].map(|axis| lane.sub(point[axis], cell.low[axis]));
    let [wide, high] = [0, 1].map(|axis| lane.sub(cell.high[axis], cell.low[axis]));
    lane.branch((lane.mul(up, wide) > lane.mul(along, high)) == is_upper)
}

/// Shader that makes and tests candidates.
struct Candidates<'a> {
    cells: &'a [Cell],
    lattice: &'a Lattice,
    within: &'a dyn Within,
    results: MemoryRange,
    point_bytes: u64,
}

/// Result of a tile.
struct Tried {
    candidates: u32,
    crowded: u64,
    kept: Vec<(u32, [f64; AXES])>,
}

impl TileShader for Candidates<'_> {
    /// Results of the box so far.
    type BodyState = u64;
    type Output = Tried;

    fn run(&self, stored: &mut u64, lanes: &Lanes, tile: &TileIntervals<'_>) -> Option<Tried> {
        let (number, is_upper) = (tile.primitive / 2, tile.primitive % 2 == 1);
        let (cell, lattice, touch) = (&self.cells[number], self.lattice, tile.touch);
        let mut tried = Tried { candidates: 0, crowded: 0, kept: Vec::new() };
        let spans = lanes.run(|lane| {
            let is_apart = lattice.is_apart(lane, tile.tile, cell);
            let span = |(axis, range)| lattice.span(lane, axis, range);
            (!is_apart).then(|| [(2, touch.t), (3, touch.u), (4, touch.v)].map(span))
        });
        let Some(spans) = spans else { return Some(tried) };
        for at in cells_within(tile.tile, &spans) {
            let kept = &mut tried.kept;
            tried.candidates += lanes.run(|lane| {
                lattice.candidates(lane, at, |order, point| {
                    if is_in(lane, cell, is_upper, &point) && self.within.contains(lane, &point) {
                        kept.push((order, point));
                    }
                })
            });
        }
        for _ in &tried.kept {
            let place = number as u64 * PLACES + *stored % PLACES;
            lanes.write(self.results, place * self.point_bytes, self.point_bytes);
            tried.crowded += u64::from(*stored >= PLACES);
            *stored += 1;
        }
        Some(tried)
    }
}

/// Cells of a tile within spans of time and lens.
fn cells_within([x, y]: [u32; 2], [t, u, v]: &[Range<u32>; 3]) -> impl Iterator<Item = [u32; AXES]> {
    let of_time = move |t: u32| u.clone().flat_map(move |u| v.clone().map(move |v| [x, y, t, u, v]));
    t.clone().flat_map(of_time)
}

/// The two simploids of every box.
fn primitives(cells: &[Cell], grid: &Grid) -> Vec<Primitive> {
    let of = |(body, cell): (u32, &Cell)| {
        let [t, u, v] = [2, 3, 4].map(|axis| [cell.low[axis], cell.high[axis]]);
        let rasterizer =
            Rasterizer::new(View::orthographic()).clipped(Region { u, v, t }).halving(0).without_depths();
        let ([left, bottom, ..], [right, top, ..]) = (cell.low, cell.high);
        let corner = |x: f64, y: f64| [x, y, 1.0];
        let halves = [
            [corner(left, bottom), corner(right, bottom), corner(right, top)],
            [corner(left, bottom), corner(right, top), corner(left, top)],
        ];
        halves.into_iter().filter_map(move |corners| {
            let triangle = MovingTriangle::new(corners, corners)?;
            // Tiles of the bounding box, and those that meet it at a border.
            let scissor = [(left, right, 0, grid.columns), (bottom, top, 1, grid.rows)].map(
                |(low, high, axis, count)| {
                    let at = |end: f64| (end / grid.tile[axis]) as u32;
                    at(low).saturating_sub(1)..(at(high) + 2).min(count)
                },
            );
            Some(Primitive {
                triangle,
                rasterizer,
                scissor,
                body,
                reuses_vertices: false,
                keeps_back_faces_only: false,
            })
        })
    };
    (0..).zip(cells).flat_map(of).collect()
}

/// Draws boxes, which have to be disjoint, in a pass of `gpu`, and returns the candidates in them and in the domain.
///
/// # Errors
/// [`PassError`] if the GPU refuses the pass.
pub(super) fn draw(
    gpu: &mut Gpu<'_>,
    name: &str,
    cells: &[Cell],
    lattice: &Lattice,
    within: &dyn Within,
) -> Result<Kept, PassError> {
    let [columns, rows, ..] = lattice.across;
    let tile = [columns, rows].map(|count| 1.0 / f64::from(count));
    let grid = Grid { origin: [0.0; 2], tile, columns, rows };
    let primitives = primitives(cells, &grid);
    let axes = lattice.used.iter().filter(|used| **used).count() as u64;
    let point_bytes = axes * COORDINATE_BYTES;
    let results = gpu.allocate(cells.len() as u64 * PLACES * point_bytes);
    let is_span = |axis: &usize| cells.iter().any(|cell| [cell.low[*axis], cell.high[*axis]] != [0.0, 1.0]);
    let vertex_bytes = VERTEX_BYTES + (2..AXES).filter(is_span).count() as u32 * SPAN_BYTES;
    let vertices = gpu.allocate(3 * primitives.len() as u64 * u64::from(vertex_bytes));
    let draw = ConservativeDraw {
        primitives: &primitives,
        grid: &grid,
        block: gpu.spec().tile_px,
        vertices,
        vertex_bytes,
        projection: None,
    };
    let shader = Candidates { cells, lattice, within, results, point_bytes };
    let (mut all, mut ordered) = (Kept::default(), Vec::new());
    // The image shows the whole of x and y, the larger y above.
    let placement = Placement { first: [0.0, 1.0], last: [1.0, 0.0] };
    let mut pass = gpu.begin_conservative(name, Some(placement), Uses::default().colours([results]))?;
    pass.draw(gpu, &draw, &shader, |_, tried| {
        all.fragments += 1;
        all.candidates += u64::from(tried.candidates);
        all.crowded += tried.crowded;
        ordered.extend(tried.kept);
    })?;
    gpu.keep(results);
    all.points = in_order(ordered);
    Ok(all)
}

/// The same points without a rasterizer: the candidates of all cells, each compared with all boxes.
#[cfg(test)]
pub(super) fn on_host(cells: &[Cell], lattice: &Lattice, within: &dyn Within) -> Vec<[f64; AXES]> {
    let (lane, mut found) = (Lane::default(), Vec::new());
    let is_in = |cell: &Cell, point: &[f64; AXES]| {
        (0..AXES).all(|axis| (cell.low[axis]..cell.high[axis]).contains(&point[axis]))
    };
    let count: u64 = lattice.across.iter().map(|&count| u64::from(count)).product();
    for number in 0..count {
        let mut rest = number;
        let at = lattice.across.map(|count| {
            let at = (rest % u64::from(count)) as u32;
            rest /= u64::from(count);
            at
        });
        lattice.candidates(&lane, at, |order, point| {
            if cells.iter().any(|cell| is_in(cell, &point)) && within.contains(&lane, &point) {
                found.push((order, point));
            }
        });
    }
    in_order(found)
}

/// Positions in pseudo-random order.
fn in_order(mut found: Vec<(u32, [f64; AXES])>) -> Vec<[f64; AXES]> {
    found.sort_unstable_by(|(a, p), (b, q)| {
        let axes = || p.iter().zip(q).map(|(p, q)| p.total_cmp(q)).find(|order| order.is_ne());
        a.cmp(b).then_with(|| axes().unwrap_or(std::cmp::Ordering::Equal))
    });
    found.into_iter().map(|(_, point)| point).collect()
}
