//! Tables of the report as CSV.

use std::io::{self, Write};

use serde::Serialize;

use super::Report;

/// Writes a table.
type Table<'a> = Box<dyn Fn(&mut dyn Write) -> io::Result<()> + 'a>;

impl Report {
    /// Tables by the names of their files.
    pub(super) fn tables(&self) -> Vec<(&'static str, Table<'_>)> {
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
            "warnings",
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
                    rated.design.warnings.join(","),
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
fn write_rows<T: Serialize + Default>(rows: &[T], mut out: impl Write) -> io::Result<()> {
    if rows.is_empty() {
        // The names come with a row.
        let mut csv = csv::Writer::from_writer(Vec::new());
        csv.serialize(T::default())?;
        let text = csv.into_inner().map_err(csv::IntoInnerError::into_error)?;
        return text.split_inclusive(|&byte| byte == b'\n').take(1).try_for_each(|line| out.write_all(line));
    }
    let mut csv = csv::Writer::from_writer(out);
    rows.iter().try_for_each(|row| csv.serialize(row))?;
    csv.flush()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{ReportOptions, exact};

    #[test]
    fn empty_tables_have_the_header_of_full_ones() {
        let texts = |report: &Report| -> Vec<String> {
            let text = |table: Table<'_>| {
                let mut bytes = Vec::new();
                table(&mut bytes).unwrap();
                String::from_utf8(bytes).unwrap()
            };
            report.tables().into_iter().map(|(_, table)| text(table)).collect()
        };
        let design = |a: &str, b: &str| exact(&[("gpu.a", a), ("gpu.b", b)], 1.0 + a.len() as f64, 1.0);
        let designs = vec![design("1", "1"), design("1", "2"), design("22", "1"), design("22", "2")];
        let full = Report::of_designs([("w".to_owned(), designs)].into(), ReportOptions::default());
        let (full, empty) = (texts(&full), texts(&Report::default()));
        for (full, empty) in full.iter().zip(&empty) {
            assert!(full.lines().count() > 1, "{full}");
            assert_eq!(format!("{}\n", full.lines().next().unwrap()), *empty);
        }
    }
}
