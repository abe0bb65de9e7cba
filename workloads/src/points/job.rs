//! The job `sampling`: uncovered regions are drawn, and the samples that hit them are the candidates (thesis,
//! Paper VI, section 5, Fig. 11).
//!
//! In each round, every uncovered cell is drawn as a square of two triangles. The cells do not overlap, so
//! the depth test rejects nothing. Every round uses new samples, so the points have no bias. Regions smaller
//! than a pixel are filled by [`super::poisson`] on the host; the facts give the share.

use glam::{Vec2, Vec3, Vec4};
use pipeline::random::mix;
use pipeline::sampling::{HashedSamples, LensShape, SampleSource};
use pipeline::{
    Cull, Draw, FrameReport, Geometry, Gpu, Lane, PipelineSpec, RasterPass, Shader, ShadingPoint, Viewport,
};
use serde::{Deserialize, Serialize};

use super::poisson::{Cube, Domain, PoissonDisk, PoissonSpec, Spacing, poisson_disk_drawn};
use super::volume::{camera, place};
use crate::error::LoadError;
use crate::job::{Drawn, Draws, Fact, Flag, Flags, Job, JobError, OptionSource, Request};
use crate::scene::Settings;

/// Options of the job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Options {
    /// Minimum distance of points, 0.005 to 0.5.
    pub radius: f64,
    /// Rounds that are rasterized, 1 to 8.
    pub rounds: u32,
    /// Whether the domain is a torus instead of a box.
    pub periodic: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { radius: 0.02, rounds: 5, periodic: true }
    }
}

/// The job, its settings and its seed.
struct Sampling {
    options: Options,
    settings: Settings,
    seed: u64,
}

/// Run options in use. Samples are new in every round, and nothing moves or is out of focus.
pub(crate) const FLAGS: Flags = Flags { uses: &[Flag::Size, Flag::Samples], instead: &[] };

/// Makes the job `sampling`.
///
/// # Errors
/// [`LoadError::Setting`] for an option out of range.
pub(crate) fn job(options: &OptionSource, request: &Request<'_>) -> Result<Box<dyn Job>, LoadError> {
    let options: Options = options.read()?;
    let refused = |setting, message: String| Err(LoadError::Setting { setting, message });
    if !(0.005..=0.5).contains(&options.radius) {
        return refused("radius", format!("{:?}: it has to be 0.005 to 0.5", options.radius));
    }
    if !(1..=8).contains(&options.rounds) {
        return refused("rounds", format!("{}: it has to be 1 to 8", options.rounds));
    }
    let usual = Settings { width: 512, height: 512, samples: 4, ..Settings::default() };
    let settings = usual.with(request.overrides)?;
    if settings.width != settings.height {
        return refused("size", "width and height have to be equal, as the unit square is drawn".to_owned());
    }
    Ok(Box::new(Sampling { options, settings, seed: request.seed }))
}

/// A shader that finds the coordinates of a candidate in the unit square from its place.
struct Append;

impl Shader for Append {
    fn shade(&self, lane: &Lane, at: &ShadingPoint, _texel: Vec4) -> Vec4 {
        let place = at.position.truncate();
        lane.madd(place, Vec2::splat(0.5), Vec2::splat(0.5)).extend(0.0).extend(1.0)
    }
}

/// Points of which the first were samples of rasterized cells.
#[derive(Debug)]
pub struct Rasterized {
    /// The points, maximal.
    pub found: PoissonDisk<2>,
    /// Number of points that come from samples.
    pub drawn: usize,
    /// Samples that hit an uncovered cell.
    pub candidates: u64,
    /// Rounds, one pass each.
    pub passes: u16,
}

/// Points of the unit square, from `side` by `side` pixels with `samples` each, and the work of the GPU.
///
/// # Errors
/// [`JobError`] for an invalid option or hardware.
pub fn rasterized(
    options: Options,
    side: u32,
    samples: u32,
    seed: u64,
    spec: &PipelineSpec,
) -> Result<(Rasterized, FrameReport), JobError> {
    let settings = Settings { width: side, height: side, samples, ..Settings::default() };
    let mut gpu = Gpu::quiet(spec)?;
    let points = Sampling { options, settings, seed }.points(0, &mut gpu)?;
    Ok((points, gpu.finish()))
}

/// Totals of the rounds so far.
#[derive(Default)]
struct Totals {
    candidates: u64,
    round: u16,
}

impl Sampling {
    /// Runs all rounds, then completes the points on the host.
    fn points(&self, number: u32, gpu: &mut Gpu<'_>) -> Result<Rasterized, JobError> {
        let domain = if self.options.periodic { Domain::Torus } else { Domain::Box };
        let seed = mix(self.seed.wrapping_add(u64::from(number)));
        let requested = PoissonSpec { radius: self.options.radius, domain, seed, spacing: Spacing::Double };
        let mut totals = Totals::default();
        let draw = |cubes: &[Cube<2>]| self.round(cubes, number, &mut totals, gpu);
        let (found, drawn) = poisson_disk_drawn(&requested, self.options.rounds, draw)?
            .map_err(|error| JobError::Setting(error.to_string()))?;
        Ok(Rasterized { found, drawn, candidates: totals.candidates, passes: totals.round })
    }

    /// Draws the uncovered cells of a round and returns the samples that hit, in random order.
    fn round(
        &self,
        cubes: &[Cube<2>],
        frame: u32,
        totals: &mut Totals,
        gpu: &mut Gpu<'_>,
    ) -> Result<Vec<[f64; 2]>, JobError> {
        let side = self.settings.height;
        let seed = mix(self.seed ^ u64::from(frame) << 32 ^ u64::from(totals.round));
        let invalid = || JobError::Setting(format!("{side} pixels, {} samples", self.settings.samples));
        let samples =
            HashedSamples::new(seed, side, self.settings.samples, LensShape::Square).ok_or_else(invalid)?;
        let (viewport, camera) =
            (Viewport::new(side, side).ok_or_else(invalid)?, camera().ok_or_else(invalid)?);
        let (corners, triangles) = squares(cubes);
        let geometry =
            Geometry::new(&corners, &corners, &triangles).map_err(|e| JobError::Setting(e.to_string()))?;
        let draws = [Draw::new(geometry, &Append, Cull::None)];
        let settings =
            pipeline::Settings { spec: gpu.spec(), viewport, samples: &samples, background: Vec3::ZERO };
        if totals.round > 0 {
            // The host has read the candidates of the round before.
            gpu.wait();
        }
        let name = format!("round {}", totals.round);
        let pass = RasterPass::new(&camera, &draws, &settings).named(&name).with_visible();
        let candidates = hits(&gpu.draw(&pass)?.visible, side, &samples, seed);
        totals.candidates += candidates.len() as u64;
        totals.round += 1;
        Ok(candidates)
    }
}

/// Two triangles per square.
fn squares(cubes: &[Cube<2>]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let corner = |cube: &Cube<2>, n: u32| {
        let [x, y] = [0, 1].map(|k| (cube.low[k] + f64::from(n >> k & 1) * cube.side) as f32);
        Vec3::new(x, y, 1.0)
    };
    let corners = cubes.iter().flat_map(|cube| (0..4).map(move |n| corner(cube, n))).collect();
    let two = |first: u32| [[first, first + 1, first + 3], [first, first + 3, first + 2]];
    (corners, (0..cubes.len() as u32).flat_map(|n| two(4 * n)).collect())
}

/// Positions of the samples that hit a triangle, in pseudo-random order.
fn hits(seen: &[(u32, u32)], side: u32, samples: &HashedSamples, seed: u64) -> Vec<[f64; 2]> {
    let per_pixel = samples.per_pixel();
    let mut own = vec![pipeline::sampling::Sample::default(); per_pixel as usize];
    let mut found = Vec::new();
    for (pixel, seen) in (0..).zip(seen.chunks(per_pixel as usize)) {
        let at = [pixel % side, pixel / side];
        samples.pixel_into(at[0], at[1], &mut own);
        for (index, (sample, _)) in own.iter().zip(seen).enumerate().filter(|(_, (_, hit))| hit.0 != u32::MAX)
        {
            let [x, y, _] = place(sample, at, side);
            let order = mix(seed ^ (u64::from(pixel) * u64::from(per_pixel) + index as u64));
            found.push((order, [x, y]));
        }
    }
    found.sort_unstable_by_key(|(order, _)| *order);
    found.into_iter().map(|(_, at)| at).collect()
}

/// The points as white squares on black.
fn picture(points: &[[f64; 2]], side: u32, radius: f64) -> Vec<Vec3> {
    let mut image = vec![Vec3::ZERO; (side * side) as usize];
    let (half, last) = ((0.15 * radius * f64::from(side)) as i64, i64::from(side) - 1);
    for [x, y] in points {
        let [column, row] = [*x, 1.0 - *y].map(|at| (at * f64::from(side)) as i64);
        for row in (row - half).max(0)..=(row + half).min(last) {
            for column in (column - half).max(0)..=(column + half).min(last) {
                image[(row * i64::from(side) + column) as usize] = Vec3::ONE;
            }
        }
    }
    image
}

impl Draws for Sampling {
    /// Frame number, which seeds the points.
    type Input = u32;

    fn settings(&self) -> &Settings {
        &self.settings
    }

    fn input(&self, number: u32) -> Result<u32, JobError> {
        Ok(number)
    }

    fn draw(&self, &number: &u32, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let Rasterized { found, drawn, candidates, .. } = self.points(number, gpu)?;
        let fact = |name, value| Fact { name, value };
        let facts = vec![
            fact("points", found.points.len() as f64),
            fact("points_from_samples", drawn as f64),
            fact("candidates_from_samples", candidates as f64),
            fact("uncovered_regions", found.uncovered as f64),
            fact("thin_regions", found.thin_regions as f64),
        ];
        let image = picture(&found.points, self.settings.height, self.options.radius);
        Ok(Drawn { image, facts, ..Drawn::default() })
    }
}

#[cfg(test)]
mod tests {
    use activity::{Counts, Packet};

    use super::super::poisson::closer;
    use super::*;
    use crate::job::testing::hardware;
    use crate::scene::Overrides;

    fn made(set: &[(&str, &str)], size: (u32, u32)) -> Result<Box<dyn Job>, String> {
        let set = set.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
        let overrides = Overrides { size: Some(size), ..Overrides::default() };
        job(&OptionSource { file: None, set }, &Request { overrides: &overrides, seed: 1 })
            .map_err(|error| error.to_string())
    }

    #[test]
    fn most_points_come_from_samples_and_packets_add_up() {
        let job = made(&[("radius", "0.05")], (128, 128)).unwrap();
        let (mut sum, mut passes) = (Counts::default(), 0);
        let hardware = hardware();
        let mut gpu = Gpu::new(&hardware, |packet: &Packet, _| {
            sum += &packet.counts;
            passes = passes.max(packet.pass + 1);
        })
        .unwrap();
        let drawn = job.frame(0, &mut gpu).unwrap();
        let report = gpu.finish();
        assert_eq!((report.counts(), passes), (sum, 5));
        let fact = |name: &str| drawn.facts.iter().find(|fact| fact.name == name).unwrap().value;
        assert!(fact("points_from_samples") > 0.9 * fact("points"), "{:?}", drawn.facts);
        assert!(drawn.image.contains(&Vec3::ONE) && report.triangles() > 1600);
    }

    #[test]
    fn points_of_drawn_regions_are_maximal_poisson_disk_points() {
        let requested =
            PoissonSpec { radius: 0.07, domain: Domain::Torus, seed: 1, spacing: Spacing::Double };
        let stream = crate::points::Stream::new(1, 1);
        let draw = |cubes: &[Cube<2>]| {
            let near = |n: u64| {
                let cube = &cubes[stream.below(3 * n, cubes.len() as u64) as usize];
                [0, 1].map(|k| cube.low[k] + cube.side * stream.unit(3 * n + 1 + k as u64))
            };
            Ok::<_, ()>((0..500).map(near).collect())
        };
        let (found, drawn) = poisson_disk_drawn::<2, _>(&requested, 4, draw).unwrap().unwrap();
        assert!(drawn > 50 && drawn <= found.points.len());
        for (number, a) in found.points.iter().enumerate() {
            assert!(!found.points[..number].iter().any(|b| closer(a, b, 0.07, Domain::Torus)));
        }
        let hole = super::super::quality::largest_hole(&found.points, Domain::Torus);
        assert!(hole.radius <= 0.07 * (1.0 + 1e-12), "{hole:?}");
    }

    #[test]
    fn options_out_of_range_are_refused() {
        for (set, size, part) in [
            (("radius", "0.6"), (64, 64), "radius: 0.6"),
            (("rounds", "0"), (64, 64), "rounds: 0"),
            (("rounds", "2"), (64, 32), "width and height"),
        ] {
            let message = made(&[set], size).err().unwrap();
            assert!(message.contains(part), "{message}");
        }
    }
}
