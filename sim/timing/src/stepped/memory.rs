//! The L2 cycle by cycle: requests in front of it, and what it sends on to the levels below.

use activity::{Event, LineAccess, LineKind, Unit};

use super::dram::{Dram, Reader};
use super::levels::{Levels, Passing};
use super::meter::Meter;
use super::queue::{Queue, Waits};
use crate::Recorder;
use crate::clock::{Clocks, Time};
use crate::demand::CLIENTS;
use crate::spec::MachineSpec;
use crate::stalls::Reason;

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
