//! Level `stepped`, the reference: every unit, queue and arbiter, cycle by cycle, written for clarity.
//!
//! Actions of a cycle become visible in the next one, so the order in which units are simulated does not
//! matter; a test permutes it. Cycles in which all units only wait are skipped, which does not change the
//! result; a test runs with and without skipping.

mod dram;
mod levels;
mod machine;
mod queue;
mod shader;
mod stage;

use activity::{LineAccess, PacketCounts, Unit};

use crate::clock::Clocks;
use crate::demand::{DemandBuilder, ServiceDemand};
use crate::spec::MachineSpec;
use crate::{Recorder, Timed};
use machine::Machine;

/// Deadlock: packets remain but no unit can act. This is an error of the model, never of the input.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("nothing moves after {cycles} cycles, but {remaining} packets are not done; please report it")]
pub struct Stalled {
    /// Length in core cycles.
    pub cycles: u64,
    /// Packets not done.
    pub remaining: usize,
}

/// Options of the simulation that do not change its result.
#[derive(Clone, Debug)]
pub struct StepOptions {
    /// Order in which the units are simulated in a cycle.
    pub order: [Unit; Unit::COUNT],
    /// Whether to skip cycles without action.
    pub skip_idle: bool,
}

impl Default for StepOptions {
    fn default() -> Self {
        Self { order: Unit::ALL, skip_idle: true }
    }
}

/// Packets of a frame, as service demands of one machine.
#[derive(Clone, Debug, Default)]
pub struct Stream {
    pub(crate) demands: Vec<ServiceDemand>,
    pub(crate) counts: Vec<PacketCounts>,
    pub(crate) lines: Vec<LineAccess>,
}

impl Stream {
    /// Add the next packet.
    pub fn push(&mut self, builder: &mut DemandBuilder, packet: &activity::Packet, lines: &[LineAccess]) {
        self.demands.push(builder.build(packet, lines, &mut self.lines));
        self.counts.push(packet.counts);
    }

    /// Add the last packet to `totals`.
    pub fn add_last(&self, builder: &DemandBuilder, totals: &mut crate::Totals) {
        if let (Some(demand), Some(counts)) = (self.demands.last(), self.counts.last()) {
            totals.add(builder, demand, counts, &self.lines[demand.first_line..]);
        }
    }
}

/// Simulate `stream` on `machine`.
///
/// # Errors
/// [`Stalled`] for a deadlock, an error of the model.
pub fn run(
    machine: &MachineSpec,
    clocks: Clocks,
    builder: &DemandBuilder,
    stream: &Stream,
    recorder: Recorder,
    options: &StepOptions,
) -> Result<Timed, Stalled> {
    Machine::new(machine, clocks, builder, stream, recorder).run(options)
}
