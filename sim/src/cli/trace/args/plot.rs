//! What can be typed after `quintile trace plot`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::parse::not_negative;
use super::{FindArgs, InputArgs};

/// Arguments of `trace plot`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  quintile trace plot meter.parquet --from 2 --to 2.5 --out curve.svg\n  quintile trace plot meter.parquet --kind energy --mark 2.513 --out energy.png"
)]
pub struct PlotArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// The frames, for kinds that show them.
    #[command(flatten)]
    pub find: FindArgs,
    /// What to draw
    #[arg(long, value_enum, default_value_t)]
    pub kind: PlotKind,
    /// Begin of what is shown of the curve
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub from: Option<f64>,
    /// End of what is shown of the curve
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub to: Option<f64>,
    /// Time over which the curve's mean is drawn, in milliseconds; the whole range over 50 without it
    #[arg(long, value_name = "MS", allow_negative_numbers = true, value_parser = not_negative)]
    pub low_pass: Option<f64>,
    /// Which frame, for `frame`; the middle one without it
    #[arg(long, value_name = "N")]
    pub frame: Option<usize>,
    /// Another run of the same thing, for `repeats`
    #[arg(long, value_name = "TRACE")]
    pub run: Vec<PathBuf>,
    /// File: .svg, .png or .pdf
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Print what was drawn as JSON
    #[arg(long)]
    pub json: bool,
}

/// What to draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum PlotKind {
    /// Power over time: lowest and highest of each column, and a mean
    #[default]
    Curve,
    /// One frame
    Frame,
    /// Frames on top of one another
    Overlay,
    /// Energy of each frame
    Energy,
    /// How often which energy occurs
    Histogram,
    /// Mean energy over the number of frames left out at the beginning
    Discard,
    /// Mean and standard deviation of each frame over repeated runs
    Repeats,
}
