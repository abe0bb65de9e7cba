//! Activity of packets in bins of time. Consecutive packets of a bin are written together.

use activity::{Counts, PacketCounts, Unit};

use super::calendar::Calendar;
use super::station::Service;
use crate::Recorder;
use crate::clock::{Clocks, Time};
use crate::demand::{CYCLE, Work};
use crate::recorder::part;

/// Units whose part of a packet follows when it has left the cores.
const BEHIND_CORES: [Unit; 5] = [Unit::Colour, Unit::L2, Unit::Llc, Unit::Edram, Unit::Dram];

/// Write the busy time of one of `servers` servers of a unit from its calendar, bin by bin. Slots may end
/// after the frame; their work is moved before its end.
pub(super) fn write_calendar(
    recorder: &mut Recorder,
    clocks: &Clocks,
    unit: Unit,
    calendar: &Calendar,
    servers: u64,
    end_ps: u64,
) {
    // Work of the bin at `at_ps` that is not yet written, and the end of that bin.
    let (mut work, mut at_ps, mut end) = (0, 0, 0);
    let flush = |recorder: &mut Recorder, work: u64, at_ps| {
        if work == 0 {
            return;
        }
        let busy_ps = clocks.ps_below(work / (calendar.servers() * servers));
        recorder.busy(unit, at_ps, at_ps + busy_ps, 1, 1);
    };
    for (from, to, used, room) in calendar.slots() {
        if to <= end {
            work += used;
            continue;
        }
        flush(recorder, std::mem::take(&mut work), at_ps);
        let (from_ps, to_ps) = (clocks.ps(from), clocks.ps(to));
        let done = part(to_ps - from_ps, used, room);
        let last_ps = to_ps.min(end_ps.max(from_ps + done));
        recorder.busy(unit, from_ps, last_ps, done, (last_ps - from_ps).max(1) * servers);
        let bin_ps = recorder.bin_ps();
        at_ps = to_ps / bin_ps * bin_ps;
        end = if at_ps + bin_ps <= end_ps { clocks.grain_up_to(at_ps + bin_ps) } else { 0 };
    }
    flush(recorder, work, at_ps);
}

/// Position of a unit: its current bin, and its work in that bin.
#[derive(Clone, Copy, Debug, Default)]
struct Cursor {
    /// The bin in grains, shrunk to times that are surely inside: work that begins in `from..to` and ends by
    /// `to`.
    from: Time,
    to: Time,
    start_ps: u64,
    /// Grains of work in the bin, and the part of a grain beyond them, in units of 1 / [`CYCLE`].
    busy: Time,
    part: Work,
}

impl Cursor {
    /// Add work in cycles of `period` grains.
    fn work(&mut self, work: Work, period: Time) {
        let part = self.part + work % CYCLE * period;
        self.busy += work / CYCLE * period + part / CYCLE;
        self.part = part % CYCLE;
    }
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

    /// Record the events of a service, and that `unit` was busy with it.
    pub fn serve(&mut self, unit: Unit, counts: &PacketCounts, service: &Service) {
        let Service { from, to, used, work, period } = *service;
        let at = &mut self.cursors[unit as usize];
        if from >= at.from && to + period <= at.to {
            return at.work(work, period);
        }
        self.count(unit, counts, from, to);
        let [begin_ps, end_ps] =
            [(from, used[0]), (to, used[1])].map(|(at, used)| self.clocks.ps_after(at, used * period, CYCLE));
        // A client waits between its requests, and a data unit between the parts of a packet.
        let (span_ps, work_ps) = (end_ps - begin_ps, self.clocks.ps_after(0, work * period, CYCLE));
        self.recorder.busy(unit, begin_ps, end_ps, work_ps.min(span_ps), span_ps.max(1));
    }

    /// Record the end of a packet: all units have done their part of `counts`.
    pub fn packet_done(&mut self, counts: &PacketCounts) {
        self.total += counts;
    }

    /// Record that the units up to the cores have done their part of `counts`.
    pub fn packet_passed(&mut self, counts: &PacketCounts) {
        self.total += counts;
        self.change_behind_cores(counts, |total, count| *total -= count);
    }

    /// Record that the units behind the cores have done their part of `counts`.
    pub fn packet_departed(&mut self, counts: &PacketCounts) {
        self.change_behind_cores(counts, |total, count| *total += count);
    }

    fn change_behind_cores(&mut self, counts: &PacketCounts, change: impl Fn(&mut u64, u64)) {
        for unit in BEHIND_CORES {
            let totals = self.total.of_mut(unit).iter_mut().zip(counts.of(unit));
            totals.for_each(|(total, &count)| change(total, count.into()));
        }
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
        if total == written && cursor.busy == 0 && cursor.part == 0 {
            return;
        }
        recorder.add(unit, cursor.start_ps, |at| total[at] - written[at]);
        written.copy_from_slice(total);
        let (busy, part) = (std::mem::take(&mut cursor.busy), std::mem::take(&mut cursor.part));
        let busy_ps = self.clocks.ps_below(busy) + self.clocks.ps_below(part) / CYCLE;
        recorder.busy(unit, cursor.start_ps, cursor.start_ps + busy_ps, 1, 1);
    }

    /// Move `unit` to the bin of `at_ps`.
    fn move_to_bin(&mut self, unit: Unit, at_ps: u64) {
        let bin_ps = self.recorder.bin_ps();
        let start_ps = at_ps / bin_ps * bin_ps;
        let (from, to) = (self.clocks.grain_from(start_ps), self.clocks.grain_up_to(start_ps + bin_ps));
        self.cursors[unit as usize] = Cursor { from, to, start_ps, ..Cursor::default() };
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

    #[test]
    fn a_slot_that_ends_after_the_frame_does_not_lengthen_it() {
        let clocks = Clocks::new(1e9, 1e9).unwrap();
        let mut calendar = Calendar::new(16, 1);
        calendar.reserve(0, 20);
        // Slots end at 16,000 and 32,000 ps, where bins begin.
        let mut recorder = Recorder::new(16_000, 16);
        recorder.lasts(20_000);
        write_calendar(&mut recorder, &clocks, Unit::Dram, &calendar, 1, 20_000);
        let timeline = recorder.finish();
        assert_eq!((timeline.duration_ps, timeline.busy_ps()[Unit::Dram as usize]), (20_000, 20_000));
    }

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
