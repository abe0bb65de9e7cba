//! Plan of a run: its inputs, loaded and checked, and the limits of its size.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use activity::inputs;
use pipeline::Viewport;
use power_model::{Bound, EnergyTable, ModelError, Pacing, Platform, PowerModel, Scaling};
use traces::device::RATES_HZ;
use warnings::Warning;
use workloads::job::{JobRequest, Reduction};
use workloads::{Job, Rendering, SceneSettings, catalog};

use crate::RunError;
use crate::changes::{ChangedFile, Changes, InputFile};
use crate::gpu::{GpuSpec, check_pairing};
use crate::hardware;
use crate::options::{Change, DEFAULT_RATE_HZ, HeatRequest, PacingChoice, Requested, RunOptions};

/// Plan of a run: options, and all inputs loaded and checked.
///
/// GPU, platform, energy table and power model follow from each other: callers read them, and change them by
/// [`RunOptions::changes`] or [`Self::on`].
pub struct Plan {
    /// The options.
    pub options: RunOptions,
    /// Name of the scene or workload.
    pub name: String,
    /// What is drawn: the scene or workload, with the changes of the options applied.
    pub job: Arc<dyn Job>,
    /// Size of the image.
    pub viewport: Viewport,
    /// The hardware.
    pub(crate) gpu: GpuSpec,
    /// The platform, with its watts scaled to the GPU, at the bound of the options.
    pub(crate) platform: Platform,
    /// The platform as in its file.
    unscaled: Platform,
    /// Energy table, in joules per event, as in its file.
    pub(crate) table: EnergyTable,
    /// What the GPU costs over the one that the platform was made for.
    pub(crate) scaling: Scaling,
    /// Power model of table and platform, scaled to the GPU.
    pub(crate) model: PowerModel,
    /// Warning of a platform or table that does not belong to the GPU.
    pub(crate) pairing: Option<Warning>,
    /// Relative error on the probe of the timing level, if `--accuracy` or `--budget` chose it.
    pub(crate) chosen: Option<f64>,
    /// When the next frame starts.
    pub pacing: Pacing,
    /// Input files, sorted by name.
    pub files: Vec<PathBuf>,
    /// Texts of the input files in which values were changed.
    pub changed: Vec<ChangedFile>,
}

impl Plan {
    /// Loads and checks all inputs that `options` names.
    ///
    /// # Errors
    /// The first input that is missing or invalid.
    pub fn resolve(options: RunOptions) -> Result<Self, RunError> {
        let (plan, files) = inputs::record(|| Self::load(options, load_job));
        Ok(Self { files, ..plan? })
    }

    /// Plan of the same job on the GPU, platform and energy table that `options` name. Scene and view of the
    /// options are not used.
    ///
    /// # Errors
    /// The first input that is missing or invalid.
    pub fn beside(&self, options: RunOptions) -> Result<Self, RunError> {
        Self::of_job(options, &self.name, Arc::clone(&self.job))
    }

    /// As [`Self::beside`], of a job that is already there.
    pub(crate) fn of_job(options: RunOptions, name: &str, job: Arc<dyn Job>) -> Result<Self, RunError> {
        let load = |_: &RunOptions, _: &mut Changes<'_>| Ok((name.to_owned(), job));
        let (plan, files) = inputs::record(|| Self::load(options, load));
        Ok(Self { files, ..plan? })
    }

    fn load(
        options: RunOptions,
        load_job: impl FnOnce(&RunOptions, &mut Changes<'_>) -> Result<(String, Arc<dyn Job>), RunError>,
    ) -> Result<Self, RunError> {
        check_recorder(&options)?;
        check_heat(&options.heat)?;
        if options.timing.is_none() {
            check_images(&options)?;
        }
        let mut changes = Changes::new(&options.changes)?;
        let (name, job) = load_job(&options, &mut changes)?;
        let settings = job.settings();
        let viewport = Viewport::new(settings.width, settings.height).ok_or_else(|| {
            RunError::invalid("size", format_args!("{}x{}", settings.width, settings.height))
        })?;
        let pacing = match options.pacing {
            PacingChoice::Vsync => Pacing::vsync(settings.frame_rate_hz)?,
            PacingChoice::Free => Pacing::FreeRunning,
        };
        let gpu = changes.gpu(&options.gpu)?.map_or_else(|| GpuSpec::load(&options.gpu), Ok)?;
        let files = gpu.power.clone().unwrap_or_default();
        let platform = options.platform.as_deref().unwrap_or(Path::new(&files.platform));
        let platform = match changes.platform(platform)? {
            Some(changed) => changed,
            None => file_or_name(platform, Platform::load, Platform::builtin)?,
        };
        // Without time there is no trace.
        let trace_rate_hz = options.timing.map_or(Some(0.0), |_| options.trace_rate_hz);
        size_of(settings, viewport, pacing, &platform, trace_rate_hz).check()?;
        let table = options.energy.as_deref().unwrap_or(Path::new(&files.energy));
        let table = match changes.table(table)? {
            Some(changed) => changed,
            None => file_or_name(table, EnergyTable::load, EnergyTable::builtin)?,
        };
        let (files, changed) = (Vec::new(), changes.files);
        let Powered { platform, unscaled, scaling, model, pairing } =
            Powered::new(&options, &gpu, platform, &table)?;
        Ok(Self {
            name,
            job,
            viewport,
            gpu,
            platform,
            unscaled,
            table,
            scaling,
            model,
            pairing,
            chosen: None,
            pacing,
            options,
            files,
            changed,
        })
    }

    /// The same plan on another GPU, platform and energy table.
    ///
    /// # Errors
    /// If platform and table do not match, or the recording would be too large.
    pub fn on(self, gpu: GpuSpec, platform: Platform, table: EnergyTable) -> Result<Self, RunError> {
        let Powered { platform, unscaled, scaling, model, pairing } =
            Powered::new(&self.options, &gpu, platform, &table)?;
        let plan = Self { gpu, platform, unscaled, table, scaling, model, pairing, ..self };
        plan.size().check()?;
        Ok(plan)
    }

    /// The hardware.
    pub const fn gpu(&self) -> &GpuSpec {
        &self.gpu
    }

    /// The platform, with its watts scaled to the GPU, at the bound of the options.
    pub const fn platform(&self) -> &Platform {
        &self.platform
    }

    /// Energy table, in joules per event, as in its file.
    pub const fn table(&self) -> &EnergyTable {
        &self.table
    }

    /// Power model of table and platform, scaled to the GPU.
    pub const fn model(&self) -> &PowerModel {
        &self.model
    }

    /// The power model with all energies and watts at `bound`.
    ///
    /// # Errors
    /// If table and platform do not match.
    pub fn model_at(&self, bound: Bound) -> Result<PowerModel, ModelError> {
        PowerModel::on(&self.table, &self.unscaled, bound, &self.scaling)
    }

    pub(super) fn size(&self) -> Size {
        let settings = self.job.settings();
        size_of(settings, self.viewport, self.pacing, &self.platform, self.options.trace_rate_hz)
    }

    /// The job with less work for each frame.
    ///
    /// # Errors
    /// If it cannot be made so small.
    pub(super) fn reduced(&self, to: &Reduction) -> Result<Box<dyn Job + '_>, RunError> {
        let options = &self.options;
        Ok(catalog::reduced(&*self.job, &options.scene, &options.options, &request(options), to)?)
    }

    /// Samples per pixel.
    pub fn per_pixel(&self) -> u32 {
        self.job.settings().samples
    }

    /// Pixels of the image.
    pub fn pixels(&self) -> u64 {
        self.viewport.pixels() as u64
    }
}

/// Power of a GPU: platform and model scaled to it.
struct Powered {
    platform: Platform,
    unscaled: Platform,
    scaling: Scaling,
    model: PowerModel,
    pairing: Option<Warning>,
}

impl Powered {
    fn new(
        options: &RunOptions,
        gpu: &GpuSpec,
        unscaled: Platform,
        table: &EnergyTable,
    ) -> Result<Self, RunError> {
        let scaling = hardware::scaling(gpu, &unscaled)?;
        let model = PowerModel::on(table, &unscaled, options.bound, &scaling)?;
        let pairing = check_pairing(options, gpu, (&unscaled, table), &scaling);
        Ok(Self { platform: unscaled.on(&scaling, options.bound), unscaled, scaling, model, pairing })
    }
}

/// Checks rate and packet loss of the recorder.
fn check_recorder(options: &RunOptions) -> Result<(), RunError> {
    if let Some(rate) = options.trace_rate_hz.filter(|rate| !RATES_HZ.contains(rate)) {
        let why = format!("{rate}; a recorder takes 1 to 1e7 samples a second");
        return Err(RunError::invalid("trace rate", why));
    }
    if !(0.0..1.0).contains(&options.packet_loss) {
        let loss = options.packet_loss;
        let why = format!("{loss}; a share from 0 to below 1 can be lost");
        return Err(RunError::invalid("packet loss", why));
    }
    Ok(())
}

/// Checks that passes of heat maps have names, and that no two maps are of one file.
fn check_heat(requests: &[HeatRequest]) -> Result<(), RunError> {
    for (at, request) in requests.iter().enumerate() {
        if request.pass.as_deref() == Some("") {
            let why = format!("`{request}`: name a pass after the @, or leave it out for the whole frame");
            return Err(RunError::invalid("heat", why));
        }
        let path = request.path(0);
        if let Some(other) = requests[..at].iter().find(|other| other.path(0) == path) {
            let why =
                format!("`{other}` and `{request}` are both written to {path}.png; ask for one of them");
            return Err(RunError::invalid("heat", why));
        }
    }
    Ok(())
}

/// Checks that a run of images alone requests nothing that needs counts or time.
fn check_images(options: &RunOptions) -> Result<(), RunError> {
    let defaults = RunOptions::default();
    let Requested { accuracy, budget_s } = options.requested;
    let requested = [
        ("--heat", !options.heat.is_empty()),
        ("--accuracy", accuracy.is_some()),
        ("--budget", budget_s.is_some()),
        ("--verify", options.verify),
        ("--platform", options.platform.is_some()),
        ("--energy", options.energy.is_some()),
        ("--bound", options.bound != Bound::Nominal),
        ("--pacing", options.pacing != PacingChoice::default()),
        ("--trace-rate", options.trace_rate_hz.is_some()),
        ("--packet-samples", options.packet_samples != defaults.packet_samples),
        ("--packet-loss", options.packet_loss != 0.0),
        ("the style of plots", options.plot_style != defaults.plot_style),
    ];
    let given = requested.into_iter().filter(|(_, given)| *given).map(|(name, _)| name.to_owned());
    let is_of_power = |change: &&Change| {
        matches!(InputFile::of(&change.path), Some(InputFile::Platform | InputFile::Table))
    };
    let changes = options.changes.iter().filter(is_of_power).map(|change| format!("--set {}", change.path));
    refuse_beside_images(&given.chain(changes).collect::<Vec<_>>())
}

/// Refuses options that need counts or time beside `--timing none`.
///
/// # Errors
/// [`RunError::Setting`] with their names, if there are any.
pub fn refuse_beside_images(requested: &[String]) -> Result<(), RunError> {
    if requested.is_empty() {
        return Ok(());
    }
    let why = format!(
        "it draws images and counts nothing, and {} needs counts or time; leave one of both out",
        requested.join(", ")
    );
    Err(RunError::invalid("--timing none", why))
}

/// Size of a run, from the parts of a plan.
fn size_of(
    settings: &SceneSettings,
    viewport: Viewport,
    pacing: Pacing,
    platform: &Platform,
    trace_rate_hz: Option<f64>,
) -> Size {
    Size {
        pixels: viewport.pixels() as u64,
        samples: settings.samples,
        frames: settings.frames.end - settings.frames.start,
        pacing,
        trace_rate_hz: trace_rate_hz.unwrap_or(DEFAULT_RATE_HZ),
        idle_s: platform.lead_in_s.value() + platform.tail_s.value(),
    }
}

/// Name and job of the scene or workload, with its changes.
fn load_job(options: &RunOptions, changes: &mut Changes<'_>) -> Result<(String, Arc<dyn Job>), RunError> {
    let request = request(options);
    match changes.scene(&options.scene)? {
        Some(scene) => Ok((scene.name().to_owned(), Arc::new(Rendering::new(scene, &request)?))),
        None => {
            let (name, job) = catalog::load(&options.scene, &options.options, &request)?;
            Ok((name, job.into()))
        }
    }
}

fn request(options: &RunOptions) -> JobRequest<'_> {
    JobRequest { overrides: &options.overrides, seed: options.seed }
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

/// Largest memory for the samples of one image, in bytes.
const MAX_SAMPLE_BYTES: u64 = 8 << 30;
/// Memory of one sample in bytes: depth, triangle, log entry and resolved colour.
pub(super) const BYTES_PER_SAMPLE: u64 = 16;
/// Largest number of trace samples: about 2.5 GB of CSV and 0.4 GB of Parquet.
const MAX_TRACE_SAMPLES: f64 = 5e7;
/// Largest number of frames of a run.
const MAX_FRAMES: u32 = 100_000;

/// Checks that an image of `pixels` with `samples` each fits into memory. `what` begins the message.
///
/// # Errors
/// [`RunError::Setting`] with the memory that the image would need.
pub fn fits_memory(what: &str, pixels: u64, samples: u32, bytes_per_sample: u64) -> Result<(), RunError> {
    let bytes = pixels * u64::from(samples) * bytes_per_sample;
    let (needed, limit) = (bytes >> 30, MAX_SAMPLE_BYTES >> 30);
    if bytes <= MAX_SAMPLE_BYTES {
        return Ok(());
    }
    let why = format!(
        "{pixels} pixels of {samples} samples take {needed} GiB, more than {limit} GiB; ask for fewer"
    );
    Err(RunError::invalid(what, why))
}

/// Quantities that determine memory and disk space of a run.
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
    /// Checks memory, number of frames and length of the trace.
    pub fn check(&self) -> Result<(), RunError> {
        fits_memory("size and samples", self.pixels, self.samples, BYTES_PER_SAMPLE)?;
        if self.frames > MAX_FRAMES {
            let why = format!("{} in one run; at most {MAX_FRAMES}, ask for fewer", self.frames);
            return Err(RunError::invalid("frames", why));
        }
        trace_fits(self.recorded_s(), self.trace_rate_hz)
    }

    /// Length of the recording in seconds. Frames without V-sync are not counted: their length is unknown
    /// yet.
    fn recorded_s(&self) -> f64 {
        let frames_s = match self.pacing {
            Pacing::Vsync { rate } => f64::from(self.frames) / rate.value(),
            Pacing::FreeRunning => 0.0,
        };
        frames_s + self.idle_s
    }

    /// Number of samples of the trace.
    pub fn trace_samples(&self) -> f64 {
        self.recorded_s() * self.trace_rate_hz
    }
}

/// Checks that a recording of `length_s` stays below [`MAX_TRACE_SAMPLES`].
pub(super) fn trace_fits(length_s: f64, rate_hz: f64) -> Result<(), RunError> {
    let samples = length_s * rate_hz;
    if samples <= MAX_TRACE_SAMPLES {
        return Ok(());
    }
    let why = format!(
        "{length_s:.0} s at {rate_hz} samples a second are {samples:.1e} samples, more than {MAX_TRACE_SAMPLES:.0e}; ask \
         for fewer frames, a lower --trace-rate, a higher --rate, or less lead_in_s and tail_s in the platform file"
    );
    Err(RunError::invalid("the trace", why))
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
    fn errors_of_size_name_the_setting_to_change() {
        assert!(message(Size { pixels: 1 << 28, samples: 256, ..size() }).contains("ask for fewer"));
        assert!(message(Size { frames: 10_000_000, ..size() }).contains("at most 100000"));
        assert!(message(Size { trace_rate_hz: 1e7, frames: 6000, ..size() }).contains("--trace-rate"));
        let idle = Size { trace_rate_hz: 1e7, idle_s: 120.0, pacing: Pacing::FreeRunning, ..size() };
        assert!(
            message(idle).contains("120 s at 10000000 samples a second are 1.2e9 samples, more than 5e7")
        );
    }

    #[test]
    fn what_needs_counts_or_time_is_named() {
        let images = RunOptions { timing: None, ..RunOptions::default() };
        assert!(check_images(&images).is_ok());
        let change = |path: &str| Change { path: path.to_owned(), value: "1".to_owned() };
        let changes =
            ["gpu.pipeline.tile_px", "platform.v_v", "table.rows.draws.nominal_pj"].map(change).into();
        let requested = RunOptions { verify: true, packet_loss: 0.5, changes, ..images };
        let message = check_images(&requested).unwrap_err().to_string();
        let says = "--verify, --packet-loss, --set platform.v_v, --set table.rows.draws.nominal_pj needs";
        assert!(message.contains(says), "{message}");
    }
}
