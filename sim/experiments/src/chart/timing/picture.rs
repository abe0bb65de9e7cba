//! Speed against accuracy of all levels in one picture.

use output::plot::{Chart, ChartPanel, Paint, Picture, PlotMark, PlotStyle, Series, SpreadPoint};
use timing::Level;

use super::animations::SAMPLED;
use super::{TimingChart, TimingRow};
use crate::chart::quantiles;
use crate::study::tradeoff::front;

/// The levels from the most exact to the fastest, in the order of their colours.
const LEVELS: [&str; 4] = [Level::Stepped.name(), Level::Packet.name(), Level::Bound.name(), SAMPLED];

/// A point: host time over that of the reference, and the size of the error of cycles in percent.
type Point = (f64, f64);

impl TimingChart {
    /// Error of cycles over host time, both against the reference: filled for animations simulated whole,
    /// hollow for the timing of single frames alone. The frontier is that of the medians of animations, which
    /// are the same for all levels.
    pub(super) fn picture(&self, plot_style: &PlotStyle) -> Picture {
        let mut series = vec![
            Series::new("frontier of the medians", PlotMark::Steps(self.frontier())).painted(Paint::Ink),
        ];
        for (index, level) in LEVELS.into_iter().enumerate() {
            let unnamed =
                |points: Vec<Point>| points.into_iter().map(|(x, y)| (x, y, String::new())).collect();
            let of_frames = unnamed(self.frames_at(level));
            let of_animations = unnamed(self.animations_at(level));
            series.push(Series::new("", PlotMark::Rings(of_frames)).painted(Paint::Like(index)));
            series.push(Series::new("", PlotMark::Dots(of_animations)).painted(Paint::Like(index)));
        }
        for (index, level) in LEVELS.into_iter().enumerate() {
            let spread = spread(&self.animations_at(level), level);
            series.push(
                Series::new("", PlotMark::Spreads(spread.into_iter().collect())).painted(Paint::Like(index)),
            );
        }
        // Keys of what markers mean, whatever their colour.
        let key = |name: &str, mark| Series::new(name, mark).painted(Paint::Ink);
        series.push(key("an animation, drawn and timed", PlotMark::Dots(Vec::new())));
        series.push(key("a frame, timing alone", PlotMark::Rings(Vec::new())));
        series.push(key("median and middle half of animations", PlotMark::Spreads(Vec::new())));
        let axes = ["host time relative to stepped", "error of cycles against stepped (%)"];
        let frames = self.animations.first().map_or(0, |row| row.frames);
        let subject = format!(
            "animations of {frames} frames and single frames, each on all built-in GPUs; lower and further left is better. Errors of \
             animations, median (middle half, number of points): {}",
            self.medians()
        );
        let panels = vec![ChartPanel::new("", axes, series).zeros(["", "exact"])];
        Chart::new("Speed against accuracy of the levels of timing", &subject, panels).picture(plot_style)
    }

    /// Single frames at a level, their packets given; none for the reference, with which they are compared.
    fn frames_at(&self, level: &str) -> Vec<Point> {
        let rows = self.rows.iter().filter(|row| row.level.name() == level);
        rows.map(|row: &TimingRow| (1.0 / row.speedup_over_stepped, row.cycle_error_percent.abs())).collect()
    }

    /// Animations at a level, those of every seed.
    fn animations_at(&self, level: &str) -> Vec<Point> {
        let rows = self.animations.iter().filter(|row| row.level == level);
        rows.map(|row| (row.relative_host, row.cycle_error_percent.abs())).collect()
    }

    /// The error of every level but the reference, with its middle half and the number of points that it is
    /// the median of.
    fn medians(&self) -> String {
        let one = |level: &&str| {
            let points = self.animations_at(level);
            let SpreadPoint { at, up, .. } = spread(&points, level)?;
            let (median, [low, high]) = (at.1, up);
            Some(format!("{level} {median:.3} % ({low:.3} to {high:.3} %, {})", points.len()))
        };
        let medians: Vec<String> = LEVELS.iter().skip(1).filter_map(one).collect();
        medians.join("; ")
    }

    /// Medians of animations that no other level beats in host time and in error at once, from the fastest on.
    fn frontier(&self) -> Vec<Point> {
        let medians =
            LEVELS.into_iter().filter_map(|level| Some(spread(&self.animations_at(level), level)?.at));
        let medians: Vec<Point> = medians.collect();
        let gains: Vec<Point> = medians.iter().map(|(host, error)| (*host, -error)).collect();
        let on_front = medians.into_iter().zip(front(&gains)).filter(|(_, on)| *on);
        let mut frontier: Vec<Point> = on_front.map(|(median, _)| median).collect();
        frontier.sort_by(|a, b| a.0.total_cmp(&b.0));
        frontier
    }
}

/// Median and the ends of the middle half of both.
fn spread(points: &[Point], level: &str) -> Option<SpreadPoint> {
    points.first()?;
    let (x, y) =
        (quantiles(points.iter().map(|point| point.0)), quantiles(points.iter().map(|point| point.1)));
    let name = level.to_owned();
    Some(SpreadPoint { at: (x(0.5), y(0.5)), across: [x(0.25), x(0.75)], up: [y(0.25), y(0.75)], name })
}

#[cfg(test)]
mod tests {
    use super::super::{AnimationRow, Reference};
    use super::*;

    fn chart(levels: [(&'static str, &[Point]); 4]) -> TimingChart {
        let rows = levels.iter().flat_map(|(level, points)| {
            points.iter().map(|(relative_host, cycle_error_percent)| AnimationRow {
                scene: "scene".to_owned(),
                gpu: "gpu".to_owned(),
                level,
                seed: None,
                frames: 100,
                simulated: 100,
                cycle_error_percent: *cycle_error_percent,
                cpu_s: 1.0,
                relative_host: *relative_host,
            })
        });
        TimingChart {
            quick: true,
            levels: std::collections::BTreeMap::new(),
            reference: Reference { unit_cycles_per_s: 1.0, cycles_per_s: 1.0, cpu_s: 1.0 },
            animations: rows.collect(),
            rows: Vec::new(),
            added: Vec::new(),
            failures: Vec::new(),
            rates: Vec::new(),
        }
    }

    /// The picture before called the worst points the front.
    #[test]
    fn the_frontier_is_of_levels_that_no_other_beats() {
        let chart = chart([
            ("stepped", &[(1.0, 0.0), (1.0, 0.0), (1.0, 0.0)]),
            ("packet", &[(0.5, 0.02), (0.6, -0.1), (0.4, 5.0)]),
            ("bound", &[(0.45, 4.0), (0.46, -9.0), (0.4, 3.0)]),
            ("sampled", &[(0.05, 1.0), (0.06, -2.0), (0.07, 0.5)]),
        ]);
        assert_eq!(chart.frontier(), [(0.06, 1.0), (0.5, 0.1), (1.0, 0.0)], "sampled beats bound");
    }

    /// A median of six, and of one, is as good as its number of points and their spread.
    #[test]
    fn medians_are_shown_with_their_spread_and_the_number_of_points() {
        let six = [0.002, 0.006, 0.021, 0.126, 0.243, 0.753].map(|error| (0.5, error));
        let chart = chart([
            ("stepped", &[(1.0, 0.0)]),
            ("packet", &six),
            ("bound", &[(0.45, 4.0)]),
            ("sampled", &[(0.05, 1.0)]),
        ]);
        let expected = "packet 0.073 % (0.010 to 0.214 %, 6); bound 4.000 % (4.000 to 4.000 %, 1)";
        assert!(chart.medians().starts_with(expected), "{}", chart.medians());
        assert!((chart.frontier()[1].1 - 0.0735).abs() < 1e-12, "{:?}", chart.frontier());
        assert!(chart.picture(&PlotStyle::default()).svg().unwrap().contains("(0.010"));
    }

    #[test]
    fn all_levels_are_named_in_one_panel_and_exact_ones_are_there() {
        let chart = chart([
            ("stepped", &[(1.0, 0.0)]),
            ("packet", &[(0.5, 0.02)]),
            ("bound", &[(0.45, 4.0)]),
            ("sampled", &[(0.05, 1.0)]),
        ]);
        for width_mm in [None, Some(85.0)] {
            let svg = chart.picture(&PlotStyle { width_mm, ..PlotStyle::default() }).svg().unwrap();
            for word in
                LEVELS.into_iter().chain(["exact", "frontier of the medians", "a frame, timing alone"])
            {
                assert!(svg.contains(word), "{word}");
            }
            assert!(!svg.contains("without room"));
        }
    }
}
