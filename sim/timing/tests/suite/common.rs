//! Machines and streams for tests.

use activity::{Bounded, Event, LineAccess, LineKind, Packet, PacketKind, Unit};
use timing::stepped::{self, StepOptions, Stream};
use timing::{
    ClientSpec, Clock, Clocks, DemandBuilder, DramSpec, MachineSpec, Rates, Recorder, ShaderSpec,
    SharedCacheSpec, Timed, UnitSpec,
};

pub fn rates(text: &str) -> Rates {
    activity::spec::parse(text, "test").unwrap()
}

/// A bounded size of a machine.
pub fn size<const MIN: u32, const MAX: u32>(value: u32) -> Bounded<MIN, MAX> {
    Bounded::new(value).unwrap()
}

fn unit(text: &str) -> UnitSpec {
    UnitSpec { clock: Clock::Core, latency_cycles: size(1), queue: size(64), rates: rates(text) }
}

pub fn client(text: &str) -> ClientSpec {
    let rates = rates(text);
    ClientSpec {
        clock: Clock::Core,
        latency_cycles: size(1),
        queue: size(64),
        in_flight: size(64),
        lines_per_cycle: size(1),
        rates,
    }
}

/// A machine with rates and latencies of 1 and deep queues.
pub fn plain() -> MachineSpec {
    MachineSpec {
        command: client("{\"indices\": 1}"),
        shader: ShaderSpec {
            clock: Clock::Core,
            latency_cycles: size(1),
            queue: size(64),
            in_flight: size(64),
            cores: size(1),
            lanes: size(4),
            warp_lanes: size(4),
            warps: size(8),
            warps_per_cycle: size(1),
            alu_latency_cycles: size(1),
            shared_bytes: size(1024),
        },
        setup: unit("{\"triangles_in\": 1}"),
        traversal: unit("{\"tiles_visited\": 1}"),
        z_cull: unit("{\"z_cull_tests\": 1}"),
        sample_test: unit("{\"samples_tested\": 1}"),
        depth: client("{\"depth_reads\": 1}"),
        shading_cache: unit("{\"shading_lookups\": 1}"),
        texture: client("{\"texture_fetches\": 1}"),
        colour: client("{\"colour_writes\": 1}"),
        bins: None,
        compute: Some(client("{\"shared_cycles\": 1, \"atomic_steps\": 1}")),
        l2: SharedCacheSpec {
            clock: Clock::Core,
            latency_cycles: size(1),
            queue: size(64),
            lines_per_cycle: size(1),
        },
        llc: None,
        edram: None,
        dram: DramSpec {
            clock: Clock::Memory,
            latency_cycles: size(1),
            queue: size(64),
            channels: size(1),
            banks: size(2),
            row_bytes: size(512),
            interleave_bytes: size(64),
            burst_cycles: size(2),
            cas_cycles: size(3),
            activate_cycles: size(4),
            precharge_cycles: size(5),
            write_queue: None,
            activate_write_cycles: None,
            ranks: size(1),
            row_cycles: size(0),
            read_to_precharge_cycles: size(0),
            write_to_precharge_cycles: size(0),
            activate_to_activate_cycles: size(0),
            four_activates_cycles: size(0),
            write_to_read_cycles: size(0),
            read_to_write_cycles: size(0),
            rank_to_rank_cycles: size(0),
            refresh: None,
        },
    }
}

pub fn packet(kind: PacketKind, counts: &[(Event, u32)]) -> Packet {
    let mut packet = Packet::new(kind, 0);
    counts.iter().for_each(|&(event, count)| packet.counts[event] = count);
    packet
}

pub fn tile(counts: &[(Event, u32)]) -> Packet {
    packet(PacketKind::Tile, counts)
}

pub fn read(client: Unit, line: u32, kind: LineKind) -> LineAccess {
    LineAccess::new(client, line, kind)
}

pub type Packets = Vec<(Packet, Vec<LineAccess>)>;

pub fn clocks() -> Clocks {
    Clocks::new(1e9, 1e9).unwrap()
}

pub fn recorder() -> Recorder {
    Recorder::new(100_000, 1 << 12)
}

pub fn stepped_as(machine: &MachineSpec, clocks: Clocks, packets: &Packets, options: &StepOptions) -> Timed {
    stepped_into(recorder(), machine, clocks, packets, options)
}

/// The same, with a recorder.
pub fn stepped_into(
    recorder: Recorder,
    machine: &MachineSpec,
    clocks: Clocks,
    packets: &Packets,
    options: &StepOptions,
) -> Timed {
    machine.validate().unwrap();
    let mut builder = DemandBuilder::new(machine);
    let mut stream = Stream::default();
    packets.iter().for_each(|(packet, lines)| stream.push(&mut builder, packet, lines));
    stepped::run(machine, clocks, &builder, &stream, recorder, options).unwrap()
}

pub fn stepped(machine: &MachineSpec, packets: &Packets) -> Timed {
    stepped_as(machine, clocks(), packets, &StepOptions::default())
}

/// Tiles with the given events and no lines.
pub fn tiles(counts: impl IntoIterator<Item = Vec<(Event, u32)>>) -> Packets {
    counts.into_iter().map(|counts| (tile(&counts), Vec::new())).collect()
}

/// Timing of the packets at the level `packet`.
pub fn packet_level(machine: &MachineSpec, clocks: Clocks, packets: &Packets) -> Timed {
    packet_level_into(recorder(), machine, clocks, packets)
}

/// The same, with a recorder.
pub fn packet_level_into(
    recorder: Recorder,
    machine: &MachineSpec,
    clocks: Clocks,
    packets: &Packets,
) -> Timed {
    let mut clock = timing::PacketClock::new(machine, clocks, recorder);
    packets.iter().for_each(|(packet, lines)| clock.push(packet, lines));
    clock.finish()
}

/// Timing of the packets at the level `bound`.
pub fn bound_level(machine: &MachineSpec, clocks: Clocks, packets: &Packets) -> Timed {
    let mut clock = timing::BoundClock::new(machine, clocks, recorder());
    packets.iter().for_each(|(packet, lines)| clock.push(packet, lines));
    clock.finish()
}

/// The times at `stepped`, `packet` and `bound`.
pub fn levels(machine: &MachineSpec, packets: &Packets) -> [Timed; 3] {
    [
        stepped(machine, packets),
        packet_level(machine, clocks(), packets),
        bound_level(machine, clocks(), packets),
    ]
}

/// Cycles at the same levels.
pub fn cycles(machine: &MachineSpec, packets: &Packets) -> [u64; 3] {
    levels(machine, packets).map(|timed| timed.cycles)
}
