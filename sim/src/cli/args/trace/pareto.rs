//! Arguments of `quintile trace pareto`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::cli::args::LookArgs;
use crate::cli::quantity::size_of_power;

/// Arguments of `trace pareto`.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Example:\n  quintile trace pareto results.csv --time time_ms --energy energy_mJ --label algorithm --group scene --group msaa --idle-w 14 --out pareto.svg"
)]
pub struct ParetoArgs {
    /// A table with a row for each setting: CSV, TSV or Parquet; `-` reads standard input
    #[arg(value_name = "TABLE")]
    pub table: PathBuf,
    /// The column of times; its unit is taken from its name (s without one)
    #[arg(long, value_name = "COLUMN", default_value = "time_ms")]
    pub time: String,
    /// The column of energies; its unit is taken from its name (J without one)
    #[arg(long, value_name = "COLUMN", default_value = "energy_mJ")]
    pub energy: String,
    /// The column of standard deviations of the times
    #[arg(long, value_name = "COLUMN")]
    pub time_sd: Option<String>,
    /// The column of standard deviations of the energies
    #[arg(long, value_name = "COLUMN")]
    pub energy_sd: Option<String>,
    /// The column of names; the number of the row without it
    #[arg(long, value_name = "COLUMN")]
    pub label: Option<String>,
    /// A column whose values make groups, each with a frontier; may be given several times
    #[arg(long, value_name = "COLUMN")]
    pub group: Vec<String>,
    /// Idle power that the faster of two is charged for the time it saves, in W
    #[arg(long, value_name = "W", default_value = "0", allow_hyphen_values = true, value_parser = size_of_power)]
    pub idle_w: f64,
    /// Seed of the draws for probabilities
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = crate::cli::parse::seed)]
    pub seed: u64,
    /// What the plot shows over time: energy, or mean power as Paper IV does
    #[arg(long, value_enum, default_value_t)]
    pub show: ParetoShow,
    /// File for a plot (.svg, .png, .pdf) or a table (.csv); `-` prints the table as CSV and nothing else
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Print as JSON and nothing else
    #[arg(long)]
    pub json: bool,
    /// Whether the result goes to standard output.
    #[arg(skip)]
    pub piped: bool,
    /// Style of pictures.
    #[command(flatten)]
    pub look: LookArgs,
}

/// What a plot of frontiers shows over time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ParetoShow {
    /// Energy
    #[default]
    Energy,
    /// Energy by time (Paper IV, Figures 7 to 9)
    Power,
}
