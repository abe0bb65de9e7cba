//! Writing a recording, sample by sample.
//!
//! Each chunk of data makes entries of level 1; a full summary of one level, with the index of its chunks,
//! makes entries of the next. An incomplete entry at the end is left out, since readers take it from the
//! samples.
//!
//! Summaries of samples: mean, standard deviation, lowest and highest.

use core::array::from_fn;
use std::io::{self, ErrorKind, Seek, Write};

use crate::chunk::{ChunkWriter, List};
use crate::definitions::{self, Heads, SignalName};
use crate::{
    DATA, DATA_SAMPLES, END, ENTRIES_PER_ENTRY, ENTRY_SAMPLES, FIXED_RATE, INDEX, LEVELS, MAX_PAYLOAD_BYTES,
    SUMMARY, SUMMARY_ENTRIES, Timestamp, UTC, front,
};

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
        self.index(chunks, 1, at, first, entries)
    }

    /// Adds a chunk to the index of a level, and full summaries to the levels above.
    fn index<W: Write + Seek>(
        &mut self,
        chunks: &mut ChunkWriter<W>,
        from: usize,
        mut at: u64,
        mut first: i64,
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
            self.index(chunks, level + 1, at, first, entries)?;
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
        sample: i64,
        time: i64,
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
pub struct JlsWriter<W, const N: usize> {
    chunks: ChunkWriter<W>,
    signals: [SignalWriter; N],
    times: [Times; N],
    heads: [Heads; N],
    samples: u64,
}

impl<W: Write + Seek, const N: usize> JlsWriter<W, N> {
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
            times.push(&mut self.chunks, number, sample as i64, time.0)?;
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

/// Sums computed together, so that the compiler may use as many lanes. Their order is fixed.
const LANES: usize = 8;

/// Number, mean, sum of squared differences from it, lowest and highest of some samples. Non-finite samples
/// count as missing.
///
/// Parts are put together by Chan, Golub and LeVeque, "Updating Formulae and a Pairwise Algorithm for
/// Computing Sample Variances", 1979, equation 2.1.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Moments {
    count: u64,
    mean: f64,
    squares: f64,
    lowest: f32,
    highest: f32,
}

fn lanes(values: &[f32], add: impl Fn(f64) -> f64) -> f64 {
    let (chunks, rest) = values.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for chunk in chunks {
        for (sum, &value) in sums.iter_mut().zip(chunk) {
            *sum += add(f64::from(value));
        }
    }
    sums.iter().sum::<f64>() + rest.iter().map(|&value| add(f64::from(value))).sum::<f64>()
}

/// The lowest by `below`; written out, as `f32::min` may take either of 0 and -0.
fn extreme(values: &[f32], below: impl Fn(f32, f32) -> bool) -> f32 {
    let pick = |a: f32, b: f32| if below(b, a) { b } else { a };
    let (chunks, rest) = values.as_chunks::<LANES>();
    let mut best = [values[0]; LANES];
    for chunk in chunks {
        for (best, &value) in best.iter_mut().zip(chunk) {
            *best = pick(*best, value);
        }
    }
    best.iter().chain(rest).copied().fold(values[0], pick)
}

impl Moments {
    const NONE: Self = Self { count: 0, mean: 0.0, squares: 0.0, lowest: 0.0, highest: 0.0 };

    /// The moments of samples.
    fn of(values: &[f32]) -> Self {
        // No sum of so few f32 overflows: it is finite if and only if all of them are.
        if lanes(values, |value| value).is_finite() {
            return Self::finite(values);
        }
        let kept: Vec<f32> = values.iter().copied().filter(|value| value.is_finite()).collect();
        Self::finite(&kept)
    }

    fn finite(values: &[f32]) -> Self {
        if values.is_empty() {
            return Self::NONE;
        }
        let mean = lanes(values, |value| value) / values.len() as f64;
        Self {
            count: values.len() as u64,
            mean,
            squares: lanes(values, |value| (value - mean) * (value - mean)),
            lowest: extreme(values, |a, b| a < b),
            highest: extreme(values, |a, b| a > b),
        }
    }

    /// The moments of several parts together.
    fn together(parts: &[Self]) -> Self {
        parts.iter().fold(Self::NONE, |sum, part| sum.and(part))
    }

    fn and(self, other: &Self) -> Self {
        if self.count == 0 || other.count == 0 {
            return if self.count == 0 { *other } else { self };
        }
        let count = self.count + other.count;
        let (difference, share) = (other.mean - self.mean, other.count as f64 / count as f64);
        Self {
            count,
            mean: self.mean + difference * share,
            squares: self.squares + other.squares + difference * difference * share * self.count as f64,
            lowest: if other.lowest < self.lowest { other.lowest } else { self.lowest },
            highest: if other.highest > self.highest { other.highest } else { self.highest },
        }
    }

    /// The entry in a file: mean, standard deviation (over the number), lowest, highest; NaN where all are
    /// missing.
    fn entry(&self) -> [f32; 4] {
        if self.count == 0 {
            return [f32::NAN; 4];
        }
        let deviation = (self.squares / self.count as f64).sqrt();
        [self.mean as f32, deviation as f32, self.lowest, self.highest]
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_few_samples_by_hand() {
        assert_eq!(Moments::of(&[1.0, 3.0]).entry(), [2.0, 1.0, 1.0, 3.0]);
        assert_eq!(Moments::of(&[-2.5]).entry(), [-2.5, 0.0, -2.5, -2.5]);
        assert_eq!(Moments::of(&[f32::NAN, 4.0, f32::INFINITY, 2.0]).entry(), [3.0, 1.0, 2.0, 4.0]);
        assert!(Moments::of(&[f32::NAN; 128]).entry().iter().all(|value| value.is_nan()));
        assert!(Moments::together(&[]).entry()[0].is_nan());
        // f32::MAX 128 times is no overflow in f64.
        assert_eq!(Moments::of(&[f32::MAX; 128]).entry(), [f32::MAX, 0.0, f32::MAX, f32::MAX]);
    }

    proptest! {
        #[test]
        fn parts_together_are_the_whole(
            values in prop::collection::vec(prop_oneof![20 => -1e3_f32..1e3, 1 => Just(f32::NAN)], 1..400),
            size in 1_usize..50,
        ) {
            let parts: Vec<Moments> = values.chunks(size).map(Moments::of).collect();
            let finite: Vec<f64> = values.iter().filter(|v| v.is_finite()).map(|&v| f64::from(v)).collect();
            let [mean, deviation, lowest, highest] = Moments::together(&parts).entry().map(f64::from);
            if finite.is_empty() {
                prop_assert!(mean.is_nan() && highest.is_nan());
            } else {
                let true_mean = finite.iter().sum::<f64>() / finite.len() as f64;
                let variance = finite.iter().map(|v| (v - true_mean).powi(2)).sum::<f64>() / finite.len() as f64;
                prop_assert!((mean - true_mean).abs() <= 1e-3 * 1.2e-7 * 1e3 + 1e-7 * true_mean.abs());
                prop_assert!((deviation - variance.sqrt()).abs() <= 1e-6 * variance.sqrt() + 1e-9);
                prop_assert_eq!(lowest, finite.iter().copied().fold(f64::INFINITY, f64::min));
                prop_assert_eq!(highest, finite.iter().copied().fold(f64::NEG_INFINITY, f64::max));
            }
        }
    }
}
