//! Multi-view rendering in one pass.

use activity::Event;
use glam::{Affine3A, Vec3};
use pipeline::{CacheSpec, Camera, Cull, Draw, Geometry, Gpu, PipelineSpec, Shading, Viewport};
use workloads::job::Job;
use workloads::multiview::{Layout, MultiView, MultiViewOptions, MultiviewRig, Show, ViewTarget, Views};
use workloads::{Overrides, Scene};

use crate::common::{White, bits, drawn_on, rmse, spec};

const LAYOUTS: [(Layout, u32); 4] = [
    (Layout::stereo(0.28, 0.11), 8),
    (Layout { views: 1, spacing: 0.1, aperture: 0.1, overlap: 0 }, 8),
    (Layout { views: 7, spacing: 0.06, aperture: 0.1, overlap: 2 }, 4),
    (Layout { views: 64, spacing: 0.01, aperture: 0.1, overlap: 1 }, 4),
];

fn scene() -> Scene {
    workloads::load("tiny").unwrap()
}

/// Passes rig, draws and a target to `run`.
fn with<R>(
    scene: &Scene,
    (layout, samples): (Layout, u32),
    spec: &PipelineSpec,
    run: impl FnOnce(&MultiviewRig, &[Draw<'_>], &ViewTarget<'_>) -> R,
) -> R {
    let frame = scene.frame(1).unwrap();
    let draws = frame.draws(scene).unwrap();
    let rig = MultiviewRig::new(&frame.camera, 4.0, &layout, samples, 3).unwrap();
    let viewport = Viewport::new(64, 48).unwrap();
    run(&rig, &draws, &ViewTarget { viewport, spec, background: scene.background(), places: &[] })
}

fn one_pass(scene: &Scene, layout: (Layout, u32), spec: &PipelineSpec) -> Views {
    with(scene, layout, spec, |rig, draws, to| {
        rig.one_pass(draws, to, &mut Gpu::without_packets(to.spec).unwrap()).unwrap()
    })
}

#[test]
fn one_pass_equals_view_by_view_bit_for_bit() {
    let scene = scene();
    for layout in LAYOUTS {
        with(&scene, layout, &spec(), |rig, draws, to| {
            let one = rig.one_pass(draws, to, &mut Gpu::without_packets(to.spec).unwrap()).unwrap();
            let each = rig.view_by_view(draws, to, &mut Gpu::without_packets(to.spec).unwrap()).unwrap();
            assert_eq!((one.passes, each.passes), (1, layout.0.views));
            assert_eq!(one.images.len(), layout.0.views as usize);
            for (view, (a, b)) in one.images.iter().zip(&each.images).enumerate() {
                assert_eq!(bits(a), bits(b), "view {view} of {layout:?}");
            }
        });
    }
}

#[test]
fn views_have_parallax() {
    // The thrown box is in front of the focus, so it moves opposite to the viewer.
    let views = one_pass(&scene(), LAYOUTS[0], &spec());
    assert!(rmse(&views.images[0], &views.images[1]) > 0.01);
}

/// With per-sample shading, a view of the wide lens differs from one through its own lens only by rounding
/// and by the viewer position of shading. View-independent shading gives no difference.
#[test]
fn a_region_of_the_lens_equals_a_separate_lens() {
    let scene = scene();
    let spec = PipelineSpec { shading: Shading::PerSample, ..spec() };
    with(&scene, LAYOUTS[0], &spec, |rig, draws, to| {
        let one = rig.one_pass(draws, to, &mut Gpu::without_packets(to.spec).unwrap()).unwrap();
        let own = rig.own_cameras(draws, to).unwrap();
        for (a, b) in one.images.iter().zip(&own) {
            assert!(rmse(a, b) < 0.01, "{}", rmse(a, b));
        }
        assert!(rmse(&one.images[0], &own[1]) > 0.01, "the other eye's view is another");
    });
}

#[test]
fn accumulation_converges_to_the_same_views() {
    let scene = scene();
    let layout = (Layout::stereo(0.28, 0.11), 64);
    let spec = PipelineSpec { shading: Shading::PerSample, ..spec() };
    with(&scene, layout, &spec, |rig, draws, to| {
        let one = rig.one_pass(draws, to, &mut Gpu::without_packets(to.spec).unwrap()).unwrap();
        let many = rig.accumulated(draws, to, &mut Gpu::without_packets(to.spec).unwrap()).unwrap();
        assert_eq!(many.passes, 128);
        for (a, b) in one.images.iter().zip(&many.images) {
            assert!(rmse(a, b) < 0.03, "{}", rmse(a, b));
        }
        assert!(rmse(&one.images[0], &many.images[1]) > 0.03);
        assert!(many.counts[Event::VertexInvocations] > 60 * one.counts[Event::VertexInvocations]);
    });
}

/// A white strip that crosses the image of a still camera, and a still strip before a rotating camera.
#[test]
fn accumulation_blurs_moving_objects_and_moving_cameras() {
    let strip =
        |x: f32| [[x, -9.0], [x + 0.8, -9.0], [x + 0.8, 9.0], [x, 9.0]].map(|[x, y]| Vec3::new(x, y, 4.0));
    let still = Camera::new(Affine3A::IDENTITY, 0.5, 0.1).unwrap();
    let turns = still.moving(Affine3A::IDENTITY, Affine3A::from_translation(Vec3::X)).unwrap();
    let viewport = Viewport::new(64, 48).unwrap();
    for (camera, by) in [(still, 1.0), (turns, 0.0)] {
        let views = |by: f32, camera: &Camera, many: bool| {
            let (open, close, spec) = (strip(-0.9), strip(-0.9 + by), spec());
            let geometry = Geometry::new(&open, &close, &[[0, 1, 2], [0, 2, 3]]).unwrap();
            let draws = [Draw::new(geometry, &White, Cull::None)];
            let rig = MultiviewRig::new(camera, 4.0, &Layout::stereo(0.28, 0.11), 64, 3).unwrap();
            let to = ViewTarget { viewport, spec: &spec, background: Vec3::ZERO, places: &[] };
            let views = if many { MultiviewRig::accumulated } else { MultiviewRig::one_pass };
            views(&rig, &draws, &to, &mut Gpu::without_packets(to.spec).unwrap()).unwrap().images
        };
        let (one, many, frozen) =
            (views(by, &camera, false), views(by, &camera, true), views(0.0, &still, false));
        for eye in 0..2 {
            let found = rmse(&one[eye], &many[eye]);
            assert!(found < 0.04, "{by} {found}");
            assert!(rmse(&one[eye], &frozen[eye]) > 0.15, "it is blurred");
        }
    }
}

/// Shading is shared: two views cost less than twice one view. With an infinite cache they cost no more than
/// newly visible points; without a cache they cost the full sum.
#[test]
fn shading_is_reused_between_views_within_the_cache() {
    let scene = scene();
    let with_cache = |entries, layout| {
        let spec = PipelineSpec { shading_cache: CacheSpec::lru(entries, 4.min(entries)), ..spec() };
        one_pass(&scene, layout, &spec).counts[Event::PixelInvocations] as f64
    };
    let one = (Layout { views: 1, ..Layout::stereo(0.28, 0.11) }, 8);
    let (all, small) = (1 << 20, 4);
    let ratio = with_cache(all, LAYOUTS[0]) / with_cache(all, one);
    assert!((1.0..1.4).contains(&ratio), "{ratio}");
    assert!(with_cache(small, LAYOUTS[0]) > 1.5 * with_cache(all, LAYOUTS[0]));
    let sizes = [16, 64, 256, 1024, 16_384].map(|entries| with_cache(entries, LAYOUTS[2]));
    assert!(sizes.windows(2).all(|pair| pair[1] <= pair[0] * 1.02), "{sizes:?}");
}

fn drawn(options: MultiViewOptions, spec: &PipelineSpec) -> (Vec<Vec3>, Vec<&'static str>, u32) {
    let overrides = Overrides { size: Some((64, 48)), ..Overrides::default() };
    let options = MultiViewOptions { scene: "tiny".to_owned(), ..options };
    let job = MultiView::new(options, &overrides, 1).unwrap();
    let (drawn, _) = drawn_on(spec, &job, 0);
    let codes = drawn.warnings.iter().map(|warning| warning.code.name()).collect();
    (drawn.image, codes, job.settings().width)
}

#[test]
fn the_job_shows_views_side_by_side_interlaced_or_alone() {
    let spec = spec();
    let (pair, _, width) = drawn(MultiViewOptions::default(), &spec);
    assert_eq!((pair.len(), width), (128 * 48, 128));
    let (left, ..) = drawn(MultiViewOptions { show: Show::One, ..MultiViewOptions::default() }, &spec);
    assert_eq!(bits(&left[64..128]), bits(&pair[128..192]), "the left half of the second row");
    let options = MultiViewOptions {
        views: 7,
        spacing: 0.05,
        overlap: 2,
        show: Show::Interlaced,
        ..MultiViewOptions::default()
    };
    let (panel, _, width) = drawn(options, &spec);
    assert_eq!((panel.len(), width), (64 * 48, 64));
}

#[test]
fn each_limitation_is_reported() {
    let big = PipelineSpec { shading_cache: CacheSpec::lru(16_384, 4), ..spec() };
    let near = MultiViewOptions { spacing: 0.15, aperture: 0.05, ..MultiViewOptions::default() };
    assert_eq!(drawn(near.clone(), &big).1, Vec::<&str>::new());
    let small = PipelineSpec { shading_cache: CacheSpec::lru(1, 1), ..spec() };
    assert_eq!(drawn(near, &small).1, ["shading-cache-small"]);
    let wide = MultiViewOptions { spacing: 1.5, ..MultiViewOptions::default() };
    assert!(drawn(wide, &big).1.contains(&"view-dependent-shading"));
    // The outermost rays meet at 5.7 and at 6.3 degrees: 0.2 and 0.22 to either side of the centre, 4 away.
    for (spacing, codes) in [(0.3, &[][..]), (0.34, &["view-dependent-shading"])] {
        let at =
            MultiViewOptions { focus: Some(4.0), aperture: 0.05, spacing, ..MultiViewOptions::default() };
        assert_eq!(drawn(at, &big).1, codes);
    }
}

#[test]
fn invalid_options_are_mistakes_of_usage() {
    let none = Overrides::default();
    for bad in [
        MultiViewOptions { views: 0, ..MultiViewOptions::default() },
        MultiViewOptions { overlap: 3, ..MultiViewOptions::default() },
        MultiViewOptions { views: 64, spacing: 0.5, ..MultiViewOptions::default() },
        MultiViewOptions { focus: Some(-1.0), ..MultiViewOptions::default() },
        MultiViewOptions { scene: "no such scene".to_owned(), ..MultiViewOptions::default() },
    ] {
        let error = MultiView::new(bad.clone(), &none, 1).err().unwrap();
        assert!(error.is_usage(), "{bad:?}: {error}");
    }
}
