//! The search of a pair of objects: its parameters, its result, and the space and time that remain.

use serde::{Deserialize, Serialize};

use super::Bounds;
use super::contact_probe::cross;
use super::object::Object;
use super::pass::{
    Comparison, Fit, FragmentBudget, Part, Pass, PassBackend, Resources, Scratch, Survivors, Tiling,
};

/// What a pass compares in a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CollisionMethod {
    /// Each fragment of one object with the box of the other (thesis, Paper VI, Fig. 5, right).
    #[default]
    FragmentBox,
    /// The boxes of both objects (Fig. 5, left).
    BoxBox,
    /// Depths alone, in six passes (Govindaraju et al. 2003, "CULLIDE").
    DepthOnly,
}

/// Parameters of the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PairSearch {
    /// Tiles across, 1 to 1024.
    pub resolution: u32,
    /// Time bins per tile, 1 to 256.
    pub bins: u32,
    /// What is compared.
    pub method: CollisionMethod,
    /// Whether to refine: search the remaining space and time again with smaller tiles.
    pub zoom: bool,
}

impl Default for PairSearch {
    fn default() -> Self {
        Self { resolution: 128, bins: 16, method: CollisionMethod::FragmentBox, zoom: true }
    }
}

/// Result of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PairVerdict {
    /// The objects do not collide.
    Apart,
    /// The objects may collide; every contact lies within `bounds`.
    Maybe {
        /// Space and time that contain every contact.
        bounds: Bounds,
        /// Overlapping tiles of the last pass; with refinement, of its last.
        tiles: u64,
        /// Whether two triangles were found to cross or to share a corner, beyond rounding errors.
        seen: bool,
    },
}

impl PairVerdict {
    /// Scales the bounds by `factor`.
    pub(super) fn scaled(self, factor: f64) -> Self {
        let Self::Maybe { bounds, tiles, seen } = self else { return self };
        let space = bounds.space.map(|range| range.map(|at| at * factor));
        Self::Maybe { bounds: Bounds { space, ..bounds }, tiles, seen }
    }

    /// Whether the pair stays in the potentially colliding set.
    pub fn may_collide(&self) -> bool {
        *self != Self::Apart
    }

    /// Whether two triangles were found to cross or to share a corner.
    pub fn is_contact(&self) -> bool {
        matches!(self, Self::Maybe { seen: true, .. })
    }
}

/// Most tiles, over all time bins, in memory at once; each takes about 50 bytes per object.
const MAX_TILES_IN_MEMORY: usize = 1 << 21;

/// Result of a round with overlapping tiles.
pub(super) struct Round {
    pub window: Bounds,
    /// Tiles in which both objects may touch.
    pub tiles: u64,
    /// Whether two triangles were found to cross or to share a corner.
    pub seen: bool,
}

/// Result of a round.
pub(super) enum PairResult {
    /// The objects are apart.
    Apart,
    /// The fragments exceeded the budget.
    BudgetExceeded,
    /// The objects may touch.
    Overlap(Round),
}

/// Parameters of the passes of a round.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct PassParams {
    pub resolution: u32,
    pub bins: u32,
    pub fit: Fit,
}

/// A pair of objects and its remaining search window.
pub(super) struct Pair<'a> {
    objects: [&'a Object; 2],
    /// Triangles of each object that may be in the window.
    lists: [Vec<u32>; 2],
    pub window: Bounds,
    pub search: &'a PairSearch,
}

impl<'a> Pair<'a> {
    /// All triangles of both objects, in the intersection of their boxes during `time`; `None` if that is
    /// empty.
    pub fn new(objects: [&'a Object; 2], time: [f64; 2], search: &'a PairSearch) -> Option<Self> {
        let shared = objects[0].bounds.meet(&objects[1].bounds)?;
        let lists = objects.map(|object| (0..object.len() as u32).collect());
        Some(Self { objects, lists, window: Bounds { time, ..shared }, search })
    }

    /// Searches by depths alone, without time bins. A pair that exceeds the budget stays.
    pub fn by_depth(&self, resources: &mut Resources<'_, impl PassBackend>) -> PairVerdict {
        match self.depths(self.search.resolution, resources) {
            Some(0) => PairVerdict::Apart,
            tiles => self.maybe(tiles.unwrap_or(0), false),
        }
    }

    /// Fewest overlapping tiles of the six passes by depths alone; 0 means apart. `None` if the fragments
    /// exceed the budget.
    pub fn depths(&self, resolution: u32, resources: &mut Resources<'_, impl PassBackend>) -> Option<u64> {
        let tiling = Tiling { resolution, min_width: self.min_tile_width() };
        let mut fewest = u64::MAX;
        for axis in 0..3 {
            let pass = Pass::new(axis, &self.window, tiling, Fit::Edges);
            let comparison = Comparison { pass: &pass, parts: self.parts(), bins: &[Some(self.window)] };
            let [in_front, behind] = comparison.depths(resources)?;
            fewest = fewest.min(in_front).min(behind);
        }
        Some(fewest)
    }

    /// Searches once, at the requested resolution. A pair that exceeds the budget stays.
    pub fn once(&mut self, resources: &mut Resources<'_, impl PassBackend>) -> PairVerdict {
        let PairSearch { resolution, bins, .. } = *self.search;
        match self.round(PassParams { resolution, bins, fit: Fit::Edges }, resources) {
            PairResult::Apart => PairVerdict::Apart,
            PairResult::BudgetExceeded => self.maybe(0, false),
            PairResult::Overlap(Round { window, tiles, seen }) => {
                PairVerdict::Maybe { bounds: window, tiles, seen }
            }
        }
    }

    /// The verdict that the pair may collide within the window.
    pub fn maybe(&self, tiles: u64, seen: bool) -> PairVerdict {
        PairVerdict::Maybe { bounds: self.window, tiles, seen }
    }

    /// Least useful width of a tile. Rounding of borders and uncertainty of corners are as large.
    pub fn min_tile_width(&self) -> f64 {
        let uncertainty = self.objects.iter().map(|object| object.uncertainty);
        uncertainty.fold(self.window.rounding(), f64::max)
    }

    /// Triangles of both objects in the window.
    pub fn triangles(&self) -> usize {
        self.lists.iter().map(Vec::len).sum()
    }

    pub fn parts(&self) -> [Part<'_>; 2] {
        [0, 1].map(|which| Part { object: self.objects[which], list: &self.lists[which] })
    }

    /// Drops triangles that are never in the window, and shrinks the window to the rest. `false` if nothing
    /// remains.
    pub fn tighten(&mut self) -> bool {
        for which in 0..2 {
            let (object, window) = (self.objects[which], self.window);
            let mut within = Bounds::NOTHING;
            self.lists[which].retain(|&triangle| {
                let Some(part) = object.boxes[triangle as usize].meet(&window) else { return false };
                let Some(times) = object.times_inside(triangle, &window) else { return false };
                within = within.hull(&Bounds { time: times, ..part });
                true
            });
            match self.window.meet(&within) {
                Some(remaining) => self.window = remaining,
                None => return false,
            }
        }
        true
    }

    /// Runs three passes. When refining, drops triangles that touch nothing after each pass.
    pub fn round(
        &mut self,
        params: PassParams,
        resources: &mut Resources<'_, impl PassBackend>,
    ) -> PairResult {
        let mut remaining = time_bins(&self.window, params.bins);
        let (mut tiles, mut seen) = (0, false);
        for axis in 0..3 {
            let Some(hull) = joined(&remaining) else { return PairResult::Apart };
            let tiling = Tiling { resolution: params.resolution, min_width: self.min_tile_width() };
            let pass = Pass::new(axis, &hull, tiling, params.fit);
            let Some(found) = self.compare(&pass, &remaining, resources) else {
                return PairResult::BudgetExceeded;
            };
            tiles = found.tiles;
            seen |= self.search.zoom && self.has_crossing(&found);
            if self.search.zoom {
                self.keep(&found);
            }
            remaining = found.bins;
            if seen {
                break;
            }
        }
        joined(&remaining)
            .map_or(PairResult::Apart, |window| PairResult::Overlap(Round { window, tiles, seen }))
    }

    /// Compares both objects in one pass, in chunks of time bins that fit in memory; `None` if the fragments
    /// exceed the budget.
    fn compare(
        &self,
        pass: &Pass,
        remaining: &[Option<Bounds>],
        resources: &mut Resources<'_, impl PassBackend>,
    ) -> Option<Survivors> {
        let mut all = Survivors::none(0, self.parts());
        for bins in remaining.chunks((MAX_TILES_IN_MEMORY / pass.tiles()).max(1)) {
            let comparison = Comparison { pass, parts: self.parts(), bins };
            all.join(match self.search.method {
                CollisionMethod::BoxBox => comparison.boxes_against_boxes(resources),
                _ => comparison.fragments_against_boxes(resources),
            }?);
        }
        Some(all)
    }

    /// Keeps the triangles marked as alive.
    fn keep(&mut self, found: &Survivors) {
        for (list, alive) in self.lists.iter_mut().zip(&found.alive) {
            let mut alive = alive.iter();
            list.retain(|_| alive.next().copied().unwrap_or(true));
        }
    }

    /// Whether any of the suspect pairs of triangles cross.
    fn has_crossing(&self, found: &Survivors) -> bool {
        found.suspects.iter().any(|&([a, b], t)| {
            let [one, other] = self.objects;
            cross(&one.triangles[a as usize], &other.triangles[b as usize], t)
        })
    }
}

/// The window split into equal time bins. Neighbours share the instant between them.
pub(super) fn time_bins(window: &Bounds, bins: u32) -> Vec<Option<Bounds>> {
    let [first, last] = window.time;
    let bins = if first == last { 1 } else { bins };
    let border = |bin: u32| {
        if bin == bins { last } else { first + (last - first) * f64::from(bin) / f64::from(bins) }
    };
    (0..bins).map(|bin| Some(Bounds { time: [border(bin), border(bin + 1)], ..*window })).collect()
}

/// Bounding box of the remaining bins.
fn joined(bins: &[Option<Bounds>]) -> Option<Bounds> {
    bins.iter().flatten().copied().reduce(|a, b| a.hull(&b))
}

/// Refinement ends when a round keeps more than this share of space and time, and of the triangles.
const MAX_REMAINING_SHARE: f64 = 0.5;
/// Least number of tiles across in the first round.
const MIN_FIRST_TILES: u32 = 8;
/// Triangles per tile above which the first round uses more tiles.
const TRIANGLES_PER_TILE: f64 = 16.0;
/// Triangles above which a round starts with boxes instead of edges.
const MIN_TRIANGLES_FOR_BOXES: usize = 64;
/// Triangles up to which edges are tried before smaller tiles. They leave fewer fragments, which pays for the
/// smaller tiles. For more triangles, boxes cull most at less cost.
const MAX_TRIANGLES_FOR_EDGES: usize = 1024;
/// Most fragments for a pair of few triangles. They are cheap, and often nearly touch.
const MAX_FRAGMENTS: u64 = 1 << 18;
/// Least number of fragments for a pair.
const MIN_FRAGMENTS: u64 = 1 << 16;
/// Reduction of the budget per triangle, down to [`MIN_FRAGMENTS`].
const FRAGMENTS_LESS_PER_TRIANGLE: u64 = 128;
/// Additional fragments per triangle.
const FRAGMENTS_PER_TRIANGLE: u64 = 4;
/// Most rounds. As many halve space and time down to the precision of a double.
const MAX_ROUNDS: u32 = 64;

/// Triangles per part that are sampled for its speed.
const SAMPLED_TRIANGLES: usize = 64;

impl Pair<'_> {
    /// Searches with few tiles, then with more; smaller windows give smaller tiles. Many triangles are tested
    /// by their boxes until that no longer helps, the remaining ones by their edges.
    pub fn refine(&mut self, scratch: &mut Scratch, backend: &mut impl PassBackend) -> PairVerdict {
        if !self.tighten() {
            return PairVerdict::Apart;
        }
        let most = self.search.resolution;
        let mut resources = Resources { scratch, budget: self.budget(), backend };
        let mut fit = if self.triangles() > MIN_TRIANGLES_FOR_BOXES { Fit::Boxes } else { Fit::Edges };
        let first = (self.triangles() as f64 / TRIANGLES_PER_TILE).sqrt() as u32;
        let (mut resolution, mut last) = (first.max(MIN_FIRST_TILES).min(most), self.maybe(0, false));
        for _ in 0..MAX_ROUNDS {
            let (before, triangles) = (self.window, self.triangles());
            let params = PassParams { resolution, bins: self.bins(resolution), fit };
            let round = match self.round(params, &mut resources) {
                PairResult::Apart => return PairVerdict::Apart,
                PairResult::BudgetExceeded => break,
                PairResult::Overlap(round) => round,
            };
            self.window = round.window;
            last = self.maybe(round.tiles, round.seen);
            if round.seen {
                break;
            }
            if !self.tighten() {
                return PairVerdict::Apart;
            }
            if self.triangles() <= MIN_TRIANGLES_FOR_BOXES {
                fit = Fit::Edges;
            }
            let window_remains = round.window.share_of(&before) > MAX_REMAINING_SHARE;
            let triangles_remain = self.triangles() as f64 > MAX_REMAINING_SHARE * triangles as f64;
            let can_double = window_remains && resolution < most;
            match fit {
                Fit::Boxes
                    if triangles_remain && (!can_double || self.triangles() <= MAX_TRIANGLES_FOR_EDGES) =>
                {
                    fit = Fit::Edges
                }
                _ if can_double => resolution = (2 * resolution).min(most),
                Fit::Edges if triangles_remain && window_remains => break,
                _ => {}
            }
        }
        last
    }

    /// Searches by depths alone, with few tiles, then with more. Objects that few tiles separate are apart. A
    /// pair that exceeds its budget stays.
    pub fn refine_by_depth(&self, scratch: &mut Scratch, backend: &mut impl PassBackend) -> PairVerdict {
        let most = self.search.resolution;
        let mut resources = Resources { scratch, budget: self.budget(), backend };
        let (mut resolution, mut last) = (MIN_FIRST_TILES.min(most), 0);
        while let Some(tiles) = self.depths(resolution, &mut resources) {
            if tiles == 0 {
                return PairVerdict::Apart;
            }
            last = tiles;
            if resolution == most {
                break;
            }
            resolution = (2 * resolution).min(most);
        }
        self.maybe(last, false)
    }

    /// Fragment budget of the pair.
    fn budget(&self) -> FragmentBudget {
        let triangles = self.triangles() as u64;
        let few = MAX_FRAGMENTS.saturating_sub(FRAGMENTS_LESS_PER_TRIANGLE * triangles).max(MIN_FRAGMENTS);
        FragmentBudget::of(few + FRAGMENTS_PER_TRIANGLE * triangles)
    }

    /// Time bins in which a triangle moves by about one tile, limited by the requested number.
    fn bins(&self, resolution: u32) -> u32 {
        let ([first, last], min_tile_width) = (self.window.time, self.min_tile_width());
        let step = |part: &Part<'_>| {
            let sampled = part.list.iter().step_by(part.list.len().div_ceil(SAMPLED_TRIANGLES).max(1));
            let moved = |triangle: &u32| {
                let [open, close] = &part.object.triangles[*triangle as usize];
                let moved = |axis: usize| {
                    let extent = self.window.space[axis][1] - self.window.space[axis][0];
                    let distance = (close[0][axis] - open[0][axis]).abs() * (last - first);
                    if extent > 0.0 {
                        distance / (extent / f64::from(resolution)).max(min_tile_width)
                    } else {
                        0.0
                    }
                };
                moved(0).max(moved(1)).max(moved(2))
            };
            sampled.clone().map(moved).sum::<f64>() / sampled.len().max(1) as f64
        };
        let step = self.parts().iter().map(step).fold(0.0, f64::max);
        (step.ceil() as u32).clamp(1, self.search.bins)
    }
}

#[cfg(test)]
mod tests {
    use super::super::detect::UNREFINED_FRAGMENTS;
    use super::super::families::slide;
    use super::super::pass::{Fragment, Pass};
    use super::super::{CollisionMethod, Object, PairSearch, detect};
    use super::*;

    /// Counts fragments.
    struct Drawn(u64);

    impl PassBackend for Drawn {
        fn fragment(&mut self, _: &Pass, _: usize, _: &Fragment) {
            self.0 += 1;
        }
    }

    /// Two triangles that are closer than any tile can separate. Both budgets are spent: that of refinement, and that
    /// of the search at full resolution.
    #[test]
    fn refinement_ends_with_every_method() {
        let slanted = |x: f64| [[x, 0.0, 0.0], [x + 1.0, 0.0, 1.0], [x, 1.0, 1.0]];
        let object = |x: f64| Object::from_ends(vec![[slanted(x); 2]], 0.0).unwrap();
        for method in [CollisionMethod::FragmentBox, CollisionMethod::BoxBox, CollisionMethod::DepthOnly] {
            let search = PairSearch { resolution: 1024, bins: 16, method, zoom: true };
            let mut drawn = Drawn(0);
            let verdict =
                search.pair_observed(&object(0.0), &object(1e-7), &mut Scratch::default(), &mut drawn);
            let most = MAX_FRAGMENTS + UNREFINED_FRAGMENTS;
            assert!(verdict.may_collide() && drawn.0 <= most + 8, "{method:?}: {}", drawn.0);
        }
    }

    /// Plates that move and fill every image in every time bin, closer than a tile can separate.
    #[test]
    fn the_search_at_full_resolution_ends_at_its_budget() {
        let plate = |x: f64, moved: f64| {
            let corner = |y: f64, z: f64| [x + y + z + moved, y + moved, z + moved];
            let [a, b, c, d] = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
            [[a, b, c], [a, c, d]]
        };
        let object = |x: f64, moved: f64| {
            let [open, close] = [plate(x, 0.0), plate(x, moved)];
            Object::from_ends(vec![[open[0], close[0]], [open[1], close[1]]], 0.0).unwrap()
        };
        let [a, b] = [object(0.0, 0.0), object(1e-7, 1e-3)];
        let drawn = |zoom: bool| {
            let (search, mut drawn) =
                (PairSearch { resolution: 288, zoom, ..PairSearch::default() }, Drawn(0));
            let verdict = search.pair_observed(&a, &b, &mut Scratch::default(), &mut drawn);
            assert!(verdict.may_collide());
            drawn.0
        };
        let [refined, unlimited] = [true, false].map(drawn);
        let most = MAX_FRAGMENTS + UNREFINED_FRAGMENTS;
        assert!(unlimited > most, "{unlimited}");
        assert!(refined <= most + 8 && refined > UNREFINED_FRAGMENTS / 4, "{refined}");
    }

    #[test]
    fn more_tiles_keep_no_more_plates_that_slide_along_each_other() {
        for gap in [0.03, 0.1] {
            let kept = |resolution: u32| {
                let search = PairSearch { resolution, ..PairSearch::default() };
                let keeps = |seed: &u64| detect(&slide(*seed, gap), &search)[0].verdict.may_collide();
                (0..8).filter(keeps).count()
            };
            let kept = [8, 16, 64].map(kept);
            assert!(kept.is_sorted_by(|few, more| few >= more), "gap {gap}: {kept:?}");
        }
    }

    /// A corner that runs into the middle of a triangle. The remaining window soon reaches the precision of a
    /// double.
    #[test]
    fn refinement_ends_at_the_precision_of_a_double() {
        let floor = [[0.0, 0.0, 0.1], [1.0, 0.0, 0.2], [0.0, 1.0, 0.4]];
        let falling = |z: f64| [[0.3, 0.3, z], [0.31, 0.3, z + 1.0], [0.3, 0.32, z + 1.0]];
        let [a, b] =
            [[floor; 2], [falling(1.0), falling(0.22)]].map(|ends| Object::from_ends(vec![ends], 0.0));
        let (a, b) = (a.unwrap(), b.unwrap());
        let drawn = |zoom: bool| {
            let (search, mut drawn) = (PairSearch { zoom, ..PairSearch::default() }, Drawn(0));
            let verdict = search.pair_observed(&a, &b, &mut Scratch::default(), &mut drawn);
            assert!(verdict.may_collide());
            drawn.0
        };
        // The pair is refined, then drawn once as without refinement.
        let [both, once] = [true, false].map(drawn);
        assert!(once > 0 && both > once && both - once < MAX_FRAGMENTS / 4, "{both} {once}");
    }
}
