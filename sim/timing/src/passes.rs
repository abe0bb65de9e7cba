//! Passes of a frame: when each began and ended, and how long its work takes every unit.

use activity::Unit;

use crate::clock::{Clocks, Time};
use crate::draws::PassParts;
use crate::service::{UnitSpeeds, UnitWork};
use crate::spec::MachineSpec;

/// Time of a pass. Passes may overlap.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PassTime {
    /// When its first packet starts.
    pub begin_ps: u64,
    /// When its last packet leaves, and no earlier than the end of the pass before. That of the last pass is
    /// the length of the frame, so the times between ends add up to the frame.
    pub end_ps: u64,
    /// Time that its work takes each unit at its rates, all servers together. It is the same at all levels.
    pub busy_ps: [u64; Unit::COUNT],
    /// Time of each draw, by number: its part of the time from the end of the pass before to the end of this one. What is
    /// missing is that of the resolve, the barrier and the last lines to memory.
    pub draws_ps: Vec<u64>,
}

/// A pass, as far as known.
#[derive(Clone, Copy, Debug)]
struct Pass {
    /// [`Time::MAX`] before its first packet.
    begin: Time,
    end: Time,
    work: UnitWork,
}

impl Pass {
    const NONE: Self = Self { begin: Time::MAX, end: 0, work: [0; Unit::COUNT] };
}

/// The passes of a frame, as far as known, by number.
#[derive(Clone, Debug, Default)]
pub(crate) struct Passes(Vec<Pass>);

impl Passes {
    /// Record that packets of `pass` are in the machine between two times.
    pub fn note(&mut self, pass: u32, begin: Time, end: Time) {
        let pass = self.reach(pass);
        pass.begin = pass.begin.min(begin);
        pass.end = pass.end.max(end);
    }

    /// Work of `pass` so far.
    pub fn work(&mut self, pass: u32) -> &mut UnitWork {
        &mut self.reach(pass).work
    }

    fn reach(&mut self, pass: u32) -> &mut Pass {
        let pass = pass as usize;
        if self.0.len() <= pass {
            self.0.resize(pass + 1, Pass::NONE);
        }
        &mut self.0[pass]
    }

    /// Times of the passes of a frame that ends at `end_ps`, with their `parts`. A pass without packets takes none.
    pub fn finish(
        &self,
        machine: &MachineSpec,
        clocks: &Clocks,
        end_ps: u64,
        parts: &[PassParts],
    ) -> Vec<PassTime> {
        let speeds = UnitSpeeds::new(machine, clocks);
        let mut ended_ps = 0;
        let time = |(pass, number): (&Pass, usize)| {
            let before_ps = ended_ps;
            let last = number + 1 == self.0.len();
            ended_ps = if last { end_ps } else { before_ps.max(clocks.ps(pass.end)) };
            PassTime {
                begin_ps: if pass.begin == Time::MAX { before_ps } else { clocks.ps(pass.begin) },
                end_ps: ended_ps,
                draws_ps: parts.get(number).map_or(Vec::new(), |parts| parts.scaled(ended_ps - before_ps)),
                busy_ps: speeds.times(&pass.work).map(|time| clocks.ps(time)),
            }
        };
        self.0.iter().zip(0..).map(time).collect()
    }
}
