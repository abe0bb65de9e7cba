//! The levels, and a clock of any of them.

use crate::stepped::{self, Manner, Stalled, Stream};
use crate::{BoundClock, Clocks, Jobs, MAX_CYCLES, MachineSpec, PacketClock, Recorder, Timed};
use activity::{LineAccess, Packet};
use serde::{Deserialize, Serialize};

/// How time is modelled.
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
    /// Every level, the most exact first.
    pub const ALL: [Self; 3] = [Self::Stepped, Self::Packet, Self::Bound];

    /// Its name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Stepped => "stepped",
            Self::Packet => "packet",
            Self::Bound => "bound",
        }
    }
}

/// Why a frame has no time.
#[derive(Debug, thiserror::Error)]
pub enum TimingError {
    /// The reference came to a stop.
    #[error(transparent)]
    Stalled(#[from] Stalled),
    /// A frame takes longer than what the level `packet` keeps in memory.
    #[error(
        "a frame takes more than {MAX_CYCLES} cycles of the core clock, more than `--timing packet` holds: check the rates of the \
         GPU file, ask for fewer pixels or samples, or use `--timing bound`"
    )]
    TooLong,
    /// The clocks have no common cycle; validated GPUs have one.
    #[error("the clocks of GPU `{0}` have no common cycle")]
    Clocks(String),
}

/// All of a GPU that its time depends on.
#[derive(Clone, Copy, Debug)]
pub struct Machine<'a> {
    /// Rates, latencies, queues and clock domains of each unit.
    pub units: &'a MachineSpec,
    /// Both clocks in one time.
    pub clocks: Clocks,
    /// Triangles of a batch, after which tiles are flushed.
    pub batch_triangles: u32,
}

/// A clock that takes the packets of a frame.
pub struct FrameClock<'a> {
    machine: Machine<'a>,
    state: State,
}

enum State {
    Stepped(Box<(Jobs, Stream, Recorder)>),
    Packet(Box<PacketClock>),
    Bound(Box<BoundClock>),
}

impl<'a> FrameClock<'a> {
    /// A clock at zero.
    pub fn new(level: Level, machine: Machine<'a>, recorder: Recorder) -> Self {
        let Machine { units, clocks, batch_triangles: batch } = machine;
        let state = match level {
            Level::Stepped => {
                State::Stepped(Box::new((Jobs::new(units, batch), Stream::default(), recorder)))
            }
            Level::Packet => State::Packet(Box::new(PacketClock::new(units, clocks, batch, recorder))),
            Level::Bound => State::Bound(Box::new(BoundClock::new(units, clocks, batch, recorder))),
        };
        Self { machine, state }
    }

    /// The next packet of the stream and the lines it asks the L2 for.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        match &mut self.state {
            State::Stepped(state) => state.1.push(&mut state.0, packet, lines),
            State::Packet(clock) => clock.push(packet, lines),
            State::Bound(clock) => clock.push(packet, lines),
        }
    }

    /// The frame in time.
    ///
    /// # Errors
    /// When the reference came to a stop, which would be a fault of the model.
    pub fn finish(self) -> Result<Timed, TimingError> {
        Ok(match self.state {
            State::Stepped(state) => {
                let (makes, stream, recorder) = *state;
                stepped::run(
                    self.machine.units,
                    self.machine.clocks,
                    &makes,
                    &stream,
                    recorder,
                    &Manner::default(),
                )?
            }
            State::Packet(clock) if clock.is_too_long() => return Err(TimingError::TooLong),
            State::Packet(clock) => clock.finish(),
            State::Bound(clock) => clock.finish(),
        })
    }
}
