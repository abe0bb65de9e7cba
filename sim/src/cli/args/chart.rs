//! Arguments of `chart` and of `stress`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use super::LookArgs;
use experiments::catalog::{ALL, CHARTS};
use experiments::study::Entry;

/// Arguments of `stress`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  quintile stress slivers --out slivers\n\n\
    Results are in DIR: plots/, stress.csv and summary.json. Ends with 1 if any method loses a sample.")]
pub struct StressArgs {
    /// One family; all without it
    pub family: Option<String>,
    /// Folder for the results; made where it is missing
    #[arg(long, value_name = "DIR", default_value = "out/stress")]
    pub out: PathBuf,
    /// Overwrite files in DIR that Quintile did not write
    #[arg(long)]
    pub force: bool,
    /// Smaller images, fewer triangles
    #[arg(long)]
    pub quick: bool,
    /// Worker threads; all cores without it. The results do not depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print summary.json to standard output and nothing else
    #[arg(long)]
    pub json: bool,
    /// How pictures look.
    #[command(flatten)]
    pub look: LookArgs,
}

/// Arguments of `chart`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  quintile chart sampling --quick --out charts\n\n\
    Results are in DIR: pictures as SVG and PNG, NAME.csv, NAME.json and NAME.md.")]
pub struct ChartArgs {
    /// Which chart
    #[arg(value_parser = charts(), value_name = "NAME")]
    pub chart: ChartArg,
    /// Another scene for `sampled`, `tile-tests` or `timing`, by name or file; may be given several times
    #[arg(long, value_name = "SCENE")]
    pub scene: Vec<String>,
    /// Smaller images, fewer samples and a coarser reference: seconds instead of minutes
    #[arg(long)]
    pub quick: bool,
    /// Folder for the results; made where it is missing
    #[arg(long, value_name = "DIR", default_value = "out/charts")]
    pub out: PathBuf,
    /// Overwrite files in DIR that Quintile did not write
    #[arg(long)]
    pub force: bool,
    /// Worker threads; all cores without it. Only times depend on it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print the numbers as JSON and nothing else
    #[arg(long)]
    pub json: bool,
    /// How pictures look.
    #[command(flatten)]
    pub look: LookArgs,
}

/// A chart, or all of them.
#[derive(Clone, Copy, Debug)]
pub enum ChartArg {
    /// Every chart and the failure catalogue.
    All,
    /// One chart.
    One(&'static Entry),
}

/// The names of the charts, each with its line of help.
fn charts() -> impl TypedValueParser<Value = ChartArg> {
    let values = CHARTS.iter().map(|chart| (chart.name, chart.about));
    let values = std::iter::once(ALL).chain(values).map(|(name, help)| PossibleValue::new(name).help(help));
    PossibleValuesParser::new(values).map(|name: String| {
        let chart = CHARTS.iter().find(|chart| chart.name == name);
        chart.map_or(ChartArg::All, ChartArg::One)
    })
}
