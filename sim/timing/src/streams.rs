//! Synthetic streams of packets: some challenge the levels of timing, others measure a single rate. They
//! bypass the pipeline, so each has a single cause.

use activity::{Bounded, Event, LineAccess, LineKind, Packet, PacketKind, Unit, Waits};

use crate::spec::{Entries, MachineSpec};

/// Packets with their lines.
pub type Packets = Vec<(Packet, Vec<LineAccess>)>;

/// A packet with events and lines; the events of the lines are counted as in the pipeline.
fn packet(
    kind: PacketKind,
    triangle: u32,
    counts: &[(Event, u32)],
    lines: Vec<LineAccess>,
) -> (Packet, Vec<LineAccess>) {
    let mut packet = Packet { tile: 0, triangle, ..Packet::new(kind, 0) };
    counts.iter().for_each(|&(event, count)| packet.counts[event] = count);
    for line in &lines {
        packet.counts[if line.is_read() { Event::L2Reads } else { Event::L2Writes }] += 1;
        packet.counts[Event::L2Misses] += u32::from(line.kind == LineKind::Fetch);
        packet.counts[Event::DramReadBytes] += 64 * u32::from(line.kind == LineKind::Fetch);
        packet.counts[Event::DramWriteBytes] += 64 * line.written().count() as u32;
    }
    (packet, lines)
}

/// `count` lines of `client` from `first` on, `stride` apart. Each evicts the line `victim` after it, if
/// given.
fn lines(
    client: Unit,
    first: u32,
    count: u32,
    stride: u32,
    kind: LineKind,
    victim: Option<u32>,
) -> Vec<LineAccess> {
    let line = |n: u32| {
        let mut access = LineAccess::new(client, first + n * stride, kind);
        victim.into_iter().for_each(|far| access.write(first + n * stride + far));
        access
    };
    (0..count).map(line).collect()
}

fn vertices(triangle: u32, triangles: u32, ops: u32) -> (Packet, Vec<LineAccess>) {
    let counts = [
        (Event::Indices, 3 * triangles),
        (Event::VerticesFetched, triangles),
        (Event::VertexInvocations, triangles),
        (Event::ShaderOps, ops * triangles),
        (Event::TrianglesIn, triangles),
    ];
    packet(
        PacketKind::Vertices,
        triangle,
        &counts,
        lines(Unit::Command, triangle, triangles / 2, 1, LineKind::Fetch, None),
    )
}

/// A tile with `pixels` shaded pixels of `ops` operations each.
fn tile(triangle: u32, pixels: u32, ops: u32, lines: Vec<LineAccess>) -> (Packet, Vec<LineAccess>) {
    let counts = [
        (Event::TilesVisited, 1),
        (Event::TileMadds, 96),
        (Event::ZCullTests, 1),
        (Event::SamplesTested, 8 * pixels),
        (Event::DepthReads, 8 * pixels),
        (Event::ShadingLookups, pixels),
        (Event::PixelInvocations, pixels),
        (Event::ShaderOps, ops * pixels),
        (Event::ColourWrites, 8 * pixels),
    ];
    packet(PacketKind::Tile, triangle, &counts, lines)
}

/// A stream that challenges a level, and its machine.
#[derive(Clone, Debug)]
pub struct Failure {
    /// What is special about it, in a few words.
    pub name: &'static str,
    /// The stream.
    pub packets: Packets,
    /// The machine.
    pub units: MachineSpec,
}

/// All challenging streams for `units`, in batches of `batch` triangles; those of groups come last, for
/// machines that have them.
pub fn failures(units: &MachineSpec, batch: u32) -> Vec<Failure> {
    let on = |name, packets| Failure { name, packets, units: units.clone() };
    let mut narrow = on("queues of one", tiny(batch));
    shallow(&mut narrow.units);
    let of_groups = units.compute.is_some().then(|| groups::failures(units, units.shader.shared_bytes.get()));
    let mut all = vec![
        on("one giant triangle", giant()),
        on("tiny triangles", tiny(batch)),
        on("work in turn", alternating(batch)),
        narrow,
        on("thrashing caches", thrashing(1)),
        on("row after row", thrashing(4096)),
        on("a short frame", vec![vertices(0, 1, 8), tile(0, 4, 8, Vec::new())]),
        on("64 passes of one triangle", single_triangles()),
        on("passes in a chain", chain()),
        on("passes side by side", side_by_side()),
    ];
    all.extend(of_groups.into_iter().flatten().map(|(name, packets)| on(name, packets)));
    all
}

/// Streams of groups.
mod groups {
    use super::*;

    /// A group that fills four warps or, if they do not fit, a core.
    struct Shape {
        lanes: u32,
        shared_bytes: u32,
    }

    /// The streams by name, for cores with `of_core` bytes of shared memory.
    pub fn failures(units: &MachineSpec, of_core: u32) -> Vec<(&'static str, Packets)> {
        let lanes = units.shader.warp_lanes.get() * units.shader.warps.get().min(4);
        let small = Shape { lanes, shared_bytes: 0 };
        let whole = Shape { lanes, shared_bytes: of_core };
        let one_way = |n: u32| whole.group(n, (40, 200), &[(Event::SharedCycles, 64)], Vec::new());
        let streams = |n: u32| {
            small.group(n, (16, 16), &[], lines(Unit::Compute, n * 32, 32, 1, LineKind::Fetch, Some(1 << 20)))
        };
        let scattered = |n: u32| {
            small.group(n, (16, 16), &[], lines(Unit::Compute, n * 131_072, 16, 4096, LineKind::Fetch, None))
        };
        let contended = |n: u32| {
            let changed = lines(Unit::Compute, 7, 8, 0, LineKind::Hit, None);
            small.group(n, (16, 16), &[(Event::Atomics, lanes), (Event::AtomicSteps, lanes)], changed)
        };
        let passes = |before: bool| {
            in_passes((0..12).map(|n| {
                let first = (before && n > 0).then(|| barrier(Waits::All, n << 16, 64));
                let read = |at: u32| lines(Unit::Compute, (n << 16) + 8 * at, 8, 1, LineKind::Fetch, None);
                let draws = std::iter::once(vertices(0, 32, 40))
                    .chain((0..150).map(|at| tile(at, 32, 40, Vec::new())));
                let groups =
                    (0..60).map(|at| small.group(at, (60, 80), &[(Event::SharedCycles, 16)], read(at)));
                (first, if n % 2 == 0 { draws.collect() } else { dispatch(groups.collect()) })
            }))
        };
        vec![
            ("groups that fill a core", dispatch((0..300).map(one_way).collect())),
            ("groups that stream", dispatch((0..600).map(streams).collect())),
            ("groups that scatter", dispatch((0..400).map(scattered).collect())),
            ("atomics on one word", dispatch((0..400).map(contended).collect())),
            ("groups and draws in a chain", passes(true)),
            ("groups and draws side by side", passes(false)),
        ]
    }

    /// Groups of one dispatch.
    fn dispatch(groups: Packets) -> Packets {
        std::iter::once(packet(PacketKind::Draw, 0, &[(Event::Draws, 1)], Vec::new())).chain(groups).collect()
    }

    impl Shape {
        /// A group of so many operations a lane, and so many one after another.
        fn group(
            &self,
            number: u32,
            (ops, steps): (u32, u32),
            more: &[(Event, u32)],
            lines: Vec<LineAccess>,
        ) -> (Packet, Vec<LineAccess>) {
            let own = [
                (Event::Groups, 1),
                (Event::GroupLanes, self.lanes),
                (Event::ShaderOps, ops * self.lanes),
                (Event::GroupSteps, steps),
                (Event::SharedBytes, self.shared_bytes),
                (Event::BufferLines, lines.len() as u32),
            ];
            packet(PacketKind::Compute, number, &[&own, more].concat(), lines)
        }
    }
}

fn giant() -> Packets {
    let fetched = |n: u32| lines(Unit::Colour, (1u32 << 20) + n * 8, 8, 1, LineKind::Fetch, Some(1 << 18));
    std::iter::once(vertices(0, 1, 20)).chain((0..4000).map(|n| tile(0, 64, 20, fetched(n)))).collect()
}

/// Number of batches of `triangles` for some thousand triangles.
fn batches(triangles: u32) -> u32 {
    (6144 / triangles).max(2)
}

fn tiny(triangles: u32) -> Packets {
    let batch = |b: u32| {
        let fronts = (0..triangles / 32).map(move |n| vertices(b * triangles + 32 * n, 32, 20));
        let tiles = (0..triangles).map(move |n| tile(b * triangles + n, n % 3, 20, Vec::new()));
        (fronts.collect::<Packets>(), tiles.collect::<Packets>())
    };
    in_batches((0..batches(triangles)).map(batch).collect())
}

/// Long vertex programs, then long pixel programs, on the same cores.
fn alternating(triangles: u32) -> Packets {
    let batch = |b: u32| {
        let fronts = (0..triangles / 32).map(move |n| vertices(b * triangles + 32 * n, 32, 400));
        let tiles = (0..40).map(move |n| tile(b * triangles + n, 64, 400, Vec::new()));
        (fronts.collect::<Packets>(), tiles.collect::<Packets>())
    };
    in_batches((0..batches(triangles)).map(batch).collect())
}

/// Packets of all batches, with the front end one batch ahead of the tiles.
fn in_batches(batches: Vec<(Packets, Packets)>) -> Packets {
    let (mut all, mut waiting) = (Packets::new(), Packets::new());
    for ((fronts, tiles), batch) in batches.into_iter().zip(0..) {
        let numbered = |packets: Packets| -> Packets {
            packets.into_iter().map(|(packet, lines)| (Packet { batch, ..packet }, lines)).collect()
        };
        all.extend(numbered(fronts));
        all.append(&mut waiting);
        waiting = numbered(tiles);
    }
    all.extend(waiting);
    all
}

/// Tiles whose depth, texture and colour lines all miss, with `stride` lines between accesses.
fn thrashing(stride: u32) -> Packets {
    let tiles = (0..1500).map(|n| {
        let of = |client, base: u32, victim| {
            lines(client, base + n * 4 * stride, 4, stride, LineKind::Fetch, victim)
        };
        let all = [
            of(Unit::Depth, 0, Some(77 * stride)),
            of(Unit::Texture, 33 * stride, None),
            of(Unit::Colour, 55 * stride, Some(99 * stride)),
        ];
        tile(0, 16, 20, all.concat())
    });
    std::iter::once(vertices(0, 1, 20)).chain(tiles).collect()
}

/// A frame of passes, with what comes before each.
fn in_passes(passes: impl IntoIterator<Item = (Option<Packets>, Packets)>) -> Packets {
    let mut all = Packets::new();
    for ((before, packets), pass) in passes.into_iter().zip(0..) {
        let of_pass = before.into_iter().flatten().chain(packets);
        all.extend(of_pass.map(|(packet, lines)| (Packet { pass, ..packet }, lines)));
    }
    all
}

/// A barrier at which depth and colour write `count` lines each to the L2, from `first` on.
fn barrier(waits: Waits, first: u32, count: u32) -> Packets {
    let written = |client, first| lines(client, first, count, 1, LineKind::Write, None);
    let all = [written(Unit::Depth, first), written(Unit::Colour, first + count)];
    vec![packet(PacketKind::Barrier(waits), 0, &[], all.concat())]
}

/// Passes of a triangle in four tiles, each of which reads what the one before wrote.
fn single_triangles() -> Packets {
    let pass = |n: u32| {
        let before = (n > 0).then(|| barrier(Waits::Tiles, 64 * n, 16));
        let texels = |at: u32| lines(Unit::Texture, 64 * n + 16 + 4 * at, 4, 1, LineKind::Hit, None);
        let tiles = (0..4).map(|at| tile(0, 64, 20, if n > 0 { texels(at) } else { Vec::new() }));
        (before, std::iter::once(vertices(0, 1, 20)).chain(tiles).collect())
    };
    in_passes((0..64).map(pass))
}

/// Passes of many packets, each of which reads what the one before wrote; every other one has its vertices wait,
/// too.
fn chain() -> Packets {
    let pass = |n: u32| {
        let waits = if n.is_multiple_of(2) { Waits::All } else { Waits::Tiles };
        let before = (n > 0).then(|| barrier(waits, n << 16, 256));
        let texels = |at: u32| lines(Unit::Texture, (n << 16) + 4 * at, 4, 1, LineKind::Fetch, None);
        let fronts = (0..32).map(|at| vertices(32 * at, 32, 40));
        let tiles = (0..200).map(|at| tile(at, 16 + at % 48, 40, texels(at)));
        (before, fronts.chain(tiles).collect())
    };
    in_passes((0..16).map(pass))
}

/// Passes that depend on no other, in turn of many vertices and of many pixels.
fn side_by_side() -> Packets {
    let pass = |n: u32| {
        let (fronts, tiles) = if n.is_multiple_of(2) { (160, 20) } else { (8, 250) };
        let fronts = (0..fronts).map(|at| vertices(32 * at, 32, 60));
        let tiles = (0..tiles).map(|at| tile(at, 48, 60, Vec::new()));
        (None, fronts.chain(tiles).collect())
    };
    in_passes((0..16).map(pass))
}

fn shallow(units: &mut MachineSpec) {
    for unit in [
        &mut units.setup,
        &mut units.traversal,
        &mut units.z_cull,
        &mut units.sample_test,
        &mut units.shading_cache,
    ] {
        unit.queue = Entries::MIN;
    }
    for unit in [&mut units.command, &mut units.depth, &mut units.texture, &mut units.colour] {
        (unit.queue, unit.in_flight) = (Entries::MIN, Entries::MIN);
    }
    (units.shader.queue, units.shader.in_flight, units.l2.queue) = (Entries::MIN, Entries::MIN, Entries::MIN);
    units.dram.queue = Bounded::MIN;
}

/// Microbenchmark of one rate of a machine.
#[derive(Clone, Debug)]
pub struct Rate {
    /// Name of the rate.
    pub name: &'static str,
    /// A stream that uses only this rate.
    pub packets: Packets,
    /// Amount in the whole stream.
    pub amount: f64,
    /// Unit of the rate.
    pub unit: &'static str,
}

const TILES: u32 = 3000;

/// Microbenchmarks of fill, triangles, texels and bandwidth.
pub fn rates() -> Vec<Rate> {
    let of = |name, unit, each: f64, of: &dyn Fn(u32) -> (Packet, Vec<LineAccess>)| Rate {
        name,
        packets: (0..TILES).map(of).collect(),
        amount: each * f64::from(TILES),
        unit,
    };
    let fill = |lines| packet(PacketKind::Tile, 0, &[(Event::ColourWrites, 256)], lines);
    // Pixels of 8 bytes, read and written: 32 lines per packet, and as many written back.
    let blended = |n: u32| lines(Unit::Colour, n * 32, 32, 1, LineKind::Fetch, Some(1 << 22));
    vec![
        of("colour fill, nothing to memory", "pixel/s", 256.0, &|_| fill(Vec::new())),
        of("colour fill, 8 bytes blended", "pixel/s", 256.0, &|n| fill(blended(n))),
        of("triangles", "triangle/s", 32.0, &|_| {
            packet(PacketKind::Vertices, 0, &[(Event::TrianglesIn, 32)], Vec::new())
        }),
        of("texels", "texel/s", 1024.0, &|_| {
            let counts =
                [(Event::PixelInvocations, 256), (Event::ShaderOps, 256), (Event::TextureFetches, 1024)];
            packet(PacketKind::Tile, 0, &counts, Vec::new())
        }),
        of("bandwidth, reads side by side", "byte/s", 64.0 * 64.0, &|n| {
            let read = lines(Unit::Depth, n * 64, 64, 1, LineKind::Fetch, None);
            packet(PacketKind::Tile, 0, &[(Event::DepthReads, 1)], read)
        }),
    ]
}
