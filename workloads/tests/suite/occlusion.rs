//! Occlusion queries against all samples.

use glam::Vec3;
use pipeline::depth::BoxGrid;
use pipeline::geometry::Projection;
use pipeline::{LensShape, SampleTable, Settings, Viewport};
use proptest::prelude::*;
use workloads::occlusion::{MovingBox, Pyramid, Queries, Samples, Yard, YardSpec, depths};
use workloads::visibility::Unshaded;

/// What of the boxes of a yard is hidden: by intervals for each grid of boxes and each side of a tile, and by samples.
struct Told {
    by_intervals: Vec<Vec<bool>>,
    by_samples: Vec<bool>,
    half_covered: f64,
}

fn ask(yard: &Yard, size: [u32; 2], per_pixel: u32, grids: &[([u32; 3], u32)]) -> Told {
    let viewport = Viewport::new(size[0], size[1]).unwrap();
    let samples = SampleTable::low_discrepancy(per_pixel, 7, LensShape::Disk).unwrap();
    let spec = crate::common::spec();
    let settings = Settings { spec: &spec, viewport, samples: &samples, background: Vec3::ZERO };
    let depths = depths(&yard.camera, &[yard.walls(&Unshaded).unwrap()], &settings).unwrap();
    let sampled = Samples { camera: &yard.camera, settings: &settings, depths: &depths };
    let by_samples: Vec<bool> =
        yard.boxes.iter().map(|object| sampled.ask(object).unwrap().passed == 0).collect();
    let projection = Projection::new(&yard.camera, viewport);
    let mut half_covered = 0.0;
    let by_intervals = grids.iter().map(|&(boxes, tile_px)| {
        let grid = BoxGrid::new(boxes, yard.camera.lens().is_some()).unwrap();
        let pyramid = Pyramid::new(viewport, &samples, &depths, tile_px, grid);
        half_covered = pyramid.half_covered();
        let queries = Queries::new(&pyramid, &projection);
        yard.boxes.iter().map(|object| queries.ask(object).hidden).collect()
    });
    let by_intervals: Vec<Vec<bool>> = by_intervals.collect();
    for hidden in &by_intervals {
        let wrong =
            hidden.iter().zip(&by_samples).position(|(hidden, truly): (&bool, &bool)| *hidden && !truly);
        assert_eq!(wrong, None, "a box that a sample sees is called hidden");
    }
    Told { by_intervals, by_samples, half_covered }
}

fn count(hidden: &[bool]) -> usize {
    hidden.iter().filter(|hidden| **hidden).count()
}

const WHOLE: YardSpec =
    YardSpec { walls: 12, slats: 1, gaps: 0.0, boxes: 60, motion: 1.5, lens: 0.0, seed: 3 };

#[test]
fn more_boxes_in_time_find_more_hidden_behind_what_moves() {
    let grids: Vec<_> = [1, 2, 4, 8, 16].map(|t| ([1, 1, t], 8)).into();
    let told = ask(&WHOLE.yard().unwrap(), [160, 90], 16, &grids);
    let found: Vec<usize> = told.by_intervals.iter().map(|hidden| count(hidden)).collect();
    assert!(found.is_sorted() && found[4] > found[0] + 3, "{found:?} of {}", count(&told.by_samples));
    assert!(found[4] <= count(&told.by_samples));
}

#[test]
fn more_boxes_on_the_lens_find_more_hidden_behind_what_is_blurred() {
    let spec = YardSpec { motion: 0.0, lens: 0.15, ..WHOLE };
    let grids: Vec<_> = [1, 2, 4].map(|n| ([n, n, 1], 8)).into();
    let told = ask(&spec.yard().unwrap(), [160, 90], 16, &grids);
    let found: Vec<usize> = told.by_intervals.iter().map(|hidden| count(hidden)).collect();
    assert!(found.is_sorted() && found[2] > found[0], "{found:?} of {}", count(&told.by_samples));
}

#[test]
fn nothing_seen_through_a_part_of_the_lens_is_called_hidden() {
    for seed in 0..8 {
        let spec = YardSpec { motion: 0.0, lens: 0.25, seed, ..WHOLE };
        let told = ask(&spec.yard().unwrap(), [96, 54], 16, &[([4, 4, 1], 2), ([2, 2, 1], 4)]);
        assert!(count(&told.by_samples) > 10);
    }
}

#[test]
fn a_box_that_the_near_plane_cuts_is_not_hidden_by_a_wall_across_the_view() {
    let mut yard = WHOLE.yard().unwrap();
    let wall: [Vec3; 4] =
        [[-90.0, -90.0], [90.0, -90.0], [-90.0, 90.0], [90.0, 90.0]].map(|[x, y]| Vec3::new(x, y, 8.0));
    (yard.open, yard.close, yard.triangles) = (wall.into(), wall.into(), vec![[0, 1, 3], [0, 3, 2]]);
    let at = |low: [f32; 3], high: [f32; 3]| MovingBox {
        open: [low, high].map(Vec3::from),
        close: [low, high].map(Vec3::from),
    };
    // All of its sides in view are behind the wall, but what is inside may be in front of it.
    yard.boxes = vec![at([-20.0, -20.0, -1.0], [20.0, 20.0, 30.0]), at([-1.0, -1.0, 9.0], [1.0, 1.0, 10.0])];
    let told = ask(&yard, [48, 27], 4, &[([1, 1, 1], 8)]);
    assert_eq!(told.by_intervals[0], [false, true]);
}

#[test]
fn many_small_occluders_hide_little_from_intervals() {
    let slats = |slats| {
        ask(
            &YardSpec { slats, gaps: 0.02, motion: 0.0, ..WHOLE }.yard().unwrap(),
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
fn a_box_about_the_eye_is_never_hidden_and_one_out_of_view_is() {
    let mut yard = WHOLE.yard().unwrap();
    let at = |low: Vec3, high: Vec3| MovingBox { open: [low, high], close: [low, high] };
    yard.boxes = vec![
        at(Vec3::splat(-1.0), Vec3::splat(1.0)),
        at(Vec3::new(90.0, 90.0, 5.0), Vec3::new(91.0, 91.0, 6.0)),
    ];
    let told = ask(&yard, [80, 45], 4, &[([1, 1, 2], 8)]);
    assert_eq!(told.by_intervals[0], [false, true]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// The promise: what a sample sees is not called hidden, whatever moves, is blurred, or is cut by the near plane.
    #[test]
    fn nothing_that_is_seen_is_called_hidden(
        (seed, walls, slats) in (0_u64..1_000_000, 1_u32..14, 1_u32..5),
        (gaps, motion) in (0.0_f32..0.3, prop_oneof![Just(0.0_f32), 0.0_f32..6.0]),
        lens in prop_oneof![Just(0.0_f32), 0.01_f32..0.6],
        boxes in ([1_u32..5, 1_u32..5, 1_u32..17], 0_u32..4),
        per_pixel in prop_oneof![Just(1_u32), Just(4), Just(16)],
        nearer in 0.01_f32..1.0,
    ) {
        let spec = YardSpec { walls, slats, gaps, boxes: 24, motion, lens, seed };
        let (boxes, size) = boxes;
        let mut yard = spec.yard().unwrap();
        // Some come nearer until they are through the walls, or begin there.
        for (number, found) in yard.boxes.iter_mut().enumerate() {
            match number % 3 {
                0 => found.close = found.close.map(|p| nearer * p),
                1 => found.open = found.open.map(|p| nearer * p),
                _ => {}
            }
        }
        ask(&yard, [61, 37], per_pixel, &[(boxes, 2 << size), ([1; 3], 8)]);
    }
}
