//! The quads of the shading grid that one packet asks for.

/// What one packet asks of one quad of 2x2 cells or, where every sample is shaded, of 2x2 pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QuadAccess {
    /// The quad, in cells or pixels divided by two.
    pub quad: [i32; 2],
    /// The index of the sample in each pixel of the quad, 0 for cells.
    pub sample: u16,
    /// Samples that asked.
    pub lookups: u16,
    /// The cells asked for, one bit each, row by row.
    pub lanes: u8,
}

/// Gathers the look-ups of one packet by quad, in the order in which the quads are first met: the look-ups of a packet
/// are coalesced before they reach the cache.
#[derive(Clone, Debug)]
pub struct QuadSet {
    list: Vec<QuadAccess>,
    /// An open hash table of places in `list`, each with the round it was written in: older ones are empty.
    slots: Vec<(u32, u16)>,
    round: u32,
}

/// Twice the samples a packet can have at most, so that a free slot is always near.
const SLOTS: usize = 32_768;

impl Default for QuadSet {
    fn default() -> Self {
        Self { list: Vec::new(), slots: vec![(0, 0); SLOTS], round: 1 }
    }
}

impl QuadSet {
    /// One sample asks for `cell`, or for the one with index `sample` of that pixel.
    pub fn ask(&mut self, cell: [i32; 2], sample: u16) {
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

    /// Moves what was gathered to the end of `log` and starts anew.
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

    #[test]
    fn look_ups_are_gathered_by_quad_in_order() {
        let mut set = QuadSet::default();
        for cell in [[5, 4], [0, 0], [4, 5], [5, 4], [-1, -1]] {
            set.ask(cell, 0);
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
        set.ask([5, 4], 0);
        set.drain_into(&mut log);
        assert_eq!(log.len(), 4);
        assert_eq!(log[3].lookups, 1);
    }
}
