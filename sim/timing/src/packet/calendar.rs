//! Availability of shared resources at the level `packet`: calendars of time slots, and queues seen from their input.

use crate::clock::Time;

/// Cycles per slot of the calendars of the L2 and the levels below it.
pub(super) const SLOT_CYCLES: u32 = 8;

/// How a packet comes to shared resources.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    /// After the packets before it in the stream.
    InOrder,
    /// Packets before it in the stream are under way at the same time, and make room for it.
    Late,
}

/// Times in which nothing works: `length` from `first` on, and again every `interval`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pauses {
    pub first: Time,
    pub interval: Time,
    pub length: Time,
}

impl Pauses {
    /// The first time from `at` on that is in no pause.
    pub fn after(&self, at: Time) -> Time {
        let Some(since) = at.checked_sub(self.first) else { return at };
        at + self.length.saturating_sub(since % self.interval)
    }
}

/// Time slots of equal length, each with capacity for the same amount of work. Requests come in stream order,
/// not in time order. A request may use capacity before that of earlier requests.
///
/// Work is measured in grains of one server, so a single server needs no division.
#[derive(Clone, Debug)]
pub(super) struct Calendar {
    /// Slot length in grains, and its binary logarithm if it is a power of two.
    length: Time,
    shift: Option<u32>,
    servers: u64,
    /// Capacity of a slot.
    capacity: u64,
    used: Vec<u64>,
    /// The part of it that came late, and the part that is no work.
    shared: Vec<u64>,
    blocked: Vec<u64>,
    /// Those that are not yet taken from the slots.
    pauses: Option<Pauses>,
    yielded: Time,
    /// For each slot, a lower bound of the first slot from it on with free capacity (union-find with path
    /// compression).
    next_free: Vec<u32>,
}

impl Calendar {
    /// A calendar with slots of `length` grains, at least 1, for `servers` servers. How fine grains are,
    /// which clocks decide, does not change what fits in a slot.
    pub fn new(length: Time, servers: u32) -> Self {
        let servers = u64::from(servers);
        Self {
            length,
            shift: length.is_power_of_two().then(|| length.trailing_zeros()),
            servers,
            capacity: length * servers,
            used: Vec::new(),
            shared: Vec::new(),
            blocked: Vec::new(),
            pauses: None,
            yielded: 0,
            next_free: Vec::new(),
        }
    }

    /// The same with pauses.
    pub fn with_pauses(self, pauses: Option<Pauses>) -> Self {
        Self { pauses, ..self }
    }

    /// Reserve `work` from `at` on. Returns when it begins and ends.
    pub fn reserve(&mut self, at: Time, work: u64) -> (Time, Time) {
        let mut slot = self.find_free(self.slot_of(at));
        let begin = self.end_of_slot_work(slot, at);
        let mut remaining = work;
        loop {
            let here = remaining.min(self.capacity - self.used[slot]);
            self.used[slot] += here;
            remaining -= here;
            if self.used[slot] == self.capacity {
                self.next_free[slot] = slot as u32 + 1;
            }
            if remaining == 0 {
                let on_all_servers = begin + self.time_of(work);
                return (begin, self.end_of_slot_work(slot, at).max(on_all_servers));
            }
            slot = self.find_free(slot + 1);
        }
    }

    /// Capacity of a slot that is free.
    pub fn free(&mut self, slot: usize) -> u64 {
        self.reach(slot);
        self.capacity - self.used[slot]
    }

    /// Capacity of a slot.
    pub fn capacity(&self) -> u64 {
        self.capacity
    }

    /// Take so much capacity from `at` on, in which nothing works.
    pub fn block(&mut self, at: Time, capacity: u64) {
        let mut slot = self.find_free(self.slot_of(at));
        let mut remaining = capacity;
        while remaining > 0 {
            let here = remaining.min(self.capacity - self.used[slot]);
            self.blocked.resize(self.blocked.len().max(slot + 1), 0);
            self.blocked[slot] += here;
            self.used[slot] += here;
            remaining -= here;
            if self.used[slot] == self.capacity {
                self.next_free[slot] = slot as u32 + 1;
                slot = self.find_free(slot + 1);
            }
        }
    }

    /// Reserve `work` from `at` on, in order or in turn.
    pub fn reserve_as(&mut self, turn: Turn, at: Time, work: u64) -> (Time, Time) {
        match turn {
            Turn::InOrder => self.reserve(at, work),
            Turn::Late => self.share(at, work),
        }
    }

    /// Reserve `work` from `at` on in turn with what is reserved already: up to half of a full slot makes room and
    /// moves on to later slots.
    fn share(&mut self, at: Time, work: u64) -> (Time, Time) {
        let mut slot = self.slot_of(at);
        let (mut remaining, mut moved, mut begin) = (work, 0, None);
        loop {
            self.reach(slot);
            self.shared.resize(self.used.len(), 0);
            let free = self.capacity - self.used[slot];
            let blocked = self.blocked.get(slot).copied().unwrap_or(0);
            let half = ((self.capacity - blocked) / 2).saturating_sub(self.shared[slot]);
            let here = remaining.min(free.max(half));
            // In turn with as much other work, if there is any.
            let before = self.used[slot].min(2 * self.shared[slot]);
            let from = (self.start_of(slot) + self.on_all_servers(before)).max(at);
            let end = from + self.on_all_servers(if here > free { 2 * here } else { here });
            if here > 0 {
                begin.get_or_insert(from);
            }
            self.shared[slot] += here;
            self.used[slot] += here.min(free);
            moved += here - here.min(free);
            remaining -= here;
            if self.used[slot] == self.capacity {
                self.next_free[slot] = slot as u32 + 1;
            }
            if remaining == 0 {
                let begin = begin.unwrap_or(at);
                if moved > 0 {
                    self.yielded = self.yielded.max(self.reserve(self.start_of(slot + 1), moved).1);
                }
                return (begin, end.max(begin + self.time_of(work)));
            }
            slot += 1;
        }
    }

    /// When the last work that made room for other work ends; 0 if none did.
    pub fn yielded(&self) -> Time {
        self.yielded
    }

    /// When a slot begins.
    pub fn start_of(&self, slot: usize) -> Time {
        slot as Time * self.length
    }

    /// The slot at a time.
    pub fn slot_of(&self, at: Time) -> usize {
        self.shift.map_or_else(|| at / self.length, |shift| at >> shift) as usize
    }

    /// End of the work reserved in a slot so far, if none of it ends before `at`.
    pub fn end_of_slot_work(&self, slot: usize, at: Time) -> Time {
        (self.start_of(slot) + self.on_all_servers(self.used[slot])).max(at)
    }

    /// Least time of `work`, in whole grains.
    pub fn time_of(&self, work: u64) -> Time {
        self.on_all_servers(work + self.servers - 1)
    }

    /// Time of `work` on all servers.
    fn on_all_servers(&self, work: u64) -> Time {
        if self.servers == 1 { work } else { work / self.servers }
    }

    /// The first slot from `from` on with free capacity.
    pub fn find_free(&mut self, from: usize) -> usize {
        self.reach(from);
        let mut at = from;
        while self.next_free[at] as usize != at {
            at = self.next_free[at] as usize;
            self.reach(at);
        }
        // Path compression.
        let mut passed = from;
        while passed != at {
            passed = std::mem::replace(&mut self.next_free[passed], at as u32) as usize;
        }
        at
    }

    /// Make all slots up to this one.
    pub fn reach(&mut self, slot: usize) {
        let known = self.used.len();
        if slot >= known {
            self.used.resize(slot + 1, 0);
            self.next_free.extend(known as u32..=slot as u32);
            let end = self.start_of(slot + 1);
            if let Some(next) = self.pauses.filter(|next| next.first < end) {
                self.pauses = Some(self.pause(known, next));
            }
        }
    }

    /// Take the next pauses out of the capacity of the slots from `first` on, which are new.
    fn pause(&mut self, first: usize, mut next: Pauses) -> Pauses {
        let all = self.used.len();
        self.blocked.resize(all, 0);
        while next.first < self.start_of(all) {
            let end = next.first + next.length;
            for slot in self.slot_of(next.first).max(first)..all.min(self.slot_of(end - 1) + 1) {
                let (from, to) = (next.first.max(self.start_of(slot)), end.min(self.start_of(slot + 1)));
                self.blocked[slot] += to.saturating_sub(from) * self.servers;
                self.used[slot] = self.blocked[slot];
                if self.used[slot] == self.capacity {
                    self.next_free[slot] = slot as u32 + 1;
                }
            }
            if end > self.start_of(all) {
                break;
            }
            next.first += next.interval;
        }
        next
    }

    /// Number of servers.
    pub fn servers(&self) -> u64 {
        self.servers
    }

    /// Every slot with reserved work: start, end, work and capacity.
    pub fn slots(&self) -> impl Iterator<Item = (Time, Time, u64, u64)> {
        let blocked = self.blocked.iter().chain(std::iter::repeat(&0));
        let worked = self.used.iter().zip(blocked).map(|(used, blocked)| used - blocked).zip(0..);
        let worked = worked.filter(|(work, _)| *work > 0);
        worked.map(|(work, at)| (self.start_of(at), self.start_of(at + 1), work, self.capacity))
    }
}

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
    fn work_fills_slots_in_any_order() {
        let mut calendar = Calendar::new(16, 1);
        assert_eq!(calendar.reserve(32, 16), (32, 48));
        // Earlier in time, later in the stream.
        assert_eq!(calendar.reserve(3, 4), (3, 7));
        assert_eq!(calendar.reserve(33, 2), (48, 50));
        // Slot 0 has capacity for 12 more, slot 1 is free, slot 2 is full.
        assert_eq!(calendar.reserve(0, 30), (4, 52));
        assert_eq!(calendar.slots().map(|(_, _, used, _)| used).sum::<u64>(), 52);
    }

    #[test]
    fn late_work_takes_turns_with_what_is_there() {
        let mut calendar = Calendar::new(16, 1);
        assert_eq!(calendar.reserve(0, 64), (0, 64));
        // Half of two slots, and the other work ends later.
        assert_eq!(calendar.reserve_as(Turn::Late, 0, 16), (0, 32));
        assert_eq!(calendar.yielded(), 80);
        // Half of the next two; what is free is taken first.
        assert_eq!(calendar.reserve_as(Turn::Late, 32, 4), (32, 40));
        assert_eq!(calendar.reserve_as(Turn::Late, 90, 30), (90, 120));
        assert_eq!(calendar.slots().map(|(_, _, used, _)| used).sum::<u64>(), 64 + 16 + 4 + 30);
    }

    #[test]
    fn blocked_time_is_no_work() {
        let mut calendar = Calendar::new(16, 1);
        calendar.reserve(0, 10);
        calendar.block(4, 14);
        // Six of the first slot and eight of the second are blocked.
        assert_eq!(calendar.reserve(0, 20), (24, 44));
        let slots: Vec<_> = calendar.slots().map(|(from, _, work, _)| (from, work)).collect();
        assert_eq!(slots, [(0, 10), (16, 8), (32, 12)]);
    }

    #[test]
    fn pauses_take_their_time_from_all_slots() {
        let pauses = Pauses { first: 20, interval: 50, length: 25 };
        assert_eq!(
            [0, 19, 20, 44, 45, 69, 70, 100].map(|at| pauses.after(at)),
            [0, 19, 45, 45, 45, 69, 95, 100]
        );
        let mut calendar = Calendar::new(16, 1).with_pauses(Some(pauses));
        // 20 to 45, 70 to 95 and 120 to 145 are pauses.
        assert_eq!(calendar.reserve(0, 40), (0, 75));
        assert_eq!(calendar.reserve(60, 40), (75, 155));
        assert_eq!(calendar.slots().map(|(_, _, used, _)| used).sum::<u64>(), 80);
    }

    #[test]
    fn a_saturated_calendar_is_a_queue() {
        let mut calendar = Calendar::new(32, 2);
        let ends: Vec<_> = (0..40).map(|_| calendar.reserve(0, 4 * 3).1).collect();
        assert_eq!(*ends.last().unwrap(), 40 * 4 * 3 / 2);
        assert!(ends.windows(2).all(|pair| pair[1] > pair[0]));
    }

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
