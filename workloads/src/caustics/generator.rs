//! Generators of beams.
//!
//! - [`Ocean`]: light refracted into water by waves; a single wave is a sinusoidal surface with a known
//!   solution.
//! - [`turned_beams`]: beams that twist around their axis.
//! - [`reflect`], [`refract`], [`transmission`]: light at a smooth surface.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use pipeline::Lane;
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

/// A wave of the surface: `amplitude cos(number . (x, z) - rate t + phase)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    /// Amplitude in metres.
    pub amplitude_m: f64,
    /// Wave vector along x and z, in radians per metre.
    pub number: DVec2,
    /// Angular frequency, in radians per second.
    pub rate: f64,
    /// Phase in radians.
    pub phase: f64,
}

/// A square of water over a horizontal floor, centred at the origin, with its mean surface at height 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Ocean {
    /// Squares of two generator triangles along each side.
    pub cells: u32,
    /// Length of a side in metres.
    pub side_m: f64,
    /// Depth of the floor below the mean surface, in metres.
    pub depth_m: f64,
    /// Extension of beams below the floor, as a share of their length, so that the receiver lies within them.
    pub overshoot: f64,
    /// Offset of every other column of corners along its light, as a share of its length, from 0 to below 1.
    /// The light stays the same, but triangles align with it, and their sides cross over a longer part where
    /// they fold.
    pub pleat: f64,
    /// The waves.
    pub waves: Vec<Wave>,
    /// Direction of sunlight, downwards, of unit length.
    pub sun: DVec3,
    /// Irradiance across the light, in watts per square metre.
    pub irradiance: f64,
    /// Refractive index of the water.
    pub index: f64,
}

/// Gravity in metres per second squared, for the wave speed.
const GRAVITY: f64 = 9.81;

impl Ocean {
    /// Water under a low sun, with waves of many lengths and directions. The longest has `longest_m`, the
    /// shortest a third of it; `slope` is the root mean square of the slopes.
    pub fn new(cells: u32, side_m: f64, depth_m: f64, [longest_m, slope]: [f64; 2], seed: u64) -> Self {
        let uniform = |n: u64| unit(mix(mix(seed ^ 0x0CEA) ^ n));
        let waves = (0..WAVES).map(|n| {
            let length_m = longest_m * libm::pow(SHORTEST, n as f64 / (WAVES - 1) as f64);
            let angle = SPREAD * (2.0 * uniform(2 * n) - 1.0);
            let number = TAU / length_m * DVec2::new(libm::cos(angle), libm::sin(angle));
            // Each wave has the same share of the slope, whose mean square is half of the peak's.
            let amplitude_m = slope * libm::sqrt(2.0 / WAVES as f64) / number.length();
            let rate = libm::sqrt(GRAVITY * number.length());
            Wave { amplitude_m, number, rate, phase: TAU * uniform(2 * n + 1) }
        });
        let sun = DVec3::new(0.35, -1.0, 0.2).normalize();
        let (irradiance, index) = (1000.0, 1.33);
        let waves = waves.collect();
        Self { cells, side_m, depth_m, overshoot: 0.0, pleat: 0.0, waves, sun, irradiance, index }
    }

    /// Length of the shortest wave in metres, infinite without waves.
    pub fn shortest_m(&self) -> f64 {
        TAU / self.waves.iter().map(|wave| wave.number.length()).fold(0.0, f64::max)
    }

    /// One beam per generator triangle, at a time in seconds.
    pub fn beams(&self, time_s: f64) -> Vec<Beam> {
        self.beams_of(&self.corners(time_s))
    }

    /// One beam per generator triangle, from the corners of all.
    pub(super) fn beams_of(&self, corners: &[Corner]) -> Vec<Beam> {
        let of_row = |row| (0..2 * self.cells).map(move |number| [number, row]);
        let all = (0..self.cells).flat_map(of_row);
        all.map(|at| {
            let lane = Lane::default();
            self.beam(&lane, self.corners_of(&lane, at).map(|corner| &corners[corner as usize]))
        })
        .collect()
    }

    /// Corners of all triangles, row by row.
    pub(super) fn corners(&self, time_s: f64) -> Vec<Corner> {
        let of_row = |row| (0..=self.cells).map(move |column| [column, row]);
        (0..=self.cells)
            .flat_map(of_row)
            .map(|place| self.corner_at(&Lane::default(), place, time_s))
            .collect()
    }

    /// The corner in a column and a row.
    pub(super) fn corner_at(&self, lane: &Lane, place: [u32; 2], time_s: f64) -> Corner {
        let along = |number: u32| {
            let share = lane.div(lane.number(number), f64::from(self.cells));
            lane.mul(self.side_m, lane.sub(share, 0.5))
        };
        let corner = self.corner(lane, DVec2::from_array(place.map(along)), time_s);
        let is_moved = self.pleat != 0.0 && lane.branch(lane.and(place[0], 1) == 1);
        if is_moved { corner.pleated(lane, self.pleat) } else { corner }
    }

    /// Numbers of the corners of triangle `number` of a row, two of each square.
    pub(super) fn corners_of(&self, lane: &Lane, [number, row]: [u32; 2]) -> [u32; 3] {
        let side = self.cells + 1;
        let (half, column) = (lane.and(number, 1), lane.shift_right(number, 1));
        let first = lane.madd(row, side, column);
        [lane.add(first, half), lane.add(first, side), lane.madd(half, side, lane.add(first, 1))]
    }

    /// Light that enters at a position of the square, refracted at the true waves instead of triangles:
    /// start, end, and watts per square metre of the square.
    pub fn ray(&self, at: DVec2, time_s: f64) -> ([DVec3; 2], f64) {
        let lane = Lane::default();
        let (_, slope) = self.surface(&lane, at, time_s);
        let corner = self.corner(&lane, at, time_s);
        let upward = DVec3::new(-slope.x, 1.0, -slope.y);
        ([corner.position, corner.end], -self.irradiance * upward.dot(self.sun) * corner.enters)
    }

    /// Height of the surface, and its slopes along x and z.
    fn surface(&self, lane: &Lane, at: DVec2, time_s: f64) -> (f64, DVec2) {
        self.waves.iter().fold((0.0, DVec2::ZERO), |(height, slope), wave| {
            let along = lane.madd(wave.number.x, at.x, lane.mul(wave.number.y, at.y));
            let angle = lane.add(lane.madd(-wave.rate, time_s, along), wave.phase);
            let height = lane.madd(wave.amplitude_m, lane.cos(angle), height);
            let down = lane.mul(-wave.amplitude_m, lane.sin(angle));
            let [x, y] = [0, 1].map(|axis| lane.madd(down, wave.number[axis], slope[axis]));
            (height, DVec2::new(x, y))
        })
    }

    fn corner(&self, lane: &Lane, at: DVec2, time_s: f64) -> Corner {
        let (height, slope) = self.surface(lane, at, time_s);
        let normal = lane.normalize(DVec3::new(-slope.x, 1.0, -slope.y));
        let (position, ratio) = (DVec3::new(at.x, height, at.y), 1.0 / self.index);
        // Refraction into the denser medium always has a solution.
        let direction = refract(lane, self.sun, normal, ratio).unwrap_or(self.sun);
        let cosines = [-lane.dot(self.sun, normal), -lane.dot(direction, normal)];
        let enters = transmission(lane, cosines, ratio);
        let length = lane.div(lane.add(height, self.depth_m), -direction.y);
        let length = lane.mul(length, 1.0 + self.overshoot);
        let end = lane.madd(direction, DVec3::splat(length), position);
        Corner { position, start: position, end, enters }
    }

    /// The beam between three corners.
    pub(super) fn beam(&self, lane: &Lane, corners: [&Corner; 3]) -> Beam {
        let [a, b, c] = corners.map(|corner| corner.enters);
        let enters = lane.div(lane.add(lane.add(a, b), c), 3.0);
        let flux_w = lane.mul(self.on(lane, &corners.map(|corner| corner.position)), enters);
        Beam { open: corners.map(|corner| corner.start), close: corners.map(|corner| corner.end), flux_w }
    }

    /// Flux of the light that hits a triangle.
    fn on(&self, lane: &Lane, [a, b, c]: &[DVec3; 3]) -> f64 {
        let area = lane.mul(DVec3::splat(0.5), lane.cross(lane.sub(*b, *a), lane.sub(*c, *a)));
        lane.mul(self.irradiance, -lane.dot(area, self.sun))
    }
}

/// Number of waves.
const WAVES: u64 = 12;
/// Length of the shortest wave relative to the longest.
const SHORTEST: f64 = 1.0 / 3.0;
/// Largest angle of a wave from the x axis, in radians.
const SPREAD: f64 = 1.2;

/// Where light enters the water.
pub(super) struct Corner {
    /// Position on the surface.
    pub position: DVec3,
    /// Start of the beam.
    pub start: DVec3,
    /// Its end.
    pub end: DVec3,
    /// Transmitted share of light.
    pub enters: f64,
}

impl Corner {
    fn pleated(self, lane: &Lane, pleat: f64) -> Self {
        let [before, after] = [1.0 - pleat, pleat].map(DVec3::splat);
        Self { start: lane.madd(self.end, after, lane.mul(self.position, before)), ..self }
    }
}

/// Direction of a reflected ray. `incoming` and `normal` have unit length.
pub fn reflect(incoming: DVec3, normal: DVec3) -> DVec3 {
    incoming - 2.0 * incoming.dot(normal) * normal
}

/// Direction of a refracted ray (Snell); `None` for total reflection. `normal` points against `incoming`,
/// both of unit length. `ratio` is the refractive index on this side over that on the other.
pub fn refract(lane: &Lane, incoming: DVec3, normal: DVec3, ratio: f64) -> Option<DVec3> {
    let cos_in = -lane.dot(incoming, normal);
    let cos_out_squared = lane.madd(-(ratio * ratio), lane.madd(-cos_in, cos_in, 1.0), 1.0);
    lane.branch(cos_out_squared >= 0.0).then(|| {
        let along = lane.sub(lane.mul(ratio, cos_in), lane.root(cos_out_squared));
        lane.madd(normal, DVec3::splat(along), lane.mul(DVec3::splat(ratio), incoming))
    })
}

/// Share of unpolarized light that is transmitted (Fresnel), for the cosines of the angles of incidence and of
/// refraction and the ratio of [`refract`].
pub fn transmission(lane: &Lane, [cos_in, cos_out]: [f64; 2], ratio: f64) -> f64 {
    let reflected = |a: f64, b: f64| {
        let a = lane.mul(ratio, a);
        lane.div(lane.sub(a, b), lane.add(a, b))
    };
    let (across, along) = (reflected(cos_in, cos_out), reflected(cos_out, cos_in));
    lane.madd(-0.5, lane.madd(across, across, lane.mul(along, along)), 1.0)
}

#[cfg(test)]
pub(in crate::caustics) mod tests {
    use pipeline::random::SplitMix;

    use super::*;
    use crate::caustics::Hit;

    /// Uniform numbers.
    pub fn uniform(seed: u64) -> SplitMix {
        SplitMix::new(mix(seed ^ 0xCA05_71C5))
    }

    /// A random position in a beam.
    pub fn hit(random: &mut SplitMix) -> Hit {
        let (mut b, mut c) = (random.next_unit(), random.next_unit());
        if b + c > 1.0 {
            (b, c) = (1.0 - b, 1.0 - c);
        }
        Hit { weights: [1.0 - b - c, b, c], t: random.next_unit() }
    }

    /// A beam along z whose directions vary by up to `warp`.
    pub fn warped(random: &mut SplitMix, warp: f64) -> Beam {
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
    pub fn turned(random: &mut SplitMix) -> Beam {
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

    /// Flux of the light on the triangles, before reflection.
    fn incoming_w(ocean: &Ocean, time_s: f64) -> f64 {
        let level = Ocean { pleat: 0.0, ..ocean.clone() };
        level.beams(time_s).iter().map(|beam| ocean.on(&Lane::default(), &beam.open)).sum()
    }

    #[test]
    fn incoming_flux_is_that_of_the_square() {
        let mut ocean = Ocean::new(96, 12.0, 5.0, [3.0, 0.2], 1);
        ocean.sun = DVec3::NEG_Y;
        let flat = ocean.irradiance * ocean.side_m * ocean.side_m;
        assert!(
            (incoming_w(&ocean, 0.7) - flat).abs() < 1e-9 * flat,
            "straight from above, whatever the waves"
        );
        let entered: f64 = ocean.beams(0.7).iter().map(|beam| beam.flux_w).sum();
        assert!(entered < 0.98 * flat && entered > 0.95 * flat, "{entered} of {flat}");
    }

    #[test]
    fn offset_corners_keep_the_light_and_cross_sides() {
        let flat = Ocean { overshoot: 0.25, ..Ocean::new(16, 16.0, 8.0, [4.0, 0.3], 1) };
        let crossing = |ocean: &Ocean| crate::caustics::crossing(&ocean.beams(0.3));
        let mut last = crossing(&flat);
        for pleat in [0.1, 0.3, 0.5] {
            let pleated = Ocean { pleat, ..flat.clone() };
            assert_eq!(incoming_w(&pleated, 0.3), incoming_w(&flat, 0.3));
            for (a, b) in pleated.beams(0.3).iter().zip(flat.beams(0.3)) {
                assert_eq!((a.close, a.flux_w), (b.close, b.flux_w));
                let aside = |k: usize| (a.open[k] - b.open[k]).cross(b.path(k)).length();
                assert!((0..3).all(|k| aside(k) < 1e-9), "corners stay on their light");
            }
            let crossed = crossing(&pleated);
            assert!(crossed > last + 0.005, "{pleat}: {crossed} {last}");
            last = crossed;
        }
    }

    #[test]
    fn rays_carry_what_the_triangles_carry() {
        let ocean = Ocean::new(96, 12.0, 5.0, [3.0, 0.2], 1);
        let entered: f64 = ocean.beams(0.7).iter().map(|beam| beam.flux_w).sum();
        let side = 400;
        let at = |n: i32| ocean.side_m * ((f64::from(n) + 0.5) / f64::from(side) - 0.5);
        let rays = (0..side * side).map(|n| ocean.ray(DVec2::new(at(n % side), at(n / side)), 0.7).1);
        let sum = rays.sum::<f64>() * (ocean.side_m / f64::from(side)).powi(2);
        assert!((sum / entered - 1.0).abs() < 1e-3, "{sum} {entered}");
    }

    #[test]
    fn slopes_are_as_requested() {
        let ocean = Ocean::new(4, 12.0, 5.0, [3.0, 0.2], 9);
        let uniform = |n: u64| unit(mix(n));
        let count = 20_000;
        let squares = (0..count).map(|n| {
            let at = DVec2::new(1000.0 * uniform(2 * n), 1000.0 * uniform(2 * n + 1));
            ocean.surface(&Lane::default(), at, 0.0).1.length_squared()
        });
        let rms = (squares.sum::<f64>() / count as f64).sqrt();
        assert!((rms - 0.2).abs() < 0.004, "{rms}");
    }

    /// A sinusoidal surface under vertical light. The first cusp is under the crests, at `1 / ((1 - 1/n) A
    /// k^2)` for small slopes.
    #[test]
    fn one_wave_focuses_at_the_closed_form() {
        let (amplitude_m, number) = (0.002, TAU / 1.0);
        let depth = 1.0 / ((1.0 - 1.0 / 1.33) * amplitude_m * number * number);
        let wave = Wave { amplitude_m, number: DVec2::new(number, 0.0), rate: 0.0, phase: 0.0 };
        let mut ocean = Ocean::new(400, 1.0, 2.0 * depth, [1.0, 0.1], 1);
        (ocean.waves, ocean.sun) = (vec![wave], DVec3::NEG_Y);
        let beams = ocean.beams(0.0);
        let focuses = |beam: &Beam| {
            let t = beam.folds(&Lane::default()).first().copied()?;
            Some(t * (2.0 * depth + amplitude_m))
        };
        let first = beams.iter().filter_map(focuses).fold(f64::INFINITY, f64::min);
        assert!((first / depth - 1.0).abs() < 0.002, "{first} {depth}");
        // Light diverges under the troughs.
        let trough = beams.iter().filter(|beam| beam.open.iter().all(|p| (p.x.abs() - 0.5).abs() < 0.1));
        assert!(
            trough.clone().count() > 100
                && trough.into_iter().all(|beam| beam.folds(&Lane::default()).is_empty())
        );
    }

    #[test]
    fn refraction_follows_snell_and_stays_in_the_plane() {
        let normal = DVec3::Y;
        for degrees in [0.0_f64, 20.0, 45.0, 80.0] {
            let angle = degrees.to_radians();
            let incoming = DVec3::new(angle.sin(), -angle.cos(), 0.0);
            let out = refract(&Lane::default(), incoming, normal, 1.0 / 1.33).unwrap();
            assert!((out.length() - 1.0).abs() < 1e-12 && out.z == 0.0);
            assert!((1.33 * out.x - incoming.x).abs() < 1e-12, "{degrees}");
            assert!((reflect(incoming, normal) - DVec3::new(incoming.x, -incoming.y, 0.0)).length() < 1e-15);
        }
        let grazing = DVec3::new(0.9, -(1.0_f64 - 0.81).sqrt(), 0.0);
        assert!(
            refract(&Lane::default(), grazing, normal, 1.33).is_none(),
            "beyond the critical angle all is reflected"
        );
    }

    #[test]
    fn transmission_follows_fresnel() {
        // Normal incidence: 4 n1 n2 / (n1 + n2)^2. At Brewster's angle the light polarized along the plane is
        // transmitted completely.
        assert!((transmission(&Lane::default(), [1.0, 1.0], 1.0 / 1.5) - 0.96).abs() < 1e-12);
        let brewster = 1.5_f64.atan();
        let (cos_in, cos_out) = (brewster.cos(), brewster.sin());
        let across = ((1.0 / 1.5 * cos_in - cos_out) / (1.0 / 1.5 * cos_in + cos_out)).powi(2);
        assert!(
            (transmission(&Lane::default(), [cos_in, cos_out], 1.0 / 1.5) - (1.0 - 0.5 * across)).abs()
                < 1e-12
        );
        // Transmission is the same in both directions.
        assert!(
            (transmission(&Lane::default(), [0.8, 0.9], 1.0 / 1.2)
                - transmission(&Lane::default(), [0.9, 0.8], 1.2))
            .abs()
                < 1e-12,
            "the same for both directions"
        );
    }
}
