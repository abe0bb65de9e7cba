//! Packets that nobody is in the way of.

use activity::{Event, PacketCounts};

use crate::clock::{Clocks, Time};
use crate::job::{CLIENTS, Job, Place};
use crate::spec::MachineSpec;

/// How long packets take where nobody is in their way. All times in grains.
#[derive(Clone, Debug)]
pub(super) struct Alone {
    period: [Time; Place::COUNT],
    latency: [Time; Place::COUNT],
    /// Of an operation of a warp.
    operation: Time,
    warp_lanes: u32,
    /// Packets, and warps, that the cores hold.
    holds: [f64; 2],
    /// Of a line that is in the L2, and what one from memory takes more.
    line: [Time; 2],
}

impl Alone {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let common = Place::ALL.map(|place| machine.common(place.unit()));
        let period = common.map(|common| clocks.period(common.clock));
        let (shader, dram) = (&machine.shader, &machine.dram);
        // A warp wider than a core takes more than one cycle of its lanes.
        let cycles =
            shader.alu_latency_cycles.get() + shader.warp_lanes.get().div_ceil(shader.lanes.get()) - 1;
        let row = dram.latency_cycles.get()
            + dram.activate_cycles.get()
            + dram.cas_cycles.get()
            + dram.burst_cycles.get();
        Self {
            period,
            latency: std::array::from_fn(|at| period[at] * Time::from(common[at].latency_cycles)),
            operation: clocks.period(shader.clock) * Time::from(cycles),
            warp_lanes: shader.warp_lanes.get(),
            holds: [f64::from(shader.in_flight), f64::from(shader.cores) * f64::from(shader.warps)],
            line: [
                clocks.period(machine.l2.clock) * Time::from(machine.l2.latency_cycles),
                clocks.period(dram.clock) * Time::from(row),
            ],
        }
    }

    /// The program of a packet, of which every warp does the same.
    pub fn program(&self, job: &Job) -> Time {
        Time::from(job.ops) * self.operation
    }

    /// For how long the packet fills the cores, by packets and by warps.
    pub fn full(&self, job: &Job, program: Time) -> [f64; 2] {
        let [packets, warps] = self.holds;
        [program as f64 / packets, program as f64 * f64::from(job.warps(self.warp_lanes)) / warps]
    }

    /// The whole way of a packet.
    pub fn packet(&self, job: &Job, program: Time, counts: &PacketCounts) -> Time {
        let first = if job.front { Place::Command } else { Place::Traversal } as usize;
        let at = |place: usize| self.latency[place] + self.period[place] * Time::from(job.service[place]);
        let units: Time = (first..=job.last as usize).map(at).sum();
        let [line, fetch] = self.line;
        let lines = if job.lines == [0; CLIENTS.len()] { 0 } else { line };
        units + program + lines + if counts[Event::DramReadBytes] > 0 { fetch } else { 0 }
    }
}
