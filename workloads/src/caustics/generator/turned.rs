//! Twisted beams, as they occur next to a focus.

use glam::DVec3;
use pipeline::random::{mix, unit};

use super::super::Beam;

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
mod tests {
    use super::*;

    #[test]
    fn beams_are_the_same_for_the_same_seed_and_their_sides_cross() {
        let beams = turned_beams(50, 3);
        assert_eq!(beams, turned_beams(50, 3));
        assert_ne!(beams[0], turned_beams(1, 4)[0]);
        assert!(beams.iter().filter(|beam| beam.crossing() > 0.1).count() > 25);
    }
}
