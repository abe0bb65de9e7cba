//! A unit that serves one packet after another and, where it is a client of the L2, asks for its lines meanwhile.

use std::collections::VecDeque;
use std::ops::Range;

use activity::{LineAccess, LineKind, Unit};

use super::memory::{NOBODY, Request};
use super::meter::Rest;
use super::queue::Queue;
use super::waits::Waits;
use crate::clock::Time;

/// What surrounds a stage: what its items are and where they go.
pub(super) trait Around {
    /// Cycles that `id` takes, and its lines.
    fn work(&self, id: u32) -> (u32, Range<usize>);
    /// A line.
    fn line(&self, at: usize) -> LineAccess;
    /// `id` was served from `from` to `to`.
    fn served(&mut self, id: u32, from: Time, to: Time);
    /// Hands `id` on at `now`, or says who does not take it.
    fn leave(&mut self, id: u32, now: Time) -> Result<(), Unit>;
}

/// Whether a stage did anything in a cycle, and its state after.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ticked {
    pub acted: bool,
    pub busy: bool,
    pub rest: Rest,
}

#[derive(Clone, Debug)]
struct Serving {
    id: u32,
    from: Time,
    /// When its work is done, but for requests.
    done_at: Time,
    /// Lines it has not asked for.
    lines: Range<usize>,
    wait: u32,
}

/// The state of a stage.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    period: Time,
    /// Items that may wait for their lines.
    in_flight: usize,
    serving: Option<Serving>,
    waiting: VecDeque<(u32, u32)>,
    /// Lines that it can ask for in a cycle, and when it last asked, for how many.
    lines_per_cycle: u32,
    asked: (Time, u32),
}

impl Stage {
    /// A stage that asks for lines only where `lines_per_cycle` is not 0.
    pub fn new(period: Time, in_flight: u32, lines_per_cycle: u32) -> Self {
        Self {
            period,
            in_flight: in_flight as usize,
            serving: None,
            waiting: VecDeque::new(),
            lines_per_cycle,
            asked: (0, 0),
        }
    }

    pub fn period(&self) -> Time {
        self.period
    }

    /// One cycle: ask for lines, finish, let go, begin, until nothing more can be done.
    pub fn tick(
        &mut self,
        now: Time,
        input: &mut Queue<u32>,
        port: Option<&mut Queue<Request>>,
        waits: &mut Waits,
        around: &mut impl Around,
    ) -> Ticked {
        let (mut acted, mut blocked) = (false, None);
        let mut port = port;
        loop {
            let asked = port.as_deref_mut().is_some_and(|port| self.ask(now, port, around));
            let finished = self.finish(now, waits, around, &mut blocked);
            let released = self.release(now, waits, around, &mut blocked);
            let begun = self.begin(now, input, waits, around);
            if !(asked || finished || released || begun) {
                break;
            }
            acted = true;
        }
        let busy = self.serving.as_ref().is_some_and(|serving| now < serving.done_at);
        let asks = self.serving.as_ref().is_some_and(|serving| !serving.lines.is_empty());
        // So many lines a cycle are its pace: asking for any is work, a port without room is not.
        let rest = match (&self.serving, blocked) {
            (Some(_), _) if asks => Rest::Blocked(Unit::L2),
            (Some(_), Some(by)) => Rest::Blocked(by),
            _ => Rest::Idle,
        };
        Ticked { acted, busy: busy || (asks && self.asked_at(now) > 0), rest }
    }

    /// Whether it serves nothing, so that it is for others to say why.
    pub fn is_free(&self) -> bool {
        self.serving.is_none()
    }

    /// Lines it has asked for in the cycle that begins at `now`.
    fn asked_at(&self, now: Time) -> u32 {
        if self.asked.0 == now { self.asked.1 } else { 0 }
    }

    /// One of the lines of a cycle.
    fn ask(&mut self, now: Time, port: &mut Queue<Request>, around: &impl Around) -> bool {
        let asked = self.asked_at(now);
        let Some(serving) = &mut self.serving else { return false };
        if serving.lines.is_empty() || asked == self.lines_per_cycle || port.room(now) == 0 {
            return false;
        }
        let Some(at) = serving.lines.next() else { return false };
        port.push(Request { access: around.line(at), wait: serving.wait }, now + self.period);
        self.asked = (now, asked + 1);
        true
    }

    fn finish(
        &mut self,
        now: Time,
        waits: &Waits,
        around: &mut impl Around,
        blocked: &mut Option<Unit>,
    ) -> bool {
        let Some(serving) = &self.serving else { return false };
        if now < serving.done_at || !serving.lines.is_empty() {
            return false;
        }
        let (id, from, done_at, wait) = (serving.id, serving.from, serving.done_at, serving.wait);
        if self.in_flight == 0 {
            match around.leave(id, now) {
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
                .filter(|(_, wait)| *wait != NOBODY && waits.ready_at(*wait).is_none_or(|at| at > now));
            *blocked = head.map(|(_, wait)| waits.blame(*wait, now)).or(*blocked);
            return false;
        }
        around.served(id, from, done_at);
        self.serving = None;
        true
    }

    /// Those whose lines are there go on, in order.
    fn release(
        &mut self,
        now: Time,
        waits: &mut Waits,
        around: &mut impl Around,
        blocked: &mut Option<Unit>,
    ) -> bool {
        let Some(&(id, wait)) = self.waiting.front() else { return false };
        if wait != NOBODY && waits.ready_at(wait).is_none_or(|at| at > now) {
            return false;
        }
        if let Err(by) = around.leave(id, now) {
            *blocked = Some(by);
            return false;
        }
        if wait != NOBODY {
            waits.close(wait);
        }
        self.waiting.pop_front();
        true
    }

    fn begin(&mut self, now: Time, input: &mut Queue<u32>, waits: &mut Waits, around: &impl Around) -> bool {
        if self.serving.is_some() {
            return false;
        }
        let Some(id) = input.head(now) else { return false };
        input.pop(now);
        let (cycles, lines) = around.work(id);
        let read = |kind| matches!(kind, LineKind::Hit | LineKind::Fetch);
        let reads = lines.clone().filter(|&at| read(around.line(at).kind)).count() as u32;
        let wait = if reads > 0 { waits.open(reads) } else { NOBODY };
        let done_at = now + self.period * Time::from(cycles);
        self.serving = Some(Serving { id, from: now, done_at, lines, wait });
        true
    }

    /// When it may have something to do next, if nobody else does anything.
    pub fn wakes_at(&self, now: Time, input: &Queue<u32>, waits: &Waits) -> Option<Time> {
        let serving = self.serving.as_ref().map(|serving| serving.done_at);
        let waiting = self
            .waiting
            .front()
            .filter(|(_, wait)| *wait != NOBODY)
            .and_then(|(_, wait)| waits.ready_at(*wait));
        [serving, waiting, input.head_at()].into_iter().flatten().filter(|&at| at > now).min()
    }
}
