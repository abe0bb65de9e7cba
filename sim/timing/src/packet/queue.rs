//! Bounded queue of the level `packet`, seen from its input: when it has room.

use crate::clock::Time;

/// Times at which the last `capacity` entries left. The next entry is admitted when the oldest of them has
/// left.
#[derive(Clone, Debug)]
pub(super) struct QueueTimes {
    times: Box<[Time]>,
    at: usize,
}

impl QueueTimes {
    /// A queue of `capacity` entries, at least 1.
    pub fn new(capacity: u32) -> Self {
        Self { times: vec![0; capacity as usize].into(), at: 0 }
    }

    /// When there is room for one more entry.
    pub fn room_at(&self) -> Time {
        self.times[self.at]
    }

    /// When there is room for the last of `count` more entries. If they do not all fit, this is when the
    /// queue is empty, as the times at which the new entries leave are not yet known.
    pub fn room_for(&self, count: u32) -> Time {
        let capacity = self.times.len();
        let last = self.at + (count as usize).min(capacity) - 1;
        self.times[if last < capacity { last } else { last - capacity }]
    }

    /// Add `count` entries, at least 1. The first leaves at `from`, the last at `to`.
    pub fn note_all(&mut self, count: u32, from: Time, to: Time) {
        let step = if count > 1 { to.saturating_sub(from) / Time::from(count - 1) } else { 0 };
        (1..count).rev().for_each(|behind| self.note(to - step * Time::from(behind)));
        self.note(to);
    }

    /// Add an entry that leaves at `time`.
    pub fn note(&mut self, time: Time) {
        self.times[self.at] = time;
        self.at += 1;
        if self.at == self.times.len() {
            self.at = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_entry_waits_for_the_oldest_to_leave() {
        let mut queue = QueueTimes::new(2);
        for (room, left_at) in [(0, 10), (0, 20), (10, 25), (20, 26), (25, 30)] {
            assert_eq!(queue.room_at(), room);
            queue.note(left_at);
        }
    }

    #[test]
    fn groups_are_admitted_in_order() {
        let mut queue = QueueTimes::new(3);
        [10, 20, 30].into_iter().for_each(|left_at| queue.note(left_at));
        assert_eq!((queue.room_for(1), queue.room_for(2)), (10, 20));
        queue.note_all(2, 35, 40);
        assert_eq!([1, 2, 3, 9].map(|count| queue.room_for(count)), [30, 35, 40, 40]);
    }
}
