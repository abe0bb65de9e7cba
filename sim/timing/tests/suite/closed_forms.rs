//! Pipelines whose cycles are known exactly.

use activity::{Event, LineAccess, LineKind, Packet, PacketKind, Unit};
use proptest::prelude::*;

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

/// Tiles through traversal and z-cull, `a` and `b` cycles.
fn pair(works: &[(u32, u32)]) -> Packets {
    tiles(works.iter().map(|&(a, b)| vec![(Event::TilesVisited, a), (Event::ZCullTests, b)]))
}

#[test]
fn two_units_overlap_and_the_slower_sets_the_pace() {
    // A cycle of latency behind each.
    assert_eq!(cycles(&pair(&[(2, 5); 10])), 2 + 1 + 10 * 5 + 1);
    assert_eq!(cycles(&pair(&[(5, 2); 10])), 10 * 5 + 1 + 2 + 1);
}

/// Tandem queues with finite buffers and blocking after service (Dallery and Gershwin 1992): the textbook's recurrence, with
/// a cycle for whatever passes between units, be it a packet or the news that there is room.
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
    // Room for one: the first starts in z-cull at 2 and leaves at 102. The second is in the queue since 11, the third done at
    // 21 and held: the second starts at 102, that is known at 103, when the third leaves; 18 more follow ten cycles apart.
    machine.z_cull.queue = size(1);
    assert_eq!(stepped(&machine, &pair(&works)).cycles, 103 + 18 * 10 + 1 + 1 + 1);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn two_units_with_a_queue_of_k(works in prop::collection::vec((0u32..20, 0u32..20), 1..60), queue in 1u32..9) {
        let mut machine = plain();
        machine.z_cull.queue = size(queue);
        // A tile that asks nothing of z-cull ends at traversal: give each one event there.
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
    // Five units before the cores with a cycle each and no work; a cycle to reach the core; a cycle to leave.
    let before = 5 + 1;
    let mut machine = plain();
    machine.shader.alu_latency_cycles = size(6);
    let one = vec![(pixels(4, 10), Vec::new())];
    assert_eq!(stepped(&machine, &one).cycles, before + 10 * 6 + 1);
    // With lanes for one thread in a cycle an operation of four threads is issued over four cycles.
    machine.shader.lanes = size(1);
    assert_eq!(stepped(&machine, &one).cycles, before + 10 * (6 + 3) + 1);
}

#[test]
fn resident_warps_hide_latency_until_the_lanes_are_full() {
    let mut machine = plain();
    machine.shader.alu_latency_cycles = size(6);
    let run = |machine: &_, warps: u32| stepped(machine, &vec![(pixels(4 * warps, 10), Vec::new())]).cycles;
    // Warps are sent one a cycle: w of them, up to six, take turns within the latency of one.
    for warps in 1..=6 {
        assert_eq!(run(&machine, warps), 6 + 10 * 6 + u64::from(warps - 1) + 1, "{warps}");
    }
    // Eight fill the lanes: eighty operations, one a cycle, and the last one's latency.
    assert_eq!(run(&machine, 8), 6 + 80 - 1 + 6 + 1);
    // Two cores, half as many each; every other warp is for the other core.
    machine.shader.cores = size(2);
    assert_eq!(run(&machine, 8), 6 + 7 + 10 * 6 + 1);
}

#[test]
fn a_shared_resource_serves_n_clients_in_turn() {
    // Four clients of the L2 ask for m lines each in the same cycles, it takes one a cycle: the vertices' are known to a cycle.
    let lines = |unit, m: u32| (0..m).map(|n| read(unit, n, LineKind::Hit)).collect::<Vec<LineAccess>>();
    let m = 50;
    let vertices = packet(PacketKind::Vertices, &[(Event::Indices, 1)]);
    let alone = vec![(vertices, lines(Unit::Command, m))];
    // The first request is seen at 1, the last taken at m; its line is there a cycle later and the packet done after one more.
    assert_eq!(cycles(&alone), u64::from(m) + 1 + 1);
    // A tile whose depth lines are asked for meanwhile: twice as many lines, and the tile, which came four cycles later,
    // has its last line when all 2 m were taken.
    let mut second = packet(PacketKind::Tile, &[(Event::DepthReads, 1)]);
    second.triangle = super::common::BATCH;
    let both = vec![(vertices, lines(Unit::Command, m)), (second, lines(Unit::Depth, m))];
    assert_eq!(cycles(&both), 2 * u64::from(m) + 1 + 1);
}

#[test]
fn a_client_asks_for_so_many_lines_a_cycle() {
    let mut machine = plain();
    for (lines, m) in (1..6).flat_map(|lines| [1, 2, 7, 40].map(|m| (lines, m))) {
        machine.command.lines_per_cycle = size(lines);
        machine.l2.lines_per_cycle = size(lines);
        let asks: Vec<_> = (0..m).map(|n| read(Unit::Command, n, LineKind::Hit)).collect();
        let alone = vec![(packet(PacketKind::Vertices, &[(Event::Indices, 1)]), asks)];
        // The first is seen at 1, the last taken in its cycle; its line is there a cycle later and the packet done after one more.
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
fn the_roofline_knows_programs_that_nobody_hides() {
    let mut machine = plain();
    machine.shader.alu_latency_cycles = size(6);
    // A warp of ten operations alone, and sixteen of them where the cores hold one packet at a time.
    let of = |n: usize| vec![(pixels(4, 10), Vec::new()); n];
    let bound = |machine: &_, packets: &_| bound_level(machine, clocks(), packets).cycles;
    assert!((60..=stepped(&machine, &of(1)).cycles).contains(&bound(&machine, &of(1))));
    machine.shader.in_flight = size(1);
    assert!((16 * 60..=stepped(&machine, &of(16)).cycles).contains(&bound(&machine, &of(16))));
    machine.shader.in_flight = size(64);
    assert!(bound(&machine, &of(16)) < 200);
}

#[test]
fn the_roofline_knows_rows() {
    // Every line of another row of one bank: opened and closed for each, tRP + tRCD + burst.
    let machine = plain();
    let lines = (0..40).map(|n| read(Unit::Depth, 16 * n, LineKind::Fetch)).collect();
    let packets = vec![(tile(&[(Event::DepthReads, 1)]), lines)];
    let (truth, found) = (stepped(&machine, &packets).cycles, bound_level(&machine, clocks(), &packets));
    assert!((0.9..1.1).contains(&(found.cycles as f64 / truth as f64)), "{} of {truth}", found.cycles);
    assert!(found.rows.unwrap() > 0.9);
}

#[test]
fn rows_and_banks_by_hand() {
    // Burst 2, CL 3, tRCD 4, tRP 5, one cycle each to the L2, to memory, in the controller, back and out.
    let machine = plain();
    let run = |lines: &[u32]| {
        let lines = lines.iter().map(|&line| read(Unit::Depth, line, LineKind::Fetch)).collect();
        stepped(&machine, &vec![(tile(&[(Event::DepthReads, 1)]), lines)]).cycles
    };
    // Depth starts at 3; the L2 sees the request at 4, memory at 5: row open at 9, data until 9 + 3 + 2, then 1 + 1 + 1.
    let first = 5 + 4 + 3 + 2 + 3;
    assert_eq!(run(&[0]), first);
    // More lines of the row: the bus is what they wait for.
    assert_eq!(run(&[0, 1, 2, 3]), first + 3 * 2);
    // Another row of the same bank (8 lines a row, 2 banks): it is closed in the cycle of the first column command, as row
    // and column commands have wires of their own, and the other opened.
    assert_eq!(run(&[0, 16]), first + 5 + 4);
    // Another bank opens its row a cycle after the first and waits for the bus.
    assert_eq!(run(&[0, 8]), first + 2);
    // First ready first come: line 1 overtakes line 16.
    assert_eq!(run(&[0, 16, 1]), run(&[0, 1, 16]));
}
