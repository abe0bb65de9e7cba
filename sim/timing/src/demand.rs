//! Service demand of packets: the work of each station of one machine for a packet. All levels read the same
//! demands. Work is in fractions of a cycle: a unit that has time left in a cycle goes on with the next
//! packet in the same cycle. [`Server`] is a unit that does so.

use std::ops::Range;

use activity::{Event, LineAccess, Packet, PacketCounts, PacketKind, Unit, Waits};

use crate::LINE_BYTES;
use crate::clock::{Clocks, Time};
use crate::spec::{DATA_EVENTS, DataUnit, MachineSpec};

/// What a warp on the shader cores is part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WarpKind {
    /// A packet of vertices.
    Vertices,
    /// A packet of pixels, or a group.
    Pixels,
}

impl WarpKind {
    /// Both kinds.
    pub const ALL: [Self; 2] = [Self::Vertices, Self::Pixels];

    /// The kind that takes turns with this one.
    pub fn other(self) -> Self {
        if self == Self::Vertices { Self::Pixels } else { Self::Vertices }
    }
}

/// A station on the path of a packet. The shader cores are two stations, one for vertices and one for pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
#[allow(missing_docs, reason = "the units of the block diagram")]
pub enum Station {
    Command,
    Vertex,
    Setup,
    Traversal,
    ZCull,
    SampleTest,
    Depth,
    ShadingCache,
    Pixel,
    Colour,
}

impl Station {
    /// All stations, in stream order.
    pub const ALL: [Self; 10] = [
        Self::Command,
        Self::Vertex,
        Self::Setup,
        Self::Traversal,
        Self::ZCull,
        Self::SampleTest,
        Self::Depth,
        Self::ShadingCache,
        Self::Pixel,
        Self::Colour,
    ];
    /// Number of stations.
    pub const COUNT: usize = Self::ALL.len();

    /// Unit at the station.
    pub const fn unit(self) -> Unit {
        match self {
            Self::Command => Unit::Command,
            Self::Vertex | Self::Pixel => Unit::Shader,
            Self::Setup => Unit::Setup,
            Self::Traversal => Unit::Traversal,
            Self::ZCull => Unit::ZCull,
            Self::SampleTest => Unit::SampleTest,
            Self::Depth => Unit::Depth,
            Self::ShadingCache => Unit::ShadingCache,
            Self::Colour => Unit::Colour,
        }
    }
}

/// Clients of the L2, in the order of its ports.
pub const CLIENTS: [Unit; 7] =
    [Unit::Command, Unit::Depth, Unit::Texture, Unit::Colour, Unit::Compute, Unit::Setup, Unit::Traversal];

/// Port of the command unit.
pub const COMMAND_PORT: usize = 0;

/// Port of the colour unit.
pub const COLOUR_PORT: usize = 3;

/// Port of a client of the L2; `None` for other units.
pub fn port(unit: Unit) -> Option<usize> {
    CLIENTS.iter().position(|&client| client == unit)
}

/// What a group needs of the cores besides threads and operations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GroupDemand {
    /// Operations one after another on its longest way: those of its longest warp between barriers. In all of them
    /// together its warps do the operations of the group.
    pub steps: u32,
    /// Bytes of the shared memory of its core that it holds.
    pub shared_bytes: u32,
}

/// Service demand of one packet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServiceDemand {
    /// Whether the packet takes the front end (command to set-up) or the tile path (traversal to colour).
    pub front: bool,
    /// Pass number in the frame.
    pub pass: u32,
    /// Draw number in the pass; [`Packet::NONE`] for work of no single draw.
    pub draw: u32,
    /// Batch number in the frame, all passes counted. Barriers are in no batch.
    pub batch: u32,
    /// For a barrier: which later packets wait for it.
    pub barrier: Option<Waits>,
    /// Last station with work.
    pub last: Station,
    /// Work of each station; 0 at the shader cores.
    pub service: [Work; Station::COUNT],
    /// Shader threads.
    pub threads: u32,
    /// Operations per thread.
    pub ops: u32,
    /// Counts of those events of its data unit that may have a rate, of all threads.
    pub data: [u32; DATA_EVENTS],
    /// For a group of lanes, which is on one core as a whole.
    pub group: Option<GroupDemand>,
    /// Index of the first line in the store.
    pub first_line: usize,
    /// Lines requested by each client, in the order of [`CLIENTS`].
    pub lines: [u32; CLIENTS.len()],
}

impl ServiceDemand {
    /// Index range of one client's lines in the store.
    pub fn lines_of(&self, port: usize) -> Range<usize> {
        let before: u32 = self.lines[..port].iter().sum();
        let first = self.first_line + before as usize;
        first..first + self.lines[port] as usize
    }

    /// The unit that works for its warps.
    pub fn data_unit(&self) -> DataUnit {
        if self.group.is_some() { DataUnit::Compute } else { DataUnit::Texture }
    }

    /// Whether the threads use their data unit.
    pub fn uses_data(&self) -> bool {
        self.data != [0; DATA_EVENTS] || self.lines[self.data_unit().port()] > 0
    }

    /// Operations of a warp one after another.
    pub fn steps(&self) -> u32 {
        self.group.map_or(self.ops, |group| group.steps.max(self.ops))
    }

    /// First station of its path.
    pub fn first(&self) -> Station {
        if self.front { Station::Command } else { Station::Traversal }
    }

    /// Number of warps of at most `lanes` threads.
    pub fn warps(&self, lanes: u32) -> u32 {
        self.threads.div_ceil(lanes)
    }
}

/// Range of `whole` that belongs to part number `part` of `parts`; the ranges cover `whole` exactly.
pub fn share(whole: u32, part: u32, parts: u32) -> Range<u32> {
    let up_to = |part: u32| (u64::from(whole) * u64::from(part) / u64::from(parts.max(1))) as u32;
    up_to(part)..up_to(part + 1)
}

/// Builder of service demands from packets.
#[derive(Clone, Debug)]
pub struct DemandBuilder {
    /// Cycles per event, by station.
    costs: [Vec<(Event, f64)>; Station::COUNT],
    /// Cycles per event of each data unit.
    data_cycles: [[f64; DATA_EVENTS]; DataUnit::ALL.len()],
    /// Lines per cycle that each client of the L2 can request.
    lines_per_cycle: [u32; CLIENTS.len()],
    /// The last two passes, each with the number of its first batch in the frame: the front end of a pass comes before
    /// the last tiles of the one before.
    passes: [(u32, u32); 2],
    /// Number of the last batch.
    last_batch: u32,
}

impl DemandBuilder {
    /// A builder for packets on `machine`.
    pub fn new(machine: &MachineSpec) -> Self {
        let costs = Station::ALL.map(|station| {
            let rates = machine.common(station.unit()).rates;
            rates.iter().flat_map(|rates| rates.iter()).map(|(event, rate)| (event, rate.recip())).collect()
        });
        let cycles = |event: Event| {
            let mut rates = machine.common(event.unit()).rates.into_iter().flat_map(|rates| rates.iter());
            rates.find(|(e, _)| *e == event).map_or(0.0, |(_, rate)| rate.recip())
        };
        Self {
            costs,
            data_cycles: DataUnit::ALL.map(|unit| unit.events().map(cycles)),
            lines_per_cycle: CLIENTS.map(|unit| machine.common(unit).lines_per_cycle),
            passes: [(0, 0); 2],
            last_batch: 0,
        }
    }

    /// Demand of the next packet of the stream; passes come one after another. `lines` are appended to
    /// `store`, sorted by client.
    pub fn build(
        &mut self,
        packet: &Packet,
        lines: &[LineAccess],
        store: &mut Vec<LineAccess>,
    ) -> ServiceDemand {
        let counts = &packet.counts;
        let front = packet.kind.is_of_front_end();
        let barrier = match packet.kind {
            PacketKind::Barrier(waits) => Some(waits),
            _ => None,
        };
        let batch = if barrier.is_some() { self.last_batch } else { self.batch_of(packet) };
        let stations = if front { Station::Command as usize..3 } else { 3..Station::COUNT };
        let group = (packet.kind == PacketKind::Compute).then(|| GroupDemand {
            steps: counts[Event::GroupSteps],
            shared_bytes: counts[Event::SharedBytes],
        });
        let threads = match packet.kind {
            PacketKind::Compute => Event::GroupLanes,
            _ if front => Event::VertexInvocations,
            _ => Event::PixelInvocations,
        };
        let mut demand = ServiceDemand {
            front,
            pass: packet.pass,
            draw: packet.draw,
            batch,
            barrier,
            last: if front { Station::Command } else { Station::Traversal },
            service: [0; Station::COUNT],
            threads: counts[threads],
            ops: 0,
            data: [0; DATA_EVENTS],
            group,
            first_line: store.len(),
            lines: [0; CLIENTS.len()],
        };
        demand.data = demand.data_unit().events().map(|event| counts[event]);
        demand.ops = counts[Event::ShaderOps].div_ceil(demand.threads.max(1));
        if !lines.is_empty() {
            demand.lines = sorted(lines, store);
        }
        if group.is_some() {
            demand.last = Station::Pixel;
            return demand;
        }
        for station in &Station::ALL[stations] {
            let used = counts.uses(station.unit())
                || port(station.unit()).is_some_and(|port| demand.lines[port] > 0);
            if used {
                demand.last = *station;
                demand.service[*station as usize] = self.work(*station, counts);
            }
        }
        demand
    }

    /// Work of a data unit for its events `data`, without line requests. The slowest of its events counts.
    pub fn data_work(&self, unit: DataUnit, data: [u32; DATA_EVENTS]) -> Work {
        let cycles = self.data_cycles[unit as usize];
        let parts = data.into_iter().zip(cycles).map(|(count, cycles)| f64::from(count) * cycles);
        work_of(parts.fold(0.0, f64::max))
    }

    /// Add the work of a packet to `work`. A client of the L2 works until it has requested its last line.
    pub(crate) fn add_work(&self, demand: &ServiceDemand, counts: &PacketCounts, work: &mut UnitWork) {
        let mut add = |unit: Unit, amount: u64| work[unit as usize] += amount;
        let service = |station: Station| demand.service[station as usize];
        let unit = demand.data_unit();
        let data = if demand.uses_data() { self.data_work(unit, demand.data) } else { 0 };
        Station::ALL.into_iter().for_each(|station| add(station.unit(), service(station)));
        add(unit.unit(), data);
        add(Unit::Shader, counts[Event::ShaderOps].into());
        add(Unit::Llc, u64::from(counts[Event::LlcReads]) + u64::from(counts[Event::LlcWrites]));
        add(Unit::Edram, u64::from(counts[Event::EdramReads]) + u64::from(counts[Event::EdramWrites]));
        let bytes = u64::from(counts[Event::DramReadBytes]) + u64::from(counts[Event::DramWriteBytes]);
        add(Unit::Dram, bytes / u64::from(LINE_BYTES));
        if demand.lines == [0; CLIENTS.len()] {
            return;
        }
        let [command, depth, colour, setup, traversal] =
            [Station::Command, Station::Depth, Station::Colour, Station::Setup, Station::Traversal]
                .map(service);
        let served = [command, depth, data, colour, data, setup, traversal];
        for (port, served) in served.into_iter().enumerate() {
            let requests = request_work(demand.lines[port], self.lines_per_cycle[port]);
            add(CLIENTS[port], requests.saturating_sub(served));
            add(Unit::L2, demand.lines[port].into());
        }
    }

    /// Work of `station` for `counts`, without line requests. The parts of a unit work in parallel, so the slowest
    /// one counts.
    fn work(&self, station: Station, counts: &PacketCounts) -> Work {
        let parts =
            self.costs[station as usize].iter().map(|&(event, cycles)| f64::from(counts[event]) * cycles);
        work_of(parts.fold(0.0, f64::max))
    }

    /// Number of the packet's batch in the frame: batches of a pass follow those of the pass before.
    fn batch_of(&mut self, packet: &Packet) -> u32 {
        if self.passes.iter().all(|(pass, _)| *pass != packet.pass) {
            self.passes = [self.passes[1], (packet.pass, self.last_batch + 1)];
        }
        let first = self.passes.iter().find(|(pass, _)| *pass == packet.pass).map_or(0, |(_, first)| *first);
        let batch = first + packet.batch;
        self.last_batch = self.last_batch.max(batch);
        batch
    }
}

/// Append `lines` to `store`, grouped by client in the order of the ports. Returns the number per client.
fn sorted(lines: &[LineAccess], store: &mut Vec<LineAccess>) -> [u32; CLIENTS.len()] {
    let mut of_units = [0; Unit::COUNT];
    lines.iter().for_each(|access| of_units[access.client as usize] += 1);
    CLIENTS.map(|client| {
        let count = of_units[client as usize];
        if count == lines.len() {
            store.extend_from_slice(lines);
        } else if count > 0 {
            store.extend(lines.iter().filter(|access| access.client == client));
        }
        count as u32
    })
}

/// Work of `lines` requests of a client that can make so many in a cycle.
pub(crate) fn request_work(lines: u32, lines_per_cycle: u32) -> Work {
    Work::from(lines) * CYCLE / Work::from(lines_per_cycle.max(1))
}

/// Work of a unit: cycles of its clock, in units of 1 / [`CYCLE`].
pub type Work = u64;

/// Work of a whole cycle.
pub const CYCLE: Work = 1 << 16;

/// Work of so many cycles, rounded up to a unit of work except for excess within rounding error.
fn work_of(cycles: f64) -> Work {
    let work = ((cycles - 1e-6) * CYCLE as f64).max(0.0);
    // `f64::ceil` is a function call on x86-64 without SSE4.1.
    let below = work as Work;
    below.saturating_add(Work::from((below as f64) < work)).min(MAX_WORK)
}

/// Most work of a packet, so that its time does not overflow: as many cycles as fit into 32 bits.
const MAX_WORK: Work = u32::MAX as Work * CYCLE;

/// Time of `work` in cycles of `period` grains, rounded down to grains.
pub(crate) fn time_of(work: Work, period: Time) -> Time {
    work / CYCLE * period + work % CYCLE * period / CYCLE
}

/// How far a unit has come: the beginning of a cycle, and the part of that cycle that is used.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Server {
    at: Time,
    used: Work,
}

impl Server {
    /// The part of the cycle at `now` that is used so far.
    pub fn used_at(&self, now: Time) -> Work {
        if self.at == now { self.used } else { 0 }
    }

    /// Serve `work` from the cycle at `start` on, after what is used of it. Returns the beginning of the
    /// cycle in which it ends.
    pub fn serve(&mut self, start: Time, period: Time, work: Work) -> Time {
        let end = self.used_at(start) + work;
        *self = Self { at: start + period * (end / CYCLE), used: end % CYCLE };
        self.at
    }

    /// The end of the last cycle that is used in part.
    pub fn used_until(&self, period: Time) -> Option<Time> {
        (self.used > 0).then_some(self.at + period)
    }
}

/// Work of every unit: operations for the cores, lines for the L2, the levels below it and memory, parts of cycles
/// ([`Work`](crate::Work)) for all others.
pub(crate) type UnitWork = [u64; Unit::COUNT];

/// Speeds of the units.
#[derive(Clone, Debug)]
pub(crate) struct UnitSpeeds {
    /// Grains per unit of work.
    grains_per_work: [f64; Unit::COUNT],
}

impl UnitSpeeds {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let servers = |unit: Unit| match unit {
            Unit::Shader => f64::from(machine.shader.cores) * f64::from(machine.shader.lanes),
            Unit::L2 => f64::from(machine.l2.lines_per_cycle),
            Unit::Llc => machine.llc.as_ref().map_or(1.0, |level| level.lines_per_cycle.into()),
            Unit::Edram => machine.edram.as_ref().map_or(1.0, |level| level.lines_per_cycle.into()),
            Unit::Dram => f64::from(machine.dram.channels) / f64::from(machine.dram.burst_cycles),
            _ => CYCLE as f64,
        };
        let grains_per_work =
            Unit::ALL.map(|unit| clocks.period(machine.common(unit).clock) as f64 / servers(unit));
        Self { grains_per_work }
    }

    /// Busy time of every unit for the given work.
    pub fn times(&self, work: &UnitWork) -> [Time; Unit::COUNT] {
        Unit::ALL
            .map(|unit| (work[unit as usize] as f64 * self.grains_per_work[unit as usize]).ceil() as Time)
    }

    /// Busy time of the busiest unit, and of the busiest one other than the cores.
    pub fn busiest(&self, work: &UnitWork) -> [Time; 2] {
        let times = self.times(work);
        let others = Unit::ALL.into_iter().filter(|&unit| unit != Unit::Shader);
        let stage = others.map(|unit| times[unit as usize]).fold(0, Time::max);
        [stage.max(times[Unit::Shader as usize]), stage]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up() {
        for (whole, parts) in [(0, 1), (7, 3), (100, 7), (3, 5)] {
            assert_eq!((0..parts).map(|part| share(whole, part, parts).len() as u32).sum::<u32>(), whole);
        }
    }

    #[test]
    fn ports_and_events_belong_to_the_data_units() {
        assert_eq!(port(Unit::Colour), Some(COLOUR_PORT));
        for (unit, number) in DataUnit::ALL.into_iter().zip(0..) {
            assert_eq!((unit as usize, port(unit.unit())), (number, Some(unit.port())));
            assert!(unit.events().iter().all(|event| event.unit() == unit.unit()));
        }
    }

    #[test]
    fn packets_share_a_cycle_until_it_is_used() {
        let mut server = Server::default();
        let ends: Vec<_> = (0..6).map(|_| server.serve(server.at.max(30), 10, work_of(0.4))).collect();
        assert_eq!(ends, [30, 30, 40, 40, 50, 50]);
        // A packet that comes later does not begin in the rest of an earlier cycle.
        assert_eq!((server.used_at(50), server.used_until(10)), (6 * work_of(0.4) % CYCLE, Some(60)));
        assert_eq!((server.serve(60, 10, CYCLE / 2), server.serve(60, 10, 3 * CYCLE / 2)), (60, 80));
        assert_eq!(server.used_until(10), None);
    }

    #[test]
    fn work_rounds_up_except_for_rounding_errors() {
        let exact = [0.0, 1.0, 0.25, 3.0 * (1.0 / 3.0), 49.0 * (1.0 / 49.0)];
        assert_eq!(exact.map(work_of), [0, CYCLE, CYCLE / 4, CYCLE, CYCLE]);
        assert_eq!(3 * work_of(1.0 / 3.0), CYCLE + 2, "no unit is faster than its rate");
        assert_eq!([work_of(1e300), work_of(1e10)], [MAX_WORK; 2]);
    }

    #[test]
    fn work_takes_time_in_proportion() {
        assert_eq!((time_of(5 * CYCLE / 2, 10), time_of(CYCLE / 3, 1)), (25, 0));
    }
}
