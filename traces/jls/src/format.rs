//! Layout of a JLS file of version 2. All numbers are little-endian.
//!
//! A file is a header and a sequence of chunks. A chunk is a header, a payload, and checksums of both. The
//! chunks of one kind and signal form a doubly linked list.

/// First bytes of every file.
pub(crate) const IDENTIFICATION: &[u8; 16] = b"jlsfmt\r\n \n \x1a  \xb2\x1c";
/// The version of the layout: 1.0.0, major number in the highest byte.
pub(crate) const VERSION: u32 = 1 << 24;
/// Identification, length (8), version (4), checksum (4).
pub(crate) const FILE_HEADER_BYTES: u64 = 32;
/// Next and previous of the list (8 each), tag (1), zero (1), mark (2), bytes of the payload and of that
/// before it (4 each), checksum (4).
pub(crate) const HEADER_BYTES: usize = 32;
const CRC_BYTES: u64 = 4;
/// Longest payload that is read or written, in bytes: no length that a file states is allocated on trust.
/// pyjls writes 32 KiB.
pub const MAX_PAYLOAD_BYTES: u32 = 1 << 26;

pub(crate) const SOURCE: u8 = 0x01;
pub(crate) const SIGNAL: u8 = 0x02;
pub(crate) const USER_DATA: u8 = 0x40;
pub(crate) const END: u8 = 0xff;

/// Content of a track; the tag of a chunk is the sum of its track and its kind.
pub(crate) const FIXED_RATE: u8 = 0x20;
pub(crate) const VARIABLE_RATE: u8 = 0x28;
pub(crate) const ANNOTATIONS: u8 = 0x30;
pub(crate) const UTC: u8 = 0x38;

/// Kinds of chunks of a track. A head holds the places of the first chunk of data and of the first index of
/// each level.
pub(crate) const DEFINITION: u8 = 0;
pub(crate) const HEAD: u8 = 1;
pub(crate) const DATA: u8 = 2;
pub(crate) const INDEX: u8 = 3;
pub(crate) const SUMMARY: u8 = 4;

/// Levels of a track: data, then indices and summaries one above the other.
pub(crate) const LEVELS: usize = 16;
/// Zeros before the texts of a source.
pub(crate) const SOURCE_TEXTS: usize = 64;
/// Place of the texts of a signal, after numbers and zeros.
pub(crate) const SIGNAL_TEXTS: usize = 128;
/// The type of samples in f32: float (4), 32 bits.
pub(crate) const F32: u32 = 0x2004;
/// The mark of user data that are JSON, ended by a zero.
pub(crate) const JSON: u16 = 3 << 12;
/// Before the entries of a payload: number of the first sample (8), entries (4), bits of an entry (2), zeros
/// (2).
pub(crate) const FRONT: usize = 16;

/// Length of a payload in the file, in bytes: with its checksum, padded to a multiple of 8.
pub(crate) const fn on_disk(payload_bytes: u32) -> u64 {
    if payload_bytes == 0 { 0 } else { (payload_bytes as u64 + CRC_BYTES).next_multiple_of(8) }
}

/// Front of a payload with entries.
pub(crate) fn front(first: i64, entries: usize, bits: u16) -> [u8; FRONT] {
    let mut front = [0; FRONT];
    front[..8].copy_from_slice(&first.to_le_bytes());
    front[8..12].copy_from_slice(&(entries as u32).to_le_bytes());
    front[12..14].copy_from_slice(&bits.to_le_bytes());
    front
}

/// The `N` bytes at `from`; zeros beyond the end.
pub(crate) fn field<const N: usize>(bytes: &[u8], from: usize) -> [u8; N] {
    bytes.get(from..).and_then(|rest| rest.first_chunk()).copied().unwrap_or([0; N])
}

/// Samples of a chunk of data. This and the next three are the defaults of pyjls for f32.
pub(crate) const DATA_SAMPLES: usize = 8192;
/// Samples of an entry of level 1.
pub(crate) const ENTRY_SAMPLES: usize = 128;
/// Entries of a summary.
pub(crate) const SUMMARY_ENTRIES: usize = 640;
/// Entries that make one of the level above.
pub(crate) const ENTRIES_PER_ENTRY: usize = 20;

/// Number of a signal, in the lower bits of the mark of a chunk.
pub(crate) const SIGNAL_MASK: u16 = 0x0fff;
