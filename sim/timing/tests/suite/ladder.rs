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
