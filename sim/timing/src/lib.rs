//! Timing: when the activity happens. One machine description, one stream of packets, and several levels of
//! models.
//!
//! - [`MachineSpec`]: throughput, latency, queues and clocks of the units of the block diagram.
//! - [`DemandBuilder`] and [`ServiceDemand`]: cycles that a packet needs at each station, the same for all
//!   levels.
//! - [`Level`] and [`FrameClock`]: the levels, and a clock for any of them; [`CheckedClock`] and [`Checked`]: how far
//!   a level is off, by [`Slices`] of the frame.
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
mod channel;
mod check;
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

use activity::{LineAccess, Packet, PacketBuffer};
use serde::{Deserialize, Serialize};

use packet::MAX_CYCLES;
use stepped::{Stalled, StepOptions, Stream};

pub use bound::{BoundClock, Totals, bound};
pub use check::{Checked, CheckedClock, SliceWriter, Slices, error_size};
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
    /// What the check of the level found; only from [`FrameClock::finish_checked`], and `None` at `stepped`.
    pub checked: Option<Checked>,
    /// The passes of the frame, by number.
    pub passes: Vec<PassTime>,
    /// When the frame spent its time on which draw, in order; empty at the level `bound`, and at `packet` if
    /// draws take turns very often.
    pub spans: Vec<DrawSpan>,
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

impl State {
    const fn level(&self) -> Level {
        match self {
            Self::Stepped(_) => Level::Stepped,
            Self::Packet(_) => Level::Packet,
            Self::Bound(_) => Level::Bound,
        }
    }
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

    /// Add packets with their lines.
    pub fn push_all(&mut self, packets: &PacketBuffer) {
        packets.iter().for_each(|(packet, lines)| self.push(packet, lines));
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
        let Machine { units, clocks } = self.machine;
        Ok(match self.state {
            State::Stepped(state) => {
                let (builder, stream, recorder) = *state;
                stepped::run(units, clocks, &builder, &stream, recorder, &StepOptions::default())?
            }
            State::Packet(clock) if clock.is_too_long() => return Err(TimingError::TooLong),
            State::Packet(clock) => clock.finish(),
            State::Bound(clock) => clock.finish(),
        })
    }

    /// The same, with a check of the level by slices of the stream: [`Timed::checked`].
    ///
    /// # Errors
    /// See [`Self::finish`].
    pub fn finish_checked(self, slices: &Slices) -> Result<Timed, TimingError> {
        let (machine, level) = (self.machine, self.state.level());
        let timed = self.finish()?;
        Ok(Timed { checked: slices.check(level, machine, timed.cycles), ..timed })
    }
}
