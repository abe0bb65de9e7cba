//! Simulation of one frame: pipeline, timing model and power model.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use activity::{Event, LineAccess, Packet, Timeline, Unit};
use glam::Vec3;
use output::OutDir;
use output::image::LinearImage;
use output::progress::Progress;
use pipeline::Settings;
use pipeline::frame::{HeatMap, render_with_heat};
use rayon::prelude::*;
use timing::{AccuracyWarning, FrameClock, Recorder};
use workloads::job::Drawn;
use workloads::{Frame, Scene};

use crate::heat::{self, HeatPicture};
use crate::regime::Regime;
use crate::{Distinct, Observed, Origin, Plan, RunError, RunFrame, Work};

/// Bins of a frame's timeline are a microsecond long, twenty to a sample of a 50 kHz recorder.
pub const BIN_PS: u64 = 1_000_000;
/// Most bins of all frames that are kept, about 200 bytes each; where there would be more they are made longer.
const MAX_TOTAL_BINS: usize = 8_000_000;
/// Fewest bins of a frame, however many frames there are.
pub(super) const MIN_FRAME_BINS: usize = 1024;

/// The most bins of a frame where `frames` are kept.
pub(super) fn max_bins_per_frame(frames: usize) -> usize {
    (MAX_TOTAL_BINS / frames.max(1)).max(MIN_FRAME_BINS)
}

/// Simulates the frames called `numbers` and writes nothing.
///
/// # Errors
/// When a frame cannot be made or timed.
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

/// What a panic carries through the threads, so that it is known which frame it happened in.
pub struct CrashedFrame {
    /// The frame.
    pub frame: u32,
    /// What the panic itself carried.
    pub panic: Box<dyn Any + Send>,
}

/// Lets tests of builds with assertions see a crash; elsewhere it is nothing.
fn panic_if_requested(number: u32) {
    if cfg!(debug_assertions)
        && std::env::var("QUINTILE_PANIC_IN_FRAME").is_ok_and(|asked| asked == number.to_string())
    {
        panic!("a test asked for it");
    }
}

/// Where frames are simulated.
pub(super) struct FrameSimulator<'a> {
    pub plan: &'a Plan,
    pub distinct: &'a Distinct,
    /// Where images and heat maps go; nowhere without it.
    pub dir: Option<&'a OutDir>,
    /// Bins of a frame at most.
    pub max_bins: usize,
}

/// A frame simulated whole.
pub(super) struct SimulatedFrame {
    pub frame: RunFrame,
    /// Its linear image, where it is wanted.
    pub picture: Option<Vec<Vec3>>,
    pub heat: Vec<HeatPicture>,
}

impl FrameSimulator<'_> {
    /// Simulates the frames of group `group` once and writes the image of each.
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
    let Drawing { drawn, regime, heat } =
        draw(plan, number, &plan.options.heat, |packet, lines| clock.push(packet, lines))?;
    let timed = clock.finish()?;
    let accuracy = AccuracyWarning::all(plan.options.timing, &timed);
    let timeline = timed.timeline;
    let power = plan.model.frame(&timeline).map_err(|source| RunError::Timeline { frame: number, source })?;
    let simulated = RunFrame {
        index: number,
        triangles: drawn.triangles,
        moving: drawn.moving,
        lens: drawn.lens,
        power,
        busy_ps: timeline.busy_ps(),
        busy: busy_shares(&timeline),
        cycles: timed.cycles,
        origin: Origin::Simulated(Observed {
            counts: drawn.counts,
            facts: drawn.facts,
            warnings: drawn.warnings,
            regime,
            stalls: timed.stalls,
            accuracy,
        }),
    };
    Ok((simulated, drawn.image, heat))
}

fn busy_shares(timeline: &Timeline) -> Vec<[f32; Unit::COUNT]> {
    let share = |busy: u64| (busy as f64 / timeline.bin_ps as f64) as f32;
    timeline.bins.iter().map(|bin| bin.busy_ps.map(share)).collect()
}

/// The name of a frame's image without its ending.
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

/// A frame as it was drawn.
struct Drawing {
    drawn: Drawn,
    regime: Regime,
    heat: Vec<HeatMap>,
}

/// Draws frame `number`, with heat maps of `events`.
fn draw(
    plan: &Plan,
    number: u32,
    events: &[Event],
    mut emit: impl FnMut(&Packet, &[LineAccess]),
) -> Result<Drawing, RunError> {
    match &plan.work {
        Work::Scene(scene) => draw_scene(plan, scene, &scene.frame(number)?, events, emit),
        Work::Job { job, .. } => {
            let drawn = job.frame(number, &plan.gpu.pipeline, &mut emit)?;
            Ok(Drawing { drawn, regime: Regime::default(), heat: Vec::new() })
        }
    }
}

/// Draws from `frame` and from what is the same in all frames. It must not know which frame it draws, because frames with the
/// same fingerprint are drawn once.
fn draw_scene(
    plan: &Plan,
    scene: &Scene,
    frame: &Frame,
    events: &[Event],
    emit: impl FnMut(&Packet, &[LineAccess]),
) -> Result<Drawing, RunError> {
    let draws = frame.draws(scene)?;
    let viewport = plan.viewport;
    let background = scene.background();
    let settings = Settings { spec: &plan.gpu.pipeline, viewport, samples: &*plan.samples, background };
    let (rendered, heat) =
        render_with_heat(&frame.camera, &draws, &settings, events, emit).map_err(RunError::setting)?;
    let drawn = Drawn {
        image: rendered.image,
        counts: rendered.counts,
        triangles: frame.triangle_count(),
        moving: frame.is_moving(),
        lens: frame.camera.lens().is_some(),
        ..Drawn::default()
    };
    let regime = Regime::of(&frame.camera, &draws, viewport, plan.samples.per_pixel());
    Ok(Drawing { drawn, regime, heat })
}
