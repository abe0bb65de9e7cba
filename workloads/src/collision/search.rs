//! One pair of objects, looked at closer and closer.

use serde::{Deserialize, Serialize};

use super::bounds::Bounds;
use super::compare::{Comparison, Scratch, Survivors, Watch};
use super::crossing::cross;
use super::depth_only;
use super::frame::Seen;
use super::glance;
use super::object::Object;
use super::pass::{Effort, Fit, Part, Pass};

/// What is compared in a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Each fragment of one object with the box of the other (Fig. 5, right).
    #[default]
    FragmentBox,
    /// The boxes of both (Fig. 5, left).
    BoxBox,
    /// Depths alone, in six passes (Govindaraju et al. 2003, "CULLIDE").
    DepthOnly,
}

/// How closely a pair is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Search {
    /// Tiles across, 1 to 1024.
    pub resolution: u32,
    /// Bins of time in a tile, 1 to 256.
    pub bins: u32,
    /// What is compared.
    pub method: Method,
    /// Whether to look again, closer, at what is left of space and time.
    pub zoom: bool,
}

impl Default for Search {
    fn default() -> Self {
        Self { resolution: 128, bins: 16, method: Method::FragmentBox, zoom: true }
    }
}

/// What is known of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// They do not collide.
    Apart,
    /// They may, and if so, then within `bounds`.
    Maybe {
        /// Where and when.
        bounds: Bounds,
        /// Tiles in which they may, in the last pass that was looked at.
        tiles: u64,
        /// Whether two triangles were seen to cross, as far as rounding can tell.
        seen: bool,
    },
}

impl Verdict {
    /// The same `factor` times as large.
    fn scaled(self, factor: f64) -> Self {
        let Self::Maybe { bounds, tiles, seen } = self else { return self };
        let space = bounds.space.map(|range| range.map(|at| at * factor));
        Self::Maybe { bounds: Bounds { space, ..bounds }, tiles, seen }
    }

    /// Whether the pair has to stay.
    pub fn may_collide(&self) -> bool {
        *self != Self::Apart
    }
}

/// Below this, products of three coordinates would vanish: a pair is then looked at as much larger as brings it near one.
const TINY: f64 = 1e-60;

/// The power of two that brings a small number near one, at most 2^1000: times it, all numbers are exact.
fn enlarging(small: f64) -> f64 {
    const BIAS: u64 = 1023;
    let exponent = BIAS.saturating_sub(small.to_bits() >> 52).min(1000);
    f64::from_bits((BIAS + exponent) << 52)
}

/// Looking closer ends when so much of space and time, and of the triangles, is left of a round.
const STUCK: f64 = 0.5;
/// Tiles across that looking closer begins with, at least; more where there are more than so many triangles for a tile.
const FIRST_TILES: u32 = 8;
const TRIANGLES_A_TILE: f64 = 16.0;
/// So many triangles are looked at by their boxes first.
const MANY: usize = 64;
/// Fragments that may be drawn for a pair before it is let stand: many for few triangles, which are cheap all the same and often
/// nearly touch, and a few for each of many.
const MOST_FRAGMENTS: u64 = 1 << 18;
const LEAST_FRAGMENTS: u64 = 1 << 16;
const FRAGMENTS_LESS: u64 = 128;
const FRAGMENTS_EACH: u64 = 4;
/// Rounds that may be needed to halve space and time down to the spacing of numbers.
const MOST_ROUNDS: u32 = 64;

/// What a round has left.
struct Round {
    window: Bounds,
    tiles: u64,
    seen: bool,
}

/// How a round ends.
enum Outcome {
    /// Nothing touches.
    Apart,
    /// It would take too long.
    GaveUp,
    /// Something may.
    Left(Round),
}

/// Tiles in any bin that are held at once, about 50 bytes each for each of the two.
const MOST_PLACES: usize = 1 << 21;

/// So many triangles of a part say how fast it is.
const SOME: usize = 64;

/// How closely a round looks.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Look {
    resolution: u32,
    bins: u32,
    fit: Fit,
}

impl Search {
    /// Whether `a` and `b` may collide.
    pub(super) fn pair(&self, a: &Object, b: &Object, scratch: &mut Scratch) -> Verdict {
        self.watched(a, b, scratch, &mut ())
    }

    /// The same, with `watch` told what is done.
    pub(super) fn watched(
        &self,
        a: &Object,
        b: &Object,
        scratch: &mut Scratch,
        watch: &mut impl Watch,
    ) -> Verdict {
        let largest = a.largest().max(b.largest());
        if largest > 0.0 && largest < TINY {
            let factor = enlarging(largest);
            let [one, other] = [a, b].map(|object| object.scaled(factor));
            return self.framed(&one, &other, scratch, watch).scaled(1.0 / factor);
        }
        self.framed(a, b, scratch, watch)
    }

    /// In the frame of reference that suits them.
    fn framed(&self, a: &Object, b: &Object, scratch: &mut Scratch, watch: &mut impl Watch) -> Verdict {
        if self.zoom && self.method != Method::DepthOnly {
            let seen = Seen::new(a, b);
            let [one, other] = seen.objects.each_ref();
            return seen.told(self.as_seen(one, other, scratch, watch));
        }
        self.as_seen(a, b, scratch, watch)
    }

    fn as_seen(&self, a: &Object, b: &Object, scratch: &mut Scratch, watch: &mut impl Watch) -> Verdict {
        let Some(window) = a.bounds.meet(&b.bounds) else { return Verdict::Apart };
        let everything = |object: &Object| (0..object.len() as u32).collect::<Vec<_>>();
        let mut search =
            Pair { objects: [a, b], lists: [everything(a), everything(b)], window, search: self };
        match (self.method, self.zoom) {
            (Method::DepthOnly, _) => search.by_depth(scratch, watch),
            (_, false) => search.once(scratch, watch),
            (_, true) => search.closer(scratch, watch),
        }
    }
}

/// A pair with what is left of it.
struct Pair<'a> {
    objects: [&'a Object; 2],
    /// The triangles of each that may be in the window.
    lists: [Vec<u32>; 2],
    window: Bounds,
    search: &'a Search,
}

impl Pair<'_> {
    /// Without time, as the method knows none.
    fn by_depth(&mut self, scratch: &mut Scratch, watch: &mut impl Watch) -> Verdict {
        let tiles = depth_only::tiles(self.parts(), &self.window, self.search.resolution, scratch, watch);
        tiles.map_or(Verdict::Apart, |tiles| Verdict::Maybe { bounds: self.window, tiles, seen: false })
    }

    /// At the resolution asked for.
    fn once(&mut self, scratch: &mut Scratch, watch: &mut impl Watch) -> Verdict {
        if !self.tighten() {
            return Verdict::Apart;
        }
        let Search { resolution, bins, .. } = *self.search;
        let look = Look { resolution, bins, fit: Fit::Edges };
        match self.round(look, &mut Effort::endless(), scratch, watch) {
            Outcome::Apart => Verdict::Apart,
            Outcome::GaveUp => self.maybe(0, false),
            Outcome::Left(Round { window, tiles, seen }) => Verdict::Maybe { bounds: window, tiles, seen },
        }
    }

    fn maybe(&self, tiles: u64, seen: bool) -> Verdict {
        Verdict::Maybe { bounds: self.window, tiles, seen }
    }

    /// From few tiles to many and, wherever that leaves less of space and time, closer. Many triangles are looked at by their boxes
    /// until that no longer helps, those that are left by their edges.
    fn closer(&mut self, scratch: &mut Scratch, watch: &mut impl Watch) -> Verdict {
        if !self.tighten() {
            return Verdict::Apart;
        }
        if glance::crossing(self.parts(), &self.window).is_some() {
            return self.maybe(0, true);
        }
        let most = self.search.resolution;
        let triangles = self.triangles() as u64;
        let few = MOST_FRAGMENTS.saturating_sub(FRAGMENTS_LESS * triangles).max(LEAST_FRAGMENTS);
        let mut effort = Effort::of(few + FRAGMENTS_EACH * triangles);
        let mut fit = if self.triangles() > MANY { Fit::Boxes } else { Fit::Edges };
        let first = (self.triangles() as f64 / TRIANGLES_A_TILE).sqrt() as u32;
        let (mut resolution, mut last) = (first.max(FIRST_TILES).min(most), self.maybe(0, false));
        for _ in 0..MOST_ROUNDS {
            let (before, triangles) = (self.window, self.triangles());
            let look = Look { resolution, bins: self.bins(resolution), fit };
            let round = match self.round(look, &mut effort, scratch, watch) {
                Outcome::Apart => return Verdict::Apart,
                Outcome::GaveUp => break,
                Outcome::Left(round) => round,
            };
            self.window = round.window;
            last = self.maybe(round.tiles, round.seen);
            if round.seen {
                break;
            }
            if !self.tighten() {
                return Verdict::Apart;
            }
            if self.triangles() <= MANY {
                fit = Fit::Edges;
            }
            let stuck = round.window.share_of(&before) > STUCK;
            let crowded = self.triangles() as f64 > STUCK * triangles as f64;
            match (stuck && resolution < most, crowded, fit) {
                (true, ..) => resolution = (2 * resolution).min(most),
                (false, true, Fit::Boxes) => fit = Fit::Edges,
                (false, true, Fit::Edges) if stuck => break,
                _ => {}
            }
        }
        last
    }

    /// Bins of time in which a triangle moves by a tile or so, and no more than asked for.
    fn bins(&self, resolution: u32) -> u32 {
        let [first, last] = self.window.time;
        let step = |part: &Part<'_>| {
            let some = part.list.iter().step_by(part.list.len().div_ceil(SOME).max(1));
            let moved = |triangle: &u32| {
                let [open, close] = &part.object.triangles[*triangle as usize];
                let moved = |axis: usize| {
                    let extent = self.window.space[axis][1] - self.window.space[axis][0];
                    let way = (close[0][axis] - open[0][axis]).abs() * (last - first);
                    if extent > 0.0 { way / extent } else { 0.0 }
                };
                moved(0).max(moved(1)).max(moved(2))
            };
            some.clone().map(moved).sum::<f64>() / some.len().max(1) as f64
        };
        let step = self.parts().iter().map(step).fold(0.0, f64::max);
        ((step * f64::from(resolution)).ceil() as u32).clamp(1, self.search.bins)
    }

    fn triangles(&self) -> usize {
        self.lists.iter().map(Vec::len).sum()
    }

    fn parts(&self) -> [Part<'_>; 2] {
        [0, 1].map(|which| Part { object: self.objects[which], list: &self.lists[which] })
    }

    /// Drops the triangles that are never in the window, and of the window what no triangle is in. Says whether anything is left.
    fn tighten(&mut self) -> bool {
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
    fn round(
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
            let pass = Pass::new(axis, &hull, look.resolution, look.fit);
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
