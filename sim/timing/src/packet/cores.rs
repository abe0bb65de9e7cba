//! Shader cores and data units of the level `packet`.
//!
//! Vertices end by the calendar of all lanes and the slots as they see them. Pixels and groups end when their core
//! has served them in turn ([`Residents`]), and no earlier than by the calendar. Both kinds are in both.

use super::calendar::{Calendar, QueueTimes};
use super::memory::Memory;
use super::residents::Residents;
use super::slots::{Occupancy, Slots, Turns};
use super::station::{ClientWork, Service};
use super::{Span, Visit};
use crate::clock::{Clocks, Time, aligned};
use crate::demand::{CYCLE, DemandBuilder, Server, ServiceDemand, Station, WarpKind, Work, share, time_of};
use crate::spec::{DataUnit, MachineSpec};

/// Cycles per slot of the calendars.
const SLOT_CYCLES: u32 = 64;

/// Operations of a warp, one after another, in an interval of the slots.
const OPERATIONS_PER_INTERVAL: Time = 32;

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
    /// When a packet of vertices leaves the cores; `None` for others, which [`Cores::leave`] knows.
    pub departed: Option<Time>,
    /// When its data unit works on it, from the first cycle to the last.
    pub data: Option<Service>,
    /// When its lines pass the L2 and memory.
    pub memory: Span,
}

impl Run {
    /// Record the service of some of its warps by their data unit.
    fn note_data(&mut self, service: Service) {
        let Some(before) = &mut self.data else {
            self.data = Some(service);
            return;
        };
        (before.to, before.used[1]) = (service.to, service.used[1]);
        before.work += service.work;
    }
}

/// Sending of the warps of one kind: when the next may be sent, and how many of
/// that cycle have been.
#[derive(Clone, Debug, Default)]
struct Sender {
    sent: Time,
    server: Server,
}

/// Packets of vertices on the cores. They leave in order.
#[derive(Clone, Debug)]
struct VertexQueue {
    departed: Time,
    flights: QueueTimes,
    /// Warp slots as warps of vertices see them, in the order of the stream.
    slots: Slots,
}

/// A data unit, which serves warps in order.
#[derive(Clone, Debug)]
struct DataState {
    unit: DataUnit,
    period: Time,
    latency: Time,
    client: ClientWork,
    free: Time,
    departed: Time,
    server: Server,
    queue: QueueTimes,
    behind: QueueTimes,
}

impl DataState {
    fn new(machine: &MachineSpec, clocks: &Clocks, unit: DataUnit) -> Self {
        let common = machine.common(unit.unit());
        let period = clocks.period(common.clock);
        Self {
            unit,
            period,
            latency: period * Time::from(common.latency_cycles),
            client: ClientWork::new(common.lines_per_cycle),
            free: 0,
            departed: 0,
            server: Server::default(),
            queue: QueueTimes::new(common.queue),
            behind: QueueTimes::new(common.in_flight),
        }
    }
}

/// All cores and data units.
#[derive(Clone, Debug)]
pub(super) struct Cores {
    senders: [Sender; WarpKind::ALL.len()],
    vertices: VertexQueue,
    residents: Residents,
    /// Warps sent, and the part of a cycle that one takes.
    sends: Calendar,
    send_work: Work,
    lanes: Calendar,
    /// How both kinds share the warp slots.
    occupancy: Occupancy,
    /// Turns of pixels and groups at the slots, for vertices that wait beside them.
    turns: Turns,
    cores: u32,
    period: Time,
    alu: Time,
    lanes_of_core: u32,
    warp_lanes: u32,
    machine: MachineSpec,
    data: [DataState; DataUnit::ALL.len()],
}

impl Cores {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = &machine.shader;
        let period = clocks.period(spec.clock);
        let alu = period * Time::from(spec.alu_latency_cycles);
        let slots = Slots::new(spec.cores.get() * spec.warps.get());
        Self {
            senders: Default::default(),
            vertices: VertexQueue { departed: 0, flights: QueueTimes::new(spec.in_flight.get()), slots },
            residents: Residents::new(spec, period),
            sends: Calendar::new(Time::from(SLOT_CYCLES) * period, spec.warps_per_cycle.get()),
            send_work: CYCLE.div_ceil(spec.warps_per_cycle.get().into()),
            lanes: Calendar::new(Time::from(SLOT_CYCLES) * period, spec.cores.get() * spec.lanes.get()),
            occupancy: Occupancy::new(spec.cores.get() * spec.warps.get(), OPERATIONS_PER_INTERVAL * alu),
            turns: Turns::default(),
            cores: spec.cores.get(),
            period,
            alu,
            machine: machine.clone(),
            lanes_of_core: spec.lanes.get(),
            warp_lanes: spec.warp_lanes.get(),
            data: DataUnit::ALL.map(|unit| DataState::new(machine, clocks, unit)),
        }
    }

    /// Calendar of the lanes.
    pub fn lanes(&self) -> &Calendar {
        &self.lanes
    }

    /// When the last work that made room for other work ends.
    pub fn yielded(&self) -> Time {
        self.lanes.yielded().max(self.occupancy.yielded())
    }

    /// When a packet of pixels or a group that comes at `arrive` is taken, and when there is room for it. `None`
    /// if the oldest one has to leave before.
    ///
    /// Groups need room but for their warps; all groups under way are taken to need as much.
    pub fn admits(&self, demand: &ServiceDemand, arrive: Time) -> Option<(Time, Time)> {
        let align = |at| aligned(at, self.period);
        let taken = arrive.max(align(self.residents.room(usize::MAX)?));
        let Some(group) = demand.group else { return Some((taken, taken)) };
        let warps = demand.warps(self.warp_lanes);
        let per_core = self.machine.groups_per_core(warps, group.shared_bytes).max(1);
        let room = self.residents.room((self.cores * per_core) as usize)?;
        Some((taken, taken.max(align(room))))
    }

    /// Whether it is known when the oldest packet of pixels or groups is done.
    pub fn oldest_is_done(&self) -> bool {
        self.residents.oldest_is_done()
    }

    /// Let the oldest packet of pixels or groups leave, for which the next unit has room from `room` on. Returns
    /// when it does.
    pub fn leave(&mut self, room: Time) -> Time {
        aligned(self.residents.leave(room), self.period)
    }

    /// Simulate a packet of vertices or pixels, or a group. Vertices leave at the time that this returns, others
    /// when [`Self::leave`] says so.
    pub fn run(&mut self, visit: &Visit<'_>, builder: &DemandBuilder, memory: &mut Memory) -> Run {
        let demand = visit.demand;
        let is_pixel = visit.station == Station::Pixel;
        let kind = if is_pixel { WarpKind::Pixels } else { WarpKind::Vertices };
        let warps = demand.warps(self.warp_lanes);
        let came = if is_pixel { visit.arrive } else { visit.arrive.max(self.vertices.flights.room_at()) };
        let taken = came.max(self.senders[kind as usize].sent);
        let mut room = taken;
        if is_pixel {
            room = taken.max(visit.room);
            self.residents.enter(demand, warps);
        }
        let mut run = Run { taken, done: taken, departed: None, data: None, memory: Span::NONE };
        let data_unit = (is_pixel && demand.uses_data()).then(|| demand.data_unit());
        let mut first = 0;
        while first < warps {
            let from = room.max(self.senders[kind as usize].sent);
            let (chunk, from, slots) =
                self.next(visit, Chunk { first, count: warps - first, of: warps }, came, from);
            let sent = self.send(kind, from, chunk.count, slots, data_unit);
            if is_pixel {
                self.note_turns(&chunk, came, sent);
            }
            let mut ready = Span { from: sent.from + self.period, to: sent.to + self.period };
            if data_unit.is_some() {
                ready = self.data(visit, &chunk, ready, builder, memory, &mut run);
            }
            let done = self.operate(visit, &chunk, sent.from, ready);
            match kind {
                WarpKind::Vertices => {
                    self.vertices.slots.hold(chunk.count, done.from, done.to);
                    self.residents.start_vertices(demand, warps, chunk.count, ready);
                }
                WarpKind::Pixels => self.residents.start(chunk.count, ready),
            }
            run.done = run.done.max(done.to);
            first += chunk.count;
        }
        if is_pixel {
            self.residents.done_after(run.done);
            return run;
        }
        let vertices = &mut self.vertices;
        let departed = aligned(run.done.max(vertices.departed).max(visit.room), self.period);
        vertices.departed = departed;
        vertices.flights.note(departed);
        run.departed = Some(departed);
        run
    }

    /// The next warps of those of `rest` that are sent together, from when on, and when the first and the last
    /// have slots. They come at `came`, and those before them are sent by `from`.
    fn next(&mut self, visit: &Visit<'_>, rest: Chunk, came: Time, from: Time) -> (Chunk, Time, Span) {
        let count = WARPS_PER_CHUNK.min(rest.count);
        if visit.station == Station::Pixel {
            let (count, slots) = self.residents.send(count, from);
            return (Chunk { count, ..rest }, from, slots);
        }
        let from = (0..count).fold(from, |at, _| self.turns.after(came, at));
        let free = &self.vertices.slots;
        (Chunk { count, ..rest }, from, Span { from: free.room_for(1), to: free.room_for(count) })
    }

    /// Record that warps of pixels or a group came at `came` and were sent at `sent`. Vertices wait for a slot as
    /// well when none of these does: groups come one by one as others leave if they fill all slots.
    fn note_turns(&mut self, chunk: &Chunk, came: Time, sent: Span) {
        let mut from = came;
        match self.residents.was_full() {
            Some(full) if came <= full.to => from = came.min(full.from),
            Some(full) => self.turns.note(full),
            None => {}
        }
        for warp in 0..chunk.count {
            let to = sent.spread(warp, chunk.count);
            if from < to {
                self.turns.note(Span { from, to });
            }
        }
    }

    /// Send warps, as many in a cycle as the machine can, as slots on the cores and in front of the data unit
    /// become free. Returns when the first and the last warp are sent.
    fn send(&mut self, kind: WarpKind, from: Time, warps: u32, slots: Span, unit: Option<DataUnit>) -> Span {
        let room = |count| {
            let slots = if count == 1 { slots.from } else { slots.to };
            unit.map_or(slots, |unit| slots.max(self.data[unit as usize].queue.room_for(count)))
        };
        let (first, last) = (room(1), room(warps));
        let (begin, sent) = self.sends.reserve(from.max(first), u64::from(warps) * self.period);
        let (sender, work) = (&mut self.senders[kind as usize], self.send_work);
        let end =
            begin + self.period * ((sender.server.used_at(begin) + Work::from(warps - 1) * work) / CYCLE);
        let to = sent.saturating_sub(self.period).max(end).max(last);
        sender.sent = sender.server.serve(begin, self.period, Work::from(warps) * work) + (to - end);
        Span { from: begin, to }
    }

    /// Fetch the data of some warps. Returns when the first and the last warp have them.
    fn data(
        &mut self,
        visit: &Visit<'_>,
        chunk: &Chunk,
        sent: Span,
        builder: &DemandBuilder,
        memory: &mut Memory,
        run: &mut Run,
    ) -> Span {
        let demand = visit.demand;
        let state = &mut self.data[demand.data_unit() as usize];
        let (unit, period) = (state.unit, state.period);
        let of_warp = |part: u32| {
            let data = demand.data.map(|whole| share(whole, part, chunk.of).len() as u32);
            builder.data_work(unit, data)
        };
        let work: Work = (chunk.first..chunk.first + chunk.count).map(of_warp).sum();
        let each = time_of(work / Work::from(chunk.count), period);
        let start = aligned(sent.from.max(state.free), period);
        let service = Service::of(&mut state.server, start, period, work);
        let mut served = service.to.max(sent.to + each);
        let all = demand.lines_of(unit.port());
        let part = |part: u32| share(all.len() as u32, part, chunk.of).start as usize;
        let base = all.start - demand.first_line;
        let range = base + part(chunk.first)..base + part(chunk.first + chunk.count);
        let lines = range.len() as u32;
        let (mut arrived, mut last_request) = (0, service.to);
        if !range.is_empty() {
            let fetched = memory.request(unit.port(), &visit.lines[range], visit.turn, start);
            served = served.max(fetched.last_request);
            arrived = fetched.arrived;
            last_request = fetched.last_request;
            run.memory = run.memory.with(fetched.first, fetched.moved);
        }
        served = served.max(state.behind.room_for(chunk.count));
        let departed = served.max(arrived).max(state.departed);
        state.free = served;
        state.departed = departed;
        let (from, to) = (start + self.period, served.saturating_sub(each).max(start) + self.period);
        state.queue.note_all(chunk.count, from, to);
        let first =
            (start + each).max(departed.saturating_sub(served.saturating_sub(start + each))).min(departed);
        state.behind.note_all(chunk.count, first, departed);
        run.note_data(state.client.with_requests(service, lines, last_request));
        Span { from: first + state.latency, to: departed + state.latency }
    }

    /// Run the operations of some warps, sent from `sent` on and ready between `ready.from` and `ready.to`.
    /// Returns when the first and the last warp are done.
    fn operate(&mut self, visit: &Visit<'_>, chunk: &Chunk, sent: Time, ready: Span) -> Span {
        let demand = visit.demand;
        let part = |part: u32| share(demand.threads, part, chunk.of).start;
        let threads = part(chunk.first + chunk.count) - part(chunk.first);
        let operations = u64::from(threads) * u64::from(demand.ops);
        // A warp wider than a core takes several cycles per operation. One of a group has operations in some
        // of its steps only.
        let steps = u64::from(demand.steps().max(1));
        let lanes = operations.div_ceil(steps * u64::from(chunk.count));
        let wide = lanes.div_ceil(u64::from(self.lanes_of_core)).saturating_sub(1) * self.period;
        // Its warps have the lanes of as many cores, those of a group of one.
        let cores = if demand.group.is_some() { 1 } else { chunk.count.min(self.cores) };
        let of_cores = u64::from(cores * self.lanes_of_core);
        let alone = (steps * (self.alu + wide)).max(operations * self.period / of_cores);
        let issued = match operations * self.period {
            0 => 0,
            work => self.lanes.reserve_as(visit.turn, ready.from, work).1,
        };
        // Warps of both kinds take turns on the slots. How long others keep the lanes does not count, as a
        // warp is faster with fewer beside it.
        let each = alone + ready.from.saturating_sub(sent);
        let held = self.occupancy.hold(visit.turn, sent, chunk.count, each);
        let last = (ready.to + alone).max(issued + self.alu.saturating_sub(self.period)).max(held);
        Span { from: last - (ready.to - ready.from).min(last - ready.from), to: last }
    }
}
