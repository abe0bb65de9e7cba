//! Conservation: all packets that enter leave, times add up, and the order of simulation does not matter.

use activity::{Counts, Event, LEVELS, LevelRequests, LineAccess, LineKind, Packet, PacketKind, Unit, Waits};
use proptest::prelude::*;
use timing::stepped::StepOptions;
use timing::{Clock, Clocks, MachineSpec, SharedCacheSpec};

use crate::common::{Packets, plain, size, stepped_as};

type Line = (u32, LineKind, Option<u32>);

fn line() -> impl Strategy<Value = Line> {
    let kind = prop_oneof![
        Just(LineKind::Hit),
        Just(LineKind::Fetch),
        Just(LineKind::Write),
        Just(LineKind::Allocate)
    ];
    (0u32..4096, kind, prop::option::weighted(0.2, 0u32..4096))
}

/// Lines of `client`, counted in `packet` as in the pipeline.
fn add_lines(packet: &mut Packet, client: Unit, lines: &[Line]) -> Vec<LineAccess> {
    let counts = &mut packet.counts;
    let access = |&(line, kind, victim): &Line| {
        let miss = matches!(kind, LineKind::Fetch | LineKind::Allocate);
        let victim = victim.filter(|_| miss);
        counts[Event::L2Reads] += u32::from(matches!(kind, LineKind::Hit | LineKind::Fetch));
        counts[Event::L2Writes] += u32::from(matches!(kind, LineKind::Write | LineKind::Allocate));
        counts[Event::L2Misses] += u32::from(miss);
        counts[Event::DramReadBytes] += 64 * u32::from(kind == LineKind::Fetch);
        counts[Event::DramWriteBytes] += 64 * u32::from(victim.is_some() || kind == LineKind::Drain);
        let mut access = LineAccess::new(client, line, kind);
        victim.or((kind == LineKind::Drain).then_some(line)).into_iter().for_each(|line| access.write(line));
        access
    };
    lines.iter().map(access).collect()
}

type Some5 = (u32, u32, u32, u32, u32);

fn tile_packet(
    (tiles, samples, reads, threads, fetches): Some5,
    depth: &[Line],
    batch: u32,
) -> (Packet, Vec<LineAccess>) {
    let mut packet = Packet { batch, ..Packet::new(PacketKind::Tile, 0) };
    let counts = &mut packet.counts;
    counts[Event::TilesVisited] = tiles;
    counts[Event::SamplesTested] = samples;
    counts[Event::DepthReads] = reads;
    counts[Event::ShadingLookups] = reads;
    counts[Event::PixelInvocations] = 4 * threads;
    counts[Event::ShaderOps] = 4 * threads * 7;
    counts[Event::TextureFetches] = if threads > 0 { fetches } else { 0 };
    counts[Event::ColourWrites] = reads;
    let (first, rest) = depth.split_at(depth.len() / 3);
    let (second, third) = rest.split_at(rest.len() / 2);
    let mut lines = add_lines(&mut packet, Unit::Depth, first);
    lines.extend(add_lines(&mut packet, Unit::Texture, if threads > 0 { second } else { &[] }));
    lines.extend(add_lines(&mut packet, Unit::Colour, third));
    (packet, lines)
}

fn vertices_packet(triangles: u32, lines: &[Line], batch: u32) -> (Packet, Vec<LineAccess>) {
    let mut packet = Packet { batch, ..Packet::new(PacketKind::Vertices, 0) };
    packet.counts[Event::Indices] = 3 * triangles;
    packet.counts[Event::VertexInvocations] = triangles;
    packet.counts[Event::ShaderOps] = 5 * triangles;
    packet.counts[Event::TrianglesIn] = triangles;
    let lines = add_lines(&mut packet, Unit::Command, lines);
    (packet, lines)
}

/// Front-end packets and tiles of a batch.
type Batch = (Vec<(u32, Vec<Line>)>, Vec<(Some5, Vec<Line>)>);

fn batch() -> impl Strategy<Value = Batch> {
    let tile = ((0u32..9, 0u32..30, 0u32..9, 0u32..5, 0u32..20), prop::collection::vec(line(), 0..12));
    let front = (1u32..20, prop::collection::vec(line(), 0..6));
    (prop::collection::vec(front, 1..6), prop::collection::vec(tile, 0..25))
}

/// A pass with the front end one batch ahead, as in the pipeline.
fn pass(number: u32, batches: &[Batch]) -> Packets {
    let mut stream = Packets::new();
    let front = |stream: &mut Packets, b: usize| {
        if let Some((fronts, _)) = batches.get(b) {
            stream.extend(fronts.iter().map(|(n, lines)| vertices_packet(*n, lines, b as u32)));
        }
    };
    front(&mut stream, 0);
    for (b, (_, tiles)) in batches.iter().enumerate() {
        front(&mut stream, b + 1);
        stream.extend(tiles.iter().map(|(some, lines)| tile_packet(*some, lines, b as u32)));
    }
    stream.iter_mut().for_each(|(packet, _)| packet.pass = number);
    stream
}

/// A pass of four batches.
pub fn packets() -> impl Strategy<Value = Packets> {
    prop::collection::vec(batch(), 4).prop_map(|batches| pass(0, &batches))
}

/// The event that only barriers have, once each.
pub const OF_BARRIERS: Event = Event::DepthWrites;

fn barrier(pass: u32, waits: Waits, lines: &[Line]) -> (Packet, Vec<LineAccess>) {
    let mut packet = Packet::new(PacketKind::Barrier(waits), pass);
    packet.counts[OF_BARRIERS] = 1;
    let written = |&(line, kind, victim): &Line| match kind {
        LineKind::Hit => (line, LineKind::Write, None),
        LineKind::Fetch => (line, LineKind::Drain, None),
        kind => (line, kind, victim),
    };
    let lines: Vec<Line> = lines.iter().map(written).collect();
    let (depth, colour) = lines.split_at(lines.len() / 2);
    let mut all = add_lines(&mut packet, Unit::Depth, depth);
    all.extend(add_lines(&mut packet, Unit::Colour, colour));
    (packet, all)
}

/// Some passes of some batches. A barrier may come before each, and belongs to it.
pub fn passes() -> impl Strategy<Value = Packets> {
    let waits = prop_oneof![Just(Waits::Tiles), Just(Waits::All)];
    let barriers = prop::option::weighted(0.7, (waits, prop::collection::vec(line(), 0..16)));
    let passes = prop::collection::vec((barriers, prop::collection::vec(batch(), 0..4)), 1..5);
    passes.prop_map(|passes| {
        let mut stream = Packets::new();
        for ((before, batches), number) in passes.iter().zip(0..) {
            stream.extend(before.iter().map(|(waits, lines)| barrier(number, *waits, lines)));
            stream.extend(pass(number, batches));
        }
        stream
    })
}

/// Machines from narrow to wide.
pub fn machine() -> impl Strategy<Value = MachineSpec> {
    let small = (1u32..6, 1u32..4, 1u32..4, 1u32..4);
    let shader = (1u32..4, 1u32..9, 1u32..9, 1u32..5, 1u32..9);
    let memory = (2u32..9, 1u32..4, 1u32..5, 1u32..5, 1u32..4);
    (small, shader, memory).prop_map(|((queue, latency, in_flight, port), s, d)| {
        let mut m = plain();
        for unit in [&mut m.setup, &mut m.traversal, &mut m.z_cull, &mut m.sample_test, &mut m.shading_cache]
        {
            (unit.queue, unit.latency_cycles) = (size(queue), size(latency));
        }
        for unit in [&mut m.command, &mut m.depth, &mut m.texture, &mut m.colour] {
            (unit.queue, unit.latency_cycles, unit.in_flight) = (size(queue), size(latency), size(in_flight));
        }
        (m.shader.queue, m.shader.in_flight, m.l2.queue) = (size(queue), size(in_flight), size(port));
        (m.shader.cores, m.shader.lanes, m.shader.warp_lanes) = (size(s.0), size(s.1), size(s.2));
        (m.shader.warps, m.shader.alu_latency_cycles) = (size(s.3), size(s.4));
        (m.dram.queue, m.dram.channels, m.dram.banks) = (size(d.0), size(d.1), size(d.2));
        (m.dram.burst_cycles, m.l2.lines_per_cycle) = (size(d.3), size(d.4));
        // The same sizes decide which levels it has.
        let level = |clock, lines| SharedCacheSpec {
            clock,
            latency_cycles: size(latency),
            queue: size(port),
            lines_per_cycle: size(lines),
        };
        m.llc = (d.1 > 1).then(|| level(Clock::Core, d.4));
        m.edram = (d.2 > 2).then(|| level(Clock::Memory, 1));
        let levels = m.levels().into_iter().flatten().count() as u32;
        m.dram.queue = size(d.0 + levels);
        m
    })
}

/// The same packets on a machine with levels below the L2: each level has some of the lines read, and evicts some
/// for those that it has not.
pub fn through_levels(packets: Packets, machine: &MachineSpec) -> Packets {
    let through = |(mut packet, lines): (Packet, Vec<LineAccess>)| {
        let lines: Vec<_> = lines.into_iter().map(|access| through_all(access, machine)).collect();
        for (level, requests) in lines.iter().flat_map(|access| LEVELS.into_iter().zip(access.levels)) {
            requests.events(level).for_each(|(event, count)| packet.counts[event] += count);
        }
        packet.counts[Event::DramReadBytes] =
            64 * lines.iter().filter_map(LineAccess::fetched).count() as u32;
        packet.counts[Event::DramWriteBytes] = 64 * lines.iter().flat_map(LineAccess::written).count() as u32;
        (packet, lines)
    };
    packets.into_iter().map(through).collect()
}

fn through_all(access: LineAccess, machine: &MachineSpec) -> LineAccess {
    let mut passed = LineAccess::new(access.client, access.line, access.kind);
    let mut written: Vec<u32> = access.written().collect();
    for (at, _) in machine.levels().iter().enumerate().filter(|(_, spec)| spec.is_some()) {
        let is_read = passed.kind == LineKind::Fetch;
        let misses = |line: u32| (line >> (2 * at)).is_multiple_of(2);
        let requested = is_read.then_some(passed.line).into_iter().chain(written.iter().copied());
        let missed: Vec<u32> = requested.filter(|&line| misses(line)).collect();
        let evicted: Vec<u32> =
            missed.iter().filter(|line| !line.is_multiple_of(3)).map(|line| line ^ 1024).collect();
        passed.levels[at] = LevelRequests {
            reads: is_read.into(),
            writes: written.len() as u8,
            misses: missed.len() as u8,
            writebacks: evicted.len() as u8,
        };
        if is_read && !misses(passed.line) {
            passed.kind = LineKind::Below;
        }
        written = evicted;
    }
    written.into_iter().for_each(|line| passed.write(line));
    passed
}

pub fn total(packets: &Packets) -> Counts {
    packets.iter().fold(Counts::default(), |mut sum, (packet, _)| {
        sum += &packet.counts;
        sum
    })
}

pub fn two_clocks() -> impl Strategy<Value = Clocks> {
    prop_oneof![Just((1e9, 1e9)), Just((925e6, 1375e6)), Just((3e8, 1e8))]
        .prop_map(|(a, b)| Clocks::new(a, b).unwrap())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_packet_leaves_and_times_add_up(packets in prop_oneof![packets(), passes()], machine in machine(), clocks in two_clocks()) {
        let packets = through_levels(packets, &machine);
        let timed = stepped_as(&machine, clocks, &packets, &StepOptions::default());
        prop_assert_eq!(timed.timeline.total(), total(&packets));
        let stalls = timed.stalls.unwrap();
        for unit in Unit::ALL {
            let whole = stalls.frame() * u64::from(stalls.servers(unit));
            prop_assert_eq!(stalls.of(unit).total(), whole, "{:?}", unit);
        }
        let bins = timed.timeline.bins.iter();
        prop_assert!(bins.clone().all(|bin| bin.busy_ps.iter().all(|&busy| busy <= timed.timeline.bin_ps)));
    }

    #[test]
    fn neither_the_order_of_visits_nor_skipping_matters(
        packets in prop_oneof![packets(), passes()],
        machine in machine(),
        clocks in two_clocks(),
        order in Just(Unit::ALL.to_vec()).prop_shuffle(),
    ) {
        let packets = through_levels(packets, &machine);
        let plainly = stepped_as(&machine, clocks, &packets, &StepOptions { skip_idle: false, ..StepOptions::default() });
        let order = std::array::from_fn(|at| order[at]);
        for skip in [false, true] {
            let other = stepped_as(&machine, clocks, &packets, &StepOptions { order, skip_idle: skip });
            prop_assert_eq!(other.cycles, plainly.cycles);
            prop_assert_eq!(&other.timeline, &plainly.timeline);
            prop_assert_eq!(&other.stalls, &plainly.stalls);
            prop_assert_eq!(&other.passes, &plainly.passes);
        }
    }
}
