//! Stated error of a run: how far its cycles and its energy may be from those at timing level `stepped`.
//!
//! Errors are factors: an error of 0.05 says that the number at `stepped` is at most 1.05 times as large and at least 1/1.05
//! times. They are quantiles of errors that were measured on GPUs drawn at random, apart for each level, with and without its accuracy
//! warnings, so that they hold for 95 % of runs that are like those (split conformal prediction by groups; Papadopoulos et al. 2002, Vovk,
//! Gammerman and Shafer 2005). `quintile chart stated-errors` measures them, and how often they hold.

use std::sync::OnceLock;

use serde::{Deserialize, Serialize};
use timing::Level;

use crate::{Observed, RunFrame};

/// The measured errors, as `quintile chart stated-errors` writes them.
const TABLE: &str = include_str!("../stated_errors.csv");

/// Share of runs whose error is within the stated one.
pub const CONFIDENCE: f64 = 0.95;

/// Stated error of a run. Infinite without a bound, as `null` in JSON.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct StatedError {
    /// Of cycles.
    pub cycles: f64,
    /// Of the energy while busy.
    pub energy: f64,
}

/// A row of the table.
#[derive(Clone, Copy, Debug, Deserialize)]
struct Row {
    level: Level,
    warns: bool,
    #[cfg(test)]
    runs: u32,
    cycles: f64,
    energy: f64,
}

fn table() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| csv::Reader::from_reader(TABLE.as_bytes()).deserialize().flatten().collect())
}

impl StatedError {
    /// Without a bound.
    const UNKNOWN: Self = Self { cycles: f64::INFINITY, energy: f64::INFINITY };

    /// Stated error of a frame at a level, with or without accuracy warnings.
    pub fn at(level: Level, warns: bool) -> Self {
        if level == Level::Stepped {
            return Self::default();
        }
        let row = table().iter().find(|row| (row.level, row.warns) == (level, warns));
        row.map_or(Self::UNKNOWN, |row| Self { cycles: row.cycles, energy: row.energy })
    }

    /// Stated error of the sum over `frames`: the mean of those of simulated frames, by time, as errors of frames of one scene do not
    /// cancel.
    pub fn of_frames<'a>(level: Level, frames: impl IntoIterator<Item = &'a RunFrame>) -> Self {
        let (mut sum, mut time_s) = (Self::default(), 0.0);
        for frame in frames {
            let Some(Observed { accuracy, .. }) = frame.observed() else { continue };
            let (of, frame_s) = (Self::at(level, !accuracy.is_empty()), frame.power.duration_s());
            sum = Self { cycles: sum.cycles + of.cycles * frame_s, energy: sum.energy + of.energy * frame_s };
            time_s += frame_s;
        }
        if time_s > 0.0 { Self { cycles: sum.cycles / time_s, energy: sum.energy / time_s } } else { sum }
    }

    /// With a further error of a prediction, as relative half-widths. Errors are added, as one may be as large as it can while the
    /// other is.
    #[must_use]
    pub fn beside(self, cycles: f64, energy: f64) -> Self {
        Self { cycles: self.cycles + cycles, energy: self.energy + energy }
    }

    /// A line for the terminal and the report.
    pub fn line(&self) -> String {
        let percent = |error: f64| match error.is_finite() {
            true => format!("{:.1} %", 100.0 * error),
            false => "unknown".to_owned(),
        };
        format!("cycles {}, energy {}", percent(self.cycles), percent(self.energy))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_has_an_error_with_and_without_warnings() {
        assert_eq!(StatedError::at(Level::Stepped, false), StatedError::default());
        for level in [Level::Packet, Level::Bound] {
            for row in table().iter().filter(|row| row.level == level) {
                let error = StatedError::at(level, row.warns);
                // The bound is the n-th of n - 1 runs with fewer than 19, and so none.
                let is_known = row.runs >= 19;
                for share in [error.cycles, error.energy] {
                    assert!(share > 0.0 && share.is_finite() == is_known, "{level:?}: {error:?}");
                }
                assert!(is_known || row.warns, "{level:?}: too few runs without a warning");
            }
        }
        assert!(StatedError::at(Level::Packet, false).cycles < StatedError::at(Level::Bound, false).cycles);
        assert_eq!(table().len(), 4);
    }

    #[test]
    fn errors_of_predictions_are_added() {
        let sum = StatedError { cycles: 0.01, energy: 0.02 }.beside(0.03, 0.05);
        assert!((sum.cycles - 0.04).abs() < 1e-15 && (sum.energy - 0.07).abs() < 1e-15);
        assert_eq!(sum.line(), "cycles 4.0 %, energy 7.0 %");
        assert_eq!(StatedError::UNKNOWN.line(), "cycles unknown, energy unknown");
    }
}
