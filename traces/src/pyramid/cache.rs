//! The cache file of a pyramid: a header, checksums of groups of entries, and the entries, level by level.

use super::{BLOCK, ENTRY_BYTES, Entry, FANOUT, PowerPyramid, Store};
use crate::clock::SampleClock;
use crate::io::{ReadOptions, WriteError, atomic};
use crc32c::crc32c;
use std::fs;
use std::fs::File;
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// First bytes of every file, with the version of the format.
const MAGIC: u64 = 0x3230_5259_505f_5451;
/// First bytes of the version before, which had no checksums.
const MAGIC_1: u64 = 0x3130_5259_505f_5451;
const HEADER_BYTES: usize = 64;
/// Place of the checksum of the header and of all checksums, in words of 8 bytes.
const CHECKSUM_WORD: usize = 7;
/// Entries of a level that share a checksum: 12 KB, so that a view checks little more than it shows.
const GROUP_ENTRIES: u64 = 1024;

/// A file whose header is whole; its entries are checked as they are read.
#[derive(Debug)]
pub(super) struct Kept {
    path: PathBuf,
    /// Entries of each level.
    sizes: Vec<u64>,
    /// Checksums of the groups of all levels.
    sums: Vec<u32>,
}

/// Hash of a file as it is now and of how it is read (FNV-1a, Fowler, Noll and Vo).
pub(super) fn stamp(path: &Path, options: &ReadOptions) -> u64 {
    let metadata = fs::metadata(path).ok();
    let modified = metadata.as_ref().and_then(|m| m.modified().ok()?.duration_since(UNIX_EPOCH).ok());
    let text = format!("{:?} {modified:?} {options:?}", metadata.map(|m| m.len()));
    text.bytes()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Entries of each level.
fn sizes(samples: u64) -> Vec<u64> {
    let mut sizes = vec![samples.div_ceil(BLOCK)];
    while sizes[sizes.len() - 1] > FANOUT as u64 {
        sizes.push(sizes[sizes.len() - 1].div_ceil(FANOUT as u64));
    }
    sizes
}

fn bytes(entries: &[Entry]) -> Vec<u8> {
    entries.iter().flat_map(|entry| entry.to_bytes()).collect()
}

/// Writes the levels of the trace with this stamp.
pub(super) fn keep(pyramid: &PowerPyramid, path: &Path, stamp: u64) -> Result<(), WriteError> {
    let Store::Memory(levels) = &pyramid.store else { return Ok(()) };
    let groups = || levels.iter().flat_map(|level| level.chunks(GROUP_ENTRIES as usize));
    let sums: Vec<u8> = groups().flat_map(|group| crc32c(&bytes(group)).to_le_bytes()).collect();
    let clock = pyramid.clock;
    let words = [MAGIC, stamp, pyramid.samples, clock.start_s.to_bits(), clock.rate_hz.to_bits(), 0, 0];
    let mut head: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    head.extend_from_slice(&u64::from(seal(&head, &sums)).to_le_bytes());
    atomic::write_file(path, |out: &mut BufWriter<File>| {
        out.write_all(&head)?;
        out.write_all(&sums)?;
        groups().try_for_each(|group| out.write_all(&bytes(group)))
    })
}

fn seal(head: &[u8], sums: &[u8]) -> u32 {
    crc32c(&[&head[..8 * CHECKSUM_WORD], sums].concat())
}

/// The cache file found beside a trace.
pub(super) enum Cached {
    /// The pyramid of the trace, whole as far as can be seen without its entries.
    Whole(PowerPyramid),
    /// Nothing, or the pyramid of another trace or version.
    Other,
    /// A pyramid that was cut off or changed.
    Damaged,
}

/// Searches the pyramid of the trace with this stamp.
pub(super) fn kept(path: &Path, stamp: u64) -> Cached {
    let Ok(mut file) = File::open(path) else { return Cached::Other };
    let mut head = [0; HEADER_BYTES];
    if file.read_exact(&mut head).is_err() {
        return Cached::Damaged;
    }
    let word = |index: usize| head[8 * index..].first_chunk().map_or(0, |word| u64::from_le_bytes(*word));
    if word(0) == MAGIC_1 {
        return Cached::Other;
    }
    let (samples, start_s, rate_hz) = (word(2), f64::from_bits(word(3)), f64::from_bits(word(4)));
    let Some((sizes, sums)) = checksums(&mut file, samples) else { return Cached::Damaged };
    if word(0) != MAGIC || word(CHECKSUM_WORD) != u64::from(seal(&head, &sums)) {
        return Cached::Damaged;
    }
    if word(1) != stamp {
        return Cached::Other;
    }
    let sums = sums.as_chunks().0.iter().map(|sum| u32::from_le_bytes(*sum)).collect();
    let clock = SampleClock { start_s, rate_hz, samples: Some(samples) };
    let store = Store::File(Kept { path: path.to_owned(), sizes, sums });
    Cached::Whole(PowerPyramid { clock, samples, store, was_damaged: false })
}

/// Entries of each level and the bytes of the checksums, which come next; `None` if the file is not as long
/// as it has to be.
fn checksums(file: &mut File, samples: u64) -> Option<(Vec<u64>, Vec<u8>)> {
    if samples >= 1 << 48 {
        return None;
    }
    let sizes = sizes(samples);
    let groups: u64 = sizes.iter().map(|size| size.div_ceil(GROUP_ENTRIES)).sum();
    let whole = HEADER_BYTES as u64 + 4 * groups + ENTRY_BYTES * sizes.iter().sum::<u64>();
    if file.metadata().ok()?.len() != whole {
        return None;
    }
    let mut sums = vec![0; 4 * groups as usize];
    file.read_exact(&mut sums).ok()?;
    Some((sizes, sums))
}

impl Kept {
    /// Entries of a level, as far as there are any; `None` where they cannot be read or are not what was
    /// written.
    pub(super) fn entries(&self, level: usize, first: u64, count: u64) -> Option<Vec<Entry>> {
        let (size, below) = (*self.sizes.get(level)?, self.sizes.get(..level)?);
        let end = size.min(first.saturating_add(count));
        let (from, to) = (first.min(end) / GROUP_ENTRIES, end.div_ceil(GROUP_ENTRIES));
        let (before, groups): (u64, u64) =
            (below.iter().sum(), below.iter().map(|size| size.div_ceil(GROUP_ENTRIES)).sum());
        let mut file = File::open(&self.path).ok()?;
        let entries_at = HEADER_BYTES as u64 + 4 * self.sums.len() as u64;
        file.seek(SeekFrom::Start(entries_at + ENTRY_BYTES * (before + from * GROUP_ENTRIES))).ok()?;
        let mut bytes =
            vec![0; (ENTRY_BYTES * (size.min(to * GROUP_ENTRIES) - size.min(from * GROUP_ENTRIES))) as usize];
        file.read_exact(&mut bytes).ok()?;
        let sums = self.sums.get((groups + from) as usize..(groups + to) as usize)?;
        let right = bytes
            .chunks((ENTRY_BYTES * GROUP_ENTRIES) as usize)
            .zip(sums)
            .all(|(group, sum)| crc32c(group) == *sum);
        let within = (ENTRY_BYTES * (first.min(end) - from * GROUP_ENTRIES)) as usize
            ..(ENTRY_BYTES * (end - from * GROUP_ENTRIES)) as usize;
        right.then(|| bytes[within].chunks_exact(ENTRY_BYTES as usize).map(Entry::from_bytes).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pyramid::pyramid_path;

    #[test]
    fn any_damaged_byte_is_found_where_it_would_be_shown() {
        let samples = 200_000_usize;
        let current = (0..samples).map(|i| (i % 1000) as f32).collect();
        let trace = crate::Trace::new(vec![1.0; samples], current, 1e3, 0.0, Default::default()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        crate::io::parquet::save(&trace, &path).unwrap();
        let options = ReadOptions::default();
        let made = PowerPyramid::of_file(&path, &options).unwrap();
        let (kept_at, whole) = (pyramid_path(&path), fs::read(pyramid_path(&path)).unwrap());
        for at in (0..whole.len()).step_by(997).chain([8, 63, 64, whole.len() - 1]) {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x10;
            fs::write(&kept_at, &bytes).unwrap();
            let found = kept(&kept_at, stamp(&path, &options));
            assert!(at >= 64 || matches!(found, Cached::Damaged), "byte {at}");
            let damaged = if let Cached::Whole(pyramid) = found { Some(pyramid) } else { None };
            let looks = [(0.0, 200.0, 1000), (0.0, 200.0, 10), (100.0, 200.0, 3000), (0.0, 99.0, 1500)];
            let shown = |(from_s, to_s, columns)| {
                let shown = damaged.as_ref().and_then(|pyramid| pyramid.columns(from_s, to_s, columns));
                shown.map(|shown| shown == made.columns(from_s, to_s, columns).unwrap())
            };
            let shown = looks.map(shown);
            assert!(!shown.contains(&Some(false)), "byte {at}");
            assert!(at >= 64 || shown == [None; 4], "byte {at}: {shown:?}");
        }
        for length in [0, 63, 64, whole.len() - 1] {
            fs::write(&kept_at, &whole[..length]).unwrap();
            let again = PowerPyramid::of_file(&path, &options).unwrap();
            assert!(again.was_damaged() && !PowerPyramid::of_file(&path, &options).unwrap().was_damaged());
        }
    }
}
