//! Accesses of a warp: bank conflicts in the shared memory of its group, lines of buffers, and contention of atomics.
//! Shared memory checks that lanes do not race.

use activity::{Event, PacketCounts};

use super::ComputeSpec;
use crate::memory::LINE_BYTES;

/// What an access of a warp does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum AccessKind {
    SharedLoad,
    SharedStore,
    SharedAtomic,
    Load,
    Store,
    Atomic,
}

/// One access of one lane. Accesses with equal key are one access of the warp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct LaneAccess {
    /// How many of this kind and buffer the lane made before.
    pub nth: u32,
    pub kind: AccessKind,
    /// Number of the buffer; 0 for shared memory.
    pub buffer: u32,
    /// Byte address; that of the word in shared memory.
    pub address: u64,
}

impl LaneAccess {
    fn key(&self) -> (u32, AccessKind, u32) {
        (self.nth, self.kind, self.buffer)
    }
}

/// How a warp accesses a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Touched {
    Read,
    Written,
    /// Read and written by an atomic unit.
    Changed,
}

/// An access of a warp to a line of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LineTouch {
    /// Address of the line.
    pub address: u64,
    pub how: Touched,
}

/// Counts the accesses of a warp, and adds the lines they touch to `lines`. `accesses` is sorted and emptied.
pub(super) fn account(
    accesses: &mut Vec<LaneAccess>,
    spec: &ComputeSpec,
    counts: &mut PacketCounts,
    lines: &mut Vec<LineTouch>,
) {
    accesses.sort_unstable();
    for one in accesses.chunk_by(|a, b| a.key() == b.key()) {
        match one[0].kind {
            AccessKind::SharedLoad | AccessKind::SharedStore | AccessKind::SharedAtomic => {
                shared(one, spec.banks, counts)
            }
            AccessKind::Load => touch(one, Touched::Read, lines),
            AccessKind::Store => touch(one, Touched::Written, lines),
            AccessKind::Atomic => {
                atomic(one, spec.atomic_units, counts);
                touch(one, Touched::Changed, lines);
            }
        }
    }
    accesses.clear();
}

/// A bank gives one word a cycle, to all lanes that request it. Atomics take a cycle each, and two accesses.
fn shared(accesses: &[LaneAccess], banks: u32, counts: &mut PacketCounts) {
    let is_atomic = accesses[0].kind == AccessKind::SharedAtomic;
    let mut in_bank = vec![0_u32; banks as usize];
    let mut words = 0;
    for word in accesses.chunk_by(|a, b| a.address == b.address) {
        in_bank[(word[0].address / 4 % u64::from(banks)) as usize] +=
            if is_atomic { word.len() as u32 } else { 1 };
        words += 1;
    }
    let cycles = in_bank.into_iter().max().unwrap_or(0);
    counts[Event::SharedAccesses] += accesses.len() as u32 * if is_atomic { 2 } else { 1 };
    counts[Event::SharedCycles] += cycles;
    counts[Event::BankConflicts] += cycles - u32::div_ceil(words, banks);
}

/// Lines of a sorted access, each once.
fn touch(accesses: &[LaneAccess], how: Touched, lines: &mut Vec<LineTouch>) {
    let line = |access: &LaneAccess| access.address / LINE_BYTES;
    let of_lines = accesses.chunk_by(|a, b| line(a) == line(b));
    lines.extend(of_lines.map(|of_line| LineTouch { address: line(&of_line[0]) * LINE_BYTES, how }));
}

/// An atomic unit changes all words of a line in a step, but a word once. Units work side by side; the
/// busiest counts.
fn atomic(accesses: &[LaneAccess], units: u32, counts: &mut PacketCounts) {
    let line = |access: &LaneAccess| access.address / LINE_BYTES;
    let mut steps = vec![0_u32; units as usize];
    for of_line in accesses.chunk_by(|a, b| line(a) == line(b)) {
        let words = of_line.chunk_by(|a, b| a.address == b.address).map(|word| word.len() as u32);
        steps[(line(&of_line[0]) % u64::from(units)) as usize] += words.clone().max().unwrap_or(0);
        counts[Event::AtomicConflicts] += words.map(|lanes| lanes - 1).sum::<u32>();
    }
    counts[Event::Atomics] += accesses.len() as u32;
    counts[Event::AtomicSteps] += steps.into_iter().max().unwrap_or(0);
}

/// Who accessed a word last: the interval between barriers, and the lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct By {
    interval: u32,
    lane: u32,
}

/// Stands for several lanes.
const SEVERAL: u32 = u32::MAX;
/// Stands for the lanes of atomics.
const ATOMIC: u32 = u32::MAX - 1;
/// Before the first interval.
const NEVER: By = By { interval: 0, lane: SEVERAL };

#[derive(Clone, Copy, Debug)]
struct SharedWord {
    bits: u32,
    read: By,
    written: By,
}

/// How a lane accesses a word of shared memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SharedAccess {
    Load,
    Store(u32),
    /// An addition.
    Add(u32),
}

/// A lane used a word that another one wrote, or wrote one that another one used, without a barrier between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Race;

/// Words of shared memory, all 0 at first.
#[derive(Clone, Debug)]
pub(super) struct SharedMemory {
    words: Vec<SharedWord>,
    interval: u32,
}

impl SharedMemory {
    pub fn new(bytes: u32) -> Self {
        let word = SharedWord { bits: 0, read: NEVER, written: NEVER };
        Self { words: vec![word; bytes as usize / 4], interval: 1 }
    }

    pub fn len(&self) -> u32 {
        self.words.len() as u32
    }

    /// Ends an interval.
    pub fn barrier(&mut self) {
        self.interval += 1;
    }

    /// Accesses word `index`, which exists. Returns the word before.
    pub fn access(&mut self, index: u32, lane: u32, access: SharedAccess) -> Result<u32, Race> {
        let (word, interval) = (&mut self.words[index as usize], self.interval);
        let is_atomic = matches!(access, SharedAccess::Add(_));
        let own = if is_atomic { ATOMIC } else { lane };
        let is_by_other = |by: By| by.interval == interval && by.lane != own;
        if is_by_other(word.written) || (access != SharedAccess::Load && !is_atomic && is_by_other(word.read))
        {
            return Err(Race);
        }
        if is_atomic && word.read.interval == interval {
            return Err(Race);
        }
        let before = word.bits;
        let by = By { interval, lane: own };
        match access {
            SharedAccess::Load if is_by_other(word.read) => word.read.lane = SEVERAL,
            SharedAccess::Load => word.read = by,
            SharedAccess::Store(bits) => (word.bits, word.written) = (bits, by),
            SharedAccess::Add(bits) => (word.bits, word.written) = (before.wrapping_add(bits), by),
        }
        Ok(before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPEC: ComputeSpec =
        ComputeSpec { warp_lanes: 32, group_lanes: 256, shared_bytes: 4096, banks: 32, atomic_units: 2 };

    fn of(kind: AccessKind, addresses: impl IntoIterator<Item = u64>) -> (PacketCounts, Vec<LineTouch>) {
        let one = |address| LaneAccess { nth: 0, kind, buffer: 0, address };
        let mut accesses = addresses.into_iter().map(one).collect();
        let (mut counts, mut lines) = (PacketCounts::default(), Vec::new());
        account(&mut accesses, &SPEC, &mut counts, &mut lines);
        (counts, lines)
    }

    #[test]
    fn lanes_that_ask_a_bank_for_several_words_wait() {
        let cycles = |stride: u64| {
            let (counts, _) = of(AccessKind::SharedLoad, (0..32).map(|lane| 4 * stride * lane));
            assert_eq!(counts[Event::SharedAccesses], 32);
            [Event::SharedCycles, Event::BankConflicts].map(|event| counts[event])
        };
        // All banks once, half of them twice, one bank for all; odd strides never conflict.
        assert_eq!([1, 2, 8, 32].map(cycles), [[1, 0], [2, 1], [8, 7], [32, 31]]);
        assert_eq!([3, 33].map(cycles), [[1, 0]; 2]);
        assert_eq!(cycles(0), [1, 0], "a word goes to all lanes at once");
        // A warp twice as wide as the memory takes two cycles, none of them a conflict.
        let (wide, _) = of(AccessKind::SharedStore, (0..64).map(|lane| 4 * lane));
        assert_eq!([wide[Event::SharedCycles], wide[Event::BankConflicts]], [2, 0]);
    }

    #[test]
    fn atomics_in_shared_memory_take_a_cycle_each_on_a_word() {
        let (counts, _) = of(AccessKind::SharedAtomic, [0; 32]);
        assert_eq!([counts[Event::SharedCycles], counts[Event::SharedAccesses]], [32, 64]);
        let (counts, _) = of(AccessKind::SharedAtomic, (0..32).map(|lane| 4 * lane));
        assert_eq!([counts[Event::SharedCycles], counts[Event::BankConflicts]], [1, 0]);
    }

    #[test]
    fn a_warp_touches_every_line_once() {
        let lines = |stride: u64| of(AccessKind::Load, (0..32).map(|lane| 4 * stride * lane)).1.len();
        assert_eq!([0, 1, 4, 16, 64].map(lines), [1, 2, 8, 32, 32]);
    }

    #[test]
    fn atomics_wait_for_equal_words_alone() {
        let of = |addresses: &[u64]| {
            let (counts, lines) = of(AccessKind::Atomic, addresses.iter().copied());
            ([Event::AtomicSteps, Event::AtomicConflicts].map(|event| counts[event]), lines.len())
        };
        assert_eq!(of(&[8; 32]), ([32, 31], 1));
        assert_eq!(of(&[0, 4, 8, 12]), ([1, 0], 1), "words of a line in a step");
        // Two lines of one unit, and two of both units.
        assert_eq!(of(&[0, 128]), ([2, 0], 2));
        assert_eq!(of(&[0, 64]), ([1, 0], 2));
        assert_eq!(of(&[0, 0, 4, 64, 64, 64]), ([3, 3], 2));
    }

    #[test]
    fn the_nth_accesses_of_lanes_are_one_access() {
        // Two loads of two lanes: the same two lines in a different order.
        let one = |nth, address| LaneAccess { nth, kind: AccessKind::Load, buffer: 0, address };
        let (mut counts, mut lines) = (PacketCounts::default(), Vec::new());
        let mut accesses = vec![one(0, 0), one(1, 64), one(0, 4), one(1, 68)];
        account(&mut accesses, &SPEC, &mut counts, &mut lines);
        assert_eq!(lines.iter().map(|line| line.address).collect::<Vec<_>>(), [0, 64]);
    }

    #[test]
    fn lanes_may_share_a_word_across_a_barrier_alone() {
        let mut memory = SharedMemory::new(8);
        assert_eq!(memory.access(0, 3, SharedAccess::Store(7)), Ok(0));
        assert_eq!(memory.access(0, 3, SharedAccess::Load), Ok(7), "its own word");
        assert_eq!(memory.access(0, 4, SharedAccess::Load), Err(Race));
        assert_eq!(memory.access(0, 4, SharedAccess::Add(1)), Err(Race));
        memory.barrier();
        assert_eq!([3, 4, 5].map(|lane| memory.access(0, lane, SharedAccess::Load)), [Ok(7); 3]);
        assert_eq!(memory.access(0, 3, SharedAccess::Store(1)), Err(Race), "others have read it");
        assert_eq!(memory.access(1, 3, SharedAccess::Load), Ok(0));
        assert_eq!(memory.access(1, 3, SharedAccess::Store(1)), Ok(0), "nobody else has read it");
    }

    #[test]
    fn atomics_race_with_plain_accesses_but_not_with_each_other() {
        let mut memory = SharedMemory::new(4);
        assert_eq!([0, 1, 1].map(|lane| memory.access(0, lane, SharedAccess::Add(2))), [Ok(0), Ok(2), Ok(4)]);
        assert_eq!(memory.access(0, 1, SharedAccess::Load), Err(Race));
        memory.barrier();
        assert_eq!(memory.access(0, 1, SharedAccess::Load), Ok(6));
        assert_eq!(memory.access(0, 1, SharedAccess::Add(1)), Err(Race));
    }
}
