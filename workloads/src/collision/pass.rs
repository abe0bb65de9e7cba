//! One object rasterized orthographically along one axis, and the comparison of two objects in such a pass.

use std::ops::Range;

use pipeline::Primitive;
use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, Region, Touch, View};

use super::object::Object;
use super::{Bounds, Ends, NOTHING, TzBox, TzBuffer, hull, meet};

/// The triangles of an object that may be in the window.
#[derive(Clone, Copy)]
pub(super) struct Part<'a> {
    pub object: &'a Object,
    pub list: &'a [u32],
}

/// How tiles and intervals are bounded. Both ways are conservative; a pass uses one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fit {
    /// By the swept box of a triangle in a time bin: cheap, and tight for triangles smaller than a tile.
    Boxes,
    /// By edges and plane, with the conservative rasterizer.
    Edges,
}

/// Fragments that may still be drawn for a pair.
#[derive(Clone, Copy, Debug)]
pub(super) struct FragmentBudget(u64);

impl FragmentBudget {
    /// Without a limit.
    pub fn unlimited() -> Self {
        Self(u64::MAX)
    }

    /// A budget of so many fragments.
    pub fn of(fragments: u64) -> Self {
        Self(fragments)
    }

    /// Subtracts fragments; `false` if they exceed the budget.
    fn spend(&mut self, fragments: u64) -> bool {
        let enough = fragments <= self.0;
        self.0 = self.0.saturating_sub(fragments);
        enough
    }
}

/// Limits of the tile grid of a pass.
#[derive(Clone, Copy)]
pub(super) struct Tiling {
    /// Most tiles across.
    pub resolution: u32,
    /// Least width of a tile. Narrower tiles carry no information: rounding and uncertainty are as large.
    pub min_width: f64,
}

/// A pass: axis, tile grid, and the bounds it covers.
#[derive(Clone, Copy)]
pub(super) struct Pass {
    /// Viewing axis: 0, 1 or 2.
    pub axis: usize,
    grid: Grid,
    /// Space and time that the pass covers.
    hull: Bounds,
    fit: Fit,
    /// Largest difference between tile borders computed by division and by multiplication.
    slack: f64,
}

/// One triangle in one tile and time bin.
#[derive(Clone, Copy)]
pub(super) struct Fragment {
    pub tile: [u32; 2],
    pub bin: usize,
    /// Position of the triangle in the list of the part.
    pub item: u32,
    pub inside: TzBox,
}

impl Pass {
    /// Makes a pass along `axis` over `hull`, with the tiles of `tiling`.
    pub fn new(axis: usize, hull: &Bounds, tiling: Tiling, fit: Fit) -> Self {
        let side = |across: usize| {
            let [low, high] = hull.space[(axis + across) % 3];
            // Tile borders are rounded. The margin keeps the last border outside the bounds.
            let margin = (low.abs() + high.abs()) * 4.0 * f64::EPSILON + 1e-300;
            let count = (((high - low) / tiling.min_width) as u32).clamp(1, tiling.resolution);
            (low - margin, (high - low + 2.0 * margin) / f64::from(count), count)
        };
        let [x, y] = [side(1), side(2)];
        let grid = Grid { origin: [x.0, y.0], tile: [x.1, y.1], columns: x.2, rows: y.2 };
        Self { axis, grid, hull: *hull, fit, slack: hull.rounding() }
    }

    /// Number of tiles.
    pub fn tiles(&self) -> usize {
        self.grid.columns as usize * self.grid.rows as usize
    }

    /// Index of a tile and time bin.
    pub fn place(&self, tile: [u32; 2], bin: usize) -> u32 {
        (bin * self.tiles()) as u32 + tile[1] * self.grid.columns + tile[0]
    }

    /// Tile and time bin of an index.
    pub fn at(&self, place: u32) -> ([u32; 2], usize) {
        let (tile, bin) = (place as usize % self.tiles(), place as usize / self.tiles());
        ([tile as u32 % self.grid.columns, tile as u32 / self.grid.columns], bin)
    }

    /// Bounds of a tile at these times and depths.
    pub fn bounds(&self, [column, row]: [u32; 2], t: [f64; 2], z: [f64; 2]) -> Bounds {
        let rect = self.grid.rect(&(column..column + 1), &(row..row + 1));
        let mut space = [z; 3];
        space[(self.axis + 1) % 3] = rect.x;
        space[(self.axis + 2) % 3] = rect.y;
        // Boxes are assigned to tiles by division; those borders differ from these by rounding.
        let bounds = Bounds { space, time: t };
        if self.fit == Fit::Boxes { bounds.inflated(self.slack) } else { bounds }
    }

    /// Passes every fragment of a part in the remaining time bins to `each`. `false` if the fragments exceed
    /// `budget`; drawing then stops.
    pub fn draw(
        &self,
        part: Part<'_>,
        bins: &[Option<Bounds>],
        budget: &mut FragmentBudget,
        mut each: impl FnMut(&Fragment),
    ) -> bool {
        self.each_bin(part, bins, |drawing, in_bin| drawing.bin(in_bin, budget, &mut each))
    }

    /// Every triangle of a part in every remaining time bin, for conservative mode. Its edges are tested.
    pub fn primitives(&self, part: Part<'_>, bins: &[Option<Bounds>]) -> Vec<BinnedPrimitive> {
        let mut all: Vec<BinnedPrimitive> = Vec::new();
        self.each_bin(part, bins, |drawing, in_bin| {
            let again = all.last().is_some_and(|last| last.item == drawing.item);
            all.extend(drawing.primitive(in_bin, again));
            true
        });
        all
    }

    /// The tiles.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Calls `each` with every triangle in every remaining time bin, until it returns `false`; then so does this.
    fn each_bin(
        &self,
        part: Part<'_>,
        bins: &[Option<Bounds>],
        mut each: impl FnMut(&mut Drawing<'_>, &InBin<'_>) -> bool,
    ) -> bool {
        let Part { object, list } = part;
        let remaining: Vec<(usize, Bounds)> =
            bins.iter().enumerate().filter_map(|(bin, bounds)| bounds.map(|bounds| (bin, bounds))).collect();
        for (&triangle, item) in list.iter().zip(0..) {
            let Some(times) = self.times(object, triangle) else { continue };
            let first = remaining.partition_point(|(_, bounds)| bounds.time[1] < times[0]);
            let open = remaining[first..].iter().take_while(|(_, bounds)| bounds.time[0] <= times[1]);
            let mut drawing = Drawing { pass: self, object, triangle, item, turned: None };
            for (bin, bounds) in open {
                let times = meet(bounds.time, times);
                let in_bin = times.map(|t| InBin { bin: *bin, bounds, t });
                if in_bin.is_some_and(|in_bin| !each(&mut drawing, &in_bin)) {
                    return false;
                }
            }
        }
        true
    }

    /// Times at which a triangle may be inside the bounds of the pass. At a single instant, the box test of
    /// each bin suffices.
    fn times(&self, object: &Object, triangle: u32) -> Option<[f64; 2]> {
        let [first, last] = self.hull.time;
        if first == last { Some(self.hull.time) } else { object.times_inside(triangle, &self.hull) }
    }

    /// Tile that contains a coordinate. The function is monotonic: values between two coordinates lie in the
    /// tiles between.
    fn tile_of(&self, across: usize, at: f64) -> u32 {
        let last = if across == 0 { self.grid.columns } else { self.grid.rows } - 1;
        let tile = (at - self.grid.origin[across]) / self.grid.tile[across];
        // Values beyond either end saturate, and NaN becomes 0.
        (tile as u32).min(last)
    }

    /// Columns and rows that a box touches. With edges, one more on each side allows for rounded borders.
    fn tiles_of(&self, near: &[[f64; 2]; 3]) -> [Range<u32>; 2] {
        let more = u32::from(self.fit == Fit::Edges);
        let counts = [self.grid.columns, self.grid.rows];
        [0, 1].map(|across| {
            let [low, high] = near[(self.axis + across + 1) % 3];
            let (first, last) = (self.tile_of(across, low), self.tile_of(across, high));
            first.saturating_sub(more)..(last + 1 + more).min(counts[across])
        })
    }

    /// The triangle in view space; `None` if its coordinates are too large.
    fn turned(&self, ends: &Ends, uncertainty: f64) -> Option<MovingTriangle> {
        let turn = |p: [f64; 3]| [p[(self.axis + 1) % 3], p[(self.axis + 2) % 3], p[self.axis]];
        let [open, close] = ends.map(|end| end.map(turn));
        MovingTriangle::uncertain(open, close, [uncertainty; 3])
    }
}

/// One time bin of a pass, and when a triangle may be in it.
struct InBin<'a> {
    bin: usize,
    /// Space and time that remain of the bin.
    bounds: &'a Bounds,
    t: [f64; 2],
}

/// A triangle in a time bin, for conservative mode.
pub(super) struct BinnedPrimitive {
    pub primitive: Primitive,
    /// Position of the triangle in the list of the part.
    pub item: u32,
    triangle: u32,
    bin: usize,
}

impl BinnedPrimitive {
    /// The fragment in a tile.
    pub fn fragment(&self, tile: [u32; 2], touch: &Touch) -> Fragment {
        let inside = TzBox { t: touch.t, z: touch.z, triangle: self.triangle };
        Fragment { tile, bin: self.bin, item: self.item, inside }
    }
}

/// A rasterizer of a time bin.
fn rasterizer(t: [f64; 2]) -> Rasterizer {
    let clip = Region { t, ..Region::WHOLE };
    Rasterizer::new(View::orthographic()).clipped(clip).halving(MAX_HALVINGS)
}

/// A triangle being rasterized.
struct Drawing<'a> {
    pass: &'a Pass,
    object: &'a Object,
    triangle: u32,
    item: u32,
    /// The triangle in view space, from the first time bin on.
    turned: Option<MovingTriangle>,
}

impl Drawing<'_> {
    /// Passes the triangle's fragments of one time bin to `each`; `false` if they exceed `budget`.
    fn bin(
        &mut self,
        in_bin: &InBin<'_>,
        budget: &mut FragmentBudget,
        each: &mut impl FnMut(&Fragment),
    ) -> bool {
        let (pass, item, triangle) = (self.pass, self.item, self.triangle);
        let InBin { bin, bounds, t } = *in_bin;
        let Some(near) = near(self.object, triangle, t, bounds) else { return true };
        let [columns, rows] = pass.tiles_of(&near);
        if !budget.spend(columns.len() as u64 * rows.len() as u64) {
            return false;
        }
        let mut emit = |tile, t, z| each(&Fragment { tile, bin, item, inside: TzBox { t, z, triangle } });
        let Some(turned) = self.edges() else {
            for row in rows {
                columns.clone().for_each(|column| emit([column, row], t, near[pass.axis]));
            }
            return true;
        };
        // Refinement goes beyond the precision of `f32`, which is relative to the triangle.
        let rasterizer = rasterizer(t).in_doubles();
        rasterizer
            .rasterize_part(turned, &pass.grid, [columns, rows], |tile, touch| emit(tile, touch.t, touch.z));
        true
    }

    /// The triangle in view space, if this pass tests edges.
    fn edges(&mut self) -> Option<&MovingTriangle> {
        if self.pass.fit == Fit::Edges && self.turned.is_none() {
            let ends = &self.object.triangles[self.triangle as usize];
            self.turned = self.pass.turned(ends, self.object.uncertainty);
        }
        self.turned.as_ref()
    }

    /// The triangle in a time bin; `None` if it is not there.
    fn primitive(&self, in_bin: &InBin<'_>, reuses_vertices: bool) -> Option<BinnedPrimitive> {
        let (pass, item, triangle, bin) = (self.pass, self.item, self.triangle, in_bin.bin);
        let scissor = pass.tiles_of(&near(self.object, triangle, in_bin.t, in_bin.bounds)?);
        let ends = &self.object.triangles[triangle as usize];
        let turned = pass.turned(ends, self.object.uncertainty)?;
        let (rasterizer, body) = (rasterizer(in_bin.t), item);
        let primitive = Primitive {
            triangle: turned,
            rasterizer,
            scissor,
            body,
            reuses_vertices,
            keeps_back_faces_only: false,
        };
        Some(BinnedPrimitive { primitive, item, triangle, bin })
    }
}

/// The part of `remaining` that a triangle sweeps during `t`; `None` if it stays outside.
fn near(object: &Object, triangle: u32, t: [f64; 2], remaining: &Bounds) -> Option<[[f64; 2]; 3]> {
    let triangle = triangle as usize;
    let (ends, whole) = (&object.triangles[triangle], &object.boxes[triangle].space);
    let side = |axis: usize| {
        let swept = if t == [0.0, 1.0] { whole[axis] } else { swept(ends, axis, t, object.uncertainty) };
        meet(swept, remaining.space[axis])
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
    // Three roundings at most affect each end.
    let margin = 8.0 * f64::EPSILON * size + uncertainty;
    [swept[0] - margin, swept[1] + margin]
}

/// Limit on halvings of time in the rasterizer. The time bins of a pass do this instead.
const MAX_HALVINGS: u32 = 1;

/// Reused buffers.
#[derive(Default)]
pub(super) struct Scratch {
    boxes: [TzBuffer; 2],
    fragments: [Vec<StoredFragment>; 2],
}

/// Buffers, remaining fragments and backend of a search.
pub(super) struct Resources<'a, B> {
    pub scratch: &'a mut Scratch,
    pub budget: FragmentBudget,
    pub backend: &'a mut B,
}

/// A fragment that is compared with the overlapping tiles after the pass.
struct StoredFragment {
    place: u32,
    item: u32,
    inside: TzBox,
}

/// What draws the passes: the host, or the modelled hardware. It may record their work.
pub(super) trait PassBackend {
    /// Begins a pass, whose boxes are empty. `follows` says whether the host has read the results of passes before to
    /// choose what it draws.
    fn begin(&mut self, _name: &str, _pass: &Pass, _follows: bool) {}

    /// Draws a part, the first (0) or the second (1) of a pair, and passes its fragments to `each`. The
    /// fragments of the part are compared with the boxes of `known`, or enlarge those of the part. `false` if
    /// they exceed `budget`.
    fn draw(
        &mut self,
        pass: &Pass,
        (which, part): (usize, Part<'_>),
        bins: &[Option<Bounds>],
        budget: &mut FragmentBudget,
        _known: Option<&TzBuffer>,
        each: &mut dyn FnMut(&Fragment),
    ) -> bool {
        self.part(pass, which, part);
        pass.draw(part, bins, budget, |fragment| {
            self.fragment(pass, which, fragment);
            each(fragment);
        })
    }

    /// Compares the boxes of both parts in every tile and time bin, of which there are so many, and if it
    /// `merges` adds those of the second to those of the first.
    fn compare(&mut self, _pass: &Pass, _bins: usize, _boxes: [&TzBuffer; 2], _merges: bool) {}

    /// Reports that a part is drawn: the first (0) or the second (1) of a pair.
    fn part(&mut self, _pass: &Pass, _which: usize, _part: Part<'_>) {}
    /// Reports a fragment of the part.
    fn fragment(&mut self, _pass: &Pass, _which: usize, _fragment: &Fragment) {}
    /// Reports a tile in which both objects may touch.
    fn overlap(&mut self, _pass: &Pass, _tile: [u32; 2]) {}
}

/// Passes that are drawn on the host alone, without reports.
impl PassBackend for () {}

/// Result of a pass.
pub(super) struct Survivors {
    /// Bounds of the contacts in each time bin.
    pub bins: Vec<Option<Bounds>>,
    /// Overlapping tiles of all time bins.
    pub tiles: u64,
    /// Some pairs of triangles that may touch, each with a time.
    pub suspects: Vec<([u32; 2], f64)>,
    /// For each triangle of the two lists, whether it may touch anything.
    pub alive: [Vec<bool>; 2],
}

/// Most suspect pairs per pass.
const MAX_SUSPECTS: usize = 48;

impl Survivors {
    /// An empty result of so many `bins`.
    pub fn none(bins: usize, parts: [Part<'_>; 2]) -> Self {
        Self {
            bins: vec![None; bins],
            tiles: 0,
            suspects: Vec::new(),
            alive: parts.map(|part| vec![false; part.list.len()]),
        }
    }

    /// Appends the result of the next time bins.
    pub fn join(&mut self, next: Self) {
        self.bins.extend(next.bins);
        self.tiles += next.tiles;
        let room = MAX_SUSPECTS.saturating_sub(self.suspects.len());
        self.suspects.extend(next.suspects.into_iter().take(room));
        for (alive, next) in self.alive.iter_mut().zip(next.alive) {
            alive.iter_mut().zip(next).for_each(|(alive, next)| *alive |= next);
        }
    }

    /// Adds an overlapping tile with its bounds.
    fn add(&mut self, bin: usize, found: &Bounds, triangles: [u32; 2]) {
        let known = self.bins[bin].get_or_insert(Bounds::NOTHING);
        *known = known.hull(found);
        self.tiles += 1;
        if self.suspects.len() < MAX_SUSPECTS {
            self.suspects.push((triangles, 0.5 * (found.time[0] + found.time[1])));
        }
    }
}

/// Marks the triangles that have a fragment which meets a box of the other part.
fn mark(alive: &mut [bool], fragments: &[StoredFragment], others: &TzBuffer) {
    for stored in fragments {
        alive[stored.item as usize] |=
            others.at(stored.place).meet(stored.inside.t, stored.inside.z).is_some();
    }
}

/// Parameters of a comparison: pass, parts, and remaining bounds of each time bin.
pub(super) struct Comparison<'a> {
    pub pass: &'a Pass,
    pub parts: [Part<'a>; 2],
    pub bins: &'a [Option<Bounds>],
}

impl Comparison<'_> {
    /// Draws part `which` into its boxes and stores its fragments; `None` if they exceed the budget.
    fn fill(&self, which: usize, resources: &mut Resources<'_, impl PassBackend>) -> Option<()> {
        let Resources { scratch, budget, backend } = resources;
        let (boxes, stored) = (&mut scratch.boxes[which], &mut scratch.fragments[which]);
        stored.clear();
        self.boxed(which, boxes, budget, *backend, |fragment| stored.push(fragment))
    }

    /// Draws part `which` into its boxes and passes its fragments to `each`; `None` if they exceed the budget.
    fn boxed(
        &self,
        which: usize,
        boxes: &mut TzBuffer,
        budget: &mut FragmentBudget,
        backend: &mut impl PassBackend,
        mut each: impl FnMut(StoredFragment),
    ) -> Option<()> {
        boxes.clear(self.pass.tiles() * self.bins.len());
        if which == 0 {
            backend.begin("pair", self.pass, self.pass.axis > 0);
        }
        let part = (which, self.parts[which]);
        let all = backend.draw(self.pass, part, self.bins, budget, None, &mut |fragment| {
            let place = self.pass.place(fragment.tile, fragment.bin);
            boxes.add(place, &fragment.inside);
            each(StoredFragment { place, item: fragment.item, inside: fragment.inside });
        });
        all.then_some(())
    }

    /// Remaining bounds of a time bin, intersected with a tile and its times and depths.
    fn remaining(&self, tile: [u32; 2], bin: usize, [t, z]: [[f64; 2]; 2]) -> Option<Bounds> {
        self.bins[bin].and_then(|allowed| allowed.meet(&self.pass.bounds(tile, t, z)))
    }

    /// Compares the first part's box in each tile with each fragment of the second, per time bin (thesis,
    /// Paper VI, Fig. 5, right). `None` if the fragments exceed the budget.
    pub fn fragments_against_boxes(
        &self,
        resources: &mut Resources<'_, impl PassBackend>,
    ) -> Option<Survivors> {
        let mut result = Survivors::none(self.bins.len(), self.parts);
        self.fill(0, resources)?;
        let Resources { scratch, budget, backend } = resources;
        let [boxes, met] = &mut scratch.boxes;
        met.clear(self.pass.tiles() * self.bins.len());
        let (known_boxes, mut overlaps) = (&*boxes, Vec::new());
        let part = (1, self.parts[1]);
        let all = backend.draw(self.pass, part, self.bins, budget, Some(known_boxes), &mut |fragment| {
            let Fragment { tile, bin, item, inside } = *fragment;
            let place = self.pass.place(tile, bin);
            let known = known_boxes.at(place);
            let Some(both) = known.meet(inside.t, inside.z) else { return };
            let Some(found) = self.remaining(tile, bin, both) else { return };
            result.add(bin, &found, [known.triangle, inside.triangle]);
            result.alive[1][item as usize] = true;
            met.add(place, &TzBox { t: both[0], z: both[1], triangle: inside.triangle });
            overlaps.push(tile);
        });
        overlaps.into_iter().for_each(|tile| backend.overlap(self.pass, tile));
        mark(&mut result.alive[0], &scratch.fragments[0], met);
        all.then_some(result)
    }

    /// Compares the boxes of both parts in each tile, per time bin (Fig. 5, left). `None` if the fragments
    /// exceed `budget`.
    pub fn boxes_against_boxes(&self, resources: &mut Resources<'_, impl PassBackend>) -> Option<Survivors> {
        let mut result = Survivors::none(self.bins.len(), self.parts);
        self.fill(0, resources)?;
        self.fill(1, resources)?;
        let Resources { scratch, backend, .. } = resources;
        let [first, second] = &scratch.boxes;
        backend.compare(self.pass, self.bins.len(), [first, second], false);
        for (place, one) in first.used() {
            let other = second.at(place);
            let (tile, bin) = self.pass.at(place);
            let Some(both) = one.meet(other.t, other.z) else { continue };
            if let Some(found) = self.remaining(tile, bin, both) {
                result.add(bin, &found, [one.triangle, other.triangle]);
                backend.overlap(self.pass, tile);
            }
        }
        for (which, alive) in result.alive.iter_mut().enumerate() {
            mark(alive, &scratch.fragments[which], &scratch.boxes[1 - which]);
        }
        Some(result)
    }

    /// Overlapping tiles by depths alone: where the second part is in front of the first's farthest depth,
    /// and where it is behind the nearest. `None` if the fragments exceed the budget.
    pub fn depths(&self, resources: &mut Resources<'_, impl PassBackend>) -> Option<[u64; 2]> {
        let Resources { scratch, budget, backend } = resources;
        for which in [0, 1] {
            self.boxed(which, &mut scratch.boxes[which], budget, *backend, |_| ())?;
        }
        let [first, second] = &scratch.boxes;
        backend.compare(self.pass, self.bins.len(), [first, second], false);
        let both = || {
            let shared = first.used().map(|(place, one)| (one.z, second.at(place).z));
            shared.filter(|(_, other)| other[0] <= other[1])
        };
        let in_front = both().filter(|(one, other)| other[0] <= one[1]).count() as u64;
        let behind = both().filter(|(one, other)| other[1] >= one[0]).count() as u64;
        Some([in_front, behind])
    }
}
