//! Packets of pixels and groups on the cores. They come and leave in order. When one leaves depends on packets
//! that come later, as their warps share its lanes.

use std::collections::VecDeque;

use super::Span;
use super::shared_cores::{Place, SharedCores, Warps};
use crate::clock::Time;
use crate::demand::ServiceDemand;
use crate::spec::ShaderSpec;

/// A packet on the cores.
#[derive(Clone, Copy, Debug)]
struct Resident {
    warps: u32,
    is_group: bool,
    /// Steps of each warp, one after another, and its lanes in a step.
    steps: u32,
    lanes: f64,
    /// Warps not done, and when the last so far was.
    remaining: u32,
    done: f64,
}

impl Resident {
    fn new(demand: &ServiceDemand, warps: u32) -> Self {
        // A warp without operations is on a core as long as one with one.
        let steps = demand.steps().max(1);
        let operations = f64::from(demand.threads) * f64::from(demand.ops);
        let lanes = operations / f64::from(steps) / f64::from(warps.max(1));
        Self { warps, is_group: demand.group.is_some(), steps, lanes, remaining: warps, done: 0.0 }
    }
}

/// All packets of pixels and groups on the cores.
#[derive(Clone, Debug)]
pub(super) struct Residents {
    packets: VecDeque<Resident>,
    /// Packets that have left, and when the latest did, as many as can be there.
    departures: usize,
    departed: VecDeque<f64>,
    /// No warp is sent before.
    sent: f64,
    /// When no slot is free after the last warps took theirs, and when none was before the last [`Self::send`].
    full: Option<Span>,
    was_full: Option<Span>,
    /// The place of the last group, and those of the warps that are sent and have not begun.
    group: Option<Place>,
    sending: Vec<Place>,
    /// Warps of vertices that have not begun, by time.
    vertices: VecDeque<WaitingVertices>,
    cores: SharedCores,
}

/// Warps of vertices, which take slots and lanes, too.
#[derive(Clone, Copy, Debug)]
struct WaitingVertices {
    from: f64,
    warps: Warps,
}

/// Most warps of vertices that wait for those of pixels to come as far in time.
const MAX_AHEAD: usize = 1 << 12;

impl Residents {
    /// Cores of `spec`, with cycles of `period`.
    pub fn new(spec: &ShaderSpec, period: Time) -> Self {
        Self {
            packets: VecDeque::new(),
            departures: 0,
            departed: VecDeque::from(vec![0.0; spec.in_flight.get() as usize]),
            sent: 0.0,
            full: None,
            was_full: None,
            group: None,
            sending: Vec::new(),
            vertices: VecDeque::new(),
            cores: SharedCores::new(spec, period),
        }
    }

    /// When there is room for another packet, if there is for `most`. `None` if one has to leave before.
    pub fn room(&self, most: usize) -> Option<Time> {
        let most = most.min(self.departed.len());
        let latest = most.checked_sub(self.packets.len()).filter(|&latest| latest > 0)?;
        Some(self.departed[self.departed.len() - latest].round() as Time)
    }

    /// Whether all warps of the oldest packet are known to be done.
    pub fn oldest_is_done(&self) -> bool {
        self.packets.front().is_some_and(|packet| packet.remaining == 0)
    }

    /// Add the next packet, of `warps` warps. They are sent next.
    pub fn enter(&mut self, demand: &ServiceDemand, warps: u32) {
        self.packets.push_back(Resident::new(demand, warps));
        self.group = None;
    }

    /// Let up to `count` of the next warps of the last packet have their slots, no earlier than `from`. Returns
    /// how many have theirs before one of them has to end, at least one, and when those of the first and of the
    /// last are free. A group has the slots of all its warps at once.
    pub fn send(&mut self, count: u32, from: Time) -> (u32, Span) {
        self.sent = self.sent.max(from as f64);
        self.was_full = None;
        while self.begin_vertices(self.sent.min(self.cores.next_end())) {}
        let at = |place: &Place| (place.at.round() as Time).max(from);
        if let Some(group) = self.packets.back().filter(|last| last.is_group) {
            let warps = group.warps;
            self.group = self.group.or_else(|| self.take(warps, self.sent));
            self.sending.extend(self.group);
        } else {
            while (self.sending.len() as u32) < count
                && let Some(place) = self.take(1, self.sent)
            {
                self.sending.push(place);
            }
        }
        let first = self.sending.first().map_or(from, at);
        let span = Span { from: first, to: self.sending.last().map_or(first, at).max(first) };
        (if self.group.is_some() { count } else { (self.sending.len() as u32).max(1) }, span)
    }

    /// From when to when no slot was free before the last [`Self::send`], if warps before had taken all.
    pub fn was_full(&self) -> Option<Span> {
        self.was_full
    }

    /// Take `count` slots of one core, no earlier than `from`. `None` if there are none and no warp is there to make
    /// room.
    fn take(&mut self, count: u32, from: f64) -> Option<Place> {
        let slots = self.cores.slots_for(count);
        loop {
            let place = self.cores.place(slots, from);
            if place.is_some_and(|place| place.at <= self.cores.next_end()) || !self.end_first(f64::INFINITY)
            {
                return place.inspect(|&place| self.fill(place, slots));
            }
        }
    }

    /// Take slots at a place, and see whether these were the last.
    fn fill(&mut self, place: Place, slots: u32) {
        self.cores.take(place, slots);
        self.was_full = self.was_full.or(self.full);
        let until = self.cores.full_until(place.at);
        self.full = until.map(|until| Span { from: place.at.round() as Time, to: until.round() as Time });
    }

    /// The `count` warps that have their slots have their data, the first and the last at `ready`.
    pub fn start(&mut self, count: u32, ready: Span) {
        let Some(&Resident { is_group, steps, lanes, .. }) = self.packets.back() else { return };
        let packet = self.departures + self.packets.len() - 1;
        let places = std::mem::take(&mut self.sending);
        let each = if is_group { count } else { 1 };
        for (&place, warp) in places.iter().zip(0..) {
            let begin = if is_group { ready.to } else { ready.spread(warp, count) } as f64;
            while self.end_next(begin) {}
            self.cores.start(place, begin, &Warps { packet: Some(packet), count: each, steps, lanes });
        }
        self.sending = places;
        self.sending.clear();
    }

    /// `count` warps of a packet of `warps` warps of vertices begin, the first and the last at `ready`.
    pub fn start_vertices(&mut self, demand: &ServiceDemand, warps: u32, count: u32, ready: Span) {
        let Resident { steps, lanes, .. } = Resident::new(demand, warps);
        let warps = Warps { packet: None, count: 1, steps, lanes };
        for warp in 0..count {
            self.vertices.push_back(WaitingVertices { from: ready.spread(warp, count) as f64, warps });
        }
        while self.vertices.len() > MAX_AHEAD && self.end_next(f64::INFINITY) {}
    }

    /// Begin the next warp of vertices that waits, if it is ready by `to`. No warp may end before `to`. One that
    /// finds no free slot is left out: it would wait here and in the slots of vertices.
    fn begin_vertices(&mut self, to: f64) -> bool {
        let Some(WaitingVertices { from, warps }) =
            self.vertices.front().copied().filter(|first| first.from <= to)
        else {
            return false;
        };
        self.vertices.pop_front();
        if let Some(place) = self.cores.place(1, from).filter(|place| place.at <= from) {
            self.cores.take(place, 1);
            self.cores.start(place, from, &warps);
        }
        true
    }

    /// The last packet is done no earlier than `at`.
    pub fn done_after(&mut self, at: Time) {
        if let Some(last) = self.packets.back_mut() {
            last.done = last.done.max(at as f64);
        }
    }

    /// Let the oldest packet leave, for which there is room from `room` on. Returns when it does.
    pub fn leave(&mut self, room: Time) -> Time {
        while self.packets.front().is_some_and(|packet| packet.remaining > 0) && self.end_next(f64::INFINITY)
        {
        }
        let done = self.packets.pop_front().map_or(0.0, |packet| packet.done);
        let before = self.departed.back().copied().unwrap_or(0.0);
        let at = before.max(done).max(room as f64);
        self.departures += 1;
        self.departed.pop_front();
        self.departed.push_back(at);
        at.round() as Time
    }

    /// Serve until warps begin or end. Returns whether some do no later than `to`.
    fn end_next(&mut self, to: f64) -> bool {
        self.begin_vertices(to.min(self.cores.next_end())) || self.end_first(to)
    }

    /// Serve until warps end, if no more begin. Returns whether some end no later than `to`.
    fn end_first(&mut self, to: f64) -> bool {
        let Some(ended) = self.cores.end_next(to) else { return false };
        if let Some(full) = &mut self.full {
            full.to = full.to.min(ended.at.round() as Time);
        }
        if let Some(packet) = ended.packet {
            self.ended(packet, ended.count, ended.at);
        }
        true
    }

    /// Warps of a packet end at `at`.
    fn ended(&mut self, number: usize, warps: u32, at: f64) {
        let packet = &mut self.packets[number - self.departures];
        packet.remaining -= warps;
        packet.done = packet.done.max(at);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::demand::{CLIENTS, GroupDemand, Station};
    use crate::spec::DATA_EVENTS;

    /// One core with four lanes and four slots, for three packets. An operation takes two cycles or more.
    fn residents() -> Residents {
        let spec = "(latency_cycles: 1, queue: 8, in_flight: 3, cores: 1, lanes: 4, warp_lanes: 4, warps: 4, \
                    alu_latency_cycles: 2, shared_bytes: 1024)";
        Residents::new(&activity::spec::parse(spec, "test").unwrap(), 1)
    }

    fn demand(threads: u32, ops: u32, group: Option<GroupDemand>) -> ServiceDemand {
        ServiceDemand {
            front: false,
            pass: 0,
            draw: 0,
            batch: 0,
            barrier: None,
            last: Station::Pixel,
            service: [0; Station::COUNT],
            threads,
            ops,
            data: [0; DATA_EVENTS],
            group,
            first_line: 0,
            lines: [0; CLIENTS.len()],
        }
    }

    /// Send all warps from `from` on; they begin at once.
    fn add(residents: &mut Residents, demand: &ServiceDemand, from: Time) -> Vec<Span> {
        let warps = demand.warps(4);
        residents.enter(demand, warps);
        let (mut sent, mut spans) = (0, Vec::new());
        while sent < warps {
            let (count, span) = residents.send(warps - sent, from);
            residents.start(count, span);
            sent += count;
            spans.push(span);
        }
        spans
    }

    #[test]
    fn packets_leave_in_order_and_make_room() {
        let mut residents = residents();
        assert_eq!(residents.room(usize::MAX), Some(0));
        // The first takes longest, and both others wait for it. One without operations takes a step.
        for ops in [10, 1, 0] {
            add(&mut residents, &demand(4, ops, None), 0);
        }
        assert_eq!((residents.room(usize::MAX), residents.oldest_is_done()), (None, false));
        assert_eq!(residents.leave(0), 20);
        assert!(residents.oldest_is_done());
        assert_eq!(residents.leave(33), 33);
        assert_eq!(residents.leave(0), 33);
        assert_eq!((residents.room(usize::MAX), residents.room(1)), (Some(20), Some(33)));
    }

    #[test]
    fn a_group_waits_for_the_slots_of_all_its_warps() {
        let mut residents = residents();
        add(&mut residents, &demand(12, 10, None), 0);
        let group = GroupDemand { steps: 5, shared_bytes: 0 };
        // Three full warps take three cycles per operation. One slot is free, and the group needs two.
        let spans = add(&mut residents, &demand(8, 5, Some(group)), 4);
        assert_eq!((spans[0].from, spans[0].to), (30, 30));
        assert_eq!([residents.leave(0), residents.leave(0)], [30, 40]);
    }

    #[test]
    fn no_slot_is_free_until_a_warp_ends_whenever_the_next_one_comes() {
        let mut residents = residents();
        add(&mut residents, &demand(16, 10, None), 5);
        assert_eq!(residents.was_full().map(|full| (full.from, full.to)), None);
        // Four full warps take four cycles per operation.
        add(&mut residents, &demand(4, 1, None), 99);
        assert_eq!(residents.was_full().map(|full| (full.from, full.to)), Some((5, 45)));
        // Three slots are free after that.
        add(&mut residents, &demand(4, 1, None), 99);
        assert_eq!(residents.was_full().map(|full| (full.from, full.to)), None);
    }

    #[test]
    fn vertices_take_lanes_from_pixels_once_these_have_come_as_far() {
        let mut residents = residents();
        let vertices = demand(12, 10, None);
        residents.start_vertices(&vertices, 3, 3, Span { from: 100, to: 100 });
        add(&mut residents, &demand(4, 10, None), 0);
        assert_eq!(residents.leave(0), 20);
        // Four full warps from 100 on.
        add(&mut residents, &demand(4, 10, None), 100);
        assert_eq!(residents.leave(0), 140);
    }
}
