//! Packets of pixels and groups on the cores. They come and leave in order. When one leaves depends on packets
//! that come later, as their warps share its lanes.

use std::collections::VecDeque;

use super::Span;
use super::sharing::{Place, Sharing, Warps};
use crate::clock::{Clocks, Time};
use crate::demand::ServiceDemand;
use crate::spec::MachineSpec;

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
        let steps = demand.steps();
        let operations = f64::from(demand.threads) * f64::from(demand.ops);
        let lanes = operations / f64::from(steps.max(1)) / f64::from(warps.max(1));
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
    /// The place of the last group, and those of the warps that are sent and have not begun.
    group: Option<Place>,
    sending: Vec<Place>,
    /// Warps of vertices that have not begun, by time.
    vertices: VecDeque<Vertices>,
    cores: Sharing,
}

/// Warps of vertices, which take slots and lanes, too.
#[derive(Clone, Copy, Debug)]
struct Vertices {
    from: f64,
    warps: Warps,
}

/// Most warps of vertices that wait for those of pixels to come as far in time.
const MAX_AHEAD: usize = 1 << 12;

impl Residents {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = &machine.shader;
        Self {
            packets: VecDeque::new(),
            departures: 0,
            departed: VecDeque::from(vec![0.0; spec.in_flight.get() as usize]),
            sent: 0.0,
            group: None,
            sending: Vec::new(),
            vertices: VecDeque::new(),
            cores: Sharing::new(spec, clocks.period(spec.clock)),
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
        while self.begin_vertices(self.sent.min(self.cores.next())) {}
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

    /// Take `count` slots of one core, no earlier than `from`. `None` if there are none and no warp is there to make
    /// room.
    fn take(&mut self, count: u32, from: f64) -> Option<Place> {
        let slots = self.cores.slots_for(count);
        loop {
            let place = self.cores.place(slots, from);
            if place.is_some_and(|place| place.at <= self.cores.next()) || !self.end_first(f64::INFINITY) {
                return place.inspect(|&place| self.cores.take(place, slots));
            }
        }
    }

    /// The `count` warps that have their slots have their data, the first and the last at `ready`.
    pub fn start(&mut self, count: u32, ready: Span) {
        let Some(&Resident { is_group, steps, lanes, .. }) = self.packets.back() else { return };
        let packet = self.departures + self.packets.len() - 1;
        let step = (ready.to - ready.from) / Time::from(count.max(2) - 1);
        let places = std::mem::take(&mut self.sending);
        let each = if is_group { count } else { 1 };
        for (&place, behind) in places.iter().zip((0..places.len() as Time).rev()) {
            let begin = (ready.to - step * behind) as f64;
            while self.end_next(begin) {}
            if lanes > 0.0 {
                self.cores.start(place, begin, &Warps { packet: Some(packet), count: each, steps, lanes });
            } else {
                let end = begin + self.cores.latency();
                self.cores.end(place, end, each);
                self.ended(packet, each, end);
            }
        }
        self.sending = places;
        self.sending.clear();
    }

    /// `count` warps of a packet of `warps` warps of vertices begin, the first and the last at `ready`.
    pub fn share(&mut self, demand: &ServiceDemand, warps: u32, count: u32, ready: Span) {
        let Resident { steps, lanes, .. } = Resident::new(demand, warps);
        for warp in 0..Time::from(count) {
            let from = (ready.from + (ready.to - ready.from) * warp / Time::from(count)) as f64;
            self.vertices.push_back(Vertices { from, warps: Warps { packet: None, count: 1, steps, lanes } });
        }
        while self.vertices.len() > MAX_AHEAD && self.end_next(f64::INFINITY) {}
    }

    /// Begin with the next warp of vertices if it comes no later than `to`, when or before which no warp ends.
    fn begin_vertices(&mut self, to: f64) -> bool {
        let Some(Vertices { from, warps }) = self.vertices.front().copied().filter(|first| first.from <= to)
        else {
            return false;
        };
        self.vertices.pop_front();
        if let Some(place) = self.take(1, from) {
            self.cores.start(place, from.max(place.at), &warps);
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
        self.begin_vertices(to.min(self.cores.next())) || self.end_first(to)
    }

    /// Serve until warps end, if no more begin. Returns whether some end no later than `to`.
    fn end_first(&mut self, to: f64) -> bool {
        let Some(ended) = self.cores.end_next(to) else { return false };
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
