//! Work of the units, and the time it takes them.

use activity::Unit;

use crate::clock::{Clocks, Time};
use crate::service::CYCLE;
use crate::spec::MachineSpec;

/// Work of every unit: operations for the cores, lines for the L2, the levels below it and memory, parts of cycles
/// ([`Work`](crate::Work)) for all others.
pub(crate) type UnitWork = [u64; Unit::COUNT];

/// Speeds of the units.
#[derive(Clone, Debug)]
pub(crate) struct UnitSpeeds {
    /// Grains per unit of work.
    grains_per_work: [f64; Unit::COUNT],
}

impl UnitSpeeds {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let servers = |unit: Unit| match unit {
            Unit::Shader => f64::from(machine.shader.cores) * f64::from(machine.shader.lanes),
            Unit::L2 => f64::from(machine.l2.lines_per_cycle),
            Unit::Llc => machine.llc.as_ref().map_or(1.0, |level| level.lines_per_cycle.into()),
            Unit::Edram => machine.edram.as_ref().map_or(1.0, |level| level.lines_per_cycle.into()),
            Unit::Dram => f64::from(machine.dram.channels) / f64::from(machine.dram.burst_cycles),
            _ => CYCLE as f64,
        };
        let grains_per_work =
            Unit::ALL.map(|unit| clocks.period(machine.common(unit).clock) as f64 / servers(unit));
        Self { grains_per_work }
    }

    /// Busy time of every unit for the given work.
    pub fn times(&self, work: &UnitWork) -> [Time; Unit::COUNT] {
        Unit::ALL
            .map(|unit| (work[unit as usize] as f64 * self.grains_per_work[unit as usize]).ceil() as Time)
    }

    /// Busy time of the busiest unit, and of the busiest one other than the cores.
    pub fn busiest(&self, work: &UnitWork) -> [Time; 2] {
        let times = self.times(work);
        let others = Unit::ALL.into_iter().filter(|&unit| unit != Unit::Shader);
        let stage = others.map(|unit| times[unit as usize]).fold(0, Time::max);
        [stage.max(times[Unit::Shader as usize]), stage]
    }
}
