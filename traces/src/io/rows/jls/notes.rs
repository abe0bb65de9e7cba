//! What our own writer says of a recording, among the user data of a file.

use super::chunk::ChunkFile;
use super::signal::each;
use crate::io::ReadError;
use crate::io::header::{self, Header};
use crate::io::jls::format::{JSON, USER_DATA};

/// The kind of user data, in the upper bits of a chunk's mark.
const KIND: u16 = 0xf000;

/// The description, if there is one.
pub(super) fn description(file: &mut ChunkFile) -> Result<Option<Header>, ReadError> {
    let (path, mut found) = (file.path.clone(), Ok(None));
    each(file, USER_DATA, |head, payload| {
        if head.tag == USER_DATA && head.meta & KIND == JSON && matches!(found, Ok(None)) {
            let text = payload.split(|&byte| byte == 0).next().unwrap_or_default();
            found = str::from_utf8(text).map_or(Ok(None), |json| header::unwrapped(&path, json));
        }
    })?;
    found
}

/// A description put to samples from number `first` on at `rate_hz`. If it is of another rate, another program has made
/// other samples of ours, and it does not say when they were taken.
pub(super) fn placed(mut header: Header, rate_hz: f64, first: i128) -> Header {
    // The file is held against its own numbers.
    header.samples = None;
    match header.rate_hz.filter(|stated_hz| (stated_hz - rate_hz).abs() <= 0.5) {
        Some(stated_hz) => header.start_s = header.start_s.map(|start_s| start_s + first as f64 / stated_hz),
        None => (header.rate_hz, header.start_s) = (Some(rate_hz), None),
    }
    header
}
