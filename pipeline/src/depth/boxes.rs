//! The farthest and nearest stored depth of a tile, for disjoint boxes that cover lens and time (thesis, Paper VI, section 3).

use super::BoxGrid;
use crate::sampling::TileSamples;
use crate::traversal::Box5;

/// What is known of the stored depths in one box.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Known {
    farthest: f32,
    nearest: f32,
    /// Whether the farthest depth is out of date.
    stale: bool,
    /// Whether what is being written lowered the nearest depth.
    lowered: bool,
    /// Where its slots begin and end among those sorted by box.
    slots: [u32; 2],
    /// The first of these that was the farthest when last looked for.
    witness: u32,
}

impl Known {
    /// Nothing stored, and no slots yet of those that will be sorted from `first` on.
    fn cleared(first: u32, farthest: f32) -> Self {
        let (nearest, slots, witness) = (f32::INFINITY, [first; 2], first);
        Self { farthest, nearest, stale: false, lowered: false, slots, witness }
    }

    /// Finds the farthest depth anew. As depths only come nearer, it is what it was where any slot still has it, and slots
    /// before the witness do not: most often one look is enough.
    fn renew(&mut self, depth: &[f32], slots: &[u16]) {
        self.stale = false;
        let [first, end] = self.slots.map(|at| at as usize);
        let is = |farthest: f32| move |&slot: &u16| depth[slot as usize] == farthest;
        if let Some(step) = slots[self.witness as usize..end].iter().position(is(self.farthest)) {
            self.witness += step as u32;
            return;
        }
        let own = &slots[first..end];
        self.farthest = own.iter().map(|&slot| depth[slot as usize]).fold(f32::NEG_INFINITY, f32::max);
        self.witness = (first + own.iter().position(is(self.farthest)).unwrap_or(0)) as u32;
    }
}

/// Where a triangle may be seen, as far as depths tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visible {
    /// What holds every box it is not behind in; `None` where it is hidden.
    pub within: Option<Box5>,
    /// Whether it is nearer than all that is stored there, so that no comparison is needed.
    pub in_front: bool,
    /// Boxes looked at.
    pub compared: u32,
    /// Boxes it is behind in.
    pub behind: u32,
}

impl Visible {
    /// In a tile where nothing is stored.
    pub fn unknown(within: &Box5) -> Self {
        Self { within: Some(*within), in_front: true, compared: 1, behind: 0 }
    }
}

/// The farthest and nearest stored depth of a tile by boxes of lens and time.
///
/// Stored depths only ever come nearer. So a farthest depth that is not up to date is too far, which is safe for culling;
/// [`Self::renew`] finds it anew. The nearest is always up to date.
#[derive(Clone, Debug)]
pub struct DepthBoxes {
    grid: BoxGrid,
    boxes: Vec<Known>,
    /// The box of each slot; empty where there is one only.
    places: Vec<u16>,
    /// The slots sorted by box.
    slots: Vec<u16>,
}

impl DepthBoxes {
    /// Of a tile with `samples`, all of them infinitely far.
    pub fn cleared(grid: BoxGrid, samples: &TileSamples) -> Self {
        let place = |slot| grid.of_sample(samples.u[slot], samples.v[slot], samples.t[slot]) as u16;
        let places = if grid.len() == 1 { Vec::new() } else { (0..samples.len).map(place).collect() };
        let mut counts = vec![0; grid.len()];
        (0..samples.len).for_each(|slot| counts[places.get(slot).map_or(0, |&place| place as usize)] += 1);
        let mut first = 0;
        let boxes = counts.into_iter().map(|count| {
            first += count;
            // A box without samples hides everything and is hidden by nothing.
            let hides = count == 0 && samples.len > 0;
            Known::cleared(first - count, if hides { f32::NEG_INFINITY } else { f32::INFINITY })
        });
        let mut boxes = Self { grid, boxes: boxes.collect(), places, slots: vec![0; samples.len] };
        boxes.sort_slots();
        boxes
    }

    fn sort_slots(&mut self) {
        for slot in 0..self.slots.len() {
            let place = self.place(slot);
            let end = &mut self.boxes[place].slots[1];
            self.slots[*end as usize] = slot as u16;
            *end += 1;
        }
    }

    /// Of a tile whose samples have these depths.
    pub fn of(grid: BoxGrid, samples: &TileSamples, depth: &[f32]) -> Self {
        let mut boxes = Self::cleared(grid, samples);
        for (slot, &depth) in depth.iter().enumerate() {
            let place = boxes.place(slot);
            let known = &mut boxes.boxes[place];
            (known.nearest, known.stale) = (known.nearest.min(depth), true);
        }
        boxes.renew(depth);
        boxes
    }

    /// How lens and time are divided.
    pub fn grid(&self) -> &BoxGrid {
        &self.grid
    }

    /// No sample of `within` is farther than this.
    pub fn farthest(&self, within: &Box5) -> f32 {
        let boxes = self.grid.overlapping(within).map(|(index, _)| self.boxes[index].farthest);
        boxes.fold(f32::NEG_INFINITY, f32::max)
    }

    /// No sample of `within` is nearer than this.
    pub fn nearest(&self, within: &Box5) -> f32 {
        let boxes = self.grid.overlapping(within).map(|(index, _)| self.boxes[index].nearest);
        boxes.fold(f32::INFINITY, f32::min)
    }

    /// Where in `within` a triangle may be seen, its depth in a part of it being `depth(part)`, given as the nearest and the
    /// farthest. For each box it overlaps that depth is compared with the stored ones.
    pub fn look(&self, within: &Box5, mut depth: impl FnMut(&Box5) -> [f32; 2]) -> Visible {
        let mut visible = Visible { within: None, in_front: true, compared: 0, behind: 0 };
        for (index, part) in self.grid.overlapping(within) {
            let ([lo, hi], known) = (depth(&part), &self.boxes[index]);
            visible.compared += 1;
            if lo > known.farthest {
                visible.behind += 1;
                continue;
            }
            visible.in_front &= hi < known.nearest;
            visible.within = Some(visible.within.map_or(part, |before: Box5| before.hull(&part)));
        }
        // A box it is behind in may lie between those where it is not.
        let seen = (visible.compared - visible.behind) as usize;
        visible.in_front &= visible.within.is_some_and(|rest| self.grid.overlapping(&rest).count() == seen);
        visible
    }

    fn place(&self, slot: usize) -> usize {
        self.places.get(slot).map_or(0, |&place| place as usize)
    }

    /// Notes that the depths in `slots` came nearer. Returns how many boxes have a new nearest depth.
    pub fn write(&mut self, depth: &[f32], slots: &[u16]) -> u32 {
        let mut lowered = 0;
        for &slot in slots {
            let place = self.place(slot as usize);
            let (known, depth) = (&mut self.boxes[place], depth[slot as usize]);
            known.stale = true;
            if depth < known.nearest {
                lowered += u32::from(!std::mem::replace(&mut known.lowered, true));
                known.nearest = depth;
            }
        }
        if lowered > 0 {
            self.boxes.iter_mut().for_each(|known| known.lowered = false);
        }
        lowered
    }

    /// Finds the farthest depths that are out of date. Returns how many.
    pub fn renew(&mut self, depth: &[f32]) -> u32 {
        let stale = self.boxes.iter().filter(|known| known.stale).count();
        if stale == 0 {
            return 0;
        }
        for known in self.boxes.iter_mut().filter(|known| known.stale) {
            known.renew(depth, &self.slots);
        }
        stale as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::grid::tests::{holds, samples};

    fn boxes() -> Vec<Box5> {
        let ranges = [[-1.0, 1.0], [-0.3, 0.2], [0.5, 1.0], [0.25, 0.25], [-1.0, -0.5]];
        let all = ranges.iter().flat_map(|&u| ranges.iter().map(move |&v| (u, v)));
        all.flat_map(|(u, v)| [[0.0, 1.0], [0.2, 0.4], [0.75, 0.75]].map(|t| Box5 { u, v, t, lens: true }))
            .collect()
    }

    #[test]
    fn boxes_know_the_nearest_and_farthest_of_their_samples() {
        let samples = samples();
        let mut depths = DepthBoxes::cleared(BoxGrid::new([2, 3, 4], true).unwrap(), &samples);
        let mut depth = vec![f32::INFINITY; samples.len];
        for round in 0..20_u32 {
            let slots: Vec<u16> = (0..samples.len as u16)
                .filter(|slot| mix(u32::from(*slot), round).is_multiple_of(3))
                .collect();
            slots.iter().for_each(|&slot| {
                depth[slot as usize] = (mix(u32::from(slot), round + 99) % 1000) as f32 / (round + 1) as f32
            });
            // Depths only come nearer.
            let before = depths.clone();
            let nearer: Vec<u16> =
                slots.into_iter().filter(|&slot| depth[slot as usize] < f32::INFINITY).collect();
            depths.write(&depth, &nearer);
            for within in boxes() {
                let inside = || {
                    (0..samples.len).filter(|&slot| holds(&within, &samples, slot)).map(|slot| depth[slot])
                };
                assert!(
                    inside().fold(f32::INFINITY, f32::min)
                        >= depths.nearest(&within).min(before.nearest(&within))
                );
            }
            depths.renew(&depth);
            for within in boxes() {
                let inside = || {
                    (0..samples.len).filter(|&slot| holds(&within, &samples, slot)).map(|slot| depth[slot])
                };
                assert!(inside().fold(f32::NEG_INFINITY, f32::max) <= depths.farthest(&within), "{within:?}");
            }
            let whole = Box5::whole(true);
            assert_eq!(depths.farthest(&whole), depth.iter().copied().fold(f32::NEG_INFINITY, f32::max));
            assert_eq!(depths.renew(&depth), 0);
            let anew = DepthBoxes::of(*depths.grid(), &samples, &depth);
            assert!(boxes().iter().all(|within| anew.farthest(within) == depths.farthest(within)));
        }
    }

    #[test]
    fn the_farthest_is_exact_in_every_box_after_every_write() {
        let samples = samples();
        for counts in [[1, 1, 1], [1, 1, 4], [2, 3, 4]] {
            let mut depths = DepthBoxes::cleared(BoxGrid::new(counts, true).unwrap(), &samples);
            let mut depth = vec![f32::INFINITY; samples.len];
            for round in 0..400 {
                let chosen = |slot: u16| mix(u32::from(slot), round).is_multiple_of(7);
                let slots: Vec<u16> = (0..samples.len as u16).filter(|&slot| chosen(slot)).collect();
                // Few values, so that several samples of a box are the farthest.
                slots.iter().for_each(|&slot| {
                    depth[slot as usize] =
                        depth[slot as usize].min(1e3) - (mix(u32::from(slot), round) % 3) as f32
                });
                depths.write(&depth, &slots);
                let written: std::collections::HashSet<usize> =
                    slots.iter().map(|&slot| depths.place(slot as usize)).collect();
                assert_eq!(depths.renew(&depth) as usize, written.len());
                for (index, known) in depths.boxes.iter().enumerate() {
                    let own = (0..samples.len).filter(|&slot| depths.place(slot) == index);
                    let farthest = own.map(|slot| depth[slot]).fold(f32::NEG_INFINITY, f32::max);
                    assert_eq!(known.farthest, farthest, "box {index} of {counts:?}, round {round}");
                }
            }
        }
    }

    fn mix(a: u32, b: u32) -> u32 {
        (crate::random::mix(u64::from(a) << 32 | u64::from(b)) >> 40) as u32
    }

    #[test]
    fn a_triangle_is_seen_where_it_is_not_behind() {
        let samples = samples();
        let mut depths = DepthBoxes::cleared(BoxGrid::new([1, 1, 4], false).unwrap(), &samples);
        let depth: Vec<f32> = samples.t[..samples.len].iter().map(|t| 1.0 + (4.0 * t).floor()).collect();
        depths.write(&depth, &(0..samples.len as u16).collect::<Vec<_>>());
        depths.renew(&depth);
        let whole = Box5::whole(false);
        let look = |lo: f32, hi: f32| depths.look(&whole, |_| [lo, hi]);
        assert_eq!(look(4.5, 5.0), Visible { within: None, in_front: false, compared: 4, behind: 4 });
        assert_eq!(look(0.2, 0.5), Visible { within: Some(whole), in_front: true, compared: 4, behind: 0 });
        let late = Box5 { t: [0.5, 1.0], ..whole };
        assert_eq!(look(2.5, 3.0), Visible { within: Some(late), in_front: false, compared: 4, behind: 2 });
        assert_eq!(look(2.5, 2.9), Visible { within: Some(late), in_front: true, compared: 4, behind: 2 });
        // Behind in the second of three.
        let wavy = depths.look(&whole, |part| if part.t[0] == 0.25 { [9.0; 2] } else { [0.1; 2] });
        assert_eq!(wavy, Visible { within: Some(whole), in_front: false, compared: 4, behind: 1 });
    }
}
