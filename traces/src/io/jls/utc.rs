//! When samples were taken: pairs of a sample's number and a time.

use super::chunks::{Chunks, List};
use super::format::{DATA, INDEX, SUMMARY, UTC, front};
use std::io::{self, Seek, Write};

/// JLS counts time in 2^-30 s.
const SECOND: f64 = (1_u64 << 30) as f64;
/// From when on: 2018-01-01, in seconds since 1970-01-01 UTC.
const EPOCH_S: i64 = 1_514_764_800;

/// The time of JLS at some seconds after `start_s`, both in s, the start since 1970; `None` if it is beyond what JLS can
/// say. The start is exact to 2^-31 s.
pub(super) fn time(start_s: f64, after_s: f64) -> Option<i64> {
    let ticks = |seconds: f64| libm::round(seconds * SECOND) as i128;
    // A float-to-int cast saturates, far beyond i64.
    i64::try_from(ticks(start_s) + ticks(after_s) - (i128::from(EPOCH_S) << 30)).ok()
}

/// Times of one signal's samples being written.
#[derive(Default)]
pub(super) struct Times {
    data: List,
    /// Number of the sample, its time, and where that stands.
    entries: Vec<(i64, i64, u64)>,
}

impl Times {
    /// Says when a sample was taken, later than those before.
    pub fn push<W: Write + Seek>(
        &mut self,
        chunks: &mut Chunks<W>,
        signal: u16,
        (sample, time): (i64, i64),
    ) -> io::Result<()> {
        let at = chunks.append(&mut self.data, UTC + DATA, signal, |bytes| {
            bytes.extend(front(sample, 1, 64));
            bytes.extend(time.to_le_bytes());
        })?;
        self.entries.push((sample, time, at));
        Ok(())
    }

    /// Writes the index and summary of level 1, which is enough for the few there are; where data and index begin.
    pub fn finish<W: Write + Seek>(self, chunks: &mut Chunks<W>, signal: u16) -> io::Result<[u64; 2]> {
        let Some(&(first, _, _)) = self.entries.first() else { return Ok([0; 2]) };
        let mark = signal | 1 << 12;
        let front = front(first, self.entries.len(), 128);
        let index = chunks.append(&mut List::default(), UTC + INDEX, mark, |bytes| {
            bytes.extend(front);
            for (sample, _, at) in &self.entries {
                bytes.extend(sample.to_le_bytes().into_iter().chain(at.to_le_bytes()));
            }
        })?;
        chunks.append(&mut List::default(), UTC + SUMMARY, mark, |bytes| {
            bytes.extend(front);
            for (sample, time, _) in &self.entries {
                bytes.extend(sample.to_le_bytes().into_iter().chain(time.to_le_bytes()));
            }
        })?;
        Ok([self.data.first, index])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_count_from_2018_in_2_to_the_minus_30_seconds() {
        assert_eq!(time(1_514_764_800.0, 0.0), Some(0));
        assert_eq!(time(1_514_764_801.5, 0.25), Some(7 << 28));
        assert_eq!(time(0.0, 0.0), Some(-1_514_764_800 << 30));
        // The trace's own limit lies beyond on the side of the past.
        assert_eq!(time(-9e9, 0.0), None);
        assert!(time(9e9, 1.2e9).is_none() && time(9e9, 0.0).is_some());
    }
}
