//! Four devices of different structure that are held out from the development of the frame finder: what works on the scenes of one
//! generator may have been learnt from it.
//!
//! Each is written as a description of how such a device behaves, with constants of its own, before any finder was
//! scored on it. They share only how spans of power are added up ([`Layers`]) and how numbers are drawn ([`Dice`]).
//! A seed makes another device of the same kind: most quantities are drawn anew with it.

use super::layers::{Dice, Drawn, Layers, on_demand, pipelined};
use super::{RecorderSpec, SynthScene};
use crate::CurveError;
use crate::energy::TrueFrame;
use core::f64::consts::TAU;

/// A kind of device, with the recorder that is used on it.
#[derive(Clone, Copy, Debug)]
pub struct HeldOutDevice {
    /// Name of the device.
    pub name: &'static str,
    /// What it does, in a line.
    pub about: &'static str,
    recorder: RecorderSpec,
    /// Makes a number of frames with a seed.
    make: fn(usize, u64) -> Drawn,
}

/// All of them.
pub const HELD_OUT_DEVICES: [HeldOutDevice; 4] = [
    HeldOutDevice {
        name: "one process",
        about: "a game with passes, scene cuts and a clock governor",
        recorder: RecorderSpec { rate_hz: 50e3, bits: 14, snr_db: 25.0, seed: 0 },
        make: one_process,
    },
    HeldOutDevice {
        name: "several processes",
        about: "an application, the compositor, sound, radio and a pulsed backlight on one rail",
        recorder: RecorderSpec { rate_hz: 40e3, bits: 12, snr_db: 22.0, seed: 0 },
        make: several_processes,
    },
    HeldOutDevice {
        name: "on demand",
        about: "an interface that draws while something moves and sleeps between",
        recorder: RecorderSpec { rate_hz: 25e3, bits: 12, snr_db: 28.0, seed: 0 },
        make: on_demand,
    },
    HeldOutDevice {
        name: "pipelined",
        about: "a tiler that bins the next frame and simulates the one after while it shades",
        recorder: RecorderSpec { rate_hz: 100e3, bits: 13, snr_db: 20.0, seed: 0 },
        make: pipelined,
    },
];

impl HeldOutDevice {
    /// Makes a number of frames, with the time before and after them.
    ///
    /// # Errors
    /// [`CurveError`] if power would not be finite or be negative.
    pub fn scene(&self, frames: usize, seed: u64) -> Result<SynthScene, CurveError> {
        let drawn = (self.make)(frames, seed);
        let curve = drawn.layers.curve(drawn.until_s)?;
        let ends_s = drawn.starts_s.iter().skip(1).copied().chain([drawn.end_s]);
        let frame = |(&a_s, b_s): (&f64, f64)| TrueFrame { start_s: a_s, energy_j: curve.energy_j(a_s, b_s) };
        let truth = drawn.starts_s.iter().zip(ends_s).map(frame).collect();
        Ok(SynthScene { truth, curve, end_s: drawn.end_s })
    }

    /// How it is recorded.
    pub fn recorder(&self, seed: u64) -> RecorderSpec {
        RecorderSpec { seed, ..self.recorder }
    }
}

const ONE_PROCESS: &str = "one process";
/// Static power, power of full activity at the highest clock, W.
const STATIC_W: [f64; 2] = [0.7, 1.3];
const DYNAMIC_W: [f64; 2] = [2.5, 6.0];
/// Submission at the start of a frame: its length, s, and activity.
const SUBMIT_S: [f64; 2] = [0.25e-3, 0.9e-3];
const SUBMIT_ACTIVITY: [f64; 2] = [0.25, 0.75];
/// Passes of a frame, and how long all of them take at the highest clock, s.
const PASSES: [f64; 2] = [3.0, 8.0];
const WORK_S: [f64; 2] = [5.5e-3, 19e-3];
const PASS_ACTIVITY: [f64; 2] = [0.2, 1.0];
/// By how much a pass begins above or below its activity, and how many steps it is made of.
const SETTLING: f64 = 0.3;
const GRAINS: usize = 14;
const GRAIN: f64 = 0.06;
/// The camera: deviation of work and activity in the long run, and its memory from frame to frame.
const CAMERA: [f64; 2] = [0.14, 0.05];
const CORRELATION_OF_FRAMES: f64 = 0.97;
/// What differs between frames all the same.
const UNEVEN: f64 = 0.025;
/// Time between cuts, s, and how often one goes back to an earlier scene.
const CUT_S: [f64; 2] = [1.2, 3.5];
const BACK: f64 = 0.4;
/// Clocks of the governor, as shares of the highest, how often it looks, s, and how often it errs.
const CLOCKS: [f64; 5] = [1.0, 0.85, 0.7, 0.55, 0.45];
const LOOK_S: f64 = 0.11;
const ERRS: f64 = 0.12;
/// Busy shares between which it keeps its clock.
const LOAD: [f64; 2] = [0.6, 0.9];
/// Between frames if nothing limits them, s; rates of a limiter and of the display, Hz; error of sleeping, s.
const TURN_S: [f64; 2] = [0.08e-3, 0.5e-3];
const LIMITS_HZ: [f64; 3] = [40.0, 50.0, 75.0];
const GAME_DISPLAY_HZ: [f64; 3] = [59.94, 72.0, 90.0];
const SLEEP_S: f64 = 0.22e-3;
/// Before the first and after the last frame, s.
const GAME_AROUND_S: f64 = 0.27;

#[derive(Clone, Copy)]
enum Pace {
    Uncapped,
    Limited(f64),
    Display(f64),
}

/// A pass of a scene.
#[derive(Clone)]
struct Pass {
    share: f64,
    activity: f64,
    settling: f64,
    grains: [f64; GRAINS],
    /// Where the camera has taken work and activity.
    walk: [f64; 2],
}

impl Pass {
    fn drawn(dice: &mut Dice) -> Self {
        Self {
            share: dice.log_between([0.3, 3.0]),
            activity: dice.between(PASS_ACTIVITY),
            settling: SETTLING * dice.normal(),
            grains: core::array::from_fn(|_| GRAIN * dice.normal()),
            walk: [0.0; 2],
        }
    }

    /// Moves the camera on by a frame.
    fn wander(&mut self, dice: &mut Dice) {
        let kick = libm::sqrt(1.0 - CORRELATION_OF_FRAMES * CORRELATION_OF_FRAMES);
        for (walk, deviation) in self.walk.iter_mut().zip(CAMERA) {
            *walk = CORRELATION_OF_FRAMES * *walk + kick * deviation * dice.normal();
        }
    }

    /// Activity of each grain.
    fn activities(&self) -> [f64; GRAINS] {
        core::array::from_fn(|grain| {
            let settled = libm::exp(-4.0 * grain as f64 / GRAINS as f64);
            (self.activity + self.walk[1] + self.settling * settled + self.grains[grain]).clamp(0.03, 1.15)
        })
    }
}

fn scene(dice: &mut Dice) -> Vec<Pass> {
    let count = dice.between(PASSES) as usize;
    let mut passes: Vec<Pass> = (0..count).map(|_| Pass::drawn(dice)).collect();
    let all: f64 = passes.iter().map(|pass| pass.share).sum();
    passes.iter_mut().for_each(|pass| pass.share /= all);
    passes
}

/// The governor's clock, and the busy time since it last looked.
struct Governor {
    dice: Dice,
    place: usize,
    look_s: f64,
    busy_s: f64,
}

impl Governor {
    fn clock(&self) -> f64 {
        CLOCKS[self.place.min(CLOCKS.len() - 1)]
    }

    fn after_frame(&mut self, now_s: f64, busy_s: f64) {
        self.busy_s += busy_s;
        if now_s < self.look_s {
            return;
        }
        let load = self.busy_s / (now_s - self.look_s + LOOK_S);
        self.place = match load {
            _ if self.dice.chance(ERRS) => self.dice.between([0.0, CLOCKS.len() as f64]) as usize,
            _ if load > LOAD[1] => self.place.saturating_sub(1),
            _ if load < LOAD[0] => (self.place + 1).min(CLOCKS.len() - 1),
            _ => self.place,
        };
        (self.look_s, self.busy_s) = (now_s + LOOK_S, 0.0);
    }
}

/// A held-out device: one process that renders a game.
///
/// A frame begins with a short submission by the driver, the same in all scenes of the game. Three to seven
/// passes follow, each with an activity that settles from its first value to its last, as caches fill, and a
/// grain of its own. The camera moves: work and activity of each pass follow a mean-reverting walk. Every few
/// seconds the scene is cut, and later scenes may be earlier ones. A governor looks at the load every tenth
/// of a second and picks one of its clocks, not always the right one. Frames are uncapped, limited to a rate
/// by sleeping, or wait for the display, whose ticks heavy frames miss.
fn one_process(count: usize, seed: u64) -> Drawn {
    let mut dice = Dice::new(seed, ONE_PROCESS, 0);
    let [static_w, dynamic_w] = [STATIC_W, DYNAMIC_W].map(|range| dice.between(range));
    let [submit_s, submit] = [SUBMIT_S, SUBMIT_ACTIVITY].map(|range| dice.between(range));
    let work_s = dice.log_between(WORK_S);
    let pace = match dice.between([0.0, 3.0]) as usize {
        0 => Pace::Uncapped,
        1 => Pace::Limited(dice.one_of(&LIMITS_HZ)),
        _ => Pace::Display(dice.one_of(&GAME_DISPLAY_HZ)),
    };
    let mut scenes = vec![scene(&mut dice)];
    let (mut shown, mut cut_s) = (0, GAME_AROUND_S + dice.between(CUT_S));
    let governor = Dice::new(seed, ONE_PROCESS, 1);
    let mut governor = Governor { dice: governor, place: 0, look_s: GAME_AROUND_S + LOOK_S, busy_s: 0.0 };
    let (mut layers, mut starts_s, mut now_s) = (Layers::default(), Vec::new(), GAME_AROUND_S);
    for _ in 0..count {
        let start_s = now_s;
        starts_s.push(start_s);
        if now_s > cut_s {
            cut_s = now_s + dice.between(CUT_S);
            if scenes.len() > 1 && dice.chance(BACK) {
                shown = dice.between([0.0, scenes.len() as f64]) as usize;
            } else {
                scenes.push(scene(&mut dice));
                shown = scenes.len() - 1;
            }
        }
        let clock = governor.clock();
        // Voltage follows the clock.
        let full_w = dynamic_w * clock * (0.55 + 0.45 * clock) * (0.55 + 0.45 * clock);
        let submitted_s = submit_s * (1.0 + UNEVEN * dice.normal());
        layers.add(now_s, now_s + submitted_s, submit * full_w);
        now_s += submitted_s;
        for pass in &mut scenes[shown] {
            pass.wander(&mut dice);
            let length_s = work_s * pass.share * libm::exp(pass.walk[0] + UNEVEN * dice.normal()) / clock;
            layers.add_steps(now_s, now_s + length_s, &pass.activities().map(|activity| activity * full_w));
            now_s += length_s;
        }
        let busy_s = now_s - start_s;
        now_s = match pace {
            Pace::Uncapped => now_s + dice.between(TURN_S),
            Pace::Limited(hz) => (start_s + 1.0 / hz).max(now_s) + SLEEP_S * dice.between([0.2, 1.0]),
            Pace::Display(hz) => GAME_AROUND_S + libm::ceil((now_s + 0.1e-3 - GAME_AROUND_S) * hz) / hz,
        };
        governor.after_frame(now_s, busy_s);
    }
    let until_s = now_s + GAME_AROUND_S;
    layers.add(0.0, until_s, static_w);
    Drawn { layers, starts_s, end_s: now_s, until_s }
}

const SEVERAL_PROCESSES: &str = "several processes";
/// The board, W.
const BOARD_W: [f64; 2] = [0.9, 1.8];
/// The display, Hz, and how many of its ticks a frame is shown for.
const TICKS_HZ: [f64; 4] = [48.0, 60.0, 60.3, 85.0];
const TICKS: [f64; 3] = [1.0, 1.0, 2.0];
/// How often a tick is missed, and how long waking up takes, s.
const MISSES: f64 = 0.03;
const WAKE_S: [f64; 2] = [0.05e-3, 0.35e-3];
/// Layers of the interface; all of them together take this share of the time between frames.
const LAYERS: [f64; 2] = [6.0, 16.0];
const BUSY: [f64; 2] = [0.3, 0.8];
const LAYER_W: [f64; 2] = [0.5, 4.5];
/// An animated layer: one in four, by this share of its power, with this period, s.
const ANIMATED: f64 = 0.25;
const SWING: f64 = 0.35;
const SWING_S: [f64; 2] = [0.6, 5.0];
const LAYER_UNEVEN: f64 = 0.04;
/// The compositor: from the tick on, how long, s, and how much power, W.
const COMPOSE_AT_S: [f64; 2] = [2.5e-3, 9e-3];
const COMPOSE_S: [f64; 2] = [0.6e-3, 2.2e-3];
const COMPOSE_W: [f64; 2] = [0.3, 1.1];
/// Sound: samples a buffer at 48 kHz, how long decoding takes, s, and how much power, W.
const BUFFER_S: [f64; 3] = [1024.0 / 48e3, 480.0 / 48e3, 2048.0 / 44.1e3];
const DECODE_S: [f64; 2] = [0.4e-3, 1.6e-3];
const DECODE_W: [f64; 2] = [0.2, 0.7];
/// Radio: how often it listens, for how long, s, with how much power, W; a transfer, and how often there is one.
const LISTEN_EVERY_S: f64 = 0.1024;
const LISTEN_S: f64 = 3.1e-3;
const RADIO_W: [f64; 2] = [0.6, 1.4];
const TRANSFERS: f64 = 0.08;
const TRANSFER_S: [f64; 2] = [12e-3, 75e-3];
/// Backlight: its rate, Hz, the share of the time it is lit, and its power, W.
const BACKLIGHT_HZ: [f64; 2] = [190.0, 1300.0];
const LIT: [f64; 2] = [0.3, 0.7];
const BACKLIGHT_W: [f64; 2] = [0.15, 0.7];
/// Before the first and after the last frame, s: the other processes are at work then, too.
const BOARD_AROUND_S: f64 = 0.35;

struct Layer {
    share: f64,
    watts: f64,
    swing: [f64; 3],
}

impl Layer {
    fn drawn(dice: &mut Dice) -> Self {
        let animated = if dice.chance(ANIMATED) { SWING } else { 0.0 };
        Self {
            share: dice.log_between([0.4, 2.5]),
            watts: dice.between(LAYER_W),
            swing: [animated, dice.between(SWING_S), dice.between([0.0, TAU])],
        }
    }

    fn watts_at(&self, time_s: f64) -> f64 {
        let [share, period_s, phase] = self.swing;
        self.watts * (1.0 + share * libm::sin(TAU * time_s / period_s + phase))
    }
}

/// A held-out device: several processes on one rail.
///
/// An application draws a frame for each tick of the display, or for each second one, and misses some. It
/// waits for the tick plus a wake-up that differs. Its frames are layers of an interface: a number of
/// rectangles, each a level of power; one layer in four is an animation, whose level swings. On the same rail
/// the compositor works at every tick, with a phase of its own; sound is decoded a buffer at a time; a radio
/// listens at its interval and now and then transfers for longer; the backlight is pulsed at a rate that has
/// nothing to do with any of them.
fn several_processes(count: usize, seed: u64) -> Drawn {
    let mut dice = Dice::new(seed, SEVERAL_PROCESSES, 0);
    let tick_s = 1.0 / dice.one_of(&TICKS_HZ);
    let every = dice.one_of(&TICKS);
    let layer_count = dice.between(LAYERS) as usize;
    let interface: Vec<Layer> = (0..layer_count).map(|_| Layer::drawn(&mut dice)).collect();
    let shares: f64 = interface.iter().map(|layer| layer.share).sum();
    let busy_s = every * tick_s * dice.between(BUSY);
    let (mut layers, mut starts_s, mut tick) = (Layers::default(), Vec::new(), 0.0);
    for _ in 0..count {
        let mut now_s = BOARD_AROUND_S + tick * tick_s + dice.between(WAKE_S);
        starts_s.push(now_s);
        for layer in &interface {
            let length_s = busy_s * layer.share / shares * (1.0 + LAYER_UNEVEN * dice.normal()).max(0.5);
            layers.add(now_s, now_s + length_s, layer.watts_at(now_s));
            now_s += length_s;
        }
        tick += every + f64::from(u8::from(dice.chance(MISSES)));
    }
    let end_s = BOARD_AROUND_S + tick * tick_s;
    let until_s = end_s + BOARD_AROUND_S;
    layers.add(0.0, until_s, dice.between(BOARD_W));
    compose(&mut layers, tick_s, until_s, seed);
    sound(&mut layers, until_s, seed);
    radio(&mut layers, until_s, seed);
    backlight(&mut layers, until_s, seed);
    Drawn { layers, starts_s, end_s, until_s }
}

fn compose(layers: &mut Layers, tick_s: f64, until_s: f64, seed: u64) {
    let mut dice = Dice::new(seed, SEVERAL_PROCESSES, 1);
    let at_s = BOARD_AROUND_S % tick_s + dice.between(COMPOSE_AT_S) % tick_s;
    let [length_s, watts] = [COMPOSE_S, COMPOSE_W].map(|range| dice.between(range));
    let mut now_s = at_s;
    while now_s < until_s {
        layers.add(now_s, now_s + length_s * dice.between([0.9, 1.1]), watts);
        now_s += tick_s;
    }
}

fn sound(layers: &mut Layers, until_s: f64, seed: u64) {
    let mut dice = Dice::new(seed, SEVERAL_PROCESSES, 2);
    let buffer_s = dice.one_of(&BUFFER_S);
    let watts = dice.between(DECODE_W);
    let mut now_s = dice.between([0.0, buffer_s]);
    while now_s < until_s {
        layers.add(now_s, now_s + dice.between(DECODE_S), watts);
        now_s += buffer_s;
    }
}

fn radio(layers: &mut Layers, until_s: f64, seed: u64) {
    let mut dice = Dice::new(seed, SEVERAL_PROCESSES, 3);
    let watts = dice.between(RADIO_W);
    let mut now_s = dice.between([0.0, LISTEN_EVERY_S]);
    while now_s < until_s {
        let length_s = if dice.chance(TRANSFERS) { dice.between(TRANSFER_S) } else { LISTEN_S };
        layers.add(now_s, now_s + length_s, watts);
        now_s += LISTEN_EVERY_S;
    }
}

fn backlight(layers: &mut Layers, until_s: f64, seed: u64) {
    let mut dice = Dice::new(seed, SEVERAL_PROCESSES, 4);
    let period_s = 1.0 / dice.log_between(BACKLIGHT_HZ);
    let [lit, watts] = [LIT, BACKLIGHT_W].map(|range| dice.between(range));
    let mut now_s = dice.between([0.0, period_s]);
    while now_s < until_s {
        layers.add(now_s, now_s + lit * period_s, watts);
        now_s += period_s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_are_in_order_within_the_curve_and_seeds_differ() {
        for device in HELD_OUT_DEVICES {
            for seed in 1..4 {
                let scene = device.scene(80, seed).unwrap();
                assert_eq!(scene.truth.len(), 80, "{}", device.name);
                assert!(scene.truth.windows(2).all(|two| two[1].start_s - two[0].start_s > 1e-3));
                assert!(scene.truth.iter().all(|frame| frame.energy_j > 0.0));
                let last = scene.truth.last().unwrap();
                assert!(last.start_s < scene.end_s && scene.end_s < scene.curve.end_s(), "{}", device.name);
                let other = device.scene(80, seed + 1).unwrap();
                assert_ne!(scene, other);
                assert_eq!(scene, device.scene(80, seed).unwrap());
                assert_eq!(scene.record(&device.recorder(seed)).unwrap().lost_samples(), 0);
            }
        }
    }
}
