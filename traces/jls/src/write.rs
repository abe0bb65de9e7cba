//! Writing a recording, sample by sample.
//!
//! Each chunk of data makes entries of level 1; a full summary of one level, with the index of its chunks,
//! makes entries of the next. An incomplete entry at the end is left out, since readers take it from the
//! samples.

use crate::chunk::{ChunkWriter, List};
use crate::definitions::{self, Heads, SignalName};
use crate::format::{
    DATA, DATA_SAMPLES, END, ENTRIES_PER_ENTRY, ENTRY_SAMPLES, FIXED_RATE, INDEX, LEVELS, MAX_PAYLOAD_BYTES,
    SUMMARY, SUMMARY_ENTRIES, UTC, front,
};
use crate::summary::Moments;
use crate::time::Timestamp;
use core::array::from_fn;
use std::io::{self, ErrorKind, Seek, Write};

/// Indices and summaries of one level.
#[derive(Default)]
struct Level {
    indices: List,
    summaries: List,
    /// First sample of the pending chunks of the level below, and entries.
    first: i64,
    below: Vec<u64>,
    entries: Vec<Moments>,
}

/// A signal being written.
struct SignalWriter {
    number: u16,
    data: List,
    /// First of the pending samples.
    first: i64,
    samples: Vec<f32>,
    /// From level 1 on.
    levels: Vec<Level>,
}

/// The mark of a chunk: the signal, and the level above the samples.
fn mark(signal: u16, level: usize) -> u16 {
    signal | (level as u16) << 12
}

impl Level {
    /// Adds a chunk of the level below, its first sample, and its entries.
    fn add(&mut self, at: u64, first: i64, entries: &[Moments]) {
        if self.below.is_empty() {
            self.first = first;
        }
        self.below.push(at);
        self.entries.extend_from_slice(entries);
    }

    /// Writes the pending entries; returns the place of the index and the entries for the level above.
    fn flush<W: Write + Seek>(
        &mut self,
        chunks: &mut ChunkWriter<W>,
        mark: u16,
    ) -> io::Result<(u64, Vec<Moments>)> {
        let index = chunks.append(&mut self.indices, FIXED_RATE + INDEX, mark, |bytes| {
            bytes.extend(front(self.first, self.below.len(), 64));
            bytes.extend(self.below.iter().flat_map(|at| at.to_le_bytes()));
        })?;
        // Readers look for it right behind the index.
        chunks.append(&mut self.summaries, FIXED_RATE + SUMMARY, mark, |bytes| {
            bytes.extend(front(self.first, self.entries.len(), 128));
            bytes.extend(self.entries.iter().flat_map(Moments::entry).flat_map(f32::to_le_bytes));
        })?;
        let above = self.entries.chunks_exact(ENTRIES_PER_ENTRY).map(Moments::together).collect();
        self.below.clear();
        self.entries.clear();
        Ok((index, above))
    }

    /// Whether entries remain to be written at the end. A single chunk below without an entry is found
    /// without an index, unless there are indices before.
    fn is_pending(&self) -> bool {
        let needed = self.indices.first != 0 || self.below.len() > 1 || !self.entries.is_empty();
        !self.below.is_empty() && needed
    }
}

impl SignalWriter {
    pub fn new(number: u16) -> Self {
        Self {
            number,
            data: List::default(),
            first: 0,
            samples: Vec::with_capacity(DATA_SAMPLES),
            levels: Vec::new(),
        }
    }

    /// How many samples can be added before a chunk is full.
    pub fn room(&self) -> usize {
        DATA_SAMPLES - self.samples.len()
    }

    /// Adds samples, no more than there is [room](Self::room) for.
    pub fn extend<W: Write + Seek>(
        &mut self,
        chunks: &mut ChunkWriter<W>,
        samples: impl IntoIterator<Item = f32>,
    ) -> io::Result<()> {
        self.samples.extend(samples);
        if self.room() == 0 { self.flush(chunks) } else { Ok(()) }
    }

    fn flush<W: Write + Seek>(&mut self, chunks: &mut ChunkWriter<W>) -> io::Result<()> {
        let samples = &self.samples;
        let at = chunks.append(&mut self.data, FIXED_RATE + DATA, mark(self.number, 0), |bytes| {
            bytes.extend(front(self.first, samples.len(), 32));
            let from = bytes.len();
            bytes.resize(from + 4 * samples.len(), 0);
            for (bytes, sample) in bytes[from..].as_chunks_mut().0.iter_mut().zip(samples) {
                *bytes = sample.to_le_bytes();
            }
        })?;
        let entries: Vec<Moments> = samples.chunks_exact(ENTRY_SAMPLES).map(Moments::of).collect();
        let (first, count) = (self.first, samples.len() as i64);
        self.first += count;
        self.samples.clear();
        self.index(chunks, 1, (at, first), entries)
    }

    /// Adds a chunk to the index of a level, and full summaries to the levels above.
    fn index<W: Write + Seek>(
        &mut self,
        chunks: &mut ChunkWriter<W>,
        from: usize,
        (mut at, mut first): (u64, i64),
        mut entries: Vec<Moments>,
    ) -> io::Result<()> {
        for level in from..LEVELS {
            if self.levels.len() < level {
                self.levels.push(Level::default());
            }
            let this = &mut self.levels[level - 1];
            this.add(at, first, &entries);
            if this.entries.len() < SUMMARY_ENTRIES {
                break;
            }
            first = this.first;
            (at, entries) = this.flush(chunks, mark(self.number, level))?;
        }
        Ok(())
    }

    /// Writes the remaining samples; returns the places of the first data and of the first index of each
    /// level.
    pub fn finish<W: Write + Seek>(mut self, chunks: &mut ChunkWriter<W>) -> io::Result<Vec<u64>> {
        if !self.samples.is_empty() {
            self.flush(chunks)?;
        }
        for level in 1..LEVELS {
            let Some(this) = self.levels.get_mut(level - 1).filter(|level| level.is_pending()) else {
                continue;
            };
            let first = this.first;
            let (at, entries) = this.flush(chunks, mark(self.number, level))?;
            self.index(chunks, level + 1, (at, first), entries)?;
        }
        let indices = self.levels.iter().map(|level| level.indices.first);
        Ok([self.data.first].into_iter().chain(indices).collect())
    }
}

/// Times of one signal's samples being written.
#[derive(Default)]
struct Times {
    data: List,
    /// Number of the sample, its time, and the place of its chunk.
    entries: Vec<(i64, i64, u64)>,
}

impl Times {
    /// Adds the time of a sample, later than those before.
    pub fn push<W: Write + Seek>(
        &mut self,
        chunks: &mut ChunkWriter<W>,
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

    /// Writes the index and summary of level 1, enough for few times; returns the places of the first data
    /// and of the index.
    pub fn finish<W: Write + Seek>(self, chunks: &mut ChunkWriter<W>, signal: u16) -> io::Result<[u64; 2]> {
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

/// A JLS file being written: `N` signals of one rate, in pieces of any size, which do not show in the bytes.
///
/// Memory does not grow with the samples: about 4 MiB, and 25 KiB a signal for each level of summaries (five
/// at 1e9).
pub struct Writer<W, const N: usize> {
    chunks: ChunkWriter<W>,
    signals: [SignalWriter; N],
    times: [Times; N],
    heads: [Heads; N],
    samples: u64,
}

impl<W: Write + Seek, const N: usize> Writer<W, N> {
    /// Begins a recording in an empty file: the name of the instrument, samples per second, the signals
    /// (numbered from 1), and a JSON text of any content.
    ///
    /// # Errors
    /// If `out` cannot be written, or the text is longer than [`MAX_PAYLOAD_BYTES`].
    pub fn new(
        out: W,
        source: &str,
        rate_hz: u32,
        signals: [SignalName<'_>; N],
        json: &str,
    ) -> io::Result<Self> {
        if json.len() >= MAX_PAYLOAD_BYTES as usize {
            return Err(io::Error::new(ErrorKind::InvalidInput, "the JSON text is longer than 64 MiB"));
        }
        let mut chunks = ChunkWriter::new(out);
        let heads = definitions::write(&mut chunks, source, signals, rate_hz, json)?;
        let signals = from_fn(|index| SignalWriter::new(index as u16 + 1));
        Ok(Self { chunks, signals, times: from_fn(|_| Times::default()), heads, samples: 0 })
    }

    /// Number of samples so far, skipped ones included.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Adds samples of all signals. Non-finite samples are written as they are; summaries leave them out.
    ///
    /// # Errors
    /// If there are not as many of each signal, or the file cannot be written.
    pub fn push(&mut self, channels: [&[f32]; N]) -> io::Result<()> {
        let count = channels.first().map_or(0, |samples| samples.len());
        if channels.iter().any(|samples| samples.len() != count) {
            return Err(io::Error::new(ErrorKind::InvalidInput, "signals differ in their number of samples"));
        }
        let mut from = 0;
        while from < count {
            let end = count.min(from + self.room());
            self.extend(channels.map(|samples| samples[from..end].iter().copied()), end - from)?;
            from = end;
        }
        Ok(())
    }

    /// Adds lost samples: NaN, as pyjls writes them.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn skip(&mut self, mut samples: u64) -> io::Result<()> {
        while samples > 0 {
            let count = samples.min(self.room() as u64) as usize;
            self.extend([(); N].map(|()| core::iter::repeat_n(f32::NAN, count)), count)?;
            samples -= count as u64;
        }
        Ok(())
    }

    /// How many samples can be added before a chunk is full.
    fn room(&self) -> usize {
        self.signals.first().map_or(DATA_SAMPLES, SignalWriter::room)
    }

    fn extend(&mut self, channels: [impl IntoIterator<Item = f32>; N], count: usize) -> io::Result<()> {
        for (signal, samples) in self.signals.iter_mut().zip(channels) {
            signal.extend(&mut self.chunks, samples)?;
        }
        self.samples += count as u64;
        Ok(())
    }

    /// Adds the time of a sample, later than those before.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn stamp(&mut self, sample: u64, time: Timestamp) -> io::Result<()> {
        for (times, number) in self.times.iter_mut().zip(1..) {
            times.push(&mut self.chunks, number, (sample as i64, time.0))?;
        }
        Ok(())
    }

    /// Writes the rest. Without it the file counts as not closed, and readers refuse it.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> io::Result<()> {
        let chunks = &mut self.chunks;
        let tracks = self.signals.into_iter().zip(self.times).zip(self.heads);
        for (((signal, times), heads), number) in tracks.zip(1..) {
            let firsts = signal.finish(chunks)?;
            chunks.replace(heads.samples, &definitions::head(&firsts))?;
            let firsts = times.finish(chunks, number)?;
            chunks.replace(heads.utc, &definitions::head(&firsts))?;
        }
        chunks.append(&mut List::default(), END, 0, |_| ())?;
        self.chunks.finish()
    }
}
