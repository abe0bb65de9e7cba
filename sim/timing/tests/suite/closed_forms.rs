//! Pipelines whose cycles are known exactly.

use activity::{Event, LEVELS, LevelRequests, LineAccess, LineKind, Packet, PacketKind, Unit};
use proptest::prelude::*;
use timing::{Clock, MachineSpec, SharedCacheSpec};

use crate::common::{
    Packets, bound_level, clocks, packet, packet_level, plain, read, size, stepped, tile, tiles,
};

fn cycles(packets: &Packets) -> u64 {
    stepped(&plain(), packets).cycles
}

#[test]
fn one_unit_takes_the_sum_and_its_latency() {
    let packets = tiles([3, 5, 7].map(|n| vec![(Event::TilesVisited, n)]));
    assert_eq!(cycles(&packets), 3 + 5 + 7 + 1);
    let mut machine = plain();
    machine.traversal.latency_cycles = size(9);
    assert_eq!(stepped(&machine, &packets).cycles, 3 + 5 + 7 + 9);
}

/// Tiles with `a` cycles in traversal and `b` in z-cull.
fn pair(works: &[(u32, u32)]) -> Packets {
    tiles(works.iter().map(|&(a, b)| vec![(Event::TilesVisited, a), (Event::ZCullTests, b)]))
}

#[test]
fn two_units_overlap_and_the_slower_sets_the_pace() {
    // One cycle of latency after each unit.
    assert_eq!(cycles(&pair(&[(2, 5); 10])), 2 + 1 + 10 * 5 + 1);
    assert_eq!(cycles(&pair(&[(5, 2); 10])), 10 * 5 + 1 + 2 + 1);
}

/// Tandem queues with finite buffers and blocking after service (Dallery and Gershwin 1992): the textbook
/// recurrence, plus one cycle for anything that passes between units, whether a packet or a free slot.
fn tandem(works: &[(u32, u32)], queue: usize) -> u64 {
    let (mut free, mut second_free) = (0u64, 0u64);
    let mut starts: Vec<u64> = Vec::new();
    for (k, &(a, b)) in works.iter().enumerate() {
        let room = if k >= queue { starts[k - queue] + 1 } else { 0 };
        free = (free + u64::from(a)).max(room);
        let start = second_free.max(free + 1);
        starts.push(start);
        second_free = start + u64::from(b);
    }
    second_free + 1
}

#[test]
fn a_full_queue_blocks_by_hand() {
    let mut machine = plain();
    let works: Vec<_> = [(1, 100)].into_iter().chain([(10, 1); 20]).collect();
    assert_eq!(stepped(&machine, &pair(&works)).cycles, 1 + 20 * 10 + 1 + 1 + 1);
    // A queue of one. The first packet starts in z-cull at 2 and leaves at 102. The second is in the queue
    // since 11; the third is done at 21 and blocked. The second starts at 102, which is visible at 103, when
    // the third leaves. 18 more follow, ten cycles apart.
    machine.z_cull.queue = size(1);
    assert_eq!(stepped(&machine, &pair(&works)).cycles, 103 + 18 * 10 + 1 + 1 + 1);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn two_units_with_a_queue_of_k(works in prop::collection::vec((0u32..20, 0u32..20), 1..60), queue in 1u32..9) {
        let mut machine = plain();
        machine.z_cull.queue = size(queue);
        // A tile without events in z-cull ends at traversal, so each gets one event there.
        let works: Vec<_> = works.into_iter().map(|(a, b)| (a, b + 1)).collect();
        prop_assert_eq!(stepped(&machine, &pair(&works)).cycles, tandem(&works, queue as usize));
    }
}

/// Pixels through the shading cache (one look-up) and the cores.
fn pixels(threads: u32, ops: u32) -> Packet {
    tile(&[(Event::PixelInvocations, threads), (Event::ShaderOps, threads * ops)])
}

#[test]
fn a_lone_warp_takes_its_latency_for_every_operation() {
    // Five units before the cores, one cycle of latency each and no work; one cycle to reach the core; one to
    // leave.
    let before = 5 + 1;
    let mut machine = plain();
    machine.shader.alu_latency_cycles = size(6);
    let one = vec![(pixels(4, 10), Vec::new())];
    assert_eq!(stepped(&machine, &one).cycles, before + 10 * 6 + 1);
    // With one lane an operation of four threads is issued over four cycles.
    machine.shader.lanes = size(1);
    assert_eq!(stepped(&machine, &one).cycles, before + 10 * (6 + 3) + 1);
}

#[test]
fn resident_warps_hide_latency_until_the_lanes_are_full() {
    let mut machine = plain();
    machine.shader.alu_latency_cycles = size(6);
    let run = |machine: &_, warps: u32| stepped(machine, &vec![(pixels(4 * warps, 10), Vec::new())]).cycles;
    // Warps are sent one per cycle; up to six share the latency of one.
    for warps in 1..=6 {
        assert_eq!(run(&machine, warps), 6 + 10 * 6 + u64::from(warps - 1) + 1, "{warps}");
    }
    // Eight warps fill the lanes: eighty operations, one per cycle, plus the latency of the last.
    assert_eq!(run(&machine, 8), 6 + 80 - 1 + 6 + 1);
    // Two cores with half the warps each; warps alternate between the cores.
    machine.shader.cores = size(2);
    assert_eq!(run(&machine, 8), 6 + 7 + 10 * 6 + 1);
}

#[test]
fn a_shared_resource_serves_n_clients_in_turn() {
    // Four clients request m lines each in the same cycles, and the L2 accepts one per cycle. The time of the
    // vertices is known exactly.
    let lines = |unit, m: u32| (0..m).map(|n| read(unit, n, LineKind::Hit)).collect::<Vec<LineAccess>>();
    let m = 50;
    let vertices = packet(PacketKind::Vertices, &[(Event::Indices, 1)]);
    let alone = vec![(vertices, lines(Unit::Command, m))];
    // The first request is visible at 1, the last is accepted at m. Its line arrives one cycle later, and the
    // packet is done after one more.
    assert_eq!(cycles(&alone), u64::from(m) + 1 + 1);
    // A tile requests depth lines meanwhile: twice as many lines. The tile starts four cycles later and has
    // its last line when all 2 m lines are accepted.
    let mut second = packet(PacketKind::Tile, &[(Event::DepthReads, 1)]);
    second.batch = 1;
    let both = vec![(vertices, lines(Unit::Command, m)), (second, lines(Unit::Depth, m))];
    assert_eq!(cycles(&both), 2 * u64::from(m) + 1 + 1);
}

#[test]
fn a_client_requests_a_fixed_number_of_lines_per_cycle() {
    let mut machine = plain();
    for (lines, m) in (1..6).flat_map(|lines| [1, 2, 7, 40].map(|m| (lines, m))) {
        machine.command.lines_per_cycle = size(lines);
        machine.l2.lines_per_cycle = size(lines);
        let requests: Vec<_> = (0..m).map(|n| read(Unit::Command, n, LineKind::Hit)).collect();
        let alone = vec![(packet(PacketKind::Vertices, &[(Event::Indices, 1)]), requests)];
        // The first request is visible at 1, the last is accepted in its cycle. Its line arrives one cycle
        // later, and the packet is done after one more.
        let cycles = u64::from(m.div_ceil(lines)) + 1 + 1;
        assert_eq!(stepped(&machine, &alone).cycles, cycles, "{m} lines, {lines} a cycle");
        assert_eq!(packet_level(&machine, clocks(), &alone).cycles, cycles, "{m} lines, {lines} a cycle");
        // The L2 as the bottleneck.
        machine.l2.lines_per_cycle = size(1);
        assert_eq!(stepped(&machine, &alone).cycles, u64::from(m) + 2);
        assert_eq!(packet_level(&machine, clocks(), &alone).cycles, u64::from(m) + 2);
    }
}

#[test]
fn the_roofline_includes_unhidden_program_latency() {
    let mut machine = plain();
    machine.shader.alu_latency_cycles = size(6);
    // One warp of ten operations, and sixteen of them on cores that hold one packet at a time.
    let of = |n: usize| vec![(pixels(4, 10), Vec::new()); n];
    let bound = |machine: &_, packets: &_| bound_level(machine, clocks(), packets).cycles;
    assert!((60..=stepped(&machine, &of(1)).cycles).contains(&bound(&machine, &of(1))));
    machine.shader.in_flight = size(1);
    assert!((16 * 60..=stepped(&machine, &of(16)).cycles).contains(&bound(&machine, &of(16))));
    machine.shader.in_flight = size(64);
    assert!(bound(&machine, &of(16)) < 200);
}

#[test]
fn the_roofline_includes_row_time() {
    // Every line in another row of one bank: tRP + tRCD + burst for each.
    let machine = plain();
    let lines = (0..40).map(|n| read(Unit::Depth, 16 * n, LineKind::Fetch)).collect();
    let packets = vec![(tile(&[(Event::DepthReads, 1)]), lines)];
    let [truth, found] =
        [stepped(&machine, &packets), bound_level(&machine, clocks(), &packets)].map(|timed| timed.cycles);
    assert!((0.9..1.1).contains(&(found as f64 / truth as f64)), "{found} of {truth}");
}

/// A level below the L2 that accepts `lines` lines a cycle.
fn level(clock: Clock, lines: u32) -> SharedCacheSpec {
    SharedCacheSpec { clock, latency_cycles: size(20), queue: size(64), lines_per_cycle: size(lines) }
}

/// Reads of `count` lines that only the last of `levels` has, or memory if it has them not.
fn stream_through(levels: &[Unit], count: u32, is_found: bool) -> Packets {
    let access = |line| {
        let mut access = read(Unit::Depth, line, if is_found { LineKind::Below } else { LineKind::Fetch });
        for (place, level) in levels.iter().enumerate() {
            let misses = u8::from(!is_found || place + 1 < levels.len());
            let at = LEVELS.iter().position(|other| other == level).unwrap();
            access.levels[at] = LevelRequests { reads: 1, misses, ..LevelRequests::default() };
        }
        access
    };
    let mut packet = tile(&[(Event::DepthReads, 1), (Event::L2Reads, count), (Event::L2Misses, count)]);
    packet.counts[Event::DramReadBytes] = if is_found { 0 } else { 64 * count };
    let lines: Vec<_> = (0..count).map(access).collect();
    for (level, requests) in lines.iter().flat_map(|access| LEVELS.into_iter().zip(access.levels)) {
        requests.events(level).for_each(|(event, count)| packet.counts[event] += count);
    }
    vec![(packet, lines)]
}

/// Cycles of every level of timing per line of a long stream, in the limit.
fn cycles_per_line(machine: &MachineSpec, levels: &[Unit], is_found: bool) -> [f64; 3] {
    let of = |count| {
        let packets = stream_through(levels, count, is_found);
        [
            stepped(machine, &packets).cycles,
            packet_level(machine, clocks(), &packets).cycles,
            bound_level(machine, clocks(), &packets).cycles,
        ]
    };
    let (short, long) = (of(1000), of(5000));
    std::array::from_fn(|at| (long[at] - short[at]) as f64 / 4000.0)
}

#[test]
fn a_stream_runs_at_the_rate_of_the_slowest_level_that_it_needs() {
    let mut machine = plain();
    (machine.depth.lines_per_cycle, machine.l2.lines_per_cycle) = (size(8), size(8));
    machine.llc = Some(level(Clock::Core, 4));
    machine.edram = Some(level(Clock::Memory, 1));
    let is = |found: [f64; 3], expected: f64, by: f64| {
        assert!(found.iter().all(|cycles| (cycles / expected - 1.0).abs() < by), "{found:?} for {expected}");
    };
    // Lines that the last-level cache has come four a cycle, those of the eDRAM one a cycle.
    is(cycles_per_line(&machine, &[Unit::Llc], true), 0.25, 1e-9);
    is(cycles_per_line(&machine, &[Unit::Llc, Unit::Edram], true), 1.0, 1e-9);
    // Those of memory take two cycles on the bus.
    is(cycles_per_line(&machine, &[Unit::Llc, Unit::Edram], false), 2.0, 0.01);
    // A slow level limits memory, too.
    machine.dram.channels = size(4);
    is(cycles_per_line(&machine, &[Unit::Llc, Unit::Edram], false), 1.0, 0.01);
    machine.edram = None;
    is(cycles_per_line(&machine, &[Unit::Llc], false), 0.5, 0.01);
}

#[test]
fn a_level_adds_its_latency_on_the_way_back_and_a_cycle_on_the_way_down() {
    let mut machine = plain();
    machine.llc = Some(level(Clock::Core, 1));
    machine.edram = Some(level(Clock::Core, 1));
    let both = [Unit::Llc, Unit::Edram];
    let cycles = |levels: &[Unit], is_found| {
        let packets = stream_through(levels, 1, is_found);
        let found = [stepped(&machine, &packets), packet_level(&machine, clocks(), &packets)];
        let [truth, other] = found.map(|timed| timed.cycles);
        assert_eq!(truth, other);
        truth
    };
    // Depth starts at 3, the L2 sees the request at 4 and the level at 5; 20 and 1 back, and 1 out.
    assert_eq!(cycles(&both[..1], true), 5 + 20 + 1 + 1);
    assert_eq!(cycles(&both, true), 6 + 20 + 20 + 1 + 1);
    // Memory sees it at 7: a row opens in 4, data comes until 3 + 2 later, and 1 in the controller.
    assert_eq!(cycles(&both, false), 7 + 4 + 3 + 2 + 1 + 20 + 20 + 1 + 1);
}

#[test]
fn a_level_that_is_full_is_what_the_l2_waits_for() {
    let mut machine = plain();
    (machine.depth.lines_per_cycle, machine.l2.lines_per_cycle) = (size(8), size(8));
    machine.llc = Some(level(Clock::Core, 1));
    let stalls = stepped(&machine, &stream_through(&[Unit::Llc], 2000, true)).stalls.unwrap();
    let [l2, llc] = [Unit::L2, Unit::Llc].map(|unit| stalls.of(unit));
    assert!(llc.busy as f64 > 0.97 * llc.total() as f64, "{llc:?}");
    assert!(l2.blocked[Unit::Llc as usize] > l2.total() / 2, "{l2:?}");
}

#[test]
fn rows_and_banks_by_hand() {
    // Burst 2, CL 3, tRCD 4, tRP 5; one cycle each to the L2, to memory, in the controller, back and out.
    let machine = plain();
    let run = |lines: &[u32]| {
        let lines = lines.iter().map(|&line| read(Unit::Depth, line, LineKind::Fetch)).collect();
        stepped(&machine, &vec![(tile(&[(Event::DepthReads, 1)]), lines)]).cycles
    };
    // Depth starts at 3. The L2 sees the request at 4, memory at 5; the row is open at 9, data arrives until
    // 9 + 3 + 2, then 1 + 1 + 1.
    let first = 5 + 4 + 3 + 2 + 3;
    assert_eq!(run(&[0]), first);
    // More lines of the row wait for the bus only.
    assert_eq!(run(&[0, 1, 2, 3]), first + 3 * 2);
    // Another row of the same bank (8 lines a row, 2 banks). It is closed in the cycle of the first column
    // command, as row and column commands have separate wires, and the other row opens.
    assert_eq!(run(&[0, 16]), first + 5 + 4);
    // Another bank opens its row one cycle after the first and waits for the bus.
    assert_eq!(run(&[0, 8]), first + 2);
    // First ready first come: line 1 overtakes line 16.
    assert_eq!(run(&[0, 16, 1]), run(&[0, 1, 16]));
}

/// Tiles with a warp each come faster than the lanes serve them. The cores serve those under way in turn, so
/// the last ones leave lanes idle. `packet` knows how long that takes, whatever the number of tiles.
#[test]
fn cores_run_empty_as_they_serve_warps_in_turn() {
    let mut machine = plain();
    let shader = &mut machine.shader;
    (shader.lanes, shader.warp_lanes, shader.warps) = (size(32), size(32), size(16));
    (shader.cores, shader.in_flight, shader.alu_latency_cycles) = (size(2), size(32), size(8));
    for tiles_of_stream in [20, 40, 80, 300] {
        let counts =
            vec![(Event::PixelInvocations, 32), (Event::ShaderOps, 32 * 40), (Event::ColourWrites, 16)];
        let packets = tiles((0..tiles_of_stream).map(|_| counts.clone()));
        let truth = stepped(&machine, &packets).cycles;
        let found = packet_level(&machine, clocks(), &packets).cycles;
        let off = found as f64 / truth as f64 - 1.0;
        assert!(off.abs() < 0.02, "{tiles_of_stream} tiles: {found} of {truth}");
    }
}

/// One core with two slots, and a program twenty times as long as the others. Those go through the other slot
/// one after another, and do not wait for the long one.
#[test]
fn short_programs_pass_a_long_one_on_the_other_slot() {
    let mut machine = plain();
    let shader = &mut machine.shader;
    (shader.warps, shader.alu_latency_cycles) = (size(2), size(10));
    let program = |ops: u32| vec![(Event::PixelInvocations, 1), (Event::ShaderOps, ops)];
    let packets = tiles([program(200)].into_iter().chain((0..20).map(|_| program(10))));
    let truth = stepped(&machine, &packets).cycles;
    let found = packet_level(&machine, clocks(), &packets).cycles;
    // Twenty programs of 100 cycles and a cycle to send each, after the five units before the cores; two to
    // leave the cores and the machine.
    assert_eq!(truth, 5 + 20 * 101 + 2);
    assert!(found.abs_diff(truth) <= 2, "{found} of {truth}");
}

/// Programs of one operation and of two thousand on a few cores. A long one blocks the packets behind it, and a
/// core with more of them than another takes longer. Which core that is depends on single cycles, so `packet` is
/// exact for one core only, and where each long program has a slot.
#[test]
fn uneven_programs_on_few_cores() {
    for (cores, most) in [(1, 0.005), (2, 0.06), (3, 0.06), (4, 0.005), (6, 0.005)] {
        let mut machine = plain();
        let shader = &mut machine.shader;
        (shader.lanes, shader.warp_lanes, shader.warps) = (size(32), size(32), size(16));
        (shader.cores, shader.in_flight, shader.alu_latency_cycles) = (size(cores), size(32), size(8));
        let tile = |at: u32| {
            let (ops, pixels) = (if at * at % 11 < 4 { 2000 } else { 1 }, 24 + at * 7 % 40);
            vec![
                (Event::PixelInvocations, pixels),
                (Event::ShaderOps, pixels * ops),
                (Event::ColourWrites, pixels),
            ]
        };
        let packets = tiles((0..90).map(tile));
        let truth = stepped(&machine, &packets).cycles;
        let found = packet_level(&machine, clocks(), &packets).cycles;
        let off = found as f64 / truth as f64 - 1.0;
        assert!(off.abs() < most, "{cores} cores: {found} of {truth}");
    }
}
