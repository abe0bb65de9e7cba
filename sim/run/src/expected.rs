//! How long a run will take and how much memory it will need, from one frame drawn small before the run starts.

use cpu_time::ProcessTime;
use pipeline::frame::render_with_heat;
use pipeline::{Draw, Settings, Viewport};
use serde::Serialize;
use timing::Recorder;
use workloads::{Frame, FrameMesh, Scene};

use super::limits::BYTES_PER_SAMPLE;
use super::regime::Regime;
use super::{Distinct, Plan, RunError, Work, frame};
use crate::Sampling;
use timing::{FrameClock, Level};

/// What a run is expected to take on this machine. It is no result: nothing of a run depends on it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Expected {
    /// Seconds by the clock, from now to the last file; good to a factor of two where nothing else runs on the machine.
    pub host_s: f64,
    /// Bytes of memory.
    pub memory_bytes: u64,
}

/// Samples of the smaller of two images that the probe draws; the larger one has four times as many.
const PROBE_SAMPLES: f64 = 30e3;
/// Triangles that the probe draws of a frame, evenly chosen.
const PROBE_TRIANGLES: usize = 20_000;
/// Seconds for plots, report and other files.
const FILES_S: f64 = 0.3;
/// Seconds for recording, analysing and writing a sample of the trace, and its bytes; see `command.md` for the measurement.
const TRACE_SAMPLE_S: f64 = 0.9e-6;
const TRACE_SAMPLE_BYTES: f64 = 70.0;
/// Previews of a run take about as long as this share of its frames.
const PREVIEWS: f64 = 0.05;
/// Bytes of the program with a small scene, and of a triangle of the scene.
const PROGRAM_BYTES: u64 = 30_000_000;
const TRIANGLE_BYTES: u64 = 150;

impl Expected {
    /// What running `plan` would take on the threads of the current pool; nothing for a workload, whose passes cannot be
    /// drawn small.
    ///
    /// # Errors
    /// When a frame cannot be made or timed.
    pub(super) fn new(plan: &Plan, distinct: &Distinct) -> Result<Option<Self>, RunError> {
        let Work::Scene(scene) = &plan.work else { return Ok(None) };
        let (all, differ) = (distinct.groups().len(), distinct.numbers().len());
        let (whole, previews) = match plan.options.sampling {
            Sampling::Every => (differ, 0.0),
            sampling => (sampling.first(all).min(differ), PREVIEWS * differ as f64),
        };
        let probe = Probe::new(plan, scene, distinct.numbers()[differ / 2])?;
        let mut frames_s = probe.frame_s(plan.options.timing)? * (whole as f64 + previews);
        if plan.options.verify {
            frames_s += probe.frame_s(Level::Stepped)? * differ as f64;
        }
        let threads = rayon::current_num_threads();
        let trace_samples = plan.size().trace_samples();
        let samples = plan.pixels() * u64::from(plan.samples.per_pixel());
        let memory_bytes = PROGRAM_BYTES
            + TRIANGLE_BYTES * scene.triangle_count() as u64
            + BYTES_PER_SAMPLE * samples * threads.min(differ) as u64
            + (TRACE_SAMPLE_BYTES * trace_samples) as u64;
        let host_s = FILES_S + TRACE_SAMPLE_S * trace_samples + frames_s / threads as f64;
        Ok(Some(Self { host_s, memory_bytes }))
    }

    /// Time and memory in words.
    pub fn line(&self) -> String {
        format!("about {}, {:.0} MB of memory", duration(self.host_s), self.memory_bytes as f64 / 1e6)
    }
}

/// A duration as people say it, to two digits.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1.0 => "a second".to_owned(),
        s if s < 100.0 => format!("{s:.0} s"),
        s if s < 6000.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.0} h", s / 3600.0),
    }
}

/// A frame with some of its triangles, to be drawn small.
struct Probe<'a> {
    plan: &'a Plan,
    scene: &'a Scene,
    frame: Frame,
    /// Triangles of the frame for one that is drawn.
    triangle_ratio: f64,
    /// Processor seconds for making the frame.
    made_s: f64,
}

impl<'a> Probe<'a> {
    fn new(plan: &'a Plan, scene: &'a Scene, number: u32) -> Result<Self, RunError> {
        let started = ProcessTime::now();
        let mut frame = scene.frame(number)?;
        let made_s = started.elapsed().as_secs_f64();
        let step = frame.triangle_count().div_ceil(PROBE_TRIANGLES).max(1);
        let all = frame.triangle_count();
        frame.meshes.iter_mut().for_each(|mesh| thin_out(mesh, step));
        let triangle_ratio = all as f64 / frame.triangle_count().max(1) as f64;
        Ok(Self { plan, scene, frame, triangle_ratio, made_s })
    }

    /// Processor seconds for a frame of the run at `level`: `a` for its triangles and `b` for a pixel, from two sizes.
    fn frame_s(&self, level: Level) -> Result<f64, RunError> {
        let samples = self.plan.pixels() as f64 * f64::from(self.plan.samples.per_pixel());
        let by = (samples / PROBE_SAMPLES).sqrt().max(1.0);
        let [small, large] = [self.drawn(by, level)?, self.drawn((0.5 * by).max(1.0), level)?];
        let a_and_b = |[(x0, y0), (x1, y1)]: [(f64, f64); 2]| {
            let b = if x1 > x0 { ((y1 - y0) / (x1 - x0)).clamp(0.0, y1 / x1) } else { y1 / x1 };
            (y1 - b * x1, b)
        };
        let (a, b) = a_and_b([small, large]);
        Ok(self.made_s + self.triangle_ratio * (a + b * self.plan.pixels() as f64))
    }

    /// Pixels and processor seconds of the frame, drawn `by` times smaller along each axis.
    fn drawn(&self, by: f64, level: Level) -> Result<(f64, f64), RunError> {
        let plan = self.plan;
        let side = |side: u32| ((f64::from(side) / by).ceil() as u32).max(1);
        let viewport = Viewport::new(side(plan.viewport.width()), side(plan.viewport.height()))
            .ok_or_else(|| RunError::Setting("size of the probe".to_owned()))?;
        let started = ProcessTime::now();
        let draws: Vec<Draw<'_>> = self.frame.draws(self.scene)?;
        let background = self.scene.background();
        let settings = Settings { spec: &plan.gpu.pipeline, viewport, samples: &*plan.samples, background };
        let recorder = Recorder::new(frame::BIN_PS, frame::FEWEST_BINS);
        let mut clock = FrameClock::new(level, plan.gpu.machine()?, recorder);
        let emit = |packet: &_, lines: &_| clock.push(packet, lines);
        render_with_heat(&self.frame.camera, &draws, &settings, &[], emit).map_err(RunError::setting)?;
        clock.finish()?;
        Regime::of(&self.frame.camera, &draws, viewport, plan.samples.per_pixel());
        Ok((viewport.pixels() as f64, started.elapsed().as_secs_f64()))
    }
}

/// Leaves one in `step` of the triangles.
fn thin_out(mesh: &mut FrameMesh, step: usize) {
    if step > 1 {
        mesh.triangles = mesh.triangles.iter().copied().step_by(step).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_as_people_say_them() {
        assert_eq!(
            [0.4, 12.4, 99.0, 150.0, 5900.0, 7200.0].map(duration),
            ["a second", "12 s", "99 s", "2 min", "98 min", "2 h"]
        );
    }
}
