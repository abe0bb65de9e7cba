//! `quintile chart compute`: cost of programs of groups over the size of groups, the layout of shared memory
//! and the contention of atomics, and error over cost where they approximate.

mod measure;

use output::OutputError;
use output::plot::{ChartPanel, PlotMark, Scale, Series};
use output::terminal::Progress;
use serde::Serialize;

use crate::study::table::{Sheet, TableBuilder, count, fixed, optional, percent, plain};
use crate::study::tradeoff::{Metric, TradeoffPoint};
use crate::study::{Gallery, Study, StudyError, each, groups};
use measure::{Bench, CHAIN_METHOD, Case};

/// How much is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ComputeEffort {
    /// Width and height of the image in pixels.
    pub size: (u32, u32),
}

/// What changes along a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ComputeSweep {
    /// Lanes of a group.
    Group,
    /// Words from the value of a lane to that of the next.
    Stride,
    /// Contrast of the image: at 0 all lanes count in one bin.
    Contrast,
    /// One pixel in so many along each axis is read.
    Step,
    /// Side of a tile in pixels.
    Tile,
}

impl ComputeSweep {
    const fn name(self) -> &'static str {
        match self {
            Self::Group => "group",
            Self::Stride => "stride",
            Self::Contrast => "contrast",
            Self::Step => "step",
            Self::Tile => "tile_px",
        }
    }
}

/// A method at a value.
#[derive(Clone, Debug, Serialize)]
pub struct ComputeRow {
    /// What changes.
    pub sweep: ComputeSweep,
    /// Value of the varied setting.
    pub value: f64,
    /// The method.
    pub method: &'static str,
    /// Cycles of the passes of the program, from the end of the pass before to the end of the last.
    pub cycles: f64,
    /// Energy of their events in joules.
    pub events_j: f64,
    /// Cycles of shared memory that banks lose, and atomics on a word of a buffer beyond the first of a warp.
    pub conflicts: u64,
    /// Error against the exact answer in percent, of methods that approximate: of the mean, of shares of the
    /// histogram (half of the sum of differences), and lights in lists that reach no sample of their tile.
    pub error_percent: Option<f64>,
    /// Codes of the warnings.
    pub warns: Vec<&'static str>,
}

/// The whole chart.
#[derive(Clone, Debug, Serialize)]
pub struct ComputeChart {
    /// How much was drawn.
    pub effort: ComputeEffort,
    /// A row for each sweep, method and value.
    pub rows: Vec<ComputeRow>,
}

impl Study for ComputeChart {
    const NAME: &'static str = "compute";
    const ABOUT: &'static str = "Groups of lanes: cost over group size, layout of shared memory, contention of atomics; error over cost";
    const PICTURES: &'static [&'static str] = &["compute", "compute_error"];
    const FILES: &'static [&'static str] = &["compute.csv", "compute.json"];

    type Effort = ComputeEffort;
    const FULL: ComputeEffort = ComputeEffort { size: (1280, 720) };
    const QUICK: ComputeEffort = ComputeEffort { size: (320, 180) };

    fn measure(effort: ComputeEffort, _: &[String], progress: &Progress) -> Result<Self, StudyError> {
        let cases = Case::all();
        let bench = Bench::new(effort.size)?;
        Ok(Self { effort, rows: each(&cases, ("programs", progress), |case| bench.row(case))? })
    }

    fn draw(&self, to: &Gallery<'_>) -> Result<(), OutputError> {
        let panels = vec![
            self.panel(ComputeSweep::Group, "lanes of a group", Scale::Doublings, None),
            self.panel(
                ComputeSweep::Stride,
                "words between the sums of lanes",
                Scale::Doublings,
                Some(16.0..32.0),
            ),
            self.panel(ComputeSweep::Contrast, "contrast of the image", Scale::Even, Some(0.0..0.02)),
        ];
        let [width, height] = [self.effort.size.0, self.effort.size.1];
        let subject =
            format!("passes of groups of a frame of {width} x {height} pixels on the GPU reference");
        to.chart("compute", ["Cost of programs of groups", &subject], panels)?;
        let errors = vec![
            self.error_panel(ComputeSweep::Step, "error (%)"),
            self.error_panel(ComputeSweep::Tile, "wasted lights (%)"),
        ];
        to.chart("compute_error", ["Error over cost of programs of groups", &subject], errors)
    }

    fn tables(&self) -> Vec<Sheet> {
        let rows = TableBuilder::of(&self.rows)
            .column("sweep", "sweep", |row| row.sweep.name(), plain)
            .column("value", "value", |row| row.value, plain)
            .column("method", "method", |row| row.method, plain)
            .column("cycles", "cycles", |row| row.cycles, |cycles| count(cycles.round() as u64))
            .column("events_j", "events (uJ)", |row| row.events_j, |joules| fixed(2)(1e6 * joules))
            .column("conflicts", "conflicts", |row| row.conflicts, |conflicts: u64| count(conflicts))
            .column("error_percent", "error", |row| row.error_percent, optional(percent(3)))
            .column("warns", "warns", |row| row.warns.join(" "), plain)
            .csv("compute.csv");
        vec![rows.sheet()]
    }

    fn tradeoff(&self) -> Vec<TradeoffPoint> {
        let point = |row: &ComputeRow| {
            let error = Metric::new(row.error_name(), "%", row.error_percent?).beside(0.0);
            let cost = Metric::new("cycles of the program", "", row.cycles);
            let level = format!("{} {}", row.sweep.name(), row.value);
            Some(TradeoffPoint::new(row.subject(), [row.method, &level], [error, cost]))
        };
        self.rows.iter().filter_map(point).collect()
    }

    /// Where all lanes of a warp wait for each other, the program says so.
    fn fault(&self) -> Option<String> {
        let silent = self.rows.iter().find(|row| row.is_broken() && row.warns.is_empty())?;
        let ComputeRow { sweep, value, method, .. } = silent;
        Some(format!("{method} at {} {value} puts all lanes in line, and does not warn", sweep.name()))
    }
}

impl ComputeRow {
    fn subject(&self) -> &'static str {
        match (self.sweep, self.method) {
            (ComputeSweep::Tile, _) => "lights of tiles",
            (_, "reduction" | CHAIN_METHOD) => "mean luminance",
            _ => "histogram of luminance",
        }
    }

    fn error_name(&self) -> &'static str {
        match (self.sweep, self.method) {
            (ComputeSweep::Tile, _) => "lights in lists that reach nothing",
            (_, "reduction" | CHAIN_METHOD) => "error of the mean luminance",
            _ => "wrong shares of the histogram",
        }
    }

    /// Whether all lanes of a warp are on one bin, or on one bank.
    fn is_broken(&self) -> bool {
        let one_bin =
            self.sweep == ComputeSweep::Contrast && self.value == 0.0 && !self.method.contains("padded");
        let one_bank =
            self.sweep == ComputeSweep::Stride && self.value == 32.0 && self.method == "sequential";
        one_bin || one_bank
    }
}

impl ComputeChart {
    /// A series for the rows of each method of a sweep.
    fn methods(&self, sweep: ComputeSweep, mark: impl Fn(Vec<&ComputeRow>) -> PlotMark) -> Vec<Series> {
        let of_sweep = self.rows.iter().filter(|row| row.sweep == sweep);
        let methods = groups(of_sweep, |a, b| a.method == b.method).into_iter();
        methods.map(|rows| Series::new(rows[0].method, mark(rows))).collect()
    }

    fn panel(
        &self,
        sweep: ComputeSweep,
        across: &str,
        scale: Scale,
        failing: Option<std::ops::Range<f64>>,
    ) -> ChartPanel {
        let curve = |rows: Vec<&ComputeRow>| {
            PlotMark::Curve(rows.iter().map(|row| (row.value, row.cycles)).collect())
        };
        let panel = ChartPanel::new("", [across, "cycles"], self.methods(sweep, curve));
        panel.on(scale, Scale::Decades).failing(failing, "fails")
    }

    fn error_panel(&self, sweep: ComputeSweep, up: &str) -> ChartPanel {
        let point = |row: &ComputeRow| Some((row.cycles, row.error_percent?, row.value.to_string()));
        let dots = |rows: Vec<&ComputeRow>| PlotMark::Dots(rows.into_iter().filter_map(point).collect());
        ChartPanel::new("", ["cycles", up], self.methods(sweep, dots)).on(Scale::Decades, Scale::FromZero)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::written;

    #[test]
    fn conflicts_cost_cycles_and_exact_methods_have_no_error() {
        let (_folder, chart, done) = written::<ComputeChart>(ComputeEffort { size: (96, 54) });
        assert_eq!(done.fault, None);
        let row = |sweep: ComputeSweep, method: &str, value: f64| {
            let is_it = |row: &&ComputeRow| row.sweep == sweep && row.method == method && row.value == value;
            chart.rows.iter().find(is_it).unwrap()
        };
        let [one, many] = [1.0, 32.0].map(|stride| row(ComputeSweep::Stride, "sequential", stride));
        assert!(one.conflicts == 0 && many.conflicts > 0 && many.cycles > one.cycles, "{one:?} {many:?}");
        assert_eq!(row(ComputeSweep::Stride, "sequential, padded", 32.0).conflicts, 0);
        let [spread, flat] = [1.0, 0.0].map(|contrast| row(ComputeSweep::Contrast, "global", contrast));
        assert!(
            flat.conflicts > spread.conflicts && flat.warns == ["atomic-contention"],
            "{spread:?} {flat:?}"
        );
        for method in ["reduction", "histogram"] {
            assert_eq!(row(ComputeSweep::Step, method, 1.0).error_percent, Some(0.0), "{method}");
            assert!(row(ComputeSweep::Step, method, 8.0).error_percent > Some(0.0), "{method}");
            assert!(
                row(ComputeSweep::Step, method, 8.0).cycles < row(ComputeSweep::Step, method, 1.0).cycles
            );
        }
        let chain = row(ComputeSweep::Step, CHAIN_METHOD, 1.0);
        assert!(
            chain.cycles > 0.0 && chain.error_percent > Some(0.0),
            "odd sizes leave texels out: {chain:?}"
        );
        let [with, without] = ["depth bounds", "frustum"].map(|method| row(ComputeSweep::Tile, method, 16.0));
        assert!(with.error_percent < without.error_percent, "{with:?} {without:?}");
    }
}
