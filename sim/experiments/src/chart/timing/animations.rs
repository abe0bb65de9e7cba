//! Animations at every level, simulated whole: drawn and timed, as a run does.

use std::path::Path;

use cpu_time::ProcessTime;
use serde::Serialize;
use workloads::Overrides;

use output::progress::Progress;
use run::GpuSpec;
use run::Sampling;
use run::{Distinct, Forecast, Plan, Previews, RunError, RunFrame, RunOptions, Signatures, frames_of};
use timing::Level;

/// The name of the level that simulates few frames and predicts the others.
pub(super) const SAMPLED: &str = "sampled";

/// How much of an animation is simulated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    frames: u32,
    size: (u32, u32),
    samples: u32,
    /// Choices of the frames that `sampled` simulates.
    seeds: u64,
}

impl Extent {
    pub fn of(quick: bool) -> Self {
        match quick {
            true => Self { frames: 24, size: (128, 72), samples: 4, seeds: 5 },
            false => Self { frames: 100, size: (320, 180), samples: 8, seeds: 10 },
        }
    }
}

/// An animation at a level.
#[derive(Clone, Debug, Serialize)]
pub struct AnimationRow {
    /// The scene.
    pub scene: String,
    /// The GPU.
    pub gpu: String,
    /// The level: those of a frame, or `sampled`.
    pub level: &'static str,
    /// Seed of the choice of frames, for `sampled`.
    pub seed: Option<u64>,
    /// Frames of the animation.
    pub frames: usize,
    /// Frames that were simulated.
    pub simulated: usize,
    /// Relative error of the cycles of all frames together.
    pub cycle_error_percent: f64,
    /// Seconds of the host's processor, drawing included, all threads together.
    pub host_s: f64,
    /// The same over that of the reference.
    pub relative_host: f64,
}

/// All frames at one level.
struct Simulated {
    plan: Plan,
    frames: Vec<RunFrame>,
    host_s: f64,
}

impl Simulated {
    fn cycles(&self) -> f64 {
        self.frames.iter().map(|frame| frame.cost().cycles).sum()
    }
}

/// The animation called `scene` on `gpu` at every level; nothing where frames repeat.
pub(super) fn rows(
    scene: &str,
    gpu: &GpuSpec,
    extent: Extent,
    progress: &Progress,
) -> Result<Vec<AnimationRow>, RunError> {
    let numbers: Vec<u32> = (0..extent.frames).collect();
    let all = |level: Level| -> Result<Simulated, RunError> {
        let plan = plan(scene, gpu, extent, level)?;
        let started = ProcessTime::now();
        let frames = frames_of(&plan, &numbers, progress)?;
        Ok(Simulated { plan, frames, host_s: started.elapsed().as_secs_f64() })
    };
    if Distinct::new(&plan(scene, gpu, extent, Level::Packet)?.work)?.numbers().len() < numbers.len() {
        return Ok(Vec::new());
    }
    let truth = all(Level::Stepped)?;
    let name = Path::new(scene).file_name().map_or(scene.into(), |file| file.to_string_lossy());
    let row = |level: &'static str, simulated: usize, cycles: f64, host_s: f64| AnimationRow {
        scene: name.clone().into_owned(),
        gpu: gpu.name.clone(),
        level,
        seed: None,
        frames: numbers.len(),
        simulated,
        cycle_error_percent: if cycles == truth.cycles() {
            0.0
        } else {
            (cycles / truth.cycles() - 1.0) * 100.0
        },
        host_s,
        relative_host: host_s / truth.host_s,
    };
    let whole =
        |level: Level, found: &Simulated| row(level.name(), numbers.len(), found.cycles(), found.host_s);
    let (packet, bound) = (all(Level::Packet)?, all(Level::Bound)?);
    let mut rows =
        vec![whole(Level::Stepped, &truth), whole(Level::Packet, &packet), whole(Level::Bound, &bound)];
    for (seed, simulated, cycles, host_s) in sampled(&packet, &numbers, extent.seeds, progress)? {
        rows.push(AnimationRow { seed: Some(seed), ..row(SAMPLED, simulated, cycles, host_s) });
    }
    Ok(rows)
}

fn plan(scene: &str, gpu: &GpuSpec, extent: Extent, level: Level) -> Result<Plan, RunError> {
    let overrides = Overrides {
        size: Some(extent.size),
        samples: Some(extent.samples),
        frames: Some(0..extent.frames),
        ..Overrides::default()
    };
    let (scene, gpu) = (scene.into(), gpu.name.as_str().into());
    Plan::resolve(RunOptions { scene, gpu, overrides, timing: level, ..RunOptions::default() })
}

/// Seed, frames simulated, cycles of all frames and host time of some choices of representatives. Each costs the previews and its share
/// of simulating all frames.
fn sampled(
    all: &Simulated,
    numbers: &[u32],
    seeds: u64,
    progress: &Progress,
) -> Result<Vec<(u64, usize, f64, f64)>, RunError> {
    let started = ProcessTime::now();
    let previews = Previews::new(&all.plan, numbers, progress)?;
    let previews_s = started.elapsed().as_secs_f64();
    let signatures =
        Signatures::new(&previews.frames, previews.pilot, &all.frames[previews.pilot], &all.plan.model);
    let count = numbers.len();
    let choice = |seed| {
        let design = previews.design(&signatures, Sampling::Some.first(count), seed);
        let simulated = design.chosen().len();
        let forecast = Forecast::new(design, &signatures, |place| all.frames[place].cost());
        let host_s = previews_s + all.host_s * simulated as f64 / count as f64;
        (seed, simulated, forecast.cycles_per_frame().value * count as f64, host_s)
    };
    Ok((1..=seeds).map(choice).collect())
}
