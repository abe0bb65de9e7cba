//! `quintile visibility`.

use std::io::{BufWriter, Write};
use std::path::Path;

use activity::Warning;
use pipeline::sampling::SampleSource;
use pipeline::{Cull, Draw, Geometry, LensShape, SampleTable, Settings, Shader, ShaderCost, ShadingPoint};
use serde::Serialize;
use workloads::visibility::{self, CameraSpec, FixedSamples, VisibilityScene, write_hits};

use super::Failure;
use super::args::VisibilityArgs;
use super::terminal::{print, print_json};
use crate::gpu::GpuSpec;

/// Nothing is shaded: only who is seen matters.
struct Unshaded;

impl Shader for Unshaded {
    fn cost(&self) -> ShaderCost {
        ShaderCost::default()
    }

    fn shade(&self, _at: &ShadingPoint, _texel: glam::Vec4) -> glam::Vec3 {
        glam::Vec3::ZERO
    }
}

/// What was found.
#[derive(Serialize)]
struct Found {
    triangles: usize,
    width: u32,
    height: u32,
    samples_per_pixel: u32,
    samples: usize,
    hits: usize,
    /// The camera, where it was fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    camera: Option<CameraSpec>,
    warnings: Vec<Warning>,
}

pub(super) fn run(args: &VisibilityArgs) -> Result<(), Failure> {
    let scene = visibility::load(&args.files, args.camera.as_deref())?;
    if args.print_camera {
        return print_camera(args, &scene);
    }
    let pool = super::threads(args.threads)?;
    let found = pool.install(|| find(args, scene))?;
    if args.json {
        return print_json(&found, false);
    }
    let camera = found.camera.as_ref().map(|camera| format!("\nthe camera was fitted: {}", camera.to_ron()));
    let warnings = found.warnings.iter().map(|warning| format!("\nwarning {warning}"));
    let remarks: String = camera.into_iter().chain(warnings).collect();
    print(&format!(
        "{} triangles, {}x{} pixels of {} samples: {} of {} samples see a triangle{remarks}",
        found.triangles, found.width, found.height, found.samples_per_pixel, found.hits, found.samples
    ))
}

/// The camera as a file to change and to give back.
fn print_camera(args: &VisibilityArgs, scene: &VisibilityScene) -> Result<(), Failure> {
    let carried =
        || format!("--print-camera: {} carries its camera, so none was fitted; leave it out", named(args));
    let camera = scene.fitted.as_ref().ok_or_else(|| Failure { message: carried(), code: 2 })?;
    print(&camera.to_ron())
}

/// The mesh in messages.
fn named(args: &VisibilityArgs) -> String {
    args.files.first().map_or_else(String::new, |file| file.display().to_string())
}

fn find(args: &VisibilityArgs, scene: VisibilityScene) -> Result<Found, Failure> {
    let samples = samples(args, &scene)?;
    let gpu = GpuSpec::load("reference").map_err(|error| Failure { message: error.to_string(), code: 1 })?;
    let background = glam::Vec3::ZERO;
    let settings = Settings { spec: &gpu.pipeline, viewport: scene.viewport, samples: &*samples, background };
    let wrong = |message: String| Failure { message: format!("{}: {message}", named(args)), code: 1 };
    let close = if scene.open == scene.close { &scene.open } else { &scene.close };
    let geometry =
        Geometry::new(&scene.open, close, &scene.triangles).map_err(|error| wrong(error.to_string()))?;
    let draws = [Draw { geometry, shader: &Unshaded, cull: Cull::None }];
    let seen = pipeline::frame::visibility(&scene.camera, &draws, &settings)
        .map_err(|error| wrong(error.to_string()))?;
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
        camera: scene.fitted,
        warnings: scene.warnings,
    })
}

/// The samples asked for: those the scene's seed hashes to, the built-in table, or a file.
fn samples(args: &VisibilityArgs, scene: &VisibilityScene) -> Result<Box<dyn SampleSource>, Failure> {
    let range = || Failure {
        message: format!("{}: {} samples per pixel; it has to be 1 to 256", named(args), scene.per_pixel),
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
