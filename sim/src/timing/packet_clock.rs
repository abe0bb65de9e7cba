//! The `packet` level: a recurrence through units with bounded queues (max-plus, no clock).
//!
//! A packet starts in a unit when it has arrived and the unit has let go of the one before; it leaves when its work is done
//! and the next queue has room, that is when the packet `queue` places ahead has started there:
//!
//! ```text
//! start(u, k)  = max(arrive(u, k), leave(u, k - 1))
//! leave(u, k)  = max(start(u, k) + service(u, k), start(v, k' - queue(v)))        v: the next unit on the way
//! arrive(v, k) = leave(u, k) + latency(u)
//! ```
//!
//! This is the recurrence of tandem queues with finite buffers and blocking after service (Dallery and Gershwin 1992).
//! L2 and memory are shared by all: each packet reserves them, first come first served, when it reaches its first unit with
//! memory traffic, and leaves its last unit no earlier than its lines have arrived.

use std::collections::VecDeque;

use activity::{Packet, PacketKind, Timeline, Unit};

use super::{Recorder, Service};
use crate::gpu::GpuSpec;

/// The way of each kind of packet, and the place on it where memory is reserved.
fn route(kind: PacketKind) -> (&'static [Unit], usize) {
    use Unit::*;
    match kind {
        PacketKind::Draw => (&[Command], 0),
        PacketKind::Vertices => (&[Command, Shader, Setup], 0),
        PacketKind::Tile => {
            (&[Traversal, ZCull, SampleTest, Depth, ShadingCache, Shader, Texture, Colour], 3)
        }
        PacketKind::Resolve => (&[Colour], 0),
    }
}

/// A clock that advances by packets.
#[derive(Clone, Debug)]
pub struct PacketClock {
    service: Service,
    recorder: Recorder,
    batches: Batches,
    /// When the last packet so far was done.
    end_ps: u64,
    /// When each unit lets go of its last packet.
    free_ps: [u64; Unit::COUNT],
    /// When each of the packets last seen by a unit started there, at most as many as its queue is deep.
    starts_ps: [VecDeque<u64>; Unit::COUNT],
}

impl PacketClock {
    /// A clock at zero for the given GPU, writing into `recorder`.
    pub fn new(gpu: &GpuSpec, recorder: Recorder) -> Self {
        Self {
            service: Service::new(gpu),
            recorder,
            batches: Batches::new(gpu.pipeline.batch_triangles),
            end_ps: 0,
            free_ps: [0; Unit::COUNT],
            starts_ps: std::array::from_fn(|_| VecDeque::new()),
        }
    }

    /// The next packet of the stream.
    pub fn push(&mut self, packet: &Packet) {
        let (way, memory_at) = route(packet.kind);
        let mut stops = [(0, Unit::Command); Unit::COUNT];
        let mut count = 0;
        for (position, &unit) in way.iter().enumerate().filter(|(_, unit)| packet.counts.uses(**unit)) {
            stops[count] = (position, unit);
            count += 1;
        }
        let (mut arrive, mut data_ps) = (self.batches.earliest(packet), None);
        for place in 0..count {
            let (position, unit) = stops[place];
            let start = arrive.max(self.free_ps[unit as usize]);
            if position >= memory_at && data_ps.is_none() {
                data_ps = Some(self.reserve_memory(packet, start));
            }
            let done = start + self.service.time_ps(unit, &packet.counts);
            let leave = if place + 1 < count {
                done.max(self.room_ps(stops[place + 1].1))
            } else {
                done.max(data_ps.unwrap_or(0))
            };
            self.recorder.record(unit, &packet.counts, start, done);
            self.note_start(unit, start);
            self.free_ps[unit as usize] = leave;
            arrive = leave + self.service.latency_ps(unit);
        }
        if count == 0 {
            // Lines that leave the caches at the end of a frame pass through no unit but memory.
            arrive = self.reserve_memory(packet, arrive.max(self.end_ps));
        }
        self.end_ps = self.end_ps.max(arrive);
        self.batches.finished(packet, arrive);
    }

    /// When the next queue has room: when the packet as many places ahead as the queue is deep has started.
    fn room_ps(&self, unit: Unit) -> u64 {
        let starts = &self.starts_ps[unit as usize];
        if starts.len() < self.service.queue(unit) { 0 } else { starts.front().copied().unwrap_or(0) }
    }

    fn note_start(&mut self, unit: Unit, start_ps: u64) {
        let starts = &mut self.starts_ps[unit as usize];
        if starts.len() == self.service.queue(unit) {
            starts.pop_front();
        }
        starts.push_back(start_ps);
    }

    /// Reserves the L2 and then memory for a packet's lines from `start_ps`, and says when they have arrived.
    fn reserve_memory(&mut self, packet: &Packet, start_ps: u64) -> u64 {
        let mut ready = start_ps;
        for unit in [Unit::L2, Unit::Dram] {
            if packet.counts.uses(unit) {
                let start = ready.max(self.free_ps[unit as usize]);
                let done = start + self.service.time_ps(unit, &packet.counts);
                self.recorder.record(unit, &packet.counts, start, done);
                self.free_ps[unit as usize] = done;
                ready = done + self.service.latency_ps(unit);
            }
        }
        ready
    }

    /// The activity of everything pushed so far.
    pub fn finish(self) -> Timeline {
        self.recorder.finish()
    }
}

/// What batches wait for: tiles for the set-up of their whole batch and the front end for one of the two bin buffers. A
/// resolve follows the tiles of its bin through the colour unit, which keeps the order of the stream.
#[derive(Clone, Debug)]
struct Batches {
    triangles: u32,
    set_up_ps: Vec<u64>,
    traversed_ps: Vec<u64>,
    current: usize,
}

impl Batches {
    fn new(triangles: u32) -> Self {
        Self { triangles, set_up_ps: Vec::new(), traversed_ps: Vec::new(), current: 0 }
    }

    fn of(&self, triangle: u32) -> usize {
        (triangle / self.triangles) as usize
    }

    fn earliest(&self, packet: &Packet) -> u64 {
        let at = |times: &[u64], batch: usize| times.get(batch).copied().unwrap_or(0);
        match packet.kind {
            PacketKind::Draw | PacketKind::Vertices => {
                let batch = self.of(packet.triangle);
                if batch < 2 { 0 } else { at(&self.traversed_ps, batch - 2) }
            }
            PacketKind::Tile if packet.triangle == u32::MAX => at(&self.set_up_ps, self.current),
            PacketKind::Tile => at(&self.set_up_ps, self.of(packet.triangle)),
            PacketKind::Resolve => at(&self.set_up_ps, self.current),
        }
    }

    fn finished(&mut self, packet: &Packet, at_ps: u64) {
        let note = |times: &mut Vec<u64>, batch: usize| {
            times.resize(times.len().max(batch + 1), 0);
            times[batch] = times[batch].max(at_ps);
        };
        match packet.kind {
            PacketKind::Vertices => note(&mut self.set_up_ps, (packet.triangle / self.triangles) as usize),
            PacketKind::Tile => {
                if packet.triangle != u32::MAX {
                    self.current = self.of(packet.triangle);
                }
                note(&mut self.traversed_ps, self.current);
            }
            PacketKind::Draw | PacketKind::Resolve => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use activity::Event;

    /// A GPU whose traversal takes one cycle a tile and whose sample test takes `samples` cycles for 100 samples, at
    /// 1 GHz, with no latency and a queue of `queue`.
    fn clock(queue: u32) -> PacketClock {
        let mut gpu = GpuSpec::load("reference").unwrap();
        gpu.core_hz = 1e9;
        for unit in [&mut gpu.units.traversal, &mut gpu.units.sample_test, &mut gpu.units.z_cull] {
            unit.latency_cycles = 0;
            unit.queue = queue;
        }
        let rates = |text| activity::spec::parse(text, "test").unwrap();
        gpu.units.traversal.rates = rates("{\"tiles_visited\": 1}");
        gpu.units.sample_test.rates = rates("{\"samples_tested\": 1}");
        PacketClock::new(&gpu, Recorder::new(1000, 1 << 16))
    }

    fn tile(tiles: u32, samples: u32) -> Packet {
        let mut packet = Packet::new(PacketKind::Tile, 0, 0, 0);
        packet.counts[Event::TilesVisited] = tiles;
        packet.counts[Event::SamplesTested] = samples;
        packet
    }

    fn run(queue: u32, packets: &[(u32, u32)]) -> u64 {
        let mut clock = clock(queue);
        packets.iter().for_each(|&(tiles, samples)| clock.push(&tile(tiles, samples)));
        clock.finish().duration_ps / 1000
    }

    #[test]
    fn one_unit_takes_the_sum() {
        assert_eq!(run(4, &[(3, 0), (5, 0), (7, 0)]), 15);
    }

    #[test]
    fn two_units_overlap_and_the_slower_sets_the_pace() {
        // n packets through stages of a and b cycles: a + n b when b is the slower, n a + b when a is.
        assert_eq!(run(100, &[(2, 5); 10]), 2 + 10 * 5);
        assert_eq!(run(100, &[(5, 2); 10]), 10 * 5 + 2);
    }

    #[test]
    fn a_full_queue_blocks_the_unit_before_it() {
        // The second stage is slow at first, then fast: with a deep queue the first stage runs ahead meanwhile.
        let packets: Vec<_> = [(1, 100)].into_iter().chain([(10, 1); 20]).collect();
        assert_eq!(run(100, &packets), 1 + 20 * 10 + 1);
        // With room for one, the second packet waits and the third is held by the first stage until 101; the other 18
        // follow ten cycles apart.
        assert_eq!(run(1, &packets), 101 + 18 * 10 + 1);
    }

    #[test]
    fn memory_bandwidth_bounds_the_frame() {
        let mut gpu = GpuSpec::load("reference").unwrap();
        gpu.units.dram.latency_cycles = 0;
        let mut clock = PacketClock::new(&gpu, Recorder::new(1000, 1 << 16));
        for _ in 0..1000 {
            let mut packet = tile(1, 1);
            packet.counts[Event::DepthReads] = 1;
            packet.counts[Event::DramReadBytes] = 6400;
            clock.push(&packet);
        }
        // 6.4 MB at 32 bytes a cycle of 2.5 ns.
        let (duration, at_least) = (clock.finish().duration_ps, 500_000_000);
        assert!((at_least..at_least + 200_000).contains(&duration), "{duration}");
    }

    #[test]
    fn a_packet_that_touches_memory_alone_is_not_lost() {
        let mut clock = clock(4);
        clock.push(&tile(3, 0));
        let mut last = Packet::new(PacketKind::Resolve, 0, 0, u32::MAX);
        last.counts[Event::L2Writes] = 10;
        last.counts[Event::DramWriteBytes] = 640;
        clock.push(&last);
        let total = clock.finish().total();
        assert_eq!((total[Event::L2Writes], total[Event::DramWriteBytes]), (10, 640));
    }

    #[test]
    fn units_are_never_busier_than_the_time() {
        let mut clock = clock(2);
        (0..500).for_each(|i| clock.push(&tile(1 + i % 7, i % 13)));
        let timeline = clock.finish();
        for bin in &timeline.bins {
            assert!(bin.busy_ps.iter().all(|&busy| busy <= timeline.bin_ps));
        }
        let samples: u64 = (0..500).map(|i| i % 13).sum();
        assert_eq!(timeline.total()[Event::SamplesTested], samples);
    }
}
