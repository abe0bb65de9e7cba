//! Depths and colours that fit in half their room.
//!
//! Offset compression of depth (Hasselgren and Akenine-Möller 2006, "Efficient Depth Buffer Compression", section 3): the least
//! depth whole, the others as offsets. A pixel of one colour needs that once. A line whose pixels all fit keeps its half of the
//! first line of a pair, so that two of them are moved as one.

use serde::Deserialize;

use super::LINE_BYTES;

/// What is compressed on its way between the caches of the units and the L2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Compression {
    /// Depths of pixels whose samples are close to each other.
    #[serde(default)]
    pub depth: bool,
    /// Colours of pixels whose samples all see one triangle and share their shading.
    #[serde(default)]
    pub colour: bool,
}

impl Compression {
    /// Whether anything is.
    pub fn is_on(self) -> bool {
        self.depth || self.colour
    }
}

/// Bits of an offset where `samples` depths of 32 bits are to take half their room; none where not even the first fits.
fn offset_bits(samples: u32) -> Option<u32> {
    let left = (16 * samples).checked_sub(32)?;
    Some(left.checked_div(samples - 1).unwrap_or(0))
}

/// Whether positive depths from `least` to `most`, of `samples` samples, fit in half their room.
pub(crate) fn depths_fit(least: f32, most: f32, samples: u32) -> bool {
    // The bits of positive floats are in the order of their values.
    offset_bits(samples).is_some_and(|bits| most.to_bits() - least.to_bits() < 1 << bits)
}

/// Where lines of depths and of colours lie in memory, halved or not.
#[derive(Clone, Debug, Default)]
pub(crate) struct Halves {
    /// First lines of the buffers, in order, and the end of the last.
    buffers: [u64; 3],
    /// Of each line from the first on; empty where nothing is compressed.
    halved: Vec<bool>,
}

impl Halves {
    /// For buffers that begin at these addresses, the last of them ending at the third.
    pub fn new(buffers: [u64; 3]) -> Self {
        let buffers = buffers.map(|address| address / LINE_BYTES);
        Self { buffers, halved: vec![false; (buffers[2] - buffers[0]) as usize] }
    }

    /// Notes whether what is in the line at `address` fits in half of it.
    pub fn note(&mut self, address: u64, fits: bool) {
        let at = (address / LINE_BYTES - self.buffers[0]) as usize;
        if let Some(halved) = self.halved.get_mut(at) {
            *halved = fits;
        }
    }

    fn is_halved(&self, line: u64) -> bool {
        let at = line.checked_sub(self.buffers[0]);
        at.and_then(|at| self.halved.get(at as usize)).is_some_and(|&halved| halved)
    }

    /// The line that is moved for `line`: for a halved one the first of its pair.
    pub fn place(&self, line: u64) -> u64 {
        if !self.is_halved(line) {
            return line;
        }
        let base = self.buffers[usize::from(line >= self.buffers[1])];
        line - (line - base) % 2
    }

    /// Whether nobody needs the line that is moved for `line` when `line` is not needed any more, and those before it neither.
    pub fn is_last(&self, line: u64) -> bool {
        let shared = self.place(line + 1) == line;
        !shared || self.place(line) != line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_take_what_the_first_depth_leaves() {
        assert_eq!([1, 2, 4, 8, 16].map(offset_bits), [None, Some(0), Some(10), Some(13), Some(14)]);
        // A depth whole and the offsets of the others, in half of 32 bits each.
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
        // Depths in lines 10 to 13, colours in 13 to 17: pairs are counted from the first line of each.
        let mut halves = Halves::new([640, 832, 1088]);
        (10..17).for_each(|line| halves.note(line * LINE_BYTES, true));
        assert_eq!(
            (9..18).map(|line| halves.place(line)).collect::<Vec<_>>(),
            [9, 10, 10, 12, 13, 13, 15, 15, 17]
        );
        assert_eq!((10..13).map(|line| halves.is_last(line)).collect::<Vec<_>>(), [false, true, true]);
        halves.note(11 * LINE_BYTES, false);
        assert_eq!((halves.place(11), halves.is_last(11), halves.is_last(10)), (11, true, true));
        assert_eq!(Halves::default().place(11), 11);
    }
}
