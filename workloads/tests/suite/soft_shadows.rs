//! Soft shadows from a 5D shadow map.

use activity::{Event, Unit};
use glam::{DVec3, Vec3};
use pipeline::geometry::Projection;
use pipeline::random::{GOLDEN, mix};
use pipeline::sampling::{Pattern, Sample, SampleSpec};
use pipeline::{Clip, Cull, Draw, Geometry, Gpu, Lane, Viewport};
use proptest::prelude::*;
use workloads::Overrides;
use workloads::accumulation::SharedSamples;
use workloads::job::{Drawn, Job};
use workloads::soft_shadows::{
    AreaLight, DepthPass, LightSpec, SceneView, ShadowMap, ShadowMethod, Shadows, SoftShadowOptions,
    SoftShadows, VisibleTriangles, World, depth_pass, look_ups,
};
use workloads::visibility::Unshaded;

use crate::common::{bits, drawn_on, spec};

/// Equal samples give only one step of a penumbra.
#[test]
fn only_different_samples_count_against_banding() {
    let many: Vec<_> = (0..16_u8).map(|n| (f32::from(n) / 16.0, 0.0, 0.0)).collect();
    let warned = |points: Option<Vec<(f32, f32, f32)>>, samples: u32| {
        let overrides = Overrides { size: Some((8, 8)), samples: Some(samples), ..Overrides::default() };
        let options = SoftShadowOptions { points, map_px: 16, ..SoftShadowOptions::default() };
        let job = SoftShadows::new(options, &overrides, 1).unwrap();
        let first = job.settings().frames.start;
        let warnings = job.frame(first, &mut Gpu::without_packets(&spec()).unwrap()).unwrap().warnings;
        warnings.into_iter().find(|warning| warning.code == "shadow-banding").map(|warning| warning.message)
    };
    let one = warned(Some(vec![(0.0, 0.0, 0.0)]), 64).unwrap();
    assert!(
        one.starts_with("distinct light samples: 1,") && one.contains("16 or more `points` that differ"),
        "{one}"
    );
    assert!(warned(Some(many.clone()), 8).unwrap().starts_with("distinct light samples: 8,"));
    assert!(
        warned(Some([[(0.0, 0.0, 0.0), (-0.0, 0.0, 0.0)]; 8].concat()), 16)
            .unwrap()
            .starts_with("distinct light samples: 1,")
    );
    assert_eq!((warned(Some(many), 64), warned(None, 16)), (None, None));
    assert!(warned(None, 8).is_some());
}

fn set(count: u32, seed: u64) -> SharedSamples {
    SharedSamples::interleaved(&SampleSpec::default(), count, seed).unwrap()
}

fn quad(height: f32, x: [f32; 2], z: [f32; 2]) -> [Vec3; 4] {
    [[x[0], z[0]], [x[1], z[0]], [x[1], z[1]], [x[0], z[1]]].map(|[x, z]| Vec3::new(x, height, z))
}

const TRIANGLES: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

fn draw<'a>(open: &'a [Vec3], close: &'a [Vec3], triangles: &'a [[u32; 3]]) -> Draw<'a> {
    Draw::new(Geometry::new(open, close, triangles).unwrap(), &Unshaded, Cull::None)
}

/// Whether a point is lit for a sample of the set.
fn is_lit(map: &ShadowMap, light: &AreaLight, at: (Vec3, usize), bias: f64) -> bool {
    map.is_lit(&Lane::default(), light, at, bias, |_| ())
}

/// A look-up is a fetch and the operations of moving the point into the map and comparing its depth, and no
/// fetch outside of the map.
#[test]
fn look_ups_cost_what_they_compute() {
    let (floor, light) = (quad(0.0, [-9.0, 9.0], [-9.0, 9.0]), above(0.6));
    let map = map(&light, &[draw(&floor, &floor, &TRIANGLES)], 64, &set(4, 3), ShadowMethod::OnePass);
    let look_up = |point: Vec3| {
        let (lane, mut fetches) = (Lane::default(), 0);
        assert!(map.is_lit(&lane, &light, (point, 0), 0.02, |_| fetches += 1));
        (lane.ops(), fetches)
    };
    // Into the axes of the light 12, lens 2, scale 3, texel 4, border 1; bias and comparison 2.
    assert_eq!(look_up(Vec3::new(0.1, 0.0, 0.3)), (24, 1));
    assert_eq!(look_up(Vec3::new(0.1, 9.0, 0.3)), (22, 0));
}

/// A lane projects the vertices of the triangle that its sample sees. If they move, it projects those of both ends of
/// the shutter, and interpolates them in the image and in the scene, each axis in two operations.
#[test]
fn lanes_project_the_vertices_of_their_triangle() {
    let [floor, raised] = [0.0, 0.1].map(|height| quad(height, [-9.0, 9.0], [-9.0, 9.0]));
    let (light, set, spec, viewport) = (above(0.6), set(4, 3), spec(), Viewport::new(8, 8).unwrap());
    let camera = light.camera().with_lens(None);
    let ops = |close: &[Vec3]| {
        let draws = [draw(&floor, close, &TRIANGLES)];
        let view = SceneView { camera: &camera, draws: &draws };
        let mut gpu = Gpu::without_packets(&spec).unwrap();
        let seen = VisibleTriangles::draw(&view, viewport, &set, ShadowMethod::OnePass, &mut gpu).unwrap();
        let world = World::new(&view, viewport, &light, &[Vec3::ONE], Vec3::ZERO);
        look_ups(&world, &set, &seen, Shadows::None, &mut gpu).unwrap().counts[Event::ShaderOps]
    };
    let of_a_vertex = u64::from(Projection::new(&camera, viewport).vertex_ops());
    assert_eq!(ops(&raised) - ops(&floor), 8 * 8 * 4 * 3 * (of_a_vertex + 12));
}

/// A light straight above, at height 4.
fn above(radius: f64) -> AreaLight {
    let spec = LightSpec { position: [0.0, 4.0, 0.0], target: [0.0; 3], radius, fov_deg: 80.0, near: 0.1 };
    AreaLight::new(&spec).unwrap()
}

fn map(
    light: &AreaLight,
    draws: &[Draw<'_>],
    side: u32,
    set: &SharedSamples,
    method: ShadowMethod,
) -> ShadowMap {
    ShadowMap::new(light, draws, side, set, method, &mut Gpu::without_packets(&spec()).unwrap()).unwrap()
}

#[test]
fn one_pass_equals_accumulation_bit_for_bit() {
    let image = |accumulate: bool| {
        let overrides = Overrides { size: Some((64, 36)), ..Overrides::default() };
        let options = SoftShadowOptions { accumulate, map_px: 64, ..SoftShadowOptions::default() };
        let job = SoftShadows::new(options, &overrides, 1).unwrap();
        assert_eq!(job.settings().samples, 64);
        let (drawn, report) = drawn_on(&spec(), &job, 1);
        (drawn, report.triangles(), report.counts()[Event::Draws])
    };
    let ((one, triangles, draws), (many, many_triangles, many_draws)) = (image(false), image(true));
    assert_eq!(bits(&one.image), bits(&many.image));
    assert!(one.image.iter().any(|pixel| *pixel != one.image[0]));
    assert_eq!((many_triangles, many_draws), (64 * triangles, 64 * draws));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// Random triangles, some between clip planes, a rotated light, any set: all depths are equal bit for bit.
    #[test]
    fn maps_are_equal_for_random_triangles(
        seed in 0_u64..1 << 32,
        count in 1_u32..20,
        radius in 0.01_f64..2.0,
        clipped in 0_usize..12,
    ) {
        let mut state = seed;
        let mut number = || {
            state = mix(state.wrapping_add(GOLDEN));
            (state >> 40) as f32 / 8_388_608.0 - 1.0
        };
        let mut points = |spread: f32| -> Vec<Vec3> {
            (0..36).map(|_| Vec3::new(number(), number(), number()) * spread).collect()
        };
        let (open, by) = (points(3.0), points(1.5));
        let close: Vec<Vec3> = open.iter().zip(&by).map(|(a, b)| *a + *b).collect();
        let triangles: Vec<[u32; 3]> = (0..12).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let all = [f32::NEG_INFINITY, f32::INFINITY];
        let clip = Clip::new([-0.5, 0.5], all, [0.2, 0.7]).and_then(|clip| clip.across_image([0.1, 0.9], all));
        let (clipped, others) = triangles.split_at(clipped);
        let clipped = draw(&open, &close, clipped);
        let clipped = Draw { geometry: clipped.geometry.with_clip(clip.unwrap()), ..clipped };
        let draws = [clipped, draw(&open, &close, others)];
        let light = LightSpec { position: [1.0, 4.0, -2.0], target: [0.3, 0.1, 0.0], radius, fov_deg: 80.0, near: 0.1 };
        let light = AreaLight::new(&light).unwrap();
        let set = set(count, seed);
        let [one, many] = [ShadowMethod::OnePass, ShadowMethod::Accumulation]
            .map(|method| map(&light, &draws, 32, &set, method));
        let of = |map: &ShadowMap| map.depths().iter().map(|d| d.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(of(&one), of(&many));
        prop_assert!(one.depths().iter().any(|depth| depth.is_finite()));
    }
}

/// A half plane at height h over a floor, and a square light of radius R at height H: the penumbra on the
/// floor is 2 R h / (H - h) wide, and the lit share is a linear ramp.
#[test]
fn the_penumbra_follows_the_closed_form() {
    let (edge, floor) = (quad(1.0, [0.0, 9.0], [-9.0, 9.0]), quad(0.0, [-9.0, 9.0], [-9.0, 9.0]));
    let draws = [draw(&floor, &floor, &TRIANGLES), draw(&edge, &edge, &TRIANGLES)];
    let light = above(0.6);
    let square = SampleSpec { lens: pipeline::LensShape::Square, ..SampleSpec::default() };
    let set = SharedSamples::interleaved(&square, 256, 3).unwrap();
    let map = map(&light, &draws, 512, &set, ShadowMethod::OnePass);
    let lit = |x: f32| {
        let point = Vec3::new(x, 0.0, 0.3);
        (0..256).filter(|&index| is_lit(&map, &light, (point, index), 0.02)).count() as f64 / 256.0
    };
    // The point u of the light sees the edge on the floor at -u R h / (H - h): here from -0.2 to 0.2.
    for x in [-0.18, -0.1, -0.05, 0.0, 0.07, 0.15, 0.19] {
        let expected = 0.5 - f64::from(x) / 0.4;
        assert!((lit(x) - expected).abs() < 0.05, "{x}: {} {expected}", lit(x));
    }
    assert_eq!((lit(-0.24), lit(0.24)), (1.0, 0.0));
}

/// A strip that crosses the light's only ray to a point blocks it for a share of the time.
#[test]
fn motion_blurs_the_shadow_by_the_share_of_time() {
    let floor = quad(0.0, [-9.0, 9.0], [-9.0, 9.0]);
    let strip = |x: f32| quad(2.0, [x, x + 1.0], [-9.0, 9.0]);
    let (open, close) = (strip(-1.5), strip(2.5));
    let draws = [draw(&floor, &floor, &TRIANGLES), draw(&open, &close, &TRIANGLES)];
    let light = above(1e-4);
    let set = set(256, 9);
    let map = map(&light, &draws, 256, &set, ShadowMethod::OnePass);
    let lit = (0..256).filter(|&index| is_lit(&map, &light, (Vec3::ZERO, index), 0.05)).count();
    // The strip is 1 wide and moves by 4: it covers the point for a quarter of the time.
    assert!((lit as f64 / 256.0 - 0.75).abs() < 0.01, "{lit}");
}

/// The visible samples of a view, in one pass.
fn visible(view: &SceneView<'_>, viewport: Viewport, set: &SharedSamples) -> DepthPass {
    depth_pass(view, viewport, set, ShadowMethod::OnePass, &mut Gpu::without_packets(&spec()).unwrap())
        .unwrap()
}

/// Lambert's law: a floor has the cosine of its angle to the light at the time of the sample, plus ambient
/// light, with either winding.
#[test]
fn a_floor_in_the_light_follows_the_cosine_while_it_tilts() {
    let light = above(1e-4);
    let (camera, viewport) = (light.camera().with_lens(None), Viewport::new(8, 8).unwrap());
    let from = light.point(&Lane::default(), [0.0; 2]);
    let [right, up] =
        [[1.0, 0.0], [0.0, 1.0]].map(|at| (light.point(&Lane::default(), at) - from).normalize());
    let open = quad(0.0, [-9.0, 9.0], [-9.0, 9.0]);
    let close = open.map(|corner| Vec3::new(corner.x, corner.x, corner.z));
    let albedo = Vec3::new(0.5, 0.25, 1.0);
    for (t, triangles) in [(0.0, TRIANGLES), (0.5, TRIANGLES), (0.5, TRIANGLES.map(|[a, b, c]| [a, c, b]))] {
        let sample = Sample { x: 0.5, y: 0.5, t, ..Sample::default() };
        let set = SharedSamples::new(vec![sample; 3]).unwrap();
        let draws = [draw(&open, &close, &triangles)];
        let view = SceneView { camera: &camera, draws: &draws };
        let seen = visible(&view, viewport, &set);
        let world = World::new(&view, viewport, &light, std::slice::from_ref(&albedo), Vec3::ZERO);
        let image = world.image(&set, &seen.samples, Shadows::None);
        let normal = DVec3::new(-f64::from(t), 1.0, 0.0).normalize();
        for (place, pixel) in image.iter().enumerate() {
            let at = [place % 8, place / 8].map(|k| (k as f64 - 3.5) / 4.0 * 40.0_f64.to_radians().tan());
            let along = (at[0] * right - at[1] * up - DVec3::Y).normalize();
            let expected = albedo * (0.18 - normal.dot(along) as f32);
            assert!((*pixel - expected).length() < 1e-3, "{t} {place}: {pixel} {expected}");
        }
    }
}

#[test]
fn rays_and_a_fine_map_agree() {
    let all = [f32::NEG_INFINITY, f32::INFINITY];
    rays_agree_with_a_map(Clip::NONE, [10_000, 300]);
    // Planes across the lens leave out half of all samples, of the camera and of the light.
    rays_agree_with_a_map(Clip::new([0.0, 0.8], all, all).unwrap(), [6_000, 100]);
}

/// What is drawn is between clip planes; `least` samples face the light, and are dark.
fn rays_agree_with_a_map(clip: Clip, least: [usize; 2]) {
    let scene = workloads::soft_shadows::default_scene().unwrap();
    let frame = scene.frame(1).unwrap();
    let draws = frame.draws(&scene).unwrap().into_iter();
    let draws: Vec<_> =
        draws.map(|d| Draw { geometry: d.geometry.with_clip(clip), ..d.culling(Cull::None) }).collect();
    let light = AreaLight::new(&LightSpec::default()).unwrap();
    let viewport = Viewport::new(48, 27).unwrap();
    let (camera, set) = (frame.camera.with_lens(None), set(16, 5));
    let view = SceneView { camera: &camera, draws: &draws };
    let seen = visible(&view, viewport, &set);
    let world = World::new(&view, viewport, &light, &[], Vec3::ZERO);
    let map = map(&light, &draws, 512, &set, ShadowMethod::OnePass);
    let of = |shadows| world.lit_and_unlit(&set, &seen.samples, shadows);
    let (by_map, by_rays) = (of(Shadows::Map { map: &map, bias: 0.02 }), of(Shadows::Rays));
    let facing = by_rays.iter().flatten().count();
    let wrong = by_map.iter().zip(&by_rays).filter(|(a, b)| a != b).count();
    let dark = by_rays.iter().flatten().filter(|lit| !**lit).count();
    assert!(facing > least[0] && dark > least[1], "{facing} {dark}");
    assert!(wrong * 100 < facing, "{wrong} of {facing} differ");
    // Without a bias surfaces shade themselves; with far too much, shadows vanish.
    let wrong = |bias| {
        let by_map = of(Shadows::Map { map: &map, bias });
        by_map.iter().zip(&by_rays).filter(|(a, b)| a != b).count()
    };
    assert!(wrong(0.0) * 5 > facing, "acne: {} of {facing}", wrong(0.0));
    assert!(wrong(5.0) * 2 > dark, "shadows lost: {} of {dark}", wrong(5.0));
}

#[test]
fn depth_passes_write_depths_only() {
    let floor = quad(0.0, [-9.0, 9.0], [-9.0, 9.0]);
    let (light, set) = (above(0.5), set(4, 1));
    let draws = [draw(&floor, &floor, &TRIANGLES)];
    let spec = spec();
    let mut gpu = Gpu::without_packets(&spec).unwrap();
    let map = ShadowMap::new(&light, &draws, 64, &set, ShadowMethod::OnePass, &mut gpu).unwrap();
    let counts = gpu.finish().counts();
    assert!(!counts.uses(Unit::Colour) && !counts.uses(Unit::ShadingCache));
    assert_eq!(counts[Event::DramWriteBytes], map.bytes(), "each depth goes to memory once");
}

/// The shading pass sees what the pass before it left in memory: every sample fetches its number, and where a
/// triangle is seen it loads the words of its indices, its corners and what it reflects, and fetches a depth in the
/// light's map. The image is
/// that of the host, bit for bit.
#[test]
fn shading_fetches_what_it_reads() {
    let scene = workloads::soft_shadows::default_scene().unwrap();
    let frame = scene.frame(1).unwrap();
    let draws: Vec<_> = frame.draws(&scene).unwrap().into_iter().map(|d| d.culling(Cull::None)).collect();
    let (light, viewport) = (AreaLight::new(&LightSpec::default()).unwrap(), Viewport::new(48, 26).unwrap());
    let (camera, set, spec) = (frame.camera.with_lens(None), set(8, 5), spec());
    let albedos: Vec<Vec3> = (0..draws.len()).map(|draw| Vec3::splat(0.1 + 0.1 * draw as f32)).collect();
    let samples = (viewport.pixels() * set.samples().len()) as u64;
    for method in [ShadowMethod::OnePass, ShadowMethod::Accumulation] {
        let mut gpu = Gpu::without_packets(&spec).unwrap();
        let draws = gpu.resident(&draws);
        let view = SceneView { camera: &camera, draws: &draws };
        let map = ShadowMap::new(&light, &draws, 64, &set, method, &mut gpu).unwrap();
        let seen = VisibleTriangles::draw(&view, viewport, &set, method, &mut gpu).unwrap();
        let world = World::new(&view, viewport, &light, &albedos, Vec3::splat(0.5));
        let shadows = Shadows::Map { map: &map, bias: 0.06 };
        let shaded = look_ups(&world, &set, &seen, shadows, &mut gpu).unwrap();
        let by_host =
            depth_pass(&view, viewport, &set, method, &mut Gpu::without_packets(&spec).unwrap()).unwrap();
        let host = by_host.samples.iter().map(|(triangle, _)| *triangle);
        let numbers = (0..viewport.pixels() as u32 * 8).map(|n| {
            let (pixel, index) = (n / 8, n as usize % 8);
            seen.at([pixel % viewport.width(), pixel / viewport.width()], index)
        });
        assert!(numbers.eq(host), "{method:?}");
        let of_host = world.image(&set, &by_host.samples, shadows);
        let fetches = shaded.counts[Event::TextureFetches];
        assert_eq!(bits(&shaded.into_image()), bits(&of_host), "{method:?}");
        let on_surfaces = by_host.samples.iter().filter(|(triangle, _)| *triangle != u32::MAX).count() as u64;
        let lit = world.lit_and_unlit(&set, &by_host.samples, Shadows::None);
        let facing = lit.iter().flatten().count() as u64;
        assert!(0 < facing && facing < on_surfaces && on_surfaces < samples);
        let triangles = draws
            .iter()
            .flat_map(|draw| (0..draw.geometry.triangles().len()).map(|at| draw.data_of(at as u32).unwrap()));
        // Words of the data of each triangle, and three of what it reflects.
        let words = triangles.map(|data| data.iter().map(|(_, bytes)| bytes / 4).sum::<u64>() + 3);
        let words: Vec<u64> = words.collect();
        let loads =
            by_host.samples.iter().filter_map(|(triangle, _)| words.get(*triangle as usize)).sum::<u64>();
        let but_depths = samples + loads;
        // A point outside of the light's map fetches no depth.
        assert!((but_depths + facing / 2..=but_depths + facing).contains(&fetches), "{fetches}");
        let report = gpu.finish();
        let passes = report.passes.iter().filter(|pass| pass.name == "triangles");
        let written: u64 = passes.map(|pass| pass.counts()[Event::ColourWrites]).sum();
        assert!(written >= on_surfaces, "{written} of {on_surfaces}");
    }
}

fn warned(options: SoftShadowOptions, samples: u32) -> Vec<&'static str> {
    let overrides = Overrides { size: Some((8, 8)), samples: Some(samples), ..Overrides::default() };
    let job = SoftShadows::new(options, &overrides, 1).unwrap();
    job.frame(0, &mut Gpu::without_packets(&spec()).unwrap())
        .unwrap()
        .warnings
        .iter()
        .map(|w| w.code.name())
        .collect()
}

#[test]
fn each_limitation_is_reported() {
    let small = SoftShadowOptions { map_px: 64, bias: 0.2, ..SoftShadowOptions::default() };
    assert_eq!(warned(small.clone(), 16), Vec::<&str>::new());
    assert_eq!(warned(small.clone(), 4), ["shadow-banding"]);
    assert_eq!(warned(SoftShadowOptions { bias: 0.0, ..small.clone() }, 16), ["shadow-bias"]);
    assert_eq!(warned(SoftShadowOptions { bias: 3.0, ..small }, 16), ["shadow-bias"]);
}

/// Blended surfaces used to be drawn without depths, and so were not seen at all.
#[test]
fn blended_surfaces_are_drawn_as_opaque_ones_and_reported() {
    let folder = tempfile::tempdir().unwrap();
    let drawn = |opacity: &str| {
        let path = folder.path().join(format!("{opacity}.ron"));
        let ball = format!("(shape: Sphere(radius: 1), position: (0, 1, 0), material: (opacity: {opacity}))");
        std::fs::write(&path, format!("(objects: [(shape: Plane(size: 9)), {ball}])")).unwrap();
        let scene = Some(path.to_str().unwrap().to_owned());
        let overrides = Overrides { size: Some((32, 24)), samples: Some(16), ..Overrides::default() };
        let job = SoftShadows::new(
            SoftShadowOptions { scene, map_px: 64, bias: 0.2, ..SoftShadowOptions::default() },
            &overrides,
            1,
        );
        job.unwrap().frame(0, &mut Gpu::without_packets(&spec()).unwrap()).unwrap()
    };
    let [opaque, blended] = ["1", "0.5"].map(drawn);
    assert_eq!(opaque.image, blended.image);
    let codes = |drawn: &Drawn| drawn.warnings.iter().map(|warning| warning.code.name()).collect::<Vec<_>>();
    assert!(!codes(&opaque).contains(&"materials-simplified"));
    assert!(codes(&blended).contains(&"materials-simplified"));
}

#[test]
fn user_defined_points_are_the_set() {
    let points = vec![(0.5, -0.25, 0.0), (-1.0, 1.0, 0.5)];
    let spec = SampleSpec { pattern: Pattern::Given { points: points.clone() }, ..SampleSpec::default() };
    let set = SharedSamples::from_spec(&spec, 2, 1).unwrap();
    let found: Vec<_> = set.samples().iter().map(|s| (s.u, s.v, s.t)).collect();
    assert_eq!(found, points);
    for bad in [
        SoftShadowOptions { points: Some(vec![(2.0, 0.0, 0.0)]), ..SoftShadowOptions::default() },
        SoftShadowOptions { points: Some(Vec::new()), ..SoftShadowOptions::default() },
        SoftShadowOptions { map_px: 33, ..SoftShadowOptions::default() },
        SoftShadowOptions { bias: f64::NAN, ..SoftShadowOptions::default() },
        SoftShadowOptions { scene: Some("no such scene".to_owned()), ..SoftShadowOptions::default() },
    ] {
        assert!(SoftShadows::new(bad, &Overrides::default(), 1).err().unwrap().is_usage());
    }
}
