//! Lines of memory that a packet asks the L2 for, in order.

use crate::Unit;

/// What becomes of a line in the L2. Caches are decided in the order of the stream, before anyone asks when.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LineKind {
    /// Read, and there.
    Hit,
    /// Read, and fetched from memory.
    Fetch,
    /// Written whole, in the place of what was there of it.
    Write,
    /// Written whole, and not there before.
    Allocate,
    /// Leaves the L2 for memory at the end of a frame.
    Drain,
}

/// One line asked for. Line numbers are addresses over the bytes of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LineAccess {
    /// The line.
    pub line: u32,
    /// The changed line that makes room for it and goes to memory; [`LineAccess::NONE`] where there is none.
    pub victim: u32,
    /// The unit that asks.
    pub client: Unit,
    /// What becomes of it.
    pub kind: LineKind,
}

impl LineAccess {
    /// No line.
    pub const NONE: u32 = u32::MAX;

    /// Lines that memory transfers for it.
    pub fn transfers(&self) -> u32 {
        u32::from(matches!(self.kind, LineKind::Fetch | LineKind::Drain))
            + u32::from(self.victim != Self::NONE)
    }
}
