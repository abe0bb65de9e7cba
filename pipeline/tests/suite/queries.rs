//! Occlusion queries by samples: passes of a frame that count what all samples give, and end early where they may.

use activity::{Counts, Event, LineAccess, Packet, Unit};
use glam::Vec3;
use pipeline::depth::{BoxGrid, Pyramid};
use pipeline::geometry::Projection;
use pipeline::*;
use proptest::prelude::*;

use crate::common::stage::*;
use crate::common::*;

/// What a pass of queries over the stored depths of an earlier pass gives.
struct Queried {
    passed: Vec<u64>,
    draws: Vec<Counts>,
    packets: Vec<(Packet, Vec<LineAccess>)>,
}

/// Draws `occluders` onto a surface, and then `queries` against it.
fn query(stage: &Stage, occluders: &[Draw<'_>], queries: &[Draw<'_>]) -> Queried {
    let (spec, mut packets) = (spec(Features::ALL), Vec::new());
    let settings =
        Settings { spec: &spec, viewport: stage.viewport, samples: &stage.table, background: Vec3::ZERO };
    let mut gpu = Gpu::new(&spec, |packet, lines| packets.push((*packet, lines.to_vec()))).unwrap();
    let samples = stage.table.per_pixel();
    let depth = gpu.create_surface(&SurfaceSpec::new("depths", stage.viewport, Format::D32).sampled(samples));
    let onto = |to| Attachments { colours: Vec::new(), depth: Some(to) };
    let (stored, loaded) =
        (onto(Attachment::cleared(depth, Clear::default())), onto(Attachment::loaded(depth)));
    gpu.draw(&RasterPass::new(&stage.camera, occluders, &settings).onto(Target::Surfaces(&stored))).unwrap();
    let before = gpu.contents(depth);
    let pass = RasterPass::new(&stage.camera, queries, &settings).onto(Target::Surfaces(&loaded));
    let passed = gpu.draw(&pass).unwrap().passed;
    assert_eq!(gpu.contents(depth), before, "a query stores nothing");
    let draws = gpu.finish().passes.remove(1).draws;
    Queried { passed, draws, packets }
}

/// Still or moving rectangles at random.
fn rectangles(r: &mut Uniform, count: usize) -> Vec<[[Vec3; 4]; 2]> {
    let one = |_| {
        let (x, y, z) = (r.within(-24.0, 16.0), r.within(-16.0, 12.0), r.within(0.5, 4.0));
        let [wide, high] = [r.within(1.0, 24.0), r.within(1.0, 20.0)];
        let moved = if r.next() < 0.5 { Vec3::ZERO } else { Vec3::new(r.within(-9.0, 9.0), 0.0, 0.2) };
        let open = rectangle([x, x + wide], [y, y + high], z);
        [open, open.map(|p| p + moved)]
    };
    (0..count).map(one).collect()
}

/// Samples of `draw` that pass `test` against the depths of `occluders`, by comparing all of them.
fn brute(stage: &Stage, occluders: &[Draw<'_>], draw: &Draw<'_>, test: Compare) -> u64 {
    let (stored, new) = (stage.see(occluders), stage.see(&[*draw]));
    let pairs = stored.iter().zip(&new);
    pairs.filter(|(stored, new)| new.2 != u32::MAX && test.holds(new.3, stored.3)).count() as u64
}

fn tests(counts: &Counts) -> u64 {
    [Event::SamplesTested, Event::SamplesScreened, Event::TilesVisited, Event::ZCullTests, Event::DepthReads]
        .iter()
        .map(|event| counts[*event])
        .sum()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Both kinds of query agree with all samples, and an early end saves work or changes nothing.
    #[test]
    fn queries_agree_with_all_samples(seed in any::<u64>(), per_pixel in prop_oneof![Just(1_u32), Just(4), Just(8)]) {
        let (stage, mut r) = (Stage::sampled(45, 35, per_pixel), Uniform::new(seed));
        let (walls, queried) = (rectangles(&mut r, 6), rectangles(&mut r, 6));
        let walls: Vec<Draw<'_>> = walls.iter().map(|[open, close]| quad(open, close, &RED)).collect();
        let test = Compare::ALL[(8.0 * r.next()) as usize];
        let state = DrawState { depth: DepthState { test, write: false }, ..DrawState::default() };
        let boxes: Vec<Draw<'_>> =
            queried.iter().map(|[open, close]| quad(open, close, &BLUE).with_state(state)).collect();
        let queries = |query| boxes.iter().map(|draw| draw.with_query(query)).collect::<Vec<_>>();
        let count = query(&stage, &walls, &queries(Query::Count));
        let early = query(&stage, &walls, &queries(Query::Any));
        for (number, (draw, queried)) in boxes.iter().zip(&queried).enumerate() {
            let plain = quad(&queried[0], &queried[1], &BLUE);
            prop_assert_eq!(count.passed[number], brute(&stage, &walls, &plain, test), "{:?}", draw.state.depth);
            prop_assert_eq!(early.passed[number] > 0, count.passed[number] > 0);
            prop_assert!(early.passed[number] <= count.passed[number]);
            let [few, all] = [&early, &count].map(|queried| &queried.draws[number]);
            for event in Event::ALL.into_iter().filter(|event| !is_of_a_cache(*event)) {
                prop_assert!(few[event] <= all[event], "{event:?}");
            }
            prop_assert!(count.passed[number] > 0 || tests(few) == tests(all), "nothing to end at");
        }
    }
}

/// A query may miss in a cache what one before it that ended early did not read.
fn is_of_a_cache(event: Event) -> bool {
    event == Event::DepthMisses || [Unit::L2, Unit::Dram].contains(&event.unit())
}

const ALL_OF_IT: ([f32; 2], [f32; 2]) = ([-99.0, 99.0], [-99.0, 99.0]);

#[test]
fn behind_a_full_screen_a_query_tests_no_sample() {
    let stage = Stage::sampled(64, 64, 4);
    let [near, far] = [1.0, 2.0].map(|z| rectangle(ALL_OF_IT.0, ALL_OF_IT.1, z));
    let queried = query(&stage, &[still(&near, &RED)], &[still(&far, &BLUE).with_query(Query::Count)]);
    let counts = &queried.draws[0];
    assert_eq!(queried.passed, [0]);
    assert!(counts[Event::ZCullTests] > 0);
    for event in [Event::SamplesTested, Event::SamplesScreened, Event::QuadsShaded] {
        assert_eq!(counts[event], 0, "{event:?}");
    }
    assert_eq!(counts[Event::DepthReads], 64 * 64 * 4, "each loaded depth is read once to cull by it");
}

/// All 64 tiles of 8x8 pixels are visible: counting takes 64 times as many samples as the first tile.
#[test]
fn a_visible_query_ends_after_its_first_tile() {
    let stage = Stage::sampled(64, 64, 4);
    let [near, far] = [1.0, 2.0].map(|z| {
        [[-99.0, -99.0], [199.0, -99.0], [-99.0, 199.0]].map(|[x, y]: [f32; 2]| Vec3::new(x * z, y * z, z))
    });
    let one = |corners| Draw::new(Geometry::new(corners, corners, &[[0, 1, 2]]).unwrap(), &RED, Cull::None);
    let of = |kind| query(&stage, &[one(&far)], &[one(&near).with_query(kind)]);
    let (count, early) = (of(Query::Count), of(Query::Any));
    assert_eq!((count.passed[0], early.passed[0]), (64 * 64 * 4, 8 * 8 * 4));
    let hit = |queried: &Queried| queried.draws[0][Event::SamplesHit];
    assert_eq!(hit(&count), 64 * hit(&early));
    assert_eq!(count.packets.len(), early.packets.len() + 63);
}

#[test]
fn threads_change_no_packet() {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (stage, mut r) = (Stage::sampled(90, 70, 4), Uniform::new(5));
            let (walls, queried) = (rectangles(&mut r, 9), rectangles(&mut r, 80));
            let walls: Vec<Draw<'_>> = walls.iter().map(|[open, close]| quad(open, close, &RED)).collect();
            let queried: Vec<Draw<'_>> =
                queried.iter().map(|[open, close]| quad(open, close, &BLUE).with_query(Query::Any)).collect();
            let queried = query(&stage, &walls, &queried);
            (queried.passed, queried.packets)
        })
    };
    let (one, three) = (on(1), on(3));
    assert!(one == three && one.0.iter().any(|passed| *passed > 0));
}

/// A query sees what draws before it in its pass stored, not those after it.
#[test]
fn a_query_sees_the_draws_before_it() {
    let stage = Stage::sampled(32, 32, 4);
    let [near, far] = [1.0, 2.0].map(|z| rectangle(ALL_OF_IT.0, ALL_OF_IT.1, z));
    let spec = spec(Features::ALL);
    let settings =
        Settings { spec: &spec, viewport: stage.viewport, samples: &stage.table, background: Vec3::ZERO };
    let query = still(&far, &BLUE).with_query(Query::Any);
    let draws = [query, still(&near, &RED), query];
    let drawn = RasterPass::new(&stage.camera, &draws, &settings).render(|_, _| ()).unwrap();
    assert!(drawn.passed[0] > 0 && drawn.passed[1..] == [0, 0], "{:?}", drawn.passed);
    assert!(drawn.into_image().iter().all(|pixel| *pixel == RED.0));
}

#[test]
fn what_a_query_cannot_do_is_refused() {
    let stage = Stage::sampled(16, 16, 1);
    let corners = rectangle(ALL_OF_IT.0, ALL_OF_IT.1, 1.0);
    let spec = spec(Features::ALL);
    let settings =
        Settings { spec: &spec, viewport: stage.viewport, samples: &stage.table, background: Vec3::ZERO };
    let any = still(&corners, &RED).with_query(Query::Any);
    let hidden = DrawState { colour_mask: [false; 4], ..DrawState::default() };
    let seen = DrawState { depth: DepthState::NONE, ..DrawState::default() };
    for (draw, is_refused) in [
        (any, false),
        (any.with_state(hidden), true),
        (any.with_state(seen), true),
        (still(&corners, &RED).with_query(Query::Count).with_state(DrawState::default()), false),
    ] {
        let drawn = RasterPass::new(&stage.camera, &[draw], &settings).render(|_, _| ());
        let expected = PassError::QueryStores { pass: "draw".to_owned(), draw: 0 };
        assert_eq!(drawn.err(), is_refused.then_some(expected));
    }
    let mut gpu = Gpu::without_packets(&spec).unwrap();
    let depth = gpu.create_surface(&SurfaceSpec::new("depths", stage.viewport, Format::D32));
    let never = Attachments { colours: Vec::new(), depth: Some(Attachment::loaded(depth)) };
    let pass = RasterPass::new(&stage.camera, &[], &settings).onto(Target::Surfaces(&never));
    let object = MovingBox { open: [Vec3::ONE; 2], close: [Vec3::ONE; 2] };
    let refused = gpu.query_samples(&pass, Query::Any, &[object]).unwrap_err();
    assert!(matches!(refused, PassError::Surface { problem: SurfaceProblem::Unwritten, .. }), "{refused}");
}

/// Every answer is a word that the unit of depth writes, by intervals and by samples, and is in memory when
/// the frame ends.
#[test]
fn answers_reach_memory() {
    let stage = Stage::sampled(48, 32, 4);
    let boxes: Vec<MovingBox> = (0..21_u8)
        .map(|number| {
            let low = Vec3::new(f32::from(number) - 10.0, -3.0, 2.0);
            let ends = [low, low + Vec3::ONE];
            MovingBox { open: ends, close: ends }
        })
        .collect();
    let spec = spec(Features::ALL);
    let settings =
        Settings { spec: &spec, viewport: stage.viewport, samples: &stage.table, background: Vec3::ZERO };
    let written = |report: &FrameReport| {
        [Event::DepthWrites, Event::DramWriteBytes].map(|event| report.counts()[event])
    };

    let depths = vec![f32::INFINITY; stage.viewport.pixels() * 4];
    let grid = BoxGrid::new([1; 3], false).unwrap();
    let pyramid = Pyramid::new(stage.viewport, &stage.table, &depths, 8, grid);
    let projection = Projection::new(&stage.camera, stage.viewport);
    let mut gpu = Gpu::without_packets(&spec).unwrap();
    gpu.query_boxes("queries", &IntervalQueries::new(&pyramid, &projection), &boxes).unwrap();
    let report = gpu.finish();
    assert_eq!(written(&report), [21, 128]);
    let [pass] = &report.passes[..] else { unreachable!() };
    assert_eq!((pass.draws.len(), pass.others), (21, Counts::default()));
    for draw in &pass.draws {
        assert_eq!([Event::DepthWrites, Event::Draws, Event::VerticesFetched].map(|of| draw[of]), [1, 1, 8]);
    }

    for query in [Query::Any, Query::Count] {
        let mut gpu = Gpu::without_packets(&spec).unwrap();
        let pass = RasterPass::new(&stage.camera, &[], &settings).onto(Target::Depth);
        gpu.query_samples(&pass, query, &boxes).unwrap();
        let report = gpu.finish();
        // The pass stores its depths, too: four samples a pixel.
        assert_eq!(written(&report), [21, 128 + 4 * 4 * stage.viewport.pixels() as u64]);
        assert!(report.passes[0].draws.iter().all(|draw| draw[Event::DepthWrites] == 1));
    }
}
