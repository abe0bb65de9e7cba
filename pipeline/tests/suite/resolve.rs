//! Resolves as passes: events, waits and refusals; what they write is compared in `surfaces.rs`.

use activity::{Event, Packet, PacketKind};
use glam::{Vec3, Vec4};
use pipeline::*;

use crate::common::stage::*;
use crate::common::*;

const SIDE: u32 = 16;

/// Calls `run` with 4 samples per pixel of an image of 16 x 16 pixels.
fn with<T>(run: impl FnOnce(&Stage, &Settings<'_>) -> T) -> T {
    let (stage, spec) = (Stage::sampled(SIDE, SIDE, 4), spec(Features::ALL));
    let settings = Settings {
        spec: &spec,
        viewport: stage.viewport,
        samples: &stage.table,
        background: Vec3::new(0.0, 0.5, 0.25),
    };
    run(&stage, &settings)
}

fn samples(gpu: &mut Gpu<'_>, viewport: Viewport, format: Format) -> SurfaceId {
    gpu.create_surface(&SurfaceSpec::new("samples", viewport, format).sampled(4))
}

/// Draws a rectangle over a part of `to`, whose other samples have no colour.
fn draw(gpu: &mut Gpu<'_>, stage: &Stage, settings: &Settings<'_>, to: SurfaceId) {
    let corners = rectangle([-5.3, 6.1], [-3.2, 7.7], 1.0);
    let state = DrawState { depth: DepthState::NONE, ..DrawState::default() };
    let draws = [still(&corners, &RED).with_state(state)];
    let targets = Attachments { colours: vec![Attachment::cleared(to, Vec4::ZERO)], depth: None };
    let pass = RasterPass::new(&stage.camera, &draws, settings).named("draw");
    gpu.draw(&pass.onto(Target::Surfaces(&targets))).unwrap();
}

/// A pass is done by the colour unit alone, tile by tile: every word and line by hand.
#[test]
fn samples_pixels_and_lines_are_counted() {
    with(|stage, settings| {
        let run = |drops: bool| {
            let mut packets = Vec::new();
            let mut gpu = Gpu::new(settings.spec, |packet, _| packets.push(*packet)).unwrap();
            let from = samples(&mut gpu, stage.viewport, Format::Rgba16f);
            let to = gpu.create_surface(&SurfaceSpec::new("pixels", stage.viewport, Format::Rgba8Srgb));
            draw(&mut gpu, stage, settings, from);
            let pass = ResolvePass::new("average", from);
            let counts = gpu.resolve(&if drops { pass.dropping() } else { pass }, to).unwrap();
            assert_eq!(gpu.contents(from).is_none(), drops);
            let report = gpu.finish();
            (counts, report, packets)
        };
        for drops in [false, true] {
            let (counts, report, packets) = run(drops);
            let of = |event| counts[event];
            // Halves are two words.
            assert_eq!([of(Event::SamplesResolved), of(Event::PixelsResolved)], [256 * 4 * 2, 256]);
            // 8 samples or 16 pixels a line.
            assert_eq!(of(Event::ColourLines), 256 * 4 / 8 + 256 / 16);
            for event in
                [Event::Draws, Event::TrianglesIn, Event::ShaderOps, Event::TextureLines, Event::ColourWrites]
            {
                assert_eq!(of(event), 0, "{event:?}");
            }
            let resolves: Vec<&Packet> = packets.iter().filter(|packet| packet.pass >= 1).collect();
            assert_eq!(resolves.len(), 5, "four tiles and the end of the frame, without a barrier");
            assert!(resolves.iter().all(|packet| packet.kind == PacketKind::Resolve));
            assert_eq!(
                resolves.iter().map(|packet| packet.tile).collect::<Vec<_>>(),
                [0, 1, 2, 3, Packet::NONE]
            );
            assert_eq!((report.passes[1].name.as_str(), report.passes[1].counts()), ("average", counts));
            let written = 16 + if drops { 0 } else { 128 };
            assert_eq!(
                report.counts()[Event::DramWriteBytes],
                written * 64,
                "dropped samples are not written"
            );
        }
    });
}

/// The end of a raster pass and the pass of its own give the same image and the same words.
#[test]
fn a_raster_pass_and_a_resolve_give_the_same_image() {
    with(|stage, settings| {
        let corners = rectangle([-5.3, 6.1], [-3.2, 7.7], 1.0);
        let (mut one, mut two) =
            (Gpu::without_packets(settings.spec).unwrap(), Gpu::without_packets(settings.spec).unwrap());
        let drawn = one.draw(&RasterPass::new(&stage.camera, &[still(&corners, &RED)], settings)).unwrap();
        let from = samples(&mut two, stage.viewport, Format::Rgba16f);
        draw(&mut two, stage, settings, from);
        let resolved = two.resolve_image(&ResolvePass::new("resolve", from), settings.background).unwrap();
        let bits = |image: &[Vec3]| image.iter().map(|p| p.to_array().map(f32::to_bits)).collect::<Vec<_>>();
        assert_eq!(bits(&drawn.images[0]), bits(&resolved.images[0]));
        assert!(drawn.images[0].iter().any(|pixel| pixel.x > 0.0 && pixel.y > 0.0), "some pixels are mixed");
        assert_eq!(resolved.counts[Event::PixelsResolved], drawn.counts[Event::PixelsResolved]);
        assert_eq!(resolved.counts[Event::SamplesResolved], 2 * drawn.counts[Event::SamplesResolved]);
        assert_eq!(resolved.region.bytes(), drawn.region.bytes());
    });
}

/// What earlier passes read is not overwritten before they end.
#[test]
fn a_resolve_waits_for_those_that_read_what_it_writes() {
    with(|stage, settings| {
        let mut packets = Vec::new();
        let mut gpu = Gpu::new(settings.spec, |packet, _| packets.push(*packet)).unwrap();
        let [from, other] = [(); 2].map(|()| samples(&mut gpu, stage.viewport, Format::Rgba8));
        let to = gpu.create_surface(&SurfaceSpec::new("pixels", stage.viewport, Format::Rgba8));
        draw(&mut gpu, stage, settings, from);
        gpu.resolve(&ResolvePass::new("first", from), to).unwrap();
        let bindings = [Binding::Surface(to)];
        let corners = rectangle([-8.0, 8.0], [-8.0, 8.0], 1.0);
        let state = DrawState { depth: DepthState::NONE, ..DrawState::default() };
        let draws = [still(&corners, &RED).with_state(state).binding(&bindings)];
        let targets = Attachments { colours: vec![Attachment::cleared(other, Vec4::ZERO)], depth: None };
        gpu.draw(&RasterPass::new(&stage.camera, &draws, settings).onto(Target::Surfaces(&targets))).unwrap();
        gpu.resolve(&ResolvePass::new("second", from), to).unwrap();
        drop(gpu);
        let barriers = packets.iter().filter(|packet| matches!(packet.kind, PacketKind::Barrier(_)));
        let passes: Vec<u32> = barriers.map(|packet| packet.pass).collect();
        assert_eq!(passes, [2, 3], "the draw waits for the pixels, the second resolve for the draw");
    });
}

#[test]
fn what_has_no_mean_is_refused_by_name() {
    with(|stage, settings| {
        let mut gpu = Gpu::without_packets(settings.spec).unwrap();
        let from = samples(&mut gpu, stage.viewport, Format::Rgba8);
        let refused = |gpu: &mut Gpu<'_>, from, to, start: &str| {
            let message = gpu.resolve(&ResolvePass::new("average", from), to).unwrap_err().to_string();
            assert!(message.starts_with(&format!("pass `average`, surface `{start}")), "{message}");
        };
        let new = |gpu: &mut Gpu<'_>, name, size, format, samples| {
            gpu.create_surface(&SurfaceSpec::new(name, size, format).sampled(samples))
        };
        let to = new(&mut gpu, "pixels", stage.viewport, Format::Rgba8, 1);
        refused(
            &mut gpu,
            from,
            to,
            "samples`: it is read, but no earlier pass of the frame stored anything in it",
        );
        draw(&mut gpu, stage, settings, from);
        refused(&mut gpu, from, from, "samples`: it is read and written in the same pass");
        let two = new(&mut gpu, "two", stage.viewport, Format::Rgba8, 2);
        refused(&mut gpu, from, two, "two`: it has 2 samples per pixel, but the pass has 1");
        let small = new(&mut gpu, "small", Viewport::new(8, 4).unwrap(), Format::Rgba8, 1);
        refused(&mut gpu, from, small, "small`: it has 8 x 4 pixels, but the pass has 16 x 16");
        for format in [Format::R32u, Format::D32, Format::D24S8] {
            let other = new(&mut gpu, "other", stage.viewport, format, 4);
            refused(&mut gpu, other, to, "other`: its format ");
            let other = new(&mut gpu, "other", stage.viewport, format, 1);
            refused(&mut gpu, from, other, "other`: its format ");
        }
        let elsewhere =
            new(&mut Gpu::without_packets(settings.spec).unwrap(), "x", stage.viewport, Format::Rgba8, 1);
        assert!(gpu.resolve(&ResolvePass::new("average", from), elsewhere.level(9)).is_err());
        assert!(gpu.resolve(&ResolvePass::new("average", elsewhere.level(1)), to).is_err());
        gpu.resolve(&ResolvePass::new("average", from).dropping(), to).unwrap();
        refused(
            &mut gpu,
            from,
            to,
            "samples`: it is read, but no earlier pass of the frame stored anything in it",
        );
    });
}

/// Many small passes end in one image; surfaces beyond the address space are refused.
#[test]
fn sixty_four_passes_and_a_target_larger_than_memory() {
    with(|stage, settings| {
        let mut gpu = Gpu::without_packets(settings.spec).unwrap();
        let from = samples(&mut gpu, stage.viewport, Format::R32f);
        let state = DrawState { depth: DepthState::NONE, blend: Blend::Add, ..DrawState::default() };
        let one = [Vec3::new(-8.0, -8.0, 1.0), Vec3::new(40.0, -8.0, 1.0), Vec3::new(-8.0, 40.0, 1.0)];
        for number in 0..64 {
            let geometry = Geometry::new(&one, &one, &[[0, 1, 2]]).unwrap();
            let draws = [Draw::new(geometry, &RED, Cull::None).with_state(state)];
            let to =
                if number == 0 { Attachment::cleared(from, Vec4::ZERO) } else { Attachment::loaded(from) };
            let targets = Attachments { colours: vec![to], depth: None };
            gpu.draw(&RasterPass::new(&stage.camera, &draws, settings).onto(Target::Surfaces(&targets)))
                .unwrap();
        }
        let to = gpu.create_surface(&SurfaceSpec::new("sum", stage.viewport, Format::R32f));
        gpu.resolve(&ResolvePass::new("resolve", from), to).unwrap();
        assert!(gpu.contents(to).unwrap().iter().all(|value| value.x == 64.0));
        let large = Viewport::new(16_384, 16_384).unwrap();
        (0..129).for_each(|_| {
            gpu.create_surface(&SurfaceSpec::new("huge", large, Format::Rg32f).sampled(256));
        });
        for message in [
            gpu.resolve(&ResolvePass::new("resolve", from), to).unwrap_err(),
            gpu.resolve_image(&ResolvePass::new("resolve", from), Vec3::ZERO).unwrap_err(),
        ] {
            assert!(
                message.to_string().starts_with("pass `resolve`: the memory of the frame takes "),
                "{message}"
            );
        }
        let report = gpu.finish();
        assert_eq!(report.passes.len(), 65, "a refused pass leaves nothing");
    });
}
