//! A witness: several processes on one rail.
//!
//! An application draws a frame for each tick of the display, or for each second one, and misses some. It waits for the tick plus a
//! wake-up that differs. Its frames are layers of an interface: a number of rectangles, each a level of power; one layer in four
//! is an animation, whose level swings. On the same rail the compositor works at every tick, with a phase of its own; sound is
//! decoded a buffer at a time; a radio listens at its interval and now and then transfers for longer; the backlight
//! is pulsed at a rate that has nothing to do with any of them.

use super::layers::{Dice, Drawn, Layers};
use core::f64::consts::TAU;

const NAME: &str = "several processes";
/// The board, W.
const BOARD_W: [f64; 2] = [0.9, 1.8];
/// The display, Hz, and how many of its ticks a frame is shown for.
const DISPLAY_HZ: [f64; 4] = [48.0, 60.0, 60.3, 85.0];
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
const AROUND_S: f64 = 0.35;

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

/// Draws frames.
pub(super) fn frames(count: usize, seed: u64) -> Drawn {
    let mut dice = Dice::new(seed, NAME, 0);
    let tick_s = 1.0 / dice.one_of(&DISPLAY_HZ);
    let every = dice.one_of(&TICKS);
    let layer_count = dice.between(LAYERS) as usize;
    let interface: Vec<Layer> = (0..layer_count).map(|_| Layer::drawn(&mut dice)).collect();
    let shares: f64 = interface.iter().map(|layer| layer.share).sum();
    let busy_s = every * tick_s * dice.between(BUSY);
    let (mut layers, mut starts_s, mut tick) = (Layers::default(), Vec::new(), 0.0);
    for _ in 0..count {
        let mut now_s = AROUND_S + tick * tick_s + dice.between(WAKE_S);
        starts_s.push(now_s);
        for layer in &interface {
            let length_s = busy_s * layer.share / shares * (1.0 + LAYER_UNEVEN * dice.normal()).max(0.5);
            layers.add(now_s, now_s + length_s, layer.watts_at(now_s));
            now_s += length_s;
        }
        tick += every + f64::from(u8::from(dice.chance(MISSES)));
    }
    let end_s = AROUND_S + tick * tick_s;
    let until_s = end_s + AROUND_S;
    layers.add(0.0, until_s, dice.between(BOARD_W));
    compose(&mut layers, tick_s, until_s, seed);
    sound(&mut layers, until_s, seed);
    radio(&mut layers, until_s, seed);
    backlight(&mut layers, until_s, seed);
    Drawn { layers, starts_s, end_s, until_s }
}

fn compose(layers: &mut Layers, tick_s: f64, until_s: f64, seed: u64) {
    let mut dice = Dice::new(seed, NAME, 1);
    let at_s = AROUND_S % tick_s + dice.between(COMPOSE_AT_S) % tick_s;
    let [length_s, watts] = [COMPOSE_S, COMPOSE_W].map(|range| dice.between(range));
    let mut now_s = at_s;
    while now_s < until_s {
        layers.add(now_s, now_s + length_s * dice.between([0.9, 1.1]), watts);
        now_s += tick_s;
    }
}

fn sound(layers: &mut Layers, until_s: f64, seed: u64) {
    let mut dice = Dice::new(seed, NAME, 2);
    let buffer_s = dice.one_of(&BUFFER_S);
    let watts = dice.between(DECODE_W);
    let mut now_s = dice.between([0.0, buffer_s]);
    while now_s < until_s {
        layers.add(now_s, now_s + dice.between(DECODE_S), watts);
        now_s += buffer_s;
    }
}

fn radio(layers: &mut Layers, until_s: f64, seed: u64) {
    let mut dice = Dice::new(seed, NAME, 3);
    let watts = dice.between(RADIO_W);
    let mut now_s = dice.between([0.0, LISTEN_EVERY_S]);
    while now_s < until_s {
        let length_s = if dice.chance(TRANSFERS) { dice.between(TRANSFER_S) } else { LISTEN_S };
        layers.add(now_s, now_s + length_s, watts);
        now_s += LISTEN_EVERY_S;
    }
}

fn backlight(layers: &mut Layers, until_s: f64, seed: u64) {
    let mut dice = Dice::new(seed, NAME, 4);
    let period_s = 1.0 / dice.log_between(BACKLIGHT_HZ);
    let [lit, watts] = [LIT, BACKLIGHT_W].map(|range| dice.between(range));
    let mut now_s = dice.between([0.0, period_s]);
    while now_s < until_s {
        layers.add(now_s, now_s + lit * period_s, watts);
        now_s += period_s;
    }
}
