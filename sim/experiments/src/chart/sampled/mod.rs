//! `quintile chart sampled`: frames predicted from few against all of them simulated, and how often intervals hold the truth.

mod measure;
mod tables;

use serde::Serialize;

use super::quantiles::quantiles;
use output::progress::Progress;
use output::table::Table;
use run::RunError;

pub use tables::claim;

/// How much is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Effort {
    /// Frames of each animation.
    pub frames: u32,
    /// Width and height of the image in pixels.
    pub size: (u32, u32),
    /// Samples in a pixel.
    pub samples: u32,
    /// Choices of representatives for each animation.
    pub seeds: u64,
}

impl Effort {
    /// Hundreds of frames: minutes.
    pub const FULL: Self = Self { frames: 300, size: (640, 360), samples: 8, seeds: 100 };
    /// Fewer and smaller ones: seconds.
    pub const QUICK: Self = Self { frames: 100, size: (320, 180), samples: 4, seeds: 100 };
}

/// The quantities that are predicted.
pub const QUANTITIES: [&str; 3] = ["cycles", "energy", "power"];

/// One choice of representatives: the totals of an animation predicted from them.
#[derive(Clone, Debug, Serialize)]
pub struct Trial {
    /// The animation.
    pub scene: String,
    /// Seed of the choice.
    pub seed: u64,
    /// Frames that were simulated.
    pub simulated: usize,
    /// The quantity: one of [`QUANTITIES`].
    pub quantity: &'static str,
    /// What all frames simulated come to: cycles a frame, joules a frame, watts.
    pub truth: f64,
    /// What was predicted.
    pub value: f64,
    /// The ends of the 95 % interval.
    pub interval: [f64; 2],
    /// Relative error of what was predicted.
    pub error_percent: f64,
    /// Half the width of the interval over the value.
    pub half_width_percent: f64,
    /// Whether the truth is inside.
    pub inside: bool,
}

/// What an animation cost.
#[derive(Clone, Debug, Serialize)]
pub struct Cost {
    /// The animation.
    pub scene: String,
    /// Its frames.
    pub frames: usize,
    /// Those that were simulated.
    pub simulated: usize,
    /// Frames for one that was simulated.
    pub times_fewer: f64,
    /// Processor seconds of the host, all threads together, for all frames.
    pub all_s: f64,
    /// For the previews of all frames.
    pub previews_s: f64,
    /// For previews and as many frames as are simulated.
    pub sampled_s: f64,
    /// All frames over that.
    pub times_faster: f64,
}

/// A quantity over all trials.
#[derive(Clone, Debug, Serialize)]
pub struct Figures {
    /// The quantity, or `all`.
    pub quantity: &'static str,
    /// How many trials.
    pub trials: usize,
    /// The share of those in which the truth is inside the interval.
    pub inside_percent: f64,
    /// Errors: median, 95th percentile, worst.
    pub error_median_percent: f64,
    /// See above.
    pub error_p95_percent: f64,
    /// See above.
    pub error_worst_percent: f64,
    /// Half-widths: median.
    pub half_width_median_percent: f64,
}

/// The whole chart.
#[derive(Clone, Debug, Serialize)]
pub struct SampledChart {
    /// How much was done.
    pub effort: Effort,
    /// Over all animations, by quantity and together.
    pub figures: Vec<Figures>,
    /// What each animation cost.
    pub costs: Vec<Cost>,
    /// Every trial.
    pub trials: Vec<Trial>,
}

/// Measures the built-in animation and the scenes called `scenes`, which have to be animated.
///
/// # Errors
/// When a scene cannot be loaded or is still.
pub fn sampled(scenes: &[String], effort: Effort, progress: &Progress) -> Result<SampledChart, RunError> {
    let (mut costs, mut trials) = (Vec::new(), Vec::new());
    for scene in std::iter::once("default").chain(scenes.iter().map(String::as_str)) {
        let measured = measure::animation(scene, effort, progress)?;
        costs.push(measured.0);
        trials.extend(measured.1);
    }
    let of = |quantity: &'static str| figures(quantity, &trials);
    let figures = QUANTITIES.into_iter().chain(["all"]).map(of).collect();
    Ok(SampledChart { effort, figures, costs, trials })
}

fn figures(quantity: &'static str, trials: &[Trial]) -> Figures {
    let of: Vec<&Trial> = trials.iter().filter(|t| quantity == "all" || t.quantity == quantity).collect();
    let sorted = |pick: fn(&Trial) -> f64| quantiles(of.iter().map(move |trial| pick(trial)));
    let errors = sorted(|trial| trial.error_percent.abs());
    Figures {
        quantity,
        trials: of.len(),
        inside_percent: 100.0 * of.iter().filter(|trial| trial.inside).count() as f64
            / of.len().max(1) as f64,
        error_median_percent: errors(0.5),
        error_p95_percent: errors(0.95),
        error_worst_percent: errors(1.0),
        half_width_median_percent: sorted(|trial| trial.half_width_percent)(0.5),
    }
}

impl SampledChart {
    /// Errors and intervals by quantity.
    pub fn text(&self) -> Table {
        let mut table = Table::new([
            "quantity",
            "trials",
            "inside",
            "error: median",
            "95 %",
            "worst",
            "half-width: median",
        ]);
        for f in &self.figures {
            let percent = |value: f64| format!("{value:.2} %");
            table.row([
                f.quantity.to_owned(),
                f.trials.to_string(),
                format!("{:.1} %", f.inside_percent),
                percent(f.error_median_percent),
                percent(f.error_p95_percent),
                percent(f.error_worst_percent),
                percent(f.half_width_median_percent),
            ]);
        }
        table
    }

    /// What it cost, a row for each animation.
    pub fn cost_text(&self) -> Table {
        let mut table =
            Table::new(["animation", "frames", "simulated", "all", "sampled", "times less host time"]);
        for cost in &self.costs {
            table.row([
                cost.scene.clone(),
                cost.frames.to_string(),
                cost.simulated.to_string(),
                format!("{:.2} s", cost.all_s),
                format!("{:.2} s", cost.sampled_s),
                format!("{:.1}", cost.times_faster),
            ]);
        }
        table
    }
}
