//! Comparison of two objects in one pass: bounds of the contacts, and triangles that may touch.

use super::bounds::{Bounds, TzBox, TzBuffer};
use super::pass::{Fragment, FragmentBudget, Part, Pass};

/// Reused buffers.
#[derive(Default)]
pub(super) struct Scratch {
    boxes: [TzBuffer; 2],
    fragments: [Vec<StoredFragment>; 2],
}

/// A fragment that is compared with the overlapping tiles after the pass.
struct StoredFragment {
    place: u32,
    item: u32,
    inside: TzBox,
}

/// Observer of the work of a pass.
pub(super) trait Observer {
    /// Reports that a part is drawn: the first (0) or the second (1) of a pair.
    fn part(&mut self, _pass: &Pass, _which: usize, _part: Part<'_>) {}
    /// Reports a fragment of the part.
    fn fragment(&mut self, _pass: &Pass, _which: usize, _fragment: &Fragment) {}
    /// Reports a tile in which both objects may touch.
    fn overlap(&mut self, _pass: &Pass, _tile: [u32; 2]) {}
}

/// No observer.
impl Observer for () {}

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
    /// Draws part `which` into its boxes and stores its fragments; `None` if they exceed `budget`.
    fn fill(
        &self,
        which: usize,
        scratch: &mut Scratch,
        budget: &mut FragmentBudget,
        observer: &mut impl Observer,
    ) -> Option<()> {
        let (boxes, stored) = (&mut scratch.boxes[which], &mut scratch.fragments[which]);
        stored.clear();
        self.boxed(which, boxes, budget, observer, |fragment| stored.push(fragment))
    }

    /// Draws part `which` into its boxes and passes its fragments to `each`; `None` if they exceed `budget`.
    fn boxed(
        &self,
        which: usize,
        boxes: &mut TzBuffer,
        budget: &mut FragmentBudget,
        observer: &mut impl Observer,
        mut each: impl FnMut(StoredFragment),
    ) -> Option<()> {
        boxes.clear(self.pass.tiles() * self.bins.len());
        observer.part(self.pass, which, self.parts[which]);
        let all = self.pass.draw(self.parts[which], self.bins, budget, |fragment| {
            observer.fragment(self.pass, which, fragment);
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
    /// Paper VI, Fig. 5, right). `None` if the fragments exceed `budget`.
    pub fn fragments_against_boxes(
        &self,
        scratch: &mut Scratch,
        budget: &mut FragmentBudget,
        observer: &mut impl Observer,
    ) -> Option<Survivors> {
        let mut result = Survivors::none(self.bins.len(), self.parts);
        self.fill(0, scratch, budget, observer)?;
        let [boxes, met] = &mut scratch.boxes;
        met.clear(self.pass.tiles() * self.bins.len());
        observer.part(self.pass, 1, self.parts[1]);
        let all = self.pass.draw(self.parts[1], self.bins, budget, |fragment| {
            let Fragment { tile, bin, item, inside } = *fragment;
            observer.fragment(self.pass, 1, fragment);
            let place = self.pass.place(tile, bin);
            let known = boxes.at(place);
            let Some(both) = known.meet(inside.t, inside.z) else { return };
            let Some(found) = self.remaining(tile, bin, both) else { return };
            result.add(bin, &found, [known.triangle, inside.triangle]);
            result.alive[1][item as usize] = true;
            met.add(place, &TzBox { t: both[0], z: both[1], triangle: inside.triangle });
            observer.overlap(self.pass, tile);
        });
        mark(&mut result.alive[0], &scratch.fragments[0], met);
        all.then_some(result)
    }

    /// Compares the boxes of both parts in each tile, per time bin (Fig. 5, left). `None` if the fragments
    /// exceed `budget`.
    pub fn boxes_against_boxes(
        &self,
        scratch: &mut Scratch,
        budget: &mut FragmentBudget,
        observer: &mut impl Observer,
    ) -> Option<Survivors> {
        let mut result = Survivors::none(self.bins.len(), self.parts);
        self.fill(0, scratch, budget, observer)?;
        self.fill(1, scratch, budget, observer)?;
        let [first, second] = &scratch.boxes;
        for (place, one) in first.used() {
            let other = second.at(place);
            let (tile, bin) = self.pass.at(place);
            let Some(both) = one.meet(other.t, other.z) else { continue };
            if let Some(found) = self.remaining(tile, bin, both) {
                result.add(bin, &found, [one.triangle, other.triangle]);
                observer.overlap(self.pass, tile);
            }
        }
        for (which, alive) in result.alive.iter_mut().enumerate() {
            mark(alive, &scratch.fragments[which], &scratch.boxes[1 - which]);
        }
        Some(result)
    }

    /// Overlapping tiles by depths alone: where the second part is in front of the first's farthest depth,
    /// and where it is behind the nearest. `None` if the fragments exceed `budget`.
    pub fn depths(
        &self,
        scratch: &mut Scratch,
        budget: &mut FragmentBudget,
        observer: &mut impl Observer,
    ) -> Option<[u64; 2]> {
        for which in [0, 1] {
            self.boxed(which, &mut scratch.boxes[which], budget, observer, |_| ())?;
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
