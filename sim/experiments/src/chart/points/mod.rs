//! `quintile chart points`: quality of points that keep their distance over points a second, spectra, and where it fails.
//!
//! Times are of the CPU, of one thread.

mod failures;
mod measure;

use serde::Serialize;
use workloads::points::MAX_THIN_PER_POINT;

use crate::study::table::{Sheet, Table, fixed, plain};
use crate::study::tradeoff::{Metric, TradeoffPoint};
use crate::study::{Gallery, Study, StudyError};
use output::OutputError;
use output::plot::{ChartPanel, Scale, Series};
use output::progress::Progress;

pub use failures::{Coarse, Columns};
pub use measure::Row;

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

/// Everything the chart found.
#[derive(Clone, Debug, Serialize)]
pub struct PointsChart {
    /// How much was measured.
    pub effort: Effort,
    /// Dimension by dimension, method by method.
    pub rows: Vec<Row>,
    /// Voids thinner than an ulp.
    pub coarse: Vec<Coarse>,
    /// Candidates for a point that follows a density.
    pub columns: Vec<Columns>,
}

impl Study for PointsChart {
    const NAME: &'static str = "points";
    const ABOUT: &'static str =
        "Points of all kinds: quality over points a second, spectra, and where it fails";
    const PICTURES: &'static [&'static str] = &["points_quality", "points_spectra", "points_failures"];
    const FILES: &'static [&'static str] = &["points.csv", "points.md", "points.json"];

    type Effort = Effort;
    const FULL: Effort =
        Effort { radius: [0.01, 0.06], darts: 1_000_000, seeds: 4, finest_bits: 26, white: 200_000 };
    const QUICK: Effort =
        Effort { radius: [0.025, 0.1], darts: 100_000, seeds: 2, finest_bits: 22, white: 20_000 };

    fn measure(effort: Effort, _scenes: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let bar = progress.bar("points", 14);
        let [plane, space] = effort.radius;
        let mut rows = measure::rows::<2>(&effort, plane, &bar).map_err(StudyError::pipeline)?;
        rows.extend(measure::rows::<3>(&effort, space, &bar).map_err(StudyError::pipeline)?);
        let coarse = failures::coarse(&effort).map_err(StudyError::pipeline)?;
        bar.inc();
        let columns = failures::columns(&effort).map_err(StudyError::pipeline)?;
        bar.inc();
        Ok(Self { effort, rows, coarse, columns })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let [plane, space] = self.effort.radius;
        let subject = format!("torus, r {plane} in the plane and {space} in space; CPU time of one thread");
        to.chart("points_quality", ["Largest hole and free share over speed", &subject], self.quality())?;
        to.chart("points_spectra", ["Power over frequency, all directions", &subject], self.spectra())?;
        let subject = "points of the plane that keep their distance, on coarser and coarser numbers (marked: points-thin-voids), and candidates for points that follow a density";
        to.chart("points_failures", ["Where points fail", subject], self.failures())
    }

    fn tables(&self) -> Vec<Sheet> {
        let free = |free_share: f64| format!("{free_share:.1e}");
        let rows = Table::of(&self.rows)
            .column("dimensions", "D", |row| row.dimensions, plain)
            .data("method", |row| row.method)
            .data("effort", |row| row.effort)
            .shown("method", |row| row.name(), plain)
            .column("points", "points", |row| row.points, plain)
            .column("points_per_s", "points/s", |row| row.points_per_s, fixed(0))
            .column("packing_density", "density", |row| row.packing_density, fixed(4))
            .data("closer_pairs", |row| row.closer_pairs)
            .detail("closer", |row| row.closer_pairs, plain)
            .data("least_over_r", |row| row.least_over_r)
            .column("hole_over_r", "hole / r", |row| row.hole_over_r, fixed(5))
            .column("free_share", "free share", |row| row.free_share, free)
            .data("low_power", |row| row.low_power)
            .detail("low", |row| row.low_power, fixed(3))
            .data("peak_frequency", |row| row.peak.0)
            .column("peak_power", "peak", |row| row.peak.1, fixed(2))
            .detail("at", |row| row.peak.0, fixed(2))
            .csv("points.csv");
        let coarse = Table::of(&self.coarse)
            .shown("r in spacings of numbers", |c| c.radius_in_numbers, fixed(0))
            .shown("points", |c| c.points, plain)
            .shown("thin voids", |c| c.thin_voids, plain)
            .shown("hole beyond r", |c| c.beyond, |beyond| format!("{beyond:.1e} r"));
        let columns = Table::of(&self.columns)
            .detail("D", |c| c.dimensions, plain)
            .detail("columns", |c| c.across, plain)
            .detail("candidates a point", |c| c.candidates_each, fixed(3))
            .detail("p", |c| c.p, fixed(3))
            .detail("p, low discrepancy", |c| c.p_low_discrepancy, fixed(4));
        vec![rows.in_book().sheet(), coarse.in_book().sheet(), columns.in_book().sheet()]
    }

    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        let both = |row: &Row| {
            let cost = Metric::new("CPU time of a million points", "s", 1e6 / row.points_per_s);
            let errors = [
                Metric::new("largest hole beyond r", "r", (row.hole_over_r - 1.0).max(0.0)),
                Metric::new("share where a point would fit", "", row.free_share),
            ];
            let level = if row.effort == 0 { String::new() } else { format!("effort {}", row.effort) };
            let subject = format!("points that keep their distance ({}D)", row.dimensions);
            errors.map(|error| {
                TradeoffPoint::new(subject.clone(), [row.method, &level], [error.beside(0.0), cost])
            })
        };
        self.rows.iter().flat_map(both).collect()
    }
}

impl Row {
    /// Method and effort.
    fn name(&self) -> String {
        if self.effort == 0 { self.method.to_owned() } else { format!("{} {}", self.method, self.effort) }
    }
}

fn long_name(method: &str) -> &str {
    match method {
        "bridson" => "Bridson, more and more candidates",
        "plain" => "plain darts, more and more misses",
        _ => "voids",
    }
}

impl PointsChart {
    /// Rows of a dimension, a method's beside each other.
    fn by_method(&self, dimensions: usize) -> impl Iterator<Item = &[Row]> {
        let same = |a: &Row, b: &Row| (a.dimensions, a.method) == (b.dimensions, b.method);
        self.rows.chunk_by(same).filter(move |rows| rows[0].dimensions == dimensions)
    }

    fn quality(&self) -> Vec<ChartPanel> {
        let panel = |dimensions, up: &str, of: fn(&Row) -> f64| {
            let curve = |rows: &[Row]| {
                Series::curve(long_name(rows[0].method), rows.iter().map(|row| (row.points_per_s, of(row))))
            };
            let title = format!("{up}, {dimensions}D");
            ChartPanel::new(&title, ["points a second", up], self.by_method(dimensions).map(curve).collect())
        };
        vec![
            panel(2, "largest hole over r", |row| row.hole_over_r).on(Scale::Decades, Scale::Even),
            panel(3, "largest hole over r", |row| row.hole_over_r).on(Scale::Decades, Scale::Even),
            panel(2, "share where a point would fit", |row| row.free_share),
            panel(3, "share where a point would fit", |row| row.free_share),
        ]
    }

    fn spectra(&self) -> Vec<ChartPanel> {
        let panel = |dimensions| {
            let last = self.by_method(dimensions).filter_map(<[Row]>::last);
            let curve = |row: &Row| Series {
                note: format!("peak {:.2}", row.peak.1),
                ..Series::curve(row.method, row.spectrum.iter().copied())
            };
            let title = format!("{dimensions}D");
            ChartPanel::new(&title, ["frequency over rate of points", "power"], last.map(curve).collect())
        };
        vec![panel(2), panel(3)]
    }

    /// Numbers too coarse for the disks, and columns too few for the density.
    fn failures(&self) -> Vec<ChartPanel> {
        let coarse = |title: &str, up: &str, of: fn(&Coarse) -> f64| {
            let curve = Series::curve("voids, 2D", self.coarse.iter().map(|c| (c.radius_in_numbers, of(c))));
            let warned = |c: &&Coarse| c.thin_voids as f64 > MAX_THIN_PER_POINT * c.points as f64;
            let last = self.coarse.iter().rfind(warned);
            ChartPanel::new(title, ["r in spacings of numbers", up], vec![curve])
                .on(Scale::Doublings, Scale::Decades)
                .failing(last.map(|c| 0.0..c.radius_in_numbers), "a run warns")
        };
        let of = |dimensions: usize| {
            let rows = self.columns.iter().filter(move |c| c.dimensions == dimensions);
            Series::curve(format!("{dimensions}D"), rows.map(|c| (f64::from(c.across), c.candidates_each)))
        };
        let columns = (1..=4).map(of).collect();
        vec![
            coarse("voids thinner than an ulp", "voids without a number, a point", |c| {
                c.thin_voids as f64 / c.points as f64
            }),
            coarse("what that costs: holes", "largest hole beyond r, share of r", |c| c.beyond),
            ChartPanel::new(
                "too few columns under a bell",
                ["columns along an axis", "candidates for a point"],
                columns,
            )
            .on(Scale::Doublings, Scale::Decades),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::written;

    #[test]
    fn a_quick_chart_is_written_and_the_maximal_method_alone_is_maximal() {
        let effort = Effort { radius: [0.06, 0.2], darts: 5000, seeds: 1, finest_bits: 16, white: 2000 };
        let (_folder, chart, _) = written::<PointsChart>(effort);
        for row in &chart.rows {
            let maximal = row.hole_over_r <= 1.0 + 1e-9;
            assert_eq!(maximal, row.method == measure::VOIDS, "{row:?}");
            assert!(row.closer_pairs == 0 && row.points_per_s > 0.0, "{row:?}");
        }
    }
}
