//! `quintile sample`.

mod file;
mod poisson;
mod volume;
mod white;

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use serde::Serialize;

use super::Failure;
use super::terminal::{print, print_json};
use file::Points;
use output::terminal::Terminal;

/// Arguments of `sample`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  quintile sample poisson --dim 2 --r 0.01 -o points.csv\n  \
    quintile sample poisson --dim 3 --count 100000 --box -o points.npy --json\n  \
    quintile sample white --dim 2 --image portrait.png --count 20000 -o stipples.csv\n  \
    quintile sample volume --mesh bunny.ply --count 50000 -o inside.bin\n\n\
    Files by their ending: .csv (with a line x,y,... first), .npy, or .bin (coordinates point by point, little-endian, f64 or, with\n\
    --single, f32). Without -o the points are printed as CSV.")]
pub struct SampleArgs {
    /// Distribution of the points
    #[command(subcommand)]
    pub kind: Kind,
}

/// Distributions of points.
#[derive(Debug, Subcommand)]
pub enum Kind {
    /// Poisson disk points of the unit square, cube, ...: a minimum distance, and no room for another point
    Poisson(poisson::PoissonArgs),
    /// Independent points of the unit square, cube, ... that follow a density
    White(white::WhiteArgs),
    /// Uniform points in a torus or in a closed surface
    Volume(volume::VolumeArgs),
}

/// Arguments of all distributions.
#[derive(Debug, Args)]
pub struct Common {
    /// Seed of the points
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = crate::cli::parse::seed)]
    pub seed: u64,
    /// File for the points: .csv, .npy or .bin
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Coordinates in single precision
    #[arg(long)]
    pub single: bool,
    /// Worker threads [default: all cores]; the points do not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print a description as one line of JSON instead of the points
    #[arg(long)]
    pub json: bool,
}

/// Description of the points for `--json`.
#[derive(Serialize)]
struct Made<T: Serialize> {
    points: usize,
    dimensions: usize,
    out: Option<String>,
    #[serde(flatten)]
    facts: T,
}

impl Common {
    /// Writes the file and prints the result.
    fn deliver(&self, points: &Points, facts: impl Serialize, line: &str) -> Result<(), Failure> {
        let pool = super::threads(self.threads)?;
        if let Some(path) = &self.out {
            pool.install(|| points.write(path, self.single))?;
        } else if !self.json {
            return print(&pool.install(|| points.csv(self.single)));
        }
        let out = self.out.as_deref().map(|path| path.display().to_string());
        if self.json {
            let dimensions = points.dimensions;
            return print_json(&Made { points: points.len(), dimensions, out, facts }, false);
        }
        print(&format!(
            "{}: {} points in {}D; {line}",
            out.unwrap_or_default(),
            points.len(),
            points.dimensions
        ))
    }

    /// Checks before the work that the output file has a known extension, can be written and is not the
    /// `input`.
    fn check(&self, input: Option<&Path>) -> Result<(), Failure> {
        let out = self.out.as_deref();
        out.map(file::Format::of).transpose()?;
        super::outputs::may_hold_results(("--out", out), input)
    }
}

fn usage(message: impl std::fmt::Display) -> Failure {
    Failure { message: message.to_string(), code: 2 }
}

pub(super) fn run(args: &SampleArgs, terminal: &Terminal) -> Result<(), Failure> {
    match &args.kind {
        Kind::Poisson(args) => poisson::run(args, terminal),
        Kind::White(args) => white::run(args),
        Kind::Volume(args) => volume::run(args),
    }
}
