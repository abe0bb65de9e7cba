//! What the timing chart times: one frame of each scene and workload, and animations at every level, drawn
//! and timed as in a run.

use std::path::Path;

use activity::{LineAccess, Packet, PacketBuffer};
use cpu_time::ProcessTime;
use glam::Vec3;
use output::terminal::Progress;
use pipeline::{Gpu, RasterPass, Settings};
use run::{
    Distinct, Forecast, GpuSpec, Plan, Previews, RunError, RunFrame, RunOptions, Sampling, Signatures,
    frames_of,
};
use serde::Serialize;
use timing::Level;
use workloads::job::{JobRequest, OptionSource, Reduction};
use workloads::stress::{Size, StressScene};
use workloads::visibility::Unshaded;
use workloads::{Job, Overrides, catalog};

use crate::stress::family_named;

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
    if Distinct::new(&*plan(scene, gpu, extent, Level::Packet)?.job)?.numbers().len() < numbers.len() {
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
    Plan::resolve(RunOptions { scene, gpu, overrides, timing: Some(level), ..RunOptions::default() })
}

/// Seed, frames simulated, cycles of all frames and host time of some choices of representatives. Each costs
/// the previews and its share of simulating all frames.
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
        Signatures::new(&previews.frames, previews.pilot, &all.frames[previews.pilot], all.plan.model());
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
/// Families of the failure catalogue, each at one value: large and tiny triangles, lens and motion, behind
/// the camera.
const FAMILIES: [(&str, f64); 4] =
    [("lens-and-motion", 2.0), ("micro", 1.0), ("behind", 0.0), ("diagonals", 128.0)];

/// A frame that can be rendered for any GPU.
pub(in crate::chart) struct Subject {
    name: String,
    pub kind: SubjectKind,
    what: What,
}

/// Kinds of frames in the chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SubjectKind {
    /// A rendering of a scene.
    Scene,
    /// A family of the failure catalogue.
    Family,
    /// The passes of a workload.
    Workload,
}

enum What {
    Job { job: Box<dyn Job>, frame: u32 },
    Family(Box<StressScene>),
}

/// A workload with other passes than by default.
struct Variant {
    workload: &'static str,
    /// What is added to the name of the workload.
    label: &'static str,
    set: &'static [(&'static str, &'static str)],
    /// Samples of a pixel, where passes depend on their number.
    samples: Option<u32>,
}

impl Variant {
    const fn new(
        workload: &'static str,
        label: &'static str,
        set: &'static [(&'static str, &'static str)],
    ) -> Self {
        Self { workload, label, set, samples: None }
    }
}

/// Options that bring passes of other types.
const VARIANTS: [Variant; 15] = [
    Variant::new("multiview", "view_by_view", &[("view_by_view", "true")]),
    Variant::new("soft-shadows", "accumulate", &[("accumulate", "true")]),
    Variant::new("compute", "mip_chain", &[("kernel", "mip_chain")]),
    Variant::new("compute", "reduction", &[("kernel", "reduction")]),
    Variant::new("compute", "histogram", &[("kernel", "histogram"), ("bins", "128")]),
    Variant::new("deferred", "forward", &[("method", "forward")]),
    Variant::new("deferred", "volumes", &[("lighting", "volumes")]),
    Variant { samples: Some(4), ..Variant::new("deferred", "4 samples resolved", &[]) },
    Variant { samples: Some(4), ..Variant::new("deferred", "volumes, resolved", &[("lighting", "volumes")]) },
    Variant::new("ccd", "narrow", &[("narrow", "true"), ("balls", "4")]),
    Variant::new("sampling", "noise", &[("points", "noise")]),
    Variant::new("sampling", "volume", &[("points", "volume")]),
    Variant::new("sampling", "volume in 5D", &[("points", "volume"), ("dimensions", "5")]),
    Variant::new("occlusion", "samples", &[("query", "samples")]),
    Variant::new("occlusion", "any", &[("query", "any")]),
];
/// Widths that images of workloads are reduced to in pixels, at most by the factor [`MAX_REDUCTION`].
const WORKLOAD_PX: [u32; 2] = [128, 256];
const MAX_REDUCTION: u32 = 8;

pub(in crate::chart) fn all(files: &[String], quick: bool) -> Result<Vec<Subject>, RunError> {
    let scenes = SCENES.iter().map(|name| (*name).to_owned()).chain(files.iter().cloned());
    let mut subjects: Vec<Subject> = scenes.map(|name| of_scene(&name, quick)).collect::<Result<_, _>>()?;
    for (name, value) in FAMILIES {
        subjects.push(of_family(name, value)?);
    }
    for (name, _) in catalog::names() {
        subjects.push(of_workload(&Variant::new(name, "", &[]), quick)?);
    }
    for variant in &VARIANTS {
        subjects.push(of_workload(variant, quick)?);
    }
    Ok(subjects)
}

fn of_scene(name: &str, quick: bool) -> Result<Subject, RunError> {
    let size = if quick { (320, 180) } else { (640, 360) };
    let overrides = Overrides { size: Some(size), samples: Some(8), ..Overrides::default() };
    let (_, job) = catalog::load(Path::new(name), &OptionSource::default(), &request(&overrides))?;
    let label = Path::new(name).file_name().map_or(name.into(), |file| file.to_string_lossy());
    Ok(Subject { name: label.into_owned(), kind: SubjectKind::Scene, what: middle_frame(job) })
}

fn of_workload(variant: &Variant, quick: bool) -> Result<Subject, RunError> {
    let Variant { workload, label, set, samples } = *variant;
    let set = set.iter().map(|(option, value)| ((*option).to_owned(), (*value).to_owned())).collect();
    let options = OptionSource { file: None, set };
    let overrides = Overrides { samples, ..Overrides::default() };
    let (_, whole) = catalog::load(Path::new(workload), &options, &request(&overrides))?;
    let to = Reduction::to_width(whole.settings(), WORKLOAD_PX[usize::from(!quick)], MAX_REDUCTION);
    let job = catalog::remade(workload, &options, &request(&overrides), &to)?;
    let name = format!("{workload} {label}").trim_end().to_owned();
    Ok(Subject { name, kind: SubjectKind::Workload, what: middle_frame(job) })
}

fn request(overrides: &Overrides) -> JobRequest<'_> {
    JobRequest { overrides, seed: 1 }
}

fn middle_frame(job: Box<dyn Job>) -> What {
    let frames = job.settings().frames.clone();
    What::Job { job, frame: frames.start + (frames.end - frames.start) / 2 }
}

fn of_family(name: &'static str, value: f64) -> Result<Subject, RunError> {
    let family = family_named(name)?;
    let name = format!("{name} at {value}");
    let scene = family.scene(value, Size::QUICK, 1).map_err(|error| RunError::invalid(&name, error))?;
    let what = What::Family(Box::new(scene));
    Ok(Subject { name, kind: SubjectKind::Family, what })
}

impl Subject {
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Packets of the subject as the pipeline of `gpu` emits them.
    pub fn stream(&self, gpu: &GpuSpec) -> Result<PacketBuffer, RunError> {
        let mut stream = PacketBuffer::default();
        self.render(gpu, |packet, lines| stream.push(packet, lines))?;
        Ok(stream)
    }

    /// Whether the GPU has the units that the frame needs.
    pub fn runs_on(&self, gpu: &GpuSpec) -> bool {
        !self.name.starts_with("compute") || gpu.pipeline.compute.is_some()
    }

    /// Renders the frame, every packet to `emit`.
    pub fn render(&self, gpu: &GpuSpec, emit: impl FnMut(&Packet, &[LineAccess])) -> Result<(), RunError> {
        let mut on = Gpu::new(&gpu.pipeline, emit).map_err(|error| RunError::invalid(&self.name, error))?;
        match &self.what {
            What::Job { job, frame } => drop(job.frame(*frame, &mut on)?),
            What::Family(scene) => {
                let draws = [scene.draw(&Unshaded).map_err(|error| RunError::invalid(&self.name, error))?];
                let (viewport, samples) = (scene.viewport, &scene.samples);
                let settings = Settings { spec: &gpu.pipeline, viewport, samples, background: Vec3::ZERO };
                let pass = RasterPass::new(&scene.camera, &draws, &settings);
                on.draw(&pass).map_err(|error| RunError::invalid(&self.name, error))?;
            }
        }
        on.finish();
        Ok(())
    }
}
