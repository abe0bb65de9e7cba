//! Simulation of all frames of a run, and of one small frame on a machine given as text (for tests and fuzz targets).

use output::OutDir;
use output::progress::Progress;
use power_model::{EnergyTable, Platform};
use rayon::prelude::*;
use timing::Level;
use workloads::Overrides;

use crate::frame::{FrameSimulator, SimulatedFrame, max_bins_per_frame};
use crate::{Distinct, GpuSpec, Plan, RunError, RunOptions, Sampling, Simulated, measure, sampled};

/// Simulates the frames that the plan requires and writes each image when its frame is done.
pub(super) fn simulate(
    plan: &Plan,
    distinct: &Distinct,
    dir: &OutDir,
    progress: &Progress,
) -> Result<Simulated, RunError> {
    let max_bins = max_bins_per_frame(distinct.numbers().len());
    let simulator = FrameSimulator { plan, distinct, dir: Some(dir), max_bins };
    if plan.options.sampling == Sampling::Every || has_few_distinct(distinct, plan.options.sampling) {
        return every(&simulator, progress);
    }
    sampled::simulate(&simulator, progress)
}

/// Whether there are so few distinct frames that prediction would save nothing.
fn has_few_distinct(distinct: &Distinct, sampling: Sampling) -> bool {
    let (differ, all) = (distinct.numbers().len(), distinct.groups().len());
    differ == 1 || differ < all && differ <= sampling.first(all)
}

/// Simulates all distinct frames without writing files.
pub(super) fn without_files(plan: &Plan, progress: &Progress) -> Result<Simulated, RunError> {
    let distinct = &Distinct::new(&*plan.job)?;
    let max_bins = max_bins_per_frame(distinct.numbers().len());
    every(&FrameSimulator { plan, distinct, dir: None, max_bins }, progress)
}

/// Simulates all distinct frames. Keeps the images of the first, the middle and the last.
fn every(simulator: &FrameSimulator<'_>, progress: &Progress) -> Result<Simulated, RunError> {
    let numbers = simulator.distinct.numbers();
    let middle = numbers[numbers.len() / 2];
    let shown = [middle, numbers[0], numbers[numbers.len() - 1]];
    let bar = progress.bar("frames", numbers.len() as u64);
    let simulate = |group: usize| {
        let done = simulator.simulate(group, shown.contains(&numbers[group]))?;
        bar.inc();
        Ok(done)
    };
    let done: Vec<SimulatedFrame> =
        (0..numbers.len()).into_par_iter().map(simulate).collect::<Result<_, RunError>>()?;
    let (mut distinct, mut pictures, mut heat) = (Vec::new(), Vec::new(), Vec::new());
    for done in done {
        if done.frame.index == middle {
            heat = done.heat;
        }
        pictures.extend(done.picture.map(|picture| (done.frame.index, picture)));
        distinct.push(done.frame);
    }
    let frames = simulator.distinct.groups().to_vec();
    Ok(Simulated { distinct, frames, pictures, heat, sampled: None })
}

/// Files of a machine as RON text; `None` for those of the reference.
#[derive(Clone, Copy, Debug, Default)]
pub struct MachineTexts<'a> {
    /// The GPU file.
    pub gpu: Option<&'a str>,
    /// The platform file.
    pub platform: Option<&'a str>,
    /// The energy table.
    pub table: Option<&'a str>,
}

impl MachineTexts<'_> {
    /// Simulates one frame of the scene `tiny` at 16x12 pixels at `level`, records it and finds it in the
    /// trace. Returns its energy in the trace in joules and writes no files. Messages name the files
    /// `gpu.ron`, `platform.ron` and `table.ron`.
    ///
    /// # Errors
    /// If a file is invalid, or the files do not match.
    pub fn one_frame(&self, level: Level) -> Result<f64, RunError> {
        let gpu =
            self.gpu.map_or_else(|| GpuSpec::load("reference"), |text| GpuSpec::parse(text, "gpu.ron"))?;
        let platform = self
            .platform
            .map_or_else(|| Platform::builtin("reference"), |text| Platform::parse(text, "platform.ron"))?;
        let table = self
            .table
            .map_or_else(|| EnergyTable::builtin("28nm"), |text| EnergyTable::parse(text, "table.ron"))?;
        let overrides =
            Overrides { size: Some((16, 12)), samples: Some(1), frames: Some(0..1), ..Overrides::default() };
        let options =
            RunOptions { scene: "tiny".into(), overrides, timing: Some(level), ..RunOptions::default() };
        let plan = Plan::resolve(options)?.on(gpu, platform, table)?;
        let simulated = without_files(&plan, &Progress::new(true))?;
        let measurement = measure::measure(&plan, &simulated)?;
        Ok(measurement.frames.iter().map(|frame| frame.energy_j).sum())
    }
}
