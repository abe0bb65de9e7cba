//! Generators of beams.
//!
//! - [`Ocean`]: light refracted into water by waves; a single wave is a sinusoidal surface with a known
//!   solution.
//! - [`turned_beams`]: beams that twist around their axis.

mod ocean;

pub use ocean::{Ocean, Wave};

use glam::DVec3;
use pipeline::random::{mix, unit};

use super::Beam;

/// Range of the twist, in radians.
const TURN: [f64; 2] = [2.5, 3.8];
/// Largest rise or fall of an end corner, in metres.
const REACH_M: f64 = 0.3;

/// Makes `count` beams that start at height 0, within a metre of the y axis, and twist by about 180 degrees
/// while rising or falling by up to 0.3 m. Their sides cross, and they may contain a point three times.
pub fn turned_beams(count: u32, seed: u64) -> Vec<Beam> {
    let turned = |number: u32| {
        let uniform = |n: u64, [low, high]: [f64; 2]| {
            low + (high - low) * unit(mix(mix(seed ^ u64::from(number) << 8) ^ n))
        };
        let (sin, cos) = libm::sincos(uniform(0, TURN));
        let open =
            [0, 1, 2].map(|k| DVec3::new(uniform(1 + k, [-1.0, 1.0]), 0.0, uniform(4 + k, [-1.0, 1.0])));
        let height = [0, 1, 2].map(|k| uniform(7 + k, [-REACH_M, REACH_M]));
        let close = [0, 1, 2].map(|k| {
            let p = open[k];
            DVec3::new(cos * p.x - sin * p.z, height[k], sin * p.x + cos * p.z)
        });
        Beam { open, close, flux_w: 1.0 }
    };
    (0..count).map(turned).collect()
}

#[cfg(test)]
pub(in crate::caustics) mod tests {
    use super::*;
    use crate::caustics::Hit;

    /// Counter-based uniform numbers.
    pub struct Uniform(u64);

    impl Uniform {
        pub fn new(seed: u64) -> Self {
            Self(mix(seed ^ 0xCA05_71C5))
        }

        pub fn within(&mut self, low: f64, high: f64) -> f64 {
            self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
            low + (high - low) * unit(mix(self.0))
        }

        /// A random position in a beam.
        pub fn hit(&mut self) -> Hit {
            let (mut b, mut c) = (self.within(0.0, 1.0), self.within(0.0, 1.0));
            if b + c > 1.0 {
                (b, c) = (1.0 - b, 1.0 - c);
            }
            Hit { weights: [1.0 - b - c, b, c], t: self.within(0.0, 1.0) }
        }
    }

    /// A beam along z whose directions vary by up to `warp`.
    pub fn warped(random: &mut Uniform, warp: f64) -> Beam {
        let open = [0; 3].map(|_| DVec3::new(random.within(-1.0, 1.0), random.within(-1.0, 1.0), 0.0));
        let (lean, length) = ([random.within(-0.3, 0.3), random.within(-0.3, 0.3)], random.within(1.5, 3.0));
        let close = open.map(|p| {
            let across = lean.map(|lean| lean + random.within(-warp, warp));
            let short = 1.0 - 0.2 * warp.min(1.0) * random.within(0.0, 1.0);
            p + length * short * DVec3::new(across[0], across[1], 1.0)
        });
        Beam { open, close, flux_w: 1.0 }
    }

    /// A short beam that twists by about 180 degrees, so that its sides cross.
    pub fn turned(random: &mut Uniform) -> Beam {
        let open = [0; 3].map(|_| DVec3::new(random.within(-1.0, 1.0), random.within(-1.0, 1.0), 0.0));
        let (sin, cos) = random.within(2.5, 3.8).sin_cos();
        let close =
            open.map(|p| DVec3::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, random.within(-0.3, 0.3)));
        Beam { open, close, flux_w: 1.0 }
    }

    #[test]
    fn beams_are_the_same_for_the_same_seed_and_their_sides_cross() {
        let beams = turned_beams(50, 3);
        assert_eq!(beams, turned_beams(50, 3));
        assert_ne!(beams[0], turned_beams(1, 4)[0]);
        assert!(beams.iter().filter(|beam| beam.crossing() > 0.1).count() > 25);
    }
}
