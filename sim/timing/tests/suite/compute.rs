//! Groups of lanes: rounds, streams, shared memory, and how dispatches follow each other and draws.

use activity::{Event, LineAccess, LineKind, Packet, PacketKind, Unit, Waits};
use proptest::prelude::*;
use timing::MachineSpec;
use timing::stepped::StepOptions;

use crate::common::{
    Packets, bound_level, clocks, cycles, packet, packet_level, plain, rates, read, size, stepped,
    stepped_as, tile,
};

/// Units before the cores, one cycle of latency each.
const BEFORE: u64 = 5;

/// A group of `lanes`, each with `ops` operations, and `steps` of them one after another.
fn group(lanes: u32, ops: u32, steps: u32, shared_bytes: u32) -> Packet {
    packet(
        PacketKind::Compute,
        &[
            (Event::Groups, 1),
            (Event::GroupLanes, lanes),
            (Event::ShaderOps, lanes * ops),
            (Event::GroupSteps, steps),
            (Event::SharedBytes, shared_bytes),
        ],
    )
}

fn groups(count: u32, group: Packet) -> Packets {
    vec![(group, Vec::new()); count as usize]
}

/// Cores of 64 lanes that the groups of these tests never fill: latency limits them.
fn roomy(cores: u32, latency: u32) -> MachineSpec {
    let mut machine = plain();
    (machine.shader.cores, machine.shader.lanes, machine.shader.warps) = (size(cores), size(64), size(16));
    machine.shader.alu_latency_cycles = size(latency);
    machine
}

/// `g` groups on `c` cores, of which `k` fit on a core, take `ceil(g / (c k))` rounds of the length of one.
#[test]
fn groups_come_in_rounds() {
    for (g, c, k) in [(1, 1, 1), (6, 1, 2), (7, 1, 2), (12, 2, 3), (13, 2, 3), (64, 4, 4), (65, 4, 4)] {
        let machine = roomy(c, 5);
        // Shared memory bounds the groups on a core, 1024 bytes in all.
        let packets = groups(g, group(4, 100, 100, 1024 / k));
        let rounds = u64::from(g.div_ceil(c * k));
        // A cycle to reach the core and 100 operations; the groups of a round are sent one a cycle.
        let expected = BEFORE + rounds * (1 + 100 * 5) + u64::from((g - 1) % (c * k)) + 1;
        let [truth, found, bound] = cycles(&machine, &packets);
        assert_eq!([truth, found], [expected; 2], "{g} groups, {c} cores, {k} each");
        // The roofline packs the last round.
        let least = f64::from(g) / f64::from(c * k) * 500.0;
        assert!((least.floor() as u64..=truth).contains(&bound), "{bound} of {truth}, {g} {c} {k}");
    }
}

/// Warps bound the groups on a core, too, and a group is on one core.
#[test]
fn lanes_bound_the_groups_of_a_core() {
    let mut machine = roomy(2, 5);
    machine.shader.warps = size(5);
    // Two warps a group: two groups on a core, and one slot is left over.
    let packets = groups(8, group(8, 100, 100, 0));
    let [truth, found, _] = cycles(&machine, &packets);
    // Four groups of two warps are sent in eight cycles; the second four follow as they end.
    assert_eq!(truth, BEFORE + 2 * (1 + 500) + 7 + 1);
    assert!(truth.abs_diff(found) <= 8, "{found} of {truth}");
}

/// Where lanes are full, the operations of all groups limit.
#[test]
fn full_lanes_take_all_operations_in_turn() {
    let mut machine = plain();
    (machine.shader.cores, machine.shader.warps) = (size(2), size(16));
    let packets = groups(100, group(16, 50, 50, 0));
    let expected = 100.0 * 16.0 * 50.0 / (2.0 * 4.0);
    for found in cycles(&machine, &packets) {
        assert!((found as f64 / expected - 1.0).abs() < 0.01, "{found} of {expected}");
    }
}

/// A group whose warps wait for each other takes its longest way, not its operations.
#[test]
fn steps_are_latency_and_operations_are_lanes() {
    let machine = roomy(1, 4);
    for found in &cycles(&machine, &groups(1, group(8, 30, 120, 0)))[..2] {
        assert_eq!(*found, BEFORE + 1 + 1 + 120 * 4 + 1);
    }
    // The lanes are used for the operations alone.
    let busy = |ops| {
        let timed = stepped(&machine, &groups(20, group(8, ops, 120, 0)));
        timed.timeline.busy_ps()[Unit::Shader as usize]
    };
    // Times are rounded to a picosecond in every cycle.
    assert!(busy(120).abs_diff(4 * busy(30)) < 100, "{} and {}", busy(120), busy(30));
}

/// Cycles of each level per group of a long stream, in the limit.
fn per_group(machine: &MachineSpec, of: impl Fn(u32) -> (Packet, Vec<LineAccess>)) -> [f64; 3] {
    let of = |count| cycles(machine, &(0..count).map(&of).collect());
    let (short, long) = (of(100), of(600));
    std::array::from_fn(|at| (long[at] - short[at]) as f64 / 500.0)
}

fn close(found: [f64; 3], expected: f64) {
    assert!(found.iter().all(|cycles| (cycles / expected - 1.0).abs() < 0.02), "{found:?} for {expected}");
}

#[test]
fn streams_take_bytes_over_bandwidth() {
    let machine = roomy(2, 2);
    let streams = |kind: LineKind| {
        move |n: u32| {
            let lines: Vec<_> = (0..16).map(|line| read(Unit::Compute, 16 * n + line, kind)).collect();
            let mut packet = group(16, 4, 4, 0);
            packet.counts[Event::L2Reads] = 16;
            packet.counts[Event::DramReadBytes] = if kind == LineKind::Fetch { 64 * 16 } else { 0 };
            (packet, lines)
        }
    };
    // Lines that the L2 has come one a cycle; those of memory take two cycles on the bus.
    close(per_group(&machine, streams(LineKind::Hit)), 16.0);
    close(per_group(&machine, streams(LineKind::Fetch)), 32.0);
}

#[test]
fn shared_memory_and_atomic_units_have_rates() {
    let machine = roomy(2, 2);
    let with = |event, count| {
        move |_| {
            let mut packet = group(16, 4, 4, 0);
            packet.counts[event] = count;
            (packet, Vec::new())
        }
    };
    close(per_group(&machine, with(Event::SharedCycles, 40)), 40.0);
    close(per_group(&machine, with(Event::AtomicSteps, 72)), 72.0);
    // What has no rate takes no time: a group of four warps is sent in four cycles.
    assert_eq!(per_group(&machine, with(Event::GroupBarriers, 72)), [4.0; 3]);
}

/// Two dispatches of groups, with a barrier between them or without.
fn two(barrier: Option<Waits>) -> Packets {
    let of = |pass: u32| {
        let start = packet(PacketKind::Draw, &[(Event::Draws, 1)]);
        std::iter::once(start)
            .chain((0..3).map(|_| group(4, 100, 100, 1024)))
            .map(move |packet| (Packet { pass, ..packet }, Vec::new()))
    };
    let between = barrier.map(|waits| (Packet::new(PacketKind::Barrier(waits), 1), Vec::new()));
    of(0).chain(between).chain(of(1)).collect()
}

#[test]
fn dependent_dispatches_wait_and_others_overlap() {
    let machine = roomy(2, 5);
    // The latency of the command unit, and rounds of two groups between the units before the cores and the way out.
    let draw = 1;
    let rounds = |count: u64, last: u64| BEFORE + count * (1 + 100 * 5) + last + 1;
    let [truth, found, bound] = cycles(&machine, &two(None));
    assert_eq!([truth, found], [draw + rounds(3, 1); 2]);
    assert!((3 * 500..=truth).contains(&bound), "{bound} of {truth}");
    // With a barrier each dispatch has two rounds. The barrier takes a cycle; the draw may come before it or after.
    for (waits, again) in [(Waits::Tiles, 0), (Waits::All, draw)] {
        let [truth, found, bound] = cycles(&machine, &two(Some(waits)));
        assert_eq!([truth, found], [draw + rounds(2, 0) + 1 + again + rounds(2, 0); 2]);
        assert!((3 * 500..=truth).contains(&bound), "{bound} of {truth}");
    }
}

/// Groups share the cores with the pixels of the pass before, and wait for them at a barrier.
#[test]
fn groups_overlap_pixels_unless_there_is_a_barrier() {
    let machine = roomy(1, 5);
    let pixels = tile(&[(Event::PixelInvocations, 4), (Event::ShaderOps, 4 * 100)]);
    let dispatched = Packet { pass: 1, ..group(4, 100, 100, 0) };
    let barrier = Packet::new(PacketKind::Barrier(Waits::Tiles), 1);
    let of =
        |packets: &[Packet]| cycles(&machine, &packets.iter().map(|packet| (*packet, Vec::new())).collect());
    let [side, found, _] = of(&[pixels, dispatched]);
    assert_eq!([side, found], [BEFORE + 1 + 1 + 500 + 1; 2]);
    let [after, found, _] = of(&[pixels, barrier, dispatched]);
    assert!(after >= 2 * 500 && after.abs_diff(found) <= 2, "{found} of {after}");
}

type Drawn = (u32, u32, u32, u32, Vec<u32>);

fn random() -> impl Strategy<Value = Vec<Drawn>> {
    let one = (1u32..17, 0u32..30, 0u32..30, 0u32..600, prop::collection::vec(0u32..4096, 0..8));
    prop::collection::vec(one, 1..40)
}

fn machines() -> impl Strategy<Value = MachineSpec> {
    ((1u32..4, 1u32..9, 1u32..5), (1u32..9, 1u32..6, 1u32..6)).prop_map(
        |((cores, lanes, more), (latency, queue, flights))| {
            let mut machine = plain();
            (machine.shader.cores, machine.shader.lanes, machine.shader.warps) =
                (size(cores), size(lanes), size(3 + more));
            (machine.shader.alu_latency_cycles, machine.shader.in_flight) = (size(latency), size(flights));
            let compute = machine.compute.as_mut().unwrap();
            (compute.queue, compute.in_flight, compute.latency_cycles) =
                (size(queue), size(flights), size(latency));
            machine
        },
    )
}

fn drawn(groups: &[Drawn]) -> Packets {
    let one = |(lanes, ops, wait, bytes, lines): &Drawn| {
        let mut packet = group(*lanes, *ops, ops + wait, *bytes);
        packet.counts[Event::SharedCycles] = *wait;
        packet.counts[Event::L2Reads] = lines.len() as u32;
        packet.counts[Event::L2Misses] = lines.len() as u32;
        packet.counts[Event::DramReadBytes] = 64 * lines.len() as u32;
        (packet, lines.iter().map(|&line| read(Unit::Compute, line, LineKind::Fetch)).collect())
    };
    groups.iter().map(one).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Groups of any shape all come through, with the same events at every level, whatever the order of the units.
    #[test]
    fn all_groups_come_through(groups in random(), machine in machines()) {
        let packets = drawn(&groups);
        let total = packets.iter().fold(activity::Counts::default(), |mut sum, (packet, _)| {
            sum += &packet.counts;
            sum
        });
        let truth = stepped(&machine, &packets);
        prop_assert_eq!(truth.timeline.total(), total);
        let mut order = Unit::ALL;
        order.reverse();
        let other = stepped_as(&machine, clocks(), &packets, &StepOptions { order, skip_idle: false });
        prop_assert_eq!(other.cycles, truth.cycles);
        for found in [packet_level(&machine, clocks(), &packets), bound_level(&machine, clocks(), &packets)] {
            prop_assert_eq!(found.timeline.total(), total);
            let bins = &found.timeline.bins;
            prop_assert!(bins.iter().all(|bin| bin.busy_ps.iter().all(|&busy| busy <= found.timeline.bin_ps)));
        }
    }
}

/// Cycles of `stepped` and `packet` for groups on a core of 16 slots that takes so many at a time, beside vertices of
/// the next pass, which set-up works on for 38,400 cycles.
fn beside_vertices(in_flight: u32, groups: Packets) -> [u64; 2] {
    let mut machine = roomy(1, 8);
    let shader = &mut machine.shader;
    (shader.lanes, shader.warp_lanes, shader.in_flight) = (size(32), size(32), size(in_flight));
    machine.setup.rates = rates("{\"triangles_in\": 0.25}");
    let vertices = |_| {
        let counts = [(Event::VertexInvocations, 38), (Event::ShaderOps, 38 * 12), (Event::TrianglesIn, 32)];
        (Packet { pass: 1, ..packet(PacketKind::Vertices, &counts) }, Vec::new())
    };
    let tile = Packet { pass: 1, ..tile(&[(Event::TilesVisited, 1)]) };
    let all: Packets = groups.into_iter().chain((0..300).map(vertices)).chain([(tile, Vec::new())]).collect();
    let [truth, found, _] = cycles(&machine, &all);
    [truth, found]
}

/// Vertices of the next pass come while groups fill the core. Where both wait for slots they are sent
/// alternately, so short programs of vertices wait for the long ones of groups, and set-up idles meanwhile.
#[test]
fn vertices_and_groups_take_turns_on_a_full_core() {
    let [truth, found] = beside_vertices(32, groups(100, group(128, 90, 119, 0)));
    // The lanes by themselves work for 36,000 cycles.
    assert!(truth > 48_000, "{truth}");
    assert!(found.abs_diff(truth) * 19 <= truth, "{found} of {truth}");
}

/// As many groups of one warp as slots: each comes when one leaves, and does not wait, but vertices do.
#[test]
fn vertices_wait_for_groups_that_fill_all_slots() {
    let [truth, found] = beside_vertices(16, groups(200, group(32, 180, 238, 0)));
    assert!(truth > 48_000, "{truth}");
    assert!(found.abs_diff(truth) * 20 <= truth, "{found} of {truth}");
}
