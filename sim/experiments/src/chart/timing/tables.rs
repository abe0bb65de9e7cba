//! The chart as files.

use std::fmt::Write as _;

use super::{Row, TimingChart};
use output::plot::Look;
use output::{Claim, OutDir, OutputError};

/// The files of the chart.
pub fn claim() -> Claim {
    Claim::new("chart timing").plots(["timing", "timing_failures"]).files([
        "timing.csv",
        "timing_points.csv",
        "timing_failures.csv",
        "timing.md",
        "timing.json",
    ])
}

impl TimingChart {
    /// Writes the picture with its points, the rows and the table of the book; `timing.json` comes last.
    ///
    /// # Errors
    /// Those of the folder.
    pub fn write(&self, dir: &OutDir, look: &Look) -> Result<(), OutputError> {
        self.picture(look).write(dir, "timing")?;
        self.write_points(dir)?;
        self.write_failures(dir, look)?;
        dir.write_file("timing.csv", |out| {
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
        dir.write_file("timing.md", |out| Ok(out.write_all(self.markdown().as_bytes())?))?;
        dir.write_json("timing.json", self)?;
        Ok(())
    }

    /// The points of the picture.
    fn write_points(&self, dir: &OutDir) -> Result<(), OutputError> {
        dir.write_file("timing_points.csv", |out| {
            let mut table = csv::Writer::from_writer(out);
            table.write_record([
                "kind",
                "scene",
                "gpu",
                "level",
                "seed",
                "relative_host_time",
                "cycle_error_percent",
            ])?;
            for row in &self.animations {
                let kind = ("animation, drawn and timed", &row.scene, &row.gpu, row.level, row.seed);
                table.serialize((kind, row.relative_host, row.cycle_error_percent))?;
            }
            for row in &self.rows {
                let seed: Option<u64> = None;
                let kind = ("frame, timing alone", &row.scene, &row.gpu, row.level.name(), seed);
                table.serialize((kind, 1.0 / row.speedup_over_stepped, row.cycle_error_percent))?;
            }
            Ok(table.flush()?)
        })?;
        Ok(())
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
