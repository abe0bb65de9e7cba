//! Accounting: the counters of a scene small enough to count by hand.

use crate::common::*;
use activity::{Counts, Event, Packet, PacketKind, Unit};
use glam::{Vec3, Vec4};
use pipeline::*;

/// Packets and counts of a frame.
struct Counted {
    packets: Vec<Packet>,
    counts: Counts,
}

/// A quad over an image of 32x32 pixels, 8 samples each; its diagonal passes through the corners of the
/// diagonal tiles.
fn two_triangles(features: Features) -> Counted {
    rectangle_of([-20.0, 20.0], [-20.0, 20.0], features)
}

fn rectangle_of(x: [f32; 2], y: [f32; 2], features: Features) -> Counted {
    let viewport = Viewport::new(32, 32).unwrap();
    let corners = rectangle(x, y, 2.0);
    let geometry = Geometry::new(&corners, &corners, &QUAD).unwrap();
    let draws = [Draw::new(geometry, &Flat(Vec3::ONE), Cull::None)];
    let table = SampleTable::low_discrepancy(8, 3, LensShape::Disk).unwrap();
    let spec = spec(features);
    let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
    let mut packets = Vec::new();
    let counts = RasterPass::new(&pixel_camera(viewport, 0.25), &draws, &settings)
        .render(|p, _| packets.push(*p))
        .unwrap()
        .counts;
    Counted { packets, counts }
}

fn expect(counts: &Counts, expected: &[(Event, u64)]) {
    for &(event, count) in expected {
        assert_eq!(counts[event], count, "{}", event.name());
    }
}

/// Counts that do not depend on the enabled tests.
const BY_HAND: [(Event, u64); 25] = [
    (Event::Draws, 1),
    (Event::Indices, 6),
    (Event::VerticesFetched, 4),
    (Event::VertexBytes, 4 * 12),
    (Event::VertexInvocations, 4),
    (Event::TrianglesIn, 2),
    (Event::TrianglesSetUp, 2),
    (Event::SetupMadds, 0),
    (Event::CoarseTilesVisited, 2),
    (Event::TilesVisited, 2 * 16),
    (Event::SamplesHit, 8192),
    (Event::DepthWrites, 8192),
    // Each triangle has its own quads; those on the diagonal are requested by both.
    (Event::QuadsShaded, 256 + 16),
    (Event::PixelInvocations, 4 * (256 + 16)),
    // On the diagonal each triangle requests three lanes: every pixel of it has samples on both sides.
    (Event::HelperInvocations, 2 * 16),
    // A vertex: nine multiply-adds to the camera, scale and shift of two axes. A lane of the shader: four.
    (Event::ShaderOps, 4 * 13 + 4 * (256 + 16) * 4),
    // Two pixels per line: 32 lines of each of the 12 tiles off the diagonal, 20 for each triangle of each of
    // the 4 on it.
    (Event::DepthLines, 12 * 32 + 4 * 2 * 20),
    // The same lines written, then read with the 4 lines of each tile of the image to resolve.
    (Event::ColourLines, 12 * 32 + 4 * 2 * 20 + 16 * (32 + 4)),
    (Event::SamplesResolved, 8192),
    (Event::PixelsResolved, 1024),
    // The vertices fill one line and so do the indices; cleared lines are not read, and only the image is
    // written back.
    (Event::DramReadBytes, 2 * 64),
    (Event::DramWriteBytes, 4 * 1024),
    (Event::TextureFetches, 0),
    (Event::TextureLines, 0),
    (Event::TilesCulledZMax, 0),
];

#[test]
fn two_triangles_counted_by_hand() {
    let bare = two_triangles(Features::NONE);
    agree_by_hand(&bare);
    expect(&bare.counts, &BY_HAND);
    expect(
        &bare.counts,
        &[
            (Event::SamplesTested, 2 * 8192),
            (Event::SampleMadds, 2 * 8192 * 18),
            (Event::TileMadds, 0),
            (Event::TilesCulledSides, 0),
            (Event::TilesCulledEdges, 0),
            (Event::ZCullTests, 0),
            (Event::DepthIntervalMadds, 0),
        ],
    );
    // Edges alone: a tile whose corner touches the diagonal is kept, so each triangle loses three of its six.
    let edges = two_triangles(Features { edges: true, ..Features::NONE });
    agree_by_hand(&edges);
    expect(&edges.counts, &BY_HAND);
    expect(
        &edges.counts,
        &[
            (Event::TilesCulledEdges, 2 * 3),
            (Event::SamplesTested, 2 * 13 * 64 * 8),
            (Event::SampleMadds, 2 * 13 * 64 * 8 * 18),
        ],
    );
    let depth = two_triangles(Features { z_max: true, ..Features::NONE });
    agree_by_hand(&depth);
    expect(&depth.counts, &BY_HAND);
    // One test per triangle and tile; the farthest depth is recomputed after the writes of the first
    // triangle, in 10 tiles.
    expect(&depth.counts, &[(Event::ZCullTests, 32), (Event::ZMaxUpdates, 10)]);
}

fn agree_by_hand(frame: &Counted) {
    let kinds = |kind| frame.packets.iter().filter(|packet| packet.kind == kind).count();
    assert_eq!([kinds(PacketKind::Draw), kinds(PacketKind::Vertices)], [1, 1]);
    let mut sum = Counts::default();
    frame.packets.iter().for_each(|packet| sum += &packet.counts);
    assert_eq!(sum, frame.counts);
}

#[test]
fn a_still_pinhole_scene_uses_no_time_and_no_lens() {
    let frame = two_triangles(Features { edges: false, ..Features::ALL });
    assert!(!frame.counts.uses(Unit::Texture));
    // Still, in focus and in front of the camera: no side plane, no depth interval, no time and no lens.
    let idle = [Event::SetupMadds, Event::DepthIntervalMadds, Event::TilesCulledSides];
    expect(&frame.counts, &idle.map(|event| (event, 0)));
    assert_eq!(frame.counts[Event::SampleMadds], 18 * frame.counts[Event::SamplesTested]);
}

/// One pixel, halved by the diagonal: each triangle requests a quad for one lane and three helpers.
#[test]
fn a_single_pixel_has_three_helpers() {
    let frame = rectangle_of([3.0, 4.0], [7.0, 8.0], Features::ALL);
    agree_by_hand(&frame);
    let hits = [Event::SamplesHit, Event::DepthReads, Event::ColourWrites, Event::ShadingLookups];
    expect(&frame.counts, &hits.map(|event| (event, 8)));
    expect(&frame.counts, &[(Event::QuadsShaded, 2), (Event::HelperInvocations, 6), (Event::ShadingHits, 6)]);
}

/// Counts to the column of the pixel, counted from the left of the image.
struct Columns;

impl Shader for Columns {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        let mut column = 0.0;
        while lane.branch(column < at.position.x + 16.0) {
            column = lane.add(column, 1.0);
        }
        Vec4::splat(column)
    }
}

/// One triangle covers the image. The loop runs column + 1 times. Eight quads are a warp: two rows of quads
/// of a tile, all of which take as long as its last column, or two quads with four samples each, which take
/// as long as the second. Warps of a quad take as long as its second column.
#[test]
fn lanes_of_a_warp_take_as_long_as_the_longest() {
    let viewport = Viewport::new(32, 32).unwrap();
    let corners = [[-100.0, -100.0], [100.0, -100.0], [0.0, 200.0]].map(|[x, y]| Vec3::new(x, y, 1.0));
    let geometry = Geometry::new(&corners, &corners, &[[0, 1, 2]]).unwrap();
    let draws = [Draw::new(geometry, &Columns, Cull::None)];
    let table = SampleTable::low_discrepancy(4, 3, LensShape::Disk).unwrap();
    let of_quad = |quad: u64| 4 * (2 * (2 * quad + 2) + 1);
    let (cached, sampled) = ((Shading::Cached, 1), (Shading::PerSample, 4));
    for ((shading, runs), warp_lanes) in [(cached, 4), (cached, 32), (sampled, 4), (sampled, 32)] {
        let spec = PipelineSpec { shading, warp_lanes, ..spec(Features::ALL) };
        let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
        let pass =
            RasterPass::new(&pixel_camera(viewport, 0.25), &draws, &settings).render(|_, _| ()).unwrap();
        // Columns of quads in a warp.
        let across = if warp_lanes == 4 { 1 } else { 4 / runs.min(2) };
        let longest = |quad: u64| quad / across * across + across - 1;
        let expected = 3 * 13 + 16 * runs * (0..16).map(|quad| of_quad(longest(quad))).sum::<u64>();
        if shading == Shading::Cached {
            assert_eq!(pass.counts[Event::ShaderOps], expected);
            assert_eq!(pass.images[0][5].x, 6.0);
        } else {
            // Samples of a pixel lie on both sides of its middle, so some loops are one step shorter.
            let steps = 16 * 16 * runs * 4 * 2;
            assert!((expected - steps..=expected).contains(&pass.counts[Event::ShaderOps]));
        }
    }
}
