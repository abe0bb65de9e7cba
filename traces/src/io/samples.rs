//! The header of a trace and its JSON description; readers and writers of samples, in pieces, so that no trace has
//! to fit into memory.
//!
//! A [`TraceReader`] is a trace in memory or a file; a [`TraceWriter`] is the writer of a format, or anything
//! else that needs all samples once. Writers take samples in pieces only, so that a trace in memory and a
//! file of any length are written in the same way, and the bytes do not depend on where pieces end.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{CURRENT_A, ReadError, TIME_NS, TIME_S, VOLTAGE_V, WriteError};
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
    /// Left edge of a sample to the nearest nanosecond.
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

/// Version of the description; it only gains keys.
const VERSION: u32 = 1;
/// The key of the description in the metadata of a Parquet file, and another one under which it is read.
pub(super) const KEYS: [&str; 2] = ["trace", "power_trace"];

/// The description: what the columns do not show, and the exact rate and start, which rounded time stamps
/// lose.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Description {
    pub version: u32,
    #[serde(alias = "sample_rate_hz")]
    pub rate_hz: Option<f64>,
    pub start_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub samples: Option<u64>,
    /// How many samples were lost after the last row.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost_at_end: Option<u64>,
    pub units: BTreeMap<String, serde_json::Value>,
    #[serde(flatten)]
    pub metadata: Metadata,
}

/// The description of a trace as JSON, `pretty` or on one line.
pub(super) fn to_json(trace: &TraceHeader, pretty: bool) -> Result<String, WriteError> {
    let samples = trace.samples - trace.lost_samples;
    let mut description = describe(trace.rate_hz, trace.start_s, Some(samples), &trace.metadata)?;
    description.lost_at_end = Some(trace.lost_at_end).filter(|lost| *lost > 0);
    let json =
        if pretty { serde_json::to_string_pretty(&description) } else { serde_json::to_string(&description) };
    json.map_err(|error| WriteError::Encode(error.to_string()))
}

/// The description of a trace.
pub(super) fn describe(
    rate_hz: f64,
    start_s: f64,
    samples: Option<u64>,
    metadata: &Metadata,
) -> Result<Description, WriteError> {
    if let Some((index, mark)) = metadata.marks.iter().enumerate().find(|(_, mark)| !mark.time_s.is_finite())
    {
        return Err(WriteError::Mark { index, time_s: mark.time_s });
    }
    let mut metadata = metadata.clone();
    for key in ["version", "rate_hz", "sample_rate_hz", "start_s", "samples", "units"] {
        metadata.other.remove(key);
    }
    let unit = |(column, unit): (&str, &str)| (column.to_owned(), serde_json::Value::from(unit));
    Ok(Description {
        version: VERSION,
        rate_hz: Some(rate_hz),
        start_s: Some(start_s),
        samples,
        lost_at_end: None,
        units: [(TIME_NS, "ns"), (TIME_S, "s"), (VOLTAGE_V, "V"), (CURRENT_A, "A")].map(unit).into(),
        metadata,
    })
}

impl Description {
    /// The JSON text under its key, on one line, to distinguish it from the notes of other programs.
    pub(super) fn to_keyed_json(&self) -> Result<String, WriteError> {
        let json = serde_json::to_string(&BTreeMap::from([(KEYS[0], self)]));
        json.map_err(|error| WriteError::Encode(error.to_string()))
    }

    /// The description among the notes of a program, in JSON; `None` if it is not there.
    pub(super) fn from_keyed_json(path: &Path, json: &str) -> Result<Option<Self>, ReadError> {
        let Ok(mut notes) = serde_json::from_str::<BTreeMap<String, serde_json::Value>>(json) else {
            return Ok(None);
        };
        match KEYS.iter().find_map(|key| notes.remove(*key)) {
            Some(description) if description.is_object() => {
                Self::from_json(path, &description.to_string()).map(Some)
            }
            _ => Ok(None),
        }
    }

    /// Reads a description. Unknown keys go into [`Metadata::other`].
    pub(super) fn from_json(path: &Path, json: &str) -> Result<Self, ReadError> {
        let refuse = |reason: String| ReadError::Description { path: path.to_owned(), reason };
        let description: Self = serde_json::from_str(json).map_err(|error| refuse(error.to_string()))?;
        match description.rate_hz {
            Some(rate_hz) if !(rate_hz.is_finite() && rate_hz > 0.0) => {
                Err(refuse(format!("rate_hz is {rate_hz}, not above 0")))
            }
            _ => Ok(description),
        }
    }

    /// Time of a row by rate and start, s: of files without times.
    pub(crate) fn time_s(&self, row: usize) -> f64 {
        self.start_s.unwrap_or(0.0) + row as f64 / self.rate_hz.unwrap_or(f64::INFINITY)
    }

    /// Refuses a file that ends before the recording did.
    pub(crate) fn check_end(&self, path: &Path) -> Result<(), ReadError> {
        match self.lost_at_end.filter(|lost| *lost > 0) {
            Some(lost) => Err(ReadError::LostEnd { path: path.to_owned(), lost }),
            None => Ok(()),
        }
    }

    /// Compares the stated number of samples with the rows found.
    pub(crate) fn check_rows(&self, path: &Path, found: u64) -> Result<(), ReadError> {
        match self.samples {
            Some(stated) if stated != found => Err(ReadError::Rows { path: path.to_owned(), found, stated }),
            _ => Ok(()),
        }
    }
}
