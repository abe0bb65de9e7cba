//! The seam of the house: what the pipeline *did*, in integers, before anyone asks when or at what cost.
//!
//! - [`Unit`] and [`Event`]: the units of the block diagram and what each of them counts. One
//!   declaration gives the enum, the docs, the column in a file and the key of an energy table.
//! - [`Counts`]: one integer per event; workers own theirs and add them up.
//! - [`Packet`]: a piece of work that moves through the units as one, with the events it causes.
//! - [`LineAccess`]: a line of memory a packet asks the L2 for, in order.
//! - [`Timeline`]: counts over time, made by a timing model, read by a power model.
//! - [`inputs`]: opening files so that it is known which were.
//! - [`Bounded`]: a whole number that cannot be built out of range.
//! - [`spec`]: reading RON files with the place of every mistake and a suggestion.
//!
//! This crate knows no triangle, no clock rate and no joule, and depends on nothing else of the house.

mod bounded;
mod counts;
mod events;
pub mod inputs;
mod lines;
mod packet;
pub mod spec;
mod timeline;

pub use bounded::{Bounded, OutOfBounds};
pub use counts::Counts;
pub use events::{Event, Unit};
pub use lines::{LineAccess, LineKind};
pub use packet::{Packet, PacketCounts, PacketKind};
pub use timeline::{Bin, Timeline};
