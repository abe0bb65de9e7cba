//! Where packets come from: the command stream, and the bins, which are double buffered.

use activity::Unit;

use super::meter::Rest;
use super::queue::Queue;
use crate::clock::Time;
use crate::job::{Job, Place};

/// Packets of a batch that are not done, and when the last of them was.
#[derive(Clone, Copy, Debug, Default)]
struct Gate {
    left: usize,
    at: Time,
}

impl Gate {
    fn is_open(&self, now: Time) -> bool {
        self.left == 0 && self.at <= now
    }
}

/// The packets of a frame that no unit has seen yet. Tiles wait for the set-up of their whole batch; the front end waits for
/// the tiles of the batch before the last.
#[derive(Clone, Debug)]
pub(super) struct Sources {
    /// Number, batch and path of the packets of each path, in order, and the next of them.
    paths: [Vec<(u32, u32)>; 2],
    next: [usize; 2],
    set_up: Vec<Gate>,
    traversed: Vec<Gate>,
    /// Packets that will still come to each place.
    to_come: [usize; Place::COUNT],
    /// Packets done in this cycle, of which others hear in the next: the first and last of their places.
    news: Vec<(usize, usize)>,
    left: usize,
}

impl Sources {
    pub fn new(jobs: &[Job]) -> Self {
        let batches = jobs.iter().map(|job| job.batch as usize + 1).max().unwrap_or(0);
        let mut sources = Self {
            paths: [Vec::new(), Vec::new()],
            next: [0; 2],
            set_up: vec![Gate::default(); batches],
            traversed: vec![Gate::default(); batches],
            to_come: [0; Place::COUNT],
            news: Vec::new(),
            left: jobs.len(),
        };
        for (job, id) in jobs.iter().zip(0..) {
            sources.paths[usize::from(!job.front)].push((id, job.batch));
            sources.gate(job).left += 1;
            let first = if job.front { 0 } else { Place::Traversal as usize };
            sources.to_come[first..=job.last as usize].iter_mut().for_each(|count| *count += 1);
        }
        sources
    }

    fn gate(&mut self, job: &Job) -> &mut Gate {
        let gates = if job.front { &mut self.set_up } else { &mut self.traversed };
        &mut gates[job.batch as usize]
    }

    /// Packets not done.
    pub fn left(&self) -> usize {
        self.left
    }

    /// Packets that are not through with `place` or any place before it.
    pub fn left_at(&self, place: Place) -> usize {
        self.to_come[place as usize]
    }

    /// A packet is done at `at`.
    pub fn done(&mut self, job: &Job, at: Time) {
        let gate = self.gate(job);
        gate.left -= 1;
        gate.at = gate.at.max(at);
        self.left -= 1;
        self.news.push((if job.front { 0 } else { Place::Traversal as usize }, job.last as usize));
    }

    /// A new cycle begins.
    pub fn settle(&mut self) {
        for (first, last) in self.news.drain(..) {
            self.to_come[first..=last].iter_mut().for_each(|count| *count -= 1);
        }
    }

    /// Fills the queue of the first place of a path.
    pub fn feed(&mut self, place: Place, now: Time, queue: &mut Queue<u32>) -> bool {
        let path = match place {
            Place::Command => 0,
            Place::Traversal => 1,
            _ => return false,
        };
        let mut fed = false;
        while queue.room(now) > 0
            && let Some(&(id, batch)) = self.paths[path].get(self.next[path])
            && self.may_start(path, batch, now)
        {
            queue.push(id, now);
            self.next[path] += 1;
            fed = true;
        }
        fed
    }

    fn waits_for(&self, path: usize, batch: u32) -> Option<&Gate> {
        match path {
            0 => self.traversed.get((batch as usize).checked_sub(2)?),
            _ => self.set_up.get(batch as usize),
        }
    }

    fn may_start(&self, path: usize, batch: u32, now: Time) -> bool {
        self.waits_for(path, batch).is_none_or(|gate| gate.is_open(now))
    }

    /// Why `place` has nothing to do.
    pub fn without(&self, place: Place, now: Time) -> Rest {
        let gated = |path: usize| {
            let next = self.paths[path].get(self.next[path]);
            next.is_some_and(|&(_, batch)| !self.may_start(path, batch, now))
        };
        match place {
            Place::Pixel if self.left_at(Place::Pixel) > 0 => Rest::Starved(Unit::ShadingCache),
            Place::Pixel if self.left_at(Place::Vertex) > 0 => Rest::Starved(Unit::Command),
            _ if self.left_at(place) == 0 => Rest::Idle,
            Place::Command if gated(0) => Rest::Blocked(Unit::Traversal),
            Place::Command => Rest::Idle,
            Place::Traversal if gated(1) => Rest::Starved(Unit::Setup),
            Place::Traversal => Rest::Idle,
            _ => Rest::Starved(Place::ALL[place as usize - 1].unit()),
        }
    }

    /// The first moment after `now` at which a batch may go on.
    pub fn wakes_at(&self, now: Time) -> Option<Time> {
        let gates = (0..2).filter_map(|path| {
            let &(_, batch) = self.paths[path].get(self.next[path])?;
            self.waits_for(path, batch)
        });
        gates.filter(|gate| gate.left == 0).map(|gate| gate.at).filter(|&at| at > now).min()
    }
}
