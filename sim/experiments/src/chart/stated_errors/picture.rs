//! Errors over how far a GPU is from home, over its memory channels, and over how dense packets are.

use output::plot::{AxisSpec, ChartPanel, Mark, Paint, Scale, Series};
use run::StatedError;
use timing::Level;

use super::{ErrorRow, LEVELS, StatedErrorsChart};

/// What errors are shown over: name, scale, and its value.
type Quantity = (&'static str, Scale, fn(&ErrorRow) -> f64);

const ACROSS: [Quantity; 3] = [
    ("distance from the reference GPU (RMS of log2)", Scale::Even, |row| row.distance),
    ("memory channels", Scale::Even, |row| f64::from(row.channels)),
    ("packets per cycle", Scale::Decades, |row| row.packets_per_cycle),
];

impl StatedErrorsChart {
    /// A row of panels for each level.
    pub(super) fn panels(&self) -> Vec<ChartPanel> {
        LEVELS.into_iter().flat_map(|level| ACROSS.map(|across| self.panel(level, across))).collect()
    }

    fn panel(&self, level: Level, (name, scale, of): Quantity) -> ChartPanel {
        let rows = || self.rows.iter().filter(|row| row.level == level);
        let points = |warned: bool| {
            let rows = rows().filter(|row| row.is_warned() == warned);
            rows.map(|row| (of(row), 100.0 * row.cycles_log.abs(), String::new())).collect()
        };
        let ends = rows().map(of).fold([f64::INFINITY, 0.0], |[low, high], x| [low.min(x), high.max(x)]);
        let stated = 100.0 * libm::log1p(StatedError::at(level, false).cycles);
        let line = ends.map(|x| (x, stated)).to_vec();
        let series = vec![
            Series::new("without a warning", Mark::Dots(points(false))).painted(Paint::Like(0)),
            Series::new("with a warning", Mark::Rings(points(true))).painted(Paint::Like(1)),
            Series::new("stated", Mark::Curve(line)).painted(Paint::Ink),
        ];
        let across = AxisSpec { name: name.to_owned(), scale, ..AxisSpec::default() };
        let up = AxisSpec {
            name: "error of cycles (%)".to_owned(),
            scale: Scale::Decades,
            zero: "exact".to_owned(),
            ..AxisSpec::default()
        };
        ChartPanel::over(level.name(), [across, up], series)
    }
}
