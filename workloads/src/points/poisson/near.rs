//! The points near a cell, packed together.

/// Points looked at together.
const LANES: usize = 8;
/// Points of one word of bits.
const WORD: usize = 64;
/// A place so far away that it is in nobody's way.
const FAR: f32 = 1e9;

/// The points near a cell, or those of them whose disks may touch a cube in it.
pub(super) struct Near<const D: usize> {
    pub slot: usize,
    /// Where they are, seen from the low corner of the cell, in cells; by axis, with room to work in.
    places: [Vec<f32>; D],
    count: usize,
}

/// The most cubes that a cube is halved into along all axes.
pub(super) const MOST_HALVES: usize = 16;

impl<const D: usize> Near<D> {
    /// Of no cell yet, with room for so many points.
    pub fn new(room: usize) -> Self {
        let room = room.next_multiple_of(WORD) + WORD;
        Self { slot: usize::MAX, places: std::array::from_fn(|_| vec![FAR; room]), count: 0 }
    }

    /// Whether they are those of this cell.
    pub fn is_of(&self, slot: usize) -> bool {
        self.slot == slot
    }

    /// Forgets all points, for those of another cell.
    pub fn clear(&mut self, slot: usize) {
        (self.slot, self.count) = (slot, 0);
    }

    /// Adds a point.
    #[inline]
    pub fn push(&mut self, place: &[f32; D]) {
        for (places, at) in self.places.iter_mut().zip(place) {
            places[self.count] = *at;
        }
        self.count += 1;
    }

    /// Takes those of `all` that are nearer than the root of `reach2` to some place of a cube.
    #[inline]
    pub fn take_within(&mut self, all: &Self, low: &[f32; D], side: f32, reach2: f32) {
        self.clear(all.slot);
        for first in (0..all.count).step_by(WORD) {
            let count = (all.count - first).min(WORD);
            let mut bits = 0;
            for block in (0..count).step_by(LANES) {
                bits |= u64::from(all.within(first + block, low, side, reach2)) << block;
            }
            bits &= u64::MAX >> (WORD - count);
            while bits != 0 {
                let from = first + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                self.push(&std::array::from_fn(|axis| all.places[axis][from]));
            }
        }
    }

    /// Which points of a block are nearer than that to a cube, a bit for each.
    #[inline]
    fn within(&self, first: usize, low: &[f32; D], side: f32, reach2: f32) -> u8 {
        let mut sums = [0.0_f32; LANES];
        for (places, low) in self.places.iter().zip(low) {
            let places = &places[first..first + LANES];
            for lane in 0..LANES {
                let within = places[lane] - low;
                let gap = larger(larger(-within, within - side), 0.0);
                sums[lane] += gap * gap;
            }
        }
        (0..LANES).fold(0, |bits, lane| bits | u8::from(sums[lane] < reach2) << lane)
    }

    /// For each half along each axis of a cube (corner bits count axes) the smallest squared distance from its farthest corner to a
    /// point: from the middles of lower and upper halves and half their side.
    #[inline]
    pub fn of_halves(&self, middles: &[[f32; 2]; D], half: f32) -> [f32; MOST_HALVES] {
        let mut least = [f32::INFINITY; MOST_HALVES];
        for point in 0..self.count {
            let mut sums = [0.0_f32; MOST_HALVES];
            for axis in 0..D {
                let [lower, upper] = middles[axis].map(|middle| {
                    let apart = (self.places[axis][point] - middle).abs() + half;
                    apart * apart
                });
                for corner in 0..1 << axis {
                    sums[corner + (1 << axis)] = sums[corner] + upper;
                    sums[corner] += lower;
                }
            }
            for corner in 0..1 << D {
                least[corner] = if sums[corner] < least[corner] { sums[corner] } else { least[corner] };
            }
        }
        least
    }

    /// The smallest squared distance from a place to a point.
    #[inline]
    pub fn nearest(&self, at: &[f32; D]) -> f32 {
        (0..self.count).fold(f32::INFINITY, |least, point| {
            let apart2 = square_of_difference(&std::array::from_fn(|axis| self.places[axis][point]), at);
            if apart2 < least { apart2 } else { least }
        })
    }
}

/// The larger of two numbers, none of them NaN, as processors have it.
#[inline]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The squared distance of two places.
#[inline]
pub(super) fn square_of_difference<const D: usize>(a: &[f32; D], b: &[f32; D]) -> f32 {
    (0..D).fold(0.0, |sum, axis| {
        let apart = a[axis] - b[axis];
        sum + apart * apart
    })
}
