//! Packets wait for what they depend on, at the levels `stepped` and `packet`.

use activity::{Event, LineAccess, LineKind, Packet, PacketKind, Unit};
use timing::{BinsSpec, MachineSpec};

use crate::common::{Packets, client, clocks, packet_level, plain, read, size, stepped, tile};

type Level = fn(&MachineSpec, &Packets) -> u64;

const LEVELS: [(&str, Level); 2] = [
    ("stepped", |machine, packets| stepped(machine, packets).cycles),
    ("packet", |machine, packets| packet_level(machine, clocks(), packets).cycles),
];

/// A packet of the batch `batch`.
fn of(batch: u32, kind: PacketKind, counts: &[(Event, u32)]) -> (Packet, Vec<LineAccess>) {
    let mut packet = Packet { batch, ..Packet::new(kind, 0) };
    counts.iter().for_each(|&(event, count)| packet.counts[event] = count);
    (packet, Vec::new())
}

fn front(batch: u32, cycles: u32) -> (Packet, Vec<LineAccess>) {
    of(batch, PacketKind::Vertices, &[(Event::Indices, cycles), (Event::TrianglesIn, 1)])
}

fn traversed(batch: u32, cycles: u32) -> (Packet, Vec<LineAccess>) {
    of(batch, PacketKind::Tile, &[(Event::TilesVisited, cycles)])
}

#[test]
fn tiles_wait_for_the_set_up_of_their_whole_batch() {
    let machine = plain();
    for (name, cycles) in LEVELS {
        let fronts = vec![front(0, 30), front(0, 50)];
        let alone = cycles(&machine, &fronts);
        let with_tile: Packets = fronts.into_iter().chain([traversed(0, 7)]).collect();
        // Its service, and the latency of traversal.
        assert_eq!(cycles(&machine, &with_tile), alone + 7 + 1, "{name}");
    }
}

#[test]
fn the_front_end_waits_for_the_tiles_of_the_batch_before_the_last() {
    let machine = plain();
    for (name, cycles) in LEVELS {
        let begun = vec![front(0, 5), front(1, 5), traversed(0, 400)];
        let then = cycles(&machine, &begun);
        let alone = cycles(&machine, &vec![front(0, 60)]);
        let all: Packets =
            begun.into_iter().chain([front(2, 60), traversed(1, 3), traversed(2, 7)]).collect();
        // The third batch is set up once the first has been traversed, and then traversed.
        assert_eq!(cycles(&machine, &all), then + alone + 7 + 1, "{name}");
    }
}

#[test]
fn a_packet_waits_for_its_lines() {
    waits_for_lines(plain(), Unit::Depth, |machine| machine.depth.in_flight = size(1));
}

#[test]
fn a_tile_waits_for_its_triangle_in_memory() {
    let bins = |in_flight| Some(BinsSpec { in_flight: size(in_flight), lines_per_cycle: size(1) });
    let machine = MachineSpec { bins: bins(64), ..plain() };
    waits_for_lines(machine, Unit::Traversal, |machine| machine.bins = bins(1));
}

fn waits_for_lines(mut machine: MachineSpec, unit: Unit, narrow_to_one: impl Fn(&mut MachineSpec)) {
    machine.dram.latency_cycles = size(500);
    let packet = |line| {
        (
            tile(&[(Event::TilesVisited, 1), (Event::DepthReads, 1), (Event::ColourWrites, 1)]),
            vec![read(unit, line, LineKind::Fetch)],
        )
    };
    let one = vec![packet(0)];
    let many: Packets = (0..64).map(packet).collect();
    let taken = LEVELS.map(|(name, cycles)| {
        let [first, last] = [&one, &many].map(|packets| cycles(&machine, packets));
        assert!(first > 500, "{name}: {first}");
        // All wait at once: the lines of the others arrive while the first packet waits.
        assert!(last < first + 64 * 4, "{name}: {last}");
        // With one waiting packet at a time, each waits separately.
        let mut narrow = machine.clone();
        narrow_to_one(&mut narrow);
        let in_turn = cycles(&narrow, &many);
        assert!(in_turn > 31 * 500, "{name}: {in_turn}");
        [first, last, in_turn]
    });
    for (truth, found) in taken[0].into_iter().zip(taken[1]) {
        assert!(truth.abs_diff(found) * 50 <= truth, "{truth} {found}");
    }
}

#[test]
fn written_bins_keep_set_up_waiting_for_no_answer_but_for_the_l2() {
    let bins = Some(BinsSpec { in_flight: size(4), lines_per_cycle: size(1) });
    let mut machine = MachineSpec { bins, ..plain() };
    let write = |line| LineAccess::new(Unit::Setup, line, LineKind::Write);
    let stream = |lines: u32| -> Packets {
        let front = |n: u32| {
            (
                of(0, PacketKind::Vertices, &[(Event::TrianglesIn, 1)]).0,
                (0..lines).map(|k| write(8 * n + k)).collect(),
            )
        };
        (0..200).map(front).collect()
    };
    for (name, cycles) in LEVELS {
        // One line a cycle hides behind the triangle; three take three cycles.
        let [none, one, three] = [0, 1, 3].map(|lines| cycles(&machine, &stream(lines)));
        assert!(one <= none + 2, "{name}: {one} {none}");
        assert!(three.abs_diff(600) < 24, "{name}: {three}");
    }
    machine.l2.latency_cycles = size(400);
    for (name, cycles) in LEVELS {
        assert!(cycles(&machine, &stream(3)) < 600 + 24 + 400, "{name}");
    }
}

#[test]
fn every_event_of_the_texture_units_may_have_a_rate() {
    for event in Unit::Texture.events().map(|at| Event::ALL[at]) {
        let mut machine = plain();
        machine.texture = client(&format!("{{\"{}\": 0.01}}", event.name()));
        let counts = [(Event::PixelInvocations, 4), (Event::ShaderOps, 4), (event, 4)];
        let packets = vec![(tile(&counts), Vec::new())];
        for (name, cycles) in LEVELS {
            assert!(cycles(&machine, &packets) > 400, "{name} {}", event.name());
        }
    }
}

#[test]
fn warps_wait_for_their_texels() {
    let mut machine = plain();
    machine.dram.latency_cycles = size(500);
    let counts = [(Event::PixelInvocations, 4), (Event::ShaderOps, 4), (Event::TextureFetches, 4)];
    let packets = vec![(tile(&counts), vec![read(Unit::Texture, 0, LineKind::Fetch)])];
    for (name, cycles) in LEVELS {
        assert!(cycles(&machine, &packets) > 500, "{name}");
    }
}
