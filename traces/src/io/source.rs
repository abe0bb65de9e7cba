//! Where samples come from and where they go, piece by piece, so that no trace has to fit into memory.
//!
//! A [`Source`] is a trace in memory or a file that is read again; a [`Sink`] is the writer of a format, or whoever wants to
//! see all samples once. Writers take samples in pieces only, so that a trace in memory and a file of any length go the
//! same way, and their bytes do not depend on where pieces end.

use super::WriteError;
use crate::metadata::Metadata;
use crate::trace::{Trace, lost_at_end, time_ns};

/// What is known of a trace before its first sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Heading {
    /// Left edge of the first sample, s.
    pub start_s: f64,
    /// Samples per second.
    pub rate_hz: f64,
    /// Number of samples, those among them that were lost.
    pub samples: u64,
    /// How many of them the recorder lost.
    pub lost_samples: u64,
    /// How many of those come after the last sample that was not lost: where files leave lost samples out, no row tells of them.
    pub lost_at_end: u64,
    /// Where the trace comes from.
    pub metadata: Metadata,
}

impl Heading {
    /// Left edge of a sample to the nearest nanosecond, as [`Trace::time_ns`].
    pub fn time_ns(&self, index: u64) -> i64 {
        time_ns(self.start_s, self.rate_hz, index)
    }

    /// Left edge of a sample, s.
    pub fn time_s(&self, index: u64) -> f64 {
        self.start_s + index as f64 / self.rate_hz
    }

    /// Position of a time in samples, fractional, not limited to the trace.
    pub fn position(&self, time_s: f64) -> f64 {
        (time_s - self.start_s) * self.rate_hz
    }

    /// Right edge of the last sample, s.
    pub fn end_s(&self) -> f64 {
        self.time_s(self.samples)
    }
}

/// Samples that follow one another.
#[derive(Clone, Copy, Debug)]
pub struct Stretch<'a> {
    /// Number of the first in the whole trace, from 0.
    pub first: u64,
    /// Voltage of each, V.
    pub voltage_v: &'a [f32],
    /// Current of each, A; as many.
    pub current_a: &'a [f32],
    /// Whether the recorder lost them: then they are the line between their neighbours, and left out of files.
    pub lost: bool,
}

impl Stretch<'_> {
    /// Power of each, W.
    pub fn powers_w(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        self.voltage_v.iter().zip(self.current_a).map(|(&v, &i)| f64::from(v) * f64::from(i))
    }

    /// How many samples.
    pub fn len(&self) -> usize {
        self.voltage_v.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.voltage_v.is_empty()
    }

    /// A part of it, by places in it.
    #[must_use]
    pub fn part(&self, from: usize, to: usize) -> Self {
        Self {
            first: self.first + from as u64,
            voltage_v: &self.voltage_v[from..to],
            current_a: &self.current_a[from..to],
            lost: self.lost,
        }
    }
}

/// Takes samples in order.
pub trait Sink: Send {
    /// Takes the samples after those taken before.
    ///
    /// # Errors
    /// [`WriteError`] if they cannot be written; the rest is then not offered.
    fn take(&mut self, stretch: &Stretch<'_>) -> Result<(), WriteError>;
}

/// Has samples, and gives them as often as asked.
pub trait Source {
    /// What is known of them.
    fn heading(&self) -> Heading;

    /// Gives all samples in order, none twice and none left out.
    ///
    /// # Errors
    /// What the sink returns, or [`WriteError::Read`] where the samples cannot be read.
    fn pour(&self, sink: &mut dyn Sink) -> Result<(), WriteError>;
}

impl Source for Trace {
    fn heading(&self) -> Heading {
        Heading {
            start_s: self.start_s(),
            rate_hz: self.rate_hz(),
            samples: self.samples() as u64,
            lost_samples: self.lost_samples() as u64,
            lost_at_end: lost_at_end(self.lost(), self.samples()),
            metadata: self.metadata.clone(),
        }
    }

    fn pour(&self, sink: &mut dyn Sink) -> Result<(), WriteError> {
        let mut from = 0;
        let whole =
            Stretch { first: 0, voltage_v: self.voltage_v(), current_a: self.current_a(), lost: false };
        for lost in self.lost() {
            sink.take(&whole.part(from, lost.start))?;
            sink.take(&Stretch { lost: true, ..whole.part(lost.start, lost.end) })?;
            from = lost.end;
        }
        sink.take(&whole.part(from, self.samples()))
    }
}

/// For tests: a trace that comes in pieces of some size.
#[cfg(test)]
pub(crate) struct Cut<'a>(pub &'a Trace, pub usize);

#[cfg(test)]
impl Source for Cut<'_> {
    fn heading(&self) -> Heading {
        self.0.heading()
    }

    fn pour(&self, sink: &mut dyn Sink) -> Result<(), WriteError> {
        let (voltage_v, current_a) = (self.0.voltage_v(), self.0.current_a());
        let whole = Stretch { first: 0, voltage_v, current_a, lost: false };
        let ends = |from: usize| whole.part(from, whole.len().min(from + self.1));
        (0..whole.len()).step_by(self.1).try_for_each(|from| sink.take(&ends(from)))
    }
}
