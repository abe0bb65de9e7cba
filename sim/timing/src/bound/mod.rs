//! Level `bound`: a roofline (Williams, Waterman and Patterson 2009) over the units of the machine.
//!
//! Units overlap only as far as the queues between them reach. So the stream of each path is split into
//! segments of as many packets as the queues of the path hold. A segment takes as long as its busiest unit.
//! If the cores cannot hold enough packets at once to hide their program latency, it takes as long as
//! Little's law demands (Little 1961). The front end of a batch overlaps the tiles of the previous batch;
//! both share the cores, the L2 and memory. Neither is shorter than its longest packet without contention:
//!
//! ```text
//! tiles(b) = max(sum over segments of busiest unit or full cores, longest packet)        front(b) likewise
//! frame    = front(0) + sum over b of max(tiles(b), front(b + 1), shared(b), rows(b)) + latency of one packet per path
//! ```

mod totals;

use activity::{Counts, LineAccess, Packet, Unit};

use crate::clock::{Clocks, Time};
use crate::demand::{DemandBuilder, Station};
use crate::spec::MachineSpec;
use crate::{Clock, Recorder, Timed};
use totals::{PATHS, UnitWork};

pub use totals::Totals;

/// Speeds of the units.
struct UnitSpeeds<'a> {
    machine: &'a MachineSpec,
    clocks: Clocks,
    /// Grains per unit of work: a cycle, an operation of a core, or a line.
    grains_per_work: [f64; Unit::COUNT],
}

impl<'a> UnitSpeeds<'a> {
    fn new(machine: &'a MachineSpec, clocks: Clocks) -> Self {
        let servers = |unit: Unit| match unit {
            Unit::Shader => f64::from(machine.shader.cores) * f64::from(machine.shader.lanes),
            Unit::L2 => f64::from(machine.l2.lines_per_cycle),
            Unit::Dram => f64::from(machine.dram.channels) / f64::from(machine.dram.burst_cycles),
            _ => 1.0,
        };
        let grains_per_work =
            Unit::ALL.map(|unit| clocks.period(machine.common(unit).clock) as f64 / servers(unit));
        Self { machine, clocks, grains_per_work }
    }

    /// Busy time of every unit for the given work.
    fn times(&self, work: &UnitWork) -> [Time; Unit::COUNT] {
        Unit::ALL
            .map(|unit| (work[unit as usize] as f64 * self.grains_per_work[unit as usize]).ceil() as Time)
    }

    /// Latency of an empty path.
    fn latency(&self, stations: &[Station]) -> Time {
        let of = |unit: Unit| {
            let common = self.machine.common(unit);
            self.clocks.period(common.clock) * Time::from(common.latency_cycles)
        };
        stations.iter().map(|station| of(station.unit())).sum()
    }
}

/// Time of a frame from its totals.
pub fn bound(machine: &MachineSpec, clocks: Clocks, totals: &Totals, mut recorder: Recorder) -> Timed {
    let speeds = UnitSpeeds::new(machine, clocks);
    let mut work = vec![UnitWork::default(); totals.phases.len()];
    let mut paths = vec![[0; 2]; totals.phases.len()];
    for segment in totals.segments().filter(|segment| segment.packets > 0) {
        let busiest = speeds.times(&segment.work).into_iter().max().unwrap_or(0);
        paths[segment.phase][segment.path] +=
            segment.full.into_iter().fold(busiest, |most, full| most.max(full as Time));
        work[segment.phase].iter_mut().zip(segment.work).for_each(|(sum, part)| *sum += part);
    }
    let fill = PATHS.map(|path| speeds.latency(path));
    let rows = totals.rows();
    let mut now: Time = 0;
    for (number, counts) in totals.phases.iter().enumerate() {
        let busy = speeds.times(&work[number]);
        let length = busy.into_iter().chain(paths[number]).fold(rows[number], Time::max);
        let [front, tiles] = totals.longest[number];
        let used = [front, tiles] != [0; 2];
        let filled = length + if number < 2 && used { fill[number] } else { 0 };
        let end = now + filled.max(front).max(tiles);
        write(&mut recorder, &clocks, counts, &busy, [now, end]);
        now = end;
    }
    recorder.lasts(clocks.ps(now));
    let packets = totals.segments().map(|segment| u64::from(segment.packets)).sum();
    let timeline = recorder.finish();
    let share = crate::ratio_to_busiest(clocks.ps(rows.iter().sum()), &timeline);
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

/// Clock of the level `bound`. It only accumulates totals until the frame ends.
#[derive(Clone, Debug)]
pub struct BoundClock {
    machine: MachineSpec,
    clocks: Clocks,
    builder: DemandBuilder,
    totals: Totals,
    recorder: Recorder,
    lines: Vec<LineAccess>,
}

impl BoundClock {
    /// A clock at time 0 for packets in batches of `batch_triangles`, which records into `recorder`.
    pub fn new(machine: &MachineSpec, clocks: Clocks, batch_triangles: u32, recorder: Recorder) -> Self {
        let (builder, totals) = (DemandBuilder::new(machine, batch_triangles), Totals::new(machine, &clocks));
        Self { machine: machine.clone(), clocks, builder, totals, recorder, lines: Vec::new() }
    }

    /// Add the next packet of the stream.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        self.lines.clear();
        let demand = self.builder.build(packet, lines, &mut self.lines);
        self.totals.add(&self.builder, &demand, &packet.counts, &self.lines);
    }

    /// Activity of all packets added.
    pub fn finish(self) -> Timed {
        bound(&self.machine, self.clocks, &self.totals, self.recorder)
    }
}
