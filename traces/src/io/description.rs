//! The JSON description of a trace.

use super::samples::TraceHeader;
use super::{CURRENT_A, ReadError, TIME_NS, TIME_S, VOLTAGE_V, WriteError};
use crate::trace::Metadata;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

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
