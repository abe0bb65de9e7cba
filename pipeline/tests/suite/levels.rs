//! Mip chains made by passes: levels and fetches from them are those of plain loops, bit for bit.

use activity::{Event, PacketKind, Waits};
use glam::{Vec2, Vec3, Vec4};
use pipeline::*;

use crate::common::stage::*;
use crate::common::*;

/// A level as plain numbers.
#[derive(Clone, Debug)]
pub(crate) struct PlainLevel {
    pub size: [usize; 2],
    pub values: Vec<Vec4>,
}

impl PlainLevel {
    /// A level of a surface whose finest has the size of `viewport`, if anything is stored in it.
    pub fn of(gpu: &Gpu<'_>, id: SurfaceId, viewport: Viewport, level: u32) -> Option<Self> {
        let size = [viewport.width(), viewport.height()].map(|side| (side >> level).max(1) as usize);
        Some(Self { size, values: gpu.contents(id.level(level))? })
    }

    pub fn bits(&self) -> Vec<[u32; 4]> {
        self.values.iter().map(|value| value.to_array().map(f32::to_bits)).collect()
    }

    fn at(&self, x: f32, y: f32) -> Vec4 {
        let inside = |part: f32, side: usize| part.clamp(0.0, (side - 1) as f32) as usize;
        self.values[inside(y, self.size[1]) * self.size[0] + inside(x, self.size[0])]
    }

    fn bilinear(&self, uv: Vec2) -> Vec4 {
        let x = uv.x * self.size[0] as f32 - 0.5;
        let y = uv.y * self.size[1] as f32 - 0.5;
        let (left, top) = (x.floor(), y.floor());
        let row = |y| mix(self.at(left, y), self.at(left + 1.0, y), x - left);
        mix(row(top), row(top + 1.0), y - top)
    }
}

fn mix(a: Vec4, b: Vec4, share: f32) -> Vec4 {
    a * (1.0 - share) + b * share
}

/// A finest level with all levels below it, each texel between the four above, stored by `round`.
pub(crate) fn chain(finest: PlainLevel, round: impl Fn(Vec4) -> Vec4) -> Vec<PlainLevel> {
    let mut levels = vec![finest];
    while levels.last().unwrap().size != [1, 1] {
        let above = levels.last().unwrap();
        let size = above.size.map(|side| (side / 2).max(1));
        let texel = above.size.map(|side| 1.0 / side as f32);
        let mut values = Vec::new();
        for y in 0..size[1] {
            for x in 0..size[0] {
                let uv = [(x, 0), (y, 1)].map(|(at, axis)| at as f32 * (2.0 * texel[axis]) + texel[axis]);
                values.push(round(above.bilinear(Vec2::from(uv))));
            }
        }
        levels.push(PlainLevel { size, values });
    }
    levels
}

/// Trilinear value of the levels.
pub(crate) fn mixed_levels(levels: &[PlainLevel], uv: Vec2, lod: f32) -> Vec4 {
    let lod = lod.clamp(0.0, (levels.len() - 1) as f32);
    let (fine, share) = (levels[lod as usize].bilinear(uv), lod.fract());
    if share == 0.0 { fine } else { mix(fine, levels[lod as usize + 1].bilinear(uv), share) }
}

/// A colour by pixel.
struct Painted<F>(F);

impl<F: Fn([i32; 2]) -> f32 + Sync> Shader for Painted<F> {
    fn shade(&self, _: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        Vec4::splat((self.0)(at.pixel))
    }
}

const FLAT: DepthState = DepthState::NONE;

/// A corner of the image at depth 1 and two beyond it.
const SCREEN: [Vec3; 3] =
    [Vec3::new(-600.0, -600.0, 1.0), Vec3::new(2000.0, -600.0, 1.0), Vec3::new(-600.0, 2000.0, 1.0)];

/// Calls `then` with a surface with levels of `size`, painted by `paint`, and its levels.
fn painted<T>(
    size: [u32; 2],
    format: Format,
    paint: impl Fn([i32; 2]) -> f32 + Sync,
    then: impl FnOnce(&mut Gpu<'_>, SurfaceId, &Stage, &Settings<'_>) -> T,
) -> T {
    let (stage, spec) = (Stage::sampled(size[0], size[1], 1), spec(Features::ALL));
    let settings =
        Settings { spec: &spec, viewport: stage.viewport, samples: &stage.table, background: Vec3::ZERO };
    let mut gpu = Gpu::without_packets(&spec).unwrap();
    let id = gpu.create_surface(&SurfaceSpec::new("bloom", stage.viewport, format).mipmapped());
    let shader = Painted(paint);
    let geometry = Geometry::new(&SCREEN, &SCREEN, &[[0, 1, 2]]).unwrap();
    let state = DrawState { depth: FLAT, ..DrawState::default() };
    let draws = [Draw::new(geometry, &shader, Cull::None).with_state(state)];
    let targets = Attachments { colours: vec![Attachment::cleared(id, Vec4::ZERO)], depth: None };
    let pass = RasterPass::new(&stage.camera, &draws, &settings);
    gpu.draw(&pass.onto(Target::Surfaces(&targets))).unwrap();
    then(&mut gpu, id, &stage, &settings)
}

/// All levels of a painted surface.
fn levels_of(size: [u32; 2], format: Format, paint: impl Fn([i32; 2]) -> f32 + Sync) -> Vec<PlainLevel> {
    painted(size, format, paint, |gpu, id, stage, _| {
        gpu.make_levels("chain", id).unwrap();
        (0..).map_while(|level| PlainLevel::of(gpu, id, stage.viewport, level)).collect()
    })
}

fn noise([x, y]: [i32; 2]) -> f32 {
    random::unit_single(random::mix(random::mix(x as u64) ^ y as u64))
}

#[test]
fn the_mean_of_a_constant_is_the_constant() {
    for size in [[40, 24], [64, 64], [7, 5], [1, 9]] {
        for level in levels_of(size, Format::R32f, |_| 0.3) {
            assert!(level.values.iter().all(|value| (value.x - 0.3).abs() < 1e-7), "{size:?}");
        }
    }
}

#[test]
fn the_mean_of_a_checkerboard_is_grey() {
    let levels = levels_of([64, 32], Format::Rgba8, |[x, y]| ((x + y) % 2) as f32);
    assert_eq!(levels.len(), 7);
    assert_eq!(
        levels.iter().map(|level| level.values.len()).sum::<usize>(),
        2048 + 512 + 128 + 32 + 8 + 2 + 1
    );
    // 127.5 of 255 rounds to the code above.
    let grey = 128.0 / 255.0;
    for level in &levels[1..] {
        assert!(level.values.iter().all(|value| *value == Vec4::splat(grey)));
    }
}

#[test]
fn random_values_are_those_of_plain_loops_bit_for_bit() {
    for size in [[64, 64], [40, 26], [33, 7], [5, 64], [1, 1]] {
        let levels = levels_of(size, Format::R32f, noise);
        let wanted = chain(levels[0].clone(), |value| Vec4::new(value.x, 0.0, 0.0, 1.0));
        assert_eq!(levels.len(), wanted.len());
        for (ours, theirs) in levels.iter().zip(&wanted) {
            assert_eq!((ours.size, ours.bits()), (theirs.size, theirs.bits()), "{size:?}");
        }
        // Where all sizes are even, no texel is left out.
        if size == [64, 64] {
            let mean = levels[0].values.iter().map(|value| f64::from(value.x)).sum::<f64>() / 4096.0;
            assert!((f64::from(levels[6].values[0].x) - mean).abs() < 1e-6);
        }
    }
}

/// An odd column is left out: a mean of the last level may be far off.
#[test]
fn odd_sizes_leave_texels_out() {
    let last =
        |width| levels_of([width, 8], Format::R32f, move |[x, _]| (x as u32 == width - 1) as u32 as f32);
    assert_eq!(last(8).last().unwrap().values[0].x, 1.0 / 8.0);
    assert_eq!(last(9).last().unwrap().values[0].x, 0.0, "a ninth is lost");
}

/// Passes, waits, lanes, fetches and lines of a chain, by hand.
#[test]
fn every_level_is_a_pass_that_waits_for_the_one_before() {
    let (stage, spec) = (Stage::sampled(16, 16, 1), spec(Features::ALL));
    let mut packets = Vec::new();
    let mut gpu = Gpu::new(&spec, |packet, _| packets.push(*packet)).unwrap();
    let id = gpu.create_surface(&SurfaceSpec::new("s", stage.viewport, Format::R32f).mipmapped());
    let settings =
        Settings { spec: &spec, viewport: stage.viewport, samples: &stage.table, background: Vec3::ZERO };
    let targets = Attachments { colours: vec![Attachment::cleared(id, Vec4::ONE)], depth: None };
    gpu.draw(&RasterPass::new(&stage.camera, &[], &settings).onto(Target::Surfaces(&targets))).unwrap();
    let counts = gpu.make_levels("chain", id).unwrap();
    let report = gpu.finish();
    let names: Vec<&str> = report.passes.iter().map(|pass| pass.name.as_str()).collect();
    assert_eq!(names[1..], ["chain level 1", "chain level 2", "chain level 3", "chain level 4"]);
    let barriers = packets.iter().filter(|packet| packet.kind == PacketKind::Barrier(Waits::Tiles));
    assert_eq!(barriers.count(), 4);
    // 64 + 16 + 4 texels, and one with three helper lanes.
    assert_eq!(counts[Event::PixelInvocations], 64 + 16 + 4 + 4);
    assert_eq!(counts[Event::HelperInvocations], 3);
    assert_eq!(counts[Event::TextureFetches], 64 + 16 + 4 + 4);
    assert_eq!(counts[Event::ColourWrites], 64 + 16 + 4 + 1);
    assert_eq!(
        counts[Event::ShaderOps],
        2 * 88 + 4 * 3 * 13,
        "the position of a fetch, and the vertices of four triangles"
    );
    // Level 1 reads the 16 lines of the finest, the others 4, 4 (a whole tile), 4 and 4.
    assert_eq!(report.passes[1].counts()[Event::TextureMisses], 16);
    // Images in whole tiles of 8 x 8 texels: one of 16 x 16, and four.
    assert!(report.counts()[Event::DramWriteBytes] >= 85 * 4);
}

/// Reads two levels by a fetch in the middle of the surface.
struct Fetches(f32);

impl Shader for Fetches {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        lane.fetch(0, Vec2::new(at.pixel[0] as f32 + 0.4, at.pixel[1] as f32 + 0.7) / 16.0, self.0)
    }
}

#[test]
fn fetches_between_levels_are_trilinear_and_count_twice() {
    painted([16, 16], Format::R32f, noise, |gpu, id, stage, settings| {
        gpu.make_levels("chain", id).unwrap();
        let levels: Vec<PlainLevel> =
            (0..5).map_while(|level| PlainLevel::of(gpu, id, stage.viewport, level)).collect();
        let to = gpu.create_surface(&SurfaceSpec::new("to", stage.viewport, Format::R32f));
        let targets = Attachments { colours: vec![Attachment::cleared(to, Vec4::ZERO)], depth: None };
        let (all, one) = ([Binding::Levels(id)], [Binding::Surface(id.level(1))]);
        let geometry = Geometry::new(&SCREEN, &SCREEN, &[[0, 1, 2]]).unwrap();
        let state = DrawState { depth: FLAT, ..DrawState::default() };
        let mut drawn = |lod, bindings: &[Binding<'_>]| {
            let shader = Fetches(lod);
            let draws = [Draw::new(geometry, &shader, Cull::None).with_state(state).binding(bindings)];
            let pass = RasterPass::new(&stage.camera, &draws, settings).onto(Target::Surfaces(&targets));
            let fetches = gpu.draw(&pass).unwrap().counts[Event::TextureFetches];
            (fetches, gpu.contents(to).unwrap())
        };
        for (lod, taps) in [(0.0, 1), (0.25, 2), (1.0, 1), (2.75, 2), (4.0, 1), (9.0, 1), (f32::NAN, 1)] {
            let (fetches, values) = drawn(lod, &all);
            assert_eq!(fetches, taps * 256, "{lod}");
            let lod = if lod.is_nan() { 0.0 } else { lod };
            for (at, value) in values.iter().enumerate() {
                let uv = Vec2::new((at % 16) as f32 + 0.4, (at / 16) as f32 + 0.7) / 16.0;
                assert_eq!(value.x.to_bits(), mixed_levels(&levels, uv, lod).x.to_bits(), "{lod} at {at}");
            }
        }
        let (fetches, values) = drawn(3.5, &one);
        let uv = Vec2::new(0.4, 0.7) / 16.0;
        assert_eq!((fetches, values[0].x), (256, levels[1].bilinear(uv).x), "a level alone has no others");
    });
}

/// The message for a pass onto `target` that reads `read`.
fn refused(read: impl Fn(SurfaceId) -> Binding<'static>, target: impl Fn(SurfaceId) -> SurfaceId) -> String {
    painted([16, 16], Format::R32f, noise, |gpu, id, stage, settings| {
        let bindings = [read(id)];
        let side = Viewport::new(8, 8).unwrap();
        let half = Settings { viewport: side, ..*settings };
        let geometry = Geometry::new(&SCREEN, &SCREEN, &[[0, 1, 2]]).unwrap();
        let state = DrawState { depth: FLAT, ..DrawState::default() };
        let draws = [Draw::new(geometry, &RED, Cull::None).with_state(state).binding(&bindings)];
        let targets = Attachments { colours: vec![Attachment::cleared(target(id), Vec4::ZERO)], depth: None };
        let pass = RasterPass::new(&stage.camera, &draws, &half).named("down");
        let drawn = gpu.draw(&pass.onto(Target::Surfaces(&targets)));
        drawn.err().map_or_else(String::new, |error| error.to_string())
    })
}

#[test]
fn levels_are_refused_by_name() {
    let starts = |message: String, start: &str| assert!(message.starts_with(start), "{message}");
    assert_eq!(
        refused(Binding::Surface, |id| id.level(1)),
        "",
        "levels of one surface may be read and written"
    );
    let unwritten = refused(|id| Binding::Surface(id.level(2)), |id| id.level(1));
    starts(unwritten, "pass `down`, surface `bloom, level 2`: it is read, but no earlier pass");
    let feedback = refused(|id| Binding::Surface(id.level(1)), |id| id.level(1));
    starts(feedback, "pass `down`, surface `bloom, level 1`: it is read and written in the same pass");
    let whole = refused(Binding::Levels, |id| id.level(1));
    starts(whole, "pass `down`, surface `bloom, level 1`: it is read and written");
    let beyond = refused(Binding::Surface, |id| id.level(5));
    starts(beyond, "pass `down`, surface `bloom, level 5`: the frame has no such surface");
    let size = refused(Binding::Surface, |id| id.level(2));
    starts(size, "pass `down`, surface `bloom, level 2`: it has 4 x 4 pixels, but the pass has 8 x 8");
    painted(
        [16, 16],
        Format::R32u,
        |_| 1.0,
        |gpu, id, stage, settings| {
            let message = gpu.make_levels("chain", id).unwrap_err().to_string();
            starts(
                message,
                "pass `chain level 1`, surface `bloom`: its format R32u is not one of those of colours",
            );
            let new = gpu.create_surface(&SurfaceSpec::new("new", stage.viewport, Format::R32f).mipmapped());
            let message = gpu.make_levels("chain", new).unwrap_err().to_string();
            starts(message, "pass `chain level 1`, surface `new`: it is read, but no earlier pass");
            let both = SurfaceSpec::new("both", stage.viewport, Format::R32f).sampled(4).with_levels(2);
            let targets = Attachments {
                colours: vec![Attachment::cleared(gpu.create_surface(&both), Vec4::ZERO)],
                depth: None,
            };
            let pass =
                RasterPass::new(&stage.camera, &[], settings).named("msaa").onto(Target::Surfaces(&targets));
            let message = gpu.draw(&pass).unwrap_err().to_string();
            starts(message, "pass `msaa`, surface `both`: it has 2 levels and 4 samples per pixel");
        },
    );
}
