//! Sampled simulation of long animations: preview every frame, simulate a few, predict the others.
//!
//! ```text
//! Previewer -> FramePreview of every frame -> a pilot frame simulated -> Signatures -> Design
//!     -> representative frames simulated -> Forecast
//! ```
//!
//! The statistics are in [`timing::sampled`].

use std::collections::{BTreeMap, BTreeSet};

use activity::{Counts, Event, Unit};
use output::terminal::Progress;
use pipeline::Gpu;
use pipeline::random::mix;
use power_model::PowerModel;
use rayon::prelude::*;
use timing::sampled::{Design, Estimate};
use timing::{FrameClock, Level, Recorder};
use workloads::Job;
use workloads::job::Reduction;

use crate::frame::{FrameSimulator, SimulatedFrame};
use crate::{Distinct, FrameCost, Origin, Plan, RunError, RunFrame, RunQuantity, SampledSummary, Simulated};

/// Previews of the frames of a run, and the pilot frame.
pub struct Previews<'a> {
    /// Settings of the previews.
    pub previewer: Previewer<'a>,
    /// Preview of each frame.
    pub frames: Vec<FramePreview>,
    /// Index of the pilot frame. It is simulated first, and previews are scaled by it.
    pub pilot: usize,
}

impl<'a> Previews<'a> {
    /// Previews the frames `numbers`.
    pub fn new(plan: &'a Plan, numbers: &[u32], progress: &Progress) -> Result<Self, RunError> {
        let previewer = Previewer::new(plan)?;
        let bar = progress.bar("previews", numbers.len() as u64);
        let preview = |&number: &u32| {
            bar.inc();
            previewer.frame(number)
        };
        let frames: Vec<FramePreview> = numbers.par_iter().map(preview).collect::<Result<_, _>>()?;
        let pilot = median(&frames);
        Ok(Self { previewer, frames, pilot })
    }

    /// Previews of all frames of a run, from those of distinct frames: frame `i` belongs to group
    /// `groups[i]`.
    fn for_frames(self, groups: &[usize]) -> Self {
        let frames: Vec<FramePreview> = groups.iter().map(|&group| self.frames[group]).collect();
        Self { pilot: median(&frames), frames, ..self }
    }

    /// Chooses `count` frames to simulate, including the pilot.
    pub fn design(&self, signatures: &Signatures, count: usize, seed: u64) -> Design {
        let word = |frame: u64| mix(mix(seed.wrapping_add(0x73A3_7D1E)) ^ frame);
        Design::draw(&signatures.cycles, Some(self.pilot), count, word)
    }
}

/// Simulates the frames that the plan requires and predicts the others.
pub(super) fn simulate(simulator: FrameSimulator<'_>, progress: &Progress) -> Result<Simulated, RunError> {
    let (plan, groups) = (simulator.plan, simulator.distinct.groups());
    let previews = Previews::new(plan, simulator.distinct.numbers(), progress)?.for_frames(groups);
    let pilot = groups[previews.pilot];
    let simulator = &FrameSimulator { checked: pilot, ..simulator };
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
    previews: &Previews<'_>,
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
    let pilot = &simulated[&groups[previews.pilot]].frame;
    let preview_share = previews.frames[previews.pilot].cycles as f64 / pilot.cycles.max(1) as f64;
    let sampled = summary(plan, frames, previews, preview_share, forecast);
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
fn nearest(previews: &Previews<'_>, forecast: &Forecast, place: usize) -> usize {
    let design = forecast.design();
    let apart = |&other: &usize| previews.frames[other].cycles.abs_diff(previews.frames[place].cycles);
    let chosen = &design.strata()[design.stratum_of(place)].chosen;
    chosen.iter().copied().min_by_key(apart).unwrap_or(previews.pilot)
}

/// Predicts a frame: the power curve of `nearest`, scaled to the predicted time and energy.
fn predict(
    number: u32,
    previews: &Previews<'_>,
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
fn summary(
    plan: &Plan,
    frames: &Distinct,
    previews: &Previews<'_>,
    preview_share: f64,
    forecast: &Forecast,
) -> SampledSummary {
    let (numbers, groups) = (frames.numbers(), frames.groups());
    let chosen: BTreeSet<u32> =
        forecast.design().chosen().into_iter().map(|place| numbers[groups[place]]).collect();
    SampledSummary {
        frames_per_simulated: groups.len() as f64 / chosen.len() as f64,
        simulated_frames: chosen.into_iter().collect(),
        strata: forecast.design().strata().len(),
        preview: previews.previewer.size(),
        preview_share,
        confidence: CONFIDENCE,
        cycles_per_frame: forecast.cycles_per_frame(),
        busy_energy_per_frame_j: forecast.energy_per_frame_j(),
        busy_power_w: forecast.busy_power_w(plan.gpu.core_hz),
    }
}

/// Confidence level of the intervals.
const CONFIDENCE: f64 = 0.95;

/// Estimates of cycles and energy of every frame, from simulated frames and previews.
pub struct Forecast {
    design: Design,
    cycles: Estimate,
    energy: Estimate,
}

impl Forecast {
    /// Estimates from the signatures of all frames and the `cost` of those that `design` chose.
    pub fn new(design: Design, signatures: &Signatures, cost: impl Fn(usize) -> FrameCost) -> Self {
        let cycles = Estimate::new(&design, &signatures.cycles, |frame| cost(frame).cycles);
        let energy = Estimate::new(&design, &signatures.energy_j, |frame| cost(frame).energy_j);
        Self { design, cycles, energy }
    }

    /// Design of the sample: strata and simulated frames.
    pub fn design(&self) -> &Design {
        &self.design
    }

    /// Mean cycles per frame.
    pub fn cycles_per_frame(&self) -> RunQuantity {
        self.cycles.total(CONFIDENCE).scaled(1.0 / self.frames()).into()
    }

    /// Mean energy per frame in joules while busy.
    pub fn energy_per_frame_j(&self) -> RunQuantity {
        self.energy.total(CONFIDENCE).scaled(1.0 / self.frames()).into()
    }

    /// Mean power in watts while busy.
    pub fn busy_power_w(&self, core_hz: f64) -> RunQuantity {
        self.energy.ratio(&self.cycles, CONFIDENCE).scaled(core_hz).into()
    }

    /// Relative half-width of the widest interval.
    pub fn relative_half_width(&self) -> f64 {
        let all = [self.cycles_per_frame(), self.energy_per_frame_j(), self.busy_power_w(1.0)];
        all.iter().map(|quantity| quantity.relative_half_width).fold(0.0, f64::max)
    }

    /// Predicted cost of frame `place`, and the half-widths of its prediction intervals.
    pub fn frame(&self, place: usize) -> [FrameCost; 2] {
        let stratum = self.design.stratum_of(place);
        let half = |estimate: &Estimate| estimate.half_width_of_one(stratum, CONFIDENCE);
        [
            FrameCost { cycles: self.cycles.predicted(place), energy_j: self.energy.predicted(place) },
            FrameCost { cycles: half(&self.cycles), energy_j: half(&self.energy) },
        ]
    }

    fn frames(&self) -> f64 {
        self.design.units() as f64
    }
}

/// Width in pixels that images are reduced to, at most by a factor of [`MAX_REDUCTION`].
const TARGET_WIDTH_PX: u32 = 160;
/// Largest factor of the reduction along each axis.
const MAX_REDUCTION: u32 = 8;
/// Timeline bins of a preview; only totals are used.
const TIMELINE_BINS: usize = 64;

/// Renders previews: the job with less work, and the timing level.
pub struct Previewer<'a> {
    plan: &'a Plan,
    job: Box<dyn Job + 'a>,
    level: Level,
}

/// Preview of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramePreview {
    /// Number of triangles.
    pub triangles: usize,
    /// Whether anything moves while its shutter is open.
    pub moving: bool,
    /// Whether the camera has a lens.
    pub lens: bool,
    /// Event counts of the preview.
    pub counts: Counts,
    /// Busy time of each unit in the preview, in picoseconds.
    pub busy_ps: [u64; Unit::COUNT],
    /// Cycles of the preview.
    pub cycles: u64,
}

impl<'a> Previewer<'a> {
    /// Previews of the frames of `plan`, with one sample per pixel if the job can draw so few.
    pub fn new(plan: &'a Plan) -> Result<Self, RunError> {
        let to = Reduction {
            samples: Some(1),
            ..Reduction::to_width(plan.job.settings(), TARGET_WIDTH_PX, MAX_REDUCTION)
        };
        let level = if plan.options.level() == Level::Bound { Level::Bound } else { Level::Packet };
        Ok(Self { plan, job: plan.reduced(&to)?, level })
    }

    /// Width and height of a preview in pixels, and samples per pixel.
    pub fn size(&self) -> [u32; 3] {
        let settings = self.job.settings();
        [settings.width, settings.height, settings.samples]
    }

    /// Renders and times a preview of frame `number`.
    pub fn frame(&self, number: u32) -> Result<FramePreview, RunError> {
        let recorder = Recorder::new(crate::BIN_PS, TIMELINE_BINS);
        let mut clock = FrameClock::new(self.level, self.plan.gpu.machine()?, recorder);
        let emit = |packet: &_, lines: &_| clock.push(packet, lines);
        let mut gpu = Gpu::new(&self.plan.gpu.pipeline, emit)?;
        let drawn = self.job.frame(number, &mut gpu).map_err(RunError::on(&self.plan.gpu))?;
        let report = gpu.finish();
        let timed = clock.finish()?;
        Ok(FramePreview {
            triangles: report.triangles(),
            moving: drawn.moving,
            lens: drawn.lens,
            counts: report.counts(),
            busy_ps: timed.timeline.busy_ps(),
            cycles: timed.cycles,
        })
    }
}

/// Signatures: estimated cost of each frame from its preview. Only differences between frames matter.
#[derive(Clone, Debug, PartialEq)]
pub struct Signatures {
    /// Soft maximum of the units' busy times, in picoseconds.
    pub cycles: Vec<f64>,
    /// Energy of events and of elapsed time, in joules.
    pub energy_j: Vec<f64>,
}

impl Signatures {
    /// Signatures of the frames of `previews`. `pilot` is the simulated frame at index `pilot_place`.
    ///
    /// A small image has other bottlenecks, and triangles cost more relative to pixels. So each unit's busy
    /// time and each event count is scaled by its ratio between the pilot and the pilot's preview. The time
    /// is the fourth root of the sum of fourth powers of busy times, because units overlap only in part.
    /// Energies are added.
    pub fn new(previews: &[FramePreview], pilot_place: usize, pilot: &RunFrame, model: &PowerModel) -> Self {
        let counts = pilot.observed().map_or_else(Counts::default, |observed| observed.counts);
        let reference = &previews[pilot_place];
        let by_unit =
            Unit::ALL.map(|unit| ratio(pilot.busy_ps[unit as usize], reference.busy_ps[unit as usize]));
        let by_event =
            Event::ALL.map(|event| ratio(counts[event], reference.counts[event]) * model.event_j(event));
        let slowest = |preview: &FramePreview| {
            let busy = preview.busy_ps.iter().zip(by_unit).map(|(&busy, scale)| busy as f64 * scale);
            busy.map(|busy| (busy * busy) * (busy * busy)).sum::<f64>().sqrt().sqrt()
        };
        let events = |preview: &FramePreview| -> f64 {
            Event::ALL.iter().zip(by_event).map(|(&event, scale)| preview.counts[event] as f64 * scale).sum()
        };
        let cycles: Vec<f64> = previews.iter().map(slowest).collect();
        let with_time = pilot.power.energy().total_j() - model.counts_energy(&counts).total_j();
        let per_time = if cycles[pilot_place] > 0.0 { with_time / cycles[pilot_place] } else { 0.0 };
        let energy_j = previews.iter().zip(&cycles).map(|(preview, time)| events(preview) + per_time * time);
        Self { energy_j: energy_j.collect(), cycles }
    }
}

fn ratio(full: u64, preview: u64) -> f64 {
    if preview == 0 { 0.0 } else { full as f64 / preview as f64 }
}

/// Index of the frame with the median cycles of its preview; the earlier of two.
fn median(previews: &[FramePreview]) -> usize {
    let mut order: Vec<usize> = (0..previews.len()).collect();
    order.sort_by_key(|&place| (previews[place].cycles, place));
    order[order.len() / 2]
}
