//! Shader cores and texture units of the level `packet`.

use super::calendar::Calendar;
use super::calendar::QueueTimes;
use super::memory::Memory;
use super::station::aligned;
use super::{Span, Visit};
use crate::clock::{Clocks, Time};
use crate::demand::{DemandBuilder, Station, TEXTURE_PORT, share};
use crate::spec::MachineSpec;

/// Cycles per slot of the calendars.
const SLOT_CYCLES: u32 = 64;

/// Warps that are simulated together.
const WARPS_PER_CHUNK: u32 = 4;

/// Consecutive warps of a packet.
#[derive(Clone, Copy, Debug)]
struct Chunk {
    first: u32,
    count: u32,
    of: u32,
}

/// Times of a packet on the cores.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    /// When its first warp is sent.
    pub taken: Time,
    /// When its last warp is done.
    pub done: Time,
    /// When the packet leaves the cores.
    pub departed: Time,
    /// When the texture units work on it.
    pub texture: Span,
    /// When its lines pass the L2 and memory.
    pub memory: Span,
}

/// State of one kind of packets (vertices or pixels) on the cores. Packets of a kind leave in order.
#[derive(Clone, Debug)]
struct PacketFifo {
    sent: Time,
    departed: Time,
    flights: QueueTimes,
    /// Warp slots of the cores. Each kind has its own queue, as the times of the two kinds are not sorted
    /// together.
    slots: QueueTimes,
}

/// All cores and texture units.
#[derive(Clone, Debug)]
pub(super) struct Cores {
    fifos: [PacketFifo; 2],
    /// Warp launches, one per cycle.
    sends: Calendar,
    lanes: Calendar,
    period: Time,
    alu: Time,
    lanes_of_core: u32,
    warp_lanes: u32,
    texture_period: Time,
    texture_latency: Time,
    texture_free: Time,
    texture_departed: Time,
    next_texture_request: Time,
    texture_queue: QueueTimes,
    texture_behind: QueueTimes,
}

impl Cores {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let (spec, texture) = (&machine.shader, &machine.texture);
        let period = clocks.period(spec.clock);
        let texture_period = clocks.period(texture.clock);
        let slots = QueueTimes::new(spec.cores.get() * spec.warps.get());
        let fifo = PacketFifo { sent: 0, departed: 0, flights: QueueTimes::new(spec.in_flight.get()), slots };
        Self {
            fifos: [fifo.clone(), fifo],
            sends: Calendar::new(Time::from(SLOT_CYCLES) * period, 1),
            lanes: Calendar::new(Time::from(SLOT_CYCLES) * period, spec.cores.get() * spec.lanes.get()),
            period,
            alu: period * Time::from(spec.alu_latency_cycles),
            lanes_of_core: spec.lanes.get(),
            warp_lanes: spec.warp_lanes.get(),
            texture_period,
            texture_latency: texture_period * Time::from(texture.latency_cycles),
            texture_free: 0,
            texture_departed: 0,
            next_texture_request: 0,
            texture_queue: QueueTimes::new(texture.queue.get()),
            texture_behind: QueueTimes::new(texture.in_flight.get()),
        }
    }

    /// Calendar of the lanes.
    pub fn lanes(&self) -> &Calendar {
        &self.lanes
    }

    /// Simulate a packet of vertices or pixels.
    pub fn run(&mut self, visit: &Visit<'_>, builder: &DemandBuilder, memory: &mut Memory) -> Run {
        let demand = visit.demand;
        let kind = usize::from(visit.station == Station::Pixel);
        let warps = demand.warps(self.warp_lanes);
        let fifo = &mut self.fifos[kind];
        let taken = visit.arrive.max(fifo.sent).max(fifo.flights.room_at());
        let mut run = Run { taken, done: taken, departed: taken, texture: Span::NONE, memory: Span::NONE };
        let textured = kind == 1 && demand.is_textured();
        for first in (0..warps).step_by(WARPS_PER_CHUNK as usize) {
            let chunk = Chunk { first, count: WARPS_PER_CHUNK.min(warps - first), of: warps };
            let sent = self.send(kind, taken.max(self.fifos[kind].sent), chunk.count, textured);
            self.fifos[kind].sent = sent.to + self.period;
            let mut ready = Span { from: sent.from + self.period, to: sent.to + self.period };
            if textured {
                ready = self.texels(visit, &chunk, ready, builder, memory, &mut run);
            }
            let done = self.operate(visit, &chunk, ready);
            self.fifos[kind].slots.note_all(chunk.count, done.from, done.to);
            run.done = run.done.max(done.to);
        }
        let fifo = &mut self.fifos[kind];
        run.departed = aligned(run.done.max(fifo.departed).max(visit.room), self.period);
        fifo.departed = run.departed;
        fifo.flights.note(run.departed);
        run
    }

    /// Send warps, one per cycle, as slots on the cores and in front of the texture units become free.
    /// Returns when the first and the last warp are sent.
    fn send(&mut self, kind: usize, from: Time, warps: u32, textured: bool) -> Span {
        let room = |count| {
            let slots = self.fifos[kind].slots.room_for(count);
            slots.max(if textured { self.texture_queue.room_for(count) } else { 0 })
        };
        let (first, last) = (room(1), room(warps));
        let (begin, sent) = self.sends.reserve(from.max(first), u64::from(warps) * self.period);
        Span { from: begin, to: sent.saturating_sub(self.period).max(begin).max(last) }
    }

    /// Fetch the texels of some warps. Returns when the first and the last warp have their texels.
    fn texels(
        &mut self,
        visit: &Visit<'_>,
        chunk: &Chunk,
        sent: Span,
        builder: &DemandBuilder,
        memory: &mut Memory,
        run: &mut Run,
    ) -> Span {
        let demand = visit.demand;
        let cycles = |part: u32| {
            let texels = demand.texels.map(|whole| share(whole, part, chunk.of).len() as u32);
            self.texture_period * Time::from(builder.texture_cycles(texels))
        };
        let service: Time = (chunk.first..chunk.first + chunk.count).map(cycles).sum();
        let each = service / Time::from(chunk.count);
        let start = aligned(sent.from.max(self.texture_free), self.texture_period);
        let mut served = (start + service).max(sent.to + each);
        let busy_to = start + service;
        let all = demand.lines_of(TEXTURE_PORT);
        let part = |part: u32| share(all.len() as u32, part, chunk.of).start as usize;
        let base = all.start - demand.first_line;
        let range = base + part(chunk.first)..base + part(chunk.first + chunk.count);
        let mut arrived = 0;
        if !range.is_empty() {
            let fetched = memory.request(
                TEXTURE_PORT,
                &visit.lines[range],
                visit.turn,
                start.max(self.next_texture_request),
                self.texture_period,
            );
            self.next_texture_request = fetched.last_request + self.texture_period;
            served = served.max(fetched.last_request);
            arrived = fetched.arrived;
            run.memory = run.memory.with(fetched.first, fetched.moved);
        }
        served = served.max(self.texture_behind.room_for(chunk.count));
        let departed = served.max(arrived).max(self.texture_departed);
        self.texture_free = served;
        self.texture_departed = departed;
        self.texture_queue.note_all(
            chunk.count,
            start + self.period,
            served.saturating_sub(each).max(start) + self.period,
        );
        let first =
            (start + each).max(departed.saturating_sub(served.saturating_sub(start + each))).min(departed);
        self.texture_behind.note_all(chunk.count, first, departed);
        run.texture = run.texture.with(start, busy_to);
        Span { from: first + self.texture_latency, to: departed + self.texture_latency }
    }

    /// Run the operations of some warps, ready between `ready.from` and `ready.to`. Returns when the first and
    /// the last warp are done.
    fn operate(&mut self, visit: &Visit<'_>, chunk: &Chunk, ready: Span) -> Span {
        let demand = visit.demand;
        let part = |part: u32| share(demand.threads, part, chunk.of).start;
        let threads = part(chunk.first + chunk.count) - part(chunk.first);
        let operations = u64::from(threads) * u64::from(demand.ops);
        // A warp wider than a core takes several cycles per operation.
        let wide = Time::from(threads.div_ceil(chunk.count).div_ceil(self.lanes_of_core).saturating_sub(1))
            * self.period;
        let alone = Time::from(demand.ops.max(1)) * (self.alu + wide);
        let issued = match operations * self.period {
            0 => 0,
            work => self.lanes.reserve_as(visit.turn, ready.from, work).1,
        };
        let last = (ready.to + alone).max(issued + self.alu.saturating_sub(self.period));
        Span { from: last - (ready.to - ready.from).min(last - ready.from), to: last }
    }
}
