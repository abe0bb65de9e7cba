//! Shader cores and texture units at the level `packet`.

use super::calendar::Calendar;
use super::memory::Memory;
use super::ring::Ring;
use super::station::aligned;
use super::{Span, Visit};
use crate::clock::{Clocks, Time};
use crate::job::{Job, Jobs, Place, TEXTURE_PORT, share};
use crate::spec::MachineSpec;

/// Cycles in a stretch of the lanes' calendar.
const STRETCH: u32 = 64;

/// Warps that are followed together.
const CHUNK: u32 = 4;

/// Some of the warps of a packet.
#[derive(Clone, Copy, Debug)]
struct Chunk {
    first: u32,
    count: u32,
    of: u32,
}

/// What became of a packet on the cores.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    /// When its warps began to be sent, were done, and when it left.
    pub taken: Time,
    /// See above.
    pub done: Time,
    /// See above.
    pub left: Time,
    /// When the texture units worked on it.
    pub texture: Span,
    /// When its lines went through the L2 and memory.
    pub memory: Span,
}

/// One way through the cores, in order.
#[derive(Clone, Debug)]
struct Way {
    sent: Time,
    left: Time,
    flights: Ring,
    /// Places for warps on the cores. Those of the other way are not in it, as their times come in another order.
    slots: Ring,
}

/// All cores and all texture units.
#[derive(Clone, Debug)]
pub(super) struct Cores {
    ways: [Way; 2],
    /// Warps that are sent, one a cycle.
    sends: Calendar,
    lanes: Calendar,
    period: Time,
    alu: Time,
    lanes_of_core: u32,
    warp_lanes: u32,
    texture_period: Time,
    texture_latency: Time,
    texture_free: Time,
    texture_gone: Time,
    texture_asks: Time,
    texture_queue: Ring,
    texture_behind: Ring,
}

impl Cores {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let (spec, texture) = (&machine.shader, &machine.texture);
        let period = clocks.period(spec.clock);
        let texture_period = clocks.period(texture.clock);
        let slots = Ring::new(spec.cores.get() * spec.warps.get());
        let way = Way { sent: 0, left: 0, flights: Ring::new(spec.in_flight.get()), slots };
        Self {
            ways: [way.clone(), way],
            sends: Calendar::new(Time::from(STRETCH) * period, 1),
            lanes: Calendar::new(Time::from(STRETCH) * period, spec.cores.get() * spec.lanes.get()),
            period,
            alu: period * Time::from(spec.alu_latency_cycles),
            lanes_of_core: spec.lanes.get(),
            warp_lanes: spec.warp_lanes.get(),
            texture_period,
            texture_latency: texture_period * Time::from(texture.latency_cycles),
            texture_free: 0,
            texture_gone: 0,
            texture_asks: 0,
            texture_queue: Ring::new(texture.queue.get()),
            texture_behind: Ring::new(texture.in_flight.get()),
        }
    }

    /// The lanes' calendar.
    pub fn lanes(&self) -> &Calendar {
        &self.lanes
    }

    /// A packet of vertices or pixels comes by.
    pub fn run(&mut self, visit: &Visit<'_>, makes: &Jobs, memory: &mut Memory) -> Run {
        let job = visit.job;
        let kind = usize::from(visit.place == Place::Pixel);
        let warps = job.warps(self.warp_lanes);
        let way = &mut self.ways[kind];
        let taken = visit.arrive.max(way.sent).max(way.flights.room_at());
        let mut run = Run { taken, done: taken, left: taken, texture: Span::NONE, memory: Span::NONE };
        let textured = kind == 1 && job.is_textured();
        for first in (0..warps).step_by(CHUNK as usize) {
            let chunk = Chunk { first, count: CHUNK.min(warps - first), of: warps };
            let sent = self.send(kind, taken.max(self.ways[kind].sent), chunk.count, textured);
            self.ways[kind].sent = sent.1 + self.period;
            let mut ready = (sent.0 + self.period, sent.1 + self.period);
            if textured {
                ready = self.texels(visit, &chunk, ready, makes, memory, &mut run);
            }
            let done = self.operate(job, &chunk, ready);
            self.ways[kind].slots.note_all(chunk.count, done.0, done.1);
            run.done = run.done.max(done.1);
        }
        let way = &mut self.ways[kind];
        run.left = aligned(run.done.max(way.left).max(visit.room), self.period);
        way.left = run.left;
        way.flights.note(run.left);
        run
    }

    /// Sends warps, one a cycle, as places on the cores and in front of the texture units come free. Says when the first and the
    /// last are sent.
    fn send(&mut self, kind: usize, from: Time, warps: u32, textured: bool) -> (Time, Time) {
        let room = |count| {
            let slots = self.ways[kind].slots.room_for(count);
            slots.max(if textured { self.texture_queue.room_for(count) } else { 0 })
        };
        let (first, last) = (room(1), room(warps));
        let (begin, sent) = self.sends.take(from.max(first), u64::from(warps) * self.period);
        (begin, sent.saturating_sub(self.period).max(begin).max(last))
    }

    /// The texels of some warps. Says when the first and the last warp have theirs.
    fn texels(
        &mut self,
        visit: &Visit<'_>,
        chunk: &Chunk,
        sent: (Time, Time),
        makes: &Jobs,
        memory: &mut Memory,
        run: &mut Run,
    ) -> (Time, Time) {
        let job = visit.job;
        let cycles = |part: u32| {
            let [fetches, lines] = job.texels.map(|whole| share(whole, part, chunk.of).len() as u32);
            self.texture_period * Time::from(makes.texture_cycles(fetches, lines))
        };
        let service: Time = (chunk.first..chunk.first + chunk.count).map(cycles).sum();
        let each = service / Time::from(chunk.count);
        let start = aligned(sent.0.max(self.texture_free), self.texture_period);
        let mut served = (start + service).max(sent.1 + each);
        let busy_to = start + service;
        let all = job.lines_of(TEXTURE_PORT);
        let part = |part: u32| share(all.len() as u32, part, chunk.of).start as usize;
        let base = all.start - job.first_line;
        let range = base + part(chunk.first)..base + part(chunk.first + chunk.count);
        let mut there = 0;
        if !range.is_empty() {
            let fetched = memory.ask(
                TEXTURE_PORT,
                &visit.lines[range],
                start.max(self.texture_asks),
                self.texture_period,
            );
            self.texture_asks = fetched.asked + self.texture_period;
            served = served.max(fetched.asked);
            there = fetched.there;
            run.memory = run.memory.with(fetched.first, fetched.moved);
        }
        served = served.max(self.texture_behind.room_for(chunk.count));
        let gone = served.max(there).max(self.texture_gone);
        self.texture_free = served;
        self.texture_gone = gone;
        self.texture_queue.note_all(
            chunk.count,
            start + self.period,
            served.saturating_sub(each).max(start) + self.period,
        );
        let first = (start + each).max(gone.saturating_sub(served.saturating_sub(start + each))).min(gone);
        self.texture_behind.note_all(chunk.count, first, gone);
        run.texture = run.texture.with(start, busy_to);
        (first + self.texture_latency, gone + self.texture_latency)
    }

    /// The operations of some warps, the first of which is ready at `ready.0` and the last at `ready.1`. Says when the first and
    /// the last are done.
    fn operate(&mut self, job: &Job, chunk: &Chunk, ready: (Time, Time)) -> (Time, Time) {
        let part = |part: u32| share(job.threads, part, chunk.of).start;
        let threads = part(chunk.first + chunk.count) - part(chunk.first);
        let operations = u64::from(threads) * u64::from(job.ops);
        // An operation of a warp wider than a core takes more than one cycle of its lanes.
        let wide = Time::from(threads.div_ceil(chunk.count).div_ceil(self.lanes_of_core).saturating_sub(1))
            * self.period;
        let alone = Time::from(job.ops.max(1)) * (self.alu + wide);
        let issued = if operations > 0 { self.lanes.take(ready.0, operations * self.period).1 } else { 0 };
        let last = (ready.1 + alone).max(issued + self.alu.saturating_sub(self.period));
        (last - (ready.1 - ready.0).min(last - ready.0), last)
    }
}
