//! Centroids: where a triangle covers samples of a pixel but not its middle, attributes are those of a point
//! inside the triangle.

use activity::Event;
use glam::{DVec2, Vec2, Vec3, Vec4};
use pipeline::sampling::Pattern;
use pipeline::*;

use crate::common::stage::*;
use crate::common::*;

/// Shows texture coordinates.
struct Coordinates;

impl Shader for Coordinates {
    fn shade(&self, _: &Lane, at: &ShadingPoint, _: Vec4) -> Vec4 {
        at.uv.extend(0.0).extend(1.0)
    }
}

const SIDE: u32 = 24;

fn stage(per_pixel: u32) -> Stage {
    let multisample = SampleSpec { pattern: Pattern::Multisample, ..SampleSpec::default() };
    Stage::new(SIDE, SIDE, SampleTable::new(&multisample, per_pixel, 1).unwrap())
}

/// Random triangles with a texture coordinate that is a corner of the unit triangle at each vertex.
struct Triangles {
    positions: Vec<Vec3>,
    later: Vec<Vec3>,
    uvs: Vec<Vec2>,
    indices: Vec<[u32; 3]>,
}

impl Triangles {
    fn new(count: u32, seed: u64) -> Self {
        let mut r = Uniform::new(seed);
        let mut corner = || {
            let depth = r.within(1.0, 3.0);
            Vec3::new(r.within(-13.0, 13.0) * depth, r.within(-13.0, 13.0) * depth, depth)
        };
        let positions: Vec<Vec3> = (0..3 * count).map(|_| corner()).collect();
        let later = positions.iter().map(|corner| *corner + Vec3::X).collect();
        let uvs = [Vec2::ZERO, Vec2::X, Vec2::Y].repeat(count as usize);
        let indices = (0..count).map(|first| [0, 1, 2].map(|corner| 3 * first + corner)).collect();
        Self { positions, later, uvs, indices }
    }

    /// Coverage, depth and texture coordinate of a triangle at an image point, in double precision.
    fn seen(&self, triangle: u32, at: DVec2) -> Seen {
        let corners = [0, 1, 2].map(|corner| self.positions[3 * triangle as usize + corner].as_dvec3());
        // The image plane has `y` downwards.
        let from = corners.map(|p| DVec2::new(p.x / p.z, -p.y / p.z) - at);
        let edges = [(1, 2), (2, 0), (0, 1)].map(|(i, j): (usize, usize)| from[i].perp_dot(from[j]));
        let all: f64 = edges.iter().sum();
        let shares = [0, 1, 2].map(|k| edges[k] / all / corners[k].z);
        let sum: f64 = shares.iter().sum();
        let weights = shares.map(|share| share / sum);
        Seen { is_inside: edges.iter().all(|edge| edge * all > 0.0), depth: 1.0 / sum, weights }
    }
}

struct Seen {
    is_inside: bool,
    depth: f64,
    weights: [f64; 3],
}

/// Texture coordinate of every sample, and the events of the pass.
fn drawn(of: &Triangles, per_pixel: u32, (centroid, moves): (bool, bool), image: bool) -> (Vec<Vec4>, u64) {
    let (stage, spec) = (stage(per_pixel), spec(Features::ALL));
    let settings =
        Settings { spec: &spec, viewport: stage.viewport, samples: &stage.table, background: Vec3::ZERO };
    let mut gpu = Gpu::without_packets(&spec).unwrap();
    let surface = |gpu: &mut Gpu<'_>, name, format| {
        gpu.create_surface(&SurfaceSpec::new(name, stage.viewport, format).sampled(per_pixel))
    };
    let [colour, depth] =
        [("uv", Format::Rg32f), ("depth", Format::D32)].map(|(name, format)| surface(&mut gpu, name, format));
    let later = if moves { &of.later } else { &of.positions };
    let geometry = Geometry::new(&of.positions, later, &of.indices).unwrap().with_uvs(&of.uvs).unwrap();
    let draws = [Draw::new(geometry, &Coordinates, Cull::None)
        .with_state(DrawState { centroid, ..DrawState::default() })];
    let targets = Attachments {
        colours: vec![Attachment::cleared(colour, Vec4::ZERO)],
        depth: Some(Attachment::cleared(depth, Clear::default())),
    };
    let pass = RasterPass::new(&stage.camera, &draws, &settings);
    if image {
        let drawn = gpu.draw(&pass).unwrap();
        return (
            drawn.images[0].iter().map(|p| p.extend(1.0)).collect(),
            drawn.counts[Event::CentroidInvocations],
        );
    }
    let counts = gpu.draw(&pass.onto(Target::Surfaces(&targets))).unwrap().counts;
    (gpu.contents(colour).unwrap(), counts[Event::CentroidInvocations])
}

/// Image coordinates of the samples of a pixel, and of its middle.
struct Pixel {
    samples: Vec<DVec2>,
    middle: DVec2,
}

/// All pixels, row by row.
fn pixels(per_pixel: u32) -> Vec<Pixel> {
    let table = stage(per_pixel).table;
    let pixel = |x, y| {
        let corner = DVec2::new(f64::from(x), f64::from(y)) - 0.5 * f64::from(SIDE);
        let at = |s: &sampling::Sample| corner + DVec2::new(s.x.into(), s.y.into());
        Pixel { samples: table.pixel(x, y).iter().map(at).collect(), middle: corner + 0.5 }
    };
    (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| [x, y])).map(|[x, y]| pixel(x, y)).collect()
}

/// Where a triangle is shaded in a pixel, by testing every sample in double precision.
fn shaded_at(of: &Triangles, triangle: u32, pixel: &Pixel) -> (DVec2, bool) {
    let is_inside = |at: &&DVec2| of.seen(triangle, **at).is_inside;
    let covered: Vec<&DVec2> = pixel.samples.iter().filter(is_inside).collect();
    if is_inside(&&pixel.middle) || covered.is_empty() {
        return (pixel.middle, false);
    }
    (covered.iter().copied().sum::<DVec2>() / covered.len() as f64, true)
}

#[test]
fn attributes_are_those_of_brute_force() {
    for (per_pixel, seed) in [2, 4, 8].into_iter().flat_map(|n| (0..4).map(move |seed| (n, seed))) {
        let of = Triangles::new(6, seed);
        let pixels = pixels(per_pixel);
        for centroid in [true, false] {
            let (values, _) = drawn(&of, per_pixel, (centroid, false), false);
            let (mut compared, mut at_centroids, mut left_out) = (0, 0, 0);
            for (number, pixel) in pixels.iter().enumerate() {
                for (sample, at) in pixel.samples.iter().enumerate() {
                    let seen = (0..6).map(|id| (id, of.seen(id, *at))).filter(|(_, seen)| seen.is_inside);
                    let nearest = seen.min_by(|a, b| a.1.depth.total_cmp(&b.1.depth));
                    let value = values[number * per_pixel as usize + sample];
                    let Some((id, _)) = nearest else {
                        assert_eq!(value, Vec4::new(0.0, 0.0, 0.0, 1.0));
                        continue;
                    };
                    let (point, is_moved) = shaded_at(&of, id, pixel);
                    let point = if centroid { point } else { pixel.middle };
                    let [_, u, v] = of.seen(id, point).weights;
                    if u.abs().max(v.abs()) > 20.0 {
                        left_out += 1;
                        continue;
                    }
                    let error = (f64::from(value.x) - u).abs().max((f64::from(value.y) - v).abs());
                    assert!(
                        error < 1e-3,
                        "{per_pixel} samples, seed {seed}, pixel {number}: {value} for {u} {v}"
                    );
                    compared += 1;
                    at_centroids += u32::from(is_moved);
                }
            }
            assert!(compared > 100 && at_centroids > 10 && left_out < compared / 20, "{compared} {left_out}");
        }
    }
}

/// One image path stores nearest samples first and shades them last: it sees the same centroids.
#[test]
fn both_orders_of_shading_agree() {
    let of = Triangles::new(6, 3);
    let (samples, _) = drawn(&of, 4, (true, false), false);
    let (image, _) = drawn(&of, 4, (true, false), true);
    for (pixel, of_pixel) in image.iter().zip(samples.chunks(4)) {
        let mean: Vec4 = of_pixel.iter().sum::<Vec4>() / 4.0;
        assert!((mean - *pixel).truncate().length() < 1e-5, "{mean} {pixel}");
    }
}

/// The middle of a pixel at an edge has a texture coordinate beyond the triangle; the centroid does not.
#[test]
fn middles_extrapolate_and_centroids_do_not() {
    for per_pixel in [2, 4, 8] {
        let of = Triangles::new(1, 5);
        let beyond = |values: &[Vec4]| {
            let out = values.iter().map(|uv| (-uv.x).max(-uv.y).max(uv.x + uv.y - 1.0));
            out.fold(0.0, f32::max)
        };
        let ((middles, none), (centroids, count)) =
            (drawn(&of, per_pixel, (false, false), false), drawn(&of, per_pixel, (true, false), false));
        assert!(beyond(&middles) > 0.01, "{per_pixel}: {}", beyond(&middles));
        assert!(beyond(&centroids) < 1e-5, "{per_pixel}: {}", beyond(&centroids));
        let moved = pixels(per_pixel).iter().filter(|pixel| shaded_at(&of, 0, pixel).1).count();
        assert_eq!((none, count), (0, moved as u64), "every pixel with a centroid is counted once");
        assert!(count > 0);
    }
}

/// Moving triangles have no coverage of a pixel at one time.
#[test]
fn triangles_that_move_are_shaded_in_the_middle() {
    let of = Triangles::new(4, 9);
    let [with, without] = [true, false].map(|centroid| drawn(&of, 4, (centroid, true), false));
    assert_eq!(with, without);
}
