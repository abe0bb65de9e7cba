//! Power model: activity over time becomes power over time, from an energy table and a platform.
//!
//! - [`EnergyTable`]: energy per [`activity::Event`], with low, nominal and high value and a source in each
//!   row.
//! - [`Platform`]: voltages, constant power, leakage, clock trees and idle power.
//! - [`Structure`]: memories and logic of a GPU, and what they cost in area, energy and leakage beside those
//!   of the GPU that a platform was made for ([`Scaling`]).
//! - [`Part`] and [`Energy`]: energy by part. The sum over parts is the exact energy of a frame.
//! - [`PowerModel`]: converts an [`activity::Timeline`] to a [`FramePower`].
//! - [`pace`]: puts frames one after another, under V-sync or free-running, into one power curve.
//! - [`System::surround`]: adds launch, blocking calls and the operating system to that curve.
//!
//! The power in every bin of the timeline is
//!
//! ```text
//! P(t) = P_constant + P_leak(V, T) + sum over events of E_event rate_event(t) (V/V0)^2
//!      + sum over used units of [ busy_unit(t) P_clock,unit + (1 - busy_unit(t)) P_idle,unit ] (V/V0)^2
//! ```
//!
//! Energies are computed first: counts times joules, and watts times the true length of the bin. Power is
//! derived from them, so a partial last bin loses nothing. The crate contains no geometry and no clock rate,
//! and also accepts counts from a file ([`PowerModel::counts_energy`]).
//!
//! ```
//! use activity::{Counts, Event};
//! use power_model::{EnergyTable, Platform, PowerModel};
//!
//! let (table, platform) = (EnergyTable::builtin("28nm")?, Platform::builtin("reference")?);
//! let model = PowerModel::new(&table, &platform)?;
//! let mut counts = Counts::default();
//! counts[Event::DramReadBytes] = 1_000_000;
//! let read_j = model.counts_energy(&counts).total_j();
//! counts[Event::DramReadBytes] *= 2;
//! assert!((model.counts_energy(&counts).total_j() - 2.0 * read_j).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod model;
mod pacing;
mod platform;
mod quantity;
mod structure;
mod system;
mod table;

use activity::spec::SpecError;

pub use model::{Energy, FramePower, PARTS, Part, PowerModel};
pub use pacing::{PacedFrame, PacedRun, Pacing, pace};
pub use platform::{
    Disturbance, Finish, Launch, Leakage, Platform, Rail, Range, Ranges, ScaledFrom, System, UnitPower,
    ValueSource,
};
pub use quantity::{
    Basis, Bound, Celsius, Exponent, Hertz, Interval, OutOfRange, Picojoules, Quantity, Ratio, Seconds,
    Share, Source, Sourced, Volts, Watts,
};
pub use structure::{
    Charge, INTERPOLATION, LANE_MADDS, Memory, MemoryCost, REGISTER_BYTES, Scaling, Sram, SramRun, Structure,
    UncertainValue, madds,
};
pub use system::{Cause, Circumstances, Pulse, Surrounded, SurroundedFrame, overlay};
pub use table::{EnergyRow, EnergyTable, Supply, TableEntry};

/// Why an energy table cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum EnergyTableError {
    /// The file cannot be read, is not RON, or has an invalid row.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// No built-in table has this name.
    #[error("no built-in energy table is called `{name}`: {suggestion}")]
    Unknown {
        /// Name given.
        name: String,
        /// Nearest known name.
        suggestion: String,
    },
    /// An event has two rows.
    #[error("{path}: event `{event}` is listed more than once: keep one row")]
    Duplicate {
        /// File.
        path: String,
        /// Event.
        event: &'static str,
    },
    /// An event has no row.
    #[error("{path}: event `{event}` has no row: add one under `rows`, or under `free` with the reason")]
    Missing {
        /// File.
        path: String,
        /// Event.
        event: &'static str,
    },
    /// The reference voltage is outside the table's own voltage range.
    #[error("{path}: v0_v is not between v_min_v and v_max_v: put v_min_v <= v0_v <= v_max_v")]
    Voltages {
        /// File.
        path: String,
    },
}

/// Why a platform cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PlatformError {
    /// The file cannot be read, is not RON, or has an invalid number.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// No built-in platform has this name.
    #[error("no built-in platform is called `{name}`: {suggestion}")]
    Unknown {
        /// Name given.
        name: String,
        /// Nearest known name.
        suggestion: String,
    },
    /// A unit has two rows under `units`.
    #[error("{path}: unit `{unit}` is listed more than once under `units`: keep one row")]
    DuplicateUnit {
        /// File.
        path: String,
        /// Unit.
        unit: &'static str,
    },
    /// A unit has no row under `units`.
    #[error("{path}: unit `{unit}` has no row under `units`: add one")]
    MissingUnit {
        /// File.
        path: String,
        /// Unit.
        unit: &'static str,
    },
    /// Two disturbances have the same name.
    #[error(
        "{path}: disturbance `{name}` is listed more than once under `system`: keep one, or name them apart"
    )]
    DuplicateDisturbance {
        /// File.
        path: String,
        /// Name.
        name: String,
    },
    /// An event is overridden twice.
    #[error("{path}: event `{event}` is listed more than once under `energy_rows`: keep one row")]
    DuplicateRow {
        /// File.
        path: String,
        /// Event.
        event: &'static str,
    },
}

/// Why a table and a platform do not fit together.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// The platform's process node differs from the table's.
    #[error(
        "platform `{platform}` is a {platform_nm} nm part but energy table `{table}` is for {table_nm} nm: \
         use a table for its node, or scale one with `energy_from`"
    )]
    Node {
        /// Platform.
        platform: String,
        /// Node of the tables it uses, in nanometres.
        platform_nm: u32,
        /// Table.
        table: String,
        /// Node of the table, in nanometres.
        table_nm: u32,
    },
    /// The core voltage is outside the range of the table's voltage scaling.
    #[error(
        "platform `{platform}` runs at {v_v} V but energy table `{table}` scales only from {low_v} to \
         {high_v} V: change v_v, or use a table for that voltage"
    )]
    Voltage {
        /// Platform.
        platform: String,
        /// Core voltage of the platform, V.
        v_v: f64,
        /// Table.
        table: String,
        /// Lowest voltage of the scaling, V.
        low_v: f64,
        /// Highest voltage of the scaling, V.
        high_v: f64,
    },
    /// The leakage at the platform's voltage and temperature exceeds any power supply.
    #[error(
        "platform `{platform}` leaks {leakage_w:.3e} W at its voltage and temperature, more than {most_w} W: check leakage.doubling_c, \
         leakage.voltage_exponent and v0_v"
    )]
    Leakage {
        /// Platform.
        platform: String,
        /// Leakage, W.
        leakage_w: f64,
        /// Largest allowed leakage, W.
        most_w: f64,
    },
}

/// Why a timeline cannot be converted to power.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TimelineError {
    /// The bin length is 0.
    #[error("the timeline's bins are 0 ps long: make them at least 1 ps")]
    EmptyBin,
    /// The bins end before the frame.
    #[error(
        "the timeline has {bins} bins of {bin_ps} ps for a frame of {duration_ps} ps: add bins up to its end"
    )]
    TooShort {
        /// Number of bins.
        bins: usize,
        /// Length of a bin in picoseconds.
        bin_ps: u64,
        /// Length of the frame in picoseconds.
        duration_ps: u64,
    },
    /// A bin that begins at or after the end of the frame has activity.
    #[error("bin {bin} of the timeline is active although the frame has ended: make duration_ps cover it")]
    AfterEnd {
        /// Bin number, from 0.
        bin: usize,
    },
    /// A unit is busy for longer than its bin lasts within the frame.
    #[error(
        "bin {bin} of the timeline has unit `{unit}` busy for {busy_ps} of {length_ps} ps: count a unit once \
         however many copies of it work, and end the frame after its last work"
    )]
    TooBusy {
        /// Bin number, from 0.
        bin: usize,
        /// Unit.
        unit: &'static str,
        /// Busy time in picoseconds.
        busy_ps: u64,
        /// Length of the bin within the frame, in picoseconds.
        length_ps: u64,
    },
}

/// Why frames cannot be paced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PacingError {
    /// The list of frames is empty.
    #[error("there are no frames to pace: render at least one")]
    NoFrames,
    /// The V-sync rate is out of range.
    #[error("the V-sync rate: {0}")]
    Rate(#[from] OutOfRange),
    /// The run is too long for 64 bits of picoseconds.
    #[error("the run lasts more than 213 days: pace fewer frames")]
    TooLong,
    /// Too many disturbances in the run.
    #[error("the run of {run_s} s would have more than {most} disturbances: shorten it, or make them rarer")]
    TooDisturbed {
        /// Length of the run, s.
        run_s: f64,
        /// Largest number of disturbances.
        most: usize,
    },
    /// The power curve rejects a step.
    #[error("the power curve of the run: {0}")]
    Curve(#[from] traces::CurveError),
}
