//! The L2 and the levels between it and memory, cycle by cycle: requests in front of each, and what it sends
//! on. Hits and misses are given; the levels add their time.

use activity::{Event, LEVELS, LineAccess, LineKind, Unit};

use super::dram::{Dram, Reader};
use super::queue::{Meter, Queue, Waits};
use crate::Recorder;
use crate::clock::{Clocks, Time};
use crate::demand::CLIENTS;
use crate::recorder::Reason;
use crate::spec::{MachineSpec, SharedCacheSpec};

/// A request of the L2 on its way down.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passing {
    pub access: LineAccess,
    /// The waiting reader, and the latency from the level to it; `None` without a line to read.
    pub reader: Option<Reader>,
}

/// A level. Requests pass it in order.
#[derive(Clone, Debug)]
struct CacheLevel {
    unit: Unit,
    /// Index in [`LEVELS`].
    at: usize,
    queue: Queue<Passing>,
    lines_per_cycle: u32,
    period: Time,
    latency: Time,
    /// Lines accepted of the request in front.
    accepted: u32,
    ends_at: Time,
}

/// All levels that the machine has, from the L2 on.
#[derive(Clone, Debug)]
pub(super) struct Levels(Vec<CacheLevel>);

impl Levels {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let level = |((at, unit), spec): ((usize, Unit), Option<&SharedCacheSpec>)| {
            let spec = spec?;
            let period = clocks.period(spec.clock);
            Some(CacheLevel {
                unit,
                at,
                queue: Queue::new(spec.queue.get()),
                lines_per_cycle: spec.lines_per_cycle.get(),
                period,
                latency: period * Time::from(spec.latency_cycles),
                accepted: 0,
                ends_at: 0,
            })
        };
        Self(LEVELS.into_iter().enumerate().zip(machine.levels()).filter_map(level).collect())
    }

    /// Cycle of the level `unit`, if the machine has it.
    pub fn period(&self, unit: Unit) -> Option<Time> {
        self.0.iter().find(|level| level.unit == unit).map(|level| level.period)
    }

    /// The unit below `above` levels that has no room for what `access` needs of it.
    pub fn full_below(&self, above: usize, access: &LineAccess, dram: &Dram, now: Time) -> Option<Unit> {
        match self.0.get(above) {
            Some(level) => (needs(access, level.at) && level.queue.room(now) == 0).then_some(level.unit),
            None => (!dram.has_room(access, now)).then_some(Unit::Dram),
        }
    }

    /// Send a request to the unit below `above` levels, if it is needed there: from `now` on, visible at `seen_at`.
    pub fn push_below(
        &mut self,
        above: usize,
        passing: Passing,
        [now, seen_at]: [Time; 2],
        dram: &mut Dram,
        waits: &mut Waits,
    ) {
        let Passing { access, reader } = passing;
        let unit = match self.0.get_mut(above) {
            Some(level) if needs(&access, level.at) => {
                level.queue.push(passing, seen_at);
                level.unit
            }
            Some(_) => return,
            None => {
                dram.push_all(&access, reader, seen_at);
                Unit::Dram
            }
        };
        if let Some(reader) = reader {
            waits.requests(reader.wait, unit, now);
        }
    }

    /// Simulate one cycle of the level `unit`. Returns whether it acted.
    pub fn tick(
        &mut self,
        unit: Unit,
        now: Time,
        (dram, waits): (&mut Dram, &mut Waits),
        meter: &mut Meter,
        recorder: &mut Recorder,
        clocks: &Clocks,
    ) -> bool {
        let Some(above) = self.0.iter().position(|level| level.unit == unit) else { return false };
        let (mut taken, mut acted, mut blocked) = (0, false, None);
        while let Some(passing) = self.0[above].queue.head(now) {
            let lines = self.0[above].accept(&passing.access, &mut taken, now);
            acted |= lines.accepted > 0;
            if !lines.is_all {
                break;
            }
            blocked = self.full_below(above + 1, &passing.access, dram, now);
            if blocked.is_some() {
                break;
            }
            acted = true;
            let level = &mut self.0[above];
            level.queue.pop(now);
            level.accepted = 0;
            for (event, count) in passing.access.levels[level.at].events(unit).filter(|(_, count)| *count > 0)
            {
                recorder.event(event, count.into(), clocks.ps(now));
            }
            self.pass(above, passing, now, dram, waits);
        }
        let reason = blocked.map_or(Reason::Idle, Reason::Blocked);
        meter.set(unit, now, taken, reason, recorder);
        acted
    }

    /// Answer a request, or send it on.
    fn pass(&mut self, above: usize, mut passing: Passing, now: Time, dram: &mut Dram, waits: &mut Waits) {
        let (period, latency) = (self.0[above].period, self.0[above].latency);
        let is_read_below = passing.access.fetched().is_some()
            || self.0[above + 1..].iter().any(|level| passing.access.levels[level.at].reads > 0);
        passing.reader =
            passing.reader.map(|Reader { wait, latency: rest }| Reader { wait, latency: latency + rest });
        if !is_read_below && let Some(Reader { wait, latency }) = passing.reader.take() {
            waits.arrives(wait, now + latency);
        }
        self.push_below(above + 1, passing, [now, now + period], dram, waits);
    }

    /// Earliest time of possible work if no other unit acts.
    pub fn wakes_at(&self, now: Time) -> Option<Time> {
        self.0.iter().filter_map(|level| level.queue.head_at()).filter(|&at| at > now).min()
    }

    pub fn is_empty(&self) -> bool {
        self.0.iter().all(|level| level.queue.is_empty())
    }

    /// End of the last request so far.
    pub fn ends_at(&self) -> Time {
        self.0.iter().map(|level| level.ends_at).max().unwrap_or(0)
    }
}

/// Lines of a request accepted in a cycle, and whether these are the last.
struct Accepted {
    accepted: u32,
    is_all: bool,
}

impl CacheLevel {
    /// Accept as many lines of a request as the cycle allows; `taken` is the number accepted in the cycle.
    fn accept(&mut self, access: &LineAccess, taken: &mut u32, now: Time) -> Accepted {
        let missing = access.levels[self.at].lines() - self.accepted;
        let accepted = missing.min(self.lines_per_cycle - *taken);
        *taken += accepted;
        self.accepted += accepted;
        if accepted > 0 {
            self.ends_at = now + self.period;
        }
        Accepted { accepted, is_all: accepted == missing }
    }
}

/// Whether a request needs the level at an index of [`LEVELS`] or what is below it. It passes all levels above those
/// that it needs, so that each queue is filled from one place.
fn needs(access: &LineAccess, at: usize) -> bool {
    let is_here = |requests: &activity::LevelRequests| requests.lines() > 0 || requests.writebacks > 0;
    access.levels[at..].iter().any(is_here) || access.moved().next().is_some()
}

/// Stands for no wait.
pub(super) const NO_WAIT: u32 = u32::MAX;

/// A line request, and the wait that its answer belongs to; writes have none, except at a barrier.
#[derive(Clone, Copy, Debug)]
pub(super) struct Request {
    pub access: LineAccess,
    pub wait: u32,
}

/// The L2, with a port for each client. Hits and misses are given; the L2 adds their time.
#[derive(Clone, Debug)]
pub(super) struct L2 {
    pub ports: [Queue<Request>; CLIENTS.len()],
    lines_per_cycle: u32,
    period: Time,
    latency: Time,
    /// First port in round-robin order.
    next_port: usize,
    ends_at: Time,
}

impl L2 {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = &machine.l2;
        let period = clocks.period(spec.clock);
        Self {
            ports: std::array::from_fn(|_| Queue::new(spec.queue.get())),
            lines_per_cycle: spec.lines_per_cycle.get(),
            period,
            latency: period * Time::from(spec.latency_cycles),
            next_port: 0,
            ends_at: 0,
        }
    }

    pub fn period(&self) -> Time {
        self.period
    }

    /// Accept as many requests as possible, round robin over the ports. Returns whether any was accepted.
    pub fn tick(
        &mut self,
        now: Time,
        (levels, dram): (&mut Levels, &mut Dram),
        waits: &mut Waits,
        meter: &mut Meter,
        recorder: &mut Recorder,
        clocks: &Clocks,
    ) -> bool {
        let mut taken = 0;
        let mut blocked = None;
        while taken < self.lines_per_cycle {
            let order = (0..CLIENTS.len()).map(|step| (self.next_port + step) % CLIENTS.len());
            let mut found = None;
            for port in order {
                let Some(request) = self.ports[port].head(now) else { continue };
                let below = levels.full_below(0, &request.access, dram, now);
                if below.is_none() {
                    found = Some((port, request));
                    break;
                }
                blocked = blocked.or(below);
            }
            let Some((port, request)) = found else { break };
            self.ports[port].pop(now);
            self.next_port = (port + 1) % CLIENTS.len();
            self.take(request, now, levels, dram, waits);
            count(&request.access, clocks.ps(now), recorder);
            taken += 1;
            self.ends_at = now + self.period;
        }
        let reason = blocked.map_or(Reason::Idle, Reason::Blocked);
        meter.set(Unit::L2, now, taken, reason, recorder);
        taken > 0
    }

    fn take(
        &mut self,
        Request { access, wait }: Request,
        now: Time,
        levels: &mut Levels,
        dram: &mut Dram,
        waits: &mut Waits,
    ) {
        let is_below = matches!(access.kind, LineKind::Below | LineKind::Fetch);
        let reader = is_below.then_some(Reader { wait, latency: self.latency });
        levels.push_below(0, Passing { access, reader }, [now, now + self.period], dram, waits);
        if !is_below && wait != NO_WAIT {
            waits.arrives(wait, now + self.latency);
        }
    }

    /// Earliest time of possible work if no other unit acts.
    pub fn wakes_at(&self, now: Time) -> Option<Time> {
        self.ports.iter().filter_map(Queue::head_at).filter(|&at| at > now).min()
    }

    /// End of the last request so far.
    pub fn ends_at(&self) -> Time {
        self.ends_at
    }

    pub fn is_empty(&self) -> bool {
        self.ports.iter().all(Queue::is_empty)
    }
}

/// Record the L2 events of an accepted line; memory records its own.
fn count(access: &LineAccess, at_ps: u64, recorder: &mut Recorder) {
    for (event, times) in l2_events(access) {
        if times > 0 {
            recorder.event(event, times, at_ps);
        }
    }
}

/// L2 events of a line.
fn l2_events(access: &LineAccess) -> [(Event, u64); 3] {
    let writes = matches!(access.kind, LineKind::Write | LineKind::Allocate);
    let misses = matches!(access.kind, LineKind::Below | LineKind::Fetch | LineKind::Allocate);
    [(Event::L2Reads, access.is_read()), (Event::L2Writes, writes), (Event::L2Misses, misses)]
        .map(|(event, yes)| (event, u64::from(yes)))
}
