//! A witness: one process that renders a game.
//!
//! A frame begins with a short submission by the driver, the same in all scenes of the game. Three to seven passes follow,
//! each with an activity that settles from its first value to its last, as caches fill, and a grain of its own. The camera moves:
//! work and activity of each pass follow a mean-reverting walk. Every few seconds the scene is cut, and later scenes may be
//! earlier ones. A governor looks at the load every tenth of a second and picks one of its clocks, not always
//! the right one. Frames are uncapped, limited to a rate by sleeping, or wait for the display, whose ticks heavy frames miss.

use super::layers::{Dice, Drawn, Layers};

const NAME: &str = "one process";
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
const MEMORY: f64 = 0.97;
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
const DISPLAY_HZ: [f64; 3] = [59.94, 72.0, 90.0];
const SLEEP_S: f64 = 0.22e-3;
/// Before the first and after the last frame, s.
const AROUND_S: f64 = 0.27;

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
        let kick = libm::sqrt(1.0 - MEMORY * MEMORY);
        for (walk, deviation) in self.walk.iter_mut().zip(CAMERA) {
            *walk = MEMORY * *walk + kick * deviation * dice.normal();
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

/// Renders frames.
pub(super) fn frames(count: usize, seed: u64) -> Drawn {
    let mut dice = Dice::new(seed, NAME, 0);
    let [static_w, dynamic_w] = [STATIC_W, DYNAMIC_W].map(|range| dice.between(range));
    let [submit_s, submit] = [SUBMIT_S, SUBMIT_ACTIVITY].map(|range| dice.between(range));
    let work_s = dice.log_between(WORK_S);
    let pace = match dice.between([0.0, 3.0]) as usize {
        0 => Pace::Uncapped,
        1 => Pace::Limited(dice.one_of(&LIMITS_HZ)),
        _ => Pace::Display(dice.one_of(&DISPLAY_HZ)),
    };
    let mut scenes = vec![scene(&mut dice)];
    let (mut shown, mut cut_s) = (0, AROUND_S + dice.between(CUT_S));
    let governor = Dice::new(seed, NAME, 1);
    let mut governor = Governor { dice: governor, place: 0, look_s: AROUND_S + LOOK_S, busy_s: 0.0 };
    let (mut layers, mut starts_s, mut now_s) = (Layers::default(), Vec::new(), AROUND_S);
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
            Pace::Display(hz) => AROUND_S + libm::ceil((now_s + 0.1e-3 - AROUND_S) * hz) / hz,
        };
        governor.after_frame(now_s, busy_s);
    }
    let until_s = now_s + AROUND_S;
    layers.add(0.0, until_s, static_w);
    Drawn { layers, starts_s, end_s: now_s, until_s }
}
