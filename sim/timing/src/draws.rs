//! Time of the draws and of the passes of a frame: when each pass began and ended, and how long its work
//! takes every unit.
//!
//! Packets count in the order of the stream, as instructions do that commit in order (Gottschall, Eeckhout
//! and Jahre 2021, time-proportional instruction profiling): each takes the time from the latest end before
//! it to its own end. So a draw gets the time by which it delays the frame, and the times of all draws add up
//! to it. Work of the front end takes time only where no tile leaves after it that does not wait for it.

use std::collections::VecDeque;

use activity::{Packet, Unit};

use crate::clock::{Clocks, Time};
use crate::demand::{ServiceDemand, UnitSpeeds, UnitWork};
use crate::spec::MachineSpec;

/// Something of each draw of a pass, and of all that is of no single draw.
#[derive(Clone, Debug, Default)]
pub(crate) struct ByDraw<T> {
    draws: Vec<T>,
    others: T,
}

impl<T: Clone + Default> ByDraw<T> {
    /// The thing of draw number `draw` of pass number `pass`.
    pub fn of(passes: &mut Vec<Self>, pass: u32, draw: u32) -> &mut T {
        let (pass, at) = (pass as usize, draw as usize);
        if passes.len() <= pass {
            passes.resize(pass + 1, Self::default());
        }
        let pass = &mut passes[pass];
        if draw == Packet::NONE {
            return &mut pass.others;
        }
        if pass.draws.len() <= at {
            pass.draws.resize(at + 1, T::default());
        }
        &mut pass.draws[at]
    }

    /// Another thing of each.
    pub fn map<U>(&self, to: impl Fn(&T) -> U) -> ByDraw<U> {
        ByDraw { draws: self.draws.iter().map(&to).collect(), others: to(&self.others) }
    }
}

/// Parts of the time of a pass. Only their ratios count.
pub(crate) type PassParts = ByDraw<Time>;

impl PassParts {
    /// The parts of the draws if all parts together are `whole`; what is missing is that of the others.
    pub fn scaled(&self, whole: u64) -> Vec<u64> {
        let total = self.draws.iter().sum::<Time>() + self.others;
        let up_to = |part: Time| (u128::from(whole) * u128::from(part) / u128::from(total.max(1))) as u64;
        let mut sum = 0;
        let part = |&part: &Time| {
            let before = up_to(sum);
            sum += part;
            up_to(sum) - before
        };
        self.draws.iter().map(part).collect()
    }
}

/// Time that one draw has without a break, from the end of the span before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrawSpan {
    /// Pass number in the frame.
    pub pass: u32,
    /// Draw number in the pass; [`Packet::NONE`] for work of no single draw.
    pub draw: u32,
    /// End in picoseconds.
    pub end_ps: u64,
}

/// The departure of a packet from the machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Departure {
    pub pass: u32,
    pub draw: u32,
    pub batch: u32,
    pub at: Time,
}

/// The draws of a frame, from its packets in the order of the stream.
#[derive(Clone, Debug)]
pub(crate) struct DrawTimes {
    /// The latest end so far.
    now: Time,
    /// Packets of the front end that left after it, in order.
    ahead: VecDeque<Departure>,
    passes: Vec<PassParts>,
    last_pass: Option<u32>,
    spans: Vec<Departure>,
    most_spans: usize,
}

impl DrawTimes {
    /// Remembers at most so many spans, else none.
    pub fn new(most_spans: usize) -> Self {
        let (passes, spans) = Default::default();
        Self { now: 0, ahead: VecDeque::new(), passes, last_pass: None, spans, most_spans }
    }

    /// Record that the next packet of the stream left the machine at `at`.
    pub fn departed(&mut self, demand: &ServiceDemand, at: Time) {
        self.last_pass = Some(demand.pass);
        let departure = Departure { pass: demand.pass, draw: demand.draw, batch: demand.batch, at };
        if demand.front {
            if at > self.now {
                self.ahead.push_back(departure);
            }
            return;
        }
        while let Some(&front) = self.ahead.front() {
            let waits = demand.barrier.is_some() || front.batch <= demand.batch;
            if !waits && front.at > at {
                break;
            }
            if waits {
                self.advance(front);
            }
            self.ahead.pop_front();
        }
        self.advance(departure);
    }

    fn advance(&mut self, departure: Departure) {
        if departure.at <= self.now {
            return;
        }
        *PassParts::of(&mut self.passes, departure.pass, departure.draw) += departure.at - self.now;
        self.now = departure.at;
        let is_full = self.spans.len() > self.most_spans;
        match self.spans.last_mut() {
            Some(last) if (last.pass, last.draw) == (departure.pass, departure.draw) => {
                last.at = departure.at
            }
            _ if is_full => {}
            _ => self.spans.push(departure),
        }
    }

    /// The parts of every pass of a frame that ends at `end_ps`, and its spans in order of time; none if
    /// there are too many.
    pub fn finish(mut self, clocks: &Clocks, end_ps: u64) -> (Vec<PassParts>, Vec<DrawSpan>) {
        while let Some(front) = self.ahead.pop_front() {
            self.advance(front);
        }
        if let Some(pass) = self.last_pass {
            self.advance(Departure { pass, draw: Packet::NONE, batch: 0, at: clocks.grain_from(end_ps) });
        }
        let span = |departure: &Departure| DrawSpan {
            pass: departure.pass,
            draw: departure.draw,
            end_ps: clocks.ps(departure.at).min(end_ps),
        };
        let is_whole = self.spans.len() <= self.most_spans;
        (self.passes, if is_whole { self.spans.iter().map(span).collect() } else { Vec::new() })
    }
}

/// Time of a pass. Passes may overlap.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PassTime {
    /// When its first packet starts.
    pub begin_ps: u64,
    /// When its last packet leaves, and no earlier than the end of the pass before. That of the last one, which
    /// writes results back to memory, is the length of the frame, so the times between ends add up to the frame.
    pub end_ps: u64,
    /// Time that its work takes each unit at its rates, all servers together. It is the same at all levels.
    pub busy_ps: [u64; Unit::COUNT],
    /// Time of each draw, by number: its part of the time from the end of the pass before to the end of this
    /// one. What is missing is that of the resolve and the barrier.
    pub draws_ps: Vec<u64>,
}

/// A pass, as far as known.
#[derive(Clone, Copy, Debug)]
struct Pass {
    /// [`Time::MAX`] before its first packet.
    begin: Time,
    end: Time,
    work: UnitWork,
}

impl Pass {
    const NONE: Self = Self { begin: Time::MAX, end: 0, work: [0; Unit::COUNT] };
}

/// The passes of a frame, as far as known, by number.
#[derive(Clone, Debug, Default)]
pub(crate) struct Passes(Vec<Pass>);

impl Passes {
    /// Record that packets of `pass` are in the machine between two times.
    pub fn note(&mut self, pass: u32, begin: Time, end: Time) {
        let pass = self.reach(pass);
        pass.begin = pass.begin.min(begin);
        pass.end = pass.end.max(end);
    }

    /// Work of `pass` so far.
    pub fn work(&mut self, pass: u32) -> &mut UnitWork {
        &mut self.reach(pass).work
    }

    fn reach(&mut self, pass: u32) -> &mut Pass {
        let pass = pass as usize;
        if self.0.len() <= pass {
            self.0.resize(pass + 1, Pass::NONE);
        }
        &mut self.0[pass]
    }

    /// Times of the passes of a frame that ends at `end_ps`, with their `parts`. A pass without packets takes none.
    pub fn finish(
        &self,
        machine: &MachineSpec,
        clocks: &Clocks,
        end_ps: u64,
        parts: &[PassParts],
    ) -> Vec<PassTime> {
        let speeds = UnitSpeeds::new(machine, clocks);
        let mut ended_ps = 0;
        let time = |(pass, number): (&Pass, usize)| {
            let before_ps = ended_ps;
            let last = number + 1 == self.0.len();
            ended_ps = if last { end_ps } else { before_ps.max(clocks.ps(pass.end)) };
            PassTime {
                begin_ps: if pass.begin == Time::MAX { before_ps } else { clocks.ps(pass.begin) },
                end_ps: ended_ps,
                draws_ps: parts.get(number).map_or(Vec::new(), |parts| parts.scaled(ended_ps - before_ps)),
                busy_ps: speeds.times(&pass.work).map(|time| clocks.ps(time)),
            }
        };
        self.0.iter().zip(0..).map(time).collect()
    }
}
