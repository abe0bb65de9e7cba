//! The L2 and the levels between it and memory: last-level cache and embedded DRAM.
//!
//! All levels write back and allocate what is read or written. A line read is allocated in each level that it
//! passes. Levels do not know what those above hold.

use activity::{Event, LEVELS, LevelRequests, LineAccess, LineKind, PacketCounts, Unit};

use super::{AccessOutcome, Cache, CacheError, CacheSpec, LINE_BYTES};

/// Levels below the L2, those that there are.
pub(super) type LevelSpecs = [Option<CacheSpec>; LEVELS.len()];

/// The L2 and the levels below it, and requests of the L2 since the log was last cleared.
#[derive(Clone, Debug)]
pub(super) struct SharedCaches {
    cache: Cache,
    levels: Vec<CacheLevel>,
    log: Vec<LineAccess>,
}

/// A level below the L2. All write back, and allocate lines that are read or written.
#[derive(Clone, Debug)]
struct CacheLevel {
    /// Index in [`LEVELS`].
    at: usize,
    cache: Cache,
}

impl SharedCaches {
    /// An empty L2 with the levels below it, in the order of [`LEVELS`].
    pub fn new(l2: CacheSpec, below: LevelSpecs) -> Result<Self, CacheError> {
        Ok(Self { cache: Cache::new(l2)?, levels: levels(below)?, log: Vec::new() })
    }

    /// Requests of the L2 since the log was last cleared, in order.
    pub fn log(&self) -> &[LineAccess] {
        &self.log
    }

    /// Clear the log.
    pub fn clear_log(&mut self) {
        self.log.clear();
    }

    /// Drop a line from the L2 and all levels below without writing it back.
    pub fn discard(&mut self, line: u64) {
        self.cache.discard(line);
        self.levels.iter_mut().for_each(|level| level.cache.discard(line));
    }

    /// Access one line of the L2. A line written whole is not fetched first.
    pub fn access(&mut self, client: Unit, line: u64, write: bool, counts: &mut PacketCounts) {
        counts[if write { Event::L2Writes } else { Event::L2Reads }] += 1;
        let found = self.cache.access(line, write);
        let kind = match (found, write) {
            (AccessOutcome::Hit, false) => LineKind::Hit,
            (AccessOutcome::Hit, true) => LineKind::Write,
            (_, false) => LineKind::Fetch,
            (_, true) => LineKind::Allocate,
        };
        let mut access = LineAccess::new(client, line_number(line), kind);
        counts[Event::L2Misses] += u32::from(found != AccessOutcome::Hit);
        if kind == LineKind::Fetch {
            request(&mut self.levels, line, false, &mut access);
        }
        if let AccessOutcome::MissEvicting(victim) = found {
            request(&mut self.levels, victim, true, &mut access);
        }
        note(&mut self.log, access, counts);
    }

    /// Empty all levels. The lines of `is_kept` go down to memory, requested by `client`; all others are dropped.
    pub fn drain(&mut self, client: Unit, is_kept: impl Fn(u64) -> bool, counts: &mut PacketCounts) {
        for line in self.cache.flush().into_iter().filter(|line| is_kept(*line)) {
            let mut access = LineAccess::new(client, line_number(line), LineKind::Drain);
            request(&mut self.levels, line, true, &mut access);
            note(&mut self.log, access, counts);
        }
        for at in 0..self.levels.len() {
            let (above, below) = self.levels.split_at_mut(at + 1);
            let level = &mut above[at];
            for line in level.cache.flush().into_iter().filter(|line| is_kept(*line)) {
                let mut access = LineAccess::new(client, line_number(line), LineKind::Drain);
                access.levels[level.at].writebacks += 1;
                request(below, line, true, &mut access);
                note(&mut self.log, access, counts);
            }
        }
    }
}

/// Request a line from the first of `levels`, and what that needs from those below it; below the last is memory.
/// A level fetches the line that it reads before it evicts another.
fn request(levels: &mut [CacheLevel], line: u64, write: bool, access: &mut LineAccess) {
    let Some((level, below)) = levels.split_first_mut() else {
        if write {
            access.write(line_number(line));
        }
        return;
    };
    let found = level.cache.access(line, write);
    let requests = &mut access.levels[level.at];
    *if write { &mut requests.writes } else { &mut requests.reads } += 1;
    requests.misses += u8::from(found != AccessOutcome::Hit);
    if found == AccessOutcome::Hit && !write {
        access.kind = LineKind::Below;
    }
    if found != AccessOutcome::Hit && !write {
        request(below, line, false, access);
    }
    if let AccessOutcome::MissEvicting(victim) = found {
        access.levels[level.at].writebacks += 1;
        request(below, victim, true, access);
    }
}

/// Count what `access` causes below the L2, and add it to the log.
fn note(log: &mut Vec<LineAccess>, access: LineAccess, counts: &mut PacketCounts) {
    for (level, requests) in LEVELS.into_iter().zip(access.levels) {
        if requests != LevelRequests::default() {
            requests.events(level).for_each(|(event, count)| counts[event] += count);
        }
    }
    counts[Event::DramReadBytes] += LINE_BYTES as u32 * u32::from(access.fetched().is_some());
    counts[Event::DramWriteBytes] += LINE_BYTES as u32 * access.written().count() as u32;
    log.push(access);
}

/// Line numbers fit in 32 bits: an image, its vertices and its textures are far below 2^38 bytes.
fn line_number(line: u64) -> u32 {
    line as u32
}

fn levels(specs: LevelSpecs) -> Result<Vec<CacheLevel>, CacheError> {
    let level = |(at, spec): (usize, Option<CacheSpec>)| {
        spec.map(|spec| Ok(CacheLevel { at, cache: Cache::new(spec)? }))
    };
    specs.into_iter().enumerate().filter_map(level).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;
    use crate::memory::{Compression, MemorySpec};
    use crate::random::mix;

    /// A cache by its definition: for every set the lines from the most to the least recently used.
    struct Reference {
        sets: Vec<VecDeque<(u64, bool)>>,
        ways: usize,
        /// Reads, writes, misses and lines written back.
        counts: [u32; 4],
    }

    impl Reference {
        fn new(spec: CacheSpec) -> Self {
            let sets = vec![VecDeque::new(); (spec.entries / spec.ways) as usize];
            Self { sets, ways: spec.ways as usize, counts: [0; 4] }
        }
    }

    /// Reads and writes of memory.
    type Traffic = [u32; 2];

    /// One access of the first of `levels`, by the textbook.
    fn walk(levels: &mut [Reference], line: u64, write: bool, memory: &mut Traffic) {
        let Some((level, below)) = levels.split_first_mut() else {
            memory[usize::from(write)] += 1;
            return;
        };
        level.counts[usize::from(write)] += 1;
        let at = line as usize % level.sets.len();
        let set = &mut level.sets[at];
        if let Some(way) = set.iter().position(|&(key, _)| key == line) {
            let (_, dirty) = set.remove(way).unwrap();
            set.push_front((line, dirty || write));
            return;
        }
        level.counts[2] += 1;
        set.push_front((line, write));
        if !write {
            walk(below, line, false, memory);
        }
        let victim = (set.len() > level.ways).then(|| set.pop_back().unwrap());
        if let Some((victim, true)) = victim {
            level.counts[3] += 1;
            walk(below, victim, true, memory);
        }
    }

    fn spec(l2: CacheSpec, llc: Option<CacheSpec>, edram: Option<CacheSpec>) -> MemorySpec {
        let one = CacheSpec::lru(1, 1);
        let compression = Compression::default();
        MemorySpec { depth: one, colour: one, texture: one, bins: None, l2, llc, edram, compression }
    }

    fn hierarchies() -> [MemorySpec; 4] {
        let [l2, llc, edram] = [(8, 2), (24, 3), (64, 4)].map(|(lines, ways)| CacheSpec::lru(lines, ways));
        [[false, false], [true, false], [false, true], [true, true]]
            .map(|[first, second]| spec(l2, first.then_some(llc), second.then_some(edram)))
    }

    /// Random accesses: runs of lines, often near the last, a third of them writes.
    fn stream(seed: u64, span: u64) -> impl Iterator<Item = (u64, bool)> {
        (0..6000).map(move |n| {
            let [at, far] = [mix(seed ^ mix(n)), mix(seed ^ mix(n / 20))];
            ((far % span + at % 12) % span, at % 3 == 0)
        })
    }

    fn level_counts(counts: &PacketCounts, level: Unit) -> [u32; 4] {
        counts.of(level).try_into().unwrap()
    }

    fn run(spec: &MemorySpec, seed: u64, span: u64) -> (SharedCaches, PacketCounts) {
        let (mut caches, mut counts) =
            (SharedCaches::new(spec.l2, spec.levels()).unwrap(), PacketCounts::default());
        stream(seed, span).for_each(|(line, write)| caches.access(Unit::Depth, line, write, &mut counts));
        (caches, counts)
    }

    #[test]
    fn every_level_hits_and_misses_as_the_textbook_says() {
        for (seed, spec) in (0..8).flat_map(|seed| hierarchies().map(|spec| (seed, spec))) {
            let span = [20, 60, 150, 1000][seed as usize % 4];
            let (_, counts) = run(&spec, seed, span);
            let present: Vec<(Unit, CacheSpec)> = LEVELS
                .into_iter()
                .zip(spec.levels())
                .filter_map(|(unit, spec)| Some((unit, spec?)))
                .collect();
            let mut levels = vec![Reference::new(spec.l2)];
            levels.extend(present.iter().map(|(_, spec)| Reference::new(*spec)));
            let mut memory = Traffic::default();
            stream(seed, span).for_each(|(line, write)| walk(&mut levels, line, write, &mut memory));
            let [reads, writes, misses, _] = levels[0].counts;
            let l2 = [Event::L2Reads, Event::L2Writes, Event::L2Misses].map(|event| counts[event]);
            assert_eq!(l2, [reads, writes, misses]);
            for ((unit, _), level) in present.iter().zip(&levels[1..]) {
                assert_eq!(level_counts(&counts, *unit), level.counts, "{unit:?} of {spec:?}");
                assert!(
                    level.counts.iter().all(|&count| count > 0) || span < 100,
                    "{level:?}",
                    level = level.counts
                );
            }
            let bytes = [Event::DramReadBytes, Event::DramWriteBytes].map(|event| counts[event]);
            assert_eq!(bytes, memory.map(|lines| 64 * lines));
        }
    }

    #[test]
    fn what_leaves_a_level_arrives_at_the_next() {
        for (seed, spec) in (0..4).flat_map(|seed| hierarchies().map(|spec| (seed, spec))) {
            let (caches, counts) = run(&spec, seed, 300);
            let sum = |part: fn(&LineAccess) -> u32| caches.log().iter().map(part).sum::<u32>();
            let read_misses =
                sum(|access| u32::from(matches!(access.kind, LineKind::Below | LineKind::Fetch)));
            // Lines read and written back by the level above, from the L2 on, which has no event for the latter.
            let mut above = [read_misses, 0];
            let present = LEVELS.into_iter().zip(spec.levels()).filter(|(_, spec)| spec.is_some());
            for ((level, _), at) in present.zip(0..) {
                let [reads, writes, misses, writebacks] = level_counts(&counts, level);
                assert_eq!(reads, above[0]);
                assert!(at == 0 || writes == above[1]);
                let found = |access: &LineAccess| {
                    LEVELS.into_iter().rposition(|unit| {
                        access.levels[LEVELS.iter().position(|other| *other == unit).unwrap()].reads > 0
                    })
                };
                let hits = caches.log().iter().filter(|access| {
                    access.kind == LineKind::Below && found(access).map(|at| LEVELS[at]) == Some(level)
                });
                above = [reads - hits.count() as u32, writebacks];
                assert!(misses >= above[0] && misses <= above[0] + writes);
            }
            assert_eq!(counts[Event::DramReadBytes], 64 * above[0]);
            assert!(spec.levels() == [None; 2] || counts[Event::DramWriteBytes] == 64 * above[1]);
            assert_eq!(counts[Event::DramWriteBytes], 64 * sum(|access| access.written().count() as u32));
        }
    }

    #[test]
    fn a_stream_that_fits_in_a_level_reaches_memory_once() {
        let [none, llc, _, both] = hierarchies();
        let reads = |spec: &MemorySpec, lines: u64| {
            let (mut caches, mut counts) =
                (SharedCaches::new(spec.l2, spec.levels()).unwrap(), PacketCounts::default());
            (0..10 * lines).for_each(|n| caches.access(Unit::Texture, n % lines, false, &mut counts));
            u64::from(counts[Event::DramReadBytes] / 64)
        };
        // 24 lines fit in the last-level cache and 64 in the eDRAM. LRU fails on one more line per set.
        assert_eq!([&none, &llc, &both].map(|spec| reads(spec, 24)), [240, 24, 24]);
        assert_eq!([&none, &llc, &both].map(|spec| reads(spec, 64)), [640, 640, 64]);
        assert_eq!(reads(&both, 128), 1280);
    }

    #[test]
    fn a_frame_ends_with_every_kept_line_in_memory_once() {
        for spec in hierarchies() {
            let (mut caches, mut counts) =
                (SharedCaches::new(spec.l2, spec.levels()).unwrap(), PacketCounts::default());
            (0..60).for_each(|line| caches.access(Unit::Colour, line, true, &mut counts));
            let written = |caches: &SharedCaches| {
                caches
                    .log()
                    .iter()
                    .flat_map(|access| access.written().collect::<Vec<_>>())
                    .collect::<Vec<_>>()
            };
            let mut expected = written(&caches);
            caches.drain(Unit::Colour, |line| line % 2 == 0, &mut counts);
            let drained = written(&caches).split_off(expected.len());
            assert_eq!(counts[Event::DramWriteBytes], 64 * (expected.len() + drained.len()) as u32);
            expected.extend(drained);
            let mut even: Vec<u32> = expected.into_iter().filter(|line| line % 2 == 0).collect();
            even.sort_unstable();
            assert_eq!(even, (0..60).step_by(2).collect::<Vec<u32>>());
            caches.clear_log();
            caches.drain(Unit::Colour, |_| true, &mut counts);
            assert!(caches.log().is_empty(), "all levels are empty");
        }
    }

    #[test]
    fn a_discarded_line_is_in_no_level() {
        let [.., both] = hierarchies();
        let (mut caches, mut counts) =
            (SharedCaches::new(both.l2, both.levels()).unwrap(), PacketCounts::default());
        (0..30).for_each(|line| caches.access(Unit::Depth, line, true, &mut counts));
        (0..30).for_each(|line| caches.discard(line));
        caches.clear_log();
        caches.drain(Unit::Depth, |_| true, &mut counts);
        assert!(caches.log().is_empty());
    }
}
