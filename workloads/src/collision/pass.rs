//! Two objects drawn orthographically along one axis.

use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, Region, View};

use super::bounds::{Bounds, meet};
use super::buffer::{TzBox, TzBuffer};
use super::object::{Ends, Object};
use super::window::times_inside;

/// Part of an object: the triangles that come near.
#[derive(Clone, Copy)]
pub(super) struct Part<'a> {
    pub object: &'a Object,
    pub list: &'a [u32],
}

/// How a pass looks at what may touch.
#[derive(Clone, Copy)]
pub(super) struct Pass {
    /// The axis it looks along.
    axis: usize,
    grid: Grid,
    /// What of space and time it covers.
    hull: Bounds,
}

/// What an object is in one tile in one bin of time.
pub(super) struct Fragment {
    pub tile: [u32; 2],
    pub bin: usize,
    pub inside: TzBox,
}

impl Pass {
    /// A pass along `axis` over `hull` with `resolution` tiles across, one where there is no extent.
    pub fn new(axis: usize, hull: &Bounds, resolution: u32) -> Self {
        let side = |across: usize| {
            let [low, high] = hull.space[(axis + across) % 3];
            // Borders are rounded; the margin keeps the last of them outside.
            let margin = (low.abs() + high.abs()) * 4.0 * f64::EPSILON + 1e-300;
            let count = if low == high { 1 } else { resolution };
            (low - margin, (high - low + 2.0 * margin) / f64::from(count), count)
        };
        let [x, y] = [side(1), side(2)];
        let grid = Grid { origin: [x.0, y.0], tile: [x.1, y.1], columns: x.2, rows: y.2 };
        Self { axis, grid, hull: *hull }
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
        Bounds { space, time: t }
    }

    /// Hands `each` fragment of a part in the bins that are left, until it says stop.
    pub fn draw(&self, part: Part<'_>, bins: &[Option<Bounds>], mut each: impl FnMut(Fragment)) {
        let Part { object, list } = part;
        for &triangle in list {
            let ends = &object.triangles[triangle as usize];
            let Some(times) = times_inside(ends, &self.hull, object.uncertainty) else { continue };
            let Some(turned) = self.turned(ends, object.uncertainty) else { continue };
            for (bin, left) in bins.iter().enumerate() {
                let Some(t) = left.and_then(|left| meet(left.time, times)) else { continue };
                let clip = Region { t, ..Region::WHOLE };
                let rasterizer = Rasterizer::new(View::orthographic()).clipped(clip).halving(HALVINGS);
                rasterizer.rasterize(&turned, &self.grid, |tile, touch| {
                    each(Fragment { tile, bin, inside: TzBox { t: touch.t, z: touch.z, triangle } });
                });
            }
        }
    }

    /// The triangle as it is seen along the axis.
    fn turned(&self, ends: &Ends, uncertainty: f64) -> Option<MovingTriangle> {
        let turn = |p: [f64; 3]| [p[(self.axis + 1) % 3], p[(self.axis + 2) % 3], p[self.axis]];
        let [open, close] = ends.map(|end| end.map(turn));
        MovingTriangle::uncertain(open, close, [uncertainty; 3])
    }
}

/// How often the rasterizer may halve the time of a tile; bins of time do that here.
const HALVINGS: u32 = 1;

/// What of each bin is left after a pass, and what was done for it.
#[derive(Default)]
pub(super) struct Survivors {
    /// By bin, where and when both may touch.
    pub bins: Vec<Option<Bounds>>,
    /// Tiles, in any bin, in which they may.
    pub tiles: u64,
    /// Fragments drawn.
    pub fragments: u64,
    /// Triangles of the first and the second that may touch, and when: some of them.
    pub suspects: Vec<([u32; 2], f64)>,
}

/// So many suspects are named in a pass.
const MOST_SUSPECTS: usize = 48;

impl Survivors {
    /// Nothing is left yet of `bins`.
    pub fn none(bins: usize) -> Self {
        Self { bins: vec![None; bins], ..Self::default() }
    }

    /// Notes that both may touch within `found`.
    pub fn add(&mut self, bin: usize, found: &Bounds, triangles: [u32; 2]) {
        let known = self.bins[bin].get_or_insert(Bounds::NOTHING);
        *known = known.hull(found);
        self.tiles += 1;
        if self.suspects.len() < MOST_SUSPECTS {
            self.suspects.push((triangles, 0.5 * (found.time[0] + found.time[1])));
        }
    }
}

/// The first part's box in each tile against each fragment of the second (Fig. 5, right), both in a bin of time.
pub(super) fn fragments_against_boxes(
    pass: &Pass,
    [first, second]: [Part<'_>; 2],
    bins: &[Option<Bounds>],
    [boxes, _]: &mut [TzBuffer; 2],
) -> Survivors {
    let mut left = Survivors::none(bins.len());
    let mut fragments = 0;
    boxes.clear(pass.tiles() * bins.len());
    pass.draw(first, bins, |fragment| {
        fragments += 1;
        boxes.add(pass.place(fragment.tile, fragment.bin), &fragment.inside);
    });
    pass.draw(second, bins, |Fragment { tile, bin, inside }| {
        fragments += 1;
        let known = boxes.at(pass.place(tile, bin));
        let Some([t, z]) = known.meet(inside.t, inside.z) else { return };
        let found = bins[bin].and_then(|allowed| allowed.meet(&pass.bounds(tile, t, z)));
        if let Some(found) = found {
            left.add(bin, &found, [known.triangle, inside.triangle]);
        }
    });
    left.fragments = fragments;
    left
}

/// The boxes of both in each tile (Fig. 5, left), in a bin of time.
pub(super) fn boxes_against_boxes(
    pass: &Pass,
    parts: [Part<'_>; 2],
    bins: &[Option<Bounds>],
    buffers: &mut [TzBuffer; 2],
) -> Survivors {
    let mut left = Survivors::none(bins.len());
    for (part, boxes) in parts.into_iter().zip(&mut *buffers) {
        boxes.clear(pass.tiles() * bins.len());
        pass.draw(part, bins, |fragment| {
            left.fragments += 1;
            boxes.add(pass.place(fragment.tile, fragment.bin), &fragment.inside);
        });
    }
    let [first, second] = &*buffers;
    for (place, one) in first.used() {
        let other = second.at(place);
        let (tile, bin) = pass.at(place);
        let Some([t, z]) = one.meet(other.t, other.z) else { continue };
        if let Some(found) = bins[bin].and_then(|allowed| allowed.meet(&pass.bounds(tile, t, z))) {
            left.add(bin, &found, [one.triangle, other.triangle]);
        }
    }
    left
}
