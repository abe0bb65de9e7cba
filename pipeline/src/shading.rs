//! Shading: the shading grid, and the quads that a packet requests.
//!
//! A sample is shaded at the cell of the shading grid that contains its surface point at the reference lens
//! position and time, `(u, v, t) = (0, 0, 1/2)` (decoupled sampling, Ragan-Kelley et al. 2011). The value of
//! a cell depends on the triangle and the cell alone. The alternative shades every sample at its own
//! position, in quads of 2x2 pixels at one sample index.

use crate::simd::{Lanes, Mask};

/// Time of the reference at which the shading grid is defined.
pub const REFERENCE_TIME: f32 = 0.5;

/// Largest distance of a cell from the image centre, so that its coordinates fit every use.
const MAX_CELL: f32 = 1e6;

/// Places of the points with the given barycentric `weights`, in pixels from the top left of the image, and the lanes whose point
/// is in front of the camera. `reference` has the vertices at the reference, `origin` the image coordinate of the first column and
/// row. The place in other lanes is undefined.
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

/// A coordinate of the points with the given weights. No closure, as that would be compiled for the baseline of the target.
#[inline(always)]
fn mixed<V: Lanes>(reference: &[[f32; 3]; 3], weights: &[V; 3], axis: usize) -> V {
    (weights[0] * V::splat(reference[0][axis]) + weights[1] * V::splat(reference[1][axis]))
        + weights[2] * V::splat(reference[2][axis])
}

/// Cell of a place.
#[inline(always)]
pub(crate) fn cell_at(place: [f32; 2]) -> [i32; 2] {
    place.map(|at| {
        let at = at.clamp(-MAX_CELL, MAX_CELL);
        // The floor, without a call.
        let whole = at as i32;
        whole - i32::from(at < whole as f32)
    })
}

/// Barycentric weights of the centre of a cell. It is outside the triangle for some cells on the border;
/// shading extrapolates there, as pixel centres do.
pub fn cell_weights(reference: &[[f32; 3]; 3], cell: [i32; 2], origin: [f32; 2]) -> [f32; 3] {
    weights_at(reference, [0, 1].map(|axis| cell[axis] as f32 + 0.5 + origin[axis]))
}

/// Barycentric weights of the point of a triangle at image coordinate `at`, extrapolated outside. An edge-on
/// triangle is represented by its centroid.
pub fn weights_at(vertices: &[[f32; 3]; 3], at: [f32; 2]) -> [f32; 3] {
    let seen = vertices.map(|[x, y, w]| [x - at[0] * w, y - at[1] * w]);
    let edge = |i: usize, j: usize| seen[i][0] * seen[j][1] - seen[j][0] * seen[i][1];
    let e = [edge(1, 2), edge(2, 0), edge(0, 1)];
    let sum = e[0] + e[1] + e[2];
    let weights = e.map(|part| part / sum);
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
    /// empty.
    slots: Vec<(u32, u16)>,
    round: u32,
}

/// Twice the largest number of samples of a packet, so a free slot is always near.
const SLOTS: usize = 32_768;

impl Default for QuadSet {
    fn default() -> Self {
        Self { list: Vec::new(), slots: vec![(0, 0); SLOTS], round: 1 }
    }
}

impl QuadSet {
    /// Request `cell`, or the sample with index `sample` of that pixel.
    pub fn request(&mut self, cell: [i32; 2], sample: u16) {
        let quad = cell.map(|c| c >> 1);
        let lanes = 1 << ((cell[0] & 1) | ((cell[1] & 1) << 1));
        let hash = (quad[0] as u32).wrapping_mul(0x9E37_79B1) ^ (quad[1] as u32).wrapping_mul(0x85EB_CA77);
        let hash = hash ^ u32::from(sample).wrapping_mul(0xC2B2_AE3D);
        let mut slot = (hash ^ (hash >> 15)) as usize % SLOTS;
        while self.slots[slot].0 == self.round {
            let access = &mut self.list[self.slots[slot].1 as usize];
            if access.quad == quad && access.sample == sample {
                access.lookups += 1;
                access.lanes |= lanes;
                return;
            }
            slot = (slot + 1) % SLOTS;
        }
        self.slots[slot] = (self.round, self.list.len() as u16);
        self.list.push(QuadAccess { quad, sample, lookups: 1, lanes });
    }

    /// Move the quads to the end of `log` and start a new round.
    pub fn drain_into(&mut self, log: &mut Vec<QuadAccess>) {
        log.append(&mut self.list);
        self.round = self.round.checked_add(1).unwrap_or_else(|| {
            self.slots.fill((0, 0));
            1
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{LANES, Plain};

    const TRIANGLE: [[f32; 3]; 3] = [[-8.0, -8.0, 1.0], [16.0, -16.0, 2.0], [-8.0, 8.0, 1.0]];

    fn cell(reference: &[[f32; 3]; 3], weights: [f32; 3], origin: [f32; 2]) -> Option<[i32; 2]> {
        let ([x, y], front) = places(reference, weights.map(Plain::splat), origin);
        (front & 1 != 0).then(|| {
            cell_at([x, y].map(|lanes| {
                let mut row = [0.0; LANES];
                lanes.store(&mut row);
                row[0]
            }))
        })
    }

    #[test]
    fn a_cell_is_the_floor_of_its_place() {
        for place in [[0.0, -0.0], [0.99, -0.01], [-1.0, -1.5], [7e5, -7e5], [1e9, f32::NEG_INFINITY]] {
            let floor = place.map(|at: f32| at.clamp(-MAX_CELL, MAX_CELL).floor() as i32);
            assert_eq!(cell_at(place), floor, "{place:?}");
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
}
