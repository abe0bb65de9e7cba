//! Totals accumulated from a stream of packets.

use activity::{Counts, Event, LineAccess, LineKind, PacketCounts, Unit};

use crate::LINE_BYTES;
use crate::address::AddressMap;
use crate::clock::{Clocks, Time};
use crate::demand::{CLIENTS, DemandBuilder, ServiceDemand, Station, TEXTURE_PORT, port};
use crate::spec::MachineSpec;

/// Work of every unit: operations for the cores, lines for the L2 and memory, cycles for all others.
pub(super) type UnitWork = [u64; Unit::COUNT];

/// Consecutive packets of one path that fit in its queues together.
#[derive(Clone, Debug, Default)]
pub(super) struct Segment {
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
    pub(super) longest: Vec<[Time; 2]>,
    banks: Banks,
    /// Row time of the busiest bank, for each phase before the last.
    rows: Vec<Time>,
    /// Events of each phase. Phase 0 is the front end of batch 0. Phase `b + 1` is the tiles of batch `b` and
    /// the front end of batch `b + 1`.
    pub(super) phases: Vec<Counts>,
}

pub(super) const PATHS: [&[Station]; 2] = [
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
            let cycles = builder.texture_cycles(demand.texels[0], demand.texels[1]);
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
    pub(super) fn rows(&self) -> Vec<Time> {
        let mut rows = self.rows.clone();
        rows.resize(self.phases.len(), 0);
        if let Some(last) = rows.last_mut() {
            *last += self.banks.clone().take_longest();
        }
        rows
    }

    pub(super) fn segments(&self) -> impl Iterator<Item = &Segment> {
        self.closed.iter().chain(&self.open)
    }
}

/// Times of packets that never wait for another packet, in grains.
#[derive(Clone, Debug)]
pub(super) struct Uncontended {
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
pub(super) struct Banks {
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
