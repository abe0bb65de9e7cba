//! The cheaper levels compared with the reference.

use activity::{Event, LineKind, Unit};
use proptest::prelude::*;
use timing::stepped::StepOptions;

use crate::common::{
    Packets, bound_level, clocks, packet_level, plain, read, size, stepped, stepped_as, tile, tiles,
};
use crate::conservation::{machine, packets, through_levels};

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// The recurrence equals the reference, to the cycle, for units that share nothing.
    #[test]
    fn a_chain_of_units_is_exact(
        works in prop::collection::vec(prop::array::uniform3(0u32..20), 1..60),
        queues in prop::array::uniform2(1u32..9),
        latencies in prop::array::uniform3(1u32..9),
    ) {
        let mut machine = plain();
        (machine.z_cull.queue, machine.sample_test.queue) = (size(queues[0]), size(queues[1]));
        let units = [&mut machine.traversal, &mut machine.z_cull, &mut machine.sample_test];
        units.into_iter().zip(latencies).for_each(|(unit, latency)| unit.latency_cycles = size(latency));
        let packets = tiles(works.into_iter().map(|[a, b, c]| {
            vec![(Event::TilesVisited, a), (Event::ZCullTests, b), (Event::SamplesTested, c)]
        }));
        let (truth, found) = (stepped(&machine, &packets), packet_level(&machine, clocks(), &packets));
        prop_assert_eq!(found.cycles, truth.cycles);
        prop_assert_eq!(found.timeline, truth.timeline);
    }

    /// All levels record the same events, and no unit is busy for longer than the frame.
    #[test]
    fn every_level_counts_the_same(packets in packets(), machine in machine()) {
        let packets = through_levels(packets, &machine);
        let truth = stepped_as(&machine, clocks(), &packets, &StepOptions::default());
        for found in [packet_level(&machine, clocks(), &packets), bound_level(&machine, clocks(), &packets)] {
            prop_assert_eq!(found.timeline.total(), truth.timeline.total());
            let bins = &found.timeline.bins;
            prop_assert!(bins.iter().all(|bin| bin.busy_ps.iter().all(|&busy| busy <= found.timeline.bin_ps)));
        }
    }
}

/// Relative error of `packet` in percent.
fn error(machine: &timing::MachineSpec, packets: &Packets) -> f64 {
    let (truth, found) = (stepped(machine, packets), packet_level(machine, clocks(), packets));
    (found.cycles as f64 / truth.cycles as f64 - 1.0) * 100.0
}

#[test]
fn shared_bottlenecks_are_close_to_the_reference() {
    let mut machine = plain();
    machine.shader.alu_latency_cycles = size(4);
    let shaded =
        |n: u32| (tile(&[(Event::PixelInvocations, 4 * n), (Event::ShaderOps, 4 * n * 10)]), Vec::new());
    let cores: Packets = (0..200).map(|k| shaded(1 + k % 7)).collect();
    assert!(error(&machine, &cores).abs() < 1.0, "cores: {}", error(&machine, &cores));
    let lines = |k: u32, stride: u32| {
        let lines = (0..8).map(|n| read(Unit::Depth, (8 * k + n) * stride, LineKind::Fetch)).collect();
        (tile(&[(Event::DepthReads, 1)]), lines)
    };
    let streaming: Packets = (0..200).map(|k| lines(k, 1)).collect();
    assert!(error(&machine, &streaming).abs() < 2.0, "streaming: {}", error(&machine, &streaming));
    // Every line in another row of one of two banks.
    let conflicts: Packets = (0..200).map(|k| lines(k, 8)).collect();
    assert!(error(&machine, &conflicts).abs() < 8.0, "conflicts: {}", error(&machine, &conflicts));
}

/// Lines of random rows of one bank (`rows`), or of all memory (0), over channels that hold `queue` lines each.
fn random_rows(rows: u64, [channels, banks, queue, in_flight]: [u32; 4]) -> (timing::MachineSpec, Packets) {
    let mut machine = plain();
    machine.l2.queue = size(8);
    machine.depth.in_flight = size(in_flight);
    let dram = &mut machine.dram;
    (dram.channels, dram.banks, dram.queue) = (size(channels), size(banks), size(queue));
    (dram.row_bytes, dram.interleave_bytes, dram.burst_cycles) = (size(4096), size(256), size(4));
    (dram.cas_cycles, dram.activate_cycles, dram.precharge_cycles) = (size(7), size(7), size(7));
    let mut state = 12345_u64;
    let mut next = |below: u64| {
        state = state.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(0x1405_7B7E_F767_814F);
        ((state >> 33) % below) as u32
    };
    let stride = 64 * channels * banks;
    let mut line = |packet: u32| match rows {
        0 => next(1 << 18),
        rows => (packet / 100 * 64 + next(64)) % stride + next(rows) * stride,
    };
    let packet = |packet: u32| {
        let lines = (0..8).map(|_| read(Unit::Depth, line(packet), LineKind::Fetch)).collect();
        (tile(&[(Event::DepthReads, 1)]), lines)
    };
    (machine, (0..1000).map(packet).collect())
}

/// A queue from which lines of any row may leave first, so that rows of one bank take turns.
#[test]
fn rows_that_take_turns_are_near_the_reference() {
    let sizes = [[1, 8, 16, 32], [2, 8, 16, 4], [2, 8, 32, 32], [2, 8, 8, 32], [4, 8, 16, 32], [2, 4, 16, 4]];
    let mut errors = Vec::new();
    for size in sizes {
        for rows in [0, 4, 8, 16, 64] {
            let (machine, packets) = random_rows(rows, size);
            let error = error(&machine, &packets);
            println!("{rows} rows, {size:?}: {error:.1} %");
            errors.push(error.abs());
        }
    }
    assert!(errors.iter().all(|error| *error < 20.0), "{errors:.1?}");
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    assert!(mean < 6.0, "{mean:.1} %");
}
