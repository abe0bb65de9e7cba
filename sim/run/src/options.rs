//! Options of a run.

use std::fmt;
use std::path::{Path, PathBuf};

use activity::Event;
use output::plot::PlotStyle;
use pipeline::frame::HeatMap;
use power_model::Bound;
use serde::{Deserialize, Serialize, Serializer};
use timing::Level;
use workloads::Overrides;
use workloads::job::OptionSource;

/// Default rate of the recorder in Hz. The method of per-frame energy is described at this rate.
pub(crate) const DEFAULT_RATE_HZ: f64 = 50e3;

/// When the next frame starts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
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

/// A changed value in an input file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Change {
    /// Names from the file inward, separated by dots: `gpu.pipeline.tile_px`. Entries of lists are named by
    /// their `name`, `event` or `unit`, or by their number from 0.
    pub path: String,
    /// The value as in the file; text may be without quotes.
    pub value: String,
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.path, self.value)
    }
}

/// Requested accuracy and time budget; they replace a timing level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Requested {
    /// Largest relative error of the run's cycles and energy, compared with every frame at level `stepped`.
    pub accuracy: Option<f64>,
    /// Time budget of the simulation in seconds of wall-clock time.
    pub budget_s: Option<f64>,
}

impl Requested {
    /// Whether an accuracy or a budget is given.
    pub fn is_any(&self) -> bool {
        self.accuracy.is_some() || self.budget_s.is_some()
    }
}

/// Quantity of a heat map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeatQuantity {
    /// Counts of an event.
    Event(Event),
    /// Energy of all events, in joules.
    Joules,
}

impl HeatQuantity {
    /// Name in files and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Event(event) => event.name(),
            Self::Joules => "joules",
        }
    }

    /// All quantities that have a position in the image, at least in part.
    pub fn all() -> impl Iterator<Item = Self> {
        let placed = Event::ALL.into_iter().filter(|&event| HeatMap::is_of(event));
        std::iter::once(Self::Joules).chain(placed.map(Self::Event))
    }
}

/// A heat map of each frame: `joules`, or `joules@shade` for the passes of a name alone.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct HeatRequest {
    /// Quantity.
    pub quantity: HeatQuantity,
    /// Name of the passes; `None` for the whole frame.
    pub pass: Option<String>,
}

impl HeatRequest {
    /// Names of quantity and passes in a text.
    pub fn split(text: &str) -> (&str, Option<&str>) {
        text.split_once('@').map_or((text, None), |(of, pass)| (of, Some(pass)))
    }

    /// Path of the files of frame `frame` in a results folder, without extension.
    pub(crate) fn path(&self, frame: u32) -> String {
        let name = self.quantity.name();
        match &self.pass {
            Some(pass) => {
                let pass = pass.replace(|symbol: char| !symbol.is_alphanumeric(), "-");
                format!("heat/{name}_{pass}_{frame:04}")
            }
            None => format!("heat/{name}_{frame:04}"),
        }
    }
}

impl fmt::Display for HeatRequest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.quantity.name();
        match &self.pass {
            Some(pass) => write!(f, "{name}@{pass}"),
            None => f.write_str(name),
        }
    }
}

impl From<HeatRequest> for String {
    fn from(request: HeatRequest) -> Self {
        request.to_string()
    }
}

impl TryFrom<String> for HeatRequest {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let (name, pass) = Self::split(&text);
        let quantity = HeatQuantity::all().find(|quantity| quantity.name() == name);
        let quantity = quantity.ok_or_else(|| format!("no heat map of `{name}`"))?;
        Ok(Self { quantity, pass: pass.map(str::to_owned) })
    }
}

/// Options of a run. Results depend on these and on the contents of the files they name.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunOptions {
    /// A built-in scene, a file or a workload.
    #[serde(serialize_with = "as_text")]
    pub scene: PathBuf,
    /// Options of a workload.
    pub options: OptionSource,
    /// Changed values in the files of GPU, platform, energy table and scene.
    #[serde(default)]
    pub changes: Vec<Change>,
    /// Changes to the scene's settings.
    pub overrides: Overrides,
    /// A built-in GPU or a RON file.
    #[serde(serialize_with = "as_text")]
    pub gpu: PathBuf,
    /// A built-in platform or a RON file; `None` for the platform of the GPU.
    #[serde(serialize_with = "as_text_if_any")]
    pub platform: Option<PathBuf>,
    /// A built-in energy table or a RON file; `None` for the table of the GPU.
    #[serde(serialize_with = "as_text_if_any")]
    pub energy: Option<PathBuf>,
    /// Column of the energy table.
    pub bound: Bound,
    /// Timing level of the simulated frames; `None` draws images alone, without counts, time and energy.
    pub timing: Option<Level>,
    /// Which frames are simulated.
    pub sampling: Sampling,
    /// Requested accuracy and budget: if given, a probe chooses `timing` and `sampling`.
    pub requested: Requested,
    /// Whether every frame is simulated again at level `stepped`, to report the actual error.
    pub verify: bool,
    /// When the next frame starts.
    pub pacing: PacingChoice,
    /// Samples per second of the recorder; `None` for 50 kHz, or more if frames are short
    /// ([`Resolution`](crate::Resolution)).
    pub trace_rate_hz: Option<f64>,
    /// Samples in one packet of the recorder. A packet is lost as a whole.
    pub packet_samples: u32,
    /// Share of packets that are lost, in [0, 1).
    pub packet_loss: f64,
    /// Seed of samples, noise and packet losses.
    pub seed: u64,
    /// Whether images are also written as EXR.
    pub exr: bool,
    /// Heat maps.
    pub heat: Vec<HeatRequest>,
    /// Width, title and font size of plots.
    pub plot_style: PlotStyle,
}

/// Serializes a path as text. Bytes that are not Unicode are replaced, so that writing the summary cannot
/// fail.
fn as_text<S: Serializer>(path: &Path, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(&path.to_string_lossy())
}

fn as_text_if_any<S: Serializer>(path: &Option<PathBuf>, to: S) -> Result<S::Ok, S::Error> {
    path.as_ref().map(|path| path.to_string_lossy()).serialize(to)
}

impl RunOptions {
    /// Timing level of the simulated frames; the default one where they are not timed.
    pub fn level(&self) -> Level {
        self.timing.unwrap_or_default()
    }
}

impl Default for RunOptions {
    fn default() -> Self {
        Self {
            scene: "default".into(),
            options: OptionSource::default(),
            changes: Vec::new(),
            overrides: Overrides::default(),
            gpu: "reference".into(),
            platform: None,
            energy: None,
            bound: Bound::Nominal,
            timing: Some(Level::default()),
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
            plot_style: PlotStyle::default(),
        }
    }
}

/// Which frames of a run are simulated; the others are predicted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// All distinct frames.
    #[default]
    Every,
    /// One frame in fifty, at least six.
    Some,
    /// This number of frames.
    Count(usize),
    /// Frames are added until the relative half-widths of all 95 % intervals are at most `target`.
    Until {
        /// Largest relative half-width of an interval.
        target: f64,
        /// Largest number of simulated frames.
        max_frames: usize,
    },
}

impl Sampling {
    /// Frames of the run per simulated frame.
    const FRAMES_PER_SIMULATED: usize = 50;
    /// Smallest number of simulated frames: the pilot frame, and two strata of two or three.
    pub const MIN_FRAMES: usize = 6;
    /// Number of frames in the first round of [`Self::Until`]: the pilot frame, and three strata of two.
    pub const FIRST_FRAMES: usize = 7;

    /// Number of frames to simulate first, of a run of `frames`.
    pub fn first(self, frames: usize) -> usize {
        match self {
            Self::Every => frames,
            Self::Some => frames.div_ceil(Self::FRAMES_PER_SIMULATED).max(Self::MIN_FRAMES),
            Self::Count(count) => count,
            Self::Until { max_frames, .. } => Self::FIRST_FRAMES.min(max_frames),
        }
    }

    /// Number of frames of the next round, if `done` of `frames` gave intervals of `relative` half-width;
    /// `None` when finished.
    pub fn next(self, done: usize, frames: usize, relative: f64) -> Option<usize> {
        let Self::Until { target, max_frames } = self else { return None };
        // A NaN does not meet the target.
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
    fn frames_double_until_the_target_is_met() {
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
