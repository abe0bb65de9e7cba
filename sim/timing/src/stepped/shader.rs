//! Shader cores: packets are split into warps, warps share the cores, and resident warps hide latency.

use std::collections::VecDeque;

use activity::Unit;

use super::queue::Queue;
use crate::clock::{Clocks, Time};
use crate::demand::{ServiceDemand, WarpKind, share};
use crate::recorder::Reason;
use crate::spec::{DATA_EVENTS, DataUnit, MachineSpec};

/// A packet whose warps are on the cores.
#[derive(Clone, Copy, Debug)]
struct Flight {
    packet: u32,
    /// Warps not done.
    remaining: u32,
    /// Bytes of shared memory of its core that it holds.
    shared_bytes: u32,
    from: Time,
    to: Time,
}

/// Packets of one kind on the cores, in order.
#[derive(Clone, Debug, Default)]
struct PacketFifo {
    flights: VecDeque<Flight>,
    /// Packets that have left.
    retired: u64,
    /// Packet whose warps are being sent.
    sending: Option<Sending>,
}

/// Progress of sending the warps of a packet.
#[derive(Clone, Copy, Debug)]
struct Sending {
    packet: u32,
    sent: u32,
    warps: u32,
    /// The core of a group; its warps have their slots.
    core: Option<usize>,
}

/// State of all cores.
#[derive(Clone, Debug)]
pub(super) struct Shader {
    cores: Vec<Core>,
    fifos: [PacketFifo; WarpKind::ALL.len()],
    warps: Vec<Warp>,
    free: Vec<u32>,
    next_kind: WarpKind,
    lanes: u64,
    warp_lanes: u32,
    warps_per_cycle: u32,
    in_flight: usize,
    period: Time,
    alu: Time,
    /// Warps at each data unit or on their fifo back.
    fetching: [usize; DataUnit::ALL.len()],
}

/// Interface of the cores to their surroundings.
pub(super) trait CoreEnv {
    /// Record that a packet was on the cores from `from` to `to`.
    fn served(&mut self, kind: WarpKind, packet: u32, from: Time, to: Time);
    /// Pass a packet on. The error is the unit that has no room.
    fn leave(&mut self, kind: WarpKind, packet: u32, now: Time) -> Result<(), Unit>;
}

impl Shader {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = &machine.shader;
        let period = clocks.period(spec.clock);
        let core = Core {
            slots: spec.warps.get(),
            shared_bytes: spec.shared_bytes.get(),
            lane: 0,
            ready: VecDeque::new(),
            fresh: VecDeque::new(),
            fetched: VecDeque::new(),
            cooling: VecDeque::new(),
        };
        Self {
            cores: vec![core; spec.cores.get() as usize],
            fifos: Default::default(),
            warps: Vec::new(),
            free: Vec::new(),
            next_kind: WarpKind::Vertices,
            lanes: u64::from(spec.lanes),
            warp_lanes: spec.warp_lanes.get(),
            warps_per_cycle: spec.warps_per_cycle.get(),
            in_flight: spec.in_flight.get() as usize,
            period,
            alu: period * Time::from(spec.alu_latency_cycles),
            fetching: Default::default(),
        }
    }

    pub fn period(&self) -> Time {
        self.period
    }

    pub fn warp(&self, id: u32) -> &Warp {
        &self.warps[id as usize]
    }

    /// Simulate a cycle. Returns whether the cores acted, how many lanes were busy, and why the others were
    /// not.
    pub fn tick(
        &mut self,
        now: Time,
        demands: &[ServiceDemand],
        mut inputs: [&mut Queue<u32>; WarpKind::ALL.len()],
        mut data: [&mut Queue<u32>; DataUnit::ALL.len()],
        env: &mut impl CoreEnv,
    ) -> (bool, u32, Option<Reason>) {
        let mut acted = false;
        let mut busy = 0;
        for at in 0..self.cores.len() {
            if self.cores[at].is_empty() {
                continue;
            }
            let (did, worked) = self.run(at, now);
            acted |= did;
            busy += worked;
        }
        let mut reason = None;
        for _ in 0..self.warps_per_cycle {
            for (kind, input) in WarpKind::ALL.into_iter().zip(&mut inputs) {
                loop {
                    let retired = self.retire(kind, now, env, &mut reason);
                    let taken = self.take(kind, now, demands, input);
                    acted |= retired || taken;
                    if !(retired || taken) {
                        break;
                    }
                }
            }
            let sent = self.send(now, demands, data.each_mut().map(|queue| &mut **queue));
            acted |= sent;
            if !sent {
                break;
            }
        }
        let resident = self.fifos.iter().any(|fifo| !fifo.flights.is_empty());
        let fetching = DataUnit::ALL.into_iter().find(|&unit| self.fetching[unit as usize] > 0);
        let why = Reason::Starved(fetching.map_or(Unit::Shader, DataUnit::unit));
        (acted, busy, reason.or(resident.then_some(why)))
    }

    /// Record that the data of a warp arrive at `at`.
    pub fn fetched(&mut self, id: u32, at: Time) {
        let core = self.warps[id as usize].core;
        let queue = &mut self.cores[core].fetched;
        let after = queue.iter().rposition(|(before, _)| *before <= at).map_or(0, |last| last + 1);
        queue.insert(after, (at, id));
    }

    /// Simulate a cycle of one core: due warps become ready, and ready warps fill the lanes.
    fn run(&mut self, at: usize, now: Time) -> (bool, u32) {
        let cycle = now / self.period;
        let core = &mut self.cores[at];
        let mut acted = false;
        while let Some(id) = due(&mut core.fresh, now) {
            core.ready.push_back(id);
            acted = true;
        }
        while let Some(id) = due(&mut core.fetched, now) {
            core.ready.push_back(id);
            self.fetching[self.warps[id as usize].data_unit as usize] -= 1;
            acted = true;
        }
        while let Some(id) = due(&mut core.cooling, now) {
            acted = true;
            let warp = self.warps[id as usize];
            if warp.remaining > 0 {
                core.ready.push_back(id);
                continue;
            }
            core.slots += 1;
            self.free.push(id);
            let fifo = &mut self.fifos[warp.kind as usize];
            let flight = &mut fifo.flights[(warp.number - fifo.retired) as usize];
            flight.remaining -= 1;
            flight.to = now;
            core.shared_bytes += if flight.remaining == 0 { flight.shared_bytes } else { 0 };
        }
        core.lane = core.lane.max(cycle * self.lanes);
        let end = (cycle + 1) * self.lanes;
        while core.lane < end
            && let Some(id) = core.ready.pop_front()
        {
            let warp = &mut self.warps[id as usize];
            // A warp without operations occupies no lane.
            core.lane += if warp.remaining > 0 { u64::from(warp.lanes()) } else { 0 };
            warp.remaining = warp.remaining.saturating_sub(1);
            let last = core.lane.saturating_sub(1).max(cycle * self.lanes) / self.lanes;
            core.cooling.push_back((last * self.period + self.alu, id));
            acted = true;
        }
        (acted, (core.lane.min(end) - cycle * self.lanes) as u32)
    }

    fn retire(
        &mut self,
        kind: WarpKind,
        now: Time,
        env: &mut impl CoreEnv,
        reason: &mut Option<Reason>,
    ) -> bool {
        let fifo = &mut self.fifos[kind as usize];
        let Some(&flight) = fifo.flights.front() else { return false };
        if flight.remaining > 0 {
            return false;
        }
        if let Err(by) = env.leave(kind, flight.packet, now) {
            *reason = Some(Reason::Blocked(by));
            return false;
        }
        env.served(kind, flight.packet, flight.from, flight.to);
        fifo.flights.pop_front();
        fifo.retired += 1;
        true
    }

    /// Accept the next packet once all warps of the previous one are sent.
    fn take(&mut self, kind: WarpKind, now: Time, demands: &[ServiceDemand], input: &mut Queue<u32>) -> bool {
        let fifo = &mut self.fifos[kind as usize];
        if fifo.sending.is_some() || fifo.flights.len() >= self.in_flight {
            return false;
        }
        let Some(id) = input.head(now) else { return false };
        input.pop(now);
        let demand = &demands[id as usize];
        let parts = demand.warps(self.warp_lanes);
        let shared_bytes = demand.group.map_or(0, |group| group.shared_bytes);
        fifo.flights.push_back(Flight { packet: id, remaining: parts, shared_bytes, from: now, to: now });
        fifo.sending = (parts > 0).then_some(Sending { packet: id, sent: 0, warps: parts, core: None });
        true
    }

    /// The core for the next warp of a packet: the one with most free slots, or that of its group. A group
    /// takes a core with room for all of it.
    fn place(&self, sending: &Sending, demand: &ServiceDemand) -> Option<usize> {
        let (slots, bytes) = demand.group.map_or((1, 0), |group| (sending.warps, group.shared_bytes));
        let fits = |core: &Core| core.slots >= slots && core.shared_bytes >= bytes;
        let most = || self.cores.iter().filter(|core| fits(core)).map(|core| core.slots).max();
        sending.core.or_else(|| {
            most().and_then(|most| self.cores.iter().position(|core| core.slots == most && fits(core)))
        })
    }

    /// Send a warp, alternately of vertices and of pixels or groups.
    fn send(
        &mut self,
        now: Time,
        demands: &[ServiceDemand],
        data: [&mut Queue<u32>; DataUnit::ALL.len()],
    ) -> bool {
        let turns = [self.next_kind, self.next_kind.other()];
        let Some(kind) = turns.into_iter().find(|&kind| self.fifos[kind as usize].sending.is_some()) else {
            return false;
        };
        let Some(sending) = self.fifos[kind as usize].sending else { return false };
        let Sending { packet, sent: part, warps: parts, .. } = sending;
        let demand = &demands[packet as usize];
        let uses_data = kind == WarpKind::Pixels && demand.uses_data();
        let [texture, compute] = data;
        let queue = if demand.group.is_some() { compute } else { texture };
        let Some(core) = self.place(&sending, demand).filter(|_| !uses_data || queue.room(now) > 0) else {
            return false;
        };
        let fifo = &mut self.fifos[kind as usize];
        let number = fifo.retired + fifo.flights.len() as u64 - 1;
        let warp = Warp::new(demand, &sending, (kind, number), core);
        let is_group = demand.group.is_some();
        let next = Sending { sent: part + 1, core: is_group.then_some(core), ..sending };
        fifo.sending = (part + 1 < parts).then_some(next);
        // All warps of a group get their slots at once.
        if sending.core.is_none() {
            self.cores[core].slots -= if is_group { parts } else { 1 };
            self.cores[core].shared_bytes -= demand.group.map_or(0, |group| group.shared_bytes);
        }
        let id = self.store(warp);
        if uses_data {
            queue.push(id, now + self.period);
            self.fetching[demand.data_unit() as usize] += 1;
        } else {
            self.cores[core].fresh.push_back((now + self.period, id));
        }
        self.next_kind = kind.other();
        true
    }

    fn store(&mut self, warp: Warp) -> u32 {
        let Some(id) = self.free.pop() else {
            self.warps.push(warp);
            return self.warps.len() as u32 - 1;
        };
        self.warps[id as usize] = warp;
        id
    }

    /// Earliest time of possible work if no other unit acts.
    pub fn wakes_at(&self, now: Time, inputs: [&Queue<u32>; WarpKind::ALL.len()]) -> Option<Time> {
        let inputs = inputs.into_iter().filter_map(Queue::head_at);
        let cores = self.cores.iter().filter(|core| !core.is_empty()).flat_map(|core| {
            let queues = [&core.fresh, &core.fetched, &core.cooling];
            let arrives = queues.into_iter().filter_map(|queue| queue.front()).map(|(at, _)| *at);
            // Lanes occupied beyond this cycle become free again, whether or not a warp is ready then.
            arrives
                .chain([core.lane.div_ceil(self.lanes) * self.period, core.lane / self.lanes * self.period])
        });
        inputs.chain(cores).filter(|&at| at > now).min()
    }
}

/// Threads that execute together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Warp {
    pub packet: u32,
    /// Number of the warp in its packet.
    pub part: u32,
    pub parts: u32,
    kind: WarpKind,
    /// Number of its packet among those of its kind.
    pub number: u64,
    pub threads: u32,
    /// Operations of all threads.
    operations: u32,
    /// Operations one after another, and those not done.
    steps: u32,
    pub remaining: u32,
    pub core: usize,
    data_unit: DataUnit,
}

impl Warp {
    fn new(demand: &ServiceDemand, sending: &Sending, (kind, number): (WarpKind, u64), core: usize) -> Self {
        let Sending { packet, sent: part, warps: parts, .. } = *sending;
        let threads = share(demand.threads, part, parts).len() as u32;
        let operations = threads.saturating_mul(demand.ops);
        let (steps, data_unit) = (demand.steps(), demand.data_unit());
        Self {
            packet,
            part,
            parts,
            kind,
            number,
            threads,
            operations,
            steps,
            remaining: steps,
            core,
            data_unit,
        }
    }

    /// Lanes of its next step. A warp that waits for others of its group has operations in some of its steps only.
    fn lanes(&self) -> u32 {
        match self.threads.saturating_mul(self.steps) == self.operations {
            true => self.threads,
            false => share(self.operations, self.steps - self.remaining, self.steps).len() as u32,
        }
    }

    /// Events of the warp in its data unit.
    pub fn data(&self, demand: &ServiceDemand) -> [u32; DATA_EVENTS] {
        demand.data.map(|whole| share(whole, self.part, self.parts).len() as u32)
    }
}

#[derive(Clone, Debug)]
pub(super) struct Core {
    pub slots: u32,
    /// Free bytes of its shared memory.
    pub shared_bytes: u32,
    /// Next free lane, numbered over all cycles.
    pub lane: u64,
    pub ready: VecDeque<u32>,
    /// Warps just sent, back from the data units, and between two operations, each sorted by time.
    pub fresh: VecDeque<(Time, u32)>,
    pub fetched: VecDeque<(Time, u32)>,
    pub cooling: VecDeque<(Time, u32)>,
}

impl Core {
    pub fn is_empty(&self) -> bool {
        self.ready.is_empty() && self.fresh.is_empty() && self.fetched.is_empty() && self.cooling.is_empty()
    }
}

pub(super) fn due(queue: &mut VecDeque<(Time, u32)>, now: Time) -> Option<u32> {
    let (at, id) = *queue.front()?;
    (at <= now).then(|| {
        queue.pop_front();
        id
    })
}
