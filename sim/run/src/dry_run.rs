//! What a run would do, for `--dry-run`.

use serde::Serialize;
use warnings::Warning;

use super::{Expected, PacingChoice, Prepared, RunError, pairing};
use crate::Sampling;
use output::table::{grouped, si};

/// A run before it starts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DryRun {
    /// Name of the scene or of the workload.
    pub scene: String,
    /// Triangles of the scene; not known of a workload.
    pub triangles: Option<usize>,
    /// Width and height of the image.
    pub size: [u32; 2],
    /// Samples per pixel.
    pub samples: u32,
    /// The sample table.
    pub table: String,
    /// Frames a second of the scene's time.
    pub frame_rate_hz: f64,
    /// Open time of the shutter as a share of the frame period.
    pub shutter: f64,
    /// Radius of the lens, in scene units.
    pub lens_radius: f32,
    /// First frame, and one after the last.
    pub frames: [u32; 2],
    /// Frames that differ.
    pub distinct_frames: usize,
    /// Frames that are simulated, at least; the others repeat these or are predicted.
    pub simulated_frames: usize,
    /// Name of the GPU.
    pub gpu: String,
    /// Name of the platform.
    pub platform: String,
    /// Name of the energy table.
    pub energy_table: String,
    /// The level of timing.
    pub timing: &'static str,
    /// When the next frame starts.
    pub pacing: &'static str,
    /// Samples a second of the recorder, where that was asked for.
    pub trace_rate_hz: Option<f64>,
    /// What was chosen for `--accuracy` or `--budget`.
    pub chosen: Option<String>,
    /// Time and memory; not known of a workload.
    pub expected: Option<Expected>,
    /// Warnings that are known before the run.
    pub warnings: Vec<Warning>,
}

impl DryRun {
    /// Of a run that is ready.
    ///
    /// # Errors
    /// When the expected time cannot be found.
    pub fn new(prepared: &Prepared) -> Result<Self, RunError> {
        let (plan, settings) = (&prepared.plan, prepared.plan.work.settings());
        let distinct = prepared.distinct.numbers().len();
        let simulated = match plan.options.sampling {
            Sampling::Every => distinct,
            sampling => sampling.first(prepared.distinct.groups().len()).min(distinct),
        };
        let mut warnings = plan.work.warnings().to_vec();
        warnings.extend(pairing::check(&plan.options, &plan.gpu, &plan.platform, &plan.table));
        Ok(Self {
            scene: plan.work.name().to_owned(),
            triangles: plan.work.scene("").ok().map(workloads::Scene::triangle_count),
            size: [settings.width, settings.height],
            samples: settings.samples,
            table: settings.table.clone(),
            frame_rate_hz: settings.frame_rate_hz,
            shutter: settings.shutter,
            lens_radius: settings.lens_radius,
            frames: [settings.frames.start, settings.frames.end],
            distinct_frames: distinct,
            simulated_frames: simulated,
            gpu: plan.gpu.name.clone(),
            platform: plan.platform.name.clone(),
            energy_table: plan.table.name().to_owned(),
            timing: plan.options.timing.name(),
            pacing: match plan.options.pacing {
                PacingChoice::Vsync => "vsync",
                PacingChoice::Free => "free",
            },
            trace_rate_hz: plan.options.trace_rate_hz,
            chosen: prepared.choice.as_ref().map(super::Choice::line),
            expected: prepared.expected()?,
            warnings,
        })
    }

    /// What would be run, a row for each subject.
    pub fn rows(&self) -> Vec<(&'static str, String)> {
        let triangles =
            self.triangles.map_or(String::new(), |count| format!(", {} triangles", grouped(count as u64)));
        let [first, end] = self.frames;
        let lens =
            if self.lens_radius > 0.0 { format!("lens {}", self.lens_radius) } else { "pinhole".to_owned() };
        let rate = self
            .trace_rate_hz
            .map_or("50 kHz, more where frames are short".to_owned(), |rate_hz| si(rate_hz, "Hz"));
        let expected =
            self.expected.map_or("not known for a workload".to_owned(), |expected| expected.line());
        let mut rows = vec![
            ("scene", format!("{}{triangles}", self.scene)),
            (
                "image",
                format!(
                    "{}x{}, {} samples per pixel ({})",
                    self.size[0], self.size[1], self.samples, self.table
                ),
            ),
            ("camera", format!("{lens}, shutter {} of {}", self.shutter, si(1.0 / self.frame_rate_hz, "s"))),
            (
                "frames",
                format!(
                    "{} ({first}..{end}), of which {} differ and {} are simulated",
                    end - first,
                    self.distinct_frames,
                    self.simulated_frames
                ),
            ),
            ("GPU", format!("{}, platform {}, energy table {}", self.gpu, self.platform, self.energy_table)),
            ("timing", format!("{}, pacing {}", self.timing, self.pacing)),
            ("recorder", rate),
        ];
        rows.extend(self.chosen.clone().map(|line| ("chosen", line)));
        rows.push(("expected", expected));
        rows
    }
}
