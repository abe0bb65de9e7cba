//! Arguments of `quintile trace sample`.

use std::path::PathBuf;

use clap::Args;
use traces::device::MAX_PACKET_SAMPLES;

use super::{InputArgs, TraceFormat};
use crate::cli::parse::{gain, share_below_one};
use crate::cli::quantity::{
    current, length_of_time, positive_current, positive_voltage, rate, resistance, size_of_current,
    size_of_voltage, voltage,
};

/// Arguments of `trace sample`.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Example:\n  quintile trace sample meter.parquet --device-rate 1kHz --bits 10 --specified-voltage 12V --out coarse.parquet\n\n\
    Without --device the recorder has the defaults above and a range that fits the trace. Options with a unit take a number in that\n\
    unit, or with any unit of its kind: 1kHz, 20us, 5mV, 250mA, 4mOhm."
)]
pub struct SampleArgs {
    /// The trace.
    #[command(flatten)]
    pub input: InputArgs,
    /// The device in a JSON file, whose defaults are those below and +-30 A, +-20 V; the options below change it
    #[arg(long, value_name = "FILE.json")]
    pub device: Option<PathBuf>,
    /// Samples per second, 1 to 10 million (default: 50kHz)
    #[arg(long, value_name = "HZ", allow_hyphen_values = true, value_parser = rate)]
    pub device_rate: Option<f64>,
    /// Bits of both converters, 1 to 24 (default: 14)
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = clap::value_parser!(u32).range(1..=24))]
    pub bits: Option<u32>,
    /// Highest current, the lowest is its negative (default: the smallest of 1mA, 3mA, 10mA, ... that holds the trace's peak)
    #[arg(long, value_name = "A", allow_hyphen_values = true, value_parser = positive_current)]
    pub current_range: Option<f64>,
    /// Highest voltage, the lowest is its negative (default: 1.5 times the rail's)
    #[arg(long, value_name = "V", allow_hyphen_values = true, value_parser = positive_voltage)]
    pub voltage_range: Option<f64>,
    /// Voltage of the rail without load (default: the trace's highest)
    #[arg(long, value_name = "V", allow_hyphen_values = true, value_parser = positive_voltage)]
    pub rail_voltage: Option<f64>,
    /// Resistance of the rail (default: 4mOhm, less where the range is above 25 A)
    #[arg(long, value_name = "OHM", allow_hyphen_values = true, value_parser = resistance)]
    pub rail_ohm: Option<f64>,
    /// Noise of the current, rms (default: a 6000th of the highest current)
    #[arg(long, value_name = "A", allow_hyphen_values = true, value_parser = size_of_current)]
    pub current_noise: Option<f64>,
    /// Noise of the voltage, rms (default: a 10000th of the highest voltage)
    #[arg(long, value_name = "V", allow_hyphen_values = true, value_parser = size_of_voltage)]
    pub voltage_noise: Option<f64>,
    /// Factor on the current: 1.01 for a gain 1 % too high (default: 1)
    #[arg(long, value_name = "FACTOR", allow_hyphen_values = true, value_parser = gain)]
    pub current_gain: Option<f64>,
    /// Offset of the current (default: 0A)
    #[arg(long, value_name = "A", allow_hyphen_values = true, value_parser = current)]
    pub current_offset: Option<f64>,
    /// Factor on the voltage (default: 1)
    #[arg(long, value_name = "FACTOR", allow_hyphen_values = true, value_parser = gain)]
    pub voltage_gain: Option<f64>,
    /// Offset of the voltage (default: 0V)
    #[arg(long, value_name = "V", allow_hyphen_values = true, value_parser = voltage)]
    pub voltage_offset: Option<f64>,
    /// Record this voltage, by specification, instead of measuring it (default: measured)
    #[arg(long, value_name = "V", allow_hyphen_values = true, value_parser = positive_voltage)]
    pub specified_voltage: Option<f64>,
    /// Time constant of a low-pass on the power, in seconds or with its unit (default: none)
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = length_of_time)]
    pub low_pass: Option<f64>,
    /// Samples in one packet; a packet is lost as a whole (default: 512)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_PACKET_SAMPLES)))]
    pub packet_samples: Option<u32>,
    /// Share of packets that are lost, 0 to below 1: gaps in the file (default: 0)
    #[arg(long, value_name = "SHARE", allow_hyphen_values = true, value_parser = share_below_one)]
    pub packet_loss: Option<f64>,
    /// Seed of noise and losses (default: 1)
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = crate::cli::parse::seed)]
    pub seed: Option<u64>,
    /// File to write, as for `trace convert`; `-` is standard output
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
    /// Format of standard output, where --out is `-` (default: csv)
    #[arg(long, value_enum, value_name = "FORMAT")]
    pub format: Option<TraceFormat>,
    /// Whether the result goes to standard output.
    #[arg(skip)]
    pub piped: bool,
}
