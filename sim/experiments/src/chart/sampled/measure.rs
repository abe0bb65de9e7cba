//! One animation simulated whole, then predicted again and again from a few of its frames.

use std::path::Path;

use cpu_time::ProcessTime;
use workloads::Overrides;

use super::{Cost, Effort, QUANTITIES, Trial};
use output::progress::Progress;
use run::Sampling;
use run::{
    Distinct, Forecast, Plan, Previews, Quantity, RunError, RunFrame, RunOptions, Signatures, frames_of,
};

/// What it cost, and every trial.
pub(super) fn animation(
    scene: &str,
    effort: Effort,
    progress: &Progress,
) -> Result<(Cost, Vec<Trial>), RunError> {
    let plan = plan(scene, effort)?;
    let numbers: Vec<u32> = plan.work.settings().frames.clone().collect();
    let started = ProcessTime::now();
    let previews = Previews::new(&plan, &numbers, progress)?;
    let previews_s = started.elapsed().as_secs_f64();
    let started = ProcessTime::now();
    let frames = frames_of(&plan, &numbers, progress)?;
    let all_s = started.elapsed().as_secs_f64();
    let signatures = Signatures::new(&previews.frames, previews.pilot, &frames[previews.pilot], &plan.model);
    let name = Path::new(scene).file_name().map_or(scene.into(), |file| file.to_string_lossy());
    let truth = truth(&frames, plan.gpu.core_hz);
    let (mut trials, mut simulated) = (Vec::new(), 0);
    for seed in 1..=effort.seeds {
        let design = previews.design(&signatures, Sampling::Some.first(numbers.len()), seed);
        simulated = design.chosen().len();
        let forecast = Forecast::new(design, &signatures, |place| frames[place].cost());
        let found = [
            forecast.cycles_per_frame(),
            forecast.energy_per_frame_j(),
            forecast.busy_power_w(plan.gpu.core_hz),
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
    let cost = Cost {
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

fn plan(scene: &str, effort: Effort) -> Result<Plan, RunError> {
    let overrides = Overrides {
        size: Some(effort.size),
        samples: Some(effort.samples),
        frames: Some(0..effort.frames),
        ..Overrides::default()
    };
    let plan = Plan::resolve(RunOptions { scene: scene.into(), overrides, ..RunOptions::default() })?;
    let distinct = Distinct::new(&plan.work)?;
    if distinct.numbers().len() == distinct.groups().len() {
        return Ok(plan);
    }
    Err(RunError::Setting(format!(
        "{scene}: {} of its {} frames differ, so there is too little to predict; name an animated scene",
        distinct.numbers().len(),
        distinct.groups().len()
    )))
}

/// What all frames come to: cycles a frame, joules a frame while busy, watts while busy.
fn truth(frames: &[RunFrame], core_hz: f64) -> [f64; 3] {
    let count = frames.len() as f64;
    let cycles: f64 = frames.iter().map(|frame| frame.cost().cycles).sum();
    let energy_j: f64 = frames.iter().map(|frame| frame.cost().energy_j).sum();
    [cycles / count, energy_j / count, energy_j / cycles * core_hz]
}

fn trial(quantity: &'static str, truth: f64, found: Quantity) -> Trial {
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
