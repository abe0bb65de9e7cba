//! Timing: when the activity happens. One machine description, one stream of packets, and several levels of
//! models.
//!
//! - [`MachineSpec`]: throughput, latency, queues and clocks of the units of the block diagram.
//! - [`DemandBuilder`] and [`ServiceDemand`]: cycles that a packet needs at each station, the same for all
//!   levels.
//! - [`Level`] and [`FrameClock`]: the levels, and a clock for any of them; [`AccuracyWarning`]: known
//!   inaccuracies.
//! - [`stepped`]: the reference, cycle by cycle.
//! - [`PacketClock`]: a recurrence over packets, with calendars for shared resources.
//! - [`BoundClock`]: a roofline over segments of the stream, from [`Totals`] gathered while packets arrive.
//! - [`sampled`]: which frames of an animation to simulate, and estimates of the others.
//! - [`streams`]: streams that challenge the levels, and microbenchmarks of single rates.
//! - [`PassTime`]: when a pass began and ended, the time of its work in every unit, and that of its draws.
//! - [`Recorder`]: events and busy time over time; [`Stalls`]: why units did not work.
//!
//! The crate contains no geometry and no energy. The activity is fixed before its timing: cache hits and
//! misses are decided in stream order, and the levels here only add their time.
//!
//! ```
//! use activity::Unit;
//! use timing::Recorder;
//!
//! // Bins of 1000 ps; a rasterizer that works for one and a half of them.
//! let mut recorder = Recorder::new(1000, 16);
//! recorder.busy(Unit::Traversal, 500, 2000, 1, 1);
//! let timeline = recorder.finish();
//! let busy: Vec<u64> = timeline.bins.iter().map(|bin| bin.busy_ps[Unit::Traversal as usize]).collect();
//! assert_eq!(busy, [500, 1000]);
//! ```

mod address;
mod bound;
mod chips;
mod clock;
mod data_unit;
mod demand;
mod draws;
mod frame_clock;
mod packet;
mod passes;
mod recorder;
pub mod sampled;
mod service;
mod spec;
pub mod stepped;
pub mod streams;

pub use bound::{BoundClock, Totals, bound};
pub use clock::{Clocks, Time};
pub use demand::{CLIENTS, DemandBuilder, ServiceDemand, Station};
pub use draws::DrawSpan;
pub use frame_clock::{AccuracyWarning, FrameClock, Level, Machine, TimingError};
pub use packet::{MAX_CYCLES, PacketClock};
pub use passes::PassTime;
pub use recorder::{Reason, Recorder, Stalls, UnitTime};
pub use service::{CYCLE, Work};
pub use spec::{
    BinsSpec, Chips, ClientSpec, Clock, Common, Cycles, DramSpec, Entries, MachineSpec, Rates, RefreshSpec,
    RowBytes, ShaderSpec, SharedCacheSpec, UnitSpec, WaitCycles, Width,
};

/// Bytes of a memory line.
pub const LINE_BYTES: u32 = 64;

/// Timing of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Timed {
    /// Events and busy time over time.
    pub timeline: activity::Timeline,
    /// Length in cycles of the core clock.
    pub cycles: u64,
    /// Why units did not work; only at the level `stepped`.
    pub stalls: Option<Stalls>,
    /// Simulated cycles summed over units; 0 at levels without cycles.
    pub unit_cycles: u64,
    /// Packets of the stream.
    pub packets: u64,
    /// Row time of the busiest memory bank over the busy time of the busiest unit; `None` at the level
    /// `stepped`. Levels differ most where it is large, as they order lines differently.
    pub rows: Option<f64>,
    /// Share of the frame for which a memory bank opens rows that it may not have to: lines of the same row that may wait side by
    /// side, in an order that is not known; only at the level `packet`.
    pub disputed: Option<f64>,
    /// Utilization of memory whose channels queue less than the time in which a row closes and another one opens; `None` if they queue
    /// more, and at the level `stepped`.
    pub short_queues: Option<f64>,
    /// Share of the frame that batches and passes may overlap, the longest packet of each; only at the level `bound`.
    pub overlap: Option<f64>,
    /// The passes of the frame, by number.
    pub passes: Vec<PassTime>,
    /// When the frame spent its time on which draw, in order; empty at the level `bound`, and at `packet` if draws take turns
    /// very often.
    pub spans: Vec<DrawSpan>,
}

/// Utilization of memory, if a queue of its channels holds less than the time in which a row closes and another one opens.
fn short_queues(dram: &DramSpec, timeline: &activity::Timeline) -> Option<f64> {
    let writes = dram.write_queue.map_or(u32::MAX, |queue| queue.get());
    let queued = dram.queue.get().min(writes) * dram.burst_cycles.get();
    let busy_ps = timeline.busy_ps()[activity::Unit::Dram as usize];
    let is_short = queued < dram.precharge_cycles.get() + dram.activate_cycles.get();
    is_short.then(|| busy_ps as f64 / timeline.duration_ps.max(1) as f64)
}

/// `length_ps` over the busy time of the busiest unit.
fn ratio_to_busiest(length_ps: u64, timeline: &activity::Timeline) -> f64 {
    let busiest = timeline.busy_ps().into_iter().max().unwrap_or(0);
    length_ps as f64 / busiest.max(1) as f64
}
