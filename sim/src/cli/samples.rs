//! `quintile samples`.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use pipeline::Viewport;
use serde::Serialize;
use workloads::SampleChoice;
use workloads::visibility::write_samples;

use super::Failure;
use super::args::SamplesArgs;
use super::terminal::{print, print_json};

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
