//! Simulation of one frame: pipeline, timing model and power model.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use activity::{Event, LineAccess, Packet, Timeline, Unit};
use glam::Vec3;
use output::OutDir;
use output::image::LinearImage;
use output::progress::Progress;
use pipeline::frame::HeatMap;
use pipeline::{FrameReport, Gpu, RasterPass, Settings, Viewport};
use rayon::prelude::*;
use timing::{AccuracyWarning, FrameClock, Recorder};
use workloads::job::Drawn;
use workloads::{Frame, Scene};

use crate::heat::{self, HeatPicture};
use crate::passes;
use crate::regime::Regime;
use crate::{Distinct, Observed, Origin, Plan, RunError, RunFrame, Work};

/// Length of a timeline bin in picoseconds: one microsecond, a twentieth of a sample at 50 kHz.
pub const BIN_PS: u64 = 1_000_000;
/// Largest number of bins of all frames, at about 200 bytes each. Longer runs use longer bins.
const MAX_TOTAL_BINS: usize = 8_000_000;
/// Lower limit of the bins of a frame, for any number of frames.
pub(super) const MIN_FRAME_BINS: usize = 1024;

/// Largest number of bins of one frame, in a run of `frames`.
pub(super) fn max_bins_per_frame(frames: usize) -> usize {
    (MAX_TOTAL_BINS / frames.max(1)).max(MIN_FRAME_BINS)
}

/// Simulates the frames `numbers` without writing files.
///
/// # Errors
/// If a frame cannot be rendered or timed.
pub fn frames_of(plan: &Plan, numbers: &[u32], progress: &Progress) -> Result<Vec<RunFrame>, RunError> {
    let max_bins = max_bins_per_frame(numbers.len());
    let bar = progress.bar("frames", numbers.len() as u64);
    let simulate = |&number: &u32| {
        let (frame, ..) = simulate_frame(plan, number, max_bins)?;
        bar.inc();
        Ok(frame)
    };
    numbers.par_iter().map(simulate).collect()
}

/// Payload of a panic in a worker thread, with the frame that was simulated.
pub struct CrashedFrame {
    /// Number of the frame.
    pub frame: u32,
    /// Payload of the original panic.
    pub panic: Box<dyn Any + Send>,
}

/// Panics in the frame that `QUINTILE_PANIC_IN_FRAME` names: a test hook of debug builds.
fn panic_if_requested(number: u32) {
    if cfg!(debug_assertions)
        && std::env::var("QUINTILE_PANIC_IN_FRAME").is_ok_and(|frame| frame == number.to_string())
    {
        panic!("requested by a test");
    }
}

/// Simulates frames of a plan and writes their images.
pub(super) struct FrameSimulator<'a> {
    pub plan: &'a Plan,
    pub distinct: &'a Distinct,
    /// Folder of images and heat maps; `None` writes no files.
    pub dir: Option<&'a OutDir>,
    /// Largest number of timeline bins of a frame.
    pub max_bins: usize,
}

/// Result of simulating one frame.
pub(super) struct SimulatedFrame {
    pub frame: RunFrame,
    /// Linear image, if it is kept for the report.
    pub picture: Option<Vec<Vec3>>,
    pub heat: Vec<HeatPicture>,
}

impl FrameSimulator<'_> {
    /// Simulates group `group` once and writes the image of each of its frames.
    pub fn simulate(&self, group: usize, keep_picture: bool) -> Result<SimulatedFrame, RunError> {
        let (plan, dir, number) = (self.plan, self.dir, self.distinct.numbers()[group]);
        let simulate = || {
            panic_if_requested(number);
            simulate_frame(plan, number, self.max_bins)
        };
        let simulated = catch_unwind(AssertUnwindSafe(simulate))
            .unwrap_or_else(|panic| resume_unwind(Box::new(CrashedFrame { frame: number, panic })));
        let (frame, image, maps) = simulated?;
        let mut heat = Vec::new();
        if let Some(dir) = dir {
            let write = |map| heat::write(plan, dir, number, map, &image);
            heat = maps.iter().map(write).collect::<Result<_, _>>()?;
            self.distinct.members(group).try_for_each(|number| write_image(plan, dir, number, &image))?;
        }
        Ok(SimulatedFrame { frame, picture: keep_picture.then_some(image), heat })
    }
}

fn simulate_frame(
    plan: &Plan,
    number: u32,
    max_bins: usize,
) -> Result<(RunFrame, Vec<Vec3>, Vec<HeatMap>), RunError> {
    let mut clock =
        FrameClock::new(plan.options.timing, plan.gpu.machine()?, Recorder::new(BIN_PS, max_bins));
    let DrawnFrame { drawn, regime, mut report } =
        draw(plan, number, &plan.options.heat, |packet, lines| clock.push(packet, lines))?;
    let heat = std::mem::take(&mut report.heat);
    passes::limit_draws(&mut report);
    let timed = clock.finish()?;
    let accuracy = AccuracyWarning::all(plan.options.timing, &timed);
    let timeline = timed.timeline;
    let power = plan.model.frame(&timeline).map_err(|source| RunError::Timeline { frame: number, source })?;
    let simulated = RunFrame {
        index: number,
        triangles: report.triangles(),
        moving: drawn.moving,
        lens: drawn.lens,
        power,
        busy_ps: timeline.busy_ps(),
        busy: busy_shares(&timeline),
        cycles: timed.cycles,
        origin: Origin::Simulated(Box::new(Observed {
            counts: report.counts(),
            report,
            times: timed.passes,
            facts: drawn.facts,
            warnings: drawn.warnings,
            regime,
            stalls: timed.stalls,
            accuracy,
        })),
    };
    Ok((simulated, drawn.image, heat))
}

fn busy_shares(timeline: &Timeline) -> Vec<[f32; Unit::COUNT]> {
    let share = |busy: u64| (busy as f64 / timeline.bin_ps as f64) as f32;
    timeline.bins.iter().map(|bin| bin.busy_ps.map(share)).collect()
}

/// Path of the image of frame `number`, without extension.
pub(super) fn image_name(number: u32) -> String {
    format!("images/frame_{number:04}")
}

fn write_image(plan: &Plan, dir: &OutDir, number: u32, image: &[Vec3]) -> Result<(), RunError> {
    let pixels: Vec<[f32; 3]> = image.iter().map(Vec3::to_array).collect();
    let linear = LinearImage::new(plan.viewport.width(), plan.viewport.height(), &pixels)?;
    linear.write_png(dir, &format!("{}.png", image_name(number)))?;
    if plan.options.exr {
        linear.write_exr(dir, &format!("{}.exr", image_name(number)))?;
    }
    Ok(())
}

/// Result of drawing a frame.
pub(super) struct DrawnFrame {
    drawn: Drawn,
    regime: Regime,
    report: FrameReport,
}

/// Draws frame `number`, with heat maps of `events`; `emit` receives the packets.
fn draw(
    plan: &Plan,
    number: u32,
    events: &[Event],
    emit: impl FnMut(&Packet, &[LineAccess]),
) -> Result<DrawnFrame, RunError> {
    match &plan.work {
        Work::Scene(scene) => draw_scene(plan, scene, &scene.frame(number)?, plan.viewport, events, emit),
        Work::Job { job, .. } => {
            let gpu = Gpu::new(&plan.gpu.pipeline, emit).map_err(RunError::setting)?;
            let mut gpu = gpu.with_heat(events, plan.viewport);
            let drawn = job.frame(number, &mut gpu)?;
            Ok(DrawnFrame { drawn, regime: Regime::default(), report: gpu.finish() })
        }
    }
}

/// Draws `frame` at the size of `viewport`. The frame number must have no influence: frames with equal fingerprints are
/// drawn once.
pub(super) fn draw_scene(
    plan: &Plan,
    scene: &Scene,
    frame: &Frame,
    viewport: Viewport,
    events: &[Event],
    emit: impl FnMut(&Packet, &[LineAccess]),
) -> Result<DrawnFrame, RunError> {
    let draws = frame.draws(scene)?;
    let background = scene.background();
    let settings = Settings { spec: &plan.gpu.pipeline, viewport, samples: &*plan.samples, background };
    let gpu = Gpu::new(&plan.gpu.pipeline, emit).map_err(RunError::setting)?;
    let mut gpu = gpu.with_heat(events, viewport);
    let pass = RasterPass::new(&frame.camera, &draws, &settings).named("scene");
    let rendered = gpu.draw(&pass).map_err(RunError::setting)?;
    let report = gpu.finish();
    let drawn = Drawn {
        image: rendered.into_image(),
        moving: frame.is_moving(),
        lens: frame.camera.lens().is_some(),
        ..Drawn::default()
    };
    let regime = Regime::of(&frame.camera, &draws, viewport, plan.samples.per_pixel());
    Ok(DrawnFrame { drawn, regime, report })
}
