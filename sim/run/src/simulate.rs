//! Simulation of all frames of a run.

use rayon::prelude::*;

use super::frame::{FrameSimulator, SimulatedFrame, max_bins_per_frame};
use super::sampled;
use super::{Distinct, Plan, RunError, Simulated};
use crate::Sampling;
use output::OutDir;
use output::progress::Progress;

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
    let distinct = &Distinct::new(&plan.work)?;
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
