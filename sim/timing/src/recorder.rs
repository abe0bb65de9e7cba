//! Recording of events and busy time in bins.

use activity::{Bin, Counts, Event, PacketCounts, Timeline, Unit};

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

    /// Record that `busy` of the `of` servers of `unit`, at least one, worked from `start_ps` to `end_ps`. Its time in each bin is
    /// rounded down, so that servers recorded one by one are together busy for no longer than the bin.
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
}
