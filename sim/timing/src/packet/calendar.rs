//! A shared resource as a calendar: how much of each stretch of time is taken, whoever asks first.

use crate::clock::Time;

/// Stretches of equal length, each with room for so much work. Packets ask in the order of the stream, not in that of time;
/// a stretch that one of them left free can be taken by another that comes later in the stream and earlier in time.
///
/// Work is counted in grains of one server, so that a server alone needs no division.
#[derive(Clone, Debug)]
pub(super) struct Calendar {
    /// Binary logarithm of the length of a stretch.
    shift: u32,
    servers: u64,
    /// Work that fits in a stretch.
    room: u64,
    used: Vec<u64>,
    /// For each stretch the first one from it on that may have room.
    free: Vec<u32>,
}

impl Calendar {
    /// Stretches of `length` grains or a little more, with so many servers.
    pub fn new(length: Time, servers: u32) -> Self {
        let length = length.next_power_of_two();
        let servers = u64::from(servers);
        Self {
            shift: length.trailing_zeros(),
            servers,
            room: length * servers,
            used: Vec::new(),
            free: Vec::new(),
        }
    }

    /// Does `work` from `at` on and says when it begins and when it is done.
    pub fn take(&mut self, at: Time, work: u64) -> (Time, Time) {
        let mut stretch = self.first_free((at >> self.shift) as usize);
        let begin = self.moment(stretch, at);
        let mut left = work;
        loop {
            let here = left.min(self.room - self.used[stretch]);
            self.used[stretch] += here;
            left -= here;
            if self.used[stretch] == self.room {
                self.free[stretch] = stretch as u32 + 1;
            }
            if left == 0 {
                let alone = begin + self.alone(work + self.servers - 1);
                return (begin, self.moment(stretch, at).max(alone));
            }
            stretch = self.first_free(stretch + 1);
        }
    }

    /// When the work put into a stretch so far is done, if none of it is done before `at`.
    fn moment(&self, stretch: usize, at: Time) -> Time {
        (((stretch as Time) << self.shift) + self.alone(self.used[stretch])).max(at)
    }

    /// How long all servers need for `work`.
    fn alone(&self, work: u64) -> Time {
        if self.servers == 1 { work } else { work / self.servers }
    }

    fn first_free(&mut self, from: usize) -> usize {
        self.reach(from);
        let mut at = from;
        while self.free[at] as usize != at {
            at = self.free[at] as usize;
            self.reach(at);
        }
        // Whoever comes this way again goes straight there.
        let mut passed = from;
        while passed != at {
            passed = std::mem::replace(&mut self.free[passed], at as u32) as usize;
        }
        at
    }

    fn reach(&mut self, stretch: usize) {
        let known = self.used.len();
        if stretch >= known {
            self.used.resize(stretch + 1, 0);
            self.free.extend(known as u32..=stretch as u32);
        }
    }

    /// How many work side by side.
    pub fn servers(&self) -> u64 {
        self.servers
    }

    /// Every stretch in which anything was done: from, to, work done and work that fits.
    pub fn stretches(&self) -> impl Iterator<Item = (Time, Time, u64, u64)> {
        let used = self.used.iter().zip(0..).filter(|(used, _)| **used > 0);
        used.map(|(&used, at): (&u64, Time)| (at << self.shift, (at + 1) << self.shift, used, self.room))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_fills_stretches_whoever_comes_first() {
        let mut calendar = Calendar::new(16, 1);
        assert_eq!(calendar.take(32, 16), (32, 48));
        // Earlier in time, later in the stream.
        assert_eq!(calendar.take(3, 4), (3, 7));
        assert_eq!(calendar.take(33, 2), (48, 50));
        // 12 fit before 16 is over, as far as the calendar knows; the next stretch is free, the one after full.
        assert_eq!(calendar.take(0, 30), (4, 52));
        assert_eq!(calendar.stretches().map(|(_, _, used, _)| used).sum::<u64>(), 52);
    }

    #[test]
    fn a_saturated_calendar_is_a_queue() {
        let mut calendar = Calendar::new(32, 2);
        let ends: Vec<_> = (0..40).map(|_| calendar.take(0, 4 * 3).1).collect();
        assert_eq!(*ends.last().unwrap(), 40 * 4 * 3 / 2);
        assert!(ends.windows(2).all(|pair| pair[1] > pair[0]));
    }
}
