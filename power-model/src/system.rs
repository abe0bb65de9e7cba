//! Contributions around the GPU that a recording shows: the state after launch, a blocking finish, the
//! operating system.
//!
//! All of them are extra power over intervals of time on top of the curve from [`crate::pace`]; they do not
//! delay frames.

use traces::{Curve, CurveError, stats};

use crate::PacingError;
use crate::pacing::{PacedFrame, PacedRun};
use crate::platform::{Disturbance, System};

/// Cause of extra power.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Recent launch of the application.
    Launch,
    /// Processor waiting in a blocking finish.
    Finish,
    /// Disturbance with this index in the `disturbances` of a [`crate::System`].
    Disturbance(usize),
}

/// Extra power over an interval of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulse {
    /// Start, s.
    pub start_s: f64,
    /// End, s.
    pub end_s: f64,
    /// Extra power, W.
    pub extra_w: f64,
    /// Cause.
    pub cause: Cause,
}

impl Pulse {
    /// Length of its overlap with an interval, s.
    pub fn overlap_s(&self, from_s: f64, to_s: f64) -> f64 {
        (self.end_s.min(to_s) - self.start_s.max(from_s)).max(0.0)
    }

    /// Energy of the pulse in an interval, J.
    pub fn energy_j(&self, from_s: f64, to_s: f64) -> f64 {
        self.extra_w * self.overlap_s(from_s, to_s)
    }
}

/// The curve plus the pulses, clipped to the curve. Overlapping pulses add up.
///
/// # Errors
/// [`CurveError`] if the power of a pulse is negative or not finite.
pub fn overlay(curve: &Curve, pulses: &[Pulse]) -> Result<Curve, CurveError> {
    let mut pulses: Vec<&Pulse> = pulses.iter().filter(|pulse| pulse.end_s > pulse.start_s).collect();
    pulses.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
    let edges_s = edges(curve, &pulses);
    let mut watts = Vec::with_capacity(edges_s.len() - 1);
    let (mut segment, mut next, mut active) = (0, 0, Vec::new());
    for &time_s in &edges_s[..edges_s.len() - 1] {
        while curve.edges_s()[segment + 1] <= time_s {
            segment += 1;
        }
        while let Some(pulse) = pulses.get(next).filter(|pulse| pulse.start_s <= time_s) {
            active.push(*pulse);
            next += 1;
        }
        active.retain(|pulse| pulse.end_s > time_s);
        // Summed from scratch each time; a running sum would accumulate rounding errors.
        let extra_w: f64 = active.iter().map(|pulse| pulse.extra_w).sum();
        watts.push(curve.watts()[segment] + extra_w);
    }
    Curve::new(edges_s, watts)
}

/// Edges of the curve and of all pulses within it, sorted and without duplicates.
fn edges(curve: &Curve, pulses: &[&Pulse]) -> Vec<f64> {
    let inside = |time_s: &f64| (curve.start_s()..curve.end_s()).contains(time_s);
    let mut edges_s = curve.edges_s().to_vec();
    edges_s.extend(pulses.iter().flat_map(|pulse| [pulse.start_s, pulse.end_s]).filter(inside));
    edges_s.sort_by(f64::total_cmp);
    // -0 and 0 differ in the total order but are one edge.
    edges_s.dedup_by(|later, earlier| *later <= *earlier);
    edges_s
}

/// Conditions of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Circumstances {
    /// Whether the application is launched with the first frame, rather than long before.
    pub launch: bool,
    /// Whether each frame ends with a blocking finish.
    pub blocking_finish: bool,
    /// Seed of the times of disturbances; each repetition takes another one.
    pub seed: u64,
}

/// One frame of a run with its surroundings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurroundedFrame {
    /// Start of its first command, s.
    pub start_s: f64,
    /// Return of a blocking finish; without one, the end of the last pixel, s.
    pub finish_s: f64,
    /// Start of the next frame, s.
    pub end_s: f64,
    /// Energy from start to end, J.
    pub energy_j: f64,
    /// Part of the energy caused by launch, finish and disturbances, J.
    pub extra_j: f64,
}

/// A run with its surroundings.
#[derive(Clone, Debug, PartialEq)]
pub struct Surrounded {
    /// Power over time.
    pub curve: Curve,
    /// The frames in order.
    pub frames: Vec<SurroundedFrame>,
    /// Start of the first frame, s.
    pub start_s: f64,
    /// End of the last frame, s.
    pub end_s: f64,
    /// Pulses of extra power.
    pub pulses: Vec<Pulse>,
}

/// Largest number of disturbances of a run.
const MAX_PULSES: usize = 10_000_000;

impl System {
    /// Add launch, blocking and the operating system to a run.
    ///
    /// # Errors
    /// [`PacingError::TooDisturbed`] if there would be more than `MAX_PULSES` disturbances.
    pub fn surround(&self, run: &PacedRun, circumstances: &Circumstances) -> Result<Surrounded, PacingError> {
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

    /// Every disturbance that begins in an interval of time.
    fn disturbances(&self, from_s: f64, to_s: f64, seed: u64) -> Result<Vec<Pulse>, PacingError> {
        let run_s = to_s - from_s;
        let expected: f64 = self.disturbances.iter().map(|one| run_s / one.period_s()).sum();
        if expected > MAX_PULSES as f64 {
            return Err(PacingError::TooDisturbed { run_s, most: MAX_PULSES });
        }
        let trains = self.disturbances.iter().enumerate();
        Ok(trains.flat_map(|(place, one)| one.occurrences(place, from_s, to_s, seed)).collect())
    }
}

impl Disturbance {
    /// Disturbance `k` begins at `(phase + k + irregularity * u_k) period`, with phase and `u_k` uniform in
    /// [0, 1). So each period has one; at irregularity 1 it may be anywhere in it (stratified sampling). The
    /// one before the first may extend into the run. It draws `extra_w (1 + variation (2 v_k - 1))`, with
    /// `v_k` uniform in [0, 1).
    fn occurrences(&self, place: usize, from_s: f64, to_s: f64, seed: u64) -> impl Iterator<Item = Pulse> {
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

/// A number in [0, 1), a pure function of both arguments.
fn uniform(stream: u64, counter: u64) -> f64 {
    (mix(stream.wrapping_add(mix(counter))) >> 11) as f64 / (1_u64 << 53) as f64
}

/// SplitMix64 with `number` as its state (Steele, Lea and Flood, OOPSLA 2014).
fn mix(number: u64) -> u64 {
    stats::mix(number.wrapping_add(stats::GOLDEN))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pulse(start_s: f64, end_s: f64, extra_w: f64) -> Pulse {
        Pulse { start_s, end_s, extra_w, cause: Cause::Launch }
    }

    #[test]
    fn overlapping_pulses_add_up_and_ends_are_cut() {
        let curve = Curve::new(vec![0.0, 1.0, 4.0], vec![2.0, 3.0]).unwrap();
        let pulses =
            [pulse(3.5, 9.0, 4.0), pulse(-1.0, 0.5, 1.0), pulse(0.25, 2.0, 0.5), pulse(5.0, 6.0, 7.0)];
        let over = overlay(&curve, &pulses).unwrap();
        assert_eq!(over.edges_s(), [0.0, 0.25, 0.5, 1.0, 2.0, 3.5, 4.0]);
        assert_eq!(over.watts(), [3.0, 3.5, 2.5, 3.5, 3.0, 7.0]);
    }

    #[test]
    fn an_empty_overlay_changes_nothing() {
        let curve = Curve::new(vec![0.0, 0.3, 0.31], vec![1.0, 0.0]).unwrap();
        assert_eq!(overlay(&curve, &[]), Ok(curve.clone()));
        assert_eq!(overlay(&curve, &[pulse(0.1, 0.1, 9.0), pulse(0.2, 0.1, 9.0)]), Ok(curve));
    }

    #[test]
    fn power_that_is_none_is_refused() {
        let curve = Curve::new(vec![0.0, 1.0], vec![1.0]).unwrap();
        assert!(overlay(&curve, &[pulse(0.2, 0.4, f64::NAN)]).is_err());
        assert!(overlay(&curve, &[pulse(0.2, 0.4, -2.0)]).is_err());
    }
}
