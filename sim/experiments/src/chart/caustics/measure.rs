//! Oceans, and what methods do for them.

use cpu_time::ThreadTime;
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::Serialize;
use workloads::caustics::generator::Ocean as Water;
use workloads::caustics::{
    Floor, Light, MIN_SQUARES_PER_WAVE, Method, Picture, Squares, accuracy_warnings, crossing, draw, error,
};

use super::view::{DEPTH_M, SIDE_M, SLOPE, SQUARE_PX, above, aside, aside_of, water};
use super::{CausticsChart, Coarse, Effort, Row, crossed};
use crate::study::StudyError;
use output::progress::{Bar, Progress};

/// Slopes of the oceans that get coarser.
const COARSE_SLOPES: [f64; 5] = [0.05, 0.15, 0.4, 0.7, 1.0];

/// What every method does for one ocean seen from the side.
#[derive(Clone, Debug, Serialize)]
pub struct Ocean {
    /// Generator triangles.
    pub volumes: usize,
    /// Pixels of the image.
    pub size: [u32; 2],
    /// Shader executions by method, in the order of [`Method::ALL`].
    pub executions: [u64; 4],
    /// The most executions of a pixel, likewise.
    pub most: [u32; 4],
    /// Executions of every pixel.
    #[serde(skip)]
    pub runs: Vec<Vec<u32>>,
}

/// Counts the executions of every method on an ocean of `2 cells^2` volumes, its waves of this slope and so many metres deep.
///
/// # Errors
/// When `size` is no size of an image.
pub fn ocean(
    cells: u32,
    [slope, depth_m]: [f64; 2],
    size: [u32; 2],
    progress: &Progress,
) -> Result<Ocean, StudyError> {
    let water = Water { depth_m, ..water(cells, slope) };
    let (beams, eye) = (water.beams(0.0), aside_of(depth_m, size)?);
    let bar = progress.bar("ocean", 4);
    let pictures = Method::ALL.map(|method| {
        let picture = draw(&beams, &eye, method, None);
        bar.inc();
        picture
    });
    Ok(Ocean {
        volumes: beams.len(),
        size,
        executions: pictures.each_ref().map(Picture::total_runs),
        most: pictures.each_ref().map(|picture| picture.runs.iter().copied().max().unwrap_or(0)),
        runs: pictures.map(|picture| picture.runs).into(),
    })
}

pub(super) fn measure(effort: Effort, progress: &Progress) -> Result<CausticsChart, StudyError> {
    let ocean = ocean(effort.ocean_cells, [SLOPE, DEPTH_M], effort.ocean_px, progress)?;
    let steps = effort.slopes.len() * 4
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
    let crossed = crossed::measure(&effort, &bar)?;
    Ok(CausticsChart { effort, ocean, resolved_cells: resolved_cells(), rows, coarse, crossed })
}

/// Every method on one surface: the light in the volume.
fn by_method(effort: &Effort, slope: f64, thread: &ThreadPool, bar: &Bar) -> Result<Vec<Row>, StudyError> {
    let (beams, eye) = (water(effort.sweep_cells, slope).beams(0.0), aside(effort.sweep_px)?);
    let ours = draw(&beams, &eye, Method::Moving, Some(Light::Volume));
    let crossing = crossing(&beams);
    let row = |method| {
        let once = || {
            let start = ThreadTime::now();
            let picture = draw(&beams, &eye, method, Some(Light::Volume));
            (start.elapsed().as_secs_f64(), picture)
        };
        let mut runs = thread
            .install(|| -> Vec<_> { std::iter::repeat_with(once).take(effort.repeats.max(1)).collect() });
        runs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (cpu_s, picture) = &runs[runs.len() / 2];
        bar.inc();
        Row {
            slope,
            crossing,
            method,
            executions: picture.total_runs(),
            useful: picture.useful_share(),
            difference: ours.farthest(picture),
            cpu_s: *cpu_s,
        }
    };
    Ok(Method::ALL.map(row).into())
}

/// One surface of fewer and fewer triangles against photons that are refracted at the waves themselves: the light on the floor.
fn by_cells(effort: &Effort, slope: f64, bar: &Bar) -> Result<Vec<Coarse>, StudyError> {
    let eye = above(effort.floor_px)?;
    let squares = Squares { eye: &eye, side_px: SQUARE_PX };
    let floor = Floor { height_m: -DEPTH_M };
    let surface = |cells: u32| Water { overshoot: 0.02, ..water(cells, slope) };
    let photons = |seed: u32| squares.on_floor(&surface(1), 0.0, &floor, [effort.rays, seed]);
    let known = photons(1);
    let noise = error(&photons(2), &known);
    let row = |&cells: &u32| {
        let surface = surface(cells);
        let beams = surface.beams(0.0);
        let found = draw(&beams, &eye, Method::Moving, Some(Light::Floor(floor))).light;
        bar.inc();
        let warned = !accuracy_warnings(&surface, &beams).is_empty();
        let error = error(&squares.of_image(&found), &known);
        Coarse { cells, slope, crossing: crossing(&beams), error, noise, warned }
    };
    Ok(effort.coarse_cells.iter().map(row).collect())
}

/// So many squares along a side, and a run does not warn of a surface that is too coarse.
fn resolved_cells() -> f64 {
    MIN_SQUARES_PER_WAVE * SIDE_M / water(1, SLOPE).shortest_m()
}
