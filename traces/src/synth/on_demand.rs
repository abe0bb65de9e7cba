//! A witness: an interface that draws on demand.
//!
//! Nothing is drawn while nothing changes. A touch starts a run of frames at the rate of the display, some of which are late; a
//! cursor or a clock draws a single one. What is drawn is anything from a small area to the whole screen, so the longest
//! frame takes ten times as long as the shortest. All frames begin with the same traversal of the view tree and end with
//! the same hand-over; in between areas are filled. The processor polls for a while after the last frame, dozes, and sleeps; from sleep it
//! wakes up by a ramp.

use super::layers::{Dice, Drawn, Layers};

const NAME: &str = "on demand";
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
const AROUND_S: f64 = 0.4;

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
        let mut dice = Dice::new(seed, NAME, 0);
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

/// Draws frames.
pub(super) fn frames(count: usize, seed: u64) -> Drawn {
    let mut interface = Interface::new(seed);
    let tick_s = 1.0 / interface.dice.one_of(&DISPLAY_HZ);
    let (mut starts_s, mut now_s) = (Vec::new(), AROUND_S);
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
    let until_s = end_s + AROUND_S;
    interface.idle_until(until_s);
    Drawn { layers: interface.layers, starts_s, end_s, until_s }
}
