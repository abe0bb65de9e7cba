//! The level `bound`: a roofline (Williams, Waterman and Patterson 2009) over the units of the machine.
//!
//! Units overlap as far as the queues between them reach. So the stream of each path is cut into stretches of as many packets as
//! the queues of the path hold, and a stretch takes as long as its busiest unit, or as the cores need to let all its packets
//! stay as long as their programs take alone (Little 1961: so many at once, so long each). The front end of a batch and the tiles
//! of the one before run side by side, and share the cores, the L2 and memory; neither is shorter than its longest packet alone:
//!
//! ```text
//! tiles(b) = max(sum over its stretches of busiest unit or cores full, longest packet alone)        front(b) alike
//! frame    = front(0) + sum over b of max(tiles(b), front(b + 1), shared(b), rows(b)) + latencies of one packet of each path
//! ```

mod alone;
mod banks;
mod totals;

use activity::{Counts, LineAccess, Packet, Unit};

use crate::clock::{Clocks, Time};
use crate::job::{Jobs, Place};
use crate::spec::MachineSpec;
use crate::{Clock, Recorder, Timed};
use totals::{Owed, PATHS};

pub use totals::Totals;

/// How fast the units are.
struct Pace<'a> {
    machine: &'a MachineSpec,
    clocks: Clocks,
    /// Grains that one of what a unit owes takes.
    each: [f64; Unit::COUNT],
}

impl<'a> Pace<'a> {
    fn new(machine: &'a MachineSpec, clocks: Clocks) -> Self {
        let servers = |unit: Unit| match unit {
            Unit::Shader => f64::from(machine.shader.cores) * f64::from(machine.shader.lanes),
            Unit::L2 => f64::from(machine.l2.lines_per_cycle),
            Unit::Dram => f64::from(machine.dram.channels) / f64::from(machine.dram.burst_cycles),
            _ => 1.0,
        };
        let each = Unit::ALL.map(|unit| clocks.period(machine.common(unit).clock) as f64 / servers(unit));
        Self { machine, clocks, each }
    }

    /// Grains for which each unit is busy with what it owes.
    fn times(&self, owed: &Owed) -> [Time; Unit::COUNT] {
        Unit::ALL.map(|unit| (owed[unit as usize] as f64 * self.each[unit as usize]).ceil() as Time)
    }

    /// Grains that a packet takes through a path that does nothing.
    fn latency(&self, places: &[Place]) -> Time {
        let of = |unit: Unit| {
            let common = self.machine.common(unit);
            self.clocks.period(common.clock) * Time::from(common.latency_cycles)
        };
        places.iter().map(|place| of(place.unit())).sum()
    }
}

/// The time of a frame of which the totals are known.
pub fn bound(machine: &MachineSpec, clocks: Clocks, totals: &Totals, mut recorder: Recorder) -> Timed {
    let pace = Pace::new(machine, clocks);
    let mut owed = vec![Owed::default(); totals.phases.len()];
    let mut paths = vec![[0; 2]; totals.phases.len()];
    for stretch in totals.stretches().filter(|stretch| stretch.packets > 0) {
        let busiest = pace.times(&stretch.owed).into_iter().max().unwrap_or(0);
        paths[stretch.phase][stretch.path] +=
            stretch.full.into_iter().fold(busiest, |most, full| most.max(full as Time));
        owed[stretch.phase].iter_mut().zip(stretch.owed).for_each(|(sum, part)| *sum += part);
    }
    let fill = PATHS.map(|path| pace.latency(path));
    let rows = totals.rows();
    let mut now: Time = 0;
    for (number, counts) in totals.phases.iter().enumerate() {
        let busy = pace.times(&owed[number]);
        let length = busy.into_iter().chain(paths[number]).fold(rows[number], Time::max);
        let [front, tiles] = totals.longest[number];
        let used = [front, tiles] != [0; 2];
        let filled = length + if number < 2 && used { fill[number] } else { 0 };
        let end = now + filled.max(front).max(tiles);
        write(&mut recorder, &clocks, counts, &busy, [now, end]);
        now = end;
    }
    recorder.lasts(clocks.ps(now));
    let packets = totals.stretches().map(|stretch| u64::from(stretch.packets)).sum();
    let timeline = recorder.finish();
    let share = crate::over_busiest(clocks.ps(rows.iter().sum()), &timeline);
    let cycles = clocks.cycles(Clock::Core, now);
    Timed { timeline, cycles, stalls: None, unit_cycles: 0, packets, rows: Some(share) }
}

fn write(
    recorder: &mut Recorder,
    clocks: &Clocks,
    counts: &Counts,
    busy: &[Time; Unit::COUNT],
    [from, to]: [Time; 2],
) {
    let (start, end) = (clocks.ps(from), clocks.ps(to));
    for unit in Unit::ALL.into_iter().filter(|&unit| counts.uses(unit)) {
        recorder.count_all(unit, counts, start, end);
        if to > from {
            recorder.busy(unit, start, end, busy[unit as usize], to - from);
        }
    }
}

/// A clock that adds up.
#[derive(Clone, Debug)]
pub struct BoundClock {
    machine: MachineSpec,
    clocks: Clocks,
    makes: Jobs,
    totals: Totals,
    recorder: Recorder,
    lines: Vec<LineAccess>,
}

impl BoundClock {
    /// A clock at zero for packets in batches of `batch_triangles`, writing into `recorder`.
    pub fn new(machine: &MachineSpec, clocks: Clocks, batch_triangles: u32, recorder: Recorder) -> Self {
        let (makes, totals) = (Jobs::new(machine, batch_triangles), Totals::new(machine, &clocks));
        Self { machine: machine.clone(), clocks, makes, totals, recorder, lines: Vec::new() }
    }

    /// The next packet of the stream.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        self.lines.clear();
        let job = self.makes.job(packet, lines, &mut self.lines);
        self.totals.add(&self.makes, &job, &packet.counts, &self.lines);
    }

    /// The activity of everything pushed.
    pub fn finish(self) -> Timed {
        bound(&self.machine, self.clocks, &self.totals, self.recorder)
    }
}
