//! What can be typed. One declaration per flag makes all of its docs.

use std::ops::Range;
use std::path::PathBuf;

use activity::{Event, spec::suggestion};
use clap::{Args, Parser, Subcommand, ValueEnum};
use pipeline::Features;
use pipeline::frame::HeatMap;

use super::parse::{duration, frames, percent, setting, size, tests};
use super::trace::args::TraceArgs;
use crate::timing::Method;

/// A cycle-approximate simulator of a tile-based 5D rasterization pipeline, with an energy trace for every frame.
#[derive(Debug, Parser)]
#[command(name = "quintile", version, arg_required_else_help = true, max_term_width = 100)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a scene, time it, turn it into watts, record a trace and find the energy of every frame in it
    Run(Box<RunArgs>),
    /// Find the triangle each sample sees and its depth, to be held against another program sample by sample
    Visibility(VisibilityArgs),
    /// Find the pairs of moving objects that may collide
    Ccd(super::ccd::CcdArgs),
    /// Make points: apart from each other, after a density, or evenly in a volume
    Sample(super::sample::SampleArgs),
    /// Write a sample table into a file
    Samples(SamplesArgs),
    /// Try each tile test on families of triangles from harmless to hopeless: samples lost, efficiency, width of intervals, cost
    Stress(StressArgs),
    /// Measure and draw a chart of the book
    Chart(ChartArgs),
    /// Compute what a paper reports and hold it against that, row by row
    Reproduce(super::reproduce::ReproduceArgs),
    /// Analyse a power trace, recorded or synthetic: frames, energies, alignment, formats, plots, Pareto frontiers
    Trace(TraceArgs),
    /// Name the scenes, GPUs, platforms, energy tables, workloads and figures that come with the program
    List(ListArgs),
}

/// Arguments of `run`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  quintile run Fox.glb --clip Run --frames 0..60 --lens 2 --samples 16 --out fox\n  \
    quintile run Fox.glb --frames 0..300 --accuracy 2% --verify --out fox\n  \
    quintile run ccd --set resolution=64 --set bins=8 --out ccd\n\n\
    Results are in DIR: images/, report.html, summary.json, frames.csv, trace.parquet, trace.csv, plots/ and\n\
    timeline.perfetto-trace (open it at ui.perfetto.dev). summary.json is written last: where it is, all is there."
)]
pub struct RunArgs {
    /// A built-in scene or a workload (see `quintile list`), or a .ron, .gltf, .glb, .ply or .obj file
    #[arg(default_value = "default", value_name = "SCENE|WORKLOAD|FILE")]
    pub scene: String,
    /// Options of a workload in a .ron file
    #[arg(long, value_name = "FILE.ron")]
    pub options: Option<PathBuf>,
    /// An option of a workload; may be given several times, and comes after --options
    #[arg(long, value_name = "NAME=VALUE", value_parser = setting)]
    pub set: Vec<(String, String)>,
    /// Folder for the results; made where it is missing
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Frames to render, the end not included
    #[arg(long, value_name = "A..B", value_parser = frames)]
    pub frames: Option<Range<u32>>,
    /// Samples in a pixel, 1 to 256
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub samples: Option<u32>,
    /// Where and when each pixel looks: a built-in sample table (see `quintile list`), a description of one in a .ron
    /// file, or the samples themselves in a .smp file
    #[arg(long, value_name = "TABLE")]
    pub table: Option<String>,
    /// Size of the image in pixels
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<(u32, u32)>,
    /// Frames in a second of the scene's time, and ticks of the display
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// Radius of the lens in scene units, 0 for a pinhole
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    pub lens: Option<f32>,
    /// Depth in scene units at which the lens is sharp
    #[arg(long, value_name = "F", allow_negative_numbers = true)]
    pub focus: Option<f32>,
    /// How long the shutter is open, as a fraction of the frame period
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub shutter: Option<f64>,
    /// Animation of a glTF scene, by name or number
    #[arg(long, value_name = "CLIP")]
    pub clip: Option<String>,
    /// A built-in GPU or a .ron file
    #[arg(long, value_name = "FILE", default_value = "reference")]
    pub gpu: String,
    /// A built-in platform or a .ron file
    #[arg(long, value_name = "FILE", default_value = "reference")]
    pub platform: String,
    /// A built-in energy table or a .ron file
    #[arg(long, value_name = "FILE", default_value = "28nm")]
    pub energy: String,
    /// Which values of the energy table to use
    #[arg(long, value_enum, default_value_t)]
    pub bound: BoundArg,
    /// How time is modelled; `quintile chart timing` says how well
    #[arg(long, value_enum, default_value_t)]
    pub timing: Method,
    /// Let a probe choose level, frames and dimensions so that the error of cycles and energy is at most this, for example 2%
    #[arg(long, value_name = "P%", value_parser = percent, conflicts_with = "timing", allow_hyphen_values = true)]
    pub accuracy: Option<f64>,
    /// Let a probe choose the most exact that takes no longer than this, for example 30s, 500ms or 2min
    #[arg(long, value_name = "T", value_parser = duration, conflicts_with = "timing", allow_hyphen_values = true)]
    pub budget: Option<f64>,
    /// Simulate every frame at the reference as well, and say how wrong the run was
    #[arg(long)]
    pub verify: bool,
    /// When the next frame starts
    #[arg(long, value_enum, default_value_t)]
    pub pacing: PacingArg,
    /// Samples per second of the recorder
    #[arg(long, value_name = "HZ", default_value_t = 50e3, allow_negative_numbers = true)]
    pub trace_rate: f64,
    /// Seed of samples and noise
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    pub seed: u64,
    /// Write every frame as EXR, too (linear light)
    #[arg(long)]
    pub exr: bool,
    /// Write where in each frame a counter counted, as a picture, an EXR and a CSV in heat/; may be given several times
    #[arg(long, value_name = "COUNTER", value_parser = counter)]
    pub heat: Vec<Event>,
    /// Worker threads; all cores without it. The results do not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print summary.json to standard output and nothing else
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `visibility`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  quintile visibility s7_soup5d_10k.m5d --out ours.hit\n  \
    quintile visibility start.ply end.ply --camera camera.ron --json\n  \
    quintile visibility cloth-ball.mts.gz --print-camera > camera.ron\n\n\
    The layouts of .m5d, of sample tables, of the hashed samples and of the result are those of\n\
    shared/peers/embree5d/README.md, that of .mts is in shared/ccd/README.md.")]
pub struct VisibilityArgs {
    /// A moving mesh: an .m5d or .mts file, or two .ply or .obj files of equal topology as the ends of the shutter
    #[arg(value_name = "FILE", required = true, num_args = 1..=2)]
    pub files: Vec<PathBuf>,
    /// A camera in RON; without it an .m5d is seen by its own, other files by one that is fitted to them
    #[arg(long, value_name = "CAM.ron")]
    pub camera: Option<PathBuf>,
    /// Print the camera that was fitted as RON, and do no more
    #[arg(long, conflicts_with_all = ["camera", "json", "out"])]
    pub print_camera: bool,
    /// `hash` (of the seed of the camera), `table` (the built-in one) or a sample table in a file
    #[arg(long, value_name = "SAMPLES", default_value = "hash")]
    pub samples: String,
    /// Rasterize as the modelled hardware does, with these tile tests: `all`, `none`, `auto`, or names with commas between.
    /// Without it the fastest way is taken; what is seen is the same
    #[arg(long, value_name = "LIST", value_parser = tests)]
    pub tests: Option<Features>,
    /// Rasterize N times and report the median
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub repeat: u16,
    /// File for the triangle and depth of every sample
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Worker threads; all cores without it. The results do not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print what was found as one line of JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `samples`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  quintile samples jittered --samples 16 --size 640x360 --out mine.smp\n\n\
    `quintile run --table mine.smp` and `quintile visibility --samples mine.smp` read the file. Its layout is that of\n\
    shared/peers/embree5d/README.md."
)]
pub struct SamplesArgs {
    /// A built-in sample table (see `quintile list`) or a description of one in a .ron file
    #[arg(value_name = "TABLE", default_value = "owen")]
    pub table: String,
    /// Samples in a pixel, 1 to 256
    #[arg(long, value_name = "N", default_value_t = 16, allow_negative_numbers = true)]
    pub samples: u32,
    /// Pixels to write; an image that is larger repeats them
    #[arg(long, value_name = "WxH", value_parser = size, default_value = "64x64")]
    pub size: (u32, u32),
    /// Seed of the samples
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    pub seed: u64,
    /// The file
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Print what was written as one line of JSON
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `stress`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  quintile stress slivers --out slivers\n\n\
    Results are in DIR: plots/, stress.csv and summary.json. Ends with 1 if any method loses a sample.")]
pub struct StressArgs {
    /// One family; all without it
    pub family: Option<String>,
    /// Folder for the results; made where it is missing
    #[arg(long, value_name = "DIR", default_value = "out/stress")]
    pub out: PathBuf,
    /// Smaller images, fewer triangles
    #[arg(long)]
    pub quick: bool,
    /// Worker threads; all cores without it. The results do not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print summary.json to standard output and nothing else
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `chart`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  quintile chart sampling --quick --out charts\n\n\
    Results are in DIR: pictures as SVG and PNG, NAME.csv, NAME.json and NAME.md.")]
pub struct ChartArgs {
    /// Which chart
    #[arg(value_enum, value_name = "NAME")]
    pub chart: ChartArg,
    /// Another scene for `sampled`, `tile-tests` or `timing`, by name or file; may be given several times
    #[arg(long, value_name = "SCENE")]
    pub scene: Vec<String>,
    /// Smaller images, fewer samples and a coarser reference: seconds instead of minutes
    #[arg(long)]
    pub quick: bool,
    /// Folder for the results; made where it is missing
    #[arg(long, value_name = "DIR", default_value = "out/charts")]
    pub out: PathBuf,
    /// Worker threads; all cores without it. Only times depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print the numbers as JSON and nothing else
    #[arg(long)]
    pub json: bool,
}

/// The charts there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ChartArg {
    /// Every chart, the failure catalogue of `quintile stress`, and `index.html`: speed against accuracy on one page
    All,
    /// Pairs kept in vain by collision detection, over resolution, bins of time and cost, and where it fails
    Collision,
    /// Shader executions and images of caustics, by how beams are bounded, and where beams fail
    Caustics,
    /// Frame starts found and energy error, by method, over sampling rate, noise, bits and host time
    Frames,
    /// Glossy reflection and refraction: error over samples, contact hardening, lenses too wide
    Glossy,
    /// Time of the visibility engine over triangles, samples a pixel and blur, with exponents
    Growth,
    /// Hidden objects found over tests and bytes, by intervals and by samples
    Occlusion,
    /// Points of all kinds: quality over points a second, spectra, and where it fails
    Points,
    /// Frames predicted from few: errors, how often intervals hold the truth, host time
    Sampled,
    /// Image error over samples per pixel and over host time, for every sample table
    Sampling,
    /// Soft shadows: error over places on the light, one pass against accumulation, and the bias
    Shadows,
    /// Every combination of tile tests: efficiency and tightness over multiply-adds
    TileTests,
    /// Every level of timing: error against the reference over host time
    Timing,
    /// Stereo and multi-view: shader runs over views and caches, one pass against its rivals
    Views,
}

/// Arguments of `list`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  quintile list --json")]
pub struct ListArgs {
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}

/// Which values of the energy table to use.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum BoundArg {
    /// The lowest that sources support
    Low,
    /// The most likely
    #[default]
    Nominal,
    /// The highest that sources support
    High,
}

/// When the next frame starts.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum PacingArg {
    /// On the next tick of the display
    #[default]
    Vsync,
    /// As soon as the one before is done
    Free,
}

fn counter(text: &str) -> Result<Event, String> {
    let placed = || Event::ALL.into_iter().filter(|&event| HeatMap::is_of(event));
    match Event::from_name(text) {
        Some(event) if HeatMap::is_of(event) => Ok(event),
        Some(_) => {
            Err(format!("`{text}` is counted before it is known where in the image; samples_tested is not"))
        }
        None => {
            let known: Vec<&str> = placed().map(Event::name).collect();
            Err(format!("no counter is called `{text}`; {}", suggestion(text, &known)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_declarations_make_sense() {
        Cli::command().debug_assert();
    }
}
