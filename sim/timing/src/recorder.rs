//! Recording of a frame in bins of time: events and busy time, and where each unit's time went (busy,
//! starved, blocked, idle).

use activity::{Bin, Counts, Event, PacketCounts, Timeline, Unit};

use crate::clock::{Clocks, Time};

/// First event of each unit, as an index. A constant, as finding it takes a search through all events.
const FIRST_EVENT: [usize; Unit::COUNT] = {
    let mut first = [0; Unit::COUNT];
    let mut at = 0;
    while at < Unit::COUNT {
        first[at] = Unit::ALL[at].events().start;
        at += 1;
    }
    first
};

/// Largest number of events of a unit.
const MAX_UNIT_EVENTS: usize = {
    let (mut max, mut at) = (0, 0);
    while at < Unit::COUNT {
        let events = Unit::ALL[at].events();
        if events.end - events.start > max {
            max = events.end - events.start;
        }
        at += 1;
    }
    max
};

/// Recorder of activity in equal bins. When a frame exceeds the largest number of bins, pairs of bins are
/// merged, so memory stays bounded.
#[derive(Clone, Debug)]
pub struct Recorder {
    bin_ps: u64,
    bins: Vec<Bin>,
    max_bins: usize,
    end_ps: u64,
}

impl Recorder {
    /// A recorder that starts with bins of `bin_ps` picoseconds and keeps at most `max_bins`; both at least
    /// 2.
    pub fn new(bin_ps: u64, max_bins: usize) -> Self {
        Self { bin_ps: bin_ps.max(2), bins: Vec::new(), max_bins: max_bins.max(2), end_ps: 0 }
    }

    /// Record the events of `unit` evenly from `start_ps` to `end_ps`, without busy time.
    pub fn count(&mut self, unit: Unit, counts: &PacketCounts, start_ps: u64, end_ps: u64) {
        let counts = counts.of(unit);
        self.spread(unit, start_ps, end_ps, |at| u64::from(counts[at]));
    }

    /// Record the events of `unit` for the summed counts of many packets.
    pub fn count_all(&mut self, unit: Unit, counts: &Counts, start_ps: u64, end_ps: u64) {
        let first = FIRST_EVENT[unit as usize];
        self.spread(unit, start_ps, end_ps, |at| counts[Event::ALL[first + at]]);
    }

    /// Record events of `unit` in the bin of `at_ps`; `counts` maps the index in the unit to a count.
    pub(crate) fn add(&mut self, unit: Unit, at_ps: u64, counts: impl Fn(usize) -> u64) {
        self.spread(unit, at_ps, at_ps, counts);
    }

    /// Current length of a bin in picoseconds.
    pub(crate) fn bin_ps(&self) -> u64 {
        self.bin_ps
    }

    fn spread(&mut self, unit: Unit, start_ps: u64, end_ps: u64, counts: impl Fn(usize) -> u64) {
        let span = self.span(start_ps, end_ps);
        let Some((first, ..)) = span.clone().next() else { return };
        if span.clone().nth(1).is_none() {
            let targets = self.bins[first].counts.of_mut(unit).iter_mut();
            return targets.zip(0..).for_each(|(target, at)| *target += counts(at));
        }
        let events = self.bins[first].counts.of_mut(unit).len();
        let mut written = [0; MAX_UNIT_EVENTS];
        for (bin, _, to) in span {
            let part = fraction(to, end_ps - start_ps);
            let targets = self.bins[bin].counts.of_mut(unit).iter_mut().zip(&mut written);
            for ((target, written), at) in targets.zip(0..events) {
                let so_far = share(counts(at), part);
                *target += so_far - *written;
                *written = so_far;
            }
        }
    }

    /// Record that `event` happened `times` times at `at_ps`.
    pub fn event(&mut self, event: Event, times: u64, at_ps: u64) {
        self.end_ps = self.end_ps.max(at_ps);
        self.reach(at_ps);
        let bin = (at_ps / self.bin_ps) as usize;
        self.bins[bin].counts[event] += times;
    }

    /// Record that `busy` of the `of` servers of `unit`, at least one, worked from `start_ps` to `end_ps`.
    /// Its time in each bin is rounded down, so that servers recorded one by one are together busy for no
    /// longer than the bin.
    pub fn busy(&mut self, unit: Unit, start_ps: u64, end_ps: u64, busy: u64, of: u64) {
        for (bin, from, to) in self.span(start_ps, end_ps) {
            self.bins[bin].busy_ps[unit as usize] += part(to - from, busy, of);
        }
    }

    /// Extend the frame to `end_ps` at least.
    pub fn lasts(&mut self, end_ps: u64) {
        self.end_ps = self.end_ps.max(end_ps);
    }

    /// The bins from `start_ps` to `end_ps`, at least one. Each comes with the part of that time in it,
    /// relative to `start_ps`.
    fn span(
        &mut self,
        start_ps: u64,
        end_ps: u64,
    ) -> impl Iterator<Item = (usize, u64, u64)> + Clone + use<> {
        self.end_ps = self.end_ps.max(end_ps);
        let last_ps = end_ps.max(start_ps + 1) - 1;
        self.reach(last_ps);
        let bin_ps = self.bin_ps;
        (start_ps / bin_ps..=last_ps / bin_ps).map(move |bin| {
            let from = (bin * bin_ps).max(start_ps) - start_ps;
            let to = ((bin + 1) * bin_ps).min(end_ps) - start_ps;
            (bin as usize, from, to)
        })
    }

    /// Add bins up to `at_ps`.
    fn reach(&mut self, at_ps: u64) {
        while at_ps / self.bin_ps >= self.max_bins as u64 {
            self.merge();
        }
        let needed = (at_ps / self.bin_ps) as usize + 1;
        if needed > self.bins.len() {
            self.bins.resize(needed, Bin::default());
        }
    }

    fn merge(&mut self) {
        self.bin_ps *= 2;
        self.bins = self
            .bins
            .chunks(2)
            .map(|pair| {
                let mut merged = pair[0];
                if let Some(second) = pair.get(1) {
                    merged.counts += &second.counts;
                    merged.busy_ps.iter_mut().zip(second.busy_ps).for_each(|(sum, busy)| *sum += busy);
                }
                merged
            })
            .collect();
    }

    /// Timeline of everything recorded.
    pub fn finish(mut self) -> Timeline {
        let duration_ps = self.end_ps.max(1);
        self.reach(duration_ps - 1);
        Timeline { bin_ps: self.bin_ps, duration_ps, bins: self.bins }
    }
}

/// `whole * share / of`, rounded down.
pub(crate) fn part(whole: u64, share: u64, of: u64) -> u64 {
    match whole.checked_mul(share) {
        Some(product) => product / of,
        None => (u128::from(whole) * u128::from(share) / u128::from(of)) as u64,
    }
}

/// Fractional bits of a [`fraction`].
const FRACTION_BITS: u32 = 32;

/// `part / length` in fixed point, rounded down; exactly 1 if they are equal. `part` is at most `length`.
fn fraction(part: u64, length: u64) -> u64 {
    match part {
        _ if part == length => 1 << FRACTION_BITS,
        _ => ((u128::from(part) << FRACTION_BITS) / u128::from(length)) as u64,
    }
}

/// `whole * fraction`, rounded down.
fn share(whole: u64, fraction: u64) -> u64 {
    match whole.checked_mul(fraction) {
        Some(product) => product >> FRACTION_BITS,
        None => ((u128::from(whole) * u128::from(fraction)) >> FRACTION_BITS) as u64,
    }
}

/// Why a unit (or one of its servers) does not work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// No work is left in this frame, or no requests.
    Idle,
    /// Input from this unit is missing.
    Starved(Unit),
    /// This unit does not accept output, or does not answer yet.
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

    /// Server time of `unit` between two times of the frame, in picoseconds. An interval that is in it in
    /// part counts in part.
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

    fn counts(samples: u32) -> PacketCounts {
        let mut counts = PacketCounts::default();
        counts[Event::SamplesTested] = samples;
        counts[Event::DepthReads] = 5;
        counts
    }

    /// Work of a unit that is busy meanwhile.
    fn record(recorder: &mut Recorder, counts: &PacketCounts, start_ps: u64, end_ps: u64) {
        recorder.count(Unit::SampleTest, counts, start_ps, end_ps);
        recorder.busy(Unit::SampleTest, start_ps, end_ps, 1, 1);
    }

    #[test]
    fn shares_add_up_to_the_whole() {
        let mut recorder = Recorder::new(100, 1000);
        record(&mut recorder, &counts(1001), 50, 377);
        let timeline = recorder.finish();
        assert_eq!(timeline.bins.len(), 4);
        assert_eq!(timeline.total()[Event::SamplesTested], 1001);
        assert_eq!(timeline.total()[Event::DepthReads], 0, "events of other units are not recorded");
        assert_eq!(timeline.busy_ps()[Unit::SampleTest as usize], 327);
        assert_eq!(timeline.bins[0].busy_ps[Unit::SampleTest as usize], 50);
        assert_eq!(timeline.duration_ps, 377);
    }

    #[test]
    fn servers_that_are_all_busy_are_busy_for_no_longer_than_the_bin() {
        for servers in [1, 2, 3, 6, 7] {
            let mut recorder = Recorder::new(100, 1000);
            for _ in 0..servers {
                recorder.busy(Unit::Dram, 0, 950, 1, servers);
            }
            let timeline = recorder.finish();
            let busy_ps: Vec<u64> =
                timeline.bins.iter().map(|bin| bin.busy_ps[Unit::Dram as usize]).collect();
            assert_eq!(busy_ps.len(), 10);
            let (last, whole) = busy_ps.split_last().unwrap();
            assert!(
                whole.iter().all(|&busy_ps| busy_ps <= 100 && busy_ps + servers > 100),
                "{servers}: {busy_ps:?}"
            );
            assert!(*last <= 50 && *last + servers > 50, "{servers}: {busy_ps:?}");
        }
    }

    #[test]
    fn events_without_duration_are_counted() {
        let mut recorder = Recorder::new(100, 1000);
        record(&mut recorder, &counts(7), 200, 200);
        let timeline = recorder.finish();
        assert_eq!(timeline.total()[Event::SamplesTested], 7);
        assert_eq!(timeline.busy_ps(), [0; Unit::COUNT]);
    }

    #[test]
    fn long_frames_merge_bins_and_lose_nothing() {
        let mut recorder = Recorder::new(10, 8);
        for step in 0..100 {
            record(&mut recorder, &counts(3), step * 10, step * 10 + 10);
        }
        let timeline = recorder.finish();
        assert!(
            timeline.bins.len() <= 8 && timeline.bin_ps == 160,
            "{} {}",
            timeline.bins.len(),
            timeline.bin_ps
        );
        assert_eq!(timeline.total()[Event::SamplesTested], 300);
        assert_eq!(timeline.busy_ps()[Unit::SampleTest as usize], 1000);
    }

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
