//! The level `packet`: a recurrence over packets and places, with no clock ticking.
//!
//! For packet `k` at place `p`, with `n` the next place on its way:
//!
//! ```text
//! start(p, k)  = max(arrive(p, k), free(p))
//! served(p, k) = max(start(p, k) + service(p, k), last request)
//! leave(p, k)  = max(served(p, k), lines there, leave(p, k - 1), start(n, k - queue(n)) + 1)
//! arrive(n, k) = leave(p, k) + latency(p)
//! ```
//!
//! the recurrence of tandem queues with finite buffers and blocking after service (Dallery and Gershwin 1992). It is that of
//! the level `stepped`, to the cycle, for units that share nothing. What is shared (lanes of the cores, the L2, buses and
//! banks of memory) is a calendar.

mod calendar;
mod cores;
mod memory;
mod window;

use std::collections::VecDeque;

use activity::{LineAccess, Packet, PacketCounts, Unit};

use crate::clock::{Clocks, Time};
use crate::job::{Job, Jobs, Place, port};
use crate::spec::MachineSpec;
use crate::{Clock, Recorder, Timed};
use calendar::Calendar;
use cores::Cores;
use memory::Memory;
use window::Window;

/// A unit at its place.
#[derive(Clone, Debug)]
struct Station {
    period: Time,
    latency: Time,
    /// When it can begin with the next packet, and when it can ask for the next line.
    free: Time,
    asks: Time,
    left: Time,
    /// The queue in front, and those that wait behind for their lines.
    queue: Window,
    behind: Option<Window>,
}

/// A clock that advances by packets.
#[derive(Debug)]
pub struct PacketClock {
    clocks: Clocks,
    makes: Jobs,
    stations: Vec<Station>,
    cores: Cores,
    memory: Memory,
    recorder: Recorder,
    gates: Gates,
    /// Packets of the front end that the tiles have not caught up with.
    ahead: VecDeque<(Job, PacketCounts, Vec<LineAccess>)>,
    lines: Vec<LineAccess>,
    end: Time,
}

/// When batches were set up and traversed, as far as is known.
#[derive(Clone, Debug, Default)]
struct Gates {
    set_up: Vec<Time>,
    traversed: Vec<Time>,
}

impl Gates {
    fn opens(&self, job: &Job) -> Time {
        let at = |times: &[Time], batch: usize| times.get(batch).copied().unwrap_or(0);
        match (job.front, job.batch as usize) {
            (true, batch) => batch.checked_sub(2).map_or(0, |before| at(&self.traversed, before)),
            (false, batch) => at(&self.set_up, batch),
        }
    }

    fn note(&mut self, job: &Job, at: Time) {
        let times = if job.front { &mut self.set_up } else { &mut self.traversed };
        let batch = job.batch as usize;
        if times.len() <= batch {
            times.resize(batch + 1, 0);
        }
        times[batch] = times[batch].max(at);
    }
}

impl PacketClock {
    /// A clock at zero for packets in batches of `batch_triangles`, writing into `recorder`.
    pub fn new(machine: &MachineSpec, clocks: Clocks, batch_triangles: u32, recorder: Recorder) -> Self {
        let station = |place: Place| {
            let common = machine.common(place.unit());
            let period = clocks.period(common.clock);
            let behind = port(place.unit()).map(|_| Window::new(common.in_flight));
            let latency = period * Time::from(common.latency_cycles);
            Station { period, latency, free: 0, asks: 0, left: 0, queue: Window::new(common.queue), behind }
        };
        Self {
            clocks,
            makes: Jobs::new(machine, batch_triangles),
            stations: Place::ALL.into_iter().map(station).collect(),
            cores: Cores::new(machine, &clocks),
            memory: Memory::new(machine, &clocks),
            recorder,
            gates: Gates::default(),
            ahead: VecDeque::new(),
            lines: Vec::new(),
            end: 0,
        }
    }

    /// The next packet of the stream and the lines it asks for.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        self.lines.clear();
        let job = self.makes.job(packet, lines, &mut self.lines);
        if job.front {
            self.ahead.push_back((job, packet.counts, self.lines.clone()));
            return;
        }
        self.catch_up(Some(job.batch));
        let lines = std::mem::take(&mut self.lines);
        self.walk(&job, &packet.counts, &lines);
        self.lines = lines;
    }

    /// The front end up to the batch that tiles need, and as far as it is behind them in time.
    fn catch_up(&mut self, batch: Option<u32>) {
        while let Some((job, ..)) = self.ahead.front() {
            let needed = batch.is_none_or(|batch| job.batch <= batch);
            let behind = self.stations[0].free.max(self.gates.opens(job))
                <= self.stations[Place::Traversal as usize].free;
            if !(needed || behind) {
                return;
            }
            if let Some((job, counts, lines)) = self.ahead.pop_front() {
                self.walk(&job, &counts, &lines);
            }
        }
    }

    /// A packet on its way from its first place to its last.
    fn walk(&mut self, job: &Job, counts: &PacketCounts, lines: &[LineAccess]) {
        let first = if job.front { Place::Command } else { Place::Traversal };
        let mut arrive = self.gates.opens(job);
        let mut memory: Option<(Time, Time)> = None;
        for &place in &Place::ALL[first as usize..=job.last as usize] {
            let period = self.stations[place as usize].period;
            let arrived = arrive.next_multiple_of(period);
            // A packet leaves when the next queue has room, which it sees a cycle later.
            let room = if place == job.last { 0 } else { self.stations[place as usize + 1].queue.room_at(1) };
            let leave = match place.unit() {
                Unit::Shader => self.cores(place, job, counts, lines, arrived, room, &mut memory),
                _ => self.station(place, job, counts, lines, arrived, room, &mut memory),
            };
            arrive = leave + self.stations[place as usize].latency;
        }
        self.end = self.end.max(arrive);
        self.gates.note(job, arrive);
        if let Some((from, to)) = memory {
            let (from, to) = (self.clocks.ps(from), self.clocks.ps(to));
            self.recorder.count(Unit::L2, counts, from, to);
            self.recorder.count(Unit::Dram, counts, from, to);
        }
    }

    #[allow(clippy::too_many_arguments, reason = "a packet at a place, and what it may do there")]
    fn station(
        &mut self,
        place: Place,
        job: &Job,
        counts: &PacketCounts,
        lines: &[LineAccess],
        arrive: Time,
        room: Time,
        memory: &mut Option<(Time, Time)>,
    ) -> Time {
        let station = &mut self.stations[place as usize];
        let start = arrive.max(station.free);
        let mut served = start + station.period * Time::from(job.service[place as usize]);
        let mut there = 0;
        let asked =
            port(place.unit()).map(|port| (port, job.lines_of(port))).filter(|(_, range)| !range.is_empty());
        if let Some((port, range)) = asked {
            let range = range.start - job.first_line..range.end - job.first_line;
            let fetched = self.memory.ask(port, &lines[range], start.max(station.asks), station.period);
            station.asks = fetched.asked + station.period;
            served = served.max(fetched.asked);
            there = fetched.there.next_multiple_of(station.period);
            note(memory, fetched.first, fetched.moved);
        }
        let leave = match &mut station.behind {
            None => served.max(room),
            Some(behind) => {
                served = served.max(behind.room_at(1));
                let leave = served.max(there).max(station.left).max(room);
                behind.enter(1, leave, leave);
                leave
            }
        }
        .next_multiple_of(station.period);
        let busy_to = start + station.period * Time::from(job.service[place as usize]);
        station.free = if station.behind.is_some() { served } else { leave };
        station.left = leave;
        station.queue.enter(1, start + 1, start + 1);
        let (from, to) = (self.clocks.ps(start), self.clocks.ps(busy_to));
        self.recorder.record(place.unit(), counts, from, to);
        leave
    }

    #[allow(clippy::too_many_arguments, reason = "a packet at a place, and what it may do there")]
    fn cores(
        &mut self,
        place: Place,
        job: &Job,
        counts: &PacketCounts,
        lines: &[LineAccess],
        arrive: Time,
        room: Time,
        memory: &mut Option<(Time, Time)>,
    ) -> Time {
        let kind = usize::from(place == Place::Pixel);
        let run = self.cores.run(kind, job, lines, arrive, room, &self.makes, &mut self.memory);
        self.stations[place as usize].queue.enter(1, run.taken + 1, run.taken + 1);
        let (from, to) = (self.clocks.ps(run.taken), self.clocks.ps(run.done));
        self.recorder.count(Unit::Shader, counts, from, to);
        if kind == 1 {
            if let Some((from, to)) = run.memory {
                note(memory, from, to);
            }
            if job.is_textured() {
                let (start, end) = (self.clocks.ps(run.texture.0), self.clocks.ps(run.texture.1));
                self.recorder.record(Unit::Texture, counts, start, end);
            }
        }
        run.left
    }

    /// The activity of everything pushed.
    pub fn finish(mut self) -> Timed {
        self.catch_up(None);
        let end = self.end.max(self.memory.ends_at());
        let end_ps = self.clocks.ps(end);
        let channels = self.memory.buses().count() as u64;
        let Self { mut recorder, clocks, cores, memory, .. } = self;
        recorder.lasts(end_ps);
        write(&mut recorder, &clocks, Unit::Shader, cores.lanes(), 1, end_ps);
        write(&mut recorder, &clocks, Unit::L2, memory.l2(), 1, end_ps);
        for bus in memory.buses() {
            write(&mut recorder, &clocks, Unit::Dram, bus, channels, end_ps);
        }
        Timed {
            timeline: recorder.finish(),
            cycles: clocks.cycles(Clock::Core, end),
            stalls: None,
            unit_cycles: 0,
        }
    }
}

fn note(memory: &mut Option<(Time, Time)>, from: Time, to: Time) {
    let (first, last) = memory.unwrap_or((from, to));
    *memory = Some((first.min(from), last.max(to)));
}

/// The busy time of one of `servers` of a unit from its calendar. What the calendar put beyond the end of the frame by its
/// stretches is moved before it.
fn write(
    recorder: &mut Recorder,
    clocks: &Clocks,
    unit: Unit,
    calendar: &Calendar,
    servers: u64,
    end_ps: u64,
) {
    for (from, to, used, room) in calendar.stretches() {
        let (from, to) = (clocks.ps(from), clocks.ps(to));
        let done = (u128::from(to - from) * u128::from(used) / u128::from(room)) as u64;
        let to = to.min(end_ps.max(from + done));
        recorder.busy(unit, from, to, done, (to - from).max(1) * servers);
    }
}
