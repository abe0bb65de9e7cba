//! Path to memory and back: requests in front of the L2, the L2, and readers waiting for lines.

use activity::{Event, LineAccess, LineKind, Unit};

use super::dram::{Dram, Reader};
use super::meter::Meter;
use super::queue::Queue;
use super::waits::Waits;
use crate::Recorder;
use crate::clock::{Clocks, Time};
use crate::demand::CLIENTS;
use crate::spec::MachineSpec;
use crate::stalls::Reason;

/// Stands for no wait.
pub(super) const NO_WAIT: u32 = u32::MAX;

/// A line request, with the wait it belongs to.
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
        dram: &mut Dram,
        waits: &mut Waits,
        meter: &mut Meter,
        recorder: &mut Recorder,
        clocks: &Clocks,
    ) -> bool {
        let mut taken = 0;
        let mut blocked = false;
        while taken < self.lines_per_cycle {
            let order = (0..CLIENTS.len()).map(|step| (self.next_port + step) % CLIENTS.len());
            let mut found = None;
            for port in order {
                let Some(request) = self.ports[port].head(now) else { continue };
                if dram.has_room(&request.access, now) {
                    found = Some((port, request));
                    break;
                }
                blocked = true;
            }
            let Some((port, request)) = found else { break };
            self.ports[port].pop(now);
            self.next_port = (port + 1) % CLIENTS.len();
            self.take(request, now, dram, waits);
            count(&request.access, clocks.ps(now), recorder);
            taken += 1;
            self.ends_at = now + self.period;
        }
        let reason = if blocked { Reason::Blocked(Unit::Dram) } else { Reason::Idle };
        meter.set(Unit::L2, now, taken, reason, recorder);
        taken > 0
    }

    fn take(&mut self, Request { access, wait }: Request, now: Time, dram: &mut Dram, waits: &mut Waits) {
        let seen_at = now + self.period;
        if access.victim != LineAccess::NONE {
            dram.push(access.victim, None, seen_at);
        }
        match access.kind {
            LineKind::Hit => waits.arrives(wait, now + self.latency),
            LineKind::Fetch => {
                waits.fetches(wait, now);
                dram.push(access.line, Some(Reader { wait, latency: self.latency }), seen_at);
            }
            LineKind::Drain => dram.push(access.line, None, seen_at),
            LineKind::Write | LineKind::Allocate => {}
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
    let reads = matches!(access.kind, LineKind::Hit | LineKind::Fetch);
    let writes = matches!(access.kind, LineKind::Write | LineKind::Allocate);
    let misses = matches!(access.kind, LineKind::Fetch | LineKind::Allocate);
    [(Event::L2Reads, reads), (Event::L2Writes, writes), (Event::L2Misses, misses)]
        .map(|(event, yes)| (event, u64::from(yes)))
}
