//! A witness: a tiled renderer whose frames overlap.
//!
//! Three units work at once, on different frames: the processor prepares frame n + 2, geometry of n + 1 is binned, tiles of n are
//! shaded. A frame starts where its binning does; that is the event a marker shows. Binning waits for the processor and, as there
//! are two sets of bins, for the shading of the frame before the last. Shading is two to five render targets, each a sequence of
//! tile rows with powers of their own; it waits for the bins. While both run they share memory, and binning is slower. Heavy
//! and light phases of the game move the bottleneck from one unit to another. The rail sees the sum.

use super::layers::{Dice, Drawn, Layers};
use core::f64::consts::TAU;

const NAME: &str = "pipelined";
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
const AROUND_S: f64 = 0.22;

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

/// Draws frames.
pub(super) fn frames(count: usize, seed: u64) -> Drawn {
    let mut dice = Dice::new(seed, NAME, 0);
    let chip = Chip::drawn(&mut dice);
    let rest_w = dice.between(REST_W);
    let (mut layers, mut starts_s) = (Layers::default(), Vec::new());
    let (mut prepared_s, mut binned_s) = (AROUND_S, 0.0);
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
    let until_s = shaded_s[0] + AROUND_S;
    layers.add(0.0, until_s, rest_w);
    Drawn { layers, starts_s, end_s: shaded_s[0], until_s }
}
