//! Frames as drawn, with their packets in few bytes, to be timed on other machines.

mod file;

use std::sync::atomic::{AtomicUsize, Ordering};

use activity::{PacketBuffer, PacketStream, StreamError, StreamWriter};
use output::terminal::Progress;
use power_model::PowerModel;
use rayon::prelude::*;
use timing::{FrameClock, Recorder, SliceWriter, Slices, Timed};

pub use file::RecordedRun;

use crate::frame::{BIN_PS, DrawnFrame, draw, max_bins_per_frame};
use crate::{Plan, RunError, RunFrame};

/// Frames of a job as a pipeline drew them. What the pipeline does depends on neither time nor power, so the
/// frames of any GPU with this pipeline follow from their packets.
pub struct DrawnFrames {
    frames: Vec<RecordedFrame>,
}

/// A drawn frame with its packets.
struct RecordedFrame {
    frame: DrawnFrame,
    packets: PacketStream,
}

impl DrawnFrames {
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
            let (frame, _) = draw(plan, number, None, |packet, lines| writer.push(packet, lines))?;
            let packets = writer.finish();
            bytes.fetch_add(packets.bytes().len(), Ordering::Relaxed);
            bar.inc();
            Ok(Some(RecordedFrame { frame, packets }))
        };
        let frames: Vec<_> = numbers.par_iter().map(record).collect::<Result<_, RunError>>()?;
        let fits = bytes.into_inner() <= max_bytes;
        Ok(frames.into_iter().collect::<Option<_>>().filter(|_| fits).map(|frames| Self { frames }))
    }

    /// The frames with their times on the machine of each plan, whose pipelines have to be that of the
    /// recording. Packets are read once for all of them.
    ///
    /// # Errors
    /// If a frame cannot be timed.
    pub fn timed(&self, plans: &[&Plan]) -> Result<Vec<TimedFrames<'_>>, RunError> {
        let max_bins = max_bins_per_frame(self.frames.len());
        let time = |recorded: &RecordedFrame| {
            let clocks = plans.iter().map(|plan| {
                let recorder = Recorder::new(BIN_PS, max_bins);
                Ok(FrameClock::new(plan.options.level(), plan.gpu.machine()?, recorder))
            });
            let mut clocks = clocks.collect::<Result<Vec<_>, RunError>>()?;
            let slices = push_all(&recorded.packets, &mut clocks)?;
            let finish = |clock: FrameClock<'_>| Ok(clock.finish_checked(&slices)?);
            clocks.into_iter().map(finish).collect::<Result<Vec<Timed>, RunError>>()
        };
        let frames = self.frames.par_iter().map(time).collect::<Result<Vec<_>, RunError>>()?;
        let mut timed: Vec<_> =
            plans.iter().map(|_| TimedFrames { recording: self, timed: Vec::new() }).collect();
        for (times, machine) in frames.into_iter().flat_map(|times| times.into_iter().zip(0..)) {
            timed[machine].timed.push(times);
        }
        Ok(timed)
    }
}

/// Number of machines that are worth timing together: reading the packets is then a small part of the work.
pub const MACHINES_IN_TURN: usize = 8;

/// Number of packets that one clock takes before the next does: few enough to stay in a cache of the host.
const PACKETS_IN_TURN: usize = 256;

/// Sends all packets to each of the clocks. Returns slices of them, for a check of all.
fn push_all(stream: &PacketStream, clocks: &mut [FrameClock<'_>]) -> Result<Slices, StreamError> {
    let (mut buffer, mut slices) = (PacketBuffer::default(), SliceWriter::default());
    stream.replay(|packet, lines| {
        buffer.push(packet, lines);
        slices.push(packet, lines);
        if buffer.len() == PACKETS_IN_TURN {
            clocks.iter_mut().for_each(|clock| clock.push_all(&buffer));
            buffer.clear();
        }
    })?;
    clocks.iter_mut().for_each(|clock| clock.push_all(&buffer));
    Ok(slices.finish())
}

/// Frames of a recording with their times on a machine.
pub struct TimedFrames<'a> {
    recording: &'a DrawnFrames,
    timed: Vec<Timed>,
}

impl TimedFrames<'_> {
    /// The frames with the power that `model` gives them, as from [`frames_of`](crate::frames_of).
    ///
    /// # Errors
    /// If a timeline contradicts itself, which is an error of the timing model.
    pub fn powered(&self, model: &PowerModel) -> Result<Vec<RunFrame>, RunError> {
        let frames = self.recording.frames.iter().zip(&self.timed);
        frames.map(|(recorded, timed)| recorded.frame.clone().powered(timed, model)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{RunOptions, frames_of};
    use timing::Level;
    use workloads::Overrides;

    fn plan(gpu: &str, timing: Level) -> Plan {
        let overrides = Overrides { frames: Some(0..2), samples: Some(2), ..Overrides::default() };
        let (scene, gpu) = ("tiny".into(), gpu.into());
        Plan::resolve(RunOptions { scene, gpu, timing: Some(timing), overrides, ..RunOptions::default() })
            .unwrap()
    }

    fn recorded(plan: &Plan, max_bytes: usize) -> Option<DrawnFrames> {
        DrawnFrames::draw(plan, &[0, 1], max_bytes, &Progress::new(true)).unwrap()
    }

    #[test]
    fn recorded_frames_are_timed_as_those_that_are_drawn() {
        for level in Level::ALL {
            let plan = plan("reference", level);
            let direct = frames_of(&plan, &[0, 1], &Progress::new(true)).unwrap();
            let recording = recorded(&plan, usize::MAX).unwrap();
            let other = self::plan("reference", Level::Bound);
            let timed = recording.timed(&[&other, &plan]).unwrap()[1].powered(&plan.model).unwrap();
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
                assert_eq!((&seen.stalls, &seen.checked), (&again.stalls, &again.checked));
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
