//! Where each unit's time went: busy, starved by whom, blocked by whom, idle.

use activity::Unit;

use crate::clock::{Clocks, Time};

/// Why a unit (or a server of it) does not work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// Nothing is left for it in this frame, or nobody asks.
    Idle,
    /// It waits for this unit to hand it something.
    Starved(Unit),
    /// It waits for this unit to take something, or to answer.
    Blocked(Unit),
}

/// Most intervals that are kept; a frame that outgrows them gets longer ones.
const MOST: usize = 512;
/// Cycles of the core clock in an interval, to begin with.
const CYCLES: Time = 256;

/// Server-time of a unit in an interval or a frame, in grains: each server of a unit counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UnitTime {
    /// Working.
    pub busy: Time,
    /// With nothing left to do.
    pub idle: Time,
    /// Waiting for a unit to hand something over, by that unit.
    pub starved: [Time; Unit::COUNT],
    /// Waiting for a unit to take something or to answer, by that unit.
    pub blocked: [Time; Unit::COUNT],
}

impl UnitTime {
    /// All of it.
    pub fn total(&self) -> Time {
        self.busy + self.idle + self.starved.iter().sum::<Time>() + self.blocked.iter().sum::<Time>()
    }

    fn merge(&mut self, other: &Self) {
        self.busy += other.busy;
        self.idle += other.idle;
        for (mine, theirs) in self.starved.iter_mut().zip(other.starved) {
            *mine += theirs;
        }
        for (mine, theirs) in self.blocked.iter_mut().zip(other.blocked) {
            *mine += theirs;
        }
    }

    fn of(&mut self, reason: Reason) -> &mut Time {
        match reason {
            Reason::Idle => &mut self.idle,
            Reason::Starved(by) => &mut self.starved[by as usize],
            Reason::Blocked(by) => &mut self.blocked[by as usize],
        }
    }
}

/// The units' time, interval by interval.
#[derive(Clone, Debug, PartialEq)]
pub struct Stalls {
    clocks: Clocks,
    servers: [u32; Unit::COUNT],
    length: Time,
    intervals: Vec<[UnitTime; Unit::COUNT]>,
    /// End of the frame.
    pub(crate) end: Time,
}

impl Stalls {
    pub(crate) fn new(clocks: Clocks, servers: [u32; Unit::COUNT]) -> Self {
        let length = CYCLES * clocks.period(crate::Clock::Core);
        Self { clocks, servers, length, intervals: Vec::new(), end: 0 }
    }

    pub(crate) fn add(&mut self, unit: Unit, busy: u32, rest: Reason, from: Time, to: Time) {
        while (to - 1) / self.length >= MOST as Time {
            self.merge();
        }
        let needed = ((to - 1) / self.length) as usize + 1;
        if self.intervals.len() < needed {
            self.intervals.resize(needed, [UnitTime::default(); Unit::COUNT]);
        }
        let others = Time::from(self.servers[unit as usize] - busy);
        for at in from / self.length..=(to - 1) / self.length {
            let time = to.min((at + 1) * self.length) - from.max(at * self.length);
            let unit = &mut self.intervals[at as usize][unit as usize];
            unit.busy += time * Time::from(busy);
            *unit.of(rest) += time * others;
        }
    }

    fn merge(&mut self) {
        self.length *= 2;
        let merged = self.intervals.chunks(2).map(|pair| {
            let mut sum = pair[0];
            if let Some(second) = pair.get(1) {
                sum.iter_mut().zip(second).for_each(|(mine, theirs)| mine.merge(theirs));
            }
            sum
        });
        self.intervals = merged.collect();
    }

    /// Length of an interval in picoseconds; the last one ends with the frame.
    pub fn interval_ps(&self) -> u64 {
        self.clocks.ps(self.length)
    }

    /// Server-time of every unit in each interval.
    pub fn intervals(&self) -> &[[UnitTime; Unit::COUNT]] {
        &self.intervals
    }

    /// Servers of a unit: lanes of all cores, channels, lines in a cycle; else 1.
    pub fn servers(&self, unit: Unit) -> u32 {
        self.servers[unit as usize]
    }

    /// Server-time of `unit` in the whole frame.
    pub fn of(&self, unit: Unit) -> UnitTime {
        self.intervals.iter().fold(UnitTime::default(), |mut sum, interval| {
            sum.merge(&interval[unit as usize]);
            sum
        })
    }

    /// The length of the frame in grains.
    pub fn frame(&self) -> Time {
        self.end
    }

    /// The unit that is busiest in each interval, with the share of its servers' time; memory and caches among them. It is
    /// what holds the frame up where that share is near 1; where no share is, latency is.
    pub fn bottlenecks(&self) -> Vec<(Unit, f64)> {
        let share = |interval: &[UnitTime; Unit::COUNT], unit: Unit| {
            let time = &interval[unit as usize];
            time.busy as f64 / time.total().max(1) as f64
        };
        let busiest = |interval: &[UnitTime; Unit::COUNT]| {
            let shares = Unit::ALL.map(|unit| (unit, share(interval, unit)));
            shares.into_iter().fold(shares[0], |best, this| if this.1 > best.1 { this } else { best })
        };
        self.intervals.iter().map(busiest).collect()
    }
}
