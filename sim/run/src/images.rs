//! Images alone: runs without timing level, drawn by the visibility engine where it gives the same bytes.

use glam::Vec3;
use output::OutDir;
use output::dir::SUMMARY;
use output::progress::Progress;
use output::report::{FactRow, FileLink, Report};
use output::table::{counted, grouped};
use pipeline::Gpu;
use rayon::prelude::*;
use serde::Serialize;
use warnings::Warning;
use workloads::job::Drawn;
use workloads::scene::CameraUsed;

use crate::dry_run::is_rendering;
use crate::frame::{caught, image_name, write_image};
use crate::provenance::SCHEMA;
use crate::summary::SettingsSummary;
use crate::{Distinct, Host, Input, Plan, Prepared, Provenance, RunError, RunOptions, report, warn};

/// What a run of images alone has, said wherever its results are.
const HAS: &str = "images alone: nothing was counted or timed, so there are no cycles and no joules";

/// Contents of `summary.json` of a run of images alone.
#[derive(Clone, Debug, Serialize)]
pub struct ImagesSummary {
    /// Schema version.
    pub schema: u32,
    /// Version of the program.
    pub version: &'static str,
    /// Name of the scene.
    pub scene: String,
    /// Name of the GPU, whose shading the images have.
    pub gpu: String,
    /// Options of the run. Results depend on these and on the contents of `inputs`.
    pub request: RunOptions,
    /// Input files, sorted by name.
    pub inputs: Vec<Input>,
    /// Settings in use.
    pub settings: SettingsSummary,
    /// Camera of the first frame.
    pub camera: Option<CameraUsed>,
    /// Images of all frames, in order.
    pub images: Vec<ImageRow>,
    /// Warnings.
    pub warnings: Vec<Warning>,
    /// Program, command line and host. All other keys are equal on every machine.
    pub host: Host,
}

/// Image of a frame.
#[derive(Clone, Debug, Serialize)]
pub struct ImageRow {
    /// Frame number in the scene.
    pub frame: u32,
    /// Image file.
    pub image: String,
}

impl ImagesSummary {
    /// Lines for the terminal.
    pub fn lines(&self) -> Vec<String> {
        let SettingsSummary { width, height, samples, frames, triangles, .. } = &self.settings;
        let drawn = format!(
            "{}, {width}x{height}, {} per pixel, {}, {}",
            self.scene,
            counted(*samples as usize, "sample"),
            counted(*frames as usize, "frame"),
            counted(*triangles, "triangle")
        );
        vec![drawn, HAS.to_owned()]
    }
}

/// Checks that a job is a rendering of a scene: what others find are counts.
pub(super) fn check_job(plan: &Plan) -> Result<(), RunError> {
    if is_rendering(plan) {
        return Ok(());
    }
    Err(RunError::Setting(format!(
        "--timing none: it draws scenes, and `{}` is a workload, whose results are counts; take another timing level",
        plan.name
    )))
}

/// A frame as drawn.
struct Frame {
    number: u32,
    triangles: usize,
    warnings: Vec<Warning>,
    /// Linear image, if it is kept for the report.
    picture: Option<Vec<Vec3>>,
}

impl Prepared {
    /// Draws the images and writes the results of a run of images alone into `dir`.
    ///
    /// # Errors
    /// As [`super::prepare`]. Earlier results in `dir` then stay unchanged.
    pub fn draw(self, mut dir: OutDir, progress: &Progress) -> Result<ImagesSummary, RunError> {
        let Self { plan, provenance, distinct, .. } = self;
        let numbers = distinct.numbers();
        let bar = progress.bar("frames", numbers.len() as u64);
        let draw = |group: usize| {
            let frame = caught(numbers[group], || frame(&plan, &distinct, group, &dir))?;
            bar.inc();
            Ok(frame)
        };
        let frames = (0..numbers.len()).into_par_iter().map(draw).collect::<Result<Vec<_>, RunError>>()?;
        let summary = summary(&plan, provenance, &frames);
        for changed in &plan.changed {
            dir.write_file(changed.file.result(), |out| Ok(out.write_all(changed.text.as_bytes())?))?;
        }
        page(&plan, &summary, frames)?.write(&dir, "report.html")?;
        dir.write_json(SUMMARY, &summary)?;
        dir.publish()?;
        Ok(summary)
    }
}

/// Draws the frame of a group, and writes the image of each of its members.
fn frame(plan: &Plan, distinct: &Distinct, group: usize, dir: &OutDir) -> Result<Frame, RunError> {
    let numbers = distinct.numbers();
    let number = numbers[group];
    let mut gpu = Gpu::uncounted(&plan.gpu.pipeline).map_err(RunError::setting)?;
    let Drawn { image, warnings, .. } = plan.job.frame(number, &mut gpu).map_err(RunError::on(&plan.gpu))?;
    distinct.members(group).try_for_each(|number| write_image(plan, dir, number, &image))?;
    let shown = [numbers[0], numbers[numbers.len() / 2], numbers[numbers.len() - 1]];
    let triangles = gpu.finish().triangles();
    Ok(Frame { number, triangles, warnings, picture: shown.contains(&number).then_some(image) })
}

fn summary(plan: &Plan, provenance: Provenance, frames: &[Frame]) -> ImagesSummary {
    let Provenance { request, inputs, camera, host } = provenance;
    let image = |frame: u32| ImageRow { frame, image: format!("{}.png", image_name(frame)) };
    ImagesSummary {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        scene: plan.name.clone(),
        gpu: plan.gpu.name.clone(),
        request,
        inputs,
        settings: SettingsSummary::new(plan, frames.first().map_or(0, |frame| frame.triangles)),
        camera,
        images: plan.job.settings().frames.clone().map(image).collect(),
        warnings: warn::of_images(plan, frames.iter().map(|frame| (frame.number, &frame.warnings[..]))),
        host,
    }
}

/// The report.
fn page(plan: &Plan, summary: &ImagesSummary, frames: Vec<Frame>) -> Result<Report<'static>, RunError> {
    let pictures: Vec<_> =
        frames.into_iter().filter_map(|frame| Some((frame.number, frame.picture?))).collect();
    let file = |(path, what): (&str, &str)| FileLink { path: path.to_owned(), what: what.to_owned() };
    let files = [
        ("summary.json", "settings and images of the run, for scripts"),
        ("images/", "every frame"),
        ("manifest.json", "these files with their sizes and hashes"),
    ];
    Ok(Report {
        title: plan.name.clone().into(),
        facts: vec![
            FactRow::new("scene", plan.name.clone()),
            FactRow::new("triangles", grouped(summary.settings.triangles as u64)),
            FactRow::new("modelled", HAS),
            FactRow::new("shaded as on", format!("{}: {}", plan.gpu.name, plan.gpu.doc)),
            FactRow::new("Quintile", summary.version),
        ],
        warnings: report::warnings(&summary.warnings),
        images: report::images(plan, &pictures)?,
        settings: report::view(plan, &summary.settings, summary.camera.as_ref()),
        inputs: report::inputs(&summary.inputs),
        files: files.map(file).into(),
        host: report::host(&summary.host),
        ..Report::default()
    })
}
