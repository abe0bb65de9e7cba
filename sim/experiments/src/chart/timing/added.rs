//! What time costs on top of a run that only draws.

use cpu_time::ProcessTime;
use serde::Serialize;
use timing::Recorder;

use super::measure::{BIN_PS, MOST_BINS};
use super::subjects::Subject;
use run::GpuSpec;
use run::RunError;
use timing::{FrameClock, Level};

/// Each is measured so often, and the fastest counts.
const TIMES: usize = 3;

/// A frame drawn, and drawn with a clock. Seconds of the host's processor, all threads together.
#[derive(Clone, Debug, Serialize)]
pub struct AddedRow {
    /// The scene.
    pub scene: String,
    /// The GPU.
    pub gpu: String,
    /// The level.
    pub level: Level,
    /// To draw the frame, its packets to nobody.
    pub drawn_s: f64,
    /// To draw it, its packets to the clock of the level.
    pub timed_s: f64,
    /// What the clock adds.
    pub added_percent: f64,
}

/// A frame at the levels that are cheap.
pub(super) fn rows(subject: &Subject, gpu: &GpuSpec) -> Result<Vec<AddedRow>, RunError> {
    let drawn_s = fastest(|| subject.render(gpu, |_, _| {}))?;
    let row = |level| {
        let timed_s = fastest(|| {
            let mut clock = FrameClock::new(level, gpu.machine()?, Recorder::new(BIN_PS, MOST_BINS));
            subject.render(gpu, |packet, lines| clock.push(packet, lines))?;
            clock.finish()?;
            Ok(())
        })?;
        let added_percent = (timed_s / drawn_s - 1.0) * 100.0;
        let (scene, gpu) = (subject.name().to_owned(), gpu.name.clone());
        Ok(AddedRow { scene, gpu, level, drawn_s, timed_s, added_percent })
    };
    [Level::Packet, Level::Bound].into_iter().map(row).collect()
}

/// Processor seconds of the fastest of some times.
fn fastest(mut work: impl FnMut() -> Result<(), RunError>) -> Result<f64, RunError> {
    let mut least = f64::INFINITY;
    for _ in 0..TIMES {
        let started = ProcessTime::now();
        work()?;
        least = least.min(started.elapsed().as_secs_f64());
    }
    Ok(least)
}
