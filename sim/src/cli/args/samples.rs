//! Arguments of `samples`.

use std::path::PathBuf;

use clap::Args;

use crate::cli::parse::{per_pixel, size};

/// Arguments of `samples`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  quintile samples jittered --samples 16 --size 640x360 --out mine.smp\n\n\
    `quintile run --table mine.smp` and `quintile visibility --samples mine.smp` read the file. Its layout is\n\
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
