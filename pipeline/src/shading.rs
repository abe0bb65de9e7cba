//! Shading: the shading grid, and the quads that a packet requests.
//!
//! A sample is shaded at the cell of the shading grid that contains its surface point at the reference lens
//! position and time, `(u, v, t) = (0, 0, 1/2)` (decoupled sampling, Ragan-Kelley et al. 2011). The value of
//! a cell depends on the triangle and the cell alone. The alternative shades every sample at its own
//! position, in quads of 2x2 pixels at one sample index.

use std::ops::{Add, Div, Mul, Sub};

use glam::Vec4;

use crate::simd::{Lanes, Mask};

/// Time of the reference at which the shading grid is defined.
pub const REFERENCE_TIME: f32 = 0.5;

/// Largest distance of a cell from the image centre, so that its coordinates fit every use.
const MAX_CELL: f32 = 1e6;

/// Places of the points with the given barycentric `weights`, in pixels from the top left of the image, and
/// the lanes whose point is in front of the camera. `reference` has the vertices at the reference, `origin`
/// the image coordinate of the first column and row. The place in other lanes is undefined.
#[inline(always)]
pub(crate) fn places<V: Lanes>(
    reference: &[[f32; 3]; 3],
    weights: [V; 3],
    origin: [f32; 2],
) -> ([V; 2], Mask) {
    let [x, y, w] =
        [mixed(reference, &weights, 0), mixed(reference, &weights, 1), mixed(reference, &weights, 2)];
    let place = [x / w - V::splat(origin[0]), y / w - V::splat(origin[1])];
    (place, w.gt(V::splat(0.0)))
}

/// A coordinate of the points with the given weights. No closure, as that would be compiled for the baseline
/// of the target.
#[inline(always)]
fn mixed<V: Lanes>(reference: &[[f32; 3]; 3], weights: &[V; 3], axis: usize) -> V {
    (weights[0] * V::splat(reference[0][axis]) + weights[1] * V::splat(reference[1][axis]))
        + weights[2] * V::splat(reference[2][axis])
}

/// Coordinate of the cell of a place on one axis; 0 for NaN.
#[inline(always)]
pub(crate) fn cell_at(place: f32) -> i32 {
    // A sum with this number keeps the nearest integer in its lowest bits. Conversions would be done one by one.
    const NEAREST: f32 = 12_582_912.0;
    let at = if place.is_nan() { 0.0 } else { place.clamp(-MAX_CELL, MAX_CELL) };
    let sum = at + NEAREST;
    let nearest = sum.to_bits().cast_signed() - NEAREST.to_bits().cast_signed();
    nearest - i32::from(sum - NEAREST > at)
}

/// Barycentric weights of the centre of a cell. It is outside the triangle for some cells on the border;
/// shading extrapolates there, as pixel centres do.
pub fn cell_weights(reference: &[[f32; 3]; 3], cell: [i32; 2], origin: [f32; 2]) -> [f32; 3] {
    weights_at(reference, [0, 1].map(|axis| middle_of(cell, origin, axis)))
}

/// The same of the four cells of a quad, by lane.
pub(crate) fn quad_weights(reference: &[[f32; 3]; 3], quad: [i32; 2], origin: [f32; 2]) -> [[f32; 3]; 4] {
    let at = [0, 1].map(|axis| Vec4::from_array(cells_of(quad).map(|cell| middle_of(cell, origin, axis))));
    let by_corner = shares_at(&reference.map(|vertex| vertex.map(Vec4::splat)), at);
    [0, 1, 2, 3].map(|lane| unless_edge_on(by_corner.map(|share| share[lane])))
}

/// Places of the lanes of a quad.
pub(crate) const QUAD_LANES: [[i32; 2]; 4] = [[0, 0], [1, 0], [0, 1], [1, 1]];

/// Cells of a quad, by lane.
pub(crate) fn cells_of(quad: [i32; 2]) -> [[i32; 2]; 4] {
    QUAD_LANES.map(|[x, y]| [2 * quad[0] + x, 2 * quad[1] + y])
}

/// Image coordinate of the middle of a cell on one axis.
fn middle_of(cell: [i32; 2], origin: [f32; 2], axis: usize) -> f32 {
    cell[axis] as f32 + 0.5 + origin[axis]
}

/// Barycentric weights of the point of a triangle at image coordinate `at`, extrapolated outside. An edge-on
/// triangle is represented by its centroid.
pub fn weights_at(vertices: &[[f32; 3]; 3], at: [f32; 2]) -> [f32; 3] {
    unless_edge_on(shares_at(vertices, at))
}

/// Shares of the edge functions at one point or several.
#[inline(always)]
fn shares_at<T>(vertices: &[[T; 3]; 3], at: [T; 2]) -> [T; 3]
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<Output = T> + Div<Output = T>,
{
    let seen = vertices.map(|[x, y, w]| [x - at[0] * w, y - at[1] * w]);
    let edge = |i: usize, j: usize| seen[i][0] * seen[j][1] - seen[j][0] * seen[i][1];
    let e = [edge(1, 2), edge(2, 0), edge(0, 1)];
    let sum = e[0] + e[1] + e[2];
    e.map(|part| part / sum)
}

/// The weights, or those of the centroid if they are too large.
#[inline(always)]
fn unless_edge_on(weights: [f32; 3]) -> [f32; 3] {
    if weights.iter().all(|w| w.abs() < 64.0) { weights } else { [1.0 / 3.0; 3] }
}

/// Requests of one packet for one quad of 2x2 cells or, with per-sample shading, of 2x2 pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QuadAccess {
    /// The quad, in cells or pixels divided by two.
    pub quad: [i32; 2],
    /// Sample index in each pixel of the quad; 0 for cells.
    pub sample: u16,
    /// Number of requesting samples.
    pub lookups: u16,
    /// Mask of the requested cells, row by row.
    pub lanes: u8,
}

/// Collector of the look-ups of one packet by quad, in the order of first use. The look-ups of a packet are
/// coalesced before they reach the cache.
#[derive(Clone, Debug)]
pub struct QuadSet {
    list: Vec<QuadAccess>,
    /// Open hash table of indices into `list`, each with the round of its write; entries of older rounds are
    /// empty. A power of four, more than twice the quads, so a free slot is always near.
    slots: Vec<(u32, u16)>,
    round: u32,
}

/// Slots of a new table: enough for most packets, and small enough for the first-level cache.
const FIRST_SLOTS: usize = 256;

impl Default for QuadSet {
    fn default() -> Self {
        Self { list: Vec::new(), slots: vec![(0, 0); FIRST_SLOTS], round: 1 }
    }
}

impl QuadSet {
    /// Request `cell`, or the sample with index `sample` of that pixel. Returns the place of its quad in the list.
    #[inline]
    pub fn request(&mut self, cell: [i32; 2], sample: u16) -> usize {
        let quad = cell.map(|c| c >> 1);
        let lanes = 1 << lane_of(cell);
        let mut slot = self.first_slot(quad, sample);
        while self.slots[slot].0 == self.round {
            let place = self.slots[slot].1 as usize;
            let access = &mut self.list[place];
            if access.quad == quad && access.sample == sample {
                access.lookups += 1;
                access.lanes |= lanes;
                return place;
            }
            slot = (slot + 1) & (self.slots.len() - 1);
        }
        self.insert(slot, QuadAccess { quad, sample, lookups: 1, lanes })
    }

    /// Slot at which the search for a quad starts. Quads close to each other start at different ones.
    #[inline]
    fn first_slot(&self, quad: [i32; 2], sample: u16) -> usize {
        let across = self.slots.len().ilog2() / 2;
        let column = quad[0] as usize & ((1 << across) - 1);
        let place = column | (quad[1] as usize) << across;
        place.wrapping_add(usize::from(sample) * 0x9E37_79B1) & (self.slots.len() - 1)
    }

    /// Adds a new quad, whose free slot is known.
    fn insert(&mut self, slot: usize, access: QuadAccess) -> usize {
        let place = self.list.len();
        self.slots[slot] = (self.round, place as u16);
        self.list.push(access);
        if 2 * self.list.len() > self.slots.len() {
            self.grow();
        }
        place
    }

    #[cold]
    fn grow(&mut self) {
        self.slots = vec![(0, 0); 4 * self.slots.len()];
        for (place, access) in (0..).zip(&self.list) {
            let mut slot = self.first_slot(access.quad, access.sample);
            while self.slots[slot].0 == self.round {
                slot = (slot + 1) & (self.slots.len() - 1);
            }
            self.slots[slot] = (self.round, place);
        }
    }

    /// The quads of this round, in the order of first use.
    pub fn quads(&self) -> &[QuadAccess] {
        &self.list
    }

    /// Start a new round without quads.
    pub fn clear(&mut self) {
        self.list.clear();
        self.round = self.round.checked_add(1).unwrap_or_else(|| {
            self.slots.fill((0, 0));
            1
        });
    }

    /// Move the quads to the end of `log` and start a new round.
    pub fn drain_into(&mut self, log: &mut Vec<QuadAccess>) {
        log.extend_from_slice(&self.list);
        self.clear();
    }
}

/// Lane of a cell in its quad.
#[inline]
pub(crate) fn lane_of(cell: [i32; 2]) -> usize {
    ((cell[0] & 1) | ((cell[1] & 1) << 1)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{LANES, Plain};

    const TRIANGLE: [[f32; 3]; 3] = [[-8.0, -8.0, 1.0], [16.0, -16.0, 2.0], [-8.0, 8.0, 1.0]];

    fn cell(reference: &[[f32; 3]; 3], weights: [f32; 3], origin: [f32; 2]) -> Option<[i32; 2]> {
        let ([x, y], front) = places(reference, weights.map(Plain::splat), origin);
        (front & 1 != 0).then(|| {
            [x, y].map(|lanes| {
                let mut row = [0.0; LANES];
                lanes.store(&mut row);
                cell_at(row[0])
            })
        })
    }

    #[test]
    fn a_cell_is_the_floor_of_its_place() {
        let exact = 999_999.94;
        let ends = [[7e5, -7e5], [1e9, f32::NEG_INFINITY], [f32::NAN, f32::INFINITY], [exact, -exact]];
        let near = [[0.0, -0.0], [0.99, -0.01], [-1.0, -1.5], [0.5, 1.5], [2.5, -0.5], [-1e-30, 1e-40]];
        for place in near.into_iter().chain(ends) {
            let floor = place.map(|at: f32| at.clamp(-MAX_CELL, MAX_CELL).floor() as i32);
            assert_eq!(place.map(cell_at), floor, "{place:?}");
        }
    }

    #[test]
    fn the_middle_of_a_cell_falls_into_it() {
        let origin = [-32.0, -32.0];
        for target in [[25, 27], [30, 26], [24, 33]] {
            let weights = cell_weights(&TRIANGLE, target, origin);
            assert_eq!(cell(&TRIANGLE, weights, origin), Some(target));
        }
    }

    #[test]
    fn the_weights_of_a_quad_are_those_of_its_cells() {
        let line = [[0.0, 0.0, 1.0], [1.0, 1.0, 1.0], [2.0, 2.0, 1.0]];
        for (reference, quad) in [(TRIANGLE, [12, 13]), (TRIANGLE, [-3, 40]), (line, [0, 0])] {
            let of_quad = quad_weights(&reference, quad, [-32.0, -31.5]);
            for (weights, cell) in of_quad.into_iter().zip(cells_of(quad)) {
                assert_eq!(weights, cell_weights(&reference, cell, [-32.0, -31.5]));
            }
        }
    }

    #[test]
    fn edge_on_and_behind_are_safe() {
        let line = [[0.0, 0.0, 1.0], [1.0, 1.0, 1.0], [2.0, 2.0, 1.0]];
        assert_eq!(cell_weights(&line, [0, 0], [0.0, 0.0]), [1.0 / 3.0; 3]);
        let behind = TRIANGLE.map(|[x, y, w]| [x, y, -w]);
        assert_eq!(cell(&behind, [1.0 / 3.0; 3], [0.0, 0.0]), None);
        assert!(cell(&TRIANGLE, [f32::NAN; 3], [0.0, 0.0]).is_none());
    }

    #[test]
    fn look_ups_are_gathered_by_quad_in_order() {
        let mut set = QuadSet::default();
        for cell in [[5, 4], [0, 0], [4, 5], [5, 4], [-1, -1]] {
            set.request(cell, 0);
        }
        let mut log = Vec::new();
        set.drain_into(&mut log);
        assert_eq!(
            log,
            [
                QuadAccess { quad: [2, 2], sample: 0, lookups: 3, lanes: 0b0110 },
                QuadAccess { quad: [0, 0], sample: 0, lookups: 1, lanes: 0b0001 },
                QuadAccess { quad: [-1, -1], sample: 0, lookups: 1, lanes: 0b1000 },
            ]
        );
        set.request([5, 4], 0);
        set.drain_into(&mut log);
        assert_eq!(log.len(), 4);
        assert_eq!(log[3].lookups, 1);
    }

    #[test]
    fn any_number_of_quads_is_kept_in_order() {
        let (mut set, mut log) = (QuadSet::default(), Vec::new());
        for round in 0..3 {
            let quads: Vec<[i32; 2]> = (0..3000).map(|n| [n % 61 - 30, n / 61 + round]).collect();
            for (place, quad) in quads.iter().enumerate() {
                assert_eq!(set.request([2 * quad[0], 2 * quad[1]], 0), place);
            }
            for (place, quad) in quads.iter().enumerate().rev() {
                assert_eq!(set.request([2 * quad[0] + 1, 2 * quad[1] + 1], 0), place);
            }
            log.clear();
            set.drain_into(&mut log);
            assert_eq!(log.iter().map(|access| access.quad).collect::<Vec<_>>(), quads);
            assert!(log.iter().all(|access| (access.lookups, access.lanes) == (2, 0b1001)));
        }
    }
}
