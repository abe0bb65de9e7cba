//! When it happens: work packets become activity over time.
//!
//! One level so far, [`PacketClock`]: a recurrence over packets and units with bounded queues, no clock ticking. Time is
//! counted in integer picoseconds, so that sums are exact and the same everywhere.

mod packet_clock;
mod recorder;
mod service;

pub use packet_clock::PacketClock;
pub use recorder::Recorder;
pub use service::Service;
