//! Light of a beam at a pixel: the pixel shader, and orthographic views of the light; and light by random
//! rays, as a reference that shares no code with the rasterization of beams.

use glam::{Affine3A, DAffine3, DMat3, DVec2, DVec3};
use pipeline::geometry::Projection;
use pipeline::random::{mix, unit};
use pipeline::setup::{SetupResult, Triangle, set_up};
use pipeline::traversal::{TimeIntervals, time_interval_counted};
use pipeline::{Camera, Cull, Lane, MovingVertex, Shear, Viewport};
use rayon::prelude::*;

use super::generator::Ocean;
use super::{Beam, Hit};

/// A horizontal floor that receives light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floor {
    /// Height in metres.
    pub height_m: f64,
}

/// Quantity that is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightQuantity {
    /// Light in the volume: fluence along the ray of a pixel, in watts per metre. Times the scattering
    /// coefficient, it is what a camera sees.
    Volume,
    /// Irradiance on a floor, in watts per square metre, from either side.
    Floor(Floor),
}

/// Input of the pixel shader: a pixel that a beam covers.
pub(super) struct PixelInBeam<'a> {
    pub eye: &'a Eye,
    pub seen: &'a Seen,
    /// Centre of the pixel.
    pub at: [f64; 2],
    /// Times at which it is in the beam, by face, if the test of the pixel found them.
    pub times: Option<[TimeIntervals; 2]>,
}

impl LightQuantity {
    /// Light of a beam at a pixel centre.
    pub(super) fn shade(&self, lane: &Lane, pixel: &PixelInBeam<'_>) -> f64 {
        match self {
            Self::Volume => fluence_along(lane, pixel),
            Self::Floor(floor) => floor.irradiance(lane, pixel),
        }
    }
}

/// Integral of the fluence along a ray. Fluence is `2 flux |dx/dt| / |det(dx/db1, dx/db2, dx/dt)|`. Along a
/// ray, `dz / |det(dx/db1, dx/db2, dx/dt)|` is `dt` over twice the area of the triangle in the image. So the
/// integral runs over the times at which the pixel is inside.
fn fluence_along(lane: &Lane, pixel: &PixelInBeam<'_>) -> f64 {
    let PixelInBeam { eye, seen, at, times } = *pixel;
    let scale = eye.scale_px();
    let areas = seen.image.areas(lane).map(|area| area.z);
    let piece = |&[from, to]: &[f64; 2]| {
        let (from, to) = (lane.max(from, 0.0), lane.min(to, 1.0));
        let middle = lane.mul(0.5, lane.add(from, to));
        lane.mul(speed(lane, seen, at, middle), over_area(lane, areas, from, to))
    };
    let sets = times.unwrap_or_else(|| {
        lane.tallied(|costs| time_interval_counted(&seen.triangle, eye.shear(), at, costs))
    });
    let sum = sets.iter().flat_map(|set| set.as_slice()).fold(0.0, |sum, times| lane.add(sum, piece(times)));
    // The factor is the same for all pixels of a beam.
    lane.mul(2.0 * seen.world.flux_w * scale * scale, sum)
}

/// `|dx/dt|` where the ray meets the triangle. It varies little within a beam, so one value represents an
/// interval.
fn speed(lane: &Lane, seen: &Seen, [x, y]: [f64; 2], t: f64) -> f64 {
    let corners = seen.image.corners_on(lane, t).map(|p| [lane.sub(p.x, x), lane.sub(p.y, y)]);
    let edge = |i: usize, j: usize| {
        let (a, b) = (corners[i], corners[j]);
        lane.madd(-b[0], a[1], lane.mul(a[0], b[1]))
    };
    let edges = [edge(1, 2), edge(2, 0), edge(0, 1)];
    let sum = lane.add(lane.add(edges[0], edges[1]), edges[2]);
    let weights = if lane.branch(sum == 0.0) {
        [1.0 / 3.0; 3]
    } else {
        edges.map(|e| lane.min(lane.max(lane.div(e, sum), 0.0), 1.0))
    };
    let motion = seen.world.motion(lane, &Hit { weights, t });
    lane.root(lane.dot(motion, motion))
}

/// Integral of `1 / |area|` over an interval in which a pixel is inside, so that the quadratic `area` keeps
/// its sign. With `B` its polar form at both times and `w^2 = B^2 - area(from) area(to)`, it is `(to - from)
/// atanh(w / B) / w`.
fn over_area(lane: &Lane, area: [f64; 3], from: f64, to: f64) -> f64 {
    let polar = |s: f64, t: f64| {
        let [before_s, before_t] = [s, t].map(|at| lane.sub(1.0, at));
        let first = lane.mul(lane.mul(before_s, before_t), area[0]);
        let mixed = lane.madd(before_s, t, lane.mul(s, before_t));
        lane.madd(lane.mul(s, t), area[2], lane.madd(mixed, area[1], first))
    };
    // At a focus the light is limited by floating-point precision. A pixel centre exactly on it would be
    // infinitely bright.
    let largest = area.iter().fold(1e-200, |most: f64, a| lane.max(most, a.abs()));
    let least = lane.mul(f64::EPSILON, largest);
    let ends = [polar(from, from), polar(to, to)];
    let sign = if lane.branch(lane.add(ends[0], ends[1]) < 0.0) { -1.0 } else { 1.0 };
    let [first, last] = ends.map(|end| lane.max(sign * end, least));
    let middle = sign * polar(from, to);
    let product = lane.mul(first, last);
    let squared = lane.madd(middle, middle, -product);
    let w = lane.root(squared.abs());
    let per_length = if lane.branch(w <= lane.mul(1e-6, middle.abs())) {
        lane.div(1.0, lane.max(middle, least))
    } else if lane.branch(squared > 0.0) {
        // atanh(w / middle) / w, without cancellation: middle - w = first last / (middle + w).
        let sum = lane.add(middle.abs(), w);
        lane.div(lane.ln(lane.div(lane.mul(sum, sum), product)), lane.mul(2.0, w))
    } else {
        lane.div(lane.atan2(w, middle), w)
    };
    lane.mul(lane.max(lane.sub(to, from), 0.0), lane.max(per_length, 0.0))
}

impl Floor {
    /// Irradiance of all hits: `2 flux |dx/dt . n| / |det(dx/db1, dx/db2, dx/dt)|`.
    fn irradiance(&self, lane: &Lane, pixel: &PixelInBeam<'_>) -> f64 {
        let PixelInBeam { eye, seen, at, .. } = *pixel;
        // The position on the floor is that of the pixel in every beam: an input.
        let Some(point) = self.point(eye, at) else { return 0.0 };
        let scale = eye.scale_px();
        let of = |hit: Hit| {
            let through = seen.world.motion(lane, &hit).y.abs();
            let room = lane.div(seen.image.jacobian(lane, &hit).abs(), scale * scale);
            let is_open = lane.branch(room > 0.0);
            if is_open { lane.div(lane.mul(2.0 * seen.world.flux_w, through), room) } else { 0.0 }
        };
        seen.image.inside(lane, point).fold(0.0, |sum, hit| lane.add(sum, of(hit)))
    }

    /// Floor point at an image position, in pixels and depth; `None` if the floor is seen edge-on.
    pub fn point(&self, eye: &Eye, at: [f64; 2]) -> Option<DVec3> {
        let (near, ahead) = (eye.world(at, 0.0), eye.world(at, 1.0));
        let depth = (self.height_m - near.y) / (ahead.y - near.y);
        depth.is_finite().then_some(DVec3::new(at[0], at[1], depth))
    }
}

/// An orthographic view.
#[derive(Clone, Copy, Debug)]
pub struct Eye {
    projection: Projection,
    viewport: Viewport,
    /// Pixels per metre.
    scale_px: f64,
    /// Transformation from view space to world space.
    pose: DAffine3,
}

/// A beam as the rasterizer sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// The beam in world space.
    pub world: Beam,
    /// The beam in pixels and depth, from the rasterizer's rounded coordinates.
    pub image: Beam,
    /// The moving triangle, from one end of the beam to the other.
    pub triangle: Triangle,
}

/// Distance of the near plane. The camera stands far behind the scene, so it clips nothing.
const NEAR: f32 = 1e-6;

impl Eye {
    /// A view from `from` at `target`, with `up` upwards in the image, and `half_height` metres above and
    /// below the centre. `None` if `from` equals `target`, `up` is parallel to the view, or a value is not
    /// finite and positive.
    pub fn new([from, target, up]: [DVec3; 3], half_height: f64, [width, height]: [u32; 2]) -> Option<Self> {
        let viewport = Viewport::new(width, height)?;
        let forward = (target - from).try_normalize()?;
        let right = forward.cross(up).try_normalize()?;
        let axes = DMat3::from_cols(right, right.cross(forward), forward).transpose();
        let pose = DAffine3 { matrix3: axes, translation: -(axes * from) };
        let rounded = Affine3A::from_cols_array(&pose.to_cols_array().map(|c| c as f32));
        let camera = Camera::orthographic(rounded, half_height as f32, NEAR).ok()?;
        let rounded = DAffine3::from_cols_array(&rounded.to_cols_array().map(f64::from));
        let scale_px = 0.5 * f64::from(height) / f64::from(half_height as f32);
        Some(Self {
            projection: Projection::new(&camera, viewport),
            viewport,
            scale_px,
            pose: rounded.inverse(),
        })
    }

    /// Image size.
    pub fn viewport(&self) -> Viewport {
        self.viewport
    }

    /// Pixels per metre.
    pub fn scale_px(&self) -> f64 {
        self.scale_px
    }

    /// Projection of vertices.
    pub(super) fn projection(&self) -> &Projection {
        &self.projection
    }

    /// Projection shear of the rasterizer.
    pub(super) fn shear(&self) -> &Shear {
        &self.projection.shear
    }

    /// Centre of a pixel, in pixels from the centre of the image.
    pub(super) fn pixel_centre(&self, [column, row]: [u32; 2]) -> [f64; 2] {
        let pixel_centre = |at: u32, side: u32| f64::from(at) + 0.5 - 0.5 * f64::from(side);
        [pixel_centre(column, self.viewport.width()), pixel_centre(row, self.viewport.height())]
    }

    /// World position of an image point at a depth.
    pub fn world(&self, [x, y]: [f64; 2], depth: f64) -> DVec3 {
        self.pose.transform_point3(DVec3::new(x / self.scale_px, -y / self.scale_px, depth))
    }

    /// Image position of a world point: pixels from the centre, and depth.
    pub fn image(&self, point: DVec3) -> DVec3 {
        let p = self.pose.inverse().transform_point3(point);
        DVec3::new(p.x * self.scale_px, -p.y * self.scale_px, p.z)
    }

    /// The beam in this view; `None` if it has no volume or reaches behind the camera.
    pub(super) fn see(&self, beam: &Beam) -> Option<Seen> {
        let vertices =
            [0, 1, 2].map(|k| self.projection.vertex(beam.open[k].as_vec3(), beam.close[k].as_vec3()));
        let [a, b, c]: [&MovingVertex; 3] = vertices.each_ref();
        let half_px = self.viewport.half_px();
        let SetupResult::Ready(triangle) = set_up(0, [a, b, c], Cull::None, self.shear(), NEAR, half_px)
        else {
            return None;
        };
        let ends = triangle.corners.map(|corner| {
            let [open, delta] = [corner.open, corner.delta].map(|p| DVec3::from_array(p.map(f64::from)));
            [open, open + delta]
        });
        let [open, close] = [0, 1].map(|end| ends.map(|corner| corner[end]));
        let in_front = open.iter().chain(&close).all(|p| p.z > f64::from(NEAR));
        in_front.then_some(Seen { world: *beam, image: Beam { open, close, flux_w: beam.flux_w }, triangle })
    }
}

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

    #[test]
    fn the_integral_over_the_area_is_that_of_many_steps() {
        // Two real roots outside, no roots, a line, a constant, a double root, and a negative area.
        for area in [
            [2.0, 3.0, 1.0],
            [1.0, 0.2, 1.0],
            [1.0, 2.0, 3.0],
            [4.0; 3],
            [1.0, 1.9, 3.61],
            [-3.0, -1.0, -2.0],
        ] {
            for [from, to] in [[0.0, 1.0], [0.25, 0.5], [0.3, 0.3]] {
                let value = |t: f64| {
                    let s = 1.0 - t;
                    (s * s * area[0] + 2.0 * s * t * area[1] + t * t * area[2]).abs()
                };
                let steps = 20_000;
                let at = |k: usize| from + (to - from) * (k as f64 + 0.5) / steps as f64;
                let by_steps =
                    (0..steps).map(|k| 1.0 / value(at(k))).sum::<f64>() * (to - from) / steps as f64;
                let found = over_area(&Lane::default(), area, from, to);
                assert!(
                    (found - by_steps).abs() <= 1e-7 * by_steps,
                    "{area:?} {from} {to}: {found} {by_steps}"
                );
            }
        }
        assert!(over_area(&Lane::default(), [0.0; 3], 0.0, 1.0).is_finite());
    }

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
