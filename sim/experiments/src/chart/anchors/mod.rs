//! `quintile chart anchors`: rates of the model beside those that others measured on parts. GPU files of the parts are in
//! `sim/experiments/parts`; they were written from data sheets before the first rate was looked at.

mod passes;
mod published;

use output::OutputError;
use output::progress::Progress;
use rayon::prelude::*;
use serde::Serialize;

use super::statistics::quantiles;
use crate::study::table::{Sheet, Table, plain};
use crate::study::{Gallery, Study, StudyError};
use published::{PUBLISHED, Published};

/// Largest median and single error that are aimed at, percent.
const MEDIAN_PERCENT: f64 = 10.0;
const WORST_PERCENT: f64 = 30.0;

/// Effort.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct AnchorsEffort {
    /// Width of the images in pixels, and height of the lower one of two.
    pub size: [u32; 2],
}

/// A rate beside the published one.
#[derive(Clone, Debug, Serialize)]
pub struct AnchorRow {
    /// The part.
    pub part: &'static str,
    /// What was done.
    pub quantity: &'static str,
    /// Unit of both rates.
    pub unit: String,
    /// The published rate.
    pub measured: f64,
    /// The rate of the model at the level `stepped`.
    pub ours: f64,
    /// Relative error of ours.
    pub error_percent: f64,
    /// The unit that has most to do.
    pub limit: &'static str,
    /// Whether the GPU file has the published number, which then tests nothing.
    pub is_input: bool,
    /// Who published it.
    pub source: &'static str,
}

/// The whole chart.
#[derive(Clone, Debug, Serialize)]
pub struct AnchorsChart {
    /// Effort.
    pub effort: AnchorsEffort,
    /// Median of the errors of rates that are no input, without sign.
    pub median_percent: f64,
    /// The largest of them.
    pub worst_percent: f64,
    /// Worst first; inputs last.
    pub rows: Vec<AnchorRow>,
}

impl Study for AnchorsChart {
    const NAME: &'static str = "anchors";
    const ABOUT: &'static str = "Rates of fill, texels and triangles beside those measured on parts";
    const PICTURES: &'static [&'static str] = &[];
    const FILES: &'static [&'static str] = &["anchors.csv", "anchors.json"];

    type Effort = AnchorsEffort;
    const FULL: AnchorsEffort = AnchorsEffort { size: [1024, 1024] };
    const QUICK: AnchorsEffort = AnchorsEffort { size: [512, 512] };

    fn measure(effort: AnchorsEffort, _: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let bar = progress.bar("rates", PUBLISHED.len() as u64);
        let row = |published: &Published| {
            let row = AnchorRow::new(published, effort);
            bar.inc();
            row
        };
        let mut rows: Vec<AnchorRow> = PUBLISHED.par_iter().map(row).collect::<Result<_, _>>()?;
        rows.sort_by(|a, b| {
            a.is_input.cmp(&b.is_input).then(b.error_percent.abs().total_cmp(&a.error_percent.abs()))
        });
        let tested = rows.iter().filter(|row| !row.is_input);
        let [median_percent, worst_percent] = {
            let error = quantiles(tested.map(|row| row.error_percent.abs()));
            [0.5, 1.0].map(error)
        };
        Ok(Self { effort, median_percent, worst_percent, rows })
    }

    fn draw(&self, _: &Gallery<'_>) -> Result<(), OutputError> {
        Ok(())
    }

    fn tables(&self) -> Vec<Sheet> {
        let verdict = |name, percent, bar| {
            let word = if percent <= bar { "met" } else { "missed" };
            format!("{name} {percent:.1} % (goal {bar} %: {word})")
        };
        let median = verdict("median", self.median_percent, MEDIAN_PERCENT);
        let worst = verdict("worst", self.worst_percent, WORST_PERCENT);
        let rows = Table::of(&self.rows)
            .column("part", "part", |row| row.part, plain)
            .column("quantity", "quantity", |row| row.quantity, plain)
            .column("unit", "unit", |row| row.unit.clone(), plain)
            .column("measured", "measured", |row| row.measured, plain)
            .column("ours", "ours", |row| row.ours, |rate| format!("{rate:.3}"))
            .column("error_percent", "error", |row| row.error_percent, |error| format!("{error:+.1} %"))
            .column("limit", "limited by", |row| row.limit, plain)
            .column(
                "is_input",
                "input",
                |row| row.is_input,
                |is_input| if is_input { "input" } else { "" }.to_owned(),
            )
            .column("source", "source", |row| row.source, plain)
            .after(format!("\nwithout inputs: {median}, {worst}\n"))
            .csv("anchors.csv");
        vec![rows.sheet()]
    }
}

impl AnchorRow {
    fn new(published: &Published, effort: AnchorsEffort) -> Result<Self, StudyError> {
        let Published { part, quantity, value, unit, work, is_input, source } = *published;
        let gpu = part.gpu()?;
        let rate = work.rate(&gpu, effort.size)?;
        let ours = unit.of(rate.per_s, gpu.core_hz);
        Ok(Self {
            part: part.name(),
            quantity,
            unit: unit.name(),
            measured: value,
            ours,
            error_percent: 100.0 * (ours / value - 1.0),
            limit: rate.limit.name(),
            is_input,
            source,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::published::Part;
    use super::*;

    fn ours(part: Part, quantity: &str) -> f64 {
        let is_it = |published: &&Published| published.part == part && published.quantity == quantity;
        let published = PUBLISHED.iter().find(is_it).unwrap();
        AnchorRow::new(published, AnchorsChart::QUICK).unwrap().ours
    }

    /// The published numbers are in the test, so that neither side can drift.
    #[test]
    fn rates_are_near_those_of_the_parts() {
        for (part, quantity, measured, within) in [
            (Part::Hd7970, "blended fill, 4 x 16 bits", 13.33, 0.3),
            (Part::Gtx580, "fill, 4 x 8 bits", 23.3, 0.3),
            (Part::Sgx543Mp2, "texels", 890.1, 0.3),
        ] {
            let ours = ours(part, quantity);
            assert!((ours / measured - 1.0_f64).abs() < within, "{quantity}: {ours} of {measured}");
        }
    }

    /// The multiprocessors limit the card to 24.7 Gpixel/s; its ROPs could do 37.1.
    #[test]
    fn multiprocessors_limit_a_card_with_more_rops() {
        let filled = ours(Part::Gtx580, "fill, 4 x 8 bits");
        assert!(filled < 24.71, "{filled}");
    }
}
