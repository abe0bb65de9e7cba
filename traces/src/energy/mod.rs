//! Energy between any two times, and per frame; the table of frames, `frames.csv`; found frames compared with
//! the ground truth.

mod idle;
mod integral;
mod run;
mod statistics;

use crate::io::csv::push_decimal;
pub use crate::pairing::{TOLERANCE_S, found_beside_true, pairs, true_beside_found, true_frames};
pub use crate::stats::Spread;
use core::ops::Range;
pub use idle::{
    Idle, IdleTooShort, SegmentEnergy, SegmentError, clipped_current, idle_in_frames, negative_power,
};
pub(crate) use integral::Sums;
pub use integral::{FrameEnergy, PowerIntegral, TrueFrame, energies_j, finishes_s, levels_w};
use rayon::prelude::*;
pub use run::{
    FramePart, FramePartError, InverseUnits, RunEnergy, RunEnergyError, RunEnergyOptions, check_parts,
    parts_j,
};
use serde::Serialize;
pub use statistics::{
    FrameSummary, Histogram, Pooled, Repeats, WarmUp, mean_over_discarded, outliers, pooled, warm_up, whole,
};
use std::io::Write;
use thiserror::Error;

/// The columns of `frames.csv`, in order. Later versions only add columns at the end.
///
/// Cells are empty where nothing is known: energy per pixel without a number of pixels, truth without a
/// simulator.
pub const TABLE_COLUMNS: [&str; 12] = [
    "frame",
    "start_s",
    "end_s",
    "duration_s",
    "energy_J",
    "power_W",
    "energy_per_pixel_J",
    "confidence",
    "flags",
    "true_start_s",
    "true_energy_J",
    "outlier",
];

/// Rows that a thread formats at once.
const TASK_ROWS: usize = 4096;
/// Such batches of rows that are written at once.
const HELD_TASKS: usize = 8;
/// Bytes of a row, about.
const ROW_BYTES: usize = 136;

/// Why a table could not be built or written.
#[derive(Debug, Error)]
pub enum FrameTableError {
    /// The truth has another number of rows than the frames.
    #[error("{frames} frames but {truths} true frames: give one (or none) per frame")]
    Truth {
        /// Measured frames.
        frames: usize,
        /// True frames.
        truths: usize,
    },
    /// An extra column has another number of cells than there are frames.
    #[error("column `{name}` has {cells} cells for {frames} frames: give one per frame")]
    Column {
        /// Name of the column.
        name: &'static str,
        /// Cells of the column.
        cells: usize,
        /// Measured frames.
        frames: usize,
    },
    /// Writing failed.
    #[error("cannot write the table of frames: {0}")]
    Write(#[from] std::io::Error),
}

/// A column after those of [`TABLE_COLUMNS`]: its name, and a cell for each frame that needs no quotes.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtraColumn {
    /// The name in the header.
    pub name: &'static str,
    /// One per frame.
    pub cells: Vec<String>,
}

/// Frames on their way to `frames.csv`.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameTable {
    frames: Vec<FrameEnergy>,
    pixels: Option<u64>,
    /// One per frame, or none at all.
    truth: Vec<Option<TrueFrame>>,
    outliers: Vec<bool>,
    extra: Vec<ExtraColumn>,
}

impl FrameTable {
    /// A table of measured frames; `pixels` per frame where known.
    pub fn new(frames: Vec<FrameEnergy>, pixels: Option<u64>) -> Self {
        let outliers = outliers(&frames.iter().map(|frame| frame.energy_j).collect::<Vec<_>>());
        Self { frames, pixels, truth: Vec::new(), outliers, extra: Vec::new() }
    }

    /// Adds the ground truth of each frame (`None` for a false one).
    ///
    /// # Errors
    /// [`FrameTableError::Truth`] unless there is one entry per frame.
    pub fn with_truth(self, truth: Vec<Option<TrueFrame>>) -> Result<Self, FrameTableError> {
        if truth.len() != self.frames.len() {
            return Err(FrameTableError::Truth { frames: self.frames.len(), truths: truth.len() });
        }
        Ok(Self { truth, ..self })
    }

    /// Adds columns at the end.
    ///
    /// # Errors
    /// [`FrameTableError::Column`] unless each has one cell per frame.
    pub fn with_columns(self, extra: Vec<ExtraColumn>) -> Result<Self, FrameTableError> {
        if let Some(column) = extra.iter().find(|column| column.cells.len() != self.frames.len()) {
            let (name, cells, frames) = (column.name, column.cells.len(), self.frames.len());
            return Err(FrameTableError::Column { name, cells, frames });
        }
        Ok(Self { extra, ..self })
    }

    /// The frames.
    pub fn frames(&self) -> &[FrameEnergy] {
        &self.frames
    }

    /// Which frames differ in energy from those around them.
    pub fn outliers(&self) -> &[bool] {
        &self.outliers
    }

    /// Writes the table as CSV with the header [`TABLE_COLUMNS`] and the names of extra columns; numbers in
    /// the shortest form that reads back the same.
    ///
    /// # Errors
    /// [`FrameTableError`] if the writer fails.
    pub fn write_csv<W: Write>(&self, mut out: W) -> Result<(), FrameTableError> {
        let extra = self.extra.iter().map(|column| column.name);
        writeln!(out, "{}", TABLE_COLUMNS.into_iter().chain(extra).collect::<Vec<_>>().join(","))?;
        // Numbers take longer to write down than to find: many rows at once on every thread, the next while
        // some go to the file.
        let step = HELD_TASKS * TASK_ROWS;
        let mut batches = self.batches(0, step);
        for from in (step..self.frames.len() + step).step_by(step) {
            let mut next = Vec::new();
            rayon::in_place_scope(|scope| {
                scope.spawn(|_| next = self.batches(from, from + step));
                batches.iter().try_for_each(|rows| out.write_all(rows))
            })?;
            batches = next;
        }
        out.flush()?;
        Ok(())
    }

    /// The text of all rows, formatted in parallel.
    fn batches(&self, from: usize, to: usize) -> Vec<Vec<u8>> {
        let to = to.min(self.frames.len());
        let firsts = (from..to).into_par_iter().step_by(TASK_ROWS);
        firsts.map(|first| self.rows(first..to.min(first + TASK_ROWS))).collect()
    }

    /// The text of some rows. No cell needs quotes.
    fn rows(&self, range: Range<usize>) -> Vec<u8> {
        let mut rows = Vec::with_capacity(range.len() * ROW_BYTES);
        for index in range {
            self.row(index, &mut rows);
        }
        rows
    }

    fn row(&self, index: usize, out: &mut Vec<u8>) {
        let frame = &self.frames[index];
        let truth = self.truth.get(index).and_then(Option::as_ref);
        let per_pixel_j = self.pixels.and_then(|pixels| frame.energy_per_pixel_j(pixels));
        let known = |value: f64| Some(value);
        // Writing to memory does not fail.
        let _ = write!(out, "{index}");
        let measured = [frame.start_s, frame.end_s, frame.duration_s(), frame.energy_j, frame.power_w()];
        cells(out, measured.map(known));
        cells(out, [per_pixel_j, known(frame.confidence)]);
        let _ = write!(out, ",{}", frame.flags);
        cells(out, [truth.map(|truth| truth.start_s), truth.map(|truth| truth.energy_j)]);
        let _ = write!(out, ",{}", u8::from(self.outliers[index]));
        self.extra.iter().for_each(|column| drop(write!(out, ",{}", column.cells[index])));
        out.push(b'\n');
    }
}

/// Appends numbers, or nothing where one is not known, each after a comma.
fn cells<const N: usize>(out: &mut Vec<u8>, values: [Option<f64>; N]) {
    for value in values {
        out.push(b',');
        if let Some(value) = value {
            push_decimal(out, value);
        }
    }
}

/// How well found frames agree with true ones. Counts; the rates are functions of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Score {
    /// True frames.
    pub truth: usize,
    /// Found frames.
    pub found: usize,
    /// Pairs, one to one, of starts within the tolerance.
    pub matched: usize,
    /// Found start less true start of each pair, s, in order.
    pub timing_errors_s: Vec<f64>,
    /// Relative energy error of each pair whose frame also ends right (its end is the next true frame's
    /// partner), in order.
    pub energy_errors: Vec<f64>,
}

/// Scores found frames, both sorted by start.
pub fn score(found: &[FrameEnergy], truth: &[TrueFrame], tolerance_s: f64) -> Score {
    let found_s: Vec<f64> = found.iter().map(|frame| frame.start_s).collect();
    let truth_s: Vec<f64> = truth.iter().map(|frame| frame.start_s).collect();
    let pairs = pairs(&found_s, &truth_s, tolerance_s);
    let clean = pairs.windows(2).filter(|two| two[1] == (two[0].0 + 1, two[0].1 + 1)).map(|two| two[0]);
    let error = |(f, t): (usize, usize)| {
        let true_j = truth[t].energy_j;
        (true_j != 0.0).then(|| (found[f].energy_j - true_j) / true_j)
    };
    Score {
        truth: truth.len(),
        found: found.len(),
        matched: pairs.len(),
        timing_errors_s: pairs.iter().map(|&(f, t)| found_s[f] - truth_s[t]).collect(),
        energy_errors: clean.filter_map(error).collect(),
    }
}

/// The true frame beside each found one, for
/// [`FrameTable::with_truth`](crate::energy::FrameTable::with_truth).
pub fn truth_beside(found: &[FrameEnergy], truth: &[TrueFrame], tolerance_s: f64) -> Vec<Option<TrueFrame>> {
    let found_s: Vec<f64> = found.iter().map(|frame| frame.start_s).collect();
    let truth_s: Vec<f64> = truth.iter().map(|frame| frame.start_s).collect();
    let beside = true_beside_found(&found_s, &truth_s, tolerance_s);
    beside.into_iter().map(|place| place.map(|place| truth[place])).collect()
}

impl Score {
    /// Share of the found starts that are true; 0 if none was found.
    pub fn precision(&self) -> f64 {
        share(self.matched, self.found)
    }

    /// Share of the true starts that were found; 0 if there is none.
    pub fn recall(&self) -> f64 {
        share(self.matched, self.truth)
    }

    /// Harmonic mean of precision and recall.
    pub fn f1(&self) -> f64 {
        share(2 * self.matched, self.found + self.truth)
    }

    /// Median of |timing error|, s.
    pub fn median_timing_error_s(&self) -> Option<f64> {
        median_of_magnitudes(&self.timing_errors_s)
    }

    /// Worst |timing error|, s.
    pub fn worst_timing_error_s(&self) -> Option<f64> {
        self.timing_errors_s.iter().map(|error| error.abs()).reduce(f64::max)
    }

    /// Median of |relative energy error| of the frames whose two ends were found.
    pub fn median_energy_error(&self) -> Option<f64> {
        median_of_magnitudes(&self.energy_errors)
    }

    /// Worst |relative energy error| of the frames whose two ends were found.
    pub fn worst_energy_error(&self) -> Option<f64> {
        self.energy_errors.iter().map(|error| error.abs()).reduce(f64::max)
    }
}

fn share(part: usize, whole: usize) -> f64 {
    if whole == 0 { 0.0 } else { part as f64 / whole as f64 }
}

fn median_of_magnitudes(values: &[f64]) -> Option<f64> {
    let magnitudes: Vec<f64> = values.iter().map(|value| value.abs()).collect();
    Spread::of(&magnitudes).map(|spread| spread.median)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{Flag, Flags};

    fn frame() -> FrameEnergy {
        let mut flags = Flags::default();
        flags.insert(Flag::Marked);
        flags.insert(Flag::Last);
        FrameEnergy { start_s: 0.25, end_s: 0.75, energy_j: 0.125, confidence: 1.0, flags }
    }

    #[test]
    fn extra_columns_stand_at_the_end_and_need_a_cell_per_frame() {
        let column = |cells: &[&str]| ExtraColumn {
            name: "predicted",
            cells: cells.iter().map(|&cell| cell.to_owned()).collect(),
        };
        let table = FrameTable::new(vec![frame(), frame()], None);
        let mut out = Vec::new();
        table.clone().with_columns(vec![column(&["1", ""])]).unwrap().write_csv(&mut out).unwrap();
        let text = String::from_utf8(out).unwrap();
        let ends: Vec<_> = text.lines().map(|line| line.rsplit(',').next().unwrap()).collect();
        assert_eq!(ends, ["predicted", "1", ""]);
        let error = table.with_columns(vec![column(&["1"])]).unwrap_err();
        assert_eq!(error.to_string(), "column `predicted` has 1 cells for 2 frames: give one per frame");
    }

    #[test]
    fn golden_rows_with_and_without_truth() {
        let truth = TrueFrame { start_s: 0.25, energy_j: 0.124 };
        let table =
            FrameTable::new(vec![frame(), frame()], Some(1000)).with_truth(vec![Some(truth), None]).unwrap();
        let mut out = Vec::new();
        table.write_csv(&mut out).unwrap();
        assert_eq!(
            String::from_utf8(out).unwrap(),
            "frame,start_s,end_s,duration_s,energy_J,power_W,energy_per_pixel_J,confidence,flags,true_start_s,true_energy_J,outlier\n\
             0,0.25,0.75,0.5,0.125,0.25,0.000125,1,marked+last,0.25,0.124,0\n\
             1,0.25,0.75,0.5,0.125,0.25,0.000125,1,marked+last,,,0\n"
        );
    }

    #[test]
    fn failures_say_what_is_wrong() {
        let error = FrameTable::new(vec![frame()], None).with_truth(vec![]).unwrap_err();
        assert!(error.to_string().contains("1 frames but 0 true frames"));
        struct Full;
        impl Write for Full {
            fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
                Err(std::io::Error::other("disk full"))
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        let error = FrameTable::new(vec![frame()], None).write_csv(Full).unwrap_err();
        assert!(error.to_string().contains("disk full"), "{error}");
    }

    fn found(start_s: f64, energy_j: f64) -> FrameEnergy {
        FrameEnergy { start_s, end_s: start_s + 1.0, energy_j, confidence: 1.0, flags: Flags::default() }
    }

    fn truth(start_s: f64, energy_j: f64) -> TrueFrame {
        TrueFrame { start_s, energy_j }
    }

    #[test]
    fn one_missed_one_false_one_late() {
        let found = [found(0.0, 1.0), found(1.01, 2.2), found(1.5, 1.0), found(3.0, 1.0)];
        let truth = [truth(0.0, 1.0), truth(1.0, 2.0), truth(2.0, 1.0), truth(3.0, 1.0), truth(4.0, 1.0)];
        let score = score(&found, &truth, 0.1);
        assert_eq!((score.matched, score.found, score.truth), (3, 4, 5));
        assert_eq!((score.precision(), score.recall()), (0.75, 0.6));
        assert!((score.f1() - 6.0 / 9.0).abs() < 1e-15);
        assert!((score.worst_timing_error_s().unwrap() - 0.01).abs() < 1e-12);
        // Only frame 0 has both ends right; frame 1 is followed by a false start.
        assert_eq!(score.energy_errors, [0.0]);
        assert_eq!(
            truth_beside(&found, &truth, 0.1).iter().map(Option::is_some).collect::<Vec<_>>(),
            [true, true, false, true]
        );
    }

    #[test]
    fn nothing_found_scores_zero() {
        let score = score(&[], &[truth(0.0, 1.0)], 0.1);
        assert_eq!((score.precision(), score.recall(), score.f1()), (0.0, 0.0, 0.0));
        assert_eq!((score.median_timing_error_s(), score.worst_energy_error()), (None, None));
    }
}
