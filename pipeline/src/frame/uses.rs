//! What passes without samples access in memory, besides the vertices of their draws: it is stated before the pass, so
//! that dependencies are known, and what the shaders access is compared with it.

use super::attachments::PassError;
use crate::memory::{LINE_BYTES, MemoryRange};

/// Ranges of memory that the shaders of a pass access.
#[derive(Clone, Debug, Default)]
pub struct Uses {
    /// By address.
    reads: Vec<MemoryRange>,
    depths: Vec<MemoryRange>,
    colours: Vec<MemoryRange>,
}

/// What writes a range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Writer {
    /// The unit of depth, in the order of passes.
    Depth,
    /// The unit of colour, in the order of passes.
    Colour,
    /// Another unit, or a pass of triangles.
    Other,
}

impl Uses {
    /// With ranges that the texture unit reads. The pass waits for earlier ones that write them.
    #[must_use]
    pub fn reading(mut self, ranges: impl IntoIterator<Item = MemoryRange>) -> Self {
        add(&mut self.reads, ranges);
        self
    }

    /// With ranges that the unit of depth reads or writes. It works in the order of passes, so the pass only waits for
    /// earlier ones whose other units access them.
    #[must_use]
    pub fn depths(mut self, ranges: impl IntoIterator<Item = MemoryRange>) -> Self {
        add(&mut self.depths, ranges);
        self
    }

    /// The same of the unit of colour.
    #[must_use]
    pub fn colours(mut self, ranges: impl IntoIterator<Item = MemoryRange>) -> Self {
        add(&mut self.colours, ranges);
        self
    }

    /// What the texture unit reads.
    pub(super) fn reads(&self) -> &[MemoryRange] {
        &self.reads
    }

    /// What the units of depth and colour access.
    pub(super) fn targets(&self) -> impl Iterator<Item = (MemoryRange, Writer)> {
        let depths = self.depths.iter().map(|range| (*range, Writer::Depth));
        depths.chain(self.colours.iter().map(|range| (*range, Writer::Colour)))
    }

    /// Whether the texture unit may read a line.
    pub(super) fn may_read(&self, line: u64) -> bool {
        have(&self.reads, line)
    }

    /// Whether the unit of depth may access a line.
    pub(super) fn may_be_depth(&self, line: u64) -> bool {
        have(&self.depths, line)
    }

    /// Whether the unit of colour may access a line.
    pub(super) fn may_be_colour(&self, line: u64) -> bool {
        have(&self.colours, line)
    }

    /// Checks that nothing is read and written.
    pub(super) fn check(&self, pass: &str) -> Result<(), PassError> {
        let both = self.reads.iter().find(|read| self.targets().any(|(target, _)| target.overlaps(**read)));
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
            .filter(|line| uses.may_read(line * LINE_BYTES))
            .map(|line| line * LINE_BYTES)
            .collect();
        let expected = [0, 1, 3].iter().flat_map(|at: &usize| {
            let first = ranges[*at].address() / LINE_BYTES;
            (first..=(ranges[*at].address() + ranges[*at].bytes() - 1) / LINE_BYTES)
                .map(|line| line * LINE_BYTES)
        });
        assert_eq!(held, expected.collect::<Vec<u64>>());
        assert!(!uses.may_be_depth(0) && !uses.may_be_colour(0));
    }
}
