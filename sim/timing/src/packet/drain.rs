//! What the order of the calendars misses when the cores run empty.
//!
//! The lanes serve all warps in turn, so packets under way together end together: processor sharing
//! (Kleinrock 1967), with a speed limit, as a warp makes a step in no less than its latency. A calendar
//! serves them one after another. Both do the same work in the same time while packets come. When none comes
//! any more, the last ones of the lanes leave some of them idle, and the unit behind still has most of them
//! to do. So packets are served a second time here, in turn. Only the time of a drain comes from it.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

use super::Span;
use crate::clock::{Clocks, Time};
use crate::demand::{ServiceDemand, Station, time_of};
use crate::draws::Departure;
use crate::spec::MachineSpec;

/// A packet of pixels or a group on the cores.
#[derive(Clone, Copy, Debug)]
pub(super) struct OnCores {
    pub arrive: Time,
    /// How long its last warps wait for their data, and when the first and the last have them.
    pub data: Time,
    pub ready: Span,
    pub warps: u32,
    pub threads: u32,
    pub ops: u32,
    /// Operations one after another.
    pub steps: u32,
    /// Packets like it that have room on the cores at once.
    pub room: usize,
    /// Service in the unit behind, and its latency if the packet goes there.
    pub behind: Time,
    pub latency: Time,
}

/// The cores as they serve packets of pixels and groups in turn, since they were empty.
#[derive(Clone, Debug)]
pub(super) struct Drain {
    /// Packets that have not left, and the number of those that have.
    packets: VecDeque<InTurn>,
    departures: usize,
    /// The last packet; its time is not known.
    last: Option<Departure>,
    /// When the last warp is sent, when the last packet begins, when the last leaves the cores and when the
    /// unit behind.
    admitted: f64,
    sent: f64,
    started: f64,
    departed: f64,
    gone: f64,
    /// When the last has left the machine.
    last_end: f64,
    /// The least wait for data.
    least_data: Time,
    /// The longest program of a packet alone, and the longest service behind.
    longest: Time,
    longest_behind: Time,
    /// Free warp slots, by the time when they become free.
    slots: VecDeque<(f64, u32)>,
    now: f64,
    /// Steps so far of a packet that was there from the beginning.
    steps: f64,
    /// Lanes of a step of all active packets.
    lanes: f64,
    /// Active warps: the steps at which they end, in parts of [`PARTS`], the number of their packet, and how
    /// many there are.
    active: BinaryHeap<Reverse<(u64, usize, u32)>>,
    cores: CoreSizes,
}

/// Parts of a step.
const PARTS: f64 = 1024.0;

#[derive(Clone, Copy, Debug)]
struct InTurn {
    packet: OnCores,
    batch: u32,
    /// Warps not done, and when the last so far was.
    remaining: u32,
    done: f64,
}

#[derive(Clone, Copy, Debug)]
struct CoreSizes {
    in_flight: usize,
    period: Time,
    alu: Time,
    /// Time in which a warp is sent.
    send: f64,
    lanes: f64,
    lanes_of_core: u64,
    /// Latency of the cores and of the unit behind, and its cycle.
    latencies: [Time; 2],
    behind_period: Time,
}

impl Drain {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = &machine.shader;
        let period = clocks.period(spec.clock);
        let latency = |station: Station| {
            let common = machine.common(station.unit());
            clocks.period(common.clock) * Time::from(common.latency_cycles)
        };
        let cores = CoreSizes {
            in_flight: spec.in_flight.get() as usize,
            period,
            alu: period * Time::from(spec.alu_latency_cycles),
            send: period as f64 / f64::from(spec.warps_per_cycle),
            lanes: f64::from(spec.cores.get()) * f64::from(spec.lanes.get()),
            lanes_of_core: spec.lanes.get().into(),
            latencies: [Station::Pixel, Station::Colour].map(latency),
            behind_period: clocks.period(machine.common(Station::Colour.unit()).clock),
        };
        Self {
            packets: VecDeque::new(),
            departures: 0,
            last: None,
            admitted: 0.0,
            sent: 0.0,
            started: 0.0,
            departed: 0.0,
            gone: 0.0,
            last_end: 0.0,
            least_data: Time::MAX,
            longest: 0,
            longest_behind: 0,
            slots: VecDeque::from([(0.0, spec.cores.get() * spec.warps.get())]),
            now: 0.0,
            steps: 0.0,
            lanes: 0.0,
            active: BinaryHeap::new(),
            cores,
        }
    }

    /// Add the next packet.
    pub fn note(&mut self, demand: &ServiceDemand, mut packet: OnCores) {
        packet.behind = time_of(demand.service[Station::Colour as usize], self.cores.behind_period);
        packet.latency = if demand.last == Station::Colour { self.cores.latencies[1] } else { 0 };
        self.last = Some(Departure { pass: demand.pass, draw: demand.draw, batch: demand.batch, at: 0 });
        self.longest = self.longest.max(Time::from(packet.steps) * self.cores.alu);
        self.longest_behind = self.longest_behind.max(packet.behind);
        // Waits are longer where packets before it delay its lines; those come no later in turn.
        self.least_data = self.least_data.min(packet.data);
        self.sent = self.admits(packet.arrive, packet.room);
        self.packets.push_back(InTurn { packet, batch: demand.batch, remaining: packet.warps, done: 0.0 });
        let mut remaining = packet.warps;
        while remaining > 0
            && let Some(count) = self.send(remaining)
        {
            remaining -= count;
            self.start(&packet, count, remaining);
        }
        if packet.warps == 0 {
            // What has no warp, as a resolve, passes the cores without a step.
            self.start(&packet, 0, 0);
        }
    }

    /// Send up to `most` warps, a few a cycle, to slots that become free together. Returns their number;
    /// `None` if no warp is there to free a slot.
    fn send(&mut self, most: u32) -> Option<u32> {
        let free = self.slot()?;
        let (_, slots) = self.slots.front_mut()?;
        let count = most.min(*slots);
        *slots -= count;
        if *slots == 0 {
            self.slots.pop_front();
        }
        self.sent = self.sent.max(free) + f64::from(count) * self.cores.send;
        Some(count)
    }

    /// Begin with `warps` warps of the last packet, of which `remaining` remain.
    fn start(&mut self, packet: &OnCores, warps: u32, remaining: u32) {
        let Span { from, to } = packet.ready;
        let before = (to - from) / Time::from(packet.warps.max(2) - 1) * Time::from(remaining);
        let ready = (to - before) as f64;
        self.started = self.started.max(self.sent + self.least_data as f64).max(ready);
        self.advance(self.started);
        let number = self.departures + self.packets.len() - 1;
        let lanes = packet.lanes_of_warp() * f64::from(warps);
        if lanes > 0.0 {
            self.lanes += lanes;
            let ends = self.steps + f64::from(packet.steps);
            self.active.push(Reverse(((ends * PARTS).round() as u64, number, warps)));
        } else {
            self.ended(number, warps, self.started + if warps > 0 { self.cores.alu as f64 } else { 0.0 });
        }
    }

    /// Warps of a packet end at `at`.
    fn ended(&mut self, number: usize, warps: u32, at: f64) {
        let packet = &mut self.packets[number - self.departures];
        packet.remaining -= warps;
        packet.done = at;
        if warps > 0 {
            self.slots.push_back((at, warps));
        }
    }

    /// When the next packet, which arrives at `arrive`, has room on the cores. They have room for `room`
    /// packets like it.
    pub fn admits(&mut self, arrive: Time, room: usize) -> f64 {
        let mut admitted = self.sent.max(arrive as f64);
        let room = self.cores.in_flight.min(room);
        while !self.packets.is_empty() && self.packets.len() >= room {
            admitted = admitted.max(self.leave());
        }
        self.admitted = self.admitted.max(admitted).max(self.slot().unwrap_or(0.0));
        self.admitted
    }

    /// When the next free slot for a warp becomes free; `None` if no warp is there to free one.
    fn slot(&mut self) -> Option<f64> {
        while self.slots.is_empty() && self.end_next(f64::INFINITY) {}
        self.slots.front().map(|&(free, _)| free)
    }

    /// When the last packet of the batches up to `batch` has left; in the calendars they have at `calendar`.
    pub fn departs(&mut self, batch: u32, calendar: Time) -> Time {
        let most = calendar + self.longest + self.longest_behind * self.packets.len() as Time;
        if self.packets.front().is_none_or(|packet| packet.batch > batch) {
            return calendar;
        }
        while self.packets.front().is_some_and(|packet| packet.batch <= batch) {
            self.leave();
        }
        most.min(self.last_end as Time).max(calendar)
    }

    /// When the last packet has left, if none comes any more; `None` if there was none. In the calendars they
    /// have left at `calendar`.
    ///
    /// Lanes are never idle while a packet waits for them, in either order. So no more is lost than the
    /// program of a packet, and the work behind of those under way.
    pub fn end(&mut self, calendar: Time) -> Option<Departure> {
        let most = calendar + self.longest + self.longest_behind * self.packets.len() as Time;
        while !self.packets.is_empty() {
            self.leave();
        }
        (self.steps, self.lanes, self.least_data) = (0.0, 0.0, Time::MAX);
        (self.longest, self.longest_behind) = (0, 0);
        self.last.take().map(|last| Departure { at: most.min(self.last_end as Time), ..last })
    }

    /// Let the oldest packet leave. Returns when it leaves the cores.
    fn leave(&mut self) -> f64 {
        while self.packets.front().is_some_and(|packet| packet.remaining > 0) && self.end_next(f64::INFINITY)
        {
        }
        let Some(InTurn { packet, done, .. }) = self.packets.pop_front() else { return self.departed };
        self.departures += 1;
        self.departed = self.departed.max(done);
        let arrived = self.departed + self.cores.latencies[0] as f64;
        self.gone = self.gone.max(arrived) + packet.behind as f64;
        self.last_end = self.last_end.max(self.gone + packet.latency as f64);
        self.departed
    }

    /// Serve until `to`.
    fn advance(&mut self, to: f64) {
        while self.now < to && self.end_next(to) {}
        self.now = self.now.max(to);
    }

    /// Serve until warps end, or until `to`. Returns whether some ended.
    fn end_next(&mut self, to: f64) -> bool {
        let Some(&Reverse((ends, number, warps))) = self.active.peek() else { return false };
        let packet = self.packets[number - self.departures].packet;
        let ends = ends as f64 / PARTS;
        let step = self.cores.step(self.lanes, &packet);
        let until = self.now + (ends - self.steps).max(0.0) * step;
        if to < until {
            self.steps += (to - self.now) / step;
            self.now = to;
            return false;
        }
        (self.steps, self.now) = (self.steps.max(ends), until);
        self.active.pop();
        self.lanes -= packet.lanes_of_warp() * f64::from(warps);
        self.ended(number, warps, until);
        true
    }
}

impl CoreSizes {
    /// Time of a step of all warps, of which `lanes` lanes are active and those of `packet` end first.
    fn step(&self, lanes: f64, packet: &OnCores) -> f64 {
        let of_warp = packet.lanes_of_warp().ceil() as u64;
        let wide = of_warp.div_ceil(self.lanes_of_core).saturating_sub(1) * self.period;
        (lanes * self.period as f64 / self.lanes).max((self.alu + wide) as f64)
    }
}

impl OnCores {
    /// Lanes of a step of a warp.
    fn lanes_of_warp(&self) -> f64 {
        f64::from(self.threads) * f64::from(self.ops) / f64::from(self.steps.max(1) * self.warps.max(1))
    }
}
