//! Lens and time divided into boxes (thesis, Paper VI, section 3).

use std::ops::Range;

use serde::Deserialize;

use super::DepthBound;
use crate::traversal::Box5;

/// How depth is bounded and what a tile remembers of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DepthSpec {
    /// How the depth of a triangle over a tile is bounded.
    pub bound: DepthBound,
    /// Boxes of lens and time along u, v and t, each 1 to [`BoxGrid::MOST`]; a farthest and a nearest depth are kept for each.
    pub boxes: [u32; 3],
    /// Read no stored depth where a triangle lies in front of all of them (`z_min`).
    pub z_min: bool,
}

impl Default for DepthSpec {
    fn default() -> Self {
        Self { bound: DepthBound::default(), boxes: [1; 3], z_min: false }
    }
}

/// Lens and time divided into boxes of one size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoxGrid {
    counts: [u32; 3],
    lens: bool,
}

impl Default for BoxGrid {
    /// One box.
    fn default() -> Self {
        Self { counts: [1; 3], lens: false }
    }
}

impl BoxGrid {
    /// Boxes along one axis at most.
    pub const MOST: u32 = 16;
    /// The ends of u, v and t.
    const ENDS: [[f32; 2]; 3] = [[-1.0, 1.0], [-1.0, 1.0], [0.0, 1.0]];

    /// `counts` boxes along u, v and t, or `None` when one is not 1 to [`Self::MOST`]. Without a lens, time alone is divided.
    pub fn new([u, v, t]: [u32; 3], lens: bool) -> Option<Self> {
        let counts = if lens { [u, v, t] } else { [1, 1, t] };
        [u, v, t].iter().all(|count| (1..=Self::MOST).contains(count)).then_some(Self { counts, lens })
    }

    /// How many boxes there are.
    pub fn len(&self) -> usize {
        self.counts.iter().map(|&count| count as usize).product()
    }

    /// Never: there is at least one box.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Where box `index` of `axis` begins; the one after the last begins where the axis ends.
    fn border(&self, axis: usize, index: u32) -> f32 {
        let [lo, hi] = Self::ENDS[axis];
        lo + (hi - lo) * index as f32 / self.counts[axis] as f32
    }

    /// The box along `axis` in which a place lies.
    fn index(&self, axis: usize, place: f32) -> u32 {
        (1..self.counts[axis]).filter(|&index| self.border(axis, index) <= place).count() as u32
    }

    /// The box of the sample at `u`, `v`, `t`.
    pub fn of_sample(&self, u: f32, v: f32, t: f32) -> usize {
        self.number([self.index(0, u), self.index(1, v), self.index(2, t)])
    }

    fn number(&self, [u, v, t]: [u32; 3]) -> usize {
        ((t * self.counts[1] + v) * self.counts[0] + u) as usize
    }

    /// The boxes that may hold a sample of `within`, with what they have in common with it.
    pub fn overlapping(&self, within: &Box5) -> impl Iterator<Item = (usize, Box5)> + use<> {
        let (grid, within) = (*self, *within);
        let run = |axis: usize, [lo, hi]: [f32; 2]| -> Range<u32> {
            if lo > hi { 0..0 } else { grid.index(axis, lo)..grid.index(axis, hi) + 1 }
        };
        let lens = if grid.lens { [run(0, within.u), run(1, within.v)] } else { [0..1, 0..1] };
        let [us, vs] = lens;
        run(2, within.t).flat_map(move |t| {
            let us = us.clone();
            vs.clone().flat_map(move |v| {
                us.clone().map(move |u| (grid.number([u, v, t]), grid.part(&within, [u, v, t])))
            })
        })
    }

    fn part(&self, within: &Box5, [u, v, t]: [u32; 3]) -> Box5 {
        let cut = |axis: usize, index: u32, [lo, hi]: [f32; 2]| {
            [lo.max(self.border(axis, index)), hi.min(self.last(axis, index))]
        };
        let t = cut(2, t, within.t);
        if self.lens {
            Box5 { u: cut(0, u, within.u), v: cut(1, v, within.v), t, ..*within }
        } else {
            Box5 { t, ..*within }
        }
    }

    /// The last place of box `index`: just before the next one begins.
    fn last(&self, axis: usize, index: u32) -> f32 {
        let end = self.border(axis, index + 1);
        if index + 1 == self.counts[axis] { end } else { end.next_down() }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::geometry::{Shear, Viewport};
    use crate::sampling::{LensShape, SampleTable, TileSamples};

    /// A tile of samples.
    pub fn samples() -> TileSamples {
        let table = SampleTable::low_discrepancy(16, 3, LensShape::Disk).unwrap();
        let mut samples = TileSamples::default();
        samples.fill(&table, Viewport::new(8, 8).unwrap(), &Shear::default(), [0, 0], 8);
        samples
    }

    /// Whether the sample in `slot` lies in the box.
    pub fn holds(within: &Box5, samples: &TileSamples, slot: usize) -> bool {
        let inside = |[lo, hi]: [f32; 2], place: f32| (lo..=hi).contains(&place);
        let lens = inside(within.u, samples.u[slot]) && inside(within.v, samples.v[slot]);
        inside(within.t, samples.t[slot]) && (lens || !within.lens)
    }

    #[test]
    fn every_sample_lies_in_its_box_and_in_no_other() {
        let samples = samples();
        for lens in [false, true] {
            let grid = BoxGrid::new([3, 2, 5], lens).unwrap();
            let parts: Vec<_> = grid.overlapping(&Box5::whole(lens)).collect();
            assert_eq!(parts.len(), if lens { 30 } else { 5 });
            for slot in 0..samples.len {
                let own = grid.of_sample(samples.u[slot], samples.v[slot], samples.t[slot]);
                for (index, part) in &parts {
                    assert_eq!(holds(part, &samples, slot), *index == own, "{slot} {part:?}");
                }
            }
        }
    }

    #[test]
    fn grids_have_at_least_one_box_and_not_too_many() {
        assert!(BoxGrid::new([0, 1, 1], true).is_none());
        assert!(BoxGrid::new([1, 17, 1], true).is_none());
        assert_eq!(BoxGrid::new([4, 4, 4], false).unwrap().len(), 4);
    }
}
