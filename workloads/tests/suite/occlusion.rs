//! Occlusion queries, compared with all samples.

use activity::{Event, PacketKind};
use glam::Vec3;
use pipeline::depth::{BoxGrid, Pyramid};
use pipeline::geometry::Projection;
use pipeline::{
    FrameReport, Gpu, IntervalQueries, LensShape, MovingBox, PipelineSpec, RasterPass, SampleTable,
    SampledQueries, Settings, Target, Viewport,
};
use proptest::prelude::*;
use workloads::Overrides;
use workloads::catalog::find;
use workloads::job::{Job, JobRequest, OptionSource};
use workloads::occlusion::{WallScene, WallSceneSpec, depths_of};
use workloads::visibility::Unshaded;

use crate::common::bits;

/// Which boxes of a wall scene are hidden: by intervals, for each grid of boxes and tile side, and by
/// samples.
struct HiddenBoxes {
    by_intervals: Vec<Vec<bool>>,
    by_samples: Vec<bool>,
    half_covered: f64,
}

fn query(wall_scene: &WallScene, size: [u32; 2], per_pixel: u32, grids: &[([u32; 3], u32)]) -> HiddenBoxes {
    let viewport = Viewport::new(size[0], size[1]).unwrap();
    let samples = SampleTable::low_discrepancy(per_pixel, 7, LensShape::Disk).unwrap();
    let spec = crate::common::spec();
    let settings = Settings { spec: &spec, viewport, samples: &samples, background: Vec3::ZERO };
    let walls = [wall_scene.walls(&Unshaded).unwrap()];
    let pass = RasterPass::new(&wall_scene.camera, &walls, &settings).onto(Target::Depth).with_visible();
    let depths = depths_of(&pass.uncounted().unwrap().visible);
    let sampled =
        SampledQueries { occluders: RasterPass::new(&wall_scene.camera, &walls, &settings), any: false };
    let all = sampled.query(&wall_scene.boxes).unwrap().answers;
    let any = SampledQueries { any: true, ..sampled }.query(&wall_scene.boxes).unwrap().answers;
    for (all, any) in all.iter().zip(&any) {
        assert_eq!(all.passed == 0, any.passed == 0, "both kinds agree");
        assert!(any.tests() <= all.tests() && any.madds <= all.madds);
        assert!(all.passed > 0 || all == any, "nothing to end at");
    }
    let by_samples: Vec<bool> = all.iter().map(|answer| answer.passed == 0).collect();
    let projection = Projection::new(&wall_scene.camera, viewport);
    let mut half_covered = 0.0;
    let by_intervals = grids.iter().map(|&(boxes, tile_px)| {
        let grid = BoxGrid::new(boxes, wall_scene.camera.lens().is_some()).unwrap();
        let pyramid = Pyramid::new(viewport, &samples, &depths, tile_px, grid);
        half_covered = pyramid.half_covered();
        let queries = IntervalQueries::new(&pyramid, &projection);
        wall_scene.boxes.iter().map(|object| queries.query(object).hidden).collect()
    });
    let by_intervals: Vec<Vec<bool>> = by_intervals.collect();
    for hidden in &by_intervals {
        let wrong =
            hidden.iter().zip(&by_samples).position(|(hidden, truly): (&bool, &bool)| *hidden && !truly);
        assert_eq!(wrong, None, "a box that a sample sees is called hidden");
    }
    HiddenBoxes { by_intervals, by_samples, half_covered }
}

fn count(hidden: &[bool]) -> usize {
    hidden.iter().filter(|hidden| **hidden).count()
}

const SOLID_WALLS: WallSceneSpec =
    WallSceneSpec { walls: 12, slats: 1, gaps: 0.0, boxes: 60, motion: 1.5, lens: 0.0, seed: 3 };

#[test]
fn more_time_boxes_find_more_hidden_behind_moving_walls() {
    let grids: Vec<_> = [1, 2, 4, 8, 16].map(|t| ([1, 1, t], 8)).into();
    let hidden_boxes = query(&SOLID_WALLS.wall_scene().unwrap(), [160, 90], 16, &grids);
    let found: Vec<usize> = hidden_boxes.by_intervals.iter().map(|hidden| count(hidden)).collect();
    assert!(found.is_sorted() && found[4] > found[0] + 3, "{found:?} of {}", count(&hidden_boxes.by_samples));
    assert!(found[4] <= count(&hidden_boxes.by_samples));
}

#[test]
fn more_lens_boxes_find_more_hidden_behind_blurred_walls() {
    let spec = WallSceneSpec { motion: 0.0, lens: 0.15, ..SOLID_WALLS };
    let grids: Vec<_> = [1, 2, 4].map(|n| ([n, n, 1], 8)).into();
    let hidden_boxes = query(&spec.wall_scene().unwrap(), [160, 90], 16, &grids);
    let found: Vec<usize> = hidden_boxes.by_intervals.iter().map(|hidden| count(hidden)).collect();
    assert!(found.is_sorted() && found[2] > found[0], "{found:?} of {}", count(&hidden_boxes.by_samples));
}

#[test]
fn objects_visible_from_part_of_the_lens_are_visible() {
    for seed in 0..8 {
        let spec = WallSceneSpec { motion: 0.0, lens: 0.25, seed, ..SOLID_WALLS };
        let hidden_boxes =
            query(&spec.wall_scene().unwrap(), [96, 54], 16, &[([4, 4, 1], 2), ([2, 2, 1], 4)]);
        assert!(count(&hidden_boxes.by_samples) > 10);
    }
}

#[test]
fn a_box_clipped_by_the_near_plane_is_never_hidden() {
    let mut wall_scene = SOLID_WALLS.wall_scene().unwrap();
    let wall: [Vec3; 4] =
        [[-90.0, -90.0], [90.0, -90.0], [-90.0, 90.0], [90.0, 90.0]].map(|[x, y]| Vec3::new(x, y, 8.0));
    (wall_scene.open, wall_scene.close, wall_scene.triangles) =
        (wall.into(), wall.into(), vec![[0, 1, 3], [0, 3, 2]]);
    let at = |low: [f32; 3], high: [f32; 3]| MovingBox {
        open: [low, high].map(Vec3::from),
        close: [low, high].map(Vec3::from),
    };
    // All of its visible sides are behind the wall, but its content may be in front of it.
    wall_scene.boxes =
        vec![at([-20.0, -20.0, -1.0], [20.0, 20.0, 30.0]), at([-1.0, -1.0, 9.0], [1.0, 1.0, 10.0])];
    let hidden_boxes = query(&wall_scene, [48, 27], 4, &[([1, 1, 1], 8)]);
    assert_eq!(hidden_boxes.by_intervals[0], [false, true]);
}

#[test]
fn many_small_occluders_hide_little_from_intervals() {
    let slats = |slats| {
        query(
            &WallSceneSpec { slats, gaps: 0.02, motion: 0.0, ..SOLID_WALLS }.wall_scene().unwrap(),
            [160, 90],
            16,
            &[([1; 3], 8)],
        )
    };
    let (few, many) = (slats(1), slats(24));
    assert!(count(&many.by_intervals[0]) * 2 <= count(&few.by_intervals[0]), "not found behind slats");
    assert!(
        many.half_covered > 0.25 && few.half_covered < 0.25,
        "{} {}",
        many.half_covered,
        few.half_covered
    );
}

#[test]
fn a_box_around_the_camera_is_never_hidden_and_one_out_of_view_is() {
    let mut wall_scene = SOLID_WALLS.wall_scene().unwrap();
    let at = |low: Vec3, high: Vec3| MovingBox { open: [low, high], close: [low, high] };
    wall_scene.boxes = vec![
        at(Vec3::splat(-1.0), Vec3::splat(1.0)),
        at(Vec3::new(90.0, 90.0, 5.0), Vec3::new(91.0, 91.0, 6.0)),
    ];
    let hidden_boxes = query(&wall_scene, [80, 45], 4, &[([1, 1, 2], 8)]);
    assert_eq!(hidden_boxes.by_intervals[0], [false, true]);
}

/// `quintile run occlusion` in a small size.
fn job(query: &str) -> Box<dyn Job> {
    let options = OptionSource {
        file: None,
        set: vec![("query".into(), query.into()), ("objects".into(), "40".into())],
    };
    let overrides = Overrides { size: Some((128, 72)), samples: Some(8), ..Overrides::default() };
    find("occlusion", &options, &JobRequest { overrides: &overrides, seed: 1 }).unwrap().unwrap()
}

/// Image and facts, and the work of the GPU.
fn run(query: &str) -> (Vec<[u32; 3]>, [f64; 2], FrameReport) {
    let (drawn, report) = crate::common::drawn_on(&crate::common::spec(), &*job(query), 0);
    let fact = |name: &str| drawn.facts.iter().find(|fact| fact.name == name).unwrap().value;
    (bits(&drawn.image), [fact("objects_hidden"), fact("tests")], report)
}

/// Tiles of a batch begin when all its triangles are set up.
#[test]
fn boxes_are_set_up_before_any_of_their_batch_is_traversed() {
    for batch_triangles in [1, 12, 50, 65536] {
        let spec = PipelineSpec { batch_triangles, ..crate::common::spec() };
        let (mut traversed, mut boxes) = (None, 0);
        let mut gpu = Gpu::new(&spec, |packet, _| match packet.kind {
            PacketKind::Tile => traversed = Some((packet.pass, packet.batch)),
            PacketKind::Vertices => {
                assert_ne!(traversed, Some((packet.pass, packet.batch)), "{batch_triangles}");
                boxes += 1;
            }
            _ => {}
        })
        .unwrap();
        job("intervals").frame(0, &mut gpu).unwrap();
        drop(gpu);
        assert!(boxes >= 40);
    }
}

/// What is hidden by any kind of query has no visible sample, so the image is the same.
#[test]
fn every_kind_of_query_draws_the_same_image() {
    let kinds = [run("intervals"), run("any"), run("samples")];
    let [
        (image, [by_intervals, _], _),
        (of_any, [any, any_tests], any_work),
        (of_samples, [all, all_tests], all_work),
    ] = kinds;
    assert!(image == of_any && image == of_samples);
    assert!(
        0.0 < by_intervals && by_intervals <= any && any == all && all < 40.0,
        "{by_intervals} {any} {all}"
    );
    assert!(any_tests < all_tests, "{any_tests} {all_tests}");
    let tested = |report: &FrameReport| report.counts()[Event::SamplesTested];
    assert!(tested(&any_work) < tested(&all_work));
    assert_eq!(
        any_work.passes.iter().map(|pass| &*pass.name).collect::<Vec<_>>(),
        ["occluders and queries", "image"]
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Safety: a visible object is never hidden, with any motion, blur and near plane.
    #[test]
    fn visible_objects_are_never_hidden(
        (seed, walls, slats) in (0_u64..1_000_000, 1_u32..14, 1_u32..5),
        (gaps, motion) in (0.0_f32..0.3, prop_oneof![Just(0.0_f32), 0.0_f32..6.0]),
        lens in prop_oneof![Just(0.0_f32), 0.01_f32..0.6],
        boxes in ([1_u32..5, 1_u32..5, 1_u32..17], 0_u32..4),
        per_pixel in prop_oneof![Just(1_u32), Just(4), Just(16)],
        nearer in 0.01_f32..1.0,
    ) {
        let spec = WallSceneSpec { walls, slats, gaps, boxes: 24, motion, lens, seed };
        let (boxes, size) = boxes;
        let mut wall_scene = spec.wall_scene().unwrap();
        // Some boxes pass through the walls, or begin in them.
        for (number, found) in wall_scene.boxes.iter_mut().enumerate() {
            match number % 3 {
                0 => found.close = found.close.map(|p| nearer * p),
                1 => found.open = found.open.map(|p| nearer * p),
                _ => {}
            }
        }
        query(&wall_scene, [61, 37], per_pixel, &[(boxes, 2 << size), ([1; 3], 8)]);
    }
}
