//! Levels between the L2 and memory at the level `packet`: a calendar each.

use activity::{LEVELS, LineAccess, LineKind, Unit};

use super::Span;
use super::calendar::{Calendar, SLOT_CYCLES, Turn};
use crate::clock::{Clocks, Time};
use crate::spec::{MachineSpec, SharedCacheSpec};

/// A run that has passed the levels below the L2.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passed {
    /// When the last of these levels, or the L2, accepts the first line and the last one.
    pub accepted: Span,
    /// Cycle of that level.
    pub period: Time,
    /// Latency of all these levels.
    pub latency: Time,
    /// Time for which the queues of these levels hold lines back from the L2.
    pub backlog: Time,
    /// When the L2 has the last line, if these levels have it.
    pub found: Option<Time>,
}

/// A level below the L2.
#[derive(Clone, Debug)]
struct CacheLevel {
    unit: Unit,
    /// Index in [`LEVELS`].
    at: usize,
    calendar: Calendar,
    period: Time,
    latency: Time,
    /// Time to accept a full queue.
    backlog: Time,
}

/// All levels that the machine has, from the L2 on.
#[derive(Clone, Debug)]
pub(super) struct Levels {
    levels: Vec<CacheLevel>,
    end: Time,
}

impl Levels {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let level = |((at, unit), spec): ((usize, Unit), Option<&SharedCacheSpec>)| {
            let spec = spec?;
            let period = clocks.period(spec.clock);
            let lines = spec.lines_per_cycle.get();
            Some(CacheLevel {
                unit,
                at,
                calendar: Calendar::new(Time::from(SLOT_CYCLES) * period, lines),
                period,
                latency: period * Time::from(spec.latency_cycles),
                backlog: period * Time::from(spec.queue) / Time::from(lines),
            })
        };
        let levels = LEVELS.into_iter().enumerate().zip(machine.levels()).filter_map(level).collect();
        Self { levels, end: 0 }
    }

    /// Pass `count` lines like `head` that the L2, with cycles of `period`, accepts at `accepted`.
    pub fn pass(
        &mut self,
        head: &LineAccess,
        (count, turn): (u32, Turn),
        accepted: Span,
        period: Time,
    ) -> Passed {
        let mut passed = Passed { accepted, period, latency: 0, backlog: 0, found: None };
        for level in &mut self.levels {
            let requests = head.levels[level.at];
            if requests.lines() == 0 {
                continue;
            }
            let Span { from, to } = passed.accepted;
            let seen = Span { from: from + passed.period, to: to + passed.period };
            passed.accepted = level.accept(requests.lines() * count, turn, seen);
            passed.latency += level.latency;
            passed.backlog += level.backlog + passed.period;
            passed.period = level.period;
            // The last level with a read has the line.
            if head.kind == LineKind::Below && requests.reads > 0 {
                passed.found = Some(passed.accepted.to + passed.latency);
            }
            self.end = self.end.max(passed.accepted.to + level.period);
        }
        passed
    }

    /// Calendars of all levels.
    pub fn calendars(&self) -> impl Iterator<Item = (Unit, &Calendar)> {
        self.levels.iter().map(|level| (level.unit, &level.calendar))
    }

    /// When the last line is accepted.
    pub fn ends_at(&self) -> Time {
        self.end
    }
}

impl CacheLevel {
    /// Accept `lines` lines, of which the first comes at `seen.from` and the last at `seen.to`. Returns when
    /// the first and the last are accepted.
    fn accept(&mut self, lines: u32, turn: Turn, seen: Span) -> Span {
        let (from, end) = self.calendar.reserve_as(turn, seen.from, u64::from(lines) * self.period);
        Span { from, to: end.saturating_sub(self.period).max(seen.to) }
    }
}
