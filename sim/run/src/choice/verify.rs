//! `--verify`: the actual error, against every frame at the reference with all dimensions.

use serde::Serialize;

use super::super::{Plan, RunError, RunFrame, Simulated, Taken, Wish, frames_of, taken};
use crate::Sampling;
use output::progress::Progress;
use timing::Level;

/// Actual errors of the run against `stepped`, frame for frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Verified {
    /// Error of the cycles of all frames together.
    pub cycles_error: f64,
    /// Error of their energy, idle not counted.
    pub energy_error: f64,
    /// Error of mean power while busy.
    pub power_error: f64,
    /// The larger of the errors of cycles and energy.
    pub error: f64,
    /// The worst error of the cycles of a single frame.
    pub worst_frame_error: f64,
}

impl Verified {
    /// A line for the terminal and the report.
    pub fn line(&self) -> String {
        format!(
            "cycles {:+.2} %, energy {:+.2} %, power {:+.2} %, worst frame {:.2} %, against every frame at `stepped`",
            self.cycles_error * 100.0,
            self.energy_error * 100.0,
            self.power_error * 100.0,
            self.worst_frame_error * 100.0
        )
    }
}

/// Simulates every frame that differs once more, at the reference.
pub(in super::super) fn verify(
    plan: &Plan,
    simulated: &Simulated,
    progress: &Progress,
) -> Result<Verified, RunError> {
    let mut options = plan.options.clone();
    (options.timing, options.sampling, options.wish) = (Level::Stepped, Sampling::Every, Wish::default());
    options.heat = Vec::new();
    let reference = Plan::resolve(options)?;
    let numbers: Vec<u32> = simulated.distinct.iter().map(|frame| frame.index).collect();
    let truth = frames_of(&reference, &numbers, progress)?;
    Ok(compare(&simulated.distinct, &truth, &simulated.frames))
}

/// Compares frames found with true ones; `frames` holds for each frame of the run its index in both.
fn compare(found: &[RunFrame], truth: &[RunFrame], frames: &[usize]) -> Verified {
    let total = |distinct: &[RunFrame]| {
        let taken = frames.iter().map(|&index| taken(&distinct[index]));
        taken.fold(Taken { cycles: 0.0, energy_j: 0.0 }, |sum, frame| Taken {
            cycles: sum.cycles + frame.cycles,
            energy_j: sum.energy_j + frame.energy_j,
        })
    };
    let relative = |found: f64, truth: f64| if found == truth { 0.0 } else { found / truth - 1.0 };
    let (all, right) = (total(found), total(truth));
    let cycles = relative(all.cycles, right.cycles);
    let energy = relative(all.energy_j, right.energy_j);
    let frames = found.iter().zip(truth).map(|(a, b)| relative(a.cycles as f64, b.cycles as f64).abs());
    Verified {
        cycles_error: cycles,
        energy_error: energy,
        power_error: relative(all.energy_j / all.cycles, right.energy_j / right.cycles),
        error: cycles.abs().max(energy.abs()),
        worst_frame_error: frames.fold(0.0, f64::max),
    }
}
