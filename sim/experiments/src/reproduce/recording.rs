//! Frames as a recorder sees them, and what the analysis finds in the trace.

use power_model::{Cause, Circumstances, FramePower, Pacing, Surrounded, pace};
use traces::Trace;
use traces::device::{Device, DeviceSpec};
use traces::energy::{FrameEnergy, PowerIntegral, TrueFrame};
use traces::frames::{Flag, Marks, Method, Options, Window, default_window, find_with};
use traces::score::{self, Score, TOLERANCE_S};

use super::stage::Stage;
use run::RunError;

/// Samples a second of the papers' station (Paper II, section 3).
const RATE_HZ: f64 = 40e3;

/// Tracking outright: where frames are all alike but for a clock that touches every fifteenth, the sum of squares takes those
/// alone to be starts, and `Auto` then leaves it at that.
const METHOD: Method = Method::Tracking;

/// How many starts are marked on the PC where one is not the point: from a single one the finder at times takes 15 frames for
/// one, as the timer of 64 Hz touches every fifteenth frame of 30 Hz at the same place. On the phone one does.
pub(super) const MARKED: usize = 3;

/// A trace and the truth behind it.
pub(super) struct Recording {
    /// What was drawn, and when: the application's own timestamps.
    pub truth: Surrounded,
    /// What was recorded of it.
    pub trace: Trace,
}

/// The frames that were found in a trace.
pub(super) struct Frames {
    /// With their energies from start to start.
    pub found: Vec<FrameEnergy>,
    /// Where the last one ends.
    pub end_s: f64,
}

impl Frames {
    /// Energies in order, J.
    pub fn energies_j(&self) -> Vec<f64> {
        self.found.iter().map(|frame| frame.energy_j).collect()
    }
}

impl Recording {
    /// Draws `frames` on the stage and records them.
    pub fn new(
        stage: &Stage,
        frames: &[&FramePower],
        pacing: Pacing,
        circumstances: Circumstances,
    ) -> Result<Self, RunError> {
        let run = pace(frames, &stage.platform, pacing)?;
        let truth = stage.platform.system.surround(&run, &circumstances)?;
        let trace =
            recorder(stage, circumstances.seed)?.sample(&truth.curve, 0.0, truth.curve.end_s())?.trace;
        Ok(Self { truth, trace })
    }

    /// Finds the frames again, by tracking from `marked` starts in a row.
    pub fn find(&self, marked: usize) -> Result<Frames, RunError> {
        self.find_by(METHOD, marked)
    }

    /// The same by another method.
    pub fn find_by(&self, method: Method, marked: usize) -> Result<Frames, RunError> {
        let found = find_with(&self.trace, &self.marks(marked), &Options { method })?;
        Ok(Frames { end_s: found.end_s, found: PowerIntegral::new(&self.trace).frames(&found) })
    }

    /// Found starts against the true ones, and how many of those missed had a disturbance on them; a start may be so far off.
    pub fn score(&self, frames: &Frames, within_s: f64) -> (Score, usize) {
        let truth = self.truth.frames.iter();
        let truth: Vec<_> =
            truth.map(|frame| TrueFrame { start_s: frame.start_s, energy_j: frame.energy_j }).collect();
        let beside = score::truth_beside(&frames.found, &truth, within_s);
        let missed = truth.iter().filter(|frame| !beside.contains(&Some(**frame)));
        let Window { pre_s, post_s } = self.marks(1).window;
        let disturbed =
            missed.filter(|frame| self.is_disturbed(frame.start_s - pre_s, frame.start_s + post_s));
        (score::score(&frames.found, &truth, within_s), disturbed.count())
    }

    fn is_disturbed(&self, from_s: f64, to_s: f64) -> bool {
        let disturbances =
            self.truth.pulses.iter().filter(|pulse| matches!(pulse.cause, Cause::Disturbance(_)));
        disturbances.into_iter().any(|pulse| pulse.overlap_s(from_s, to_s) > 0.0)
    }

    /// `count` starts in a row from the middle on are marked, as an analyst would in the steady part, and the end of the last
    /// frame.
    fn marks(&self, count: usize) -> Marks {
        let frames = &self.truth.frames;
        let lengths = frames.iter().map(|frame| frame.end_s - frame.start_s);
        Marks {
            starts_s: frames.iter().skip(frames.len() / 2).take(count).map(|frame| frame.start_s).collect(),
            window: default_window(lengths.fold(f64::INFINITY, f64::min), self.trace.rate_hz()),
            end_s: self.truth.end_s.min(self.trace.end_s()),
        }
    }

    /// For each frame that was drawn, the energy of the one found in its place, J; none where there is none, or where the
    /// analysis itself says that it is merged with another or a part of one.
    pub fn by_true_frame_j(&self, frames: &Frames) -> Vec<Option<f64>> {
        let found: Vec<f64> = frames.found.iter().map(|frame| frame.start_s).collect();
        let truth: Vec<f64> = self.truth.frames.iter().map(|frame| frame.start_s).collect();
        let whole_j = |place: usize| {
            let frame = &frames.found[place];
            let parts = [Flag::Merged, Flag::Split, Flag::Long, Flag::Short];
            (!parts.iter().any(|flag| frame.flags.contains(*flag))).then_some(frame.energy_j)
        };
        let beside = score::found_beside_true(&found, &truth, TOLERANCE_S);
        beside.into_iter().map(|place| place.and_then(whole_j)).collect()
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

    /// The recorded power over an interval, as points from its start on.
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

/// `frames` again and again, `count` in all.
pub(super) fn looped(frames: &[FramePower], count: usize) -> Vec<&FramePower> {
    frames.iter().cycle().take(count).collect()
}
