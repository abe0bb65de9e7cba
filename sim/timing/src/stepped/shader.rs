//! The shader cores: packets become warps, warps share the cores, latency hides behind those that are resident.

use std::collections::VecDeque;

use activity::Unit;

use super::meter::Rest;
use super::queue::Queue;
use super::warp::{Core, Warp, due};
use crate::clock::{Clocks, Time};
use crate::job::{Job, share};
use crate::spec::MachineSpec;

/// A packet whose warps are on the cores.
#[derive(Clone, Copy, Debug)]
struct Flight {
    job: u32,
    /// Warps not done.
    left: u32,
    from: Time,
    to: Time,
}

/// One way through the cores: that of vertices or that of pixels.
#[derive(Clone, Debug, Default)]
struct Way {
    flights: VecDeque<Flight>,
    /// Packets that have left.
    left: u64,
    /// The packet whose warps are being sent: how many were, of how many.
    sending: Option<(u32, u32, u32)>,
}

/// The state of all cores.
#[derive(Clone, Debug)]
pub(super) struct Shader {
    cores: Vec<Core>,
    ways: [Way; 2],
    warps: Vec<Warp>,
    free: Vec<u32>,
    turn: usize,
    lanes: u64,
    warp_lanes: u32,
    in_flight: usize,
    period: Time,
    alu: Time,
    /// Warps at the texture units or on their way back.
    fetching: usize,
}

/// What surrounds the cores.
pub(super) trait Outside {
    /// A packet was on the cores from `from` to `to`.
    fn served(&mut self, kind: usize, job: u32, from: Time, to: Time);
    /// Hands a packet on, or says who does not take it.
    fn leave(&mut self, kind: usize, job: u32, now: Time) -> Result<(), Unit>;
}

impl Shader {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = &machine.shader;
        let period = clocks.period(spec.clock);
        let core = Core {
            slots: spec.warps.get(),
            lane: 0,
            ready: VecDeque::new(),
            fresh: VecDeque::new(),
            textured: VecDeque::new(),
            cooling: VecDeque::new(),
        };
        Self {
            cores: vec![core; spec.cores.get() as usize],
            ways: Default::default(),
            warps: Vec::new(),
            free: Vec::new(),
            turn: 0,
            lanes: u64::from(spec.lanes),
            warp_lanes: spec.warp_lanes.get(),
            in_flight: spec.in_flight.get() as usize,
            period,
            alu: period * Time::from(spec.alu_latency_cycles),
            fetching: 0,
        }
    }

    pub fn period(&self) -> Time {
        self.period
    }

    pub fn warp(&self, id: u32) -> &Warp {
        &self.warps[id as usize]
    }

    /// One cycle. Says whether anything was done, how many lanes were busy, and why the others were not.
    pub fn tick(
        &mut self,
        now: Time,
        jobs: &[Job],
        inputs: [&mut Queue<u32>; 2],
        textures: &mut Queue<u32>,
        outside: &mut impl Outside,
    ) -> (bool, u32, Option<Rest>) {
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
        let mut rest = None;
        for (kind, input) in inputs.into_iter().enumerate() {
            loop {
                let retired = self.retire(kind, now, outside, &mut rest);
                let taken = self.take(kind, now, jobs, input);
                acted |= retired || taken;
                if !(retired || taken) {
                    break;
                }
            }
        }
        acted |= self.send(now, jobs, textures);
        let resident = self.ways.iter().any(|way| !way.flights.is_empty());
        let why = if self.fetching > 0 { Rest::Starved(Unit::Texture) } else { Rest::Starved(Unit::Shader) };
        (acted, busy, rest.or(resident.then_some(why)))
    }

    /// A warp has its texels.
    pub fn textured(&mut self, id: u32, at: Time) {
        let core = self.warps[id as usize].core;
        self.cores[core].textured.push_back((at, id));
    }

    /// Warps of one core: those whose time has come are ready, and the ready ones fill the lanes of the cycle.
    fn run(&mut self, at: usize, now: Time) -> (bool, u32) {
        let cycle = now / self.period;
        let core = &mut self.cores[at];
        let mut acted = false;
        while let Some(id) = due(&mut core.fresh, now) {
            core.ready.push_back(id);
            acted = true;
        }
        while let Some(id) = due(&mut core.textured, now) {
            core.ready.push_back(id);
            self.fetching -= 1;
            acted = true;
        }
        while let Some(id) = due(&mut core.cooling, now) {
            acted = true;
            let warp = self.warps[id as usize];
            if warp.left > 0 {
                core.ready.push_back(id);
                continue;
            }
            core.slots += 1;
            self.free.push(id);
            let way = &mut self.ways[warp.kind];
            let flight = &mut way.flights[(warp.number - way.left) as usize];
            flight.left -= 1;
            flight.to = now;
        }
        core.lane = core.lane.max(cycle * self.lanes);
        let end = (cycle + 1) * self.lanes;
        while core.lane < end
            && let Some(id) = core.ready.pop_front()
        {
            let warp = &mut self.warps[id as usize];
            // A warp without operations passes.
            core.lane += if warp.left > 0 { u64::from(warp.threads) } else { 0 };
            warp.left = warp.left.saturating_sub(1);
            let last = core.lane.saturating_sub(1).max(cycle * self.lanes) / self.lanes;
            core.cooling.push_back((last * self.period + self.alu, id));
            acted = true;
        }
        (acted, (core.lane.min(end) - cycle * self.lanes) as u32)
    }

    fn retire(
        &mut self,
        kind: usize,
        now: Time,
        outside: &mut impl Outside,
        rest: &mut Option<Rest>,
    ) -> bool {
        let way = &mut self.ways[kind];
        let Some(&flight) = way.flights.front() else { return false };
        if flight.left > 0 {
            return false;
        }
        if let Err(by) = outside.leave(kind, flight.job, now) {
            *rest = Some(Rest::Blocked(by));
            return false;
        }
        outside.served(kind, flight.job, flight.from, flight.to);
        way.flights.pop_front();
        way.left += 1;
        true
    }

    /// The next packet, when the warps of the one before are all sent.
    fn take(&mut self, kind: usize, now: Time, jobs: &[Job], input: &mut Queue<u32>) -> bool {
        let way = &mut self.ways[kind];
        if way.sending.is_some() || way.flights.len() >= self.in_flight {
            return false;
        }
        let Some(id) = input.head(now) else { return false };
        input.pop(now);
        let parts = jobs[id as usize].warps(self.warp_lanes);
        way.flights.push_back(Flight { job: id, left: parts, from: now, to: now });
        way.sending = (parts > 0).then_some((id, 0, parts));
        true
    }

    /// One warp a cycle, of vertices and of pixels in turn, to the core that has most room.
    fn send(&mut self, now: Time, jobs: &[Job], textures: &mut Queue<u32>) -> bool {
        let turns = [self.turn, 1 - self.turn];
        let Some(kind) = turns.into_iter().find(|&kind| self.ways[kind].sending.is_some()) else {
            return false;
        };
        let Some((job, part, parts)) = self.ways[kind].sending else { return false };
        let most = self.cores.iter().map(|core| core.slots).max().unwrap_or(0);
        let textured = kind == 1 && jobs[job as usize].is_textured();
        if most == 0 || (textured && textures.room(now) == 0) {
            return false;
        }
        let core = self.cores.iter().position(|core| core.slots == most).unwrap_or(0);
        let way = &mut self.ways[kind];
        let number = way.left + way.flights.len() as u64 - 1;
        let threads = share(jobs[job as usize].threads, part, parts).len() as u32;
        let warp = Warp { job, part, parts, kind, number, threads, left: jobs[job as usize].ops, core };
        way.sending = (part + 1 < parts).then_some((job, part + 1, parts));
        self.cores[core].slots -= 1;
        let id = self.place(warp);
        if textured {
            textures.push(id, now + self.period);
            self.fetching += 1;
        } else {
            self.cores[core].fresh.push_back((now + self.period, id));
        }
        self.turn = 1 - kind;
        true
    }

    fn place(&mut self, warp: Warp) -> u32 {
        let Some(id) = self.free.pop() else {
            self.warps.push(warp);
            return self.warps.len() as u32 - 1;
        };
        self.warps[id as usize] = warp;
        id
    }

    /// When it may have something to do next, if nobody else does anything.
    pub fn wakes_at(&self, now: Time, inputs: [&Queue<u32>; 2]) -> Option<Time> {
        let inputs = inputs.into_iter().filter_map(Queue::head_at);
        let cores = self.cores.iter().filter(|core| !core.is_empty()).flat_map(|core| {
            let queues = [&core.fresh, &core.textured, &core.cooling];
            let arrives = queues.into_iter().filter_map(|queue| queue.front()).map(|(at, _)| *at);
            // Lanes that are taken beyond this cycle are free again, whether or not a warp is ready then.
            arrives
                .chain([core.lane.div_ceil(self.lanes) * self.period, core.lane / self.lanes * self.period])
        });
        inputs.chain(cores).filter(|&at| at > now).min()
    }
}
