//! Memory of the pipeline: the address space of a frame, set-associative caches (hits and misses), and
//! traffic to the chips.

mod shared;
mod system;

use serde::{Deserialize, Serialize};

use crate::random::mix;

pub(crate) use system::depths_fit;
pub use system::{Compression, MemorySpec, MemorySystem};

/// Bytes per line in all caches of memory.
pub const LINE_BYTES: u64 = 64;

/// A region of memory that passes write to and later ones may read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryRange {
    first: u64,
    bytes: u64,
}

impl MemoryRange {
    /// Without bytes.
    pub(crate) const NOWHERE: Self = Self { first: 0, bytes: 0 };

    /// Address of the first byte.
    pub fn address(&self) -> u64 {
        self.first
    }

    /// Size in bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Whether it has this address.
    pub fn contains(&self, address: u64) -> bool {
        (self.first..self.first + self.bytes).contains(&address)
    }

    /// Whether both have bytes in common.
    pub(crate) fn overlaps(&self, other: Self) -> bool {
        self.first.max(other.first) < (self.first + self.bytes).min(other.first + other.bytes)
    }
}

/// Addresses of a frame, handed out one after the other.
#[derive(Clone, Debug, Default)]
pub struct AddressSpace {
    next: u64,
    /// Depths and colours of samples that no pass keeps; passes of one size share them.
    samples: Vec<[MemoryRange; 2]>,
}

impl AddressSpace {
    /// End of the addresses of surfaces, vertices and textures. A line has a number of 32 bits; the upper
    /// half is for bins.
    pub const END: u64 = LINE_BYTES << 31;
    /// Most bytes of a frame. This program keeps the contents of all surfaces, too.
    pub const MAX_BYTES: u64 = 8 << 30;

    /// A new surface of `bytes`.
    pub fn take(&mut self, bytes: u64) -> MemoryRange {
        let first = self.next;
        self.next += bytes.next_multiple_of(LINE_BYTES);
        MemoryRange { first, bytes }
    }

    /// Depths and colours of samples, `bytes` each, whose values end with the pass.
    pub fn samples(&mut self, bytes: u64) -> [MemoryRange; 2] {
        if let Some(known) = self.samples.iter().find(|[depth, _]| depth.bytes == bytes) {
            return *known;
        }
        let new = [self.take(bytes), self.take(bytes)];
        self.samples.push(new);
        new
    }

    /// Whether all surfaces fit into memory.
    pub fn fits(&self) -> bool {
        self.next <= Self::MAX_BYTES
    }

    /// Bytes handed out.
    pub fn bytes(&self) -> u64 {
        self.next
    }
}

/// Size and organization of a cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CacheSpec {
    /// Total number of entries.
    pub entries: u32,
    /// Entries per set.
    pub ways: u32,
    /// Replacement policy.
    #[serde(default)]
    pub replacement: Replacement,
}

impl CacheSpec {
    /// A cache with LRU replacement.
    pub const fn lru(entries: u32, ways: u32) -> Self {
        Self { entries, ways, replacement: Replacement::Lru }
    }
}

/// Replacement policy: which entry of a full set is evicted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Replacement {
    /// Least recently used.
    #[default]
    Lru,
    /// First in first out, independent of use.
    Fifo,
    /// Random, by the hash of the seed and the number of evictions so far.
    Random {
        /// Seed.
        seed: u64,
    },
}

/// Why a cache cannot be built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "a cache of {entries} entries in {ways} ways; ways have to divide entries, and both be 1 to 16777216"
)]
pub struct CacheError {
    /// Number of entries.
    pub entries: u32,
    /// Number of ways.
    pub ways: u32,
}

/// Outcome of an access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AccessOutcome {
    /// The key is in the cache.
    Hit,
    /// The key is not in the cache, and no dirty key is evicted.
    Miss,
    /// The key is not in the cache, and this dirty key is evicted.
    MissEvicting(u64),
}

/// Contents of a cache: keys only, no data.
#[derive(Clone, Debug)]
pub struct Cache {
    ways: usize,
    sets: u64,
    /// One less than the number of sets if that is a power of two, so that no division is needed.
    set_mask: Option<u64>,
    replacement: Replacement,
    /// Misses so far.
    misses: u64,
    /// Entries of every set, the most recently used (LRU) or inserted (FIFO) first. Empty ways hold
    /// [`Line::EMPTY`] and come last.
    lines: Vec<Line>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Line {
    key: u64,
    dirty: bool,
}

impl Line {
    const EMPTY: Self = Self { key: u64::MAX, dirty: false };
}

impl Cache {
    /// An empty cache.
    ///
    /// # Errors
    /// [`CacheError`] if the ways do not divide the entries, or either is zero or too large.
    pub fn new(spec: CacheSpec) -> Result<Self, CacheError> {
        let CacheSpec { entries, ways, replacement } = spec;
        let sane = 1..=16_777_216;
        if !sane.contains(&entries) || !sane.contains(&ways) || entries % ways != 0 {
            return Err(CacheError { entries, ways });
        }
        let (lines, sets) = (vec![Line::EMPTY; entries as usize], u64::from(entries / ways));
        let set_mask = sets.is_power_of_two().then(|| sets - 1);
        Ok(Self { ways: ways as usize, sets, set_mask, replacement, misses: 0, lines })
    }

    /// Entries of the set of `key`.
    #[inline]
    fn set(&mut self, key: u64) -> &mut [Line] {
        let set = self.set_mask.map_or_else(|| key % self.sets, |mask| key & mask);
        let first = set as usize * self.ways;
        &mut self.lines[first..first + self.ways]
    }

    /// Access `key`; `write` marks it as dirty. The set is the key modulo the number of sets. `u64::MAX` is
    /// not a valid key.
    #[inline]
    pub fn access(&mut self, key: u64, write: bool) -> AccessOutcome {
        let newest = &mut self.set(key)[0];
        if newest.key == key {
            newest.dirty |= write;
            return AccessOutcome::Hit;
        }
        self.access_others(key, write)
    }

    /// [`Self::access`] of a key that is not the first of its set.
    fn access_others(&mut self, key: u64, write: bool) -> AccessOutcome {
        let (is_lru, last) = (self.replacement == Replacement::Lru, self.ways - 1);
        let set = self.set(key);
        if let Some(way) = set.iter().position(|line| line.key == key) {
            set[way].dirty |= write;
            if is_lru {
                to_front(set, way);
            }
            return AccessOutcome::Hit;
        }
        let is_full = set[last] != Line::EMPTY;
        self.misses += 1;
        let way = match self.replacement {
            Replacement::Random { seed } if is_full => {
                (mix(seed ^ mix(self.misses)) % self.ways as u64) as usize
            }
            _ => last,
        };
        let set = self.set(key);
        to_front(set, way);
        let victim = std::mem::replace(&mut set[0], Line { key, dirty: write });
        if victim.dirty { AccessOutcome::MissEvicting(victim.key) } else { AccessOutcome::Miss }
    }

    /// Remove `key` without writing it back.
    pub fn discard(&mut self, key: u64) {
        let set = self.set(key);
        if let Some(way) = set.iter().position(|line| line.key == key) {
            set[way..].rotate_left(1);
            set[set.len() - 1] = Line::EMPTY;
        }
    }

    /// Empty the cache. Returns the dirty keys in increasing order.
    pub fn flush(&mut self) -> Vec<u64> {
        let mut dirty: Vec<u64> = self.lines.iter().filter(|line| line.dirty).map(|line| line.key).collect();
        // The lines of a set lie in different rows of one bank of memory.
        dirty.sort_unstable();
        self.lines.fill(Line::EMPTY);
        dirty
    }
}

/// Moves the entry at `way` to the front; those before it keep their order.
fn to_front(set: &mut [Line], way: usize) {
    let entry = set[way];
    // A loop rather than `rotate_right`, which is slow for a few entries.
    for at in (0..way).rev() {
        set[at + 1] = set[at];
    }
    set[0] = entry;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_are_disjoint_and_start_at_a_line() {
        let mut space = AddressSpace::default();
        let [a, b] = [space.take(100), space.take(1)];
        assert_eq!([a.address(), b.address()], [0, 128]);
        assert!(a.contains(99) && !a.contains(100));
        assert_eq!(space.samples(64), space.samples(64), "passes of one size share their samples");
        assert_ne!(space.samples(64), space.samples(128));
        assert_eq!(space.bytes(), 192 + 2 * 64 + 2 * 128);
    }

    #[test]
    fn a_frame_takes_no_more_than_memory_has() {
        const { assert!(AddressSpace::MAX_BYTES <= AddressSpace::END) };
        let mut space = AddressSpace::default();
        space.take(AddressSpace::MAX_BYTES);
        assert!(space.fits());
        space.take(1);
        assert!(!space.fits());
    }

    fn cache(entries: u32, ways: u32) -> Cache {
        Cache::new(CacheSpec::lru(entries, ways)).unwrap()
    }

    fn hits(replacement: Replacement, keys: &[u64]) -> Vec<bool> {
        let mut cache = Cache::new(CacheSpec { replacement, ..CacheSpec::lru(2, 2) }).unwrap();
        keys.iter().map(|&key| cache.access(key, false) == AccessOutcome::Hit).collect()
    }

    #[test]
    fn the_first_in_is_the_first_out_however_used() {
        // 1 is used again before 3 arrives, so the policies evict different keys.
        let keys = [1, 2, 1, 3, 1];
        assert_eq!(hits(Replacement::Lru, &keys), [false, false, true, false, true]);
        assert_eq!(hits(Replacement::Fifo, &keys), [false, false, true, false, false]);
    }

    #[test]
    fn random_victims_follow_the_seed_and_spare_empty_ways() {
        let keys: Vec<u64> = (0..400).map(|i| mix(i) % 4).collect();
        let of = |seed| hits(Replacement::Random { seed }, &keys);
        assert_eq!(of(1), of(1));
        assert_ne!(of(1), of(2));
        // A set of two holds both keys permanently, for any seed.
        let two: Vec<u64> = (0..50).map(|i| i % 2).collect();
        assert!(
            (0..20).all(|seed| hits(Replacement::Random { seed }, &two).iter().filter(|h| !**h).count() == 2)
        );
        // Four random keys in two ways: half of the accesses hit.
        let share = of(3).iter().filter(|hit| **hit).count() as f64 / 400.0;
        assert!((0.42..0.58).contains(&share), "{share}");
    }

    #[test]
    fn a_cyclic_walk_defeats_recency_but_not_chance() {
        // One key more than ways, in turn: the textbook worst case of LRU and FIFO.
        let keys: Vec<u64> = (0..300).map(|i| i % 3).collect();
        let count = |replacement| hits(replacement, &keys).iter().filter(|hit| **hit).count();
        assert_eq!((count(Replacement::Lru), count(Replacement::Fifo)), (0, 0));
        assert!(count(Replacement::Random { seed: 5 }) > 60);
    }

    #[test]
    fn the_least_recently_used_makes_room() {
        let mut c = cache(2, 2);
        assert_eq!(c.access(10, false), AccessOutcome::Miss);
        assert_eq!(c.access(20, false), AccessOutcome::Miss);
        assert_eq!(c.access(10, false), AccessOutcome::Hit);
        assert_eq!(c.access(30, false), AccessOutcome::Miss);
        assert_eq!(c.access(10, false), AccessOutcome::Hit);
        assert_eq!(c.access(20, false), AccessOutcome::Miss);
    }

    #[test]
    fn only_dirty_keys_are_written_back() {
        let mut c = cache(1, 1);
        c.access(1, false);
        assert_eq!(c.access(2, true), AccessOutcome::Miss);
        assert_eq!(c.access(3, false), AccessOutcome::MissEvicting(2));
        c.access(3, true);
        assert_eq!(c.flush(), [3]);
        assert_eq!(c.access(3, false), AccessOutcome::Miss);
    }

    #[test]
    fn discarded_keys_are_not_written_back() {
        let mut c = cache(2, 2);
        c.access(1, true);
        c.access(2, true);
        c.discard(1);
        assert_eq!(c.access(3, false), AccessOutcome::Miss);
        assert_eq!(c.access(2, false), AccessOutcome::Hit);
        assert_eq!(c.flush(), [2]);
    }

    #[test]
    fn sets_do_not_disturb_each_other() {
        let mut c = cache(4, 1);
        (0..4).for_each(|key| assert_eq!(c.access(key, false), AccessOutcome::Miss));
        (0..4).for_each(|key| assert_eq!(c.access(key, false), AccessOutcome::Hit));
        assert_eq!(c.access(4, false), AccessOutcome::Miss);
        assert_eq!(c.access(0, false), AccessOutcome::Miss);
        assert_eq!(c.access(1, false), AccessOutcome::Hit);
    }

    #[test]
    fn nonsense_is_refused() {
        for (entries, ways) in [(0, 1), (8, 0), (8, 3), (u32::MAX, 1)] {
            assert!(Cache::new(CacheSpec::lru(entries, ways)).is_err());
        }
    }
}
