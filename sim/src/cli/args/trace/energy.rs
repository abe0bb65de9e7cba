//! Arguments of `quintile trace energy`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::parse::{pass, segment};
use super::{FindArgs, InputArgs};
use crate::cli::quantity::{power, size_of_power, time};

/// Arguments about frames; they do not apply to a segment.
const OF_FRAMES: [&str; 11] = [
    "mark",
    "mark_file",
    "auto",
    "end",
    "stream",
    "pixels",
    "pass",
    "discard",
    "drop_outliers",
    "run",
    "busy_above",
];

/// Arguments of `trace energy`.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  quintile trace energy meter.csv --from 1.5 --to 2.5\n  quintile trace energy meter.csv --mark 2.513 --idle 0..0.4 --pass shadow=0 --pass light=4.2 --discard auto --drop-outliers"
)]
pub struct EnergyArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// The frames.
    #[command(flatten)]
    pub find: FindArgs,
    /// Begin of a segment, in seconds or with its unit; a segment needs no frames
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = time, conflicts_with_all = OF_FRAMES)]
    pub from: Option<f64>,
    /// End of the segment, in seconds or with its unit
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = time, conflicts_with_all = OF_FRAMES)]
    pub to: Option<f64>,
    /// A segment without rendering, in seconds or with units; its mean power is subtracted
    #[arg(long, value_name = "A..B", value_parser = segment, allow_hyphen_values = true, conflicts_with_all = ["idle_w", "idle_trace"])]
    pub idle: Option<(f64, f64)>,
    /// Idle power to subtract, in W
    #[arg(long, value_name = "W", conflicts_with = "idle_trace", allow_hyphen_values = true, value_parser = size_of_power)]
    pub idle_w: Option<f64>,
    /// A recording without rendering, to subtract
    #[arg(long, value_name = "TRACE")]
    pub idle_trace: Option<PathBuf>,
    /// How the recording is subtracted
    #[arg(long, value_enum, default_value_t, requires = "idle_trace")]
    pub idle_by: IdleBy,
    /// A pass within every frame: its name, and when it begins after the start of the frame, in milliseconds or with its unit
    #[arg(long, value_name = "NAME=MS", value_parser = pass)]
    pub pass: Vec<(String, f64)>,
    /// Leave out the first frames: a number, or `auto` to find the warm-up
    #[arg(long, value_name = "N", default_value = "0", value_parser = discard)]
    pub discard: Discard,
    /// Leave out frames that differ from those around them
    #[arg(long)]
    pub drop_outliers: bool,
    /// Another run of the same thing, with the same marks; may be given several times
    #[arg(long, value_name = "TRACE")]
    pub run: Vec<PathBuf>,
    /// Power above which the old method takes a frame's work to go on, in W; a tenth above idle without it
    #[arg(long, value_name = "W", allow_hyphen_values = true, value_parser = power)]
    pub busy_above: Option<f64>,
    /// Print everything as JSON and nothing else
    #[arg(long)]
    pub json: bool,
}

/// How an idle recording is subtracted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum IdleBy {
    /// Its mean power, at all times
    #[default]
    Mean,
    /// Instant by instant
    Instant,
}

/// Frames to leave out at the beginning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Discard {
    /// This number of frames.
    Count(usize),
    /// Frames before the mean is stable.
    Auto,
}

fn discard(text: &str) -> Result<Discard, String> {
    match text {
        "auto" => Ok(Discard::Auto),
        _ => text
            .parse()
            .map(Discard::Count)
            .map_err(|_| format!("`{text}` is neither a number of frames nor auto")),
    }
}
