//! Where everything lies in memory.

/// Bytes of a line in every cache of memory.
pub const LINE_BYTES: u64 = 64;

/// Buffers one behind the other, each starting at a line.
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
    /// First byte of the texture of each draw; draws that share one share its address.
    pub textures: Vec<u64>,
}

/// Hands out addresses.
#[derive(Debug, Default)]
pub(crate) struct Allocator(u64);

impl Allocator {
    /// The first byte of a new buffer of `bytes`.
    pub fn take(&mut self, bytes: u64) -> u64 {
        let first = self.0;
        self.0 += bytes.next_multiple_of(LINE_BYTES);
        first
    }
}
