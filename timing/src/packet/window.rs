//! How many may be somewhere at once: the next comes in when one of those before has gone.

use std::collections::VecDeque;

use crate::clock::Time;

/// When each of the last so many went. Groups are noted as one: their members go one after another.
#[derive(Clone, Debug)]
pub(super) struct Window {
    capacity: u64,
    entered: u64,
    gone: VecDeque<Group>,
}

/// The number of its last member, how many it has, and when its first and its last member were gone.
#[derive(Clone, Copy, Debug)]
struct Group {
    last: u64,
    count: u32,
    from: Time,
    to: Time,
}

impl Group {
    /// When member `number` of all was gone.
    fn gone_at(&self, number: u64) -> Time {
        let behind = self.last.saturating_sub(number).min(u64::from(self.count) - 1);
        if behind == 0 {
            return self.to;
        }
        self.to - (self.to - self.from) * behind / (u64::from(self.count) - 1)
    }
}

impl Window {
    pub fn new(capacity: u32) -> Self {
        Self { capacity: u64::from(capacity), entered: 0, gone: VecDeque::new() }
    }

    /// When there is room for the last of `count` more. For a group larger than the window that is when the window is empty, as
    /// it is not known when its own first members will make room for its last.
    pub fn room_at(&mut self, count: u32) -> Time {
        let must_go = (self.entered + u64::from(count)).saturating_sub(self.capacity).min(self.entered);
        if must_go == 0 {
            return 0;
        }
        while self.gone.len() > 1 && self.gone[0].last < must_go {
            self.gone.pop_front();
        }
        self.gone.front().map_or(0, |group| group.gone_at(must_go))
    }

    /// `count` (at least 1) more went in; the first is gone at `from`, the last at `to`.
    pub fn enter(&mut self, count: u32, from: Time, to: Time) {
        self.entered += u64::from(count);
        self.gone.push_back(Group { last: self.entered, count, from: from.min(to), to });
        while self.gone.len() as u64 > self.capacity {
            self.gone.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_comes_in_when_one_has_gone() {
        let mut window = Window::new(3);
        for at in [10, 20, 30] {
            assert_eq!(window.room_at(1), 0);
            window.enter(1, at, at);
        }
        assert_eq!((window.room_at(1), window.room_at(2)), (10, 20));
        window.enter(2, 35, 40);
        assert_eq!((window.room_at(1), window.room_at(2), window.room_at(3)), (30, 35, 40));
        assert_eq!(window.room_at(9), 40);
    }
}
