//! Heat maps: every event is counted once, at its position.

use crate::common::stage::{RED, still};
use crate::common::{Plain, Soup, SoupKind, camera, pixel_camera, rectangle, spec};
use activity::{Counts, Event};
use glam::Vec3;
use pipeline::depth::{BoxGrid, Pyramid};
use pipeline::frame::{HeatMap, TileHeat};
use pipeline::*;

fn maps(size: [u32; 2], spec: &PipelineSpec, draws: &[Draw<'_>], camera: &Camera) -> (Vec<HeatMap>, Counts) {
    let viewport = Viewport::new(size[0], size[1]).unwrap();
    let table = SampleTable::low_discrepancy(4, 3, LensShape::Disk).unwrap();
    let settings = Settings { spec, viewport, samples: &table, background: Vec3::ZERO };
    let pass = RasterPass::new(camera, draws, &settings);
    let mut gpu = Gpu::without_packets(spec).unwrap().with_heat(&Event::ALL, viewport);
    let rendered = gpu.draw(&pass).unwrap();
    let report = gpu.finish();
    let plain = pass.render(|_, _| ()).unwrap();
    assert_eq!((plain.images, plain.counts), (rendered.images, report.counts()), "looking changes nothing");
    (report.heat, plain.counts)
}

#[test]
fn every_event_is_counted_once() {
    for (kind, tile_px, coarse_tile_px) in
        [(SoupKind::Moving, 8, 32), (SoupKind::Layers, 4, 16), (SoupKind::Still, 1, 8)]
    {
        let soup = Soup::new(kind, 250, 4);
        let spec = PipelineSpec { tile_px, coarse_tile_px, ..spec(Features::ALL) };
        let (heat, counts) = maps([75, 53], &spec, &[soup.draw(&Plain, Cull::None)], &camera(true));
        for map in heat {
            assert_eq!(map.total(), counts[map.event], "{:?} {kind:?}", map.event);
            let pixels: f64 = map.pixels().iter().map(|&value| f64::from(value)).sum();
            let placed = (map.total() - map.elsewhere) as f64;
            assert!((pixels - placed).abs() <= 1e-4 * placed, "{:?}: {pixels} of {placed}", map.event);
            assert!(HeatMap::is_of(map.event) || map.elsewhere == map.total(), "{:?}", map.event);
        }
    }
}

#[test]
fn events_of_a_triangle_are_in_its_tiles() {
    // A rectangle over the pixels 16..24 by 8..16 of 64x32: one fine tile of 8 pixels.
    let (viewport, corners) = (Viewport::new(64, 32).unwrap(), rectangle([-15.5, -8.5], [0.5, 7.5], 2.0));
    let spec = spec(Features::ALL);
    let (heat, counts) = maps([64, 32], &spec, &[still(&corners, &RED)], &pixel_camera(viewport, 0.25));
    let map = |event| heat.iter().find(|map| map.event == event).unwrap();
    for event in [Event::SamplesHit, Event::DepthWrites, Event::QuadsShaded, Event::TilesVisited] {
        let hot: Vec<_> = map(event).tiles.iter().filter(|tile| tile.count > 0).collect();
        assert_eq!(hot.len(), 1, "{event:?}");
        assert_eq!((hot[0].origin, hot[0].count), ([16, 8], counts[event]), "{event:?}");
    }
    let coarse = map(Event::CoarseTilesVisited);
    assert_eq!(coarse.coarse.iter().map(|tile| tile.count).collect::<Vec<_>>(), [2, 0]);
    assert_eq!(map(Event::Indices).elsewhere, 6);
}

/// Sample events are known by pixel: a triangle over part of a tile is hit there only.
#[test]
fn sample_events_are_in_their_own_pixels() {
    let (viewport, corners) = (Viewport::new(64, 32).unwrap(), rectangle([-15.5, -10.5], [0.5, 4.5], 2.0));
    let (heat, counts) =
        maps([64, 32], &spec(Features::ALL), &[still(&corners, &RED)], &pixel_camera(viewport, 0.25));
    let map = |event| heat.iter().find(|map| map.event == event).unwrap();
    let hit = map(Event::SamplesHit).pixels();
    let covered: Vec<_> =
        hit.iter().enumerate().filter(|(_, hits)| **hits > 0.0).map(|(at, _)| [at % 64, at / 64]).collect();
    assert!(!covered.is_empty() && covered.len() <= 6 * 5, "{covered:?}");
    let columns = covered.iter().map(|at| at[0]);
    assert!(columns.clone().max().unwrap() - columns.min().unwrap() <= 5);
    for event in [Event::SamplesTested, Event::SampleMadds, Event::SamplesHit, Event::DepthWrites] {
        let sum: f64 = map(event).pixels().iter().map(|&count| f64::from(count)).sum();
        assert_eq!(sum, counts[event] as f64, "{event:?}");
    }
    let tested = map(Event::SamplesTested).pixels();
    assert!(hit.iter().zip(&tested).all(|(hit, tested)| hit <= tested));
}

#[test]
fn tests_without_a_packet_are_counted_in_their_tile() {
    // A sliver along the diagonal: its bounding box visits every tile, its edges cull those beside the
    // diagonal.
    let viewport = Viewport::new(32, 32).unwrap();
    let corners = [[-15.0, -15.0], [15.0, 15.0], [15.0, 14.0]].map(|[x, y]| Vec3::new(x, y, 1.0));
    let geometry = Geometry::new(&corners, &corners, &[[0, 1, 2]]).unwrap();
    let draws = [Draw::new(geometry, &RED, Cull::None)];
    let (heat, _) = maps([32, 32], &spec(Features::ALL), &draws, &pixel_camera(viewport, 0.25));
    let counts = |event| -> Vec<u64> {
        heat.iter().find(|map| map.event == event).unwrap().tiles.iter().map(|tile| tile.count).collect()
    };
    assert_eq!(counts(Event::TilesVisited), [1; 16]);
    let culled = counts(Event::TilesCulledEdges);
    for (index, count) in culled.iter().enumerate() {
        let (column, row) = (index % 4, index / 4);
        // The diagonal crosses the tiles with column + row = 3, and touches their neighbours at a corner.
        match (column + row).abs_diff(3) {
            0 => assert_eq!(*count, 0, "tile {column}, {row}"),
            1 => (),
            _ => assert_eq!(*count, 1, "tile {column}, {row}"),
        }
    }
}

/// Over several passes of a frame every event is counted once: in its place in passes of the size of the
/// maps, elsewhere in others.
#[test]
fn passes_of_a_frame_add_up_on_one_map() {
    let (spec, soup) = (spec(Features::ALL), Soup::new(SoupKind::Moving, 120, 4));
    let table = SampleTable::low_discrepancy(4, 3, LensShape::Disk).unwrap();
    let (camera, draws) = (camera(true), [soup.draw(&Plain, Cull::None)]);
    let [image, map] = [[75, 53], [32, 32]].map(|[width, height]| Viewport::new(width, height).unwrap());
    let mut gpu = Gpu::without_packets(&spec).unwrap().with_heat(&Event::ALL, image);
    for viewport in [map, image, image] {
        let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
        gpu.draw(&RasterPass::new(&camera, &draws, &settings)).unwrap();
    }
    for viewport in [image, map] {
        gpu.shade_pixels("grey", viewport, Uses::default(), |lanes, [x, y]| {
            lanes.run(|lane| Vec3::splat(lane.add(x as f32, y as f32)))
        })
        .unwrap();
    }
    let report = gpu.finish();
    let counts = report.counts();
    for map in &report.heat {
        assert_eq!(map.total(), counts[map.event], "{:?}", map.event);
        let pixels: f64 = map.pixels().iter().map(|&value| f64::from(value)).sum();
        let placed = (map.total() - map.elsewhere) as f64;
        assert!((pixels - placed).abs() <= 1e-4 * placed, "{:?}: {pixels} of {placed}", map.event);
    }
    let elsewhere = |event: Event| {
        let map = report.heat.iter().find(|map| map.event == event).unwrap();
        let passes: Vec<u64> = report.passes.iter().map(|pass| pass.counts()[event]).collect();
        (map.elsewhere, passes)
    };
    let (tested, passes) = elsewhere(Event::SamplesTested);
    assert_eq!(tested, passes[0]);
    let (resolved, passes) = elsewhere(Event::PixelsResolved);
    assert_eq!((resolved, passes[4]), (passes[0], 0));
    let (written, passes) = elsewhere(Event::ColourWrites);
    assert_eq!((written, passes[4]), (passes[0] + passes[4], 32 * 32));
}

/// The maps of passes of different names and kinds, and what is of no pass, add up to those of the frame.
#[test]
fn maps_of_single_passes_add_up() {
    let (spec, soup) = (spec(Features::ALL), Soup::new(SoupKind::Moving, 120, 4));
    let table = SampleTable::low_discrepancy(4, 3, LensShape::Disk).unwrap();
    let (camera, draws) = (camera(true), [soup.draw(&Plain, Cull::None)]);
    let viewport = Viewport::new(75, 53).unwrap();
    let mut gpu = Gpu::without_packets(&spec).unwrap().with_heat(&Event::ALL, viewport);
    for name in ["near", "far", "none"] {
        gpu = gpu.with_heat_of_pass(name, &Event::ALL, viewport);
    }
    let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
    for name in ["near", "far", "near"] {
        gpu.draw(&RasterPass::new(&camera, &draws, &settings).named(name)).unwrap();
        let grey = |lanes: &Lanes, _| lanes.run(|lane| Vec3::splat(lane.add(1.0, 2.0)));
        gpu.shade_pixels("far", viewport, Uses::default(), grey).unwrap();
    }
    let report = gpu.finish();
    let of = |pass: Option<&'static str>| report.heat.iter().filter(move |map| map.pass.as_deref() == pass);
    for (((all, near), far), none) in
        of(None).zip(of(Some("near"))).zip(of(Some("far"))).zip(of(Some("none")))
    {
        let event = all.event;
        let counted = |name: &str| -> u64 {
            let passes = report.passes.iter().filter(|pass| pass.name == name);
            passes.map(|pass| pass.counts()[event]).sum()
        };
        for (name, map) in [("near", near), ("far", far), ("none", none)] {
            assert_eq!(map.total(), counted(name), "{event:?} of {name}");
        }
        for (at, tile) in all.tiles.iter().enumerate() {
            assert_eq!(tile.count, near.tiles[at].count + far.tiles[at].count, "{event:?}");
        }
        let outside = all.elsewhere - near.elsewhere - far.elsewhere;
        assert_eq!(outside, report.write_back[event], "{event:?}");
    }
    assert_eq!(of(None).count(), Event::ALL.len());
}

/// Farthest depths are gathered where they are in the image, also over tiles of another size than those of the
/// hardware and at the borders of the image, and nowhere in an image of another size.
#[test]
fn farthest_depths_are_gathered_in_their_tiles() {
    let spec = spec(Features::ALL);
    let table = SampleTable::low_discrepancy(4, 3, LensShape::Disk).unwrap();
    let [image, other] = [[44, 28], [32, 32]].map(|[width, height]| Viewport::new(width, height).unwrap());
    let depths = vec![1.0; image.pixels() * 4];
    for tile_px in [8, 16] {
        let gathered = |of: Viewport| {
            let pyramid = Pyramid::new(image, &table, &depths, tile_px, BoxGrid::new([1; 3], false).unwrap());
            let mut gpu =
                Gpu::without_packets(&spec).unwrap().with_heat(&[Event::DepthReads, Event::ZCullTests], of);
            let stored = gpu.allocate(4 * depths.len() as u64);
            gpu.gather_farthest_depths("farthest depths", &pyramid, stored).unwrap();
            gpu.finish().heat
        };
        let [reads, tests] = &gathered(image)[..] else { unreachable!() };
        assert_eq!((reads.total(), reads.elsewhere, tests.elsewhere), (depths.len() as u64, 0, 0));
        let each_depth_once = |tile: &TileHeat| tile.count == u64::from(4 * tile.size[0] * tile.size[1]);
        assert!(reads.tiles.iter().all(each_depth_once), "{:?}", reads.tiles);
        assert!(tests.total() > reads.total(), "each level compares what the one before found");
        assert!(gathered(other).iter().all(|map| map.elsewhere == map.total()));
    }
}
