//! Rates of a GPU file are reached whatever the size of packets: units serve several packets in a cycle.

use activity::{Event, LineKind, Packet, PacketKind, Unit};
use proptest::prelude::*;
use timing::{Clocks, MachineSpec, Rates, Recorder};

use crate::common::{
    Packets, bound_level, clocks, packet, packet_level, packet_level_into, plain, rates, read, size, stepped,
    tile, tiles,
};

/// Events per cycle, and packets of one event each.
const RATES: [f64; 5] = [1.0, 2.0, 4.0, 2.5, 0.5];
const PACKETS: u64 = 1000;

/// A unit at a station, one of its events, the kind of packets that visit it, and cycles from the start of
/// the frame until it sees the first one.
const UNITS: [(Unit, Event, PacketKind, u64); 8] = [
    (Unit::Command, Event::Indices, PacketKind::Vertices, 0),
    (Unit::Setup, Event::TrianglesIn, PacketKind::Vertices, 2),
    (Unit::Traversal, Event::TilesVisited, PacketKind::Tile, 0),
    (Unit::ZCull, Event::ZCullTests, PacketKind::Tile, 1),
    (Unit::SampleTest, Event::SamplesTested, PacketKind::Tile, 2),
    (Unit::Depth, Event::DepthReads, PacketKind::Tile, 3),
    (Unit::ShadingCache, Event::ShadingLookups, PacketKind::Tile, 4),
    (Unit::Colour, Event::ColourWrites, PacketKind::Tile, 6),
];

fn rates_of(machine: &mut MachineSpec, unit: Unit) -> &mut Rates {
    match unit {
        Unit::Command => &mut machine.command.rates,
        Unit::Setup => &mut machine.setup.rates,
        Unit::Traversal => &mut machine.traversal.rates,
        Unit::ZCull => &mut machine.z_cull.rates,
        Unit::SampleTest => &mut machine.sample_test.rates,
        Unit::Depth => &mut machine.depth.rates,
        Unit::ShadingCache => &mut machine.shading_cache.rates,
        _ => &mut machine.colour.rates,
    }
}

/// The machine with one rate changed, and one event a packet of that unit.
fn stream((unit, event, kind, _): (Unit, Event, PacketKind, u64), rate: f64) -> (MachineSpec, Packets) {
    let mut machine = plain();
    *rates_of(&mut machine, unit) = rates(&format!("{{\"{}\": {rate}}}", event.name()));
    (machine, vec![(packet(kind, &[(event, 1)]), Vec::new()); PACKETS as usize])
}

/// Cycles at `stepped`, `packet` and `bound`.
fn at_all_levels(machine: &MachineSpec, packets: &Packets) -> [f64; 3] {
    let (found, bound) = (packet_level(machine, clocks(), packets), bound_level(machine, clocks(), packets));
    [stepped(machine, packets), found, bound].map(|timed| timed.cycles as f64)
}

#[test]
fn every_unit_reaches_its_rate_with_packets_of_one_event() {
    for of_unit in UNITS {
        for rate in RATES {
            let (machine, packets) = stream(of_unit, rate);
            let (unit, .., fill) = of_unit;
            // A packet that ends within a cycle leaves in it. One cycle of latency.
            let cycles = fill + (PACKETS as f64 / rate) as u64 + 1;
            let truth = stepped(&machine, &packets);
            let found = packet_level(&machine, clocks(), &packets);
            assert_eq!((truth.cycles, found.cycles), (cycles, cycles), "{unit:?} at {rate}");
            let bound = bound_level(&machine, clocks(), &packets).cycles;
            assert!((bound as f64 - cycles as f64).abs() <= 8.0, "{unit:?} at {rate}: {bound} of {cycles}");
            for timed in [&truth, &found] {
                let busy = timed.timeline.busy_ps()[unit as usize] as f64 / 1000.0;
                assert!((busy - PACKETS as f64 / rate).abs() < 0.05, "{unit:?} at {rate}: busy for {busy}");
            }
        }
    }
}

#[test]
fn a_queue_limits_the_packets_of_a_cycle() {
    // Places are taken on the way: with `q` of them and a latency of `l`, `q` packets pass in `l + 1` cycles.
    let (mut machine, packets) = stream(UNITS[3], 8.0);
    *rates_of(&mut machine, Unit::Traversal) = rates("{\"tiles_visited\": 8}");
    machine.traversal.latency_cycles = size(3);
    for (queue, per_cycle) in [(4, 1.0), (8, 2.0), (32, 8.0), (64, 8.0)] {
        machine.z_cull.queue = size(queue);
        let cycles = [stepped(&machine, &packets), packet_level(&machine, clocks(), &packets)];
        let [truth, found] = cycles.map(|timed| timed.cycles);
        assert_eq!(truth, found, "queue of {queue}");
        let expected = PACKETS as f64 / per_cycle;
        assert!((truth as f64 - expected).abs() < 10.0, "queue of {queue}: {truth} for {expected}");
    }
}

#[test]
fn requests_of_several_packets_fit_in_a_cycle() {
    for lines in [1, 2, 4] {
        let mut machine = plain();
        (machine.depth.lines_per_cycle, machine.l2.lines_per_cycle) = (size(lines), size(lines));
        machine.depth.rates = rates("{\"depth_reads\": 8}");
        let of = |n: u32| (tile(&[(Event::DepthReads, 1)]), vec![read(Unit::Depth, n, LineKind::Hit)]);
        let packets: Packets = (0..PACKETS as u32).map(of).collect();
        let cycles = at_all_levels(&machine, &packets);
        let expected = PACKETS as f64 / f64::from(lines);
        assert!(cycles.iter().all(|cycles| (cycles - expected).abs() < 12.0), "{cycles:?} for {expected}");
    }
}

/// A tile that takes so many quarters of a cycle in traversal, z-cull and sample test.
fn quarters([a, b, c]: [u32; 3]) -> Packet {
    tile(&[(Event::TilesVisited, a), (Event::ZCullTests, b), (Event::SamplesTested, c)])
}

fn quarter_machine() -> MachineSpec {
    let mut machine = plain();
    for (unit, event) in [
        (Unit::Traversal, "tiles_visited"),
        (Unit::ZCull, "z_cull_tests"),
        (Unit::SampleTest, "samples_tested"),
    ] {
        *rates_of(&mut machine, unit) = rates(&format!("{{\"{event}\": 4}}"));
    }
    machine
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// The recurrence equals the reference, to the cycle, for units that share nothing and serve parts of cycles.
    #[test]
    fn a_chain_of_parts_of_cycles_is_exact(
        works in prop::collection::vec(prop::array::uniform3(0u32..12), 1..60),
        queues in prop::array::uniform2(1u32..9),
        latencies in prop::array::uniform3(1u32..9),
    ) {
        let mut machine = quarter_machine();
        (machine.z_cull.queue, machine.sample_test.queue) = (size(queues[0]), size(queues[1]));
        let units = [&mut machine.traversal, &mut machine.z_cull, &mut machine.sample_test];
        units.into_iter().zip(latencies).for_each(|(unit, latency)| unit.latency_cycles = size(latency));
        let packets: Packets = works.into_iter().map(|work| (quarters(work), Vec::new())).collect();
        let (truth, found) = (stepped(&machine, &packets), packet_level(&machine, clocks(), &packets));
        prop_assert_eq!(found.cycles, truth.cycles);
        prop_assert_eq!(found.timeline.total(), truth.timeline.total());
        for (a, b) in found.timeline.busy_ps().into_iter().zip(truth.timeline.busy_ps()) {
            prop_assert!(a.abs_diff(b) < 10, "{} and {} ps", a, b);
        }
    }

    /// No unit serves faster than its rate, and a part of a cycle never makes a stream longer than a whole one.
    #[test]
    fn parts_of_cycles_lie_between_the_rate_and_whole_cycles(
        works in prop::collection::vec(0u32..12, 1..60),
        queue in 1u32..9,
    ) {
        let of = |works: &[u32]| tiles(works.iter().map(|&n| {
            vec![(Event::TilesVisited, n), (Event::ZCullTests, 1)]
        }));
        let mut machine = quarter_machine();
        machine.z_cull.queue = size(queue);
        let found = stepped(&machine, &of(&works)).cycles;
        let mut slow = plain();
        slow.z_cull.queue = size(queue);
        let whole: Vec<_> = works.iter().map(|n| n.div_ceil(4)).collect();
        prop_assert!(found <= stepped(&slow, &of(&whole)).cycles);
        prop_assert!(found >= u64::from(works.iter().sum::<u32>() / 4));
    }
}

/// Packets of one warp, each with one event of a data unit, or of two.
fn warps(rate: f64, per_cycle: u32, counts: &[(Event, u32)], kind: PacketKind) -> (MachineSpec, Packets) {
    let mut machine = plain();
    machine.shader.warps_per_cycle = size(per_cycle);
    (machine.shader.cores, machine.shader.warps) = (size(4), size(64));
    machine.texture.rates = rates(&format!("{{\"texture_fetches\": {rate}}}"));
    machine.compute.as_mut().unwrap().rates = rates(&format!("{{\"shared_cycles\": {rate}}}"));
    (machine, vec![(packet(kind, counts), Vec::new()); PACKETS as usize])
}

#[test]
fn data_units_reach_their_rates_with_warps_of_one_event() {
    let texels = [(Event::PixelInvocations, 4), (Event::TextureFetches, 1)];
    let shared = [(Event::GroupLanes, 4), (Event::SharedCycles, 1)];
    for (counts, kind) in [(texels, PacketKind::Tile), (shared, PacketKind::Compute)] {
        for rate in [1.0, 2.0, 4.0, 2.5, 0.5] {
            let (machine, packets) = warps(rate, 4, &counts, kind);
            let expected = PACKETS as f64 / rate;
            let cycles = at_all_levels(&machine, &packets);
            assert!(
                cycles.iter().all(|cycles| (cycles - expected).abs() < 0.02 * expected + 16.0),
                "{kind:?} at {rate}: {cycles:?} for {expected}"
            );
        }
    }
}

#[test]
fn warps_are_sent_at_their_rate() {
    for per_cycle in [1, 2, 3, 4] {
        let (machine, packets) = warps(1e3, per_cycle, &[(Event::PixelInvocations, 4)], PacketKind::Tile);
        let expected = PACKETS as f64 / f64::from(per_cycle);
        let cycles = at_all_levels(&machine, &packets);
        assert!(
            cycles.iter().all(|cycles| (cycles - expected).abs() < 0.02 * expected + 16.0),
            "{per_cycle} a cycle: {cycles:?} for {expected}"
        );
    }
}

#[test]
fn no_unit_is_busy_for_longer_than_a_bin() {
    for clocks in [Clocks::new(400e6, 400e6), Clocks::new(925e6, 1375e6), Clocks::new(333e6, 401e6)] {
        let mut machine = plain();
        *rates_of(&mut machine, Unit::Traversal) = rates("{\"tiles_visited\": 48}");
        machine.z_cull.queue = size(1000);
        let packets = tiles((0..5000).map(|n| vec![(Event::TilesVisited, 1 + n * n % 97)]));
        let work: f64 = (0..5000_u32).map(|n| f64::from(1 + n * n % 97) / 48.0).sum();
        for bin_ps in [10_000, 100_000] {
            let bins = Recorder::new(bin_ps, 1 << 12);
            let timeline = packet_level_into(bins, &machine, clocks.unwrap(), &packets).timeline;
            let busy = |bin: &activity::Bin| bin.busy_ps[Unit::Traversal as usize];
            assert!(timeline.bins.iter().all(|bin| busy(bin) <= timeline.bin_ps), "{clocks:?}");
            let found = timeline.busy_ps()[Unit::Traversal as usize] as f64;
            let expected = work * clocks.unwrap().ps(clocks.unwrap().period(timing::Clock::Core)) as f64;
            assert!((found / expected - 1.0).abs() < 1e-3, "{found} of {expected}");
        }
    }
}
