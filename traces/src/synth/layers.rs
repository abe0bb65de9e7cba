//! What the devices of [`HELD_OUT_DEVICES`](super::HELD_OUT_DEVICES) are made with: power as a sum of spans, and random
//! numbers. Two of them: an interface that draws on demand, and a renderer whose frames overlap.

use crate::stats::Random;
use crate::{Curve, CurveBuilder, CurveError};
use core::f64::consts::TAU;

/// What a device has drawn.
pub(super) struct Drawn {
    /// Power.
    pub layers: Layers,
    /// Starts of the frames, s.
    pub starts_s: Vec<f64>,
    /// End of the last frame, and of the curve, s.
    pub end_s: f64,
    pub until_s: f64,
}

/// Power as a sum of spans of constant power, some of them of processes that overlap.
#[derive(Default)]
pub(super) struct Layers {
    /// Times, s, and the change of power there, W.
    steps: Vec<[f64; 2]>,
}

impl Layers {
    /// Adds power over a span; a span of no length adds nothing.
    pub fn add(&mut self, from_s: f64, to_s: f64, watts: f64) {
        if to_s > from_s {
            self.steps.extend([[from_s, watts], [to_s, -watts]]);
        }
    }

    /// Adds the same number of equal spans as there are values.
    pub fn add_steps(&mut self, from_s: f64, to_s: f64, watts: &[f64]) {
        let part_s = (to_s - from_s) / watts.len().max(1) as f64;
        for (part, &watts) in watts.iter().enumerate() {
            let part = part as f64;
            self.add(from_s + part * part_s, from_s + (part + 1.0) * part_s, watts);
        }
    }

    pub fn curve(mut self, until_s: f64) -> Result<Curve, CurveError> {
        self.steps.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut builder = CurveBuilder::new(0.0)?;
        let mut watts = 0.0;
        for [time_s, change_w] in self.steps {
            let time_s = time_s.min(until_s);
            if time_s > builder.now_s() {
                // Sums of many spans round to a trifle below nothing.
                builder.push(time_s - builder.now_s(), f64::max(watts, 0.0))?;
            }
            watts += change_w;
        }
        builder.build()
    }
}

/// Random numbers, one after another.
pub(super) struct Dice {
    random: Random,
    drawn: u64,
}

impl Dice {
    /// A stream for one purpose of one device.
    pub fn new(seed: u64, device: &str, purpose: u64) -> Self {
        let device = device.bytes().fold(0, |sum: u64, byte| sum.wrapping_mul(257).wrapping_add(byte.into()));
        Self { random: Random::new(seed, device.wrapping_add(purpose)), drawn: 0 }
    }

    fn next(&mut self) -> u64 {
        self.drawn += 1;
        self.drawn
    }

    pub fn between(&mut self, range: [f64; 2]) -> f64 {
        let place = self.next();
        self.random.between(place, range)
    }

    /// Between two positive numbers, evenly in the logarithm.
    pub fn log_between(&mut self, [low, high]: [f64; 2]) -> f64 {
        libm::exp(self.between([libm::log(low), libm::log(high)]))
    }

    pub fn normal(&mut self) -> f64 {
        // Normal numbers take two even ones each: two streams of counters that do not meet.
        let place = self.next();
        self.random.normals((1 << 40) + place).0
    }

    pub fn chance(&mut self, share: f64) -> bool {
        self.between([0.0, 1.0]) < share
    }

    /// Exponential, of this mean.
    pub fn waiting(&mut self, mean: f64) -> f64 {
        -mean * libm::log(self.between([0.0, 1.0]))
    }

    /// One of a list; the first of an empty one is its default.
    pub fn one_of<T: Copy + Default>(&mut self, list: &[T]) -> T {
        let place = self.between([0.0, list.len() as f64]) as usize;
        list.get(place).copied().unwrap_or_default()
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

/// A held-out device: an interface that draws on demand.
///
/// Nothing is drawn while nothing changes. A touch starts a run of frames at the rate of the display, some of
/// which are late; a cursor or a clock draws a single one. What is drawn is anything from a small area to the
/// whole screen, so the longest frame takes ten times as long as the shortest. All frames begin with the same
/// traversal of the view tree and end with the same hand-over; in between areas are filled. The processor
/// polls for a while after the last frame, dozes, and sleeps; from sleep it wakes up by a ramp.
pub(super) fn on_demand(count: usize, seed: u64) -> Drawn {
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

/// A held-out device: a tiled renderer whose frames overlap.
///
/// Three units work at once, on different frames: the processor prepares frame n + 2, geometry of n + 1 is
/// binned, tiles of n are shaded. A frame starts where its binning does; that is the event a marker shows.
/// Binning waits for the processor and, as there are two sets of bins, for the shading of the frame before
/// the last. Shading is two to five render targets, each a sequence of tile rows with powers of their own; it
/// waits for the bins. While both run they share memory, and binning is slower. Heavy and light phases of the
/// game move the bottleneck from one unit to another. The rail sees the sum.
pub(super) fn pipelined(count: usize, seed: u64) -> Drawn {
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
    fn overlapping_spans_add_up() {
        let mut layers = Layers::default();
        layers.add(0.0, 4.0, 1.0);
        layers.add(1.0, 3.0, 2.0);
        layers.add_steps(2.0, 4.0, &[0.5, 0.25]);
        let curve = layers.curve(4.0).unwrap();
        let at = |time_s| curve.power_at(time_s);
        assert_eq!([at(0.5), at(1.5), at(2.5), at(3.5)], [1.0, 3.0, 3.5, 1.25]);
        assert!((curve.energy_j(0.0, 4.0) - 8.75).abs() < 1e-12);
    }
}
