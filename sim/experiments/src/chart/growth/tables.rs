//! The files of the chart.

use std::fmt::Write;

use super::measure::LAYERS;
use super::{GrowthChart, Kind, Row, Sweep};
use output::dir::BoxError;
use output::plot::{Chart, ChartPanel, Look, Scale, Series};
use output::table::Table;
use output::{Claim, OutDir, OutputError};

/// The files of the chart.
pub fn claim() -> Claim {
    Claim::new("chart growth").plots(["growth"]).files(["growth.csv", "growth.md", "growth.json"])
}

/// Writes picture and numbers; `growth.json` comes last.
pub(super) fn write(chart: &GrowthChart, dir: &OutDir, look: &Look) -> Result<(), OutputError> {
    let (title, subject) = ("Time of the visibility engine", chart.subject());
    let panels = Sweep::ALL.map(|sweep| chart.panel(sweep)).into();
    Chart::new(title, &subject, panels).picture(look).write(dir, "growth")?;
    dir.write_file("growth.csv", |out| chart.csv(out))?;
    dir.write_file("growth.md", |out| Ok(out.write_all(chart.markdown().as_bytes())?))?;
    dir.write_json("growth.json", chart)?;
    Ok(())
}

const HEADER: [&str; 7] =
    ["growing", "what blurs", "exponent of time", "of sample tests", "fitted", "ms, first", "ms, last"];

impl GrowthChart {
    /// What is printed: the exponents.
    pub fn text(&self) -> String {
        let mut table = Table::new(HEADER);
        for row in &self.rows {
            table.row(row.cells());
        }
        format!("{table}\n{}\n", self.subject())
    }

    /// The table of the book's chapter.
    fn markdown(&self) -> String {
        let mut text = format!("| {} |\n{}|\n", HEADER.join(" | "), "|---".repeat(HEADER.len()));
        for row in &self.rows {
            // Writing into a string cannot fail.
            let _ = writeln!(text, "| {} |", row.cells().join(" | "));
        }
        text
    }

    fn subject(&self) -> String {
        let (side, repeats) = (self.effort.side_px, self.effort.repeats);
        format!(
            "CPU time of one thread, median of {repeats}; {side}x{side} pixels, triangles cover them {LAYERS} times; \
             numbers are exponents, fitted over the upper half of each axis"
        )
    }

    fn panel(&self, sweep: Sweep) -> ChartPanel {
        let base = &self.effort.base;
        let (triangles, samples, blur) = (
            format!("{} triangles", base.triangles),
            format!("{} samples a pixel", base.samples),
            format!("blur {} px", base.blur_px),
        );
        let (across, title) = match sweep {
            Sweep::Triangles => ("triangles", format!("{samples}, {blur}")),
            Sweep::Samples => ("samples a pixel", format!("{triangles}, {blur}")),
            Sweep::Blur => ("motion or circle of confusion (px)", format!("{triangles}, {samples}")),
        };
        let scale = if sweep == Sweep::Triangles { Scale::Decades } else { Scale::Doublings };
        let curves = Kind::ALL.map(|kind| self.curve(sweep, kind)).into();
        ChartPanel::new(&title, [across, "CPU time (ms)"], curves).on(scale, Scale::Decades)
    }

    /// A curve without points where there is none, so that the others keep their colours.
    fn curve(&self, sweep: Sweep, kind: Kind) -> Series {
        let row = self.rows.iter().find(|row| row.sweep == sweep && row.kind == kind);
        let points = row.iter().flat_map(|row| &row.points);
        let note = row.and_then(|row| row.exponent).map_or(String::new(), |p| format!("{p:.2}"));
        Series {
            note,
            ..Series::curve(kind.name(), points.map(|point| (sweep.of(point), 1e3 * point.cpu_s)))
        }
    }

    fn csv(&self, out: &mut (dyn std::io::Write + Send)) -> Result<(), BoxError> {
        // Names of fields are written here: a row is more than a struct.
        let mut table = csv::WriterBuilder::new().has_headers(false).from_writer(out);
        table.write_record([
            "sweep",
            "kind",
            "exponent",
            "fitted_from",
            "triangles",
            "samples_per_pixel",
            "motion_px",
            "defocus_px",
            "cpu_s",
            "sample_tests",
            "hits",
        ])?;
        for row in &self.rows {
            for point in &row.points {
                table.serialize((row.sweep, row.kind, row.exponent, row.fitted_from, point))?;
            }
        }
        Ok(table.flush()?)
    }
}

impl Row {
    /// A row of the table.
    fn cells(&self) -> [String; 7] {
        let shown = |exponent: Option<f64>| exponent.map_or("-".to_owned(), |p| format!("{p:.2}"));
        let across = |x: f64| format!("{x:.0}");
        let fitted = self.points.iter().map(|point| self.sweep.of(point)).filter(|x| *x >= self.fitted_from);
        let ends = fitted.clone().reduce(f64::min).zip(fitted.reduce(f64::max));
        let ms = |point: Option<&super::Point>| {
            point.map_or("-".to_owned(), |point| format!("{:.2}", 1e3 * point.cpu_s))
        };
        [
            self.sweep.name().to_owned(),
            self.kind.name().to_owned(),
            shown(self.exponent),
            shown(self.tests_exponent),
            ends.map_or("-".to_owned(), |(low, high)| format!("{} to {}", across(low), across(high))),
            ms(self.points.first()),
            ms(self.points.last()),
        ]
    }
}
