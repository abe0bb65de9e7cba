//! The L2 as its ports see it, at the level `packet`: they take turns where they come at the same time.

use std::collections::VecDeque;

use super::calendar::{Calendar, Turn};
use crate::clock::Time;
use crate::demand::CLIENTS;

/// Slots whose ports are remembered, a power of two. Packets that are in the pipeline at the same time are
/// closer in time.
const REMEMBERED_SLOTS: usize = 1 << 12;

/// Work of each port in a slot.
#[derive(Clone, Copy, Debug)]
struct SlotPorts {
    slot: usize,
    work: [u64; CLIENTS.len()],
}

impl SlotPorts {
    const fn none(slot: usize) -> Self {
        Self { slot, work: [0; CLIENTS.len()] }
    }

    /// Number of ports that share the slot if `port` comes. All get the same part of it.
    fn sharing(&self, port: usize) -> u64 {
        let others = self.work.iter().enumerate().filter(|(other, work)| *other != port && **work > 0);
        1 + others.count() as u64
    }

    /// Takes up to `wanted` from the other ports that have most, and leaves each at least `part`. Returns how
    /// much of each.
    fn take(&mut self, port: usize, wanted: u64, part: u64) -> [u64; CLIENTS.len()] {
        let mut taken = [0; CLIENTS.len()];
        let mut missing = wanted;
        while missing > 0 {
            let others = self.work.iter_mut().enumerate().filter(|(other, _)| *other != port);
            let Some((other, most)) = others.max_by_key(|(_, work)| **work).filter(|(_, work)| **work > part)
            else {
                break;
            };
            let gives = (*most - part).min(missing);
            *most -= gives;
            taken[other] += gives;
            missing -= gives;
        }
        taken
    }
}

/// What a port has of a slot.
struct Shared {
    /// Its work in the slot.
    here: u64,
    /// Work of other ports that made room for it.
    moved: u64,
    /// Ports that take turns in the slot.
    ports: u64,
}

/// Work of a port that made room for others and waits in the queue of the port, which stays in order: all
/// that comes behind waits as long.
#[derive(Clone, Debug, Default)]
struct Lag {
    /// When each part of it is done, and its work.
    moved: VecDeque<(Time, u64)>,
    work: u64,
    /// Work for which the client could not go on, as the queue was full, and which it does not know yet.
    stalled: u64,
}

impl Lag {
    /// `work` at `at` is done at `end` only. The queue holds `room`.
    fn add(&mut self, at: Time, end: Time, work: u64, room: u64) {
        while let Some(&(_, work)) = self.moved.front().filter(|(done, _)| *done <= at) {
            self.work -= work;
            self.moved.pop_front();
        }
        let held = work.min(room.saturating_sub(self.work));
        self.stalled += work - held;
        self.work += held;
        self.moved.push_back((end, held));
    }
}

/// A calendar with ports that take turns.
///
/// Requests come in stream order. So those of a unit early in the pipeline come after those of a late unit at
/// the same time, which are of packets before theirs, and a calendar alone would serve the late unit first.
/// Here each port gets its part of a slot, and what was there before moves on to later slots. It waits in the
/// queue of its port; what does not fit there stalls the client.
#[derive(Clone, Debug)]
pub(super) struct Arbiter {
    calendar: Calendar,
    slots: Box<[SlotPorts]>,
    lags: [Lag; CLIENTS.len()],
    /// Work that the queue of a port holds.
    room: u64,
}

impl Arbiter {
    /// Ports of a calendar, each with a queue for so much work.
    pub fn new(calendar: Calendar, room: u64) -> Self {
        let slots = vec![SlotPorts::none(0); REMEMBERED_SLOTS].into();
        Self { calendar, slots, lags: Default::default(), room }
    }

    /// How long the client of a port could not go on since the last call.
    pub fn stalled(&mut self, port: usize) -> Time {
        self.calendar.time_of(std::mem::take(&mut self.lags[port].stalled))
    }

    /// The calendar of all ports.
    pub fn calendar(&self) -> &Calendar {
        &self.calendar
    }

    /// Reserve `work` for a port from `at` on. Returns when it begins and ends.
    pub fn reserve_as(&mut self, turn: Turn, port: usize, at: Time, work: u64) -> (Time, Time) {
        let first = self.calendar.slot_of(at);
        if turn == Turn::Late && self.has_forgotten(first) {
            return self.calendar.reserve_as(turn, at, work);
        }
        if self.calendar.free(first) >= work {
            self.ports(first).work[port] += work;
            return self.calendar.reserve(at, work);
        }
        let (mut slot, mut remaining, mut begin) = (first, work, None);
        loop {
            self.calendar.reach(slot);
            let before = self.calendar.end_of_slot_work(slot, at);
            let Shared { here, moved, ports } = self.share(slot, port, remaining);
            let (from, end) = match moved {
                0 => (before, self.calendar.end_of_slot_work(slot, at)),
                _ => {
                    let [from, next] = [slot, slot + 1].map(|slot| self.calendar.start_of(slot).max(at));
                    (from, next.min(from + self.calendar.time_of(here * ports)))
                }
            };
            if here > 0 {
                begin.get_or_insert(from);
            }
            remaining -= here;
            if remaining == 0 {
                let begin = begin.unwrap_or(at);
                return (begin, end.max(begin + self.calendar.time_of(work)));
            }
            slot += 1;
        }
    }

    /// Give a port as much of a slot as is free, or its part of it, up to `wanted`.
    fn share(&mut self, slot: usize, port: usize, wanted: u64) -> Shared {
        let free = self.calendar.free(slot).min(wanted);
        let capacity = self.calendar.capacity();
        let ports = self.ports(slot);
        let count = ports.sharing(port);
        let part = capacity / count;
        let more = part.saturating_sub(ports.work[port]).min(wanted).saturating_sub(free);
        let taken = ports.take(port, more, part);
        let moved = taken.iter().sum();
        ports.work[port] += free + moved;
        if free > 0 {
            self.calendar.reserve(self.calendar.start_of(slot), free);
        }
        for (port, work) in taken.into_iter().enumerate().filter(|(_, work)| *work > 0) {
            let end = self.append(port, slot + 1, work);
            self.lags[port].add(self.calendar.start_of(slot), end, work, self.room);
        }
        Shared { here: free + moved, moved, ports: count }
    }

    /// Whether the ports of a slot are no longer known.
    fn has_forgotten(&self, slot: usize) -> bool {
        self.slots[slot % REMEMBERED_SLOTS].slot > slot
    }

    /// Give a port free capacity of a slot and those after it. Returns when its work ends.
    fn append(&mut self, port: usize, first: usize, work: u64) -> Time {
        let (mut slot, mut remaining) = (first, work);
        loop {
            slot = self.calendar.find_free(slot);
            let here = self.calendar.free(slot).min(remaining);
            let end = self.calendar.reserve(self.calendar.start_of(slot), here).1;
            self.ports(slot).work[port] += here;
            remaining -= here;
            if remaining == 0 {
                return end;
            }
        }
    }

    fn ports(&mut self, slot: usize) -> &mut SlotPorts {
        let known = &mut self.slots[slot % REMEMBERED_SLOTS];
        if known.slot != slot {
            *known = SlotPorts::none(slot);
        }
        known
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arbiter() -> Arbiter {
        Arbiter::new(Calendar::new(8, 1), 4)
    }

    fn used(arbiter: &Arbiter) -> Vec<(Time, u64)> {
        arbiter.calendar.slots().map(|(from, _, work, _)| (from, work)).collect()
    }

    #[test]
    fn a_port_alone_has_the_calendar_for_itself() {
        let (mut ports, mut alone) = (arbiter(), Calendar::new(8, 1));
        for (at, work) in [(0, 3), (2, 8), (40, 30), (1, 5), (12, 9), (45, 8)] {
            assert_eq!(
                ports.reserve_as(Turn::InOrder, 2, at, work),
                alone.reserve(at, work),
                "{work} at {at}"
            );
        }
        assert_eq!(used(&ports), alone.slots().map(|(from, _, work, _)| (from, work)).collect::<Vec<_>>());
    }

    #[test]
    fn ports_that_come_at_the_same_time_take_turns() {
        let mut ports = arbiter();
        assert_eq!(ports.reserve_as(Turn::InOrder, 3, 0, 16), (0, 16));
        // Half of a slot that the other port had; four lines of that move on.
        assert_eq!(ports.reserve_as(Turn::InOrder, 1, 0, 4), (0, 8));
        assert_eq!(used(&ports), [(0, 8), (8, 8), (16, 4)]);
        // Its part of the first slot is used up. The next slots have half for each, one line after the other.
        assert_eq!(ports.reserve_as(Turn::InOrder, 1, 0, 2), (8, 12));
        // A third port has its part, which those with more give.
        assert_eq!(ports.reserve_as(Turn::InOrder, 2, 0, 3), (0, 11));
        assert_eq!(used(&ports).iter().map(|(_, work)| work).sum::<u64>(), 16 + 4 + 2 + 3);
    }

    #[test]
    fn moved_lines_keep_their_port() {
        let mut ports = arbiter();
        ports.reserve_as(Turn::Late, 0, 0, 24);
        // Half of each slot; four lines of the other port move to the next free slot each time.
        for slot in 0..3 {
            assert_eq!(ports.reserve_as(Turn::InOrder, 3, 8 * slot, 4), (8 * slot, 8 * slot + 8));
        }
        assert_eq!(used(&ports), [(0, 8), (8, 8), (16, 8), (24, 8), (32, 4)]);
        // So there they give half of it again.
        assert_eq!(ports.reserve_as(Turn::InOrder, 3, 24, 4), (24, 32));
    }

    #[test]
    fn late_lines_get_half_of_slots_whose_ports_are_forgotten() {
        let mut ports = arbiter();
        ports.reserve_as(Turn::InOrder, 3, 0, 8);
        ports.reserve_as(Turn::InOrder, 3, 8 * REMEMBERED_SLOTS as Time, 8);
        assert_eq!(ports.reserve_as(Turn::Late, 0, 0, 4), (0, 8));
        assert_eq!(ports.calendar.yielded(), 12);
    }

    #[test]
    fn a_client_stalls_for_what_the_queue_of_its_port_cannot_hold() {
        let mut ports = arbiter();
        ports.reserve_as(Turn::InOrder, 3, 0, 24);
        // Four lines wait in the queue until 28; so four more stall the client.
        let mut stalled_by = |at| {
            ports.reserve_as(Turn::InOrder, 1, at, 4);
            [3, 3].map(|port| ports.stalled(port))
        };
        assert_eq!([0, 8].map(&mut stalled_by), [[0, 0], [4, 0]]);
        // The queue is empty again.
        ports.reserve_as(Turn::InOrder, 3, 48, 8);
        ports.reserve_as(Turn::InOrder, 1, 48, 4);
        assert_eq!(ports.stalled(3), 0);
    }
}
