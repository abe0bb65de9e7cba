//! What memory chips allow, in closed form: refresh, turns of the bus, rows that stay open, activations, ranks.

use activity::{Event, LineAccess, LineKind, Unit};
use timing::stepped::StepOptions;
use timing::{BinsSpec, Clocks, MachineSpec, RefreshSpec, Timed};

use crate::common::{Packets, bound_level, cycles, packet_level, plain, size, stepped, stepped_as, tile};

/// A machine that only memory limits: a bus that takes 8 cycles a line, one bank of one row.
fn machine() -> MachineSpec {
    let mut machine = plain();
    (machine.depth.lines_per_cycle, machine.l2.lines_per_cycle) = (size(4), size(4));
    let dram = &mut machine.dram;
    (dram.banks, dram.row_bytes, dram.burst_cycles, dram.queue) = (size(1), size(1 << 20), size(8), size(16));
    machine
}

/// Reads and, where `true`, writes of lines, in order.
pub fn stream(lines: impl IntoIterator<Item = (u32, bool)>) -> Packets {
    let access = |(line, is_write)| {
        let kind = if is_write { LineKind::Drain } else { LineKind::Fetch };
        let mut access = LineAccess::new(Unit::Depth, line, kind);
        if is_write {
            access.write(line);
        }
        access
    };
    let all: Vec<_> = lines.into_iter().map(access).collect();
    let packet = |lines: &[LineAccess]| {
        let mut packet = tile(&[(Event::DepthReads, 1)]);
        packet.counts[Event::DramReadBytes] = 64 * lines.iter().filter(|line| line.is_read()).count() as u32;
        packet.counts[Event::DramWriteBytes] =
            64 * lines.iter().map(|line| line.written().count() as u32).sum::<u32>();
        (packet, lines.to_vec())
    };
    all.chunks(64).map(packet).collect()
}

fn reads(count: u32, stride: u32) -> Packets {
    stream((0..count).map(|n| (n * stride, false)))
}

/// Cycles that `more` lines add in a long stream.
fn added(machine: &MachineSpec, of: impl Fn(u32) -> Packets, from: u32, more: u32) -> [f64; 3] {
    let [short, long] = [from, from + more].map(|count| cycles(machine, &of(count)));
    std::array::from_fn(|at| (long[at] - short[at]) as f64)
}

/// `stepped` is exact, the others are within `percent`.
fn is(found: [f64; 3], expected: f64, percent: f64) {
    assert_eq!(found[0], expected, "{found:?}");
    let near = |found: f64| (found / expected - 1.0).abs() <= percent / 100.0;
    assert!(near(found[1]) && near(found[2]), "{found:?} for {expected}");
}

#[test]
fn a_stream_loses_the_time_of_its_refreshes() {
    let mut machine = machine();
    // The row closes in 5, is refreshed in 71, and opens in 4: ten lines less in every 400 cycles.
    let plain = cycles(&machine, &reads(4000, 1))[0];
    machine.dram.refresh = Some(RefreshSpec { interval_cycles: size(400), busy_cycles: size(71) });
    let found = cycles(&machine, &reads(4000, 1))[0];
    assert_eq!(found - plain, found / 400 * 80);
    is(added(&machine, |count| reads(count, 1), 400, 4000), 4000.0 * 8.0 * 400.0 / 320.0, 1.0);
}

#[test]
fn an_idle_rank_is_refreshed_in_time() {
    // Two lines of a row, the second after 900 cycles of traversal: refreshed in between, so that the row has
    // to open again.
    let mut machine = machine();
    let mut packets = [reads(1, 1), reads(1, 1)].concat();
    packets[1].0.counts[Event::TilesVisited] = 900;
    let plain = stepped(&machine, &packets).cycles;
    machine.dram.refresh = Some(RefreshSpec { interval_cycles: size(400), busy_cycles: size(71) });
    assert_eq!(stepped(&machine, &packets).cycles, plain + 4);
    // In the middle of a refresh the line waits for its end, too.
    packets[1].0.counts[Event::TilesVisited] = 820;
    machine.dram.refresh = None;
    let plain = stepped(&machine, &packets).cycles;
    machine.dram.refresh = Some(RefreshSpec { interval_cycles: size(400), busy_cycles: size(71) });
    let comes = 820 + 5;
    assert_eq!(stepped(&machine, &packets).cycles, plain + (800 + 71 - comes) + 4);
}

#[test]
fn reads_and_writes_in_turn_pay_for_every_turn() {
    let mut machine = machine();
    (machine.dram.write_to_read_cycles, machine.dram.read_to_write_cycles) = (size(15), size(9));
    machine.dram.write_queue = Some(size(1));
    let in_turn = |count| stream((0..count).map(|n| (n, n % 2 == 1)));
    is(added(&machine, in_turn, 400, 4000), 4000.0 * 8.0 + 2000.0 * (15.0 + 9.0), 4.0);
    (machine.dram.write_to_read_cycles, machine.dram.read_to_write_cycles) = (size(0), size(0));
    is(added(&machine, in_turn, 400, 4000), 4000.0 * 8.0, 4.0);
}

#[test]
fn a_bus_turns_once_for_the_lines_that_its_queue_holds() {
    let mut machine = machine();
    (machine.dram.write_to_read_cycles, machine.dram.read_to_write_cycles) = (size(15), size(9));
    for queue in [4, 16] {
        machine.dram.queue = size(queue);
        // The other half of the lines fills the queue: `2 queue - 1` lines one way, as the place of the last
        // one is free by then.
        let in_turn = |count| stream((0..count).map(|n| (n, n % 2 == 1)));
        let lines = 2 * (2 * queue - 1);
        let expected = f64::from(100 * lines) * 8.0 + 100.0 * (15.0 + 9.0);
        is(added(&machine, in_turn, 10 * lines, 100 * lines), expected, 4.0);
    }
    // Writes wait until theirs is full.
    machine.dram.write_queue = Some(size(8));
    let in_turn = |count| stream((0..count).map(|n| (n, n % 2 == 1)));
    is(added(&machine, in_turn, 160, 1600), 1600.0 * 8.0 + 100.0 * (15.0 + 9.0), 4.0);
}

#[test]
fn a_bus_turns_no_more_than_once_each_way_for_two_chunks() {
    let mut machine = machine();
    (machine.dram.write_to_read_cycles, machine.dram.read_to_write_cycles) = (size(15), size(9));
    machine.dram.channels = size(2);
    // Chunks of as many lines as a queue holds, and longer ones.
    for interleave_bytes in [1024, 2048, 4096] {
        machine.dram.interleave_bytes = size(interleave_bytes);
        let packets = stream((0..8000).map(|n| (n / 2 + n % 2 * 8192, n % 2 == 1)));
        let [stepped, packet, bound] = cycles(&machine, &packets);
        let off = |found: u64| (found as f64 / stepped as f64 - 1.0).abs();
        assert!(off(packet) < 0.08, "{interleave_bytes}: {stepped} {packet} {bound}");
    }
}

#[test]
fn a_rank_opens_at_most_four_rows_in_a_window() {
    let mut machine = machine();
    let dram = &mut machine.dram;
    (dram.banks, dram.row_bytes, dram.burst_cycles) = (size(16), size(64), size(2));
    let all_rows = |count| reads(count, 1);
    // Each line has a row of its own, and a bank has 16 activations to close it: the command to close it and
    // that to open the next take turns.
    dram.activate_to_activate_cycles = size(6);
    is(added(&machine, all_rows, 400, 4000), 4000.0 * 6.0, 1.0);
    machine.dram.four_activates_cycles = size(40);
    is(added(&machine, all_rows, 400, 4000), 4000.0 * 40.0 / 4.0, 1.0);
    // Two ranks of half the banks have a window each.
    (machine.dram.ranks, machine.dram.banks) = (size(2), size(8));
    let in_turn = |count: u32| stream((0..count).map(|n| (n / 2 % 8 + n % 2 * 8 + n / 16 * 16, false)));
    is(added(&machine, in_turn, 400, 4000), 4000.0 * 40.0 / 8.0, 1.0);
}

#[test]
fn a_row_stays_open_as_long_as_it_has_to() {
    // Two rows of one bank in turn; burst 8, tRCD 4, tRP 5.
    let mut machine = machine();
    (machine.dram.row_bytes, machine.dram.queue) = (size(64), size(2));
    let rows = |count| reads(count, 1);
    // A row closes in the cycle of its column command.
    is(added(&machine, rows, 100, 1000), 1000.0 * (4.0 + 5.0), 1.0);
    machine.dram.read_to_precharge_cycles = size(13);
    is(added(&machine, rows, 100, 1000), 1000.0 * (4.0 + 13.0 + 5.0), 1.0);
    machine.dram.row_cycles = size(30);
    is(added(&machine, rows, 100, 1000), 1000.0 * (30.0 + 5.0), 1.0);
    let written = |count| stream((0..count).map(|n| (n, true)));
    machine.dram.write_to_precharge_cycles = size(37);
    is(added(&machine, written, 100, 1000), 1000.0 * (4.0 + 37.0 + 5.0), 1.0);
}

#[test]
fn two_ranks_hide_what_one_cannot() {
    let mut machine = machine();
    (machine.dram.banks, machine.dram.row_bytes) = (size(2), size(4096));
    (machine.dram.write_to_read_cycles, machine.dram.rank_to_rank_cycles) = (size(15), size(1));
    // Lines are read in one row and written in another, both open: 64 lines in a row.
    let in_turn = |count: u32| stream((0..count).map(|n| (n / 2 % 64 + n % 2 * 64, n % 2 == 1)));
    machine.dram.write_queue = Some(size(1));
    is(added(&machine, in_turn, 400, 4000), 4000.0 * 8.0 + 2000.0 * 15.0, 4.0);
    // In another rank a read need not wait for the chips that were written.
    (machine.dram.ranks, machine.dram.banks) = (size(2), size(1));
    assert_eq!(added(&machine, in_turn, 400, 4000)[0], 4000.0 * (8.0 + 1.0));
    // Nor for those that are refreshed, if enough lines of others wait.
    machine.dram.rank_to_rank_cycles = size(0);
    let of_both = |count: u32| stream((0..count).map(|n| (n / 2 % 64 + n % 2 * 64, false)));
    machine.dram.refresh = Some(RefreshSpec { interval_cycles: size(400), busy_cycles: size(21) });
    is(added(&machine, of_both, 400, 4000), 4000.0 * 8.0, 1.0);
}

/// A core of so many hertz with memory of 1 MHz, at `stepped`, `packet` and `bound`.
fn with_slow_memory(core_hz: f64, machine: &MachineSpec, packets: &Packets) -> [Timed; 3] {
    let clocks = Clocks::new(core_hz, 1e6).unwrap();
    [
        stepped_as(machine, clocks, packets, &StepOptions::default()),
        packet_level(machine, clocks, packets),
        bound_level(machine, clocks, packets),
    ]
}

/// Lines that several clients read and write, in several rows.
fn mixed() -> Packets {
    let line = |n: u32| if n % 5 < 2 { (4096 + 3 * n % 509, true) } else { (7 * n % 1021, false) };
    stream((0..600).map(line))
}

#[test]
fn a_frame_is_as_long_as_its_cycles() {
    // CL of a slow memory is long, and nothing waits for the lines that are written last.
    let mut machine = machine();
    (machine.dram.cas_cycles, machine.dram.banks, machine.dram.row_bytes) = (size(30), size(8), size(512));
    for packets in [mixed(), stream((0..100).map(|n| (n, true)))] {
        for timed in with_slow_memory(333e6, &machine, &packets) {
            let cycles = timed.timeline.duration_ps as f64 * 333e-6;
            assert!((cycles / timed.cycles as f64 - 1.0).abs() < 2e-4, "{cycles} for {}", timed.cycles);
        }
    }
}

#[test]
fn a_clock_that_hardly_differs_takes_the_same_time() {
    // Clocks of 333 and 333.3 MHz have grains of other lengths.
    let mut machine = machine();
    (machine.dram.banks, machine.dram.row_bytes, machine.dram.burst_cycles) = (size(8), size(512), size(4));
    for packets in [mixed(), reads(400, 1), reads(400, 9)] {
        let [one, other] = [333e6, 333.3e6].map(|hz| with_slow_memory(hz, &machine, &packets));
        for (one, other) in one.iter().zip(&other) {
            let [one, other] = [one, other].map(|timed| timed.timeline.duration_ps as f64);
            assert!((other / one - 1.0).abs() < 2e-3, "{one} and {other} ps");
        }
    }
}

#[test]
fn units_far_apart_in_the_pipeline_that_share_a_bank() {
    // Triangles are read at the head of the pipeline, and colours at its end from a row of their bank: for
    // packets in order, lines out of the order of time.
    let mut machine = plain();
    machine.bins = Some(BinsSpec { in_flight: size(2), lines_per_cycle: size(1) });
    machine.sample_test.latency_cycles = size(1000);
    let packet = |n: u32| {
        let line = |unit, line| LineAccess::new(unit, line, LineKind::Fetch);
        let lines = vec![line(Unit::Traversal, n / 8 * 16 + n % 8), line(Unit::Colour, (1 << 20) + n % 8)];
        (tile(&[(Event::TilesVisited, 30), (Event::ColourWrites, 1)]), lines)
    };
    let packets: Packets = (0..400).map(packet).collect();
    for queue in [8, 16, 64] {
        machine.dram.queue = size(queue);
        let [stepped, packet, _] = cycles(&machine, &packets);
        assert!(stepped.abs_diff(packet) * 50 <= stepped, "{queue}: {stepped} {packet}");
    }
}
