//! Yards, and what queries find in them.

use glam::Vec3;
use pipeline::depth::BoxGrid;
use pipeline::geometry::Projection;
use pipeline::memory::CacheError;
use pipeline::{LensShape, SampleTable, Settings, Viewport};
use rayon::prelude::*;
use workloads::occlusion::{
    Answer, Pyramid, Queries, SampledAnswer, Samples, WallScene, WallSceneSpec, depths,
};
use workloads::visibility::Unshaded;

use super::{Effort, Kind, OcclusionChart, Row};
use crate::study::StudyError;
use output::progress::{Bar, Progress};
use run::GpuSpec;

/// Boxes of lens and time by kind: for what moves along t, for what is out of focus along u and v, for both along all.
const IN_TIME: [[u32; 3]; 5] = [[1, 1, 1], [1, 1, 2], [1, 1, 4], [1, 1, 8], [1, 1, 16]];
const ON_LENS: [[u32; 3]; 4] = [[1, 1, 1], [2, 2, 1], [4, 4, 1], [8, 8, 1]];
const IN_BOTH: [[u32; 3]; 5] = [[1, 1, 1], [1, 1, 4], [2, 2, 1], [2, 2, 4], [4, 4, 8]];
/// Samples in a pixel where boxes and tiles are swept, and the tile and the samples' seed elsewhere.
const SAMPLES: u32 = 16;
const TILE_PX: u32 = 8;
/// Tiles where occluders get smaller.
pub(super) const FAILING_TILES: [u32; 2] = [4, TILE_PX];
const SEED: u64 = 7;
/// Walls, their motion in metres and the radius of the lens.
const WALLS: u32 = 12;
const MOTION: f32 = 1.5;
const LENS: f32 = 0.15;
/// The part of a wall of slats that is gaps.
pub(super) const GAPS: f32 = 0.02;

impl Kind {
    /// A scene of this kind with so many boxes, its walls whole.
    pub(crate) fn spec(self, boxes: u32, seed: u64) -> WallSceneSpec {
        let motion = if self == Self::Defocus { 0.0 } else { MOTION };
        let lens = if self == Self::Motion { 0.0 } else { LENS };
        WallSceneSpec { walls: WALLS, slats: 1, gaps: 0.0, boxes, motion, lens, seed }
    }

    fn boxes(self) -> &'static [[u32; 3]] {
        match self {
            Self::Motion => &IN_TIME,
            Self::Defocus => &ON_LENS,
            Self::Both => &IN_BOTH,
        }
    }

    /// Boxes in the middle of the range.
    pub(crate) fn typical(self) -> [u32; 3] {
        match self {
            Self::Motion => [1, 1, 8],
            Self::Defocus => [4, 4, 1],
            Self::Both => [2, 2, 4],
        }
    }
}

/// A scene whose walls are drawn and whose boxes were tested by samples.
pub(crate) struct Drawn {
    scene: WallScene,
    viewport: Viewport,
    table: SampleTable,
    depths: Vec<f32>,
    /// What sampled queries found, by box.
    pub seen: Vec<SampledAnswer>,
}

fn refused(error: CacheError) -> StudyError {
    StudyError::Pipeline(error.to_string())
}

impl Drawn {
    /// Draws the walls of a scene into an image of `size` with `samples` in a pixel, and tests every box by samples.
    ///
    /// # Errors
    /// When no such scene or image exists.
    pub fn new(size: [u32; 2], scene: &WallSceneSpec, samples: u32) -> Result<Self, StudyError> {
        let scene = scene.wall_scene().ok_or_else(|| StudyError::Pipeline("a wall scene".to_owned()))?;
        let gpu = GpuSpec::load("reference")?;
        let viewport = Viewport::new(size[0], size[1])
            .ok_or_else(|| StudyError::Pipeline("an image without area".to_owned()))?;
        let table = SampleTable::low_discrepancy(samples, SEED, LensShape::Disk)?;
        let settings = Settings { spec: &gpu.pipeline, viewport, samples: &table, background: Vec3::ZERO };
        let walls = scene.walls(&Unshaded).map_err(|error| StudyError::Pipeline(error.to_string()))?;
        let depths = depths(&scene.camera, &[walls], &settings).map_err(refused)?;
        let queries = Samples { camera: &scene.camera, settings: &settings, depths: &depths };
        let seen = scene.boxes.par_iter().map(|object| queries.ask(object));
        let seen = seen.collect::<Result<_, _>>().map_err(refused)?;
        Ok(Self { scene, viewport, table, depths, seen })
    }

    /// Samples whose depths are stored.
    pub fn stored(&self) -> usize {
        self.depths.len()
    }

    /// By intervals, with so many boxes of lens and time and tiles of this side.
    pub fn ask(&self, boxes: [u32; 3], tile_px: u32) -> (Vec<Answer>, f64) {
        let grid = BoxGrid::new(boxes, self.scene.camera.lens().is_some()).unwrap_or_default();
        let pyramid = Pyramid::new(self.viewport, &self.table, &self.depths, tile_px, grid);
        let projection = Projection::new(&self.scene.camera, self.viewport);
        let queries = Queries::new(&pyramid, &projection);
        let answers = self.scene.boxes.iter().map(|object| queries.ask(object)).collect();
        (answers, pyramid.half_covered())
    }
}

/// What one way of asking costs, `[tests, bytes, madds]`, and whether it finds an object hidden.
type Answered = (bool, [u64; 3]);

/// A row from the answers for all objects, and whether it is truly hidden.
fn row(like: Row, answers: &[(Answered, bool)]) -> Row {
    let count = |of: &dyn Fn(bool, bool) -> bool| {
        answers.iter().filter(|((says, _), truly)| of(*says, *truly)).count() as u64
    };
    let mean = |of: usize| {
        answers.iter().map(|((_, cost), _)| cost[of]).sum::<u64>() as f64 / answers.len().max(1) as f64
    };
    Row {
        objects: answers.len() as u64,
        hidden: count(&|_, truly| truly),
        found: count(&|says, truly| says && truly),
        wrong: count(&|says, truly| says && !truly),
        tests: mean(0),
        bytes: mean(1),
        madds: mean(2),
        ..like
    }
}

fn blank(kind: Kind, slats: u32, samples: u32) -> Row {
    Row {
        kind,
        slats,
        samples,
        tile_px: None,
        boxes: None,
        objects: 0,
        hidden: 0,
        found: 0,
        wrong: 0,
        half_covered: 0.0,
        tests: 0.0,
        bytes: 0.0,
        madds: 0.0,
    }
}

fn by_intervals(yards: &[Drawn], like: Row, boxes: [u32; 3], tile_px: u32) -> Row {
    let (mut answered, mut half_covered) = (Vec::new(), 0.0);
    for drawn in yards {
        let (answers, half) = drawn.ask(boxes, tile_px);
        half_covered += half / yards.len() as f64;
        let all = answers.iter().zip(&drawn.seen).map(|(answer, seen)| {
            ((answer.hidden, [answer.tests(), answer.bytes(), answer.madds]), seen.passed == 0)
        });
        answered.extend(all);
    }
    row(Row { tile_px: Some(tile_px), boxes: Some(boxes), half_covered, ..like }, &answered)
}

fn by_samples(yards: &[Drawn], like: Row) -> Row {
    let all = yards.iter().flat_map(|drawn| &drawn.seen).map(|seen| {
        let hidden = seen.passed == 0;
        ((hidden, [seen.tests(), seen.bytes(), seen.madds]), hidden)
    });
    row(like, &all.collect::<Vec<_>>())
}

pub(super) fn measure(effort: Effort, progress: &Progress) -> Result<OcclusionChart, StudyError> {
    let bar = progress.bar("occlusion", (3 * effort.samples.len() + effort.slats.len()) as u64);
    let mut chart =
        OcclusionChart { effort, intervals: Vec::new(), samples: Vec::new(), failing: Vec::new() };
    for kind in Kind::ALL {
        for &samples in effort.samples {
            let yards = drawn(&effort, kind, 1, samples, &bar)?;
            let like = blank(kind, 1, samples);
            chart.samples.push(by_samples(&yards, like));
            chart.samples.push(by_intervals(&yards, like, kind.typical(), TILE_PX));
            if samples == effort.samples[0] {
                let each = kind
                    .boxes()
                    .iter()
                    .flat_map(|boxes| effort.tiles.iter().map(move |tile| (*boxes, *tile)));
                chart.intervals.extend(each.map(|(boxes, tile)| by_intervals(&yards, like, boxes, tile)));
            }
        }
    }
    for &slats in effort.slats {
        let yards = drawn(&effort, Kind::Motion, slats, SAMPLES, &bar)?;
        let like = blank(Kind::Motion, slats, SAMPLES);
        chart.failing.push(by_samples(&yards, like));
        chart.failing.extend(FAILING_TILES.map(|tile_px| by_intervals(&yards, like, [1, 1, 8], tile_px)));
    }
    Ok(chart)
}

fn drawn(effort: &Effort, kind: Kind, slats: u32, samples: u32, bar: &Bar) -> Result<Vec<Drawn>, StudyError> {
    let gaps = if slats > 1 { GAPS } else { 0.0 };
    let drawn = |seed| {
        let scene = WallSceneSpec { slats, gaps, ..kind.spec(effort.boxes, seed) };
        Drawn::new(effort.size, &scene, samples)
    };
    let yards = (0..effort.yards).map(drawn).collect();
    bar.inc();
    yards
}
