//! From watts over time to a trace, and back to joules per frame as an analyst would.

use power_model::{FramePower, PARTS, Run, pace};
use traces::device::{Device, Sampled};
use traces::energy::{FrameEnergy, PowerIntegral, TrueFrame};
use traces::frames::{Found, Marks, default_window, find, marked_only};
use traces::score::{self, Score, TOLERANCE_S};
use traces::{Mark, MarkKind, Metadata, Trace};

use super::checks::Checks;
use super::limits::trace_fits;
use super::recorder::{Resolution, device_spec};
use super::{Plan, RunError, Simulated};

/// The trace of a run and what was found in it.
pub struct Measurement {
    /// The frames in their places: the truth.
    pub run: Run,
    /// The trace as recorded.
    pub trace: Trace,
    /// Samples beyond the range of the recorder, currents and voltages.
    pub clipped: usize,
    /// The recorder.
    pub device: Device,
    /// How finely it records the frames.
    pub resolution: Resolution,
    /// The one marked frame and the end of the run.
    pub marks: Marks,
    /// Frame starts found.
    pub found: Found,
    /// The energy of every found frame.
    pub frames: Vec<FrameEnergy>,
    /// The true frames, as the analysis would describe them.
    pub truth: Vec<TrueFrame>,
    /// Found against true starts.
    pub score: Score,
    /// Sums that have to agree.
    pub checks: Checks,
}

impl Measurement {
    /// Whether no frame of several was found but the one that was marked, so that nothing is measured by frame.
    pub fn is_mark_alone(&self) -> bool {
        self.truth.len() > 1 && self.found.starts.len() == 1
    }

    /// For each frame of the run, the one found in the trace at its place, if any; none where only the marked frame was
    /// found, because that one then reaches from the mark to the end mark.
    pub fn by_true_frame(&self) -> Vec<Option<&FrameEnergy>> {
        if self.is_mark_alone() {
            return vec![None; self.truth.len()];
        }
        let starts: Vec<f64> = self.truth.iter().map(|frame| frame.start_s).collect();
        let found: Vec<f64> = self.frames.iter().map(|frame| frame.start_s).collect();
        let beside = score::found_beside_true(&found, &starts, TOLERANCE_S);
        beside.into_iter().map(|place| place.map(|place| &self.frames[place])).collect()
    }
}

/// Paces the frames, records them, finds them again and integrates them.
pub(super) fn measure(plan: &Plan, simulated: &Simulated) -> Result<Measurement, RunError> {
    let powers: Vec<&FramePower> = simulated.in_order().map(|frame| &frame.power).collect();
    let run = pace(&powers, &plan.platform, plan.pacing)?;
    let resolution = Resolution::new(plan.options.trace_rate_hz, &run);
    // Frames may last longer than their share of the display's ticks.
    trace_fits(run.curve.end_s(), resolution.rate_hz)?;
    let device = Device::new(device_spec(plan, resolution.rate_hz, &powers))?;
    let Sampled { mut trace, clipped_currents, clipped_voltages } =
        device.sample(&run.curve, 0.0, run.curve.end_s())?;
    let marks = marks(&run, &trace);
    trace.metadata = metadata(plan, &device, &marks);
    // A run of one frame has no other to be found, and any that is would be false.
    let search = if run.frames.len() == 1 { marked_only } else { find };
    let found = search(&trace, &marks)?;
    let integral = PowerIntegral::new(&trace);
    let frames = integral.frames(&found);
    let truth: Vec<_> =
        run.frames.iter().map(|f| TrueFrame { start_s: f.start_s, energy_j: f.energy.total_j() }).collect();
    let score = score::score(&frames, &truth, TOLERANCE_S);
    let checks = Checks::new(&run, &device, &integral, &found, &frames)?;
    let clipped = clipped_currents + clipped_voltages;
    Ok(Measurement { run, clipped, device, resolution, marks, found, frames, truth, score, checks, trace })
}

/// The middle frame is marked, as an analyst would pick one from the steady part. The last frame ends at the end of the run,
/// or of the trace where a recording without a tail ends with a part of a sample.
fn marks(run: &Run, trace: &Trace) -> Marks {
    let middle = &run.frames[run.frames.len() / 2];
    let shortest = run.frames.iter().map(|frame| frame.end_s - frame.start_s).fold(f64::INFINITY, f64::min);
    Marks::one(middle.start_s, default_window(shortest, trace.rate_hz()), run.end_s.min(trace.end_s()))
}

fn metadata(plan: &Plan, device: &Device, marks: &Marks) -> Metadata {
    let mark = |time_s, kind, label: &str| Mark { time_s, kind, label: label.to_owned() };
    Metadata {
        device: device.spec().name.clone(),
        scene: plan.work.name().to_owned(),
        platform: plan.platform.name.clone(),
        seed: plan.options.seed,
        pixels: Some(plan.pixels()),
        marks: vec![
            mark(marks.starts_s[0], MarkKind::FrameStart, "marked frame"),
            mark(marks.end_s, MarkKind::End, "end of the last frame"),
        ],
        ..Metadata::default()
    }
}

/// The mean power of each part over the frames of a run, from start to end, idle included.
pub(super) fn mean_parts_w(run: &Run) -> [f64; PARTS] {
    let length_s = run.end_s - run.start_s;
    run.energy().by_part_j.map(|joules| joules / length_s)
}
