//! Streams that break levels, and rates, as picture and tables.

use std::fmt::Write as _;

use super::{FailureRow, RateRow, TimingChart};
use output::plot::{Look, Matrix, MatrixPanel, Picture};
use output::{OutDir, OutputError};
use timing::Level;

/// The levels that can fail.
const LEVELS: [Level; 2] = [Level::Packet, Level::Bound];

impl TimingChart {
    /// Writes the picture and the rows.
    pub(super) fn write_failures(&self, dir: &OutDir, look: &Look) -> Result<(), OutputError> {
        self.failure_picture(look).write(dir, "timing_failures")?;
        dir.write_file("timing_failures.csv", |out| {
            let mut table = csv::Writer::from_writer(out);
            table.write_record([
                "stream",
                "gpu",
                "stepped_cycles",
                "level",
                "cycle_error_percent",
                "energy_error_percent",
                "warns",
            ])?;
            for row in &self.failures {
                for (level, found) in &row.levels {
                    table.serialize((
                        (row.stream, &row.gpu, row.stepped_cycles, level),
                        (found.cycle_error_percent, found.energy_error_percent, found.warns.join(" ")),
                    ))?;
                }
            }
            Ok(table.flush()?)
        })?;
        Ok(())
    }

    /// Errors in cycles, a block for each level, streams by GPUs.
    fn failure_picture(&self, look: &Look) -> Picture {
        let mut gpus: Vec<&str> = Vec::new();
        let mut streams: Vec<&str> = Vec::new();
        for row in &self.failures {
            if !gpus.contains(&row.gpu.as_str()) {
                gpus.push(&row.gpu);
            }
            if !streams.contains(&row.stream) {
                streams.push(row.stream);
            }
        }
        let error = |gpu: &str, stream: &str, level: Level| {
            let row = self.failures.iter().find(|row| row.gpu == gpu && row.stream == stream)?;
            row.levels.get(level.name()).map(|found| found.cycle_error_percent.abs())
        };
        let panel = |level: Level| MatrixPanel {
            name: level.name(),
            rows: gpus
                .iter()
                .map(|&gpu| (gpu, streams.iter().map(|stream| error(gpu, stream, level)).collect()))
                .collect(),
        };
        Matrix {
            title: "Where levels of timing fail",
            subject: "error in cycles against stepped, in percent",
            scale: ["1 % and less", "32 % and more"],
            columns: streams.clone(),
            panels: LEVELS.map(panel).into(),
        }
        .picture(look)
    }

    /// The tables of the book.
    pub(super) fn failure_markdown(&self) -> String {
        let mut text = String::from("\n| stream | GPU | cycles | `packet` | `bound` | warns |");
        let asked: Vec<String> = self.failures.first().map_or(Vec::new(), |row| {
            row.chosen.iter().map(|chosen| format!(" {} % |", chosen.asked_percent)).collect()
        });
        text.push_str(&asked.concat());
        // Writing into a string cannot fail.
        let _ = writeln!(text, "\n|---|---|---|---|---|---|{}", "---|".repeat(asked.len()));
        self.failures.iter().for_each(|row| failure_line(&mut text, row));
        let _ = writeln!(text, "\n| rate | `stepped` | `packet` | `bound` | card |\n|---|---|---|---|---|");
        self.rates.iter().for_each(|row| rate_line(&mut text, row));
        text
    }
}

fn failure_line(text: &mut String, row: &FailureRow) {
    let error = |level: Level| row.levels.get(level.name()).map_or(0.0, |found| found.cycle_error_percent);
    let warns = row
        .levels
        .iter()
        .flat_map(|(level, found)| found.warns.iter().map(move |code| format!("`{code}` at `{level}`")));
    let [packet, bound] = LEVELS.map(error);
    let _ = write!(
        text,
        "| {} | `{}` | {} | {packet:+.1} % | {bound:+.1} % | {} |",
        row.stream,
        row.gpu,
        row.stepped_cycles,
        warns.collect::<Vec<_>>().join(", ")
    );
    let chosen: String = row.chosen.iter().map(|chosen| format!(" `{}` |", chosen.level.name())).collect();
    let _ = writeln!(text, "{chosen}");
}

fn rate_line(text: &mut String, row: &RateRow) {
    let of = |level: Level| row.giga_per_s.get(level.name()).copied().unwrap_or(0.0);
    let [stepped, packet, bound] = Level::ALL.map(of);
    let _ = writeln!(
        text,
        "| {} | {stepped:.1} G{} | {packet:.1} | {bound:.1} | {} |",
        row.rate, row.unit, row.card
    );
}
