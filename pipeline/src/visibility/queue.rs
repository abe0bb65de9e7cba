//! Packets that wait to be tested against a triangle.

use crate::simd::{LANES, Lanes, Mask};

/// The packets of a bin that may see one triangle. Filled without a branch that depends on the data, and known ahead of being
/// tested, so that their samples can be fetched.
pub(super) struct Queue {
    /// With room for a whole block behind the last.
    packets: Vec<u32>,
    len: usize,
}

impl Queue {
    /// A queue for bins of so many packets.
    pub fn new(packets: usize) -> Self {
        Self { packets: vec![0; packets + LANES], len: 0 }
    }

    pub fn clear(&mut self) {
        self.len = 0;
    }

    pub fn len(&self) -> usize {
        self.len
    }

    /// The packet queued as number `turn`. A few turns past the end it is some packet of the bin, to be fetched in vain.
    #[inline(always)]
    pub fn packet(&self, turn: usize) -> usize {
        self.packets[turn] as usize
    }

    /// Queues the packets of a mask, counted from `first`.
    #[inline(always)]
    pub fn push<V: Lanes>(&mut self, mask: Mask, first: u32) {
        if let Some(room) = self.packets[self.len..].first_chunk_mut() {
            V::number(mask, first, room);
            self.len += mask.count_ones() as usize;
        }
    }
}
