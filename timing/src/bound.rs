//! The level `bound`: a roofline (Williams, Waterman and Patterson 2009) over the units of the machine.
//!
//! Units overlap as far as the queues between them reach. So the stream of each path is cut into stretches of as many packets as
//! the queues of the path hold, and a stretch takes as long as its busiest unit. The front end of a batch and the tiles of the
//! one before run side by side, and share the cores, the L2 and memory:
//!
//! ```text
//! tiles(b) = sum over its stretches of busiest unit        front(b) alike
//! frame    = front(0) + sum over b of max(tiles(b), front(b + 1), shared(b)) + latencies of one packet of each path
//! ```

use activity::{Counts, Event, LineAccess, Packet, PacketCounts, Unit};

use crate::clock::{Clocks, Time};
use crate::job::{CLIENTS, Job, Jobs, Place, TEXTURE_PORT, port};
use crate::spec::MachineSpec;
use crate::{Clock, LINE_BYTES, Recorder, Timed};

/// What the units owe, in their own cycles; the cores in operations, the L2 and memory in lines.
type Owed = [u64; Unit::COUNT];

/// The packets of one path that are in the queues together.
#[derive(Clone, Debug, Default)]
struct Stretch {
    path: usize,
    phase: usize,
    owed: Owed,
    packets: u32,
}

/// What is known of a frame when its stream is written: what its stretches owe, and the events of its phases. It does not grow
/// with packets but with stretches.
#[derive(Clone, Debug)]
pub struct Totals {
    /// Packets in a stretch of the front end and of the tiles' way.
    reach: [u32; 2],
    /// Lines that each client of the L2 asks for in a cycle.
    lines_per_cycle: [u32; CLIENTS.len()],
    open: [Stretch; 2],
    closed: Vec<Stretch>,
    /// Events of each phase. Phase 0 is the front end of batch 0; phase `b + 1` the tiles of batch `b` and the front end of batch
    /// `b + 1`.
    phases: Vec<Counts>,
}

const PATHS: [&[Place]; 2] = [
    &[Place::Command, Place::Vertex, Place::Setup],
    &[
        Place::Traversal,
        Place::ZCull,
        Place::SampleTest,
        Place::Depth,
        Place::ShadingCache,
        Place::Pixel,
        Place::Colour,
    ],
];

impl Totals {
    /// Nothing, so far.
    pub fn new(machine: &MachineSpec) -> Self {
        let queue = |place: &Place| machine.common(place.unit()).queue;
        let open = |path| Stretch { path, phase: path, ..Stretch::default() };
        Self {
            reach: PATHS.map(|path| path.iter().map(queue).sum()),
            lines_per_cycle: CLIENTS.map(|unit| machine.common(unit).lines_per_cycle),
            open: [open(0), open(1)],
            closed: Vec::new(),
            phases: Vec::new(),
        }
    }

    /// The next packet of the stream, as a job made by `makes`.
    pub fn add(&mut self, makes: &Jobs, job: &Job, counts: &PacketCounts) {
        let path = usize::from(!job.front);
        let phase = job.batch as usize + path;
        let open = &mut self.open[path];
        if phase != open.phase || open.packets == self.reach[path] {
            let full = std::mem::replace(open, Stretch { path, phase, ..Stretch::default() });
            self.closed.push(full);
        }
        let owed = &mut open.owed;
        // A client is busy until it has asked for its last line.
        let asks = |port: usize| job.lines[port].div_ceil(self.lines_per_cycle[port]);
        for &place in PATHS[path] {
            let asks = port(place.unit()).map_or(0, asks);
            owed[place.unit() as usize] += u64::from(job.service[place as usize].max(asks));
        }
        owed[Unit::Shader as usize] += u64::from(counts[Event::ShaderOps]);
        if job.is_textured() {
            let cycles = makes.texture_cycles(job.texels[0], job.texels[1]);
            owed[Unit::Texture as usize] += u64::from(cycles.max(asks(TEXTURE_PORT)));
        }
        owed[Unit::L2 as usize] += job.lines.iter().map(|&lines| u64::from(lines)).sum::<u64>();
        let bytes = counts[Event::DramReadBytes] + counts[Event::DramWriteBytes];
        owed[Unit::Dram as usize] += u64::from(bytes / LINE_BYTES);
        open.packets += 1;
        if self.phases.len() <= phase {
            self.phases.resize(phase + 1, Counts::default());
        }
        self.phases[phase] += counts;
    }

    fn stretches(&self) -> impl Iterator<Item = &Stretch> {
        self.closed.iter().chain(&self.open)
    }
}

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
        let longest = pace.times(&stretch.owed).into_iter().max().unwrap_or(0);
        paths[stretch.phase][stretch.path] += longest;
        owed[stretch.phase].iter_mut().zip(stretch.owed).for_each(|(sum, part)| *sum += part);
    }
    let fill = PATHS.map(|path| pace.latency(path));
    let mut now: Time = 0;
    for (number, counts) in totals.phases.iter().enumerate() {
        let busy = pace.times(&owed[number]);
        let length = busy.into_iter().chain(paths[number]).max().unwrap_or(0);
        let end = now + length + if number < 2 { fill[number] } else { 0 };
        write(&mut recorder, &clocks, counts, &busy, [now, end]);
        now = end;
    }
    recorder.lasts(clocks.ps(now));
    let cycles = clocks.cycles(Clock::Core, now);
    Timed { timeline: recorder.finish(), cycles, stalls: None, unit_cycles: 0 }
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
        let (makes, totals) = (Jobs::new(machine, batch_triangles), Totals::new(machine));
        Self { machine: machine.clone(), clocks, makes, totals, recorder, lines: Vec::new() }
    }

    /// The next packet of the stream.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        self.lines.clear();
        let job = self.makes.job(packet, lines, &mut self.lines);
        self.totals.add(&self.makes, &job, &packet.counts);
    }

    /// The activity of everything pushed.
    pub fn finish(self) -> Timed {
        bound(&self.machine, self.clocks, &self.totals, self.recorder)
    }
}
