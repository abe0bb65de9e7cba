//! What was asked for, and what it means.

use std::path::Path;

use activity::Event;
use pipeline::Viewport;
use pipeline::sampling::SampleSource;
use power_model::{Bound, EnergyTable, Pacing, Platform, PowerModel};
use traces::device::RATES_HZ;
use workloads::job::OptionSource;
use workloads::{Overrides, SampleChoice};

use super::limits::Size;
use super::{RunError, Wish, Work};
use crate::gpu::GpuSpec;
use crate::timing::{Level, Sampling};

/// When the next frame starts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PacingChoice {
    /// On the next tick of a display that runs at the scene's frame rate.
    #[default]
    Vsync,
    /// As soon as the one before is done.
    Free,
}

/// A run as asked for.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// A built-in scene, a file or a workload.
    pub scene: String,
    /// Options of a workload.
    pub options: OptionSource,
    /// Changes to the scene's settings.
    pub overrides: Overrides,
    /// A built-in GPU or a RON file.
    pub gpu: String,
    /// A built-in platform or a RON file.
    pub platform: String,
    /// A built-in energy table or a RON file.
    pub energy: String,
    /// Which of the table's values is used.
    pub bound: Bound,
    /// How time is modelled.
    pub timing: Level,
    /// How many frames are simulated.
    pub sampling: Sampling,
    /// What is wanted instead: then level and frames are chosen.
    pub wish: Wish,
    /// Whether the run is held against every frame at the reference.
    pub verify: bool,
    /// When the next frame starts.
    pub pacing: PacingChoice,
    /// Samples per second of the recorder.
    pub trace_rate_hz: f64,
    /// Samples of the recorder that travel together and are lost together.
    pub packet_samples: u32,
    /// Share of these packets that are lost, 0 to below 1.
    pub packet_loss: f64,
    /// Seed of samples, noise and losses.
    pub seed: u64,
    /// Whether images are written as EXR, too.
    pub exr: bool,
    /// Counters whose heat maps are wanted.
    pub heat: Vec<Event>,
}

impl Default for RunOptions {
    fn default() -> Self {
        Self {
            scene: "default".to_owned(),
            options: OptionSource::default(),
            overrides: Overrides::default(),
            gpu: "reference".to_owned(),
            platform: "reference".to_owned(),
            energy: "28nm".to_owned(),
            bound: Bound::Nominal,
            timing: Level::default(),
            sampling: Sampling::default(),
            wish: Wish::default(),
            verify: false,
            pacing: PacingChoice::default(),
            trace_rate_hz: 50e3,
            packet_samples: 512,
            packet_loss: 0.0,
            seed: 1,
            exr: false,
            heat: Vec::new(),
        }
    }
}

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
}

impl Plan {
    /// Loads and checks everything that `options` names.
    ///
    /// # Errors
    /// The first thing that is missing, broken or makes no sense.
    pub fn resolve(options: RunOptions) -> Result<Self, RunError> {
        if !RATES_HZ.contains(&options.trace_rate_hz) {
            let rate = options.trace_rate_hz;
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
        let platform = file_or_name(&options.platform, Platform::load, Platform::builtin)?;
        Size {
            pixels: viewport.pixels() as u64,
            samples: settings.samples,
            frames: settings.frames.end - settings.frames.start,
            pacing,
            trace_rate_hz: options.trace_rate_hz,
            idle_s: platform.lead_in_s.value() + platform.tail_s.value(),
        }
        .check()?;
        let samples = table.source(settings.samples, options.seed)?;
        let gpu = GpuSpec::load(&options.gpu)?;
        let table = file_or_name(&options.energy, EnergyTable::load, EnergyTable::builtin)?;
        let model = PowerModel::at(&table, &platform, options.bound)?;
        Ok(Self { work, viewport, samples, gpu, platform, table, model, pacing, options })
    }

    /// Pixels of the image.
    pub fn pixels(&self) -> u64 {
        self.viewport.pixels() as u64
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
    name: &str,
    load: impl FnOnce(&Path) -> Result<T, E>,
    builtin: impl FnOnce(&str) -> Result<T, E>,
) -> Result<T, E> {
    if name.ends_with(".ron") { load(Path::new(name)) } else { builtin(name) }
}
