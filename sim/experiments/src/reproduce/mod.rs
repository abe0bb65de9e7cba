//! Reproduction of papers: each claim is computed from scratch and compared with the paper. A paper is a
//! module; a row of the list of claims is a function.
//!
//! ```text
//! settings -> scenes -> Stage (pipeline, clock, watts) -> TracedRun (pacing, surroundings, recorder, analysis) -> ClaimRow, Figure
//! ```
//!
//! Inputs come from the papers only. A committed file of settings for each paper has what it states and what
//! it leaves open. The verdict of a row is over all values of open settings (`Band`).

mod paper2;
mod paper3;
mod paper6;
mod report;
mod row;
mod settings;
mod stage;

use std::path::PathBuf;

use output::Destination;
use output::terminal::Progress;
use run::RunError;
use serde::Serialize;
use settings::Form;

pub use report::{Figure, PaperReport};
pub use row::{Band, ClaimRow, NamedValue, SettingCase, Turn, Verdict};
pub use settings::{About, AgreementKind, Listed, SettingsOrigin};

/// Papers with reproduced claims.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Paper {
    /// Performance per What?
    #[serde(rename = "II")]
    Two,
    /// Measuring Per-Frame Energy Consumption of Real-Time Graphics Applications
    #[serde(rename = "III")]
    Three,
    /// Design and Novel Uses of Higher-Dimensional Rasterization
    #[serde(rename = "VI")]
    Six,
}

impl Paper {
    /// All papers.
    pub const ALL: [Self; 3] = [Self::Two, Self::Three, Self::Six];

    /// Number of the paper.
    pub const fn number(self) -> &'static str {
        match self {
            Self::Two => "II",
            Self::Three => "III",
            Self::Six => "VI",
        }
    }

    /// Title of the paper.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Two => "Performance per What?",
            Self::Six => "Design and Novel Uses of Higher-Dimensional Rasterization",
            Self::Three => "Measuring Per-Frame Energy Consumption of Real-Time Graphics Applications",
        }
    }
}

impl Paper {
    /// The ids of its rows.
    fn rows(self) -> Vec<&'static str> {
        match self {
            Self::Two => paper2::ids(),
            Self::Three => paper3::ids(),
            Self::Six => paper6::ids(),
        }
    }
}

/// Options of a reproduction.
#[derive(Clone, Debug, Default)]
pub struct ReproduceOptions {
    /// Quick form: fewer values and less work, some minutes at most.
    pub quick: bool,
    /// Ids of the rows to compute; empty for all.
    pub rows: Vec<String>,
    /// A file of settings in place of the committed one.
    pub settings: Option<PathBuf>,
    /// A folder with public cases of collision detection.
    pub collision_data: Option<PathBuf>,
}

impl ReproduceOptions {
    fn form(&self) -> Form {
        if self.quick { Form::Quick } else { Form::Full }
    }

    /// Whether a row is requested.
    fn wants(&self, id: &str) -> bool {
        self.rows.is_empty() || self.rows.iter().any(|row| row.eq_ignore_ascii_case(id))
    }

    /// Refuses unknown rows, and data that no requested row reads.
    fn check(&self, paper: Paper) -> Result<(), RunError> {
        let ids = paper.rows();
        let unknown = self.rows.iter().find(|row| !ids.iter().any(|id| id.eq_ignore_ascii_case(row)));
        if let Some(row) = unknown {
            return Err(RunError::setting(format_args!(
                "no row `{row}` in Paper {}; its rows: {}",
                paper.number(),
                ids.join(", ")
            )));
        }
        if self.collision_data.is_some() && !(paper == Paper::Six && self.wants(paper6::READS_COLLISION_DATA))
        {
            let row = paper6::READS_COLLISION_DATA;
            return Err(RunError::setting(format_args!(
                "--collision-data is read by row {row} alone: leave it out, or compute that row"
            )));
        }
        Ok(())
    }
}

/// A row with its figures.
struct Done {
    row: ClaimRow,
    figures: Vec<Figure>,
}

impl Done {
    /// A row without a figure.
    fn bare(row: ClaimRow) -> Self {
        Self { row, figures: Vec::new() }
    }
}

/// Computes the requested rows of `paper`.
///
/// # Errors
/// If settings are invalid or a simulation fails. A row that differs is no error.
pub fn compute(
    paper: Paper,
    options: &ReproduceOptions,
    progress: &Progress,
) -> Result<PaperReport, RunError> {
    options.check(paper)?;
    let (origin, done) = match paper {
        Paper::Two => paper2::rows(options, progress),
        Paper::Three => paper3::rows(options, progress),
        Paper::Six => paper6::rows(options, progress),
    }?;
    Ok(PaperReport::new(paper, options.form(), origin, done))
}

/// Computes the requested rows and writes table and figures into `out`.
///
/// # Errors
/// As [`compute`], and if `out` cannot be written, or has a larger result and `--force` is missing.
pub fn reproduce(
    paper: Paper,
    options: &ReproduceOptions,
    out: &Destination,
    progress: &Progress,
) -> Result<PaperReport, RunError> {
    options.check(paper)?;
    report::check_earlier(paper, options, out)?;
    // The folder first: that it cannot be made is better known before the work than after it.
    let mut dir = out.open([report::claim(paper)])?;
    let report = compute(paper, options, progress)?;
    report.write(&dir)?;
    dir.publish()?;
    Ok(report)
}
