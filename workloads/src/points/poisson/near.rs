//! Cells near a cell, and the points in them packed together.

/// Cells of a row looked at together.
pub(super) const LANES: usize = 8;
/// A place so far away that an empty cell is in nobody's way.
pub(super) const FAR: f32 = 1e9;
/// The points whose disks may touch a cell.
pub(super) struct Near<const D: usize> {
    pub slot: usize,
    /// Where they are, seen from the low corner of the cell, by axis; far away from the last one on.
    pub places: [Vec<f32>; D],
    /// How many of these are to be looked at, a multiple of the lanes.
    pub padded: usize,
}

impl<const D: usize> Near<D> {
    /// Of no cell yet.
    pub fn new() -> Self {
        Self { slot: usize::MAX, places: std::array::from_fn(|_| Vec::new()), padded: 0 }
    }

    /// Whether they are those of this cell.
    pub fn is_of(&self, slot: usize) -> bool {
        self.slot == slot
    }

    /// The smallest squared distance to a point from the corner of a cube that is farthest from it; middle and half a side.
    #[inline]
    pub fn nearest(&self, at: &[f32; D], half: f32) -> f32 {
        let mut least = [f32::INFINITY; LANES];
        for first in (0..self.padded).step_by(LANES) {
            let mut sums = [0.0_f32; LANES];
            for (places, from) in self.places.iter().zip(at) {
                let places = &places[first..first + LANES];
                for lane in 0..LANES {
                    let apart = (places[lane] - from).abs() + half;
                    sums[lane] += apart * apart;
                }
            }
            for lane in 0..LANES {
                least[lane] = if sums[lane] < least[lane] { sums[lane] } else { least[lane] };
            }
        }
        smallest(least)
    }
}

/// The smallest of some numbers.
#[inline]
pub(super) fn smallest(mut least: [f32; LANES]) -> f32 {
    for width in [4, 2, 1] {
        for lane in 0..width {
            let (a, b) = (least[lane], least[lane + width]);
            least[lane] = if a < b { a } else { b };
        }
    }
    least[0]
}

/// Neighbours in a row along the first axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row<const D: usize> {
    /// From a cell to the first of the row.
    pub offset: isize,
    /// Cells from a cell to the row along each axis; the first is not used.
    pub away: [f32; D],
}

/// The rows that may reach into a cell, nearest first.
pub(super) fn rows<const D: usize>(pad: i64, strides: &[u64; D], ratio: f64) -> Vec<Row<D>> {
    let along = 2 * pad + 1;
    let row = |number: i64| {
        let away: [i64; D] = std::array::from_fn(|axis| match axis {
            0 => -pad,
            _ => number / along.pow(axis as u32 - 1) % along - pad,
        });
        let gap = |at: i64| (at.abs() - 1).max(0) as f64;
        let apart: f64 = away[1..].iter().map(|&at| gap(at) * gap(at)).sum();
        let size: i64 = away[1..].iter().map(|at| at * at).sum();
        let offset = (0..D).map(|axis| away[axis] * strides[axis] as i64).sum::<i64>() as isize;
        (apart, size, Row { offset, away: away.map(|at| at as f32) })
    };
    let mut all: Vec<_> = (0..along.pow(D as u32 - 1)).map(row).collect();
    all.retain(|(apart, _, _)| *apart < ratio * ratio);
    all.sort_by_key(|(_, size, _)| *size);
    all.into_iter().map(|(_, _, row)| row).collect()
}
