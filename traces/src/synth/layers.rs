//! What the devices of [`WITNESSES`](super::WITNESSES) are made with: power as a sum of spans, and random numbers.

use crate::random::Random;
use crate::{Curve, CurveBuilder, CurveError};

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
