//! The chart as files.

use std::fmt::Write as _;

use super::{QUANTITIES, SampledChart};
use crate::output::plot::{Tradeoff, TradeoffPanel, TradeoffPoint};
use crate::output::{OutDir, OutputError};

/// Errors below this are drawn here: the axes are logarithmic.
const LEAST_PERCENT: f64 = 1e-3;

impl SampledChart {
    /// Writes the picture, every trial and the tables of the book; `sampled.json` comes last.
    ///
    /// # Errors
    /// Those of the folder.
    pub fn write(&self, dir: &OutDir) -> Result<(), OutputError> {
        dir.remove_stale("", "sampled", &["svg", "png", "csv", "json", "md"])?;
        self.picture().picture().write(dir, "sampled")?;
        dir.write_atomic("sampled.csv", |out| {
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
        dir.write_atomic("sampled.md", |out| Ok(out.write_all(self.markdown().as_bytes())?))?;
        dir.write_json("sampled.json", self)?;
        Ok(())
    }

    /// Errors over half-widths, a panel for each quantity.
    fn picture(&self) -> Tradeoff<'_> {
        let panel = |quantity: &'static str| {
            let trials = self.trials.iter().filter(|trial| trial.quantity == quantity);
            let points = trials.map(|trial| TradeoffPoint {
                label: format!("{} {}", trial.scene, trial.seed),
                x: trial.half_width_percent.max(LEAST_PERCENT),
                y: trial.error_percent.abs().max(LEAST_PERCENT),
                front: false,
            });
            TradeoffPanel { name: quantity, points: points.collect() }
        };
        Tradeoff {
            title: "Frames predicted from few",
            subject: "each dot a choice of representatives; the truth is inside where the error is below the half-width",
            x: "half-width of the 95 % interval, %",
            y: "error, %",
            panels: QUANTITIES.into_iter().map(panel).collect(),
        }
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
