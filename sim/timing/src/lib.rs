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

mod bound;
mod chips;
mod clock;
mod demand;
mod draws;
mod packet;
mod recorder;
pub mod sampled;
mod spec;
pub mod stepped;
pub mod streams;

use activity::{LineAccess, Packet};
use serde::{Deserialize, Serialize};
use warnings::{Code, Warning};

use packet::MAX_CYCLES;
use stepped::{Stalled, StepOptions, Stream};

pub use bound::{BoundClock, Totals, bound};
pub use clock::{Clocks, Time};
pub use demand::{CLIENTS, CYCLE, DemandBuilder, ServiceDemand, Station, Work};
pub use draws::{DrawSpan, PassTime};
pub use packet::PacketClock;
pub use recorder::{Reason, Recorder, Stalls, UnitTime};
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
    /// Share of the frame for which a memory bank opens rows that it may not have to: lines of the same row
    /// that may wait side by side, in an order that is not known; only at the level `packet`.
    pub disputed: Option<f64>,
    /// Utilization of memory whose channels queue less than the time in which a row closes and another one
    /// opens; `None` if they queue more, and at the level `stepped`.
    pub short_queues: Option<f64>,
    /// Share of the frame that batches and passes may overlap, the longest packet of each; only at the level `bound`.
    pub overlap: Option<f64>,
    /// The passes of the frame, by number.
    pub passes: Vec<PassTime>,
    /// When the frame spent its time on which draw, in order; empty at the level `bound`, and at `packet` if
    /// draws take turns very often.
    pub spans: Vec<DrawSpan>,
}

/// Utilization of memory, if a queue of its channels holds less than the time in which a row closes and
/// another one opens.
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

/// Timing level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// Every unit from cycle to cycle: the reference, slow
    Stepped,
    /// A recurrence over packets
    #[default]
    Packet,
    /// The busiest unit of each batch, fill and drain
    Bound,
}

impl Level {
    /// All levels, the most exact first.
    pub const ALL: [Self; 3] = [Self::Stepped, Self::Packet, Self::Bound];

    /// Name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Stepped => "stepped",
            Self::Packet => "packet",
            Self::Bound => "bound",
        }
    }
}

/// Why a frame could not be timed.
#[derive(Debug, thiserror::Error)]
pub enum TimingError {
    /// The level `stepped` reached a deadlock.
    #[error(transparent)]
    Stalled(#[from] Stalled),
    /// The frame is longer than the level `packet` can store.
    #[error(
        "a frame takes more than {MAX_CYCLES} cycles of the core clock, more than `--timing packet` holds: check the rates of the \
         GPU file, ask for fewer pixels or samples, or use `--timing bound`"
    )]
    TooLong,
    /// The clocks have no common grain; validated GPUs always have one.
    #[error("the clocks of GPU `{0}` have no common cycle")]
    Clocks(String),
}

/// The properties of a GPU that its timing depends on.
#[derive(Clone, Copy, Debug)]
pub struct Machine<'a> {
    /// Rates, latencies, queues and clock domains of all units.
    pub units: &'a MachineSpec,
    /// Both clocks.
    pub clocks: Clocks,
}

/// Clock of one frame, at any level.
pub struct FrameClock<'a> {
    machine: Machine<'a>,
    state: State,
}

enum State {
    Stepped(Box<(DemandBuilder, Stream, Recorder)>),
    Packet(Box<PacketClock>),
    Bound(Box<BoundClock>),
}

impl<'a> FrameClock<'a> {
    /// A clock at time 0.
    pub fn new(level: Level, machine: Machine<'a>, recorder: Recorder) -> Self {
        let Machine { units, clocks } = machine;
        let state = match level {
            Level::Stepped => {
                State::Stepped(Box::new((DemandBuilder::new(units), Stream::default(), recorder)))
            }
            Level::Packet => State::Packet(Box::new(PacketClock::new(units, clocks, recorder))),
            Level::Bound => State::Bound(Box::new(BoundClock::new(units, clocks, recorder))),
        };
        Self { machine, state }
    }

    /// Add the next packet of the stream and the lines it requests from the L2.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        match &mut self.state {
            State::Stepped(state) => state.1.push(&mut state.0, packet, lines),
            State::Packet(clock) => clock.push(packet, lines),
            State::Bound(clock) => clock.push(packet, lines),
        }
    }

    /// Whether the frame is already too long for the level, so that [`Self::finish`] returns
    /// [`TimingError::TooLong`] whatever comes.
    pub fn is_too_long(&self) -> bool {
        matches!(&self.state, State::Packet(clock) if clock.is_too_long())
    }

    /// Timing of the frame.
    ///
    /// # Errors
    /// [`TimingError::Stalled`] is an error of the model; [`TimingError::TooLong`] limits the level `packet`.
    pub fn finish(self) -> Result<Timed, TimingError> {
        Ok(match self.state {
            State::Stepped(state) => {
                let (builder, stream, recorder) = *state;
                stepped::run(
                    self.machine.units,
                    self.machine.clocks,
                    &builder,
                    &stream,
                    recorder,
                    &StepOptions::default(),
                )?
            }
            State::Packet(clock) if clock.is_too_long() => return Err(TimingError::TooLong),
            State::Packet(clock) => clock.finish(),
            State::Bound(clock) => clock.finish(),
        })
    }
}

/// Reason why the time of a frame may be inaccurate at its level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AccuracyWarning {
    /// Share of the frame for which a memory bank opens rows in an order that `packet` and `bound` do not
    /// know: those that other lines may have open at `packet`, all at `bound`, there over the busy time of
    /// the busiest unit.
    MemoryRows(f64),
    /// Utilization of memory whose queues are shorter than the opening of a row: which lines are in the queue
    /// of a channel, and which wait in front of it, decides how well rows and buses are used.
    MemoryQueue(f64),
    /// Share of the frame that batches and passes may overlap. `bound` does not know for how much of it they do.
    BatchOverlap(f64),
    /// Core cycles per packet. At `bound`, short packets wait for one unit each, so no unit is busy for long.
    ShortPackets(f64),
}

/// Smallest disputed share of the frame that gives a warning at `packet`, and smallest row time over busy
/// time at `bound`.
const MIN_ROWS: f64 = 0.2;
/// Least utilization of memory with short queues that gives a warning at `packet`, and at `bound`.
const MIN_QUEUED: [f64; 2] = [0.2, 0.15];
/// Smallest share of the frame that batches and passes may overlap that gives a warning: half of it is what
/// `bound` takes, and any part may be right.
const MIN_OVERLAP: f64 = 0.16;
/// Packets with fewer cycles than this give a warning.
const MIN_PACKET_CYCLES: f64 = 2.0;

impl AccuracyWarning {
    /// All warnings about a frame at `level`.
    pub fn all(level: Level, timed: &Timed) -> Vec<Self> {
        let is_bound = level == Level::Bound;
        let rows = if is_bound { timed.rows } else { timed.disputed };
        let rows = rows.filter(|&share| share >= MIN_ROWS).map(Self::MemoryRows);
        let least = MIN_QUEUED[usize::from(is_bound)];
        let queues = timed.short_queues.filter(|&share| share >= least).map(Self::MemoryQueue);
        let overlap = timed.overlap.filter(|&share| share >= MIN_OVERLAP).map(Self::BatchOverlap);
        let cycles = timed.cycles as f64 / timed.packets.max(1) as f64;
        let short = (is_bound && cycles < MIN_PACKET_CYCLES).then_some(Self::ShortPackets(cycles));
        [rows, queues, overlap, short].into_iter().flatten().collect()
    }

    /// Warning code.
    pub const fn code(self) -> Code {
        match self {
            Self::MemoryRows(_) => Code::MemoryRows,
            Self::MemoryQueue(_) => Code::MemoryQueue,
            Self::BatchOverlap(_) => Code::BatchOverlap,
            Self::ShortPackets(_) => Code::ShortPackets,
        }
    }

    /// Severity, comparable among warnings of one kind; larger is worse.
    pub fn extent(self) -> f64 {
        match self {
            Self::MemoryRows(share) | Self::MemoryQueue(share) | Self::BatchOverlap(share) => share,
            Self::ShortPackets(cycles) => -cycles,
        }
    }

    /// Level that has no such warning.
    const fn better(self) -> Level {
        match self {
            Self::MemoryRows(_) | Self::MemoryQueue(_) => Level::Stepped,
            Self::BatchOverlap(_) | Self::ShortPackets(_) => Level::Packet,
        }
    }

    /// What can be done at `level`, which the user requested, or which was `chosen` with this relative error on a
    /// probe.
    fn remedy(self, level: Level, chosen: Option<f64>) -> String {
        let (name, better) = (level.name(), self.better().name());
        match chosen {
            None => format!("use --timing {better}, or let --accuracy choose"),
            Some(error) => format!(
                "`{name}` was chosen with an error of {:.2} % on a probe; give a smaller --accuracy, or --timing {better}",
                1e2 * error
            ),
        }
    }

    /// Warning about a frame at a level that the user requested, or that was `chosen` with this relative error on
    /// a probe.
    pub fn warning(self, frame: u32, level: Level, chosen: Option<f64>) -> Warning {
        let (name, remedy) = (level.name(), self.remedy(level, chosen));
        match self {
            Self::MemoryRows(share) => Warning::new(
                Code::MemoryRows,
                format!(
                    "a bank of memory opens rows for {:.0} % of {} in frame {frame} that lines of the same row may have open: \
                     times at `{name}` may be far off, as what counts is which lines wait side by side; {remedy}",
                    100.0 * share,
                    if level == Level::Bound { "the busy time" } else { "the time" },
                ),
            ),
            Self::MemoryQueue(share) => Warning::new(
                Code::MemoryQueue,
                format!(
                    "memory is busy for {:.0} % of frame {frame}, and a queue of a channel is shorter than the time in which a row \
                     opens: times at `{name}` may be a tenth too short or more, as lines wait in front of full queues in an order \
                     that it does not know; use a longer `dram.queue` (or `dram.write_queue`); {remedy}",
                    100.0 * share,
                ),
            ),
            Self::BatchOverlap(share) => Warning::new(
                Code::BatchOverlap,
                format!(
                    "the longest packets of the batches and passes of frame {frame} take {:.0} % of it: times at `{name}` may be \
                     off by half of that, as it does not know how far batches overlap; {remedy}",
                    100.0 * share,
                ),
            ),
            Self::ShortPackets(cycles) => Warning::new(
                Code::ShortPackets,
                format!(
                    "a packet comes every {cycles:.1} cycles of frame {frame}: with packets so short `{name}` is up to a \
                     quarter too short; {remedy}"
                ),
            ),
        }
    }
}
