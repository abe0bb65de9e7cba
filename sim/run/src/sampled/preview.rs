//! Previews of frames at a reduced resolution, and the signatures made from them.

use activity::{Counts, Event, Unit};
use pipeline::frame::render_with_heat;
use pipeline::sampling::SampleSource;
use pipeline::{Settings, Viewport};
use power_model::PowerModel;
use timing::{FrameClock, Level, Recorder};
use workloads::SampleChoice;

use crate::{Plan, RunError, RunFrame, frame};

/// The preview is as many times smaller along each axis as leaves it so wide, and at most [`MAX_REDUCTION`] times.
const TARGET_WIDTH_PX: u32 = 160;
const MAX_REDUCTION: u32 = 8;
/// Bins of a timeline that nobody looks at.
const TIMELINE_BINS: usize = 64;

/// How frames are looked at before it is known which are simulated.
pub struct Previewer {
    /// Size of the image.
    pub viewport: Viewport,
    samples: Box<dyn SampleSource>,
    level: Level,
}

/// A frame at a glance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramePreview {
    /// Triangles drawn.
    pub triangles: usize,
    /// Whether anything moves while its shutter is open.
    pub moving: bool,
    /// Whether the camera has a lens.
    pub lens: bool,
    /// How often each event happened in the preview.
    pub counts: Counts,
    /// For how long each unit was busy with it, in picoseconds.
    pub busy_ps: [u64; Unit::COUNT],
    /// Cycles of the preview.
    pub cycles: u64,
}

impl Previewer {
    /// A preview of the frames of `plan`, with one sample in a pixel where the sample table can be had so.
    pub fn new(plan: &Plan) -> Result<Self, RunError> {
        let by = (plan.viewport.width() / TARGET_WIDTH_PX).clamp(1, MAX_REDUCTION);
        let [width, height] = [plan.viewport.width(), plan.viewport.height()].map(|side| side.div_ceil(by));
        let viewport = Viewport::new(width, height)
            .ok_or_else(|| RunError::Setting(format!("size of the preview: {width}x{height}")))?;
        let settings = plan.work.settings();
        let table = SampleChoice::load(&settings.table)?;
        let own = |count| table.source(count, plan.options.seed);
        let samples = own(1).or_else(|_| own(plan.samples.per_pixel()))?;
        let level = if plan.options.timing == Level::Bound { Level::Bound } else { Level::Packet };
        Ok(Self { viewport, samples, level })
    }

    /// Samples in a pixel.
    pub fn per_pixel(&self) -> u32 {
        self.samples.per_pixel()
    }

    /// Frame `number` at a glance.
    pub fn frame(&self, plan: &Plan, number: u32) -> Result<FramePreview, RunError> {
        let scene = plan.work.scene("predicting frames")?;
        let frame = scene.frame(number)?;
        let settings = Settings {
            spec: &plan.gpu.pipeline,
            viewport: self.viewport,
            samples: &*self.samples,
            background: scene.background(),
        };
        let draws = frame.draws(scene)?;
        let recorder = Recorder::new(frame::BIN_PS, TIMELINE_BINS);
        let mut clock = FrameClock::new(self.level, plan.gpu.machine()?, recorder);
        let emit = |packet: &_, lines: &_| clock.push(packet, lines);
        let rendered =
            render_with_heat(&frame.camera, &draws, &settings, &[], emit).map_err(RunError::setting)?;
        let timed = clock.finish()?;
        Ok(FramePreview {
            triangles: frame.triangle_count(),
            moving: frame.is_moving(),
            lens: frame.camera.lens().is_some(),
            counts: rendered.0.counts,
            busy_ps: timed.timeline.busy_ps(),
            cycles: timed.cycles,
        })
    }
}

/// About what each frame takes. Only differences between frames matter.
#[derive(Clone, Debug, PartialEq)]
pub struct Signatures {
    /// A soft maximum of the busy times of the units, in picoseconds.
    pub cycles: Vec<f64>,
    /// Events times their energy, and what goes with time, in joules.
    pub energy_j: Vec<f64>,
}

impl Signatures {
    /// Of the frames seen in `previews`, of which `pilot` is the one at place `at`, simulated whole.
    ///
    /// At a small size other units are the bottleneck, and triangles weigh more beside pixels. So each unit's busy time and each
    /// event's count is scaled by what it is for the pilot over what it is in the pilot's preview; then the slowest unit decides
    /// over time (fourth powers are summed, as units overlap without quite hiding each other), and energies add up.
    pub fn new(previews: &[FramePreview], pilot_place: usize, pilot: &RunFrame, model: &PowerModel) -> Self {
        let counts = pilot.observed().map_or_else(Counts::default, |observed| observed.counts);
        let seen = &previews[pilot_place];
        let by_unit = Unit::ALL.map(|unit| ratio(pilot.busy_ps[unit as usize], seen.busy_ps[unit as usize]));
        let by_event =
            Event::ALL.map(|event| ratio(counts[event], seen.counts[event]) * model.event_j(event));
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

fn ratio(whole: u64, seen: u64) -> f64 {
    if seen == 0 { 0.0 } else { whole as f64 / seen as f64 }
}

/// The place of the frame in the middle by the cycles of its preview, the earlier of two.
pub fn median(previews: &[FramePreview]) -> usize {
    let mut order: Vec<usize> = (0..previews.len()).collect();
    order.sort_by_key(|&place| (previews[place].cycles, place));
    order[order.len() / 2]
}
