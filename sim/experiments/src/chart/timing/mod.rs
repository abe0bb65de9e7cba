//! `quintile chart timing`: every level of timing against the reference, over scenes and GPUs.

mod added;
mod animations;
mod failure_output;
mod failures;
mod measure;
mod picture;
mod subjects;
mod tables;

use std::collections::BTreeMap;

use serde::Serialize;

use super::quantiles::quantiles;
use output::progress::Progress;
use output::table::Table;
use run::GpuSpec;
use run::RunError;
use timing::Level;

pub use added::AddedRow;
pub use animations::AnimationRow;
pub use failures::{Chosen, FailedLevel, FailureRow, RateRow};
pub use measure::Row;
pub use tables::claim;

/// GPUs in the chart: small, integrated, large.
const GPUS: [&str; 3] = ["mobile", "reference", "discrete"];

/// A level in a few numbers. Errors are against `stepped`, in percent, over all rows.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Figures {
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
    /// What the clock adds to a run that only draws, in processor time: median and worst.
    pub added_percent: f64,
    /// See above.
    pub added_worst_percent: f64,
}

/// The reference itself.
#[derive(Clone, Debug, Serialize)]
pub struct Reference {
    /// Units visited in a second of host time.
    pub unit_cycles_per_s: f64,
    /// Cycles of the core clock, those that were skipped included, in a second of host time.
    pub cycles_per_s: f64,
    /// Host seconds of all rows.
    pub host_s: f64,
}

/// The whole chart.
#[derive(Clone, Debug, Serialize)]
pub struct TimingChart {
    /// Whether it is the short one.
    pub quick: bool,
    /// The levels by name.
    pub levels: BTreeMap<&'static str, Figures>,
    /// How fast the reference is.
    pub reference: Reference,
    /// Animations at every level, drawn and timed, on every GPU.
    pub animations: Vec<AnimationRow>,
    /// A row for each scene, GPU and level but the reference.
    pub rows: Vec<Row>,
    /// What the cheap levels add to a run that only draws, scenes by GPUs.
    pub added: Vec<AddedRow>,
    /// Streams made to break levels, on each GPU; not in the figures of the levels.
    pub failures: Vec<FailureRow>,
    /// Rates of the large GPU from outside.
    pub rates: Vec<RateRow>,
}

/// Measures built-in scenes, families of triangles and the scenes in `files`.
///
/// # Errors
/// When a scene cannot be loaded or a GPU fails.
pub fn timing(files: &[String], quick: bool, progress: &Progress) -> Result<TimingChart, RunError> {
    let gpus: Vec<GpuSpec> = GPUS.iter().map(GpuSpec::load).collect::<Result<_, _>>()?;
    let subjects = subjects::all(files, quick)?;
    let bar = progress.bar("scenes", (subjects.len() * gpus.len()) as u64);
    // One after another: host times are part of what is measured.
    let (mut rows, mut added, mut reference) = (Vec::new(), Vec::new(), measure::Speed::default());
    for subject in &subjects {
        for gpu in &gpus {
            let stream = subject.stream(gpu)?;
            rows.extend(measure::rows(subject.name(), gpu, &stream, &mut reference)?);
            added.extend(added::rows(subject, gpu)?);
            bar.inc();
        }
    }
    let animations = animated(files, &gpus, quick, progress)?;
    let levels = Level::ALL.into_iter().map(|level| (level.name(), figures(level, &rows, &added))).collect();
    Ok(TimingChart {
        quick,
        levels,
        reference: reference.figures(),
        animations,
        rows,
        added,
        failures: failures::failures(&gpus)?,
        rates: failures::rates()?,
    })
}

/// Every scene that is animated, on every GPU.
fn animated(
    files: &[String],
    gpus: &[GpuSpec],
    quick: bool,
    progress: &Progress,
) -> Result<Vec<AnimationRow>, RunError> {
    let extent = animations::Extent::of(quick);
    let mut rows = Vec::new();
    for scene in subjects::SCENES.into_iter().chain(files.iter().map(String::as_str)) {
        for gpu in gpus {
            rows.extend(animations::rows(scene, gpu, extent, progress)?);
        }
    }
    Ok(rows)
}

fn figures(level: Level, rows: &[Row], added: &[AddedRow]) -> Figures {
    if level == Level::Stepped {
        return Figures { speedup_over_stepped: 1.0, speedup_over_stepped_least: 1.0, ..Figures::default() };
    }
    let of = |pick: fn(&Row) -> f64| quantiles(rows.iter().filter(|row| row.level == level).map(pick));
    let added = quantiles(added.iter().filter(|row| row.level == level).map(|row| row.added_percent));
    let (cycles, energy) =
        (of(|row| row.cycle_error_percent.abs()), of(|row| row.energy_error_percent.abs()));
    let (busy, speedup) = (of(|row| row.busy_error_percent), of(|row| row.speedup_over_stepped));
    Figures {
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

impl TimingChart {
    /// The levels as a table for the terminal and the book.
    pub fn text(&self) -> Table {
        let mut table = Table::new([
            "level",
            "cycles: median",
            "95 %",
            "worst",
            "energy: median",
            "worst",
            "power shape",
            "times as fast",
            "adds to a run",
        ]);
        for (name, f) in &self.levels {
            let percent = |value: f64| format!("{value:.2} %");
            table.row([
                (*name).to_owned(),
                percent(f.cycle_error_median_percent),
                percent(f.cycle_error_p95_percent),
                percent(f.cycle_error_worst_percent),
                percent(f.energy_error_median_percent),
                percent(f.energy_error_worst_percent),
                percent(f.power_shape_error_percent),
                format!("{:.1}", f.speedup_over_stepped),
                if *name == Level::Stepped.name() {
                    "-".to_owned()
                } else {
                    format!("{:.0} %", f.added_percent)
                },
            ]);
        }
        table
    }
}
