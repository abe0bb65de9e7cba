//! Hi-Z of a tile: farthest and nearest stored depth in disjoint boxes that cover lens and time (thesis,
//! Paper VI, section 3).

use glam::Vec4;

use super::BoxGrid;
use crate::sampling::TileSamples;
use crate::state::Compare;
use crate::traversal::Box5;

/// Bounds of the stored depths in one box.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BoxDepths {
    farthest: f32,
    nearest: f32,
    /// Whether the farthest depth is out of date.
    stale: bool,
    /// Whether the nearest depth may be out of date, too, as depths increased.
    raised: bool,
    /// Whether the current write lowered the nearest depth.
    lowered: bool,
    /// Range of its slots in the list sorted by box.
    slots: [u32; 2],
    /// First of these slots with the farthest depth at the last update.
    witness: u32,
}

impl BoxDepths {
    /// An empty box with these bounds whose slots will start at `first` of the sorted list.
    fn cleared(first: u32, [nearest, farthest]: [f32; 2]) -> Self {
        let (slots, witness) = ([first; 2], first);
        Self { farthest, nearest, stale: false, raised: false, lowered: false, slots, witness }
    }

    /// Recompute the bounds. While depths only decrease, the farthest is unchanged as long as any slot still has it,
    /// and slots before the witness do not. One comparison is usually enough.
    fn update(&mut self, depth: &[f32], slots: &[u16]) {
        self.stale = false;
        let [first, end] = self.slots.map(|at| at as usize);
        if std::mem::take(&mut self.raised) {
            self.witness = first as u32;
            let own = slots[first..end].iter();
            self.nearest = own.map(|&slot| depth[slot as usize]).fold(f32::INFINITY, f32::min);
        }
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

/// Part of a box in which a triangle may pass the depth test by stored depths. Where it cannot, it is hidden.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visible {
    /// Hull of all boxes in which the triangle is not hidden; `None` if it is hidden everywhere.
    pub within: Option<Box5>,
    /// Whether the triangle passes the depth test everywhere there, so no stored depth is needed.
    pub in_front: bool,
    /// Number of boxes compared.
    pub compared: u32,
    /// Number of boxes in which the triangle is hidden.
    pub behind: u32,
}

impl Visible {
    /// Result for a tile cleared to one depth.
    pub fn in_cleared(within: &Box5, test: Compare, depth: f32) -> Self {
        let in_front = test.always_holds([f32::MIN_POSITIVE, f32::MAX], [depth; 2]);
        Self { within: Some(*within), in_front, compared: 1, behind: 0 }
    }
}

/// Farthest and nearest stored depth of a tile in boxes of lens and time.
///
/// Outdated bounds are too far apart, which is safe for culling; [`Self::update`] recomputes them. While depths only
/// decrease, the nearest is always up to date.
#[derive(Clone, Debug)]
pub struct DepthBoxes {
    grid: BoxGrid,
    boxes: Vec<BoxDepths>,
    /// Box of each slot; empty for a single box.
    box_of_slot: Vec<u16>,
    /// Slots sorted by box.
    slots: Vec<u16>,
}

impl DepthBoxes {
    /// Boxes of a tile with `samples`, all at `depth`.
    pub fn cleared(grid: BoxGrid, samples: &TileSamples, depth: f32) -> Self {
        let box_index = |slot| grid.of_sample(samples.u[slot], samples.v[slot], samples.t[slot]) as u16;
        let box_of_slot =
            if grid.len() == 1 { Vec::new() } else { (0..samples.len).map(box_index).collect() };
        let mut counts = vec![0; grid.len()];
        (0..samples.len)
            .for_each(|slot| counts[box_of_slot.get(slot).map_or(0, |&box_index| box_index as usize)] += 1);
        let mut first = 0;
        let boxes = counts.into_iter().map(|count| {
            first += count;
            // A box without samples hides everything and is hidden by nothing.
            let hides = count == 0 && samples.len > 0;
            let bounds = if hides { [f32::INFINITY, f32::NEG_INFINITY] } else { [depth; 2] };
            BoxDepths::cleared(first - count, bounds)
        });
        let mut boxes = Self { grid, boxes: boxes.collect(), box_of_slot, slots: vec![0; samples.len] };
        boxes.sort_slots();
        boxes
    }

    fn sort_slots(&mut self) {
        for slot in 0..self.slots.len() {
            let box_index = self.box_of(slot);
            let end = &mut self.boxes[box_index].slots[1];
            self.slots[*end as usize] = slot as u16;
            *end += 1;
        }
    }

    /// Boxes of a tile whose samples have the given depths.
    pub fn of(grid: BoxGrid, samples: &TileSamples, depth: &[f32]) -> Self {
        let mut boxes = Self::cleared(grid, samples, f32::INFINITY);
        for (slot, &depth) in depth.iter().enumerate() {
            let box_index = boxes.box_of(slot);
            let known = &mut boxes.boxes[box_index];
            (known.nearest, known.stale) = (known.nearest.min(depth), true);
        }
        boxes.update(depth);
        boxes
    }

    /// Part of `within` in which a triangle may pass `test`; everything if it `culls` nothing. `depth(part)`
    /// gives its nearest and farthest depth in a part. It is compared with the stored depths of every
    /// overlapping box.
    pub fn compare(
        &self,
        within: &Box5,
        test: Compare,
        culls: bool,
        mut depth: impl FnMut(&Box5) -> [f32; 2],
    ) -> Visible {
        let mut visible = Visible { within: None, in_front: true, compared: 0, behind: 0 };
        for (index, part) in self.grid.overlapping(within) {
            let (new, known) = (depth(&part), &self.boxes[index]);
            let stored = [known.nearest, known.farthest];
            visible.compared += 1;
            if culls && test.never_holds(new, stored) {
                visible.behind += 1;
                continue;
            }
            visible.in_front &= test.always_holds(new, stored);
            visible.within = Some(visible.within.map_or(part, |before: Box5| before.hull(&part)));
        }
        // A box in which it is hidden may lie between visible ones.
        let seen = (visible.compared - visible.behind) as usize;
        visible.in_front &= visible.within.is_some_and(|part| self.grid.overlapping(&part).count() == seen);
        visible
    }

    fn box_of(&self, slot: usize) -> usize {
        self.box_of_slot.get(slot).map_or(0, |&box_index| box_index as usize)
    }

    /// Record that the depths in `slots` were written, after a test that `raises` some or only lowers them.
    /// Returns the number of boxes with a new nearest depth.
    pub fn write(&mut self, depth: &[f32], slots: &[u16], raises: bool) -> u32 {
        let mut lowered = 0;
        for &slot in slots {
            let box_index = self.box_of(slot as usize);
            let (known, depth) = (&mut self.boxes[box_index], depth[slot as usize]);
            known.stale = true;
            if raises {
                (known.farthest, known.raised) = (known.farthest.max(depth), true);
            }
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

    /// Recompute the outdated bounds of boxes. Returns their number.
    pub fn update(&mut self, depth: &[f32]) -> u32 {
        let stale = self.boxes.iter().filter(|known| known.stale).count();
        if stale == 0 {
            return 0;
        }
        for known in self.boxes.iter_mut().filter(|known| known.stale) {
            known.update(depth, &self.slots);
        }
        stale as u32
    }
}

/// Stored samples of one tile.
#[derive(Clone, Debug)]
pub struct DepthTile {
    /// Depth of each sample.
    pub depth: Vec<f32>,
    /// Triangle stored last, [`Self::NO_TRIANGLE`] without any.
    pub triangle: Vec<u32>,
    /// Triangle whose colour each sample is to get when shading no longer waits, [`Self::NO_TRIANGLE`] without
    /// any. Only with hidden-surface removal.
    pub waiting: Vec<u32>,
    /// Stencil value, if the pass has any.
    pub stencil: Vec<u8>,
    /// Linear RGB and opacity of each sample, by target, if colours are stored in the order of triangles.
    pub colours: Vec<Vec<Vec4>>,
    /// Farthest and nearest depths.
    pub boxes: DepthBoxes,
    /// Whether the hardware knows them. Those of loaded depths have to be found first.
    pub is_bounded: bool,
}

impl DepthTile {
    /// Triangle of a sample without a hit.
    pub const NO_TRIANGLE: u32 = u32::MAX;

    /// A tile of `samples` cleared to `depth`, without stencil values and colours.
    pub fn cleared(grid: BoxGrid, samples: &TileSamples, depth: f32) -> Self {
        Self {
            depth: vec![depth; samples.len],
            triangle: vec![Self::NO_TRIANGLE; samples.len],
            waiting: Vec::new(),
            stencil: Vec::new(),
            colours: Vec::new(),
            boxes: DepthBoxes::cleared(grid, samples, depth),
            is_bounded: true,
        }
    }

    /// Record that the depths in `slots` were written, as [`DepthBoxes::write`].
    pub fn record_writes(&mut self, slots: &[u16], raises: bool) -> u32 {
        self.boxes.write(&self.depth, slots, raises)
    }

    /// Recompute outdated bounds. Returns the number of their boxes.
    pub fn update(&mut self) -> u32 {
        self.boxes.update(&self.depth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::grid::tests::{holds, samples};
    use crate::traversal::Box5;

    impl DepthBoxes {
        fn farthest(&self, within: &Box5) -> f32 {
            let boxes = self.grid.overlapping(within).map(|(index, _)| self.boxes[index].farthest);
            boxes.fold(f32::NEG_INFINITY, f32::max)
        }

        fn nearest(&self, within: &Box5) -> f32 {
            let boxes = self.grid.overlapping(within).map(|(index, _)| self.boxes[index].nearest);
            boxes.fold(f32::INFINITY, f32::min)
        }
    }

    fn boxes() -> Vec<Box5> {
        let ranges = [[-1.0, 1.0], [-0.3, 0.2], [0.5, 1.0], [0.25, 0.25], [-1.0, -0.5]];
        let all = ranges.iter().flat_map(|&u| ranges.iter().map(move |&v| (u, v)));
        all.flat_map(|(u, v)| [[0.0, 1.0], [0.2, 0.4], [0.75, 0.75]].map(|t| Box5 { u, v, t, lens: true }))
            .collect()
    }

    #[test]
    fn boxes_know_the_nearest_and_farthest_of_their_samples() {
        let samples = samples();
        let mut depths = DepthBoxes::cleared(BoxGrid::new([2, 3, 4], true).unwrap(), &samples, f32::INFINITY);
        let mut depth = vec![f32::INFINITY; samples.len];
        for round in 0..20_u32 {
            let slots: Vec<u16> = (0..samples.len as u16)
                .filter(|slot| mix(u32::from(*slot), round).is_multiple_of(3))
                .collect();
            slots.iter().for_each(|&slot| {
                depth[slot as usize] = (mix(u32::from(slot), round + 99) % 1000) as f32 / (round + 1) as f32
            });
            // Depths only decrease.
            let before = depths.clone();
            let nearer: Vec<u16> =
                slots.into_iter().filter(|&slot| depth[slot as usize] < f32::INFINITY).collect();
            depths.write(&depth, &nearer, false);
            for within in boxes() {
                let inside = || {
                    (0..samples.len).filter(|&slot| holds(&within, &samples, slot)).map(|slot| depth[slot])
                };
                assert!(
                    inside().fold(f32::INFINITY, f32::min)
                        >= depths.nearest(&within).min(before.nearest(&within))
                );
            }
            depths.update(&depth);
            for within in boxes() {
                let inside = || {
                    (0..samples.len).filter(|&slot| holds(&within, &samples, slot)).map(|slot| depth[slot])
                };
                assert!(inside().fold(f32::NEG_INFINITY, f32::max) <= depths.farthest(&within), "{within:?}");
            }
            let whole = Box5::whole(true);
            assert_eq!(depths.farthest(&whole), depth.iter().copied().fold(f32::NEG_INFINITY, f32::max));
            assert_eq!(depths.update(&depth), 0);
            let anew = DepthBoxes::of(depths.grid, &samples, &depth);
            assert!(boxes().iter().all(|within| anew.farthest(within) == depths.farthest(within)));
        }
    }

    #[test]
    fn the_farthest_is_exact_in_every_box_after_every_write() {
        let samples = samples();
        for counts in [[1, 1, 1], [1, 1, 4], [2, 3, 4]] {
            let mut depths =
                DepthBoxes::cleared(BoxGrid::new(counts, true).unwrap(), &samples, f32::INFINITY);
            let mut depth = vec![f32::INFINITY; samples.len];
            for round in 0..400 {
                let chosen = |slot: u16| mix(u32::from(slot), round).is_multiple_of(7);
                let slots: Vec<u16> = (0..samples.len as u16).filter(|&slot| chosen(slot)).collect();
                // Few distinct values, so several samples of a box are the farthest.
                slots.iter().for_each(|&slot| {
                    depth[slot as usize] =
                        depth[slot as usize].min(1e3) - (mix(u32::from(slot), round) % 3) as f32
                });
                depths.write(&depth, &slots, false);
                let written: std::collections::HashSet<usize> =
                    slots.iter().map(|&slot| depths.box_of(slot as usize)).collect();
                assert_eq!(depths.update(&depth) as usize, written.len());
                for (index, known) in depths.boxes.iter().enumerate() {
                    let own = (0..samples.len).filter(|&slot| depths.box_of(slot) == index);
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
    fn a_triangle_is_visible_where_it_is_not_hidden() {
        let samples = samples();
        let mut depths =
            DepthBoxes::cleared(BoxGrid::new([1, 1, 4], false).unwrap(), &samples, f32::INFINITY);
        let depth: Vec<f32> = samples.t[..samples.len].iter().map(|t| 1.0 + (4.0 * t).floor()).collect();
        depths.write(&depth, &(0..samples.len as u16).collect::<Vec<_>>(), false);
        depths.update(&depth);
        let whole = Box5::whole(false);
        let compare = |lo: f32, hi: f32| depths.compare(&whole, Compare::Less, true, |_| [lo, hi]);
        assert_eq!(compare(4.5, 5.0), Visible { within: None, in_front: false, compared: 4, behind: 4 });
        assert_eq!(
            compare(0.2, 0.5),
            Visible { within: Some(whole), in_front: true, compared: 4, behind: 0 }
        );
        let late = Box5 { t: [0.5, 1.0], ..whole };
        assert_eq!(
            compare(2.5, 3.0),
            Visible { within: Some(late), in_front: false, compared: 4, behind: 2 }
        );
        assert_eq!(compare(2.5, 2.9), Visible { within: Some(late), in_front: true, compared: 4, behind: 2 });
        // Hidden in the second of three boxes.
        let wavy = depths
            .compare(&whole, Compare::Less, true, |part| if part.t[0] == 0.25 { [9.0; 2] } else { [0.1; 2] });
        assert_eq!(wavy, Visible { within: Some(whole), in_front: false, compared: 4, behind: 1 });
    }

    #[test]
    #[allow(clippy::field_reassign_with_default, reason = "the other fields are private")]
    fn a_tile_is_as_far_as_its_farthest_sample() {
        let mut samples = TileSamples::default();
        samples.len = 2;
        let mut tile = DepthTile::cleared(BoxGrid::new([1; 3], false).unwrap(), &samples, f32::INFINITY);
        let whole = Box5::whole(false);
        let farthest = |tile: &mut DepthTile| (tile.update(), tile.boxes.farthest(&whole));
        assert_eq!(farthest(&mut tile), (0, f32::INFINITY));
        tile.depth[0] = 3.0;
        assert_eq!(tile.record_writes(&[0], false), 1);
        assert_eq!((farthest(&mut tile), tile.boxes.nearest(&whole)), ((1, f32::INFINITY), 3.0));
        tile.depth[1] = 5.0;
        assert_eq!(tile.record_writes(&[1], false), 0, "farther than the nearest");
        assert_eq!(farthest(&mut tile), (1, 5.0));
        assert_eq!((farthest(&mut tile), tile.boxes.nearest(&whole)), ((0, 5.0), 3.0));
    }
}
