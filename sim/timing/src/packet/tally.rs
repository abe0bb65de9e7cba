//! Events of packets in bins of time. Consecutive packets of a bin are written together.

use activity::{Counts, PacketCounts, Unit};

use crate::Recorder;
use crate::clock::{Clocks, Time};

/// Position of a unit: its current bin, and its work in that bin.
#[derive(Clone, Copy, Debug, Default)]
struct Cursor {
    /// The bin in grains, shrunk to times that are surely inside: work that begins in `from..to` and ends by
    /// `to`.
    from: Time,
    to: Time,
    start_ps: u64,
    /// Grains of work in the bin.
    busy: Time,
}

/// Events over time. A packet whose work is inside the current bin of a unit costs one comparison: its events
/// go to the running total. The growth of the total is written when the unit moves to another bin.
#[derive(Debug)]
pub(super) struct Tally {
    recorder: Recorder,
    clocks: Clocks,
    cursors: [Cursor; Unit::COUNT],
    /// Events of all packets so far.
    total: Counts,
    /// The part of them that has been written, by unit.
    written: Counts,
}

impl Tally {
    pub fn new(recorder: Recorder, clocks: Clocks) -> Self {
        let (total, written) = Default::default();
        Self { recorder, clocks, cursors: Default::default(), total, written }
    }

    /// Record that `unit` did its part of `counts` evenly between two times.
    pub fn count(&mut self, unit: Unit, counts: &PacketCounts, from: Time, to: Time) {
        let at = &self.cursors[unit as usize];
        if from < at.from || from >= at.to || to > at.to {
            self.count_outside_bin(unit, counts, from, to);
        }
    }

    /// Record the same, and that `unit` was busy meanwhile.
    pub fn serve(&mut self, unit: Unit, counts: &PacketCounts, from: Time, to: Time) {
        let at = &mut self.cursors[unit as usize];
        if from < at.from || from >= at.to || to > at.to {
            self.count_outside_bin(unit, counts, from, to);
            let (from_ps, to_ps) = (self.clocks.ps(from), self.clocks.ps(to));
            self.recorder.busy(unit, from_ps, to_ps, 1, 1);
        } else {
            at.busy += to - from;
        }
    }

    /// Record the end of a packet: all units have done their part of `counts`.
    pub fn packet_done(&mut self, counts: &PacketCounts) {
        self.total += counts;
    }

    #[cold]
    fn count_outside_bin(&mut self, unit: Unit, counts: &PacketCounts, from: Time, to: Time) {
        let (from_ps, to_ps) = (self.clocks.ps(from), self.clocks.ps(to));
        self.recorder.count(unit, counts, from_ps, to_ps);
        if from >= self.cursors[unit as usize].from {
            self.write(unit);
            self.move_to_bin(unit, to_ps);
        }
        for (written, &count) in self.written.of_mut(unit).iter_mut().zip(counts.of(unit)) {
            *written += u64::from(count);
        }
    }

    /// Write the work of `unit` in its bin.
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

    /// Move `unit` to the bin of `at_ps`.
    fn move_to_bin(&mut self, unit: Unit, at_ps: u64) {
        let bin_ps = self.recorder.bin_ps();
        let start_ps = at_ps / bin_ps * bin_ps;
        let (from, to) = (self.clocks.grain_from(start_ps), self.clocks.grain_up_to(start_ps + bin_ps));
        self.cursors[unit as usize] = Cursor { from, to, start_ps, busy: 0 };
    }

    /// The recorder, with everything written.
    pub fn finish(mut self) -> Recorder {
        Unit::ALL.into_iter().for_each(|unit| self.write(unit));
        self.recorder
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use activity::Event;

    /// Packets in and out of time order, through a tally and directly through a recorder.
    #[test]
    fn bins_equal_those_of_a_recorder() {
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
                tally.packet_done(&counts);
                plain.count(Unit::SampleTest, &counts, clocks.ps(from), clocks.ps(to));
            }
            let mut tally = tally.finish();
            // The clock sets the end of the frame.
            tally.lasts(100_000_000);
            plain.lasts(100_000_000);
            assert_eq!(tally.finish(), plain.finish(), "{hz:?}");
        }
    }
}
