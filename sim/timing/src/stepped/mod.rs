//! The level `stepped`, the reference: every unit, queue and arbiter from cycle to cycle, written to be read.
//!
//! What a unit does in a cycle others see in the next, so the order in which they are visited does not matter; a test
//! visits them in every order it likes. Cycles in which no unit does anything but wait are skipped, which changes nothing
//! either, and a test runs both ways.

mod dram;
mod machine;
mod memory;
mod meter;
mod queue;
mod shader;
mod sources;
mod stage;
mod waits;
mod warp;
mod world;

use activity::{LineAccess, PacketCounts, Unit};

use crate::clock::Clocks;
use crate::job::{Job, Jobs};
use crate::spec::MachineSpec;
use crate::{Recorder, Timed};
use machine::Machine;

/// A frame that does not end: a fault of the model, never of the input.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("nothing moves after {cycles} cycles, but {left} packets are not done; please report it")]
pub struct Stalled {
    /// Cycles of the core clock.
    pub cycles: u64,
    /// Packets not done.
    pub left: usize,
}

/// What may be done in more than one way without any difference.
#[derive(Clone, Debug)]
pub struct Manner {
    /// The units in the order in which they are visited in a cycle.
    pub order: [Unit; Unit::COUNT],
    /// Whether cycles in which nothing happens are skipped.
    pub skip: bool,
}

impl Default for Manner {
    fn default() -> Self {
        Self { order: Unit::ALL, skip: true }
    }
}

/// A frame's packets, as jobs of one machine.
#[derive(Clone, Debug, Default)]
pub struct Stream {
    pub(crate) jobs: Vec<Job>,
    pub(crate) counts: Vec<PacketCounts>,
    pub(crate) lines: Vec<LineAccess>,
}

impl Stream {
    /// Adds the next packet.
    pub fn push(&mut self, makes: &mut Jobs, packet: &activity::Packet, lines: &[LineAccess]) {
        self.jobs.push(makes.job(packet, lines, &mut self.lines));
        self.counts.push(packet.counts);
    }

    /// Adds the packet that was pushed last to `totals`.
    pub fn add_last(&self, makes: &Jobs, totals: &mut crate::Totals) {
        if let (Some(job), Some(counts)) = (self.jobs.last(), self.counts.last()) {
            totals.add(makes, job, counts, &self.lines[job.first_line..]);
        }
    }
}

/// Runs `stream` through `machine`, from the first cycle to the last.
///
/// # Errors
/// [`Stalled`] where the model has a fault.
pub fn run(
    machine: &MachineSpec,
    clocks: Clocks,
    makes: &Jobs,
    stream: &Stream,
    recorder: Recorder,
    manner: &Manner,
) -> Result<Timed, Stalled> {
    Machine::new(machine, clocks, makes, stream, recorder).run(manner)
}
