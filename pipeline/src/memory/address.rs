//! Address space of a frame: surfaces, vertices and textures, each aligned to a line.

/// Bytes per line in all caches of memory.
pub const LINE_BYTES: u64 = 64;

/// A region of memory that passes write to and later ones may read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryRange {
    first: u64,
    bytes: u64,
}

impl MemoryRange {
    /// Without bytes.
    pub(crate) const NOWHERE: Self = Self { first: 0, bytes: 0 };

    /// Address of the first byte.
    pub fn address(&self) -> u64 {
        self.first
    }

    /// Size in bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Whether it has this address.
    pub fn contains(&self, address: u64) -> bool {
        (self.first..self.first + self.bytes).contains(&address)
    }
}

/// Addresses of a frame, handed out one after the other.
#[derive(Clone, Debug, Default)]
pub struct AddressSpace {
    next: u64,
    /// Depths and colours of samples that no pass keeps; passes of one size share them.
    samples: Vec<[MemoryRange; 2]>,
}

impl AddressSpace {
    /// End of the addresses of surfaces, vertices and textures. A line has a number of 32 bits; the upper half is for bins.
    pub const END: u64 = LINE_BYTES << 31;

    /// A new surface of `bytes`.
    pub fn take(&mut self, bytes: u64) -> MemoryRange {
        let first = self.next;
        self.next += bytes.next_multiple_of(LINE_BYTES);
        MemoryRange { first, bytes }
    }

    /// Depths and colours of samples, `bytes` each, whose values end with the pass.
    pub fn samples(&mut self, bytes: u64) -> [MemoryRange; 2] {
        if let Some(known) = self.samples.iter().find(|[depth, _]| depth.bytes == bytes) {
            return *known;
        }
        let new = [self.take(bytes), self.take(bytes)];
        self.samples.push(new);
        new
    }

    /// Whether all surfaces have addresses.
    pub fn fits(&self) -> bool {
        self.next <= Self::END
    }

    /// Bytes handed out.
    pub fn bytes(&self) -> u64 {
        self.next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_are_disjoint_and_start_at_a_line() {
        let mut space = AddressSpace::default();
        let [a, b] = [space.take(100), space.take(1)];
        assert_eq!([a.address(), b.address()], [0, 128]);
        assert!(a.contains(99) && !a.contains(100));
        assert_eq!(space.samples(64), space.samples(64), "passes of one size share their samples");
        assert_ne!(space.samples(64), space.samples(128));
        assert_eq!(space.bytes(), 192 + 2 * 64 + 2 * 128);
    }

    #[test]
    fn addresses_end_where_line_numbers_do() {
        let mut space = AddressSpace::default();
        space.take(AddressSpace::END);
        assert!(space.fits());
        space.take(1);
        assert!(!space.fits());
    }
}
