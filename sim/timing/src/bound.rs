//! Level `bound`: a roofline (Williams, Waterman and Patterson 2009) over the units of the machine.
//!
//! Units overlap only as far as the queues between them reach. So the stream of each path is split into
//! segments of as many packets as the queues of the path hold. A segment takes as long as its busiest unit.
//! If the cores cannot hold enough packets at once to hide their program latency, it takes as long as
//! Little's law demands (Little 1961). The front end of a batch overlaps the tiles of the previous batch;
//! both share the cores, the L2 and memory. Neither is shorter than its longest packet without contention,
//! or half of that if the batches around it hide the other half. A path that was empty fills first: its longest
//! packet passes all units but the busiest, which is among those summed.
//!
//! ```text
//! tiles(b) = max(fill + sum over segments of busiest unit or full cores, longest packet)        front(b) likewise
//! frame    = front(0) + sum over b of max(tiles(b) + barriers(b), front(b + 1), shared(b) + fill, rows(b) + fill)
//! ```
//!
//! A barrier after batch `b` empties the tile path, and its own packet comes alone. If vertices wait for it,
//! the front end of the next batch overlaps no tiles.
//!
//! Totals accumulated from a stream of packets.

use activity::{Counts, Event, LineAccess, LineKind, Packet, PacketCounts, Unit, Waits};

use crate::chips::{AddressMap, ChipTimes, Refresh, TurnPolicy};
use crate::clock::{Clocks, Time};
use crate::demand::{CLIENTS, DemandBuilder, ServiceDemand, Station, UnitSpeeds, UnitWork, port, time_of};
use crate::draws::{ByDraw, PassParts, Passes};
use crate::spec::{DataUnit, MachineSpec};
use crate::{Clock, Recorder, Timed};

/// Time of a frame from its totals.
pub fn bound(machine: &MachineSpec, clocks: Clocks, totals: &Totals, mut recorder: Recorder) -> Timed {
    let speeds = &totals.speeds;
    let mut lengths = vec![PhaseLength::default(); totals.phases.len()];
    let mut passes = Passes::default();
    for segment in totals.segments().filter(|segment| segment.packets > 0) {
        lengths[segment.phase].add(segment, speeds);
        add(passes.work(segment.pass), &segment.work);
    }
    let memory = totals.memory();
    let mut times = Vec::with_capacity(lengths.len());
    let mut now: Time = 0;
    // Barriers come last in their phase.
    for ((phase, length), memory) in totals.phases.iter().zip(&lengths).zip(&memory) {
        let busy = speeds.times(&length.work);
        let end = now + length.of(phase, &busy, *memory);
        write(&mut recorder, &clocks, &phase.counts, &busy, [now, end]);
        times.push([now, end - length.barriers, end]);
        now = end;
    }
    for segment in totals.segments().filter(|segment| segment.packets > 0) {
        let [begin, barriers, end] = times[segment.phase];
        match segment.barrier {
            Some(_) => passes.note(segment.pass, barriers, end),
            None => passes.note(segment.pass, begin, barriers),
        }
    }
    recorder.lasts(clocks.ps(now));
    let timeline = recorder.finish();
    Timed {
        cycles: clocks.cycles(Clock::Core, now),
        stalls: None,
        unit_cycles: 0,
        packets: totals.segments().map(|segment| u64::from(segment.packets)).sum(),
        checked: None,
        passes: passes.finish(machine, &clocks, timeline.duration_ps, &totals.parts()),
        spans: Vec::new(),
        timeline,
    }
}

fn add(to: &mut UnitWork, work: &UnitWork) {
    to.iter_mut().zip(work).for_each(|(sum, part)| *sum += part);
}

/// Parts of the length of a phase, in grains.
#[derive(Clone, Debug, Default)]
struct PhaseLength {
    work: UnitWork,
    /// Segments of each path, without barriers.
    paths: [Time; 2],
    /// The same with the busiest unit other than the cores.
    stages: [Time; 2],
    barriers: Time,
}

impl PhaseLength {
    fn add(&mut self, segment: &Segment, speeds: &UnitSpeeds) {
        let [busiest, stage] = speeds.busiest(&segment.work);
        let length = segment.full.into_iter().fold(busiest, |most, full| most.max(full as Time));
        match segment.barrier {
            Some(latency) => self.barriers += length.max(latency),
            None => {
                self.paths[segment.path] += length;
                self.stages[segment.path] += stage;
            }
        }
        add(&mut self.work, &segment.work);
    }

    /// Length of `phase`, with the busy time of its units and what its lines take of the chips of memory.
    fn of(&self, phase: &Phase, busy: &[Time; Unit::COUNT], chips: Time) -> Time {
        let floors = phase.floors(self.barriers > 0);
        let [front, tiles] = std::array::from_fn(|path| {
            let [fill, fill_stage] = phase.fill(path);
            (self.paths[path] + fill).max(self.stages[path] + fill_stage).max(floors[path])
        });
        let fill = phase.fill(0)[0].max(phase.fill(1)[0]);
        let shared = busy.iter().copied().fold(chips, Time::max) + fill;
        shared.max(front).max(tiles + self.barriers)
    }
}

fn write(
    recorder: &mut Recorder,
    clocks: &Clocks,
    counts: &Counts,
    busy: &[Time; Unit::COUNT],
    [from, to]: [Time; 2],
) {
    let (start, end) = (clocks.ps(from), clocks.ps(to));
    for unit in Unit::ALL.into_iter().filter(|&unit| counts.uses(unit) || busy[unit as usize] > 0) {
        recorder.count_all(unit, counts, start, end);
        if to > from {
            recorder.busy(unit, start, end, busy[unit as usize], to - from);
        }
    }
}

/// Clock of the level `bound`. It only accumulates totals until the frame ends.
#[derive(Clone, Debug)]
pub struct BoundClock {
    machine: MachineSpec,
    clocks: Clocks,
    builder: DemandBuilder,
    totals: Totals,
    recorder: Recorder,
    lines: Vec<LineAccess>,
}

impl BoundClock {
    /// A clock at time 0 which records into `recorder`.
    pub fn new(machine: &MachineSpec, clocks: Clocks, recorder: Recorder) -> Self {
        let (builder, totals) = (DemandBuilder::new(machine), Totals::new(machine, &clocks));
        Self { machine: machine.clone(), clocks, builder, totals, recorder, lines: Vec::new() }
    }

    /// Add the next packet of the stream.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        self.lines.clear();
        let demand = self.builder.build(packet, lines, &mut self.lines);
        self.totals.add(&self.builder, &demand, &packet.counts, &self.lines);
    }

    /// Activity of all packets added.
    pub fn finish(self) -> Timed {
        bound(&self.machine, self.clocks, &self.totals, self.recorder)
    }
}

/// What can be full: the cores, twice, the way of warps to them, and the clients.
const FULL: usize = 3 + CLIENTS.len();

/// Consecutive packets of one path that fit in its queues together, or a barrier.
#[derive(Clone, Debug, Default)]
struct Segment {
    pub path: usize,
    pub phase: usize,
    pub pass: u32,
    /// Time of a barrier without contention; `None` for other packets.
    pub barrier: Option<Time>,
    pub work: UnitWork,
    /// Grains for which the cores are full if no packet waits, by packets and by warps, those in which warps
    /// are sent, and those for which clients are full of lines under way.
    pub full: [f64; FULL],
    pub packets: u32,
}

/// The longest packet of a path, without contention.
#[derive(Clone, Copy, Debug, Default)]
struct Longest {
    alone: Time,
    /// The part of it beyond its busiest unit and its program, which other packets overlap.
    beyond: Time,
    /// The part of it beyond its busiest unit other than the cores.
    beyond_stage: Time,
}

/// Batches that overlap. Phase 0 is the front end of batch 0. The next has the tiles of batch 0 and the front end
/// of batch 1, and so on; a barrier that vertices wait for makes the two separate phases.
#[derive(Clone, Debug, Default)]
struct Phase {
    counts: Counts,
    longest: [Longest; 2],
    /// Whether a path was empty before.
    fills: [bool; 2],
}

impl Phase {
    /// The least time of each path. Between other batches each path works on two batches at once, unless it was
    /// empty or is emptied.
    fn floors(&self, is_emptied: bool) -> [Time; 2] {
        let [front, tiles] = self.longest.map(|longest| longest.alone);
        let overlaps = front > 0 && tiles > 0 && !is_emptied && self.fills == [false; 2];
        if overlaps { [(front + tiles) / 2; 2] } else { [front, tiles] }
    }

    /// Time to fill an empty path, if the cores are its busiest unit or if another unit is.
    fn fill(&self, path: usize) -> [Time; 2] {
        let Longest { beyond, beyond_stage, .. } = self.longest[path];
        if self.fills[path] { [beyond, beyond_stage] } else { [0; 2] }
    }
}

/// Totals of a frame: work of every segment and events of every phase. The size grows with segments, not with
/// packets.
#[derive(Clone, Debug)]
pub struct Totals {
    /// Packets per segment, for the front end and for tiles.
    segment_packets: [u32; 2],
    speeds: UnitSpeeds,
    uncontended: Uncontended,
    open: [Segment; 2],
    closed: Vec<Segment>,
    banks: Banks,
    /// Times of memory, for each phase before the last.
    memory: Vec<Time>,
    phases: Vec<Phase>,
    /// Work of every draw, by pass.
    draws: Vec<ByDraw<UnitWork>>,
    /// Whether each path is empty.
    empty: [bool; 2],
    /// Barriers so far that vertices wait for.
    full_barriers: usize,
}

const PATHS: [&[Station]; 2] = [
    &[Station::Command, Station::Vertex, Station::Setup],
    &[
        Station::Traversal,
        Station::ZCull,
        Station::SampleTest,
        Station::Depth,
        Station::ShadingCache,
        Station::Pixel,
        Station::Colour,
    ],
];

impl Totals {
    /// Empty totals.
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let queue = |station: &Station| machine.common(station.unit()).queue;
        let open = |path| Segment { path, phase: path, ..Segment::default() };
        Self {
            segment_packets: PATHS.map(|path| path.iter().map(queue).sum()),
            speeds: UnitSpeeds::new(machine, clocks),
            uncontended: Uncontended::new(machine, clocks),
            open: [open(0), open(1)],
            closed: Vec::new(),
            banks: Banks::new(machine, clocks),
            memory: Vec::new(),
            phases: Vec::new(),
            draws: Vec::new(),
            empty: [true; 2],
            full_barriers: 0,
        }
    }

    /// Add the next packet of the stream: its demand from `builder`, its events and its lines.
    pub fn add(
        &mut self,
        builder: &DemandBuilder,
        demand: &ServiceDemand,
        counts: &PacketCounts,
        lines: &[LineAccess],
    ) {
        let path = usize::from(!demand.front);
        let phase = match demand.barrier {
            Some(_) => self.phases.len().saturating_sub(1),
            None => demand.batch as usize + path + self.full_barriers,
        };
        self.reach(phase);
        let program = self.uncontended.program(demand);
        let alone = self.uncontended.packet(demand, program, counts);
        let segment = self.segment(path, phase, demand);
        let mut own = UnitWork::default();
        builder.add_work(demand, counts, &mut own);
        add(&mut segment.work, &own);
        segment.packets += 1;
        self.phases[phase].counts += counts;
        add(ByDraw::of(&mut self.draws, demand.pass, demand.draw), &own);
        self.banks.add(lines);
        if let Some(waits) = demand.barrier {
            return self.barrier(waits, demand, alone);
        }
        let full = self.uncontended.full(demand, program, counts, lines);
        self.open[path].full.iter_mut().zip(full).for_each(|(sum, part)| *sum += part);
        let at = &mut self.phases[phase];
        at.fills[path] |= std::mem::take(&mut self.empty[path]);
        if alone > at.longest[path].alone {
            let [busiest, stage] = self.speeds.busiest(&own);
            let hidden = full.into_iter().fold(busiest.max(program), |most, full| most.max(full as Time));
            let [beyond, beyond_stage] = [hidden, stage].map(|part| alone.saturating_sub(part));
            at.longest[path] = Longest { alone, beyond, beyond_stage };
        }
    }

    /// The open segment of a path for the packet of `demand`.
    fn segment(&mut self, path: usize, phase: usize, demand: &ServiceDemand) -> &mut Segment {
        let open = &mut self.open[path];
        let is_full = open.packets == self.segment_packets[path] || demand.barrier.is_some();
        if phase != open.phase || is_full {
            let next = Segment { path, phase, pass: demand.pass, ..Segment::default() };
            self.closed.push(std::mem::replace(open, next));
        }
        open.pass = demand.pass;
        open
    }

    /// End the segment of a barrier. Its packet is alone, so it takes the sum of its units.
    fn barrier(&mut self, waits: Waits, demand: &ServiceDemand, alone: Time) {
        let open = &mut self.open[1];
        let requests = self.uncontended.requests(demand, &open.work);
        open.barrier = Some(alone + requests);
        let next = Segment { path: 1, phase: open.phase, ..Segment::default() };
        self.closed.push(std::mem::replace(open, next));
        self.empty[1] = true;
        if waits == Waits::All {
            self.empty[0] = true;
            self.full_barriers += 1;
        }
    }

    /// Add phases up to `phase`.
    fn reach(&mut self, phase: usize) {
        if self.phases.len() <= phase {
            self.memory.resize(phase, 0);
            if let Some(last) = self.memory.last_mut() {
                *last += self.banks.take_longest();
            }
            self.phases.resize(phase + 1, Phase::default());
        }
    }

    /// Times of memory in each phase.
    fn memory(&self) -> Vec<Time> {
        let mut memory = self.memory.clone();
        memory.resize(self.phases.len(), 0);
        if let Some(last) = memory.last_mut() {
            *last += self.banks.clone().take_longest();
        }
        memory
    }

    /// Parts of the time of each pass: the time of each draw's work in its busiest unit.
    fn parts(&self) -> Vec<PassParts> {
        self.draws.iter().map(|pass| pass.map(|work| self.speeds.busiest(work)[0])).collect()
    }

    fn segments(&self) -> impl Iterator<Item = &Segment> {
        self.closed.iter().chain(&self.open)
    }
}

/// Times of packets that never wait for another packet, in grains.
#[derive(Clone, Debug)]
struct Uncontended {
    period: [Time; Station::COUNT],
    latency: [Time; Station::COUNT],
    /// Time of one operation of a full warp, its cycles on the lanes, and a cycle of the cores.
    operation: Time,
    wide: Time,
    cycle: Time,
    warp_lanes: u32,
    machine: MachineSpec,
    /// Packets or warps of each client that can wait for their lines.
    in_flight: [f64; CLIENTS.len()],
    /// Latency of a line in the L2.
    line: Time,
    /// The extra latency of a line that is read from further below, with the event that counts such lines.
    below: [(Event, Time); 3],
}

impl Uncontended {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let common = Station::ALL.map(|station| machine.common(station.unit()));
        let period = common.map(|common| clocks.period(common.clock));
        let (shader, dram) = (&machine.shader, &machine.dram);
        // A warp wider than a core takes more than one cycle of its lanes.
        let wide = shader.warp_lanes.get().div_ceil(shader.lanes.get());
        let cycles = shader.alu_latency_cycles.get() + wide - 1;
        let row = dram.latency_cycles.get()
            + dram.activate_cycles.get()
            + dram.cas_cycles.get()
            + dram.burst_cycles.get();
        let latency = |unit| {
            let common = machine.common(unit);
            clocks.period(common.clock) * Time::from(common.latency_cycles)
        };
        Self {
            period,
            latency: std::array::from_fn(|at| period[at] * Time::from(common[at].latency_cycles)),
            operation: clocks.period(shader.clock) * Time::from(cycles),
            wide: wide.into(),
            cycle: clocks.period(shader.clock),
            warp_lanes: shader.warp_lanes.get(),
            machine: machine.clone(),
            in_flight: CLIENTS.map(|unit| f64::from(machine.common(unit).in_flight.max(1))),
            line: latency(Unit::L2),
            below: [
                (Event::LlcReads, latency(Unit::Llc)),
                (Event::EdramReads, latency(Unit::Edram)),
                (Event::DramReadBytes, clocks.period(dram.clock) * Time::from(row)),
            ],
        }
    }

    /// Program time of a packet; all its warps run the same program. One of a group has operations in some of
    /// its steps only.
    pub fn program(&self, demand: &ServiceDemand) -> Time {
        let steps = Time::from(demand.steps());
        let Some(_) = demand.group else { return steps * self.operation };
        let all = u64::from(demand.threads) * u64::from(demand.ops);
        let warps = u64::from(demand.warps(self.warp_lanes)).max(1);
        let lanes = all.div_ceil(steps.max(1) * warps);
        let cycles = lanes.div_ceil(self.machine.shader.lanes.get().into()).max(1);
        steps * (self.operation - self.cycle * (self.wide - cycles.min(self.wide)))
    }

    /// Time for which the packet fills the cores, by packets and by warps or, for a group, by groups, the way
    /// to them, and each client. Warps hold their places while they wait for their lines, too.
    fn full(
        &self,
        demand: &ServiceDemand,
        program: Time,
        counts: &PacketCounts,
        lines: &[LineAccess],
    ) -> [f64; FULL] {
        let shader = &self.machine.shader;
        let (packets, cores) = (f64::from(shader.in_flight), f64::from(shader.cores));
        let warps = demand.warps(self.warp_lanes);
        let answer = self.answer(demand, counts) as f64;
        let reads = self.reads(lines);
        let waits = demand.uses_data() && reads[demand.data_unit().port()];
        let held = program as f64 + if waits { answer } else { 0.0 };
        let places = demand.group.map_or(cores * f64::from(shader.warps), |group| {
            cores * f64::from(self.machine.groups_per_core(warps, group.shared_bytes).max(1))
        });
        let needed = if demand.group.is_some() { 1.0 } else { f64::from(warps) };
        let mut full = [0.0; FULL];
        (full[0], full[1]) = (held / packets, held * needed / places);
        full[2] = (Time::from(warps) * self.cycle) as f64 / f64::from(shader.warps_per_cycle);
        for port in (0..CLIENTS.len()).filter(|&port| reads[port]) {
            // At data units warps wait.
            let is_of_warps = DataUnit::ALL.iter().any(|unit| unit.port() == port);
            let waiting = if is_of_warps { warps.min(demand.lines[port]) } else { 1 };
            full[3 + port] = answer * f64::from(waiting) / self.in_flight[port];
        }
        full
    }

    /// Whether each client waits for a line from below the L2, which is the slowest kind.
    fn reads(&self, lines: &[LineAccess]) -> [bool; CLIENTS.len()] {
        let mut reads = [false; CLIENTS.len()];
        let slow = lines.iter().filter(|line| matches!(line.kind, LineKind::Fetch | LineKind::Below));
        slow.filter_map(|line| port(line.client)).for_each(|port| reads[port] = true);
        reads
    }

    /// Latency of the slowest kind of lines of a packet.
    fn answer(&self, demand: &ServiceDemand, counts: &PacketCounts) -> Time {
        let lines = if demand.lines == [0; CLIENTS.len()] { 0 } else { self.line };
        let below = self.below.iter().filter(|(event, _)| counts[*event] > 0).map(|(_, latency)| latency);
        lines + below.sum::<Time>()
    }

    /// Time that the clients of a packet take to request its lines beyond their service in `work`, and
    /// the answers to all of them but one.
    pub fn requests(&self, demand: &ServiceDemand, work: &UnitWork) -> Time {
        let clients = [Station::Setup, Station::Traversal, Station::Depth, Station::Colour]
            .into_iter()
            .filter(|station| port(station.unit()).is_some_and(|port| demand.lines[port] > 0));
        let beyond = |station: &Station| {
            let beyond = work[station.unit() as usize] - demand.service[*station as usize];
            time_of(beyond, self.period[*station as usize])
        };
        let answers = self.line * (clients.clone().count() as Time).saturating_sub(1);
        clients.map(|station| beyond(&station)).sum::<Time>() + answers
    }

    /// Time of a packet from its first station to its last.
    pub fn packet(&self, demand: &ServiceDemand, program: Time, counts: &PacketCounts) -> Time {
        let first = if demand.front { Station::Command } else { Station::Traversal } as usize;
        let at =
            |station: usize| self.latency[station] + time_of(demand.service[station], self.period[station]);
        let units: Time = (first..=demand.last as usize).map(at).sum();
        units + program + self.answer(demand, counts)
    }
}

/// Time each bank spends closing and opening rows, and what rows and lines take of ranks and buses. This is a
/// lower bound: lines of each client come in stream order, and clients never close each other's rows.
#[derive(Clone, Debug)]
struct Banks {
    map: AddressMap,
    banks: usize,
    banks_per_rank: usize,
    times: ChipTimes,
    turns: TurnPolicy,
    /// Time to close a row and open another, read or written. Data moves meanwhile, as row and column
    /// commands have separate wires.
    row: [Time; 2],
    /// Last row of each bank and client.
    rows: Vec<[u32; CLIENTS.len()]>,
    busy: Vec<Time>,
    /// Rows opened in each rank, and lines read and written in each channel.
    opened: Vec<u64>,
    moved: Vec<[u64; 2]>,
}

impl Banks {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = &machine.dram;
        let [channels, ranks, banks_per_rank] =
            [spec.channels, spec.ranks, spec.banks].map(|count| count.get() as usize);
        let banks = ranks * banks_per_rank;
        let times = ChipTimes::new(spec, clocks);
        Self {
            map: AddressMap::new(spec),
            banks,
            banks_per_rank,
            turns: TurnPolicy::new(spec, &times),
            row: [0, 1].map(|kind| times.row_cycle(kind)),
            times,
            rows: vec![[u32::MAX; CLIENTS.len()]; channels * banks],
            busy: vec![0; channels * banks],
            opened: vec![0; channels * ranks],
            moved: vec![[0; 2]; channels],
        }
    }

    /// Add the lines of a packet.
    pub fn add(&mut self, lines: &[LineAccess]) {
        for access in lines {
            access.moved().for_each(|line| self.line(access, line));
        }
    }

    fn line(&mut self, access: &LineAccess, line: u32) {
        let Some(client) = port(access.client) else { return };
        let address = self.map.locate(line);
        let bank = address.channel * self.banks + address.bank;
        let kind = usize::from(access.fetched() != Some(line));
        self.moved[address.channel][kind] += 1;
        if std::mem::replace(&mut self.rows[bank][client], address.row) != address.row {
            self.busy[bank] += self.row[kind];
            self.opened[bank / self.banks_per_rank] += 1;
        }
    }

    /// Least time since the last call: of the busiest bank, rank or bus, with refresh.
    pub fn take_longest(&mut self) -> Time {
        let rows = self.busy.iter().copied().max().unwrap_or(0);
        let opened = self.opened.iter().copied().max().unwrap_or(0) * self.times.spacing();
        let moved = self.moved.iter().map(|&lines| self.on_bus(lines)).max().unwrap_or(0);
        self.busy.fill(0);
        self.opened.fill(0);
        self.moved.fill([0; 2]);
        self.with_refresh(rows.max(opened).max(moved))
    }

    /// Time of lines on the bus of a channel, with its turns.
    fn on_bus(&self, lines: [u64; 2]) -> Time {
        let turns = self.turns.pair as f64 * self.turns.pairs(lines);
        (lines[0] + lines[1]) * self.times.burst + turns as Time
    }

    /// `time`, and that of the refreshes meanwhile, if a single rank leaves nothing to do then.
    fn with_refresh(&self, time: Time) -> Time {
        let refresh = self.times.refreshes().filter(|_| self.banks == self.banks_per_rank);
        refresh.map_or(time, |Refresh { interval, busy }| {
            let pause = busy + self.times.activate[0];
            time + time / interval.saturating_sub(pause).max(1) * pause
        })
    }
}
