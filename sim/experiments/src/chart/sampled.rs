//! `quintile chart sampled`: prediction of frames from a few simulated ones, and coverage of the intervals.
//!
//! An animation is simulated whole, then predicted repeatedly from some of its frames.

use std::path::Path;

use cpu_time::ProcessTime;
use output::OutputError;
use output::plot::{ChartPanel, Paint, PlotMark, Series};
use output::terminal::Progress;
use run::{
    Distinct, Forecast, Plan, Previews, RunError, RunFrame, RunOptions, RunQuantity, Sampling, Signatures,
    frames_of,
};
use serde::Serialize;
use workloads::Overrides;

use super::quantiles;
use crate::study::table::{Sheet, TableBuilder, fixed, percent, plain};
use crate::study::tradeoff::{Metric, TradeoffPoint};
use crate::study::{Gallery, Study, StudyError};

/// Effort.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct SampledEffort {
    /// Frames of each animation.
    pub frames: u32,
    /// Width and height of the image in pixels.
    pub size: (u32, u32),
    /// Samples in a pixel.
    pub samples: u32,
    /// Choices of representatives for each animation.
    pub seeds: u64,
}

/// Name of the cost: previews and timing of a run, over those of a run that simulates every frame.
pub(super) const HOST_TIME: &str = "host time of a run, relative to all frames simulated";

/// The quantities that are predicted.
const QUANTITIES: [&str; 3] = ["cycles", "energy", "power"];

/// One choice of representatives: the totals of an animation predicted from them.
#[derive(Clone, Debug, Serialize)]
pub struct Trial {
    /// The animation.
    pub scene: String,
    /// Seed of the choice.
    pub seed: u64,
    /// Frames that were simulated.
    pub simulated: usize,
    /// The quantity: one of `QUANTITIES`.
    pub quantity: &'static str,
    /// Value with all frames simulated: cycles a frame, joules a frame, watts.
    pub truth: f64,
    /// Predicted value.
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

/// Cost of an animation.
#[derive(Clone, Debug, Serialize)]
pub struct AnimationCost {
    /// The animation.
    pub scene: String,
    /// Frames of the scene.
    pub frames: usize,
    /// Frames that were simulated.
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
pub struct TrialFigures {
    /// The quantity, or `all`.
    pub quantity: &'static str,
    /// Number of trials.
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
    /// Effort.
    pub effort: SampledEffort,
    /// Over all animations, by quantity and together.
    pub figures: Vec<TrialFigures>,
    /// Cost of each animation.
    pub costs: Vec<AnimationCost>,
    /// Every trial.
    pub trials: Vec<Trial>,
}

impl Study for SampledChart {
    const NAME: &'static str = "sampled";
    const ABOUT: &'static str =
        "Frames predicted from few: errors, how often intervals hold the truth, host time";
    const PICTURES: &'static [&'static str] = &["sampled"];
    const FILES: &'static [&'static str] = &["sampled.csv", "sampled.json"];
    /// They have to be animated.
    const TAKES_SCENES: bool = true;

    type Effort = SampledEffort;
    /// Hundreds of frames: minutes.
    const FULL: SampledEffort = SampledEffort { frames: 300, size: (640, 360), samples: 8, seeds: 100 };
    const QUICK: SampledEffort = SampledEffort { frames: 100, size: (320, 180), samples: 4, seeds: 100 };

    fn measure(effort: SampledEffort, scenes: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let (mut costs, mut trials) = (Vec::new(), Vec::new());
        for scene in std::iter::once("default").chain(scenes.iter().map(String::as_str)) {
            let measured = animation(scene, effort, progress)?;
            costs.push(measured.0);
            trials.extend(measured.1);
        }
        let of = |quantity: &'static str| figures(quantity, &trials);
        let figures = QUANTITIES.into_iter().chain(["all"]).map(of).collect();
        Ok(Self { effort, figures, costs, trials })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let subject = "each point a choice of representatives; the truth is inside the interval of those below the line";
        let panels = QUANTITIES.into_iter().map(|quantity| self.panel(quantity)).collect();
        to.chart("sampled", ["Frames predicted from few", subject], panels)
    }

    fn tables(&self) -> Vec<Sheet> {
        let figures = TableBuilder::of(&self.figures)
            .shown("quantity", |f| f.quantity, plain)
            .shown("trials", |f| f.trials, plain)
            .shown("inside", |f| f.inside_percent, percent(1))
            .shown("error: median", |f| f.error_median_percent, percent(2))
            .shown("95 %", |f| f.error_p95_percent, percent(2))
            .shown("worst", |f| f.error_worst_percent, percent(2))
            .shown("half-width: median", |f| f.half_width_median_percent, percent(2));
        let seconds = |s: f64| format!("{s:.2} s");
        let costs = TableBuilder::of(&self.costs)
            .shown("animation", |cost| cost.scene.as_str(), plain)
            .shown("frames", |cost| cost.frames, plain)
            .shown("simulated", |cost| cost.simulated, plain)
            .shown("all", |cost| cost.all_s, seconds)
            .shown("sampled", |cost| cost.sampled_s, seconds)
            .shown("times less host time", |cost| cost.times_faster, fixed(1));
        let trials = TableBuilder::of(&self.trials)
            .data("scene", |trial| trial.scene.as_str())
            .data("seed", |trial| trial.seed)
            .data("simulated", |trial| trial.simulated)
            .data("quantity", |trial| trial.quantity)
            .data("truth", |trial| trial.truth)
            .data("value", |trial| trial.value)
            .data("low", |trial| trial.interval[0])
            .data("high", |trial| trial.interval[1])
            .data("error_percent", |trial| trial.error_percent)
            .data("half_width_percent", |trial| trial.half_width_percent)
            .data("inside", |trial| trial.inside)
            .csv("sampled.csv");
        vec![figures.sheet(), costs.sheet(), trials.sheet()]
    }

    /// The median error of each quantity, beside the host time of simulating all frames.
    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        let point = |cost: &AnimationCost, quantity: &'static str| {
            let trials = self.trials.iter().filter(|t| t.scene == cost.scene && t.quantity == quantity);
            let error = quantiles(trials.map(|trial| trial.error_percent.abs()))(0.5);
            let relative = Metric::new(HOST_TIME, "", 1.0 / cost.times_faster);
            let level = format!("{} of {} frames simulated", cost.simulated, cost.frames);
            let metrics =
                [Metric::new(median_error_of(quantity), "%", error).beside(0.0), relative.beside(1.0)];
            TradeoffPoint::new(format!("an animation ({})", cost.scene), ["sampled", &level], metrics)
        };
        self.costs.iter().flat_map(|cost| QUANTITIES.map(|quantity| point(cost, quantity))).collect()
    }
}

/// Name of the median error of a quantity.
fn median_error_of(quantity: &str) -> &'static str {
    match quantity {
        "cycles" => "median error of cycles",
        "energy" => "median error of energy",
        _ => "median error of power",
    }
}

fn figures(quantity: &'static str, trials: &[Trial]) -> TrialFigures {
    let of: Vec<&Trial> = trials.iter().filter(|t| quantity == "all" || t.quantity == quantity).collect();
    let sorted = |pick: fn(&Trial) -> f64| quantiles(of.iter().map(move |trial| pick(trial)));
    let errors = sorted(|trial| trial.error_percent.abs());
    TrialFigures {
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
    /// Errors of a quantity over half-widths of intervals.
    fn panel(&self, quantity: &'static str) -> ChartPanel {
        let trials: Vec<&Trial> = self.trials.iter().filter(|trial| trial.quantity == quantity).collect();
        let widths = || trials.iter().map(|trial| trial.half_width_percent).filter(|width| *width > 0.0);
        let ends = [widths().reduce(f64::min), widths().reduce(f64::max)];
        let equal = ends.into_iter().flatten().map(|width| (width, width)).collect();
        let mut series =
            vec![Series::new("error as large as the half-width", PlotMark::Line(equal)).painted(Paint::Ink)];
        for (number, trials) in trials.chunk_by(|a, b| a.scene == b.scene).enumerate() {
            let dot = |trial: &&Trial| (trial.half_width_percent, trial.error_percent.abs(), String::new());
            let dots = PlotMark::Dots(trials.iter().map(dot).collect());
            series.push(Series::new(&trials[0].scene, dots).painted(Paint::Like(number)));
        }
        let axes = ["half-width of the 95 % interval (%)", "error (%)"];
        ChartPanel::new(quantity, axes, series).zeros(["exact"; 2])
    }
}

/// Cost of an animation, and every trial.
fn animation(
    scene: &str,
    effort: SampledEffort,
    progress: &Progress,
) -> Result<(AnimationCost, Vec<Trial>), RunError> {
    let plan = plan(scene, effort)?;
    let numbers: Vec<u32> = plan.job.settings().frames.clone().collect();
    let started = ProcessTime::now();
    let previews = Previews::new(&plan, &numbers, progress)?;
    let previews_s = started.elapsed().as_secs_f64();
    let started = ProcessTime::now();
    let frames = frames_of(&plan, &numbers, progress)?;
    let all_s = started.elapsed().as_secs_f64();
    let signatures = Signatures::new(&previews.frames, previews.pilot, &frames[previews.pilot], plan.model());
    let name = Path::new(scene).file_name().map_or(scene.into(), |file| file.to_string_lossy());
    let truth = truth(&frames, plan.gpu().core_hz);
    let (mut trials, mut simulated) = (Vec::new(), 0);
    for seed in 1..=effort.seeds {
        let design = previews.design(&signatures, Sampling::Some.first(numbers.len()), seed);
        simulated = design.chosen().len();
        let forecast = Forecast::new(design, &signatures, |place| frames[place].cost());
        let found = [
            forecast.cycles_per_frame(),
            forecast.energy_per_frame_j(),
            forecast.busy_power_w(plan.gpu().core_hz),
        ];
        let rows = QUANTITIES.into_iter().zip(truth).zip(found);
        trials.extend(rows.map(|((quantity, truth), found)| Trial {
            scene: name.clone().into_owned(),
            seed,
            simulated,
            ..trial(quantity, truth, found)
        }));
    }
    let sampled_s = previews_s + all_s * simulated as f64 / numbers.len() as f64;
    let cost = AnimationCost {
        scene: name.into_owned(),
        frames: numbers.len(),
        simulated,
        times_fewer: numbers.len() as f64 / simulated as f64,
        all_s,
        previews_s,
        sampled_s,
        times_faster: all_s / sampled_s,
    };
    Ok((cost, trials))
}

fn plan(scene: &str, effort: SampledEffort) -> Result<Plan, RunError> {
    let overrides = Overrides {
        size: Some(effort.size),
        samples: Some(effort.samples),
        frames: Some(0..effort.frames),
        ..Overrides::default()
    };
    let plan = Plan::resolve(RunOptions { scene: scene.into(), overrides, ..RunOptions::default() })?;
    let distinct = Distinct::new(&*plan.job)?;
    if distinct.numbers().len() == distinct.groups().len() {
        return Ok(plan);
    }
    let why = format!(
        "{} of its {} frames differ, so there is too little to predict; name an animated scene",
        distinct.numbers().len(),
        distinct.groups().len()
    );
    Err(RunError::invalid(scene, why))
}

/// Values over all frames: cycles a frame, joules a frame while busy, watts while busy.
fn truth(frames: &[RunFrame], core_hz: f64) -> [f64; 3] {
    let count = frames.len() as f64;
    let cycles: f64 = frames.iter().map(|frame| frame.cost().cycles).sum();
    let energy_j: f64 = frames.iter().map(|frame| frame.cost().energy_j).sum();
    [cycles / count, energy_j / count, energy_j / cycles * core_hz]
}

fn trial(quantity: &'static str, truth: f64, found: RunQuantity) -> Trial {
    Trial {
        scene: String::new(),
        seed: 0,
        simulated: 0,
        quantity,
        truth,
        value: found.value,
        interval: [found.low, found.high],
        error_percent: (found.value / truth - 1.0) * 100.0,
        half_width_percent: found.relative_half_width * 100.0,
        inside: found.holds(truth),
    }
}
