//! Arguments of `visibility`.

use std::path::PathBuf;

use clap::Args;
use pipeline::Features;

use crate::cli::parse::tests;

/// Arguments of `visibility`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  quintile visibility s7_soup5d_10k.m5d --out ours.hit\n  \
    quintile visibility start.ply end.ply --camera camera.ron --json\n  \
    quintile visibility cloth-ball.mts.gz --print-camera > camera.ron\n\n\
    The layouts of all files, and the hashed samples, are described in docs/formats.md.")]
pub struct VisibilityArgs {
    /// A moving mesh: an .m5d or .mts file, a .ply, .obj, .off or .stl file, or two of equal topology as the ends of the shutter
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
    /// Worker threads [default: all cores]; results do not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print the result as one line of JSON
    #[arg(long)]
    pub json: bool,
}
