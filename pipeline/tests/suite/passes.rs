//! Frames of several passes: one address space, warm caches, barriers, and work by pass and by draw.

use std::cell::Cell;

use activity::{Counts, Event, Packet, PacketKind, Waits};
use glam::{Vec2, Vec3};
use pipeline::*;

use crate::common::*;

const SIDE: u32 = 64;

/// Calls `run` with settings of a small image.
fn with<T>(run: impl FnOnce(&Settings<'_>) -> T) -> T {
    let spec = spec(Features::ALL);
    let table = SampleTable::low_discrepancy(4, 3, LensShape::Disk).unwrap();
    let viewport = Viewport::new(SIDE, SIDE).unwrap();
    run(&Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO })
}

/// Draws `passes` in one frame: their results, all packets, and the report.
fn frame(passes: &[RasterPass<'_>]) -> (Vec<Rendered>, Vec<Packet>, FrameReport) {
    let mut packets = Vec::new();
    let mut gpu = Gpu::new(passes[0].settings.spec, |packet, _| packets.push(*packet)).unwrap();
    let drawn = passes.iter().map(|pass| gpu.draw(pass).unwrap()).collect();
    let report = gpu.finish();
    (drawn, packets, report)
}

fn barriers(packets: &[Packet]) -> Vec<(u32, Waits)> {
    let barrier = |packet: &Packet| match packet.kind {
        PacketKind::Barrier(waits) => Some((packet.pass, waits)),
        _ => None,
    };
    packets.iter().filter_map(barrier).collect()
}

#[test]
fn a_pass_has_the_image_that_it_has_alone() {
    let soups = [Soup::new(SoupKind::Moving, 150, 1), Soup::new(SoupKind::Layers, 40, 2)];
    let draws = soups.each_ref().map(|soup| [soup.draw(&Plain, Cull::None)]);
    with(|settings| {
        let camera = camera(true);
        let passes = draws.each_ref().map(|draws| RasterPass::new(&camera, draws, settings).with_visible());
        let (both, packets, report) = frame(&passes);
        assert_eq!(barriers(&packets), [], "neither reads what the other writes");
        for (number, (pass, ours)) in passes.iter().zip(&both).enumerate() {
            let alone = pass.render(|_, _| ()).unwrap();
            assert_eq!((&ours.images, &ours.visible), (&alone.images, &alone.visible));
            for event in [Event::SamplesTested, Event::QuadsShaded, Event::VerticesFetched, Event::DepthLines]
            {
                assert_eq!(report.passes[number].counts()[event], alone.counts[event], "{event:?}");
            }
        }
        assert_eq!(
            packets.last().map(|packet| packet.pass),
            Some(2),
            "the write-back comes after the last pass"
        );
    });
}

#[test]
fn packets_add_up_to_the_work_of_draws_and_passes() {
    let soups = [1, 2, 3].map(|seed| Soup::new(SoupKind::Crossing, 70, seed));
    let draws = soups.each_ref().map(|soup| soup.draw(&Plain, Cull::None));
    with(|settings| {
        let camera = camera(true);
        let pass = RasterPass::new(&camera, &draws, settings);
        let (drawn, packets, report) = frame(&[pass, pass.named("again").onto(Target::Depth)]);
        let of = |pass: u32, draw: u32| {
            let own = packets.iter().filter(|packet| (packet.pass, packet.draw) == (pass, draw));
            own.fold(Counts::default(), |mut sum, packet| {
                sum += &packet.counts;
                sum
            })
        };
        for (number, pass) in (0..).zip(&report.passes) {
            for (draw, counts) in (0..).zip(&pass.draws) {
                assert_eq!(*counts, of(number, draw));
                assert!(counts[Event::SamplesTested] > 0 && counts[Event::Draws] == 1);
            }
        }
        assert_eq!(drawn[0].counts, report.passes[0].counts());
        let all = (0..3).map(|draw| of(0, draw)[Event::TilesVisited]).sum::<u64>();
        assert_eq!(
            all,
            drawn[0].counts[Event::TilesVisited],
            "tile tests without a hit belong to their draw"
        );
        let sum = packets.iter().fold(Counts::default(), |mut sum, packet| {
            sum += &packet.counts;
            sum
        });
        assert_eq!((sum, report.triangles()), (report.counts(), 2 * 210));
    });
}

#[test]
fn data_that_are_drawn_twice_are_read_from_memory_once() {
    let soup = Soup::new(SoupKind::Moving, 200, 5);
    let draws = [soup.draw(&Plain, Cull::None)];
    let read = |resident: bool| {
        with(|settings| {
            let mut gpu = Gpu::without_packets(settings.spec).unwrap();
            let draws = if resident { gpu.resident(&draws) } else { draws.to_vec() };
            let camera = camera(false);
            let pass = RasterPass::new(&camera, &draws, settings).onto(Target::Depth);
            let [_, second] = [gpu.draw(&pass).unwrap(), gpu.draw(&pass).unwrap()];
            second.counts[Event::DramReadBytes]
        })
    };
    assert!(read(false) >= 200 * 3 * 24);
    assert_eq!(read(true), 0, "the L2 holds all vertices");
}

/// A square that fills the image, with its texture coordinates.
fn screen() -> ([Vec3; 4], [Vec2; 4]) {
    let corners = [[-9.0, 9.0], [9.0, 9.0], [9.0, -9.0], [-9.0, -9.0]].map(|[x, y]| Vec3::new(x, y, 4.0));
    (corners, [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y])
}

#[test]
fn a_pass_waits_for_the_one_it_reads_and_finds_its_result_in_the_l2() {
    let soup = Soup::new(SoupKind::Still, 100, 7);
    let (corners, uvs) = screen();
    let texels = vec![[200, 100, 50, 255]; (SIDE * SIDE) as usize];
    let shader = Textured(Texture::from_srgb8(SIDE, SIDE, texels, [Wrap::Clamp; 2]).unwrap());
    let read = |written: bool| {
        with(|settings| {
            let mut packets = Vec::new();
            let mut gpu = Gpu::new(settings.spec, |packet, _| packets.push(*packet)).unwrap();
            let (camera, first) = (camera(false), [soup.draw(&Plain, Cull::None)]);
            let first = gpu.draw(&RasterPass::new(&camera, &first, settings).onto(Target::Texture)).unwrap();
            let geometry = Geometry::new(&corners, &corners, &QUAD).unwrap().with_uvs(&uvs).unwrap();
            let draw = Draw::new(geometry, &shader, Cull::None);
            let draws = [if written { draw.reading(first.region) } else { draw }];
            let second = gpu.draw(&RasterPass::new(&camera, &draws, settings)).unwrap();
            drop(gpu);
            (second, packets)
        })
    };
    let ((ours, packets), (other, without)) = (read(true), read(false));
    assert_eq!((barriers(&packets), barriers(&without)), (vec![(1, Waits::Tiles)], vec![]));
    let at = packets.iter().position(|packet| matches!(packet.kind, PacketKind::Barrier(_))).unwrap();
    assert!(packets[..at].iter().all(|packet| packet.pass == 0));
    assert!(packets[at].counts[Event::L2Writes] > 0, "the image moves to the L2");
    assert_eq!(ours.images, other.images, "where a texture lies does not change it");
    let saved = other.counts[Event::DramReadBytes] - ours.counts[Event::DramReadBytes];
    // Only the finest level was written; the footprint of a quad of pixels is larger than a texel.
    assert!(saved > 0, "{saved}");
}

#[test]
fn a_frame_that_is_too_large_names_its_pass() {
    let soup = Soup::new(SoupKind::Still, 1, 1);
    let draws = [soup.draw(&Plain, Cull::None)];
    with(|settings| {
        let mut gpu = Gpu::without_packets(settings.spec).unwrap();
        gpu.allocate(memory::AddressSpace::MAX_BYTES);
        let camera = camera(false);
        let error = gpu.draw(&RasterPass::new(&camera, &draws, settings).named("shadow")).unwrap_err();
        assert!(error.to_string().starts_with("pass `shadow`: the memory of the frame takes "), "{error}");
    });
}

#[test]
fn sixty_four_passes_of_one_triangle_are_sixty_four_times_one() {
    let (corners, _) = screen();
    let draws = [Draw::new(Geometry::new(&corners, &corners, &QUAD[..1]).unwrap(), &Plain, Cull::None)];
    with(|settings| {
        let camera = camera(false);
        let pass = RasterPass::new(&camera, &draws, settings);
        let (drawn, packets, report) = frame(&[pass; 64]);
        let one = pass.render(|_, _| ()).unwrap();
        assert!(drawn.iter().all(|pass| pass.images == one.images));
        let all = report.counts();
        for event in [Event::Draws, Event::TrianglesIn, Event::SamplesTested, Event::PixelsResolved] {
            assert_eq!(all[event], 64 * one.counts[event], "{event:?}");
        }
        assert_eq!(packets.iter().filter(|packet| packet.kind == PacketKind::Draw).count(), 64);
    });
}

/// Once it is stopped, here by its first packet, a GPU ends the pass of triangles that it draws, and refuses the
/// next one.
#[test]
fn a_stopped_frame_is_drawn_no_further() {
    let soup = Soup::new(SoupKind::Moving, 150, 1);
    let draws = [soup.draw(&Plain, Cull::None)];
    with(|settings| {
        let (camera, stop) = (camera(true), Cell::new(false));
        let mut gpu = Gpu::new(settings.spec, |_, _| stop.set(true)).unwrap().stopping(&stop);
        let pass = RasterPass::new(&camera, &draws, settings).named("light");
        assert_eq!(gpu.draw(&pass).unwrap().images, pass.render(|_, _| ()).unwrap().images);
        assert_eq!(gpu.draw(&pass).unwrap_err(), PassError::Stopped { pass: "light".to_owned() });
    });
}
