//! Previews of frames at a reduced resolution, and the signatures made from them.

use activity::{Counts, Event, Unit};
use pipeline::frame::render_with_heat;
use pipeline::sampling::SampleSource;
use pipeline::{Settings, Viewport};
use power_model::PowerModel;
use timing::{FrameClock, Level, Recorder};
use workloads::SampleChoice;

use crate::{Plan, RunError, RunFrame, frame};

/// Width in pixels that images are reduced to, at most by a factor of [`MAX_REDUCTION`].
const TARGET_WIDTH_PX: u32 = 160;
/// Largest factor of the reduction along each axis.
const MAX_REDUCTION: u32 = 8;
/// Timeline bins of a preview; only totals are used.
const TIMELINE_BINS: usize = 64;

/// Renders previews: image size, sample table and timing level.
pub struct Previewer {
    /// Size of the image.
    pub viewport: Viewport,
    samples: Box<dyn SampleSource>,
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

impl Previewer {
    /// Settings for the frames of `plan`, with one sample per pixel if the sample table allows it.
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

    /// Samples per pixel.
    pub fn per_pixel(&self) -> u32 {
        self.samples.per_pixel()
    }

    /// Renders and times a preview of frame `number`.
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
pub fn median(previews: &[FramePreview]) -> usize {
    let mut order: Vec<usize> = (0..previews.len()).collect();
    order.sort_by_key(|&place| (previews[place].cycles, place));
    order[order.len() / 2]
}
