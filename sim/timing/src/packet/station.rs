//! State of a unit at its station, at the level `packet`.

use super::Visit;
use super::calendar::QueueTimes;
use super::memory::{Fetched, Memory};
use crate::clock::{Clocks, Time, aligned};
use crate::demand::{CYCLE, Server, Station, Work, port, request_work};
use crate::spec::MachineSpec;

/// State of a unit at a station.
#[derive(Clone, Debug)]
pub(super) struct StationState {
    pub latency: Time,
    /// The input queue, by the times at which its packets began service.
    pub queue: QueueTimes,
    period: Time,
    /// When it can serve the next packet, and how far it has served.
    free: Time,
    server: Server,
    departed: Time,
    port: Option<usize>,
    client: ClientWork,
    /// Packets that wait for their lines after service.
    behind: Option<QueueTimes>,
}

/// Service of a packet by a unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Service {
    /// The cycles in which it begins and ends.
    pub from: Time,
    pub to: Time,
    /// The part of the first cycle that other packets used, and that of the last one up to its end.
    pub used: [Work; 2],
    pub work: Work,
    pub period: Time,
}

impl Service {
    /// Let `server` do `work` from the cycle at `from` on.
    pub fn of(server: &mut Server, from: Time, period: Time, work: Work) -> Self {
        let before = server.used_at(from);
        let to = server.serve(from, period, work);
        Self { from, to, used: [before, server.used_at(to)], work, period }
    }
}

/// Busy time of a client of the L2: for its events, and until it has made its requests.
#[derive(Clone, Debug)]
pub(super) struct ClientWork {
    lines_per_cycle: u32,
    /// The cycle in which its work so far ends, and the used part of that.
    end: (Time, Work),
}

impl ClientWork {
    /// A client with so many requests in a cycle.
    pub fn new(lines_per_cycle: u32) -> Self {
        Self { lines_per_cycle, end: (0, 0) }
    }

    /// A service with its `lines` requests, the last of them at `last`. Time that earlier work took does not count again.
    pub fn with_requests(&mut self, service: Service, lines: u32, last: Time) -> Service {
        let Service { from, to, used, work, period } = service;
        let last = aligned(last, period);
        let (begin, requests) = (self.end.max((from, used[0])), request_work(lines, self.lines_per_cycle));
        let end = if requests > work && last >= to { (last, CYCLE) } else { (to, used[1]) };
        self.end = end.max(begin);
        if requests <= work && begin.0 == from && begin.1 == used[0] {
            return service;
        }
        let left = (self.end.0 - begin.0) / period * CYCLE + self.end.1 - begin.1;
        Service {
            from: begin.0,
            to: self.end.0,
            used: [begin.1, self.end.1],
            work: work.max(requests).min(left),
            period,
        }
    }
}

/// Times of a packet at a unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Served {
    pub service: Service,
    pub leave: Time,
    pub fetched: Option<Fetched>,
}

impl StationState {
    pub fn new(station: Station, machine: &MachineSpec, clocks: &Clocks) -> Self {
        let common = machine.common(station.unit());
        let period = clocks.period(common.clock);
        let port = port(station.unit());
        Self {
            latency: period * Time::from(common.latency_cycles),
            queue: QueueTimes::new(common.queue),
            period,
            free: 0,
            server: Server::default(),
            departed: 0,
            port,
            client: ClientWork::new(common.lines_per_cycle),
            behind: (common.in_flight > 0).then(|| QueueTimes::new(common.in_flight)),
        }
    }

    /// When it can serve another packet.
    pub fn free(&self) -> Time {
        self.free
    }

    /// When it starts with the next packet, if that arrives at `arrive`.
    pub fn starts(&self, arrive: Time) -> Time {
        self.edge(arrive).max(self.free)
    }

    /// First edge of its clock at or after `at`.
    pub fn edge(&self, at: Time) -> Time {
        aligned(at, self.period)
    }

    /// Grains per cycle.
    pub fn period(&self) -> Time {
        self.period
    }

    /// The later of `edge`, an edge of its clock, and the first edge at or after `at`.
    fn later(&self, edge: Time, at: Time) -> Time {
        if at <= edge { edge } else { aligned(at, self.period) }
    }

    /// Serve a packet.
    pub fn serve(&mut self, visit: &Visit<'_>, memory: &mut Memory) -> Served {
        let start = visit.arrive.max(self.free);
        let work = visit.demand.service[visit.station as usize];
        let service = Service::of(&mut self.server, start, self.period, work);
        let busy_to = service.to;
        let fetched = visit.fetched.or_else(|| self.fetch(visit, start, memory));
        let last_request =
            fetched.as_ref().map_or(busy_to, |fetched| self.later(busy_to, fetched.last_request));
        let answered = |fetched: &Fetched| match visit.demand.barrier {
            None => fetched.arrived,
            Some(_) => fetched.arrived.max(memory.acknowledges(fetched.last)),
        };
        let waits = fetched.as_ref().map_or(0, answered).max(visit.room);
        let leave = match &self.behind {
            None => {
                self.free = self.later(last_request, waits);
                self.free
            }
            Some(behind) => {
                self.free = last_request.max(behind.room_at());
                self.later(self.free.max(self.departed), waits)
            }
        };
        if let Some(behind) = &mut self.behind {
            behind.note(leave);
        }
        self.departed = leave;
        self.queue.note(start + 1);
        let lines = self.port.map(|port| visit.demand.lines[port]);
        let service = lines.map_or(service, |lines| self.client.with_requests(service, lines, last_request));
        Served { service, leave, fetched }
    }

    fn fetch(&mut self, visit: &Visit<'_>, start: Time, memory: &mut Memory) -> Option<Fetched> {
        let port = self.port?;
        if visit.demand.lines[port] == 0 {
            return None;
        }
        let range = visit.demand.lines_of(port);
        let first = visit.demand.first_line;
        let lines = &visit.lines[range.start - first..range.end - first];
        Some(memory.request(port, lines, visit.turn, start))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_client_works_until_it_has_made_its_requests_and_never_twice_at_once() {
        let (mut server, mut client) = (Server::default(), ClientWork::new(2));
        let mut busy = |start, work, lines, last| {
            let Service { from, to, used, work, .. } =
                client.with_requests(Service::of(&mut server, start, 10, work), lines, last);
            (from, to, used, work)
        };
        // A cycle and a half of work; three lines take as long.
        assert_eq!(busy(0, 3 * CYCLE / 2, 3, 10), (0, 10, [0, CYCLE / 2], 3 * CYCLE / 2));
        // Eight lines take four cycles, though the last waits in between.
        assert_eq!(busy(20, CYCLE, 8, 70), (20, 70, [0, CYCLE], 4 * CYCLE));
        // Begins in the cycle of the last request, all of which is taken; requests at times of another clock end a cycle.
        assert_eq!(busy(70, CYCLE / 2, 6, 93), (70, 100, [CYCLE, CYCLE], 3 * CYCLE));
        assert_eq!(busy(100, CYCLE / 4, 0, 100), (100, 100, [CYCLE, CYCLE], 0));
        assert_eq!(busy(110, CYCLE, 0, 110), (110, 120, [0, 0], CYCLE));
    }
}
