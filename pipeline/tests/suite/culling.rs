//! Culling and dropped dimensions change nothing: with any tests enabled, every visible sample is that of
//! testing every sample against every triangle on the full five-dimensional path.

use crate::common::*;
use glam::Vec3;
use pipeline::depth::{DepthBound, DepthSpec};
use pipeline::*;
use proptest::prelude::*;

fn culls() -> impl Strategy<Value = Cull> {
    prop_oneof![Just(Cull::None), Just(Cull::Back), Just(Cull::Front)]
}

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
    fn new(kind: Kind, cull: Cull, optics: Optics, borders: bool, count: u32, seed: u64) -> Self {
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
    for kind in [Kind::Still, Kind::Moving, Kind::Crossing, Kind::Slivers, Kind::Grid, Kind::Layers] {
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
