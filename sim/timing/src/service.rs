//! Service in fractions of a cycle: a unit that has time left in a cycle goes on with the next packet in the same cycle.
//! Also the work of the units, and the time it takes them.

use activity::Unit;

use crate::clock::{Clocks, Time};
use crate::spec::MachineSpec;

/// Work of a unit: cycles of its clock, in units of 1 / [`CYCLE`].
pub type Work = u64;

/// Work of a whole cycle.
pub const CYCLE: Work = 1 << 16;

/// Work of so many cycles, rounded up to a unit of work except for excess within rounding error.
pub(crate) fn work_of(cycles: f64) -> Work {
    let work = ((cycles - 1e-6) * CYCLE as f64).max(0.0);
    // `f64::ceil` is a function call on x86-64 without SSE4.1.
    let below = work as Work;
    below.saturating_add(Work::from((below as f64) < work)).min(MAX_WORK)
}

/// Most work of a packet, so that its time does not overflow: as many cycles as fit into 32 bits.
const MAX_WORK: Work = u32::MAX as Work * CYCLE;

/// Time of `work` in cycles of `period` grains, rounded down to grains.
pub(crate) fn time_of(work: Work, period: Time) -> Time {
    work / CYCLE * period + work % CYCLE * period / CYCLE
}

/// How far a unit has come: the beginning of a cycle, and the part of that cycle that is used.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Server {
    at: Time,
    used: Work,
}

impl Server {
    /// The part of the cycle at `now` that is used so far.
    pub fn used_at(&self, now: Time) -> Work {
        if self.at == now { self.used } else { 0 }
    }

    /// Serve `work` from the cycle at `start` on, after what is used of it. Returns the beginning of the cycle in which it ends.
    pub fn serve(&mut self, start: Time, period: Time, work: Work) -> Time {
        let end = self.used_at(start) + work;
        *self = Self { at: start + period * (end / CYCLE), used: end % CYCLE };
        self.at
    }

    /// The end of the last cycle that is used in part.
    pub fn used_until(&self, period: Time) -> Option<Time> {
        (self.used > 0).then_some(self.at + period)
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_share_a_cycle_until_it_is_used() {
        let mut server = Server::default();
        let ends: Vec<_> = (0..6).map(|_| server.serve(server.at.max(30), 10, work_of(0.4))).collect();
        assert_eq!(ends, [30, 30, 40, 40, 50, 50]);
        // A packet that comes later does not begin in the rest of an earlier cycle.
        assert_eq!((server.used_at(50), server.used_until(10)), (6 * work_of(0.4) % CYCLE, Some(60)));
        assert_eq!((server.serve(60, 10, CYCLE / 2), server.serve(60, 10, 3 * CYCLE / 2)), (60, 80));
        assert_eq!(server.used_until(10), None);
    }

    #[test]
    fn work_rounds_up_except_for_rounding_errors() {
        let exact = [0.0, 1.0, 0.25, 3.0 * (1.0 / 3.0), 49.0 * (1.0 / 49.0)];
        assert_eq!(exact.map(work_of), [0, CYCLE, CYCLE / 4, CYCLE, CYCLE]);
        assert_eq!(3 * work_of(1.0 / 3.0), CYCLE + 2, "no unit is faster than its rate");
        assert_eq!([work_of(1e300), work_of(1e10)], [MAX_WORK; 2]);
    }

    #[test]
    fn work_takes_time_in_proportion() {
        assert_eq!((time_of(5 * CYCLE / 2, 10), time_of(CYCLE / 3, 1)), (25, 0));
    }
}
