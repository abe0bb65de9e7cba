//! Sources that fill the first queues: the command stream, the double-buffered bins, and barriers between
//! passes.

use activity::Unit;

use super::queue::Queue;
use crate::clock::Time;
use crate::demand::{ServiceDemand, Station};
use crate::recorder::Reason;

/// Unfinished packets of a group, and when the last one finished.
#[derive(Clone, Copy, Debug, Default)]
struct Gate {
    remaining: usize,
    at: Time,
}

impl Gate {
    fn is_open(&self, now: Time) -> bool {
        self.remaining == 0 && self.at <= now
    }

    fn done(&mut self, at: Time) {
        self.remaining -= 1;
        self.at = self.at.max(at);
    }
}

/// A packet that has yet to start.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    id: u32,
    batch: u32,
    is_barrier: bool,
    /// Barriers that it waits for: those before this number.
    barriers: usize,
}

/// Packets of a frame not yet in any queue.
///
/// Tiles wait for the set-up of their whole batch. The front end waits for the tiles of the batch before the
/// last. A barrier waits for all packets before it, tiles after it wait for the barrier, and so does the
/// front end if the barrier says so.
#[derive(Clone, Debug)]
pub(super) struct Sources {
    /// Packets of each path, in order, and the next of each path.
    paths: [Vec<Waiting>; 2],
    next: [usize; 2],
    set_up: Vec<Gate>,
    traversed: Vec<Gate>,
    /// Packets between barriers. Group 0 comes before the first barrier; each barrier is the first packet of
    /// its group.
    groups: Vec<Gate>,
    /// Each barrier alone, and its packet.
    barriers: Vec<Gate>,
    barrier_ids: Vec<u32>,
    /// Packets that have yet to pass each station.
    to_come: [usize; Station::COUNT],
    /// Packets done in this cycle, as first and last station; visible in the next cycle.
    done_this_cycle: Vec<(usize, usize)>,
    remaining: usize,
}

impl Sources {
    pub fn new(demands: &[ServiceDemand]) -> Self {
        let batches = demands.iter().map(|demand| demand.batch as usize + 1).max().unwrap_or(0);
        let mut sources = Self {
            paths: [Vec::new(), Vec::new()],
            next: [0; 2],
            set_up: vec![Gate::default(); batches],
            traversed: vec![Gate::default(); batches],
            groups: vec![Gate::default()],
            barriers: Vec::new(),
            barrier_ids: Vec::new(),
            to_come: [0; Station::COUNT],
            done_this_cycle: Vec::new(),
            remaining: demands.len(),
        };
        let mut barriers_for_front = 0;
        for (demand, id) in demands.iter().zip(0..) {
            let before = sources.barriers.len();
            if let Some(waits) = demand.barrier {
                sources.barriers.push(Gate::default());
                sources.barrier_ids.push(id);
                sources.groups.push(Gate::default());
                barriers_for_front =
                    if waits == activity::Waits::All { before + 1 } else { barriers_for_front };
            }
            sources.paths[usize::from(!demand.front)].push(Waiting {
                id,
                batch: demand.batch,
                is_barrier: demand.barrier.is_some(),
                barriers: if demand.front { barriers_for_front } else { before },
            });
            sources.gates_of(id, demand).into_iter().flatten().for_each(|gate| gate.remaining += 1);
            sources.to_come[demand.first() as usize..=demand.last as usize]
                .iter_mut()
                .for_each(|count| *count += 1);
        }
        sources
    }

    /// Gates that open when packet number `id` and all others of its groups are done.
    fn gates_of(&mut self, id: u32, demand: &ServiceDemand) -> [Option<&mut Gate>; 2] {
        let group = self.barrier_ids.partition_point(|&barrier| barrier <= id);
        let own = match demand.barrier {
            Some(_) => self.barriers.get_mut(group - 1),
            None if demand.front => self.set_up.get_mut(demand.batch as usize),
            None => self.traversed.get_mut(demand.batch as usize),
        };
        [own, self.groups.get_mut(group)]
    }

    /// Packets not done.
    pub fn remaining(&self) -> usize {
        self.remaining
    }

    /// Packets that have yet to pass `station`.
    pub fn remaining_at(&self, station: Station) -> usize {
        self.to_come[station as usize]
    }

    /// Record that packet number `id` is done at `at`.
    pub fn done(&mut self, id: u32, demand: &ServiceDemand, at: Time) {
        self.gates_of(id, demand).into_iter().flatten().for_each(|gate| gate.done(at));
        self.remaining -= 1;
        self.done_this_cycle.push((demand.first() as usize, demand.last as usize));
    }

    /// Begin a cycle.
    pub fn begin_cycle(&mut self) {
        for (first, last) in self.done_this_cycle.drain(..) {
            self.to_come[first..=last].iter_mut().for_each(|count| *count -= 1);
        }
    }

    /// Fill the input queue of the first station of a path.
    pub fn feed(&mut self, station: Station, now: Time, queue: &mut Queue<u32>) -> bool {
        let path = match station {
            Station::Command => 0,
            Station::Traversal => 1,
            _ => return false,
        };
        let mut fed = false;
        while queue.room(now) > 0
            && let Some(&waiting) = self.paths[path].get(self.next[path])
            && self.gates_before(path, waiting).all(|gate| gate.is_open(now))
        {
            queue.push(waiting.id, now);
            self.next[path] += 1;
            fed = true;
        }
        fed
    }

    /// Gates that a packet waits for: its batch, or all packets before a barrier; and the last barrier, which
    /// waits for those before.
    fn gates_before(&self, path: usize, waiting: Waiting) -> impl Iterator<Item = &Gate> {
        let batch = waiting.batch as usize;
        let own = match path {
            _ if waiting.is_barrier => self.groups.get(waiting.barriers),
            0 => batch.checked_sub(2).and_then(|before| self.traversed.get(before)),
            _ => self.set_up.get(batch),
        };
        own.into_iter().chain(self.barrier_before(waiting))
    }

    fn barrier_before(&self, waiting: Waiting) -> Option<&Gate> {
        self.barriers.get(waiting.barriers.checked_sub(1)?)
    }

    /// Why `station` has no work.
    pub fn idle_reason(&self, station: Station, now: Time) -> Reason {
        match station {
            Station::Pixel if self.remaining_at(Station::Pixel) > 0 => Reason::Starved(Unit::ShadingCache),
            Station::Pixel if self.remaining_at(Station::Vertex) > 0 => Reason::Starved(Unit::Command),
            _ if self.remaining_at(station) == 0 => Reason::Idle,
            Station::Command => self.waits_for(0, now).map_or(Reason::Idle, Reason::Blocked),
            Station::Traversal => self.waits_for(1, now).map_or(Reason::Idle, Reason::Starved),
            _ => Reason::Starved(Station::ALL[station as usize - 1].unit()),
        }
    }

    /// The unit that the next packet of a path waits for, if it may not start: the last unit of the tiles at
    /// a barrier.
    fn waits_for(&self, path: usize, now: Time) -> Option<Unit> {
        let &next = self.paths[path].get(self.next[path])?;
        let closed = |gate: &Gate| !gate.is_open(now);
        let at_barrier = next.is_barrier || self.barrier_before(next).is_some_and(closed);
        self.gates_before(path, next).any(closed).then_some(match path {
            _ if at_barrier => Unit::Colour,
            0 => Unit::Traversal,
            _ => Unit::Setup,
        })
    }

    /// Earliest time after `now` at which a path may continue.
    pub fn wakes_at(&self, now: Time) -> Option<Time> {
        let gates = (0..2).filter_map(|path| {
            let &next = self.paths[path].get(self.next[path])?;
            Some(self.gates_before(path, next))
        });
        gates.flatten().filter(|gate| gate.remaining == 0).map(|gate| gate.at).filter(|&at| at > now).min()
    }
}
