//! Points by rasterization beside the CPU sampler: time and energy of a frame on the reference GPU, CPU time
//! of one thread, and the error of both; and where rasterization fails.

use activity::Event;
use cpu_time::ThreadTime;
use output::terminal::Progress;
use pipeline::Gpu;
use pipeline::sampling::{HashedSamples, LensShape};
use run::{GpuSpec, Plan, RunOptions, frames_of};
use serde::Serialize;
use workloads::job::OptionSource;
use workloads::points::job::rasterized;
use workloads::points::poisson::{Domain, PoissonSpec, Spacing, poisson_disk};
use workloads::points::quality::{chi_square, largest_hole};
use workloads::points::volume::{Blurred, Torus, Volume, every_sample, standard_mode};
use workloads::points::white::{NamedDensity, Numbers, WhiteSpec, columns_for, counts, shares, white_noise};
use workloads::points::{DrawnNoise, NoiseSpec, draw_noise};
use workloads::scene::Overrides;

use super::{PointsEffort, one_thread};
use crate::study::StudyError;

/// One kind of points in one number of dimensions.
#[derive(Clone, Debug, Serialize)]
pub struct DrawnRow {
    /// Kind of points: darts, noise or volume.
    pub kind: &'static str,
    /// Dimensions.
    pub dimensions: u32,
    /// Points of the frame.
    pub points: u64,
    /// Triangles drawn.
    pub triangles: usize,
    /// Operations of the shader.
    pub shader_ops: u64,
    /// Seconds of the frame on the reference GPU.
    pub frame_s: f64,
    /// Joules of the frame while busy.
    pub frame_j: f64,
    /// CPU time of one thread of the CPU sampler for as many points.
    pub cpu_s: f64,
    /// Darts: largest hole beyond r, in r. Noise: p of chi-square. Volume: standard errors that the count is off.
    pub error: f64,
    /// The same of the CPU sampler.
    pub cpu_error: f64,
}

/// A setting at which rasterization may fail.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Weak {
    /// Rounds of darts in 2D, or points of noise in 4D.
    pub at: f64,
    /// Share of points from passes, or candidates for a point.
    pub value: f64,
}

/// Pixels along a side, and samples, of volumes.
const VOLUME_SIZE: [u32; 2] = [512, 4];

/// All kinds.
pub(super) fn rows(effort: &PointsEffort) -> Result<Vec<DrawnRow>, StudyError> {
    let cells = [64, 24, 8, 4];
    Ok(vec![
        darts::<2>(effort.radius[0])?,
        darts::<3>(effort.radius[1])?,
        noise::<1>(effort, cells[0])?,
        noise::<2>(effort, cells[1])?,
        noise::<3>(effort, cells[2])?,
        noise::<4>(effort, cells[3])?,
        volume(3, &Torus::default(), Torus::default().volume())?,
        volume(4, &Blurred::FOUR, Blurred::FOUR.volume())?,
        volume(5, &Blurred::FIVE, Blurred::FIVE.volume())?,
    ])
}

/// A frame of the workload; errors are left at 0.
fn frame(kind: &'static str, dimensions: u32, more: (&str, String)) -> Result<DrawnRow, StudyError> {
    let set = [("points", kind.to_owned()), ("dimensions", dimensions.to_string()), more];
    let options = OptionSource { file: None, set: set.map(|(name, value)| (name.to_owned(), value)).into() };
    let size = Some((VOLUME_SIZE[0], VOLUME_SIZE[0]));
    let overrides = Overrides { size, frames: Some(0..1), ..Overrides::default() };
    let plan =
        Plan::resolve(RunOptions { scene: "sampling".into(), options, overrides, ..RunOptions::default() })?;
    let frames = frames_of(&plan, &[0], &Progress::new(true))?;
    let (counts, points) = frames[0].observed().map_or_else(Default::default, |observed| {
        let points = observed.facts.iter().find(|fact| fact.name == "points").map_or(0.0, |fact| fact.value);
        (observed.counts, points as u64)
    });
    let cost = frames[0].cost();
    Ok(DrawnRow {
        kind,
        dimensions,
        points,
        triangles: frames[0].triangles,
        shader_ops: counts[Event::ShaderOps],
        frame_s: cost.cycles / plan.gpu().core_hz,
        frame_j: cost.energy_j,
        cpu_s: 0.0,
        error: 0.0,
        cpu_error: 0.0,
    })
}

/// CPU time of one thread, and what it computed.
fn timed<T: Send>(work: impl FnOnce() -> T + Send) -> (f64, T) {
    let started = ThreadTime::now();
    let result = one_thread(work);
    (started.elapsed().as_secs_f64(), result)
}

fn darts_spec(radius: f64) -> PoissonSpec {
    PoissonSpec { radius, domain: Domain::Torus, seed: 1, spacing: Spacing::Double }
}

fn darts<const D: usize>(radius: f64) -> Result<DrawnRow, StudyError> {
    let row = frame("darts", D as u32, ("radius", radius.to_string()))?;
    let spec = darts_spec(radius);
    let (drawn, _) =
        rasterized::<D>(&spec, 5, &GpuSpec::load("reference")?.pipeline).map_err(StudyError::pipeline)?;
    let (cpu_s, found) = timed(|| poisson_disk::<D>(&spec));
    let found = found.map_err(StudyError::pipeline)?;
    let beyond = |points: &[[f64; D]]| (largest_hole(points, Domain::Torus).radius / radius - 1.0).max(0.0);
    Ok(DrawnRow { cpu_s, error: beyond(&drawn.found.points), cpu_error: beyond(&found.points), ..row })
}

fn drawn_noise<const D: usize>(count: f64) -> Result<DrawnNoise<D>, StudyError> {
    let hardware = GpuSpec::load("reference")?.pipeline;
    let mut gpu = Gpu::without_packets(&hardware).map_err(StudyError::pipeline)?;
    let spec = NoiseSpec { count, seed: 1, across: columns_for(D) };
    draw_noise::<D>(&NamedDensity::Gauss, &spec, &mut gpu).map_err(StudyError::pipeline)
}

fn noise<const D: usize>(effort: &PointsEffort, cells: u64) -> Result<DrawnRow, StudyError> {
    let row = frame("noise", D as u32, ("count", effort.white.to_string()))?;
    let drawn = drawn_noise::<D>(effort.white as f64)?;
    let spec =
        WhiteSpec { count: effort.white, seed: 1, across: columns_for(D), numbers: Numbers::Independent };
    let (cpu_s, found) = timed(|| white_noise::<D>(&NamedDensity::Gauss, &spec));
    let found = found.map_err(StudyError::pipeline)?;
    let expected = shares::<D>(&NamedDensity::Gauss, cells, 8);
    let p = |points: &[[f64; D]]| chi_square(&counts(points, cells), &expected).p;
    Ok(DrawnRow { cpu_s, error: p(&drawn.points), cpu_error: p(&found.points), ..row })
}

fn volume(dimensions: u32, domain: &dyn Volume, share: f64) -> Result<DrawnRow, StudyError> {
    let row = frame("volume", dimensions, ("rounds", 5.to_string()))?;
    let [side, per_pixel] = VOLUME_SIZE;
    let samples = HashedSamples::new(1, side, per_pixel, LensShape::Square)
        .ok_or_else(|| StudyError::pipeline("samples of a volume"))?;
    let hardware = GpuSpec::load("reference")?.pipeline;
    let (drawn, _) = standard_mode(domain, side, &samples, &hardware).map_err(StudyError::pipeline)?;
    let (cpu_s, found) = timed(|| every_sample(domain, side, &samples));
    let all = drawn.samples as f64;
    let off = |count: usize| (count as f64 - all * share) / (all * share * (1.0 - share)).sqrt();
    Ok(DrawnRow { cpu_s, error: off(drawn.points.len()), cpu_error: off(found.len()), ..row })
}

/// Share of the points of the plane that come from passes, over rounds.
pub(super) fn rounds(effort: &PointsEffort) -> Result<Vec<Weak>, StudyError> {
    let hardware = GpuSpec::load("reference")?.pipeline;
    let at = |rounds: u32| {
        let spec = darts_spec(effort.radius[0]);
        let (drawn, _) = rasterized::<2>(&spec, rounds, &hardware).map_err(StudyError::pipeline)?;
        Ok(Weak { at: f64::from(rounds), value: drawn.drawn as f64 / drawn.found.points.len() as f64 })
    };
    (1..=8).map(at).collect()
}

/// Candidates for a point of noise in 4D, over the number of points.
pub(super) fn rejected(effort: &PointsEffort) -> Result<Vec<Weak>, StudyError> {
    let counts = [100.0, 1000.0, 10_000.0, 100_000.0, 1_000_000.0];
    let at = |count: f64| {
        let drawn = drawn_noise::<4>(count)?;
        Ok(Weak { at: count, value: drawn.candidates as f64 / drawn.points.len().max(1) as f64 })
    };
    counts.into_iter().filter(|count| *count <= effort.white as f64).map(at).collect()
}
