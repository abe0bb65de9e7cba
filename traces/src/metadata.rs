//! Metadata of a trace: its origin and its marks.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

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
    /// Its meaning.
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
