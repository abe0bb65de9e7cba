//! `quintile visibility`.

use std::io::{BufWriter, Write};
use std::path::Path;

use pipeline::frame::visibility;
use pipeline::sampling::SampleSource;
use pipeline::{Cull, Draw, Geometry, LensShape, SampleTable, Settings};
use serde::Serialize;
use workloads::visibility::{FixedSamples, M5d, Unshaded, write_hits};

use super::Failure;
use super::args::VisibilityArgs;
use super::terminal::{print, print_json};
use crate::gpu::GpuSpec;

/// What was found.
#[derive(Serialize)]
struct Found {
    triangles: usize,
    width: u32,
    height: u32,
    samples_per_pixel: u32,
    samples: usize,
    hits: usize,
}

pub(super) fn run(args: &VisibilityArgs) -> Result<(), Failure> {
    let pool = super::threads(args.threads)?;
    let found = pool.install(|| find(args))?;
    if args.json {
        return print_json(&found, false);
    }
    print(&format!(
        "{} triangles, {}x{} pixels of {} samples: {} of {} samples see a triangle",
        found.triangles, found.width, found.height, found.samples_per_pixel, found.hits, found.samples
    ))
}

fn find(args: &VisibilityArgs) -> Result<Found, Failure> {
    let scene = M5d::load(Path::new(&args.scene))?;
    let samples = samples(args, &scene)?;
    let gpu = GpuSpec::load("reference").map_err(|error| Failure { message: error.to_string(), code: 1 })?;
    let background = glam::Vec3::ZERO;
    let settings = Settings { spec: &gpu.pipeline, viewport: scene.viewport, samples: &*samples, background };
    let wrong = |message: String| Failure { message: format!("{}: {message}", args.scene), code: 1 };
    let close = if scene.open == scene.close { &scene.open } else { &scene.close };
    let geometry =
        Geometry::new(&scene.open, close, &scene.triangles).map_err(|error| wrong(error.to_string()))?;
    let draws = [Draw { geometry, shader: &Unshaded, cull: Cull::None }];
    let seen = visibility(&scene.camera, &draws, &settings).map_err(|error| wrong(error.to_string()))?;
    if let Some(out) = &args.out {
        let (triangles, depths): (Vec<u32>, Vec<f32>) =
            seen.iter().map(|&(triangle, depth)| (triangle, f32::from_bits(depth))).unzip();
        let written = traces::io::atomic::write_file(out, |file: &mut BufWriter<std::fs::File>| {
            write_hits(scene.viewport, samples.per_pixel(), &triangles, &depths, file)?;
            file.flush()
        });
        written.map_err(|error| Failure { message: error.to_string(), code: 1 })?;
    }
    Ok(Found {
        triangles: scene.triangles.len(),
        width: scene.viewport.width(),
        height: scene.viewport.height(),
        samples_per_pixel: samples.per_pixel(),
        samples: seen.len(),
        hits: seen.iter().filter(|(triangle, _)| *triangle != u32::MAX).count(),
    })
}

/// The samples asked for: those the scene's seed hashes to, the built-in table, or a file.
fn samples(args: &VisibilityArgs, scene: &M5d) -> Result<Box<dyn SampleSource>, Failure> {
    let range = || Failure {
        message: format!("{}: {} samples per pixel; it has to be 1 to 256", args.scene, scene.per_pixel),
        code: 1,
    };
    match args.samples.as_str() {
        "hash" => Ok(Box::new(scene.hashed_samples().ok_or_else(range)?)),
        "table" => {
            let shape: LensShape = scene.shape;
            Ok(Box::new(
                SampleTable::low_discrepancy(scene.per_pixel, scene.seed, shape).map_err(|_| range())?,
            ))
        }
        file => Ok(Box::new(FixedSamples::load(Path::new(file))?)),
    }
}
