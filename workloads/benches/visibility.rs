//! Throughput of visibility, in image samples per second of a thread's CPU time.
//!
//! Run `cargo bench -p workloads --bench visibility [NAME]`; `README.md` beside this file describes the
//! measurement and has results.

#![allow(clippy::unwrap_used, reason = "a benchmark that cannot run may as well panic")]

use std::path::{Path, PathBuf};

use cpu_time::ProcessTime;
use glam::{Affine3A, Vec3};
use pipeline::random::{GOLDEN, SplitMix};
use pipeline::sampling::HashedSamples;
use pipeline::visibility::{SampleLayout, StepTally, Visibility, resolve};
use pipeline::{Camera, Cull, Geometry, Lens, LensShape, Viewport};

/// Moving triangles and their camera.
struct Scene {
    name: String,
    camera: Camera,
    open: Vec<Vec3>,
    close: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

fn offset(r: &mut SplitMix, size: f32) -> Vec3 {
    Vec3::from_array([0; 3].map(|_| r.within_single(-size, size)))
}

/// Parameters of random triangles. Sizes and speeds are shares of the depth; `speed` is the largest of a
/// log-uniform range of 200 to 1.
struct Soup {
    name: &'static str,
    count: u32,
    size: f32,
    speed: f32,
    lens: f32,
}

const SOUPS: [Soup; 7] = [
    Soup { name: "static 100k", count: 100_000, size: 0.01, speed: 0.0, lens: 0.0 },
    Soup { name: "moving 10k", count: 10_000, size: 0.03, speed: 0.4, lens: 0.0 },
    Soup { name: "moving 100k", count: 100_000, size: 0.01, speed: 0.4, lens: 0.0 },
    Soup { name: "defocused 20k", count: 20_000, size: 0.025, speed: 0.0, lens: 0.25 },
    Soup { name: "both 10k", count: 10_000, size: 0.03, speed: 0.4, lens: 0.25 },
    Soup { name: "both 100k", count: 100_000, size: 0.01, speed: 0.4, lens: 0.25 },
    Soup { name: "micro 1M", count: 1_000_000, size: 0.000_5, speed: 0.0, lens: 0.0 },
];

impl Soup {
    fn scene(&self) -> Scene {
        let seed = u64::from(self.count) ^ u64::from(self.size.to_bits());
        let mut r = SplitMix::new(seed.wrapping_mul(GOLDEN));
        let (mut open, mut close) = (Vec::new(), Vec::new());
        for _ in 0..self.count {
            let z = r.within_single(3.0, 30.0);
            let middle = Vec3::new(r.within_single(-0.6, 0.6) * z, r.within_single(-0.6, 0.6) * z, z);
            let speed = self.speed * z * 200.0_f32.powf(-r.within_single(0.0, 1.0));
            let drift = offset(&mut r, 1.0).normalize_or_zero() * speed;
            for _ in 0..3 {
                let corner = middle + offset(&mut r, self.size * z);
                open.push(corner);
                close.push(corner + drift + offset(&mut r, 0.2 * speed));
            }
        }
        let camera = Camera::new(Affine3A::IDENTITY, 0.577, 0.1).unwrap();
        let camera = camera.with_lens((self.lens > 0.0).then(|| Lens::new(self.lens, 8.0).unwrap()));
        let triangles = (0..self.count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        Scene { name: self.name.to_owned(), camera, open, close, triangles }
    }
}

/// Meshes in the folders of `QUINTILE_MESHES`, each with a fitted camera.
fn real_scenes() -> Vec<Scene> {
    let folders = std::env::var("QUINTILE_MESHES").unwrap_or_default();
    let mut files: Vec<PathBuf> = std::env::split_paths(&folders)
        .filter_map(|folder| std::fs::read_dir(folder).ok())
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            [".ply", ".ply.gz", ".obj", ".mts", ".mts.gz"]
                .iter()
                .any(|end| path.to_string_lossy().ends_with(end))
        })
        .collect();
    files.sort();
    files.iter().map(|path| real_scene(path)).collect()
}

fn real_scene(path: &Path) -> Scene {
    let scene = workloads::visibility::load(&[path], None).unwrap();
    let name = path.file_name().unwrap().to_string_lossy().into_owned();
    Scene { name, camera: scene.camera, open: scene.open, close: scene.close, triangles: scene.triangles }
}

/// Median and best of several runs on so many threads.
fn measure(scene: &Scene, threads: usize) -> (f64, f64, StepTally) {
    const RUNS: usize = 7;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let viewport = Viewport::new(512, 512).unwrap();
        let samples = HashedSamples::new(1, 512, 16, LensShape::Disk).unwrap();
        let moving = scene.open != scene.close;
        let layout = SampleLayout::new(&scene.camera, viewport, &samples, moving).unwrap();
        let close = if moving { &scene.close } else { &scene.open };
        let geometry = Geometry::new(&scene.open, close, &scene.triangles).unwrap();
        let mut visibility = Visibility::new(&layout);
        let mut tally = StepTally::default();
        let mut seconds: Vec<f64> = (0..RUNS)
            .map(|_| {
                let start = ProcessTime::now();
                tally = resolve(&layout, &geometry, Cull::None, &mut visibility);
                start.elapsed().as_secs_f64()
            })
            .collect();
        seconds.sort_by(f64::total_cmp);
        (seconds[RUNS / 2], seconds[0], tally)
    })
}

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with('-')).collect();
    println!(
        "| scene | triangles | threads | Msamples/s median | best | ns per sample test | samples hit per tested |"
    );
    println!("|---|---|---|---|---|---|---|");
    let scenes = SOUPS.iter().map(Soup::scene).chain(real_scenes());
    for scene in
        scenes.filter(|scene| wanted.is_empty() || wanted.iter().any(|name| scene.name.contains(name)))
    {
        for threads in [1, 2] {
            let (median_s, best_s, tally) = measure(&scene, threads);
            let samples = 512.0 * 512.0 * 16.0 * threads as f64 / 1e6;
            let tests = 16.0 * tally.packets as f64;
            println!(
                "| {} | {} | {threads} | {:.1} | {:.1} | {:.2} | {:.1} % |",
                scene.name,
                scene.triangles.len(),
                samples / median_s,
                samples / best_s,
                1e9 * median_s / tests,
                100.0 * tally.hits as f64 / tests
            );
        }
    }
}
