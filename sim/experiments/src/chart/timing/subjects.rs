//! What is timed: one frame of each scene.

use std::path::Path;

use activity::{LineAccess, Packet};
use pipeline::frame::render_with_heat;
use pipeline::sampling::SampleSource;
use pipeline::{Camera, Draw, LensShape, SampleTable, Settings, Viewport};
use workloads::stress::{Size, StressScene, family};
use workloads::visibility::Unshaded;
use workloads::{Overrides, Scene};

use run::GpuSpec;
use run::RunError;

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
    let family = family(name).ok_or_else(|| failed("there is no such family".to_owned()))?;
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
        render_with_heat(camera, draws, &settings, &[], emit)
            .map_err(|error| RunError::Setting(format!("{}: {error}", self.name)))?;
        Ok(())
    }
}
