//! `quintile stress`: the failure catalogue, each method on each family.
//!
//! - [`methods`]: the sets of tests compared.
//! - [`subject`]: what they are tried on, and what every sample has to see.
//! - [`sweep`], [`truth`]: when a triangle truly touches a tile.
//! - [`intervals`]: the boxes of tile tests against that.
//! - [`measure`]: all of it for one value of a family.
//! - [`choice`]: `auto` against every fixed choice of tests.
//! - [`report`]: every row, as table, CSV and pictures.

pub mod choice;
pub mod intervals;
pub mod measure;
pub mod methods;
mod picture;
pub mod report;
pub mod subject;
pub mod sweep;
pub mod truth;

use rayon::prelude::*;
use workloads::stress::{Family, Size, families, family};

use choice::{Choices, Trial};
use measure::Row;
use output::progress::Progress;
pub use report::Report;
use run::GpuSpec;
use run::RunError;
pub use write::claim;

/// The seed of the scenes.
const SEED: u64 = 1;

/// Sweeps the family called `only`, or all of them.
///
/// # Errors
/// When there is no such family, or a scene cannot be made.
pub fn stress(only: Option<&str>, quick: bool, progress: &Progress) -> Result<Report, RunError> {
    let chosen = choose(only)?;
    let size = if quick { Size::QUICK } else { Size::FULL };
    let gpu = GpuSpec::load("reference")?;
    let cases: Vec<(&'static Family, f64)> = chosen
        .iter()
        .flat_map(|&family| family.sweep(quick).iter().map(move |&value| (family, value)))
        .collect();
    let bar = progress.bar("values", cases.len() as u64);
    let measured: Vec<(Vec<Row>, Option<Trial>)> = cases
        .par_iter()
        .map(|&(family, value)| {
            let rows = measure::measure(family, value, size, &gpu, &methods::METHODS)?;
            // Every combination of tests on a million triangles would take longer than all the rest.
            let held = family.sweep(true).contains(&value);
            let trial = held.then(|| choice::trial(family, value, size, SEED, &gpu)).transpose()?;
            bar.inc();
            Ok((rows, trial))
        })
        .collect::<Result<_, RunError>>()?;
    let (rows, trials): (Vec<_>, Vec<_>) = measured.into_iter().unzip();
    let trials: Vec<Trial> = trials.into_iter().flatten().collect();
    Ok(Report {
        families: chosen,
        size,
        rows: rows.into_iter().flatten().collect(),
        auto: Choices::new(&trials),
    })
}

fn choose(only: Option<&str>) -> Result<Vec<&'static Family>, RunError> {
    let Some(name) = only else { return Ok(families().collect()) };
    let unknown = || {
        let names: Vec<_> = families().map(|family| family.name).collect();
        RunError::Setting(format!("no family called `{name}`; there are {}", names.join(", ")))
    };
    Ok(vec![family(name).ok_or_else(unknown)?])
}

mod write;

#[cfg(test)]
mod tests;
