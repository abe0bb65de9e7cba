//! Deferred rendering against forward rendering of the same surfaces under the same lights.

use activity::Event;
use glam::{DVec3, Vec3};
use pipeline::{FrameReport, Gpu};
use workloads::deferred::{Deferred, DeferredOptions, LightPass, LightingMethod, LightingRate, NormalFormat};
use workloads::job::{Drawn, Job};
use workloads::scene::{Local, Node, Parts, Rig, Scene, SceneCamera, SceneSettings, Trs};
use workloads::{Alpha, Material, Overrides, shapes};

use crate::common::spec;

const SIZE: (u32, u32) = (96, 54);
const PIXELS: u64 = 96 * 54;

fn overrides(samples: u32) -> Overrides {
    Overrides { size: Some(SIZE), samples: Some(samples), ..Overrides::default() }
}

fn drawn(job: &dyn Job) -> (Drawn, FrameReport) {
    let spec = spec();
    let mut gpu = Gpu::without_packets(&spec).unwrap();
    let drawn = job.frame(0, &mut gpu).unwrap();
    (drawn, gpu.finish())
}

fn with(options: DeferredOptions, samples: u32) -> (Drawn, FrameReport) {
    drawn(&Deferred::new(options, &overrides(samples), 1).unwrap())
}

fn forward(options: &DeferredOptions, samples: u32) -> Vec<Vec3> {
    with(DeferredOptions { method: LightingMethod::Forward, ..options.clone() }, samples).0.image
}

fn largest(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max)
}

fn rms(a: &[Vec3], b: &[Vec3]) -> f32 {
    let sum: f32 = a.iter().zip(b).map(|(a, b)| (*a - *b).length_squared()).sum();
    (sum / (3.0 * a.len() as f32)).sqrt()
}

/// Largest error of radiance where light of at most `light` falls on surfaces with a reflectance of at most 1.
///
/// A base colour is off by half a code: 0.5 / 255 times the slope of the sRGB curve, at most 2.4 / 1.055. A
/// normal is off by half an ulp in each component, the square root of 3 times that as an angle; diffuse light
/// changes by the angle, and the 32nd power by 3.5 times that (its steepest slope), times the gloss of 0.12.
/// The sum is stored as a half.
fn bound(light: f32, half_ulp_of_normals: f32) -> f32 {
    let base = 0.5 / 255.0 * 2.4 / 1.055;
    let angle = 3.0_f32.sqrt() * half_ulp_of_normals;
    let gloss = 0.5 / 255.0_f32;
    light * (base + angle * (1.0 + 0.12 * 3.5) + gloss + 2.0_f32.powi(-11))
}

/// Halves below 1 are at most this far from a number.
const HALF: f32 = 1.0 / 4096.0;
/// Bytes for -1 to 1.
const BYTE: f32 = 1.0 / 255.0;
/// Most light of the lamp and the sky of the built-in scene in a channel.
const SCENE: f32 = 0.74 + 0.34;
/// Most light of a point light in a channel: 1.2 of 1.2, 0.2 and 0.2.
const LIGHT: f32 = 1.5 * 1.2 / 1.6;

#[test]
fn a_lit_buffer_equals_forward_shading_within_its_formats() {
    for (normals, half_ulp) in [(NormalFormat::Rgba16f, HALF), (NormalFormat::Rgba8, BYTE)] {
        for lights in [0, 1, 4] {
            let options = DeferredOptions { lights, range: 12.0, normals, ..DeferredOptions::default() };
            let (deferred, wanted) = (with(options.clone(), 1).0.image, forward(&options, 1));
            let (error, most) = (largest(&deferred, &wanted), bound(SCENE + LIGHT * lights as f32, half_ulp));
            assert!(error > 0.0 && error < most, "{normals:?}, {lights} lights: {error} of {most}");
            let dark = forward(&DeferredOptions { lights: 0, ..options.clone() }, 1);
            assert!(lights == 0 || largest(&dark, &wanted) > most, "the light would not be missed");
        }
    }
}

#[test]
fn larger_normals_err_less() {
    let options = DeferredOptions { lights: 8, range: 8.0, ..DeferredOptions::default() };
    let wanted = forward(&options, 1);
    let error = |normals| rms(&with(DeferredOptions { normals, ..options.clone() }, 1).0.image, &wanted);
    assert!(error(NormalFormat::Rgba16f) < error(NormalFormat::Rgba8));
}

#[test]
fn the_background_stays() {
    let options = DeferredOptions::default();
    let job = Deferred::new(options.clone(), &overrides(1), 1).unwrap();
    let sky = Job::scene(&job).unwrap().background();
    let (deferred, wanted) = (drawn(&job).0.image, forward(&options, 1));
    let is_sky = |image: &[Vec3]| image.iter().map(|pixel| *pixel == sky).collect::<Vec<bool>>();
    let (seen, expected) = (is_sky(&deferred), is_sky(&wanted));
    assert_eq!(seen, expected);
    let count = seen.iter().filter(|is_sky| **is_sky).count();
    assert!(count > 50 && count < PIXELS as usize, "{count}");
}

#[test]
fn light_volumes_add_up_to_the_loop_over_lights() {
    let options = DeferredOptions { lights: 24, range: 3.0, ..DeferredOptions::default() };
    let (screen, _) = with(options.clone(), 1);
    let (volumes, report) = with(DeferredOptions { lighting: LightPass::Volumes, ..options.clone() }, 1);
    let most = screen.image.iter().map(|pixel| pixel.max_element()).fold(0.0, f32::max);
    // Each of the sums is rounded to a half.
    let error = largest(&screen.image, &volumes.image);
    assert!(error > 0.0 && error < 25.0 * most * HALF, "{error} of {most}");
    assert_eq!(report.passes[1].draws.len(), 25);
    let runs =
        |drawn: &Drawn| drawn.facts.iter().find(|fact| fact.name == "lighting_invocations").unwrap().value;
    assert_eq!(runs(&screen), PIXELS as f64);
    assert!(runs(&volumes) > runs(&screen));
}

#[test]
fn counts_are_those_of_the_code_that_ran() {
    let ops = |lights: u32| {
        let (_, report) = with(DeferredOptions { lights, ..DeferredOptions::default() }, 1);
        let names: Vec<&str> = report.passes.iter().map(|pass| pass.name.as_str()).collect();
        assert_eq!(names, ["g-buffer", "lighting", "resolve"]);
        let counts = report.passes[1].counts();
        assert_eq!(counts[Event::PixelInvocations], PIXELS);
        assert!(report.passes[0].counts()[Event::ShaderOps] > 0);
        counts[Event::ShaderOps]
    };
    let [two, four, eight] = [2, 4, 8].map(ops);
    assert!(four > two);
    assert_eq!(eight - four, 2 * (four - two), "each light runs the same code for each surface");
    // Forward rendering runs it for every fragment that is shaded, hidden ones, too.
    let of_forward = |lights| {
        let options =
            DeferredOptions { method: LightingMethod::Forward, lights, ..DeferredOptions::default() };
        let (_, report) = with(options, 1);
        assert_eq!(report.passes.len(), 2);
        report.passes[0].counts()[Event::ShaderOps]
    };
    assert!(of_forward(8) - of_forward(4) > eight - four);
}

/// A light is seven words, and every pixel here is in reach of all lights.
#[test]
fn lights_are_read_from_memory() {
    let (few, many) = (64, 256);
    let read = |method, lighting, lights| {
        let options = DeferredOptions { method, lighting, lights, range: 1e4, ..DeferredOptions::default() };
        let small = Overrides { size: Some((16, 9)), ..overrides(1) };
        let (_, report) = drawn(&Deferred::new(options, &small, 1).unwrap());
        let pass = report.passes[usize::from(method == LightingMethod::Deferred)].counts();
        [Event::DramReadBytes, Event::TextureFetches].map(|event| pass[event])
    };
    for (method, lighting) in [
        (LightingMethod::Forward, LightPass::Screen),
        (LightingMethod::Deferred, LightPass::Screen),
        (LightingMethod::Deferred, LightPass::Volumes),
    ] {
        let more = [0, 1].map(|of| read(method, lighting, many)[of] - read(method, lighting, few)[of]);
        let lights = u64::from(many - few);
        assert!(more[0] >= lights * 7 * 4, "{method:?}, {lighting:?}: {more:?}");
        assert!(more[1] >= lights * 7 * 16 * 9 / 2, "{method:?}, {lighting:?}: {more:?}");
    }
}

#[test]
fn threads_do_not_change_a_byte() {
    let options = DeferredOptions { lights: 6, lighting: LightPass::Volumes, ..DeferredOptions::default() };
    let all = [1, 2, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| with(options.clone(), 2))
    });
    for (drawn, report) in &all[1..] {
        let bits =
            |image: &[Vec3]| image.iter().map(|pixel| pixel.to_array().map(f32::to_bits)).collect::<Vec<_>>();
        assert_eq!(bits(&drawn.image), bits(&all[0].0.image));
        assert_eq!(*report, all[0].1);
    }
}

#[test]
fn one_lit_sample_does_not_stand_for_a_pixel() {
    let options = DeferredOptions { lights: 4, ..DeferredOptions::default() };
    let wanted = forward(&options, 4);
    let (each, _) = with(options.clone(), 4);
    let (one, _) = with(DeferredOptions { rate: LightingRate::Pixel, ..options }, 4);
    let codes = |drawn: &Drawn| drawn.warnings.iter().map(|warning| warning.code.name()).collect::<Vec<_>>();
    assert_eq!((codes(&each), codes(&one)), (vec![], vec!["deferred-one-surface"]));
    let errors = [&each, &one].map(|drawn| rms(&drawn.image, &wanted));
    assert!(errors[1] > 5.0 * errors[0], "{errors:?}");
    let bytes = |drawn: &Drawn| drawn.facts[1].value;
    assert_eq!(bytes(&each), 4.0 * 16.0);
}

/// A red pane before a green wall, and a sky beside them.
fn pane(velocity: DVec3) -> Scene {
    let mut parts = Parts::new("pane");
    let wall = parts.graph.push_material(Material::colored("wall", Vec3::new(0.1, 0.6, 0.2)));
    let glass = Material { opacity: 0.5, alpha: Alpha::Blended, ..Material::colored("glass", Vec3::X) };
    let glass = parts.graph.push_material(glass);
    for (size, z, material) in
        [(Vec3::new(3.0, 2.0, 0.2), -1.0, wall), (Vec3::new(1.5, 1.0, 0.1), 0.5, glass)]
    {
        let trs = Trs { translation: DVec3::new(0.0, 0.0, z), ..Trs::default() };
        let mut node = Node::new("box", None, Local::Trs(trs));
        node.motion.velocity = velocity;
        let node = parts.graph.push_node(node);
        parts.graph.attach(shapes::cuboid(size, material), node);
    }
    let rig = Rig::look_at(DVec3::new(0.6, 0.4, 5.0), DVec3::ZERO);
    parts.camera = SceneCamera { rig, ..SceneCamera::default() };
    parts.settings = SceneSettings::default();
    Scene::new(parts).unwrap()
}

fn of(scene: Scene, options: DeferredOptions, overrides: &Overrides) -> (Drawn, FrameReport) {
    drawn(&Deferred::of(scene, options, overrides, 1).unwrap())
}

#[test]
fn blended_surfaces_are_lit_forward_over_the_lit_buffer() {
    let options = DeferredOptions { lights: 2, range: 6.0, ..DeferredOptions::default() };
    let (deferred, report) = of(pane(DVec3::ZERO), options.clone(), &overrides(1));
    let names: Vec<&str> = report.passes.iter().map(|pass| pass.name.as_str()).collect();
    assert_eq!(names, ["g-buffer", "lighting", "blended", "resolve"]);
    let (wanted, _) =
        of(pane(DVec3::ZERO), DeferredOptions { method: LightingMethod::Forward, ..options }, &overrides(1));
    let (error, most) = (largest(&deferred.image, &wanted.image), bound(SCENE + 2.0 * LIGHT, HALF));
    assert!(error < most, "{error} of {most}");
    let middle = wanted.image[(27 * 96 + 48) as usize];
    assert!(middle.x > middle.y, "the pane covers half of the wall: {middle}");
}

#[test]
fn moving_objects_have_a_surface_for_every_sample() {
    let options = DeferredOptions { lights: 2, range: 6.0, ..DeferredOptions::default() };
    let overrides = Overrides { shutter: Some(1.0), table: Some("owen".to_owned()), ..overrides(16) };
    let fast = DVec3::new(20.0, 0.0, 0.0);
    let image = |options: DeferredOptions| of(pane(fast), options, &overrides).0;
    let wanted = image(DeferredOptions { method: LightingMethod::Forward, ..options.clone() });
    let (each, one) =
        (image(options.clone()), image(DeferredOptions { rate: LightingRate::Pixel, ..options }));
    assert!(each.moving && each.warnings.is_empty(), "{:?}", each.warnings);
    let errors = [&each, &one].map(|drawn| rms(&drawn.image, &wanted.image));
    assert!(errors[1] > 3.0 * errors[0], "{errors:?}");
}

#[test]
fn a_camera_that_moves_while_the_shutter_is_open_is_reported() {
    let camera = "position: (-4, 1, 5), target: (0, 0, 0), end_position: (4, 1, 5)";
    let moving = Overrides { shutter: Some(1.0), camera: Some(camera.to_owned()), ..overrides(1) };
    let codes = |overrides: &Overrides, method| {
        let (drawn, _) = of(
            pane(DVec3::ZERO),
            DeferredOptions { method, lights: 0, ..DeferredOptions::default() },
            overrides,
        );
        drawn.warnings.iter().map(|warning| warning.code.name()).collect::<Vec<_>>()
    };
    assert_eq!(codes(&moving, LightingMethod::Deferred), ["deferred-moving-camera"]);
    assert!(codes(&moving, LightingMethod::Forward).is_empty());
    assert!(codes(&Overrides { shutter: None, ..moving }, LightingMethod::Deferred).is_empty());
}

#[test]
fn invalid_options_are_reported() {
    for bad in [
        DeferredOptions { lights: 5000, ..DeferredOptions::default() },
        DeferredOptions { range: 0.0, ..DeferredOptions::default() },
        DeferredOptions { range: f32::NAN, ..DeferredOptions::default() },
        DeferredOptions { scene: "nowhere".to_owned(), ..DeferredOptions::default() },
    ] {
        let error = Deferred::new(bad.clone(), &overrides(1), 1).err().unwrap();
        assert!(error.is_usage(), "{bad:?}: {error}");
    }
}
