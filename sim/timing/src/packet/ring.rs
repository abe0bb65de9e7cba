//! A queue seen from outside: when it has room for one more.

use crate::clock::Time;

/// The moments at which each of the last so many left. The next comes in when the oldest of them has gone.
#[derive(Clone, Debug)]
pub(super) struct Ring {
    moments: Box<[Time]>,
    at: usize,
}

impl Ring {
    /// For `capacity` at once, at least 1.
    pub fn new(capacity: u32) -> Self {
        Self { moments: vec![0; capacity as usize].into(), at: 0 }
    }

    /// When there is room for one more.
    pub fn room_at(&self) -> Time {
        self.moments[self.at]
    }

    /// When there is room for the last of `count` more. For more than fit that is when the queue is empty, as it is not known when
    /// their own first will make room for their last.
    pub fn room_for(&self, count: u32) -> Time {
        let capacity = self.moments.len();
        let last = self.at + (count as usize).min(capacity) - 1;
        self.moments[if last < capacity { last } else { last - capacity }]
    }

    /// `count` (at least 1) more came in; the first is gone at `from`, the last at `to`.
    pub fn note_all(&mut self, count: u32, from: Time, to: Time) {
        let step = if count > 1 { to.saturating_sub(from) / Time::from(count - 1) } else { 0 };
        (1..count).rev().for_each(|behind| self.note(to - step * Time::from(behind)));
        self.note(to);
    }

    /// One more came in, and is gone at `moment`.
    pub fn note(&mut self, moment: Time) {
        self.moments[self.at] = moment;
        self.at += 1;
        if self.at == self.moments.len() {
            self.at = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_comes_in_when_the_oldest_has_gone() {
        let mut ring = Ring::new(2);
        for (room, gone) in [(0, 10), (0, 20), (10, 25), (20, 26), (25, 30)] {
            assert_eq!(ring.room_at(), room);
            ring.note(gone);
        }
    }

    #[test]
    fn groups_go_one_after_another() {
        let mut ring = Ring::new(3);
        [10, 20, 30].into_iter().for_each(|gone| ring.note(gone));
        assert_eq!((ring.room_for(1), ring.room_for(2)), (10, 20));
        ring.note_all(2, 35, 40);
        assert_eq!([1, 2, 3, 9].map(|count| ring.room_for(count)), [30, 35, 40, 40]);
    }
}
