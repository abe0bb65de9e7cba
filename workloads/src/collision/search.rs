//! One pair of objects, looked at closer and closer.

use super::bounds::Bounds;
use super::buffer::TzBuffer;
use super::crossing::cross;
use super::depth_only;
use super::object::Object;
use super::pass::{Part, Pass, Survivors, boxes_against_boxes, fragments_against_boxes};
use super::window::times_inside;

/// What is compared in a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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
    /// Whether the pair has to stay.
    pub fn may_collide(&self) -> bool {
        *self != Self::Apart
    }
}

/// Buffers used over and over.
#[derive(Default)]
pub(super) struct Scratch {
    buffers: [TzBuffer; 2],
}

/// Looking closer ends when so much of space and time is left of a round.
const STUCK: f64 = 0.5;
/// Fragments that may be drawn for a pair before it is let stand, and more for each of its triangles.
const MOST_FRAGMENTS: u64 = 1 << 16;
const FRAGMENTS_EACH: u64 = 16;
/// Rounds that may be needed to halve space and time down to the spacing of numbers.
const MOST_ROUNDS: u32 = 64;

/// What a round has left.
struct Round {
    window: Bounds,
    tiles: u64,
    fragments: u64,
    seen: bool,
}

impl Search {
    /// Whether `a` and `b` may collide.
    pub(super) fn pair(&self, a: &Object, b: &Object, scratch: &mut Scratch) -> Verdict {
        let Some(window) = a.bounds.meet(&b.bounds) else { return Verdict::Apart };
        let everything = |object: &Object| (0..object.len() as u32).collect::<Vec<_>>();
        let mut search =
            Pair { objects: [a, b], lists: [everything(a), everything(b)], window, search: self };
        match (self.method, self.zoom) {
            (Method::DepthOnly, _) => search.by_depth(scratch),
            (_, false) => search.once(scratch),
            (_, true) => search.closer(scratch),
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
    fn by_depth(&mut self, scratch: &mut Scratch) -> Verdict {
        let tiles =
            depth_only::tiles(self.parts(), &self.window, self.search.resolution, &mut scratch.buffers);
        tiles.map_or(Verdict::Apart, |tiles| Verdict::Maybe { bounds: self.window, tiles, seen: false })
    }

    /// At the resolution asked for.
    fn once(&mut self, scratch: &mut Scratch) -> Verdict {
        if !self.tighten() {
            return Verdict::Apart;
        }
        let round = self.round(self.search.resolution, self.search.bins, scratch);
        round.map_or(Verdict::Apart, |Round { window, tiles, seen, .. }| Verdict::Maybe {
            bounds: window,
            tiles,
            seen,
        })
    }

    /// From few tiles to many and, wherever that leaves less of space and time, closer.
    fn closer(&mut self, scratch: &mut Scratch) -> Verdict {
        let triangles = self.lists.iter().map(|list| list.len() as u64).sum::<u64>();
        let budget = MOST_FRAGMENTS + FRAGMENTS_EACH * triangles;
        let (mut resolution, mut bins, mut spent) =
            (8.min(self.search.resolution), 2.min(self.search.bins), 0);
        let mut last = Verdict::Maybe { bounds: self.window, tiles: 0, seen: false };
        for _ in 0..MOST_ROUNDS {
            if !self.tighten() {
                return Verdict::Apart;
            }
            let before = self.window;
            let Some(round) = self.round(resolution, bins, scratch) else { return Verdict::Apart };
            spent += round.fragments;
            self.window = round.window;
            last = Verdict::Maybe { bounds: round.window, tiles: round.tiles, seen: round.seen };
            let at_most = resolution == self.search.resolution && bins == self.search.bins;
            let stuck = round.window.share_of(&before) > STUCK;
            if round.seen || spent > budget || (stuck && at_most) {
                break;
            }
            if stuck {
                resolution = (2 * resolution).min(self.search.resolution);
                bins = (2 * bins).min(self.search.bins);
            }
        }
        last
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
                let ends = &object.triangles[triangle as usize];
                let Some(times) = times_inside(ends, &window, object.uncertainty) else { return false };
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

    /// Three passes; `None` where they show that nothing touches.
    fn round(&self, resolution: u32, bins: u32, scratch: &mut Scratch) -> Option<Round> {
        let mut left = slices(&self.window, bins);
        let (mut tiles, mut fragments, mut seen) = (0, 0, false);
        for axis in 0..3 {
            let pass = Pass::new(axis, &joined(&left)?, resolution);
            let compare = match self.search.method {
                Method::BoxBox => boxes_against_boxes,
                _ => fragments_against_boxes,
            };
            let found = compare(&pass, self.parts(), &left, &mut scratch.buffers);
            (tiles, fragments) = (found.tiles, fragments + found.fragments);
            seen |= self.search.zoom && self.is_seen(&found);
            left = found.bins;
            if seen {
                break;
            }
        }
        joined(&left).map(|window| Round { window, tiles, fragments, seen })
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
