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
mod dram;
mod memory;
mod ring;
mod station;
mod tally;

use std::collections::VecDeque;

use activity::{LineAccess, Packet, PacketCounts, Unit};

use crate::clock::{Clocks, Time};
use crate::job::{Job, Jobs, Place};
use crate::spec::MachineSpec;
use crate::stepped::Stream;
use crate::{Clock, Recorder, Timed};
use calendar::Calendar;
use cores::Cores;
use memory::Memory;
use station::Station;
use tally::Tally;

/// A packet comes to a place.
#[derive(Clone, Copy, Debug)]
struct Visit<'a> {
    place: Place,
    job: &'a Job,
    /// All its lines, those of each client side by side.
    lines: &'a [LineAccess],
    /// When it is there, and when the place after has room for it.
    arrive: Time,
    room: Time,
}

/// The first and the last moment of something that has several parts.
#[derive(Clone, Copy, Debug)]
struct Span {
    from: Time,
    to: Time,
}

impl Span {
    const NONE: Self = Self { from: Time::MAX, to: 0 };

    fn with(self, from: Time, to: Time) -> Self {
        Self { from: self.from.min(from), to: self.to.max(to) }
    }
}

/// A clock that advances by packets.
#[derive(Debug)]
pub struct PacketClock {
    clocks: Clocks,
    makes: Jobs,
    stations: Vec<Station>,
    /// Whether the clocks of some places differ.
    mixed: bool,
    cores: Cores,
    memory: Memory,
    tally: Tally,
    gates: Gates,
    /// Packets of the front end that the tiles have not caught up with.
    ahead: VecDeque<(Job, PacketCounts, Vec<LineAccess>)>,
    lines: Vec<LineAccess>,
    /// Packets so far.
    packets: u64,
    end: Time,
    /// The latest moment that is timed.
    most: Time,
    is_too_long: bool,
}

/// Core cycles of a frame beyond which it is not timed: half a second to some seconds of hardware. Shared resources are
/// kept as calendars of about three bytes a cycle.
pub const MAX_CYCLES: u64 = 1 << 30;

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
        let stations: Vec<_> =
            Place::ALL.into_iter().map(|place| Station::new(place, machine, &clocks)).collect();
        Self {
            clocks,
            makes: Jobs::new(machine, batch_triangles),
            mixed: stations.iter().any(|station| station.period() != stations[0].period()),
            stations,
            cores: Cores::new(machine, &clocks),
            memory: Memory::new(machine, &clocks),
            tally: Tally::new(recorder, clocks),
            gates: Gates::default(),
            ahead: VecDeque::new(),
            lines: Vec::new(),
            packets: 0,
            end: 0,
            most: MAX_CYCLES * clocks.period(Clock::Core),
            is_too_long: false,
        }
    }

    /// Whether the frame takes more than [`MAX_CYCLES`]. What comes later is not timed, and [`PacketClock::finish`] gives the
    /// time of the part before.
    pub fn is_too_long(&self) -> bool {
        self.is_too_long
    }

    /// Runs a stream that is written already.
    pub fn run(mut self, stream: &Stream) -> Timed {
        for (job, counts) in stream.jobs.iter().zip(&stream.counts) {
            let all: u32 = job.lines.iter().sum();
            self.next(job, counts, &stream.lines[job.first_line..job.first_line + all as usize]);
        }
        self.finish()
    }

    /// The next packet of the stream and the lines it asks for.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        let mut sorted = std::mem::take(&mut self.lines);
        sorted.clear();
        let job = self.makes.job(packet, lines, &mut sorted);
        self.next(&job, &packet.counts, &sorted);
        self.lines = sorted;
    }

    fn next(&mut self, job: &Job, counts: &PacketCounts, lines: &[LineAccess]) {
        self.packets += 1;
        if job.front {
            self.ahead.push_back((job.clone(), *counts, lines.to_vec()));
            return;
        }
        if !self.ahead.is_empty() {
            self.catch_up(Some(job.batch));
        }
        self.walk(job, counts, lines);
    }

    /// The front end up to the batch that tiles need, and as far as it is behind them in time.
    fn catch_up(&mut self, batch: Option<u32>) {
        while let Some((job, ..)) = self.ahead.front() {
            let needed = batch.is_none_or(|batch| job.batch <= batch);
            let behind = self.stations[0].free().max(self.gates.opens(job))
                <= self.stations[Place::Traversal as usize].free();
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
        self.is_too_long |= self.end > self.most || arrive > self.most;
        if self.is_too_long {
            return;
        }
        let mut memory = Span::NONE;
        for &place in &Place::ALL[first as usize..=job.last as usize] {
            if self.mixed {
                arrive = self.stations[place as usize].edge(arrive);
            }
            // A packet leaves when the next queue has room, which it sees a cycle later.
            let room = if place == job.last { 0 } else { self.stations[place as usize + 1].queue.room_at() };
            let visit = Visit { place, job, lines, arrive, room };
            let leave = match place.unit() {
                Unit::Shader => self.cores(&visit, counts, &mut memory),
                _ => self.station(&visit, counts, &mut memory),
            };
            arrive = leave + self.stations[place as usize].latency;
        }
        self.end = self.end.max(arrive);
        self.gates.note(job, arrive);
        if memory.from <= memory.to {
            self.tally.count(Unit::L2, counts, memory.from, memory.to);
            self.tally.count(Unit::Dram, counts, memory.from, memory.to);
        }
        self.tally.through(counts);
    }

    fn station(&mut self, visit: &Visit<'_>, counts: &PacketCounts, memory: &mut Span) -> Time {
        let served = self.stations[visit.place as usize].serve(visit, &mut self.memory);
        if let Some(fetched) = served.fetched {
            *memory = memory.with(fetched.first, fetched.moved);
        }
        self.tally.serve(visit.place.unit(), counts, served.start, served.busy_to);
        served.leave
    }

    fn cores(&mut self, visit: &Visit<'_>, counts: &PacketCounts, memory: &mut Span) -> Time {
        let run = self.cores.run(visit, &self.makes, &mut self.memory);
        self.stations[visit.place as usize].queue.note(run.taken + 1);
        self.tally.count(Unit::Shader, counts, run.taken, run.done);
        *memory = memory.with(run.memory.from, run.memory.to);
        if run.texture.from <= run.texture.to {
            self.tally.serve(Unit::Texture, counts, run.texture.from, run.texture.to);
        }
        run.left
    }

    /// The activity of everything pushed.
    pub fn finish(mut self) -> Timed {
        self.catch_up(None);
        let end = self.end.max(self.memory.ends_at());
        let end_ps = self.clocks.ps(end);
        let channels = self.memory.buses().count() as u64;
        let Self { tally, clocks, cores, memory, packets, .. } = self;
        let mut recorder = tally.finish();
        recorder.lasts(end_ps);
        write(&mut recorder, &clocks, Unit::Shader, cores.lanes(), 1, end_ps);
        write(&mut recorder, &clocks, Unit::L2, memory.l2(), 1, end_ps);
        for bus in memory.buses() {
            write(&mut recorder, &clocks, Unit::Dram, bus, channels, end_ps);
        }
        let timeline = recorder.finish();
        let rows = crate::over_busiest(clocks.ps(memory.rows()), &timeline);
        Timed {
            timeline,
            cycles: clocks.cycles(Clock::Core, end),
            stalls: None,
            unit_cycles: 0,
            packets,
            rows: Some(rows),
        }
    }
}

/// The busy time of one of `servers` of a unit from its calendar: all that lies in a bin at once. What the calendar put beyond the
/// end of the frame by its stretches is moved before it.
fn write(
    recorder: &mut Recorder,
    clocks: &Clocks,
    unit: Unit,
    calendar: &Calendar,
    servers: u64,
    end_ps: u64,
) {
    // Work in the bin of `at_ps` that is not written, and where that bin ends.
    let (mut work, mut at_ps, mut end) = (0, 0, 0);
    let flush = |recorder: &mut Recorder, work: u64, at_ps| {
        let busy_ps = clocks.ps_below(work / (calendar.servers() * servers));
        recorder.busy(unit, at_ps, at_ps + busy_ps, 1, 1);
    };
    for (from, to, used, room) in calendar.stretches() {
        if to <= end {
            work += used;
            continue;
        }
        flush(recorder, std::mem::take(&mut work), at_ps);
        let (from_ps, to_ps) = (clocks.ps(from), clocks.ps(to));
        let done = part(to_ps - from_ps, used, room);
        let last_ps = to_ps.min(end_ps.max(from_ps + done));
        recorder.busy(unit, from_ps, last_ps, done, (last_ps - from_ps).max(1) * servers);
        let bin_ps = recorder.bin_ps();
        at_ps = to_ps / bin_ps * bin_ps;
        end = if at_ps + bin_ps <= end_ps { clocks.grain_up_to(at_ps + bin_ps) } else { 0 };
    }
    flush(recorder, work, at_ps);
}

/// `whole` times `used` over `room`, rounded down.
fn part(whole: u64, used: u64, room: u64) -> u64 {
    match whole.checked_mul(used) {
        Some(product) => product / room,
        None => (u128::from(whole) * u128::from(used) / u128::from(room)) as u64,
    }
}
