//! Buffers in memory: their addresses, and compression of depths and colours to half their size.
//!
//! Offset compression of depth (Hasselgren and Akenine-Möller 2006, "Efficient Depth Buffer Compression",
//! section 3): the smallest depth is stored in full, the others as offsets. A pixel of one colour stores it
//! once. Lines come in pairs. A compressed line uses one half of the first line of its pair, so that two
//! compressed lines are moved as one.

use serde::Deserialize;

/// Compression between the caches of the units and the L2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
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
pub(crate) struct CompressedLines {
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

/// Bytes per line in all caches of memory.
pub const LINE_BYTES: u64 = 64;

/// Addresses of consecutive buffers, each aligned to a line.
#[derive(Clone, Debug)]
pub struct AddressMap {
    /// First byte of the sample depths.
    pub depth: u64,
    /// First byte of the sample colours.
    pub colour: u64,
    /// First byte of the resolved image.
    pub image: u64,
    /// First byte of the vertices of each draw.
    pub vertices: Vec<u64>,
    /// First byte of the texture of each draw; draws with the same texture have the same address.
    pub textures: Vec<u64>,
}

/// Allocator of addresses.
#[derive(Debug, Default)]
pub(crate) struct Allocator(u64);

impl Allocator {
    /// First byte of a new buffer of `bytes`.
    pub fn take(&mut self, bytes: u64) -> u64 {
        let first = self.0;
        self.0 += bytes.next_multiple_of(LINE_BYTES);
        first
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
