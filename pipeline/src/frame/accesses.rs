//! Accesses of passes without samples: what they wait for, and the lines that their lanes access.

use std::collections::HashSet;

use activity::{PacketCounts, Waits};

use super::attachments::PassError;
use super::gpu::Gpu;
use super::lanes::{LaneWork, TargetLine};
use super::uses::{Uses, Writer};
use crate::memory::MemoryRange;

impl Gpu<'_> {
    /// Checks that a pass may begin and use this memory.
    pub(super) fn check_uses(&self, pass: &str, uses: &Uses) -> Result<(), PassError> {
        self.check_frame(pass)?;
        uses.check(pass)
    }

    /// States what the pass that was begun accesses, and lets it wait for earlier ones where it has to.
    pub(super) fn use_memory(&mut self, uses: Uses) {
        let waits = uses.reads().iter().any(|range| self.conflicts(*range, false))
            || uses.targets().any(|(range, by)| self.is_read(range) || self.is_written_by_others(range, by));
        if waits {
            self.barrier(Waits::Tiles);
        }
        self.uses = uses;
        self.note_uses();
    }

    /// Lets the pass that was begun wait for those that write its vertices.
    pub(super) fn read_vertices(&mut self, vertices: MemoryRange) {
        if self.conflicts(vertices, false) {
            self.barrier(Waits::All);
            self.note_uses();
        }
        self.note_read(vertices.address());
    }

    /// Whether a unit other than `by` wrote bytes of a range since the last barrier.
    fn is_written_by_others(&self, range: MemoryRange, by: Writer) -> bool {
        self.pending.iter().any(|(pending, writer)| *writer != by && pending.overlaps(range))
    }

    fn note_uses(&mut self) {
        self.pending.extend(self.uses.targets());
        self.reads.extend(self.uses.reads().iter().map(MemoryRange::address));
    }

    /// Makes the accesses of lanes, for a packet with these counts. Lines of targets that are not in `written` have held
    /// nothing but the clear value so far.
    ///
    /// # Errors
    /// [`PassError::Unstated`] if the pass did not state that it accesses a line.
    pub(super) fn access(
        &mut self,
        work: &LaneWork,
        counts: &mut PacketCounts,
        written: &mut HashSet<u64>,
    ) -> Result<(), PassError> {
        *counts += &work.counts;
        let Self { memory, uses, .. } = self;
        let mut is_cleared = |access: &TargetLine| {
            if access.write { written.insert(access.line) } else { !written.contains(&access.line) }
        };
        for access in &work.depths {
            memory.depth(access.line, access.write, is_cleared(access), counts);
        }
        work.reads.iter().for_each(|line| memory.texture(*line, counts));
        for access in &work.colours {
            memory.colour(access.line, access.write, is_cleared(access), counts);
        }
        let read = work.reads.iter().find(|line| !uses.may_read(**line));
        let depth = work.depths.iter().map(|access| access.line).find(|line| !uses.may_be_depth(*line));
        let colour = work.colours.iter().map(|access| access.line).find(|line| !uses.may_be_colour(*line));
        match read.copied().or(depth).or(colour) {
            Some(line) => Err(PassError::Unstated { pass: self.name_of_pass().to_owned(), line }),
            None => Ok(()),
        }
    }
}
