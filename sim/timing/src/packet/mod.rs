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
//! (lanes of the cores, the L2, buses and banks of memory) are calendars; ports of the L2 take turns in its.
//! The front end overlaps tiles that are simulated before it, and gets up to half of a slot that they fill.
//!
//! Packets arrive at their first unit when their gates open. With `tiles(b)` the time when all tiles of batch `b`
//! have left, `front(b)` likewise, and barrier `i` done at `barrier(i)`:
//!
//! ```text
//! vertices of batch b    max(tiles(b - 2), barrier(last that stops them))
//! tiles of batch b       max(front(b), barrier(last))
//! barrier                when all packets before it in the stream have left
//! ```
//!
//! Events of packets in bins of time. Consecutive packets of a bin are written together.

mod arbiter;
mod bank;
mod calendar;
mod cores;
mod drain;
mod dram;
mod memory;
mod slots;
mod station;

use std::collections::VecDeque;

use activity::{Counts, LineAccess, Packet, PacketCounts, Unit, Waits};
use calendar::{Calendar, Turn};
use cores::Cores;
use memory::Memory;
use station::{Service, StationState};

use crate::clock::{Clocks, Time};
use crate::demand::{CYCLE, DemandBuilder, ServiceDemand, Station, Work};
use crate::draws::{DrawTimes, Passes};
use crate::recorder::part;
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
    /// When it arrives, and when the next station has room for it.
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
}

/// A front-end packet that is not simulated yet.
#[derive(Debug)]
struct WaitingPacket {
    demand: ServiceDemand,
    counts: PacketCounts,
    lines: Vec<LineAccess>,
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
/// resources take about three bytes per cycle.
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
        if demand.front && !self.traversed.is_empty() { Turn::Late } else { Turn::InOrder }
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
            });
            return;
        }
        if !self.ahead.is_empty() {
            self.catch_up(demand.barrier.is_none().then_some(demand.batch));
        }
        self.walk(demand, counts, lines);
    }

    /// Simulate the front end up to the batch that the tiles need (all of it before a barrier), and as far as it
    /// is behind the tiles in time.
    fn catch_up(&mut self, batch: Option<u32>) {
        while let Some(WaitingPacket { demand, .. }) = self.ahead.front() {
            let needed = batch.is_none_or(|batch| demand.batch <= batch);
            let behind = self.stations[0].free().max(self.gates.opens(demand))
                <= self.stations[Station::Traversal as usize].free();
            if !(needed || behind) {
                return;
            }
            if let Some(WaitingPacket { demand, counts, lines }) = self.ahead.pop_front() {
                if let Some(before) = demand.batch.checked_sub(2)
                    && let Some(at) = self.gates.traversed.get_mut(before as usize)
                {
                    *at = self.cores.departs(before, *at);
                }
                self.walk(&demand, &counts, &lines);
            }
        }
    }

    /// Move a packet from its first station to its last.
    fn walk(&mut self, demand: &ServiceDemand, counts: &PacketCounts, lines: &[LineAccess]) {
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
        let turn = self.gates.turn(demand);
        let mut memory = Span::NONE;
        let begin = self.stations[first as usize].starts(arrive);
        for &station in &Station::ALL[first as usize..=demand.last as usize] {
            if self.clocks_differ {
                arrive = self.stations[station as usize].edge(arrive);
            }
            // A packet leaves when the next queue has room, which it sees one cycle later.
            let room =
                if station == demand.last { 0 } else { self.stations[station as usize + 1].queue.room_at() };
            let visit = Visit { station, demand, lines, arrive, room, turn };
            let leave = match station.unit() {
                Unit::Shader => self.cores(&visit, counts, &mut memory),
                _ => self.serve(&visit, counts, &mut memory),
            };
            arrive = leave + self.stations[station as usize].latency;
        }
        self.end = self.end.max(arrive);
        self.gates.note(demand, arrive);
        self.passes.note(demand.pass, begin, arrive);
        self.draws.departed(demand, arrive);
        self.builder.add_work(demand, counts, self.passes.work(demand.pass));
        if memory.from <= memory.to {
            let units = [Unit::L2, Unit::Llc, Unit::Edram, Unit::Dram];
            for unit in units.into_iter().filter(|&unit| self.machine.has(unit)) {
                self.tally.count(unit, counts, memory.from, memory.to);
            }
        }
        self.tally.packet_done(counts);
        if turn == Turn::Late {
            let yielded = self.cores.yielded().max(self.memory.yielded());
            self.gates.delay(yielded);
            self.end = self.end.max(yielded);
        }
    }

    /// The cores run empty.
    fn drain(&mut self) {
        let Some(drained) = self.cores.drain(self.end).filter(|drained| drained.at > self.end) else {
            return;
        };
        self.end = drained.at;
        self.passes.note(drained.pass, Time::MAX, drained.at);
        self.draws.delayed(drained);
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
        run.departed
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
        write(&mut recorder, &clocks, Unit::Shader, cores.lanes(), 1, end_ps);
        write(&mut recorder, &clocks, Unit::L2, memory.l2(), 1, end_ps);
        for (unit, calendar) in memory.levels() {
            write(&mut recorder, &clocks, unit, calendar, 1, end_ps);
        }
        for bus in memory.buses() {
            write(&mut recorder, &clocks, Unit::Dram, bus, channels, end_ps);
        }
        let timeline = recorder.finish();
        let rows = crate::ratio_to_busiest(clocks.ps(memory.rows()), &timeline);
        let disputed = clocks.ps(memory.disputed()) as f64 / timeline.duration_ps.max(1) as f64;
        let short_queues = crate::short_queues(&machine.dram, &timeline);
        let (parts, spans) = draws.finish(&clocks, timeline.duration_ps);
        Timed {
            passes: passes.finish(&machine, &clocks, timeline.duration_ps, &parts),
            spans,
            timeline,
            cycles: clocks.cycles(Clock::Core, end),
            stalls: None,
            unit_cycles: 0,
            packets,
            rows: Some(rows),
            disputed: Some(disputed),
            short_queues,
            overlap: None,
        }
    }
}

/// Write the busy time of one of `servers` servers of a unit from its calendar, bin by bin. Slots may end
/// after the frame; their work is moved before its end.
fn write(
    recorder: &mut Recorder,
    clocks: &Clocks,
    unit: Unit,
    calendar: &Calendar,
    servers: u64,
    end_ps: u64,
) {
    // Work of the bin at `at_ps` that is not yet written, and the end of that bin.
    let (mut work, mut at_ps, mut end) = (0, 0, 0);
    let flush = |recorder: &mut Recorder, work: u64, at_ps| {
        let busy_ps = clocks.ps_below(work / (calendar.servers() * servers));
        recorder.busy(unit, at_ps, at_ps + busy_ps, 1, 1);
    };
    for (from, to, used, room) in calendar.slots() {
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

/// Position of a unit: its current bin, and its work in that bin.
#[derive(Clone, Copy, Debug, Default)]
struct Cursor {
    /// The bin in grains, shrunk to times that are surely inside: work that begins in `from..to` and ends by
    /// `to`.
    from: Time,
    to: Time,
    start_ps: u64,
    /// Grains of work in the bin, and the part of a grain beyond them, in units of 1 / [`CYCLE`].
    busy: Time,
    part: Work,
}

impl Cursor {
    /// Add work in cycles of `period` grains.
    fn work(&mut self, work: Work, period: Time) {
        let part = self.part + work % CYCLE * period;
        self.busy += work / CYCLE * period + part / CYCLE;
        self.part = part % CYCLE;
    }
}

/// Events over time. A packet whose work is inside the current bin of a unit costs one comparison: its events
/// go to the running total. The growth of the total is written when the unit moves to another bin.
#[derive(Debug)]
struct Tally {
    recorder: Recorder,
    clocks: Clocks,
    cursors: [Cursor; Unit::COUNT],
    /// Events of all packets so far.
    total: Counts,
    /// The part of them that has been written, by unit.
    written: Counts,
}

impl Tally {
    pub fn new(recorder: Recorder, clocks: Clocks) -> Self {
        let (total, written) = Default::default();
        Self { recorder, clocks, cursors: Default::default(), total, written }
    }

    /// Record that `unit` did its part of `counts` evenly between two times.
    pub fn count(&mut self, unit: Unit, counts: &PacketCounts, from: Time, to: Time) {
        let at = &self.cursors[unit as usize];
        if from < at.from || from >= at.to || to > at.to {
            self.count_outside_bin(unit, counts, from, to);
        }
    }

    /// Record the events of a service, and that `unit` was busy with it.
    pub fn serve(&mut self, unit: Unit, counts: &PacketCounts, service: &Service) {
        let Service { from, to, used, work, period } = *service;
        let at = &mut self.cursors[unit as usize];
        if from >= at.from && to + period <= at.to {
            return at.work(work, period);
        }
        self.count(unit, counts, from, to);
        let [begin_ps, end_ps] =
            [(from, used[0]), (to, used[1])].map(|(at, used)| self.clocks.ps_after(at, used * period, CYCLE));
        // A data unit that serves a packet in parts waits for lines between them.
        let (span_ps, work_ps) = (end_ps - begin_ps, self.clocks.ps_after(0, work * period, CYCLE));
        self.recorder.busy(unit, begin_ps, end_ps, work_ps.min(span_ps), span_ps.max(1));
    }

    /// Record the end of a packet: all units have done their part of `counts`.
    pub fn packet_done(&mut self, counts: &PacketCounts) {
        self.total += counts;
    }

    #[cold]
    fn count_outside_bin(&mut self, unit: Unit, counts: &PacketCounts, from: Time, to: Time) {
        let (from_ps, to_ps) = (self.clocks.ps(from), self.clocks.ps(to));
        self.recorder.count(unit, counts, from_ps, to_ps);
        if from >= self.cursors[unit as usize].from {
            self.write(unit);
            self.move_to_bin(unit, to_ps);
        }
        for (written, &count) in self.written.of_mut(unit).iter_mut().zip(counts.of(unit)) {
            *written += u64::from(count);
        }
    }

    /// Write the work of `unit` in its bin.
    fn write(&mut self, unit: Unit) {
        let Self { recorder, total, written, cursors, .. } = self;
        let cursor = &mut cursors[unit as usize];
        let (total, written) = (total.of_mut(unit), written.of_mut(unit));
        if total == written && cursor.busy == 0 && cursor.part == 0 {
            return;
        }
        recorder.add(unit, cursor.start_ps, |at| total[at] - written[at]);
        written.copy_from_slice(total);
        let (busy, part) = (std::mem::take(&mut cursor.busy), std::mem::take(&mut cursor.part));
        let busy_ps = self.clocks.ps_below(busy) + self.clocks.ps_below(part) / CYCLE;
        recorder.busy(unit, cursor.start_ps, cursor.start_ps + busy_ps, 1, 1);
    }

    /// Move `unit` to the bin of `at_ps`.
    fn move_to_bin(&mut self, unit: Unit, at_ps: u64) {
        let bin_ps = self.recorder.bin_ps();
        let start_ps = at_ps / bin_ps * bin_ps;
        let (from, to) = (self.clocks.grain_from(start_ps), self.clocks.grain_up_to(start_ps + bin_ps));
        self.cursors[unit as usize] = Cursor { from, to, start_ps, ..Cursor::default() };
    }

    /// The recorder, with everything written.
    pub fn finish(mut self) -> Recorder {
        Unit::ALL.into_iter().for_each(|unit| self.write(unit));
        self.recorder
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use activity::Event;

    /// Packets in and out of time order, through a tally and directly through a recorder.
    #[test]
    fn bins_equal_those_of_a_recorder() {
        for hz in [(1e9, 1e9), (925e6, 1375e6)] {
            let clocks = Clocks::new(hz.0, hz.1).unwrap();
            let bins = || Recorder::new(10_000, 16);
            let (mut tally, mut plain) = (Tally::new(bins(), clocks), bins());
            let mut counts = PacketCounts::default();
            for (step, jump) in
                [3, 0, 40, 7, 1, 90, 2, 500, 3, 9, 1000].into_iter().cycle().take(400).zip(0..)
            {
                counts[Event::SamplesTested] = 1000 + step;
                counts[Event::SamplesHit] = step;
                let from = u64::from(step) * 13 + jump * 20;
                let to = from + u64::from(step % 50);
                tally.count(Unit::SampleTest, &counts, from, to);
                tally.packet_done(&counts);
                plain.count(Unit::SampleTest, &counts, clocks.ps(from), clocks.ps(to));
            }
            let mut tally = tally.finish();
            // The clock sets the end of the frame.
            tally.lasts(100_000_000);
            plain.lasts(100_000_000);
            assert_eq!(tally.finish(), plain.finish(), "{hz:?}");
        }
    }
}
