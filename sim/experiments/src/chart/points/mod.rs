//! `quintile chart points`: quality of points that keep their distance over points a second, spectra, and where it fails.
//!
//! Times are of the CPU, of one thread.

mod failures;
mod measure;
mod tables;

use serde::Serialize;

use super::ChartError;
use output::OutDir;
use output::plot::Look;
use output::progress::Progress;

pub use failures::{Coarse, Columns};
pub use measure::Row;
pub use tables::claim;

/// How much is measured.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Effort {
    /// Least distance in the plane and in space.
    pub radius: [f64; 2],
    /// Places tried to find what is still free.
    pub darts: u64,
    /// Points of other seeds that a spectrum is the mean of.
    pub seeds: u64,
    /// Numbers in a unit of length get finer up to 2 to this power, from the fewest that the least distance of that sweep may have.
    pub finest_bits: u32,
    /// Points that follow a density.
    pub white: usize,
}

impl Effort {
    /// The chart of the book.
    pub const FULL: Self =
        Self { radius: [0.01, 0.06], darts: 1_000_000, seeds: 4, finest_bits: 26, white: 200_000 };
    /// A look in seconds.
    pub const QUICK: Self =
        Self { radius: [0.025, 0.1], darts: 100_000, seeds: 2, finest_bits: 22, white: 20_000 };
}

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct PointsChart {
    /// How much was measured.
    pub effort: Effort,
    /// Dimension by dimension, method by method.
    pub rows: Vec<Row>,
    /// Voids thinner than the spacing of numbers.
    pub coarse: Vec<Coarse>,
    /// Candidates for a point that follows a density.
    pub columns: Vec<Columns>,
}

/// Measures the chart and writes it into `dir`.
///
/// # Errors
/// [`ChartError`], above all when `dir` cannot be written to.
pub fn chart(
    effort: Effort,
    dir: &OutDir,
    look: &Look,
    progress: &Progress,
) -> Result<PointsChart, ChartError> {
    let bar = progress.bar("points", 14);
    let failed = |message: String| ChartError::Pipeline(message);
    let mut rows = measure::rows::<2>(&effort, effort.radius[0], &bar).map_err(|e| failed(e.to_string()))?;
    rows.extend(measure::rows::<3>(&effort, effort.radius[1], &bar).map_err(|e| failed(e.to_string()))?);
    let coarse = failures::coarse(&effort).map_err(|e| failed(e.to_string()))?;
    bar.inc();
    let columns = failures::columns(&effort).map_err(|e| failed(e.to_string()))?;
    bar.inc();
    let chart = PointsChart { effort, rows, coarse, columns };
    tables::write(&chart, dir, look)?;
    Ok(chart)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quick_chart_is_written_and_the_maximal_method_alone_is_maximal() {
        let effort = Effort { radius: [0.06, 0.2], darts: 5000, seeds: 1, finest_bits: 16, white: 2000 };
        let out = tempfile::tempdir().unwrap();
        let chart = OutDir::with(out.path(), claim(), |dir| {
            chart(effort, dir, &Look::default(), &Progress::new(true))
        })
        .unwrap()
        .unwrap();
        for row in &chart.rows {
            let maximal = row.hole_over_r <= 1.0 + 1e-9;
            assert_eq!(maximal, row.method == measure::VOIDS, "{row:?}");
            assert!(row.closer_pairs == 0 && row.points_per_s > 0.0, "{row:?}");
        }
        for file in
            ["points_quality.svg", "points_spectra.svg", "points_failures.png", "points.csv", "points.json"]
        {
            assert!(out.path().join(file).exists(), "{file}");
        }
    }
}
