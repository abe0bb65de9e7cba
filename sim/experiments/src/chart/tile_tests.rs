//! `quintile chart tile-tests`: every combination of tile tests on several scenes.

use std::path::Path;

use pipeline::sampling::SampleSource;
use pipeline::{Camera, Draw, LensShape, SampleTable, Viewport};
use rayon::prelude::*;
use serde::Serialize;
use workloads::Overrides;
use workloads::stress::{Size, family};
use workloads::visibility::Unshaded;

use super::front::front;
use crate::stress::intervals::Pairs;
use crate::stress::measure::Work;
use crate::stress::methods::{SWITCHES, combinations};
use crate::stress::subject::{Subject, differing};
use output::dir::BoxError;
use output::plot::{AxisSpec, Chart, ChartPanel, Look, Mark, Paint, Picture, Scale, Series};
use output::progress::Progress;
use output::table::Table;
use output::{Claim, OutDir, OutputError};
use run::GpuSpec;
use run::RunError;

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
pub struct Row {
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

/// The whole chart.
#[derive(Clone, Debug, Serialize)]
pub struct TileTests {
    /// A row for each scene and combination.
    pub rows: Vec<Row>,
}

/// Measures the families, the built-in scenes and those named in `files`.
///
/// # Errors
/// When a scene cannot be loaded or made.
pub fn tile_tests(files: &[String], quick: bool, progress: &Progress) -> Result<TileTests, RunError> {
    let gpu = GpuSpec::load("reference")?;
    let scenes = SCENES.map(str::to_owned);
    let bar = progress.bar("scenes", (FAMILIES.len() + scenes.len() + files.len()) as u64);
    let families = FAMILIES.par_iter().map(|&(name, value)| {
        let rows = of_family(name, value, quick, &gpu);
        bar.inc();
        rows
    });
    let loaded = scenes.par_iter().chain(files).map(|name| {
        let rows = of_scene(name, quick, &gpu);
        bar.inc();
        rows
    });
    let rows: Vec<Vec<Row>> = families.chain(loaded).collect::<Result<_, RunError>>()?;
    Ok(TileTests { rows: rows.into_iter().flatten().collect() })
}

fn of_family(name: &'static str, value: f64, quick: bool, gpu: &GpuSpec) -> Result<Vec<Row>, RunError> {
    let failed = |message: String| RunError::Setting(format!("{name} at {value}: {message}"));
    let family = family(name).ok_or_else(|| failed("there is no such family".to_owned()))?;
    let size = if quick { Size::QUICK } else { Size::FULL };
    let scene = family.scene(value, size, 1).map_err(|error| failed(error.to_string()))?;
    let draws = [scene.draw(&Unshaded).map_err(|error| failed(error.to_string()))?];
    let label = format!("{name} at {value}");
    rows(label, (&scene.camera, scene.viewport), &scene.samples, &draws, quick, gpu)
}

fn of_scene(name: &str, quick: bool, gpu: &GpuSpec) -> Result<Vec<Row>, RunError> {
    let size = if quick { (160, 90) } else { (320, 180) };
    let overrides = Overrides { size: Some(size), samples: Some(4), ..Overrides::default() };
    let scene = workloads::load(name)?.with_overrides(&overrides)?;
    let frames = scene.settings().frames.clone();
    let frame = scene.frame(frames.start + (frames.end - frames.start) / 2)?;
    let draws = frame.draws(&scene)?;
    let samples = SampleTable::low_discrepancy(4, 1, LensShape::Disk)?;
    let viewport = Viewport::new(size.0, size.1).ok_or_else(|| RunError::Setting("size: none".to_owned()))?;
    let label = Path::new(name).file_name().map_or(name.into(), |file| file.to_string_lossy());
    rows(label.into_owned(), (&frame.camera, viewport), &samples, &draws, quick, gpu)
}

fn rows(
    scene: String,
    (camera, viewport): (&Camera, Viewport),
    samples: &dyn SampleSource,
    draws: &[Draw<'_>],
    quick: bool,
    gpu: &GpuSpec,
) -> Result<Vec<Row>, RunError> {
    let subject = Subject { camera, viewport, samples, draws, spec: &gpu.pipeline };
    let failed = |error: pipeline::memory::CacheError| RunError::Setting(format!("{scene}: {error}"));
    let pairs = Pairs::of(&subject, if quick { 60 } else { 400 });
    let (reference, _) = subject.reference().map_err(failed)?;
    let row = |(tests, features)| {
        let work = Work::new(&subject.counts(features)?);
        Ok(Row {
            scene: scene.clone(),
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
    let rows = combinations().into_iter().map(row).collect::<Result<_, _>>().map_err(failed)?;
    Ok(with_fronts(rows))
}

fn with_fronts(mut rows: Vec<Row>) -> Vec<Row> {
    let efficiency: Vec<_> = rows.iter().map(|row| (row.madds_per_triangle, row.efficiency)).collect();
    let tightness: Vec<_> = rows.iter().map(|row| (row.madds_per_triangle, row.tightness)).collect();
    for (row, (a, b)) in rows.iter_mut().zip(front(&efficiency).into_iter().zip(front(&tightness))) {
        (row.on_efficiency_front, row.on_tightness_front) = (a, b);
    }
    rows
}

impl TileTests {
    /// Samples lost over all rows: must be none.
    pub fn samples_lost(&self) -> u64 {
        self.rows.iter().map(|row| row.samples_lost).sum()
    }

    /// What is printed: the fronts.
    pub fn text(&self) -> String {
        let mut table =
            Table::new(["scene", "tests", "madds per triangle", "efficiency", "tightness", "best in"]);
        for row in self.rows.iter().filter(|row| row.on_efficiency_front || row.on_tightness_front) {
            let best = match (row.on_efficiency_front, row.on_tightness_front) {
                (true, true) => "both",
                (true, false) => "efficiency",
                _ => "tightness",
            };
            table.row([
                row.scene.clone(),
                row.tests.clone(),
                format!("{:.0}", row.madds_per_triangle),
                format!("{:.1} %", 100.0 * row.efficiency),
                format!("{:.2} %", 100.0 * row.tightness),
                best.to_owned(),
            ]);
        }
        format!("{table}\n{}; {} samples lost\n", key(), self.samples_lost())
    }

    /// Writes the pictures, `tile_tests.csv` and `tile_tests.json`.
    ///
    /// # Errors
    /// [`OutputError`] with the file and the cause.
    pub fn write(&self, dir: &OutDir, look: &Look) -> Result<(), OutputError> {
        let titles = ["Which tile tests pay: efficiency", "efficiency over the best (%)"];
        self.picture(titles, |row| row.efficiency, look).write(dir, "plots/tile_tests_efficiency")?;
        let titles = ["Which tile tests pay: tightness", "tightness over the best (%)"];
        self.picture(titles, |row| row.tightness, look).write(dir, "plots/tile_tests_tightness")?;
        dir.write_file("tile_tests.csv", |out| self.csv(out))?;
        dir.write_json("tile_tests.json", self)
    }

    /// Every combination as one point: cost and gain over those of the best of each scene, means over scenes.
    fn picture(&self, [title, up]: [&str; 2], of: fn(&Row) -> f64, look: &Look) -> Picture {
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
            Series::new("frontier", Mark::Steps(steps)).painted(Paint::Ink),
            Series::new(
                "a combination of tests",
                Mark::Rings(
                    others
                        .map(|m| point(m, if named(m) { words(&m.tests) } else { String::new() }))
                        .collect(),
                ),
            )
            .painted(Paint::Like(0)),
            Series::new(
                "on the frontier",
                Mark::Dots(best().map(|mean| point(mean, words(&mean.tests))).collect()),
            )
            .painted(Paint::Like(1)),
        ];
        let scenes = self.rows.chunk_by(|a, b| a.scene == b.scene).count();
        let subject = format!(
            "multiply-adds of tile and sample tests for a triangle, over the least of each scene; means over {scenes} scenes; named: the \
             frontier, each test alone, none and all"
        );
        let axes = [
            AxisSpec { name: "cost over the least".to_owned(), scale: Scale::Decades, ..AxisSpec::default() },
            AxisSpec { name: up.to_owned(), scale: Scale::FromZero, ..AxisSpec::default() },
        ];
        Chart::new(title, &subject, vec![ChartPanel::over("", axes, series)]).picture(look)
    }

    /// Cost and gain of every combination, over the least cost and the greatest gain of each scene: geometric and arithmetic means.
    fn means(&self, of: fn(&Row) -> f64) -> Vec<Mean> {
        let scenes: Vec<&[Row]> = self.rows.chunk_by(|a, b| a.scene == b.scene).collect();
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

    fn csv(&self, out: &mut (dyn std::io::Write + Send)) -> Result<(), BoxError> {
        let mut csv = csv::Writer::from_writer(out);
        self.rows.iter().try_for_each(|row| csv.serialize(row))?;
        Ok(csv.flush()?)
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

/// The files of the chart.
pub fn claim() -> Claim {
    let plots = ["plots/tile_tests_efficiency", "plots/tile_tests_tightness"];
    Claim::new("chart tile-tests").plots(plots).files(["tile_tests.csv", "tile_tests.json"])
}

/// What the letters mean.
fn key() -> String {
    SWITCHES.map(|switch| format!("{} = {}", switch.letter, switch.name)).join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_combination_is_held_against_none_and_the_best_is_marked() {
        let gpu = GpuSpec::load("reference").unwrap();
        let rows = of_family("speed", 0.1, true, &gpu).unwrap();
        assert_eq!(rows.len(), 1 << SWITCHES.len());
        assert!(rows.iter().all(|row| row.samples_lost == 0 && row.tightness <= 1.0 + 1e-9));
        let least = rows.iter().map(|row| row.madds_per_triangle).fold(f64::INFINITY, f64::min);
        let cheapest = rows.iter().find(|row| row.madds_per_triangle == least).unwrap();
        assert!(cheapest.on_efficiency_front && cheapest.tests != "-", "{cheapest:?}");
        let chart = TileTests { rows };
        let out = tempfile::tempdir().unwrap();
        OutDir::with(out.path(), claim(), |dir| chart.write(dir, &Look::default())).unwrap().unwrap();
        let csv = std::fs::read_to_string(out.path().join("tile_tests.csv")).unwrap();
        assert_eq!(csv.lines().count(), 1 + (1 << SWITCHES.len()));
        assert!(csv.starts_with("scene,tests,madds_per_triangle"));
        assert!(chart.text().contains("s = side_planes") && out.path().join("tile_tests.json").exists());
    }
}
