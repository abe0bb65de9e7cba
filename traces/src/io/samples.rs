//! Readers and writers of samples, in pieces, so that no trace has to fit into memory.
//!
//! A [`TraceReader`] is a trace in memory or a file; a [`TraceWriter`] is the writer of a format, or anything
//! else that needs all samples once. Writers take samples in pieces only, so that a trace in memory and a
//! file of any length are written in the same way, and the bytes do not depend on where pieces end.

use super::WriteError;
use crate::trace::{Metadata, Trace, lost_at_end, time_ns};

/// Everything about a trace but its samples.
#[derive(Clone, Debug, PartialEq)]
pub struct TraceHeader {
    /// Left edge of the first sample, s.
    pub start_s: f64,
    /// Samples per second.
    pub rate_hz: f64,
    /// Number of samples, those among them that were lost.
    pub samples: u64,
    /// How many of them the recorder lost.
    pub lost_samples: u64,
    /// How many of those come after the last sample that was not lost: in files that leave lost samples out,
    /// no row shows them.
    pub lost_at_end: u64,
    /// Origin and marks of the trace.
    pub metadata: Metadata,
}

impl TraceHeader {
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

/// Consecutive samples of a trace.
#[derive(Clone, Copy, Debug)]
pub struct TraceChunk<'a> {
    /// Number of the first in the whole trace, from 0.
    pub first: u64,
    /// Voltage of each, V.
    pub voltage_v: &'a [f32],
    /// Current of each, A; as many.
    pub current_a: &'a [f32],
    /// Whether the recorder lost them: then they lie on the line between their neighbours, and files leave
    /// them out.
    pub lost: bool,
}

impl TraceChunk<'_> {
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

    /// A part, by indices.
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

/// A destination of samples.
pub trait TraceWriter: Send {
    /// Writes the samples after those written before.
    ///
    /// # Errors
    /// [`WriteError`] if they cannot be written; the rest is then not written.
    fn write(&mut self, chunk: &TraceChunk<'_>) -> Result<(), WriteError>;
}

/// A source of samples, which can be read any number of times.
pub trait TraceReader {
    /// The header.
    fn header(&self) -> TraceHeader;

    /// Writes all samples to `writer`, in order, none twice and none left out.
    ///
    /// # Errors
    /// The errors of `writer`, or [`WriteError::Read`] where the samples cannot be read.
    fn read_into(&self, writer: &mut dyn TraceWriter) -> Result<(), WriteError>;
}

impl TraceReader for Trace {
    fn header(&self) -> TraceHeader {
        TraceHeader {
            start_s: self.start_s(),
            rate_hz: self.rate_hz(),
            samples: self.samples() as u64,
            lost_samples: self.lost_samples() as u64,
            lost_at_end: lost_at_end(self.lost(), self.samples()),
            metadata: self.metadata.clone(),
        }
    }

    fn read_into(&self, writer: &mut dyn TraceWriter) -> Result<(), WriteError> {
        let mut from = 0;
        let whole =
            TraceChunk { first: 0, voltage_v: self.voltage_v(), current_a: self.current_a(), lost: false };
        for lost in self.lost() {
            writer.write(&whole.part(from, lost.start))?;
            writer.write(&TraceChunk { lost: true, ..whole.part(lost.start, lost.end) })?;
            from = lost.end;
        }
        writer.write(&whole.part(from, self.samples()))
    }
}

/// For tests: a trace in pieces of some size.
#[cfg(test)]
pub(crate) struct SplitTrace<'a>(pub &'a Trace, pub usize);

#[cfg(test)]
impl TraceReader for SplitTrace<'_> {
    fn header(&self) -> TraceHeader {
        self.0.header()
    }

    fn read_into(&self, writer: &mut dyn TraceWriter) -> Result<(), WriteError> {
        let (voltage_v, current_a) = (self.0.voltage_v(), self.0.current_a());
        let whole = TraceChunk { first: 0, voltage_v, current_a, lost: false };
        let ends = |from: usize| whole.part(from, whole.len().min(from + self.1));
        (0..whole.len()).step_by(self.1).try_for_each(|from| writer.write(&ends(from)))
    }
}
