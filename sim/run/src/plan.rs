//! What a run is made of, loaded and checked.

use std::path::{Path, PathBuf};

use activity::inputs;
use pipeline::Viewport;
use pipeline::sampling::SampleSource;
use power_model::{EnergyTable, Pacing, Platform, PowerModel};
use traces::device::RATES_HZ;
use workloads::{Overrides, SampleChoice};

use super::limits::Size;
use super::options::{DEFAULT_RATE_HZ, PacingChoice, RunOptions};
use super::{RunError, Work};
use crate::Sampling;
use crate::gpu::GpuSpec;

/// A run with everything loaded and checked.
pub struct Plan {
    /// What was asked for.
    pub options: RunOptions,
    /// The scene or the job with its settings changed as asked.
    pub work: Work,
    /// Size of the image.
    pub viewport: Viewport,
    /// Where and when each pixel looks.
    pub samples: Box<dyn SampleSource>,
    /// The hardware.
    pub gpu: GpuSpec,
    /// What surrounds it.
    pub platform: Platform,
    /// Joules per event.
    pub table: EnergyTable,
    /// Table and platform joined.
    pub model: PowerModel,
    /// When the next frame starts.
    pub pacing: Pacing,
    /// The files that all this was read from, by name.
    pub files: Vec<PathBuf>,
}

impl Plan {
    /// Loads and checks everything that `options` names.
    ///
    /// # Errors
    /// The first thing that is missing, broken or makes no sense.
    pub fn resolve(options: RunOptions) -> Result<Self, RunError> {
        let (plan, files) = inputs::record(|| Self::load(options));
        Ok(Self { files, ..plan? })
    }

    fn load(options: RunOptions) -> Result<Self, RunError> {
        if let Some(rate) = options.trace_rate_hz.filter(|rate| !RATES_HZ.contains(rate)) {
            return Err(RunError::Setting(format!(
                "trace rate: {rate}; a recorder takes 1 to 1e7 samples a second"
            )));
        }
        if !(0.0..1.0).contains(&options.packet_loss) {
            let loss = options.packet_loss;
            return Err(RunError::Setting(format!(
                "packet loss: {loss}; a share from 0 to below 1 can be lost"
            )));
        }
        let (work, table) = work(&options)?;
        if !options.heat.is_empty() {
            work.scene("--heat")?;
        }
        if options.sampling != Sampling::Every {
            work.scene("--timing sampled")?;
        }
        let settings = work.settings();
        let viewport = Viewport::new(settings.width, settings.height)
            .ok_or_else(|| RunError::Setting(format!("size: {}x{}", settings.width, settings.height)))?;
        let pacing = match options.pacing {
            PacingChoice::Vsync => Pacing::vsync(settings.frame_rate_hz)?,
            PacingChoice::Free => Pacing::FreeRunning,
        };
        let gpu = GpuSpec::load(&options.gpu)?;
        let files = gpu.power.clone().unwrap_or_default();
        let platform = options.platform.as_deref().unwrap_or(Path::new(&files.platform));
        let platform = file_or_name(platform, Platform::load, Platform::builtin)?;
        size_of(&work, viewport, pacing, &platform, options.trace_rate_hz).check()?;
        let samples = table.source(settings.samples, options.seed)?;
        let table = options.energy.as_deref().unwrap_or(Path::new(&files.energy));
        let table = file_or_name(table, EnergyTable::load, EnergyTable::builtin)?;
        let model = PowerModel::at(&table, &platform, options.bound)?;
        let files = Vec::new();
        Ok(Self { work, viewport, samples, gpu, platform, table, model, pacing, options, files })
    }

    /// The same plan on another GPU, platform and energy table.
    ///
    /// # Errors
    /// When platform and table do not go together, or what is recorded would be too large.
    pub fn on(self, gpu: GpuSpec, platform: Platform, table: EnergyTable) -> Result<Self, RunError> {
        let model = PowerModel::at(&table, &platform, self.options.bound)?;
        let plan = Self { gpu, platform, table, model, ..self };
        plan.size().check()?;
        Ok(plan)
    }

    pub(super) fn size(&self) -> Size {
        size_of(&self.work, self.viewport, self.pacing, &self.platform, self.options.trace_rate_hz)
    }

    /// Pixels of the image.
    pub fn pixels(&self) -> u64 {
        self.viewport.pixels() as u64
    }
}

/// What decides how large a run is.
fn size_of(
    work: &Work,
    viewport: Viewport,
    pacing: Pacing,
    platform: &Platform,
    trace_rate_hz: Option<f64>,
) -> Size {
    let settings = work.settings();
    Size {
        pixels: viewport.pixels() as u64,
        samples: settings.samples,
        frames: settings.frames.end - settings.frames.start,
        pacing,
        trace_rate_hz: trace_rate_hz.unwrap_or(DEFAULT_RATE_HZ),
        idle_s: platform.lead_in_s.value() + platform.tail_s.value(),
    }
}

/// What is drawn with its settings changed as asked, and its sample table. A table in a file decides how many samples there
/// are, unless the caller asked for another number.
fn work(options: &RunOptions) -> Result<(Work, SampleChoice), RunError> {
    let work = Work::find(&options.scene, &options.overrides, &options.options, options.seed)?;
    let table = SampleChoice::load(&work.settings().table)?;
    let samples = table.per_pixel().filter(|_| options.overrides.samples.is_none());
    match (work, samples) {
        (Work::Scene(scene), Some(_)) => {
            let scene = scene.with_overrides(&Overrides { samples, ..Overrides::default() })?;
            Ok((Work::Scene(Box::new(scene)), table))
        }
        (work, _) => Ok((work, table)),
    }
}

fn file_or_name<T, E>(
    name: &Path,
    load: impl FnOnce(&Path) -> Result<T, E>,
    builtin: impl FnOnce(&str) -> Result<T, E>,
) -> Result<T, E> {
    match name.extension().is_some_and(|ending| ending == "ron") {
        true => load(name),
        false => builtin(&name.to_string_lossy()),
    }
}
