//! Every row of a sweep as tables, files and pictures.

use serde::Serialize;
use workloads::stress::{Family, Size};

use super::choice::Choices;
use super::measure::Row;
use super::methods::METHODS;
use output::table::{Table, grouped};

/// Everything a sweep found out.
pub struct Report {
    /// The families swept.
    pub families: Vec<&'static Family>,
    /// How large their scenes are.
    pub size: Size,
    /// A row for each family, value and method, in this order.
    pub rows: Vec<Row>,
    /// `auto` against every fixed choice of tests.
    pub auto: Choices,
}

/// What goes into `summary.json`.
#[derive(Serialize)]
pub struct Summary<'a> {
    /// Samples lost over all rows: must be none.
    pub samples_lost: u64,
    /// Boxes over all rows that leave out what truly touches: must be none.
    pub pairs_wrong: u64,
    /// Side of the images in pixels.
    pub side_px: u32,
    /// `auto` against the best fixed choice of tests.
    pub auto: &'a Choices,
    /// Every row.
    pub rows: &'a [Row],
}

impl Report {
    /// What goes into `summary.json`.
    pub fn summary(&self) -> Summary<'_> {
        Summary {
            samples_lost: self.rows.iter().map(|row| row.samples_lost).sum(),
            pairs_wrong: self.rows.iter().map(|row| row.intervals.pairs_wrong).sum(),
            side_px: self.size.side_px,
            auto: &self.auto,
            rows: &self.rows,
        }
    }

    /// Whether no method lost a sample and no box left anything out.
    pub fn is_clean(&self) -> bool {
        let summary = self.summary();
        summary.samples_lost == 0 && summary.pairs_wrong == 0
    }

    /// What to say where it is not.
    pub fn fault(&self) -> Option<&'static str> {
        let fault = "a test is not conservative: samples were lost or boxes are too small; please report it";
        (!self.is_clean()).then_some(fault)
    }

    /// The rows of one family.
    pub fn of(&self, family: &Family) -> impl Iterator<Item = &Row> + use<'_> {
        let name = family.name;
        self.rows.iter().filter(move |row| row.family == name)
    }

    /// The largest cost over the best of `method` on `family`; `first` looks at the harmless value only.
    pub fn over_best(&self, family: &Family, method: &str, first: bool) -> Option<f64> {
        let rows = self.of(family).filter(|row| row.method == method);
        rows.take(if first { 1 } else { usize::MAX }).map(|row| row.over_best).reduce(f64::max)
    }

    /// What is printed: every number of one family, or of many the costs at their worst values.
    pub fn text(&self) -> String {
        let table = match self.families[..] {
            [family] => format!("{}: {}\n\n{}", family.name, family.what, self.detail(family)),
            _ => format!(
                "Cost over that of the best method, at the worst value of each family.\n\n{}",
                self.overview()
            ),
        };
        let summary = self.summary();
        let rows = self.rows.len();
        format!(
            "{table}\n{} samples lost and {} boxes too small in {rows} sweeps of {} pixels a side\n{}",
            summary.samples_lost,
            summary.pairs_wrong,
            self.size.side_px,
            self.auto.text()
        )
    }

    fn overview(&self) -> Table {
        let mut table = Table::new(std::iter::once("family").chain(METHODS.map(|method| method.name)));
        for family in &self.families {
            let cost = |method: &str| {
                self.over_best(family, method, false).map_or("-".to_owned(), |over| format!("{over:.2}"))
            };
            let cells = METHODS.iter().map(|method| cost(method.name));
            table.row(std::iter::once(family.name.to_owned()).chain(cells));
        }
        table
    }

    fn detail(&self, family: &Family) -> Table {
        let header = [
            family.parameter,
            "method",
            "lost",
            "efficiency",
            "tile madds",
            "sample madds",
            "over best",
            "tiles kept",
            "true",
            "t width",
            "true",
            "u width",
            "true",
            "truth",
        ];
        let mut table = Table::new(header);
        for row in self.of(family) {
            let (work, boxes) = (&row.work, &row.intervals);
            let percent = |share: f64| format!("{:.1} %", 100.0 * share);
            table.row([
                row.value.to_string(),
                row.method.to_owned(),
                row.samples_lost.to_string(),
                work.efficiency().map_or("-".to_owned(), percent),
                grouped(work.tile_madds),
                grouped(work.sample_madds),
                format!("{:.2}", row.over_best),
                percent(boxes.pairs_kept as f64 / boxes.pairs.max(1) as f64),
                percent(boxes.pairs_touching as f64 / boxes.pairs.max(1) as f64),
                percent(boxes.t_width),
                percent(boxes.t_true),
                percent(boxes.u_width),
                percent(boxes.u_true),
                row.truth.to_owned(),
            ]);
        }
        table
    }
}
