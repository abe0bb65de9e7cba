//! Warp slots of the cores at the level `packet`.

use std::collections::VecDeque;

use super::Span;
use super::calendar::Turn;
use crate::clock::Time;

/// Slots by the time at which they become free, in order. Programs of unequal length free slots in another order
/// than they took them, so this is no queue.
#[derive(Clone, Debug, Default)]
pub(super) struct FreeSlots<T>(VecDeque<(T, u32)>);

impl<T: Copy + PartialOrd> FreeSlots<T> {
    /// When the first is free.
    pub fn next(&self) -> Option<T> {
        self.0.front().map(|(at, _)| *at)
    }

    /// When `count` are free, at least 1; `None` if there are fewer.
    pub fn room_for(&self, count: u32) -> Option<T> {
        let mut missing = count;
        self.0.iter().find_map(|&(at, slots)| {
            missing = missing.saturating_sub(slots);
            (missing == 0).then_some(at)
        })
    }

    /// Take up to `count` of those that are free first.
    pub fn take(&mut self, count: u32) {
        let mut missing = count;
        while let Some((_, slots)) = self.0.front_mut().filter(|_| missing > 0) {
            let taken = missing.min(*slots);
            *slots -= taken;
            missing -= taken;
            if *slots == 0 {
                self.0.pop_front();
            }
        }
    }

    /// Take all that are free by `at`. Returns how many.
    pub fn take_until(&mut self, at: T) -> u32 {
        let mut taken = 0;
        while let Some(&(_, slots)) = self.0.front().filter(|(free, _)| *free <= at) {
            taken += slots;
            self.0.pop_front();
        }
        taken
    }

    /// `count` more are free at `at`.
    pub fn give(&mut self, at: T, count: u32) {
        let after = self.0.partition_point(|(before, _)| *before <= at);
        match after.checked_sub(1).map(|last| &mut self.0[last]).filter(|(before, _)| *before == at) {
            Some((_, there)) => *there += count,
            None => self.0.insert(after, (at, count)),
        }
    }
}

/// Slots as warps see them that come in order. A warp takes the first that is free.
#[derive(Clone, Debug)]
pub(super) struct Slots {
    free: FreeSlots<Time>,
    count: u32,
}

impl Slots {
    /// `count` free slots, at least 1.
    pub fn new(count: u32) -> Self {
        let mut free = FreeSlots::default();
        free.give(0, count);
        Self { free, count }
    }

    /// When `warps` slots are free; if there are fewer, when all are.
    pub fn room_for(&self, warps: u32) -> Time {
        self.free.room_for(warps.min(self.count)).unwrap_or(0)
    }

    /// Let `warps` warps, at least 1, take the slots that become free first. The first of them is done at
    /// `from`, the last at `to`.
    pub fn hold(&mut self, warps: u32, from: Time, to: Time) {
        let warps_at_once = warps.min(self.count);
        self.free.take(warps_at_once);
        let step = to.saturating_sub(from) / Time::from(warps.max(2) - 1);
        if step == 0 {
            return self.free.give(to, warps_at_once);
        }
        (0..warps_at_once).for_each(|behind| self.free.give(to - step * Time::from(behind), 1));
    }
}

/// How much of the slots of the cores warps of both kinds hold over time. A warp holds one slot at a time, so
/// a long program does not keep others out of slots that it does not need.
#[derive(Clone, Debug)]
pub(super) struct Occupancy {
    /// Binary logarithm of the length of an interval.
    shift: u32,
    /// Slot time of an interval.
    capacity: u64,
    /// The part of it that is held, and of that what came late.
    held: Vec<u64>,
    late: Vec<u64>,
    yielded: Time,
}

impl Occupancy {
    /// No warp on `slots` slots, by intervals of at least `length`.
    pub fn new(slots: u32, length: Time) -> Self {
        let shift = length.next_power_of_two().trailing_zeros();
        Self { shift, capacity: u64::from(slots) << shift, held: Vec::new(), late: Vec::new(), yielded: 0 }
    }

    /// Let `warps` warps hold a slot each for a time `each` from `from` on. Returns when they have had it:
    /// later, if slots are taken. What comes late gets up to half of an interval, and what is there goes on
    /// later.
    pub fn hold(&mut self, turn: Turn, from: Time, warps: u32, each: Time) -> Time {
        let (mut at, mut missing, mut moved) = (from, u64::from(warps) * each, 0);
        while missing > 0 {
            let interval = (at >> self.shift) as usize;
            let end = (interval as Time + 1) << self.shift;
            self.reach(interval);
            let free = self.capacity - self.held[interval];
            let most = match turn {
                Turn::InOrder => free,
                Turn::Late => free.max((self.capacity / 2).saturating_sub(self.late[interval])),
            };
            let here = missing.min(u64::from(warps) * (end - at)).min(most);
            missing -= here;
            self.held[interval] += here.min(free);
            moved += here - here.min(free);
            if turn == Turn::Late {
                self.late[interval] += here;
            }
            at = if missing > 0 { end } else { at + here.div_ceil(u64::from(warps)) };
        }
        if moved > 0 {
            let warps = (self.capacity >> self.shift) as u32;
            let begin = ((from >> self.shift) + 1) << self.shift;
            let yielded = self.hold(Turn::InOrder, begin, warps, moved.div_ceil(warps.into()));
            self.yielded = self.yielded.max(yielded);
        }
        at
    }

    /// When the last work that made room for other work ends; 0 if none did.
    pub fn yielded(&self) -> Time {
        self.yielded
    }

    fn reach(&mut self, interval: usize) {
        if interval >= self.held.len() {
            self.held.resize(interval + 1, 0);
            self.late.resize(interval + 1, 0);
        }
    }
}

/// Most turns that are remembered: those of a pass beside which vertices of the next one run.
const MAX_TURNS: usize = 1 << 16;

/// Turns of warps at the slots. Where both kinds wait, their warps are sent alternately.
#[derive(Clone, Debug, Default)]
pub(super) struct Turns(VecDeque<Span>);

impl Turns {
    /// From `wait.from` on warps had to wait; at `wait.to` one was sent or could be, no earlier than at those before.
    pub fn note(&mut self, wait: Span) {
        if self.0.len() == MAX_TURNS {
            self.0.pop_front();
        }
        self.0.push_back(wait);
    }

    /// When a warp of the other kind is sent that waits since `came` and could be sent at `at`, both no
    /// earlier than for those before it: after those that wait already, were not sent before it came, and
    /// have not yet let one pass.
    pub fn after(&mut self, came: Time, at: Time) -> Time {
        while self.0.front().is_some_and(|wait| wait.to < came) {
            self.0.pop_front();
        }
        let Some(wait) = self.0.front().filter(|wait| wait.from <= at) else { return at };
        let sent = wait.to.max(at);
        self.0.pop_front();
        sent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warp_takes_the_slot_that_is_free_first() {
        let mut slots = Slots::new(2);
        slots.hold(1, 100, 100);
        for done in [10, 20, 30] {
            slots.hold(1, done, done);
            assert_eq!([1, 2].map(|warps| slots.room_for(warps)), [done, 100]);
        }
    }

    #[test]
    fn warps_of_a_packet_end_one_after_another() {
        let mut slots = Slots::new(4);
        slots.hold(3, 10, 20);
        assert_eq!([1, 2, 3, 4].map(|warps| slots.room_for(warps)), [0, 10, 15, 20]);
        // More warps than slots: the last ones keep them.
        slots.hold(5, 30, 50);
        assert_eq!([1, 2, 4, 9].map(|warps| slots.room_for(warps)), [35, 40, 50, 50]);
    }

    #[test]
    fn a_warp_holds_one_slot_however_long_it_is() {
        let mut cores = Occupancy::new(2, 16);
        assert_eq!(cores.hold(Turn::InOrder, 3, 1, 100), 103);
        // The other slot is free.
        assert_eq!(cores.hold(Turn::InOrder, 3, 1, 50), 53);
        // Both are taken until 53.
        assert!((53..=64).contains(&(cores.hold(Turn::InOrder, 40, 1, 10))));
    }

    #[test]
    fn late_warps_get_half_and_the_others_go_on_later() {
        let mut cores = Occupancy::new(4, 16);
        assert_eq!(cores.hold(Turn::InOrder, 0, 4, 64), 64);
        assert_eq!((cores.hold(Turn::Late, 0, 2, 32), cores.yielded()), (32, 80));
        // Half of the first two intervals is taken.
        assert_eq!(cores.hold(Turn::Late, 0, 1, 16), 48);
    }

    #[test]
    fn warps_of_two_kinds_that_wait_are_sent_alternately() {
        let mut turns = Turns::default();
        for (from, to) in [(0, 10), (10, 20), (20, 30), (25, 40), (70, 90)] {
            turns.note(Span { from, to });
        }
        // Those that wait since 5 go after one each. At 50 none waits.
        let mut at = 0;
        let found = [5, 5, 5, 5, 50, 80].map(|came| {
            at = turns.after(came, came.max(at));
            at
        });
        assert_eq!(found, [10, 20, 30, 40, 50, 90]);
    }
}
