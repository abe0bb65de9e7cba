//! A pair of objects with what is left of it, and how it is looked at once.

use super::bounds::Bounds;
use super::compare::{Comparison, Scratch, Survivors, Watch};
use super::crossing::cross;
use super::depth_only;
use super::object::Object;
use super::pass::{Effort, Fit, Part, Pass};
use super::search::{Method, Search, Verdict};

/// Tiles in any bin that are held at once, about 50 bytes each for each of the two.
const MOST_PLACES: usize = 1 << 21;

/// What a round has left.
pub(super) struct Round {
    pub window: Bounds,
    /// Tiles in which both may touch.
    pub tiles: u64,
    /// Whether two triangles were seen to cross or to share a corner.
    pub seen: bool,
}

/// How a round ends.
pub(super) enum Outcome {
    /// Nothing touches.
    Apart,
    /// It would take too long.
    GaveUp,
    /// Something may.
    Left(Round),
}

/// How closely a round looks.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Look {
    pub resolution: u32,
    pub bins: u32,
    pub fit: Fit,
}

/// A pair with what is left of it.
pub(super) struct Pair<'a> {
    objects: [&'a Object; 2],
    /// The triangles of each that may be in the window.
    lists: [Vec<u32>; 2],
    pub window: Bounds,
    pub search: &'a Search,
}

impl<'a> Pair<'a> {
    /// All triangles of both, in what their boxes share during `time`; `None` where that is nothing.
    pub fn new(objects: [&'a Object; 2], time: [f64; 2], search: &'a Search) -> Option<Self> {
        let shared = objects[0].bounds.meet(&objects[1].bounds)?;
        let lists = objects.map(|object| (0..object.len() as u32).collect());
        Some(Self { objects, lists, window: Bounds { time, ..shared }, search })
    }

    /// Without time, as the method knows none.
    pub fn by_depth(&self, scratch: &mut Scratch, watch: &mut impl Watch) -> Verdict {
        let resolution = self.search.resolution;
        match self.depths(resolution, &mut Effort::endless(), scratch, watch) {
            Some(0) => Verdict::Apart,
            tiles => self.maybe(tiles.unwrap_or(0), false),
        }
    }

    /// Tiles that keep both together by their depths alone, none where they are apart; `None` where that takes more than `effort`.
    pub fn depths(
        &self,
        resolution: u32,
        effort: &mut Effort,
        scratch: &mut Scratch,
        watch: &mut impl Watch,
    ) -> Option<u64> {
        let across = (resolution, self.grain());
        depth_only::tiles(self.parts(), &self.window, across, effort, scratch, watch)
    }

    /// At the resolution asked for.
    pub fn once(&mut self, scratch: &mut Scratch, watch: &mut impl Watch) -> Verdict {
        let Search { resolution, bins, .. } = *self.search;
        let look = Look { resolution, bins, fit: Fit::Edges };
        match self.round(look, &mut Effort::endless(), scratch, watch) {
            Outcome::Apart => Verdict::Apart,
            Outcome::GaveUp => self.maybe(0, false),
            Outcome::Left(Round { window, tiles, seen }) => Verdict::Maybe { bounds: window, tiles, seen },
        }
    }

    /// What is left of it may collide.
    pub fn maybe(&self, tiles: u64, seen: bool) -> Verdict {
        Verdict::Maybe { bounds: self.window, tiles, seen }
    }

    /// Tiles narrower than this tell nothing more: their borders are rounded, and corners are unsure, by as much.
    pub fn grain(&self) -> f64 {
        let unsure = self.objects.iter().map(|object| object.unsure());
        unsure.fold(self.window.rounding(), f64::max)
    }

    /// How many are left.
    pub fn triangles(&self) -> usize {
        self.lists.iter().map(Vec::len).sum()
    }

    pub fn parts(&self) -> [Part<'_>; 2] {
        [0, 1].map(|which| Part { object: self.objects[which], list: &self.lists[which] })
    }

    /// Drops the triangles that are never in the window, and of the window what no triangle is in. Says whether anything is left.
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
                Some(left) => self.window = left,
                None => return false,
            }
        }
        true
    }

    /// Three passes. Where it is looked closer, triangles that touch nothing are dropped on the way.
    pub fn round(
        &mut self,
        look: Look,
        effort: &mut Effort,
        scratch: &mut Scratch,
        watch: &mut impl Watch,
    ) -> Outcome {
        let mut left = slices(&self.window, look.bins);
        let (mut tiles, mut seen) = (0, false);
        for axis in 0..3 {
            let Some(hull) = joined(&left) else { return Outcome::Apart };
            let pass = Pass::new(axis, &hull, (look.resolution, self.grain()), look.fit);
            let Some(found) = self.compare(&pass, &left, effort, scratch, watch) else {
                return Outcome::GaveUp;
            };
            tiles = found.tiles;
            seen |= self.search.zoom && self.is_seen(&found);
            if self.search.zoom {
                self.keep(&found);
            }
            left = found.bins;
            if seen {
                break;
            }
        }
        joined(&left).map_or(Outcome::Apart, |window| Outcome::Left(Round { window, tiles, seen }))
    }

    /// Both in one pass, as many bins at once as fit in memory; `None` where that takes more than `effort`.
    fn compare(
        &self,
        pass: &Pass,
        left: &[Option<Bounds>],
        effort: &mut Effort,
        scratch: &mut Scratch,
        watch: &mut impl Watch,
    ) -> Option<Survivors> {
        let mut all = Survivors::none(0, self.parts());
        for bins in left.chunks((MOST_PLACES / pass.tiles()).max(1)) {
            let comparison = Comparison { pass, parts: self.parts(), bins };
            all.join(match self.search.method {
                Method::BoxBox => comparison.boxes_against_boxes(scratch, effort, watch),
                _ => comparison.fragments_against_boxes(scratch, effort, watch),
            }?);
        }
        Some(all)
    }

    /// Keeps the triangles that are alive.
    fn keep(&mut self, found: &Survivors) {
        for (list, alive) in self.lists.iter_mut().zip(&found.alive) {
            let mut alive = alive.iter();
            list.retain(|_| alive.next().copied().unwrap_or(true));
        }
    }

    /// Whether any of the suspects cross.
    fn is_seen(&self, found: &Survivors) -> bool {
        found.suspects.iter().any(|&([a, b], t)| {
            let [one, other] = self.objects;
            cross(&one.triangles[a as usize], &other.triangles[b as usize], t)
        })
    }
}

/// The window cut into equal bins of time; neighbours share the instant between them.
fn slices(window: &Bounds, bins: u32) -> Vec<Option<Bounds>> {
    let [first, last] = window.time;
    let bins = if first == last { 1 } else { bins };
    let border = |bin: u32| {
        if bin == bins { last } else { first + (last - first) * f64::from(bin) / f64::from(bins) }
    };
    (0..bins).map(|bin| Some(Bounds { time: [border(bin), border(bin + 1)], ..*window })).collect()
}

/// The box around what is left of all bins.
fn joined(bins: &[Option<Bounds>]) -> Option<Bounds> {
    bins.iter().flatten().copied().reduce(|a, b| a.hull(&b))
}
