//! A bounded queue between two units, as a register would be: what one does in a cycle the other sees in the next.

use std::collections::VecDeque;

use crate::clock::Time;

/// First in, first out. Neither what was put in nor the room that was made can be seen in the cycle in which it was
/// done, so it does not matter which of the two units is visited first.
#[derive(Clone, Debug)]
pub(super) struct Queue<T> {
    items: VecDeque<(Time, T)>,
    capacity: usize,
    popped: usize,
    popped_at: Time,
}

impl<T: Copy> Queue<T> {
    pub fn new(capacity: u32) -> Self {
        Self { items: VecDeque::new(), capacity: capacity as usize, popped: 0, popped_at: Time::MAX }
    }

    /// How many more it takes at `now`.
    pub fn room(&self, now: Time) -> usize {
        let just_freed = if self.popped_at == now { self.popped } else { 0 };
        self.capacity - self.items.len() - just_freed
    }

    /// Puts `item` in, to be seen from `seen_at` on.
    pub fn push(&mut self, item: T, seen_at: Time) {
        debug_assert!(self.items.len() < self.capacity);
        self.items.push_back((seen_at, item));
    }

    /// The first item, where it can be seen at `now`.
    pub fn head(&self, now: Time) -> Option<T> {
        self.items.front().filter(|(seen_at, _)| *seen_at <= now).map(|(_, item)| *item)
    }

    /// When the first item can be seen.
    pub fn head_at(&self) -> Option<Time> {
        self.items.front().map(|(seen_at, _)| *seen_at)
    }

    /// Takes the first item out; the room it leaves can be used after `now`.
    pub fn pop(&mut self, now: Time) {
        self.items.pop_front();
        self.popped = if self.popped_at == now { self.popped + 1 } else { 1 };
        self.popped_at = now;
    }

    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_done_in_a_cycle_is_seen_in_the_next() {
        let mut queue = Queue::new(2);
        queue.push('a', 5);
        queue.push('b', 5);
        assert_eq!((queue.head(4), queue.head(5), queue.room(5)), (None, Some('a'), 0));
        queue.pop(5);
        assert_eq!((queue.head(5), queue.room(5), queue.room(6)), (Some('b'), 0, 1));
    }
}
