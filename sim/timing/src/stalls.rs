//! Stall accounting: where each unit's time went (busy, starved, blocked, idle).

use activity::Unit;

use crate::clock::{Clocks, Time};

/// Why a unit (or one of its servers) does not work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// It has no work left in this frame, or no requests.
    Idle,
    /// It waits for input from this unit.
    Starved(Unit),
    /// It waits for this unit to accept its output or to answer.
    Blocked(Unit),
}

/// Largest number of intervals; longer frames get longer intervals.
const MAX_INTERVALS: usize = 512;
/// Initial length of an interval in core cycles.
const FIRST_INTERVAL_CYCLES: Time = 256;

/// Server time of a unit in an interval or a frame, in grains, summed over its servers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UnitTime {
    /// Working.
    pub busy: Time,
    /// Without work.
    pub idle: Time,
    /// Waiting for input, by the unit waited for.
    pub starved: [Time; Unit::COUNT],
    /// Waiting for output or an answer, by the unit waited for.
    pub blocked: [Time; Unit::COUNT],
}

impl UnitTime {
    /// Sum of all parts.
    pub fn total(&self) -> Time {
        self.busy + self.idle + self.starved.iter().sum::<Time>() + self.blocked.iter().sum::<Time>()
    }

    fn merge(&mut self, other: &Self) {
        self.busy += other.busy;
        self.idle += other.idle;
        for (sum, part) in self.starved.iter_mut().zip(other.starved) {
            *sum += part;
        }
        for (sum, part) in self.blocked.iter_mut().zip(other.blocked) {
            *sum += part;
        }
    }

    /// The part of the time from `from` to `to` of `whole`. Parts that follow each other add up to the whole.
    fn part(&self, [from, to]: [u64; 2], whole: u64) -> Self {
        let up_to = |time: Time, end: u64| (u128::from(time) * u128::from(end) / u128::from(whole)) as Time;
        let of = |time: Time| up_to(time, to) - up_to(time, from);
        let Self { busy, idle, starved, blocked } = *self;
        Self { busy: of(busy), idle: of(idle), starved: starved.map(of), blocked: blocked.map(of) }
    }

    fn of(&mut self, reason: Reason) -> &mut Time {
        match reason {
            Reason::Idle => &mut self.idle,
            Reason::Starved(by) => &mut self.starved[by as usize],
            Reason::Blocked(by) => &mut self.blocked[by as usize],
        }
    }
}

/// Server time of all units, by interval.
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
        let length = FIRST_INTERVAL_CYCLES * clocks.period(crate::Clock::Core);
        Self { clocks, servers, length, intervals: Vec::new(), end: 0 }
    }

    pub(crate) fn add(&mut self, unit: Unit, busy: u32, reason: Reason, from: Time, to: Time) {
        while (to - 1) / self.length >= MAX_INTERVALS as Time {
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
            *unit.of(reason) += time * others;
        }
    }

    fn merge(&mut self) {
        self.length *= 2;
        let merged = self.intervals.chunks(2).map(|pair| {
            let mut sum = pair[0];
            if let Some(second) = pair.get(1) {
                sum.iter_mut().zip(second).for_each(|(sum, part)| sum.merge(part));
            }
            sum
        });
        self.intervals = merged.collect();
    }

    /// Length of an interval in picoseconds; the last interval ends with the frame.
    pub fn interval_ps(&self) -> u64 {
        self.clocks.ps(self.length)
    }

    /// Server time of every unit in each interval.
    pub fn intervals(&self) -> &[[UnitTime; Unit::COUNT]] {
        &self.intervals
    }

    /// Servers of a unit: lanes of all cores, memory channels, L2 lines per cycle; otherwise 1.
    pub fn servers(&self, unit: Unit) -> u32 {
        self.servers[unit as usize]
    }

    /// Server time of `unit` in the whole frame.
    pub fn of(&self, unit: Unit) -> UnitTime {
        self.intervals.iter().fold(UnitTime::default(), |mut sum, interval| {
            sum.merge(&interval[unit as usize]);
            sum
        })
    }

    /// Server time of `unit` between two times of the frame, in picoseconds. An interval that is in it in part counts in
    /// part.
    pub fn between(&self, unit: Unit, [from_ps, to_ps]: [u64; 2]) -> UnitTime {
        let first = (from_ps / self.interval_ps()).saturating_sub(1);
        let mut sum = UnitTime::default();
        for (interval, at) in self.intervals.iter().zip(0..).skip(first as usize) {
            let begin = self.clocks.ps(at * self.length);
            if begin >= to_ps {
                break;
            }
            let end = self.clocks.ps(self.end.min((at + 1) * self.length));
            let within = [from_ps, to_ps].map(|ps| ps.clamp(begin, end) - begin);
            if within[0] < within[1] {
                sum.merge(&interval[unit as usize].part(within, end - begin));
            }
        }
        sum
    }

    /// Length of the frame in grains.
    pub fn frame(&self) -> Time {
        self.end
    }

    /// Busiest unit of each interval, with its utilization; caches and memory are included. A utilization
    /// near 1 is the bottleneck; otherwise latency limits the frame.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_frame_add_up_to_it() {
        let clocks = Clocks::new(1e9, 1e9).unwrap();
        let mut stalls = Stalls::new(clocks, [1; Unit::COUNT]);
        stalls.add(Unit::Depth, 1, Reason::Idle, 0, 300);
        stalls.add(Unit::Depth, 0, Reason::Blocked(Unit::L2), 300, 1000);
        stalls.end = 1000;
        let of = |span_cycles: [u64; 2]| {
            let time = stalls.between(Unit::Depth, span_cycles.map(|cycles| clocks.ps(cycles)));
            (time.busy, time.blocked[Unit::L2 as usize])
        };
        assert_eq!(of([0, 1000]), (300, 700));
        // The second interval has 44 cycles of work in 256.
        assert_eq!([of([0, 384]), of([384, 1000])], [(278, 106), (22, 594)]);
        assert_eq!(of([768, 1000]), (0, 232), "the last interval ends with the frame");
        let parts = (0..1000).map(|cycle| of([cycle, cycle + 1])).fold((0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        assert_eq!(parts, (300, 700), "however short they are");
    }
}
