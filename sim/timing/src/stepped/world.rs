//! What surrounds the units: which packets come, and where they go.

use activity::{LineAccess, Unit};

use super::Stream;
use super::queue::Queue;
use super::shader::{Outside, Shader};
use super::sources::Sources;
use super::stage::Around;
use crate::Recorder;
use crate::clock::{Clocks, Time};
use crate::job::{Jobs, Place, TEXTURE_PORT, port};

/// What the units share.
pub(super) struct World<'a> {
    pub clocks: Clocks,
    pub makes: &'a Jobs,
    pub stream: &'a Stream,
    pub latency: [Time; Place::COUNT],
    pub sources: Sources,
    pub recorder: Recorder,
    pub end: Time,
}

/// A unit at its place: its packets are jobs.
pub(super) struct At<'w, 'a> {
    pub world: &'w mut World<'a>,
    pub next: Option<&'w mut Queue<u32>>,
    pub place: Place,
}

impl Around for At<'_, '_> {
    fn work(&self, id: u32) -> (u32, std::ops::Range<usize>) {
        let job = &self.world.stream.jobs[id as usize];
        let lines = port(self.place.unit()).map_or(0..0, |port| job.lines_of(port));
        (job.service[self.place as usize], lines)
    }

    fn line(&self, at: usize) -> LineAccess {
        self.world.stream.lines[at]
    }

    fn served(&mut self, id: u32, from: Time, to: Time) {
        self.world.count(self.place.unit(), id, from, to);
    }

    fn leave(&mut self, id: u32, now: Time) -> Result<(), Unit> {
        self.world.leave(self.place, id, now, self.next.as_deref_mut())
    }
}

impl World<'_> {
    fn count(&mut self, unit: Unit, id: u32, from: Time, to: Time) {
        let counts = &self.stream.counts[id as usize];
        self.recorder.count(unit, counts, self.clocks.ps(from), self.clocks.ps(to));
    }

    /// A packet leaves `place`: to the next queue, or for good.
    fn leave(&mut self, place: Place, id: u32, now: Time, next: Option<&mut Queue<u32>>) -> Result<(), Unit> {
        let job = &self.stream.jobs[id as usize];
        let at = now + self.latency[place as usize];
        if job.last == place {
            self.sources.done(job, at);
            self.end = self.end.max(at);
            return Ok(());
        }
        let Some(next) = next else { return Ok(()) };
        if next.room(now) == 0 {
            return Err(Place::ALL[place as usize + 1].unit());
        }
        next.push(id, at);
        Ok(())
    }
}

/// The shader cores: packets leave for set-up or for colour.
pub(super) struct Cores<'w, 'a> {
    pub world: &'w mut World<'a>,
    pub setup: &'w mut Queue<u32>,
    pub colour: &'w mut Queue<u32>,
}

impl Outside for Cores<'_, '_> {
    fn served(&mut self, kind: usize, job: u32, from: Time, to: Time) {
        self.world.count(Unit::Shader, job, from, to);
        if kind == 1 {
            self.world.count(Unit::Texture, job, from, to);
        }
    }

    fn leave(&mut self, kind: usize, job: u32, now: Time) -> Result<(), Unit> {
        let (place, next) =
            if kind == 0 { (Place::Vertex, &mut *self.setup) } else { (Place::Pixel, &mut *self.colour) };
        self.world.leave(place, job, now, Some(next))
    }
}

/// The texture units: their packets are warps.
pub(super) struct Texels<'w, 'a> {
    pub world: &'w World<'a>,
    pub shader: &'w mut Shader,
    pub latency: Time,
}

impl Around for Texels<'_, '_> {
    fn work(&self, id: u32) -> (u32, std::ops::Range<usize>) {
        let warp = self.shader.warp(id);
        let job = &self.world.stream.jobs[warp.job as usize];
        let [fetches, lines] = warp.texels(job);
        let all = job.lines_of(TEXTURE_PORT);
        let part = crate::job::share(all.len() as u32, warp.part, warp.parts);
        let range = all.start + part.start as usize..all.start + part.end as usize;
        (self.world.makes.texture_cycles(fetches, lines), range)
    }

    fn line(&self, at: usize) -> LineAccess {
        self.world.stream.lines[at]
    }

    fn served(&mut self, _: u32, _: Time, _: Time) {}

    fn leave(&mut self, id: u32, now: Time) -> Result<(), Unit> {
        self.shader.textured(id, now + self.latency);
        Ok(())
    }
}
