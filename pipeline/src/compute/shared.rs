//! Shared memory of a group, with a check that lanes do not race.

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
