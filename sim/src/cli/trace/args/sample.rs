//! What can be typed after `quintile trace sample`.

use std::path::PathBuf;

use clap::Args;

use super::InputArgs;

/// Arguments of `trace sample`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  quintile trace sample meter.parquet --device-rate 1000 --bits 10 --specified-voltage 12 --out coarse.parquet"
)]
pub struct SampleArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// The device in a JSON file; the flags below change it
    #[arg(long, value_name = "FILE.json")]
    pub device: Option<PathBuf>,
    /// Samples per second, 1 to 10 million
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub device_rate: Option<f64>,
    /// Bits of both converters
    #[arg(long, value_name = "N")]
    pub bits: Option<u32>,
    /// Highest current, the lowest is its negative
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub current_range: Option<f64>,
    /// Highest voltage, the lowest is its negative
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub voltage_range: Option<f64>,
    /// Voltage of the rail without load
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub rail_voltage: Option<f64>,
    /// Resistance of the rail
    #[arg(long, value_name = "OHM", allow_negative_numbers = true)]
    pub rail_ohm: Option<f64>,
    /// Noise of the current, A rms
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub current_noise: Option<f64>,
    /// Noise of the voltage, V rms
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub voltage_noise: Option<f64>,
    /// Factor on the current: 1.01 for a gain 1 % too high
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    pub current_gain: Option<f64>,
    /// Offset of the current
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub current_offset: Option<f64>,
    /// Factor on the voltage
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    pub voltage_gain: Option<f64>,
    /// Offset of the voltage
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub voltage_offset: Option<f64>,
    /// Take the voltage to be this, by specification, instead of measuring it
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    pub specified_voltage: Option<f64>,
    /// Time constant of the low-pass in seconds
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub low_pass: Option<f64>,
    /// Samples that travel together, and are lost together
    #[arg(long, value_name = "N")]
    pub packet_samples: Option<u32>,
    /// Share of packets that are lost, 0 to below 1: gaps in the file
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    pub packet_loss: Option<f64>,
    /// Seed of noise and losses
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = crate::cli::parse::seed)]
    pub seed: Option<u64>,
    /// File to write, as for `trace convert`
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
}
