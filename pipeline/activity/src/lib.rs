//! Activity: what the modelled hardware did, in integers. It is the interface between the pipeline, the
//! timing models and the power model.
//!
//! - [`Unit`] and [`Event`]: the units of the block diagram and the events each unit counts. One declaration
//!   gives the enum, the docs, the column in a file and the key of an energy table.
//! - [`Counts`]: one integer per event, one set per worker, summed at the end.
//! - [`Packet`]: work that moves through the units as one, with the events it causes.
//! - [`LineAccess`]: a request of a packet for a memory line, in order.
//! - [`PacketStream`]: the packets of a frame in few bytes.
//! - [`Timeline`]: counts over time, written by a timing model and read by a power model.
//! - [`inputs`]: recording of the files that a run reads.
//! - [`Bounded`]: an integer with a range in its type.
//! - [`spec`]: reading of RON files, with line, column and a suggestion in each error.
//!
//! ```
//! use activity::{Counts, Event};
//!
//! let mut counts = Counts::default();
//! counts[Event::SamplesTested] = 64;
//! counts[Event::SamplesHit] = 16;
//! assert_eq!(counts.sample_test_efficiency(), Some(0.25));
//! ```
//!
//! The crate contains no geometry, clock rate or energy, and depends on no other crate of the workspace.

mod events;
pub mod inputs;
mod packet;
pub mod spec;
mod stream;

pub use events::{Event, Unit};
pub use packet::{
    Bin, Counts, LEVELS, LevelRequests, LineAccess, LineKind, Packet, PacketBuffer, PacketCounts, PacketKind,
    Timeline, Waits,
};
pub use spec::{Bounded, OutOfBounds};
pub use stream::{PacketStream, StreamError, StreamWriter};

/// Seconds in a picosecond.
pub const S_PER_PS: f64 = 1e-12;
/// Picoseconds in a second. The product with one of the two constants and the quotient by the other may differ
/// in the last bit.
pub const PS_PER_S: f64 = 1e12;
