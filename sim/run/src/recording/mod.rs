//! Frames as drawn, with their packets in few bytes, to be timed on other machines.

mod file;

use std::sync::atomic::{AtomicUsize, Ordering};

use activity::{PacketStream, StreamWriter};
use output::progress::Progress;
use power_model::PowerModel;
use rayon::prelude::*;
use timing::{FrameClock, Level, Recorder, Timed};

pub use file::RecordedRun;

use crate::frame::{BIN_PS, DrawnFrame, draw, max_bins_per_frame};
use crate::{Plan, RunError, RunFrame};

/// Frames of a job as a pipeline drew them. What the pipeline does depends on neither time nor power, so the frames of any GPU
/// with this pipeline follow from their packets.
pub struct Recording {
    frames: Vec<RecordedFrame>,
}

/// A drawn frame with its packets.
struct RecordedFrame {
    frame: DrawnFrame,
    packets: PacketStream,
}

impl Recording {
    /// Draws the frames `numbers` of a plan; `None` if their packets take more than `max_bytes`.
    ///
    /// # Errors
    /// If a frame cannot be drawn.
    pub fn draw(
        plan: &Plan,
        numbers: &[u32],
        max_bytes: usize,
        progress: &Progress,
    ) -> Result<Option<Self>, RunError> {
        let bar = progress.bar("frames", numbers.len() as u64);
        let bytes = AtomicUsize::new(0);
        let record = |&number: &u32| {
            if bytes.load(Ordering::Relaxed) > max_bytes {
                return Ok(None);
            }
            let mut writer = StreamWriter::default();
            let (frame, _) = draw(plan, number, |packet, lines| writer.push(packet, lines))?;
            let packets = writer.finish();
            bytes.fetch_add(packets.bytes().len(), Ordering::Relaxed);
            bar.inc();
            Ok(Some(RecordedFrame { frame, packets }))
        };
        let frames: Vec<_> = numbers.par_iter().map(record).collect::<Result<_, RunError>>()?;
        let fits = bytes.into_inner() <= max_bytes;
        Ok(frames.into_iter().collect::<Option<_>>().filter(|_| fits).map(|frames| Self { frames }))
    }

    /// The frames with their times on the machine of `plan`, whose pipeline has to be that of the recording.
    ///
    /// # Errors
    /// If a frame cannot be timed.
    pub fn timed(&self, plan: &Plan) -> Result<TimedFrames<'_>, RunError> {
        let (level, max_bins) = (plan.options.timing, max_bins_per_frame(self.frames.len()));
        let time = |recorded: &RecordedFrame| {
            let mut clock = FrameClock::new(level, plan.gpu.machine()?, Recorder::new(BIN_PS, max_bins));
            recorded.packets.replay(|packet, lines| clock.push(packet, lines))?;
            Ok(clock.finish()?)
        };
        let timed = self.frames.par_iter().map(time).collect::<Result<_, RunError>>()?;
        Ok(TimedFrames { recording: self, timed, level })
    }
}

/// Frames of a recording with their times on a machine.
pub struct TimedFrames<'a> {
    recording: &'a Recording,
    timed: Vec<Timed>,
    level: Level,
}

impl TimedFrames<'_> {
    /// The frames with the power that `model` gives them, as from [`frames_of`](crate::frames_of).
    ///
    /// # Errors
    /// If a timeline contradicts itself, which is an error of the timing model.
    pub fn powered(&self, model: &PowerModel) -> Result<Vec<RunFrame>, RunError> {
        let frames = self.recording.frames.iter().zip(&self.timed);
        frames.map(|(recorded, timed)| recorded.frame.clone().powered(self.level, timed, model)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{RunOptions, frames_of};
    use workloads::Overrides;

    fn plan(gpu: &str, timing: Level) -> Plan {
        let overrides = Overrides { frames: Some(0..2), samples: Some(2), ..Overrides::default() };
        let (scene, gpu) = ("tiny".into(), gpu.into());
        Plan::resolve(RunOptions { scene, gpu, timing, overrides, ..RunOptions::default() }).unwrap()
    }

    fn recorded(plan: &Plan, max_bytes: usize) -> Option<Recording> {
        Recording::draw(plan, &[0, 1], max_bytes, &Progress::new(true)).unwrap()
    }

    #[test]
    fn recorded_frames_are_timed_as_those_that_are_drawn() {
        for level in Level::ALL {
            let plan = plan("reference", level);
            let direct = frames_of(&plan, &[0, 1], &Progress::new(true)).unwrap();
            let recording = recorded(&plan, usize::MAX).unwrap();
            let timed = recording.timed(&plan).unwrap().powered(&plan.model).unwrap();
            for (a, b) in direct.iter().zip(&timed) {
                let (seen, again) = (a.observed().unwrap(), b.observed().unwrap());
                assert_eq!(
                    (a.cycles, a.busy_ps, &a.power, &a.busy),
                    (b.cycles, b.busy_ps, &b.power, &b.busy)
                );
                assert_eq!(
                    (&seen.report, &seen.times, &seen.spans),
                    (&again.report, &again.times, &again.spans)
                );
                assert_eq!((&seen.stalls, &seen.accuracy), (&again.stalls, &again.accuracy));
            }
        }
    }

    #[test]
    fn packets_that_take_too_many_bytes_are_not_kept() {
        let plan = plan("reference", Level::Bound);
        let bytes: usize =
            recorded(&plan, usize::MAX).unwrap().frames.iter().map(|frame| frame.packets.bytes().len()).sum();
        assert!(recorded(&plan, bytes).is_some() && recorded(&plan, bytes - 1).is_none());
    }
}
