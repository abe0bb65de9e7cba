//! `quintile chart memory`: traffic to memory and energy of a frame over the size of the levels below the L2.

use activity::{Event, Unit};
use output::OutputError;
use output::plot::{ChartPanel, Scale, Series};
use output::terminal::Progress;
use power_model::Part;
use run::{Change, GpuSpec, Plan, RunError, RunFrame, RunOptions, frames_of};
use serde::Serialize;
use workloads::Overrides;

use crate::study::table::{Sheet, TableBuilder, fixed, millis, optional, plain, share};
use crate::study::{Gallery, Study, StudyError, each};

/// Drawn: a scene of one pass, and a workload whose passes read what earlier ones wrote.
const WORK: [&str; 2] = ["default", "soft-shadows"];
/// The GPU with both levels, and the platform nearest to it.
const MACHINE: [&str; 2] = ["iris_pro", "hd_4000"];
/// The level that is swept, and its sizes in megabytes; 0 leaves it out. The LLC is alone, the eDRAM is below the
/// LLC of the GPU.
const SWEEPS: [(Unit, &[f64]); 2] =
    [(Unit::Llc, &[0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0]), (Unit::Edram, &[0.0, 8.0, 16.0, 32.0, 64.0, 128.0])];
const BYTES_PER_MB: f64 = 1_048_576.0;
/// Saving of energy below which a larger level does not pay, as a share.
const MIN_SAVING: f64 = 0.01;

/// Effort.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct MemoryEffort {
    /// Width and height of the image in pixels.
    pub size: (u32, u32),
    /// Samples in a pixel.
    pub samples: u32,
}

/// One frame with one size of a level.
#[derive(Clone, Debug, Default, Serialize)]
pub struct MemoryRow {
    /// The scene or workload.
    pub work: &'static str,
    /// The level whose size changes.
    pub level: &'static str,
    /// Size of the level in megabytes of 1,048,576 bytes.
    pub size_mb: f64,
    /// Bytes read from and written to memory.
    pub dram_bytes: u64,
    /// Reads and writes of the level that hit, as a share.
    pub hit_share: Option<f64>,
    /// Energy of the events of the L2, the levels below and memory, in joules.
    pub memory_j: f64,
    /// Energy of the frame in joules.
    pub frame_j: f64,
    /// Length of the frame in seconds.
    pub frame_s: f64,
}

/// The whole chart.
#[derive(Clone, Debug, Serialize)]
pub struct MemoryChart {
    /// Effort.
    pub effort: MemoryEffort,
    /// A row for each work, level and size.
    pub rows: Vec<MemoryRow>,
}

impl Study for MemoryChart {
    const NAME: &'static str = "memory";
    const ABOUT: &'static str =
        "Traffic to memory and energy over the size of a last-level cache and an eDRAM";
    const PICTURES: &'static [&'static str] = &["memory"];
    const FILES: &'static [&'static str] = &["memory.csv", "memory.json"];

    type Effort = MemoryEffort;
    const FULL: MemoryEffort = MemoryEffort { size: (1280, 720), samples: 8 };
    const QUICK: MemoryEffort = MemoryEffort { size: (320, 180), samples: 4 };

    fn measure(effort: MemoryEffort, _: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let sizes = |(level, sizes): (Unit, &'static [f64])| sizes.iter().map(move |&size| (level, size));
        let cases: Vec<_> = WORK
            .iter()
            .flat_map(|&work| SWEEPS.into_iter().flat_map(sizes).map(move |case| (work, case)))
            .collect();
        let row = |&(work, (level, size_mb)): &_| measure(work, level, size_mb, effort);
        Ok(Self { effort, rows: each(&cases, ("sizes", progress), row)? })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let panels = vec![
            self.panel("bytes to and from memory", "B", |row| row.dram_bytes as f64),
            self.panel("energy of the frame", "J", |row| row.frame_j),
        ];
        let subject = "a frame on the GPU iris_pro and the platform hd_4000; eDRAM below an LLC of 6 MB, LLC without an eDRAM";
        to.chart("memory", ["Where a level below the L2 stops paying", subject], panels)
    }

    fn tables(&self) -> Vec<Sheet> {
        let pays = self.sweeps().map(|rows| {
            let (MemoryRow { work, level, .. }, best) = (&rows[0], pays_up_to(rows));
            format!("\n{level} for {work}: the energy of a frame stops falling at {best} MB")
        });
        let rows = TableBuilder::of(&self.rows)
            .column("work", "work", |row| row.work, plain)
            .column("level", "level", |row| row.level, plain)
            .column("size_mb", "MB", |row| row.size_mb, plain)
            .column("dram_bytes", "memory (MB)", |row| row.dram_bytes, megabytes)
            .column("hit_share", "hits", |row| row.hit_share, optional(share(1)))
            .column("memory_j", "memory (mJ)", |row| row.memory_j, millis(2))
            .column("frame_j", "frame (mJ)", |row| row.frame_j, millis(2))
            .column("frame_s", "frame (ms)", |row| row.frame_s, millis(2))
            .after(pays.collect::<String>() + "\n")
            .csv("memory.csv");
        vec![rows.sheet()]
    }
}

fn megabytes(bytes: u64) -> String {
    fixed(2)(bytes as f64 / BYTES_PER_MB)
}

fn measure(
    work: &'static str,
    level: Unit,
    size_mb: f64,
    effort: MemoryEffort,
) -> Result<MemoryRow, RunError> {
    let overrides = Overrides {
        size: Some(effort.size),
        samples: Some(effort.samples),
        frames: Some(0..1),
        ..Overrides::default()
    };
    let [gpu, platform] = MACHINE.map(Into::into);
    let plan = Plan::resolve(RunOptions {
        scene: work.into(),
        gpu,
        platform: Some(platform),
        overrides,
        changes: changes(level, size_mb)?,
        ..RunOptions::default()
    })?;
    let frames = frames_of(&plan, &[0], &Progress::new(true))?;
    Ok(row(work, level, size_mb, &frames[0], plan.gpu().core_hz))
}

/// Changes of the GPU file that give `level` a size, in whole sets of its ways; without a size it is left out,
/// and so is a level below the LLC.
fn changes(level: Unit, size_mb: f64) -> Result<Vec<Change>, RunError> {
    let change = |path: String, value: String| Change { path: format!("gpu.{path}"), value };
    let without = |level: Unit| {
        let name = level.name();
        [format!("pipeline.memory.{name}"), format!("units.{name}")]
            .map(|path| change(path, "None".to_owned()))
    };
    let memory = GpuSpec::load(MACHINE[0])?.pipeline.memory;
    let (cache, mut changes) = match level {
        Unit::Llc => (memory.llc, without(Unit::Edram).to_vec()),
        _ => (memory.edram, Vec::new()),
    };
    match cache.filter(|_| size_mb > 0.0) {
        Some(cache) => {
            let entries = (size_mb * BYTES_PER_MB / f64::from(timing::LINE_BYTES)) as u32;
            let entries = entries - entries % cache.ways;
            changes.push(change(format!("pipeline.memory.{}.entries", level.name()), entries.to_string()));
        }
        None => changes.extend(without(level)),
    }
    Ok(changes)
}

fn row(work: &'static str, level: Unit, size_mb: f64, frame: &RunFrame, core_hz: f64) -> MemoryRow {
    let (cost, energy) = (frame.cost(), frame.power.energy());
    let counts = frame.observed().map(|observed| observed.counts).unwrap_or_default();
    let [accesses, misses] = match level {
        Unit::Llc => [counts[Event::LlcReads] + counts[Event::LlcWrites], counts[Event::LlcMisses]],
        _ => [counts[Event::EdramReads] + counts[Event::EdramWrites], counts[Event::EdramMisses]],
    };
    let memory = [Unit::L2, Unit::Llc, Unit::Edram, Unit::Dram];
    MemoryRow {
        work,
        level: level.name(),
        size_mb,
        dram_bytes: counts[Event::DramReadBytes] + counts[Event::DramWriteBytes],
        hit_share: (accesses > 0).then(|| 1.0 - misses as f64 / accesses as f64),
        memory_j: memory.into_iter().map(|unit| energy[Part::Unit(unit)]).sum(),
        frame_j: cost.energy_j,
        frame_s: cost.cycles / core_hz,
    }
}

/// The smallest size from which no larger one saves more than [`MIN_SAVING`] of the energy of a frame.
fn pays_up_to(rows: &[MemoryRow]) -> f64 {
    let least = |rows: &[MemoryRow]| rows.iter().map(|row| row.frame_j).fold(f64::INFINITY, f64::min);
    let pays = |at: usize| least(&rows[at..]) > (1.0 - MIN_SAVING) * rows[at].frame_j;
    (0..rows.len()).find(|&at| pays(at)).map_or(0.0, |at| rows[at].size_mb)
}

impl MemoryChart {
    /// The rows of each work and level, by size.
    fn sweeps(&self) -> impl Iterator<Item = &[MemoryRow]> {
        self.rows.chunk_by(|a, b| (a.work, a.level) == (b.work, b.level))
    }

    fn panel(&self, name: &str, unit: &str, of: fn(&MemoryRow) -> f64) -> ChartPanel {
        let curves = self.sweeps().map(|rows| {
            let points = rows.iter().map(|row| (row.size_mb * BYTES_PER_MB, of(row)));
            Series::curve(format!("{} ({})", rows[0].level, rows[0].work), points)
        });
        ChartPanel::new("", ["size of the level", name], curves.collect())
            .on(Scale::Doublings, Scale::FromZero)
            .in_units(["B", unit])
            .zeros(["none", ""])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::written;

    #[test]
    fn a_larger_level_hits_more_often_and_costs_energy_where_it_moves_as_many_bytes() {
        let (folder, chart, _) = written::<MemoryChart>(MemoryEffort { size: (160, 90), samples: 4 });
        let csv = std::fs::read_to_string(folder.path().join("memory.csv")).unwrap();
        assert_eq!(csv.lines().count(), 1 + chart.rows.len());
        for rows in chart.sweeps() {
            let grows = |pair: &[MemoryRow]| {
                pair[1].dram_bytes <= pair[0].dram_bytes && pair[1].hit_share >= pair[0].hit_share
            };
            assert!(rows.windows(2).all(grows), "{rows:?}");
            assert!(rows[0].hit_share.is_none() && rows[1].hit_share.is_some(), "{rows:?}");
            // Energy per access and leakage follow the size.
            let traffic = |row: &MemoryRow| (row.dram_bytes, row.hit_share);
            let mut equal = rows.windows(2).filter(|pair| traffic(&pair[0]) == traffic(&pair[1])).peekable();
            assert!(equal.peek().is_some(), "{rows:?}");
            let costs =
                |pair: &[MemoryRow]| pair[1].memory_j > pair[0].memory_j && pair[1].frame_j > pair[0].frame_j;
            assert!(equal.all(costs), "{rows:?}");
        }
        // A frame of the default scene this small fits in the L2; the shadow maps do not.
        assert!(chart.rows.iter().any(|row| row.hit_share > Some(0.0)));
    }

    #[test]
    fn a_size_pays_while_a_larger_one_saves_a_percent() {
        let rows = |energies: &[f64]| -> Vec<MemoryRow> {
            let row = |(size_mb, frame_j)| MemoryRow { size_mb, frame_j, ..MemoryRow::default() };
            [0.0, 1.0, 2.0, 4.0].into_iter().zip(energies.iter().copied()).map(row).collect()
        };
        assert_eq!(pays_up_to(&rows(&[10.0, 8.0, 7.0, 6.95])), 2.0);
        assert_eq!(pays_up_to(&rows(&[10.0, 10.1, 10.2, 10.3])), 0.0);
        assert_eq!(pays_up_to(&rows(&[10.0, 9.99, 9.98, 5.0])), 4.0);
    }
}
