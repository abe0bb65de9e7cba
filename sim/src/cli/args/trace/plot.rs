//! Arguments of `quintile trace plot`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{FindArgs, InputArgs};
use crate::cli::args::LookArgs;
use crate::cli::quantity::{milliseconds, time};

/// Arguments of `trace plot`.
#[derive(Clone, Debug, Args)]
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
    /// Begin of what is shown of the curve, in seconds or with its unit
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = time)]
    pub from: Option<f64>,
    /// End of what is shown of the curve, in seconds or with its unit
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = time)]
    pub to: Option<f64>,
    /// Time over which the curve's mean is drawn, in milliseconds or with its unit; a fiftieth of the range without it
    #[arg(long, value_name = "MS", allow_hyphen_values = true, value_parser = milliseconds)]
    pub low_pass: Option<f64>,
    /// Keep the overview of a curve beside the trace as TRACE.pyramid: later plots of a long trace are then drawn at once
    #[arg(long)]
    pub keep_pyramid: bool,
    /// Which frame, for `frame`; the middle one without it
    #[arg(long, value_name = "N")]
    pub frame: Option<usize>,
    /// Another run of the same thing, for `repeats`
    #[arg(long, value_name = "TRACE")]
    pub run: Vec<PathBuf>,
    /// File: .svg, .png or .pdf; `-` is standard output
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Print what was drawn as JSON
    #[arg(long)]
    pub json: bool,
    /// Format of standard output, where --out is `-` (default: svg)
    #[arg(long, value_enum, value_name = "FORMAT")]
    pub format: Option<PlotFormat>,
    /// Whether the result goes to standard output.
    #[arg(skip)]
    pub piped: bool,
    /// Style of pictures.
    #[command(flatten)]
    pub look: LookArgs,
}

/// Formats of plots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names of the formats")]
pub enum PlotFormat {
    Svg,
    Png,
    Pdf,
}

impl PlotFormat {
    /// The ending of files of this format.
    pub fn name(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Png => "png",
            Self::Pdf => "pdf",
        }
    }
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
