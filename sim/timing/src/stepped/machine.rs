//! Everything there is, from cycle to cycle.

use activity::Unit;

use super::dram::Dram;
use super::memory::L2;
use super::meter::{Meter, Rest};
use super::queue::Queue;
use super::shader::Shader;
use super::sources::Sources;
use super::stage::Stage;
use super::waits::Waits;
use super::world::{At, Cores, Texels, World};
use super::{Manner, Stalled, Stream};
use crate::clock::{Clocks, Time};
use crate::job::{Jobs, Place, TEXTURE_PORT, port};
use crate::spec::{Common, MachineSpec};
use crate::{Recorder, Timed};

/// Everything there is.
pub(super) struct Machine<'a> {
    world: World<'a>,
    /// In front of each place.
    queues: [Queue<u32>; Place::COUNT],
    /// The unit at each place; the shader cores stand at two and are below.
    stages: [Option<Stage>; Place::COUNT],
    shader: Shader,
    texture: Stage,
    textures: Queue<u32>,
    texture_latency: Time,
    l2: L2,
    dram: Dram,
    waits: Waits,
    meter: Meter,
    /// Unit-cycles visited and skipped.
    visited: u64,
}

impl<'a> Machine<'a> {
    pub fn new(
        machine: &MachineSpec,
        clocks: Clocks,
        makes: &'a Jobs,
        stream: &'a Stream,
        recorder: Recorder,
    ) -> Self {
        let common = Place::ALL.map(|place| machine.common(place.unit()));
        let period = |place: Place| clocks.period(common[place as usize].clock);
        let stage = |place: Place| {
            (place.unit() != Unit::Shader).then(|| {
                let Common { in_flight, lines_per_cycle, .. } = common[place as usize];
                Stage::new(period(place), in_flight, lines_per_cycle)
            })
        };
        let mut servers = [1; Unit::COUNT];
        servers[Unit::Shader as usize] = machine.shader.cores.get() * machine.shader.lanes.get();
        servers[Unit::L2 as usize] = machine.l2.lines_per_cycle.get();
        servers[Unit::Dram as usize] = machine.dram.channels.get();
        let world = World {
            clocks,
            makes,
            stream,
            latency: Place::ALL
                .map(|place| period(place) * Time::from(common[place as usize].latency_cycles)),
            sources: Sources::new(&stream.jobs),
            recorder,
            end: 0,
        };
        Self {
            world,
            queues: Place::ALL.map(|place| Queue::new(common[place as usize].queue)),
            stages: Place::ALL.map(stage),
            shader: Shader::new(machine, &clocks),
            texture: Stage::new(
                clocks.period(machine.texture.clock),
                machine.texture.in_flight.get(),
                machine.texture.lines_per_cycle.get(),
            ),
            textures: Queue::new(machine.texture.queue.get()),
            texture_latency: clocks.period(machine.texture.clock)
                * Time::from(machine.texture.latency_cycles),
            l2: L2::new(machine, &clocks),
            dram: Dram::new(machine, &clocks),
            waits: Waits::default(),
            meter: Meter::new(clocks, servers),
            visited: 0,
        }
    }

    pub fn run(mut self, manner: &Manner) -> Result<Timed, Stalled> {
        let periods = Unit::ALL.map(|unit| self.period(unit));
        let (mut now, mut quiet_since) = (0, 0);
        let longest = periods.into_iter().max().unwrap_or(1);
        loop {
            let mut acted = false;
            self.world.sources.settle();
            for &unit in &manner.order {
                if now % periods[unit as usize] == 0 {
                    acted |= self.tick(unit, now);
                    self.visited += 1;
                }
            }
            if acted {
                quiet_since = now + 1;
                now = self.world.clocks.next_edge(now);
                continue;
            }
            // Once every unit has had a cycle since anything happened, nothing will until the next moment that one waits for.
            // A moment just gone may belong to a unit whose cycle is still to come.
            let quiet = now >= quiet_since + longest - 1;
            now = match self.wakes_at(now.saturating_sub(longest)) {
                None if quiet => break,
                Some(at) if quiet && manner.skip && at > now => self.world.clocks.edge_from(at),
                _ => self.world.clocks.next_edge(now),
            };
        }
        self.finish(now)
    }

    fn finish(mut self, now: Time) -> Result<Timed, Stalled> {
        let clocks = self.world.clocks;
        if self.world.sources.left() > 0 || !self.l2.is_empty() || !self.dram.is_empty() {
            return Err(Stalled {
                cycles: clocks.cycles(crate::Clock::Core, now),
                left: self.world.sources.left(),
            });
        }
        let end = self.world.end.max(self.l2.ends_at()).max(self.dram.ends_at());
        self.meter.finish(end, &mut self.world.recorder);
        let mut recorder = self.world.recorder;
        recorder.lasts(clocks.ps(end));
        let timeline = recorder.finish();
        let cycles = clocks.cycles(crate::Clock::Core, end);
        Ok(Timed {
            timeline,
            cycles,
            stalls: Some(self.meter.stalls),
            unit_cycles: self.visited,
            packets: self.world.stream.jobs.len() as u64,
            rows: None,
        })
    }

    fn period(&self, unit: Unit) -> Time {
        match unit {
            Unit::Shader => self.shader.period(),
            Unit::Texture => self.texture.period(),
            Unit::L2 => self.l2.period(),
            Unit::Dram => self.dram.period(),
            _ => self.stages[place(unit) as usize].as_ref().map_or(1, Stage::period),
        }
    }

    /// One cycle of one unit. Says whether it did anything.
    fn tick(&mut self, unit: Unit, now: Time) -> bool {
        let (clocks, recorder) = (self.world.clocks, &mut self.world.recorder);
        match unit {
            Unit::Shader => self.tick_shader(now),
            Unit::Texture => self.tick_texture(now),
            Unit::L2 => {
                self.l2.tick(now, &mut self.dram, &mut self.waits, &mut self.meter, recorder, &clocks)
            }
            Unit::Dram => self.dram.tick(now, &mut self.waits, &mut self.meter, recorder, &clocks),
            _ => self.tick_stage(place(unit), now),
        }
    }

    fn tick_stage(&mut self, place: Place, now: Time) -> bool {
        let (before, after) = self.queues.split_at_mut(place as usize + 1);
        let input = &mut before[place as usize];
        let fed = self.world.sources.feed(place, now, input);
        let Some(stage) = &mut self.stages[place as usize] else { return false };
        let port = port(place.unit()).map(|port| &mut self.l2.ports[port]);
        let mut at = At { world: &mut self.world, next: after.first_mut(), place };
        let ticked = stage.tick(now, input, port, &mut self.waits, &mut at);
        let rest = if stage.is_free() { self.world.sources.without(place, now) } else { ticked.rest };
        self.meter.set(place.unit(), now, u32::from(ticked.busy), rest, &mut self.world.recorder);
        fed || ticked.acted
    }

    fn tick_shader(&mut self, now: Time) -> bool {
        let [_, vertex, setup, _, _, _, _, _, pixel, colour] = &mut self.queues;
        let mut cores = Cores { world: &mut self.world, setup, colour };
        let jobs = &cores.world.stream.jobs;
        let (acted, busy, rest) =
            self.shader.tick(now, jobs, [vertex, pixel], &mut self.textures, &mut cores);
        let rest = rest.unwrap_or_else(|| self.world.sources.without(Place::Pixel, now));
        self.meter.set(Unit::Shader, now, busy, rest, &mut self.world.recorder);
        acted
    }

    fn tick_texture(&mut self, now: Time) -> bool {
        let mut texels =
            Texels { world: &self.world, shader: &mut self.shader, latency: self.texture_latency };
        let port = Some(&mut self.l2.ports[TEXTURE_PORT]);
        let ticked = self.texture.tick(now, &mut self.textures, port, &mut self.waits, &mut texels);
        let idle = self.texture.is_free() && self.world.sources.left_at(Place::Pixel) == 0;
        let rest = match (self.texture.is_free(), idle) {
            (_, true) => Rest::Idle,
            (true, _) => Rest::Starved(Unit::Shader),
            _ => ticked.rest,
        };
        self.meter.set(Unit::Texture, now, u32::from(ticked.busy), rest, &mut self.world.recorder);
        ticked.acted
    }

    /// The first moment after `now` for which any unit waits or waited.
    fn wakes_at(&self, now: Time) -> Option<Time> {
        let stages = self.stages.iter().zip(&self.queues);
        let stages = stages.filter_map(|(stage, input)| stage.as_ref()?.wakes_at(now, input, &self.waits));
        let inputs = [&self.queues[Place::Vertex as usize], &self.queues[Place::Pixel as usize]];
        let others = [
            self.shader.wakes_at(now, inputs),
            self.texture.wakes_at(now, &self.textures, &self.waits),
            self.l2.wakes_at(now),
            self.dram.wakes_at(now),
            self.world.sources.wakes_at(now),
        ];
        stages.chain(others.into_iter().flatten()).min()
    }
}

/// Where a unit stands that stands at one place.
fn place(unit: Unit) -> Place {
    Place::ALL.into_iter().find(|place| place.unit() == unit).unwrap_or(Place::Command)
}
