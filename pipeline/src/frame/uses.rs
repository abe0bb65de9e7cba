//! What passes without samples access in memory, besides the vertices of their draws: it is stated before the pass, so
//! that dependencies are known, and what the shaders access is compared with it.

use activity::{PacketCounts, Waits};

use super::attachments::PassError;
use super::gpu::Gpu;
use super::lanes::LaneWork;
use crate::memory::{LINE_BYTES, MemoryRange};

/// Ranges of memory that the shaders of a pass access.
#[derive(Clone, Debug, Default)]
pub struct Uses {
    /// By address.
    reads: Vec<MemoryRange>,
    targets: Vec<MemoryRange>,
}

impl Uses {
    /// With ranges that the texture unit reads. The pass waits for earlier ones that write them.
    #[must_use]
    pub fn reading(mut self, ranges: impl IntoIterator<Item = MemoryRange>) -> Self {
        add(&mut self.reads, ranges);
        self
    }

    /// With ranges that the units of depth and colour read or write. They work in the order of passes, so the pass only
    /// waits for earlier ones whose texture units read them.
    #[must_use]
    pub fn targeting(mut self, ranges: impl IntoIterator<Item = MemoryRange>) -> Self {
        add(&mut self.targets, ranges);
        self
    }

    /// Checks that nothing is read and written.
    fn check(&self, pass: &str) -> Result<(), PassError> {
        let both = self.reads.iter().find(|read| self.targets.iter().any(|target| target.overlaps(**read)));
        let Some(range) = both else { return Ok(()) };
        Err(PassError::Feedback { pass: pass.to_owned(), bytes: range.bytes(), address: range.address() })
    }
}

fn add(ranges: &mut Vec<MemoryRange>, more: impl IntoIterator<Item = MemoryRange>) {
    ranges.extend(more);
    ranges.sort_unstable_by_key(MemoryRange::address);
}

/// Whether a line has bytes of these ranges, which are disjoint and sorted.
fn have(ranges: &[MemoryRange], line: u64) -> bool {
    let before = ranges.partition_point(|range| range.address() < line + LINE_BYTES);
    before > 0 && ranges[before - 1].address() + ranges[before - 1].bytes() > line
}

impl Gpu<'_> {
    /// Checks that a pass may begin and use this memory.
    pub(super) fn check_uses(&self, pass: &str, uses: &Uses) -> Result<(), PassError> {
        self.check_frame(pass)?;
        uses.check(pass)
    }

    /// States what the pass that was begun accesses, and lets it wait for earlier ones where it has to.
    pub(super) fn use_memory(&mut self, uses: Uses) {
        let waits = uses.reads.iter().any(|range| self.conflicts(*range, false))
            || uses.targets.iter().any(|range| self.is_read(*range));
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

    fn note_uses(&mut self) {
        self.pending.extend(&self.uses.targets);
        self.reads.extend(self.uses.reads.iter().map(MemoryRange::address));
    }

    /// Makes the accesses of lanes, for a packet with these counts. `is_cleared` says whether a line of a target has
    /// held nothing but the clear value so far.
    ///
    /// # Errors
    /// [`PassError::Unstated`] if the pass did not state that it accesses a line.
    pub(super) fn access(
        &mut self,
        work: &LaneWork,
        counts: &mut PacketCounts,
        mut is_cleared: impl FnMut(u64) -> bool,
    ) -> Result<(), PassError> {
        *counts += &work.counts;
        let Self { memory, uses, .. } = self;
        for access in &work.depths {
            memory.depth(access.line, access.write, is_cleared(access.line), counts);
        }
        work.reads.iter().for_each(|line| memory.texture(*line, counts));
        for access in &work.colours {
            memory.colour(access.line, access.write, access.whole || is_cleared(access.line), counts);
        }
        let read = work.reads.iter().find(|line| !have(&uses.reads, **line));
        let mut targets = work.depths.iter().chain(&work.colours).map(|access| access.line);
        match read.copied().or_else(|| targets.find(|line| !have(&uses.targets, *line))) {
            Some(line) => Err(PassError::Unstated { pass: self.name_of_pass().to_owned(), line }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::AddressSpace;

    #[test]
    fn lines_are_in_the_ranges_of_which_they_have_bytes() {
        let mut space = AddressSpace::default();
        let ranges = [100, 1, 64, 65].map(|bytes| space.take(bytes));
        let uses = Uses::default().reading([ranges[3], ranges[0]]).reading([ranges[1]]);
        let end = ranges[3].address() + 128;
        let held: Vec<u64> = (0..=end / LINE_BYTES)
            .filter(|line| have(&uses.reads, line * LINE_BYTES))
            .map(|line| line * LINE_BYTES)
            .collect();
        let expected = [0, 1, 3].iter().flat_map(|at: &usize| {
            let first = ranges[*at].address() / LINE_BYTES;
            (first..=(ranges[*at].address() + ranges[*at].bytes() - 1) / LINE_BYTES)
                .map(|line| line * LINE_BYTES)
        });
        assert_eq!(held, expected.collect::<Vec<u64>>());
        assert!(!have(&[], 0));
    }
}
