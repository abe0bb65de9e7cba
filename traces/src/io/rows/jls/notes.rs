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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_description_counts_from_sample_0_and_only_at_its_own_rate() {
        let header =
            || Header { rate_hz: Some(999.6), start_s: Some(5.0), samples: Some(3), ..Header::default() };
        let of = |header: Header| (header.rate_hz, header.start_s, header.samples);
        assert_eq!(of(placed(header(), 1000.0, 0)), (Some(999.6), Some(5.0), None));
        assert_eq!(of(placed(header(), 1000.0, 2499)), (Some(999.6), Some(7.5), None));
        assert_eq!(of(placed(header(), 1001.0, 2499)), (Some(1001.0), None, None));
        assert_eq!(of(placed(Header::default(), 50.0, 7)), (Some(50.0), None, None));
    }
}
