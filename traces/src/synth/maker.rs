//! Frame after frame of power.

use super::scenario::Scenario;
use crate::random::Random;
use crate::{Curve, CurveBuilder, CurveError};
use core::f64::consts::TAU;

/// Idle power, and what full activity adds at the highest clock, W.
const IDLE_W: f64 = 0.55;
const ACTIVE_W: f64 = 3.2;
/// Clocks and voltages that steps choose from, as shares of the highest.
const LEVELS: [[f64; 2]; 4] = [[1.0, 1.0], [0.88, 0.93], [0.72, 0.86], [0.58, 0.8]];
/// Time between clock steps, s, and for how long one stalls the frame.
const STEP_S: [f64; 2] = [0.5, 2.5];
const RELOCK_S: f64 = 0.15e-3;
/// Front end and clear: length at the highest clock, s, and activity.
const BEGIN: [[f64; 2]; 2] = [[0.14e-3, 0.15], [0.11e-3, 0.97]];
/// Draws of a frame, how long they take together at the highest clock, s, and the spread of their lengths' logarithms.
const DRAWS: usize = 120;
const WORK_S: f64 = 8.0e-3;
const SPREAD: f64 = 0.7;
/// From frame to frame a draw's length differs by so much.
const JITTER: f64 = 0.02;
/// Idle within a frame of three phases, s.
const GAP_S: f64 = 2.4e-3;
/// Between frames that do not wait for a tick, s.
const TURN_S: [f64; 2] = [0.12e-3, 0.25e-3];
/// Frames of the launch transient, and the power it adds, W.
const LAUNCH: (usize, f64) = (48, 0.05);
/// Share by which idle power rises, and how fast, s.
const DRIFT: [f64; 2] = [0.33, 5.0];
/// Idle before the first and after the last frame, s.
const AROUND_S: f64 = 0.3;
/// A disturbance: how often, for how long, how long its steps are, s, and their mean power, W.
const BURST_EVERY_S: f64 = 2.0;
const BURST_S: f64 = 0.09;
const BURST_STEP_S: [f64; 2] = [0.4e-3, 3e-3];
const BURST_W: f64 = 0.45;

/// What varies, each with random numbers of its own.
#[derive(Clone, Copy)]
enum Vary {
    Length,
    Activity,
    Phase,
    Rate,
    Jitter,
    Clock,
    Turn,
    Burst,
    BurstPower,
}

/// A draw: work in seconds at the highest clock, activity, and how both wander.
struct Draw {
    work_s: f64,
    activity: f64,
    phase: f64,
    rate: f64,
}

/// The state while frames are drawn.
pub(super) struct Maker {
    scenario: Scenario,
    seed: u64,
    builder: CurveBuilder,
    draws: Vec<Draw>,
    level: usize,
    /// How many clock steps there were, and when the next one is.
    steps: u64,
    step_s: f64,
    /// The disturbance: since when, with what power, and when that ends.
    burst: Burst,
}

impl Maker {
    pub fn new(scenario: Scenario, seed: u64) -> Result<Self, CurveError> {
        let random = |vary: Vary| Random::new(seed, vary as u64);
        let step_s =
            if scenario.clocks { AROUND_S + random(Vary::Clock).between(0, STEP_S) } else { f64::INFINITY };
        Ok(Self {
            scenario,
            seed,
            builder: CurveBuilder::new(0.0)?,
            draws: draws(seed),
            level: 0,
            steps: 0,
            step_s,
            burst: Burst::new(scenario.disturbed, seed),
        })
    }

    pub fn now_s(&self) -> f64 {
        self.builder.now_s()
    }

    pub fn build(self) -> Result<Curve, CurveError> {
        self.builder.build()
    }

    fn random(&self, vary: Vary) -> Random {
        Random::new(self.seed, vary as u64)
    }

    /// Appends power, with what disturbances add to it.
    fn push(&mut self, duration_s: f64, watts: f64) -> Result<(), CurveError> {
        let mut left_s = duration_s;
        while self.burst.until_s < self.now_s() + left_s {
            let part_s = (self.burst.until_s - self.now_s()).max(0.0);
            self.builder.push(part_s, watts + self.burst.watts)?;
            left_s -= part_s;
            self.burst.advance();
        }
        self.builder.push(left_s, watts + self.burst.watts)
    }

    /// Idle before the first frame or after the last.
    pub fn idle_around(&mut self) -> Result<(), CurveError> {
        self.push(AROUND_S, self.idle_w())
    }

    fn idle_w(&self) -> f64 {
        let rise = DRIFT[0] * (1.0 - libm::exp(-self.now_s() / DRIFT[1]));
        if self.scenario.drift { IDLE_W * (1.0 + rise) } else { IDLE_W }
    }

    /// Work at some activity, after the clock step that is due.
    fn work(&mut self, work_s: f64, activity: f64, extra_w: f64) -> Result<(), CurveError> {
        if self.now_s() >= self.step_s {
            let random = self.random(Vary::Clock);
            self.steps += 1;
            // Another level than this one.
            let others = (LEVELS.len() - 1) as f64;
            let on = 1 + (others * random.uniform(2 * self.steps + 1)) as usize;
            self.level = (self.level + on) % LEVELS.len();
            self.step_s += random.between(2 * self.steps, STEP_S);
            self.push(RELOCK_S, self.idle_w() + 0.05 * ACTIVE_W)?;
        }
        let [clock, volts] = LEVELS[self.level];
        self.push(work_s / clock, self.idle_w() + extra_w + ACTIVE_W * activity * clock * volts * volts)
    }

    /// One frame; its start, s.
    pub fn frame(&mut self, frame: usize) -> Result<f64, CurveError> {
        let start_s = self.now_s();
        let extra_w = if self.scenario.launch && frame < LAUNCH.0 { LAUNCH.1 } else { 0.0 };
        for [work_s, activity] in BEGIN {
            self.work(work_s, activity, extra_w)?;
        }
        let jitter = self.random(Vary::Jitter);
        for place in 0..DRAWS {
            if self.scenario.phases && (place == DRAWS / 3 || place == 2 * DRAWS / 3) {
                self.push(GAP_S, self.idle_w())?;
            }
            let draw = &self.draws[place];
            let wave = libm::sin(draw.phase + draw.rate * start_s) * self.scenario.content;
            let by = JITTER * jitter.normals((frame * DRAWS + place) as u64).0;
            let (work_s, activity) =
                (draw.work_s * libm::exp(2.0 * wave + by), draw.activity * (1.0 + 0.3 * wave));
            self.work(work_s, activity.min(1.1), extra_w)?;
        }
        self.turn(frame)?;
        Ok(start_s)
    }

    /// Waits for the next tick, or for a moment.
    fn turn(&mut self, frame: usize) -> Result<(), CurveError> {
        let (now_s, idle_w) = (self.now_s(), self.idle_w());
        match self.scenario.sync_hz {
            Some(rate_hz) => {
                let ticks = libm::ceil((now_s + TURN_S[0] - AROUND_S) * rate_hz);
                self.push(AROUND_S + ticks / rate_hz - now_s, idle_w)
            }
            None => {
                let turn_s = self.random(Vary::Turn).between(frame as u64, TURN_S);
                self.push(turn_s, idle_w + 0.08 * ACTIVE_W)
            }
        }
    }
}

/// The draws that every frame begins from.
fn draws(seed: u64) -> Vec<Draw> {
    let random = |vary: Vary| Random::new(seed, vary as u64);
    let lengths = (0..DRAWS as u64).map(|draw| libm::exp(SPREAD * random(Vary::Length).normals(draw).0));
    let lengths: Vec<f64> = lengths.collect();
    let total: f64 = lengths.iter().sum();
    let draw = |(n, length): (u64, &f64)| Draw {
        work_s: WORK_S * length / total,
        activity: random(Vary::Activity).between(n, [0.3, 1.0]),
        phase: random(Vary::Phase).between(n, [0.0, TAU]),
        rate: random(Vary::Rate).between(n, [0.2, 2.5]),
    };
    (0..).zip(&lengths).map(draw).collect()
}

/// Work of the operating system: steps of power for a while, then none until the next burst.
struct Burst {
    powers: [Random; 2],
    /// When this burst began or the next one will, and how many steps there were.
    from_s: f64,
    steps: u64,
    watts: f64,
    until_s: f64,
}

impl Burst {
    fn new(disturbed: bool, seed: u64) -> Self {
        let powers = [Vary::Burst, Vary::BurstPower].map(|vary| Random::new(seed, vary as u64));
        let first_s = AROUND_S + powers[0].between(0, [0.2, 1.0]);
        let from_s = if disturbed { first_s } else { f64::INFINITY };
        Self { powers, from_s, steps: 0, watts: 0.0, until_s: from_s }
    }

    /// The next step, or the pause after the last.
    fn advance(&mut self) {
        self.steps += 1;
        if self.until_s >= self.from_s + BURST_S {
            self.from_s += BURST_EVERY_S;
            (self.watts, self.until_s) = (0.0, self.from_s);
        } else {
            let normal = self.powers[1].normals(self.steps).0;
            self.watts = (BURST_W * (1.0 + 0.5 * normal)).max(0.0);
            self.until_s += self.powers[0].between(self.steps, BURST_STEP_S);
        }
    }
}
