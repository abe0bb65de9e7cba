//! Cache hierarchy between the units and the memory chips, accessed in the order of the modelled hardware;
//! addresses and compression of the buffers.

use activity::{Event, LEVELS, LineAccess, PacketCounts, Unit};
use serde::{Deserialize, Serialize};

use super::shared::SharedCaches;
use super::{AccessOutcome, Cache, CacheError, CacheSpec, LINE_BYTES, MemoryRange};

/// Caches of memory, with lines of 64 bytes as entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MemorySpec {
    /// Depth cache.
    pub depth: CacheSpec,
    /// Colour cache.
    pub colour: CacheSpec,
    /// Texture cache.
    pub texture: CacheSpec,
    /// Triangle buffer: cache of bins, which are set-up records and lists of triangles. Without it bins take
    /// no memory.
    #[serde(default)]
    pub bins: Option<CacheSpec>,
    /// L2, shared by all.
    pub l2: CacheSpec,
    /// Last-level cache below the L2: what the GPU can use of it.
    #[serde(default)]
    pub llc: Option<CacheSpec>,
    /// Embedded DRAM below the last-level cache, or below the L2 without one.
    #[serde(default)]
    pub edram: Option<CacheSpec>,
    /// Compression between the unit caches and the L2; off by default.
    #[serde(default)]
    pub compression: Compression,
}

impl MemorySpec {
    /// The levels below the L2, in the order of [`LEVELS`].
    pub fn levels(&self) -> [Option<CacheSpec>; LEVELS.len()] {
        [self.llc, self.edram]
    }
}

/// A unit's own cache above the L2, and its events.
#[derive(Clone, Debug)]
struct Client {
    unit: Unit,
    cache: Cache,
    lines: Event,
    misses: Event,
}

/// State of all caches.
#[derive(Clone, Debug)]
pub struct MemorySystem {
    depth: Client,
    colour: Client,
    texture: Client,
    bins: Option<Cache>,
    l2: SharedCaches,
    compressed: CompressedLines,
}

impl MemorySystem {
    /// Empty caches.
    ///
    /// # Errors
    /// [`CacheError`] if one of them is invalid.
    pub fn new(spec: &MemorySpec) -> Result<Self, CacheError> {
        let client = |spec, lines: Event, misses| {
            Ok(Client { unit: lines.unit(), cache: Cache::new(spec)?, lines, misses })
        };
        Ok(Self {
            depth: client(spec.depth, Event::DepthLines, Event::DepthMisses)?,
            colour: client(spec.colour, Event::ColourLines, Event::ColourMisses)?,
            texture: client(spec.texture, Event::TextureLines, Event::TextureMisses)?,
            bins: spec.bins.map(Cache::new).transpose()?,
            l2: SharedCaches::new(spec.l2, spec.levels())?,
            compressed: CompressedLines::default(),
        })
    }

    /// Compress the depth and colour buffers at these addresses from now on; [`Self::set_compressed`] marks lines.
    pub fn compress(&mut self, buffers: [u64; 3]) {
        self.compressed = CompressedLines::new(buffers);
    }

    /// Set whether the line at `address` compresses to half.
    pub fn set_compressed(&mut self, address: u64, fits: bool) {
        self.compressed.set(address, fits);
    }

    /// Lines requested from the L2 since the log was last cleared, in order.
    pub fn log(&self) -> &[LineAccess] {
        self.l2.log()
    }

    /// Clear the log.
    pub fn clear_log(&mut self) {
        self.l2.clear_log();
    }

    /// Read the line at `address` by the depth unit, and write it if `write` is set. A `fresh` line holds the
    /// clear value, so it is not fetched.
    pub fn depth(&mut self, address: u64, write: bool, fresh: bool, counts: &mut PacketCounts) {
        access(&mut self.depth, (&mut self.l2, &self.compressed), address, write, fresh, counts);
    }

    /// Read or write the line at `address` by the colour unit; `fresh` as for depth.
    pub fn colour(&mut self, address: u64, write: bool, fresh: bool, counts: &mut PacketCounts) {
        access(&mut self.colour, (&mut self.l2, &self.compressed), address, write, fresh, counts);
    }

    /// Discard the line at `address`, whose samples are no longer needed. It is removed from all caches and
    /// not written back.
    pub fn discard(&mut self, address: u64) {
        let line = address / LINE_BYTES;
        self.depth.cache.discard(line);
        self.colour.cache.discard(line);
        if self.compressed.is_last(line) {
            self.l2.discard(self.compressed.moved_line(line));
        }
    }

    /// Read the line at `address` by a texture unit.
    pub fn texture(&mut self, address: u64, counts: &mut PacketCounts) {
        access(&mut self.texture, (&mut self.l2, &self.compressed), address, false, false, counts);
    }

    /// Read the lines of `bytes` from `address` by the vertex fetch, directly from the L2.
    pub fn vertices(&mut self, address: u64, bytes: u64, counts: &mut PacketCounts) {
        let first = address / LINE_BYTES;
        let last = (address + bytes.max(1) - 1) / LINE_BYTES;
        (first..=last).for_each(|line| self.l2.access(Unit::Command, line, false, counts));
    }

    /// Write the line of bins at `address`, which is new or in part so, by set-up.
    pub fn write_bin(&mut self, address: u64, counts: &mut PacketCounts) {
        let Some(bins) = &mut self.bins else { return };
        counts[Event::BinLinesWritten] += 1;
        if let AccessOutcome::MissEvicting(victim) = bins.access(address / LINE_BYTES, true) {
            self.l2.access(Unit::Setup, victim, true, counts);
        }
    }

    /// Read the line of bins at `address` by the tile loop.
    pub fn read_bin(&mut self, address: u64, counts: &mut PacketCounts) {
        let Some(bins) = &mut self.bins else { return };
        counts[Event::BinLinesRead] += 1;
        let line = address / LINE_BYTES;
        let found = bins.access(line, false);
        if found == AccessOutcome::Hit {
            return;
        }
        counts[Event::BinMisses] += 1;
        if let AccessOutcome::MissEvicting(victim) = found {
            self.l2.access(Unit::Traversal, victim, true, counts);
        }
        self.l2.access(Unit::Traversal, line, false, counts);
    }

    /// Discard the line of bins at `address`, as all triangles of its batch are drawn.
    pub fn discard_bin(&mut self, address: u64) {
        let line = address / LINE_BYTES;
        if let Some(bins) = &mut self.bins {
            bins.discard(line);
            self.l2.discard(line);
        }
    }

    /// Read or write the line at `address` for a group of lanes. Groups have no cache above the L2, which
    /// knows the bytes of a line that are written: a line is not fetched to be written in part.
    pub fn buffer(&mut self, address: u64, write: bool, counts: &mut PacketCounts) {
        self.l2.access(Unit::Compute, self.compressed.moved_line(address / LINE_BYTES), write, counts);
    }

    /// Move written lines to the L2, as later passes read them through other caches. Texture lines are dropped.
    pub fn flush(&mut self, counts: &mut PacketCounts) {
        self.texture.cache.flush();
        for client in [&mut self.colour, &mut self.depth] {
            for line in client.cache.flush() {
                self.l2.access(client.unit, self.compressed.moved_line(line), true, counts);
            }
        }
    }

    /// End the frame: lines in `kept` (images and depths) are written back, all others are dropped.
    pub fn finish(&mut self, kept: &[MemoryRange], counts: &mut PacketCounts) {
        let is_kept = |line: u64| kept.iter().any(|surface| surface.contains(line * LINE_BYTES));
        let mut unit = Unit::Colour;
        for client in [&mut self.colour, &mut self.depth] {
            for line in client.cache.flush() {
                if is_kept(line) {
                    unit = client.unit;
                    self.l2.access(unit, self.compressed.moved_line(line), true, counts);
                }
            }
        }
        self.l2.drain(unit, is_kept, counts);
    }
}

fn access(
    client: &mut Client,
    (l2, compressed): (&mut SharedCaches, &CompressedLines),
    address: u64,
    write: bool,
    fresh: bool,
    counts: &mut PacketCounts,
) {
    let line = address / LINE_BYTES;
    counts[client.lines] += 1;
    let found = client.cache.access(line, write);
    if found == AccessOutcome::Hit {
        return;
    }
    counts[client.misses] += 1;
    if let AccessOutcome::MissEvicting(victim) = found {
        l2.access(client.unit, compressed.moved_line(victim), true, counts);
    }
    if !fresh {
        l2.access(client.unit, compressed.moved_line(line), false, counts);
    }
}

/// Compression of depths and colours to half their size, between the caches of the units and the L2.
///
/// Offset compression of depth (Hasselgren and Akenine-Möller 2006, "Efficient Depth Buffer Compression",
/// section 3): the smallest depth is stored in full, the others as offsets. A pixel of one colour stores it
/// once. Lines come in pairs. A compressed line uses one half of the first line of its pair, so that two
/// compressed lines are moved as one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Compression {
    /// Depths of pixels whose samples have similar depths.
    #[serde(default)]
    pub depth: bool,
    /// Colours of pixels whose samples all see one triangle and share their shading.
    #[serde(default)]
    pub colour: bool,
}

impl Compression {
    /// Whether any compression is enabled.
    pub fn is_on(self) -> bool {
        self.depth || self.colour
    }
}

/// Bits per offset if `samples` depths of 32 bits are compressed to half; `None` if even the first depth does
/// not fit.
fn offset_bits(samples: u32) -> Option<u32> {
    let left = (16 * samples).checked_sub(32)?;
    Some(left.checked_div(samples - 1).unwrap_or(0))
}

/// Whether `samples` positive depths between `min` and `max` compress to half.
pub(crate) fn depths_fit(min: f32, max: f32, samples: u32) -> bool {
    // The bits of positive floats are in the order of their values.
    offset_bits(samples).is_some_and(|bits| max.to_bits() - min.to_bits() < 1 << bits)
}

/// Compressed lines of the depth and colour buffers.
#[derive(Clone, Debug, Default)]
struct CompressedLines {
    /// First lines of the two buffers, and the end of the second.
    buffers: [u64; 3],
    /// State of each line from the first on; empty without compression.
    is_compressed: Vec<bool>,
}

impl CompressedLines {
    /// Lines of two buffers that begin at the first two addresses; the third is the end.
    pub fn new(buffers: [u64; 3]) -> Self {
        let buffers = buffers.map(|address| address / LINE_BYTES);
        Self { buffers, is_compressed: vec![false; (buffers[2] - buffers[0]) as usize] }
    }

    /// Record whether the contents of the line at `address` compress to half.
    pub fn set(&mut self, address: u64, fits: bool) {
        let at = (address / LINE_BYTES - self.buffers[0]) as usize;
        if let Some(is_compressed) = self.is_compressed.get_mut(at) {
            *is_compressed = fits;
        }
    }

    fn is_halved(&self, line: u64) -> bool {
        let at = line.checked_sub(self.buffers[0]);
        at.and_then(|at| self.is_compressed.get(at as usize)).is_some_and(|&is_compressed| is_compressed)
    }

    /// The line that is moved for `line`: the first of its pair if `line` is compressed.
    pub fn moved_line(&self, line: u64) -> u64 {
        if !self.is_halved(line) {
            return line;
        }
        let base = self.buffers[usize::from(line >= self.buffers[1])];
        line - (line - base) % 2
    }

    /// Whether the line moved for `line` is no longer needed once `line` and all lines before it are
    /// discarded.
    pub fn is_last(&self, line: u64) -> bool {
        let shared = self.moved_line(line + 1) == line;
        !shared || self.moved_line(line) != line
    }
}

#[cfg(test)]
mod tests {
    use super::super::AddressSpace;
    use super::*;

    fn system() -> MemorySystem {
        let small = CacheSpec::lru(2, 2);
        let l2 = CacheSpec::lru(64, 4);
        MemorySystem::new(&MemorySpec {
            depth: small,
            colour: small,
            texture: small,
            bins: None,
            l2,
            llc: None,
            edram: None,
            compression: Compression::default(),
        })
        .unwrap()
    }

    #[test]
    fn a_line_is_fetched_once() {
        let (mut memory, mut counts) = (system(), PacketCounts::default());
        memory.texture(100, &mut counts);
        memory.texture(120, &mut counts);
        assert_eq!((counts[Event::TextureLines], counts[Event::TextureMisses]), (2, 1));
        assert_eq!((counts[Event::L2Reads], counts[Event::DramReadBytes]), (1, 64));
    }

    #[test]
    fn a_fresh_line_costs_no_read() {
        let (mut memory, mut counts) = (system(), PacketCounts::default());
        memory.depth(0, true, true, &mut counts);
        assert_eq!(
            (counts[Event::DepthMisses], counts[Event::L2Reads], counts[Event::DramReadBytes]),
            (1, 0, 0)
        );
    }

    #[test]
    fn only_the_image_is_written_at_the_end() {
        let (mut memory, mut counts, mut space) =
            (system(), PacketCounts::default(), AddressSpace::default());
        let [depth, colour, image] = [1024, 1024, 2048].map(|bytes| space.take(bytes));
        memory.depth(depth.address(), true, true, &mut counts);
        memory.colour(colour.address(), true, true, &mut counts);
        memory.colour(image.address(), true, true, &mut counts);
        memory.finish(&[image], &mut counts);
        assert_eq!(counts[Event::DramWriteBytes], 64);
    }

    #[test]
    fn depths_that_are_kept_are_written_and_colours_then_are_not() {
        let (mut memory, mut counts) = (system(), PacketCounts::default());
        (0..3).for_each(|line| memory.depth(64 * line, true, true, &mut counts));
        memory.colour(1024, true, true, &mut counts);
        memory.finish(&[AddressSpace::default().take(1024)], &mut counts);
        assert_eq!(counts[Event::DramWriteBytes], 3 * 64);
    }

    #[test]
    fn two_halved_lines_are_moved_as_one() {
        let moved = |fits: bool| {
            let (mut memory, mut counts) = (system(), PacketCounts::default());
            memory.compress([0, 4096, 8192]);
            (0..2).for_each(|line| memory.set_compressed(64 * line, fits));
            (0..2).for_each(|line| memory.depth(64 * line, false, false, &mut counts));
            (counts[Event::DepthMisses], counts[Event::L2Reads], counts[Event::DramReadBytes])
        };
        assert_eq!((moved(false), moved(true)), ((2, 2, 128), (2, 2, 64)));
    }

    #[test]
    fn vertices_span_lines() {
        let (mut memory, mut counts) = (system(), PacketCounts::default());
        memory.vertices(60, 32, &mut counts);
        assert_eq!(counts[Event::L2Reads], 2);
    }

    #[test]
    fn offsets_use_the_bits_left_by_the_first_depth() {
        assert_eq!([1, 2, 4, 8, 16].map(offset_bits), [None, Some(0), Some(10), Some(13), Some(14)]);
        // One full depth and the offsets of the others, in half of 32 bits each.
        for samples in 2..=64 {
            let bits = 32 + (samples - 1) * offset_bits(samples).unwrap();
            assert!(bits <= 16 * samples, "{samples}");
        }
    }

    #[test]
    fn depths_fit_up_to_the_last_offset() {
        let after = |depth: f32, steps: u32| f32::from_bits(depth.to_bits() + steps);
        assert!(depths_fit(3.0, after(3.0, 1023), 4) && !depths_fit(3.0, after(3.0, 1024), 4));
        assert!(depths_fit(3.0, 3.0, 2) && !depths_fit(3.0, after(3.0, 1), 2));
        assert!(!depths_fit(3.0, 3.0, 1) && !depths_fit(3.0, f32::INFINITY, 8));
    }

    #[test]
    fn halved_lines_share_the_first_of_their_pair() {
        // Depths in lines 10 to 13, colours in 13 to 17: pairs start at the first line of each buffer.
        let mut compressed = CompressedLines::new([640, 832, 1088]);
        (10..17).for_each(|line| compressed.set(line * LINE_BYTES, true));
        assert_eq!(
            (9..18).map(|line| compressed.moved_line(line)).collect::<Vec<_>>(),
            [9, 10, 10, 12, 13, 13, 15, 15, 17]
        );
        assert_eq!((10..13).map(|line| compressed.is_last(line)).collect::<Vec<_>>(), [false, true, true]);
        compressed.set(11 * LINE_BYTES, false);
        assert_eq!(
            (compressed.moved_line(11), compressed.is_last(11), compressed.is_last(10)),
            (11, true, true)
        );
        assert_eq!(CompressedLines::default().moved_line(11), 11);
    }
}
