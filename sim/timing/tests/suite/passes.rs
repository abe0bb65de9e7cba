//! Passes: how they overlap, how barriers keep them apart, and what is reported of each.

use activity::{Counts, Event, LineAccess, LineKind, Packet, PacketKind, Timeline, Unit, Waits};
use proptest::prelude::*;
use timing::stepped::StepOptions;
use timing::{Recorder, Timed};

use crate::common::{Packets, client, clocks, levels, packet_level_into, plain, read, size, stepped_into};
use crate::conservation::{OF_BARRIERS, machine, passes, through_levels, total};

/// Cycles of a front end that works `cycles` in the command unit: one more in set-up, and three latencies.
fn front_takes(cycles: u32) -> u64 {
    u64::from(cycles) + 1 + 3
}

fn of(pass: u32, kind: PacketKind, counts: &[(Event, u32)]) -> (Packet, Vec<LineAccess>) {
    let mut packet = Packet::new(kind, pass);
    counts.iter().for_each(|&(event, count)| packet.counts[event] = count);
    (packet, Vec::new())
}

/// A pass of one packet on each path, with so many cycles in the command unit and in traversal.
fn pass(number: u32, front: u32, tiles: u32) -> Packets {
    vec![
        of(number, PacketKind::Vertices, &[(Event::Indices, front), (Event::TrianglesIn, 1)]),
        of(number, PacketKind::Tile, &[(Event::TilesVisited, tiles)]),
    ]
}

fn barrier(pass: u32, waits: Waits) -> (Packet, Vec<LineAccess>) {
    of(pass, PacketKind::Barrier(waits), &[])
}

/// Passes one after another, with a barrier before each but the first, if any.
fn in_turn(passes: &[(u32, u32)], between: Option<Waits>) -> Packets {
    let mut all = Packets::new();
    for (&(front, tiles), number) in passes.iter().zip(0..) {
        all.extend(between.filter(|_| number > 0).map(|waits| barrier(number, waits)));
        all.extend(pass(number, front, tiles));
    }
    all
}

/// Cycles of the first two levels; `bound` has to be off by no more than `slack`.
fn cycles(packets: &Packets, slack: u64) -> [u64; 2] {
    let [truth, found, bound] = levels(&plain(), packets).map(|timed| timed.cycles);
    assert!(bound.abs_diff(truth) <= slack, "bound: {bound} for {truth}");
    [truth, found]
}

/// At most what a path that is about to be used takes to fill, as `bound` adds it to the longer of two paths.
const FILL: u64 = 4;

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// The front end of the second pass overlaps the tiles of the first.
    #[test]
    fn passes_without_a_barrier_overlap_as_batches_do(works in prop::array::uniform4(1u32..400)) {
        let [f0, t0, f1, t1] = works;
        let packets = in_turn(&[(f0, t0), (f1, t1)], None);
        let expected = front_takes(f0) + u64::from(t0.max(f1)) + u64::from(t1) + 1;
        prop_assert_eq!(cycles(&packets, FILL), [expected; 2]);
    }

    /// Tiles wait until the first pass has left and the barrier after it; the front end does not.
    #[test]
    fn tiles_wait_at_a_barrier(works in prop::array::uniform4(1u32..400)) {
        let [f0, t0, f1, t1] = works;
        let packets = in_turn(&[(f0, t0), (f1, t1)], Some(Waits::Tiles));
        let barrier_done = front_takes(f0) + u64::from(t0) + 1 + 1;
        let set_up = u64::from(f0) + front_takes(f1);
        let expected = barrier_done.max(set_up) + u64::from(t1) + 1;
        prop_assert_eq!(cycles(&packets, FILL), [expected; 2]);
    }

    /// With `Waits::All` nothing overlaps.
    #[test]
    fn vertices_wait_at_a_full_barrier(works in prop::array::uniform4(1u32..400)) {
        let [f0, t0, f1, t1] = works;
        let packets = in_turn(&[(f0, t0), (f1, t1)], Some(Waits::All));
        let expected = front_takes(f0) + u64::from(t0) + 1 + 1 + front_takes(f1) + u64::from(t1) + 1;
        prop_assert_eq!(cycles(&packets, 0), [expected; 2]);
        for timed in levels(&plain(), &packets) {
            let begin_ps = (front_takes(f0) + u64::from(t0) + 1) * 1000;
            prop_assert_eq!(timed.passes[0].end_ps, begin_ps);
        }
    }
}

/// A barrier that writes `depth` and `colour` lines; every other one evicts a line to memory.
fn writes(pass: u32, waits: Waits, depth: u32, colour: u32) -> (Packet, Vec<LineAccess>) {
    let (mut packet, mut lines) = barrier(pass, waits);
    for (client, count, first) in [(Unit::Depth, depth, 0), (Unit::Colour, colour, 1 << 12)] {
        lines.extend((0..count).map(|n| {
            let kind = if n % 2 == 0 { LineKind::Write } else { LineKind::Allocate };
            let mut access = LineAccess::new(client, first + n, kind);
            (n % 2 == 1).then(|| access.write((1 << 16) + n));
            access
        }));
    }
    packet.counts[Event::L2Writes] = depth + colour;
    packet.counts[Event::L2Misses] = depth / 2 + colour / 2;
    packet.counts[Event::DramWriteBytes] = 64 * (depth / 2 + colour / 2);
    (packet, lines)
}

/// Cycles of a barrier that is alone in the machine. It reaches depth after three units, requests one line per
/// cycle, and goes on when the last one, accepted a cycle after its request, is acknowledged.
fn barrier_takes(depth: u32, colour: u32) -> u64 {
    let written = |lines: u32| if lines > 0 { u64::from(lines) + 1 } else { 0 };
    match (depth, colour) {
        (0, 0) => 1,
        (_, 0) => 3 + written(depth) + 1,
        _ => 3 + written(depth) + 1 + 1 + 1 + written(colour) + 1,
    }
}

#[test]
fn no_tile_starts_before_the_last_write_back() {
    let (first, second) = (pass(0, 5, 30), pass(1, 6, 20));
    for (depth, colour) in [(0, 0), (1, 0), (12, 0), (0, 9), (1, 1), (25, 40)] {
        let between = |waits| -> Packets {
            let written = writes(1, waits, depth, colour);
            first.iter().cloned().chain([written]).chain(second.iter().cloned()).collect()
        };
        let apart = front_takes(5) + 30 + 1 + barrier_takes(depth, colour);
        let truth = apart + 20 + 1;
        assert_eq!(cycles(&between(Waits::Tiles), FILL), [truth; 2], "{depth} {colour}");
        let truth = apart + front_takes(6) + 20 + 1;
        assert_eq!(cycles(&between(Waits::All), FILL), [truth; 2], "{depth} {colour}");
    }
}

#[test]
fn a_barrier_waits_for_the_lines_that_are_read_before() {
    let mut machine = plain();
    machine.dram.latency_cycles = size(500);
    let (mut packets, mut reads) = (pass(0, 5, 1), pass(0, 5, 1).remove(1));
    reads.0.counts[Event::DepthReads] = 1;
    reads.0.counts[Event::DramReadBytes] = 64;
    reads.1.push(read(Unit::Depth, 7, LineKind::Fetch));
    packets.push(reads);
    let [alone, alone_packet, _] = levels(&machine, &packets).map(|timed| timed.cycles);
    packets.push(barrier(1, Waits::Tiles));
    packets.extend(pass(1, 5, 20));
    let [truth, found, _] = levels(&machine, &packets).map(|timed| timed.cycles);
    assert!(alone > 500);
    assert_eq!([truth, found], [alone + 1 + 20 + 1, alone_packet + 1 + 20 + 1]);
}

/// A pass that resolves `n` tiles follows the tiles before it without a barrier, and a tile takes the longer
/// of its reads and its writes. The six units before that of colour have no work, but a cycle of latency
/// each.
#[test]
fn a_resolve_takes_the_longer_of_its_reads_and_its_writes() {
    let mut machine = plain();
    machine.colour = client("{\"samples_resolved\": 4, \"pixels_resolved\": 1}");
    for (n, samples, pixels) in [(1_u32, 256, 32), (10, 256, 32), (10, 64, 64), (40, 4, 1)] {
        let mut packets = pass(0, 5, 30);
        let counts = [(Event::SamplesResolved, samples), (Event::PixelsResolved, pixels)];
        packets.extend((0..n).map(|_| of(1, PacketKind::Resolve, &counts)));
        let each = u64::from((samples / 4).max(pixels));
        let alone = front_takes(5) + 30 + 1 + 6;
        let [truth, found, bound] = levels(&machine, &packets).map(|timed| timed.cycles);
        assert_eq!([truth, found], [alone + u64::from(n) * each; 2], "{n} {samples} {pixels}");
        // It may miss the latency of the path: seven units.
        assert!(bound.abs_diff(truth) <= 7, "bound: {bound} for {truth}");
    }
}

/// With `c` cycles in the front end and `t` in the tiles, and `c < t <= c + 5`.
#[test]
fn many_passes_of_one_triangle() {
    let (c, t) = (6, 10);
    let passes = [(c, t); 64];
    let [front, tiles] = [front_takes(c), u64::from(t) + 1];
    // Two passes are under way at a time, each from the front end to the end of its tiles.
    // `bound` rounds half a grain down in every phase.
    assert_eq!(cycles(&in_turn(&passes, None), 32), [32 * (front + tiles) + u64::from(t); 2]);
    // The front end is hidden behind the tiles of the pass before and the barrier.
    assert_eq!(cycles(&in_turn(&passes, Some(Waits::Tiles)), FILL), [front + 64 * tiles + 63; 2]);
    assert_eq!(cycles(&in_turn(&passes, Some(Waits::All)), 0), [64 * (front + tiles) + 63; 2]);
}

#[test]
fn a_long_front_end_is_hidden_behind_the_tiles_of_the_pass_before() {
    let packets = in_turn(&[(5, 1000), (900, 10)], None);
    assert_eq!(cycles(&packets, FILL), [front_takes(5) + 1000 + 10 + 1; 2]);
    for timed in levels(&plain(), &packets) {
        assert!(timed.passes[1].begin_ps < timed.passes[0].end_ps);
    }
    let packets = in_turn(&[(5, 1000), (900, 10)], Some(Waits::All));
    let front = front_takes(900);
    assert_eq!(cycles(&packets, 0), [front_takes(5) + 1000 + 1 + 1 + front + 10 + 1; 2]);
}

/// Events of a timeline with bins of a cycle up to the cycle of each barrier.
fn before_barriers(timeline: &Timeline) -> Vec<Counts> {
    let (mut sum, mut found) = (Counts::default(), Vec::new());
    for bin in &timeline.bins {
        sum += &bin.counts;
        (0..bin.counts[OF_BARRIERS]).for_each(|_| found.push(sum));
    }
    found
}

/// Events of the packets up to each barrier.
fn expected_before_barriers(packets: &Packets) -> Vec<Counts> {
    let barriers = packets.iter().enumerate();
    let barriers = barriers.filter(|(_, (packet, _))| matches!(packet.kind, PacketKind::Barrier(_)));
    barriers.map(|(at, _)| total(&packets[..=at].to_vec())).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn barriers_keep_tiles_apart(packets in passes(), machine in machine()) {
        let fine = || Recorder::new(1000, 1 << 20);
        let truth = stepped_into(fine(), &machine, clocks(), &packets, &StepOptions::default());
        let found = packet_level_into(fine(), &machine, clocks(), &packets);
        for timed in [truth, found] {
            prop_assert_eq!(timed.timeline.total(), total(&packets));
            prop_assert_eq!(timed.timeline.bin_ps, 1000);
            let barriers = before_barriers(&timed.timeline);
            let expected = expected_before_barriers(&packets);
            prop_assert_eq!(barriers.len(), expected.len());
            for (found, expected) in barriers.iter().zip(&expected) {
                for event in [Event::TilesVisited, Event::SamplesTested, Event::PixelInvocations, Event::ColourWrites] {
                    prop_assert_eq!(found[event], expected[event], "{:?}", event);
                }
                // Vertices may be ahead, but none before the barrier is behind.
                prop_assert!(found[Event::TrianglesIn] >= expected[Event::TrianglesIn]);
            }
            for (packet, _) in &packets {
                if packet.kind == PacketKind::Barrier(Waits::All) && packet.pass > 0 {
                    let [before, after] = [packet.pass - 1, packet.pass].map(|pass| &timed.passes[pass as usize]);
                    prop_assert!(after.begin_ps >= before.end_ps);
                }
            }
        }
    }

    /// Every level reports the passes of a frame, from its start to its end, with the same work.
    #[test]
    fn passes_add_up_to_the_frame(packets in passes(), machine in machine()) {
        let packets = through_levels(packets, &machine);
        let all = levels(&machine, &packets);
        let busy = all.clone().map(|timed| timed.passes.iter().map(|pass| pass.busy_ps).collect::<Vec<_>>());
        prop_assert_eq!(&busy[1], &busy[0]);
        prop_assert_eq!(&busy[2], &busy[0]);
        for timed in all {
            let passes = &timed.passes;
            prop_assert!(passes.windows(2).all(|pair| pair[0].end_ps <= pair[1].end_ps));
            prop_assert!(passes.iter().all(|pass| pass.begin_ps <= pass.end_ps));
            if let Some(last) = passes.last() {
                prop_assert_eq!(last.end_ps, timed.timeline.duration_ps);
            }
        }
    }

    /// The work of the passes is the busy time of the frame, except for rounding. Clients of the L2 differ:
    /// `stepped` has them busy while requests are held up, too, but not in the cycle of a packet's last request,
    /// and `packet` not while they only request lines. Shared units lose up to a grain per bin at `packet`, memory
    /// on each of its channels.
    #[test]
    fn busy_times_of_passes_add_up_to_those_of_units(packets in passes(), machine in machine()) {
        let packets = through_levels(packets, &machine);
        let [truth, found, bound] = levels(&machine, &packets);
        let clients = [Unit::Command, Unit::Depth, Unit::Texture, Unit::Colour];
        for unit in Unit::ALL {
            let of = |timed: &Timed| {
                let passes: u64 = timed.passes.iter().map(|pass| pass.busy_ps[unit as usize]).sum();
                (passes, timed.timeline.busy_ps()[unit as usize])
            };
            // A cycle for each pass, and one for each of at most two phases per batch.
            let rounding = 1000 * (truth.passes.len() as u64 + 2 * 4 * truth.passes.len() as u64);
            let servers = if unit == Unit::Dram { machine.dram.channels.get() } else { 1 };
            let per_bin = 1000 * u64::from(servers) * found.timeline.bins.len() as u64;
            let close = |(passes, units): (u64, u64), by: u64| passes.abs_diff(units) <= by;
            prop_assert!(close(of(&bound), rounding), "{:?} {:?}", unit, of(&bound));
            if !clients.contains(&unit) {
                prop_assert!(close(of(&truth), rounding), "{:?} {:?}", unit, of(&truth));
                prop_assert!(close(of(&found), rounding + per_bin), "{:?} {:?}", unit, of(&found));
                continue;
            }
            let (passes, units) = of(&truth);
            let last_requests = 1000 * packets.len() as u64;
            prop_assert!(passes <= units + rounding + last_requests, "{:?} {:?}", unit, of(&truth));
            let (passes, units) = of(&found);
            prop_assert!(unit == Unit::Texture || units <= passes + rounding, "{:?} {:?}", unit, of(&found));
        }
    }
}
