//! What the six papers report, computed from scratch and held against them: a module for each paper, a function for each row
//! of the list of claims.
//!
//! ```text
//! scenes -> Stage (pipeline, clock, watts) -> Recording (pacing, surroundings, recorder, analysis) -> Row, Figure
//! ```
//!
//! Nothing is looked up but what the papers themselves say.

mod figure;
mod paper2;
mod paper3;
mod paper6;
mod recording;
mod report;
mod row;
mod scenes;
mod stage;

use std::path::Path;

use serde::Serialize;

use crate::output::OutDir;
use crate::output::progress::Progress;
use crate::run::RunError;

pub use figure::Figure;
pub use report::Report;
pub use row::{Kind, Row, Verdict};

/// The papers whose rows there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
pub enum Paper {
    /// Performance per What? Energy-Efficiency Units for Graphics
    #[value(name = "II")]
    #[serde(rename = "II")]
    Two,
    /// Per-frame Energy Measurement Methodology for Computer Graphics
    #[value(name = "III")]
    #[serde(rename = "III")]
    Three,
    /// Design and Novel Uses of Higher-Dimensional Rasterization
    #[value(name = "VI")]
    #[serde(rename = "VI")]
    Six,
}

impl Paper {
    /// Its number.
    pub const fn number(self) -> &'static str {
        match self {
            Self::Two => "II",
            Self::Three => "III",
            Self::Six => "VI",
        }
    }

    /// Its title.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Two => "Performance per What? Energy-Efficiency Units for Graphics",
            Self::Six => "Design and Novel Uses of Higher-Dimensional Rasterization",
            Self::Three => "Per-frame Energy Measurement Methodology for Computer Graphics",
        }
    }
}

/// How much is simulated and recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Effort {
    /// Distinct frames of the PC's animation.
    pub pc_frames: u32,
    /// Every how many frames of the phone's sequence of 24 one is simulated.
    pub phone_step: u32,
    /// Frames in a recording of an animation.
    pub recorded_frames: usize,
    /// Frames in a recording of one frame drawn again and again.
    pub still_frames: usize,
    /// Recordings of the same thing.
    pub repeats: u64,
}

impl Effort {
    /// Minutes.
    pub const FULL: Self =
        Self { pc_frames: 36, phone_step: 1, recorded_frames: 144, still_frames: 900, repeats: 12 };
    /// Less than a minute.
    pub const QUICK: Self =
        Self { pc_frames: 6, phone_step: 4, recorded_frames: 72, still_frames: 600, repeats: 5 };
}

/// A row and what it draws.
struct Done {
    row: Row,
    figures: Vec<Figure>,
}

/// Computes every row of `paper`.
///
/// # Errors
/// When a part of the line fails; a row that differs is none.
pub fn compute(paper: Paper, effort: Effort, progress: &Progress) -> Result<Report, RunError> {
    let done = match paper {
        Paper::Two => paper2::rows(effort, progress),
        Paper::Three => paper3::rows(effort, progress),
        Paper::Six => paper6::rows(effort, progress),
    }?;
    Ok(Report::new(paper, effort, done))
}

/// Computes every row of `paper` and writes table and figures into `out`.
///
/// # Errors
/// As [`compute`], and when `out` cannot be written.
pub fn reproduce(paper: Paper, effort: Effort, out: &Path, progress: &Progress) -> Result<Report, RunError> {
    // The folder first: that it cannot be made is better known before the work than after it.
    let dir = OutDir::create(out)?;
    report::remove_stale(&dir, paper)?;
    let report = compute(paper, effort, progress)?;
    report.write(&dir)?;
    Ok(report)
}
