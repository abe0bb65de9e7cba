//! Level `packet`: a recurrence over packets and stations, without a ticking clock.
//!
//! For packet `k` at station `p`, with `n` its next station:
//!
//! ```text
//! start(p, k)  = max(arrive(p, k), free(p))
//! served(p, k) = max(start(p, k) + floor(used(p) + service(p, k)), last request)
//! leave(p, k)  = max(served(p, k), last line, leave(p, k - 1), start(n, k - queue(n)) + 1)
//! arrive(n, k) = leave(p, k) + latency(p)
//! ```
//!
//! `used` is the part of the cycle `start` that earlier packets took; a unit goes on with the next packet in the same
//! cycle.
//!
//! This is the recurrence of tandem queues with finite buffers and blocking after service (Dallery and
//! Gershwin 1992). For units that share nothing it equals the level `stepped`, to the cycle. Shared resources
//! (the L2, buses and banks of memory) are calendars; ports of the L2 take turns in its. The cores serve warps
//! in turn, so when a packet of pixels or a group leaves them depends on packets that come later. It goes on
//! once that is known. The front end overlaps tiles that are simulated before it, and gets up to half of a slot that they
//! fill. It requests its lines run by run (lines with one route), each when the tiles have come to the time at which the
//! L2 can accept it.
//!
//! Packets arrive at their first unit when their gates open. With `tiles(b)` the time when all tiles of batch `b`
//! have left, `front(b)` likewise, and barrier `i` done at `barrier(i)`:
//!
//! ```text
//! vertices of batch b    max(tiles(b - 2), barrier(last that stops them))
//! tiles of batch b       max(front(b), barrier(last))
//! barrier                when all packets before it in the stream have left
//! ```

mod arbiter;
mod bank;
mod calendar;
mod cores;
mod dram;
mod memory;
mod residents;
mod shared_cores;
mod slots;
mod station;
mod tally;

use std::collections::VecDeque;

use activity::{LineAccess, Packet, PacketCounts, Unit, Waits};
use calendar::Turn;
use cores::Cores;
use memory::{Fetched, Memory};
use station::StationState;
use tally::Tally;

use crate::clock::{Clocks, Time};
use crate::demand::{CLIENTS, COLOUR_PORT, COMMAND_PORT, DemandBuilder, ServiceDemand, Station};
use crate::draws::{DrawTimes, Passes};
use crate::spec::MachineSpec;
use crate::stepped::Stream;
use crate::{Clock, Recorder, Timed};

/// A packet at a station.
#[derive(Clone, Copy, Debug)]
struct Visit<'a> {
    station: Station,
    demand: &'a ServiceDemand,
    /// All its lines, grouped by client.
    lines: &'a [LineAccess],
    /// Times of its lines, if they were requested before.
    fetched: Option<Fetched>,
    /// When it arrives, and when the next station has room for it; at [`Station::Pixel`], when the cores have.
    arrive: Time,
    room: Time,
    turn: Turn,
}

/// First and last time of work with several parts.
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

    /// The time of part `at` of `count` that are spread evenly, the first at its begin and the last at its end.
    fn spread(self, at: u32, count: u32) -> Time {
        self.from + (self.to - self.from) / Time::from(count.max(2) - 1) * Time::from(at)
    }
}

/// A packet of pixels or a group on the cores.
#[derive(Clone, Debug)]
struct OnCores {
    /// Of its lines, only those of the colour unit.
    demand: ServiceDemand,
    counts: PacketCounts,
    turn: Turn,
    /// When it began, and when its lines so far pass the L2 and memory.
    begin: Time,
    memory: Span,
}

/// A front-end packet that has not left the command unit. Some of its lines may be requested.
#[derive(Debug)]
struct WaitingPacket {
    demand: ServiceDemand,
    counts: PacketCounts,
    lines: Vec<LineAccess>,
    /// How many of the lines of its first unit are requested, and their times.
    requested: usize,
    fetched: Option<Fetched>,
}

/// Clock that advances by packets.
#[derive(Debug)]
pub struct PacketClock {
    machine: MachineSpec,
    clocks: Clocks,
    builder: DemandBuilder,
    stations: Vec<StationState>,
    /// Whether the clocks of the stations differ.
    clocks_differ: bool,
    cores: Cores,
    /// Packets of pixels and groups on the cores, in the order in which they leave, and their lines of colour.
    on_cores: VecDeque<OnCores>,
    lines_on_cores: VecDeque<LineAccess>,
    /// Scratch memory of [`Self::depart`].
    leaving: Vec<LineAccess>,
    memory: Memory,
    tally: Tally,
    gates: Gates,
    passes: Passes,
    draws: DrawTimes,
    /// Front-end packets not yet simulated; the tiles have not reached them.
    ahead: VecDeque<WaitingPacket>,
    lines: Vec<LineAccess>,
    /// Packets so far.
    packets: u64,
    end: Time,
    /// Latest time that is simulated.
    max_end: Time,
    is_too_long: bool,
}

/// Longest frame in core cycles, half a second to some seconds of hardware time. Calendars of shared
/// resources take up to about nine bytes per cycle.
pub(crate) const MAX_CYCLES: u64 = 1 << 30;

/// Most changes between draws that are remembered; they are for slices of draws that do not take turns.
const MAX_SPANS: usize = 1 << 12;

/// When each batch was set up and traversed, as far as known.
#[derive(Clone, Debug, Default)]
struct Gates {
    set_up: Vec<Time>,
    traversed: Vec<Time>,
    /// When the last barrier was done, and the last one that the front end waits for.
    barrier: Time,
    front_barrier: Time,
    /// Whether tiles are on their way.
    tiles_began: bool,
}

impl Gates {
    fn opens(&self, demand: &ServiceDemand) -> Time {
        let at = |times: &[Time], batch: usize| times.get(batch).copied().unwrap_or(0);
        match (demand.front, demand.batch as usize) {
            (true, batch) => {
                batch.checked_sub(2).map_or(0, |before| at(&self.traversed, before)).max(self.front_barrier)
            }
            (false, batch) => at(&self.set_up, batch).max(self.barrier),
        }
    }

    /// The front end overlaps tiles that are simulated before it, so it takes turns with them.
    fn turn(&self, demand: &ServiceDemand) -> Turn {
        if demand.front && self.tiles_began { Turn::Late } else { Turn::InOrder }
    }

    /// The last tiles so far, or the barrier after them, end no earlier than `at`.
    fn delay(&mut self, at: Time) {
        if let Some(last) = self.traversed.last_mut() {
            *last = at.max(*last);
        }
        self.barrier = if self.barrier > 0 { at.max(self.barrier) } else { 0 };
    }

    fn note(&mut self, demand: &ServiceDemand, at: Time) {
        if let Some(waits) = demand.barrier {
            self.barrier = at;
            self.front_barrier = if waits == Waits::All { at } else { self.front_barrier };
            return;
        }
        let times = if demand.front { &mut self.set_up } else { &mut self.traversed };
        let batch = demand.batch as usize;
        if times.len() <= batch {
            times.resize(batch + 1, 0);
        }
        times[batch] = times[batch].max(at);
    }
}

impl PacketClock {
    /// A clock at time 0 which records into `recorder`.
    pub fn new(machine: &MachineSpec, clocks: Clocks, recorder: Recorder) -> Self {
        let stations: Vec<_> =
            Station::ALL.into_iter().map(|station| StationState::new(station, machine, &clocks)).collect();
        Self {
            machine: machine.clone(),
            clocks,
            builder: DemandBuilder::new(machine),
            clocks_differ: stations.iter().any(|station| station.period() != stations[0].period()),
            stations,
            cores: Cores::new(machine, &clocks),
            on_cores: VecDeque::new(),
            lines_on_cores: VecDeque::new(),
            leaving: Vec::new(),
            memory: Memory::new(machine, &clocks),
            tally: Tally::new(recorder, clocks),
            gates: Gates::default(),
            passes: Passes::default(),
            draws: DrawTimes::new(MAX_SPANS),
            ahead: VecDeque::new(),
            lines: Vec::new(),
            packets: 0,
            end: 0,
            max_end: MAX_CYCLES * clocks.period(Clock::Core),
            is_too_long: false,
        }
    }

    /// Whether the frame takes more than `MAX_CYCLES`. Later packets are not timed, and
    /// [`PacketClock::finish`] returns the time of the packets before.
    pub fn is_too_long(&self) -> bool {
        self.is_too_long
    }

    /// Run a recorded stream.
    pub fn run(mut self, stream: &Stream) -> Timed {
        for (demand, counts) in stream.demands.iter().zip(&stream.counts) {
            let all: u32 = demand.lines.iter().sum();
            self.next(demand, counts, &stream.lines[demand.first_line..demand.first_line + all as usize]);
        }
        self.finish()
    }

    /// Add the next packet of the stream and the lines it requests.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        let mut sorted = std::mem::take(&mut self.lines);
        sorted.clear();
        let demand = self.builder.build(packet, lines, &mut sorted);
        self.next(&demand, &packet.counts, &sorted);
        self.lines = sorted;
    }

    fn next(&mut self, demand: &ServiceDemand, counts: &PacketCounts, lines: &[LineAccess]) {
        self.packets += 1;
        if demand.front {
            self.ahead.push_back(WaitingPacket {
                demand: demand.clone(),
                counts: *counts,
                lines: lines.to_vec(),
                requested: 0,
                fetched: None,
            });
            return;
        }
        if !self.ahead.is_empty() {
            self.catch_up(demand.barrier.is_none().then_some(demand.batch));
        }
        self.walk(demand, counts, lines, None);
    }

    /// Simulate the front end up to the batch that the tiles need (all of it before a barrier), and as far as it
    /// is behind the tiles in time.
    fn catch_up(&mut self, batch: Option<u32>) {
        while let Some(WaitingPacket { demand, fetched, .. }) = self.ahead.front() {
            let before = demand.batch.checked_sub(2);
            let waits = |oldest: &OnCores| before.is_some_and(|before| oldest.demand.batch <= before);
            let needed = batch.is_none_or(|batch| demand.batch <= batch);
            let begins = match fetched {
                Some(_) => self.memory.next_accepted(COMMAND_PORT),
                None => self.stations[0].free().max(self.gates.opens(demand)),
            };
            let behind = !self.on_cores.front().is_some_and(waits)
                && begins <= self.stations[Station::Traversal as usize].free();
            if !(needed || behind) {
                return;
            }
            while self.on_cores.front().is_some_and(waits) {
                self.depart();
            }
            self.go_ahead();
        }
    }

    /// Request the next lines of the front end, or simulate its next packet if all are requested.
    fn go_ahead(&mut self) {
        let Some(WaitingPacket { demand, lines, requested, fetched, .. }) = self.ahead.front_mut() else {
            return;
        };
        let all = demand.lines[COMMAND_PORT] as usize;
        if *requested < all && !self.is_too_long {
            let start = self.stations[0].starts(self.gates.opens(demand));
            let turn = self.gates.turn(demand);
            let fetched = fetched.get_or_insert(Fetched::none(start));
            *requested += self.memory.request_run(COMMAND_PORT, &lines[*requested..all], turn, fetched);
        } else if let Some(WaitingPacket { demand, counts, lines, fetched, .. }) = self.ahead.pop_front() {
            self.walk(&demand, &counts, &lines, fetched);
        }
    }

    /// Move a packet from its first station to its last.
    fn walk(
        &mut self,
        demand: &ServiceDemand,
        counts: &PacketCounts,
        lines: &[LineAccess],
        fetched: Option<Fetched>,
    ) {
        if demand.barrier.is_some() {
            self.drain();
        }
        let first = demand.first();
        // A barrier comes when all packets before it have left.
        let mut arrive = if demand.barrier.is_some() { self.end } else { self.gates.opens(demand) };
        self.is_too_long |= self.end > self.max_end || arrive > self.max_end;
        if self.is_too_long {
            return;
        }
        self.builder.add_work(demand, counts, self.passes.work(demand.pass));
        let turn = self.gates.turn(demand);
        let mut memory = Span::NONE;
        let begin = self.stations[first as usize].starts(arrive);
        for &station in &Station::ALL[first as usize..=demand.last as usize] {
            if station == Station::Pixel {
                let (arrive, room) = self.admit(demand, arrive);
                let arrive = self.edge(station, arrive);
                let visit = Visit { station, demand, lines, fetched: None, arrive, room, turn };
                self.cores(&visit, counts, &mut memory);
                return self.stay(visit, counts, begin, memory);
            }
            // A packet leaves when the next queue has room, which it sees one cycle later.
            let next = (station != demand.last).then(|| &self.stations[station as usize + 1]);
            let room = next.map_or(0, |next| next.queue.room_at());
            let fetched = fetched.filter(|_| station == first);
            let visit =
                Visit { station, demand, lines, fetched, arrive: self.edge(station, arrive), room, turn };
            let leave = match station.unit() {
                Unit::Shader => self.cores(&visit, counts, &mut memory),
                _ => self.serve(&visit, counts, &mut memory),
            };
            arrive = leave + self.stations[station as usize].latency;
        }
        self.done(demand, begin, arrive);
        self.count_memory(counts, memory);
        self.tally.packet_done(counts);
        if turn == Turn::Late {
            let yielded = self.cores.yielded().max(self.memory.yielded());
            self.gates.delay(yielded);
            self.end = self.end.max(yielded);
        }
    }

    /// When the cores take a packet of pixels or a group that comes at `arrive`, and when they have room for it.
    fn admit(&mut self, demand: &ServiceDemand, arrive: Time) -> (Time, Time) {
        loop {
            if let Some(admitted) = self.cores.admits(demand, arrive) {
                return admitted;
            }
            self.depart();
        }
    }

    /// First edge of the clock of a station at or after `at`.
    fn edge(&self, station: Station, at: Time) -> Time {
        if self.clocks_differ { self.stations[station as usize].edge(at) } else { at }
    }

    /// A packet that began at `begin` leaves the machine at `at`.
    fn done(&mut self, demand: &ServiceDemand, begin: Time, at: Time) {
        self.end = self.end.max(at);
        self.gates.note(demand, at);
        self.passes.note(demand.pass, begin, at);
        self.draws.departed(demand, at);
    }

    fn count_memory(&mut self, counts: &PacketCounts, memory: Span) {
        if memory.from <= memory.to {
            let units = [Unit::L2, Unit::Llc, Unit::Edram, Unit::Dram];
            for unit in units.into_iter().filter(|&unit| self.machine.has(unit)) {
                self.tally.count(unit, counts, memory.from, memory.to);
            }
        }
    }

    /// A packet is on the cores until it is known when it leaves; a barrier leaves at once.
    fn stay(&mut self, visit: Visit<'_>, counts: &PacketCounts, begin: Time, memory: Span) {
        let Visit { demand, lines, turn, .. } = visit;
        self.tally.packet_passed(counts);
        self.gates.tiles_began = true;
        let range = demand.lines_of(COLOUR_PORT);
        let lines = &lines[range.start - demand.first_line..range.end - demand.first_line];
        self.lines_on_cores.extend(lines);
        let mut demand = demand.clone();
        demand.lines = [0; CLIENTS.len()];
        demand.lines[COLOUR_PORT] = lines.len() as u32;
        let is_barrier = demand.barrier.is_some();
        self.on_cores.push_back(OnCores { demand, counts: *counts, turn, begin, memory });
        while self.cores.oldest_is_done() || (is_barrier && !self.on_cores.is_empty()) {
            self.depart();
        }
    }

    /// Let the oldest packet leave the cores.
    fn depart(&mut self) {
        let Some(OnCores { demand, counts, turn, begin, mut memory }) = self.on_cores.pop_front() else {
            return;
        };
        let goes_on = demand.last == Station::Colour;
        let room = if goes_on { self.stations[Station::Colour as usize].queue.room_at() } else { 0 };
        let mut at = self.cores.leave(room) + self.stations[Station::Pixel as usize].latency;
        if goes_on {
            let station = Station::Colour;
            let mut lines = std::mem::take(&mut self.leaving);
            lines.clear();
            lines.extend(self.lines_on_cores.drain(..demand.lines[COLOUR_PORT] as usize));
            let arrive = self.edge(station, at);
            let visit =
                Visit { station, demand: &demand, lines: &lines, fetched: None, arrive, room: 0, turn };
            at = self.serve(&visit, &counts, &mut memory) + self.stations[station as usize].latency;
            self.leaving = lines;
        }
        self.done(&demand, begin, at);
        self.count_memory(&counts, memory);
        self.tally.packet_departed(&counts);
    }

    /// The cores run empty.
    fn drain(&mut self) {
        while !self.on_cores.is_empty() {
            self.depart();
        }
    }

    fn serve(&mut self, visit: &Visit<'_>, counts: &PacketCounts, memory: &mut Span) -> Time {
        let served = self.stations[visit.station as usize].serve(visit, &mut self.memory);
        if let Some(fetched) = served.fetched {
            *memory = memory.with(fetched.first, fetched.moved);
        }
        self.tally.serve(visit.station.unit(), counts, &served.service);
        served.leave
    }

    fn cores(&mut self, visit: &Visit<'_>, counts: &PacketCounts, memory: &mut Span) -> Time {
        let run = self.cores.run(visit, &self.builder, &mut self.memory);
        self.stations[visit.station as usize].queue.note(run.taken + 1);
        self.tally.count(Unit::Shader, counts, run.taken, run.done);
        *memory = memory.with(run.memory.from, run.memory.to);
        let unit = visit.demand.data_unit().unit();
        if let Some(service) = &run.data {
            self.tally.serve(unit, counts, service);
        } else if visit.demand.group.is_some() {
            self.tally.count(unit, counts, run.taken, run.done);
        }
        run.departed.unwrap_or(run.done)
    }

    /// Activity of all packets added.
    pub fn finish(mut self) -> Timed {
        self.catch_up(None);
        self.drain();
        let end = self.end.max(self.memory.ends_at());
        let end_ps = self.clocks.ps(end);
        let channels = self.memory.buses().count() as u64;
        let Self { machine, tally, clocks, cores, memory, passes, draws, packets, .. } = self;
        let mut recorder = tally.finish();
        recorder.lasts(end_ps);
        tally::write_calendar(&mut recorder, &clocks, Unit::Shader, cores.lanes(), 1, end_ps);
        tally::write_calendar(&mut recorder, &clocks, Unit::L2, memory.l2(), 1, end_ps);
        for (unit, calendar) in memory.levels() {
            tally::write_calendar(&mut recorder, &clocks, unit, calendar, 1, end_ps);
        }
        for bus in memory.buses() {
            tally::write_calendar(&mut recorder, &clocks, Unit::Dram, bus, channels, end_ps);
        }
        let timeline = recorder.finish();
        let (parts, spans) = draws.finish(&clocks, timeline.duration_ps);
        Timed {
            passes: passes.finish(&machine, &clocks, timeline.duration_ps, &parts),
            spans,
            timeline,
            cycles: clocks.cycles(Clock::Core, end),
            stalls: None,
            unit_cycles: 0,
            packets,
            checked: None,
        }
    }
}
