//! The job `sampling`: points by rasterization (thesis, Paper VI, section 5).
//!
//! - *Darts* (Fig. 11): in each round the uncovered regions, squares in 2D and cubes in 3D, are drawn in
//!   conservative mode as triangles and prisms, and the random candidates in them become points if they are
//!   free. The host removes conflicts and divides the regions. It fills what is left after the last round,
//!   [`super::poisson`]; the facts give the share.
//! - *Noise* (Fig. 12): points that follow a bell, from columns one dimension higher ([`crate::points`]).
//! - *Volume* (Fig. 9): samples in a torus (3D) or a blurred disk (4D, 5D), found in standard mode
//!   ([`super::volume`]).

use glam::Vec3;
use pipeline::random::mix;
use pipeline::sampling::{HashedSamples, LensShape};
use pipeline::{FrameReport, Gpu, PipelineSpec};
use serde::{Deserialize, Serialize};
use warnings::{Code, Warning};

use super::drawn::{AXES, Cell, Everywhere, Kept, Lattice, draw};
use super::poisson::{
    Cube, DARTS_PER_FIRST_CELL, DARTS_PER_LATER_CELL, Domain, PoissonDisk, PoissonSpec, Spacing,
    poisson_disk_drawn,
};
use super::volume::{Blurred, Torus, Volume, fill};
use super::white::{NamedDensity, columns_for};
use super::{DrawnNoise, NoiseSpec, draw_noise};
use crate::error::LoadError;
use crate::job::{
    Drawn, Draws, Fact, Flag, Flags, Job, JobError, JobOptions, JobRequest, Need, OptionSource, facts,
};
use crate::scene::SceneSettings;

/// Kind of points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PointKind {
    /// Points that keep their distance.
    #[default]
    Darts,
    /// Independent points that follow a bell.
    Noise,
    /// Samples in a volume.
    Volume,
}

impl PointKind {
    /// What summaries name in place of a sample table: darts and noise have candidates instead of samples.
    fn samples(self) -> &'static str {
        match self {
            Self::Darts | Self::Noise => "none",
            Self::Volume => "hashed",
        }
    }

    /// Dimensions in which there are such points.
    fn dimensions(self) -> std::ops::RangeInclusive<u32> {
        match self {
            Self::Darts => 2..=3,
            Self::Noise => 1..=4,
            Self::Volume => 3..=5,
        }
    }
}

/// Options of the job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PointOptions {
    /// Kind of points.
    pub points: PointKind,
    /// Dimensions; 0 for the fewest of the kind.
    pub dimensions: u32,
    /// Minimum distance of darts, 0.005 to 0.5, in 3D from 0.03 on; 0 for 0.02 in 2D and 0.06 in 3D.
    pub radius: f64,
    /// Rounds of darts that are rasterized, 1 to 8.
    pub rounds: u32,
    /// Whether the domain of darts is a torus instead of a box.
    pub periodic: bool,
    /// Points of noise on average, 100 to 2,000,000.
    pub count: f64,
}

impl JobOptions for PointOptions {
    const NEEDS: &'static [Need] = &[
        Need::new("radius", "points", &["darts"]),
        Need::new("rounds", "points", &["darts"]),
        Need::new("periodic", "points", &["darts"]),
        Need::new("count", "points", &["noise"]),
    ];
}

impl Default for PointOptions {
    fn default() -> Self {
        let (points, dimensions) = (PointKind::Darts, 0);
        Self { points, dimensions, radius: 0.0, rounds: 5, periodic: true, count: 20_000.0 }
    }
}

/// The job, its settings and its seed.
struct Sampling {
    options: PointOptions,
    settings: SceneSettings,
    seed: u64,
}

facts! {
    points "count" "points found"
    points_from_passes "count" "of these, those from candidates of the passes; the host adds the others"
    candidates "count" "candidates that the shader makes"
    candidates_in_regions "count" "of these, those in an uncovered region"
    uncovered_regions "count" "uncovered cells of the host, over all levels"
    thin_regions "count" "of these, those that remain because they hold no representable point"
    columns "count" "columns of the density that are drawn"
    points_expected "count" "samples times the share of space that the volume fills"
    samples_covered "count" "samples that a triangle covers"
}

/// Run options in use. Darts and noise bring their own samples; nothing but volumes moves or is out of focus.
pub(crate) const FLAGS: Flags = Flags { uses: &[Flag::Size, Flag::Samples], instead: &[] };

/// Least distance of darts in 3D, so that a round has 200,000 regions at most.
const MIN_RADIUS_3D: f64 = 0.03;

/// Makes the job `sampling`.
///
/// # Errors
/// [`LoadError::Setting`] for an option out of range.
pub(crate) fn job(options: &OptionSource, request: &JobRequest<'_>) -> Result<Box<dyn Job>, LoadError> {
    let mut options: PointOptions = options.read()?;
    let refused = |setting, message: String| Err(LoadError::Setting { setting, message });
    let known = options.points.dimensions();
    if options.dimensions == 0 {
        options.dimensions = *known.start();
    }
    if !known.contains(&options.dimensions) {
        let range = format!("{} to {}", known.start(), known.end());
        let kind = format!("{:?}", options.points).to_lowercase();
        return refused("points", format!("`{kind}` has {range} dimensions, not {}", options.dimensions));
    }
    let in_space = options.dimensions == 3 && options.points == PointKind::Darts;
    if options.radius == 0.0 {
        options.radius = if in_space { 0.06 } else { 0.02 };
    }
    let least = if in_space { MIN_RADIUS_3D } else { 0.005 };
    if !(least..=0.5).contains(&options.radius) {
        return refused("radius", format!("{:?}: it has to be {least} to 0.5", options.radius));
    }
    if !(1..=8).contains(&options.rounds) {
        return refused("rounds", format!("{}: it has to be 1 to 8", options.rounds));
    }
    if !(100.0..=2e6).contains(&options.count) {
        return refused("count", format!("{}: it has to be 100 to 2000000", options.count));
    }
    if options.points != PointKind::Volume && request.overrides.samples.is_some() {
        return refused(
            "points",
            "these bring samples of their own: only `points=volume` takes --samples".to_owned(),
        );
    }
    let usual = SceneSettings { width: 512, height: 512, samples: 4, ..SceneSettings::default() };
    let settings = usual.with(request.overrides)?;
    let settings = SceneSettings { table: options.points.samples().to_owned(), ..settings };
    if settings.width != settings.height {
        return refused("size", "width and height have to be equal, as the unit square is drawn".to_owned());
    }
    Ok(Box::new(Sampling { options, settings, seed: request.seed }))
}

/// Points of which the first were candidates of rasterized regions.
#[derive(Debug)]
pub struct Rasterized<const D: usize> {
    /// The points, maximal.
    pub found: PoissonDisk<D>,
    /// Number of points that come from candidates of the passes.
    pub drawn: usize,
    /// Candidates in an uncovered region.
    pub kept: u64,
    /// Candidates that the shader made, in the region or not.
    pub candidates: u64,
    /// Runs of the shader: pairs of a triangle or prism and a tile.
    pub fragments: u64,
    /// Rounds, one pass each.
    pub passes: u32,
    /// The uncovered regions of the last round.
    pub uncovered: Vec<Cube<D>>,
}

impl<const D: usize> Rasterized<D> {
    /// Whether a point is in a region of the last round, and so was not there before: the regions are smaller
    /// than the least distance, so there is no earlier point in them.
    pub fn is_in_uncovered(&self, point: &[f64; D]) -> bool {
        let is_in = |cube: &Cube<D>| {
            (0..D).all(|axis| (cube.low[axis]..cube.low[axis] + cube.side).contains(&point[axis]))
        };
        self.uncovered.iter().any(is_in)
    }
}

/// Darts at regions that are drawn on `gpu`, the first `rounds` of them; the host throws the rest.
///
/// # Errors
/// [`JobError`] for an invalid radius.
pub fn darts<const D: usize>(
    spec: &PoissonSpec,
    rounds: u32,
    gpu: &mut Gpu<'_>,
) -> Result<Rasterized<D>, JobError> {
    let (mut passes, mut sums, mut uncovered) = (0, [0; 3], Vec::new());
    let draw = |cubes: &[Cube<D>]| {
        uncovered = cubes.to_vec();
        let Kept { points, candidates, fragments, .. } = round(cubes, passes, spec.seed, gpu)?;
        sums = [sums[0] + points.len() as u64, sums[1] + candidates, sums[2] + fragments];
        passes += 1;
        Ok::<_, JobError>(points.iter().map(|point| std::array::from_fn(|k| point[k])).collect())
    };
    let (found, drawn) = poisson_disk_drawn(spec, rounds, draw)?.map_err(JobError::setting)?;
    let [kept, candidates, fragments] = sums;
    Ok(Rasterized { found, drawn, kept, candidates, fragments, passes, uncovered })
}

/// Darts on a GPU of its own, and its work.
///
/// # Errors
/// As [`darts`].
pub fn rasterized<const D: usize>(
    spec: &PoissonSpec,
    rounds: u32,
    hardware: &PipelineSpec,
) -> Result<(Rasterized<D>, FrameReport), JobError> {
    let mut gpu = Gpu::without_packets(hardware)?;
    let points = darts(spec, rounds, &mut gpu)?;
    Ok((points, gpu.finish()))
}

/// Boxes and lattice of a round. A cell of the lattice is a region of the round, or would be.
fn regions<const D: usize>(cubes: &[Cube<D>], round: u32, seed: u64) -> Option<(Vec<Cell>, Lattice)> {
    let side = cubes.first()?.side;
    let cell = |cube: &Cube<D>| {
        let mut cell = Cell::WHOLE;
        for axis in 0..D {
            (cell.low[axis], cell.high[axis]) = (cube.low[axis], cube.low[axis] + cube.side);
        }
        cell
    };
    let mut across = [1; AXES];
    across[..D].fill((1.0 / side).round() as u32);
    let mean = if round == 0 { DARTS_PER_FIRST_CELL } else { DARTS_PER_LATER_CELL };
    let used: [usize; D] = std::array::from_fn(|axis| axis);
    let lattice = Lattice::new(across, &used, mean, mix(seed ^ u64::from(round)))?;
    Some((cubes.iter().map(cell).collect(), lattice))
}

/// Draws the uncovered regions of a round and returns the candidates in them, in random order.
fn round<const D: usize>(
    cubes: &[Cube<D>],
    number: u32,
    seed: u64,
    gpu: &mut Gpu<'_>,
) -> Result<Kept, JobError> {
    let regions = regions(cubes, number, seed);
    let (cells, lattice) = regions.ok_or_else(|| JobError::setting("no region to draw"))?;
    if number > 0 {
        // The host has read the candidates of the round before.
        gpu.wait();
    }
    Ok(draw(gpu, &format!("round {number}"), &cells, &lattice, &Everywhere)?)
}

/// The points as white squares on black.
fn picture(points: impl Iterator<Item = [f64; 2]>, side: u32, half: i64) -> Vec<Vec3> {
    let mut image = vec![Vec3::ZERO; (side * side) as usize];
    let last = i64::from(side) - 1;
    for [x, y] in points {
        let [column, row] = [x, 1.0 - y].map(|at| (at * f64::from(side)) as i64);
        for row in (row - half).max(0)..=(row + half).min(last) {
            for column in (column - half).max(0)..=(column + half).min(last) {
                image[(row * i64::from(side) + column) as usize] = Vec3::ONE;
            }
        }
    }
    image
}

/// First two coordinates of points; those of a line are on the middle of the image.
fn plane<const D: usize>(points: &[[f64; D]]) -> impl Iterator<Item = [f64; 2]> {
    points.iter().map(|point| [0, 1].map(|k| point.get(k).copied().unwrap_or(0.5)))
}

/// Share of points from passes below which a warning is given.
pub const MIN_DRAWN_SHARE: f64 = 0.9;
/// Candidates for a point above which a warning is given.
pub const MAX_CANDIDATES_PER_POINT: f64 = 20.0;

/// Warns if the host threw many of the darts.
fn host_warning(drawn: usize, points: usize) -> Option<Warning> {
    ((drawn as f64) < MIN_DRAWN_SHARE * points as f64).then(|| {
        let message = format!(
            "{drawn} of {points} points come from passes; the host found the others, so time and energy of the frame are not those of \
             all points; set more rounds"
        );
        Warning::new(Code::PointsFromHost, message)
    })
}

/// Warns if most candidates were rejected.
fn rejected_warning(candidates: u64, points: usize) -> Option<Warning> {
    let each = candidates as f64 / points.max(1) as f64;
    (each > MAX_CANDIDATES_PER_POINT).then(|| {
        let message = format!(
            "{each:.0} candidates were made for each point, so time and energy are those of rejections; bounds are loose for a count \
             this small: ask for more points"
        );
        Warning::new(Code::PointsRejected, message)
    })
}

impl Sampling {
    fn darts<const D: usize>(&self, seed: u64, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let PointOptions { radius, rounds, periodic, .. } = self.options;
        let domain = if periodic { Domain::Torus } else { Domain::Box };
        let spec = PoissonSpec { radius, domain, seed, spacing: Spacing::Double };
        let Rasterized { found, drawn, kept, candidates, .. } = darts::<D>(&spec, rounds, gpu)?;
        let facts = Fact::all([
            (fact::points, found.points.len() as f64),
            (fact::points_from_passes, drawn as f64),
            (fact::candidates, candidates as f64),
            (fact::candidates_in_regions, kept as f64),
            (fact::uncovered_regions, found.uncovered as f64),
            (fact::thin_regions, found.thin_regions as f64),
        ]);
        let side = self.settings.height;
        let image = picture(plane(&found.points), side, (0.15 * radius * f64::from(side)) as i64);
        let warnings = host_warning(drawn, found.points.len()).into_iter().collect();
        Ok(Drawn { image, moving: D > 2, lens: false, facts, warnings })
    }

    fn noise<const D: usize>(&self, seed: u64, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let spec = NoiseSpec { count: self.options.count, seed, across: columns_for(D) };
        let found: DrawnNoise<D> = draw_noise(&NamedDensity::Gauss, &spec, gpu).map_err(JobError::setting)?;
        let facts = Fact::all([
            (fact::points, found.points.len() as f64),
            (fact::candidates, found.candidates as f64),
            (fact::columns, found.columns as f64),
        ]);
        let image = picture(plane(&found.points), self.settings.height, 0);
        let warnings = rejected_warning(found.candidates, found.points.len()).into_iter().collect();
        // The density is one more dimension. The third is time, the others are the lens.
        Ok(Drawn { image, moving: D > 1, lens: D > 2, facts, warnings })
    }

    fn volume(&self, seed: u64, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let (side, samples) = (self.settings.height, self.settings.samples);
        let invalid = || JobError::setting(format_args!("{side} pixels, {samples} samples"));
        let source = HashedSamples::new(seed, side, samples, LensShape::Square).ok_or_else(invalid)?;
        let (domain, share): (&dyn Volume, f64) = match self.options.dimensions {
            4 => (&Blurred::FOUR, Blurred::FOUR.volume()),
            5 => (&Blurred::FIVE, Blurred::FIVE.volume()),
            _ => (&Torus { ring: 0.3, tube: 0.15 }, Torus::default().volume()),
        };
        let found = fill(domain, side, &source, gpu)?;
        let facts = Fact::all([
            (fact::points, found.points.len() as f64),
            (fact::points_expected, share * found.samples as f64),
            (fact::samples_covered, found.covered as f64),
        ]);
        let (moving, lens) = (self.options.dimensions != 4, self.options.dimensions > 3);
        Ok(Drawn { image: found.image, moving, lens, facts, ..Drawn::default() })
    }
}

impl Draws for Sampling {
    /// Frame number, which seeds the points.
    type Input = u32;

    fn settings(&self) -> &SceneSettings {
        &self.settings
    }

    fn input(&self, number: u32) -> Result<u32, JobError> {
        Ok(number)
    }

    fn draw(&self, &number: &u32, gpu: &mut Gpu<'_>) -> Result<Drawn, JobError> {
        let seed = mix(self.seed.wrapping_add(u64::from(number)));
        match (self.options.points, self.options.dimensions) {
            (PointKind::Darts, 2) => self.darts::<2>(seed, gpu),
            (PointKind::Darts, _) => self.darts::<3>(seed, gpu),
            (PointKind::Noise, 1) => self.noise::<1>(seed, gpu),
            (PointKind::Noise, 2) => self.noise::<2>(seed, gpu),
            (PointKind::Noise, 3) => self.noise::<3>(seed, gpu),
            (PointKind::Noise, _) => self.noise::<4>(seed, gpu),
            (PointKind::Volume, _) => self.volume(seed, gpu),
        }
    }
}

#[cfg(test)]
mod tests {
    use activity::{Counts, Event, Packet};

    use super::super::poisson::closer;
    use super::*;
    use crate::job::testing::hardware;
    use crate::scene::Overrides;

    fn made(set: &[(&str, &str)], size: (u32, u32)) -> Result<Box<dyn Job>, String> {
        let set = set.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
        let overrides = Overrides { size: Some(size), ..Overrides::default() };
        job(&OptionSource { file: None, set }, &JobRequest { overrides: &overrides, seed: 1 })
            .map_err(|error| error.to_string())
    }

    #[test]
    fn most_points_come_from_passes_and_packets_add_up() {
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
        // Five passes and the write-back.
        assert_eq!((report.counts(), passes), (sum, 6));
        let fact = |name: &str| drawn.facts.iter().find(|fact| fact.name == name).unwrap().value;
        assert!(fact("points_from_passes") > 0.9 * fact("points"), "{:?}", drawn.facts);
        assert!(drawn.image.contains(&Vec3::ONE) && report.triangles() > 1600);
        // The passes have no other results, so what is written back when the frame ends is points.
        assert!(report.write_back[Event::DramWriteBytes] > 0);
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
    fn settings_name_the_samples_in_use() {
        for (kind, table) in [("darts", "none"), ("noise", "none"), ("volume", "hashed")] {
            assert_eq!(made(&[("points", kind)], (64, 64)).unwrap().settings().table, table);
        }
    }

    #[test]
    fn options_out_of_range_are_refused() {
        let small = (64, 64);
        for (set, size, part) in [
            (&[("radius", "0.6")][..], small, "radius: 0.6"),
            (&[("rounds", "0")], small, "rounds: 0"),
            (&[("rounds", "2")], (64, 32), "width and height"),
            (&[("dimensions", "5")], small, "2 to 3"),
            (&[("points", "noise"), ("count", "1")], small, "count: 1"),
        ] {
            let message = made(set, size).err().unwrap();
            assert!(message.contains(part), "{message}");
        }
    }

    /// Candidates of drawn regions are those of the host in every round, in the plane and in space.
    fn rounds_agree<const D: usize>(radius: f64) {
        let spec = PoissonSpec { radius, domain: Domain::Torus, seed: 3, spacing: Spacing::Double };
        let hardware = hardware();
        let mut gpu = Gpu::without_packets(&hardware).unwrap();
        let mut rounds = 0;
        let draw = |cubes: &[Cube<D>]| {
            let drawn = round(cubes, rounds, 3, &mut gpu)?;
            let (cells, lattice) = regions(cubes, rounds, 3).unwrap();
            assert_eq!(drawn.points, super::super::drawn::on_host(&cells, &lattice, &Everywhere));
            assert!(!drawn.points.is_empty());
            rounds += 1;
            Ok::<_, JobError>(drawn.points.iter().map(|point| std::array::from_fn(|k| point[k])).collect())
        };
        let (found, _) = poisson_disk_drawn::<D, _>(&spec, 3, draw).unwrap().unwrap();
        assert_eq!(rounds, 3);
        // A vertex has three coordinates; those of prisms also have the ends of its span of time.
        let counts = gpu.finish().counts();
        assert_eq!(counts[Event::VertexBytes], (12 + 8 * (D as u64 - 2)) * counts[Event::VerticesFetched]);
        let hole = super::super::quality::largest_hole(&found.points, Domain::Torus);
        assert!(hole.radius <= radius * (1.0 + 1e-12), "{hole:?}");
        assert_eq!(super::super::quality::closer_than(&found.points, radius, Domain::Torus), 0);
    }

    #[test]
    fn candidates_of_regions_are_those_of_the_host() {
        rounds_agree::<2>(0.1);
        rounds_agree::<3>(0.25);
    }

    #[test]
    fn few_rounds_and_few_points_are_warned_about() {
        assert!(host_warning(89, 100).is_some() && host_warning(90, 100).is_none());
        assert!(rejected_warning(2001, 100).is_some() && rejected_warning(2000, 100).is_none());
    }
}
