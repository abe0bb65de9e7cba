//! `quintile visibility` and `quintile samples`: sample tables, and the triangle that each sample sees.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use output::table::counted;
use output::terminal::Terminal;
use pipeline::sampling::SampleSource;
use pipeline::visibility::VisibleTriangle;
use pipeline::{Features, SampleTable, Viewport};
use run::fits_memory;
use run::visibility::{SampleRates, find};
use serde::Serialize;
use warnings::{Code, Warning};
use workloads::visibility::{self, CameraSpec, VisibilityScene};
use workloads::{FixedSamples, SampleChoice, write_hits, write_samples};

use super::{Failure, print, print_json};
use crate::cli::args::ThreadArgs;
use crate::cli::parse::{per_pixel, size, tests};

/// Arguments of `visibility`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  quintile visibility s7_soup5d_10k.m5d --out ours.hit\n  \
    quintile visibility start.ply end.ply --camera camera.ron --json\n  \
    quintile visibility cloth-ball.mts.gz --print-camera > camera.ron\n\n\
    The layouts of all files, and the hashed samples, are described in docs/formats.md.")]
pub struct VisibilityArgs {
    /// A moving mesh: an .m5d or .mts file, a .ply, .obj, .off or .stl file, or two of equal topology as the
    /// ends of the shutter
    #[arg(value_name = "FILE", required = true, num_args = 1..=2)]
    pub files: Vec<PathBuf>,
    /// A .ron file, or a description such as 'position: (1, 2, 3), target: (0, 0, 0)'; without it an .m5d
    /// file uses its own camera, other files a fitted one
    #[arg(long, value_name = "CAMERA", allow_hyphen_values = true)]
    pub camera: Option<String>,
    /// Print the fitted camera as RON, and stop
    #[arg(long, conflicts_with_all = ["camera", "json", "out"])]
    pub print_camera: bool,
    /// `hash` (of the camera's seed), `table` (the built-in table) or a sample table in a file
    #[arg(long, value_name = "SAMPLES", default_value = "hash")]
    pub samples: String,
    /// Rasterize as the modelled hardware, with these tile tests: `all`, `none`, `auto`, or names separated
    /// by commas. Without it the fastest engine is used; the result is the same
    #[arg(long, value_name = "LIST", value_parser = tests)]
    pub tests: Option<Features>,
    /// Rasterize N times and report the median
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub repeat: u16,
    /// File for the triangle and depth of every sample
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Worker threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
    /// Print the result as one line of JSON
    #[arg(long)]
    pub json: bool,
}

/// Result for `--json`.
#[derive(Serialize)]
struct Found {
    triangles: usize,
    width: u32,
    height: u32,
    samples_per_pixel: u32,
    samples: usize,
    hits: usize,
    /// Camera, if it was fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    camera: Option<CameraSpec>,
    warnings: Vec<Warning>,
    #[serde(flatten)]
    rates: SampleRates,
}

pub(super) fn run(args: &VisibilityArgs, terminal: &Terminal) -> Result<(), Failure> {
    let named = args.camera.iter().chain([&args.samples]).map(Path::new);
    let inputs = args.files.iter().map(PathBuf::as_path).chain(named);
    super::may_hold_results("--out", args.out.as_deref(), inputs)?;
    let scene = visibility::load(&args.files, args.camera.as_deref())?;
    if args.print_camera {
        return print_camera(args, &scene);
    }
    let pool = args.threads.pool()?;
    let found = pool.install(|| see(args, scene))?;
    if args.json {
        return print_json(&found, false);
    }
    let camera = found.camera.as_ref().map(|camera| format!("\nthe camera was fitted: {}", camera.to_ron()));
    found.warnings.iter().for_each(|warning| terminal.warn(warning));
    let rates = format!(
        "\n{:.1} million samples/s by the CPU time of a thread ({} on {}), {:.1} end to end",
        found.rates.samples_per_s / 1e6,
        counted(usize::from(found.rates.runs), "run"),
        counted(found.rates.threads, "thread"),
        found.rates.end_to_end_samples_per_s / 1e6
    );
    let notes: String = std::iter::once(rates).chain(camera).collect();
    print(&format!(
        "{}, {}x{} pixels of {}: {} of {} samples hit a triangle{notes}",
        counted(found.triangles, "triangle"),
        found.width,
        found.height,
        counted(found.samples_per_pixel as usize, "sample"),
        found.hits,
        found.samples
    ))
}

/// Prints the fitted camera as RON, for `--camera`.
fn print_camera(args: &VisibilityArgs, scene: &VisibilityScene) -> Result<(), Failure> {
    let carried = || {
        format!("--print-camera: {} has a camera of its own, so none was fitted; leave it out", named(args))
    };
    let camera = scene.fitted.as_ref().ok_or_else(|| Failure { message: carried(), code: 2 })?;
    print(&camera.to_ron())
}

/// Memory of one sample in bytes.
const BYTES_PER_SAMPLE: u64 = 48;

/// Name of the mesh in messages.
fn named(args: &VisibilityArgs) -> String {
    args.files.first().map_or_else(String::new, |file| file.display().to_string())
}

fn see(args: &VisibilityArgs, scene: VisibilityScene) -> Result<Found, Failure> {
    let samples = samples(args, &scene)?;
    let pixels = scene.viewport.pixels() as u64;
    fits_memory(&named(args), pixels, samples.per_pixel(), BYTES_PER_SAMPLE)?;
    let mut warnings = scene.warnings.clone();
    warnings.extend(run::visibility::warnings(&scene));
    warnings.extend((args.tests.is_none() && scene.camera.is_orthographic()).then(slow_view));
    let found = find(&scene, &*samples, args.tests, args.repeat)
        .map_err(|message| Failure { message: format!("{}: {message}", named(args)), code: 1 })?;
    if let Some(out) = &args.out {
        write(out, &scene, samples.per_pixel(), &found.seen)?;
    }
    Ok(Found {
        triangles: scene.triangles.len(),
        width: scene.viewport.width(),
        height: scene.viewport.height(),
        samples_per_pixel: samples.per_pixel(),
        samples: found.seen.len(),
        hits: found.seen.iter().filter(|(triangle, _)| *triangle != u32::MAX).count(),
        camera: scene.fitted,
        warnings: Warning::fold(warnings),
        rates: found.rates,
    })
}

/// Warning that the fast engine does not support the camera.
fn slow_view() -> Warning {
    let message = "the fast engine does not support orthographic cameras, so all tile tests were modelled: the result is the same, but \
                   the rates are those of the model";
    Warning::new(Code::OrthographicView, message)
}

fn write(
    out: &Path,
    scene: &VisibilityScene,
    per_pixel: u32,
    seen: &[VisibleTriangle],
) -> Result<(), Failure> {
    let (triangles, depths): (Vec<u32>, Vec<f32>) = seen.iter().copied().unzip();
    let written = traces::io::atomic::write_file(out, |file: &mut BufWriter<File>| {
        write_hits(scene.viewport, per_pixel, &triangles, &depths, file)?;
        file.flush()
    });
    written.map_err(|error| Failure { message: error.to_string(), code: 1 })
}

/// Sample source of `--samples`: hashed from the scene's seed, the built-in table, or a file.
fn samples(args: &VisibilityArgs, scene: &VisibilityScene) -> Result<Box<dyn SampleSource>, Failure> {
    let range = || Failure {
        message: format!("{}: {} samples per pixel; it has to be 1 to 256", named(args), scene.per_pixel),
        code: 2,
    };
    match args.samples.as_str() {
        "hash" => Ok(Box::new(scene.hashed_samples().ok_or_else(range)?)),
        "table" => Ok(Box::new(
            SampleTable::low_discrepancy(scene.per_pixel, scene.seed, scene.shape).map_err(|_| range())?,
        )),
        file => Ok(Box::new(FixedSamples::load(Path::new(file))?)),
    }
}

/// Arguments of `samples`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  quintile samples jittered --samples 16 --size 640x360 --out mine.smp\n\n\
    `quintile run --table mine.smp` and `quintile visibility --samples mine.smp` read the file. Its layout is \
    described in docs/formats.md."
)]
pub struct SamplesArgs {
    /// A built-in sample table (see `quintile list`) or a description of one in a .ron file
    #[arg(value_name = "TABLE", default_value = "owen")]
    pub table: String,
    /// Samples per pixel, 1 to 256
    #[arg(long, value_name = "N", default_value_t = 16, allow_hyphen_values = true, value_parser = per_pixel)]
    pub samples: u32,
    /// Pixels to write; a larger image repeats them
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "64x64")]
    pub size: (u32, u32),
    /// Seed of the samples
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = crate::cli::parse::seed)]
    pub seed: u64,
    /// Output file
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Print a description of the file as one line of JSON
    #[arg(long)]
    pub json: bool,
}

/// Description of the written file.
#[derive(Serialize)]
struct Written {
    table: String,
    width: u32,
    height: u32,
    samples_per_pixel: u32,
    samples: u64,
    out: String,
}

pub(super) fn write_table(args: &SamplesArgs) -> Result<(), Failure> {
    super::may_hold_results("--out", Some(&args.out), [Path::new(&args.table)])?;
    let (width, height) = args.size;
    let wrong = |message: String| Failure { message, code: 2 };
    if args.out.extension().is_none_or(|ending| ending != "smp") {
        return Err(wrong(format!("--out: {}: samples are written to a .smp file", args.out.display())));
    }
    let viewport = Viewport::new(width, height)
        .ok_or_else(|| wrong(format!("size: {width}x{height}: each side has to be 1 to 16384 pixels")))?;
    let source = SampleChoice::load(&args.table)?.source(args.samples, args.seed)?;
    traces::io::atomic::write_file(&args.out, |file: &mut BufWriter<File>| {
        write_samples(viewport, &*source, file)?;
        file.flush()
    })
    .map_err(|error| Failure { message: error.to_string(), code: 1 })?;
    let written = Written {
        table: args.table.clone(),
        width,
        height,
        samples_per_pixel: source.per_pixel(),
        samples: viewport.pixels() as u64 * u64::from(source.per_pixel()),
        out: args.out.display().to_string(),
    };
    if args.json {
        return print_json(&written, false);
    }
    print(&format!(
        "{}: {} samples, {} in each of {width}x{height} pixels, table {}",
        written.out, written.samples, written.samples_per_pixel, written.table
    ))
}
