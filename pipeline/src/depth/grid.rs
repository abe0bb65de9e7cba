//! Division of lens and time into boxes (thesis, Paper VI, section 3).

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::DepthBound;
use crate::traversal::Box5;

/// Settings of depth culling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DepthSpec {
    /// Method of bounding the depth of a triangle over a tile.
    pub bound: DepthBound,
    /// Number of boxes of lens and time along u, v and t, each 1 to [`BoxGrid::MAX`]. Each box keeps its
    /// farthest and nearest depth.
    pub boxes: [u32; 3],
    /// Skip the reading of stored depths if a triangle is in front of all of them (`z_min`).
    pub z_min: bool,
}

impl Default for DepthSpec {
    fn default() -> Self {
        Self { bound: DepthBound::default(), boxes: [1; 3], z_min: false }
    }
}

/// Lens and time divided into equal boxes.
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
    /// Largest number of boxes along one axis.
    pub const MAX: u32 = 16;
    /// Ranges of u, v and t.
    const ENDS: [[f32; 2]; 3] = [[-1.0, 1.0], [-1.0, 1.0], [0.0, 1.0]];

    /// `counts` boxes along u, v and t, or `None` if one is not 1 to [`Self::MAX`]. Without a lens only time
    /// is divided.
    pub fn new([u, v, t]: [u32; 3], lens: bool) -> Option<Self> {
        let counts = if lens { [u, v, t] } else { [1, 1, t] };
        [u, v, t].iter().all(|count| (1..=Self::MAX).contains(count)).then_some(Self { counts, lens })
    }

    /// Number of boxes.
    pub fn len(&self) -> usize {
        self.counts.iter().map(|&count| count as usize).product()
    }

    /// Always false; there is at least one box.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Lower border of box `index` of `axis`, or the end of the axis for the index after the last.
    fn border(&self, axis: usize, index: u32) -> f32 {
        let [lo, hi] = Self::ENDS[axis];
        lo + (hi - lo) * index as f32 / self.counts[axis] as f32
    }

    /// Box of a coordinate along `axis`.
    fn index(&self, axis: usize, coordinate: f32) -> u32 {
        (1..self.counts[axis]).filter(|&index| self.border(axis, index) <= coordinate).count() as u32
    }

    /// Box of the sample at `u`, `v`, `t`.
    pub fn of_sample(&self, u: f32, v: f32, t: f32) -> usize {
        self.number([self.index(0, u), self.index(1, v), self.index(2, t)])
    }

    fn number(&self, [u, v, t]: [u32; 3]) -> usize {
        ((t * self.counts[1] + v) * self.counts[0] + u) as usize
    }

    /// Boxes that may contain a sample of `within`, each with its intersection.
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

    /// Largest float in box `index`, just below the next border.
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

    /// Whether the sample in `slot` is in the box.
    pub fn holds(within: &Box5, samples: &TileSamples, slot: usize) -> bool {
        let inside = |[lo, hi]: [f32; 2], coordinate: f32| (lo..=hi).contains(&coordinate);
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
