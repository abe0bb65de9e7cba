//! What was asked for.

use std::path::{Path, PathBuf};

use activity::Event;
use power_model::Bound;
use serde::{Deserialize, Serialize, Serializer};
use workloads::Overrides;
use workloads::job::OptionSource;

use crate::Sampling;
use output::plot::Look;
use timing::Level;

/// The rate of the recorder that the methodology of per-frame energy is described with.
pub(super) const DEFAULT_RATE_HZ: f64 = 50e3;

/// When the next frame starts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PacingChoice {
    /// On the next tick of a display that runs at the scene's frame rate.
    #[default]
    Vsync,
    /// As soon as the one before is done.
    Free,
}

/// What the caller wants of a run, instead of a level of timing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wish {
    /// The largest relative error of cycles and energy of the run, against every frame at the reference.
    pub accuracy: Option<f64>,
    /// The longest that simulating may take, in seconds by the clock.
    pub budget_s: Option<f64>,
}

impl Wish {
    /// Whether anything was asked for.
    pub fn is_any(&self) -> bool {
        self.accuracy.is_some() || self.budget_s.is_some()
    }
}

/// A run as asked for: all that its results depend on but the content of files.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunOptions {
    /// A built-in scene, a file or a workload.
    #[serde(serialize_with = "as_text")]
    pub scene: PathBuf,
    /// Options of a workload.
    pub options: OptionSource,
    /// Changes to the scene's settings.
    pub overrides: Overrides,
    /// A built-in GPU or a RON file.
    #[serde(serialize_with = "as_text")]
    pub gpu: PathBuf,
    /// A built-in platform or a RON file; without it the one that belongs to the GPU.
    #[serde(serialize_with = "as_text_if_any")]
    pub platform: Option<PathBuf>,
    /// A built-in energy table or a RON file; without it the one that belongs to the GPU.
    #[serde(serialize_with = "as_text_if_any")]
    pub energy: Option<PathBuf>,
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
    /// Samples per second of the recorder; without it 50 kHz, or more where frames are short ([`Resolution`](super::Resolution)).
    pub trace_rate_hz: Option<f64>,
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
    /// How pictures look.
    pub look: Look,
}

/// JSON holds Unicode alone: other bytes of a path are replaced, so that a run does not fail when it writes its summary.
fn as_text<S: Serializer>(path: &Path, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(&path.to_string_lossy())
}

fn as_text_if_any<S: Serializer>(path: &Option<PathBuf>, to: S) -> Result<S::Ok, S::Error> {
    path.as_ref().map(|path| path.to_string_lossy()).serialize(to)
}

impl Default for RunOptions {
    fn default() -> Self {
        Self {
            scene: "default".into(),
            options: OptionSource::default(),
            overrides: Overrides::default(),
            gpu: "reference".into(),
            platform: None,
            energy: None,
            bound: Bound::Nominal,
            timing: Level::default(),
            sampling: Sampling::default(),
            wish: Wish::default(),
            verify: false,
            pacing: PacingChoice::default(),
            trace_rate_hz: None,
            packet_samples: 512,
            packet_loss: 0.0,
            seed: 1,
            exr: false,
            heat: Vec::new(),
            look: Look::default(),
        }
    }
}
