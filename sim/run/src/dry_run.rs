//! `--dry-run`: what a run would do, and the time and memory that it is expected to take.

use std::cell::Cell;

use cpu_time::ProcessTime;
use output::table::{counted, digits, grouped, si};
use pipeline::Gpu;
use power_model::UncertainValue;
use serde::Serialize;
use timing::{CheckedClock, Level, Recorder};
use warnings::Warning;
use workloads::Scene;
use workloads::job::Reduction;

use crate::plan::BYTES_PER_SAMPLE;
use crate::{Choice, Distinct, Plan, Prepared, RunError, Sampling, area_mm2, frame, heat};

/// Description of a run before it starts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DryRun {
    /// Name of the scene or of the workload.
    pub scene: String,
    /// Triangles of the scene; `None` for a workload without one.
    pub triangles: Option<usize>,
    /// Width and height of the image.
    pub size: [u32; 2],
    /// Samples per pixel.
    pub samples: u32,
    /// The sample table.
    pub table: String,
    /// Frames per second of the scene's time.
    pub frame_rate_hz: f64,
    /// Open time of the shutter as a share of the frame period.
    pub shutter: f64,
    /// Radius of the lens, in scene units.
    pub lens_radius: f32,
    /// First frame, and one after the last.
    pub frames: [u32; 2],
    /// Number of distinct frames.
    pub distinct_frames: usize,
    /// Lower limit of the number of simulated frames; the others are repeated or predicted.
    pub simulated_frames: usize,
    /// Name of the GPU.
    pub gpu: String,
    /// How frames are counted and timed; `None` for images alone.
    #[serde(flatten)]
    pub timed: Option<DryTimed>,
    /// Warnings found before the run.
    pub warnings: Vec<Warning>,
}

/// How the frames of a run are to be counted and timed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DryTimed {
    /// Name of the platform.
    pub platform: String,
    /// Name of the energy table.
    pub energy_table: String,
    /// Area of the GPU in square millimetres.
    pub area_mm2: UncertainValue,
    /// Timing level.
    pub timing: &'static str,
    /// Pacing of frames.
    pub pacing: &'static str,
    /// Samples per second of the recorder, if given.
    pub trace_rate_hz: Option<f64>,
    /// Choice for `--accuracy` or `--budget`.
    pub chosen: Option<String>,
    /// Expected time and memory.
    pub expected: Expected,
}

impl DryRun {
    /// Describes a prepared run.
    ///
    /// # Errors
    /// If the expected time cannot be measured.
    pub fn new(prepared: &Prepared) -> Result<Self, RunError> {
        let (plan, settings) = (&prepared.plan, prepared.plan.job.settings());
        let distinct = prepared.distinct.numbers().len();
        let simulated = match plan.options.sampling {
            Sampling::Every => distinct,
            sampling => sampling.first(prepared.distinct.groups().len()).min(distinct),
        };
        let mut warnings = plan.job.warnings().to_vec();
        warnings.extend(plan.pairing.clone().filter(|_| plan.options.timing.is_some()));
        Ok(Self {
            scene: plan.name.clone(),
            triangles: plan.job.scene().map(Scene::triangle_count),
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
            timed: plan.options.timing.map(|level| DryTimed::new(prepared, level)).transpose()?,
            warnings,
        })
    }

    /// Description as rows of name and value.
    pub fn rows(&self) -> Vec<(&'static str, String)> {
        let triangles =
            self.triangles.map_or(String::new(), |count| format!(", {} triangles", grouped(count as u64)));
        let [first, end] = self.frames;
        let lens =
            if self.lens_radius > 0.0 { format!("lens {}", self.lens_radius) } else { "pinhole".to_owned() };
        let mut rows = vec![
            ("scene", format!("{}{triangles}", self.scene)),
            (
                "image",
                format!(
                    "{}x{}, {} per pixel ({})",
                    self.size[0],
                    self.size[1],
                    counted(self.samples as usize, "sample"),
                    self.table
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
        ];
        match &self.timed {
            Some(timed) => rows.extend(timed.rows(&self.gpu)),
            None => rows.extend([("GPU", self.gpu.clone()), ("timing", "none: images alone".to_owned())]),
        }
        rows
    }
}

impl DryTimed {
    fn new(prepared: &Prepared, level: Level) -> Result<Self, RunError> {
        let plan = &prepared.plan;
        Ok(Self {
            platform: plan.platform.name.clone(),
            energy_table: plan.table.name().to_owned(),
            area_mm2: area_mm2(plan),
            timing: level.name(),
            pacing: plan.options.pacing.name(),
            trace_rate_hz: plan.options.trace_rate_hz,
            chosen: prepared.choice.as_ref().map(Choice::line),
            expected: prepared.expected()?,
        })
    }

    /// Its rows, of a run on `gpu`.
    fn rows(&self, gpu: &str) -> Vec<(&'static str, String)> {
        let rate = self
            .trace_rate_hz
            .map_or("50 kHz, more where frames are short".to_owned(), |rate_hz| si(rate_hz, "Hz"));
        let mut rows = vec![
            ("GPU", format!("{gpu}, platform {}, energy table {}", self.platform, self.energy_table)),
            ("area", area_text(&self.area_mm2)),
            ("timing", format!("{}, pacing {}", self.timing, self.pacing)),
            ("recorder", rate),
        ];
        rows.extend(self.chosen.clone().map(|line| ("chosen", line)));
        rows.push(("expected", self.expected.line()));
        rows
    }
}

/// Expected time and memory of a run on this host. Results do not depend on them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Expected {
    /// Wall-clock seconds to the last file; accurate to a factor of two on an otherwise idle host.
    pub host_s: f64,
    /// Whether it takes that at least: a frame of a workload was not drawn to its end to find out.
    pub at_least: bool,
    /// Memory in bytes; `None` for a workload, whose passes keep surfaces of their own.
    pub memory_bytes: Option<u64>,
}

/// Samples of the smaller of two probe images; the larger one has four times as many.
const PROBE_SAMPLES: f64 = 30e3;
/// Largest number of triangles of a probe image, chosen at equal steps.
const MAX_PROBE_TRIANGLES: usize = 20_000;
/// Time to write plots, report and other files, in seconds.
const FILES_S: f64 = 0.3;
/// Time to record, analyse and write one trace sample, in seconds. `command.md` has the measurement.
const TRACE_SAMPLE_S: f64 = 0.9e-6;
/// Memory of one trace sample in bytes.
const TRACE_SAMPLE_BYTES: f64 = 70.0;
/// Time of a preview over the time of a frame.
const PREVIEW_TIME_RATIO: f64 = 0.05;
/// Least number of differing frames of a workload from which on the estimate is worth its cost.
pub(super) const MIN_WORKLOAD_FRAMES: usize = 4;
/// Processor time after which a frame is not drawn further to find out how long it takes, in seconds.
const MAX_PROBE_S: f64 = 10.0;
/// Packets from one look at the time to the next.
const PACKETS_PER_LOOK: u32 = 1024;
/// Memory of the program with a small scene, in bytes.
const PROGRAM_BYTES: u64 = 30_000_000;
/// Memory of one triangle of the scene in bytes.
const TRIANGLE_BYTES: u64 = 150;

/// Whether a frame is one rendering of a scene. Passes of other jobs keep surfaces, and draw all triangles,
/// of their own.
pub(super) fn is_rendering(plan: &Plan) -> bool {
    let settings = plan.job.settings();
    let size = [settings.width, settings.height];
    plan.job.reduced(&Reduction { size, samples: None, max_triangles: None }).is_some()
}

impl Expected {
    /// Expected time and memory of `plan` on the threads of the current pool.
    ///
    /// # Errors
    /// If a frame cannot be rendered or timed.
    pub(super) fn new(plan: &Plan, distinct: &Distinct) -> Result<Self, RunError> {
        let (all, differ) = (distinct.groups().len(), distinct.numbers().len());
        let (whole, previews) = match plan.options.sampling {
            Sampling::Every => (differ, 0.0),
            sampling => (sampling.first(all).min(differ), PREVIEW_TIME_RATIO * differ as f64),
        };
        let has_heat_of_passes = plan.options.heat.iter().any(|request| request.pass.is_some());
        let number = distinct.numbers()[if has_heat_of_passes { 0 } else { differ / 2 }];
        let probe = Probe { plan, number };
        let (frame_s, mut at_least) = probe.frame_s(plan.options.level())?;
        let mut frames_s = frame_s * (whole as f64 + previews);
        if plan.options.verify {
            let (stepped_s, is_least) = probe.frame_s(Level::Stepped)?;
            frames_s += stepped_s * differ as f64;
            at_least |= is_least;
        }
        let threads = rayon::current_num_threads();
        let trace_samples = plan.size().trace_samples();
        // Tiles of a scene are drawn side by side, passes of a workload one after another.
        let (workers, memory_bytes) = match plan.job.scene().filter(|_| is_rendering(plan)) {
            Some(scene) => (threads, Some(memory_bytes(plan, scene, threads.min(differ)))),
            None => (threads.min(differ), None),
        };
        let host_s = FILES_S + TRACE_SAMPLE_S * trace_samples + frames_s / workers as f64;
        Ok(Self { host_s, at_least, memory_bytes })
    }

    /// Time and memory as text.
    pub fn line(&self) -> String {
        let memory = self.memory_bytes.map(|bytes| format!(", {:.0} MB of memory", bytes as f64 / 1e6));
        let how = if self.at_least { "at least" } else { "about" };
        format!("{how} {}{}", duration(self.host_s), memory.unwrap_or_default())
    }
}

/// Area as text.
pub(super) fn area_text(area_mm2: &UncertainValue) -> String {
    let [low, nominal, high] = [area_mm2.low, area_mm2.nominal, area_mm2.high].map(digits);
    format!("{nominal} mm2 ({low} to {high}), without interfaces")
}

/// Duration as text, to two digits.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1.0 => "a second".to_owned(),
        s if s < 100.0 => format!("{s:.0} s"),
        s if s < 6000.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.0} h", s / 3600.0),
    }
}

/// Memory in bytes of a run that draws `frames` frames of `scene` at once.
fn memory_bytes(plan: &Plan, scene: &Scene, frames: usize) -> u64 {
    let samples = plan.pixels() * u64::from(plan.per_pixel());
    PROGRAM_BYTES
        + TRIANGLE_BYTES * scene.triangle_count() as u64
        + BYTES_PER_SAMPLE * samples * frames as u64
        + (TRACE_SAMPLE_BYTES * plan.size().trace_samples()) as u64
}

/// A frame of the run, to be rendered at reduced sizes.
struct Probe<'a> {
    plan: &'a Plan,
    number: u32,
}

/// A frame rendered at a reduced size, in processor seconds.
#[derive(Clone, Copy, Debug)]
struct Rendered {
    pixels: f64,
    /// To make the frame.
    made_s: f64,
    /// To draw and time it with all its triangles.
    drawn_s: f64,
    /// Whether it was drawn to its end.
    is_whole: bool,
}

impl Probe<'_> {
    /// CPU seconds for a frame of the run at `level`: a line `a + b pixels` through the times of two sizes. And whether
    /// it takes that at least, as it was not drawn to its end.
    fn frame_s(&self, level: Level) -> Result<(f64, bool), RunError> {
        let samples = self.plan.pixels() as f64 * f64::from(self.plan.per_pixel());
        let by = (samples / PROBE_SAMPLES).sqrt().max(1.0);
        let small = self.rendered(by, level)?;
        if !small.is_whole {
            return Ok((small.made_s + small.drawn_s, true));
        }
        let large = if by > 1.0 { self.rendered((0.5 * by).max(1.0), level)? } else { small };
        let (x0, x1, y1) = (small.pixels, large.pixels, large.drawn_s);
        let b = if x1 > x0 { ((y1 - small.drawn_s) / (x1 - x0)).clamp(0.0, y1 / x1) } else { y1 / x1 };
        let frame_s = small.made_s.min(large.made_s) + y1 + b * (self.plan.pixels() as f64 - x1);
        Ok((frame_s, !large.is_whole))
    }

    /// The frame, rendered `by` times smaller along each axis.
    fn rendered(&self, by: f64, level: Level) -> Result<Rendered, RunError> {
        let Self { plan, number } = *self;
        let side = |side: u32| ((f64::from(side) / by).ceil() as u32).max(1);
        let size = [side(plan.viewport.width()), side(plan.viewport.height())];
        let to = Reduction { size, samples: None, max_triangles: Some(MAX_PROBE_TRIANGLES) };
        let job = plan.reduced(&to)?;
        let started = ProcessTime::now();
        let ready = job.prepare(number)?;
        let made_s = started.elapsed().as_secs_f64();
        let recorder = Recorder::new(crate::BIN_PS, frame::MIN_FRAME_BINS);
        let mut clock = CheckedClock::new(level, plan.gpu.machine()?, recorder);
        let (stop, mut packets) = (Cell::new(false), 0_u32);
        let emit = |packet: &_, lines: &_| {
            clock.push(packet, lines);
            packets += 1;
            let is_look = packets.is_multiple_of(PACKETS_PER_LOOK);
            stop.set(stop.get() || is_look && started.elapsed().as_secs_f64() > made_s + MAX_PROBE_S);
        };
        let mut gpu = Gpu::new(&plan.gpu.pipeline, emit)?.stopping(&stop);
        let drawn = ready.draw(&mut gpu);
        let is_whole = !stop.get();
        if is_whole {
            drawn.map_err(RunError::on(&plan.gpu))?;
        }
        let report = gpu.finish();
        if is_whole {
            heat::check_passes(&plan.options.heat, number, &report)?;
        }
        let triangles = report.triangles();
        clock.finish()?;
        let all = plan.job.scene().filter(|_| is_rendering(plan)).map_or(triangles, Scene::triangle_count);
        let drawn_s = (started.elapsed().as_secs_f64() - made_s) * all as f64 / triangles.max(1) as f64;
        Ok(Rendered { pixels: f64::from(size[0]) * f64::from(size[1]), made_s, drawn_s, is_whole })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_two_digits_and_a_unit() {
        assert_eq!(
            [0.4, 12.4, 99.0, 150.0, 5900.0, 7200.0].map(duration),
            ["a second", "12 s", "99 s", "2 min", "98 min", "2 h"]
        );
    }
}
