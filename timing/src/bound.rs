//! The level `bound`: a roofline (Williams, Waterman and Patterson 2009) over the units of the machine, batch by batch.
//!
//! A batch takes as long as its busiest unit. The front end of a batch and the tiles of the one before run side by side, and
//! share the cores, the L2 and memory:
//!
//! ```text
//! frame = front(0) + sum over b of busiest(tiles(b) and front(b + 1)) + latencies of one packet of each path
//! ```

use activity::{Counts, Event, LineAccess, Packet, PacketKind, Unit};

use crate::clock::{Clocks, Time};
use crate::job::Place;
use crate::spec::MachineSpec;
use crate::{Clock, LINE_BYTES, Recorder, Timed};

/// What happens side by side.
#[derive(Clone, Debug, Default)]
struct Phase {
    counts: Counts,
}

/// A clock that adds up.
#[derive(Clone, Debug)]
pub struct BoundClock {
    machine: MachineSpec,
    clocks: Clocks,
    batch_triangles: u32,
    /// Phase 0 is the front end of batch 0; phase `b + 1` the tiles of batch `b` and the front end of batch `b + 1`.
    phases: Vec<Phase>,
    phase: usize,
    recorder: Recorder,
}

impl BoundClock {
    /// A clock at zero for packets in batches of `batch_triangles`, writing into `recorder`.
    pub fn new(machine: &MachineSpec, clocks: Clocks, batch_triangles: u32, recorder: Recorder) -> Self {
        let machine = machine.clone();
        Self { machine, clocks, batch_triangles: batch_triangles.max(1), phases: vec![Phase::default()], phase: 0, recorder }
    }

    /// The next packet of the stream.
    pub fn push(&mut self, packet: &Packet, _lines: &[LineAccess]) {
        match packet.kind {
            PacketKind::Draw | PacketKind::Vertices => self.phase = (packet.triangle / self.batch_triangles) as usize,
            PacketKind::Tile if packet.triangle != u32::MAX => self.phase = (packet.triangle / self.batch_triangles) as usize + 1,
            PacketKind::Tile | PacketKind::Resolve => self.phase = self.phase.max(1),
        }
        while self.phases.len() <= self.phase {
            self.phases.push(Phase::default());
        }
        self.phases[self.phase].counts += &packet.counts;
    }

    /// Grains for which `counts` occupy `unit`.
    fn busy(&self, unit: Unit, counts: &Counts) -> Time {
        let machine = &self.machine;
        let common = machine.common(unit);
        let cycles = match unit {
            Unit::Shader => counts[Event::ShaderOps] as f64 / (f64::from(machine.shader.cores) * f64::from(machine.shader.lanes)),
            Unit::L2 => (counts[Event::L2Reads] + counts[Event::L2Writes]) as f64 / f64::from(machine.l2.lines_per_cycle),
            Unit::Dram => {
                let bytes = (counts[Event::DramReadBytes] + counts[Event::DramWriteBytes]) as f64;
                bytes / f64::from(LINE_BYTES) * f64::from(machine.dram.burst_cycles) / f64::from(machine.dram.channels)
            }
            _ => {
                let parts = common.rates.into_iter().flat_map(|rates| rates.iter());
                parts.map(|(event, rate)| counts[event] as f64 / rate).fold(0.0, f64::max)
            }
        };
        (cycles * self.clocks.period(common.clock) as f64).ceil() as Time
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
        let fill = [self.latency(&Place::ALL[..3]), self.latency(&Place::ALL[3..])];
        let mut now: Time = 0;
        for (phase, number) in std::mem::take(&mut self.phases).into_iter().zip(0..) {
            let busy = Unit::ALL.map(|unit| self.busy(unit, &phase.counts));
            let length = busy.into_iter().max().unwrap_or(0);
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
