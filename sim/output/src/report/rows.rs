//! Rows of the report's tables.

use serde::Serialize;

/// Name and value, for example of a setting.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FactRow {
    /// Name.
    pub name: String,
    /// Value with its unit.
    pub value: String,
    /// Note; may be empty.
    pub note: String,
}

impl FactRow {
    /// Row without a note.
    pub fn new(name: impl Into<String>, value: impl Into<String>) -> Self {
        Self { name: name.into(), value: value.into(), note: String::new() }
    }
}

/// Warning.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WarningRow {
    /// Warning code.
    pub code: String,
    /// Message.
    pub message: String,
    /// Affected things, if there are several.
    pub details: Vec<String>,
}

/// A part of the energy of the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PartRow {
    /// A unit, `constant`, `leakage`, `clock tree`.
    pub name: String,
    /// Description, one sentence.
    pub doc: String,
    /// Colour in CSS notation, the same as in plots.
    pub colour: String,
    /// Whether this is idle energy between frames.
    pub idle: bool,
    /// Energy in joules.
    pub energy_j: f64,
}

/// Time, energy and mean power of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FrameNumbers {
    /// Time to the start of the next frame, in seconds.
    pub time_s: f64,
    /// Energy over that time, in joules.
    pub energy_j: f64,
    /// Mean power in watts.
    pub power_w: f64,
}

/// Row of a frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FrameRow {
    /// Its number.
    pub frame: u64,
    /// Start in seconds.
    pub start_s: f64,
    /// Busy time in seconds, if known.
    pub busy_s: Option<f64>,
    /// Measured in the trace; `None` if the frame was not found.
    pub measured: Option<FrameNumbers>,
    /// Ground truth of the simulator; `None` for a recording.
    pub truth: Option<FrameNumbers>,
    /// Flags, for example `warm-up`; may be empty.
    pub flags: String,
}

/// Row of a unit.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct UnitRow {
    /// Its name.
    pub name: String,
    /// Description, one sentence.
    pub doc: String,
    /// Share of the frames' busy time in which the unit was busy, 0 to 1; `None` if it was not timed.
    pub busy: Option<f64>,
    /// Whether the run modelled it.
    pub modelled: bool,
    /// Note on the model; may be empty.
    pub note: String,
}

/// Row of a counter.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CounterRow {
    /// Unit of the counter.
    pub unit: String,
    /// Name in files.
    pub name: String,
    /// Description of one event.
    pub doc: String,
    /// Sum over the run.
    pub total: u64,
    /// Mean per frame.
    pub per_frame: f64,
    /// Mean per pixel of a frame.
    pub per_pixel: f64,
}

/// A file beside the report.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FileLink {
    /// Path relative to the report, with `/` between folders.
    pub path: String,
    /// Description of the contents.
    pub what: String,
}
