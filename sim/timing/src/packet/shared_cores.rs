//! Cores that serve their warps in turn: processor sharing (Kleinrock 1967), with a speed limit, as a warp makes
//! a step in no less than its latency.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::slots::FreeSlots;
use crate::clock::Time;
use crate::spec::ShaderSpec;

/// Parts of a step and of a lane, in which sums are exact.
const SCALE: f64 = 1024.0;

/// Warps of a packet that run together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Warps {
    /// Number of their packet; `None` for vertices.
    pub packet: Option<usize>,
    pub count: u32,
    /// Steps of each, one after another, and its lanes in a step.
    pub steps: u32,
    pub lanes: f64,
}

/// Warps that have ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ended {
    pub packet: Option<usize>,
    pub count: u32,
    pub at: f64,
}

/// A place for warps on a core, which is free from `at` on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    core: usize,
    pub at: f64,
}

/// All cores. A warp stays on its core.
#[derive(Clone, Debug)]
pub(super) struct SharedCores {
    cores: Vec<Core>,
    speed: Speed,
    slots: u32,
    /// Free slots of each core, and when its next one becomes free; infinite if that is not known.
    free: Vec<u32>,
    next_free: Vec<f64>,
    /// When the next warps end on each core, and the core where they end first.
    next_end: Vec<f64>,
    first: usize,
}

#[derive(Clone, Copy, Debug)]
struct Speed {
    period: f64,
    alu: f64,
    lanes: f64,
    /// Time of a part of a lane in a step.
    of_part: f64,
    /// Whether a warp may take several cycles per operation.
    is_narrow: bool,
}

/// Warps that run, by the steps at which they end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Active {
    /// In parts of a step.
    ends: u64,
    packet: Option<usize>,
    count: u32,
    /// Parts of a lane of all in a step.
    lanes: u64,
}

#[derive(Clone, Debug)]
struct Core {
    now: f64,
    /// Steps so far of a warp that was there from the beginning, and the time of one.
    steps: f64,
    step: f64,
    /// Parts of a lane in a step of all active warps.
    lanes: u64,
    active: BinaryHeap<Reverse<Active>>,
    /// Slots that become free later, by time.
    later: FreeSlots<f64>,
}

impl SharedCores {
    pub fn new(spec: &ShaderSpec, period: Time) -> Self {
        let slots = spec.warps.get();
        let core = Core {
            now: 0.0,
            steps: 0.0,
            step: 0.0,
            lanes: 0,
            active: BinaryHeap::new(),
            later: FreeSlots::default(),
        };
        let cores = spec.cores.get() as usize;
        Self {
            cores: vec![core; cores],
            speed: Speed {
                period: period as f64,
                alu: (period * Time::from(spec.alu_latency_cycles)) as f64,
                lanes: spec.lanes.get().into(),
                of_part: period as f64 / f64::from(spec.lanes.get()) / SCALE,
                is_narrow: spec.warp_lanes.get() > spec.lanes.get(),
            },
            slots,
            free: vec![slots; cores],
            next_free: vec![f64::INFINITY; cores],
            next_end: vec![f64::INFINITY; cores],
            first: 0,
        }
    }

    /// The core with most free slots of those that have `count` from `from` on; if none has, the one that has
    /// them first, as far as is known before more warps end.
    pub fn place(&mut self, count: u32, from: f64) -> Option<Place> {
        let (mut most, mut core) = (0, 0);
        for at in 0..self.cores.len() {
            if self.next_free[at] <= from {
                self.release_until(at, from);
            }
            if self.free[at] > most {
                (most, core) = (self.free[at], at);
            }
        }
        if most >= count {
            return Some(Place { core, at: from });
        }
        let room =
            |core: usize| Some(Place { core, at: self.cores[core].later.room_for(count - self.free[core])? });
        (0..self.cores.len()).filter_map(room).min_by(|a, b| a.at.total_cmp(&b.at))
    }

    /// Slots of a core that are free by `at` are free.
    fn release_until(&mut self, core: usize, at: f64) {
        let later = &mut self.cores[core].later;
        self.free[core] += later.take_until(at);
        self.next_free[core] = later.next().unwrap_or(f64::INFINITY);
    }

    /// If no slot is free at `at`, when one is again; infinite if that is not known.
    pub fn full_until(&self, at: f64) -> Option<f64> {
        if self.free.iter().any(|free| *free > 0) {
            return None;
        }
        Some(self.next_free.iter().copied().fold(f64::INFINITY, f64::min)).filter(|free| *free > at)
    }

    /// Slots that warps need which are sent together.
    pub fn slots_for(&self, warps: u32) -> u32 {
        warps.min(self.slots)
    }

    /// Take slots at a place.
    pub fn take(&mut self, place: Place, count: u32) {
        let now = count.min(self.free[place.core]);
        self.free[place.core] -= now;
        self.cores[place.core].later.take(count - now);
        self.release_until(place.core, 0.0);
    }

    /// Warps at a place begin at `at`, no earlier than others before.
    pub fn start(&mut self, place: Place, at: f64, warps: &Warps) {
        let core = &mut self.cores[place.core];
        core.advance(at);
        let lanes = ((warps.lanes * f64::from(warps.count)) * SCALE).round() as u64;
        let ends = ((core.steps + f64::from(warps.steps)) * SCALE).round() as u64;
        core.lanes += lanes;
        let Warps { packet, count, .. } = *warps;
        core.active.push(Reverse(Active { ends, packet, count, lanes }));
        let next = core.next_end(&self.speed);
        self.ends_at(place.core, next);
    }

    /// The next warps of a core end at `next`.
    fn ends_at(&mut self, core: usize, next: f64) {
        self.next_end[core] = next;
        if core == self.first {
            let first =
                |best: usize, at: usize| if self.next_end[at] < self.next_end[best] { at } else { best };
            self.first = (1..self.next_end.len()).fold(0, first);
        } else if next < self.next_end[self.first] {
            self.first = core;
        }
    }

    /// When the next warps end, if no more come; infinite if there are none.
    pub fn next_end(&self) -> f64 {
        self.next_end[self.first]
    }

    /// The next warps that end no later than `to`.
    pub fn end_next(&mut self, to: f64) -> Option<Ended> {
        let at = self.first;
        if self.next_end[at] > to {
            return None;
        }
        let core = &mut self.cores[at];
        let Reverse(Active { ends, packet, count, lanes }) = core.active.pop()?;
        (core.steps, core.now) = (core.steps.max(ends as f64 / SCALE), self.next_end[at]);
        core.lanes -= lanes;
        let (now, next) = (core.now, core.next_end(&self.speed));
        let ended = Ended { packet, count, at: now };
        core.later.give(now, count.min(self.slots));
        self.next_free[at] = self.next_free[at].min(now);
        self.ends_at(at, next);
        Some(ended)
    }
}

impl Core {
    /// Set the time of a step of all warps. Returns when those that end first do; infinite if there are none.
    fn next_end(&mut self, speed: &Speed) -> f64 {
        let Some(&Reverse(Active { ends, count, lanes, .. })) = self.active.peek() else {
            return f64::INFINITY;
        };
        let mut least = speed.alu;
        if speed.is_narrow {
            let of_warp = (lanes as f64 / SCALE / f64::from(count.max(1))).ceil();
            least += ((of_warp / speed.lanes).ceil() - 1.0).max(0.0) * speed.period;
        }
        self.step = least.max(self.lanes as f64 * speed.of_part);
        self.now + (ends as f64 / SCALE - self.steps).max(0.0) * self.step
    }

    /// Serve until `to`, when or before which no warp ends.
    fn advance(&mut self, to: f64) {
        if to > self.now {
            if !self.active.is_empty() {
                self.steps += (to - self.now) / self.step;
            }
            self.now = to;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cores of four lanes and two slots, with steps of at least two cycles.
    fn cores(count: u32) -> SharedCores {
        let mut spec: ShaderSpec = activity::spec::parse(
            "(latency_cycles: 1, queue: 8, in_flight: 8, cores: 1, lanes: 4, warp_lanes: 8, warps: 2, \
             alu_latency_cycles: 2, shared_bytes: 1024)",
            "test",
        )
        .unwrap();
        spec.cores = activity::Bounded::new(count).unwrap();
        SharedCores::new(&spec, 1)
    }

    fn start(cores: &mut SharedCores, packet: usize, at: f64, steps: u32) -> usize {
        let place = cores.place(1, at).unwrap();
        cores.take(place, 1);
        cores.start(place, at, &Warps { packet: Some(packet), count: 1, steps, lanes: 4.0 });
        place.core
    }

    fn ends(cores: &mut SharedCores) -> Vec<(Option<usize>, f64)> {
        std::iter::from_fn(|| cores.end_next(f64::INFINITY)).map(|ended| (ended.packet, ended.at)).collect()
    }

    #[test]
    fn warps_share_the_lanes_of_their_core_alone() {
        let mut cores = cores(2);
        // Three full warps: two of them have a step in two cycles, as one alone has.
        let of = [(0, 10), (1, 10), (2, 30)].map(|(packet, steps)| start(&mut cores, packet, 0.0, steps));
        assert_eq!(of, [0, 1, 0]);
        assert_eq!(ends(&mut cores), [(Some(0), 20.0), (Some(1), 20.0), (Some(2), 60.0)]);
        // Warps of eight lanes beside one of four take three cycles.
        let place = cores.place(1, 60.0).unwrap();
        cores.take(place, 1);
        cores.start(place, 60.0, &Warps { packet: Some(3), count: 1, steps: 10, lanes: 8.0 });
        assert_eq!(ends(&mut cores), [(Some(3), 90.0)]);
    }

    #[test]
    fn a_place_is_on_the_core_with_most_room_or_where_a_slot_is_free_first() {
        let mut cores = cores(2);
        let of =
            [(0, 40), (1, 10), (2, 20), (3, 5)].map(|(packet, steps)| start(&mut cores, packet, 0.0, steps));
        assert_eq!(of, [0, 1, 0, 1]);
        assert!(cores.place(1, 0.0).is_none());
        // The core of the shortest is known to be free once that has ended.
        assert_eq!(cores.end_next(f64::INFINITY).map(|ended| ended.at), Some(10.0));
        assert_eq!(cores.place(1, 3.0).map(|place| (place.core, place.at)), Some((1, 10.0)));
        assert_eq!(start(&mut cores, 4, 12.0, 1), 1);
        assert_eq!(cores.next_end(), 14.0);
    }
}
