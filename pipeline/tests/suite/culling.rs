//! Culling and dropped dimensions change nothing: with any tests enabled, every visible sample is that of
//! testing every sample against every triangle on the full five-dimensional path.

use crate::common::*;
use activity::Event;
use glam::Vec3;
use pipeline::depth::{DepthBound, DepthSpec};
use pipeline::sampling::{LensRegion, LensRegions, SampleSpec};
use pipeline::*;
use proptest::prelude::*;

fn depths() -> impl Strategy<Value = DepthSpec> {
    let boxes = (1..=5_u32, 1..=4_u32, 1..=9_u32).prop_map(|(u, v, t)| [u, v, t]);
    let bound = (0..4_usize).prop_map(|index| DepthBound::ALL[index]);
    (bound, boxes, any::<bool>()).prop_map(|(bound, boxes, z_min)| DepthSpec { bound, boxes, z_min })
}

/// A scene, with the visible triangle and depth of every sample by brute force.
struct Scene {
    soup: Soup,
    cull: Cull,
    optics: Optics,
    table: SampleTable,
    truth: Vec<(u32, u32)>,
}

impl Scene {
    fn new(kind: SoupKind, cull: Cull, optics: Optics, borders: bool, count: u32, seed: u64) -> Self {
        let soup = Soup::new(kind, count, seed);
        let table = if borders {
            border_table(seed)
        } else {
            SampleTable::low_discrepancy(4, seed, LensShape::Disk).unwrap()
        };
        let truth = brute_force(&soup, cull, optics, viewport(), &table);
        Self { soup, cull, optics, table, truth }
    }

    fn check(&self, spec: &PipelineSpec) {
        let settings = Settings { spec, viewport: viewport(), samples: &self.table, background: Vec3::ZERO };
        let ours = RasterPass::new(&camera(self.optics), &[self.soup.draw(&Plain, self.cull)], &settings)
            .visibility()
            .unwrap();
        assert_eq!(ours.len(), self.truth.len());
        let differ = ours.iter().zip(&self.truth).filter(|(a, b)| a != b).count();
        let of = ours.len();
        assert_eq!(differ, 0, "{differ} of {of} samples differ: {:?} {:?} {spec:?}", self.cull, self.optics);
    }
}

fn optics() -> impl Strategy<Value = Optics> {
    (any::<bool>(), any::<bool>()).prop_map(|(lens, parallel)| Optics { lens, parallel })
}

fn viewport() -> Viewport {
    Viewport::new(72, 50).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 160, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn culling_changes_nothing(
        kind in kinds(), cull in culls(), optics in optics(), switches in 0..SWITCHES, splits in 0..4_u32, borders: bool,
        sizes in 0..4_usize, auto: bool, count in 1..160_u32, seed: u64,
    ) {
        let (tile_px, coarse_tile_px) = [(8, 32), (4, 16), (1, 8), (2, 64)][sizes];
        let features = Features { facing_splits: splits, auto, ..switched(switches) };
        let spec = PipelineSpec { tile_px, coarse_tile_px, ..spec(features) };
        Scene::new(kind, cull, optics, borders, count, seed).check(&spec);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn depth_culling_changes_nothing_however_depth_is_bounded_and_kept(
        kind in kinds(), cull in culls(), optics in optics(), others in 0..SWITCHES, z_max: bool, depth in depths(),
        borders: bool, count in 1..160_u32, seed: u64,
    ) {
        let features = Features { z_max, ..switched(others) };
        let spec = PipelineSpec { depth, ..spec(features) };
        Scene::new(kind, cull, optics, borders, count, seed).check(&spec);
    }
}

#[test]
fn every_combination_on_one_scene_of_each_kind() {
    for kind in [
        SoupKind::Still,
        SoupKind::Moving,
        SoupKind::Crossing,
        SoupKind::Slivers,
        SoupKind::Grid,
        SoupKind::Layers,
    ] {
        for ways in 0..8 {
            let [lens, borders, parallel] = [1, 2, 4].map(|bit| ways & bit != 0);
            let cull = if borders { Cull::Back } else { Cull::None };
            let scene = Scene::new(kind, cull, Optics { lens, parallel }, borders, 60, 11);
            for switches in 0..SWITCHES {
                scene.check(&spec(switched(switches)));
            }
            for switches in (0..SWITCHES).step_by(7).chain([SWITCHES - 1]) {
                scene.check(&spec(Features { auto: true, ..switched(switches) }));
            }
        }
    }
}

/// Lenses with several regions: apart, adjoining, in rows, of random sizes, and more than have a test of their own.
fn divisions() -> impl Strategy<Value = LensRegions> {
    let region = |u: [f32; 2]| LensRegion { u: (u[0], u[1]), v: (-1.0, 1.0) };
    let apart = (2..=4_u32, 0.02..0.98_f32).prop_map(move |(count, part)| {
        let step = 2.0 / count as f32;
        let of = |k: u32| [-1.0 + k as f32 * step, -1.0 + (k as f32 + part) * step];
        LensRegions::Rectangles((0..count).map(|k| region(of(k))).collect())
    });
    let rows = (1..=4_u32, prop::sample::select(vec![1_u32, 2]))
        .prop_map(|(columns, rows)| LensRegions::Grid(columns, rows));
    let overlap_in_u = Just(LensRegions::Rectangles(vec![
        LensRegion { u: (-1.0, 0.25), v: (-1.0, 0.0) },
        LensRegion { u: (-0.25, 1.0), v: (0.0, 1.0) },
    ]));
    prop_oneof![3 => apart, 1 => rows, 1 => overlap_in_u, 1 => Just(LensRegions::Across(12))]
}

/// A table with its lens divided, 24 samples per pixel.
fn divided(regions: LensRegions, lens: LensShape, seed: u64) -> SampleTable {
    SampleTable::new(&SampleSpec { regions, lens, ..SampleSpec::default() }, 24, seed).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn separate_tests_for_the_regions_of_the_lens_change_nothing(
        kind in kinds(), cull in culls(), parallel: bool, switches in 0..SWITCHES, auto: bool, regions in divisions(), round: bool,
        depth in depths(), count in 1..120_u32, seed: u64,
    ) {
        let shape = if round { LensShape::Disk } else { LensShape::Square };
        let (soup, optics) = (Soup::new(kind, count, seed), Optics { lens: true, parallel });
        let table = divided(regions, shape, seed);
        let viewport = Viewport::new(40, 27).unwrap();
        let draws = [soup.draw(&Plain, cull)];
        let drawn = |lens_regions: bool| {
            let spec = PipelineSpec { depth, ..spec(Features { auto, lens_regions, ..switched(switches) }) };
            let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
            let (camera, views) = (camera(optics), [0..12, 12..24, 6..18]);
            let pass = RasterPass::new(&camera, &draws, &settings);
            let images = pass.onto(Target::Views(&views)).render(|_, _| ()).unwrap().images;
            let bits: Vec<_> = images.concat().iter().map(|pixel| pixel.to_array().map(f32::to_bits)).collect();
            (pass.visibility().unwrap(), bits)
        };
        let (seen, image) = drawn(true);
        prop_assert_eq!(&seen, &brute_force(&soup, cull, optics, viewport, &table));
        let (seen_without, image_without) = drawn(false);
        prop_assert!(seen == seen_without && image == image_without);
    }
}

/// Two eyes see a small triangle in front of the focus in two places. Between them the whole lens has to be
/// tested, and the eyes have nothing.
#[test]
fn tiles_between_the_images_of_two_views_are_culled() {
    let eye = |middle: f32| LensRegion { u: (middle - 0.1, middle + 0.1), v: (-0.1, 0.1) };
    let table = divided(LensRegions::Rectangles(vec![eye(-0.9), eye(0.9)]), LensShape::Disk, 5);
    for kind in [SoupKind::Still, SoupKind::Moving] {
        let camera = camera(false).with_lens(Some(Lens::new(3.0, 6.0).unwrap()));
        let soup = Soup::new(kind, 30, 3);
        let counts = |lens_regions: bool| {
            let spec = PipelineSpec {
                tile_px: 1,
                coarse_tile_px: 8,
                ..spec(Features { lens_regions, ..Features::ALL })
            };
            let settings =
                Settings { spec: &spec, viewport: viewport(), samples: &table, background: Vec3::ZERO };
            RasterPass::new(&camera, &[soup.draw(&Plain, Cull::None)], &settings)
                .render(|_, _| ())
                .unwrap()
                .counts
        };
        let (with, without) = (counts(true), counts(false));
        let culled =
            |counts: &activity::Counts| counts[Event::TilesCulledSides] + counts[Event::TilesCulledLens];
        assert!(culled(&with) > culled(&without), "{kind:?}: {} {}", culled(&with), culled(&without));
        let samples = |counts: &activity::Counts| counts[Event::SamplesScreened];
        assert!(samples(&with) <= samples(&without), "{kind:?}: {} {}", samples(&with), samples(&without));
        assert!(kind == SoupKind::Still || samples(&with) < samples(&without), "views keep their own times");
        assert_eq!(with[Event::SamplesHit], without[Event::SamplesHit]);
    }
}
