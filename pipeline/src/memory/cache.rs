//! A set-associative cache with least-recently-used replacement, as a functional model: it says what hits.

use serde::Deserialize;

/// Size and organization of a cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CacheSpec {
    /// Entries in all.
    pub entries: u32,
    /// Entries a key may be kept in.
    pub ways: u32,
}

/// Why a cache cannot be built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "a cache of {entries} entries in {ways} ways; ways have to divide entries, and both be 1 to 16777216"
)]
pub struct CacheError {
    /// Entries asked for.
    pub entries: u32,
    /// Ways asked for.
    pub ways: u32,
}

/// What an access found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// The key was there.
    Hit,
    /// It was not, and nothing that was written had to make room.
    Miss,
    /// It was not, and this key, which had been written, made room.
    MissEvicting(u64),
}

/// The contents of a cache: keys only, no data.
#[derive(Clone, Debug)]
pub struct Cache {
    ways: usize,
    sets: u64,
    /// Per set, the most recently used first. Empty ways hold [`Line::EMPTY`].
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
    /// When the ways do not divide the entries, or either is zero or absurdly large.
    pub fn new(spec: CacheSpec) -> Result<Self, CacheError> {
        let CacheSpec { entries, ways } = spec;
        let sane = 1..=16_777_216;
        if !sane.contains(&entries) || !sane.contains(&ways) || entries % ways != 0 {
            return Err(CacheError { entries, ways });
        }
        let lines = vec![Line::EMPTY; entries as usize];
        Ok(Self { ways: ways as usize, sets: u64::from(entries / ways), lines })
    }

    /// Looks `key` up and keeps it as the most recently used; `write` marks it as changed. The set is chosen by the
    /// key modulo the number of sets. `u64::MAX` is not a key.
    pub fn access(&mut self, key: u64, write: bool) -> Access {
        let first = (key % self.sets) as usize * self.ways;
        let set = &mut self.lines[first..first + self.ways];
        if let Some(way) = set.iter().position(|line| line.key == key) {
            let dirty = set[way].dirty | write;
            set[..=way].rotate_right(1);
            set[0].dirty = dirty;
            return Access::Hit;
        }
        set.rotate_right(1);
        let victim = std::mem::replace(&mut set[0], Line { key, dirty: write });
        if victim.dirty { Access::MissEvicting(victim.key) } else { Access::Miss }
    }

    /// Forgets `key`, written or not: its contents are not needed again.
    pub fn discard(&mut self, key: u64) {
        let first = (key % self.sets) as usize * self.ways;
        let set = &mut self.lines[first..first + self.ways];
        if let Some(way) = set.iter().position(|line| line.key == key) {
            set[way..].rotate_left(1);
            set[self.ways - 1] = Line::EMPTY;
        }
    }

    /// Forgets everything and returns the keys that had been written, in order of place.
    pub fn flush(&mut self) -> Vec<u64> {
        let dirty = self.lines.iter().filter(|line| line.dirty).map(|line| line.key).collect();
        self.lines.fill(Line::EMPTY);
        dirty
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cache(entries: u32, ways: u32) -> Cache {
        Cache::new(CacheSpec { entries, ways }).unwrap()
    }

    #[test]
    fn the_least_recently_used_makes_room() {
        let mut c = cache(2, 2);
        assert_eq!(c.access(10, false), Access::Miss);
        assert_eq!(c.access(20, false), Access::Miss);
        assert_eq!(c.access(10, false), Access::Hit);
        assert_eq!(c.access(30, false), Access::Miss);
        assert_eq!(c.access(10, false), Access::Hit);
        assert_eq!(c.access(20, false), Access::Miss);
    }

    #[test]
    fn only_what_was_written_is_written_back() {
        let mut c = cache(1, 1);
        c.access(1, false);
        assert_eq!(c.access(2, true), Access::Miss);
        assert_eq!(c.access(3, false), Access::MissEvicting(2));
        c.access(3, true);
        assert_eq!(c.flush(), [3]);
        assert_eq!(c.access(3, false), Access::Miss);
    }

    #[test]
    fn what_is_discarded_is_not_written_back() {
        let mut c = cache(2, 2);
        c.access(1, true);
        c.access(2, true);
        c.discard(1);
        assert_eq!(c.access(3, false), Access::Miss);
        assert_eq!(c.access(2, false), Access::Hit);
        assert_eq!(c.flush(), [2]);
    }

    #[test]
    fn sets_do_not_disturb_each_other() {
        let mut c = cache(4, 1);
        (0..4).for_each(|key| assert_eq!(c.access(key, false), Access::Miss));
        (0..4).for_each(|key| assert_eq!(c.access(key, false), Access::Hit));
        assert_eq!(c.access(4, false), Access::Miss);
        assert_eq!(c.access(0, false), Access::Miss);
        assert_eq!(c.access(1, false), Access::Hit);
    }

    #[test]
    fn nonsense_is_refused() {
        for (entries, ways) in [(0, 1), (8, 0), (8, 3), (u32::MAX, 1)] {
            assert!(Cache::new(CacheSpec { entries, ways }).is_err());
        }
    }
}
