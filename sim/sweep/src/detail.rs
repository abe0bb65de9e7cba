//! What is kept of a run beside its sums: passes and both ends of the energy table.

use activity::Bin;
use power_model::{Bound, ModelError};
use run::{Plan, RunFrame, passes_of};
use serde::{Deserialize, Serialize};

/// Time and energy of the passes of one name, mean per frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassMeans {
    /// Name of the pass.
    pub name: String,
    /// Milliseconds.
    pub ms: f64,
    /// Millijoules.
    pub mj: f64,
}

/// Passes of a run in the order of their first use. Their times add up to the busy time, their energies to the busy energy.
pub(crate) fn passes(plan: &Plan, frames: &[&RunFrame]) -> Vec<PassMeans> {
    let count = frames.len().max(1) as f64;
    let means = |pass: run::PassSummary| PassMeans {
        name: pass.name,
        ms: pass.all.time_s / count * 1e3,
        mj: pass.all.energy_j / count * 1e3,
    };
    passes_of(plan, frames.iter().copied()).into_iter().map(means).collect()
}

/// Busy energy in joules, mean per frame, with all energies and watts at their low and at their high end. Nothing is timed again.
///
/// # Errors
/// If table and platform do not match.
pub(crate) fn energy_ends(plan: &Plan, frames: &[&RunFrame]) -> Result<[f64; 2], ModelError> {
    let count = frames.len().max(1) as f64;
    let at = |bound: Bound| {
        let model = plan.model_at(bound)?;
        let energy_j = |frame: &&RunFrame| {
            let counts = frame.observed().map(|observed| observed.counts).unwrap_or_default();
            model.energy_of(&Bin { counts, busy_ps: frame.busy_ps }, frame.power.duration_ps()).total_j()
        };
        Ok::<f64, ModelError>(frames.iter().map(energy_j).sum::<f64>() / count)
    };
    Ok([at(Bound::Low)?, at(Bound::High)?])
}
