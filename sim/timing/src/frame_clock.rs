//! Timing levels, and a clock for any of them.

use crate::stepped::{self, Stalled, StepOptions, Stream};
use crate::{BoundClock, Clocks, DemandBuilder, MAX_CYCLES, MachineSpec, PacketClock, Recorder, Timed};
use activity::{LineAccess, Packet};
use serde::{Deserialize, Serialize};

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
    /// Triangles per batch; tiles are flushed after each batch.
    pub batch_triangles: u32,
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
        let Machine { units, clocks, batch_triangles: batch } = machine;
        let state = match level {
            Level::Stepped => {
                State::Stepped(Box::new((DemandBuilder::new(units, batch), Stream::default(), recorder)))
            }
            Level::Packet => State::Packet(Box::new(PacketClock::new(units, clocks, batch, recorder))),
            Level::Bound => State::Bound(Box::new(BoundClock::new(units, clocks, batch, recorder))),
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
