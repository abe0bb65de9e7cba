//! Arguments of `compare`.

use std::path::PathBuf;

use clap::Args;

/// Arguments of `compare`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  quintile compare out/before out/after\n  quintile compare before.png after.png --out difference.png\n  \
    quintile compare before/images after/images --json\n\n\
    Differences are B minus A, ratios B over A. The exit code is 0 with or without differences; 1 if a file is broken, 2 if\n\
    the two cannot be compared: images of different sizes, or a run with an image."
)]
pub struct CompareArgs {
    /// The folder or summary.json of a run, a frames.csv, a .png or .exr image, or a folder of images
    #[arg(value_name = "A")]
    pub a: PathBuf,
    /// The result to compare with, of the same kind
    #[arg(value_name = "B")]
    pub b: PathBuf,
    /// File for the difference of two images: .png, scaled to be seen, or .exr, B minus A in linear light
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Print every value, including equal ones
    #[arg(long)]
    pub all: bool,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}
