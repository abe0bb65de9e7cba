//! What can be typed. One declaration per flag makes all of its docs.

use std::ops::Range;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

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
    /// Try each tile test on families of triangles from harmless to hopeless: samples lost, efficiency, width of intervals, cost
    Stress(StressArgs),
    /// Chart what a method gains over what it costs
    Chart(ChartArgs),
    /// Name the scenes, GPUs, platforms, energy tables, workloads and figures that come with the program
    List(ListArgs),
}

/// Arguments of `run`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  quintile run Fox.glb --clip Run --frames 0..60 --lens 2 --samples 16 --out fox\n\n\
    Results are in DIR: images/, report.html, summary.json, frames.csv, trace.parquet, trace.csv, plots/ and\n\
    timeline.perfetto-trace (open it at ui.perfetto.dev). summary.json is written last: where it is, all is there."
)]
pub struct RunArgs {
    /// A built-in scene (see `quintile list`) or a .ron, .gltf, .glb, .ply or .obj file
    #[arg(default_value = "default")]
    pub scene: String,
    /// Folder for the results; made where it is missing
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Frames to render, the end not included
    #[arg(long, value_name = "A..B", value_parser = frames)]
    pub frames: Option<Range<u32>>,
    /// Samples in a pixel, 1 to 256
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub samples: Option<u32>,
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
    /// Worker threads; all cores without it. The results do not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print summary.json to standard output and nothing else
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `visibility`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  quintile visibility s7_soup5d_10k.m5d --out ours.hit\n\n\
    The layouts of .m5d, of sample tables, of the hashed samples and of the result are those of\n\
    shared/peers/embree5d/README.md.")]
pub struct VisibilityArgs {
    /// Moving triangles with their camera, a .m5d file
    #[arg(value_name = "FILE")]
    pub scene: String,
    /// `hash` (of the seed in the file), `table` (the built-in one) or a sample table in a file
    #[arg(long, value_name = "SAMPLES", default_value = "hash")]
    pub samples: String,
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
#[command(after_help = "Example:\n  quintile chart tile-tests --scene Fox.glb --out chart")]
pub struct ChartArgs {
    /// What to chart
    #[arg(value_enum)]
    pub name: ChartName,
    /// Another scene to chart, by name or file; may be given several times
    #[arg(long, value_name = "SCENE")]
    pub scene: Vec<String>,
    /// Folder for the results; made where it is missing
    #[arg(long, value_name = "DIR", default_value = "out/chart")]
    pub out: PathBuf,
    /// Smaller images, fewer triangles
    #[arg(long)]
    pub quick: bool,
    /// Worker threads; all cores without it. The results do not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print every row as JSON
    #[arg(long)]
    pub json: bool,
}

/// What can be charted.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum ChartName {
    /// Every combination of tile tests: efficiency and tightness over multiply-adds
    TileTests,
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

fn frames(text: &str) -> Result<Range<u32>, String> {
    let wrong = || format!("`{text}` is not a range of frames; write it as 0..36");
    let (start, end) = text.split_once("..").ok_or_else(wrong)?;
    let number = |part: &str| part.trim().parse().map_err(|_| wrong());
    Ok(number(start)?..number(end)?)
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let wrong = || format!("`{text}` is not a size; write it as 1280x720");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let side = |part: &str| part.trim().parse().map_err(|_| wrong());
    Ok((side(width)?, side(height)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_declarations_make_sense() {
        Cli::command().debug_assert();
    }

    #[test]
    fn ranges_and_sizes() {
        assert_eq!(frames("3..7"), Ok(3..7));
        assert!(frames("3-7").unwrap_err().contains("0..36"));
        assert!(frames("-3..7").is_err());
        assert_eq!(size("1280x720"), Ok((1280, 720)));
        assert!(size("1280").unwrap_err().contains("1280x720"));
    }
}
