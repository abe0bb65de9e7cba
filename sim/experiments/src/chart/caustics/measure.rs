//! Caustics of an ocean by every method, and of crossed light volumes: the same light through the same number
//! of triangles, on increasingly crossed sides. Also the water of the figures and its views.

use activity::Event;
use cpu_time::ThreadTime;
use glam::DVec3;
use output::terminal::{Bar, Progress};
use rayon::{ThreadPool, ThreadPoolBuilder};
use run::{Plan, RunOptions, frames_of};
use serde::Serialize;
use workloads::caustics::generator::Ocean;
use workloads::caustics::{
    Beam, BeamMethod, Eye, Floor, LightPicture, LightQuantity, MIN_SQUARES_PER_WAVE, Squares,
    accuracy_warnings, crossing, draw, error,
};
use workloads::job::OptionSource;
use workloads::scene::Overrides;

use super::{CausticsChart, CausticsEffort, CausticsRow, CoarseSurface, KEYS};
use crate::study::StudyError;

/// Slopes of the oceans that get coarser.
const COARSE_SLOPES: [f64; 5] = [0.05, 0.15, 0.4, 0.7, 1.0];

/// Results of every method for one ocean seen from the side.
#[derive(Clone, Debug, Serialize)]
pub struct OceanCounts {
    /// Generator triangles.
    pub volumes: usize,
    /// Pixels of the image.
    pub size: [u32; 2],
    /// Shader executions by method, in the order of [`BeamMethod::ALL`].
    pub executions: [u64; 4],
    /// Pictures drawn.
    pub draws: u64,
    /// The most executions of a pixel, likewise.
    pub most: [u32; 4],
    /// Executions of every pixel.
    #[serde(skip)]
    pub runs: Vec<Vec<u32>>,
}

/// Counts the executions of every method on an ocean of `2 cells^2` volumes, its waves of this slope and so
/// many metres deep.
///
/// # Errors
/// When the width or the height in `size` is zero or too large.
pub fn ocean(
    cells: u32,
    [slope, depth_m]: [f64; 2],
    size: [u32; 2],
    progress: &Progress,
) -> Result<OceanCounts, StudyError> {
    let water = Ocean { depth_m, ..water(cells, slope) };
    let (beams, eye) = (water.beams(0.0), aside_of(depth_m, size)?);
    let bar = progress.bar("ocean", 4);
    let pictures = BeamMethod::ALL.map(|method| {
        let picture = draw(&beams, &eye, method, None);
        bar.inc();
        picture
    });
    Ok(OceanCounts {
        volumes: beams.len(),
        size,
        executions: pictures.each_ref().map(LightPicture::total_runs),
        draws: pictures.len() as u64,
        most: pictures.each_ref().map(|picture| picture.runs.iter().copied().max().unwrap_or(0)),
        runs: pictures.map(|picture| picture.runs).into(),
    })
}

pub(super) fn measure(effort: CausticsEffort, progress: &Progress) -> Result<CausticsChart, StudyError> {
    let ocean = ocean(effort.ocean_cells, [SLOPE, DEPTH_M], effort.ocean_px, progress)?;
    let steps = (effort.slopes.len() + effort.frame_slopes.len()) * 4
        + COARSE_SLOPES.len() * effort.coarse_cells.len()
        + effort.pleated_cells.len() * effort.pleats.len();
    let bar = progress.bar("caustics", steps as u64);
    let thread = ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut rows = Vec::new();
    for &slope in effort.slopes {
        rows.extend(by_method(&effort, slope, &thread, &bar)?);
    }
    let mut coarse = Vec::new();
    for slope in COARSE_SLOPES {
        coarse.extend(by_cells(&effort, slope, &bar)?);
    }
    let crossed = crossed(&effort, &bar)?;
    let mut frames = Vec::new();
    for &slope in effort.frame_slopes {
        for place in 0..BeamMethod::ALL.len() {
            frames.push(frame(&effort, slope, place)?);
            bar.inc();
        }
    }
    Ok(CausticsChart { effort, ocean, resolved_cells: resolved_cells(), rows, coarse, crossed, frames })
}

/// A frame of `quintile run caustics` on the reference GPU.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MethodFrame {
    /// Root mean square of the slope of the surface.
    pub slope: f64,
    /// How beams are bounded.
    pub method: BeamMethod,
    /// Triangles drawn.
    pub triangles: usize,
    /// Pixels tested.
    pub tests: u64,
    /// Executions of the shader of the light: one for every covered pixel.
    pub executions: u64,
    /// Operations of all shaders.
    pub shader_ops: u64,
    /// Seconds.
    pub frame_s: f64,
    /// Joules while busy.
    pub frame_j: f64,
}

/// The first frame by the method at `place`, with what its packets count.
fn frame(effort: &CausticsEffort, slope: f64, place: usize) -> Result<MethodFrame, StudyError> {
    let cells = effort.frame_cells.to_string();
    let set = [("cells", cells), ("slope", slope.to_string()), ("method", KEYS[place].to_owned())];
    let options = OptionSource { file: None, set: set.map(|(name, value)| (name.to_owned(), value)).into() };
    let size = Some((effort.frame_px[0], effort.frame_px[1]));
    let overrides = Overrides { size, frames: Some(0..1), ..Overrides::default() };
    let plan =
        Plan::resolve(RunOptions { scene: "caustics".into(), options, overrides, ..RunOptions::default() })?;
    let frames = frames_of(&plan, &[0], &Progress::new(true))?;
    let counts = frames[0].observed().map(|observed| observed.counts).unwrap_or_default();
    let cost = frames[0].cost();
    Ok(MethodFrame {
        slope,
        method: BeamMethod::ALL[place],
        triangles: frames[0].triangles,
        tests: counts[Event::SamplesTested],
        executions: counts[Event::SamplesHit],
        shader_ops: counts[Event::ShaderOps],
        frame_s: cost.cycles / plan.gpu().core_hz,
        frame_j: cost.energy_j,
    })
}

/// Every method on one surface: the light in the volume.
fn by_method(
    effort: &CausticsEffort,
    slope: f64,
    thread: &ThreadPool,
    bar: &Bar,
) -> Result<Vec<CausticsRow>, StudyError> {
    let (beams, eye) = (water(effort.sweep_cells, slope).beams(0.0), aside(effort.sweep_px)?);
    let ours = draw(&beams, &eye, BeamMethod::Moving, Some(LightQuantity::Volume));
    let crossing = crossing(&beams);
    let row = |method| {
        let once = || {
            let start = ThreadTime::now();
            let picture = draw(&beams, &eye, method, Some(LightQuantity::Volume));
            (start.elapsed().as_secs_f64(), picture)
        };
        let mut runs = thread
            .install(|| -> Vec<_> { std::iter::repeat_with(once).take(effort.repeats.max(1)).collect() });
        runs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (cpu_s, picture) = &runs[runs.len() / 2];
        bar.inc();
        CausticsRow {
            slope,
            crossing,
            method,
            executions: picture.total_runs(),
            useful: picture.useful_share(),
            difference: ours.farthest(picture),
            cpu_s: *cpu_s,
        }
    };
    Ok(BeamMethod::ALL.map(row).into())
}

/// One surface of fewer and fewer triangles against photons that are refracted at the waves themselves: the
/// light on the floor.
fn by_cells(effort: &CausticsEffort, slope: f64, bar: &Bar) -> Result<Vec<CoarseSurface>, StudyError> {
    let eye = above(effort.floor_px)?;
    let squares = Squares { eye: &eye, side_px: SQUARE_PX };
    let floor = Floor { height_m: -DEPTH_M };
    let surface = |cells: u32| Ocean { overshoot: 0.02, ..water(cells, slope) };
    let photons = |seed: u32| squares.on_floor(&surface(1), 0.0, &floor, [effort.rays, seed]);
    let known = photons(1);
    let noise = error(&photons(2), &known);
    let row = |&cells: &u32| {
        let surface = surface(cells);
        let beams = surface.beams(0.0);
        let found = draw(&beams, &eye, BeamMethod::Moving, Some(LightQuantity::Floor(floor))).light;
        bar.inc();
        let warned = !accuracy_warnings(&surface, &beams).is_empty();
        let error = error(&squares.of_image(&found), &known);
        CoarseSurface { cells, slope, crossing: crossing(&beams), error, noise, warned }
    };
    Ok(effort.coarse_cells.iter().map(row).collect())
}

/// So many squares along a side, and a run does not warn of a surface that is too coarse.
fn resolved_cells() -> f64 {
    MIN_SQUARES_PER_WAVE * SIDE_M / water(1, SLOPE).shortest_m()
}

/// Depth of the water in metres: half of all beams fold above the floor.
const FOLDED_DEPTH_M: f64 = 8.0;
/// Slope of the waves.
const FOLDED_SLOPE: f64 = 0.3;
/// Beams go on below the floor, so that it does not lie at their ends, where pleats would not matter.
const OVERSHOOT: f64 = 0.25;
/// Photons in the volume, of all beams.
const PHOTONS: usize = 8_000_000;

/// One pleat of one surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Crossed {
    /// Squares along a side.
    pub cells: u32,
    /// How far every other column of corners lies down its light, as a part of its length.
    pub pleat: f64,
    /// For how much of their length sides of beams cross.
    pub crossing: f64,
    /// Mean difference of the light on the floor from photons refracted at the waves themselves, as a part of
    /// its mean.
    pub floor_error: f64,
    /// Error of other photons of that kind.
    pub noise: f64,
    /// Mean difference of the light in the volume from photons through the same triangles, as a part of its mean.
    pub volume_error: f64,
    /// The part of the light in the volume that all methods miss, by the same photons.
    pub missing: f64,
    /// The part of the light in the volume that the refined bound without cuts loses.
    pub lost: f64,
    /// Shader executions by method, in the order of [`BeamMethod::ALL`].
    pub executions: [u64; 4],
    /// The share of them that finds light, likewise.
    pub useful: [f64; 4],
    /// Largest difference of a pixel from the image of the moving triangles, by any method of [`BeamMethod::ALL`].
    pub difference: f64,
    /// Whether the run warns of crossed sides.
    pub warned: bool,
}

/// Surfaces, views and photons of one number of triangles.
struct Bench {
    surface: Ocean,
    above: Eye,
    aside: Eye,
    /// Light on the floor, and by other photons.
    known: [Vec<f64>; 2],
}

/// Every pleat of every number of triangles.
fn crossed(effort: &CausticsEffort, bar: &Bar) -> Result<Vec<Crossed>, StudyError> {
    let mut rows = Vec::new();
    for &cells in effort.pleated_cells {
        let bench = Bench::new(effort, cells)?;
        for &pleat in effort.pleats {
            rows.push(bench.row(pleat));
            bar.inc();
        }
    }
    Ok(rows)
}

fn floor() -> Floor {
    Floor { height_m: -FOLDED_DEPTH_M }
}

impl Bench {
    fn new(effort: &CausticsEffort, cells: u32) -> Result<Self, StudyError> {
        let surface = Ocean { overshoot: OVERSHOOT, depth_m: FOLDED_DEPTH_M, ..water(cells, FOLDED_SLOPE) };
        let middle = DVec3::new(1.5, -0.6 * FOLDED_DEPTH_M, 1.0);
        let aside = from_the_side(middle, FOLDED_DEPTH_M, effort.sweep_px)?;
        let above = above(effort.floor_px)?;
        let squares = Squares { eye: &above, side_px: SQUARE_PX };
        let known = [1, 2].map(|seed| squares.on_floor(&surface, 0.0, &floor(), [effort.rays, seed]));
        Ok(Self { surface, above, aside, known })
    }

    fn row(&self, pleat: f64) -> Crossed {
        let surface = Ocean { pleat, ..self.surface.clone() };
        let beams = surface.beams(0.0);
        let pictures =
            BeamMethod::ALL.map(|method| draw(&beams, &self.aside, method, Some(LightQuantity::Volume)));
        let ours = &pictures[0];
        let uncut = draw(&beams, &self.aside, BeamMethod::Uncut, Some(LightQuantity::Volume));
        let sum = |picture: &LightPicture| picture.light.iter().sum::<f64>();
        let (volume_error, missing) = self.volume(&beams, ours);
        Crossed {
            cells: surface.cells,
            pleat,
            crossing: crossing(&beams),
            floor_error: self.floor_error(&beams),
            noise: error(&self.known[1], &self.known[0]),
            volume_error,
            missing,
            lost: 1.0 - sum(&uncut) / sum(ours),
            executions: pictures.each_ref().map(LightPicture::total_runs),
            useful: pictures.each_ref().map(LightPicture::useful_share),
            difference: pictures.iter().map(|other| ours.farthest(other)).fold(0.0, f64::max),
            warned: accuracy_warnings(&surface, &beams)
                .iter()
                .any(|warning| warning.code == "caustics-crossed"),
        }
    }

    fn floor_error(&self, beams: &[Beam]) -> f64 {
        let squares = Squares { eye: &self.above, side_px: SQUARE_PX };
        let image = draw(beams, &self.above, BeamMethod::Moving, Some(LightQuantity::Floor(floor())));
        error(&squares.of_image(&image.light), &self.known[0])
    }

    /// The error of the light in the volume, and the part of it that is missing.
    fn volume(&self, beams: &[Beam], ours: &LightPicture) -> (f64, f64) {
        let squares = Squares { eye: &self.aside, side_px: SQUARE_PX };
        let (found, photons) =
            (squares.of_image(&ours.light), squares.in_volume(beams, (PHOTONS / beams.len()) as u32));
        (error(&found, &photons), 1.0 - found.iter().sum::<f64>() / photons.iter().sum::<f64>())
    }
}

/// Side and depth of the water and its longest waves, in metres.
pub(crate) const SIDE_M: f64 = 16.0;
pub(crate) const DEPTH_M: f64 = 5.0;
pub(crate) const WAVE_M: f64 = 4.0;
/// The slope of the paper's ocean is not given; this is a fresh breeze (Cox and Munk 1954 have 0.15 at some 4 m/s).
pub(crate) const SLOPE: f64 = 0.15;
/// Decides what the waves are like.
const SEED: u64 = 1;
/// Pixels along a side of the squares that are compared: next to a focus single pixels have no bound.
const SQUARE_PX: u32 = 8;

pub(crate) fn water(cells: u32, slope: f64) -> Ocean {
    Ocean::new(cells, SIDE_M, DEPTH_M, [WAVE_M, slope], SEED)
}

/// All of the water from the side, a little above and askew.
pub(crate) fn aside(size: [u32; 2]) -> Result<Eye, StudyError> {
    aside_of(DEPTH_M, size)
}

/// The same for water of another depth.
pub(crate) fn aside_of(depth_m: f64, size: [u32; 2]) -> Result<Eye, StudyError> {
    from_the_side(DVec3::new(0.6, -0.5 * depth_m, 0.3), 6.5, size)
}

/// Water about `middle`, `reach` metres up and down.
fn from_the_side(middle: DVec3, reach: f64, size: [u32; 2]) -> Result<Eye, StudyError> {
    let from = middle + 80.0 * DVec3::new(0.3, 0.35, 1.0).normalize();
    eye([from, middle, DVec3::Y], reach, size)
}

/// The middle of the floor from above.
pub(crate) fn above(side: u32) -> Result<Eye, StudyError> {
    eye([10.0 * DVec3::Y, DVec3::ZERO, DVec3::NEG_Z], 0.3 * SIDE_M, [side; 2])
}

fn eye(place: [DVec3; 3], reach: f64, size: [u32; 2]) -> Result<Eye, StudyError> {
    Eye::new(place, reach, size).ok_or_else(|| StudyError::Pipeline("a view without extent".to_owned()))
}
