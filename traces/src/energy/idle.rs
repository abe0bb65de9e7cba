//! Idle power, measured and subtracted, and the energy between two times without it.

use thiserror::Error;
use warnings::{Code, Warning};

use super::{FrameEnergy, PowerIntegral, energies_j};
use crate::frames::noise_deviation;
use crate::io::{TraceHeader, TraceReader, WriteError};
use crate::stats::upper_median;
use crate::trace::{SpanError, Trace, check_span};

/// Idle power to subtract.
#[derive(Clone, Debug)]
pub enum Idle<'a> {
    /// The same at all times, W: the mean over a part of the trace or a recording. Less noisy.
    Mean(f64),
    /// Instant by instant: the power of an idle recording at the same time after its start (repeated if it is
    /// shorter). Periodic patterns are subtracted, but the noise of both adds up.
    Instant(PowerIntegral<'a>),
}

/// An idle recording that ends before the trace does: instants are compared from the starts of both on.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("the idle recording lasts {idle_s} s, the trace {trace_s} s")]
pub struct IdleTooShort {
    /// How long the idle recording lasts, s.
    pub idle_s: f64,
    /// How long the trace lasts, s.
    pub trace_s: f64,
}

impl<'a> Idle<'a> {
    /// The mean power of a trace from one time to another, s.
    ///
    /// # Errors
    /// [`WriteError::Read`] if the samples cannot be read.
    pub fn between(trace: &dyn TraceReader, from_s: f64, to_s: f64) -> Result<Self, WriteError> {
        Ok(Self::Mean(energies_j(trace, &[(from_s, to_s)])?[0] / (to_s - from_s)))
    }

    /// The mean power of an idle recording.
    pub fn mean_of(recording: &PowerIntegral<'_>) -> Self {
        let length_s = recording.trace().end_s() - recording.trace().start_s();
        Self::Mean(recording.total_j() / length_s)
    }

    /// An idle recording, instant by instant.
    ///
    /// # Errors
    /// [`IdleTooShort`] if it is shorter than the trace.
    pub fn instant(recording: PowerIntegral<'a>, trace: &TraceHeader) -> Result<Self, IdleTooShort> {
        let idle_s = recording.trace().end_s() - recording.trace().start_s();
        let trace_s = trace.end_s() - trace.start_s;
        if idle_s >= trace_s * (1.0 - 1e-9) {
            Ok(Self::Instant(recording))
        } else {
            Err(IdleTooShort { idle_s, trace_s })
        }
    }

    /// Energy of idling from `a_s` to `b_s` of a trace that starts at `start_s`, J.
    pub fn energy_j(&self, start_s: f64, a_s: f64, b_s: f64) -> f64 {
        match self {
            Self::Mean(watts) => watts * (b_s - a_s),
            Self::Instant(recording) => since(recording, b_s - start_s) - since(recording, a_s - start_s),
        }
    }

    /// Warning if frames of a trace that starts at `start_s`, from which nothing is taken off yet, draw less
    /// than idle power.
    pub fn above_frames(&self, start_s: f64, frames: &[FrameEnergy]) -> Option<Warning> {
        let idle_j: f64 = frames.iter().map(|frame| self.energy_j(start_s, frame.start_s, frame.end_s)).sum();
        let total_j: f64 = frames.iter().map(|frame| frame.energy_j).sum();
        let total_s: f64 = frames.iter().map(FrameEnergy::duration_s).sum();
        let message = || {
            format!(
                "idle power, {:.4} W, is above that of the frames, {:.4} W on average: their energies without it are negative",
                idle_j / total_s,
                total_j / total_s
            )
        };
        (idle_j > total_j && total_s > 0.0).then(|| Warning::new(Code::IdleBusy, message()))
    }

    /// Subtracts the idle energy from every frame.
    pub fn take_off(&self, start_s: f64, frames: &mut [FrameEnergy]) {
        for frame in frames {
            frame.energy_j -= self.energy_j(start_s, frame.start_s, frame.end_s);
        }
    }
}

/// Warning if a segment that is taken for idle, s, has a part of some frames.
pub fn idle_in_frames((from_s, to_s): (f64, f64), frames: &[FrameEnergy]) -> Option<Warning> {
    let overlapping = frames.iter().filter(|frame| frame.start_s < to_s && frame.end_s > from_s).count();
    let message = || {
        let all = frames.len();
        format!(
            "the idle segment, {from_s} s to {to_s} s, overlaps {overlapping} of {all} frames: its mean is no idle power unless it \
             lies in a gap between draws"
        )
    };
    (overlapping > 0).then(|| Warning::new(Code::IdleBusy, message()))
}

/// Warning about a trace, or a part of it, with less than no energy, J.
pub fn negative_power(total_j: f64) -> Option<Warning> {
    let message = "power is negative on average: the current is most likely measured in reverse; swap the leads, or its sign";
    (total_j < 0.0).then(|| Warning::new(Code::NegativePower, message))
}

/// Least share of clipped samples, and their least number.
const MIN_CLIPPED: (f64, usize) = (1e-3, 8);
/// A range ends where its last value occurs more often than this many times the value next to it.
const MIN_CLIPPED_RATIO: usize = 4;

/// Warning about a trace whose current was clipped: its greatest or least value occurs far more often than
/// the next one, which noise would reach as often. Noise below a step of the converter leaves steady power on
/// one value as well, and says nothing.
pub fn clipped_current(trace: &Trace) -> Option<Warning> {
    let current_a = trace.current_a();
    let mut steps_a: Vec<f64> = current_a.windows(2).map(|two| f64::from((two[1] - two[0]).abs())).collect();
    let noise_a = noise_deviation(upper_median(&mut steps_a));
    let at_end = |sign: f32| {
        let [last, next] = last_two_values(current_a.iter().map(|amperes| sign * amperes));
        let often = last.count > MIN_CLIPPED_RATIO * next.count && last.count >= MIN_CLIPPED.1;
        let close = f64::from(last.value - next.value) <= noise_a;
        (often && close).then_some(last.count)
    };
    let count = at_end(1.0).unwrap_or(0) + at_end(-1.0).unwrap_or(0);
    let share = count as f64 / current_a.len().max(1) as f64;
    (share >= MIN_CLIPPED.0).then(|| {
        Warning::new(Code::Clipped, format!(
            "{:.2} % of the samples lie at the greatest or least current, which was clipped there: energies are too low or too high; \
             record with a wider range", 100.0 * share))
    })
}

/// A value and how often it occurs.
#[derive(Clone, Copy)]
struct Occurrence {
    value: f32,
    count: usize,
}

/// The greatest value and the next one below it.
fn last_two_values(values: impl Iterator<Item = f32>) -> [Occurrence; 2] {
    let none = Occurrence { value: f32::NEG_INFINITY, count: 0 };
    let [mut last, mut next] = [none; 2];
    for value in values {
        let one = Occurrence { value, count: 1 };
        if value > last.value {
            (last, next) = (one, last);
        } else if value == last.value {
            last.count += 1;
        } else if value > next.value {
            next = one;
        } else if value == next.value {
            next.count += 1;
        }
    }
    [last, next]
}

/// Energy of the recording, repeated, from its start on, J.
fn since(integral: &PowerIntegral<'_>, time_s: f64) -> f64 {
    let trace = integral.trace();
    let length_s = trace.end_s() - trace.start_s();
    let whole = libm::floor(time_s / length_s);
    let rest_s = time_s - whole * length_s;
    whole * integral.total_j() + integral.energy_j(trace.start_s(), trace.start_s() + rest_s)
}

/// Energy of a segment of a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentEnergy {
    /// Energy less that of idling, J.
    pub energy_j: f64,
    /// Mean power less that of idling, W.
    pub power_w: f64,
    /// Energy of idling, J.
    pub idle_j: f64,
}

/// Reason why a segment has no energy.
#[derive(Debug, Error)]
pub enum SegmentError {
    /// The times are not in the trace, or in the wrong order.
    #[error(transparent)]
    Span(#[from] SpanError),
    /// The samples could not be read.
    #[error(transparent)]
    Read(#[from] WriteError),
}

impl SegmentEnergy {
    /// The energy from `from_s` to `to_s`, less that of idling.
    ///
    /// # Errors
    /// [`SegmentError`] if the segment is not within the trace, or samples cannot be read.
    pub fn of(
        trace: &dyn TraceReader,
        from_s: f64,
        to_s: f64,
        idle: Option<&Idle<'_>>,
    ) -> Result<Self, SegmentError> {
        let header = trace.header();
        check_span([header.start_s, header.end_s()], [from_s, to_s])?;
        let total_j = energies_j(trace, &[(from_s, to_s)])?[0];
        let idle_j = idle.map_or(0.0, |idle| idle.energy_j(header.start_s, from_s, to_s));
        let energy_j = total_j - idle_j;
        Ok(Self { energy_j, power_w: energy_j / (to_s - from_s), idle_j })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::Flags;
    use crate::stats::Random;
    use crate::trace::Metadata;

    fn trace(power: Vec<f32>) -> Trace {
        Trace::new(vec![1.0; power.len()], power, 10.0, 0.0, Metadata::default()).unwrap()
    }

    fn frame(start_s: f64, end_s: f64, energy_j: f64) -> FrameEnergy {
        FrameEnergy { start_s, end_s, energy_j, confidence: 1.0, flags: Flags::default() }
    }

    #[test]
    fn a_constant_idle_is_the_same_by_mean_and_by_instant_also_beyond_its_recording() {
        let recording = trace(vec![2.0; 7]);
        for (a_s, b_s) in [(0.0, 0.3), (0.55, 3.21)] {
            let by_instant = Idle::Instant(PowerIntegral::new(&recording)).energy_j(0.0, a_s, b_s);
            assert!((by_instant - Idle::Mean(2.0).energy_j(0.0, a_s, b_s)).abs() < 1e-12);
        }
    }

    #[test]
    fn idle_that_is_none_is_warned_about() {
        let frames = [frame(1.0, 1.5, 1.5), frame(1.5, 2.0, 1.7)];
        assert!(
            idle_in_frames((0.2, 1.0), &frames).is_none() && idle_in_frames((2.0, 3.0), &frames).is_none()
        );
        let warning = idle_in_frames((0.9, 1.1), &frames).unwrap();
        assert!(warning.code == "idle-busy" && warning.message.contains("overlaps 1 of 2 frames"));
        assert!(Idle::Mean(3.1).above_frames(0.0, &frames).is_none());
        let warning = Idle::Mean(5.0).above_frames(0.0, &frames).unwrap();
        assert!(warning.message.contains("5.0000 W, is above that of the frames, 3.2000 W"), "{warning}");
        let recording = trace(vec![4.0; 7]);
        assert!(Idle::Instant(PowerIntegral::new(&recording)).above_frames(0.0, &frames).is_some());
        assert!(negative_power(-1e-3).is_some() && negative_power(0.0).is_none());
    }

    #[test]
    fn a_current_that_ends_at_one_value_is_clipped_and_noise_or_a_coarse_converter_is_not() {
        let random = Random::new(7, 0);
        let current = |i: u64| 2.0 + (0.01 * i as f64).sin() + 0.02 * random.normals(i).0;
        let warned = |of: &dyn Fn(f64) -> f64| {
            let amperes = (0..5000).map(|i| of(current(i)) as f32).collect();
            clipped_current(&trace(amperes)).is_some()
        };
        assert!(warned(&|a| a.min(2.8)) && warned(&|a| a.max(1.1)));
        assert!(
            !warned(&|a| a) && !warned(&|a| (a * 1000.0).round() / 1000.0) && !warned(&|a| (2.0 * a).round())
        );
        assert!(clipped_current(&trace(vec![1.0; 100])).is_none());
    }

    #[test]
    fn taken_off_every_frame() {
        let mut frames = [frame(0.0, 0.5, 3.0)];
        Idle::Mean(2.0).take_off(0.0, &mut frames);
        assert_eq!(frames[0].energy_j, 2.0);
    }

    #[test]
    fn an_idle_recording_has_to_be_as_long_as_the_trace() {
        let (idle, long) = (trace(vec![2.0; 7]), trace(vec![2.0; 8]));
        assert!(Idle::instant(PowerIntegral::new(&idle), &idle.header()).is_ok());
        let error = Idle::instant(PowerIntegral::new(&idle), &long.header()).unwrap_err();
        assert_eq!((error.idle_s, error.trace_s), (0.7, 0.8));
        let means = [Idle::mean_of(&PowerIntegral::new(&idle)), Idle::between(&long, 0.1, 0.3).unwrap()];
        assert!(means.iter().all(|idle| (idle.energy_j(0.0, 0.0, 1.0) - 2.0).abs() < 1e-12));
    }

    #[test]
    fn idle_energy_is_taken_off_and_wrong_segments_are_refused() {
        let trace = Trace::new(vec![2.0; 100], vec![1.5; 100], 100.0, 0.0, Metadata::default()).unwrap();
        let segment = SegmentEnergy::of(&trace, 0.25, 0.75, Some(&Idle::Mean(1.0))).unwrap();
        let expected = [(segment.energy_j, 1.0), (segment.power_w, 2.0), (segment.idle_j, 0.5)];
        assert!(expected.iter().all(|(found, expected)| (found - expected).abs() < 1e-12), "{segment:?}");
        for (from_s, to_s) in [(0.75, 0.25), (0.5, 1.5), (-1.0, 0.5)] {
            assert!(matches!(SegmentEnergy::of(&trace, from_s, to_s, None), Err(SegmentError::Span(_))));
        }
    }
}
