//! Arguments of `chart` and of `stress`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::LookArgs;

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
    /// Overwrite files in DIR that Quintile did not write
    #[arg(long)]
    pub force: bool,
    /// Smaller images, fewer triangles
    #[arg(long)]
    pub quick: bool,
    /// Worker threads; all cores without it. The results do not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print summary.json to standard output and nothing else
    #[arg(long)]
    pub json: bool,
    /// How pictures look.
    #[command(flatten)]
    pub look: LookArgs,
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
    /// Overwrite files in DIR that Quintile did not write
    #[arg(long)]
    pub force: bool,
    /// Worker threads; all cores without it. Only times depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print the numbers as JSON and nothing else
    #[arg(long)]
    pub json: bool,
    /// How pictures look.
    #[command(flatten)]
    pub look: LookArgs,
}

/// The charts there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ChartArg {
    /// Every chart, the failure catalogue of `quintile stress`, and `index.html`: speed against accuracy on one page
    All,
    /// Shader executions and images of caustics, by how beams are bounded, and where beams fail
    Caustics,
    /// Pairs kept in vain by collision detection, over resolution, bins of time and cost, and where it fails
    Collision,
    /// Frame starts found and energy error, by method, over sampling rate, noise, bits and host time
    Frames,
    /// Glossy reflection and refraction: error over samples, contact hardening, lenses too wide
    Glossy,
    /// Time of the visibility engine over triangles, samples a pixel and blur, with exponents
    Growth,
    /// Hidden objects found over tests and bytes, by intervals and by samples, and where occluders are too small
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
