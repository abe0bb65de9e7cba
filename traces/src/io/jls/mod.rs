//! JLS version 2, what Joulescope instruments record: writing, and what it has in common with reading.
//!
//! [`Writer`] takes samples in pieces, [`save`] a whole trace. Current and voltage are signals of fixed rate in f32, with
//! summaries (mean, standard deviation, lowest, highest) of 128 samples, 2560, 51,200 and so on. UTC entries say when the
//! first and the last sample were taken; a JSON text among the user data (`{"trace": ...}`) holds the exact rate and
//! start and the trace's metadata, which [`read`](super::read()) takes back.

mod chunks;
mod crc;
mod definitions;
pub(in crate::io) mod format;
mod signal;
mod summary;
mod utc;
mod write;

pub(crate) use crc::crc32c;
pub use write::{Writer, save, write};
