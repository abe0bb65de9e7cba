//! Options of a run.

use std::path::{Path, PathBuf};

use activity::Event;
use output::plot::Look;
use power_model::Bound;
use serde::{Deserialize, Serialize, Serializer};
use timing::Level;
use workloads::Overrides;
use workloads::job::OptionSource;

/// The rate of the recorder that the methodology of per-frame energy is described with.
pub(crate) const DEFAULT_RATE_HZ: f64 = 50e3;

/// When the next frame starts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum PacingChoice {
    /// On the next tick of the display
    #[default]
    Vsync,
    /// As soon as the previous frame is done
    Free,
}

impl PacingChoice {
    /// Name in results and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Vsync => "vsync",
            Self::Free => "free",
        }
    }
}

/// What the caller wants of a run, instead of a level of timing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Requested {
    /// The largest relative error of cycles and energy of the run, against every frame at the reference.
    pub accuracy: Option<f64>,
    /// The longest that simulating may take, in seconds by the clock.
    pub budget_s: Option<f64>,
}

impl Requested {
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
    pub requested: Requested,
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
    pub plot_style: Look,
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
            requested: Requested::default(),
            verify: false,
            pacing: PacingChoice::default(),
            trace_rate_hz: None,
            packet_samples: 512,
            packet_loss: 0.0,
            seed: 1,
            exr: false,
            heat: Vec::new(),
            plot_style: Look::default(),
        }
    }
}

/// How the times of a run are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Method {
    /// Every unit from cycle to cycle: the reference, slow
    Stepped,
    /// A recurrence over packets
    #[default]
    Packet,
    /// The busiest unit of each batch, fill and drain
    Bound,
    /// One frame in fifty at `packet`, the others predicted from a preview, with intervals
    Sampled,
}

impl Method {
    /// The level of the frames that are simulated.
    pub const fn level(self) -> Level {
        match self {
            Self::Stepped => Level::Stepped,
            Self::Packet | Self::Sampled => Level::Packet,
            Self::Bound => Level::Bound,
        }
    }

    /// How many frames are simulated.
    pub const fn sampling(self) -> Sampling {
        match self {
            Self::Sampled => Sampling::Some,
            _ => Sampling::Every,
        }
    }
}

/// How many frames of a run are simulated whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// All that differ.
    #[default]
    Every,
    /// One in fifty, at least six.
    Some,
    /// So many.
    Count(usize),
    /// As many as it takes for the relative half-widths of all 95 % intervals to be at most `target`, but no more than `most`.
    Until {
        /// Relative half-width.
        target: f64,
        /// Frames.
        max_frames: usize,
    },
}

impl Sampling {
    /// Frames for one that is simulated.
    const FRAMES_PER_SIMULATED: usize = 50;
    /// Fewest: one to scale the previews by, and two strata of two or three.
    pub const MIN_FRAMES: usize = 6;
    /// To begin with where it goes on until it is sure: one, and three strata of two.
    pub const FIRST_FRAMES: usize = 7;

    /// How many of `frames` to begin with.
    pub fn first(self, frames: usize) -> usize {
        match self {
            Self::Every => frames,
            Self::Some => frames.div_ceil(Self::FRAMES_PER_SIMULATED).max(Self::MIN_FRAMES),
            Self::Count(count) => count,
            Self::Until { max_frames, .. } => Self::FIRST_FRAMES.min(max_frames),
        }
    }

    /// How many next, where `done` of `frames` gave intervals of `relative` half-width; `None` where that is enough.
    pub fn next(self, done: usize, frames: usize, relative: f64) -> Option<usize> {
        let Self::Until { target, max_frames } = self else { return None };
        // A NaN is not enough.
        let enough = relative <= target || done >= frames.min(max_frames);
        let next = if 4 * done > frames { frames } else { 2 * done - 1 };
        (!enough).then(|| next.min(max_frames))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_in_fifty_and_six_at_least() {
        assert_eq!([36, 300, 301, 1000].map(|n| Sampling::Some.first(n)), [6, 6, 7, 20]);
    }

    #[test]
    fn it_doubles_until_it_is_sure() {
        let until = Sampling::Until { target: 0.01, max_frames: 300 };
        assert_eq!(until.next(7, 300, 0.02), Some(13));
        assert_eq!(until.next(7, 300, f64::NAN), Some(13));
        assert_eq!(until.next(13, 300, 0.01), None);
        assert_eq!(until.next(96, 300, 0.02), Some(300));
        assert_eq!(until.next(300, 300, f64::NAN), None);
        let capped = Sampling::Until { target: 0.01, max_frames: 20 };
        assert_eq!([7, 13, 20].map(|done| capped.next(done, 300, 0.5)), [Some(13), Some(20), None]);
        assert_eq!(Sampling::Some.next(6, 300, 1.0), None);
    }
}
