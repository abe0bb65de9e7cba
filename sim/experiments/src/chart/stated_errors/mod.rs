//! `quintile chart stated-errors`: errors of timing levels on GPUs drawn at random, the errors that a run
//! states from them, and how often those hold.
//!
//! Scenes and workloads are in two halves, and so are the GPUs. An error is stated from one half of both and
//! judged on the other, so neither frame nor GPU is known to it.
//!
//! GPUs are drawn at random around the reference one. The picture shows errors over how far a GPU is from it,
//! over its memory channels, and over how dense packets are.

mod figures;

use activity::{Bounded, PacketBuffer};
use output::OutputError;
use output::plot::{ChartPanel, Paint, PlotMark, Scale, Series};
use output::terminal::Progress;
use rayon::prelude::*;
use run::{GpuSpec, RunError, StatedError};
use serde::Serialize;
use timing::{Checked, Level, Rates, Timed};
use traces::stats::Random;

use super::timing::animations;
use super::timing::animations::Subject;
use super::timing::measure::{Written, power_model, timed};
use crate::study::table::Sheet;
use crate::study::{Gallery, Study, StudyError};

pub use figures::{Accuracy, Flips, StatedMargin};

/// Levels that have errors.
const LEVELS: [Level; 2] = [Level::Packet, Level::Bound];
/// The GPU that the others are drawn around.
const HOME: &str = "reference";
/// Least number of GPUs with which a share of runs is a finding.
const MIN_GPUS: u64 = 24;
/// Least share of runs within their stated error: the promise of 95 %, less what a finite number of GPUs moves it.
const MIN_HELD: f64 = 0.93;

/// Effort.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct StatedErrorsEffort {
    /// GPUs.
    pub gpus: u64,
    /// What they are drawn by.
    pub seed: u64,
    /// One of how many scenes and workloads is timed.
    pub one_of: usize,
}

/// A frame on a GPU at a level. Errors are logarithms of the level's number over that at `stepped`.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorRow {
    /// The scene, family or workload.
    pub subject: String,
    /// Place of the subject in the list of subjects.
    pub subject_number: usize,
    /// Number of the GPU.
    pub gpu: u64,
    /// The level.
    pub level: Level,
    /// Error that the check of the level found, and whether it is worth a warning.
    pub checked_log: f64,
    /// See above.
    pub warns: bool,
    /// Error of cycles.
    pub cycles_log: f64,
    /// Error of the energy of the frame.
    pub energy_log: f64,
    /// Seconds of the frame at `stepped`.
    pub stepped_s: f64,
    /// Joules at `stepped`.
    pub stepped_j: f64,
    /// Root mean square of the binary logarithms of the GPU's numbers over those of `reference`.
    pub distance: f64,
    /// Memory channels.
    pub channels: u32,
    /// Bytes of a memory row.
    pub row_bytes: u32,
    /// Packets over cycles, at `stepped`.
    pub packets_per_cycle: f64,
}

/// The whole chart.
#[derive(Clone, Debug, Serialize)]
pub struct StatedErrorsChart {
    /// Effort.
    pub effort: StatedErrorsEffort,
    /// Errors of levels, and what their warnings say.
    pub levels: Vec<Accuracy>,
    /// Stated errors, and how often they hold.
    pub margins: Vec<StatedMargin>,
    /// Pairs of GPUs whose order a level turns round.
    pub flips: Vec<Flips>,
    /// A row for each frame, GPU and level.
    pub rows: Vec<ErrorRow>,
}

impl Study for StatedErrorsChart {
    const NAME: &'static str = "stated-errors";
    const ABOUT: &'static str =
        "Errors of timing levels on GPUs drawn at random, and how often the stated errors of runs hold";
    const PICTURES: &'static [&'static str] = &["stated_errors"];
    const FILES: &'static [&'static str] =
        &["stated_errors.csv", "stated_errors_runs.csv", "stated_errors.json"];
    const TAKES_SEED: bool = true;

    type Effort = StatedErrorsEffort;
    const FULL: StatedErrorsEffort = StatedErrorsEffort { gpus: 24, seed: 1, one_of: 1 };
    const QUICK: StatedErrorsEffort = StatedErrorsEffort { gpus: 4, seed: 1, one_of: 1 };

    fn seeded(effort: StatedErrorsEffort, seed: u64) -> StatedErrorsEffort {
        StatedErrorsEffort { seed, ..effort }
    }

    fn measure(
        effort: StatedErrorsEffort,
        _scenes: &[String],
        progress: &Progress,
    ) -> Result<Self, StudyError> {
        let home = GpuSpec::load(HOME)?;
        let gpus: Vec<RandomGpu> =
            (0..effort.gpus).map(|number| RandomGpu::new(&home, effort.seed, number)).collect();
        let subjects: Vec<_> = animations::all(&[], true)?.into_iter().step_by(effort.one_of).collect();
        let bar = progress.bar("frames", subjects.len() as u64 * effort.gpus);
        let mut rows = Vec::new();
        for (number, subject) in subjects.iter().enumerate() {
            // What is drawn depends on the pipeline alone, which all of them share.
            let stream = subject.stream(&home)?;
            let on = |(gpu_number, gpu): (usize, &RandomGpu)| {
                let rows = errors((number, subject), (gpu_number as u64, gpu), &stream);
                bar.inc();
                rows
            };
            let found: Vec<_> = gpus.par_iter().enumerate().map(on).collect::<Result<_, _>>()?;
            rows.extend(found.into_iter().flatten());
        }
        let levels = LEVELS.map(|level| Accuracy::of(level, &rows)).into();
        let margins = LEVELS.map(|level| StatedMargin::of(level, &rows)).into();
        Ok(Self { effort, levels, margins, flips: figures::flips(&rows), rows })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let subject = format!(
            "single frames on {} GPUs drawn at random; rings: the level warned; line: stated if its check finds no error",
            self.effort.gpus
        );
        to.chart("stated_errors", ["Errors of timing levels on random GPUs", &subject], self.panels())
    }

    fn tables(&self) -> Vec<Sheet> {
        vec![self.level_sheet(), self.margin_sheet(), self.flip_sheet(), self.row_sheet()]
    }

    /// Stated errors hold as often as they say, on frames and GPUs that they were not made from.
    fn fault(&self) -> Option<String> {
        let broken = |of: &&StatedMargin| of.held_out_cycles.is_some_and(|share| share < MIN_HELD);
        let margin = self.margins.iter().filter(|_| self.effort.gpus >= MIN_GPUS).find(broken)?;
        let (level, held) = (margin.level.name(), 100.0 * margin.held_out_cycles?);
        Some(format!("errors of `{level}`, stated for 95 % of runs, hold for {held:.1} %"))
    }
}

/// The errors of all levels for a frame on a GPU.
fn errors(
    (subject_number, subject): (usize, &Subject),
    (gpu_number, gpu): (u64, &RandomGpu),
    stream: &PacketBuffer,
) -> Result<Vec<ErrorRow>, RunError> {
    let spec = &gpu.spec;
    let model = power_model(spec)?;
    let written = Written::new(spec, stream)?;
    let cost = |level: Level| -> Result<(Timed, f64), RunError> {
        let (timed, _) = timed(level, spec, &written)?;
        let failed = |error| {
            let (subject, gpu, level) = (subject.name(), &spec.name, level.name());
            RunError::invalid(format_args!("{subject} on the GPU `{gpu}` at `{level}`"), error)
        };
        let power = model.frame(&timed.timeline).map_err(failed)?;
        Ok((timed, power.energy().total_j()))
    };
    let (truth, stepped_j) = cost(Level::Stepped)?;
    let row = |level: Level| {
        let (found, energy_j) = cost(level)?;
        let checked = written.check(level, spec, found.cycles)?;
        Ok(ErrorRow {
            subject: subject.name().to_owned(),
            subject_number,
            gpu: gpu_number,
            level,
            checked_log: libm::log1p(checked.map_or(0.0, |checked| checked.error)),
            warns: checked.is_some_and(Checked::is_far),
            cycles_log: libm::log(found.cycles as f64 / truth.cycles as f64),
            energy_log: libm::log(energy_j / stepped_j),
            stepped_s: truth.cycles as f64 / spec.core_hz,
            stepped_j,
            distance: gpu.distance,
            channels: spec.units.dram.channels.get(),
            row_bytes: spec.units.dram.row_bytes.get(),
            packets_per_cycle: stream.len() as f64 / truth.cycles as f64,
        })
    };
    LEVELS.into_iter().map(row).collect()
}

/// What errors are shown over: name, scale, and its value.
type Quantity = (&'static str, Scale, fn(&ErrorRow) -> f64);

const ACROSS: [Quantity; 3] = [
    ("distance from the reference GPU (RMS of log2)", Scale::Even, |row| row.distance),
    ("memory channels", Scale::Even, |row| f64::from(row.channels)),
    ("packets per cycle", Scale::Decades, |row| row.packets_per_cycle),
];

impl StatedErrorsChart {
    /// A row of panels for each level.
    fn panels(&self) -> Vec<ChartPanel> {
        LEVELS.into_iter().flat_map(|level| ACROSS.map(|across| self.panel(level, across))).collect()
    }

    fn panel(&self, level: Level, (name, scale, of): Quantity) -> ChartPanel {
        let rows = || self.rows.iter().filter(|row| row.level == level);
        let points = |warned: bool| {
            let rows = rows().filter(|row| row.warns == warned);
            rows.map(|row| (of(row), 100.0 * row.cycles_log.abs(), String::new())).collect()
        };
        let ends = rows().map(of).fold([f64::INFINITY, 0.0], |[low, high], x| [low.min(x), high.max(x)]);
        let stated = 100.0 * libm::log1p(StatedError::of(level, Some(0.0)).cycles);
        let line = ends.map(|x| (x, stated)).to_vec();
        let series = vec![
            Series::new("without a warning", PlotMark::Dots(points(false))).painted(Paint::Like(0)),
            Series::new("with a warning", PlotMark::Rings(points(true))).painted(Paint::Like(1)),
            Series::new("stated", PlotMark::Curve(line)).painted(Paint::Ink),
        ];
        ChartPanel::new(level.name(), [name, "error of cycles (%)"], series)
            .on(scale, Scale::Decades)
            .zeros(["", "exact"])
    }
}

/// Factors of rates, and clocks in hertz. Numbers between are drawn evenly by their logarithm.
const RATE_FACTORS: [f64; 2] = [0.25, 16.0];
const CLOCKS_HZ: [f64; 2] = [200e6, 1375e6];
/// Sizes to choose from.
const CORES: [u32; 5] = [1, 2, 4, 8, 16];
const LINES: [u32; 3] = [1, 2, 4];
const QUEUES: [u32; 5] = [2, 4, 8, 16, 32];
const CHANNELS: [u32; 6] = [1, 2, 3, 4, 6, 8];
const BANKS: [u32; 3] = [4, 8, 16];
const ROWS_BYTES: [u32; 3] = [1024, 2048, 4096];

/// A GPU, and how far it is from the reference one.
#[derive(Clone, Debug)]
struct RandomGpu {
    pub spec: GpuSpec,
    /// Root mean square of the binary logarithms of its numbers over those of the reference GPU.
    pub distance: f64,
}

impl RandomGpu {
    /// The GPU `number` of a seed: another one than `home` in clocks, rates, queues, cores and memory.
    pub fn new(home: &GpuSpec, seed: u64, number: u64) -> Self {
        let mut draw = Draw { random: Random::new(seed, number), squares: 0.0, count: 0 };
        let mut gpu = home.clone();
        gpu.name = format!("random {seed}.{number}");
        gpu.core_hz = draw.between(gpu.core_hz, CLOCKS_HZ);
        gpu.memory_hz = draw.between(gpu.memory_hz, CLOCKS_HZ);
        let units = &mut gpu.units;
        for unit in [
            &mut units.setup,
            &mut units.traversal,
            &mut units.z_cull,
            &mut units.sample_test,
            &mut units.shading_cache,
        ] {
            unit.rates = draw.rates(&unit.rates);
            unit.queue = draw.one_of(unit.queue, &QUEUES);
        }
        let clients = [&mut units.command, &mut units.depth, &mut units.texture, &mut units.colour];
        for client in clients.into_iter().chain(&mut units.compute) {
            client.rates = draw.rates(&client.rates);
            client.queue = draw.one_of(client.queue, &QUEUES);
            client.lines_per_cycle = draw.one_of(client.lines_per_cycle, &LINES);
        }
        units.shader.cores = draw.one_of(units.shader.cores, &CORES);
        units.shader.queue = draw.one_of(units.shader.queue, &QUEUES);
        units.l2.queue = draw.one_of(units.l2.queue, &QUEUES);
        units.l2.lines_per_cycle = draw.one_of(units.l2.lines_per_cycle, &LINES);
        let dram = &mut units.dram;
        dram.queue = draw.one_of(dram.queue, &QUEUES);
        dram.channels = draw.one_of(dram.channels, &CHANNELS);
        dram.banks = draw.one_of(dram.banks, &BANKS);
        dram.row_bytes = draw.one_of(dram.row_bytes, &ROWS_BYTES);
        Self { spec: gpu, distance: (draw.squares / draw.count as f64).sqrt() }
    }
}

/// Numbers drawn one after another, and how far they are from those they replace.
struct Draw {
    random: Random,
    squares: f64,
    /// Numbers drawn so far.
    count: u64,
}

impl Draw {
    /// The next number that `of` makes of an even one in (0, 1), in place of `home`.
    fn next(&mut self, home: f64, of: impl FnOnce(f64) -> f64) -> f64 {
        let drawn = of(self.random.uniform(self.count));
        self.squares += libm::log2(drawn / home).powi(2);
        self.count += 1;
        drawn
    }

    fn between(&mut self, home: f64, [low, high]: [f64; 2]) -> f64 {
        self.next(home, |even| low * libm::pow(high / low, even))
    }

    /// All rates of a unit times the same number.
    fn rates(&mut self, home: &Rates) -> Rates {
        home.scaled(self.between(1.0, RATE_FACTORS))
    }

    fn one_of<const MIN: u32, const MAX: u32>(
        &mut self,
        home: Bounded<MIN, MAX>,
        values: &[u32],
    ) -> Bounded<MIN, MAX> {
        let of = |even: f64| values[(even * values.len() as f64) as usize].into();
        let drawn = self.next(home.get().into(), of) as u32;
        // All values are within the limits of the fields that they are drawn for.
        Bounded::new(drawn).unwrap_or(home)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::written;

    #[test]
    fn the_chart_states_errors_that_its_own_runs_hold() {
        let effort = StatedErrorsEffort { gpus: 2, seed: 5, one_of: 5 };
        let (folder, chart, done) = written::<StatedErrorsChart>(effort);
        // A frame on a GPU at either level, and all frames have one.
        assert_eq!(chart.rows.len() % 4, 0);
        assert!(chart.rows.iter().all(|row| row.cycles_log.is_finite() && row.energy_log.is_finite()));
        for level in &chart.levels {
            assert_eq!(level.runs, chart.rows.len() / 2);
            assert_eq!(
                level.far_warned + level.far_silent + level.near_warned + level.near_silent,
                level.runs
            );
        }
        let text = std::fs::read_to_string(folder.path().join("stated_errors.csv")).unwrap();
        assert!(text.starts_with("level,runs,cycles,energy"), "{text}");
        assert!(done.text.contains("packet") && done.fault.is_none());
    }

    #[test]
    fn gpus_are_valid_different_and_the_same_again() {
        let home = GpuSpec::load("reference").unwrap();
        let of = |seed, number| RandomGpu::new(&home, seed, number);
        for number in 0..200 {
            let RandomGpu { spec, distance } = of(7, number);
            spec.units.validate().unwrap();
            spec.machine().unwrap();
            assert!((0.5..4.0).contains(&distance), "{distance}");
            assert!(spec == of(7, number).spec && spec.units != of(7, number + 1).spec.units);
            assert!(spec.units != of(8, number).spec.units);
            assert!(
                QUEUES.contains(&spec.units.dram.queue.get()) && BANKS.contains(&spec.units.dram.banks.get())
            );
        }
    }
}
