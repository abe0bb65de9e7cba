//! Where things stand in a JLS file of version 2. The layout is Jetperch's (JLS 0.17, `include/jls/format.h`, Apache-2.0);
//! code and words are our own. All numbers are little-endian.
//!
//! A file is a header and a row of chunks: a header each, a payload, and checksums of both. Chunks of one kind and signal
//! make up a list that leads both ways.

/// What every file begins with.
pub(in crate::io) const IDENTIFICATION: &[u8; 16] = b"jlsfmt\r\n \n \x1a  \xb2\x1c";
/// The version of the layout: 1.0.0, major number in the highest byte.
pub(in crate::io) const VERSION: u32 = 1 << 24;
/// Identification, length (8), version (4), checksum (4).
pub(in crate::io) const FILE_HEADER_BYTES: u64 = 32;
/// Next and previous of the list (8 each), tag (1), zero (1), mark (2), bytes of the payload and of that before it (4
/// each), checksum (4).
pub(in crate::io) const HEADER_BYTES: usize = 32;
const CRC_BYTES: u64 = 4;
/// A payload longer than this is not read or written: what a file claims is not allocated on trust. pyjls makes 32 KiB.
pub(in crate::io) const LONGEST_BYTES: u32 = 1 << 26;

pub(in crate::io) const SOURCE: u8 = 0x01;
pub(in crate::io) const SIGNAL: u8 = 0x02;
pub(in crate::io) const USER_DATA: u8 = 0x40;
pub(in crate::io) const END: u8 = 0xff;

/// What a track holds; the tag of a chunk is that of its track with the [kind](tag) of chunk.
pub(in crate::io) const FIXED_RATE: u8 = 0x20;
pub(in crate::io) const VARIABLE_RATE: u8 = 0x28;
pub(in crate::io) const ANNOTATIONS: u8 = 0x30;
pub(in crate::io) const UTC: u8 = 0x38;

/// Kinds of chunks of a track. A head says where the data and each level of indices begin.
pub(in crate::io) const DEFINITION: u8 = 0;
pub(in crate::io) const HEAD: u8 = 1;
pub(in crate::io) const DATA: u8 = 2;
pub(in crate::io) const INDEX: u8 = 3;
pub(in crate::io) const SUMMARY: u8 = 4;

/// Levels of a track: data, then indices and summaries one above the other.
pub(in crate::io) const LEVELS: usize = 16;
/// Zeros before the texts of a source.
pub(in crate::io) const SOURCE_TEXTS: usize = 64;
/// Where the texts of a signal begin: numbers and zeros before.
pub(in crate::io) const SIGNAL_TEXTS: usize = 128;
/// The type of samples in f32: float (4), 32 bits.
pub(in crate::io) const F32: u32 = 0x2004;
/// The mark of user data that are JSON, ended by a zero.
pub(in crate::io) const JSON: u16 = 3 << 12;
/// Before the entries of a payload: number of the first sample (8), entries (4), bits of an entry (2), zeros (2).
pub(in crate::io) const FRONT: usize = 16;

/// How long a payload is with its checksum: padded so that it ends on 8.
pub(in crate::io) const fn on_disk(payload_bytes: u32) -> u64 {
    if payload_bytes == 0 { 0 } else { (payload_bytes as u64 + CRC_BYTES).next_multiple_of(8) }
}

/// The front of a payload.
pub(super) fn front(first: i64, entries: usize, bits: u16) -> [u8; FRONT] {
    let mut front = [0; FRONT];
    front[..8].copy_from_slice(&first.to_le_bytes());
    front[8..12].copy_from_slice(&(entries as u32).to_le_bytes());
    front[12..14].copy_from_slice(&bits.to_le_bytes());
    front
}
