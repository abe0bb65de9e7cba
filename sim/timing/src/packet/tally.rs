//! Events of packets in bins of time, added up where many packets fall into one bin.

use activity::{Counts, PacketCounts, Unit};

use crate::Recorder;
use crate::clock::{Clocks, Time};

/// Where a unit is: the bin it writes into, and what it has done there.
#[derive(Clone, Copy, Debug, Default)]
struct Cursor {
    /// The bin, in grains: nothing that begins before `from`, at `to` or later, or ends after `to` is surely in it.
    from: Time,
    to: Time,
    start_ps: u64,
    /// Grains of work in the bin.
    busy: Time,
}

/// Events over time. A packet whose work in a unit lies in the bin in which that unit is costs a comparison: its events are in
/// the running total, and what the total has grown by is written when the unit goes on to another bin.
#[derive(Debug)]
pub(super) struct Tally {
    recorder: Recorder,
    clocks: Clocks,
    cursors: [Cursor; Unit::COUNT],
    /// Events of all packets that are through.
    total: Counts,
    /// Of these, those that are written, by unit.
    written: Counts,
}

impl Tally {
    pub fn new(recorder: Recorder, clocks: Clocks) -> Self {
        let (total, written) = Default::default();
        Self { recorder, clocks, cursors: Default::default(), total, written }
    }

    /// `unit` did its share of `counts` evenly between two moments.
    pub fn count(&mut self, unit: Unit, counts: &PacketCounts, from: Time, to: Time) {
        let at = &self.cursors[unit as usize];
        if from < at.from || from >= at.to || to > at.to {
            self.elsewhere(unit, counts, from, to);
        }
    }

    /// The same, and it was busy meanwhile.
    pub fn serve(&mut self, unit: Unit, counts: &PacketCounts, from: Time, to: Time) {
        let at = &mut self.cursors[unit as usize];
        if from < at.from || from >= at.to || to > at.to {
            self.elsewhere(unit, counts, from, to);
            let (from_ps, to_ps) = (self.clocks.ps(from), self.clocks.ps(to));
            self.recorder.busy(unit, from_ps, to_ps, 1, 1);
        } else {
            at.busy += to - from;
        }
    }

    /// All units have done what `counts` says.
    pub fn through(&mut self, counts: &PacketCounts) {
        self.total += counts;
    }

    #[cold]
    fn elsewhere(&mut self, unit: Unit, counts: &PacketCounts, from: Time, to: Time) {
        let (from_ps, to_ps) = (self.clocks.ps(from), self.clocks.ps(to));
        self.recorder.count(unit, counts, from_ps, to_ps);
        if from >= self.cursors[unit as usize].from {
            self.write(unit);
            self.go_to(unit, to_ps);
        }
        for (written, &count) in self.written.of_mut(unit).iter_mut().zip(counts.of(unit)) {
            *written += u64::from(count);
        }
    }

    /// Writes what `unit` has done in its bin.
    fn write(&mut self, unit: Unit) {
        let Self { recorder, total, written, cursors, .. } = self;
        let cursor = &mut cursors[unit as usize];
        let (total, written) = (total.of_mut(unit), written.of_mut(unit));
        if total == written && cursor.busy == 0 {
            return;
        }
        recorder.add(unit, cursor.start_ps, |at| total[at] - written[at]);
        written.copy_from_slice(total);
        let busy_ps = self.clocks.ps_below(std::mem::take(&mut cursor.busy));
        recorder.busy(unit, cursor.start_ps, cursor.start_ps + busy_ps, 1, 1);
    }

    /// `unit` goes on to the bin of `at_ps`.
    fn go_to(&mut self, unit: Unit, at_ps: u64) {
        let bin_ps = self.recorder.bin_ps();
        let start_ps = at_ps / bin_ps * bin_ps;
        let (from, to) = (self.clocks.grain_from(start_ps), self.clocks.grain_up_to(start_ps + bin_ps));
        self.cursors[unit as usize] = Cursor { from, to, start_ps, busy: 0 };
    }

    /// The recorder, with everything in it.
    pub fn finish(mut self) -> Recorder {
        Unit::ALL.into_iter().for_each(|unit| self.write(unit));
        self.recorder
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use activity::Event;

    /// Packets here and there, in and out of order, into a tally and straight into a recorder.
    #[test]
    fn bins_are_those_of_a_recorder() {
        for hz in [(1e9, 1e9), (925e6, 1375e6)] {
            let clocks = Clocks::new(hz.0, hz.1).unwrap();
            let bins = || Recorder::new(10_000, 16);
            let (mut tally, mut plain) = (Tally::new(bins(), clocks), bins());
            let mut counts = PacketCounts::default();
            for (step, jump) in
                [3, 0, 40, 7, 1, 90, 2, 500, 3, 9, 1000].into_iter().cycle().take(400).zip(0..)
            {
                counts[Event::SamplesTested] = 1000 + step;
                counts[Event::SamplesHit] = step;
                let from = u64::from(step) * 13 + jump * 20;
                let to = from + u64::from(step % 50);
                tally.count(Unit::SampleTest, &counts, from, to);
                tally.through(&counts);
                plain.count(Unit::SampleTest, &counts, clocks.ps(from), clocks.ps(to));
            }
            let mut tally = tally.finish();
            // The clock says when the frame ends.
            tally.lasts(100_000_000);
            plain.lasts(100_000_000);
            assert_eq!(tally.finish(), plain.finish(), "{hz:?}");
        }
    }
}
