//! The samples of one signal, chunk by chunk along their list.

use super::chunk::{ChunkFile, Head, field};
use super::sample::{MUST, Sample};
use super::signal::{SIGNAL_MASK, Signal};
use crate::io::ReadError;
use crate::io::jls::format::{self, FIXED_RATE, FRONT};
use std::path::Path;

const DATA: u8 = FIXED_RATE + format::DATA;
const INDEX: u8 = FIXED_RATE + format::INDEX;

/// A signal being read.
pub(super) struct Track {
    file: ChunkFile,
    pub name: String,
    id: u16,
    sample: Sample,
    pub rate_hz: u32,
    /// The number of the first sample: instruments count on.
    pub first: i64,
    pub rows: u64,
    /// How many of them are given out: all, or as many as other signals have.
    until: u64,
    /// Rows before the ones to come.
    row: u64,
    next: Option<u64>,
    /// The chunk at hand, and how much of it has been taken.
    payload: Vec<u8>,
    taken: usize,
}

fn entries(payload: &[u8]) -> (i64, usize, u16) {
    let count = u32::from_le_bytes(field(payload, 8));
    (i64::from_le_bytes(field(payload, 0)), count as usize, u16::from_le_bytes(field(payload, 12)))
}

impl Track {
    pub fn open(path: &Path, signal: &Signal) -> Result<Self, ReadError> {
        let sample = Sample::of(signal.data_type).map_err(|found| ReadError::ColumnType {
            path: path.to_owned(),
            column: signal.name.clone(),
            found,
            must: MUST,
        })?;
        let mut track = Self {
            file: ChunkFile::open(path)?,
            name: signal.name.clone(),
            id: signal.id,
            sample,
            rate_hz: signal.rate_hz,
            first: 0,
            rows: 0,
            until: 0,
            row: 0,
            next: Some(signal.heads[0]).filter(|&at| at != 0),
            payload: Vec::new(),
            taken: 0,
        };
        if let Some(at) = track.next {
            let (first, last) = (track.front(at)?.0, track.last(signal)?);
            let (last, count, _) = track.front(last)?;
            let rows = i128::from(last) + count as i128 - i128::from(first);
            track.rows = u64::try_from(rows).map_err(|_| track.file.damaged(at, "sample numbers go back"))?;
            (track.first, track.until) = (first, track.rows);
            track.payload.clear();
        }
        Ok(track)
    }

    /// The number of the sample after the last one.
    pub fn end(&self) -> i128 {
        i128::from(self.first) + i128::from(self.rows)
    }

    /// The number of the sample to be given out next.
    pub fn at(&self) -> i128 {
        i128::from(self.first) + i128::from(self.row)
    }

    /// How many are still to be given out.
    pub fn left(&self) -> u64 {
        self.until - self.row
    }

    /// Gives out samples from one number to another alone, both within the signal.
    pub fn cut(&mut self, from: i128, to: i128) -> Result<(), ReadError> {
        let within =
            |number: i128| u64::try_from(number - i128::from(self.first)).unwrap_or(0).min(self.rows);
        let (from, until) = (within(from), within(to));
        self.until = until;
        self.skip(from)
    }

    /// The header of a chunk that must be of this signal.
    fn head(&mut self, at: u64, tag: u8) -> Result<Head, ReadError> {
        let head = self.file.head(at)?;
        if head.tag != tag || head.meta & SIGNAL_MASK != self.id {
            return Err(self
                .file
                .damaged(at, &format!("no chunk of signal {} where one must be", self.name)));
        }
        Ok(head)
    }

    /// Reads a chunk of data: the number of its first sample, and how many there are.
    fn front(&mut self, at: u64) -> Result<(i64, usize, Head), ReadError> {
        let head = self.head(at, DATA)?;
        self.file.payload(&head, &mut self.payload)?;
        let (first, count, bits) = entries(&self.payload);
        let bytes = self.sample.bytes();
        if usize::from(bits) != 8 * bytes || self.payload.len() != FRONT + count * bytes {
            return Err(self.file.damaged(at, "a chunk of data is not of the length it says"));
        }
        Ok((first, count, head))
    }

    /// The last chunk of data, down from the highest index: the last entry of each leads to the level below.
    fn last(&mut self, signal: &Signal) -> Result<u64, ReadError> {
        let top = (1..signal.heads.len()).rev().find(|&level| signal.heads[level] != 0).unwrap_or(0);
        let mut at = signal.heads[top];
        for _ in 0..top {
            at = self.end_of_list(at, INDEX)?;
            let head = self.head(at, INDEX)?;
            self.file.payload(&head, &mut self.payload)?;
            let (_, count, _) = entries(&self.payload);
            let entry = count.checked_sub(1).map(|last| FRONT + 8 * last);
            at = match entry.and_then(|entry| self.payload.get(entry..)?.first_chunk()) {
                Some(below) if (1..at).contains(&u64::from_le_bytes(*below)) => u64::from_le_bytes(*below),
                _ => return Err(self.file.damaged(at, "an index leads nowhere")),
            };
        }
        self.end_of_list(at, DATA)
    }

    fn end_of_list(&mut self, at: u64, tag: u8) -> Result<u64, ReadError> {
        let mut head = self.head(at, tag)?;
        while let Some(next) = self.follow(&head)? {
            head = next;
        }
        Ok(head.at)
    }

    /// The next chunk of the same list. Where a mended list leads to another chunk it ends; that no samples are missing
    /// before their end is seen by their numbers.
    fn follow(&mut self, head: &Head) -> Result<Option<Head>, ReadError> {
        let next = self.file.follow(head)?;
        Ok(next.filter(|next| next.tag == head.tag && next.meta & SIGNAL_MASK == self.id))
    }

    /// Loads the next chunk; `false` at the end.
    fn advance(&mut self) -> Result<bool, ReadError> {
        let Some(at) = self.next else { return self.ended() };
        let (first, count, head) = self.front(at)?;
        self.taken = FRONT;
        self.next = self.follow(&head)?.map(|next| next.at);
        let jump = i128::from(first) - i128::from(self.first) - i128::from(self.row);
        if jump != 0 {
            return Err(ReadError::Uneven {
                path: self.file.path.clone(),
                row: self.row + 1,
                time_s: (self.row as f64 + jump as f64) / f64::from(self.rate_hz),
                off_periods: jump as f64,
                rate_hz: f64::from(self.rate_hz),
            });
        }
        // Signals of a row must end together: what the index knows nothing of is not given out.
        if self.row.checked_add(count as u64).is_none_or(|end| end > self.rows) {
            return Err(self.file.damaged(at, "there are more samples than the index says"));
        }
        Ok(true)
    }

    fn ended(&self) -> Result<bool, ReadError> {
        if self.row == self.rows {
            return Ok(false);
        }
        let (name, row, rows) = (&self.name, self.row, self.rows);
        let path = self.file.path.clone();
        let reason = format!("signal {name} ends after {row} of {rows} samples");
        Err(ReadError::Damaged { path, format: "JLS", reason })
    }

    /// Appends samples until there are `limit` or no more.
    pub fn values(&mut self, limit: usize, into: &mut Vec<f32>) -> Result<usize, ReadError> {
        let left = usize::try_from(self.left()).unwrap_or(usize::MAX);
        let limit = limit.min(left.saturating_add(into.len()));
        while into.len() < limit {
            let bytes = self.sample.bytes();
            let rest = &self.payload[self.taken.min(self.payload.len())..];
            let count = (rest.len() / bytes).min(limit - into.len());
            self.sample.decode(&rest[..count * bytes], into);
            self.taken += count * bytes;
            self.row += count as u64;
            if count == 0 && !self.advance()? {
                break;
            }
        }
        Ok(into.len())
    }

    /// Leaves samples out. How many a chunk has its length tells, so that it need not be read; whether they were where
    /// they belong, the next chunk that is read does.
    pub fn skip(&mut self, mut rows: u64) -> Result<(), ReadError> {
        let bytes = self.sample.bytes() as u64;
        while rows > 0 {
            let left = self.payload.len().saturating_sub(self.taken) as u64 / bytes;
            if left > 0 {
                let count = left.min(rows);
                self.taken += (count * bytes) as usize;
                (self.row, rows) = (self.row + count, rows - count);
                continue;
            }
            let Some(at) = self.next else { return self.ended().map(|_| ()) };
            let head = self.head(at, DATA)?;
            let whole = u64::from(head.bytes).saturating_sub(FRONT as u64) / bytes;
            if whole > rows {
                self.advance()?;
            } else {
                self.next = self.follow(&head)?.map(|next| next.at);
                (self.row, rows) = (self.row + whole, rows - whole);
            }
        }
        Ok(())
    }
}
