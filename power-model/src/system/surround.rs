//! A run as a recorder would see it in its surroundings.

use traces::{Curve, random};

use super::pulse::{Cause, Pulse, overlay};
use crate::error::PacingError;
use crate::pacing::{PacedFrame, Run};
use crate::platform::{Disturbance, System};

/// How a run was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Circumstances {
    /// Whether the application was launched with the first frame, rather than long before it.
    pub launch: bool,
    /// Whether each frame ends with a blocking finish.
    pub blocking_finish: bool,
    /// Decides when disturbances come: another one for each repetition.
    pub seed: u64,
}

/// One frame of a run in its surroundings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurroundedFrame {
    /// When its first command is taken, s.
    pub start_s: f64,
    /// When a blocking finish returns; without one when the last pixel is written, s.
    pub finish_s: f64,
    /// When the next frame starts, s.
    pub end_s: f64,
    /// From start to end, J.
    pub energy_j: f64,
    /// The part of it that launch, finish and disturbances caused, J.
    pub extra_j: f64,
}

/// A run in its surroundings.
#[derive(Clone, Debug, PartialEq)]
pub struct Surrounded {
    /// Watts over time.
    pub curve: Curve,
    /// The frames in order.
    pub frames: Vec<SurroundedFrame>,
    /// Start of the first frame, s.
    pub start_s: f64,
    /// End of the last frame, s.
    pub end_s: f64,
    /// What was drawn on top, and when.
    pub pulses: Vec<Pulse>,
}

/// Disturbances of a run at most.
const MOST_PULSES: usize = 10_000_000;

impl System {
    /// What launch, blocking and the operating system make of a run.
    ///
    /// # Errors
    /// [`PacingError::TooDisturbed`] where there would be more disturbances than memory.
    pub fn surround(&self, run: &Run, circumstances: &Circumstances) -> Result<Surrounded, PacingError> {
        let mut pulses = self.disturbances(run.curve.start_s(), run.curve.end_s(), circumstances.seed)?;
        if let Some(launch) = self.launch.as_ref().filter(|_| circumstances.launch) {
            let (start_s, extra_w) = (run.start_s, launch.extra_w.value());
            pulses.push(Pulse {
                start_s,
                end_s: start_s + launch.duration_s.value(),
                extra_w,
                cause: Cause::Launch,
            });
        }
        let finish = self.finish.as_ref().filter(|_| circumstances.blocking_finish);
        let waiting_w = finish.map_or(0.0, |finish| finish.waiting_w.value());
        let return_s = finish.map_or(0.0, |finish| finish.return_s.value());
        let finish_s = |frame: &PacedFrame| (frame.busy_end_s + return_s).min(frame.end_s);
        if waiting_w > 0.0 {
            pulses.extend(run.frames.iter().map(|frame| Pulse {
                start_s: frame.start_s,
                end_s: finish_s(frame),
                extra_w: waiting_w,
                cause: Cause::Finish,
            }));
        }
        let curve = overlay(&run.curve, &pulses)?;
        let frames = run.frames.iter().map(|frame| surrounded(frame, finish_s(frame), &pulses)).collect();
        Ok(Surrounded { curve, frames, start_s: run.start_s, end_s: run.end_s, pulses })
    }

    /// Every disturbance that begins in a stretch of time.
    fn disturbances(&self, from_s: f64, to_s: f64, seed: u64) -> Result<Vec<Pulse>, PacingError> {
        let run_s = to_s - from_s;
        let expected: f64 = self.disturbances.iter().map(|one| run_s / one.period_s()).sum();
        if expected > MOST_PULSES as f64 {
            return Err(PacingError::TooDisturbed { run_s, most: MOST_PULSES });
        }
        let trains = self.disturbances.iter().enumerate();
        Ok(trains.flat_map(|(place, one)| one.train(place, from_s, to_s, seed)).collect())
    }
}

impl Disturbance {
    /// Disturbance `k` begins at `(phase + k + irregularity * u_k) period`, phase and `u_k` uniform in [0, 1): one in each
    /// period, at any time of it where it is wholly irregular (stratified sampling). The one before the first may reach in.
    /// It draws `extra_w (1 + variation (2 v_k - 1))`, `v_k` uniform likewise.
    fn train(&self, place: usize, from_s: f64, to_s: f64, seed: u64) -> impl Iterator<Item = Pulse> {
        let stream = mix(seed ^ mix(place as u64));
        let phase = uniform(stream, u64::MAX) - 2.0;
        let count = libm::ceil((to_s - from_s) / self.period_s()) as u64 + 2;
        let (irregularity, period_s) = (self.irregularity(), self.period_s());
        let (duration_s, extra_w, variation) = (self.duration_s(), self.extra_w(), self.variation());
        let sizes = mix(stream);
        (0..count + 1)
            .map(move |k| {
                let start_s = from_s + (phase + k as f64 + irregularity * uniform(stream, k)) * period_s;
                let extra_w = extra_w * (1.0 + variation * (2.0 * uniform(sizes, k) - 1.0));
                Pulse { start_s, end_s: start_s + duration_s, extra_w, cause: Cause::Disturbance(place) }
            })
            .filter(move |pulse| pulse.end_s > from_s && pulse.start_s < to_s)
    }
}

fn surrounded(frame: &PacedFrame, finish_s: f64, pulses: &[Pulse]) -> SurroundedFrame {
    let (start_s, end_s) = (frame.start_s, frame.end_s);
    let extra_j: f64 = pulses.iter().map(|pulse| pulse.energy_j(start_s, end_s)).sum();
    SurroundedFrame { start_s, finish_s, end_s, energy_j: frame.energy.total_j() + extra_j, extra_j }
}

/// A number in [0, 1), a pure function of both.
fn uniform(stream: u64, counter: u64) -> f64 {
    (mix(stream.wrapping_add(mix(counter))) >> 11) as f64 / (1_u64 << 53) as f64
}

/// `SplitMix64` with `number` as its state (Steele, Lea and Flood, OOPSLA 2014).
fn mix(number: u64) -> u64 {
    random::mix(number.wrapping_add(random::GOLDEN))
}
