//! Four devices of different structure that bear witness of the frame finder: what works on the scenes of one generator may
//! have been learnt from it.
//!
//! Each is written as a description of how such a device behaves, with constants of its own, before any finder was
//! scored on it. They share only how spans of power are added up ([`Layers`]) and how numbers are drawn ([`Dice`]).
//! A seed makes another device of the same kind: most quantities are drawn anew with it.

use super::layers::{Dice, Drawn, Layers};
use super::processes::{one_process, several_processes};
use super::{Recording, Scene};
use crate::CurveError;
use crate::energy::TrueFrame;
use core::f64::consts::TAU;

/// A kind of device, with the recorder that is used on it.
#[derive(Clone, Copy, Debug)]
pub struct Witness {
    /// Its name.
    pub name: &'static str,
    /// What it does, in a line.
    pub about: &'static str,
    recorder: Recording,
    /// Makes a number of frames with a seed.
    make: fn(usize, u64) -> Drawn,
}

/// All of them.
pub const WITNESSES: [Witness; 4] = [
    Witness {
        name: "one process",
        about: "a game with passes, scene cuts and a clock governor",
        recorder: Recording { rate_hz: 50e3, bits: 14, snr_db: 25.0, seed: 0 },
        make: one_process,
    },
    Witness {
        name: "several processes",
        about: "an application, the compositor, sound, radio and a pulsed backlight on one rail",
        recorder: Recording { rate_hz: 40e3, bits: 12, snr_db: 22.0, seed: 0 },
        make: several_processes,
    },
    Witness {
        name: "on demand",
        about: "an interface that draws while something moves and sleeps between",
        recorder: Recording { rate_hz: 25e3, bits: 12, snr_db: 28.0, seed: 0 },
        make: on_demand,
    },
    Witness {
        name: "pipelined",
        about: "a tiler that bins the next frame and simulates the one after while it shades",
        recorder: Recording { rate_hz: 100e3, bits: 13, snr_db: 20.0, seed: 0 },
        make: pipelined,
    },
];

impl Witness {
    /// Makes a number of frames, with the time before and after them.
    ///
    /// # Errors
    /// [`CurveError`] if power would not be finite or be negative.
    pub fn scene(&self, frames: usize, seed: u64) -> Result<Scene, CurveError> {
        let drawn = (self.make)(frames, seed);
        let curve = drawn.layers.curve(drawn.until_s)?;
        let ends_s = drawn.starts_s.iter().skip(1).copied().chain([drawn.end_s]);
        let frame = |(&a_s, b_s): (&f64, f64)| TrueFrame { start_s: a_s, energy_j: curve.energy_j(a_s, b_s) };
        let truth = drawn.starts_s.iter().zip(ends_s).map(frame).collect();
        Ok(Scene { truth, curve, end_s: drawn.end_s })
    }

    /// How it is recorded.
    pub fn recording(&self, seed: u64) -> Recording {
        Recording { seed, ..self.recorder }
    }
}

const ON_DEMAND: &str = "on demand";
/// Power asleep, dozing and polling, W, and after how long it dozes and sleeps, s.
const ASLEEP_W: f64 = 0.12;
const DOZING_W: f64 = 0.31;
const POLLING_W: f64 = 0.52;
const DOZES_S: f64 = 9e-3;
const SLEEPS_S: f64 = 60e-3;
/// Waking up: how long, s, and its steps, W.
const WAKES_S: f64 = 1.7e-3;
const WAKING_W: [f64; 5] = [0.2, 0.35, 0.5, 0.68, 0.6];
/// The traversal: length, s, and power, W, of its parts.
const TRAVERSE_S: [f64; 2] = [0.7e-3, 1.5e-3];
const TRAVERSE_W: [f64; 2] = [0.8, 2.0];
const TRAVERSE_PARTS: usize = 6;
/// The hand-over, s, W.
const HAND_OVER_S: f64 = 0.45e-3;
const HAND_OVER_W: f64 = 0.95;
/// Filling: how long, s, and its power, W.
const FILL_S: [f64; 2] = [0.9e-3, 16e-3];
const FILL_W: [f64; 2] = [1.5, 3.3];
/// Areas in a full fill, and how much their powers differ.
const AREAS: f64 = 22.0;
const AREA_DIFFERS: f64 = 0.22;
/// The display, Hz; how often a frame is late, and by how much, s.
const DISPLAY_HZ: [f64; 3] = [60.0, 90.0, 120.0];
const LATE: f64 = 0.1;
const LATE_S: [f64; 2] = [0.3e-3, 5e-3];
/// Frames of a touch; how often a lone frame comes instead.
const TOUCH_FRAMES: [f64; 2] = [8.0, 55.0];
const LONE: f64 = 0.45;
/// Mean pause, s.
const PAUSE_S: f64 = 0.25;
const MIN_PAUSE_S: f64 = 5e-3;
/// From frame to frame of a touch the filled area changes by so much.
const SCROLL: f64 = 0.15;
const IDLE_AROUND_S: f64 = 0.4;

/// What it looks like, and the time.
struct Interface {
    dice: Dice,
    layers: Layers,
    traverse_s: f64,
    traverse_w: Vec<f64>,
    area_w: Vec<f64>,
    /// End of the frame before, s.
    idle_s: f64,
}

impl Interface {
    fn new(seed: u64) -> Self {
        let mut dice = Dice::new(seed, ON_DEMAND, 0);
        let traverse_s = dice.between(TRAVERSE_S);
        let traverse_w = (0..TRAVERSE_PARTS).map(|_| dice.between(TRAVERSE_W)).collect();
        let area_w = (0..AREAS as usize).map(|_| dice.between(FILL_W)).collect();
        Self { dice, layers: Layers::default(), traverse_s, traverse_w, area_w, idle_s: 0.0 }
    }

    /// Idles until a time, and wakes up before it if asleep.
    fn idle_until(&mut self, to_s: f64) {
        let from_s = self.idle_s;
        let [doze_s, sleep_s] = [DOZES_S, SLEEPS_S].map(|after_s| (from_s + after_s).min(to_s));
        self.layers.add(from_s, doze_s, POLLING_W);
        self.layers.add(doze_s, sleep_s, DOZING_W);
        self.layers.add(sleep_s, to_s, ASLEEP_W);
        if to_s - sleep_s > WAKES_S {
            self.layers.add_steps(to_s - WAKES_S, to_s, &WAKING_W);
        }
    }

    /// Draws a frame of so long a fill.
    fn draw(&mut self, start_s: f64, fill_s: f64) {
        self.idle_until(start_s);
        let dice = &mut self.dice;
        let traversed_s = start_s + self.traverse_s * dice.between([0.96, 1.04]);
        self.layers.add_steps(start_s, traversed_s, &self.traverse_w);
        let areas = libm::ceil(AREAS * fill_s / FILL_S[1]).clamp(1.0, AREAS) as usize;
        let watts: Vec<f64> = self.area_w[..areas]
            .iter()
            .map(|watts| watts * libm::exp(AREA_DIFFERS * dice.normal()))
            .collect();
        self.layers.add_steps(traversed_s, traversed_s + fill_s, &watts);
        self.idle_s = traversed_s + fill_s + HAND_OVER_S;
        self.layers.add(traversed_s + fill_s, self.idle_s, HAND_OVER_W);
    }
}

/// A witness: an interface that draws on demand.
///
/// Nothing is drawn while nothing changes. A touch starts a run of frames at the rate of the display, some of which are late; a
/// cursor or a clock draws a single one. What is drawn is anything from a small area to the whole screen, so the longest
/// frame takes ten times as long as the shortest. All frames begin with the same traversal of the view tree and end with
/// the same hand-over; in between areas are filled. The processor polls for a while after the last frame, dozes, and sleeps; from sleep it
/// wakes up by a ramp.
fn on_demand(count: usize, seed: u64) -> Drawn {
    let mut interface = Interface::new(seed);
    let tick_s = 1.0 / interface.dice.one_of(&DISPLAY_HZ);
    let (mut starts_s, mut now_s) = (Vec::new(), IDLE_AROUND_S);
    while starts_s.len() < count {
        let dice = &mut interface.dice;
        let touch = if dice.chance(LONE) { 1 } else { dice.between(TOUCH_FRAMES) as usize };
        let mut fill_s = dice.log_between(FILL_S);
        for _ in 0..touch.min(count - starts_s.len()) {
            let dice = &mut interface.dice;
            let late_s = if dice.chance(LATE) { dice.between(LATE_S) } else { 0.0 };
            fill_s = (fill_s * libm::exp(SCROLL * dice.normal())).clamp(FILL_S[0], FILL_S[1]);
            let start_s = now_s + late_s;
            starts_s.push(start_s);
            interface.draw(start_s, fill_s);
            let ticks = libm::ceil((interface.idle_s + 0.05e-3 - now_s) / tick_s);
            now_s += ticks * tick_s;
        }
        now_s += MIN_PAUSE_S + interface.dice.waiting(PAUSE_S);
    }
    let end_s = now_s.max(interface.idle_s);
    let until_s = end_s + IDLE_AROUND_S;
    interface.idle_until(until_s);
    Drawn { layers: interface.layers, starts_s, end_s, until_s }
}

const PIPELINED: &str = "pipelined";
/// The rest of the chip, W.
const REST_W: [f64; 2] = [0.4, 1.0];
/// Preparation by the processor: how long, s, and its power, W.
const PREPARE_S: [f64; 2] = [3e-3, 11e-3];
const PREPARE_W: [f64; 2] = [0.4, 1.3];
/// Binning: a burst that sets up, then draws; s and W.
const SET_UP_S: [f64; 2] = [0.12e-3, 0.4e-3];
const SET_UP_W: [f64; 2] = [1.6, 3.0];
const BIN_S: [f64; 2] = [1.4e-3, 4.5e-3];
const BIN_W: [f64; 2] = [0.9, 2.2];
const BIN_DRAWS: usize = 17;
/// Binning takes so much longer where shading runs at the same time.
const SHARED: f64 = 1.25;
/// Shading: render targets, how long all of them take, s, tile rows of each, W.
const TARGETS: [f64; 2] = [2.0, 6.0];
const SHADE_S: [f64; 2] = [4e-3, 15e-3];
const SHADE_W: [f64; 2] = [1.0, 4.2];
const TILE_ROWS: usize = 9;
/// A store to memory ends each target: s, W.
const STORE_S: f64 = 0.18e-3;
const STORE_W: f64 = 0.75;
/// Phases of the game: by how much each unit's work swings, and how fast, s.
const SWING: [f64; 2] = [0.05, 0.3];
const SWING_S: [f64; 2] = [1.5, 9.0];
/// What differs from frame to frame.
const DIFFERS: f64 = 0.035;
/// Before the first preparation and after the last frame, s.
const REST_AROUND_S: f64 = 0.22;

/// How a unit's work swings with time.
struct Swing([f64; 3]);

impl Swing {
    fn drawn(dice: &mut Dice) -> Self {
        Self([dice.between(SWING), dice.between(SWING_S), dice.between([0.0, TAU])])
    }

    fn at(&self, time_s: f64, dice: &mut Dice) -> f64 {
        let [share, period_s, phase] = self.0;
        libm::exp(share * libm::sin(TAU * time_s / period_s + phase) + DIFFERS * dice.normal())
    }
}

/// The three units.
struct Chip {
    prepare: ([f64; 2], Swing),
    set_up: [f64; 2],
    bin: (f64, Vec<f64>, Swing),
    shade: (f64, Vec<Target>, Swing),
}

/// A render target: its share of the shading, and the power of its tile rows, W.
struct Target {
    share: f64,
    row_w: [f64; TILE_ROWS],
}

impl Chip {
    fn drawn(dice: &mut Dice) -> Self {
        let prepare = [dice.log_between(PREPARE_S), dice.between(PREPARE_W)];
        let set_up = [SET_UP_S, SET_UP_W].map(|range| dice.between(range));
        let draws = (0..BIN_DRAWS).map(|_| dice.between(BIN_W)).collect();
        let count = dice.between(TARGETS) as usize;
        let shares: Vec<f64> = (0..count).map(|_| dice.log_between([0.35, 2.8])).collect();
        let all: f64 = shares.iter().sum();
        let targets = shares.iter().map(|share| {
            let level_w = dice.between(SHADE_W);
            let row_w = core::array::from_fn(|_| level_w * dice.between([0.7, 1.3]));
            Target { share: share / all, row_w }
        });
        let targets = targets.collect();
        let shade_s = dice.log_between(SHADE_S);
        let mut swing = || Swing::drawn(dice);
        Self {
            prepare: (prepare, swing()),
            set_up,
            shade: (shade_s, targets, swing()),
            bin: (0.0, draws, swing()),
        }
        .with_binning(dice)
    }

    fn with_binning(mut self, dice: &mut Dice) -> Self {
        self.bin.0 = dice.log_between(BIN_S);
        self
    }

    /// Bins from a time on, shading until another; returns the end, s.
    fn bin(&self, layers: &mut Layers, from_s: f64, shaded_s: f64, dice: &mut Dice) -> f64 {
        let set_up_s = from_s + self.set_up[0];
        layers.add(from_s, set_up_s, self.set_up[1]);
        let slower = if shaded_s > set_up_s { SHARED } else { 1.0 };
        let end_s = set_up_s + slower * self.bin.0 * self.bin.2.at(from_s, dice);
        let watts: Vec<f64> = self.bin.1.iter().map(|watts| watts / slower).collect();
        layers.add_steps(set_up_s, end_s, &watts);
        end_s
    }

    /// Shades from a time on; returns the end, s.
    fn shade(&self, layers: &mut Layers, from_s: f64, dice: &mut Dice) -> f64 {
        let mut now_s = from_s;
        for target in &self.shade.1 {
            let end_s = now_s + self.shade.0 * target.share * self.shade.2.at(from_s, dice);
            layers.add_steps(now_s, end_s, &target.row_w);
            layers.add(end_s, end_s + STORE_S, STORE_W);
            now_s = end_s + STORE_S;
        }
        now_s
    }
}

/// A witness: a tiled renderer whose frames overlap.
///
/// Three units work at once, on different frames: the processor prepares frame n + 2, geometry of n + 1 is binned, tiles of n are
/// shaded. A frame starts where its binning does; that is the event a marker shows. Binning waits for the processor and, as there
/// are two sets of bins, for the shading of the frame before the last. Shading is two to five render targets, each a sequence of
/// tile rows with powers of their own; it waits for the bins. While both run they share memory, and binning is slower. Heavy
/// and light phases of the game move the bottleneck from one unit to another. The rail sees the sum.
fn pipelined(count: usize, seed: u64) -> Drawn {
    let mut dice = Dice::new(seed, PIPELINED, 0);
    let chip = Chip::drawn(&mut dice);
    let rest_w = dice.between(REST_W);
    let (mut layers, mut starts_s) = (Layers::default(), Vec::new());
    let (mut prepared_s, mut binned_s) = (REST_AROUND_S, 0.0);
    // When shading ends, of the last frame and of the one before it.
    let mut shaded_s = [0.0; 2];
    for _ in 0..count {
        let ([prepare_s, prepare_w], swing) = &chip.prepare;
        let from_s = prepared_s;
        prepared_s += prepare_s * swing.at(from_s, &mut dice);
        layers.add(from_s, prepared_s, *prepare_w);
        let start_s = prepared_s.max(binned_s).max(shaded_s[1]);
        starts_s.push(start_s);
        binned_s = chip.bin(&mut layers, start_s, shaded_s[0], &mut dice);
        let end_s = chip.shade(&mut layers, binned_s.max(shaded_s[0]), &mut dice);
        shaded_s = [end_s, shaded_s[0]];
        // It prepares no more than two frames ahead.
        prepared_s = prepared_s.max(shaded_s[1]);
    }
    let until_s = shaded_s[0] + REST_AROUND_S;
    layers.add(0.0, until_s, rest_w);
    Drawn { layers, starts_s, end_s: shaded_s[0], until_s }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_are_in_order_within_the_curve_and_seeds_differ() {
        for witness in WITNESSES {
            for seed in 1..4 {
                let scene = witness.scene(80, seed).unwrap();
                assert_eq!(scene.truth.len(), 80, "{}", witness.name);
                assert!(scene.truth.windows(2).all(|two| two[1].start_s - two[0].start_s > 1e-3));
                assert!(scene.truth.iter().all(|frame| frame.energy_j > 0.0));
                let last = scene.truth.last().unwrap();
                assert!(last.start_s < scene.end_s && scene.end_s < scene.curve.end_s(), "{}", witness.name);
                let other = witness.scene(80, seed + 1).unwrap();
                assert_ne!(scene, other);
                assert_eq!(scene, witness.scene(80, seed).unwrap());
                assert_eq!(scene.record(&witness.recording(seed)).unwrap().lost_samples(), 0);
            }
        }
    }
}
