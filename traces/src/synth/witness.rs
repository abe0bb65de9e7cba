//! Four devices of different structure that bear witness of the frame finder: what works on the scenes of one generator may
//! have been learnt from it.
//!
//! Each is written as a description of how such a device behaves, with constants of its own, before any finder was
//! scored on it. They share only how spans of power are added up ([`Layers`](super::layers::Layers)) and how numbers are drawn ([`Dice`](super::layers::Dice)).
//! A seed makes another device of the same kind: most quantities are drawn anew with it.

use super::layers::Drawn;
use super::{Recording, Scene, on_demand, one_process, pipelined, several_processes};
use crate::CurveError;
use crate::energy::TrueFrame;

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
        make: one_process::frames,
    },
    Witness {
        name: "several processes",
        about: "an application, the compositor, sound, radio and a pulsed backlight on one rail",
        recorder: Recording { rate_hz: 40e3, bits: 12, snr_db: 22.0, seed: 0 },
        make: several_processes::frames,
    },
    Witness {
        name: "on demand",
        about: "an interface that draws while something moves and sleeps between",
        recorder: Recording { rate_hz: 25e3, bits: 12, snr_db: 28.0, seed: 0 },
        make: on_demand::frames,
    },
    Witness {
        name: "pipelined",
        about: "a tiler that bins the next frame and simulates the one after while it shades",
        recorder: Recording { rate_hz: 100e3, bits: 13, snr_db: 20.0, seed: 0 },
        make: pipelined::frames,
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
