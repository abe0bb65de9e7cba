//! `quintile chart timing`: every level of timing against the reference, over scenes and GPUs.

pub(super) mod animations;
pub(super) mod measure;
mod picture;

use std::collections::BTreeMap;

use output::OutputError;
use output::plot::{Matrix, MatrixPanel};
use output::terminal::Progress;
use run::{GpuSpec, RunError};
use serde::Serialize;
use timing::Level;

use super::quantiles;
use crate::study::table::{Sheet, TableBuilder, fixed, percent, plain};
use crate::study::tradeoff::{Metric, TradeoffPoint};
use crate::study::{Gallery, Study, StudyError};

pub use animations::{AnimationRow, SubjectKind};
pub use measure::{AddedRow, Chosen, FailedLevel, FailureRow, RateRow, TimingRow};

/// Name of the cost: timing alone, without drawing, over that at `stepped`.
pub(super) const HOST_TIME: &str = "host time of timing alone, relative to stepped";

/// GPUs in the chart: all that are built in, from small to large.
const GPUS: [&str; 5] = ["mobile", "reference", "hd_4000", "iris_pro", "discrete"];

/// A level in a few numbers. Errors are against `stepped`, in percent, over all rows.
#[derive(Clone, Debug, Default, Serialize)]
pub struct LevelFigures {
    /// Of the cycles of a frame: median, 95th percentile and worst.
    pub cycle_error_median_percent: f64,
    /// See above.
    pub cycle_error_p95_percent: f64,
    /// See above.
    pub cycle_error_worst_percent: f64,
    /// Of the energy of a frame.
    pub energy_error_median_percent: f64,
    /// See above.
    pub energy_error_worst_percent: f64,
    /// Busy time of the unit that is worst, over the time of the frame: median and worst.
    pub busy_error_median_percent: f64,
    /// See above.
    pub busy_error_worst_percent: f64,
    /// Bytes to and from memory, worst.
    pub dram_error_worst_percent: f64,
    /// RMS of the difference of power at 50 kHz over mean power, median; and at 1 us.
    pub power_shape_error_percent: f64,
    /// See above.
    pub power_shape_error_1us_percent: f64,
    /// Host time of the reference over that of the level, timing alone: median, and least of all rows.
    pub speedup_over_stepped: f64,
    /// See above.
    pub speedup_over_stepped_least: f64,
    /// Time that the clock adds to a run that only draws, in processor time: median and worst.
    pub added_percent: f64,
    /// See above.
    pub added_worst_percent: f64,
}

/// The reference itself.
#[derive(Clone, Debug, Serialize)]
pub struct Reference {
    /// Units visited in a second of processor time.
    pub unit_cycles_per_s: f64,
    /// Cycles of the core clock, those that were skipped included, in a second of processor time.
    pub cycles_per_s: f64,
    /// Seconds of the host's processor, all rows together.
    pub cpu_s: f64,
}

/// The whole chart.
#[derive(Clone, Debug, Serialize)]
pub struct TimingChart {
    /// Whether it is the short one.
    pub quick: bool,
    /// The levels by name.
    pub levels: BTreeMap<&'static str, LevelFigures>,
    /// Speed of the reference.
    pub reference: Reference,
    /// Animations at every level, drawn and timed, on every GPU.
    pub animations: Vec<AnimationRow>,
    /// A row for each scene, GPU and level but the reference.
    pub rows: Vec<TimingRow>,
    /// Time that the cheap levels add to a run that only draws, scenes by GPUs.
    pub added: Vec<AddedRow>,
    /// Streams made to break levels, on each GPU; not in the figures of the levels.
    pub failures: Vec<FailureRow>,
    /// Rates of the large GPU from outside.
    pub rates: Vec<RateRow>,
}

impl Study for TimingChart {
    const NAME: &'static str = "timing";
    const ABOUT: &'static str = "Every level of timing: error against the reference over host time";
    const PICTURES: &'static [&'static str] = &["timing", "timing_subjects", "timing_failures"];
    const FILES: &'static [&'static str] =
        &["timing.csv", "timing_points.csv", "timing_failures.csv", "timing.json"];
    const TAKES_SCENES: bool = true;
    const SHOWS_TIME: bool = true;

    type Effort = Quick;
    const FULL: Quick = Quick(false);
    const QUICK: Quick = Quick(true);

    fn measure(Quick(quick): Quick, files: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let gpus: Vec<GpuSpec> = GPUS.iter().map(GpuSpec::load).collect::<Result<_, _>>()?;
        let subjects = animations::all(files, quick)?;
        let bar = progress.bar("scenes", (subjects.len() * gpus.len()) as u64);
        // One after another: host times are part of what is measured.
        let (mut rows, mut added, mut reference) = (Vec::new(), Vec::new(), measure::Speed::default());
        for subject in &subjects {
            for gpu in &gpus {
                if !subject.runs_on(gpu) {
                    bar.inc();
                    continue;
                }
                let stream = subject.stream(gpu)?;
                let named = (subject.name(), Some(subject.kind));
                rows.extend(measure::rows(named, gpu, &stream, &mut reference)?);
                if subject.kind != SubjectKind::Workload {
                    added.extend(measure::added(subject, gpu)?);
                }
                bar.inc();
            }
        }
        let animations = animated(files, &gpus, quick, progress)?;
        let of = |level: Level| (level.name(), figures(level, &rows, &added));
        Ok(Self {
            quick,
            levels: Level::ALL.into_iter().map(of).collect(),
            reference: reference.figures(),
            animations,
            rows,
            added,
            failures: measure::failures(&gpus)?,
            rates: measure::rates()?,
        })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        to.add("timing", &self.picture(to.plot_style()))?;
        to.add("timing_subjects", &self.subject_matrix().picture(to.plot_style()))?;
        to.add("timing_failures", &self.failure_matrix().picture(to.plot_style()))
    }

    fn tables(&self) -> Vec<Sheet> {
        vec![
            self.level_sheet(),
            self.subject_sheet(),
            self.row_sheet(),
            self.point_sheet(),
            self.failure_sheet(),
            self.stream_sheet(),
            self.rate_sheet(),
        ]
    }

    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        let both = |(level, f): (&&'static str, &LevelFigures)| {
            let cost = Metric::new(HOST_TIME, "", 1.0 / f.speedup_over_stepped);
            let errors = [
                Metric::new("median error of cycles", "%", f.cycle_error_median_percent),
                Metric::new("median error of energy", "%", f.energy_error_median_percent),
                Metric::new("worst error of cycles", "%", f.cycle_error_worst_percent),
                Metric::new("worst error of energy", "%", f.energy_error_worst_percent),
            ];
            errors.map(|error| {
                let metrics = [error.beside(0.0), cost.beside(1.0)];
                TradeoffPoint::new("time of a frame", [*level, ""], metrics)
            })
        };
        self.levels.iter().flat_map(both).collect()
    }

    /// `packet` is off by no more than a few percent, over scenes and workloads, or warns.
    fn fault(&self) -> Option<String> {
        let median = self.levels.get(Level::Packet.name())?.cycle_error_median_percent;
        let silent = |row: &&TimingRow| {
            row.level == Level::Packet && !row.warns && row.cycle_error_percent.abs() > MAX_WORST_PERCENT
        };
        if let Some(row) = self.rows.iter().find(silent) {
            let (scene, gpu, error) = (&row.scene, &row.gpu, row.cycle_error_percent);
            return Some(format!("`packet` is {error:+.1} % off for {scene} on {gpu}, and does not warn"));
        }
        (median > MAX_MEDIAN_PERCENT).then(|| format!("the median error of `packet` is {median:.1} %"))
    }
}

/// Largest errors of the cycles of `packet` in percent: the median, and the worst without a warning.
const MAX_MEDIAN_PERCENT: f64 = 2.0;
const MAX_WORST_PERCENT: f64 = 8.0;

/// Whether a preview will do.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Quick(bool);

/// Every scene that is animated, on every GPU.
fn animated(
    files: &[String],
    gpus: &[GpuSpec],
    quick: bool,
    progress: &Progress,
) -> Result<Vec<AnimationRow>, RunError> {
    let extent = animations::Extent::of(quick);
    let mut rows = Vec::new();
    for scene in animations::SCENES.into_iter().chain(files.iter().map(String::as_str)) {
        for gpu in gpus {
            rows.extend(animations::rows(scene, gpu, extent, progress)?);
        }
    }
    Ok(rows)
}

fn figures(level: Level, rows: &[TimingRow], added: &[AddedRow]) -> LevelFigures {
    if level == Level::Stepped {
        return LevelFigures {
            speedup_over_stepped: 1.0,
            speedup_over_stepped_least: 1.0,
            ..LevelFigures::default()
        };
    }
    let of = |pick: fn(&TimingRow) -> f64| quantiles(rows.iter().filter(|row| row.level == level).map(pick));
    let added = quantiles(added.iter().filter(|row| row.level == level).map(|row| row.added_percent));
    let (cycles, energy) =
        (of(|row| row.cycle_error_percent.abs()), of(|row| row.energy_error_percent.abs()));
    let (busy, speedup) = (of(|row| row.busy_error_percent), of(|row| row.speedup_over_stepped));
    LevelFigures {
        cycle_error_median_percent: cycles(0.5),
        cycle_error_p95_percent: cycles(0.95),
        cycle_error_worst_percent: cycles(1.0),
        energy_error_median_percent: energy(0.5),
        energy_error_worst_percent: energy(1.0),
        busy_error_median_percent: busy(0.5),
        busy_error_worst_percent: busy(1.0),
        dram_error_worst_percent: of(|row| row.dram_error_percent.abs())(1.0),
        power_shape_error_percent: of(|row| row.power_shape_error_percent)(0.5),
        power_shape_error_1us_percent: of(|row| row.power_shape_error_1us_percent)(0.5),
        speedup_over_stepped: speedup(0.5),
        speedup_over_stepped_least: speedup(0.0),
        added_percent: added(0.5),
        added_worst_percent: added(1.0),
    }
}

/// The levels that can fail.
const LEVELS: [Level; 2] = [Level::Packet, Level::Bound];

/// Shows an error with its sign.
fn signed(decimals: usize) -> impl Fn(f64) -> String {
    move |value| format!("{value:+.decimals$} %")
}

impl TimingChart {
    /// The levels in a few numbers.
    fn level_sheet(&self) -> Sheet {
        let below = format!(
            "the reference: {:.1} million unit-cycles, {:.2} million cycles a second\n",
            self.reference.unit_cycles_per_s / 1e6,
            self.reference.cycles_per_s / 1e6
        );
        let added = |(name, f): &(&&'static str, &LevelFigures)| match **name == Level::Stepped.name() {
            true => "-".to_owned(),
            false => format!("{:.0} %", f.added_percent),
        };
        TableBuilder::of(&self.levels)
            .shown("level", |(name, _)| **name, plain)
            .shown("cycles: median", |(_, f)| f.cycle_error_median_percent, percent(2))
            .shown("95 %", |(_, f)| f.cycle_error_p95_percent, percent(2))
            .shown("worst", |(_, f)| f.cycle_error_worst_percent, percent(2))
            .shown("energy: median", |(_, f)| f.energy_error_median_percent, percent(2))
            .shown("worst", |(_, f)| f.energy_error_worst_percent, percent(2))
            .shown("power shape", |(_, f)| f.power_shape_error_percent, percent(2))
            .shown("speed over stepped", |(_, f)| f.speedup_over_stepped, fixed(1))
            .detail("least", |(_, f)| f.speedup_over_stepped_least, fixed(1))
            .shown("added to drawing", added, plain)
            .detail("worst", |(_, f)| f.added_worst_percent, percent(0))
            .after(below)
            .sheet()
    }

    /// Errors of the cycles of each scene, family and workload: a row each, over the GPUs.
    fn subject_sheet(&self) -> Sheet {
        let of = |scene: &str, level: Level| {
            let rows = self.rows.iter().filter(move |row| row.scene == scene && row.level == level);
            let each = rows.map(|row| {
                let warns = if row.warns { " (warns)" } else { "" };
                format!("{:+.1}{warns}", row.cycle_error_percent)
            });
            each.collect::<Vec<_>>().join(", ")
        };
        TableBuilder::of(self.subjects())
            .detail("frame", |row| row.scene.as_str(), plain)
            .detail("cycles", |row| row.stepped_cycles, plain)
            .detail(&format!("packet, % on {}", GPUS.join(", ")), |row| of(&row.scene, LEVELS[0]), plain)
            .detail("bound, %", |row| of(&row.scene, LEVELS[1]), plain)
            .sheet()
    }

    /// The first row of each scene, family and workload.
    fn subjects(&self) -> Vec<&TimingRow> {
        let mut first: Vec<&TimingRow> = Vec::new();
        for row in &self.rows {
            if !first.iter().any(|known| known.scene == row.scene) {
                first.push(row);
            }
        }
        first
    }

    /// Every scene on every GPU at every level but the reference.
    fn row_sheet(&self) -> Sheet {
        TableBuilder::of(&self.rows)
            .data("scene", |row| row.scene.as_str())
            .data("gpu", |row| row.gpu.as_str())
            .data("level", |row| row.level.name())
            .data("warns", |row| row.warns.to_string())
            .data("checked_percent", |row| row.checked_percent)
            .data("packets", |row| row.packets)
            .data("cycles", |row| row.cycles)
            .data("stepped_cycles", |row| row.stepped_cycles)
            .data("cycle_error_percent", |row| row.cycle_error_percent)
            .data("energy_error_percent", |row| row.energy_error_percent)
            .data("busy_error_percent", |row| row.busy_error_percent)
            .data("power_shape_error_percent", |row| row.power_shape_error_percent)
            .data("busiest", |row| row.busiest.0)
            .data("busiest_share", |row| row.busiest.1)
            .data("cpu_s", |row| row.cpu_s)
            .data("written_s", |row| row.written_s)
            .data("speedup_over_stepped", |row| row.speedup_over_stepped)
            .detail("scene", |row| row.scene.as_str(), plain)
            .detail("GPU", |row| row.gpu.as_str(), plain)
            .detail("level", |row| row.level.name(), plain)
            .detail("cycles", |row| row.stepped_cycles, plain)
            .detail("error", |row| row.cycle_error_percent, signed(2))
            .detail("energy", |row| row.energy_error_percent, signed(2))
            .detail("busiest", |row| format!("{} {:.0} %", row.busiest.0, row.busiest.1 * 100.0), plain)
            .detail("speed over stepped", |row| row.speedup_over_stepped, fixed(1))
            .csv("timing.csv")
            .sheet()
    }

    /// The points of the picture.
    fn point_sheet(&self) -> Sheet {
        let animations = self.animations.iter().map(|row| {
            let of = ["animation, drawn and timed", &row.scene, &row.gpu, row.level];
            (of, row.seed, row.relative_host, row.cycle_error_percent)
        });
        let frames = self.rows.iter().map(|row| {
            let of = ["frame, timing alone", &row.scene, &row.gpu, row.level.name()];
            (of, None, 1.0 / row.speedup_over_stepped, row.cycle_error_percent)
        });
        TableBuilder::of(animations.chain(frames))
            .data("kind", |(of, ..)| of[0])
            .data("scene", |(of, ..)| of[1])
            .data("gpu", |(of, ..)| of[2])
            .data("level", |(of, ..)| of[3])
            .data("seed", |(_, seed, ..)| *seed)
            .data("relative_host_time", |(.., host, _)| *host)
            .data("cycle_error_percent", |(.., error)| *error)
            .csv("timing_points.csv")
            .sheet()
    }

    /// Streams that break levels, a row for each level.
    fn failure_sheet(&self) -> Sheet {
        let each = self.failures.iter().flat_map(|row| row.levels.iter().map(move |found| (row, found)));
        TableBuilder::of(each)
            .data("stream", |(row, _)| row.stream)
            .data("gpu", |(row, _)| row.gpu.as_str())
            .data("stepped_cycles", |(row, _)| row.stepped_cycles)
            .data("level", |(_, (level, _))| **level)
            .data("cycle_error_percent", |(_, (_, found))| found.cycle_error_percent)
            .data("energy_error_percent", |(_, (_, found))| found.energy_error_percent)
            .data("checked_percent", |(_, (_, found))| found.checked_percent)
            .data("warns", |(_, (_, found))| found.warns.to_string())
            .csv("timing_failures.csv")
            .sheet()
    }

    /// Streams that break levels, a row for each.
    fn stream_sheet(&self) -> Sheet {
        let error = |level: Level| {
            move |row: &&FailureRow| {
                row.levels.get(level.name()).map_or(0.0, |found| found.cycle_error_percent)
            }
        };
        let warns = |row: &&FailureRow| {
            let levels = row.levels.iter().filter(|(_, found)| found.warns).map(|(level, _)| *level);
            levels.collect::<Vec<_>>().join(", ")
        };
        let mut table = TableBuilder::of(&self.failures)
            .detail("stream", |row| row.stream, plain)
            .detail("GPU", |row| row.gpu.as_str(), plain)
            .detail("cycles", |row| row.stepped_cycles, plain)
            .detail("packet", error(LEVELS[0]), signed(1))
            .detail("bound", error(LEVELS[1]), signed(1))
            .detail("warns", warns, plain);
        let requested: Vec<f64> = self
            .failures
            .first()
            .map_or(Vec::new(), |row| row.chosen.iter().map(|chosen| chosen.asked_percent).collect());
        for (place, percent) in requested.into_iter().enumerate() {
            table = table.detail(&format!("{percent} %"), |row| row.chosen[place].level.name(), plain);
        }
        table.sheet()
    }

    /// Rates of the large GPU beside those of a card.
    fn rate_sheet(&self) -> Sheet {
        let of =
            |level: Level| move |row: &&RateRow| row.giga_per_s.get(level.name()).copied().unwrap_or(0.0);
        let [stepped, packet, bound] = Level::ALL;
        TableBuilder::of(&self.rates)
            .detail("rate", |row| row.rate, plain)
            .detail("stepped", |row| format!("{:.1} G{}", of(stepped)(row), row.unit), plain)
            .detail("packet", of(packet), fixed(1))
            .detail("bound", of(bound), fixed(1))
            .detail("card", |row| row.card, plain)
            .sheet()
    }

    /// Errors in cycles of streams that break levels.
    fn failure_matrix(&self) -> Matrix<'_> {
        let streams = distinct(self.failures.iter().map(|row| row.stream));
        let gpus = distinct(self.failures.iter().map(|row| row.gpu.as_str()));
        matrix("Where levels of timing fail", (streams, gpus), |stream, gpu, level| {
            let row = self.failures.iter().find(|row| row.gpu == gpu && row.stream == stream)?;
            row.levels.get(level.name()).map(|found| found.cycle_error_percent)
        })
    }

    /// Errors in cycles of scenes, families and workloads.
    fn subject_matrix(&self) -> Matrix<'_> {
        let scenes = distinct(self.rows.iter().map(|row| row.scene.as_str()));
        let gpus = distinct(self.rows.iter().map(|row| row.gpu.as_str()));
        matrix("Levels of timing, by scene and workload", (scenes, gpus), |scene, gpu, level| {
            let is_it = |row: &&TimingRow| row.scene == scene && row.gpu == gpu && row.level == level;
            self.rows.iter().find(is_it).map(|row| row.cycle_error_percent)
        })
    }
}

fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut all = Vec::new();
    for name in names {
        if !all.contains(&name) {
            all.push(name);
        }
    }
    all
}

/// Errors in percent, a block for each level, columns by GPUs.
fn matrix<'a>(
    title: &'a str,
    (columns, gpus): (Vec<&'a str>, Vec<&'a str>),
    error: impl Fn(&str, &str, Level) -> Option<f64>,
) -> Matrix<'a> {
    let panel = |level: Level| {
        let of = |gpu: &str| columns.iter().map(|name| error(name, gpu, level).map(f64::abs)).collect();
        MatrixPanel { name: level.name(), rows: gpus.iter().map(|&gpu| (gpu, of(gpu))).collect() }
    };
    Matrix {
        title,
        subject: "error in cycles against stepped, in percent",
        scale: ["1 % and less", "32 % and more"],
        panels: LEVELS.map(panel).into(),
        columns,
    }
}
