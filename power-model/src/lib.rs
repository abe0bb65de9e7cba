//! Joules per event and platforms: activity over time becomes watts over time.
//!
//! - [`EnergyTable`]: joules per [`activity::Event`], low, nominal and high, each row with its source.
//! - [`Platform`]: what surrounds the events: voltages, constant power, leakage, clock trees, idle.
//! - [`Part`] and [`Energy`]: where joules go. The sum over parts *is* a frame's energy, exactly.
//! - [`PowerModel`]: a [`activity::Timeline`] in, a [`FramePower`] out.
//! - [`pace`]: frames, one after another under V-sync or free-running, become one power curve.
//! - [`System::surround`]: what launch, a blocking finish and the operating system add to that curve.
//!
//! The equation (design, section 7), for every bin of the timeline:
//!
//! ```text
//! P(t) = P_constant + P_leak(V, T) + sum over events of E_event rate_event(t) (V/V0)^2
//!      + sum over used units of [ busy_unit(t) P_clock,unit + (1 - busy_unit(t)) P_idle,unit ] (V/V0)^2
//! ```
//!
//! Energies are computed first (counts times joules, watts times the bin's true length) and watts from
//! them, so that nothing is lost to a partial last bin. This crate knows no triangle and no clock rate; it can
//! be fed counts from a file ([`PowerModel::counts_energy`]).

mod error;
mod frame;
mod ledger;
mod model;
mod pacing;
mod parts;
mod platform;
mod quantity;
mod row;
mod system;
mod table;

pub use error::{ModelError, PacingError, PlatformError, TableError, TimelineError};
pub use frame::FramePower;
pub use model::PowerModel;
pub use pacing::{PacedFrame, Pacing, Run, pace};
pub use parts::{Energy, PARTS, Part};
pub use platform::{
    Disturbance, Finish, Launch, Leakage, Platform, Provenance, Rail, ScaledFrom, System, UnitPower,
};
pub use quantity::{
    Basis, Celsius, Exponent, Hertz, Interval, OutOfRange, Picojoules, Quantity, Ratio, Seconds, Share,
    Source, Sourced, Volts, Watts,
};
pub use row::{EnergyRow, Supply};
pub use system::{Cause, Circumstances, Pulse, Surrounded, SurroundedFrame, overlay};
pub use table::{Bound, EnergyTable, Entry};
