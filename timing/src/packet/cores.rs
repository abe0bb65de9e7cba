//! Shader cores and texture units at the level `packet`.

use activity::LineAccess;

use super::calendar::Calendar;
use super::memory::Memory;
use super::window::Window;
use crate::clock::{Clocks, Time};
use crate::job::{Job, Jobs};
use crate::spec::MachineSpec;

/// Cycles in a stretch of the lanes' calendar.
const STRETCH: u32 = 64;

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
    pub texture: (Time, Time),
    /// When its lines went through the L2 and memory.
    pub memory: Option<(Time, Time)>,
}

/// One way through the cores, in order.
#[derive(Clone, Debug)]
struct Way {
    sent: Time,
    left: Time,
    flights: Window,
}

/// All cores and all texture units.
#[derive(Clone, Debug)]
pub(super) struct Cores {
    ways: [Way; 2],
    /// Warps that are sent, one a cycle.
    sends: Calendar,
    lanes: Calendar,
    slots: Window,
    period: Time,
    alu: Time,
    lanes_of_core: u32,
    warp_lanes: u32,
    texture_period: Time,
    texture_latency: Time,
    texture_free: Time,
    texture_asks: Time,
    texture_queue: Window,
    texture_behind: Window,
}

impl Cores {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let (spec, texture) = (&machine.shader, &machine.texture);
        let period = clocks.period(spec.clock);
        let texture_period = clocks.period(texture.clock);
        let way = Way { sent: 0, left: 0, flights: Window::new(spec.in_flight) };
        Self {
            ways: [way.clone(), way],
            sends: Calendar::new(STRETCH, period, 1),
            lanes: Calendar::new(STRETCH, period, spec.cores * spec.lanes),
            slots: Window::new(spec.cores * spec.warps),
            period,
            alu: period * Time::from(spec.alu_latency_cycles),
            lanes_of_core: spec.lanes,
            warp_lanes: spec.warp_lanes,
            texture_period,
            texture_latency: texture_period * Time::from(texture.latency_cycles),
            texture_free: 0,
            texture_asks: 0,
            texture_queue: Window::new(texture.queue),
            texture_behind: Window::new(texture.in_flight),
        }
    }

    /// The lanes' calendar.
    pub fn lanes(&self) -> &Calendar {
        &self.lanes
    }

    /// A packet of vertices (`kind` 0) or pixels that arrives at `arrive` and may leave from `room` on.
    #[allow(clippy::too_many_arguments, reason = "a packet at a place, and what it may do there")]
    pub fn run(&mut self, kind: usize, job: &Job, lines: &[LineAccess], arrive: Time, room: Time, makes: &Jobs, memory: &mut Memory) -> Run {
        let warps = job.warps(self.warp_lanes);
        let way = &mut self.ways[kind];
        let taken = arrive.max(way.sent).max(way.flights.room_at(1));
        let mut run = Run { taken, done: taken, left: taken, texture: (taken, taken), memory: None };
        if warps > 0 {
            let last = self.send(taken, warps, kind == 1 && job.is_textured());
            self.ways[kind].sent = last;
            let ready = (taken + self.period, last + self.period);
            let ready = if kind == 1 && job.is_textured() { self.texels(job, lines, ready, warps, makes, memory, &mut run) } else { ready };
            run.done = self.operate(job, warps, ready);
            self.slots.enter(warps, run.done);
        }
        let way = &mut self.ways[kind];
        run.left = run.done.max(way.left).max(room).next_multiple_of(self.period);
        way.left = run.left;
        way.flights.enter(1, run.left);
        run
    }

    /// Sends the warps of a packet, one a cycle, as places on the cores and in front of the texture units come free. Says when
    /// the last is sent.
    fn send(&mut self, from: Time, warps: u32, textured: bool) -> Time {
        let (_, sent) = self.sends.take(from, u64::from(warps));
        let mut last = sent.saturating_sub(self.period).max(from).max(self.slots.room_at(warps));
        if textured {
            last = last.max(self.texture_queue.room_at(warps));
        }
        last
    }

    /// The texels of all warps. Says when the first and the last warp have theirs.
    #[allow(clippy::too_many_arguments, reason = "a packet at the texture units, and what it may do there")]
    fn texels(&mut self, job: &Job, lines: &[LineAccess], sent: (Time, Time), warps: u32, makes: &Jobs, memory: &mut Memory, run: &mut Run) -> (Time, Time) {
        let start = sent.0.max(self.texture_free);
        let each = job.texels.map(|whole| whole.div_ceil(warps));
        let service = self.texture_period * Time::from(makes.texture_cycles(each[0], each[1]));
        let mut served = (start + service * Time::from(warps)).max(sent.1 + service);
        let busy_to = start + service * Time::from(warps);
        let range = job.lines_of(2);
        let range = range.start - job.first_line..range.end - job.first_line;
        let mut there = 0;
        if !range.is_empty() {
            let fetched = memory.ask(2, &lines[range], start.max(self.texture_asks), self.texture_period);
            self.texture_asks = fetched.asked + self.texture_period;
            served = served.max(fetched.asked);
            there = fetched.there;
            run.memory = Some((fetched.first, fetched.moved));
        }
        served = served.max(self.texture_behind.room_at(warps));
        let last = served.max(there) + self.texture_latency;
        self.texture_free = served;
        self.texture_queue.enter(warps, served);
        self.texture_behind.enter(warps, served.max(there));
        run.texture = (start, busy_to);
        let first = if warps == 1 { last } else { start + service + self.texture_latency };
        (first, last)
    }

    /// The operations of all warps, the first of which is ready at `ready.0` and the last at `ready.1`. Says when all are done.
    fn operate(&mut self, job: &Job, warps: u32, ready: (Time, Time)) -> Time {
        let operations = u64::from(job.threads) * u64::from(job.ops);
        let threads = job.threads.div_ceil(warps);
        // An operation of a warp wider than a core takes more than one cycle of its lanes.
        let wide = Time::from(threads.div_ceil(self.lanes_of_core).saturating_sub(1)) * self.period;
        let alone = Time::from(job.ops.max(1)) * (self.alu + wide);
        let issued = if operations > 0 { self.lanes.take(ready.0, operations).1 } else { 0 };
        (ready.1 + alone).max(issued + self.alu.saturating_sub(self.period))
    }
}
