//! JLS version 2, the recordings of Joulescope instruments: reading and writing, in pieces, in files of any
//! length.
//!
//! - [`JlsWriter`] writes signals of one fixed rate in f32, with the summaries (mean, standard deviation,
//!   lowest, highest) that let viewers zoom, the times of first and last sample, and a JSON text of your own.
//! - [`Reader`] lists the signals of a file; a [`SampleReader`] reads the samples of one of them, in any of
//!   the common sample types, from any sample on.
//!
//! Summaries, annotations and times are written, but not read. The layout is Jetperch's (JLS 0.17,
//! `include/jls/format.h`, Apache-2.0); the code is our own. Every checksum is verified; a damaged file is an
//! error, never a panic, and no length that a file states is allocated on trust.
//!
//! All numbers in a file are little-endian. It is a header and a sequence of chunks. A chunk is a header, a
//! payload, and checksums of both. The chunks of one kind and signal form a doubly linked list.
//!
//! ```
//! use jls::{JlsWriter, Reader, SignalName, Timestamp};
//! use std::fs::File;
//!
//! # let folder = std::env::temp_dir().join(format!("jls-doc-{}", std::process::id()));
//! # std::fs::create_dir_all(&folder)?;
//! # let path = folder.join("a.jls");
//! let signals = [SignalName { name: "current", unit: "A" }, SignalName { name: "voltage", unit: "V" }];
//! let mut writer = JlsWriter::new(File::create(&path)?, "my instrument", 50_000, signals, "{}")?;
//! writer.push([&[0.25; 1000], &[3.8; 1000]])?;
//! writer.stamp(999, Timestamp::from_unix_s(1.7e9, 999.0 / 50e3).expect("within 272 years of 2018"))?;
//! writer.finish()?;
//!
//! let reader = Reader::open(&path)?;
//! let current = &reader.signals()[0];
//! assert_eq!((current.name.as_str(), current.rate_hz), ("current", 50_000));
//! let mut samples = Vec::new();
//! reader.samples(current)?.read(usize::MAX, &mut samples)?;
//! assert_eq!(samples, [0.25; 1000]);
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod chunk;
mod definitions;
mod read;
mod write;

use std::io;
use thiserror::Error;

pub use definitions::{Signal, SignalName, SourceDefinition};
pub use read::{Reader, SampleReader};
pub use write::JlsWriter;

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

/// A sample type that is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Sample {
    F32,
    F64,
    /// A whole number, to be multiplied by `scale`.
    Whole {
        bytes: usize,
        signed: bool,
        scale: f64,
    },
}

/// The sample types that are read.
pub const SAMPLE_TYPES: &str = "f32, f64 or a whole number of 8, 16 or 32 bits";

const FLOAT: u32 = 4;
const UNSIGNED: u32 = 2;

impl Sample {
    /// From the type of a definition: base type (bits 0 to 3), size in bits (8 to 15), binary digits after
    /// the point (16 to 23). Its name if it cannot be read.
    pub fn of(data_type: u32) -> Result<Self, String> {
        let (base, bits, point) = (data_type & 0xf, (data_type >> 8) & 0xff, (data_type >> 16) as u8 as i8);
        match (base, bits) {
            (FLOAT, 32) => Ok(Self::F32),
            (FLOAT, 64) => Ok(Self::F64),
            (1 | 3, 8 | 16 | 32) => Ok(Self::Whole {
                bytes: bits as usize / 8,
                signed: base & UNSIGNED == 0,
                scale: libm::exp2(-f64::from(point)),
            }),
            (1, bits) => Err(format!("i{bits}")),
            (3, bits) => Err(format!("u{bits}")),
            _ => Err(format!("of an unknown type ({data_type:#x})")),
        }
    }

    pub fn bytes(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::F64 => 8,
            Self::Whole { bytes, .. } => bytes,
        }
    }

    /// Decodes samples and appends them.
    pub fn decode(self, bytes: &[u8], into: &mut Vec<f32>) {
        match self {
            Self::F32 => into.extend(bytes.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes))),
            Self::F64 => {
                into.extend(bytes.as_chunks().0.iter().map(|&bytes| f64::from_le_bytes(bytes) as f32));
            }
            Self::Whole { bytes: size, signed, scale } => {
                // Moved to the upper end of 32 bits, so that the shift back brings the sign along.
                let shift = 32 - 8 * size as u32;
                into.extend(bytes.chunks_exact(size).map(|bytes| {
                    let raised =
                        bytes.iter().rev().fold(0_u32, |number, &byte| number << 8 | u32::from(byte))
                            << shift;
                    let number =
                        if signed { f64::from(raised as i32 >> shift) } else { f64::from(raised >> shift) };
                    (number * scale) as f32
                }));
            }
        }
    }
}

/// Ticks per second: JLS counts time in 2^-30 s.
const TICKS_PER_S: f64 = (1_u64 << 30) as f64;
/// Origin of JLS times, 2018-01-01, in seconds since 1970-01-01 UTC.
const EPOCH_S: i64 = 1_514_764_800;

/// A time of day, in units of 2^-30 s since 2018-01-01 UTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Timestamp(pub(crate) i64);

impl Timestamp {
    /// The time `after_s` seconds after `start_s`, the latter since 1970-01-01 UTC; `None` if it is farther
    /// than about 8.5e9 s from 2018. The start is exact to 2^-31 s.
    pub fn from_unix_s(start_s: f64, after_s: f64) -> Option<Self> {
        let ticks = |seconds: f64| libm::round(seconds * TICKS_PER_S) as i128;
        // A float-to-int cast saturates, far beyond i64.
        i64::try_from(ticks(start_s) + ticks(after_s) - (i128::from(EPOCH_S) << 30)).ok().map(Self)
    }
}

/// Why a JLS file could not be read.
#[derive(Debug, Error)]
pub enum JlsReadError {
    /// The file could not be opened or read.
    #[error("cannot read the file: {0}")]
    Io(#[from] io::Error),
    /// The file is of a newer version of the format.
    #[error(
        "a JLS recording of a newer version, which is not read: export it with pyjls or the Joulescope UI"
    )]
    NewerVersion,
    /// The file is cut off, damaged, or not a JLS file.
    #[error("not a whole JLS file: {0}")]
    Damaged(String),
    /// The samples of a signal are of a type that is not read.
    #[error("signal {signal} is {found}, it must be {SAMPLE_TYPES}")]
    SampleType {
        /// The signal.
        signal: String,
        /// The type of its samples.
        found: String,
    },
    /// Samples are missing within a signal.
    #[error("signal {signal}: after {samples} samples the numbers of samples jump by {jump}")]
    Gap {
        /// The signal.
        signal: String,
        /// Samples before the gap.
        samples: u64,
        /// How many samples are missing; negative where numbers repeat.
        jump: i128,
        /// Samples per second.
        rate_hz: u32,
    },
}

impl JlsReadError {
    /// An error at a place in the file.
    pub(crate) fn damaged(at: u64, reason: &str) -> Self {
        Self::Damaged(format!("byte {at}: {reason}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(data_type: u32, bytes: &[u8]) -> Vec<f32> {
        let mut into = Vec::new();
        Sample::of(data_type).unwrap().decode(bytes, &mut into);
        into
    }

    #[test]
    fn whole_numbers_keep_sign_and_point() {
        assert_eq!(decoded(0x1001, &[0xff, 0xff, 0x00, 0x80]), [-1.0, -32_768.0]);
        assert_eq!(decoded(0x1003, &[0xff, 0xff, 0x00, 0x80]), [65_535.0, 32_768.0]);
        assert_eq!(decoded(0x0801, &[0x80, 0x7f]), [-128.0, 127.0]);
        assert_eq!(decoded(0x0803, &[0x80, 0x7f]), [128.0, 127.0]);
        assert_eq!(decoded(0x2001, &[0xfe, 0xff, 0xff, 0xff]), [-2.0]);
        assert_eq!(decoded(0x2003, &[0, 0, 0, 0x80]), [2_147_483_648.0]);
        assert_eq!(decoded(0x04_1001, &[0x18, 0x00]), [1.5]);
        assert_eq!(decoded(0x4004, &0.1_f64.to_le_bytes()), [0.1]);
    }

    #[test]
    fn other_types_are_named() {
        assert_eq!(Sample::of(0x0403).unwrap_err(), "u4");
        assert_eq!(Sample::of(0x1801).unwrap_err(), "i24");
        assert!(Sample::of(0x1004).unwrap_err().contains("0x1004"));
    }

    fn ticks(start_s: f64, after_s: f64) -> Option<i64> {
        Timestamp::from_unix_s(start_s, after_s).map(|time| time.0)
    }

    #[test]
    fn times_count_from_2018_in_2_to_the_minus_30_seconds() {
        assert_eq!(ticks(1_514_764_800.0, 0.0), Some(0));
        assert_eq!(ticks(1_514_764_801.5, 0.25), Some(7 << 28));
        assert_eq!(ticks(0.0, 0.0), Some(-1_514_764_800 << 30));
        // The trace's own limit lies beyond on the side of the past.
        assert_eq!(ticks(-9e9, 0.0), None);
        assert!(ticks(9e9, 1.2e9).is_none() && ticks(9e9, 0.0).is_some());
    }
}
