//! Level `bound`: a roofline (Williams, Waterman and Patterson 2009) over the units of the machine.
//!
//! Units overlap only as far as the queues between them reach. So the stream of each path is split into
//! segments of as many packets as the queues of the path hold. A segment takes as long as its busiest unit.
//! If the cores cannot hold enough packets at once to hide their program latency, it takes as long as
//! Little's law demands (Little 1961). The front end of a batch overlaps the tiles of the previous batch;
//! both share the cores, the L2 and memory. Neither is shorter than its longest packet without contention:
//!
//! ```text
//! tiles(b) = max(sum over segments of busiest unit or full cores, longest packet)        front(b) likewise
//! frame    = front(0) + sum over b of max(tiles(b), front(b + 1), shared(b), rows(b)) + latency of one packet per path
//! ```
//!
//! Totals accumulated from a stream of packets.

use activity::{Counts, Event, LineAccess, LineKind, Packet, PacketCounts, Unit};

use crate::address::AddressMap;
use crate::clock::{Clocks, Time};
use crate::demand::{CLIENTS, DemandBuilder, ServiceDemand, Station, TEXTURE_PORT, port};
use crate::spec::MachineSpec;
use crate::{Clock, LINE_BYTES, Recorder, Timed};

/// Speeds of the units.
struct UnitSpeeds<'a> {
    machine: &'a MachineSpec,
    clocks: Clocks,
    /// Grains per unit of work: a cycle, an operation of a core, or a line.
    grains_per_work: [f64; Unit::COUNT],
}

impl<'a> UnitSpeeds<'a> {
    fn new(machine: &'a MachineSpec, clocks: Clocks) -> Self {
        let servers = |unit: Unit| match unit {
            Unit::Shader => f64::from(machine.shader.cores) * f64::from(machine.shader.lanes),
            Unit::L2 => f64::from(machine.l2.lines_per_cycle),
            Unit::Dram => f64::from(machine.dram.channels) / f64::from(machine.dram.burst_cycles),
            _ => 1.0,
        };
        let grains_per_work =
            Unit::ALL.map(|unit| clocks.period(machine.common(unit).clock) as f64 / servers(unit));
        Self { machine, clocks, grains_per_work }
    }

    /// Busy time of every unit for the given work.
    fn times(&self, work: &UnitWork) -> [Time; Unit::COUNT] {
        Unit::ALL
            .map(|unit| (work[unit as usize] as f64 * self.grains_per_work[unit as usize]).ceil() as Time)
    }

    /// Latency of an empty path.
    fn latency(&self, stations: &[Station]) -> Time {
        let of = |unit: Unit| {
            let common = self.machine.common(unit);
            self.clocks.period(common.clock) * Time::from(common.latency_cycles)
        };
        stations.iter().map(|station| of(station.unit())).sum()
    }
}

/// Time of a frame from its totals.
pub fn bound(machine: &MachineSpec, clocks: Clocks, totals: &Totals, mut recorder: Recorder) -> Timed {
    let speeds = UnitSpeeds::new(machine, clocks);
    let mut work = vec![UnitWork::default(); totals.phases.len()];
    let mut paths = vec![[0; 2]; totals.phases.len()];
    for segment in totals.segments().filter(|segment| segment.packets > 0) {
        let busiest = speeds.times(&segment.work).into_iter().max().unwrap_or(0);
        paths[segment.phase][segment.path] +=
            segment.full.into_iter().fold(busiest, |most, full| most.max(full as Time));
        work[segment.phase].iter_mut().zip(segment.work).for_each(|(sum, part)| *sum += part);
    }
    let fill = PATHS.map(|path| speeds.latency(path));
    let rows = totals.rows();
    let mut now: Time = 0;
    for (number, counts) in totals.phases.iter().enumerate() {
        let busy = speeds.times(&work[number]);
        let length = busy.into_iter().chain(paths[number]).fold(rows[number], Time::max);
        let [front, tiles] = totals.longest[number];
        let used = [front, tiles] != [0; 2];
        let filled = length + if number < 2 && used { fill[number] } else { 0 };
        let end = now + filled.max(front).max(tiles);
        write(&mut recorder, &clocks, counts, &busy, [now, end]);
        now = end;
    }
    recorder.lasts(clocks.ps(now));
    let packets = totals.segments().map(|segment| u64::from(segment.packets)).sum();
    let timeline = recorder.finish();
    let share = crate::ratio_to_busiest(clocks.ps(rows.iter().sum()), &timeline);
    let cycles = clocks.cycles(Clock::Core, now);
    Timed { timeline, cycles, stalls: None, unit_cycles: 0, packets, rows: Some(share) }
}

fn write(
    recorder: &mut Recorder,
    clocks: &Clocks,
    counts: &Counts,
    busy: &[Time; Unit::COUNT],
    [from, to]: [Time; 2],
) {
    let (start, end) = (clocks.ps(from), clocks.ps(to));
    for unit in Unit::ALL.into_iter().filter(|&unit| counts.uses(unit)) {
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

/// Work of every unit: operations for the cores, lines for the L2 and memory, cycles for all others.
type UnitWork = [u64; Unit::COUNT];

/// Consecutive packets of one path that fit in its queues together.
#[derive(Clone, Debug, Default)]
struct Segment {
    pub path: usize,
    pub phase: usize,
    pub work: UnitWork,
    /// Grains for which the cores are full if no packet waits, by packets and by warps.
    pub full: [f64; 2],
    pub packets: u32,
}

/// Totals of a frame: work of every segment and events of every phase. The size grows with segments, not with
/// packets.
#[derive(Clone, Debug)]
pub struct Totals {
    /// Packets per segment, for the front end and for tiles.
    segment_packets: [u32; 2],
    /// Lines per cycle that each client of the L2 can request.
    lines_per_cycle: [u32; CLIENTS.len()],
    uncontended: Uncontended,
    open: [Segment; 2],
    closed: Vec<Segment>,
    /// Longest packet of each phase and path without contention.
    longest: Vec<[Time; 2]>,
    banks: Banks,
    /// Row time of the busiest bank, for each phase before the last.
    rows: Vec<Time>,
    /// Events of each phase. Phase 0 is the front end of batch 0. Phase `b + 1` is the tiles of batch `b` and
    /// the front end of batch `b + 1`.
    phases: Vec<Counts>,
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
            lines_per_cycle: CLIENTS.map(|unit| machine.common(unit).lines_per_cycle),
            uncontended: Uncontended::new(machine, clocks),
            open: [open(0), open(1)],
            closed: Vec::new(),
            longest: Vec::new(),
            banks: Banks::new(machine, clocks),
            rows: Vec::new(),
            phases: Vec::new(),
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
        let phase = demand.batch as usize + path;
        let open = &mut self.open[path];
        if phase != open.phase || open.packets == self.segment_packets[path] {
            let full = std::mem::replace(open, Segment { path, phase, ..Segment::default() });
            self.closed.push(full);
        }
        let work = &mut open.work;
        // A client is busy until it has requested its last line.
        let request_cycles = |port: usize| demand.lines[port].div_ceil(self.lines_per_cycle[port]);
        for &station in PATHS[path] {
            let request_cycles = port(station.unit()).map_or(0, request_cycles);
            work[station.unit() as usize] += u64::from(demand.service[station as usize].max(request_cycles));
        }
        work[Unit::Shader as usize] += u64::from(counts[Event::ShaderOps]);
        if demand.is_textured() {
            let cycles = builder.texture_cycles(demand.texels);
            work[Unit::Texture as usize] += u64::from(cycles.max(request_cycles(TEXTURE_PORT)));
        }
        work[Unit::L2 as usize] += demand.lines.iter().map(|&lines| u64::from(lines)).sum::<u64>();
        let bytes = counts[Event::DramReadBytes] + counts[Event::DramWriteBytes];
        work[Unit::Dram as usize] += u64::from(bytes / LINE_BYTES);
        let program = self.uncontended.program(demand);
        open.full.iter_mut().zip(self.uncontended.full(demand, program)).for_each(|(sum, part)| *sum += part);
        open.packets += 1;
        if self.phases.len() <= phase {
            self.rows.resize(phase, 0);
            if let Some(last) = self.rows.last_mut() {
                *last += self.banks.take_longest();
            }
            self.phases.resize(phase + 1, Counts::default());
            self.longest.resize(phase + 1, [0; 2]);
        }
        self.phases[phase] += counts;
        self.banks.add(lines);
        let longest = &mut self.longest[phase][path];
        *longest = (*longest).max(self.uncontended.packet(demand, program, counts));
    }

    /// Row time of the busiest bank in each phase.
    fn rows(&self) -> Vec<Time> {
        let mut rows = self.rows.clone();
        rows.resize(self.phases.len(), 0);
        if let Some(last) = rows.last_mut() {
            *last += self.banks.clone().take_longest();
        }
        rows
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
    /// Time of one operation of a warp.
    operation: Time,
    warp_lanes: u32,
    /// Packets and warps that fit on the cores.
    capacity: [f64; 2],
    /// Latency of a line in the L2, and the extra latency of a line from memory.
    line: [Time; 2],
}

impl Uncontended {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let common = Station::ALL.map(|station| machine.common(station.unit()));
        let period = common.map(|common| clocks.period(common.clock));
        let (shader, dram) = (&machine.shader, &machine.dram);
        // A warp wider than a core takes more than one cycle of its lanes.
        let cycles =
            shader.alu_latency_cycles.get() + shader.warp_lanes.get().div_ceil(shader.lanes.get()) - 1;
        let row = dram.latency_cycles.get()
            + dram.activate_cycles.get()
            + dram.cas_cycles.get()
            + dram.burst_cycles.get();
        Self {
            period,
            latency: std::array::from_fn(|at| period[at] * Time::from(common[at].latency_cycles)),
            operation: clocks.period(shader.clock) * Time::from(cycles),
            warp_lanes: shader.warp_lanes.get(),
            capacity: [f64::from(shader.in_flight), f64::from(shader.cores) * f64::from(shader.warps)],
            line: [
                clocks.period(machine.l2.clock) * Time::from(machine.l2.latency_cycles),
                clocks.period(dram.clock) * Time::from(row),
            ],
        }
    }

    /// Program time of a packet; all its warps run the same program.
    pub fn program(&self, demand: &ServiceDemand) -> Time {
        Time::from(demand.ops) * self.operation
    }

    /// Time for which the packet fills the cores, by packets and by warps.
    pub fn full(&self, demand: &ServiceDemand, program: Time) -> [f64; 2] {
        let [packets, warps] = self.capacity;
        [program as f64 / packets, program as f64 * f64::from(demand.warps(self.warp_lanes)) / warps]
    }

    /// Time of a packet from its first station to its last.
    pub fn packet(&self, demand: &ServiceDemand, program: Time, counts: &PacketCounts) -> Time {
        let first = if demand.front { Station::Command } else { Station::Traversal } as usize;
        let at = |station: usize| {
            self.latency[station] + self.period[station] * Time::from(demand.service[station])
        };
        let units: Time = (first..=demand.last as usize).map(at).sum();
        let [line, fetch] = self.line;
        let lines = if demand.lines == [0; CLIENTS.len()] { 0 } else { line };
        units + program + lines + if counts[Event::DramReadBytes] > 0 { fetch } else { 0 }
    }
}

/// Time each bank spends closing and opening rows. This is a lower bound: lines of each client come in stream
/// order, and clients never close each other's rows.
#[derive(Clone, Debug)]
struct Banks {
    map: AddressMap,
    banks: usize,
    /// Time to close a row and open another. Data moves meanwhile, as row and column commands have separate
    /// wires.
    row: Time,
    /// Last row of each bank and client.
    rows: Vec<[u32; CLIENTS.len()]>,
    busy: Vec<Time>,
}

impl Banks {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = &machine.dram;
        let banks = spec.banks.get() as usize;
        let all = spec.channels.get() as usize * banks;
        let row = spec.precharge_cycles.get() + spec.activate_cycles.get();
        Self {
            map: AddressMap::new(spec),
            banks,
            row: clocks.period(spec.clock) * Time::from(row),
            rows: vec![[u32::MAX; CLIENTS.len()]; all],
            busy: vec![0; all],
        }
    }

    /// Add the lines of a packet.
    pub fn add(&mut self, lines: &[LineAccess]) {
        for access in lines.iter().filter(|access| access.kind != LineKind::Hit) {
            if matches!(access.kind, LineKind::Fetch | LineKind::Drain) {
                self.line(access, access.line);
            }
            if access.victim != LineAccess::NONE {
                self.line(access, access.victim);
            }
        }
    }

    fn line(&mut self, access: &LineAccess, line: u32) {
        let Some(client) = port(access.client) else { return };
        let address = self.map.locate(line);
        let bank = address.channel * self.banks + address.bank;
        if std::mem::replace(&mut self.rows[bank][client], address.row) != address.row {
            self.busy[bank] += self.row;
        }
    }

    /// Time of the busiest bank since the last call.
    pub fn take_longest(&mut self) -> Time {
        let longest = self.busy.iter().copied().max().unwrap_or(0);
        self.busy.fill(0);
        longest
    }
}
