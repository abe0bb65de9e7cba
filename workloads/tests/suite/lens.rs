//! A fitted camera is valid for every lens, and sees something.

use crate::common::Files;
use glam::Vec3;
use pipeline::{
    CacheSpec, Features, LensShape, MemorySpec, PipelineSpec, RasterPass, SampleTable, Shading, Viewport,
};
use workloads::{Overrides, Scene, load};

pub const SIZE: (u32, u32) = (96, 54);

/// Lens radius and focus depth.
type Optics = (f32, Option<f32>);

/// A sphere of radius 1 around the origin, without its own camera.
fn sphere((radius, focus): Optics) -> Scene {
    let files = Files::new();
    let scene = load(files.put("s.ron", "(objects: [(shape: Sphere(radius: 1))])")).unwrap();
    let overrides = Overrides { size: Some(SIZE), lens_radius: Some(radius), focus, ..Overrides::default() };
    scene.with_overrides(&overrides).unwrap()
}

fn warns(scene: &Scene) -> bool {
    scene.warnings().iter().any(|warning| warning.code == "lens-leaves-view")
}

/// Every vertex through the lens centre: `|x|` and `|y|` in halves of the image, and depth.
fn through_the_centre(scene: &Scene) -> Vec<Vec3> {
    let frame = scene.frame(0).unwrap();
    let tan = frame.camera.half_height();
    let aspect = SIZE.0 as f32 / SIZE.1 as f32;
    let points = frame.meshes.iter().flat_map(|mesh| mesh.open.iter());
    let seen = points.map(|point| {
        let p = frame.camera.open().transform_point3(*point);
        Vec3::new((p.x / p.z / (tan * aspect)).abs(), (p.y / p.z / tan).abs(), p.z)
    });
    seen.collect()
}

#[test]
fn every_lens_and_focus_gives_a_camera_with_everything_in_view_of_its_centre() {
    let radii = [0.001, 0.01, 0.1, 0.2, 0.25, 0.3, 0.5, 1.0, 2.0, 5.0, 10.0, 1e4, 1e30];
    let depths = [1e-20, 0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 10.0, 30.0, 100.0, 1e30];
    for radius in radii {
        for focus in [None].into_iter().chain(depths.map(Some)) {
            let optics = (radius, focus);
            let scene = sphere(optics);
            let camera = scene.frame(0).unwrap().camera;
            assert_eq!(camera.lens().unwrap().radius(), radius);
            assert!(camera.near().is_finite() && camera.near() > 0.0, "{optics:?}: {}", camera.near());
            let centre = camera.open().transform_point3(Vec3::ZERO);
            // In front of the camera, and near enough to be more than a dot.
            assert!(centre.z > camera.near() && centre.z < 150.0, "{optics:?}: {centre}");
            for seen in through_the_centre(&scene) {
                assert!(seen.x <= 1.0 && seen.y <= 1.0 && seen.z > camera.near(), "{optics:?}: {seen}");
            }
        }
    }
}

#[test]
fn a_lens_too_large_for_its_focus_is_warned_about_and_keeps_the_pinhole_position() {
    let pinhole = sphere((0.0, None)).frame(0).unwrap().camera;
    for optics in [(1.0, 0.5), (1.0, 1.0), (0.5, 1.0), (2.0, 3.0), (10.0, 0.1), (1e30, 1e-20)] {
        let scene = sphere((optics.0, Some(optics.1)));
        assert!(warns(&scene), "{optics:?}");
        let camera = scene.frame(0).unwrap().camera;
        assert_eq!((camera.open(), camera.near()), (pinhole.open(), pinhole.near()), "{optics:?}");
    }
}

#[test]
fn a_lens_near_the_limit_still_fits() {
    // The view is 0.92 tan(20 deg) = 0.335 high per unit of depth. A lens of that share of its focus depth is
    // too large at any distance; every smaller one fits at some distance.
    for (part, holds) in [(0.1, true), (0.2, true), (0.28, true), (0.34, false), (0.5, false)] {
        for focus in [0.7, 1.0, 3.0] {
            let scene = sphere((part * focus, Some(focus)));
            assert_eq!(!warns(&scene), holds, "{part} of {focus}");
        }
    }
}

/// The first frame before black, with all tile tests.
pub fn first_image(scene: &Scene) -> Vec<Vec3> {
    let cache = CacheSpec::lru(256, 4);
    let spec = PipelineSpec {
        tile_px: 8,
        coarse_tile_px: 32,
        batch_triangles: 4096,
        vertex_reuse: 16,
        shading_cache: cache,
        shading: Shading::Cached,
        memory: MemorySpec {
            depth: cache,
            colour: cache,
            texture: cache,
            bins: None,
            l2: cache,
            llc: None,
            edram: None,
            compression: Default::default(),
        },
        features: Features::ALL,
        depth: pipeline::depth::DepthSpec::default(),
        compute: None,
        warp_lanes: 32,
    };
    let samples = SampleTable::low_discrepancy(4, 1, LensShape::Disk).unwrap();
    let background = Vec3::ZERO;
    let viewport = Viewport::new(SIZE.0, SIZE.1).unwrap();
    let settings = pipeline::Settings { spec: &spec, viewport, samples: &samples, background };
    let frame = scene.frame(0).unwrap();
    let draws = frame.draws(scene).unwrap();
    RasterPass::new(&frame.camera, &draws, &settings).render(|_, _| ()).unwrap().into_image()
}

#[test]
fn something_is_seen_through_a_very_large_lens() {
    for optics in [
        (0.0, None),
        (1.0, None),
        (10.0, None),
        (0.5, Some(1.0)),
        (1.0, Some(0.5)),
        (1.0, Some(1.0)),
        (2.0, Some(3.0)),
        (0.3, Some(1.0)),
    ] {
        let hit = first_image(&sphere(optics)).iter().filter(|pixel| **pixel != Vec3::ZERO).count();
        assert!(hit > 50, "{optics:?}: {hit} pixels");
    }
}
