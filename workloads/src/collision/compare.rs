//! Two objects in one pass: where and when both may touch, and which triangles may.

use super::bounds::Bounds;
use super::buffer::{TzBox, TzBuffer};
use super::pass::{Effort, Fragment, Part, Pass};

/// Buffers used over and over.
#[derive(Default)]
pub(super) struct Scratch {
    boxes: [TzBuffer; 2],
    fragments: [Vec<Kept>; 2],
}

/// A fragment that is looked at again when it is known which tiles are left.
struct Kept {
    place: u32,
    item: u32,
    inside: TzBox,
}

/// What is told of a pass while it goes on.
pub(super) trait Watch {
    /// A part is drawn: the first (0) or the second of a pair.
    fn part(&mut self, _pass: &Pass, _which: usize, _part: Part<'_>) {}
    /// A fragment of it.
    fn fragment(&mut self, _pass: &Pass, _which: usize, _fragment: &Fragment) {}
    /// Both may touch in a tile.
    fn left(&mut self, _pass: &Pass, _tile: [u32; 2]) {}
}

/// Nobody watches.
impl Watch for () {}

/// What of each bin is left after a pass, and what was done for it.
pub(super) struct Survivors {
    /// By bin, where and when both may touch.
    pub bins: Vec<Option<Bounds>>,
    /// Tiles, in any bin, in which they may.
    pub tiles: u64,
    /// Triangles of the first and the second that may touch, and when: some of them.
    pub suspects: Vec<([u32; 2], f64)>,
    /// For each place in the two lists, whether its triangle may touch anything.
    pub alive: [Vec<bool>; 2],
}

/// So many suspects are named in a pass.
const MOST_SUSPECTS: usize = 48;

impl Survivors {
    /// Nothing is left yet of `bins`.
    pub fn none(bins: usize, parts: [Part<'_>; 2]) -> Self {
        Self {
            bins: vec![None; bins],
            tiles: 0,
            suspects: Vec::new(),
            alive: parts.map(|part| vec![false; part.list.len()]),
        }
    }

    /// Adds what is left of the bins that come next.
    pub fn join(&mut self, next: Self) {
        self.bins.extend(next.bins);
        self.tiles += next.tiles;
        let room = MOST_SUSPECTS.saturating_sub(self.suspects.len());
        self.suspects.extend(next.suspects.into_iter().take(room));
        for (alive, next) in self.alive.iter_mut().zip(next.alive) {
            alive.iter_mut().zip(next).for_each(|(alive, next)| *alive |= next);
        }
    }

    /// Notes that both may touch within `found`.
    fn add(&mut self, bin: usize, found: &Bounds, triangles: [u32; 2]) {
        let known = self.bins[bin].get_or_insert(Bounds::NOTHING);
        *known = known.hull(found);
        self.tiles += 1;
        if self.suspects.len() < MOST_SUSPECTS {
            self.suspects.push((triangles, 0.5 * (found.time[0] + found.time[1])));
        }
    }
}

/// Marks the triangles alive of which a fragment meets the boxes of the other part.
fn mark(alive: &mut [bool], fragments: &[Kept], others: &TzBuffer) {
    for kept in fragments {
        alive[kept.item as usize] |= others.at(kept.place).meet(kept.inside.t, kept.inside.z).is_some();
    }
}

/// What is compared and how: a pass, the two parts, and what of each bin is left.
pub(super) struct Comparison<'a> {
    pub pass: &'a Pass,
    pub parts: [Part<'a>; 2],
    pub bins: &'a [Option<Bounds>],
}

impl Comparison<'_> {
    /// Draws part `which` into the boxes of its tiles, and keeps its fragments; `None` where that takes more than `effort`.
    fn fill(
        &self,
        which: usize,
        scratch: &mut Scratch,
        effort: &mut Effort,
        watch: &mut impl Watch,
    ) -> Option<()> {
        let (boxes, kept) = (&mut scratch.boxes[which], &mut scratch.fragments[which]);
        kept.clear();
        self.boxed(which, boxes, effort, watch, |kept_one| kept.push(kept_one))
    }

    /// Draws part `which` into the boxes of its tiles, and hands `each` of its fragments; as above.
    fn boxed(
        &self,
        which: usize,
        boxes: &mut TzBuffer,
        effort: &mut Effort,
        watch: &mut impl Watch,
        mut each: impl FnMut(Kept),
    ) -> Option<()> {
        boxes.clear(self.pass.tiles() * self.bins.len());
        watch.part(self.pass, which, self.parts[which]);
        let all = self.pass.draw(self.parts[which], self.bins, effort, |fragment| {
            watch.fragment(self.pass, which, fragment);
            let place = self.pass.place(fragment.tile, fragment.bin);
            boxes.add(place, &fragment.inside);
            each(Kept { place, item: fragment.item, inside: fragment.inside });
        });
        all.then_some(())
    }

    /// The part of a bin in which both may touch, when they may within `[t, z]` of a tile.
    fn left_of(&self, tile: [u32; 2], bin: usize, [t, z]: [[f64; 2]; 2]) -> Option<Bounds> {
        self.bins[bin].and_then(|allowed| allowed.meet(&self.pass.bounds(tile, t, z)))
    }

    /// The first part's box in each tile against each fragment of the second (Fig. 5, right), both in a bin of time. `None` where
    /// that takes more than `effort`.
    pub fn fragments_against_boxes(
        &self,
        scratch: &mut Scratch,
        effort: &mut Effort,
        watch: &mut impl Watch,
    ) -> Option<Survivors> {
        let mut left = Survivors::none(self.bins.len(), self.parts);
        self.fill(0, scratch, effort, watch)?;
        let [boxes, met] = &mut scratch.boxes;
        met.clear(self.pass.tiles() * self.bins.len());
        watch.part(self.pass, 1, self.parts[1]);
        let all = self.pass.draw(self.parts[1], self.bins, effort, |fragment| {
            let Fragment { tile, bin, item, inside } = *fragment;
            watch.fragment(self.pass, 1, fragment);
            let place = self.pass.place(tile, bin);
            let known = boxes.at(place);
            let Some(both) = known.meet(inside.t, inside.z) else { return };
            let Some(found) = self.left_of(tile, bin, both) else { return };
            left.add(bin, &found, [known.triangle, inside.triangle]);
            left.alive[1][item as usize] = true;
            met.add(place, &TzBox { t: both[0], z: both[1], triangle: inside.triangle });
            watch.left(self.pass, tile);
        });
        mark(&mut left.alive[0], &scratch.fragments[0], met);
        all.then_some(left)
    }

    /// The boxes of both in each tile (Fig. 5, left), in a bin of time; as above.
    pub fn boxes_against_boxes(
        &self,
        scratch: &mut Scratch,
        effort: &mut Effort,
        watch: &mut impl Watch,
    ) -> Option<Survivors> {
        let mut left = Survivors::none(self.bins.len(), self.parts);
        self.fill(0, scratch, effort, watch)?;
        self.fill(1, scratch, effort, watch)?;
        let [first, second] = &scratch.boxes;
        for (place, one) in first.used() {
            let other = second.at(place);
            let (tile, bin) = self.pass.at(place);
            let Some(both) = one.meet(other.t, other.z) else { continue };
            if let Some(found) = self.left_of(tile, bin, both) {
                left.add(bin, &found, [one.triangle, other.triangle]);
                watch.left(self.pass, tile);
            }
        }
        for (which, alive) in left.alive.iter_mut().enumerate() {
            mark(alive, &scratch.fragments[which], &scratch.boxes[1 - which]);
        }
        Some(left)
    }

    /// Depths alone: tiles in which the second is in front of the farthest of the first, and behind its nearest. `None` where that takes
    /// more than `effort`.
    pub fn depths(
        &self,
        scratch: &mut Scratch,
        effort: &mut Effort,
        watch: &mut impl Watch,
    ) -> Option<[u64; 2]> {
        for which in [0, 1] {
            self.boxed(which, &mut scratch.boxes[which], effort, watch, |_| ())?;
        }
        let [first, second] = &scratch.boxes;
        let both = || {
            let shared = first.used().map(|(place, one)| (one.z, second.at(place).z));
            shared.filter(|(_, other)| other[0] <= other[1])
        };
        let in_front = both().filter(|(one, other)| other[0] <= one[1]).count() as u64;
        let behind = both().filter(|(one, other)| other[1] >= one[0]).count() as u64;
        Some([in_front, behind])
    }
}
