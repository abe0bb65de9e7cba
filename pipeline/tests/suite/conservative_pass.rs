//! Conservative mode as a pass of the pipeline: its tiles are those of the rasterizer alone, and every packet
//! counts what was done.

use std::sync::atomic::{AtomicU32, Ordering};

use crate::common::*;
use activity::{Counts, Event, PacketKind, Waits};
use glam::Vec3;
use pipeline::conservative::{Grid, MovingTriangle, Rasterizer, TileLoop, Touch, View};
use pipeline::memory::MemoryRange;
use pipeline::random::{mix, unit};
use pipeline::tally::Costs;
use pipeline::*;

const GRID: Grid = Grid { origin: [0.0, 0.0], tile: [1.0; 2], columns: 8, rows: 8 };

/// A triangle that touches seven tiles.
const CORNERS: [[f64; 3]; 3] = [[0.5, 0.5, 2.0], [3.5, 0.5, 2.0], [0.5, 1.5, 4.0]];

/// A draw in blocks of 8 x 8 tiles.
fn in_blocks_of_8(primitives: &[Primitive], vertices: MemoryRange) -> ConservativeDraw<'_> {
    ConservativeDraw { primitives, grid: &GRID, block: 8, vertices, vertex_bytes: 24, projection: None }
}

fn primitive(corners: [[[f64; 3]; 3]; 2], body: u32) -> Primitive {
    Primitive {
        triangle: MovingTriangle::new(corners[0], corners[1]).unwrap(),
        rasterizer: Rasterizer::new(View::orthographic()),
        scissor: [0..GRID.columns, 0..GRID.rows],
        body,
        reuses_vertices: false,
        keeps_back_faces_only: false,
    }
}

/// Merges a word at each tile, with two operations.
struct Merge {
    target: MemoryRange,
    runs: AtomicU32,
}

impl TileShader for Merge {
    type BodyState = u32;
    type Output = [f64; 2];

    fn run(&self, tiles_of_body: &mut u32, lanes: &Lanes, tile: &TileIntervals<'_>) -> Option<[f64; 2]> {
        self.runs.fetch_add(1, Ordering::Relaxed);
        *tiles_of_body += 1;
        lanes.run(|lane| lane.madd(1.0_f32, 2.0, lane.add(1.0, 1.0)));
        lanes.merge(self.target, u64::from(tile.tile[1] * GRID.columns + tile.tile[0]) * 4, 4);
        Some(tile.touch.z)
    }
}

/// A tile and its depths.
type Tile = ([u32; 2], [f64; 2]);

/// Tiles that a pass hands to its shader, its packets and its counts.
fn drawn(primitives: &[Primitive], block: u32) -> (Vec<Tile>, Vec<PacketKind>, Counts) {
    let spec = spec(Features::ALL);
    let (mut sum, mut kinds, mut found) = (Counts::default(), Vec::new(), Vec::new());
    let mut gpu = Gpu::new(&spec, |packet, _| {
        sum += &packet.counts;
        kinds.push(packet.kind);
    })
    .unwrap();
    let [target, vertices] = [64 * 4, 3 * 24 * primitives.len() as u64].map(|bytes| gpu.allocate(bytes));
    let shader = Merge { target, runs: AtomicU32::new(0) };
    let uses = Uses::default().depths([target]);
    let mut pass = gpu.begin_conservative("boxes", None, uses).unwrap();
    let draw =
        ConservativeDraw { primitives, grid: &GRID, block, vertices, vertex_bytes: 24, projection: None };
    pass.draw(&mut gpu, &draw, &shader, |tile, z| found.push((tile, z))).unwrap();
    let report = gpu.finish();
    assert_eq!(report.counts(), sum);
    assert_eq!(report.triangles(), primitives.iter().filter(|primitive| !primitive.reuses_vertices).count());
    assert_eq!(shader.runs.into_inner() as usize, found.len());
    (found, kinds, sum)
}

#[test]
fn a_still_triangle_is_counted_by_hand() {
    let corners = CORNERS;
    let (found, kinds, counts) = drawn(&[primitive([corners; 2], 0)], 8);
    // As in the example of `pipeline::conservative`.
    assert_eq!(found.len(), 7);
    assert_eq!(counts[Event::PixelInvocations], 7);
    assert_eq!(counts[Event::ShaderOps], 7 * 2);
    assert_eq!((counts[Event::DepthReads], counts[Event::DepthWrites]), (7, 7));
    assert_eq!([Event::TrianglesIn, Event::TrianglesSetUp, Event::Draws].map(|event| counts[event]), [1; 3]);
    // Blocks of 8, 4 and 2 tiles along a side down to the 16 tiles of two blocks of 4 by 2.
    let tests = counts[Event::TilesVisited];
    assert!(tests >= 7 && counts[Event::TilesCulledSides] + counts[Event::TilesCulledEdges] > 0);
    let culled = counts[Event::TilesCulledSides] + counts[Event::TilesCulledEdges];
    assert!(culled <= tests - 7 + counts[Event::CoarseTilesVisited]);
    assert_eq!(counts[Event::SetupMadds], 0, "nothing moves");
    let parts = [Event::EdgeMadds, Event::SidePlaneMadds, Event::EdgeBoundMadds].map(|event| counts[event]);
    assert!(parts.iter().all(|madds| *madds > 0));
    assert_eq!(counts[Event::TileMadds], parts.iter().sum::<u64>());
    assert!(counts[Event::DepthIntervalMadds] > 0);
    // Two rows of eight tiles are 64 bytes: one line, which a packet accesses once.
    assert_eq!(counts[Event::DepthLines], 1);
    assert_eq!(counts[Event::DepthMisses], 1);
    assert_eq!(kinds[..2], [PacketKind::Draw, PacketKind::Vertices]);
}

#[test]
fn a_moving_triangle_counts_the_differences_of_its_vertices_once() {
    let open = [[0.5, 0.5, 2.0], [3.5, 0.5, 2.0], [0.5, 1.5, 4.0]];
    let close = open.map(|[x, y, z]| [x + 2.0, y + 1.0, z]);
    let moving = primitive([open, close], 0);
    let (_, _, counts) = drawn(std::slice::from_ref(&moving), 8);
    assert_eq!(counts[Event::SetupMadds], 9);
    let again = Primitive { reuses_vertices: true, ..moving.clone() };
    let (found, _, both) = drawn(&[moving, again], 8);
    assert_eq!((both[Event::VerticesFetched], both[Event::SetupMadds]), (3, 9));
    assert_eq!(both[Event::TileMadds], 2 * counts[Event::TileMadds]);
    assert_eq!(found.len() as u64, both[Event::PixelInvocations]);
}

#[test]
fn set_up_drops_front_faces_where_only_backs_are_drawn() {
    let corners = CORNERS;
    let back = Primitive { keeps_back_faces_only: true, ..primitive([corners; 2], 0) };
    let [a, b, c] = corners;
    let front = Primitive { keeps_back_faces_only: true, ..primitive([[a, c, b]; 2], 1) };
    let (found, _, counts) = drawn(&[back, front], 8);
    assert_eq!(found.len(), 7);
    assert_eq!((counts[Event::TrianglesSetUp], counts[Event::TrianglesFaceCulled]), (1, 1));
    // Four differences and two products of each.
    assert_eq!(counts[Event::SetupMadds], 2 * 6);
}

/// Counting numbers give the same tiles and intervals as plain ones, in the same order, whatever the blocks.
#[test]
fn the_tiles_are_those_of_the_rasterizer() {
    let uniform = |n: u64| 12.0 * unit(mix(n)) - 2.0;
    let triangle = |n: u64| {
        let corner =
            |k: u64| [uniform(18 * n + 3 * k), uniform(18 * n + 3 * k + 1), uniform(18 * n + 3 * k + 2)];
        primitive([[0, 1, 2].map(corner), [3, 4, 5].map(corner)], n as u32 / 2)
    };
    let primitives: Vec<Primitive> = (0..200).map(triangle).collect();
    let mut expected = Vec::new();
    for primitive in &primitives {
        primitive
            .rasterizer
            .rasterize(&primitive.triangle, &GRID, |tile, touch| expected.push((tile, touch.z)));
    }
    for block in [1, 4, 8] {
        let (found, kinds, counts) = drawn(&primitives, block);
        assert_eq!(found, expected);
        assert_eq!(counts[Event::PixelInvocations], expected.len() as u64);
        assert!(kinds.len() > 200);
    }
}

/// Where no depths are found, the same tiles are there, and those that depths cull; u, v and t are as wide or wider.
#[test]
fn tiles_without_depths_have_those_with() {
    let uniform = |n: u64| 12.0 * unit(mix(n)) - 2.0;
    let view = View::Perspective { s: [2.0, -2.0], a: [0.5, -0.5], near: 0.25 };
    let mut culled = 0;
    for n in 0..300 {
        let corner = |k: u64| [0, 1, 2].map(|axis| uniform(18 * n + 3 * k + axis));
        let triangle = MovingTriangle::new([0, 1, 2].map(corner), [3, 4, 5].map(corner)).unwrap();
        let tiles = |rasterizer: Rasterizer| {
            let (mut tiles, mut madds) = (Vec::new(), 0);
            let each = |tile, touch: &Touch, work: &mut TileLoop| {
                madds += std::mem::take(work).depth_madds;
                tiles.push((tile, *touch));
            };
            let costs = Costs::default();
            let rest = rasterizer.rasterize_counted(&triangle, &GRID, [0..8, 0..8], &costs, each);
            (tiles, madds + rest.depth_madds)
        };
        let (with, madds) = tiles(Rasterizer::new(view));
        let (without, none) = tiles(Rasterizer::new(view).without_depths());
        assert!(madds > 0 && none == 0, "{n}");
        culled += without.len() - with.len();
        for (tile, touch) in with {
            let (_, wider) = without.iter().find(|(other, _)| *other == tile).unwrap();
            for ([lo, hi], [low, high]) in [(touch.u, wider.u), (touch.v, wider.v), (touch.t, wider.t)] {
                assert!(low <= lo && hi <= high, "{n} {tile:?}");
            }
            assert_eq!(wider.z, [0.25, f64::INFINITY], "{n}");
        }
    }
    assert!(culled > 0);
}

/// Lanes of a warp run in step: it takes as long as its longest lane, for each program that any of them runs.
/// Lanes of tiles in conservative mode have no helpers.
#[test]
fn lanes_of_a_full_screen_pass_wait_for_their_warp() {
    let quads = PipelineSpec { warp_lanes: 4, ..spec(Features::ALL) };
    let spec = spec(Features::ALL);
    let wait = |spec: &PipelineSpec, at: [u32; 2]| {
        let mut gpu = Gpu::without_packets(spec).unwrap();
        let drawn =
            gpu.shade_pixels("wait", Viewport::new(16, 8).unwrap(), Uses::default(), |lanes, pixel| {
                let ops = if pixel == at { 50 } else { 3 };
                lanes.run(|lane| (0..ops).for_each(|_| assert!(lane.add(1.0, 2.0) > 0.0)));
                Vec3::ZERO
            });
        drawn.unwrap().counts[Event::ShaderOps]
    };
    // One lane of 128 takes longer, and its quad or its warp of eight quads with it.
    assert_eq!(wait(&quads, [5, 3]), 3 * 124 + 4 * 50);
    assert_eq!(wait(&spec, [5, 3]), 3 * 96 + 32 * 50);
    let counts = |programs: fn([u32; 2]) -> Vec<u32>| {
        let mut gpu = Gpu::without_packets(&spec).unwrap();
        let drawn = gpu.shade_pixels("steps", Viewport::new(16, 8).unwrap(), Uses::default(), |lanes, at| {
            for ops in programs(at) {
                lanes.run(|lane| (0..ops).for_each(|_| assert!(lane.add(1.0, 2.0) > 0.0)));
            }
            Vec3::ZERO
        });
        let drawn = drawn.unwrap();
        [Event::PixelInvocations, Event::HelperInvocations, Event::ShaderOps].map(|event| drawn.counts[event])
    };
    assert_eq!(counts(|_| vec![3]), [128, 0, 3 * 128]);
    // A second program of three lanes of two quads.
    let second = |at: [u32; 2]| if [[0, 0], [1, 1], [8, 0]].contains(&at) { vec![3, 7] } else { vec![3] };
    assert_eq!(counts(second), [128 + 8, 8 - 3, 3 * 128 + 7 * 8]);
    // Lanes of a quad that run different programs take turns.
    let mut gpu = Gpu::without_packets(&spec).unwrap();
    let turns = gpu.shade_pixels("turns", Viewport::new(2, 2).unwrap(), Uses::default(), |lanes, [x, _]| {
        let adds = |lane: &Lane, count: u32| (0..count).for_each(|_| assert!(lane.add(1.0, 2.0) > 0.0));
        if x == 0 {
            lanes.run(|lane| adds(lane, 5))
        } else {
            lanes.run(|lane| adds(lane, 7))
        }
        Vec3::ZERO
    });
    assert_eq!(turns.unwrap().counts[Event::ShaderOps], 4 * 5 + 4 * 7);
    // Quads that run nothing are not started.
    assert_eq!(counts(|[x, _]| if x < 3 { vec![2] } else { vec![] }), [2 * 4 * 4, 8, 2 * 32]);
    let corners = CORNERS;
    let (found, _, counts) = drawn(&[primitive([corners; 2], 0)], 8);
    assert_eq!(counts[Event::PixelInvocations], found.len() as u64);
    assert_eq!(counts[Event::HelperInvocations], 0);
}

/// A program for every pixel writes every pixel once and counts its lanes.
#[test]
fn a_full_screen_pass_runs_every_pixel() {
    let spec = spec(Features::ALL);
    let viewport = Viewport::new(21, 13).unwrap();
    let mut gpu = Gpu::without_packets(&spec).unwrap();
    let source = gpu.allocate(4096);
    let drawn = gpu.shade_pixels("grey", viewport, Uses::default().reading([source]), |lanes, [x, y]| {
        lanes.fetch(source.address(), 4);
        lanes.run(|lane| Vec3::splat(lane.add(x as f32, y as f32)))
    });
    let (drawn, pixels) = (drawn.unwrap(), 21 * 13);
    // Three by two tiles of 256 bytes, of whose 24 lines those below the image hold no pixels.
    assert_eq!(
        [Event::ColourWrites, Event::ColourLines].map(|event| drawn.counts[event]),
        [pixels, 3 * 4 + 3 * 3]
    );
    assert_eq!(drawn.counts[Event::PixelsResolved], 0);
    // Quads of 2x2: eleven across and seven down, whose lanes beyond the image are helpers.
    let lanes = 4 * 11 * 7;
    assert_eq!((drawn.counts[Event::PixelInvocations], drawn.counts[Event::ShaderOps]), (lanes, lanes));
    assert_eq!(drawn.counts[Event::HelperInvocations], lanes - pixels);
    // Helpers fetch what their neighbours do, one line each.
    assert_eq!((drawn.counts[Event::TextureFetches], drawn.counts[Event::TextureLines]), (lanes, lanes));
    assert_eq!(drawn.into_image()[21 * 5 + 7], Vec3::splat(12.0));
}

/// Lanes of a quad share the lines of their n-th loads, as in passes of triangles; fetches of texels each access theirs.
/// A load is an operation and a fetch for each of its words.
#[test]
fn loads_of_a_quad_share_lines() {
    let (spec, viewport) = (spec(Features::ALL), Viewport::new(16, 8).unwrap());
    let read = |each: fn(&Lanes, u64)| {
        let mut gpu = Gpu::without_packets(&spec).unwrap();
        let source = gpu.allocate(4096);
        let uses = Uses::default().reading([source]);
        let drawn = gpu.shade_pixels("read", viewport, uses, |lanes, _| {
            lanes.run(|lane| {
                each(lanes, source.address());
                Vec3::splat(lane.add(1.0, 2.0))
            })
        });
        let counts = drawn.unwrap().counts;
        [Event::TextureFetches, Event::TextureLines, Event::ShaderOps].map(|event| counts[event])
    };
    assert_eq!(read(|lanes, at| lanes.fetch(at, 16)), [128, 128, 128]);
    assert_eq!(read(|lanes, at| lanes.load(at, 12)), [3 * 128, 3 * 32, 4 * 128]);
    // The third word is in the next line.
    assert_eq!(read(|lanes, at| lanes.load(at + 56, 12)), [3 * 128, 3 * 32, 4 * 128]);
    let thrice = |lanes: &Lanes, at| {
        lanes.load(at, 4);
        lanes.fetch(at, 4);
        lanes.load(at, 4);
    };
    assert_eq!(read(thrice), [3 * 128, 2 * 32 + 128, 3 * 128]);
}

/// A pass waits for those that write what it reads, with its tiles alone, and for those that read what it writes.
#[test]
fn dependencies_follow_from_the_uses() {
    let (spec, viewport) = (spec(Features::ALL), Viewport::new(16, 8).unwrap());
    let waits = |first: fn(MemoryRange) -> Uses, second: fn(MemoryRange) -> Uses| {
        let mut waits = Vec::new();
        let mut gpu = Gpu::new(&spec, |packet, _| {
            if let PacketKind::Barrier(of) = packet.kind {
                waits.push((packet.pass, of));
            }
        })
        .unwrap();
        let range = gpu.allocate(4096);
        gpu.begin_conservative("first", None, first(range)).unwrap();
        gpu.shade_pixels("second", viewport, second(range), |_, _| Vec3::ZERO).unwrap();
        drop(gpu);
        waits
    };
    let (reads, writes) = (|range| Uses::default().reading([range]), |range| Uses::default().depths([range]));
    assert_eq!(waits(writes, reads), [(1, Waits::Tiles)]);
    assert_eq!(waits(reads, writes), [(1, Waits::Tiles)]);
    assert_eq!(waits(reads, reads), []);
    // Each of the units of depth and colour works in order.
    let blends = |range| Uses::default().colours([range]);
    assert_eq!(waits(writes, writes), []);
    assert_eq!(waits(blends, blends), []);
    assert_eq!(waits(writes, blends), [(1, Waits::Tiles)]);
}

/// A pass that stores a target writes the lines that still hold the clear value, each once, and pixels of the pass do
/// not fetch them.
#[test]
fn stored_targets_are_written_whole() {
    let spec = spec(Features::ALL);
    let mut gpu = Gpu::without_packets(&spec).unwrap();
    let [target, vertices] = [64 * 64, 72].map(|bytes| gpu.allocate(bytes));
    let primitives = [primitive([CORNERS; 2], 0)];
    let draw = in_blocks_of_8(&primitives, vertices);
    let shader = Merge { target, runs: AtomicU32::new(0) };
    let mut pass = gpu.begin_conservative("boxes", None, Uses::default().depths([target])).unwrap();
    pass.draw(&mut gpu, &draw, &shader, |_, _| ()).unwrap();
    let reads = |gpu: &Gpu<'_>| gpu.counts_of_pass()[Event::L2Reads];
    let before = reads(&gpu);
    let read = pass.run_pixels(&mut gpu, Viewport::new(8, 8).unwrap(), |lanes, [x, y]| {
        lanes.read(target, u64::from(64 * (8 * y + x)) / 2, 4);
    });
    assert_eq!(read.map(|values| values.len()), Ok(64));
    assert_eq!(reads(&gpu), before, "cleared lines are not fetched");
    let lines = gpu.counts_of_pass()[Event::DepthLines];
    pass.store(&mut gpu, target).unwrap();
    assert_eq!(gpu.counts_of_pass()[Event::DepthLines] - lines, 63, "all lines but that of the triangle");
    pass.store(&mut gpu, target).unwrap();
    assert_eq!(gpu.counts_of_pass()[Event::DepthLines] - lines, 63);
    gpu.keep(target);
    assert_eq!(gpu.finish().counts()[Event::DramWriteBytes], 64 * 64);
}

/// Vertices that an earlier pass wrote let the front end wait, too.
#[test]
fn written_vertices_are_waited_for() {
    let spec = spec(Features::ALL);
    let mut waits = Vec::new();
    let mut gpu = Gpu::new(&spec, |packet, _| {
        if let PacketKind::Barrier(of) = packet.kind {
            waits.push((packet.pass, of));
        }
    })
    .unwrap();
    let [target, vertices] = [64 * 4, 72].map(|bytes| gpu.allocate(bytes));
    let primitives = [primitive([CORNERS; 2], 0)];
    let draw = in_blocks_of_8(&primitives, vertices);
    let shader = Merge { target, runs: AtomicU32::new(0) };
    gpu.begin_conservative("vertices", None, Uses::default().depths([vertices])).unwrap();
    let mut pass = gpu.begin_conservative("triangles", None, Uses::default().depths([target])).unwrap();
    for _ in 0..2 {
        pass.draw(&mut gpu, &draw, &shader, |_, _| ()).unwrap();
    }
    // What the pass writes is still to be waited for.
    gpu.shade_pixels("read", Viewport::new(8, 8).unwrap(), Uses::default().reading([target]), |_, _| {
        Vec3::ZERO
    })
    .unwrap();
    drop(gpu);
    assert_eq!(waits, [(1, Waits::All), (2, Waits::Tiles)]);
}

/// Memory that a pass reads and writes, and accesses that it does not state, are errors.
#[test]
fn uses_are_checked() {
    let (spec, viewport) = (spec(Features::ALL), Viewport::new(8, 8).unwrap());
    let mut gpu = Gpu::without_packets(&spec).unwrap();
    let [range, other] = [(); 2].map(|()| gpu.allocate(256));
    let both = Uses::default().reading([other, range]).depths([range]);
    let refused = gpu.begin_conservative("light", None, both).unwrap_err();
    assert!(
        refused.to_string().starts_with("pass `light`: its texture unit reads the 256 bytes from address")
    );
    let mut run = |uses: Uses, each: fn(&Lanes, MemoryRange)| {
        let drawn = gpu.shade_pixels("look", viewport, uses, |lanes, _| {
            each(lanes, range);
            Vec3::ZERO
        });
        drawn.map(|_| ())
    };
    let unstated = Err(PassError::Unstated { pass: "look".to_owned(), line: range.address() });
    let (reads, targets) = (|| Uses::default().reading([range]), || Uses::default().depths([range, other]));
    for (uses, is_read) in [(Uses::default(), false), (reads(), true), (targets(), false)] {
        let expected = if is_read { Ok(()) } else { unstated.clone() };
        assert_eq!(run(uses.clone(), |lanes, range| lanes.load(range.address(), 4)), expected);
        assert_eq!(run(uses, |lanes, range| lanes.fetch(range.address(), 4)), expected);
    }
    for (uses, is_target) in [(Uses::default(), false), (reads(), false), (targets(), true)] {
        let expected = if is_target { Ok(()) } else { unstated.clone() };
        assert_eq!(run(uses.clone(), |lanes, range| lanes.merge(range, 0, 4)), expected);
        let colours = if is_target { unstated.clone() } else { expected };
        assert_eq!(run(uses, |lanes, range| lanes.blend(range, 0, 4)), colours);
    }
}

/// Runs a program of 2 + column operations for every tile, and then one of 100.
struct TwoPrograms;

impl TileShader for TwoPrograms {
    type BodyState = ();
    type Output = [u32; 2];

    fn run(&self, (): &mut (), lanes: &Lanes, tile: &TileIntervals<'_>) -> Option<[u32; 2]> {
        let adds = |lane: &Lane, count: u32| (0..count).for_each(|_| assert!(lane.add(1.0, 2.0) > 0.0));
        lanes.run(|lane| adds(lane, 2 + tile.tile[0]));
        lanes.run(|lane| adds(lane, 100));
        Some(tile.tile)
    }
}

/// Lanes of a packet share warps with those of their program alone, and wait for the longest.
#[test]
fn lanes_of_tiles_wait_for_those_of_their_program() {
    let corners = CORNERS;
    let primitives = [primitive([corners; 2], 0)];
    let ops = |warp_lanes: u32| {
        let spec = PipelineSpec { warp_lanes, ..spec(Features::ALL) };
        let (mut gpu, mut tiles) = (Gpu::without_packets(&spec).unwrap(), Vec::new());
        let vertices = gpu.allocate(72);
        let draw = in_blocks_of_8(&primitives, vertices);
        let mut pass = gpu.begin_conservative("two", None, Uses::default()).unwrap();
        pass.draw(&mut gpu, &draw, &TwoPrograms, |_, tile| tiles.push(tile)).unwrap();
        assert_eq!(tiles.len(), 7);
        (tiles, gpu.finish().counts()[Event::ShaderOps])
    };
    let (tiles, alone) = ops(1);
    let own: u64 = tiles.iter().map(|[column, _]| 2 + u64::from(*column)).sum();
    assert_eq!(alone, own + 7 * 100);
    let longest = tiles.iter().map(|[column, _]| 2 + u64::from(*column)).max().unwrap();
    assert_eq!(ops(32).1, 7 * longest + 7 * 100);
    assert!(7 * longest > own);
}

/// What happens on tiles is on the heat maps where the tiles are in the image, evenly over their pixels: here
/// in its right half, the first row below.
#[test]
fn heat_maps_have_the_work_on_tiles_in_their_pixels() {
    let corners = CORNERS;
    let primitives =
        [primitive([corners; 2], 0), primitive([corners.map(|[x, y, z]| [x + 3.0, y, z]); 2], 1)];
    let (spec, viewport) = (spec(Features::ALL), Viewport::new(40, 24).unwrap());
    for block in [1, 3, 8] {
        let mut gpu = Gpu::without_packets(&spec).unwrap().with_heat(&Event::ALL, viewport);
        let [target, vertices] = [64 * 4, 3 * 24 * 2].map(|bytes| gpu.allocate(bytes));
        let shader = Merge { target, runs: AtomicU32::new(0) };
        let placement = Placement { first: [0.5, 1.0], last: [1.0, 0.0] };
        let mut pass =
            gpu.begin_conservative("boxes", Some(placement), Uses::default().depths([target])).unwrap();
        let draw = ConservativeDraw {
            primitives: &primitives,
            grid: &GRID,
            block,
            vertices,
            vertex_bytes: 24,
            projection: None,
        };
        pass.draw(&mut gpu, &draw, &shader, |_, _| ()).unwrap();
        let report = gpu.finish();
        let counts = report.counts();
        for map in &report.heat {
            assert_eq!(map.total(), counts[map.event], "{:?}", map.event);
            let pixels: f64 = map.pixels().iter().map(|&value| f64::from(value)).sum();
            assert!((pixels - (map.total() - map.elsewhere) as f64).abs() < 1e-3, "{:?}", map.event);
        }
        let map = |event| report.heat.iter().find(|map| map.event == event).unwrap();
        for event in [
            Event::PixelInvocations,
            Event::ShaderOps,
            Event::TilesVisited,
            Event::TileMadds,
            Event::DepthLines,
        ] {
            assert!(map(event).total() > 0 && map(event).elsewhere == 0, "{event:?} {block}");
        }
        assert_eq!(map(Event::Draws).elsewhere, 1);
        let runs = map(Event::PixelInvocations).pixels();
        let hot = (0..24 * 40).filter(|at| runs[*at] > 0.0).map(|at| [at % 40, at / 40]);
        let hot: Vec<[usize; 2]> = hot.collect();
        // Fine tiles of 8 pixels; the triangles are in the first two of as many rows as there are.
        let high = 24 / GRID.rows as usize * 2;
        assert!(
            hot.iter().all(|[x, y]| *x >= 16 && *y + high.next_multiple_of(8).max(8 * block as usize) >= 24),
            "{hot:?}"
        );
        assert!(!hot.is_empty());
    }
}
