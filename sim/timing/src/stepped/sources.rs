//! Sources of packets: the command stream, and the bins, which are double buffered.

use activity::Unit;

use super::queue::Queue;
use crate::clock::Time;
use crate::demand::{ServiceDemand, Station};
use crate::stalls::Reason;

/// Unfinished packets of a batch, and when the last one finished.
#[derive(Clone, Copy, Debug, Default)]
struct Gate {
    remaining: usize,
    at: Time,
}

impl Gate {
    fn is_open(&self, now: Time) -> bool {
        self.remaining == 0 && self.at <= now
    }
}

/// Packets of a frame not yet in any queue. Tiles wait for the set-up of their whole batch. The front end
/// waits for the tiles of the batch before the last.
#[derive(Clone, Debug)]
pub(super) struct Sources {
    /// Index and batch of the packets of each path, in order, and the next of each path.
    paths: [Vec<(u32, u32)>; 2],
    next: [usize; 2],
    set_up: Vec<Gate>,
    traversed: Vec<Gate>,
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
            to_come: [0; Station::COUNT],
            done_this_cycle: Vec::new(),
            remaining: demands.len(),
        };
        for (demand, id) in demands.iter().zip(0..) {
            sources.paths[usize::from(!demand.front)].push((id, demand.batch));
            sources.gate(demand).remaining += 1;
            let first = if demand.front { 0 } else { Station::Traversal as usize };
            sources.to_come[first..=demand.last as usize].iter_mut().for_each(|count| *count += 1);
        }
        sources
    }

    fn gate(&mut self, demand: &ServiceDemand) -> &mut Gate {
        let gates = if demand.front { &mut self.set_up } else { &mut self.traversed };
        &mut gates[demand.batch as usize]
    }

    /// Packets not done.
    pub fn remaining(&self) -> usize {
        self.remaining
    }

    /// Packets that have yet to pass `station`.
    pub fn remaining_at(&self, station: Station) -> usize {
        self.to_come[station as usize]
    }

    /// Record that a packet is done at `at`.
    pub fn done(&mut self, demand: &ServiceDemand, at: Time) {
        let gate = self.gate(demand);
        gate.remaining -= 1;
        gate.at = gate.at.max(at);
        self.remaining -= 1;
        self.done_this_cycle
            .push((if demand.front { 0 } else { Station::Traversal as usize }, demand.last as usize));
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

    /// Why `station` has no work.
    pub fn idle_reason(&self, station: Station, now: Time) -> Reason {
        let gated = |path: usize| {
            let next = self.paths[path].get(self.next[path]);
            next.is_some_and(|&(_, batch)| !self.may_start(path, batch, now))
        };
        match station {
            Station::Pixel if self.remaining_at(Station::Pixel) > 0 => Reason::Starved(Unit::ShadingCache),
            Station::Pixel if self.remaining_at(Station::Vertex) > 0 => Reason::Starved(Unit::Command),
            _ if self.remaining_at(station) == 0 => Reason::Idle,
            Station::Command if gated(0) => Reason::Blocked(Unit::Traversal),
            Station::Command => Reason::Idle,
            Station::Traversal if gated(1) => Reason::Starved(Unit::Setup),
            Station::Traversal => Reason::Idle,
            _ => Reason::Starved(Station::ALL[station as usize - 1].unit()),
        }
    }

    /// Earliest time after `now` at which a batch may continue.
    pub fn wakes_at(&self, now: Time) -> Option<Time> {
        let gates = (0..2).filter_map(|path| {
            let &(_, batch) = self.paths[path].get(self.next[path])?;
            self.waits_for(path, batch)
        });
        gates.filter(|gate| gate.remaining == 0).map(|gate| gate.at).filter(|&at| at > now).min()
    }
}
