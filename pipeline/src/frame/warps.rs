//! Warps: lanes that run in step.

/// Lanes of one packet, put into warps in the order in which they start. Each lane of a warp takes as long as
/// the longest. A warp that is not full has no other lanes: warps of other packets issue beside it.
#[derive(Debug)]
pub(super) struct Warps {
    /// Lanes of a full warp.
    lanes: u32,
    /// Lanes of the warp that is being filled, and operations of its longest.
    filled: u32,
    longest: u32,
    /// Operations of the warps before it.
    ops: u32,
}

impl Warps {
    /// No warps so far, of up to `lanes` lanes.
    pub fn new(lanes: u32) -> Self {
        Self { lanes, filled: 0, longest: 0, ops: 0 }
    }

    /// Starts some lanes in one warp, the longest of which takes `ops`. More than a warp has are a warp of their own.
    pub fn start(&mut self, lanes: u32, ops: u32) {
        if self.filled + lanes > self.lanes {
            self.end();
        }
        self.filled += lanes;
        self.longest = self.longest.max(ops);
    }

    fn end(&mut self) {
        self.ops += self.filled * self.longest;
        (self.filled, self.longest) = (0, 0);
    }

    /// Operations of all lanes.
    pub fn ops(mut self) -> u32 {
        self.end();
        self.ops
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ops(lanes: u32, started: &[(u32, u32)]) -> u32 {
        let mut warps = Warps::new(lanes);
        started.iter().for_each(|&(lanes, ops)| warps.start(lanes, ops));
        warps.ops()
    }

    #[test]
    fn a_warp_takes_as_long_as_its_longest_lane() {
        assert_eq!(ops(8, &[(4, 3), (4, 10), (4, 5)]), 8 * 10 + 4 * 5);
        assert_eq!(ops(8, &[(1, 3), (1, 4), (1, 1)]), 3 * 4);
        // Quads are not torn apart.
        assert_eq!(ops(6, &[(4, 3), (4, 10)]), 4 * 3 + 4 * 10);
        // A warp of fewer lanes than a quad runs quads one by one.
        assert_eq!(ops(2, &[(4, 3), (4, 10)]), 4 * 3 + 4 * 10);
        assert_eq!(ops(32, &[]), 0);
    }
}
