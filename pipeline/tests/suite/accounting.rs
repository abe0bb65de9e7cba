//! Accounting: the counters of a frame add up and are consistent.

use crate::common::*;
use activity::{Counts, Event, Packet, PacketKind, Unit};
use glam::{Vec2, Vec3};
use pipeline::depth::{DepthBound, DepthSpec};
use pipeline::memory::{CacheSpec, Compression, MemorySpec};
use pipeline::*;
use proptest::prelude::*;

/// All combinations of enabled tests.
fn switches() -> Vec<Features> {
    (0..SWITCHES).map(switched).collect()
}

/// Packets and counts of a frame, and the number of its samples that see a triangle.
struct Frame {
    packets: Vec<Packet>,
    counts: Counts,
    visible: u64,
    samples: u64,
    pixels: u64,
    /// Boxes of lens and time of a tile.
    boxes: u64,
}

fn frame(draws: &[Draw<'_>], lens: bool, features: Features) -> Frame {
    frame_with(draws, lens, &spec(features))
}

fn frame_with(draws: &[Draw<'_>], lens: bool, spec: &PipelineSpec) -> Frame {
    let table = SampleTable::low_discrepancy(4, 3, LensShape::Disk).unwrap();
    let viewport = Viewport::new(70, 50).unwrap();
    let settings = Settings { spec, viewport, samples: &table, background: Vec3::ZERO };
    let mut packets = Vec::new();
    let rendered =
        RasterPass::new(&camera(lens), draws, &settings).render(|packet, _| packets.push(*packet)).unwrap();
    let seen = RasterPass::new(&camera(lens), draws, &settings).visibility().unwrap();
    Frame {
        packets,
        counts: rendered.counts,
        visible: seen.iter().filter(|(id, _)| *id != u32::MAX).count() as u64,
        samples: seen.len() as u64,
        pixels: 3500,
        boxes: spec.depth.boxes.iter().map(|&count| u64::from(count)).product(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn the_counters_of_a_frame_agree_with_each_other(
        kind in kinds(), lens: bool, front: bool, textured: bool, count in 1..150_u32, switch: prop::sample::Index, seed: u64,
    ) {
        let (soup, other) = (Soup::new(kind, count, seed), Soup::new(SoupKind::Still, 20, seed));
        let uvs: Vec<_> = soup.open.iter().map(|p| Vec2::new(p.x, p.y)).collect();
        let texels = (0..256_u32).map(|i| [i as u8, 255 - i as u8, 7, 255]).collect();
        let checkered = Textured(Texture::from_srgb8(16, 16, texels, [Wrap::Repeat; 2]).unwrap());
        let cull = if front { Cull::Back } else { Cull::None };
        let mut first = soup.draw(if textured { &checkered } else { &Plain }, cull);
        first.geometry = first.geometry.with_uvs(&uvs).unwrap();
        let features = *switch.get(&switches());
        let frame = frame(&[first, other.draw(&Plain, Cull::Front)], lens, features);
        agree(&frame);
        prop_assert_eq!(frame.counts[Event::Draws], 2);
        prop_assert_eq!(frame.counts[Event::TrianglesIn], u64::from(count) + 20);
        prop_assert_eq!(frame.counts.uses(Unit::Texture), textured && frame.packets.iter().any(
            |p| p.kind == PacketKind::Tile && p.triangle < count && p.counts[Event::QuadsShaded] > 0));
        let moving = kind != SoupKind::Still && frame.counts[Event::SamplesTested] > 0;
        let (least, most) = (sample_madds(false, lens), sample_madds(moving, lens));
        let (tested, madds) = (frame.counts[Event::SamplesTested], frame.counts[Event::SampleMadds]);
        prop_assert!((least * tested..=most * tested).contains(&madds), "{} {}", madds, tested);
    }

    /// Tests save work and change nothing: another test leaves at most as many samples to test, and the
    /// writes are the same. (Edges and screens linearize over their box. Over a smaller box the linear edges
    /// differ; usually they are tighter, but not for every sample. So counts of one frame are compared only
    /// if at most one of the two has them.)
    #[test]
    fn enabling_a_test_adds_no_sample_tests(
        kind in kinds(), lens: bool, count in 1..100_u32, seed: u64, pairs in prop::collection::vec((0..SWITCHES, 0..SWITCHES.ilog2()), 10),
    ) {
        let soup = Soup::new(kind, count, seed);
        for (switches, bit) in pairs {
            let ((more, a), (less, b)) = one_apart(&soup, lens, switches, bit);
            prop_assert!(a[Event::SamplesTested] <= looked_at(&more, &a));
            if !(more.edges && less.edges) || more.z_max != less.z_max {
                prop_assert!(looked_at(&more, &a) <= looked_at(&less, &b), "{:?} {:?}", more, less);
            }
            if more.screen != less.screen {
                prop_assert!(a[Event::SamplesTested] <= b[Event::SamplesTested], "{:?} {:?}", more, less);
            }
            prop_assert_eq!(a[Event::DepthWrites], b[Event::DepthWrites], "{:?} {:?}", more, less);
            if !more.z_max && !less.z_max {
                prop_assert_eq!(a[Event::SamplesHit], b[Event::SamplesHit], "{:?} {:?}", more, less);
            }
        }
    }
}

/// Counts of a soup with and without the test of `bit`.
fn one_apart(soup: &Soup, lens: bool, switches: u32, bit: u32) -> ((Features, Counts), (Features, Counts)) {
    let counts = |switches: u32| {
        let features = switched(switches);
        (features, frame(&[soup.draw(&Plain, Cull::None)], lens, features).counts)
    };
    (counts(switches | 1 << bit), counts(switches & !(1 << bit)))
}

/// Samples left after the tile tests.
fn looked_at(features: &Features, counts: &Counts) -> u64 {
    counts[if features.screen { Event::SamplesScreened } else { Event::SamplesTested }]
}

/// Where edges linearize over the boxes left by other tests, these tests save samples over many frames, if
/// not in each one.
#[test]
fn beside_edges_a_test_saves_samples_over_many_frames() {
    let edges = switched(SWITCHES - 1);
    assert!(edges.edges && edges.screen);
    for bit in (0..SWITCHES.ilog2()).filter(|&bit| switched(1 << bit).z_max || !switched(1 << bit).edges) {
        let mut totals = [0; 2];
        for (seed, kind) in SoupKind::ALL.iter().copied().cycle().take(10 * SoupKind::ALL.len()).enumerate() {
            let (more, less) = one_apart(&Soup::new(kind, 60, seed as u64), seed % 2 == 0, SWITCHES - 1, bit);
            for (total, (features, counts)) in totals.iter_mut().zip([more, less]) {
                *total += looked_at(&features, &counts);
            }
        }
        assert!(totals[0] <= totals[1], "{:?}: {totals:?}", switched(1 << bit));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]
    /// All depth settings give the same writes; finer boxes and tighter bounds test at most as many samples.
    #[test]
    fn depth_settings_save_work_and_change_nothing(
        kind in kinds(), lens: bool, count in 1..120_u32, boxes in (1..=4_u32, 1..=4_u32, 1..=8_u32), z_min: bool, seed: u64,
    ) {
        let soup = Soup::new(kind, count, seed);
        let draws = [soup.draw(&Plain, Cull::None)];
        let with = |bound, boxes, z_min| {
            let spec = PipelineSpec { depth: DepthSpec { bound, boxes, z_min }, ..spec(Features::ALL) };
            let frame = frame_with(&draws, lens, &spec);
            agree(&frame);
            frame.counts
        };
        let plain = with(DepthBound::VerticesInTime, [1; 3], false);
        let boxes = [boxes.0, boxes.1, boxes.2];
        let mut before = u64::MAX;
        for bound in DepthBound::ALL {
            let one = with(bound, [1; 3], z_min);
            let many = with(bound, boxes, z_min);
            for counts in [&one, &many] {
                prop_assert_eq!(counts[Event::DepthWrites], plain[Event::DepthWrites]);
                prop_assert_eq!(counts[Event::QuadsShaded], plain[Event::QuadsShaded]);
                prop_assert!(z_min || counts[Event::DepthReadsSkipped] + counts[Event::ZMinUpdates] == 0);
            }
            prop_assert!(many[Event::SamplesTested] <= one[Event::SamplesTested], "{:?}", bound);
            if bound != DepthBound::LocalPlanes {
                prop_assert!(one[Event::SamplesTested] <= before, "{:?}", bound);
                before = one[Event::SamplesTested];
            }
        }
    }
}

/// Multiply-adds of one sample test, counted by hand: two per vertex to translate it to the sample, three
/// more to move it, two more to shear it; two per edge; six for the depth.
fn sample_madds(moving: bool, lens: bool) -> u64 {
    3 * (2 + 3 * u64::from(moving) + 2 * u64::from(lens)) + 3 * 2 + 6
}

/// Invariants of every frame.
fn agree(frame: &Frame) {
    let mut sum = Counts::default();
    frame.packets.iter().for_each(|packet| sum += &packet.counts);
    assert_eq!(sum, frame.counts, "packets add up to the counts");
    let n = |event: Event| frame.counts[event];
    let boxes = frame.boxes;
    use Event as E;
    let equal = [
        (
            "a tile test is of one kind",
            n(E::TileMadds),
            n(E::LensLineMadds)
                + n(E::SidePlaneMadds)
                + n(E::EdgeMadds)
                + n(E::FacingMadds)
                + n(E::EdgeBoundMadds)
                + n(E::ScreenSetupMadds),
        ),
        ("every nearer hit has a colour", n(E::ColourWrites), n(E::DepthWrites)),
        ("and asks for it", n(E::ShadingLookups), n(E::DepthWrites)),
        ("a look-up hits or shades", n(E::ShadingHits) + n(E::QuadsShaded), n(E::ShadingLookups)),
        ("a quad has four lanes", n(E::PixelInvocations), 4 * n(E::QuadsShaded)),
        ("three indices a triangle", n(E::Indices), 3 * n(E::TrianglesIn)),
        ("what is fetched is shaded", n(E::VertexInvocations), n(E::VerticesFetched)),
        (
            "a triangle goes on or is dropped for one reason",
            n(E::TrianglesIn),
            n(E::TrianglesSetUp)
                + n(E::TrianglesDegenerate)
                + n(E::TrianglesOutside)
                + n(E::TrianglesFaceCulled),
        ),
        (
            "a hit is compared or known to be in front",
            n(E::DepthReads) + n(E::DepthReadsSkipped),
            n(E::SamplesHit),
        ),
        ("every pixel is resolved", n(E::PixelsResolved), frame.pixels),
        ("a line is 64 bytes", n(E::DramReadBytes) % 64 + n(E::DramWriteBytes) % 64, 0),
    ];
    for (what, left, right) in equal {
        assert_eq!(left, right, "{what}");
    }
    let at_most = [
        ("hits are among the tested", n(E::SamplesHit), n(E::SamplesTested)),
        ("writes are among the hits", n(E::DepthWrites), n(E::SamplesHit)),
        ("what is visible was written", frame.visible, n(E::DepthWrites)),
        (
            "culled tiles are among the visited",
            n(E::TilesCulledLens) + n(E::TilesCulledSides) + n(E::TilesCulledFacing) + n(E::TilesCulledEdges),
            n(E::CoarseTilesVisited) + n(E::TilesVisited),
        ),
        ("what is hidden was tested for it", n(E::TilesCulledZMax), n(E::ZCullTests)),
        ("every box of it", n(E::BoxesCulledZMax), n(E::ZCullTests)),
        ("and visited", n(E::ZCullTests), boxes * n(E::TilesVisited)),
        ("a box is renewed for tests", n(E::ZMaxUpdates), boxes * n(E::ZCullTests)),
        ("a box comes nearer by a write", n(E::ZMinUpdates), n(E::DepthWrites)),
        ("what is in front is written", n(E::DepthReadsSkipped), n(E::DepthWrites)),
        ("a quad has a lane that is covered", n(E::HelperInvocations), 3 * n(E::QuadsShaded)),
        ("vertices are fetched for indices", n(E::VerticesFetched), n(E::Indices)),
        ("a miss is an access", n(E::DepthMisses), n(E::DepthLines)),
        ("a miss is an access", n(E::ColourMisses), n(E::ColourLines)),
        ("a miss is an access", n(E::TextureMisses), n(E::TextureLines)),
        ("a miss is an access", n(E::L2Misses), n(E::L2Reads) + n(E::L2Writes)),
        ("a fetch has four texels", n(E::TextureLines), 4 * n(E::TextureFetches)),
        ("each read of memory is a miss", n(E::DramReadBytes), 64 * n(E::L2Misses)),
        ("samples resolved are those there are", n(E::SamplesResolved), frame.samples),
        ("what is seen is resolved", frame.visible, n(E::SamplesResolved)),
        ("a line read holds a sample", n(E::DepthLines), n(E::SamplesHit)),
    ];
    for (what, less, more) in at_most {
        assert!(less <= more, "{what}: {less} of {more}");
    }
    frame.packets.iter().for_each(stays_in_its_units);
}

/// A packet causes events, and only in units of its kind.
fn stays_in_its_units(packet: &Packet) {
    use Unit as U;
    let units: &[Unit] = match packet.kind {
        PacketKind::Draw => &[U::Command],
        PacketKind::Vertices => &[U::Command, U::Shader, U::Setup, U::L2, U::Dram],
        PacketKind::Tile => &[
            U::Traversal,
            U::ZCull,
            U::SampleTest,
            U::Depth,
            U::ShadingCache,
            U::Shader,
            U::Texture,
            U::Colour,
            U::L2,
            U::Dram,
        ],
        PacketKind::Resolve => &[U::Colour, U::L2, U::Dram],
        PacketKind::Compute => &[U::Shader, U::Compute, U::L2, U::Dram],
        PacketKind::Barrier(_) => &[U::Depth, U::Colour, U::L2, U::Dram],
    };
    assert!(Unit::ALL.iter().all(|unit| !packet.counts.uses(*unit) || units.contains(unit)), "{packet:?}");
    assert!(Unit::ALL.iter().any(|unit| packet.counts.uses(*unit)), "nothing happens in {packet:?}");
    let [hit, tested] = [Event::SamplesHit, Event::SamplesTested].map(|event| packet.counts[event]);
    assert!(hit <= tested && tested <= 64 * 4, "{packet:?}");
    let [skipped, written] = [Event::DepthReadsSkipped, Event::DepthWrites].map(|event| packet.counts[event]);
    assert!(skipped == 0 || (skipped == hit && hit == written), "not all in front: {packet:?}");
}

#[test]
fn an_empty_frame_is_resolved_and_nothing_else() {
    let frame = frame(&[], false, Features::ALL);
    for (event, count) in frame.counts.iter().filter(|(_, count)| *count > 0) {
        assert!([Unit::Colour, Unit::L2, Unit::Dram].contains(&event.unit()), "{}: {count}", event.name());
    }
    assert_eq!(frame.counts[Event::PixelsResolved], 3500);
    assert_eq!(frame.counts[Event::SamplesResolved], 0);
}

/// A vertex is fetched again after enough others.
#[test]
fn vertices_are_reused_first_in_first_out() {
    let corners: Vec<_> =
        (0..40).map(|i| Vec3::new((i % 7) as f32, (i % 5) as f32 * 0.9, 4.0 + i as f32)).collect();
    let strip: Vec<_> = (0..38).map(|i| [i, i + 1, i + 2]).collect();
    let back_to_the_start = [strip.clone(), vec![[0, 39, 1]]].concat();
    for (triangles, fetched) in [(strip, 40), (back_to_the_start, 42)] {
        let geometry = Geometry::new(&corners, &corners, &triangles).unwrap();
        let counts = frame(&[Draw::new(geometry, &Plain, Cull::None)], false, Features::ALL).counts;
        assert_eq!(counts[Event::VerticesFetched], fetched);
    }
}

/// Counts of a soup with small caches, with or without compression, and its image.
fn compressed(soup: &Soup, lens: bool, compression: Compression) -> (Counts, Vec<Vec3>) {
    let small = CacheSpec::lru(8, 4);
    let l2 = CacheSpec::lru(32, 4);
    let memory = MemorySpec {
        depth: small,
        colour: small,
        texture: small,
        bins: None,
        l2,
        llc: None,
        edram: None,
        compression,
    };
    let spec = PipelineSpec { memory, ..spec(Features::ALL) };
    let table = SampleTable::low_discrepancy(8, 3, LensShape::Disk).unwrap();
    let viewport = Viewport::new(70, 50).unwrap();
    let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
    let rendered = RasterPass::new(&camera(lens), &[soup.draw(&Plain, Cull::None)], &settings)
        .render(|_, _| {})
        .unwrap();
    (rendered.counts, rendered.into_image())
}

const NOTHING: Compression = Compression { depth: false, colour: false };

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]
    /// Compression changes memory traffic only.
    #[test]
    fn compression_changes_traffic_alone(kind in kinds(), lens: bool, seed: u64, depth: bool, colour: bool) {
        let soup = Soup::new(kind, 40, seed);
        let (plain, image) = compressed(&soup, lens, NOTHING);
        let (found, same) = compressed(&soup, lens, Compression { depth, colour });
        prop_assert_eq!(image, same);
        for event in Event::ALL.into_iter().filter(|event| !matches!(event.unit(), Unit::L2 | Unit::Dram)) {
            prop_assert_eq!(found[event], plain[event], "{}", event.name());
        }
        prop_assert_eq!(found[Event::L2Reads], plain[Event::L2Reads]);
    }
}

/// Slightly tilted walls that fill the image, each nearer than the one before, optionally moving sideways.
fn walls(moving: bool) -> Soup {
    let mut open = Vec::new();
    for wall in 0..8_u8 {
        let at = |x, y| Vec3::new(x, y, 12.0 - f32::from(wall) + 0.01 * x);
        open.extend([at(-40.0, -20.0), at(40.0, -20.0), at(0.0, 60.0)]);
    }
    let close = open.iter().map(|p| if moving { *p + Vec3::X } else { *p }).collect();
    Soup { open, close, triangles: (0..8).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect() }
}

/// Large still surfaces compress to half, except for the image. Moving ones have different shading in every
/// sample of a pixel.
#[test]
fn similar_pixels_compress() {
    let moved = |moving, depth, colour| {
        let bytes = |compression| {
            let (counts, _) = compressed(&walls(moving), false, compression);
            counts[Event::DramReadBytes] + counts[Event::DramWriteBytes]
        };
        bytes(Compression { depth, colour }) as f64 / bytes(NOTHING) as f64
    };
    let [depth, colour, both] = [(true, false), (false, true), (true, true)].map(|(d, c)| moved(false, d, c));
    assert!((0.7..0.85).contains(&depth) && (0.7..0.85).contains(&colour), "{depth} {colour}");
    assert!((0.5..0.6).contains(&both), "{both}");
    assert_eq!(moved(true, false, true), 1.0);
}
