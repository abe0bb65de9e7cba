//! Reading a recording, signal by signal.

use crate::chunk::{ChunkFile, ChunkHeader};
use crate::definitions::{self, Definitions, Signal, SourceDefinition};
use crate::{DATA, FIXED_RATE, FRONT, INDEX, JSON, JlsReadError, SIGNAL_MASK, Sample, USER_DATA, field};
use std::path::{Path, PathBuf};

const FIXED_RATE_DATA: u8 = FIXED_RATE + DATA;
const FIXED_RATE_INDEX: u8 = FIXED_RATE + INDEX;
/// The kind of user data, in the upper bits of the mark of a chunk.
const USER_DATA_KIND: u16 = 0xf000;

/// A JLS file: its sources and signals.
#[derive(Debug)]
pub struct Reader {
    path: PathBuf,
    file: ChunkFile,
    definitions: Definitions,
}

impl Reader {
    /// Opens a file and reads its definitions.
    ///
    /// # Errors
    /// [`JlsReadError`] if it cannot be read, is of a newer version, was not closed, or is damaged.
    pub fn open(path: &Path) -> Result<Self, JlsReadError> {
        let mut file = ChunkFile::open(path)?;
        let definitions = Definitions::read(&mut file)?;
        Ok(Self { path: path.to_owned(), file, definitions })
    }

    /// The signals of fixed rate, by their numbers.
    pub fn signals(&self) -> &[Signal] {
        &self.definitions.signals
    }

    /// The source of a signal, if the file has it.
    pub fn source(&self, signal: &Signal) -> Option<&SourceDefinition> {
        self.definitions.sources.get(&signal.source)
    }

    /// Opens a signal, at its first sample. Each reader has a file handle of its own, so that threads can
    /// read side by side.
    ///
    /// # Errors
    /// [`JlsReadError`] if samples are of a type that is not read, or the index is damaged.
    pub fn samples(&self, signal: &Signal) -> Result<SampleReader, JlsReadError> {
        SampleReader::open(&self.path, signal)
    }

    /// Visits the JSON texts among the user data.
    ///
    /// # Errors
    /// [`JlsReadError`] if the file cannot be read or is damaged.
    pub fn each_json(&mut self, mut visit: impl FnMut(&str)) -> Result<(), JlsReadError> {
        definitions::each(&mut self.file, USER_DATA, |head, payload| {
            if head.tag == USER_DATA && head.meta & USER_DATA_KIND == JSON {
                let text = payload.split(|&byte| byte == 0).next().unwrap_or_default();
                if let Ok(json) = str::from_utf8(text) {
                    visit(json);
                }
            }
        })
    }
}

/// Reads the samples of one signal.
#[derive(Debug)]
pub struct SampleReader {
    file: ChunkFile,
    name: String,
    number: u16,
    sample: Sample,
    rate_hz: u32,
    /// Number of the first sample.
    first: i64,
    count: u64,
    /// Where reading ends, counted from the first sample.
    end_position: u64,
    /// Samples before the next one.
    position: u64,
    /// Place of the next chunk of data.
    next: Option<u64>,
    /// The current chunk, and how many of its bytes have been used.
    payload: Vec<u8>,
    used: usize,
}

fn entries(payload: &[u8]) -> (i64, usize, u16) {
    let count = u32::from_le_bytes(field(payload, 8));
    (i64::from_le_bytes(field(payload, 0)), count as usize, u16::from_le_bytes(field(payload, 12)))
}

impl SampleReader {
    fn open(path: &Path, signal: &Signal) -> Result<Self, JlsReadError> {
        let sample = Sample::of(signal.data_type)
            .map_err(|found| JlsReadError::SampleType { signal: signal.name.clone(), found })?;
        let mut reader = Self {
            file: ChunkFile::open(path)?,
            name: signal.name.clone(),
            number: signal.number,
            sample,
            rate_hz: signal.rate_hz,
            first: 0,
            count: 0,
            end_position: 0,
            position: 0,
            next: Some(signal.heads[0]).filter(|&at| at != 0),
            payload: Vec::new(),
            used: 0,
        };
        if let Some(at) = reader.next {
            let (first, last) = (reader.front(at)?.0, reader.last(signal)?);
            let (last, count, _) = reader.front(last)?;
            let count = i128::from(last) + count as i128 - i128::from(first);
            reader.count =
                u64::try_from(count).map_err(|_| JlsReadError::damaged(at, "sample numbers go back"))?;
            (reader.first, reader.end_position) = (first, reader.count);
            reader.payload.clear();
        }
        Ok(reader)
    }

    /// Number of the first sample: instruments count on from the last recording.
    pub fn first(&self) -> i64 {
        self.first
    }

    /// Number of samples, whether they have been read or not.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Number of the sample after the last one.
    pub fn end(&self) -> i128 {
        i128::from(self.first) + i128::from(self.count)
    }

    /// Number of the next sample.
    pub fn next_sample(&self) -> i128 {
        i128::from(self.first) + i128::from(self.position)
    }

    /// How many samples remain to be read.
    pub fn remaining(&self) -> u64 {
        self.end_position - self.position
    }

    /// Restricts a reader at its first sample to the samples from one number to another.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn limit_to(&mut self, from: i128, to: i128) -> Result<(), JlsReadError> {
        let within =
            |number: i128| u64::try_from(number - i128::from(self.first)).unwrap_or(0).min(self.count);
        let (from, end) = (within(from), within(to));
        self.end_position = end;
        self.skip(from)
    }

    /// The header of a chunk that must be of this signal.
    fn head(&mut self, at: u64, tag: u8) -> Result<ChunkHeader, JlsReadError> {
        let head = self.file.head(at)?;
        if head.tag != tag || head.meta & SIGNAL_MASK != self.number {
            return Err(JlsReadError::damaged(
                at,
                &format!("no chunk of signal {} where one must be", self.name),
            ));
        }
        Ok(head)
    }

    /// Reads a chunk of data: the number of its first sample, and how many there are.
    fn front(&mut self, at: u64) -> Result<(i64, usize, ChunkHeader), JlsReadError> {
        let head = self.head(at, FIXED_RATE_DATA)?;
        self.file.payload(&head, &mut self.payload)?;
        let (first, count, bits) = entries(&self.payload);
        let bytes = self.sample.bytes();
        if usize::from(bits) != 8 * bytes || self.payload.len() != FRONT + count * bytes {
            return Err(JlsReadError::damaged(at, "a chunk of data is not of the length it says"));
        }
        Ok((first, count, head))
    }

    /// The last chunk of data, down from the highest index: the last entry of each leads to the level below.
    fn last(&mut self, signal: &Signal) -> Result<u64, JlsReadError> {
        let top = (1..signal.heads.len()).rev().find(|&level| signal.heads[level] != 0).unwrap_or(0);
        let mut at = signal.heads[top];
        for _ in 0..top {
            at = self.end_of_list(at, FIXED_RATE_INDEX)?;
            let head = self.head(at, FIXED_RATE_INDEX)?;
            self.file.payload(&head, &mut self.payload)?;
            let (_, count, _) = entries(&self.payload);
            let entry = count.checked_sub(1).map(|last| FRONT + 8 * last);
            at = match entry.and_then(|entry| self.payload.get(entry..)?.first_chunk()) {
                Some(below) if (1..at).contains(&u64::from_le_bytes(*below)) => u64::from_le_bytes(*below),
                _ => return Err(JlsReadError::damaged(at, "an index leads nowhere")),
            };
        }
        self.end_of_list(at, FIXED_RATE_DATA)
    }

    fn end_of_list(&mut self, at: u64, tag: u8) -> Result<u64, JlsReadError> {
        let mut head = self.head(at, tag)?;
        while let Some(next) = self.follow(&head)? {
            head = next;
        }
        Ok(head.at)
    }

    /// The next chunk of the same list. A list of a repaired file that leads to another chunk ends there; the
    /// numbers of samples show whether any are missing before the end.
    fn follow(&mut self, head: &ChunkHeader) -> Result<Option<ChunkHeader>, JlsReadError> {
        let next = self.file.follow(head)?;
        Ok(next.filter(|next| next.tag == head.tag && next.meta & SIGNAL_MASK == self.number))
    }

    /// Loads the next chunk; `false` at the end.
    fn advance(&mut self) -> Result<bool, JlsReadError> {
        let Some(at) = self.next else { return self.check_end() };
        let (first, count, head) = self.front(at)?;
        self.used = FRONT;
        self.next = self.follow(&head)?.map(|next| next.at);
        let jump = i128::from(first) - i128::from(self.first) - i128::from(self.position);
        if jump != 0 {
            return Err(JlsReadError::Gap {
                signal: self.name.clone(),
                samples: self.position,
                jump,
                rate_hz: self.rate_hz,
            });
        }
        // Signals of a position must end together: what the index knows nothing of is not given out.
        if self.position.checked_add(count as u64).is_none_or(|end| end > self.count) {
            return Err(JlsReadError::damaged(at, "there are more samples than the index says"));
        }
        Ok(true)
    }

    fn check_end(&self) -> Result<bool, JlsReadError> {
        if self.position == self.count {
            return Ok(false);
        }
        let (name, position, count) = (&self.name, self.position, self.count);
        Err(JlsReadError::Damaged(format!("signal {name} ends after {position} of {count} samples")))
    }

    /// Reads up to `limit` samples and appends them; returns how many, 0 at the end.
    ///
    /// # Errors
    /// [`JlsReadError::Damaged`] and [`JlsReadError::Gap`] name the place.
    pub fn read(&mut self, limit: usize, into: &mut Vec<f32>) -> Result<usize, JlsReadError> {
        let before = into.len();
        let limit = limit.min(usize::try_from(self.remaining()).unwrap_or(usize::MAX));
        while into.len() - before < limit {
            let bytes = self.sample.bytes();
            let rest = &self.payload[self.used.min(self.payload.len())..];
            let count = (rest.len() / bytes).min(limit - (into.len() - before));
            self.sample.decode(&rest[..count * bytes], into);
            self.used += count * bytes;
            self.position += count as u64;
            if count == 0 && !self.advance()? {
                break;
            }
        }
        Ok(into.len() - before)
    }

    /// Skips samples. Chunks skipped whole are not read: their headers hold their lengths, and the next chunk
    /// that is read shows whether its samples are where they belong.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn skip(&mut self, mut samples: u64) -> Result<(), JlsReadError> {
        let bytes = self.sample.bytes() as u64;
        while samples > 0 {
            let pending = self.payload.len().saturating_sub(self.used) as u64 / bytes;
            if pending > 0 {
                let count = pending.min(samples);
                self.used += (count * bytes) as usize;
                (self.position, samples) = (self.position + count, samples - count);
                continue;
            }
            let Some(at) = self.next else { return self.check_end().map(|_| ()) };
            let head = self.head(at, FIXED_RATE_DATA)?;
            let whole = u64::from(head.bytes).saturating_sub(FRONT as u64) / bytes;
            if whole > samples {
                self.advance()?;
            } else {
                self.next = self.follow(&head)?.map(|next| next.at);
                (self.position, samples) = (self.position + whole, samples - whole);
            }
        }
        Ok(())
    }
}
