//! The samples of one signal, with indices and summaries above them.
//!
//! Each chunk of data makes entries of level 1; a full summary of one level, with the index of the chunks it comes from,
//! makes entries of the next. What does not fill an entry at the end has none, as readers take it from the samples.

use super::chunks::{Chunks, List};
use super::format::{DATA, FIXED_RATE, INDEX, LEVELS, SUMMARY, front};
use super::summary::Moments;
use std::io::{self, Seek, Write};

/// Samples of a chunk of data. This and what follows are what pyjls takes for f32.
pub(super) const BLOCK: usize = 8192;
/// Samples of an entry of level 1.
pub(super) const ENTRY_SAMPLES: usize = 128;
/// Entries of a summary.
pub(super) const ENTRIES: usize = 640;
/// Entries that make one of the level above.
pub(super) const FANOUT: usize = 20;

/// Indices and summaries of one level.
#[derive(Default)]
struct Level {
    indices: List,
    summaries: List,
    /// The first sample of what is at hand: chunks of the level below, and entries.
    first: i64,
    below: Vec<u64>,
    entries: Vec<Moments>,
}

/// A signal being written.
pub(super) struct Signal {
    number: u16,
    data: List,
    /// The first sample of those at hand.
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
    /// Takes a chunk of the level below, its first sample, and the entries it makes.
    fn take(&mut self, at: u64, first: i64, entries: &[Moments]) {
        if self.below.is_empty() {
            self.first = first;
        }
        self.below.push(at);
        self.entries.extend_from_slice(entries);
    }

    /// Writes what is at hand; where the index is, and the entries for the level above.
    fn flush<W: Write + Seek>(
        &mut self,
        chunks: &mut Chunks<W>,
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
        let above = self.entries.chunks_exact(FANOUT).map(Moments::together).collect();
        self.below.clear();
        self.entries.clear();
        Ok((index, above))
    }

    /// Whether anything is left that has to be written at the end. A single chunk below without an entry is found without
    /// an index, unless there are indices to go on with.
    fn is_left(&self) -> bool {
        let needed = self.indices.first != 0 || self.below.len() > 1 || !self.entries.is_empty();
        !self.below.is_empty() && needed
    }
}

impl Signal {
    pub fn new(number: u16) -> Self {
        Self {
            number,
            data: List::default(),
            first: 0,
            samples: Vec::with_capacity(BLOCK),
            levels: Vec::new(),
        }
    }

    /// How many samples can be added before a chunk is full.
    pub fn room(&self) -> usize {
        BLOCK - self.samples.len()
    }

    /// Adds samples, no more than there is [room](Self::room) for.
    pub fn extend<W: Write + Seek>(
        &mut self,
        chunks: &mut Chunks<W>,
        samples: impl IntoIterator<Item = f32>,
    ) -> io::Result<()> {
        self.samples.extend(samples);
        if self.room() == 0 { self.flush(chunks) } else { Ok(()) }
    }

    fn flush<W: Write + Seek>(&mut self, chunks: &mut Chunks<W>) -> io::Result<()> {
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

    /// Takes a chunk into the index of a level, and what that fills into those above.
    fn index<W: Write + Seek>(
        &mut self,
        chunks: &mut Chunks<W>,
        from: usize,
        (mut at, mut first): (u64, i64),
        mut entries: Vec<Moments>,
    ) -> io::Result<()> {
        for level in from..LEVELS {
            if self.levels.len() < level {
                self.levels.push(Level::default());
            }
            let this = &mut self.levels[level - 1];
            this.take(at, first, &entries);
            if this.entries.len() < ENTRIES {
                break;
            }
            first = this.first;
            (at, entries) = this.flush(chunks, mark(self.number, level))?;
        }
        Ok(())
    }

    /// Writes what is left; where data begin and the indices of each level.
    pub fn finish<W: Write + Seek>(mut self, chunks: &mut Chunks<W>) -> io::Result<Vec<u64>> {
        if !self.samples.is_empty() {
            self.flush(chunks)?;
        }
        for level in 1..LEVELS {
            let Some(this) = self.levels.get_mut(level - 1).filter(|level| level.is_left()) else { continue };
            let first = this.first;
            let (at, entries) = this.flush(chunks, mark(self.number, level))?;
            self.index(chunks, level + 1, (at, first), entries)?;
        }
        let indices = self.levels.iter().map(|level| level.indices.first);
        Ok([self.data.first].into_iter().chain(indices).collect())
    }
}
