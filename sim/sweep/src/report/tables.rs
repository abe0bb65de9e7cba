//! Tables of the report as CSV.

use std::io::{self, Write};

use serde::Serialize;

use super::Report;

/// Writes a table.
type Table<'a> = Box<dyn Fn(&mut dyn Write) -> io::Result<()> + 'a>;

impl Report {
    /// Tables by the names of their files.
    pub fn tables(&self) -> Vec<(&'static str, Table<'_>)> {
        vec![
            ("designs.csv", Box::new(|out| self.write_designs(out))),
            ("winners.csv", Box::new(|out| write_rows(&self.winners, out))),
            ("near_best.csv", Box::new(|out| write_rows(&self.near_best, out))),
            ("pairs.csv", Box::new(|out| write_rows(&self.pairs, out))),
            ("effects.csv", Box::new(|out| write_rows(&self.effects, out))),
            ("interactions.csv", Box::new(|out| write_rows(&self.interactions, out))),
            ("shares.csv", Box::new(|out| write_rows(&self.shares, out))),
        ]
    }

    /// Writes a row for each design: costs with their errors, ranks, frontier.
    ///
    /// # Errors
    /// The errors of `out`.
    fn write_designs(&self, out: impl Write) -> io::Result<()> {
        let mut csv = csv::Writer::from_writer(out);
        csv.write_record([
            "workload",
            "design",
            "runs",
            "time_s",
            "time_sd_s",
            "time_error",
            "energy_J",
            "energy_low_J",
            "energy_high_J",
            "energy_sd_J",
            "energy_error",
            "area_mm2",
            "on_frontier",
            "probability",
            "time_rank_best",
            "time_rank_worst",
            "energy_rank_best",
            "energy_rank_worst",
        ])?;
        let optional = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
        for (workload, designs) in &self.workloads {
            for rated in designs {
                let (time, energy) = (&rated.design.time_s, &rated.design.energy_j);
                csv.write_record([
                    workload.clone(),
                    rated.design.design.clone(),
                    rated.design.runs.to_string(),
                    time.value.to_string(),
                    time.deviation.to_string(),
                    time.error.to_string(),
                    energy.value.to_string(),
                    energy.low.to_string(),
                    energy.high.to_string(),
                    energy.deviation.to_string(),
                    energy.error.to_string(),
                    optional(rated.design.area_mm2),
                    u8::from(rated.on_frontier).to_string(),
                    optional(rated.probability),
                    rated.time_ranks[0].to_string(),
                    rated.time_ranks[1].to_string(),
                    rated.energy_ranks[0].to_string(),
                    rated.energy_ranks[1].to_string(),
                ])?;
            }
        }
        csv.flush()
    }
}

/// Writes a table whose columns are the fields of its rows.
///
/// # Errors
/// The errors of `out`.
fn write_rows<T: Serialize>(rows: &[T], out: impl Write) -> io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    rows.iter().try_for_each(|row| csv.serialize(row))?;
    csv.flush()
}
