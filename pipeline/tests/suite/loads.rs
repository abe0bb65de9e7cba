//! Loads of buffers in pixel shaders: values, counts by hand, and what waits for what.

use activity::{Counts, Event, Packet, PacketKind, Waits};
use glam::{Vec3, Vec4};
use pipeline::sampling::Sample;
use pipeline::*;

use crate::common::stage::*;
use crate::common::*;

/// A corner of the image at depth 1 and two beyond it.
const SCREEN: [Vec3; 3] =
    [Vec3::new(-600.0, -600.0, 1.0), Vec3::new(2000.0, -600.0, 1.0), Vec3::new(-600.0, 2000.0, 1.0)];
const SIDE: u32 = 16;

/// The word of a buffer that is `step` times the number of the pixel, and `more` of the words after it.
struct Loads {
    buffer: Buffer<f32>,
    step: u32,
    more: u32,
}

impl Shader for Loads {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        let pixel = (at.pixel[1] as u32).wrapping_mul(SIDE).wrapping_add(at.pixel[0] as u32);
        let first = pixel.wrapping_mul(self.step);
        let words = (0..=self.more).map(|word| lane.load(self.buffer, first.wrapping_add(word)));
        Vec4::splat(words.last().unwrap_or_default())
    }
}

/// Writes twice the number of the lane to a buffer.
struct Doubles(Buffer<f32>);

impl GroupShader for Doubles {
    fn run(&self, group: &mut Group<'_>) {
        let first = group.id()[0] * group.size();
        group.lanes(|lane| lane.store(self.0, first + lane.index(), 2.0 * (first + lane.index()) as f32));
    }
}

fn hardware() -> PipelineSpec {
    let compute =
        ComputeSpec { warp_lanes: 32, group_lanes: 256, shared_bytes: 8192, banks: 32, atomic_units: 1 };
    PipelineSpec { compute: Some(compute), ..spec(Features::ALL) }
}

/// Fills `target` with what the shader loads.
fn fill(
    gpu: &mut Gpu<'_>,
    target: SurfaceId,
    shader: &Loads,
    bindings: &[Binding<'_>],
) -> Result<Counts, PassError> {
    let stage = Stage::sampled(SIDE, SIDE, 1);
    let settings = Settings {
        spec: gpu.spec(),
        viewport: stage.viewport,
        samples: &stage.table,
        background: Vec3::ZERO,
    };
    let geometry = Geometry::new(&SCREEN, &SCREEN, &[[0, 1, 2]]).unwrap();
    let state = DrawState { depth: DepthState::NONE, ..DrawState::default() };
    let draws = [Draw::new(geometry, shader, Cull::None).with_state(state).binding(bindings)];
    let targets = Attachments { colours: vec![Attachment::cleared(target, Vec4::ZERO)], depth: None };
    let pass = RasterPass::new(&stage.camera, &draws, &settings).named("fill");
    Ok(gpu.draw(&pass.onto(Target::Surfaces(&targets)))?.counts)
}

fn target(gpu: &mut Gpu<'_>) -> SurfaceId {
    gpu.create_surface(&SurfaceSpec::new("target", Viewport::new(SIDE, SIDE).unwrap(), Format::R32f))
}

/// Values and events of a pass that loads words of a buffer of `words`.
fn loaded(words: u32, step: u32, more: u32) -> (Vec<f32>, Counts) {
    let spec = hardware();
    let mut gpu = Gpu::without_packets(&spec).unwrap();
    let data: Vec<f32> = (0..words).map(|word| word as f32).collect();
    let (buffer, target) = (gpu.buffer("data", &data), target(&mut gpu));
    let counts =
        fill(&mut gpu, target, &Loads { buffer, step, more }, &[Binding::Buffer(buffer.reads())]).unwrap();
    (gpu.contents(target).unwrap().iter().map(|value| value.x).collect(), counts)
}

#[test]
fn every_lane_loads_and_a_quad_reads_each_line_once() {
    let pixels = SIDE * SIDE;
    let events = [
        Event::TextureFetches,
        Event::ShaderOps,
        Event::TextureLines,
        Event::TextureMisses,
        Event::DramReadBytes,
        Event::BufferLines,
    ];
    let found = |words, step, more| {
        let (values, counts) = loaded(words, step, more);
        let expected =
            |pixel: u32| if step * pixel + more < words { (step * pixel + more) as f32 } else { 0.0 };
        assert_eq!(values, (0..pixels).map(expected).collect::<Vec<_>>());
        let lanes = [Event::VertexInvocations, Event::HelperInvocations, Event::PixelInvocations];
        assert_eq!(lanes.map(|event| counts[event]), [3, 0, 256]);
        // Three vertices of 13 operations and 12 bytes, which are in one line, and the line of their indices.
        let of_vertices = [0, 3 * 13, 0, 0, 2 * 64, 0];
        std::array::from_fn::<u64, 6, _>(|at| counts[events[at]] - of_vertices[at])
    };
    // A row of the image is a line of 64 bytes: each of 64 quads reads two, and sixteen lines are missed once.
    assert_eq!(found(256, 1, 0), [256, 256, 2 * 64, 16, 16 * 64, 0]);
    // One word for all.
    assert_eq!(found(256, 0, 0), [256, 256, 64, 1, 64, 0]);
    // A line for every lane, each once.
    assert_eq!(found(16 * 256, 16, 0), [256, 256, 256, 256, 256 * 64, 0]);
    // Two loads of neighbours: two accesses of a quad, each of its two lines.
    // In the last quads of seven rows the second load goes on in a third line.
    assert_eq!(found(256, 1, 1), [512, 512, 4 * 64 + 7, 16, 16 * 64, 0]);
    // Beyond the buffer nothing is read: the first eight rows are inside.
    assert_eq!(found(128, 1, 0), [256, 256, 2 * 32, 8, 8 * 64, 0]);
}

/// Kinds of the packets of a dispatch, a draw and a dispatch, with their passes, and what the draw stored.
fn between_dispatches(is_bound: bool) -> (Vec<(PacketKind, u32)>, Vec<f32>) {
    let (spec, mut kinds) = (hardware(), Vec::new());
    let mut gpu = Gpu::new(&spec, |packet: &Packet, _| kinds.push((packet.kind, packet.pass))).unwrap();
    let (buffer, other) = (gpu.buffer("data", &[1.0_f32; 256]), gpu.buffer("other", &[3.0_f32; 256]));
    let target = target(&mut gpu);
    let write = |gpu: &mut Gpu<'_>| {
        let (shader, bindings) = (Doubles(buffer), [buffer.writes()]);
        let pass = ComputePass {
            name: "write",
            groups: [4, 1, 1],
            group_size: 64,
            shared_bytes: 0,
            bindings: &bindings,
            shader: &shader,
        };
        gpu.dispatch(&pass).unwrap();
    };
    write(&mut gpu);
    let read = if is_bound { buffer } else { other };
    let bindings = [Binding::Buffer(read.reads())];
    fill(&mut gpu, target, &Loads { buffer: read, step: 1, more: 0 }, &bindings).unwrap();
    write(&mut gpu);
    let values = gpu.contents(target).unwrap().iter().map(|value| value.x).collect();
    drop(gpu);
    (kinds, values)
}

#[test]
fn a_draw_waits_for_the_groups_that_wrote_what_it_loads_and_they_for_it() {
    let barriers = |kinds: Vec<(PacketKind, u32)>| {
        let waits = kinds.into_iter().filter(|(kind, _)| *kind == PacketKind::Barrier(Waits::Tiles));
        waits.map(|(_, pass)| pass).collect::<Vec<u32>>()
    };
    let (kinds, values) = between_dispatches(true);
    assert_eq!(values, (0..256).map(|lane| 2.0 * lane as f32).collect::<Vec<_>>());
    assert_eq!(barriers(kinds), [1, 2], "read after write, write after read");
    let (kinds, values) = between_dispatches(false);
    assert_eq!((values, barriers(kinds)), (vec![3.0; 256], vec![2]), "write after write alone");
}

#[test]
fn a_buffer_that_is_not_bound_reads_as_zero_and_one_of_another_frame_is_refused() {
    let spec = hardware();
    let mut gpu = Gpu::without_packets(&spec).unwrap();
    let (buffer, to) = (gpu.buffer("data", &[1.0_f32; 256]), target(&mut gpu));
    fill(&mut gpu, to, &Loads { buffer, step: 1, more: 0 }, &[]).unwrap();
    assert_eq!(gpu.contents(to).unwrap(), vec![Vec4::new(0.0, 0.0, 0.0, 1.0); 256]);
    let mut other = Gpu::without_packets(&spec).unwrap();
    let to = target(&mut other);
    let bindings = [Binding::Buffer(buffer.reads())];
    let error = fill(&mut other, to, &Loads { buffer, step: 1, more: 0 }, &bindings).unwrap_err();
    assert!(error.to_string().starts_with("pass `fill`: the frame has no such buffer number 0"), "{error}");
    let (shader, bindings) = (Doubles(buffer), [buffer.writes()]);
    let groups = ComputePass {
        name: "write",
        groups: [1; 3],
        group_size: 32,
        shared_bytes: 0,
        bindings: &bindings,
        shader: &shader,
    };
    let error = other.dispatch(&groups).unwrap_err();
    assert!(error.to_string().starts_with("pass `write`: the frame has no such buffer"), "{error}");
}

/// Loads the word of its pixel, and then adds as often as the column says.
struct Uneven(Buffer<f32>);

impl Shader for Uneven {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        let [x, y] = at.pixel.map(|part| part as u32);
        let mut sum = lane.load(self.0, y * SIDE + x);
        for _ in 0..x {
            sum = lane.add(sum, 1.0);
        }
        lane.branch(sum > 0.0);
        Vec4::splat(sum)
    }
}

/// A triangle with legs of 7.5 pixels in the first tile covers the 28 pixels with `x + y < 7` at their
/// centres: ten quads, whose other twelve lanes are helpers. All forty load; lane `x` takes `x + 2`
/// operations, and a warp of eight quads as long as its longest.
#[test]
fn helper_lanes_load_and_a_warp_waits_for_its_longest_lane() {
    let corners = [[0.0, 0.0], [7.5, 0.0], [0.0, 7.5]];
    let corners = corners.map(|[x, y]: [f32; 2]| Vec3::new(x - 8.0, 8.0 - y, 1.0));
    let geometry = Geometry::new(&corners, &corners, &[[0, 1, 2]]).unwrap();
    let viewport = Viewport::new(SIDE, SIDE).unwrap();
    let middle = Sample { x: 0.5, y: 0.5, t: 0.5, ..Sample::default() };
    let samples = vec![middle; (SampleTable::SIDE_PX * SampleTable::SIDE_PX) as usize];
    let table = SampleTable::programmed(1, 0, samples).unwrap();
    // Rows of quads of four, three, two and one: the first warp has the first two rows and a quad of the third.
    let by_quad = [[2, 4, 6, 8].as_slice(), &[2, 4, 6], &[2, 4], &[2]].concat();
    for (warp_lanes, of_lanes) in
        [(4, by_quad.iter().map(|last| 4 * (last + 1)).sum::<u64>()), (32, 32 * (8 + 1) + 8 * (4 + 1))]
    {
        let spec = PipelineSpec { warp_lanes, ..spec(Features::ALL) };
        let mut gpu = Gpu::without_packets(&spec).unwrap();
        let buffer = gpu.buffer("data", &[1.0_f32; 256]);
        let bindings = [Binding::Buffer(buffer.reads())];
        let shader = Uneven(buffer);
        let draws = [Draw::new(geometry, &shader, Cull::None).binding(&bindings)];
        let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
        let camera = pixel_camera(viewport, 0.25);
        let counts = gpu.draw(&RasterPass::new(&camera, &draws, &settings)).unwrap().counts;
        let lanes = [Event::QuadsShaded, Event::PixelInvocations, Event::HelperInvocations];
        assert_eq!(lanes.map(|event| counts[event]), [10, 40, 12]);
        assert_eq!(counts[Event::TextureFetches], 40, "helpers load, too");
        // A row of the image is a line; each quad has lanes in two rows.
        assert_eq!((counts[Event::TextureLines], counts[Event::TextureMisses]), (20, 8));
        assert_eq!(counts[Event::ShaderOps], 3 * 13 + of_lanes, "warps of {warp_lanes}");
    }
}
