//! `quintile chart occlusion`: hidden boxes found by occlusion queries, and their cost, over boxes of lens
//! and time, tiles and samples.

use activity::Event;
use glam::Vec3;
use output::OutputError;
use output::plot::{ChartPanel, Scale, Series};
use output::terminal::{Bar, Progress};
use pipeline::depth::{BoxGrid, Pyramid};
use pipeline::geometry::Projection;
use pipeline::{
    Gpu, IntervalAnswer, IntervalQueries, LensShape, PipelineSpec, RasterPass, SampleTable, SampledAnswer,
    SampledQueries, Settings, Target, Viewport,
};
use run::GpuSpec;
use serde::Serialize;
use workloads::occlusion::{MAX_HALF_COVERED_SHARE, WallScene, WallSceneSpec, depths_of};
use workloads::visibility::Unshaded;

use crate::study::table::{Sheet, TableBuilder, fixed, optional, plain};
use crate::study::tradeoff::{Metric, TradeoffPoint};
use crate::study::{Gallery, Ran, Study, StudyError};

/// Effort of the measurement.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct OcclusionEffort {
    /// Pixels of the image.
    pub size: [u32; 2],
    /// Boxes queried in each scene.
    pub boxes: u32,
    /// Scenes of each kind.
    pub scenes: u64,
    /// Samples in a pixel that sampled queries look at.
    pub samples: &'static [u32],
    /// Sides of tiles in pixels.
    pub tiles: &'static [u32],
    /// Slats that a wall is made of for failure modes.
    pub slats: &'static [u32],
}

/// The source of blur.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum OcclusionBlur {
    /// Walls and what is behind them move.
    Motion,
    /// All is out of focus.
    Defocus,
    /// Both.
    Both,
}

impl OcclusionBlur {
    /// Every kind.
    pub const ALL: [Self; 3] = [Self::Motion, Self::Defocus, Self::Both];

    /// Name of the kind in tables and pictures.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Motion => "motion",
            Self::Defocus => "defocus",
            Self::Both => "both",
        }
    }
}

/// A kind of query on one kind of scene. Costs are means over all objects.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OcclusionRow {
    /// The source of blur.
    pub kind: OcclusionBlur,
    /// Slats of a wall.
    pub slats: u32,
    /// Samples in a pixel.
    pub samples: u32,
    /// Side of a tile in pixels, none for a sampled query.
    pub tile_px: Option<u32>,
    /// Boxes of lens and time along u, v and t, none for a sampled query.
    pub boxes: Option<[u32; 3]>,
    /// Objects.
    pub objects: u64,
    /// Objects hidden from every sample.
    pub hidden: u64,
    /// Hidden objects that were found.
    pub found: u64,
    /// Objects called hidden that a sample sees: there must be none.
    pub wrong: u64,
    /// Share of tiles that most samples but not all find covered.
    pub half_covered: f64,
    /// Tests of tiles, samples and depths.
    pub tests: f64,
    /// Bytes of stored depth read.
    pub bytes: f64,
    /// Multiply-adds.
    pub madds: f64,
}

impl OcclusionRow {
    /// The share of what is hidden that is found.
    pub fn rate(&self) -> f64 {
        if self.hidden == 0 { 0.0 } else { self.found as f64 / self.hidden as f64 }
    }

    fn way(&self) -> String {
        self.boxes.map_or("samples".to_owned(), |[u, v, t]| format!("{u}x{v}x{t}"))
    }
}

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct OcclusionChart {
    /// Effort of the measurement.
    pub effort: OcclusionEffort,
    /// By intervals, over boxes and tiles.
    pub intervals: Vec<OcclusionRow>,
    /// Both ways over samples.
    pub samples: Vec<OcclusionRow>,
    /// Walls of more and more slats.
    pub failing: Vec<OcclusionRow>,
}

impl Study for OcclusionChart {
    const NAME: &'static str = "occlusion";
    const ABOUT: &'static str = "Hidden objects found over tests and bytes, by intervals and by samples, and where occluders are too small";
    const PICTURES: &'static [&'static str] = &["occlusion", "occlusion_failures"];
    const FILES: &'static [&'static str] = &["occlusion.csv", "occlusion.json"];

    type Effort = OcclusionEffort;
    const FULL: OcclusionEffort = OcclusionEffort {
        size: [192, 108],
        boxes: 96,
        scenes: 3,
        samples: &[16, 32, 64],
        tiles: &[4, 8, 16, 32],
        slats: &[1, 2, 4, 8, 16, 32, 64],
    };
    const QUICK: OcclusionEffort = OcclusionEffort {
        size: [128, 72],
        boxes: 48,
        scenes: 1,
        samples: &[16, 64],
        tiles: &[4, 8, 16],
        slats: &[1, 4, 16],
    };

    fn measure(effort: OcclusionEffort, _scenes: &[String], progress: &Progress) -> Result<Self, StudyError> {
        measure(effort, progress)
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let samples = self.effort.samples[0];
        let title = "Occlusion queries: by intervals and by samples";
        let subject = self.subject();
        to.chart("occlusion", [title, &subject], OcclusionBlur::ALL.map(|kind| self.rates(kind)).into())?;
        let title = "Where occlusion queries fail: many small occluders";
        let subject = format!(
            "walls of more and narrower slats, {:.0} % of a wall being gaps; motion, {samples} samples a pixel, 8 boxes of time. Marked: where a \
             run with {}-pixel tiles warns (occlusion-small-occluders)",
            100.0 * GAPS,
            FAILING_TILES[0]
        );
        to.chart("occlusion_failures", [title, &subject], self.failures())
    }

    fn tables(&self) -> Vec<Sheet> {
        let rows = TableBuilder::of(self.rows())
            .column("kind", "blur", |row| row.kind.name(), plain)
            .column("slats", "slats", |row| row.slats, plain)
            .column("samples", "samples", |row| row.samples, plain)
            .column("tile_px", "tile", |row| row.tile_px, optional(plain))
            .column("boxes", "boxes", |row| row.way(), plain)
            .data("objects", |row| row.objects)
            .shown("hidden", |row| format!("{} of {}", row.hidden, row.objects), plain)
            .data("hidden", |row| row.hidden)
            .shown("found", |row| format!("{} ({:.3})", row.found, row.rate()), plain)
            .data("found", |row| row.found)
            .data("wrong", |row| row.wrong)
            .data("half_covered", |row| row.half_covered)
            .column("tests", "tests", |row| row.tests, fixed(0))
            .column("bytes", "bytes", |row| row.bytes, fixed(0))
            .column("madds", "multiply-adds", |row| row.madds, fixed(0))
            .csv("occlusion.csv")
            .after(
                "\ncosts are means over all objects; a query by intervals ends where an object is seen to be visible\n",
            );
        vec![rows.sheet()]
    }

    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        let point = |row: &OcclusionRow| {
            let method = row.tile_px.map_or("sampled queries".to_owned(), |px| format!("{px}-pixel tiles"));
            let level = match row.boxes {
                Some(_) => format!("{} boxes, {} samples a pixel", row.way(), row.samples),
                None => format!("{} samples a pixel", row.samples),
            };
            let missed = Metric::new("share of hidden objects not found", "", 1.0 - row.rate()).beside(0.0);
            let cost = Metric::new("depth read for an object", "bytes", row.bytes);
            TradeoffPoint::new(
                format!("hidden objects ({})", row.kind.name()),
                [&method, &level],
                [missed, cost],
            )
        };
        self.intervals.iter().chain(&self.samples).map(point).collect()
    }

    /// Whether anything that a sample sees was called hidden.
    fn fault(&self) -> Option<String> {
        let wrong: u64 = self.rows().map(|row| row.wrong).sum();
        (wrong > 0).then(|| format!("{wrong} objects that are seen were called hidden; please report it"))
    }
}

impl OcclusionChart {
    /// Subtitle of the chart of rates.
    fn subject(&self) -> String {
        let samples = self.effort.samples;
        format!(
            "share of hidden boxes that are found, over bytes of stored depth read for each queried box; {} samples a pixel, \
             sampled queries {} to {}; dots of a tile from few boxes of lens and time to many",
            samples[0],
            samples[0],
            samples[samples.len() - 1]
        )
    }

    fn rows(&self) -> impl Iterator<Item = &OcclusionRow> {
        self.intervals.iter().chain(&self.samples).chain(&self.failing)
    }

    fn rates(&self, kind: OcclusionBlur) -> ChartPanel {
        let of_tile = |&tile: &u32| {
            let rows = self.intervals.iter().filter(|row| row.kind == kind && row.tile_px == Some(tile));
            let mut points: Vec<_> = rows.map(|row| (row.bytes, row.rate())).collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            Series::curve(format!("{tile}-pixel tiles"), points)
        };
        let mut curves: Vec<Series> = self.effort.tiles.iter().map(of_tile).collect();
        let sampled = self.samples.iter().filter(|row| row.kind == kind && row.boxes.is_none());
        curves.push(Series::curve("sampled queries", sampled.map(|row| (row.bytes, row.rate()))));
        ChartPanel::new(kind.name(), ["bytes of depth read for a box", "share found"], curves)
            .on(Scale::Decades, Scale::Even)
    }

    /// Walls of more and more slats: what is found, and why not more is.
    fn failures(&self) -> Vec<ChartPanel> {
        let panel = |title: &str, up: &str, of: fn(&OcclusionRow) -> f64, ways: &[Option<u32>]| {
            let curve = |tile_px: &Option<u32>| {
                let rows = self.failing.iter().filter(|row| row.tile_px == *tile_px);
                let name = tile_px.map_or("sampled queries".to_owned(), |px| format!("{px}-pixel tiles"));
                Series::curve(name, rows.map(|row| (f64::from(row.slats), of(row))))
            };
            ChartPanel::new(title, ["slats of a wall", up], ways.iter().map(curve).collect())
                .on(Scale::Doublings, Scale::Even)
                .failing(self.warned().map(|slats| slats..f64::INFINITY), "a run warns")
        };
        let [small, large] = FAILING_TILES.map(Some);
        vec![
            panel("what is found", "share of hidden boxes found", OcclusionRow::rate, &[small, large, None]),
            panel(
                "tiles that most samples but not all find covered",
                "share of tiles",
                |row| row.half_covered,
                &[small, large],
            ),
        ]
    }

    /// The number of slats from which on a run with the smaller tiles warns.
    fn warned(&self) -> Option<f64> {
        let small = Some(FAILING_TILES[0]);
        let warned = |row: &&OcclusionRow| row.tile_px == small && row.half_covered > MAX_HALF_COVERED_SHARE;
        self.failing.iter().find(warned).map(|row| f64::from(row.slats))
    }
}

/// Boxes of lens and time by kind: for what moves along t, for what is out of focus along u and v, for both
/// along all.
const IN_TIME: [[u32; 3]; 5] = [[1, 1, 1], [1, 1, 2], [1, 1, 4], [1, 1, 8], [1, 1, 16]];
const ON_LENS: [[u32; 3]; 4] = [[1, 1, 1], [2, 2, 1], [4, 4, 1], [8, 8, 1]];
const IN_BOTH: [[u32; 3]; 5] = [[1, 1, 1], [1, 1, 4], [2, 2, 1], [2, 2, 4], [4, 4, 8]];
/// Samples in a pixel where boxes and tiles are swept, and the tile and the samples' seed elsewhere.
const SAMPLES: u32 = 16;
const TILE_PX: u32 = 8;
/// Tiles where occluders get smaller.
const FAILING_TILES: [u32; 2] = [4, TILE_PX];
const SEED: u64 = 7;
/// Walls, their motion in metres and the radius of the lens.
const WALLS: u32 = 12;
const MOTION: f32 = 1.5;
const LENS: f32 = 0.15;
/// The part of a wall of slats that is gaps.
const GAPS: f32 = 0.02;

impl OcclusionBlur {
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

/// Bytes of a stored depth.
const DEPTH_BYTES: u64 = 4;

/// A scene whose walls are drawn and whose boxes were tested by samples.
pub(crate) struct Drawn {
    scene: WallScene,
    viewport: Viewport,
    table: SampleTable,
    spec: PipelineSpec,
    depths: Vec<f32>,
    /// Answers of sampled queries that end at the first sample that sees the box, by box.
    pub seen: Vec<SampledAnswer>,
    /// Answers of sampled queries that count all samples.
    pub counted: Vec<SampledAnswer>,
    /// Work of the walls and of both kinds of sampled queries.
    pub ran: Ran,
}

/// Answers of interval queries, and the farthest depths that they were compared with.
pub(crate) struct QueryAnswers {
    /// By box.
    pub answers: Vec<IntervalAnswer>,
    /// Share of tiles in which most, but not all, samples are covered.
    pub half_covered: f64,
    /// Depths compared to gather the farthest of every tile and level.
    pub gathered: u64,
    /// Bytes of stored depth read for that.
    pub gathered_bytes: u64,
    /// Work of gathering and of the queries.
    pub ran: Ran,
}

impl Drawn {
    /// Draws the walls of a scene into an image of `size` with `samples` in a pixel on the reference GPU, and tests every
    /// box by samples.
    ///
    /// # Errors
    /// When no such scene or image exists.
    pub fn new(size: [u32; 2], scene: &WallSceneSpec, samples: u32) -> Result<Self, StudyError> {
        Self::on(GpuSpec::load("reference")?.pipeline, size, scene, samples)
    }

    /// The same on a GPU of this pipeline.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn on(
        spec: PipelineSpec,
        size: [u32; 2],
        scene: &WallSceneSpec,
        samples: u32,
    ) -> Result<Self, StudyError> {
        let scene = scene.wall_scene().ok_or_else(|| StudyError::Pipeline("a wall scene".to_owned()))?;
        let viewport = Viewport::new(size[0], size[1])
            .ok_or_else(|| StudyError::Pipeline("an image without area".to_owned()))?;
        let table = SampleTable::low_discrepancy(samples, SEED, LensShape::Disk)?;
        let settings = Settings { spec: &spec, viewport, samples: &table, background: Vec3::ZERO };
        let walls = [scene.walls(&Unshaded).map_err(|error| StudyError::Pipeline(error.to_string()))?];
        let occluders = RasterPass::new(&scene.camera, &walls, &settings);
        let mut alone = Gpu::without_packets(&spec)?;
        let depths = depths_of(&alone.draw(&occluders.onto(Target::Depth).with_visible())?.visible);
        let query = |any: bool| SampledQueries { occluders, any }.query(&scene.boxes);
        let (seen, counted) = (query(true)?, query(false)?);
        let ran = [&alone.finish(), &seen.report, &counted.report].map(Ran::of).into_iter().sum();
        let [seen, counted] = [seen, counted].map(|queried| queried.answers);
        Ok(Self { scene, viewport, table, spec, depths, seen, counted, ran })
    }

    /// By intervals, with so many boxes of lens and time and tiles of this side.
    ///
    /// # Errors
    /// When the caches of the GPU cannot be built.
    pub fn query(&self, boxes: [u32; 3], tile_px: u32) -> Result<QueryAnswers, StudyError> {
        let grid = BoxGrid::new(boxes, self.scene.camera.lens().is_some()).unwrap_or_default();
        let pyramid = Pyramid::new(self.viewport, &self.table, &self.depths, tile_px, grid);
        let projection = Projection::new(&self.scene.camera, self.viewport);
        let queries = IntervalQueries::new(&pyramid, &projection);
        let mut gpu = Gpu::without_packets(&self.spec)?;
        let stored = gpu.allocate(DEPTH_BYTES * self.depths.len() as u64);
        gpu.gather_farthest_depths("farthest depths", &pyramid, stored)?;
        let gathering = gpu.counts_of_pass();
        let answers = gpu.query_boxes("queries", &queries, &self.scene.boxes)?;
        Ok(QueryAnswers {
            answers,
            half_covered: pyramid.half_covered(),
            gathered: gathering[Event::ZCullTests],
            gathered_bytes: DEPTH_BYTES * gathering[Event::DepthReads],
            ran: Ran::of(&gpu.finish()),
        })
    }
}

/// Answer of one kind of query: whether it finds an object hidden, and its cost `[tests, bytes, madds]`.
type Answered = (bool, [u64; 3]);

/// A row from the answers for all objects, and whether it is truly hidden.
fn row(like: OcclusionRow, answers: &[(Answered, bool)]) -> OcclusionRow {
    let count = |of: &dyn Fn(bool, bool) -> bool| {
        answers.iter().filter(|((says, _), truly)| of(*says, *truly)).count() as u64
    };
    let mean = |of: usize| {
        answers.iter().map(|((_, cost), _)| cost[of]).sum::<u64>() as f64 / answers.len().max(1) as f64
    };
    OcclusionRow {
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

fn blank(kind: OcclusionBlur, slats: u32, samples: u32) -> OcclusionRow {
    OcclusionRow {
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

fn by_intervals(
    scenes: &[Drawn],
    like: OcclusionRow,
    boxes: [u32; 3],
    tile_px: u32,
) -> Result<OcclusionRow, StudyError> {
    let (mut answered, mut half_covered) = (Vec::new(), 0.0);
    for drawn in scenes {
        let queried = drawn.query(boxes, tile_px)?;
        half_covered += queried.half_covered / scenes.len() as f64;
        let all = queried.answers.iter().zip(&drawn.seen).map(|(answer, seen)| {
            ((answer.hidden, [answer.tests(), answer.bytes(), answer.all_madds()]), seen.passed == 0)
        });
        answered.extend(all);
    }
    Ok(row(OcclusionRow { tile_px: Some(tile_px), boxes: Some(boxes), half_covered, ..like }, &answered))
}

fn by_samples(scenes: &[Drawn], like: OcclusionRow) -> OcclusionRow {
    let all = scenes.iter().flat_map(|drawn| &drawn.seen).map(|seen| {
        let hidden = seen.passed == 0;
        ((hidden, [seen.tests(), seen.bytes(), seen.madds]), hidden)
    });
    row(like, &all.collect::<Vec<_>>())
}

fn measure(effort: OcclusionEffort, progress: &Progress) -> Result<OcclusionChart, StudyError> {
    let bar = progress.bar("occlusion", (3 * effort.samples.len() + effort.slats.len()) as u64);
    let mut chart =
        OcclusionChart { effort, intervals: Vec::new(), samples: Vec::new(), failing: Vec::new() };
    for kind in OcclusionBlur::ALL {
        for &samples in effort.samples {
            let scenes = drawn(&effort, kind, 1, samples, &bar)?;
            let like = blank(kind, 1, samples);
            chart.samples.push(by_samples(&scenes, like));
            chart.samples.push(by_intervals(&scenes, like, kind.typical(), TILE_PX)?);
            if samples == effort.samples[0] {
                let each = kind
                    .boxes()
                    .iter()
                    .flat_map(|boxes| effort.tiles.iter().map(move |tile| (*boxes, *tile)));
                for (boxes, tile) in each {
                    chart.intervals.push(by_intervals(&scenes, like, boxes, tile)?);
                }
            }
        }
    }
    for &slats in effort.slats {
        let scenes = drawn(&effort, OcclusionBlur::Motion, slats, SAMPLES, &bar)?;
        let like = blank(OcclusionBlur::Motion, slats, SAMPLES);
        chart.failing.push(by_samples(&scenes, like));
        for tile_px in FAILING_TILES {
            chart.failing.push(by_intervals(&scenes, like, [1, 1, 8], tile_px)?);
        }
    }
    Ok(chart)
}

fn drawn(
    effort: &OcclusionEffort,
    kind: OcclusionBlur,
    slats: u32,
    samples: u32,
    bar: &Bar,
) -> Result<Vec<Drawn>, StudyError> {
    let gaps = if slats > 1 { GAPS } else { 0.0 };
    let drawn = |seed| {
        let scene = WallSceneSpec { slats, gaps, ..kind.spec(effort.boxes, seed) };
        Drawn::new(effort.size, &scene, samples)
    };
    let scenes = (0..effort.scenes).map(drawn).collect();
    bar.inc();
    scenes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::written;

    #[test]
    fn nothing_seen_is_called_hidden() {
        let least = OcclusionEffort {
            size: [64, 36],
            boxes: 24,
            scenes: 1,
            samples: &[4, 8],
            tiles: &[8],
            slats: &[1, 8],
        };
        let (folder, chart, done) = written::<OcclusionChart>(least);
        assert!(chart.subject().contains("4 samples a pixel, sampled queries 4 to 8"), "{}", chart.subject());
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
        let json: serde_json::Value = serde_json::from_str(&read("occlusion.json")).unwrap();
        let rows = chart.intervals.len() + chart.samples.len() + chart.failing.len();
        assert_eq!(json["intervals"].as_array().unwrap().len(), chart.intervals.len());
        assert_eq!(read("occlusion.csv").lines().count(), 1 + rows);
        assert!(read("occlusion.svg").contains("motion"));
        assert!(chart.fault().is_none(), "{:?}", chart.fault());
        assert!(chart.intervals.iter().any(|row| row.found > 0) && done.text.contains("1x1x16"));
        let sampled = chart.samples.iter().find(|row| row.boxes.is_none()).unwrap();
        let interval = chart.samples.iter().find(|row| row.boxes.is_some()).unwrap();
        assert!(sampled.bytes > interval.bytes && sampled.rate() == 1.0);
    }
}
