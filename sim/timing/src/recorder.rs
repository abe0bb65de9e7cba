//! Writes down when events happen, in bins.

use activity::{Bin, Counts, Event, PacketCounts, Timeline, Unit};

/// The first event of each unit: found once, as finding it is a walk through all events.
const FIRST: [usize; Unit::COUNT] = {
    let mut first = [0; Unit::COUNT];
    let mut at = 0;
    while at < Unit::COUNT {
        first[at] = Unit::ALL[at].events().start;
        at += 1;
    }
    first
};

/// The most events of a unit.
const MOST_EVENTS: usize = {
    let (mut most, mut at) = (0, 0);
    while at < Unit::COUNT {
        let events = Unit::ALL[at].events();
        if events.end - events.start > most {
            most = events.end - events.start;
        }
        at += 1;
    }
    most
};

/// Collects activity into equal bins. Where a frame outgrows the most bins allowed, pairs of bins are merged, so memory
/// stays bounded.
#[derive(Clone, Debug)]
pub struct Recorder {
    bin_ps: u64,
    bins: Vec<Bin>,
    most_bins: usize,
    end_ps: u64,
}

impl Recorder {
    /// A recorder with bins of `bin_ps` picoseconds to begin with and at most `most_bins` of them; both at least 2.
    pub fn new(bin_ps: u64, most_bins: usize) -> Self {
        Self { bin_ps: bin_ps.max(2), bins: Vec::new(), most_bins: most_bins.max(2), end_ps: 0 }
    }

    /// `unit` did its share of `counts` evenly from `start_ps` to `end_ps`, and was busy meanwhile.
    pub fn record(&mut self, unit: Unit, counts: &PacketCounts, start_ps: u64, end_ps: u64) {
        self.count(unit, counts, start_ps, end_ps);
        self.busy(unit, start_ps, end_ps, 1, 1);
    }

    /// `unit` did its share of `counts` evenly from `start_ps` to `end_ps`; nothing is said of how busy it was.
    pub fn count(&mut self, unit: Unit, counts: &PacketCounts, start_ps: u64, end_ps: u64) {
        let counts = counts.of(unit);
        self.spread(unit, start_ps, end_ps, |at| u64::from(counts[at]));
    }

    /// The same for counts of many packets together.
    pub fn count_all(&mut self, unit: Unit, counts: &Counts, start_ps: u64, end_ps: u64) {
        let first = FIRST[unit as usize];
        self.spread(unit, start_ps, end_ps, |at| counts[Event::ALL[first + at]]);
    }

    /// Events of `unit` that happened in the bin of `at_ps`, by their place among its events.
    pub(crate) fn add(&mut self, unit: Unit, at_ps: u64, counts: impl Fn(usize) -> u64) {
        self.spread(unit, at_ps, at_ps, counts);
    }

    /// The length of a bin, so far.
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
        let mut written = [0; MOST_EVENTS];
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

    /// `event` happened `times` times at `at_ps`.
    pub fn event(&mut self, event: Event, times: u64, at_ps: u64) {
        self.end_ps = self.end_ps.max(at_ps);
        self.reach(at_ps);
        let bin = (at_ps / self.bin_ps) as usize;
        self.bins[bin].counts[event] += times;
    }

    /// `busy` of the `of` servers of `unit` worked from `start_ps` to `end_ps`.
    pub fn busy(&mut self, unit: Unit, start_ps: u64, end_ps: u64, busy: u64, of: u64) {
        let span = self.span(start_ps, end_ps);
        let bin_ps = self.bin_ps;
        let mut add = |bin: usize, share: u64| self.bins[bin].busy_ps[unit as usize] += share;
        if busy == of {
            return span.for_each(|(bin, from, to)| add(bin, to - from));
        }
        let mut shares = Shares::new(busy, of, bin_ps);
        span.for_each(|(bin, from, to)| add(bin, shares.next(to - from)));
    }

    /// The frame lasts until `end_ps` at least.
    pub fn lasts(&mut self, end_ps: u64) {
        self.end_ps = self.end_ps.max(end_ps);
    }

    /// The bins from `start_ps` to `end_ps`, each with the part of that time it holds, counted from `start_ps`; at least one.
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

    /// Makes room for what happens at `at_ps`.
    fn reach(&mut self, at_ps: u64) {
        while at_ps / self.bin_ps >= self.most_bins as u64 {
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

    /// The timeline of everything recorded.
    pub fn finish(mut self) -> Timeline {
        let duration_ps = self.end_ps.max(1);
        self.reach(duration_ps - 1);
        Timeline { bin_ps: self.bin_ps, duration_ps, bins: self.bins }
    }
}

/// Binary places of a [`fraction`].
const PLACES: u32 = 32;

/// `part` of `length` (at least `part`), rounded down but for all of it.
fn fraction(part: u64, length: u64) -> u64 {
    match part {
        _ if part == length => 1 << PLACES,
        _ => ((u128::from(part) << PLACES) / u128::from(length)) as u64,
    }
}

/// That fraction of `whole`, rounded down.
fn share(whole: u64, fraction: u64) -> u64 {
    match whole.checked_mul(fraction) {
        Some(product) => product >> PLACES,
        None => ((u128::from(whole) * u128::from(fraction)) >> PLACES) as u64,
    }
}

/// The shares of a whole that fall to parts of a length, one after another. What falls to all parts up to one is rounded down, so
/// the shares add up to the whole.
struct Shares {
    whole: u64,
    length: u64,
    /// Of the parts so far, what was rounded away, in parts of `length`.
    rest: u64,
    /// The length most parts have, and quotient and remainder of their share.
    usual: (u64, u64, u64),
}

impl Shares {
    fn new(whole: u64, length: u64, usual: u64) -> Self {
        let mut shares = Self { whole, length, rest: 0, usual: (usual, 0, 0) };
        let (quotient, remainder) = shares.divide(usual);
        shares.usual = (usual, quotient, remainder);
        shares
    }

    fn divide(&self, part: u64) -> (u64, u64) {
        // A moment has no parts: it takes all.
        let Some(length) = std::num::NonZeroU64::new(self.length) else { return (self.whole, 0) };
        match self.whole.checked_mul(part) {
            Some(product) => (product / length, product % length),
            None => {
                let (product, length) = (u128::from(self.whole) * u128::from(part), u128::from(length.get()));
                ((product / length) as u64, (product % length) as u64)
            }
        }
    }

    fn next(&mut self, part: u64) -> u64 {
        let (usual, quotient, remainder) = self.usual;
        let (quotient, remainder) = if part == usual { (quotient, remainder) } else { self.divide(part) };
        if self.rest >= self.length - remainder {
            self.rest -= self.length - remainder;
            return quotient + u64::from(self.length > 0);
        }
        self.rest += remainder;
        quotient
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

    #[test]
    fn shares_add_up_to_the_whole() {
        let mut recorder = Recorder::new(100, 1000);
        recorder.record(Unit::SampleTest, &counts(1001), 50, 377);
        let timeline = recorder.finish();
        assert_eq!(timeline.bins.len(), 4);
        assert_eq!(timeline.total()[Event::SamplesTested], 1001);
        assert_eq!(timeline.total()[Event::DepthReads], 0, "events of other units are theirs");
        assert_eq!(timeline.busy_ps()[Unit::SampleTest as usize], 327);
        assert_eq!(timeline.bins[0].busy_ps[Unit::SampleTest as usize], 50);
        assert_eq!(timeline.duration_ps, 377);
    }

    #[test]
    fn work_that_takes_no_time_is_counted() {
        let mut recorder = Recorder::new(100, 1000);
        recorder.record(Unit::SampleTest, &counts(7), 200, 200);
        let timeline = recorder.finish();
        assert_eq!(timeline.total()[Event::SamplesTested], 7);
        assert_eq!(timeline.busy_ps(), [0; Unit::COUNT]);
    }

    #[test]
    fn long_frames_merge_bins_and_lose_nothing() {
        let mut recorder = Recorder::new(10, 8);
        for step in 0..100 {
            recorder.record(Unit::SampleTest, &counts(3), step * 10, step * 10 + 10);
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
