//! The chart as files.

use std::fmt::Write as _;

use super::{Row, TimingChart};
use crate::output::plot::{Tradeoff, TradeoffPanel, TradeoffPoint};
use crate::output::{OutDir, OutputError};
use crate::timing::Level;

impl TimingChart {
    /// Writes the picture, the rows and the table of the book; `timing.json` comes last.
    ///
    /// # Errors
    /// Those of the folder.
    pub fn write(&self, dir: &OutDir) -> Result<(), OutputError> {
        dir.remove_stale("", "timing", &["svg", "png", "csv", "json", "md"])?;
        self.picture().picture().write(dir, "timing")?;
        self.write_failures(dir)?;
        dir.write_atomic("timing.csv", |out| {
            let mut table = csv::Writer::from_writer(out);
            table.write_record([
                "scene",
                "gpu",
                "level",
                "packets",
                "cycles",
                "stepped_cycles",
                "cycle_error_percent",
                "energy_error_percent",
                "busy_error_percent",
                "power_shape_error_percent",
                "busiest",
                "busiest_share",
                "host_s",
                "written_s",
                "speedup_over_stepped",
            ])?;
            for row in &self.rows {
                table.serialize((
                    (&row.scene, &row.gpu, row.level, row.packets, row.cycles, row.stepped_cycles),
                    (row.cycle_error_percent, row.energy_error_percent, row.busy_error_percent),
                    (row.power_shape_error_percent, row.busiest),
                    (row.host_s, row.written_s, row.speedup_over_stepped),
                ))?;
            }
            Ok(table.flush()?)
        })?;
        dir.write_atomic("timing.md", |out| Ok(out.write_all(self.markdown().as_bytes())?))?;
        dir.write_json("timing.json", self)?;
        Ok(())
    }

    /// Speed over error, a panel for each level.
    fn picture(&self) -> Tradeoff<'_> {
        let panel = |level: Level| {
            let rows = self.rows.iter().filter(|row| row.level == level);
            let points = rows.map(|row| TradeoffPoint {
                label: format!("{} {}", row.scene, row.gpu),
                x: row.cycle_error_percent.abs().max(1e-3),
                y: row.speedup_over_stepped,
                front: row.cycle_error_percent.abs() > 8.0,
            });
            TradeoffPanel { name: level.name(), points: points.collect() }
        };
        Tradeoff {
            title: "Levels of timing against the reference",
            subject: "each dot a scene on a GPU; named where the error is above 8 %",
            x: "error in cycles, %",
            y: "times as fast as stepped",
            panels: Level::ALL.into_iter().filter(|&level| level != Level::Stepped).map(panel).collect(),
        }
    }

    /// The tables of the book.
    fn markdown(&self) -> String {
        let mut text = String::new();
        // Writing into a string cannot fail.
        let _ = writeln!(
            text,
            "| level | cycles: median | 95 % | worst | energy: median | worst | power shape | times as fast: median | least | adds to a run: median | worst |"
        );
        let _ = writeln!(text, "|---|---|---|---|---|---|---|---|---|---|---|");
        for (name, f) in &self.levels {
            let _ = writeln!(
                text,
                "| `{name}` | {:.2} % | {:.2} % | {:.2} % | {:.2} % | {:.2} % | {:.2} % | {:.1} | {:.1} | {:.0} % | {:.0} % |",
                f.cycle_error_median_percent,
                f.cycle_error_p95_percent,
                f.cycle_error_worst_percent,
                f.energy_error_median_percent,
                f.energy_error_worst_percent,
                f.power_shape_error_percent,
                f.speedup_over_stepped,
                f.speedup_over_stepped_least,
                f.added_percent,
                f.added_worst_percent
            );
        }
        let _ =
            writeln!(text, "\n| scene | GPU | level | cycles | error | energy | busiest | times as fast |");
        let _ = writeln!(text, "|---|---|---|---|---|---|---|---|");
        self.rows.iter().for_each(|row| line(&mut text, row));
        text.push_str(&self.failure_markdown());
        text
    }
}

fn line(text: &mut String, row: &Row) {
    let (unit, share) = row.busiest;
    let _ = writeln!(
        text,
        "| {} | {} | `{}` | {} | {:+.2} % | {:+.2} % | {unit} {:.0} % | {:.1} |",
        row.scene,
        row.gpu,
        row.level.name(),
        row.stepped_cycles,
        row.cycle_error_percent,
        row.energy_error_percent,
        share * 100.0,
        row.speedup_over_stepped
    );
}
