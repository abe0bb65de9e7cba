//! `quintile chart tile-tests`: every combination of tile tests on several scenes.

use std::path::Path;

use pipeline::{LensShape, PassError, SampleTable, Viewport};
use serde::Serialize;
use workloads::Overrides;
use workloads::stress::Size;

use crate::stress::family_named;
use crate::stress::measure::{MethodWork, Pairs, SWITCHES, Subject, combinations, differing, on_subject};
use crate::study::table::{Sheet, TableBuilder, fixed, plain, share};
use crate::study::tradeoff::{Metric, TradeoffPoint, front};
use crate::study::{Gallery, Study, StudyError, each};
use output::OutputError;
use output::plot::{ChartPanel, Paint, PlotMark, Scale, Series};
use output::terminal::Progress;
use run::{GpuSpec, RunError};

/// Families of the failure catalogue in the chart, each at one value.
const FAMILIES: [(&str, f64); 7] = [
    ("diagonals", 128.0),
    ("speed", 0.1),
    ("defocus", 16.0),
    ("lens-and-motion", 2.0),
    ("facing", 90.0),
    ("behind", 0.0),
    ("micro", 1.0),
];

/// Built-in scenes in the chart.
const SCENES: [&str; 2] = ["default", "tiny"];

/// One combination of tests on one scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TileTestsRow {
    /// The scene.
    pub scene: String,
    /// Letters of the tests that are on, `-` for none.
    pub tests: String,
    /// Multiply-adds of tile and sample tests for each triangle drawn.
    pub madds_per_triangle: f64,
    /// Samples hit over samples tested.
    pub efficiency: f64,
    /// Volume of the true boxes of lens and time over that of the boxes kept.
    pub tightness: f64,
    /// Where the true boxes are from.
    pub truth: &'static str,
    /// Samples that do not see what they do without any test: must be none.
    pub samples_lost: u64,
    /// Whether no other combination is as cheap and as efficient.
    pub on_efficiency_front: bool,
    /// Whether no other combination is as cheap and as tight.
    pub on_tightness_front: bool,
}

/// Effort of the measurement.
#[derive(Clone, Copy, Debug)]
pub struct TileTestsEffort {
    /// How large the scenes of families are.
    pub families: Size,
    /// Pixels of scenes, across and down.
    pub size: (u32, u32),
    /// Pairs of triangle and tile whose true box is found.
    pub pairs: u64,
}

/// The whole chart.
#[derive(Clone, Debug, Serialize)]
pub struct TileTestsChart {
    /// A row for each scene and combination.
    pub rows: Vec<TileTestsRow>,
}

impl Study for TileTestsChart {
    const NAME: &'static str = "tile-tests";
    const ABOUT: &'static str =
        "Every combination of tile tests: efficiency and tightness over multiply-adds";
    const PICTURES: &'static [&'static str] = &["tile_tests_efficiency", "tile_tests_tightness"];
    const FILES: &'static [&'static str] = &["tile_tests.csv", "tile_tests.json"];
    const TAKES_SCENES: bool = true;

    type Effort = TileTestsEffort;
    const FULL: TileTestsEffort = TileTestsEffort { families: Size::FULL, size: (320, 180), pairs: 400 };
    const QUICK: TileTestsEffort = TileTestsEffort { families: Size::QUICK, size: (160, 90), pairs: 60 };

    fn measure(effort: TileTestsEffort, files: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let gpu = GpuSpec::load("reference")?;
        let scenes = SCENES.into_iter().chain(files.iter().map(String::as_str)).map(|name| (name, None));
        let families = FAMILIES.map(|(name, value)| (name, Some(value)));
        let cases: Vec<(&str, Option<f64>)> = families.into_iter().chain(scenes).collect();
        let rows = |&(name, value): &(&str, Option<f64>)| match value {
            Some(value) => of_family(name, value, &effort, &gpu),
            None => of_scene(name, &effort, &gpu),
        };
        Ok(Self { rows: each(&cases, ("scenes", progress), rows)?.concat() })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let scenes = self.rows.chunk_by(|a, b| a.scene == b.scene).count();
        let subject = format!(
            "multiply-adds of tile and sample tests for a triangle, over the least of each scene; means over {scenes} scenes; named: the \
             frontier, each test alone, none and all"
        );
        let panel = self.panel("efficiency over the best (%)", |row| row.efficiency);
        let title = "Which tile tests pay: efficiency";
        to.chart("tile_tests_efficiency", [title, &subject], vec![panel])?;
        let panel = self.panel("tightness over the best (%)", |row| row.tightness);
        let title = "Which tile tests pay: tightness";
        to.chart("tile_tests_tightness", [title, &subject], vec![panel])
    }

    fn tables(&self) -> Vec<Sheet> {
        let best = |row: &&TileTestsRow| row.on_efficiency_front || row.on_tightness_front;
        let fronts = TableBuilder::of(self.rows.iter().filter(best))
            .shown("scene", |row| row.scene.as_str(), plain)
            .shown("tests", |row| row.tests.as_str(), plain)
            .shown("madds per triangle", |row| row.madds_per_triangle, fixed(0))
            .shown("efficiency", |row| row.efficiency, share(1))
            .shown("tightness", |row| row.tightness, share(2))
            .shown("best in", |row| row.best_in(), plain)
            .after(format!("\n{}; {} samples lost\n", key(), self.samples_lost()));
        let rows = TableBuilder::of(&self.rows)
            .data("scene", |row| row.scene.as_str())
            .data("tests", |row| row.tests.as_str())
            .data("madds_per_triangle", |row| row.madds_per_triangle)
            .data("efficiency", |row| row.efficiency)
            .data("tightness", |row| row.tightness)
            .data("truth", |row| row.truth)
            .data("samples_lost", |row| row.samples_lost)
            .data("on_efficiency_front", |row| row.on_efficiency_front)
            .data("on_tightness_front", |row| row.on_tightness_front)
            .csv("tile_tests.csv");
        vec![fronts.sheet(), rows.sheet()]
    }

    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        // Of combinations that cost and gain the same, the first.
        let same = |a: &&TileTestsRow, b: &&TileTestsRow| {
            (&a.scene, a.madds_per_triangle, a.efficiency) == (&b.scene, b.madds_per_triangle, b.efficiency)
        };
        let mut front: Vec<&TileTestsRow> = self.rows.iter().filter(|row| row.on_efficiency_front).collect();
        front.dedup_by(|a, b| same(a, b));
        let point = |row: &TileTestsRow| {
            let wasted = Metric::new("share of tested samples that miss", "", 1.0 - row.efficiency);
            let cost = Metric::new("multiply-adds a triangle", "", row.madds_per_triangle);
            let subject = format!("samples of a triangle ({})", row.scene);
            TradeoffPoint::new(subject, ["tile tests", &row.tests], [wasted, cost])
        };
        front.into_iter().map(point).collect()
    }

    fn fault(&self) -> Option<String> {
        let lost = self.samples_lost();
        (lost > 0).then(|| format!("{lost} samples were lost: a test is not conservative; please report it"))
    }
}

fn of_family(
    name: &str,
    value: f64,
    effort: &TileTestsEffort,
    gpu: &GpuSpec,
) -> Result<Vec<TileTestsRow>, RunError> {
    let label = format!("{name} at {value}");
    on_subject(family_named(name)?, value, effort.families, 1, gpu, |subject| {
        rows(&label, subject, effort.pairs)
    })
}

fn of_scene(name: &str, effort: &TileTestsEffort, gpu: &GpuSpec) -> Result<Vec<TileTestsRow>, RunError> {
    let size = effort.size;
    let overrides = Overrides { size: Some(size), samples: Some(4), ..Overrides::default() };
    let scene = workloads::load(name)?.with_overrides(&overrides)?;
    let frames = scene.settings().frames.clone();
    let frame = scene.frame(frames.start + (frames.end - frames.start) / 2)?;
    let draws = frame.draws(&scene)?;
    let samples = SampleTable::low_discrepancy(4, 1, LensShape::Disk)?;
    let viewport = Viewport::new(size.0, size.1).ok_or_else(|| RunError::invalid("size", "none"))?;
    let label = Path::new(name).file_name().map_or(name.into(), |file| file.to_string_lossy());
    let (camera, spec) = (&frame.camera, &gpu.pipeline);
    let subject = Subject { camera, viewport, samples: &samples, draws: &draws, spec };
    let rows = rows(&label, &subject, effort.pairs);
    rows.map_err(|error| RunError::invalid(label, error))
}

fn rows(scene: &str, subject: &Subject<'_>, pairs: u64) -> Result<Vec<TileTestsRow>, PassError> {
    let pairs = Pairs::of(subject, pairs);
    let (reference, _) = subject.reference()?;
    let row = |(tests, features)| {
        let work = MethodWork::new(&subject.counts(features)?);
        Ok(TileTestsRow {
            scene: scene.to_owned(),
            tests,
            madds_per_triangle: work.madds() as f64 / subject.triangles().max(1) as f64,
            efficiency: work.efficiency().unwrap_or(0.0),
            tightness: pairs.under(&features).tightness,
            truth: pairs.source(),
            samples_lost: differing(&subject.seen(features)?, &reference),
            on_efficiency_front: false,
            on_tightness_front: false,
        })
    };
    combinations().into_iter().map(row).collect::<Result<_, _>>().map(with_fronts)
}

fn with_fronts(mut rows: Vec<TileTestsRow>) -> Vec<TileTestsRow> {
    let efficiency: Vec<_> = rows.iter().map(|row| (row.madds_per_triangle, row.efficiency)).collect();
    let tightness: Vec<_> = rows.iter().map(|row| (row.madds_per_triangle, row.tightness)).collect();
    for (row, (a, b)) in rows.iter_mut().zip(front(&efficiency).into_iter().zip(front(&tightness))) {
        (row.on_efficiency_front, row.on_tightness_front) = (a, b);
    }
    rows
}

impl TileTestsChart {
    /// Samples lost over all rows: must be none.
    pub fn samples_lost(&self) -> u64 {
        self.rows.iter().map(|row| row.samples_lost).sum()
    }

    /// Every combination as one point: cost and gain over those of the best of each scene, means over scenes.
    fn panel(&self, up: &str, of: fn(&TileTestsRow) -> f64) -> ChartPanel {
        let means = self.means(of);
        let front = front(&means.iter().map(|mean| (mean.cost, mean.gain)).collect::<Vec<_>>());
        let point = |mean: &Mean, name: String| (mean.cost, 100.0 * mean.gain, name);
        let best = || means.iter().zip(&front).filter(|(_, on)| **on).map(|(mean, _)| mean);
        let others = means.iter().zip(&front).filter(|(_, on)| !**on).map(|(mean, _)| mean);
        // Named besides the frontier: no test, each alone, and all.
        let named = |mean: &Mean| mean.tests.len() == 1 || mean.tests.len() == SWITCHES.len();
        let mut steps: Vec<(f64, f64)> = best().map(|mean| (mean.cost, 100.0 * mean.gain)).collect();
        steps.sort_by(|a, b| a.0.total_cmp(&b.0));
        let series = vec![
            Series::new("frontier", PlotMark::Steps(steps)).painted(Paint::Ink),
            Series::new(
                "a combination of tests",
                PlotMark::Rings(
                    others
                        .map(|m| point(m, if named(m) { words(&m.tests) } else { String::new() }))
                        .collect(),
                ),
            )
            .painted(Paint::Like(0)),
            Series::new(
                "on the frontier",
                PlotMark::Dots(best().map(|mean| point(mean, words(&mean.tests))).collect()),
            )
            .painted(Paint::Like(1)),
        ];
        ChartPanel::new("", ["cost over the least", up], series).on(Scale::Decades, Scale::FromZero)
    }

    /// Cost and gain of every combination, over the least cost and the greatest gain of each scene: geometric
    /// and arithmetic means.
    fn means(&self, of: fn(&TileTestsRow) -> f64) -> Vec<Mean> {
        let scenes: Vec<&[TileTestsRow]> = self.rows.chunk_by(|a, b| a.scene == b.scene).collect();
        let combinations = scenes.first().map_or(0, |rows| rows.len());
        let count = scenes.len().max(1) as f64;
        let mean = |place: usize| {
            let (mut cost, mut gain) = (0.0, 0.0);
            for rows in &scenes {
                let least = rows.iter().map(|row| row.madds_per_triangle).fold(f64::INFINITY, f64::min);
                let most = rows.iter().map(of).fold(f64::MIN_POSITIVE, f64::max);
                cost += libm::log(rows[place].madds_per_triangle / least) / count;
                gain += of(&rows[place]) / most / count;
            }
            Mean { tests: scenes[0][place].tests.clone(), cost: libm::exp(cost), gain }
        };
        (0..combinations).map(mean).collect()
    }
}

impl TileTestsRow {
    fn best_in(&self) -> &'static str {
        match (self.on_efficiency_front, self.on_tightness_front) {
            (true, true) => "both",
            (true, false) => "efficiency",
            _ => "tightness",
        }
    }
}

/// A combination of tests over all scenes.
struct Mean {
    tests: String,
    cost: f64,
    gain: f64,
}

/// The tests behind letters: `sides + edges`.
fn words(letters: &str) -> String {
    match letters.len() {
        1 if letters == "-" => return "no test".to_owned(),
        n if n == SWITCHES.len() => return "all tests".to_owned(),
        _ => {}
    }
    let on = SWITCHES.iter().filter(|switch| letters.contains(switch.letter));
    on.map(|switch| switch.name).collect::<Vec<_>>().join(" + ")
}

/// Legend of the letters.
fn key() -> String {
    SWITCHES.map(|switch| format!("{} = {}", switch.letter, switch.name)).join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::Done;
    use output::OutDir;
    use output::plot::PlotStyle;

    #[test]
    fn every_combination_is_compared_with_none_and_the_best_is_marked() {
        let gpu = GpuSpec::load("reference").unwrap();
        let rows = of_family("speed", 0.1, &TileTestsChart::QUICK, &gpu).unwrap();
        assert_eq!(rows.len(), 1 << SWITCHES.len());
        assert!(rows.iter().all(|row| row.samples_lost == 0 && row.tightness <= 1.0 + 1e-9));
        let least = rows.iter().map(|row| row.madds_per_triangle).fold(f64::INFINITY, f64::min);
        let cheapest = rows.iter().find(|row| row.madds_per_triangle == least).unwrap();
        assert!(cheapest.on_efficiency_front && cheapest.tests != "-", "{cheapest:?}");
        let chart = TileTestsChart { rows };
        let out = tempfile::tempdir().unwrap();
        let make = |dir: &OutDir| Done::new(&chart, dir, &PlotStyle::default()).unwrap();
        let done = OutDir::with(out.path(), TileTestsChart::claim(), make).unwrap();
        let csv = std::fs::read_to_string(out.path().join("tile_tests.csv")).unwrap();
        assert_eq!(csv.lines().count(), 1 + (1 << SWITCHES.len()));
        assert!(csv.starts_with("scene,tests,madds_per_triangle"));
        assert!(done.text.contains("s = side_planes") && out.path().join("tile_tests.json").exists());
    }
}
