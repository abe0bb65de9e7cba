//! How many may be somewhere at once: the next comes in when one of those before has gone.

use std::collections::VecDeque;

use crate::clock::Time;

/// When each of the last so many went. Groups go in at once, each member counted.
#[derive(Clone, Debug)]
pub(super) struct Window {
    capacity: u64,
    entered: u64,
    /// The number of the last of a group, and when the group was gone.
    gone: VecDeque<(u64, Time)>,
}

impl Window {
    pub fn new(capacity: u32) -> Self {
        Self { capacity: u64::from(capacity), entered: 0, gone: VecDeque::new() }
    }

    /// When there is room for the last of `count` more.
    pub fn room_at(&mut self, count: u32) -> Time {
        let Some(must_go) = (self.entered + u64::from(count)).checked_sub(self.capacity).filter(|&n| n > 0) else { return 0 };
        while self.gone.len() > 1 && self.gone[0].0 < must_go {
            self.gone.pop_front();
        }
        // Of a group larger than the window, its own first members make room for its last; that is not known here.
        self.gone.front().map_or(0, |&(_, at)| at)
    }

    /// `count` more went in, and are gone at `at`.
    pub fn enter(&mut self, count: u32, at: Time) {
        self.entered += u64::from(count);
        self.gone.push_back((self.entered, at));
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
            window.enter(1, at);
        }
        assert_eq!((window.room_at(1), window.room_at(2)), (10, 20));
        window.enter(2, 40);
        assert_eq!(window.room_at(1), 30);
    }
}
