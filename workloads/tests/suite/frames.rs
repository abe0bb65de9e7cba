//! Which frames have equal inputs, and independence of a frame from others in the run.

use std::cell::Cell;
use std::collections::HashSet;
use std::sync::Arc;

use crate::common::{Builder, Files};
use activity::{Event, LineAccess, Packet};
use glam::{Vec2, Vec3, Vec4};
use pipeline::{Gpu, Lane, Lens, PipelineSpec, ShadingPoint, Viewport};
use serde_json::json;
use workloads::catalog::find;
use workloads::job::{Job, JobRequest, OptionSource};
use workloads::{Fingerprint, Frame, Overrides, Scene, load};

const OBJECTS: &str =
    "objects: [(shape: Sphere(radius: 1, segments: 8)), (shape: Plane(size: 6), position: (0, -1, 0))]";

/// A scene of still objects with a given camera.
fn seen_by(files: &Files, camera: &str, settings: &str) -> String {
    let text = format!(
        "(settings: (width: 32, height: 18, samples: 1, frames: (0, 6){settings}), camera: ({camera}), {OBJECTS})"
    );
    files.put(&format!("{}.ron", Fingerprint::of(&text).map(|f| format!("{f:?}")).unwrap()), text)
}

const STILL: &str = "position: (-4, 1, 5), target: (0, 0, 0)";
const PATHS: [&str; 4] = [
    "position: (-4, 1, 5), target: (0, 0, 0), end_position: (4, 1, 5)",
    "position: (-4, 1, 5), target: (0, 0, 0), end_target: (1, 0, 0)",
    "position: (-4, 1, 5), target: (0, 0, 0), keyframes: [(time_s: 0, position: (-4, 1, 5)), (time_s: 1, position: (4, 1, 5))]",
    "position: (-4, 1, 5), target: (0, 0, 0), keyframes: [(time_s: 0, target: (0, 0, 0)), (time_s: 1, target: (0, 0, 1))]",
];

/// A still triangle, and a camera on a moving node.
fn camera_node() -> Vec<u8> {
    let mut file = Builder::triangle();
    file.animate("translation", &[0.0, 1.0], (&[0.0, 0.0, 3.0, 0.0, 1.0, 4.0], "VEC3"), "LINEAR");
    file.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.25}}]);
    file.json["nodes"] = json!([{"camera": 0, "translation": [0, 0, 3]}, {"mesh": 0}]);
    file.json["scenes"][0]["nodes"] = json!([0, 1]);
    file.bytes()
}

fn print(frame: &Frame) -> Fingerprint {
    Fingerprint::of(frame).unwrap()
}

/// Number of different frames of a scene, and number of all.
fn differ(scene: &Scene) -> (usize, usize) {
    let frames = scene.settings().frames.clone();
    let prints: HashSet<_> = frames.clone().map(|number| print(&scene.frame(number).unwrap())).collect();
    (prints.len(), frames.len())
}

#[test]
fn a_camera_that_moves_makes_every_frame_another() {
    let files = Files::new();
    for path in PATHS {
        for settings in ["", ", shutter: 0"] {
            let scene = load(seen_by(&files, path, settings)).unwrap();
            assert_eq!(differ(&scene), (6, 6), "{path}{settings}");
        }
    }
    let flight = load(files.put("flight.glb", camera_node())).unwrap();
    assert_eq!(differ(&flight), (36, 36));
}

#[test]
fn still_frames_are_equal() {
    let files = Files::new();
    let scene = load(seen_by(&files, STILL, "")).unwrap();
    assert_eq!(differ(&scene), (1, 6));
    assert!(!scene.frame(0).unwrap().is_moving());
}

/// A clip with a period of whole frames repeats the frames of its first loop.
#[test]
fn frames_of_a_loop_come_again() {
    let mut file = Builder::triangle();
    file.animate("translation", &[0.0, 0.5], (&[0.0, 0.0, 0.0, 0.0, 1.0, 0.0], "VEC3"), "LINEAR");
    let frames = Overrides { frames: Some(0..12), frame_rate_hz: Some(8.0), ..Overrides::default() };
    let scene = crate::common::load_glb(&file.bytes()).unwrap().with_overrides(&frames).unwrap();
    assert_eq!(differ(&scene), (4, 12));
    assert_eq!(print(&scene.frame(1).unwrap()), print(&scene.frame(9).unwrap()));
}

/// One change to a frame.
type Change = fn(&mut Frame);

#[test]
fn every_part_of_a_frame_counts() {
    let frame = load("tiny").unwrap().frame(1).unwrap();
    let moved = |points: &Arc<[Vec3]>| -> Arc<[Vec3]> {
        let mut points = points.to_vec();
        points[0].x = points[0].x.next_up();
        points.into()
    };
    let changes: [Change; 6] = [
        |frame| frame.camera = frame.camera.with_lens(None),
        |frame| frame.camera = frame.camera.with_lens(Some(Lens::new(0.08, 3.0).unwrap())),
        |frame| {
            frame.camera =
                frame.camera.moving(frame.camera.open(), frame.camera.open()).unwrap().with_lens(None)
        },
        |frame| frame.meshes[0].triangles = frame.meshes[0].triangles[1..].into(),
        |frame| frame.meshes[0].uvs = frame.meshes[0].uvs.iter().map(|uv| *uv + Vec2::X).collect(),
        |frame| frame.meshes[0].material += 1,
    ];
    let mut prints = HashSet::from([print(&frame)]);
    for change in changes {
        let mut changed = frame.clone();
        change(&mut changed);
        prints.insert(print(&changed));
    }
    for mesh in 0..frame.meshes.len() {
        let mut changed = [frame.clone(), frame.clone(), frame.clone()];
        changed[0].meshes[mesh].open = moved(&frame.meshes[mesh].open);
        changed[1].meshes[mesh].close = moved(&frame.meshes[mesh].close);
        changed[2].meshes[mesh].name.push('!');
        prints.extend(changed.iter().map(print));
    }
    // Still cameras without their lens are the same camera.
    assert_eq!(prints.len(), 1 + 5 + 3 * frame.meshes.len());
    assert_eq!(print(&frame), print(&frame.clone()));
}

/// Shading of a surface at one point, which shows the lamp.
fn shade(scene: &Scene, frame: &Frame) -> Vec3 {
    let at = ShadingPoint { normal: Vec3::new(0.6, 0.64, 0.48), ..ShadingPoint::FACING };
    frame.draws(scene).unwrap()[0].shader.shade(&Lane::default(), &at, Vec4::ONE).truncate()
}

/// Frame 3 alone must equal frame 3 of a run: camera, focus and lamp are placed for the scene, not for the
/// requested frames.
#[test]
fn a_frame_does_not_depend_on_other_frames_of_the_run() {
    let files = Files::new();
    let fitted = format!(
        "(settings: (width: 32, height: 18, frames: (0, 6), lens_radius: 0.01), {})",
        OBJECTS.replace("position", "velocity")
    );
    let mut names: Vec<String> =
        PATHS.iter().map(|path| seen_by(&files, path, ", lens_radius: 0.05")).collect();
    names.push(files.put("fitted.ron", fitted));
    names.push(files.put("flight.glb", camera_node()));
    names.extend(["default", "tiny"].map(str::to_owned));
    for name in names {
        let all = load(&name).unwrap();
        let overrides = |frames| Overrides { frames: Some(frames), ..Overrides::default() };
        let alone = load(&name).unwrap().with_overrides(&overrides(3..4)).unwrap();
        let (one, of_all) = (alone.frame(3).unwrap(), all.frame(3).unwrap());
        assert_eq!(print(&one), print(&of_all), "{name}");
        assert_eq!(shade(&alone, &one), shade(&all, &of_all), "{name}: the lamp");
        assert!(alone.warnings().is_empty(), "{name}: {:?}", alone.warnings());
    }
}

#[test]
fn what_leaves_a_fitted_view_is_reported() {
    let files = Files::new();
    let text = "(settings: (width: 32, height: 18, frames: (0, 4)), objects: [(shape: Sphere(radius: 1, segments: 8), \
                velocity: (9, 0, 0)), (shape: Sphere(radius: 1, segments: 8))])";
    let name = files.put("leaves.ron", text);
    let codes = |frames| {
        let overrides = Overrides { frames: Some(frames), ..Overrides::default() };
        let scene = load(&name).unwrap().with_overrides(&overrides).unwrap();
        scene.warnings().iter().map(|warning| warning.code).collect::<Vec<_>>()
    };
    assert!(codes(0..4).is_empty() && codes(3..4).is_empty());
    assert_eq!(codes(0..60), ["leaves-fitted-view"]);
    assert_eq!(codes(59..60), ["leaves-fitted-view"]);
}

fn job(name: &str, set: &[(&str, &str)]) -> Box<dyn Job> {
    let set = set.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
    let overrides = Overrides::default();
    find(name, &OptionSource { file: None, set }, &JobRequest { overrides: &overrides, seed: 1 })
        .unwrap()
        .unwrap()
}

fn inputs(job: &dyn Job) -> usize {
    (0..6).map(|number| job.fingerprint(number).unwrap()).collect::<HashSet<_>>().len()
}

#[test]
fn workloads_follow_the_camera_of_their_scene() {
    let files = Files::new();
    let [still, path] = [STILL, PATHS[0]].map(|camera| seen_by(&files, camera, ", lens_radius: 0.05"));
    for name in ["glossy", "soft-shadows", "multiview"] {
        let of = |scene: &str| inputs(&*job(name, &[("scene", scene)]));
        assert_eq!((of(&still), of(&path)), (1, 6), "{name}");
    }
}

#[test]
fn workloads_without_a_scene_say_what_changes() {
    for (name, differ) in [("ccd", 1), ("occlusion", 1), ("caustics", 6), ("sampling", 6)] {
        assert_eq!(inputs(&*job(name, &[])), differ, "{name}");
    }
}

/// Passes in conservative mode end where the GPU is stopped: soon after a tenth of the packets there are no more.
#[test]
fn a_stopped_search_ends() {
    let set = [("resolution", "32"), ("balls", "8")];
    let set = set.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
    let request = JobRequest { overrides: &Overrides::default(), seed: 1 };
    let job = find("ccd", &OptionSource { file: None, set }, &request).unwrap().unwrap();
    let packets = |most: u32| {
        let (spec, stop, mut packets) = (crate::common::spec(), Cell::new(false), 0);
        let count = |_: &Packet, _: &[LineAccess]| {
            packets += 1;
            stop.set(packets >= most);
        };
        let drawn = job.frame(0, &mut Gpu::new(&spec, count).unwrap().stopping(&stop));
        assert_eq!(drawn.is_err(), stop.get(), "a later pass is refused");
        packets
    };
    let all = packets(u32::MAX);
    assert!(packets(all / 10) < all / 3, "{} of {all}", packets(all / 10));
}

/// Views side by side have the work of their pass in equal parts, and one by one each its own.
#[test]
fn views_side_by_side_are_on_heat_maps() {
    let events = [Event::SamplesTested, Event::PixelsResolved, Event::TileMadds];
    for is_each in ["false", "true"] {
        let set = vec![("view_by_view".to_owned(), is_each.to_owned())];
        let overrides = Overrides { size: Some((26, 20)), ..Overrides::default() };
        let request = JobRequest { overrides: &overrides, seed: 1 };
        let job = find("multiview", &OptionSource { file: None, set }, &request).unwrap().unwrap();
        let viewport = Viewport::new(52, 20).unwrap();
        let spec = crate::common::spec();
        let mut gpu = Gpu::without_packets(&spec).unwrap().with_heat(&events, viewport);
        job.frame(job.settings().frames.start, &mut gpu).unwrap();
        let report = gpu.finish();
        for map in &report.heat {
            assert_eq!((map.total(), map.elsewhere), (report.counts()[map.event], 0), "{:?}", map.event);
        }
        let resolved = report.heat[1].pixels();
        assert!(resolved.iter().all(|count| (count - 1.0).abs() < 1e-3), "{is_each}: {resolved:?}");
        let tested = report.heat[0].pixels();
        let of_view = |first: usize| tested.chunks(52).flat_map(|row| &row[first..first + 26]).sum::<f32>();
        let share = of_view(0) / of_view(26);
        assert!((0.5..2.0).contains(&share), "{is_each}: {share}");
    }
}

/// Heat maps have the work of conservative passes where their tiles are in the image: what lanes do and tests
/// of tiles, all of it.
#[test]
fn passes_in_conservative_mode_are_on_heat_maps() {
    let events = [Event::PixelInvocations, Event::ShaderOps, Event::TileMadds, Event::TilesVisited];
    for (name, size, set) in [
        ("ccd", None, [("resolution", "16"), ("balls", "5")]),
        ("caustics", Some((90, 50)), [("cells", "8"), ("wave_m", "18")]),
        ("sampling", Some((60, 60)), [("radius", "0.08"), ("rounds", "2")]),
    ] {
        let set = set.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        let overrides = Overrides { size, ..Overrides::default() };
        let request = JobRequest { overrides: &overrides, seed: 1 };
        let job = find(name, &OptionSource { file: None, set }, &request).unwrap().unwrap();
        let settings = job.settings();
        let viewport = Viewport::new(settings.width, settings.height).unwrap();
        // Tiles of the GPU are not those of the passes.
        let spec = PipelineSpec { tile_px: 4, ..crate::common::hardware() };
        let mut gpu = Gpu::without_packets(&spec).unwrap().with_heat(&events, viewport);
        job.frame(settings.frames.start, &mut gpu).unwrap();
        let report = gpu.finish();
        for map in &report.heat {
            let pixels: f64 = map.pixels().iter().map(|&value| f64::from(value)).sum();
            let total = report.counts()[map.event];
            assert!(total > 0 && map.total() == total, "{name} {:?}", map.event);
            // Vertices run on the same cores.
            let placed = if map.event == Event::ShaderOps { map.total() - map.elsewhere } else { total };
            assert!((pixels - placed as f64).abs() <= 1e-4 * placed as f64, "{name} {:?}", map.event);
            assert!(placed > 0, "{name} {:?}", map.event);
        }
    }
}
