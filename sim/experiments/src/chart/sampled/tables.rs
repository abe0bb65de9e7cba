//! The chart as files.

use std::fmt::Write as _;

use super::{QUANTITIES, SampledChart, Trial};
use output::plot::{AxisSpec, Chart, ChartPanel, Look, Mark, Paint, Picture, Series};
use output::{Claim, OutDir, OutputError};

/// The files of the chart.
pub fn claim() -> Claim {
    Claim::new("chart sampled").plots(["sampled"]).files(["sampled.csv", "sampled.md", "sampled.json"])
}

impl SampledChart {
    /// Writes the picture, every trial and the tables of the book; `sampled.json` comes last.
    ///
    /// # Errors
    /// Those of the folder.
    pub fn write(&self, dir: &OutDir, look: &Look) -> Result<(), OutputError> {
        self.picture(look).write(dir, "sampled")?;
        dir.write_file("sampled.csv", |out| {
            let mut table = csv::Writer::from_writer(out);
            table.write_record([
                "scene",
                "seed",
                "simulated",
                "quantity",
                "truth",
                "value",
                "low",
                "high",
                "error_percent",
                "half_width_percent",
                "inside",
            ])?;
            for t in &self.trials {
                table.serialize((
                    (&t.scene, t.seed, t.simulated, t.quantity, t.truth, t.value),
                    (t.interval, t.error_percent, t.half_width_percent, t.inside),
                ))?;
            }
            Ok(table.flush()?)
        })?;
        dir.write_file("sampled.md", |out| Ok(out.write_all(self.markdown().as_bytes())?))?;
        dir.write_json("sampled.json", self)?;
        Ok(())
    }

    /// Errors over half-widths of intervals, a panel for each quantity.
    fn picture(&self, look: &Look) -> Picture {
        let axis =
            |name: &str| AxisSpec { name: name.to_owned(), zero: "exact".to_owned(), ..AxisSpec::default() };
        let panel = |quantity: &'static str| {
            let trials: Vec<&Trial> = self.trials.iter().filter(|trial| trial.quantity == quantity).collect();
            let widths = || trials.iter().map(|trial| trial.half_width_percent).filter(|width| *width > 0.0);
            let ends = [widths().reduce(f64::min), widths().reduce(f64::max)];
            let equal = ends.into_iter().flatten().map(|width| (width, width)).collect();
            let mut series =
                vec![Series::new("error as large as the half-width", Mark::Line(equal)).painted(Paint::Ink)];
            for (number, trials) in trials.chunk_by(|a, b| a.scene == b.scene).enumerate() {
                let dot =
                    |trial: &&Trial| (trial.half_width_percent, trial.error_percent.abs(), String::new());
                let dots = Mark::Dots(trials.iter().map(dot).collect());
                series.push(Series::new(&trials[0].scene, dots).painted(Paint::Like(number)));
            }
            ChartPanel::over(
                quantity,
                [axis("half-width of the 95 % interval (%)"), axis("error (%)")],
                series,
            )
        };
        let subject = "each point a choice of representatives; the truth is inside the interval of those below the line";
        Chart::new("Frames predicted from few", subject, QUANTITIES.into_iter().map(panel).collect())
            .picture(look)
    }

    /// The tables of the book.
    fn markdown(&self) -> String {
        let mut text = String::new();
        // Writing into a string cannot fail.
        let _ = writeln!(
            text,
            "| quantity | trials | truth inside | error: median | 95 % | worst | half-width: median |"
        );
        let _ = writeln!(text, "|---|---|---|---|---|---|---|");
        for f in &self.figures {
            let _ = writeln!(
                text,
                "| {} | {} | {:.1} % | {:.2} % | {:.2} % | {:.2} % | {:.2} % |",
                f.quantity,
                f.trials,
                f.inside_percent,
                f.error_median_percent,
                f.error_p95_percent,
                f.error_worst_percent,
                f.half_width_median_percent
            );
        }
        let _ = writeln!(text, "\n| animation | frames | simulated | host: all | sampled | times less |");
        let _ = writeln!(text, "|---|---|---|---|---|---|");
        for c in &self.costs {
            let _ = writeln!(
                text,
                "| {} | {} | {} | {:.1} s | {:.1} s | {:.1} |",
                c.scene, c.frames, c.simulated, c.all_s, c.sampled_s, c.times_faster
            );
        }
        text
    }
}
