//! How long a unit is occupied by a packet.

use activity::{Event, PacketCounts, Unit};

use crate::gpu::GpuSpec;

/// The time of one event in picoseconds, by unit, and the fixed times of each unit.
#[derive(Clone, Debug)]
pub struct Service {
    /// For each unit, the events that take time and the picoseconds each takes.
    costs: [Vec<(Event, f64)>; Unit::COUNT],
    latency_ps: [u64; Unit::COUNT],
    queue: [usize; Unit::COUNT],
    /// Events that add up rather than run side by side: reads and writes share a unit's one port to memory.
    serial: [bool; Unit::COUNT],
}

impl Service {
    /// The times of `gpu`.
    pub fn new(gpu: &GpuSpec) -> Self {
        let cycle_ps = |unit: Unit| 1e12 / gpu.clock_hz(gpu.units.get(unit).clock);
        let costs = Unit::ALL.map(|unit| {
            let rates = gpu.units.get(unit).rates.iter();
            rates.map(|(event, rate)| (event, cycle_ps(unit) / rate)).collect()
        });
        Self {
            costs,
            latency_ps: Unit::ALL
                .map(|u| (f64::from(gpu.units.get(u).latency_cycles) * cycle_ps(u)).round() as u64),
            queue: Unit::ALL.map(|u| gpu.units.get(u).queue as usize),
            serial: Unit::ALL.map(|u| matches!(u, Unit::L2 | Unit::Dram)),
        }
    }

    /// Picoseconds for which `counts` occupy `unit`, rounded up: the parts of a unit work side by side and the slowest
    /// sets the pace, but reads and writes of a memory share its port.
    pub fn time_ps(&self, unit: Unit, counts: &PacketCounts) -> u64 {
        let parts = self.costs[unit as usize].iter().map(|&(event, ps)| f64::from(counts[event]) * ps);
        let time = if self.serial[unit as usize] { parts.sum::<f64>() } else { parts.fold(0.0, f64::max) };
        time.ceil() as u64
    }

    /// Picoseconds from the end of a unit's work until the next unit sees the packet.
    pub fn latency_ps(&self, unit: Unit) -> u64 {
        self.latency_ps[unit as usize]
    }

    /// Packets that may wait in front of a unit.
    pub fn queue(&self, unit: Unit) -> usize {
        self.queue[unit as usize]
    }
}
