//! Whether GPU, platform and energy table belong together.

use std::path::{Path, PathBuf};

use power_model::{EnergyTable, Platform};
use warnings::{Code, Warning};

use super::options::RunOptions;
use crate::gpu::{GpuSpec, PowerFiles};

/// A warning where the GPU's file names another platform or energy table than those in use, or none: the watts of a platform
/// are stated for the size and the clock of one GPU, and nothing scales them.
pub(super) fn check(
    options: &RunOptions,
    gpu: &GpuSpec,
    platform: &Platform,
    table: &EnergyTable,
) -> Option<Warning> {
    let in_use = format!("platform `{}` and energy table `{}`", platform.name, table.name());
    let message = match &gpu.power {
        None => format!(
            "no platform belongs to GPU `{}`, so its watts come from {in_use}, which were made for another machine: compare its \
             cycles and counts, not its watts; or write a platform for it and name that as `power` in the GPU file",
            gpu.name
        ),
        Some(own) if belongs(own, options, platform, table) => return None,
        Some(own) => format!(
            "GPU `{}` belongs to platform `{}` and energy table `{}`, and its watts come from {in_use}: they are those of another \
             machine; leave --platform and --energy out, or choose the GPU that belongs to them (`quintile list`)",
            gpu.name, own.platform, own.energy
        ),
    };
    Some(Warning::new(Code::PlatformMismatch, message))
}

/// By the names in the files, or by what was asked for where that is a file itself.
fn belongs(own: &PowerFiles, options: &RunOptions, platform: &Platform, table: &EnergyTable) -> bool {
    let is = |own: &str, asked: &Option<PathBuf>, name: &str| {
        own == name || asked.as_ref().is_none_or(|asked| asked == Path::new(own))
    };
    is(&own.platform, &options.platform, &platform.name) && is(&own.energy, &options.energy, table.name())
}
