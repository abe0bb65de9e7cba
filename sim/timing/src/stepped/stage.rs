//! A unit that serves packets one after another and, as a client of the L2, requests their lines meanwhile.

use std::collections::VecDeque;
use std::ops::Range;

use activity::{LineAccess, Unit};

use super::levels::{NO_WAIT, Request};
use super::queue::{Queue, Waits};
use crate::clock::Time;
use crate::demand::{CYCLE, Server, Work};
use crate::recorder::Reason;

/// Interface of a stage to its surroundings.
pub(super) trait StageEnv {
    /// Work of `id`, and its lines.
    fn work(&self, id: u32) -> (Work, Range<usize>);
    /// Line number `at`.
    fn line(&self, at: usize) -> LineAccess;
    /// Whether `id` is a barrier, which waits until the L2 has acknowledged each of its lines.
    fn is_barrier(&self, id: u32) -> bool;
    /// Record that `id` was served from `from` to `to`.
    fn served(&mut self, id: u32, from: Time, to: Time);
    /// Pass `id` on at `now`. The error is the unit that has no room.
    fn leave(&mut self, id: u32, now: Time) -> Result<(), Unit>;
}

/// Result of a cycle: whether the stage acted, and its state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ticked {
    pub acted: bool,
    /// The part of the cycle for which it works.
    pub busy: Work,
    pub reason: Reason,
}

#[derive(Clone, Debug)]
struct Serving {
    id: u32,
    from: Time,
    /// Cycle in which the service ends, apart from requests.
    done_at: Time,
    /// Lines not yet requested.
    lines: Range<usize>,
    wait: u32,
    barrier: bool,
}

/// State of a stage.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    period: Time,
    /// Items that may wait for their lines.
    in_flight: usize,
    serving: Option<Serving>,
    server: Server,
    waiting: VecDeque<(u32, u32)>,
    /// Lines it can request per cycle, and the last cycle with requests and their number.
    lines_per_cycle: u32,
    last_requests: (Time, u32),
}

impl Stage {
    /// A stage; it requests no lines if `lines_per_cycle` is 0.
    pub fn new(period: Time, in_flight: u32, lines_per_cycle: u32) -> Self {
        Self {
            period,
            in_flight: in_flight as usize,
            serving: None,
            server: Server::default(),
            waiting: VecDeque::new(),
            lines_per_cycle,
            last_requests: (0, 0),
        }
    }

    pub fn period(&self) -> Time {
        self.period
    }

    /// Simulate a cycle: request lines, finish, release and begin, until nothing more is possible.
    pub fn tick(
        &mut self,
        now: Time,
        input: &mut Queue<u32>,
        port: Option<&mut Queue<Request>>,
        waits: &mut Waits,
        env: &mut impl StageEnv,
    ) -> Ticked {
        let (mut acted, mut blocked) = (false, None);
        let mut port = port;
        loop {
            let requested = port.as_deref_mut().is_some_and(|port| self.request(now, port, env));
            let finished = self.finish(now, waits, env, &mut blocked);
            let released = self.release(now, waits, env, &mut blocked);
            let begun = self.begin(now, input, waits, env);
            if !(requested || finished || released || begun) {
                break;
            }
            acted = true;
        }
        let works_on = self.serving.as_ref().is_some_and(|serving| now < serving.done_at);
        let has_requests = self.serving.as_ref().is_some_and(|serving| !serving.lines.is_empty());
        // Requesting lines at the full rate is work; a full port is a stall.
        let reason = match (&self.serving, blocked) {
            (Some(_), _) if has_requests => Reason::Blocked(Unit::L2),
            (Some(_), Some(by)) => Reason::Blocked(by),
            _ => Reason::Idle,
        };
        Ticked {
            acted,
            busy: if works_on { CYCLE } else { self.server.used_at(now).max(self.requests_at(now)) },
            reason,
        }
    }

    /// Whether it serves no packet. The caller then knows why.
    pub fn is_free(&self) -> bool {
        self.serving.is_none()
    }

    /// Lines requested in the cycle that begins at `now`.
    fn requested_at(&self, now: Time) -> u32 {
        if self.last_requests.0 == now { self.last_requests.1 } else { 0 }
    }

    /// The part of the cycle at `now` that its requests take at their rate.
    fn requests_at(&self, now: Time) -> Work {
        CYCLE * Work::from(self.requested_at(now)) / Work::from(self.lines_per_cycle.max(1))
    }

    /// Request one line.
    fn request(&mut self, now: Time, port: &mut Queue<Request>, env: &impl StageEnv) -> bool {
        let requested = self.requested_at(now);
        let Some(serving) = &mut self.serving else { return false };
        if serving.lines.is_empty() || requested == self.lines_per_cycle || port.room(now) == 0 {
            return false;
        }
        let Some(at) = serving.lines.next() else { return false };
        let access = env.line(at);
        let wait = if serving.barrier || access.is_read() { serving.wait } else { NO_WAIT };
        port.push(Request { access, wait }, now + self.period);
        self.last_requests = (now, requested + 1);
        true
    }

    fn finish(
        &mut self,
        now: Time,
        waits: &Waits,
        env: &mut impl StageEnv,
        blocked: &mut Option<Unit>,
    ) -> bool {
        let Some(serving) = &self.serving else { return false };
        if now < serving.done_at || !serving.lines.is_empty() {
            return false;
        }
        let (id, from, done_at, wait) = (serving.id, serving.from, serving.done_at, serving.wait);
        if self.in_flight == 0 {
            match env.leave(id, now) {
                Ok(()) => {}
                Err(by) => {
                    *blocked = Some(by);
                    return false;
                }
            }
        } else if self.waiting.len() < self.in_flight {
            self.waiting.push_back((id, wait));
        } else {
            let head = self
                .waiting
                .front()
                .filter(|(_, wait)| *wait != NO_WAIT && waits.ready_at(*wait).is_none_or(|at| at > now));
            *blocked = head.map(|(_, wait)| waits.waits_for_unit(*wait, now)).or(*blocked);
            return false;
        }
        env.served(id, from, done_at);
        self.serving = None;
        true
    }

    /// Release waiting items whose lines have arrived, in order.
    fn release(
        &mut self,
        now: Time,
        waits: &mut Waits,
        env: &mut impl StageEnv,
        blocked: &mut Option<Unit>,
    ) -> bool {
        let Some(&(id, wait)) = self.waiting.front() else { return false };
        if wait != NO_WAIT && waits.ready_at(wait).is_none_or(|at| at > now) {
            return false;
        }
        if let Err(by) = env.leave(id, now) {
            *blocked = Some(by);
            return false;
        }
        if wait != NO_WAIT {
            waits.close(wait);
        }
        self.waiting.pop_front();
        true
    }

    fn begin(&mut self, now: Time, input: &mut Queue<u32>, waits: &mut Waits, env: &impl StageEnv) -> bool {
        if self.serving.is_some() {
            return false;
        }
        let Some(id) = input.head(now) else { return false };
        input.pop(now);
        let (work, lines) = env.work(id);
        let barrier = env.is_barrier(id);
        let answered = lines.clone().filter(|&at| barrier || env.line(at).is_read()).count() as u32;
        let wait = if answered > 0 { waits.open(answered) } else { NO_WAIT };
        let done_at = self.server.serve(now, self.period, work);
        self.serving = Some(Serving { id, from: now, done_at, lines, wait, barrier });
        true
    }

    /// Earliest time of possible work if no other unit acts.
    pub fn wakes_at(&self, now: Time, input: &Queue<u32>, waits: &Waits) -> Option<Time> {
        let serving = self.serving.as_ref().map(|serving| serving.done_at);
        let waiting = self
            .waiting
            .front()
            .filter(|(_, wait)| *wait != NO_WAIT)
            .and_then(|(_, wait)| waits.ready_at(*wait));
        [serving, self.server.used_until(self.period), waiting, input.head_at()]
            .into_iter()
            .flatten()
            .filter(|&at| at > now)
            .min()
    }
}
