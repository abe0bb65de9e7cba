//! JLS version 2, the recordings of Joulescope instruments: reading and writing, in pieces, in files of any
//! length.
//!
//! - [`Writer`] writes signals of one fixed rate in f32, with the summaries (mean, standard deviation, lowest, highest)
//!   that let viewers zoom, the times of first and last sample, and a JSON text of your own.
//! - [`Reader`] lists the signals of a file; a [`SampleReader`] reads the samples of one of them, in any of the common
//!   sample types, from any sample on.
//!
//! Summaries, annotations and times are written, but not read. The layout is Jetperch's (JLS 0.17,
//! `include/jls/format.h`, Apache-2.0); the code is our own. Every checksum is verified; a damaged file is an
//! error, never a panic, and no length that a file states is allocated on trust.
//!
//! ```
//! use jls::{Reader, SignalName, Timestamp, Writer};
//! use std::fs::File;
//!
//! # let folder = std::env::temp_dir().join(format!("jls-doc-{}", std::process::id()));
//! # std::fs::create_dir_all(&folder)?;
//! # let path = folder.join("a.jls");
//! let signals = [SignalName { name: "current", unit: "A" }, SignalName { name: "voltage", unit: "V" }];
//! let mut writer = Writer::new(File::create(&path)?, "my instrument", 50_000, signals, "{}")?;
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
mod format;
mod read;
mod write;

pub use definitions::{Signal, SignalName, Source};
pub use format::{MAX_PAYLOAD_BYTES, ReadError, SAMPLE_TYPES, Timestamp};
pub use read::{Reader, SampleReader};
pub use write::Writer;
