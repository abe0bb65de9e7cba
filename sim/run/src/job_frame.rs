//! A frame of a job on a machine, with the energy of each of its passes; and which frames of a run differ.

use std::collections::HashMap;

use activity::{Counts, Event, LineAccess, Packet};
use pipeline::{FrameReport, Gpu, Viewport};
use power_model::{FramePower, Part, PowerModel};
use rayon::prelude::*;
use timing::{FrameClock, Level, Recorder};
use workloads::job::{Drawn, ReadyFrame};
use workloads::{Fingerprint, Job};

use crate::{GpuSpec, RunError};

/// Length of a timeline bin in picoseconds: one microsecond, a twentieth of a sample at 50 kHz.
pub const BIN_PS: u64 = 1_000_000;

/// A drawn and timed frame with the energy of its passes.
pub struct JobFrame {
    /// Image and facts.
    pub drawn: Drawn,
    /// Work by pass.
    pub report: FrameReport,
    /// Power over time.
    pub power: FramePower,
    /// Its passes, in order.
    pub passes: Vec<PassEnergy>,
    /// Energy of writing results to memory when the frame ends, J.
    pub write_back_j: f64,
}

/// Energy of a pass.
#[derive(Clone, Debug, PartialEq)]
pub struct PassEnergy {
    /// Its name.
    pub name: String,
    /// When its last packet leaves, s from the start of the frame.
    pub end_s: f64,
    /// From the end of the pass before, s.
    pub time_s: f64,
    /// Energy of its events, as the pipeline counted them, J.
    pub events_j: f64,
    /// Energy of clocks, leakage and what is constant in that time, J.
    pub timed_j: f64,
}

impl PassEnergy {
    /// All of it, J.
    pub fn total_j(&self) -> f64 {
        self.events_j + self.timed_j
    }
}

/// Largest number of bins of a frame.
const MAX_BINS: usize = 4096;

/// Draws a frame on the pipeline of `gpu`, with heat maps of some events over images of a size, and emits its packets.
pub(crate) fn draw<'a>(
    gpu: &'a GpuSpec,
    heat: Option<(&[Event], Viewport)>,
    ready: &dyn ReadyFrame,
    emit: impl FnMut(&Packet, &[LineAccess]) + 'a,
) -> Result<(Drawn, FrameReport), RunError> {
    let mut on = Gpu::new(&gpu.pipeline, emit).map_err(RunError::setting)?;
    if let Some((events, viewport)) = heat {
        on = on.with_heat(events, viewport);
    }
    let drawn = ready.draw(&mut on).map_err(RunError::on(gpu))?;
    Ok((drawn, on.finish()))
}

impl JobFrame {
    /// Draws frame `number` of a job.
    ///
    /// # Errors
    /// [`RunError`] if the frame cannot be drawn or timed.
    pub fn new(job: &dyn Job, number: u32, gpu: &GpuSpec, model: &PowerModel) -> Result<Self, RunError> {
        let mut clock = FrameClock::new(Level::default(), gpu.machine()?, Recorder::new(BIN_PS, MAX_BINS));
        let emit = |packet: &_, lines: &_| clock.push(packet, lines);
        let (drawn, report) = draw(gpu, None, &*job.prepare(number)?, emit)?;
        let timed = clock.finish()?;
        let power = model.frame(&timed.timeline);
        let power = power.map_err(|source| RunError::Timeline { frame: number, source })?;
        let mut before_s = 0.0;
        let pass = |(pass, time): (&pipeline::PassReport, &timing::PassTime)| {
            let end_s = time.end_ps as f64 * 1e-12;
            let from_s = std::mem::replace(&mut before_s, end_s);
            PassEnergy {
                name: pass.name.clone(),
                end_s,
                time_s: end_s - from_s,
                events_j: events_j(model, &pass.counts()),
                timed_j: timed_j(&power, from_s, end_s),
            }
        };
        let passes = report.passes.iter().zip(&timed.passes).map(pass).collect();
        let write_back_j = events_j(model, &report.write_back);
        Ok(Self { drawn, report, power, passes, write_back_j })
    }

    /// Energy of all passes and of the write-back, J: to compare with that of the power over time.
    pub fn sum_j(&self) -> f64 {
        self.passes.iter().map(PassEnergy::total_j).sum::<f64>() + self.write_back_j
    }

    /// Bytes to and from memory.
    pub fn dram_bytes(&self) -> u64 {
        let counts = self.report.counts();
        counts[Event::DramReadBytes] + counts[Event::DramWriteBytes]
    }
}

fn events_j(model: &PowerModel, counts: &Counts) -> f64 {
    model.counts_energy(counts).total_j()
}

/// Energy between two times of the parts of a power that depend on time: what a pass takes besides its events.
pub(crate) fn timed_j(power: &FramePower, from_s: f64, to_s: f64) -> f64 {
    let is_timed = |part: &Part| !matches!(part, Part::Unit(_));
    let mut at_s = 0.0;
    let energy = |(length_s, watts): (f64, &[f64; Part::ALL.len()])| {
        let begin_s = at_s;
        at_s += length_s;
        let inside_s = (at_s.min(to_s) - begin_s.max(from_s)).max(0.0);
        let watts: f64 =
            Part::ALL.iter().zip(watts).filter(|(part, _)| is_timed(part)).map(|(_, watts)| watts).sum();
        watts * inside_s
    };
    power.bins().map(energy).sum()
}

/// Groups of frames with equal input. Each group is simulated once.
///
/// Inputs are compared by the [`Fingerprint`] of everything that the renderer receives and that changes from
/// frame to frame: the camera at both ends of the shutter, every mesh, and all that a workload prepares.
/// Settings, materials, lights, background, sample table and hardware are constant in a run and are not
/// compared.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Distinct {
    /// First frame of each group, in order.
    numbers: Vec<u32>,
    /// Index of the group of each frame of the run.
    groups: Vec<usize>,
    /// Number of the first frame of the run.
    start: u32,
}

impl Distinct {
    /// Prepares and compares all frames of `job`.
    ///
    /// # Errors
    /// When a frame cannot be made.
    pub fn new(job: &dyn Job) -> Result<Self, RunError> {
        let range = job.settings().frames.clone();
        if range.len() == 1 {
            return Ok(Self::of(range.start, &[()]));
        }
        let start = range.start;
        let prints = range.into_par_iter().map(|number| job.fingerprint(number));
        Ok(Self::of(start, &prints.collect::<Result<Vec<Fingerprint>, _>>()?))
    }

    fn of<K: Eq + std::hash::Hash>(start: u32, inputs: &[K]) -> Self {
        let (mut numbers, mut known) = (Vec::new(), HashMap::new());
        let groups = (start..)
            .zip(inputs)
            .map(|(number, input)| {
                *known.entry(input).or_insert_with(|| {
                    numbers.push(number);
                    numbers.len() - 1
                })
            })
            .collect();
        Self { numbers, groups, start }
    }

    /// Number of the first frame of each group, in order: the frames to simulate.
    pub fn numbers(&self) -> &[u32] {
        &self.numbers
    }

    /// Index of the group of each frame of the run, in [`Self::numbers`].
    pub fn groups(&self) -> &[usize] {
        &self.groups
    }

    /// Numbers of the frames in `group`.
    pub fn members(&self, group: usize) -> impl Iterator<Item = u32> {
        (self.start..).zip(&self.groups).filter(move |(_, of)| **of == group).map(|(number, _)| number)
    }
}

#[cfg(test)]
mod tests {
    use power_model::{EnergyTable, Platform};
    use workloads::Overrides;
    use workloads::deferred::{Deferred, DeferredOptions, LightPass};

    use super::*;

    #[test]
    fn energies_of_passes_add_up_to_that_of_the_power_over_time() {
        let gpu = GpuSpec::load("hd_4000").unwrap();
        let platform = Platform::builtin("hd_4000").unwrap();
        let model = PowerModel::new(&EnergyTable::builtin("28nm").unwrap(), &platform).unwrap();
        let overrides = Overrides { size: Some((160, 90)), ..Overrides::default() };
        for lighting in [LightPass::Screen, LightPass::Volumes] {
            let options = DeferredOptions { lights: 8, lighting, ..DeferredOptions::default() };
            let job = Deferred::new(options, &overrides, 1).unwrap();
            let frame = JobFrame::new(&job, 0, &gpu, &model).unwrap();
            let names: Vec<&str> = frame.passes.iter().map(|pass| pass.name.as_str()).collect();
            assert_eq!(names, ["g-buffer", "lighting", "resolve"]);
            let whole_j: f64 =
                frame.power.bins().map(|(length_s, watts)| length_s * watts.iter().sum::<f64>()).sum();
            let error = (frame.sum_j() / whole_j - 1.0).abs();
            assert!(error < 1e-9, "{error:e}");
            // Each part is far above what would be missed.
            let parts = frame.passes.iter().flat_map(|pass| [pass.events_j, pass.timed_j]);
            assert!(parts.chain([frame.write_back_j]).all(|part_j| part_j > 1e-6 * whole_j));
        }
    }

    #[test]
    fn equal_frames_share_a_group_wherever_they_are() {
        let found = Distinct::of(7, &["a", "b", "a", "a", "c", "b"]);
        assert_eq!((found.numbers(), found.groups()), (&[7, 8, 11][..], &[0, 1, 0, 0, 2, 1][..]));
        assert_eq!(found.members(0).collect::<Vec<_>>(), [7, 9, 10]);
        assert_eq!(found.members(2).collect::<Vec<_>>(), [11]);
    }
}
