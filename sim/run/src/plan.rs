//! Plan of a run: its inputs, loaded and checked, and the limits of its size.

use std::path::{Path, PathBuf};

use activity::inputs;
use pipeline::Viewport;
use pipeline::sampling::SampleSource;
use power_model::{EnergyTable, Pacing, Platform, PowerModel};
use traces::device::RATES_HZ;
use workloads::{Overrides, SampleChoice};

use crate::gpu::GpuSpec;
use crate::options::{DEFAULT_RATE_HZ, PacingChoice, RunOptions, Sampling};
use crate::{RunError, Work};

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

/// Bytes of memory that the samples of one image may take.
const SAMPLE_BYTES_LIMIT: u64 = 8 << 30;
/// Bytes of one stored sample: its depth, its triangle, and what is logged and resolved of it.
pub(super) const BYTES_PER_SAMPLE: u64 = 16;
/// Samples of the trace: about 2.5 GB as CSV, which is written beside the 0.4 GB of Parquet.
const TRACE_LIMIT: f64 = 5e7;
/// Frames of one run.
const FRAMES_LIMIT: u32 = 100_000;

/// Refuses `pixels` of `samples`, each of so many bytes, where they would not fit into memory; `what` begins the message.
///
/// # Errors
/// [`RunError::Setting`] with what would be needed.
pub fn fits_memory(what: &str, pixels: u64, samples: u32, bytes_per_sample: u64) -> Result<(), RunError> {
    let bytes = pixels * u64::from(samples) * bytes_per_sample;
    let (needed, limit) = (bytes >> 30, SAMPLE_BYTES_LIMIT >> 30);
    let message = || {
        format!(
            "{what}: {pixels} pixels of {samples} samples take {needed} GiB, more than {limit} GiB; ask for fewer"
        )
    };
    if bytes > SAMPLE_BYTES_LIMIT { Err(RunError::Setting(message())) } else { Ok(()) }
}

/// What decides the size of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    pub pixels: u64,
    pub samples: u32,
    pub frames: u32,
    pub pacing: Pacing,
    pub trace_rate_hz: f64,
    pub idle_s: f64,
}

impl Size {
    /// Refuses what would not fit.
    pub fn check(&self) -> Result<(), RunError> {
        let refuse = |message| Err(RunError::Setting(message));
        fits_memory("size and samples", self.pixels, self.samples, BYTES_PER_SAMPLE)?;
        if self.frames > FRAMES_LIMIT {
            return refuse(format!(
                "frames: {} in one run; at most {FRAMES_LIMIT}, ask for fewer",
                self.frames
            ));
        }
        trace_fits(self.recorded_s(), self.trace_rate_hz)
    }

    /// How long the recording is; of frames that follow each other freely, without them.
    fn recorded_s(&self) -> f64 {
        let frames_s = match self.pacing {
            Pacing::Vsync { rate } => f64::from(self.frames) / rate.value(),
            Pacing::FreeRunning => 0.0,
        };
        frames_s + self.idle_s
    }

    /// Samples of the trace.
    pub fn trace_samples(&self) -> f64 {
        self.recorded_s() * self.trace_rate_hz
    }
}

/// Refuses a recording of `length_s` where its files would fill the disk.
pub(super) fn trace_fits(length_s: f64, rate_hz: f64) -> Result<(), RunError> {
    let samples = length_s * rate_hz;
    if samples <= TRACE_LIMIT {
        return Ok(());
    }
    Err(RunError::Setting(format!(
        "the trace: {length_s:.0} s at {rate_hz} samples a second are {samples:.1e} samples, more than {TRACE_LIMIT:.0e}; ask \
         for fewer frames, a lower --trace-rate, a higher --rate, or less lead_in_s and tail_s in the platform file"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn size() -> Size {
        let pacing = Pacing::vsync(60.0).unwrap();
        Size { pixels: 921_600, samples: 8, frames: 36, pacing, trace_rate_hz: 50e3, idle_s: 0.5 }
    }

    fn message(size: Size) -> String {
        size.check().unwrap_err().to_string()
    }

    #[test]
    fn ordinary_runs_fit() {
        assert!(size().check().is_ok());
        assert!(Size { pixels: 3840 * 2160, samples: 64, frames: 3000, ..size() }.check().is_ok());
    }

    #[test]
    fn what_does_not_fit_says_what_to_change() {
        assert!(message(Size { pixels: 1 << 28, samples: 256, ..size() }).contains("ask for fewer"));
        assert!(message(Size { frames: 10_000_000, ..size() }).contains("at most 100000"));
        assert!(message(Size { trace_rate_hz: 1e7, frames: 6000, ..size() }).contains("--trace-rate"));
        let idle = Size { trace_rate_hz: 1e7, idle_s: 120.0, pacing: Pacing::FreeRunning, ..size() };
        assert!(
            message(idle).contains("120 s at 10000000 samples a second are 1.2e9 samples, more than 5e7")
        );
    }
}
