//! L2 and memory at the level `packet`: calendars that lines are entered into.

use activity::{LineAccess, LineKind};

use super::calendar::Calendar;
use crate::address::Map;
use crate::clock::{Clocks, Time};
use crate::job::CLIENTS;
use crate::spec::{DramSpec, MachineSpec};

/// Cycles in a stretch of a calendar.
const STRETCH: u32 = 32;

/// A ring of the last moments at which something was taken from a queue.
#[derive(Clone, Debug)]
struct Ring {
    moments: Vec<Time>,
    at: usize,
}

impl Ring {
    fn new(capacity: u32) -> Self {
        Self { moments: vec![0; capacity as usize], at: 0 }
    }

    /// When the queue had room for one more.
    fn room_at(&self) -> Time {
        self.moments[self.at]
    }

    fn note(&mut self, moment: Time) {
        self.moments[self.at] = moment;
        self.at = (self.at + 1) % self.moments.len();
    }
}

#[derive(Clone, Debug)]
struct Bank {
    open: u32,
    time: Calendar,
}

#[derive(Clone, Debug)]
struct Channel {
    bus: Calendar,
    banks: Vec<Bank>,
}

/// When some lines were asked for, taken and there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fetched {
    /// When the last was asked for.
    pub asked: Time,
    /// When the first was taken by the L2.
    pub first: Time,
    /// When the last that is read is there; 0 where none is.
    pub there: Time,
    /// When everything has been moved.
    pub moved: Time,
}

/// The L2 with its ports, and memory behind it.
#[derive(Clone, Debug)]
pub(super) struct Memory {
    map: Map,
    channels: Vec<Channel>,
    l2: Calendar,
    ports: [Ring; CLIENTS.len()],
    l2_period: Time,
    l2_latency: Time,
    period: Time,
    spec: DramSpec,
    end: Time,
}

impl Memory {
    pub fn new(machine: &MachineSpec, clocks: &Clocks) -> Self {
        let spec = machine.dram.clone();
        let (period, l2_period) = (clocks.period(spec.clock), clocks.period(machine.l2.clock));
        let stretch = STRETCH * spec.burst_cycles;
        let bank = Bank { open: u32::MAX, time: Calendar::new(stretch, period, 1) };
        let channel =
            Channel { bus: Calendar::new(stretch, period, 1), banks: vec![bank; spec.banks as usize] };
        Self {
            map: Map::new(&spec),
            channels: vec![channel; spec.channels as usize],
            l2: Calendar::new(STRETCH, l2_period, machine.l2.lines_per_cycle),
            ports: std::array::from_fn(|_| Ring::new(machine.l2.queue)),
            l2_period,
            l2_latency: l2_period * Time::from(machine.l2.latency_cycles),
            period,
            spec,
            end: 0,
        }
    }

    /// A client asks for `lines` one after another, every `step`, from `start` on.
    pub fn ask(&mut self, port: usize, lines: &[LineAccess], start: Time, step: Time) -> Fetched {
        let mut fetched = Fetched { asked: start, first: Time::MAX, there: 0, moved: 0 };
        let mut at = start;
        for access in lines {
            // The port has room a cycle after the L2 took the request so many before.
            at = at.max(self.ports[port].room_at());
            fetched.asked = at;
            let taken = self.take(access, at + step, &mut fetched);
            self.ports[port].note(taken + self.l2_period);
            fetched.first = fetched.first.min(taken);
            at += step;
        }
        fetched
    }

    /// One line through the L2, from `seen` on. Says when it was taken.
    fn take(&mut self, access: &LineAccess, seen: Time, fetched: &mut Fetched) -> Time {
        let fetch = matches!(access.kind, LineKind::Fetch | LineKind::Drain);
        let moved =
            [fetch.then_some(access.line), (access.victim != LineAccess::NONE).then_some(access.victim)];
        let mut taken = self.l2.take(seen, 1).0;
        let backlog = self.period * Time::from(self.spec.queue * self.spec.burst_cycles);
        if access.kind == LineKind::Hit {
            fetched.there = fetched.there.max(taken + self.l2_latency);
        }
        for (line, read) in moved.into_iter().zip([access.kind == LineKind::Fetch, false]) {
            let Some(line) = line else { continue };
            let (issued, data) = self.transfer(line, taken + self.l2_period);
            // The queue of the channel holds no more than this: the request waits in front of the L2 for the rest.
            taken = taken.max(issued.saturating_sub(backlog));
            fetched.moved = fetched.moved.max(data);
            if read {
                let back = self.period * Time::from(self.spec.latency_cycles) + self.l2_latency;
                fetched.there = fetched.there.max(data + back);
            }
        }
        fetched.moved = fetched.moved.max(taken + self.l2_period);
        self.end = self.end.max(taken + self.l2_period);
        taken
    }

    /// A line over the bus of its channel, from `seen` on. Says when it is issued and when its last data have passed.
    fn transfer(&mut self, line: u32, seen: Time) -> (Time, Time) {
        let place = self.map.place(line);
        let cycles = |count: u32| self.period * Time::from(count);
        let DramSpec { burst_cycles, cas_cycles, activate_cycles, precharge_cycles, .. } = self.spec;
        let channel = &mut self.channels[place.channel];
        let bank = &mut channel.banks[place.bank];
        let opens = match bank.open {
            open if open == place.row => 0,
            u32::MAX => activate_cycles,
            _ => activate_cycles + precharge_cycles,
        };
        bank.open = place.row;
        let seen = if opens > 0 { bank.time.take(seen, u64::from(opens)).0 } else { seen };
        let (issued, _) = channel.bus.take(seen + cycles(opens), u64::from(burst_cycles));
        let bus_free = issued + cycles(burst_cycles);
        self.end = self.end.max(bus_free);
        (issued, bus_free + cycles(cas_cycles))
    }

    /// When the last line is taken and the last transfer over.
    pub fn ends_at(&self) -> Time {
        self.end
    }

    /// Stretches of the L2's time.
    pub fn l2(&self) -> &Calendar {
        &self.l2
    }

    /// The buses of all channels.
    pub fn buses(&self) -> impl Iterator<Item = &Calendar> {
        self.channels.iter().map(|channel| &channel.bus)
    }
}
