//! One object drawn orthographically along one axis.

use std::ops::Range;

use pipeline::conservative::{Grid, MovingTriangle, Prepared, Rasterizer, Region, View};

use super::bounds::Ends;
use super::bounds::{Bounds, NOTHING, hull, meet};
use super::buffer::TzBox;
use super::object::Object;

/// Part of an object: the triangles that come near.
#[derive(Clone, Copy)]
pub(super) struct Part<'a> {
    pub object: &'a Object,
    pub list: &'a [u32],
}

/// How closely a triangle is fitted with tiles and intervals. Both are conservative; a pass draws all with the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fit {
    /// By the box it sweeps within a bin of time: cheap, and near the truth where triangles are smaller than tiles.
    Boxes,
    /// By edges and plane, as the conservative rasterizer has them.
    Edges,
}

/// Fragments that may still be drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort(u64);

impl Effort {
    /// As many as it takes.
    pub fn endless() -> Self {
        Self(u64::MAX)
    }

    /// So many fragments.
    pub fn of(fragments: u64) -> Self {
        Self(fragments)
    }

    /// Takes what is spent; `false` where that is more than there is.
    fn spend(&mut self, fragments: u64) -> bool {
        let enough = fragments <= self.0;
        self.0 = self.0.saturating_sub(fragments);
        enough
    }
}

/// How a pass looks at what may touch.
#[derive(Clone, Copy)]
pub(super) struct Pass {
    /// The axis it looks along.
    pub axis: usize,
    grid: Grid,
    /// What of space and time it covers.
    hull: Bounds,
    fit: Fit,
    /// By how much borders of tiles by division and by multiplication may differ.
    slack: f64,
}

/// What an object is in one tile in one bin of time.
#[derive(Clone, Copy)]
pub(super) struct Fragment {
    pub tile: [u32; 2],
    pub bin: usize,
    /// Place of its triangle in the list of the part.
    pub item: u32,
    pub inside: TzBox,
}

impl Pass {
    /// A pass along `axis` over `hull` with `resolution` tiles across, fewer where they would be narrower than `grain`.
    pub fn new(axis: usize, hull: &Bounds, (resolution, grain): (u32, f64), fit: Fit) -> Self {
        let side = |across: usize| {
            let [low, high] = hull.space[(axis + across) % 3];
            // Borders are rounded; the margin keeps the last of them outside.
            let margin = (low.abs() + high.abs()) * 4.0 * f64::EPSILON + 1e-300;
            let count = (((high - low) / grain) as u32).clamp(1, resolution);
            (low - margin, (high - low + 2.0 * margin) / f64::from(count), count)
        };
        let [x, y] = [side(1), side(2)];
        let grid = Grid { origin: [x.0, y.0], tile: [x.1, y.1], columns: x.2, rows: y.2 };
        Self { axis, grid, hull: *hull, fit, slack: hull.rounding() }
    }

    /// Tiles of the pass.
    pub fn tiles(&self) -> usize {
        self.grid.columns as usize * self.grid.rows as usize
    }

    /// The place of a tile and a bin among all.
    pub fn place(&self, tile: [u32; 2], bin: usize) -> u32 {
        (bin * self.tiles()) as u32 + tile[1] * self.grid.columns + tile[0]
    }

    /// The tile and the bin at a place.
    pub fn at(&self, place: u32) -> ([u32; 2], usize) {
        let (tile, bin) = (place as usize % self.tiles(), place as usize / self.tiles());
        ([tile as u32 % self.grid.columns, tile as u32 / self.grid.columns], bin)
    }

    /// What a tile covers at these times and depths.
    pub fn bounds(&self, [column, row]: [u32; 2], t: [f64; 2], z: [f64; 2]) -> Bounds {
        let rect = self.grid.rect(&(column..column + 1), &(row..row + 1));
        let mut space = [z; 3];
        space[(self.axis + 1) % 3] = rect.x;
        space[(self.axis + 2) % 3] = rect.y;
        // Boxes are put into tiles by division, whose borders may differ from these by rounding.
        let bounds = Bounds { space, time: t };
        if self.fit == Fit::Boxes { bounds.inflated(self.slack) } else { bounds }
    }

    /// Hands `each` fragment of a part in the bins that are left. Says whether that was all of them: where they are more than
    /// `effort`, the rest is left out.
    pub fn draw(
        &self,
        part: Part<'_>,
        bins: &[Option<Bounds>],
        effort: &mut Effort,
        mut each: impl FnMut(&Fragment),
    ) -> bool {
        let Part { object, list } = part;
        let left: Vec<(usize, Bounds)> =
            bins.iter().enumerate().filter_map(|(bin, left)| left.map(|left| (bin, left))).collect();
        for (&triangle, item) in list.iter().zip(0..) {
            let Some(times) = self.times(object, triangle) else { continue };
            let first = left.partition_point(|(_, left)| left.time[1] < times[0]);
            let open = left[first..].iter().take_while(|(_, left)| left.time[0] <= times[1]);
            let mut drawing = Drawing { pass: self, object, triangle, item, prepared: None };
            for (bin, left) in open {
                if !drawing.bin(*bin, left, times, effort, &mut each) {
                    return false;
                }
            }
        }
        true
    }

    /// When a triangle may be in what the pass covers; at an instant its box says that better.
    fn times(&self, object: &Object, triangle: u32) -> Option<[f64; 2]> {
        let [first, last] = self.hull.time;
        if first == last { Some(self.hull.time) } else { object.times_inside(triangle, &self.hull) }
    }

    /// The tile that holds a coordinate; a function that never falls, so that what lies between two lies in the tiles between.
    fn tile_of(&self, across: usize, at: f64) -> u32 {
        let last = if across == 0 { self.grid.columns } else { self.grid.rows } - 1;
        let tile = (at - self.grid.origin[across]) / self.grid.tile[across];
        // Numbers beyond either end, and none at all, saturate.
        (tile as u32).min(last)
    }

    /// Columns and rows that hold a box, with one more all around where its border may be a hair off.
    fn tiles_of(&self, near: &[[f64; 2]; 3]) -> [Range<u32>; 2] {
        let more = u32::from(self.fit == Fit::Edges);
        let counts = [self.grid.columns, self.grid.rows];
        [0, 1].map(|across| {
            let [low, high] = near[(self.axis + across + 1) % 3];
            let (first, last) = (self.tile_of(across, low), self.tile_of(across, high));
            first.saturating_sub(more)..(last + 1 + more).min(counts[across])
        })
    }

    /// The triangle as it is seen along the axis; `None` where it is too large to be seen by its edges.
    fn prepared(&self, ends: &Ends, uncertainty: f64) -> Option<Prepared> {
        let turn = |p: [f64; 3]| [p[(self.axis + 1) % 3], p[(self.axis + 2) % 3], p[self.axis]];
        let [open, close] = ends.map(|end| end.map(turn));
        let turned = MovingTriangle::uncertain(open, close, [uncertainty; 3])?;
        Some(Rasterizer::new(View::orthographic()).prepare(&turned))
    }
}

/// A triangle being drawn.
struct Drawing<'a> {
    pass: &'a Pass,
    object: &'a Object,
    triangle: u32,
    item: u32,
    /// Made for the first bin it is in.
    prepared: Option<Prepared>,
}

impl Drawing<'_> {
    /// Hands `each` of its fragments in a bin; `false` where they are more than `effort`.
    fn bin(
        &mut self,
        bin: usize,
        left: &Bounds,
        times: [f64; 2],
        effort: &mut Effort,
        each: &mut impl FnMut(&Fragment),
    ) -> bool {
        let (pass, item, triangle) = (self.pass, self.item, self.triangle);
        let Some(t) = meet(left.time, times) else { return true };
        let Some(near) = near(self.object, triangle, t, left) else { return true };
        let [columns, rows] = pass.tiles_of(&near);
        if !effort.spend(columns.len() as u64 * rows.len() as u64) {
            return false;
        }
        let mut tell = |tile, t, z| each(&Fragment { tile, bin, item, inside: TzBox { t, z, triangle } });
        let Some(prepared) = self.edges() else {
            for row in rows {
                columns.clone().for_each(|column| tell([column, row], t, near[pass.axis]));
            }
            return true;
        };
        let clip = Region { t, ..Region::WHOLE };
        let rasterizer = Rasterizer::new(View::orthographic()).clipped(clip).halving(HALVINGS);
        rasterizer.rasterize_part(prepared, &pass.grid, [columns, rows], |tile, touch| {
            tell(tile, touch.t, touch.z)
        });
        true
    }

    /// The triangle with its edges, where these are looked at.
    fn edges(&mut self) -> Option<&Prepared> {
        if self.pass.fit == Fit::Edges && self.prepared.is_none() {
            let ends = &self.object.triangles[self.triangle as usize];
            self.prepared = self.pass.prepared(ends, self.object.unsure());
        }
        self.prepared.as_ref()
    }
}

/// The part of `left` that a triangle sweeps during `t`, or `None` where it stays outside.
fn near(object: &Object, triangle: u32, t: [f64; 2], left: &Bounds) -> Option<[[f64; 2]; 3]> {
    let triangle = triangle as usize;
    let (ends, whole) = (&object.triangles[triangle], &object.boxes[triangle].space);
    let side = |axis: usize| {
        let swept = if t == [0.0, 1.0] { whole[axis] } else { swept(ends, axis, t, object.unsure()) };
        meet(swept, left.space[axis])
    };
    Some([side(0)?, side(1)?, side(2)?])
}

/// Least and greatest coordinate of a triangle during `t`.
fn swept(ends: &Ends, axis: usize, t: [f64; 2], uncertainty: f64) -> [f64; 2] {
    let (mut swept, mut size) = (NOTHING, 0.0_f64);
    for (from, to) in ends[0].iter().zip(&ends[1]).map(|(from, to)| (from[axis], to[axis])) {
        let at = |t: f64| from + t * (to - from);
        let first = at(t[0]);
        let last = if t[0] == t[1] { first } else { at(t[1]) };
        swept = hull(swept, [first.min(last), first.max(last)]);
        size = size.max(from.abs()).max(to.abs());
    }
    // Each end is off by three roundings at most.
    let margin = 8.0 * f64::EPSILON * size + uncertainty;
    [swept[0] - margin, swept[1] + margin]
}

/// How often the rasterizer may halve the time of a tile; bins of time do that here.
const HALVINGS: u32 = 1;
