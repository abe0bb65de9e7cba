//! Property: culling and dropped dimensions change nothing. Every visible sample of the pipeline, with any tests switched
//! on, is that of testing every sample against every triangle on the full five-dimensional path.

#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test")]

mod common;

use common::*;
use glam::Vec3;
use pipeline::depth::{DepthBound, DepthSpec};
use pipeline::frame::visibility;
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

fn check(kind: Kind, cull: Cull, lens: bool, features: Features, borders: bool, count: u32, seed: u64) {
    check_depth(kind, cull, lens, features, DepthSpec::default(), borders, count, seed);
}

#[allow(clippy::too_many_arguments, reason = "one for each choice")]
fn check_depth(
    kind: Kind,
    cull: Cull,
    lens: bool,
    features: Features,
    depth: DepthSpec,
    borders: bool,
    count: u32,
    seed: u64,
) {
    let soup = Soup::new(kind, count, seed);
    let viewport = Viewport::new(72, 50).unwrap();
    let table = if borders {
        border_table(seed)
    } else {
        SampleTable::low_discrepancy(4, seed, LensShape::Disk).unwrap()
    };
    let spec = PipelineSpec { depth, ..spec(features) };
    let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
    let ours = visibility(&camera(lens), &[soup.draw(&Plain, cull)], &settings).unwrap();
    let theirs = brute_force(&soup, cull, lens, viewport, &table);
    assert_eq!(ours.len(), theirs.len());
    let differ = ours.iter().zip(&theirs).filter(|(a, b)| a != b).count();
    assert_eq!(
        differ,
        0,
        "{differ} of {} samples differ: {kind:?} {cull:?} lens {lens} {features:?} {depth:?}",
        ours.len()
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn culling_changes_nothing(
        kind in kinds(), cull in culls(), lens: bool, switches in 0..16_u8, borders: bool, count in 1..160_u32, seed: u64,
    ) {
        let on = |bit: u8| switches & (1 << bit) != 0;
        check(kind, cull, lens, Features { side_planes: on(0), edges: on(1), screen: on(2), z_max: on(3) }, borders, count, seed);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn depth_culling_changes_nothing_however_depth_is_bounded_and_kept(
        kind in kinds(), cull in culls(), lens: bool, others: bool, z_max: bool, depth in depths(), borders: bool,
        count in 1..160_u32, seed: u64,
    ) {
        let features = Features { z_max, ..if others { Features::ALL } else { Features::NONE } };
        check_depth(kind, cull, lens, features, depth, borders, count, seed);
    }
}

#[test]
fn every_combination_on_one_scene_of_each_kind() {
    for kind in [Kind::Still, Kind::Moving, Kind::Crossing, Kind::Slivers, Kind::Grid, Kind::Layers] {
        for lens in [false, true] {
            for switches in 0..16_u8 {
                let on = |bit: u8| switches & (1 << bit) != 0;
                let features = Features { side_planes: on(0), edges: on(1), screen: on(2), z_max: on(3) };
                check(kind, Cull::None, lens, features, false, 90, 11);
                check(kind, Cull::None, lens, features, true, 90, 11);
            }
        }
    }
}
