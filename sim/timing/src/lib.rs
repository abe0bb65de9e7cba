//! When it happens. One description of a machine, one stream of packets, and a ladder of models of the time they take.
//!
//! - [`MachineSpec`]: the units of the block diagram, with throughput, latency, queues and clocks.
//! - [`Jobs`] and [`Job`]: what a packet owes each unit, in cycles; every level reads the same.
//! - [`Level`] and [`FrameClock`]: the ladder, and a clock at any rung of it; [`AccuracyWarning`]: where a rung is not to be trusted.
//! - [`stepped`]: the reference, from cycle to cycle.
//! - [`PacketClock`]: packets, not cycles: a recurrence, with calendars for what is shared.
//! - [`BoundClock`]: no packets: the busiest unit of each stretch, from [`Totals`] gathered while packets come by.
//! - [`sampled`]: which frames of many to simulate, and what they say of the others.
//! - [`streams`]: packets that break levels, and packets that ask for one rate alone.
//! - [`Recorder`]: events and busy time over time; [`Stalls`]: why units did not work.
//!
//! The crate knows no triangle and no joule, and what happens is decided before it is asked: caches are walked in the order
//! of the stream, here they take their time.

mod address;
mod bound;
mod clock;
mod frame_clock;
mod job;
mod packet;
mod rates;
mod recorder;
pub mod sampled;
mod spec;
mod stalls;
pub mod stepped;
pub mod streams;
mod warning;

pub use bound::{BoundClock, Totals, bound};
pub use clock::{Clocks, Time};
pub use frame_clock::{FrameClock, Level, Machine, TimingError};
pub use job::{CLIENTS, Job, Jobs, Place};
pub use packet::{MAX_CYCLES, PacketClock};
pub use rates::Rates;
pub use recorder::Recorder;
pub use spec::{
    Chips, ClientSpec, Clock, Common, Cycles, DramSpec, Entries, L2Spec, MachineSpec, RowBytes, ShaderSpec,
    UnitSpec, WaitCycles, Width,
};
pub use stalls::{Reason, Stalls, UnitTime};
pub use warning::AccuracyWarning;

/// Bytes of a line of memory.
pub const LINE_BYTES: u32 = 64;

/// A frame in time.
#[derive(Clone, Debug, PartialEq)]
pub struct Timed {
    /// Events and busy time over time.
    pub timeline: activity::Timeline,
    /// Cycles of the core clock.
    pub cycles: u64,
    /// Why units did not work, where the level knows.
    pub stalls: Option<Stalls>,
    /// Units visited, summed over cycles; 0 where the level has no cycles.
    pub unit_cycles: u64,
    /// Packets of the stream.
    pub packets: u64,
    /// For how long the bank of memory that is busiest with it opens and closes rows, over the busy time of the unit that is
    /// busiest; where the level knows. Levels differ most where it is large, as they reorder lines differently.
    pub rows: Option<f64>,
}

/// A length of time over the busy time of the busiest unit.
fn over_busiest(length_ps: u64, timeline: &activity::Timeline) -> f64 {
    let busiest = timeline.busy_ps().into_iter().max().unwrap_or(0);
    length_ps as f64 / busiest.max(1) as f64
}
