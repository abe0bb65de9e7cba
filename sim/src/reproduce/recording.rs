//! Frames as a recorder sees them, and what the analysis finds in the trace.

use power_model::{Cause, Circumstances, FramePower, Pacing, Surrounded, pace};
use traces::Trace;
use traces::device::{Device, DeviceSpec};
use traces::energy::{FrameEnergy, PowerIntegral, TrueFrame};
use traces::frames::{Flag, Marks, Method, Options, default_window, find_with};
use traces::score::{self, Score, TOLERANCE_S};

use super::stage::Stage;
use crate::run::RunError;

/// Samples a second of the papers' station (Paper II, section 3).
const RATE_HZ: f64 = 40e3;

/// Tracking outright: where frames are all alike but for a clock that touches every fifteenth, the sum of squares takes those
/// alone to be starts, and `Auto` then leaves it at that.
const METHOD: Options = Options { method: Method::Tracking };

/// How many starts are marked on the PC where one is not the point: from a single one the finder at times takes 15 frames for
/// one, as the timer of 64 Hz touches every fifteenth frame of 30 Hz at the same place. On the phone one does.
pub(super) const MARKED: usize = 3;

/// A trace, the truth behind it, and the frames that were found in it.
pub(super) struct Recording {
    /// What was drawn, and when: the application's own timestamps.
    pub truth: Surrounded,
    /// What was recorded of it.
    pub trace: Trace,
    /// Frames found from one mark, with their energies from start to start.
    pub found: Vec<FrameEnergy>,
    /// Where the last one ends.
    pub end_s: f64,
}

impl Recording {
    /// Draws `frames` on the stage, records them, and finds them again from `marked` starts in a row.
    pub fn new(
        stage: &Stage,
        frames: &[&FramePower],
        pacing: Pacing,
        circumstances: Circumstances,
        marked: usize,
    ) -> Result<Self, RunError> {
        let run = pace(frames, &stage.platform, pacing)?;
        let truth = stage.platform.system.surround(&run, &circumstances)?;
        let trace =
            recorder(stage, circumstances.seed)?.sample(&truth.curve, 0.0, truth.curve.end_s())?.trace;
        let found = find_with(&trace, &marks(&truth, &trace, marked), &METHOD)?;
        let energies = PowerIntegral::new(&trace).frames(&found);
        Ok(Self { end_s: found.end_s, found: energies, truth, trace })
    }

    /// Starts found from one mark by `method` against the true ones, and how many of those missed had a disturbance on them.
    pub fn score(&self, method: Method) -> Result<(Score, usize), RunError> {
        let marks = marks(&self.truth, &self.trace, 1);
        let found = find_with(&self.trace, &marks, &Options { method })?;
        let frames = PowerIntegral::new(&self.trace).frames(&found);
        let truth = self.truth.frames.iter();
        let truth: Vec<_> =
            truth.map(|frame| TrueFrame { start_s: frame.start_s, energy_j: frame.energy_j }).collect();
        let beside = score::truth_beside(&frames, &truth, TOLERANCE_S);
        let missed = truth.iter().filter(|frame| !beside.contains(&Some(**frame)));
        let window = |start_s: f64| (start_s - marks.window.pre_s, start_s + marks.window.post_s);
        let disturbed = missed.filter(|frame| self.is_disturbed(window(frame.start_s))).count();
        Ok((score::score(&frames, &truth, TOLERANCE_S), disturbed))
    }

    fn is_disturbed(&self, (from_s, to_s): (f64, f64)) -> bool {
        let disturbances =
            self.truth.pulses.iter().filter(|pulse| matches!(pulse.cause, Cause::Disturbance(_)));
        disturbances.into_iter().any(|pulse| pulse.overlap_s(from_s, to_s) > 0.0)
    }

    /// Energies of the found frames in order, J.
    pub fn energies_j(&self) -> Vec<f64> {
        self.found.iter().map(|frame| frame.energy_j).collect()
    }

    /// For each frame that was drawn, the energy of the one found in its place, J; none where there is none, or where the
    /// analysis itself says that it is merged with another or a part of one.
    pub fn by_true_frame_j(&self) -> Vec<Option<f64>> {
        let found: Vec<f64> = self.found.iter().map(|frame| frame.start_s).collect();
        let truth: Vec<f64> = self.truth.frames.iter().map(|frame| frame.start_s).collect();
        let mut matched = vec![None; truth.len()];
        for (found, truth) in score::pairs(&found, &truth, TOLERANCE_S) {
            let frame = &self.found[found];
            let whole = ![Flag::Merged, Flag::Split, Flag::Long, Flag::Short]
                .iter()
                .any(|flag| frame.flags.contains(*flag));
            matched[truth] = whole.then_some(frame.energy_j);
        }
        matched
    }

    /// From start to start by the application's own timestamps, in the recorded power, J.
    pub fn by_timestamps_j(&self) -> Vec<f64> {
        let integral = PowerIntegral::new(&self.trace);
        self.truth.frames.iter().map(|frame| integral.energy_j(frame.start_s, frame.end_s)).collect()
    }

    /// The old method: from begin to finish by the application's timestamps, in the recorded power, J.
    pub fn begin_to_finish_j(&self) -> Vec<f64> {
        let integral = PowerIntegral::new(&self.trace);
        self.truth.frames.iter().map(|frame| integral.energy_j(frame.start_s, frame.finish_s)).collect()
    }

    /// The recorded power over a stretch of time, as points from its start on.
    pub fn points(&self, from_s: f64, to_s: f64) -> Vec<(f64, f64)> {
        let place =
            |time_s: f64| self.trace.position(time_s).clamp(0.0, self.trace.samples() as f64) as usize;
        (place(from_s)..place(to_s))
            .map(|index| (self.trace.time_s(index) - from_s, self.trace.power_w(index)))
            .collect()
    }
}

/// The papers' station on the platform's rail: current and voltage at 40 kHz.
fn recorder(stage: &Stage, seed: u64) -> Result<Device, RunError> {
    let default = DeviceSpec::default();
    let rail_v = stage.platform.rail.voltage_v.value();
    let (range_a, range_v) = (stage.sensor.range_a, 1.5 * rail_v);
    Ok(Device::new(DeviceSpec {
        name: "station of the papers".to_owned(),
        rate_hz: RATE_HZ,
        rail_v,
        current_range_a: [-range_a, range_a],
        voltage_range_v: [-range_v, range_v],
        current_noise_a: stage.sensor.noise_a,
        voltage_noise_v: default.voltage_noise_v * range_v / default.voltage_range_v[1],
        seed,
        ..default
    })?)
}

/// `count` starts in a row from the middle on are marked, as an analyst would in the steady part, and the end of the last frame.
fn marks(truth: &Surrounded, trace: &Trace, count: usize) -> Marks {
    let from_middle = truth.frames.iter().skip(truth.frames.len() / 2);
    let lengths = truth.frames.iter().map(|frame| frame.end_s - frame.start_s);
    Marks {
        starts_s: from_middle.take(count).map(|frame| frame.start_s).collect(),
        window: default_window(lengths.fold(f64::INFINITY, f64::min), trace.rate_hz()),
        end_s: truth.end_s.min(trace.end_s()),
    }
}

/// `frames` again and again, `count` in all.
pub(super) fn looped(frames: &[FramePower], count: usize) -> Vec<&FramePower> {
    frames.iter().cycle().take(count).collect()
}
