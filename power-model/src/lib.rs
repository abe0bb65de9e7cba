//! Power model: activity over time becomes power over time, from an energy table and a platform.
//!
//! - [`EnergyTable`]: energy per [`activity::Event`], with low, nominal and high value and a source in each
//!   row.
//! - [`Platform`]: voltages, constant power, leakage, clock trees and idle power.
//! - [`Structure`]: memories and logic of a GPU, and what they cost in area, energy and leakage beside those of the GPU that a platform
//!   was made for ([`Scaling`]).
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

mod error;
mod model;
mod pacing;
mod platform;
mod quantity;
mod structure;
mod system;
mod table;

pub use error::{ModelError, PacingError, PlatformError, TableError, TimelineError};
pub use model::{Energy, FramePower, PARTS, Part, PowerModel};
pub use pacing::{PacedFrame, Pacing, Run, pace};
pub use platform::{
    Disturbance, Finish, Launch, Leakage, Platform, Provenance, Rail, Range, Ranges, ScaledFrom, System,
    UnitPower,
};
pub use quantity::{
    Basis, Bound, Celsius, Exponent, Hertz, Interval, OutOfRange, Picojoules, Quantity, Ratio, Seconds,
    Share, Source, Sourced, Volts, Watts,
};
pub use structure::{
    Charge, Cost, Estimate, INTERPOLATION, LANE_MADDS, Memory, REGISTER_BYTES, Scaling, Sram, SramRun,
    Structure, madds,
};
pub use system::{Cause, Circumstances, Pulse, Surrounded, SurroundedFrame, overlay};
pub use table::{EnergyRow, EnergyTable, Entry, Supply};
