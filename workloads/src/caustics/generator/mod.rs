//! Generators of beams.
//!
//! - [`Ocean`]: light refracted into water by waves; a single wave is a sinusoidal surface with a known
//!   solution.
//! - [`MirrorRing`]: light reflected inside a ring, whose caustic is a nephroid or a cardioid.
//! - [`BallLens`]: light through a ball of glass.
//! - [`turned_beams`]: beams that twist around their axis.

mod lens;
mod mirror;
mod ocean;
mod turned;

pub use lens::BallLens;
pub use mirror::{MirrorRing, Source};
pub use ocean::{Ocean, Wave};
pub use turned::turned_beams;

#[cfg(test)]
pub(in crate::caustics) mod tests {
    use glam::DVec3;
    use pipeline::random::{mix, unit};

    use crate::caustics::{Beam, Hit};

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
}
