//! `quintile samples`.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use pipeline::Viewport;
use serde::Serialize;
use workloads::SampleChoice;
use workloads::visibility::write_samples;

use super::Failure;
use super::outputs::{print, print_json};
use crate::cli::parse::{per_pixel, size};

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

pub(super) fn run(args: &SamplesArgs) -> Result<(), Failure> {
    super::outputs::may_hold_results(("--out", Some(&args.out)), [Path::new(&args.table)])?;
    let (width, height) = args.size;
    let wrong = |message: String| Failure { message, code: 2 };
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
