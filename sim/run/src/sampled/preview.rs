//! Frames at a glance: the whole pipeline at a reduced resolution.

use activity::{Counts, Unit};
use pipeline::frame::render_with_heat;
use pipeline::sampling::SampleSource;
use pipeline::{Settings, Viewport};
use timing::Recorder;
use workloads::SampleChoice;

use super::super::{Plan, RunError, frame};
use timing::{FrameClock, Level};

/// The preview is as many times smaller along each axis as leaves it so wide, and at most [`SMALLEST`] times.
const WIDTH_PX: u32 = 160;
const SMALLEST: u32 = 8;
/// Bins of a timeline that nobody looks at.
const BINS: usize = 64;

/// How frames are looked at before it is known which are simulated.
pub struct Preview {
    /// Size of the image.
    pub viewport: Viewport,
    samples: Box<dyn SampleSource>,
    level: Level,
}

/// A frame at a glance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glimpse {
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

impl Preview {
    /// A preview of the frames of `plan`, with one sample in a pixel where the sample table can be had so.
    pub fn new(plan: &Plan) -> Result<Self, RunError> {
        let by = (plan.viewport.width() / WIDTH_PX).clamp(1, SMALLEST);
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
    pub fn frame(&self, plan: &Plan, number: u32) -> Result<Glimpse, RunError> {
        let scene = plan.work.scene("predicting frames")?;
        let frame = scene.frame(number)?;
        let settings = Settings {
            spec: &plan.gpu.pipeline,
            viewport: self.viewport,
            samples: &*self.samples,
            background: scene.background(),
        };
        let draws = frame.draws(scene)?;
        let recorder = Recorder::new(frame::BIN_PS, BINS);
        let mut clock = FrameClock::new(self.level, plan.gpu.machine()?, recorder);
        let emit = |packet: &_, lines: &_| clock.push(packet, lines);
        let rendered =
            render_with_heat(&frame.camera, &draws, &settings, &[], emit).map_err(RunError::setting)?;
        let timed = clock.finish()?;
        Ok(Glimpse {
            triangles: frame.triangle_count(),
            moving: frame.is_moving(),
            lens: frame.camera.lens().is_some(),
            counts: rendered.0.counts,
            busy_ps: timed.timeline.busy_ps(),
            cycles: timed.cycles,
        })
    }
}
