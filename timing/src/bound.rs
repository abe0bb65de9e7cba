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

use activity::{Counts, Event, LineAccess, Packet, PacketKind, Unit};

use crate::clock::{Clocks, Time};
use crate::job::{Jobs, Place};
use crate::spec::MachineSpec;
use crate::{Clock, LINE_BYTES, Recorder, Timed};

/// What the units owe, in their own cycles; the cores in operations, the L2 and memory in lines.
type Owed = [u64; Unit::COUNT];

/// The packets of one path that are in the queues together.
#[derive(Clone, Debug, Default)]
struct Stretch {
    owed: Owed,
    packets: u32,
}

/// What happens side by side: the tiles of a batch and the front end of the next.
#[derive(Clone, Debug, Default)]
struct Phase {
    counts: Counts,
    owed: Owed,
    /// Grains of the front end and of the tiles.
    paths: [Time; 2],
}

/// A clock that adds up.
#[derive(Clone, Debug)]
pub struct BoundClock {
    machine: MachineSpec,
    clocks: Clocks,
    makes: Jobs,
    batch_triangles: u32,
    /// Grains that one of what a unit owes takes.
    each: [f64; Unit::COUNT],
    /// Packets in a stretch of the front end and of the tiles' way.
    reach: [u32; 2],
    stretches: [Stretch; 2],
    /// Phase 0 is the front end of batch 0; phase `b + 1` the tiles of batch `b` and the front end of batch `b + 1`.
    phases: Vec<Phase>,
    /// The phase of each path.
    at: [usize; 2],
    recorder: Recorder,
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

impl BoundClock {
    /// A clock at zero for packets in batches of `batch_triangles`, writing into `recorder`.
    pub fn new(machine: &MachineSpec, clocks: Clocks, batch_triangles: u32, recorder: Recorder) -> Self {
        let servers = |unit: Unit| match unit {
            Unit::Shader => f64::from(machine.shader.cores) * f64::from(machine.shader.lanes),
            Unit::L2 => f64::from(machine.l2.lines_per_cycle),
            Unit::Dram => f64::from(machine.dram.channels) / f64::from(machine.dram.burst_cycles),
            _ => 1.0,
        };
        let queue = |place: &Place| machine.common(place.unit()).queue;
        Self {
            makes: Jobs::new(machine, batch_triangles),
            machine: machine.clone(),
            clocks,
            batch_triangles: batch_triangles.max(1),
            each: Unit::ALL.map(|unit| clocks.period(machine.common(unit).clock) as f64 / servers(unit)),
            reach: PATHS.map(|path| path.iter().map(queue).sum()),
            stretches: Default::default(),
            phases: vec![Phase::default()],
            at: [0, 1],
            recorder,
        }
    }

    /// The next packet of the stream.
    pub fn push(&mut self, packet: &Packet, lines: &[LineAccess]) {
        let batch = (packet.triangle / self.batch_triangles) as usize;
        let (path, phase) = match packet.kind {
            PacketKind::Draw | PacketKind::Vertices => (0, batch),
            PacketKind::Tile if packet.triangle != u32::MAX => (1, batch + 1),
            PacketKind::Tile | PacketKind::Resolve => (1, self.at[1]),
        };
        if phase != self.at[path] || self.stretches[path].packets == self.reach[path] {
            self.close(path);
        }
        self.at[path] = phase;
        let counts = &packet.counts;
        let owed = &mut self.stretches[path].owed;
        for &place in PATHS[path] {
            owed[place.unit() as usize] += u64::from(self.makes.service(place, counts));
        }
        owed[Unit::Shader as usize] += u64::from(counts[Event::ShaderOps]);
        let texels = self.makes.texture_cycles(counts[Event::TextureFetches], counts[Event::TextureLines]);
        owed[Unit::Texture as usize] += u64::from(texels);
        owed[Unit::L2 as usize] += lines.len() as u64;
        owed[Unit::Dram as usize] +=
            u64::from((counts[Event::DramReadBytes] + counts[Event::DramWriteBytes]) / LINE_BYTES);
        self.stretches[path].packets += 1;
        self.phase(phase).counts += counts;
    }

    fn phase(&mut self, phase: usize) -> &mut Phase {
        if self.phases.len() <= phase {
            self.phases.resize(phase + 1, Phase::default());
        }
        &mut self.phases[phase]
    }

    /// The stretch of a path is over.
    fn close(&mut self, path: usize) {
        let Stretch { owed, packets } = std::mem::take(&mut self.stretches[path]);
        if packets == 0 {
            return;
        }
        let longest = self.times(&owed).into_iter().max().unwrap_or(0);
        let phase = self.phase(self.at[path]);
        phase.paths[path] += longest;
        phase.owed.iter_mut().zip(owed).for_each(|(sum, part)| *sum += part);
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

    /// The activity of everything pushed.
    pub fn finish(mut self) -> Timed {
        (0..PATHS.len()).for_each(|path| self.close(path));
        let fill = PATHS.map(|path| self.latency(path));
        let mut now: Time = 0;
        for (phase, number) in std::mem::take(&mut self.phases).into_iter().zip(0..) {
            let busy = self.times(&phase.owed);
            let length = busy.into_iter().chain(phase.paths).max().unwrap_or(0);
            let end = now + length + if number < 2 { fill[number] } else { 0 };
            self.write(&phase.counts, &busy, now, end);
            now = end;
        }
        self.recorder.lasts(self.clocks.ps(now));
        let cycles = self.clocks.cycles(Clock::Core, now);
        Timed { timeline: self.recorder.finish(), cycles, stalls: None, unit_cycles: 0 }
    }

    fn write(&mut self, counts: &Counts, busy: &[Time; Unit::COUNT], from: Time, to: Time) {
        let (start, end) = (self.clocks.ps(from), self.clocks.ps(to));
        for unit in Unit::ALL.into_iter().filter(|&unit| counts.uses(unit)) {
            self.recorder.count_all(unit, counts, start, end);
            if to > from {
                self.recorder.busy(unit, start, end, busy[unit as usize], to - from);
            }
        }
    }
}
