//! The frames of a run through pipeline, clock and watts.

use activity::{Counts, Timeline, Unit};
use glam::Vec3;
use pipeline::frame::{HeatMap, render_with_heat};
use power_model::FramePower;
use rayon::prelude::*;
use timing::{Recorder, Stalls};
use workloads::Frame;

use super::heat::{self, HeatPicture};
use super::regime::Regime;
use super::{Plan, RunError};
use crate::output::OutDir;
use crate::output::image::LinearImage;
use crate::output::progress::Progress;
use crate::timing::FrameClock;

/// Bins of a frame's timeline are a microsecond long, twenty to a sample of a 50 kHz recorder.
const BIN_PS: u64 = 1_000_000;
/// Most bins of all frames that are kept, about 200 bytes each; where there would be more they are made longer.
const MOST_BINS: usize = 8_000_000;
/// Fewest bins of a frame, however many frames there are.
const FEWEST_BINS: usize = 1024;

/// One frame as the simulator knows it.
pub struct SimulatedFrame {
    /// Its number in the scene.
    pub index: u32,
    /// Triangles drawn.
    pub triangles: usize,
    /// Whether anything moves while its shutter is open.
    pub moving: bool,
    /// Whether the camera has a lens.
    pub lens: bool,
    /// How often each event happened.
    pub counts: Counts,
    /// Triangles that tile tests are known to be bad at.
    pub regime: Regime,
    /// Watts over time and joules by part.
    pub power: FramePower,
    /// For how long each unit was busy, in picoseconds.
    pub busy_ps: [u64; Unit::COUNT],
    /// The busy share of each unit in each bin of [`FramePower::bin_s`].
    pub busy: Vec<[f32; Unit::COUNT]>,
    /// Cycles of the core clock.
    pub cycles: u64,
    /// Why units did not work, where the level of timing knows.
    pub stalls: Option<Stalls>,
}

/// All frames of a run.
pub struct Simulated {
    /// Frames that differ.
    pub distinct: Vec<SimulatedFrame>,
    /// For each frame of the run, its place in `distinct`: a still scene is simulated once.
    pub frames: Vec<usize>,
    /// Pictures for the report: frame number and the linear image.
    pub pictures: Vec<(u32, Vec<Vec3>)>,
    /// The heat maps of the frame in the middle.
    pub heat: Vec<HeatPicture>,
}

impl Simulated {
    /// The frames of the run in order.
    pub fn in_order(&self) -> impl Iterator<Item = &SimulatedFrame> {
        self.frames.iter().map(|&place| &self.distinct[place])
    }

    /// The counts of the whole run.
    pub fn total(&self) -> Counts {
        self.in_order().fold(Counts::default(), |mut sum, frame| {
            sum += &frame.counts;
            sum
        })
    }
}

/// Simulates every frame that differs, writing its image as soon as it is done.
pub(super) fn simulate(plan: &Plan, dir: &OutDir, progress: &Progress) -> Result<Simulated, RunError> {
    remove_stale(dir)?;
    let range = plan.scene.settings().frames.clone();
    let numbers: Vec<u32> =
        if plan.scene.is_animated() { range.clone().collect() } else { vec![range.start] };
    let middle = numbers[numbers.len() / 2];
    let shown = [middle, numbers[0], numbers[numbers.len() - 1]];
    let most_bins = (MOST_BINS / numbers.len()).max(FEWEST_BINS);
    let bar = progress.bar("frames", numbers.len() as u64);
    let done: Vec<_> = numbers
        .par_iter()
        .map(|&number| {
            let (frame, image, heat) = simulate_frame(plan, number, most_bins)?;
            let maps = heat.iter().map(|map| heat::write(plan, dir, number, map));
            let maps: Vec<HeatPicture> = maps.collect::<Result<_, _>>()?;
            // A still scene is simulated once; every frame of the run has its image all the same.
            let mut shown_as = if numbers.len() == 1 { range.clone() } else { number..number + 1 };
            shown_as.try_for_each(|frame| write_image(plan, dir, frame, &image))?;
            bar.inc();
            let maps = if number == middle { maps } else { Vec::new() };
            Ok((frame, shown.contains(&number).then_some((number, image)), maps))
        })
        .collect::<Result<_, RunError>>()?;
    let (mut distinct, mut pictures, mut heat) = (Vec::new(), Vec::new(), Vec::new());
    for (frame, picture, maps) in done {
        distinct.push(frame);
        pictures.extend(picture);
        heat.extend(maps);
    }
    let frames =
        range.map(|number| if numbers.len() == 1 { 0 } else { (number - numbers[0]) as usize }).collect();
    Ok(Simulated { distinct, frames, pictures, heat })
}

/// What an earlier run left: should this one die on the way, nothing old may stand in for it.
fn remove_stale(dir: &OutDir) -> Result<(), RunError> {
    dir.remove_stale("images", "frame_", &["png", "exr"])?;
    dir.remove_stale("heat", "", &["png", "exr", "csv"])?;
    dir.remove_stale("", "report.", &["html"])?;
    dir.remove_stale("", "frames.", &["csv"])?;
    dir.remove_stale("", "trace.", &["csv", "json", "parquet"])?;
    dir.remove_stale("plots", "stalls", &["svg", "png"])?;
    dir.remove_stale("", "timeline.", &["perfetto-trace"])?;
    for (figure, _) in super::FIGURES {
        dir.remove_stale("plots", figure, &["svg", "png"])?;
    }
    Ok(())
}

fn simulate_frame(
    plan: &Plan,
    number: u32,
    most_bins: usize,
) -> Result<(SimulatedFrame, Vec<Vec3>, Vec<HeatMap>), RunError> {
    let frame = plan.scene.frame(number)?;
    let settings = pipeline::Settings {
        spec: &plan.gpu.pipeline,
        viewport: plan.viewport,
        samples: &*plan.samples,
        background: plan.scene.background(),
    };
    let draws = frame.draws(&plan.scene)?;
    let mut clock = FrameClock::new(plan.options.timing, &plan.gpu, Recorder::new(BIN_PS, most_bins))?;
    let events = &plan.options.heat;
    let emit = |packet: &_, lines: &_| clock.push(packet, lines);
    let (rendered, heat) = render_with_heat(&frame.camera, &draws, &settings, events, emit)
        .map_err(|error| RunError::Setting(error.to_string()))?;
    let timed = clock.finish()?;
    let timeline = timed.timeline;
    let power = plan.model.frame(&timeline).map_err(|source| RunError::Timeline { frame: number, source })?;
    let moving = is_moving(&frame);
    let simulated = SimulatedFrame {
        index: number,
        triangles: frame.triangle_count(),
        moving,
        lens: frame.camera.lens().is_some(),
        counts: rendered.counts,
        regime: Regime::of(&frame.camera, &draws, plan.viewport, plan.samples.per_pixel()),
        power,
        busy_ps: timeline.busy_ps(),
        busy: busy_shares(&timeline),
        cycles: timed.cycles,
        stalls: timed.stalls,
    };
    Ok((simulated, rendered.image, heat))
}

fn is_moving(frame: &Frame) -> bool {
    frame.camera.open() != frame.camera.close() || frame.meshes.iter().any(|mesh| !mesh.is_still())
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
