//! Level `stepped`, the reference: every unit, queue and arbiter, cycle by cycle, written for clarity.
//!
//! Actions of a cycle become visible in the next one, so the order in which units are simulated does not
//! matter; a test permutes it. Cycles in which all units only wait are skipped, which does not change the
//! result; a test runs with and without skipping.

mod dram;
mod levels;
mod queue;
mod shader;
mod sources;
mod stage;

use activity::{LEVELS, LineAccess, PacketCounts, Unit};

use self::dram::Dram;
use self::levels::{L2, Levels};
use self::queue::{Meter, Queue, Waits};
use self::shader::{CoreEnv, Shader};
use self::sources::Sources;
use self::stage::{Stage, StageEnv};
use crate::clock::{Clocks, Time};
use crate::demand::{CYCLE, DemandBuilder, ServiceDemand, Station, WarpKind, Work, port};
use crate::draws::{DrawTimes, Passes};
use crate::recorder::Reason;
use crate::spec::{Common, DataUnit, MachineSpec};
use crate::{Recorder, Timed};

/// Deadlock: packets remain but no unit can act. This is an error of the model, never of the input.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("nothing moves after {cycles} cycles, but {remaining} packets are not done; please report it")]
pub struct Stalled {
    /// Length in core cycles.
    pub cycles: u64,
    /// Packets not done.
    pub remaining: usize,
}

/// Options of the simulation that do not change its result.
#[derive(Clone, Debug)]
pub struct StepOptions {
    /// Order in which the units are simulated in a cycle.
    pub order: [Unit; Unit::COUNT],
    /// Whether to skip cycles without action.
    pub skip_idle: bool,
}

impl Default for StepOptions {
    fn default() -> Self {
        Self { order: Unit::ALL, skip_idle: true }
    }
}

/// Packets of a frame, as service demands of one machine.
#[derive(Clone, Debug, Default)]
pub struct Stream {
    pub(crate) demands: Vec<ServiceDemand>,
    pub(crate) counts: Vec<PacketCounts>,
    pub(crate) lines: Vec<LineAccess>,
}

impl Stream {
    /// Add the next packet.
    pub fn push(&mut self, builder: &mut DemandBuilder, packet: &activity::Packet, lines: &[LineAccess]) {
        self.demands.push(builder.build(packet, lines, &mut self.lines));
        self.counts.push(packet.counts);
    }

    /// Add the last packet to `totals`.
    pub fn add_last(&self, builder: &DemandBuilder, totals: &mut crate::Totals) {
        if let (Some(demand), Some(counts)) = (self.demands.last(), self.counts.last()) {
            totals.add(builder, demand, counts, &self.lines[demand.first_line..]);
        }
    }
}

/// Simulate `stream` on `machine`.
///
/// # Errors
/// [`Stalled`] for a deadlock, an error of the model.
pub fn run(
    machine: &MachineSpec,
    clocks: Clocks,
    builder: &DemandBuilder,
    stream: &Stream,
    recorder: Recorder,
    options: &StepOptions,
) -> Result<Timed, Stalled> {
    Machine::new(machine, clocks, builder, stream, recorder).run(options)
}

/// All units of a machine.
struct Machine<'a> {
    spec: &'a MachineSpec,
    shared: SharedState<'a>,
    /// Input queue of each station.
    queues: [Queue<u32>; Station::COUNT],
    /// Unit of each station, except for the shader cores.
    stages: [Option<Stage>; Station::COUNT],
    shader: Shader,
    data: [DataStage; DataUnit::ALL.len()],
    l2: L2,
    levels: Levels,
    dram: Dram,
    waits: Waits,
    meter: Meter,
    /// Cycles simulated, summed over units.
    visited: u64,
}

/// A data unit; its items are warps.
struct DataStage {
    stage: Stage,
    queue: Queue<u32>,
    latency: Time,
}

impl DataStage {
    fn new(machine: &MachineSpec, clocks: &Clocks, unit: DataUnit) -> Self {
        let common = machine.common(unit.unit());
        let period = clocks.period(common.clock);
        Self {
            stage: Stage::new(period, common.in_flight, common.lines_per_cycle),
            queue: Queue::new(common.queue),
            latency: period * Time::from(common.latency_cycles),
        }
    }
}

impl<'a> Machine<'a> {
    pub fn new(
        machine: &'a MachineSpec,
        clocks: Clocks,
        builder: &'a DemandBuilder,
        stream: &'a Stream,
        recorder: Recorder,
    ) -> Self {
        let common = Station::ALL.map(|station| machine.common(station.unit()));
        let period = |station: Station| clocks.period(common[station as usize].clock);
        let stage = |station: Station| {
            (station.unit() != Unit::Shader).then(|| {
                let Common { in_flight, lines_per_cycle, .. } = common[station as usize];
                Stage::new(period(station), in_flight, lines_per_cycle)
            })
        };
        // Stages are busy for a part of a cycle.
        let mut servers = [CYCLE as u32; Unit::COUNT];
        servers[Unit::Shader as usize] = machine.shader.cores.get() * machine.shader.lanes.get();
        servers[Unit::L2 as usize] = machine.l2.lines_per_cycle.get();
        for (unit, spec) in LEVELS.into_iter().zip(machine.levels()) {
            servers[unit as usize] = spec.map_or(1, |spec| spec.lines_per_cycle.get());
        }
        servers[Unit::Dram as usize] = machine.dram.channels.get();
        let shared = SharedState {
            clocks,
            builder,
            stream,
            latency: Station::ALL
                .map(|station| period(station) * Time::from(common[station as usize].latency_cycles)),
            sources: Sources::new(&stream.demands),
            passes: Passes::default(),
            departures: vec![0; stream.demands.len()],
            recorder,
            end: 0,
        };
        Self {
            spec: machine,
            shared,
            queues: Station::ALL.map(|station| Queue::new(common[station as usize].queue)),
            stages: Station::ALL.map(stage),
            shader: Shader::new(machine, &clocks),
            data: DataUnit::ALL.map(|unit| DataStage::new(machine, &clocks, unit)),
            l2: L2::new(machine, &clocks),
            levels: Levels::new(machine, &clocks),
            dram: Dram::new(machine, &clocks),
            waits: Waits::default(),
            meter: Meter::new(clocks, servers),
            visited: 0,
        }
    }

    pub fn run(mut self, options: &StepOptions) -> Result<Timed, Stalled> {
        let periods = Unit::ALL.map(|unit| self.period(unit));
        let (mut now, mut quiet_since) = (0, 0);
        let longest = periods.into_iter().max().unwrap_or(1);
        loop {
            let mut acted = false;
            self.shared.sources.begin_cycle();
            for unit in options.order.into_iter().filter(|&unit| self.spec.has(unit)) {
                if now % periods[unit as usize] == 0 {
                    acted |= self.tick(unit, now);
                    self.visited += 1;
                }
            }
            if acted {
                quiet_since = now + 1;
                now = self.shared.clocks.next_edge(now);
                continue;
            }
            // If all units had a cycle without action, nothing happens before the earliest time a unit waits
            // for. A time just past may belong to a unit whose cycle is still to come.
            let quiet = now >= quiet_since + longest - 1;
            now = match self.wakes_at(now.saturating_sub(longest)) {
                None if quiet => break,
                Some(at) if quiet && options.skip_idle && at > now => self.shared.clocks.edge_from(at),
                _ => self.shared.clocks.next_edge(now),
            };
        }
        self.finish(now)
    }

    fn finish(mut self, now: Time) -> Result<Timed, Stalled> {
        let clocks = self.shared.clocks;
        let is_memory_empty = self.l2.is_empty() && self.levels.is_empty() && self.dram.is_empty();
        if self.shared.sources.remaining() > 0 || !is_memory_empty {
            return Err(Stalled {
                cycles: clocks.cycles(crate::Clock::Core, now),
                remaining: self.shared.sources.remaining(),
            });
        }
        let memory_end = self.l2.ends_at().max(self.levels.ends_at()).max(self.dram.ends_at());
        let end = self.shared.end.max(memory_end);
        self.meter.finish(end, &mut self.shared.recorder);
        let SharedState { mut recorder, mut passes, departures, stream, builder, .. } = self.shared;
        recorder.lasts(clocks.ps(end));
        let timeline = recorder.finish();
        let cycles = clocks.cycles(crate::Clock::Core, end);
        for (demand, counts) in stream.demands.iter().zip(&stream.counts) {
            builder.add_work(demand, counts, passes.work(demand.pass));
        }
        let mut draws = DrawTimes::new(usize::MAX);
        stream.demands.iter().zip(departures).for_each(|(demand, at)| draws.departed(demand, at));
        let (parts, spans) = draws.finish(&clocks, timeline.duration_ps);
        Ok(Timed {
            passes: passes.finish(self.spec, &clocks, timeline.duration_ps, &parts),
            spans,
            timeline,
            cycles,
            stalls: Some(self.meter.stalls),
            unit_cycles: self.visited,
            packets: stream.demands.len() as u64,
            checked: None,
        })
    }

    fn period(&self, unit: Unit) -> Time {
        match unit {
            Unit::Shader => self.shader.period(),
            Unit::Texture => self.data[DataUnit::Texture as usize].stage.period(),
            Unit::Compute => self.data[DataUnit::Compute as usize].stage.period(),
            Unit::L2 => self.l2.period(),
            Unit::Llc | Unit::Edram => self.levels.period(unit).unwrap_or(1),
            Unit::Dram => self.dram.period(),
            _ => self.stages[station_of(unit) as usize].as_ref().map_or(1, Stage::period),
        }
    }

    /// Simulate one cycle of one unit. Returns whether it acted.
    fn tick(&mut self, unit: Unit, now: Time) -> bool {
        let (clocks, recorder) = (self.shared.clocks, &mut self.shared.recorder);
        match unit {
            Unit::Shader => self.tick_shader(now),
            Unit::Texture => self.tick_data(DataUnit::Texture, now),
            Unit::Compute => self.tick_data(DataUnit::Compute, now),
            Unit::L2 => {
                let below = (&mut self.levels, &mut self.dram);
                self.l2.tick(now, below, &mut self.waits, &mut self.meter, recorder, &clocks)
            }
            Unit::Llc | Unit::Edram => {
                let below = (&mut self.dram, &mut self.waits);
                self.levels.tick(unit, now, below, &mut self.meter, recorder, &clocks)
            }
            Unit::Dram => self.dram.tick(now, &mut self.waits, &mut self.meter, recorder, &clocks),
            _ => self.tick_stage(station_of(unit), now),
        }
    }

    fn tick_stage(&mut self, station: Station, now: Time) -> bool {
        let (before, after) = self.queues.split_at_mut(station as usize + 1);
        let input = &mut before[station as usize];
        let fed = self.shared.sources.feed(station, now, input);
        let Some(stage) = &mut self.stages[station as usize] else { return false };
        let port = port(station.unit()).map(|port| &mut self.l2.ports[port]);
        let mut at = StationEnv { shared: &mut self.shared, next: after.first_mut(), station };
        let ticked = stage.tick(now, input, port, &mut self.waits, &mut at);
        let reason =
            if stage.is_free() { self.shared.sources.idle_reason(station, now) } else { ticked.reason };
        self.meter.set(station.unit(), now, ticked.busy as u32, reason, &mut self.shared.recorder);
        fed || ticked.acted
    }

    fn tick_shader(&mut self, now: Time) -> bool {
        let [_, vertex, setup, _, _, _, _, _, pixel, colour] = &mut self.queues;
        let mut cores = CoresEnv { shared: &mut self.shared, setup, colour };
        let demands = &cores.shared.stream.demands;
        let data = self.data.each_mut().map(|data| &mut data.queue);
        let (acted, busy, reason) = self.shader.tick(now, demands, [vertex, pixel], data, &mut cores);
        let reason = reason.unwrap_or_else(|| self.shared.sources.idle_reason(Station::Pixel, now));
        self.meter.set(Unit::Shader, now, busy, reason, &mut self.shared.recorder);
        acted
    }

    fn tick_data(&mut self, unit: DataUnit, now: Time) -> bool {
        let DataStage { stage, queue, latency } = &mut self.data[unit as usize];
        let mut env = DataEnv { shared: &self.shared, shader: &mut self.shader, unit, latency: *latency };
        let port = Some(&mut self.l2.ports[unit.port()]);
        let ticked = stage.tick(now, queue, port, &mut self.waits, &mut env);
        let idle = stage.is_free() && self.shared.sources.remaining_at(Station::Pixel) == 0;
        let reason = match (stage.is_free(), idle) {
            (_, true) => Reason::Idle,
            (true, _) => Reason::Starved(Unit::Shader),
            _ => ticked.reason,
        };
        self.meter.set(unit.unit(), now, ticked.busy as u32, reason, &mut self.shared.recorder);
        ticked.acted
    }

    /// Earliest time after `now` that a unit waits for.
    fn wakes_at(&self, now: Time) -> Option<Time> {
        let stages = self.stages.iter().zip(&self.queues);
        let stages = stages.filter_map(|(stage, input)| stage.as_ref()?.wakes_at(now, input, &self.waits));
        let inputs = [&self.queues[Station::Vertex as usize], &self.queues[Station::Pixel as usize]];
        let others = [
            self.shader.wakes_at(now, inputs),
            self.l2.wakes_at(now),
            self.levels.wakes_at(now),
            self.dram.wakes_at(now),
            self.shared.sources.wakes_at(now),
        ];
        let data = self.data.iter().filter_map(|data| data.stage.wakes_at(now, &data.queue, &self.waits));
        stages.chain(data).chain(others.into_iter().flatten()).min()
    }
}

/// Station of a unit with one station.
fn station_of(unit: Unit) -> Station {
    Station::ALL.into_iter().find(|station| station.unit() == unit).unwrap_or(Station::Command)
}

/// State shared by all units.
struct SharedState<'a> {
    pub clocks: Clocks,
    pub builder: &'a DemandBuilder,
    pub stream: &'a Stream,
    pub latency: [Time; Station::COUNT],
    pub sources: Sources,
    pub passes: Passes,
    /// When each packet left the machine.
    pub departures: Vec<Time>,
    pub recorder: Recorder,
    pub end: Time,
}

/// Environment of a unit at a station; its items are packets.
struct StationEnv<'w, 'a> {
    pub shared: &'w mut SharedState<'a>,
    pub next: Option<&'w mut Queue<u32>>,
    pub station: Station,
}

impl StageEnv for StationEnv<'_, '_> {
    fn work(&self, id: u32) -> (Work, std::ops::Range<usize>) {
        let demand = &self.shared.stream.demands[id as usize];
        let lines = port(self.station.unit()).map_or(0..0, |port| demand.lines_of(port));
        (demand.service[self.station as usize], lines)
    }

    fn line(&self, at: usize) -> LineAccess {
        self.shared.stream.lines[at]
    }

    fn is_barrier(&self, id: u32) -> bool {
        self.shared.stream.demands[id as usize].barrier.is_some()
    }

    fn served(&mut self, id: u32, from: Time, to: Time) {
        self.shared.count(self.station.unit(), id, from, to);
    }

    fn leave(&mut self, id: u32, now: Time) -> Result<(), Unit> {
        self.shared.leave(self.station, id, now, self.next.as_deref_mut())
    }
}

impl SharedState<'_> {
    fn count(&mut self, unit: Unit, id: u32, from: Time, to: Time) {
        let counts = &self.stream.counts[id as usize];
        self.passes.note(self.stream.demands[id as usize].pass, from, to);
        self.recorder.count(unit, counts, self.clocks.ps(from), self.clocks.ps(to));
    }

    /// Move a packet from `station` to the next queue, or finish it.
    fn leave(
        &mut self,
        station: Station,
        id: u32,
        now: Time,
        next: Option<&mut Queue<u32>>,
    ) -> Result<(), Unit> {
        let demand = &self.stream.demands[id as usize];
        let at = now + self.latency[station as usize];
        if demand.last == station {
            self.sources.done(id, demand, at);
            self.passes.note(demand.pass, at, at);
            self.departures[id as usize] = at;
            self.end = self.end.max(at);
            return Ok(());
        }
        let Some(next) = next else { return Ok(()) };
        if next.room(now) == 0 {
            return Err(Station::ALL[station as usize + 1].unit());
        }
        next.push(id, at);
        Ok(())
    }
}

/// Environment of the shader cores; packets go on to set-up or to colour.
struct CoresEnv<'w, 'a> {
    pub shared: &'w mut SharedState<'a>,
    pub setup: &'w mut Queue<u32>,
    pub colour: &'w mut Queue<u32>,
}

impl CoreEnv for CoresEnv<'_, '_> {
    fn served(&mut self, kind: WarpKind, packet: u32, from: Time, to: Time) {
        self.shared.count(Unit::Shader, packet, from, to);
        if kind == WarpKind::Pixels {
            let unit = self.shared.stream.demands[packet as usize].data_unit().unit();
            self.shared.count(unit, packet, from, to);
        }
    }

    fn leave(&mut self, kind: WarpKind, packet: u32, now: Time) -> Result<(), Unit> {
        let (station, next) = match kind {
            WarpKind::Vertices => (Station::Vertex, &mut *self.setup),
            WarpKind::Pixels => (Station::Pixel, &mut *self.colour),
        };
        self.shared.leave(station, packet, now, Some(next))
    }
}

/// Environment of a data unit; its items are warps.
struct DataEnv<'w, 'a> {
    pub shared: &'w SharedState<'a>,
    pub shader: &'w mut Shader,
    pub unit: DataUnit,
    pub latency: Time,
}

impl StageEnv for DataEnv<'_, '_> {
    fn work(&self, id: u32) -> (Work, std::ops::Range<usize>) {
        let warp = self.shader.warp(id);
        let demand = &self.shared.stream.demands[warp.packet as usize];
        let data = warp.data(demand);
        let all = demand.lines_of(self.unit.port());
        let part = crate::demand::share(all.len() as u32, warp.part, warp.parts);
        let range = all.start + part.start as usize..all.start + part.end as usize;
        (self.shared.builder.data_work(self.unit, data), range)
    }

    fn line(&self, at: usize) -> LineAccess {
        self.shared.stream.lines[at]
    }

    fn is_barrier(&self, _: u32) -> bool {
        false
    }

    fn served(&mut self, _: u32, _: Time, _: Time) {}

    fn leave(&mut self, id: u32, now: Time) -> Result<(), Unit> {
        self.shader.fetched(id, now + self.latency);
        Ok(())
    }
}
