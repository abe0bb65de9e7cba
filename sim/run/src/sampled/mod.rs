//! Sampled simulation of long animations: preview every frame, simulate a few, predict the others.
//!
//! ```text
//! Previewer -> FramePreview of every frame -> a pilot frame simulated -> Signatures -> Design
//!     -> representative frames simulated -> Forecast
//! ```
//!
//! The statistics are in [`timing::sampled`].

mod forecast;
mod preview;

use std::collections::{BTreeMap, BTreeSet};

use activity::Unit;
use output::progress::Progress;
use pipeline::random::mix;
use rayon::prelude::*;
use timing::sampled::Design;

use crate::frame::{FrameSimulator, SimulatedFrame};
use crate::{Distinct, Origin, Plan, RunError, RunFrame, SampledSummary, Simulated};

pub use forecast::{CONFIDENCE, Forecast};
pub use preview::{FramePreview, Previewer, Signatures};

/// Previews of the frames of a run, and the pilot frame.
pub struct Previews {
    /// Settings of the previews.
    pub previewer: Previewer,
    /// Preview of each frame.
    pub frames: Vec<FramePreview>,
    /// Index of the pilot frame. It is simulated first, and previews are scaled by it.
    pub pilot: usize,
}

impl Previews {
    /// Previews the frames `numbers`.
    pub fn new(plan: &Plan, numbers: &[u32], progress: &Progress) -> Result<Self, RunError> {
        let previewer = Previewer::new(plan)?;
        let bar = progress.bar("previews", numbers.len() as u64);
        let preview = |&number: &u32| {
            bar.inc();
            previewer.frame(plan, number)
        };
        let frames: Vec<FramePreview> = numbers.par_iter().map(preview).collect::<Result<_, _>>()?;
        let pilot = preview::median(&frames);
        Ok(Self { previewer, frames, pilot })
    }

    /// Previews of all frames of a run, from those of distinct frames: frame `i` belongs to group
    /// `groups[i]`.
    fn for_frames(self, groups: &[usize]) -> Self {
        let frames: Vec<FramePreview> = groups.iter().map(|&group| self.frames[group]).collect();
        Self { pilot: preview::median(&frames), frames, ..self }
    }

    /// Chooses `count` frames to simulate, including the pilot.
    pub fn design(&self, signatures: &Signatures, count: usize, seed: u64) -> Design {
        let word = |frame: u64| mix(mix(seed.wrapping_add(0x73A3_7D1E)) ^ frame);
        Design::draw(&signatures.cycles, Some(self.pilot), count, word)
    }
}

/// Simulates the frames that the plan requires and predicts the others.
pub(super) fn simulate(simulator: &FrameSimulator<'_>, progress: &Progress) -> Result<Simulated, RunError> {
    let (plan, groups) = (simulator.plan, simulator.distinct.groups());
    let previews = Previews::new(plan, simulator.distinct.numbers(), progress)?.for_frames(groups);
    let pilot = groups[previews.pilot];
    let mut whole = BTreeMap::from([(pilot, simulator.simulate(pilot, true)?)]);
    let signatures = Signatures::new(&previews.frames, previews.pilot, &whole[&pilot].frame, &plan.model);
    let mut count = plan.options.sampling.first(groups.len());
    let forecast = loop {
        let design = previews.design(&signatures, count, plan.options.seed);
        simulate_chosen(simulator, &design, &mut whole, progress)?;
        let forecast = Forecast::new(design, &signatures, |place| whole[&groups[place]].frame.cost());
        match plan.options.sampling.next(count, groups.len(), forecast.relative_half_width()) {
            Some(more) => count = more,
            None => break forecast,
        }
    };
    Ok(all_frames(plan, simulator.distinct, &previews, &forecast, whole))
}

/// Simulates the chosen frames that are not simulated yet. The first round keeps the images of its first and
/// last frame.
fn simulate_chosen(
    simulator: &FrameSimulator<'_>,
    design: &Design,
    whole: &mut BTreeMap<usize, SimulatedFrame>,
    progress: &Progress,
) -> Result<(), RunError> {
    let chosen: BTreeSet<usize> =
        design.chosen().into_iter().map(|place| simulator.distinct.groups()[place]).collect();
    let ends = if whole.len() == 1 { [chosen.first(), chosen.last()] } else { [None; 2] };
    let missing: Vec<usize> = chosen.iter().copied().filter(|group| !whole.contains_key(group)).collect();
    let bar = progress.bar("frames", missing.len() as u64);
    let simulate = |&group: &usize| {
        let done = simulator.simulate(group, ends.contains(&Some(&group)))?;
        bar.inc();
        Ok((group, done))
    };
    whole.extend(missing.par_iter().map(simulate).collect::<Result<Vec<_>, RunError>>()?);
    Ok(())
}

/// Smallest ratio of a predicted frame's time and energy to those of the frame it is scaled from.
const MIN_SCALE: f64 = 0.01;

/// All frames of the run, simulated or predicted. `simulated` holds the simulated groups by index.
fn all_frames(
    plan: &Plan,
    frames: &Distinct,
    previews: &Previews,
    forecast: &Forecast,
    mut simulated: BTreeMap<usize, SimulatedFrame>,
) -> Simulated {
    let (numbers, groups) = (frames.numbers(), frames.groups());
    let mut distinct: BTreeMap<usize, RunFrame> = BTreeMap::new();
    for (place, &group) in groups.iter().enumerate().filter(|(_, group)| !simulated.contains_key(group)) {
        distinct.entry(group).or_insert_with(|| {
            let nearest = &simulated[&groups[nearest(previews, forecast, place)]].frame;
            predict(numbers[group], previews, forecast, place, nearest)
        });
    }
    let sampled = summary(plan, frames, previews, forecast);
    let pictures =
        simulated.iter_mut().filter_map(|(&group, done)| Some((numbers[group], done.picture.take()?)));
    let pictures = pictures.collect();
    let pilot = simulated.get_mut(&groups[previews.pilot]);
    let heat = pilot.map(|pilot| std::mem::take(&mut pilot.heat)).unwrap_or_default();
    distinct.extend(simulated.into_iter().map(|(group, done)| (group, done.frame)));
    Simulated {
        distinct: distinct.into_values().collect(),
        frames: groups.to_vec(),
        pictures,
        heat,
        sampled: Some(sampled),
    }
}

/// Simulated frame of the same stratum with the most similar preview.
fn nearest(previews: &Previews, forecast: &Forecast, place: usize) -> usize {
    let design = forecast.design();
    let apart = |&other: &usize| previews.frames[other].cycles.abs_diff(previews.frames[place].cycles);
    let chosen = &design.strata()[design.stratum_of(place)].chosen;
    chosen.iter().copied().min_by_key(apart).unwrap_or(previews.pilot)
}

/// Predicts a frame: the power curve of `nearest`, scaled to the predicted time and energy.
fn predict(
    number: u32,
    previews: &Previews,
    forecast: &Forecast,
    place: usize,
    nearest: &RunFrame,
) -> RunFrame {
    let [value, half] = forecast.frame(place);
    let share = |predicted: f64, known: f64| (predicted / known.max(f64::MIN_POSITIVE)).max(MIN_SCALE);
    let time = share(value.cycles, nearest.cycles as f64);
    let energy_j = share(value.energy_j, nearest.power.energy().total_j()) * nearest.power.energy().total_j();
    let preview = &previews.frames[place];
    RunFrame {
        index: number,
        triangles: preview.triangles,
        moving: preview.moving,
        lens: preview.lens,
        power: nearest.power.reshaped((nearest.power.duration_ps() as f64 * time).round() as u64, energy_j),
        busy_ps: Unit::ALL.map(|unit| (nearest.busy_ps[unit as usize] as f64 * time).round() as u64),
        busy: nearest.busy.clone(),
        cycles: (nearest.cycles as f64 * time).round() as u64,
        origin: Origin::Predicted(half),
    }
}

/// Summary of a sampled run: simulated frames and intervals.
fn summary(plan: &Plan, frames: &Distinct, previews: &Previews, forecast: &Forecast) -> SampledSummary {
    let (numbers, groups) = (frames.numbers(), frames.groups());
    let chosen: BTreeSet<u32> =
        forecast.design().chosen().into_iter().map(|place| numbers[groups[place]]).collect();
    let viewport = previews.previewer.viewport;
    SampledSummary {
        frames_per_simulated: groups.len() as f64 / chosen.len() as f64,
        simulated_frames: chosen.into_iter().collect(),
        strata: forecast.design().strata().len(),
        preview: [viewport.width(), viewport.height(), previews.previewer.per_pixel()],
        confidence: CONFIDENCE,
        cycles_per_frame: forecast.cycles_per_frame(),
        busy_energy_per_frame_j: forecast.energy_per_frame_j(),
        busy_power_w: forecast.busy_power_w(plan.gpu.core_hz),
    }
}
