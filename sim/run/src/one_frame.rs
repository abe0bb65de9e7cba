//! One small frame on a machine given as text, for tests and fuzz targets of its files.

use output::progress::Progress;
use power_model::{EnergyTable, Platform};
use timing::Level;
use workloads::Overrides;

use crate::{GpuSpec, Plan, RunError, RunOptions, measure, simulate};

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
        let options = RunOptions { scene: "tiny".into(), overrides, timing: level, ..RunOptions::default() };
        let plan = Plan::resolve(options)?.on(gpu, platform, table)?;
        let simulated = simulate::without_files(&plan, &Progress::new(true))?;
        let measurement = measure::measure(&plan, &simulated)?;
        Ok(measurement.frames.iter().map(|frame| frame.energy_j).sum())
    }
}
