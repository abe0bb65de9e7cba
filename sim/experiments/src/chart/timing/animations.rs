//! Workloads of the timing chart: one frame of each scene, and animations at every level, drawn and timed as in a run.

use std::path::Path;

use activity::{LineAccess, Packet};
use cpu_time::ProcessTime;
use output::progress::Progress;
use pipeline::sampling::SampleSource;
use pipeline::{Camera, Draw, LensShape, RasterPass, SampleTable, Settings, Viewport};
use run::{
    Distinct, Forecast, GpuSpec, Plan, Previews, RunError, RunFrame, RunOptions, Sampling, Signatures,
    frames_of,
};
use serde::Serialize;
use timing::Level;
use workloads::stress::{Size, StressScene, family};
use workloads::visibility::Unshaded;
use workloads::{Overrides, Scene};

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
    pub cpu_s: f64,
    /// The same over that of the reference.
    pub relative_host: f64,
}

/// All frames at one level.
struct Simulated {
    plan: Plan,
    frames: Vec<RunFrame>,
    cpu_s: f64,
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
        Ok(Simulated { plan, frames, cpu_s: started.elapsed().as_secs_f64() })
    };
    if Distinct::new(&plan(scene, gpu, extent, Level::Packet)?.work)?.numbers().len() < numbers.len() {
        return Ok(Vec::new());
    }
    let truth = all(Level::Stepped)?;
    let name = Path::new(scene).file_name().map_or(scene.into(), |file| file.to_string_lossy());
    let row = |level: &'static str, simulated: usize, cycles: f64, cpu_s: f64| AnimationRow {
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
        cpu_s,
        relative_host: cpu_s / truth.cpu_s,
    };
    let whole =
        |level: Level, found: &Simulated| row(level.name(), numbers.len(), found.cycles(), found.cpu_s);
    let (packet, bound) = (all(Level::Packet)?, all(Level::Bound)?);
    let mut rows =
        vec![whole(Level::Stepped, &truth), whole(Level::Packet, &packet), whole(Level::Bound, &bound)];
    for (seed, simulated, cycles, cpu_s) in sampled(&packet, &numbers, extent.seeds, progress)? {
        rows.push(AnimationRow { seed: Some(seed), ..row(SAMPLED, simulated, cycles, cpu_s) });
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
        let cpu_s = previews_s + all.cpu_s * simulated as f64 / count as f64;
        (seed, simulated, forecast.cycles_per_frame().value * count as f64, cpu_s)
    };
    Ok((1..=seeds).map(choice).collect())
}

/// Built-in scenes.
pub(super) const SCENES: [&str; 2] = ["default", "tiny"];
/// Families of the failure catalogue, each at one value: large and tiny triangles, lens and motion, behind the camera.
const FAMILIES: [(&str, f64); 4] =
    [("lens-and-motion", 2.0), ("micro", 1.0), ("behind", 0.0), ("diagonals", 128.0)];

/// The packets of a frame, each with the end of its lines.
#[derive(Default)]
pub(super) struct Packets {
    pub packets: Vec<(Packet, usize)>,
    pub lines: Vec<LineAccess>,
}

impl Packets {
    /// Packets that have their lines with them.
    pub fn of(packets: &[(Packet, Vec<LineAccess>)]) -> Self {
        let mut all = Self::default();
        for (packet, lines) in packets {
            all.lines.extend_from_slice(lines);
            all.packets.push((*packet, all.lines.len()));
        }
        all
    }

    /// Each packet with its lines.
    pub fn each(&self, mut to: impl FnMut(&Packet, &[LineAccess])) {
        let mut first = 0;
        for (packet, end) in &self.packets {
            to(packet, &self.lines[first..*end]);
            first = *end;
        }
    }
}

/// A frame that can be rendered for any GPU.
pub(super) struct Subject {
    name: String,
    what: What,
}

enum What {
    Scene { scene: Box<Scene>, frame: u32, viewport: Viewport, samples: SampleTable },
    Family(Box<StressScene>),
}

pub(super) fn all(files: &[String], quick: bool) -> Result<Vec<Subject>, RunError> {
    let scenes = SCENES.iter().map(|name| (*name).to_owned()).chain(files.iter().cloned());
    let mut subjects: Vec<Subject> = scenes.map(|name| of_scene(&name, quick)).collect::<Result<_, _>>()?;
    for (name, value) in FAMILIES {
        subjects.push(of_family(name, value)?);
    }
    Ok(subjects)
}

fn of_scene(name: &str, quick: bool) -> Result<Subject, RunError> {
    let size = if quick { (320, 180) } else { (640, 360) };
    let overrides = Overrides { size: Some(size), samples: Some(8), ..Overrides::default() };
    let scene = workloads::load(name)?.with_overrides(&overrides)?;
    let frames = scene.settings().frames.clone();
    let frame = frames.start + (frames.end - frames.start) / 2;
    let viewport = Viewport::new(size.0, size.1).ok_or_else(|| RunError::Setting("size: none".to_owned()))?;
    let samples = SampleTable::low_discrepancy(8, 1, LensShape::Disk)?;
    let label = Path::new(name).file_name().map_or(name.into(), |file| file.to_string_lossy());
    Ok(Subject {
        name: label.into_owned(),
        what: What::Scene { scene: Box::new(scene), frame, viewport, samples },
    })
}

fn of_family(name: &'static str, value: f64) -> Result<Subject, RunError> {
    let failed = |message: String| RunError::Setting(format!("{name} at {value}: {message}"));
    let family = family(name).ok_or_else(|| failed("unknown family".to_owned()))?;
    let scene = family.scene(value, Size::QUICK, 1).map_err(|error| failed(error.to_string()))?;
    Ok(Subject { name: format!("{name} at {value}"), what: What::Family(Box::new(scene)) })
}

impl Subject {
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its packets as the pipeline of `gpu` emits them.
    pub fn stream(&self, gpu: &GpuSpec) -> Result<Packets, RunError> {
        let mut stream = Packets::default();
        self.render(gpu, |packet, lines| {
            stream.lines.extend_from_slice(lines);
            stream.packets.push((*packet, stream.lines.len()));
        })?;
        Ok(stream)
    }

    /// Renders the frame, every packet to `emit`.
    pub fn render(&self, gpu: &GpuSpec, emit: impl FnMut(&Packet, &[LineAccess])) -> Result<(), RunError> {
        match &self.what {
            What::Scene { scene, frame, viewport, samples } => {
                let frame = scene.frame(*frame)?;
                let draws = frame.draws(scene)?;
                self.draw(&frame.camera, (*viewport, samples), &draws, gpu, emit)
            }
            What::Family(scene) => {
                let failed = |error: String| RunError::Setting(format!("{}: {error}", self.name));
                let draws = [scene.draw(&Unshaded).map_err(|error| failed(error.to_string()))?];
                self.draw(&scene.camera, (scene.viewport, &scene.samples), &draws, gpu, emit)
            }
        }
    }

    fn draw(
        &self,
        camera: &Camera,
        (viewport, samples): (Viewport, &dyn SampleSource),
        draws: &[Draw<'_>],
        gpu: &GpuSpec,
        emit: impl FnMut(&Packet, &[LineAccess]),
    ) -> Result<(), RunError> {
        let settings = Settings { spec: &gpu.pipeline, viewport, samples, background: glam::Vec3::ZERO };
        RasterPass::new(camera, draws, &settings)
            .render(emit)
            .map_err(|error| RunError::Setting(format!("{}: {error}", self.name)))?;
        Ok(())
    }
}
