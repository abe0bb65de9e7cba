//! The rows of the report's tables.

use serde::Serialize;

/// A name and a value, for example of a setting.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FactRow {
    /// What it is.
    pub name: String,
    /// What it says, with its unit.
    pub value: String,
    /// Where it comes from or what it means; may be empty.
    pub note: String,
}

impl FactRow {
    /// A fact without a note.
    pub fn new(name: impl Into<String>, value: impl Into<String>) -> Self {
        Self { name: name.into(), value: value.into(), note: String::new() }
    }
}

/// A coded remark.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WarningRow {
    /// A stable code in kebab case.
    pub code: String,
    /// What happened, where, and what it means for the results.
    pub message: String,
    /// The things it concerns, where it names several.
    pub details: Vec<String>,
}

/// A part of the energy of the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PartRow {
    /// A unit, `constant`, `leakage`, `clock tree`.
    pub name: String,
    /// What it is, in a sentence.
    pub doc: String,
    /// Its colour, the same as in the plots, as CSS writes it.
    pub colour: String,
    /// Whether it is drawn between frames rather than by them.
    pub idle: bool,
    /// Its energy in joules.
    pub energy_j: f64,
}

/// Time, energy and mean power of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FrameNumbers {
    /// From its start to the start of the next, in seconds.
    pub time_s: f64,
    /// Over that time, in joules.
    pub energy_j: f64,
    /// Energy over time, in watts.
    pub power_w: f64,
}

/// A frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FrameRow {
    /// Its number.
    pub frame: u64,
    /// When it starts, in seconds.
    pub start_s: f64,
    /// For how long the GPU worked on it, in seconds, where known.
    pub busy_s: Option<f64>,
    /// By the analysis of the trace; `None` where it found no such frame.
    pub measured: Option<FrameNumbers>,
    /// By the simulator; `None` for a recording.
    pub truth: Option<FrameNumbers>,
    /// Remarks, for example `warm-up`; may be empty.
    pub flags: String,
}

/// A unit of the block diagram.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct UnitRow {
    /// Its name.
    pub name: String,
    /// What it does, in a sentence.
    pub doc: String,
    /// The fraction of the frames' busy time in which it was serving work, 0 to 1; `None` where it was not timed.
    pub busy: Option<f64>,
    /// Whether the run modelled it.
    pub modelled: bool,
    /// How it was modelled, or why not; may be empty.
    pub note: String,
}

/// A counter.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CounterRow {
    /// The unit that counts.
    pub unit: String,
    /// The name used in files.
    pub name: String,
    /// What one of it is.
    pub doc: String,
    /// The sum over the run.
    pub total: u64,
    /// The mean per frame.
    pub per_frame: f64,
    /// The mean per pixel of a frame.
    pub per_pixel: f64,
}

/// A file beside the report.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FileLink {
    /// Relative to the report, with `/` between folders.
    pub path: String,
    /// What is in it.
    pub what: String,
}
