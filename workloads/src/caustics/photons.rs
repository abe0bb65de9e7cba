//! Light by random rays, as a reference. It shares no code with the rasterization of beams.

use glam::{DVec2, DVec3};
use pipeline::random::{mix, unit};
use rayon::prelude::*;

use super::generator::Ocean;
use super::{Beam, Eye, Floor};

/// Squares of pixels that light is summed in, row by row from the top left.
#[derive(Clone, Copy, Debug)]
pub struct Squares<'a> {
    /// View of the image.
    pub eye: &'a Eye,
    /// Pixels along a side of a square. Squares at the right and bottom may be smaller.
    pub side_px: u32,
}

/// Groups of photons, each with its own sums.
const GROUPS: u32 = 32;

impl Squares<'_> {
    /// Number of squares across and down.
    pub fn size(&self) -> [usize; 2] {
        let viewport = self.eye.viewport();
        [viewport.width(), viewport.height()].map(|side| side.div_ceil(self.side_px) as usize)
    }

    /// Sums of an image's light, times the area of a pixel in square metres.
    pub fn of_image(&self, light: &[f64]) -> Vec<f64> {
        let (width, side) = (self.eye.viewport().width() as usize, self.side_px as usize);
        let [columns, rows] = self.size();
        let mut sums = vec![0.0; columns * rows];
        let pixel_m2 = (self.eye.scale_px() * self.eye.scale_px()).recip();
        for (place, light) in light.iter().enumerate() {
            sums[place / width / side * columns + place % width / side] += light * pixel_m2;
        }
        sums
    }

    /// Light of `rays` by `rays` rays on the floor, in watts. One ray starts at a random position in each
    /// small square of the water, and is refracted at the true waves.
    pub fn on_floor(&self, ocean: &Ocean, time_s: f64, floor: &Floor, [rays, seed]: [u32; 2]) -> Vec<f64> {
        let step_m = ocean.side_m / f64::from(rays);
        self.sum(|group, sums| {
            for n in (group..rays).step_by(GROUPS as usize).flat_map(|row| (0..rays).map(move |x| [x, row])) {
                let number = u64::from(n[1]) * u64::from(rays) + u64::from(n[0]);
                let inside = uniform::<2>(u64::from(seed), number);
                let at = [0, 1].map(|k| (f64::from(n[k]) + inside[k]) * step_m - 0.5 * ocean.side_m);
                let ([from, to], watts_m2) = ocean.ray(DVec2::from_array(at), time_s);
                let t = (floor.height_m - from.y) / (to.y - from.y);
                self.add(sums, from.lerp(to, t), watts_m2 * step_m * step_m);
            }
        })
    }

    /// Light of beams in the volume, in watts times metres. Each beam gets `photons` rays, interpolated
    /// between its corners, and each ray one random position that represents its whole length. The positions
    /// are an additive recurrence (Roberts 2018, "The unreasonable effectiveness of quasirandom sequences"),
    /// shifted randomly per beam.
    pub fn in_volume(&self, beams: &[Beam], photons: u32) -> Vec<f64> {
        self.sum(|group, sums| {
            for (number, beam) in (0..).zip(beams).skip(group as usize).step_by(GROUPS as usize) {
                let turned = uniform::<3>(0, number);
                for photon in 0..photons {
                    let at = |k: usize| (turned[k] + f64::from(photon + 1) * RECURRENCE[k]).fract();
                    let ([b, c], t) = (folded([at(0), at(1)]), at(2));
                    let [from, to] =
                        [&beam.open, &beam.close].map(|x| x[0] * (1.0 - b - c) + x[1] * b + x[2] * c);
                    let light = beam.flux_w * (to - from).length() / f64::from(photons);
                    self.add(sums, from.lerp(to, t), light);
                }
            }
        })
    }

    fn add(&self, sums: &mut [f64], point: DVec3, light: f64) {
        let viewport = self.eye.viewport();
        let place = self.eye.image(point);
        let [x, y] = [
            (place.x + 0.5 * f64::from(viewport.width())).floor(),
            (place.y + 0.5 * f64::from(viewport.height())).floor(),
        ];
        let inside = |at: f64, side: u32| (0.0..f64::from(side)).contains(&at);
        if inside(x, viewport.width()) && inside(y, viewport.height()) {
            let [column, row] = [x, y].map(|at| (at as u32 / self.side_px) as usize);
            sums[row * self.size()[0] + column] += light;
        }
    }

    /// Sums all groups in order, independent of threads.
    fn sum(&self, group: impl Fn(u32, &mut [f64]) + Sync) -> Vec<f64> {
        let [columns, rows] = self.size();
        let one = |number: u32| {
            let mut sums = vec![0.0; columns * rows];
            group(number, &mut sums);
            sums
        };
        let groups: Vec<Vec<f64>> = (0..GROUPS).into_par_iter().map(one).collect();
        (0..columns * rows).map(|place| groups.iter().map(|sums| sums[place]).sum()).collect()
    }
}

/// Mean absolute difference of `found` from `known`, relative to the mean of `known`.
pub fn error(found: &[f64], known: &[f64]) -> f64 {
    let apart: f64 = found.iter().zip(known).map(|(a, b)| (a - b).abs()).sum();
    apart / known.iter().sum::<f64>()
}

/// Powers of the inverse root of `x^4 = x + 1`.
const RECURRENCE: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_3];

/// Folds the upper right half of the unit square onto the lower left.
fn folded([b, c]: [f64; 2]) -> [f64; 2] {
    if b + c > 1.0 { [1.0 - b, 1.0 - c] } else { [b, c] }
}

fn uniform<const D: usize>(seed: u64, number: u64) -> [f64; D] {
    let first = mix(mix(seed ^ 0xF107) ^ number);
    std::array::from_fn(|k| unit(mix(first.wrapping_add(k as u64))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn above(pixels: u32) -> Eye {
        Eye::new([10.0 * DVec3::Y, DVec3::ZERO, DVec3::NEG_Z], 8.0, [pixels; 2]).unwrap()
    }

    /// Flat water under vertical light: every square gets the incident light less the reflected share.
    #[test]
    fn flat_water_lights_uniformly() {
        let mut ocean = Ocean::new(4, 16.0, 5.0, [4.0, 0.0], 1);
        ocean.sun = DVec3::NEG_Y;
        let eye = above(64);
        let squares = Squares { eye: &eye, side_px: 16 };
        let found = squares.on_floor(&ocean, 0.0, &Floor { height_m: -5.0 }, [128, 1]);
        let known = 1000.0 * 16.0 * (1.0 - (0.33_f64 / 2.33).powi(2));
        assert_eq!(found.len(), 16);
        assert!(found.iter().all(|light| (light / known - 1.0).abs() < 1e-9), "{found:?} {known}");
        let all = squares.in_volume(&ocean.beams(0.0), 200);
        assert!((all.iter().sum::<f64>() / (16.0 * known * 5.0) - 1.0).abs() < 1e-9);
        assert!(all.iter().all(|light| (light / (5.0 * known) - 1.0).abs() < 0.05), "{all:?}");
    }

    #[test]
    fn photons_do_not_depend_on_threads_and_all_seeds_agree() {
        let ocean = Ocean { overshoot: 0.2, ..Ocean::new(8, 16.0, 5.0, [4.0, 0.2], 1) };
        let (eye, beams) = (above(50), ocean.beams(0.0));
        let squares = Squares { eye: &eye, side_px: 8 };
        assert_eq!(squares.size(), [7, 7]);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let floor = |seed| squares.on_floor(&ocean, 0.0, &Floor { height_m: -5.0 }, [300, seed]);
                (floor(1), floor(2), squares.in_volume(&beams, 50))
            })
        };
        let (one, other, volume) = with(1);
        assert_eq!(with(3), (one.clone(), other.clone(), volume));
        assert!(error(&one, &other) > 0.0 && error(&one, &other) < 0.03, "{}", error(&one, &other));
    }

    #[test]
    fn squares_of_an_image_are_its_sums() {
        let eye = above(20);
        let squares = Squares { eye: &eye, side_px: 8 };
        let light: Vec<f64> = (0..400).map(f64::from).collect();
        let sums = squares.of_image(&light);
        let pixel_m2 = (eye.scale_px() * eye.scale_px()).recip();
        let last: f64 = (16..20).flat_map(|y| (16..20).map(move |x| f64::from(20 * y + x))).sum();
        assert!((sums[8] - last * pixel_m2).abs() < 1e-9);
        assert!((error(&sums, &sums.iter().map(|sum| 2.0 * sum).collect::<Vec<_>>()) - 0.5).abs() < 1e-12);
    }
}
