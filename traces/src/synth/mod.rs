//! Power curves with known frames, to measure the frame finder.
//!
//! The model stands for no particular GPU. A frame is a front end, a clear, and draws with a length and a
//! power each. A [`Scenario`] makes its frames hard to find: free running or V-sync, idle gaps within the
//! frame, changing content, clock steps, a launch transient, disturbances, drifting idle power.
//! [`Scenario::scene`] makes a curve of it, and [`RecorderSpec`] samples that with a recorder of some rate,
//! resolution and noise. All random numbers are functions of (seed, purpose, frame, draw), so a longer scene
//! begins like a shorter one.
//!
//! [`HELD_OUT_DEVICES`] are four more devices of other structure, which share nothing with these scenes or each other.

mod held_out;
mod layers;

pub use held_out::{HELD_OUT_DEVICES, HeldOutDevice};

use crate::device::{Device, DeviceError, DeviceSpec, SampleError};
use crate::energy::TrueFrame;
use crate::stats::Random;
use crate::trace::Trace;
use crate::{Curve, CurveBuilder, CurveError};
use core::f64::consts::TAU;
use thiserror::Error;

/// The properties that make a recording easy or hard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scenario {
    /// Name of the scenario.
    pub name: &'static str,
    /// Frames wait for a tick of this rate, Hz; `None` lets them run on.
    pub sync_hz: Option<f64>,
    /// The GPU waits twice within a frame.
    pub phases: bool,
    /// How far lengths and powers of draws wander, as a share.
    pub content: f64,
    /// The clock steps every 0.5 to 2.5 s, within frames, too.
    pub clocks: bool,
    /// The first frames draw more power.
    pub launch: bool,
    /// The operating system works for 90 ms every 2 s.
    pub disturbed: bool,
    /// Idle power rises by a third.
    pub drift: bool,
}

const ONE_PHASE: Scenario = Scenario {
    name: "v-sync",
    sync_hz: Some(60.0),
    phases: false,
    content: 0.05,
    clocks: false,
    launch: false,
    disturbed: false,
    drift: false,
};

/// From easy to hard.
pub const SCENARIOS: [Scenario; 8] = [
    ONE_PHASE,
    Scenario { name: "free-running", sync_hz: None, content: 0.15, ..ONE_PHASE },
    Scenario { name: "three-phase", phases: true, sync_hz: Some(30.0), ..ONE_PHASE },
    Scenario { name: "launch", launch: true, drift: true, ..ONE_PHASE },
    Scenario { name: "disturbed", disturbed: true, ..ONE_PHASE },
    Scenario { name: "content", sync_hz: None, content: 0.35, ..ONE_PHASE },
    Scenario { name: "clock-steps", sync_hz: None, clocks: true, content: 0.15, ..ONE_PHASE },
    Scenario {
        name: "all",
        sync_hz: None,
        clocks: true,
        content: 0.35,
        launch: true,
        disturbed: true,
        drift: true,
        ..ONE_PHASE
    },
];

/// A curve, and the frames in it.
#[derive(Clone, Debug, PartialEq)]
pub struct SynthScene {
    /// Power over time.
    pub curve: Curve,
    /// The frames, in order; each reaches to the next one's start, the last to `end_s`.
    pub truth: Vec<TrueFrame>,
    /// End of the last one, s.
    pub end_s: f64,
}

impl Scenario {
    /// Makes a number of frames, with idle time before and after them.
    ///
    /// # Errors
    /// [`CurveError`] if a number of the scenario is not finite or so large that power would be negative.
    pub fn scene(&self, frames: usize, seed: u64) -> Result<SynthScene, CurveError> {
        let mut maker = Maker::new(*self, seed)?;
        maker.idle_around()?;
        let starts_s: Vec<f64> = (0..frames).map(|frame| maker.frame(frame)).collect::<Result<_, _>>()?;
        let end_s = maker.now_s();
        maker.idle_around()?;
        let curve = maker.build()?;
        let ends_s = starts_s.iter().skip(1).copied().chain([end_s]);
        let frame = |(&a_s, b_s): (&f64, f64)| TrueFrame { start_s: a_s, energy_j: curve.energy_j(a_s, b_s) };
        let truth = starts_s.iter().zip(ends_s).map(frame).collect();
        Ok(SynthScene { truth, curve, end_s })
    }
}

/// Rate at which the power of the signal is taken, Hz.
const FINE_HZ: f64 = 50e3;
/// Voltage of the rail, V.
const RAIL_V: f64 = 4.0;

/// How a scene is recorded: a 4 V rail without resistance, currents of +-4 A, voltages of +-6 V.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecorderSpec {
    /// Samples per second.
    pub rate_hz: f64,
    /// Resolution of current and voltage.
    pub bits: u32,
    /// Variance of the power while frames are drawn, at 50 kHz, over the variance of the noise of one sample
    /// at any rate, dB.
    pub snr_db: f64,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for RecorderSpec {
    /// 50 kHz, 14 bits, 30 dB.
    fn default() -> Self {
        Self { rate_hz: 50e3, bits: 14, snr_db: 30.0, seed: 1 }
    }
}

/// A scene that cannot be recorded so.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the variants are the sources, documented there")]
pub enum SynthError {
    #[error(transparent)]
    Device(#[from] DeviceError),
    #[error(transparent)]
    Sample(#[from] SampleError),
}

impl SynthScene {
    /// The trace of all of it, idle before and after included.
    ///
    /// # Errors
    /// [`SynthError`] where rate, bits or noise are out of range.
    pub fn record(&self, recorder: &RecorderSpec) -> Result<Trace, SynthError> {
        let noise_w = libm::sqrt(self.variance_w2()) * libm::pow(10.0, -recorder.snr_db / 20.0);
        let device = Device::new(DeviceSpec {
            name: "synthetic".to_owned(),
            rate_hz: recorder.rate_hz,
            rail_v: RAIL_V,
            rail_ohm: 0.0,
            current_range_a: [-4.0, 4.0],
            voltage_range_v: [-6.0, 6.0],
            bits: recorder.bits,
            current_noise_a: noise_w / RAIL_V,
            voltage_noise_v: 0.0,
            seed: recorder.seed,
            ..DeviceSpec::default()
        })?;
        Ok(device.sample(&self.curve, self.curve.start_s(), self.curve.end_s())?.trace)
    }

    /// Variance of the power while frames are drawn, W^2.
    fn variance_w2(&self) -> f64 {
        let from_s = self.truth.first().map_or(self.end_s, |frame| frame.start_s);
        let count = ((self.end_s - from_s) * FINE_HZ) as usize;
        let watts = self.curve.sample_means_w(from_s, FINE_HZ, count);
        let mean = watts.iter().sum::<f64>() / count.max(1) as f64;
        watts.iter().map(|w| (w - mean) * (w - mean)).sum::<f64>() / count.max(1) as f64
    }
}

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
/// Draws of a frame, how long they take together at the highest clock, s, and the spread of their lengths'
/// logarithms.
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

/// The random quantities, each with a stream of its own.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Trace;
    use crate::frames::{FinderMethod, Marks, default_window, find};

    /// Times from start to start, s.
    fn gaps(scenario: &Scenario, frames: usize, seed: u64) -> Vec<f64> {
        let scene = scenario.scene(frames, seed).unwrap();
        scene.truth.windows(2).map(|two| two[1].start_s - two[0].start_s).collect()
    }

    #[test]
    fn frames_follow_one_another_and_their_energies_add_up() {
        for scenario in SCENARIOS {
            let scene = scenario.scene(40, 3).unwrap();
            assert_eq!(scene.truth.len(), 40);
            assert!(scene.truth.windows(2).all(|two| two[0].start_s < two[1].start_s), "{}", scenario.name);
            let sum: f64 = scene.truth.iter().map(|frame| frame.energy_j).sum();
            let whole = scene.curve.energy_j(scene.truth[0].start_s, scene.end_s);
            assert!((sum - whole).abs() < 1e-9 * whole, "{}", scenario.name);
        }
    }

    #[test]
    fn v_sync_keeps_to_ticks_and_free_running_does_not_wait() {
        let on_tick = |gap: &f64| (gap * 60.0 - (gap * 60.0).round()).abs() < 1e-6;
        assert!(gaps(&SCENARIOS[0], 30, 1).iter().all(on_tick));
        assert!(!gaps(&SCENARIOS[1], 30, 1).iter().any(on_tick));
    }

    #[test]
    fn clock_steps_lengthen_frames_and_lower_power() {
        let steady = Scenario { content: 0.0, ..SCENARIOS[1] };
        let ratio = |gaps: &[f64]| {
            let ends = gaps.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), &g| (a.min(g), b.max(g)));
            ends.1 / ends.0
        };
        assert!(ratio(&gaps(&steady, 600, 5)) < 1.1);
        assert!(ratio(&gaps(&Scenario { clocks: true, ..steady }, 600, 5)) > 1.3);
    }

    #[test]
    fn three_phases_are_idle_twice_within_a_frame() {
        let scene = SCENARIOS[2].scene(3, 4).unwrap();
        let (a_s, b_s) = (scene.truth[0].start_s, scene.truth[1].start_s);
        let edges = scene.curve.edges_s().windows(2).zip(scene.curve.watts());
        let idle = edges.filter(|(edge, watts)| {
            edge[0] >= a_s && edge[1] <= b_s && **watts < 0.56 && edge[1] - edge[0] > 2e-3
        });
        assert_eq!(idle.count(), 3, "two gaps and the wait for the tick");
    }

    #[test]
    fn content_launch_drift_and_disturbances_each_change_the_energy_of_frames() {
        let energies = |scenario: &Scenario| -> Vec<f64> {
            scenario.scene(200, 6).unwrap().truth.iter().map(|frame| frame.energy_j).collect()
        };
        let plain = energies(&SCENARIOS[0]);
        let differ = |scenario: Scenario| {
            let other = energies(&scenario);
            other.iter().zip(&plain).filter(|(a, b)| (*a - *b).abs() > 1e-9).count()
        };
        let plain_scenario = SCENARIOS[0];
        assert_eq!(differ(plain_scenario), 0);
        assert_eq!(differ(Scenario { launch: true, ..plain_scenario }), 48);
        assert_eq!(differ(Scenario { drift: true, ..plain_scenario }), 200);
        // 3.3 s of frames, a burst of 0.09 s every 2 s: one or two, each over at most seven frames.
        assert!((5..=14).contains(&differ(Scenario { disturbed: true, ..plain_scenario })));
        assert!(differ(Scenario { content: 0.1, ..plain_scenario }) > 190);
    }

    #[test]
    fn a_longer_scene_begins_like_a_shorter_one_and_another_seed_differs() {
        let of = |frames, seed| SCENARIOS[7].scene(frames, seed).unwrap().truth;
        assert_eq!(of(20, 3)[..19], of(60, 3)[..19]);
        assert_ne!(of(20, 3)[1..], of(20, 4)[1..]);
    }

    #[test]
    fn noise_is_as_asked_and_the_same_seed_gives_the_same_trace() {
        let scene = SCENARIOS[1].scene(100, 2).unwrap();
        let at =
            |snr_db: f64| scene.record(&RecorderSpec { snr_db, seed: 9, ..RecorderSpec::default() }).unwrap();
        let powers = |trace: &Trace| trace.powers_w().collect::<Vec<_>>();
        let (noisy, clean) = (powers(&at(0.0)), powers(&at(200.0)));
        let inner = 20_000..40_000;
        let variance = |x: Vec<f64>| {
            let mean = x.iter().sum::<f64>() / x.len() as f64;
            x.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / x.len() as f64
        };
        let noise = variance(inner.clone().map(|i| noisy[i] - clean[i]).collect());
        let ratio = variance(inner.map(|i| clean[i]).collect()) / noise;
        assert!((0.8..1.25).contains(&ratio), "{ratio}");
        assert_eq!(at(0.0), at(0.0));
        assert!(scene.record(&RecorderSpec { bits: 99, ..RecorderSpec::default() }).is_err());
    }

    #[test]
    fn auto_tracks_unless_the_window_has_hardly_any_samples() {
        let scene = SCENARIOS[1].scene(40, 2).unwrap();
        let method = |rate_hz: f64| {
            let trace = scene.record(&RecorderSpec { rate_hz, ..RecorderSpec::default() }).unwrap();
            let window = default_window(0.0, rate_hz);
            find(&trace, &Marks::one(scene.truth[15].start_s, window, trace.end_s())).unwrap().method
        };
        assert_eq!((method(50e3), method(2e3)), (FinderMethod::Tracking, FinderMethod::SumOfSquares));
    }

    #[test]
    fn no_frames_are_idle_alone() {
        let scene = SCENARIOS[0].scene(0, 1).unwrap();
        assert!(scene.truth.is_empty() && scene.curve.watts() == [0.55]);
        assert!(scene.record(&RecorderSpec::default()).is_ok());
    }
}
