//! Groups of lanes: results against plain loops, counts by hand, what waits for what, and what is refused.

use crate::common::*;
use activity::{Counts, Event, LineAccess, Packet, PacketKind, Unit, Waits};
use glam::{Vec3, Vec4};
use pipeline::*;

const SPEC: ComputeSpec =
    ComputeSpec { warp_lanes: 32, group_lanes: 256, shared_bytes: 8192, banks: 32, atomic_units: 1 };

fn hardware() -> PipelineSpec {
    PipelineSpec { compute: Some(SPEC), ..spec(Features::ALL) }
}

/// A program as a function.
struct Program<F>(F);

impl<F: Fn(&mut Group<'_>) + Sync> GroupShader for Program<F> {
    fn run(&self, group: &mut Group<'_>) {
        (self.0)(group);
    }
}

fn pass<'a>(
    groups: u32,
    size: u32,
    bindings: &'a [BufferBinding],
    shader: &'a dyn GroupShader,
) -> ComputePass<'a> {
    ComputePass {
        name: "groups",
        groups: [groups, 1, 1],
        group_size: size,
        shared_bytes: 0,
        bindings,
        shader,
    }
}

/// Events of one pass over a buffer of `data`, and the buffer afterwards.
fn run(
    data: &[u32],
    (groups, size, shared_bytes): (u32, u32, u32),
    program: impl Fn(&mut Group<'_>, Buffer<u32>) + Sync,
) -> Result<(Counts, Vec<u32>), PassError> {
    let spec = hardware();
    let mut gpu = Gpu::without_packets(&spec)?;
    let buffer = gpu.buffer("data", data);
    let shader = Program(|group: &mut Group<'_>| program(group, buffer));
    let bindings = [buffer.writes()];
    let counts = gpu.dispatch(&ComputePass { shared_bytes, ..pass(groups, size, &bindings, &shader) })?;
    Ok((counts, gpu.values(buffer)))
}

/// Place of a lane in its dispatch.
fn place(group: [u32; 3], size: u32, lane: &GroupLane<'_, '_>) -> u32 {
    group[0] * size + lane.index()
}

/// Sum of the words of each group by a tree in shared memory.
fn sum_groups(group: &mut Group<'_>, data: Buffer<u32>) {
    let (id, size) = (group.id(), group.size());
    group.lanes(|lane| lane.set_shared(lane.index(), lane.load(data, place(id, size, lane))));
    let mut half = size / 2;
    while half > 0 {
        group.barrier();
        group.lanes(|lane| {
            if lane.branch(lane.index() < half) {
                let [a, b]: [u32; 2] = [lane.index(), lane.index() + half].map(|at| lane.shared(at));
                lane.set_shared(lane.index(), lane.add(a, b));
            }
        });
        half /= 2;
    }
    group.lanes(|lane| {
        if lane.branch(lane.index() == 0) {
            lane.store(data, id[0], lane.shared(0));
        }
    });
}

#[test]
fn a_tree_in_shared_memory_adds_up() {
    let data: Vec<u32> = (0..4 * 256).map(|n| n * n % 1009).collect();
    let (counts, sums) = run(&data, (4, 256, 4 * 256), sum_groups).unwrap();
    let expected: Vec<u32> = data.chunks(256).map(|part| part.iter().sum()).collect();
    assert_eq!(sums[..4], expected);
    assert_eq!(sums[4..], data[4..], "nothing else is written");
    // By hand, for a group of eight warps of 32 lanes, of which 128, 64, ..., 1 add: a load and a store; a
    // compare, two loads, a sum and a store; and at the end a compare, a load and a store.
    let adding = [4, 2, 1, 1, 1, 1, 1, 1];
    let steps = 2 + 8 * (1 + 5) + 3;
    let operations: u32 = 8 * 2 + adding.iter().map(|warps| 8 + 5 * warps + (8 - warps)).sum::<u32>() + 3 + 7;
    let by_hand = [
        (Event::Groups, 4),
        (Event::GroupLanes, 4 * 256),
        (Event::GroupHelperLanes, 0),
        (Event::GroupSteps, 4 * steps),
        (Event::ShaderOps, 4 * 32 * operations),
        (Event::GroupBarriers, 4 * 8 * 8),
        (Event::SharedBytes, 4 * 1024),
        (Event::SharedAccesses, 4 * (256 + 3 * 255 + 1)),
        // A cycle for each access of a warp: nobody meets in a bank.
        (Event::SharedCycles, 4 * (8 + 3 * adding.iter().sum::<u32>() + 1)),
        (Event::BankConflicts, 0),
        // 256 words are sixteen lines, two for each warp; and the line of the result.
        (Event::BufferLines, 4 * (16 + 1)),
        (Event::L2Reads, 4 * 16),
        (Event::L2Writes, 4),
        (Event::DramReadBytes, 4 * 16 * 64),
        (Event::Draws, 1),
    ];
    for (event, count) in by_hand {
        assert_eq!(counts[event], u64::from(count), "{event:?}");
    }
}

#[test]
fn a_warp_takes_as_long_as_its_longest_lane() {
    let ops = |of_lane: fn(u32) -> u32, size: u32| {
        let program = |group: &mut Group<'_>, _: Buffer<u32>| {
            group.lanes(|lane| (0..of_lane(lane.index())).for_each(|_| assert!(lane.add(1.0, 2.0) > 0.0)));
        };
        let (counts, _) = run(&[0], (1, size, 0), program).unwrap();
        [Event::ShaderOps, Event::GroupSteps, Event::GroupLanes, Event::GroupHelperLanes]
            .map(|event| counts[event])
    };
    assert_eq!(ops(|_| 7, 64), [64 * 7, 7, 64, 0]);
    // One lane of the second warp is long.
    assert_eq!(ops(|lane| if lane == 40 { 100 } else { 7 }, 64), [32 * 7 + 32 * 100, 100, 64, 0]);
    // Lanes that fill a warp count.
    assert_eq!(ops(|_| 7, 33), [64 * 7, 7, 64, 31]);
    assert_eq!(ops(|_| 7, 1), [32 * 7, 7, 32, 31]);
}

#[test]
fn atomics_add_up_and_their_contention_is_counted() {
    let count = |bins: u32| {
        let program = move |group: &mut Group<'_>, data: Buffer<u32>| {
            let (id, size) = (group.id(), group.size());
            group.lanes(|lane| lane.atomic(data, place(id, size, lane) % bins, Atomic::Add, 1));
        };
        let (counts, found) = run(&[0; 64], (8, 64, 0), program).unwrap();
        let expected: Vec<u32> = (0..64).map(|bin| if bin < bins { 512 / bins } else { 0 }).collect();
        assert_eq!(found, expected);
        [Event::Atomics, Event::AtomicConflicts, Event::AtomicSteps, Event::BufferLines]
            .map(|event| counts[event])
    };
    // Sixteen warps: each lane a word of two lines, each word in two lanes, all lanes on one word.
    assert_eq!(count(32), [512, 0, 16 * 2, 16 * 2]);
    assert_eq!(count(16), [512, 16 * 16, 16 * 2, 16]);
    assert_eq!(count(1), [512, 16 * 31, 16 * 32, 16]);
}

/// The rule of order: a group sees what was there before the pass, and what groups write takes effect in their order.
#[test]
fn groups_do_not_see_each_other() {
    let shift = |group: &mut Group<'_>, data: Buffer<u32>| {
        let id = group.id()[0];
        group.lanes(|lane| lane.store(data, id + 1, lane.load(data, id)));
    };
    let data: Vec<u32> = (0..9).collect();
    assert_eq!(run(&data, (8, 1, 0), shift).unwrap().1, [0, 0, 1, 2, 3, 4, 5, 6, 7]);
}

/// Results, packets and lines with some threads.
fn with_threads(threads: usize) -> (Vec<u32>, Vec<(Packet, Vec<LineAccess>)>) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let (spec, mut packets) = (hardware(), Vec::new());
        let mut gpu = Gpu::new(&spec, |packet, lines| packets.push((*packet, lines.to_vec()))).unwrap();
        let data: Vec<u32> = (0..40_000).map(|n| random::mix(n) as u32).collect();
        let (input, out) = (gpu.buffer("input", &data), gpu.buffer("out", &[0_u32; 600]));
        let program = |group: &mut Group<'_>| {
            let (id, size) = (group.id(), group.size());
            group.lanes(|lane| {
                let value = lane.load(input, place(id, size, lane));
                lane.atomic(out, value % 500, Atomic::Add, 1);
                lane.atomic(out, 500 + value % 3, Atomic::Max, value);
                // All groups store to one word: the last group wins.
                lane.store(out, 510, value);
            });
        };
        gpu.dispatch(&pass(1250, 32, &[input.reads(), out.writes()], &Program(program))).unwrap();
        let values = gpu.values(out);
        gpu.finish();
        (values, packets)
    })
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let one = with_threads(1);
    assert_eq!(one.0[510], random::mix(39_999) as u32);
    for threads in [2, 3, 8] {
        assert!(with_threads(threads) == one, "{threads} threads");
    }
}

/// Kinds of the packets of dispatches that use some of three buffers.
fn kinds(uses: &[&[(usize, bool)]]) -> Vec<PacketKind> {
    let (spec, mut kinds) = (hardware(), Vec::new());
    let mut gpu = Gpu::new(&spec, |packet, _| kinds.push(packet.kind)).unwrap();
    let buffers = [(); 3].map(|()| gpu.buffer("buffer", &[0_u32; 64]));
    let idle = Program(|_: &mut Group<'_>| ());
    for of_pass in uses {
        let binding = |&(at, writes): &(usize, bool)| {
            if writes { buffers[at].writes() } else { buffers[at].reads() }
        };
        let bindings: Vec<BufferBinding> = of_pass.iter().map(binding).collect();
        gpu.dispatch(&pass(1, 32, &bindings, &idle)).unwrap();
    }
    drop(gpu);
    kinds
}

#[test]
fn dependent_dispatches_have_a_barrier_and_others_none() {
    let (read, write) = (false, true);
    let start = [PacketKind::Draw, PacketKind::Compute];
    let apart = [&start[..], &[PacketKind::Barrier(Waits::Tiles)], &start].concat();
    // The second dispatch begins beside the groups of the first.
    let beside = [start[0], start[0], start[1], start[1]];
    assert_eq!(kinds(&[&[(0, read), (1, write)], &[(0, read), (2, write)]]), beside);
    assert_eq!(kinds(&[&[(0, write)], &[(0, read)]]), apart, "read after write");
    assert_eq!(kinds(&[&[(0, read)], &[(0, write)]]), apart, "write after read");
    assert_eq!(kinds(&[&[(0, write)], &[(0, write)]]), apart, "write after write");
}

#[test]
fn groups_read_the_depths_that_a_pass_drew() {
    let spec = hardware();
    let table = SampleTable::low_discrepancy(1, 3, LensShape::Disk).unwrap();
    let viewport = Viewport::new(64, 32).unwrap();
    let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
    let mut packets = Vec::new();
    let mut gpu = Gpu::new(&spec, |packet, _| packets.push(*packet)).unwrap();
    let corners = rectangle([-40.0, 0.0], [-20.0, 20.0], 2.0);
    let geometry = Geometry::new(&corners, &corners, &QUAD).unwrap();
    let draws = [Draw::new(geometry, &Plain, Cull::None)];
    let camera = pixel_camera(viewport, 0.5);
    let surface = gpu.create_surface(&SurfaceSpec::new("depth", viewport, Format::D32));
    let to = Attachments { colours: vec![], depth: Some(Attachment::cleared(surface, Clear::default())) };
    gpu.draw(&RasterPass::new(&camera, &draws, &settings).onto(Target::Surfaces(&to))).unwrap();
    let depth = gpu.surface_view(surface).unwrap();
    let covered = gpu.buffer("covered", &[0_u32]);
    let program = Program(|group: &mut Group<'_>| {
        let (id, size) = (group.id(), group.size());
        group.lanes(|lane| {
            let at = place(id, size, lane);
            let is_covered = lane.texel(&depth, [at % 64, at / 64], 0).x < 3.0;
            if lane.branch(is_covered) {
                lane.atomic(covered, 0, Atomic::Add, 1);
            }
        });
    });
    let counts = gpu.dispatch(&pass(64 * 32 / 64, 64, &[depth.reads(), covered.writes()], &program)).unwrap();
    assert_eq!(gpu.values(covered), [32 * 32]);
    assert_eq!(counts[Event::DramReadBytes], 64, "stored depths are in the L2, the counter is not");
    let report = gpu.finish();
    assert!(
        packets.iter().any(|packet| packet.kind == PacketKind::Barrier(Waits::Tiles) && packet.pass == 1)
    );
    let all = packets.iter().fold(Counts::default(), |mut sum, packet| {
        sum += &packet.counts;
        sum
    });
    assert_eq!(all, report.counts());
    assert_eq!(report.passes[1].draws.len(), 1);
}

#[test]
fn a_pass_waits_for_the_groups_that_read_what_it_overwrites() {
    let spec = hardware();
    let table = SampleTable::low_discrepancy(1, 3, LensShape::Disk).unwrap();
    let viewport = Viewport::new(64, 32).unwrap();
    let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
    let corners = rectangle([-40.0, 0.0], [-20.0, 20.0], 2.0);
    let geometry = Geometry::new(&corners, &corners, &QUAD).unwrap();
    let draws = [Draw::new(geometry, &Plain, Cull::None)
        .with_state(DrawState { depth: DepthState::NONE, ..DrawState::new(Cull::None) })];
    let camera = pixel_camera(viewport, 0.5);
    let idle = Program(|_: &mut Group<'_>| {});
    let barriers = |is_read: bool| {
        let mut packets = Vec::new();
        let mut gpu = Gpu::new(&spec, |packet, _| packets.push(*packet)).unwrap();
        let target = gpu.create_surface(&SurfaceSpec::new("target", viewport, Format::R32f));
        let colours = vec![Attachment::cleared(target, Vec4::ZERO)];
        let targets = Attachments { colours, depth: None };
        let pass_onto = RasterPass::new(&camera, &draws, &settings).onto(Target::Surfaces(&targets));
        gpu.draw(&pass_onto).unwrap();
        gpu.wait();
        let values = gpu.surface_view(target).unwrap();
        let other = gpu.buffer("other", &[0_u32]);
        let bindings = if is_read { vec![values.reads()] } else { vec![other.reads()] };
        gpu.dispatch(&pass(1, 32, &bindings, &idle)).unwrap();
        gpu.draw(&pass_onto).unwrap();
        drop(gpu);
        let is_barrier = |packet: &&Packet| packet.kind == PacketKind::Barrier(Waits::Tiles);
        packets.iter().filter(is_barrier).map(|packet| packet.pass).collect::<Vec<u32>>()
    };
    assert_eq!((barriers(true), barriers(false)), (vec![2], vec![]));
}

#[test]
fn lines_of_groups_are_those_of_the_l2() {
    let spec = hardware();
    let (mut touched, mut clients) = (0, Vec::new());
    let mut gpu = Gpu::new(&spec, |packet, lines| {
        touched += packet.counts[Event::BufferLines];
        clients
            .extend(lines.iter().filter(|_| packet.kind == PacketKind::Compute).map(|access| access.client));
    })
    .unwrap();
    let (input, out) = (gpu.buffer("in", &[1.5_f32; 1024]), gpu.buffer("out", &[0.0_f32; 1024]));
    let program = Program(|group: &mut Group<'_>| {
        let (id, size) = (group.id(), group.size());
        group.lanes(|lane| {
            let at = place(id, size, lane);
            lane.store(out, at, lane.mul(2.0, lane.load(input, at)));
        });
    });
    let counts = gpu.dispatch(&pass(16, 64, &[input.reads(), out.writes()], &program)).unwrap();
    assert_eq!(gpu.values(out), [3.0; 1024]);
    let report = gpu.finish();
    assert_eq!((touched, clients), (2 * 64, vec![Unit::Compute; 2 * 64]));
    assert_eq!(counts[Event::DramReadBytes], 4096, "what is written is not fetched");
    assert_eq!(report.write_back[Event::DramWriteBytes], 4096);
}

fn refused(error: PassError, says: &str) {
    let text = error.to_string();
    assert!(text.starts_with("pass `groups`: ") && text.contains(says), "{text}");
}

#[test]
fn what_the_hardware_lacks_is_refused() {
    let idle = Program(|_: &mut Group<'_>| ());
    let without = spec(Features::ALL);
    refused(
        Gpu::without_packets(&without).unwrap().dispatch(&pass(1, 32, &[], &idle)).unwrap_err(),
        "no compute unit",
    );
    let nothing = |_: &mut Group<'_>, _: Buffer<u32>| ();
    refused(
        run(&[0], (1, 257, 0), nothing).unwrap_err(),
        "a group of 257 lanes; the GPU runs groups of 1 to 256",
    );
    refused(run(&[0], (1, 0, 0), nothing).unwrap_err(), "a group of 0 lanes");
    refused(run(&[0], (0, 32, 0), nothing).unwrap_err(), "[0, 1, 1] groups");
    refused(run(&[0], (1 << 25, 32, 0), nothing).unwrap_err(), "1 to 16777216");
    refused(
        run(&[0], (1, 32, 8196), nothing).unwrap_err(),
        "8196 bytes of shared memory; the GPU gives a group up to 8192",
    );
    let invalid = PipelineSpec { compute: Some(ComputeSpec { banks: 0, ..SPEC }), ..hardware() };
    assert_eq!(invalid.validate().unwrap_err().to_string(), "`compute.banks` is 0; it has to be 1 to 128");
}

#[test]
fn faults_of_programs_name_group_lane_and_buffer() {
    let fault = |program: fn(&GroupLane<'_, '_>, Buffer<u32>)| {
        let program = |group: &mut Group<'_>, data| group.lanes(|lane| program(lane, data));
        run(&[0; 10], (1, 32, 16), program).unwrap_err()
    };
    let says = "group [0, 0, 0], lane 10: index 10 of buffer `data`, which has 10 words";
    refused(fault(|lane, data| assert_eq!(lane.load(data, lane.index()), 0)), says);
    refused(
        fault(|lane, _| lane.set_shared(lane.index(), 1.0)),
        "lane 4: word 4 of the shared memory, which has 4",
    );
    let race = "lane 1: word 0 of the shared memory is used by another lane";
    refused(fault(|lane, _| lane.set_shared(0, lane.index())), race);
    let written = "lane 1: index 0 of buffer `data` is loaded after the group wrote it";
    refused(
        fault(|lane, data| {
            lane.load(data, 0);
            lane.store(data, 0, lane.index());
        }),
        written,
    );
    let spec = hardware();
    let mut gpu = Gpu::without_packets(&spec).unwrap();
    let buffer = gpu.buffer("input", &[0_u32; 32]);
    let stores = Program(|group: &mut Group<'_>| group.lanes(|lane| lane.store(buffer, lane.index(), 1)));
    for bindings in [&[buffer.reads()][..], &[]] {
        refused(
            gpu.dispatch(&pass(1, 32, bindings, &stores)).unwrap_err(),
            "buffer `input` is not bound for this",
        );
    }
}

/// Groups see the words of a surface in their places, and a pass that draws on it again waits for them.
#[test]
fn groups_read_a_surface_as_a_pass_stored_it() {
    let spec = hardware();
    let table = SampleTable::low_discrepancy(2, 3, LensShape::Disk).unwrap();
    let viewport = Viewport::new(30, 20).unwrap();
    let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
    let mut kinds = Vec::new();
    let mut gpu = Gpu::new(&spec, |packet, _| kinds.push((packet.kind, packet.pass))).unwrap();
    let surfaces = [Format::Rgba16f, Format::D32]
        .map(|format| gpu.create_surface(&SurfaceSpec::new("surface", viewport, format).sampled(2)));
    let corners = rectangle([-9.0, -5.0], [11.0, 6.0], 2.0);
    let geometry = Geometry::new(&corners, &corners, &QUAD).unwrap();
    let draws = [Draw::new(geometry, &Plain, Cull::None)];
    let camera = pixel_camera(viewport, 0.5);
    let colours = vec![Attachment::cleared(surfaces[0], Vec4::new(0.1, 0.2, 0.3, 1.0))];
    let to = Attachments { colours, depth: Some(Attachment::cleared(surfaces[1], Clear::default())) };
    let raster = RasterPass::new(&camera, &draws, &settings).onto(Target::Surfaces(&to));
    assert!(gpu.surface_view(surfaces[0]).is_none(), "nothing is stored yet");
    gpu.draw(&raster).unwrap();
    for surface in surfaces {
        let (view, stored) = (gpu.surface_view(surface).unwrap(), gpu.contents(surface).unwrap());
        assert_eq!((view.size(), view.samples()), ([30, 20], 2));
        let out = gpu.buffer("out", &[0.0_f32; 4 * 30 * 20 * 2]);
        let copy = Program(|group: &mut Group<'_>| {
            let (id, size) = (group.id(), group.size());
            group.lanes(|lane| {
                let at = place(id, size, lane);
                let texel = lane.texel(&view, [at / 2 % 30, at / 2 / 30], at % 2);
                (0..4).for_each(|part| lane.store(out, 4 * at + part, texel[part as usize]));
            });
        });
        gpu.dispatch(&pass(30 * 20 * 2 / 60, 60, &[view.reads(), out.writes()], &copy)).unwrap();
        let read: Vec<f32> = stored.iter().flat_map(|value| value.to_array()).collect();
        assert_eq!(gpu.values(out), read);
        assert!(read.iter().any(|value| *value != read[0]));
    }
    let before = gpu.surface_view(surfaces[0]).unwrap();
    gpu.draw(&raster).unwrap();
    let view = gpu.surface_view(surfaces[0]).unwrap();
    let outside = Program(|group: &mut Group<'_>| {
        group.lanes(|lane| {
            lane.texel(&view, [30, 0], 0);
        });
    });
    assert!(gpu.dispatch(&pass(1, 1, &[view.reads()], &outside)).is_err());
    let outdated = gpu.dispatch(&pass(1, 1, &[before.reads()], &outside)).unwrap_err();
    assert!(
        matches!(&outdated, PassError::OutdatedView { surface, .. } if surface == "surface"),
        "{outdated}"
    );
    drop(gpu);
    let waits = kinds.iter().filter(|(kind, _)| *kind == PacketKind::Barrier(Waits::Tiles));
    let waits: Vec<u32> = waits.map(|(_, pass)| *pass).collect();
    // The first copy waits for the pass, the second pass for both copies, and the last dispatch for that.
    assert_eq!(waits, [1, 3, 4]);
}
