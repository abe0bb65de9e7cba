//! Voltage and current over time, recorded or synthetic, with their origin and marks.

use core::ops::Range;
use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The largest |time| a trace may reach, s: its nanoseconds must fit an i64.
const TIME_LIMIT_S: f64 = 9.0e9;
/// The lowest and highest sample rate, Hz: above it, time stamps in whole nanoseconds would be equal.
pub const RATE_LIMITS_HZ: [f64; 2] = [1e-6, 1e8];

/// Why a [`Trace`] cannot be built. Rows count samples from 1.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TraceError {
    /// No samples.
    #[error("the trace has no samples: record at least one")]
    Empty,
    /// The channels differ in length.
    #[error("{voltages} voltages but {currents} currents: a sample needs one of each")]
    Lengths {
        /// Samples of voltage.
        voltages: usize,
        /// Samples of current.
        currents: usize,
    },
    /// The sample rate is out of [`RATE_LIMITS_HZ`].
    #[error("sample rate {rate_hz} Hz is not between 1e-6 and 1e8 Hz")]
    Rate {
        /// The rate, Hz.
        rate_hz: f64,
    },
    /// Start or end is not finite or beyond `TIME_LIMIT_S`.
    #[error("the trace reaches {time_s} s: times must be finite and within 9e9 s of zero")]
    Time {
        /// The time, s.
        time_s: f64,
    },
    /// A sample is not a finite number.
    #[error("row {row}: {channel} is {value}, not a finite number; cut it out or fix it")]
    NotFinite {
        /// Sample, from 1.
        row: usize,
        /// Column name.
        channel: &'static str,
        /// The value.
        value: f32,
    },
}

/// Evenly sampled voltage (V) and current (A).
///
/// Sample `i` begins at `start_s + i / rate_hz` (its **left edge**) and is the mean over the period that
/// follows.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    voltage_v: Vec<f32>,
    current_a: Vec<f32>,
    rate_hz: f64,
    start_s: f64,
    lost: Vec<Range<usize>>,
    /// Origin and marks of the trace.
    pub metadata: Metadata,
}

impl Trace {
    /// A trace from its two channels, V and A, one value each per sample.
    ///
    /// # Errors
    /// [`TraceError`]: empty, unequal lengths, rate or times out of range, or a value that is not finite.
    pub fn new(
        voltage_v: Vec<f32>,
        current_a: Vec<f32>,
        rate_hz: f64,
        start_s: f64,
        metadata: Metadata,
    ) -> Result<Self, TraceError> {
        if voltage_v.len() != current_a.len() {
            return Err(TraceError::Lengths { voltages: voltage_v.len(), currents: current_a.len() });
        }
        if voltage_v.is_empty() {
            return Err(TraceError::Empty);
        }
        check_times(voltage_v.len() as u64, rate_hz, start_s)?;
        check_finite(&voltage_v, "voltage_V")?;
        check_finite(&current_a, "current_A")?;
        Ok(Self { voltage_v, current_a, rate_hz, start_s, lost: Vec::new(), metadata })
    }

    /// The same samples, some of which the recorder lost on the way: they are put on the straight line
    /// between their neighbours, as nothing is known of them, and left out of files. Of `lost`, in order and
    /// apart, what is beyond the samples is cut off, and so is the first sample, with which a recording
    /// begins.
    #[must_use]
    pub fn without(mut self, lost: impl IntoIterator<Item = Range<usize>>) -> Self {
        let count = self.samples();
        let inside = |range: Range<usize>| range.start.max(1)..range.end.min(count);
        self.lost = lost.into_iter().map(inside).filter(|range| range.start < range.end).collect();
        for range in &self.lost {
            bridge(&mut self.voltage_v, range.clone());
            bridge(&mut self.current_a, range.clone());
        }
        self
    }

    /// Segments that the recorder lost, in order.
    pub fn lost(&self) -> &[Range<usize>] {
        &self.lost
    }

    /// How many samples they are.
    pub fn lost_samples(&self) -> usize {
        lost_samples(&self.lost)
    }

    /// The losses of the recorder, in words; `None` without any.
    pub fn losses(&self) -> Option<String> {
        losses(&self.lost, |index| self.time_s(index))
    }

    /// Number of samples; never 0.
    pub fn samples(&self) -> usize {
        self.voltage_v.len()
    }

    /// Voltage of each sample, V.
    pub fn voltage_v(&self) -> &[f32] {
        &self.voltage_v
    }

    /// Current of each sample, A.
    pub fn current_a(&self) -> &[f32] {
        &self.current_a
    }

    /// Samples per second.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Duration of a sample, s.
    pub fn period_s(&self) -> f64 {
        1.0 / self.rate_hz
    }

    /// Left edge of the first sample, s.
    pub fn start_s(&self) -> f64 {
        self.start_s
    }

    /// Right edge of the last sample, s.
    pub fn end_s(&self) -> f64 {
        self.time_s(self.samples())
    }

    /// Left edge of sample `index`, s.
    pub fn time_s(&self, index: usize) -> f64 {
        self.start_s + index as f64 / self.rate_hz
    }

    /// Position of a time in samples, fractional, not limited to the trace.
    pub fn position(&self, time_s: f64) -> f64 {
        (time_s - self.start_s) * self.rate_hz
    }

    /// Power of sample `index`, W: `V I`. The product of two f32 is exact in f64.
    ///
    /// # Panics
    /// If `index` is not below [`Trace::samples`].
    pub fn power_w(&self, index: usize) -> f64 {
        f64::from(self.voltage_v[index]) * f64::from(self.current_a[index])
    }

    /// Left edge (s) and power (W) of the samples from the one that `from_s` lies in to before the one that
    /// `to_s` lies in.
    pub fn powers_between(&self, from_s: f64, to_s: f64) -> impl ExactSizeIterator<Item = (f64, f64)> + '_ {
        let place = |time_s: f64| self.position(time_s).clamp(0.0, self.samples() as f64) as usize;
        (place(from_s)..place(to_s)).map(|index| (self.time_s(index), self.power_w(index)))
    }

    /// Power of every sample, W, in order.
    pub fn powers_w(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        self.voltage_v.iter().zip(&self.current_a).map(|(&v, &i)| f64::from(v) * f64::from(i))
    }
}

/// How many samples are in segments that were lost.
pub(crate) fn lost_samples(lost: &[Range<usize>]) -> usize {
    lost.iter().map(ExactSizeIterator::len).sum()
}

/// Segments that were lost, in words; `None` if there are none.
pub(crate) fn losses(lost: &[Range<usize>], time_s: impl Fn(usize) -> f64) -> Option<String> {
    let first = lost.first()?;
    Some(format!(
        "{} samples in {} ranges are missing, the first after {} s",
        lost_samples(lost),
        lost.len(),
        time_s(first.start - 1)
    ))
}

/// How many of `samples` are lost after the last that is not.
pub(crate) fn lost_at_end(lost: &[Range<usize>], samples: usize) -> u64 {
    lost.last().filter(|last| last.end == samples).map_or(0, |last| last.len() as u64)
}

/// Left edge of a sample to the nearest nanosecond.
pub(crate) fn time_ns(start_s: f64, rate_hz: f64, index: u64) -> i64 {
    // A float-to-int cast saturates; the constructor keeps times within i64.
    libm::round(start_s * 1e9 + index as f64 * 1e9 / rate_hz) as i64
}

/// The straight line from the value before to the one after, or that before where there is none after.
fn bridge(values: &mut [f32], lost: Range<usize>) {
    let before = values[lost.start - 1];
    let after = values.get(lost.end).copied().unwrap_or(before);
    let len = lost.len();
    for (at, value) in values[lost].iter_mut().enumerate() {
        *value = on_line(before, after, at, len);
    }
}

/// The value `at` (from 0) of `len` that are missing between two.
pub(crate) fn on_line(before: f32, after: f32, at: usize, len: usize) -> f32 {
    before + (after - before) * ((at + 1) as f32 / (len + 1) as f32)
}

/// Whether rate, start and end are within their limits.
pub(crate) fn check_times(samples: u64, rate_hz: f64, start_s: f64) -> Result<(), TraceError> {
    if !(RATE_LIMITS_HZ[0]..=RATE_LIMITS_HZ[1]).contains(&rate_hz) {
        return Err(TraceError::Rate { rate_hz });
    }
    for time_s in [start_s, start_s + samples as f64 / rate_hz] {
        if !time_s.is_finite() || time_s.abs() > TIME_LIMIT_S {
            return Err(TraceError::Time { time_s });
        }
    }
    Ok(())
}

/// A span of time that is not part of a trace.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum SpanError {
    /// The span ends before it begins, or at once.
    #[error("{from_s} s to {to_s} s ends before it begins or has no length; give the earlier time first")]
    Reversed {
        /// Begin, s.
        from_s: f64,
        /// End, s.
        to_s: f64,
    },
    /// The span is not within the trace.
    #[error("{from_s} s to {to_s} s is not within the trace, {start_s} s to {end_s} s; give times inside it")]
    Outside {
        /// Begin, s.
        from_s: f64,
        /// End, s.
        to_s: f64,
        /// Start of the trace, s.
        start_s: f64,
        /// End of the trace, s.
        end_s: f64,
    },
}

/// Whether a number is between two others, to rounding.
pub fn is_within([low, high]: [f64; 2], number: f64) -> bool {
    let rounding = 1e-12 * low.abs().max(high.abs());
    (low - rounding..=high + rounding).contains(&number)
}

/// Refuses a span of time that is not within a trace from `start_s` to `end_s`.
///
/// # Errors
/// [`SpanError`] names both.
pub fn check_span([start_s, end_s]: [f64; 2], [from_s, to_s]: [f64; 2]) -> Result<(), SpanError> {
    let inside = [from_s, to_s].into_iter().all(|time_s| is_within([start_s, end_s], time_s));
    match (inside, from_s < to_s) {
        (true, true) => Ok(()),
        (true, false) => Err(SpanError::Reversed { from_s, to_s }),
        (false, _) => Err(SpanError::Outside { from_s, to_s, start_s, end_s }),
    }
}

fn check_finite(values: &[f32], channel: &'static str) -> Result<(), TraceError> {
    match values.iter().enumerate().find(|(_, value)| !value.is_finite()) {
        Some((index, &value)) => Err(TraceError::NotFinite { row: index + 1, channel, value }),
        None => Ok(()),
    }
}

/// Meaning of a [`Mark`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MarkKind {
    /// The start of one frame.
    FrameStart,
    /// The end of the last frame.
    End,
    /// Anything else; the label says what.
    Other,
}

/// A time somebody (or the simulator) pointed at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// When, s.
    pub time_s: f64,
    /// Meaning of the mark.
    pub kind: MarkKind,
    /// Free text.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub label: String,
}

/// Origin and marks of a trace. Every field is optional; keys of other programs go into `other`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Metadata {
    /// The instrument.
    pub device: String,
    /// The rendered scene.
    pub scene: String,
    /// The GPU or device that rendered it.
    pub platform: String,
    /// Seed of the noise; 0 for a recording.
    pub seed: u64,
    /// Pixels per frame, for energies per pixel.
    pub pixels: Option<u64>,
    /// Marked times, in the order given.
    pub marks: Vec<Mark>,
    /// Everything else found in the file, by key.
    #[serde(flatten)]
    pub other: BTreeMap<String, serde_json::Value>,
}

impl Metadata {
    /// The marked frame starts, s, in the order given.
    pub fn frame_starts_s(&self) -> impl Iterator<Item = f64> + '_ {
        self.marks.iter().filter(|mark| mark.kind == MarkKind::FrameStart).map(|mark| mark.time_s)
    }

    /// The marked end of the last frame, s: the last such mark.
    pub fn end_mark_s(&self) -> Option<f64> {
        self.marks.iter().rev().find(|mark| mark.kind == MarkKind::End).map(|mark| mark.time_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn build(v: Vec<f32>, i: Vec<f32>, rate_hz: f64, start_s: f64) -> Result<Trace, TraceError> {
        Trace::new(v, i, rate_hz, start_s, Metadata::default())
    }

    #[test]
    fn times_are_left_edges_and_nanoseconds_are_exact_at_50_khz() {
        let trace = build(vec![1.0; 4], vec![2.0; 4], 50e3, 0.25).unwrap();
        assert_eq!(
            [0, 3].map(|index| time_ns(trace.start_s, trace.rate_hz, index)),
            [250_000_000, 250_060_000]
        );
        assert_eq!(trace.end_s(), 0.25 + 4.0 / 50e3);
        assert_eq!(trace.power_w(3), 2.0);
    }

    #[test]
    fn each_bad_trace_names_what_is_wrong() {
        let message = |v: &[f32], i: &[f32], rate: f64, start: f64| {
            build(v.to_vec(), i.to_vec(), rate, start).unwrap_err().to_string()
        };
        assert!(message(&[], &[], 1.0, 0.0).contains("no samples"));
        assert!(message(&[1.0], &[], 1.0, 0.0).contains("1 voltages but 0 currents"));
        assert!(message(&[1.0], &[1.0], -5.0, 0.0).contains("-5 Hz"));
        assert!(message(&[1.0], &[1.0], f64::NAN, 0.0).contains("NaN Hz"));
        assert!(message(&[1.0], &[1.0], 1.0, 1e10).contains("10000000000 s"));
        assert!(message(&[1.0, 1.0], &[1.0, f32::NAN], 1.0, 0.0).contains("row 2: current_A is NaN"));
    }

    #[test]
    fn powers_between_times_are_those_of_the_samples_there() {
        let trace = build(vec![2.0; 5], vec![0.0, 1.0, 2.0, 3.0, 4.0], 10.0, 1.0).unwrap();
        let powers = |from_s, to_s| trace.powers_between(from_s, to_s).map(|(_, w)| w).collect::<Vec<_>>();
        assert_eq!(powers(1.15, 1.35), [2.0, 4.0]);
        assert_eq!(powers(0.0, 9.0), [0.0, 2.0, 4.0, 6.0, 8.0]);
        assert!(powers(1.35, 1.15).is_empty() && powers(7.0, 9.0).is_empty());
        assert_eq!(trace.powers_between(1.25, 9.0).next(), Some((trace.time_s(2), 4.0)));
    }

    #[test]
    fn spans_are_within_a_trace_to_rounding() {
        assert_eq!(check_span([0.0, 0.3], [0.1, 0.1 + 0.2]), Ok(()));
        assert_eq!(check_span([0.0, 1.0], [0.5, 0.5]), Err(SpanError::Reversed { from_s: 0.5, to_s: 0.5 }));
        assert!(matches!(check_span([0.0, 1.0], [0.5, 1.1]), Err(SpanError::Outside { .. })));
        assert!(matches!(check_span([0.0, 1.0], [f64::NAN, 0.5]), Err(SpanError::Outside { .. })));
    }
}
